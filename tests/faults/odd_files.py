#!/usr/bin/env python3
"""Promise: a pipe, a socket, a folder or a device where a file is asked for is refused at once, with its name, whichever
option names it; and wherever the program waits or works, SIGTERM ends it within two seconds.

  odd_files.py PROGRAM SMALL_RECORDING [--all]     without --all: pipes alone, and SIGTERM at fewer moments
"""
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

REFUSED_WITHIN_S = 10  # nothing is waited for: a busy machine's start-up
ENDS_WITHIN_S = 2
# What is read: {odd} stands for what is no file.
READS = [
    "run --replay {odd}",
    "run --replay {frames} --calibration {odd}",
    "run --replay {frames} --config {odd}",
    "run --replay {frames} --vocabulary {odd}",
    "run --replay {frames} --map-in {odd}",
    "run --replay {frames} --map {odd}",
    "run --simulate static_xyz:1 --frames 1 --map-in {odd}",
    "run --camera auto --calibration {odd}",
    "run --camera openni2:{odd} --calibration kinect",
    "eval --groundtruth {odd} --trajectory {frames}/groundtruth.txt",
    "eval --groundtruth {frames}/groundtruth.txt --trajectory {odd}",
    "rerun {odd} --replay {frames}",
    "rerun {record} --replay {odd}",
    "rerun {record} --replay {frames} --map-in {odd}",
    "rerun {record} --replay {frames} --vocabulary {odd}",
    "rerun {record} --replay {frames} --map-store {odd}",
    "capture --camera auto --out captured --calibration {odd}",
    "run --replay {frames} --mask {odd}",
    "run --replay {frames} --level gravity --accelerometer {odd}",
    "map info {odd}",
    "map export {odd} --ply points.ply",
    "map merge {odd} {odd} --out merged.map",
    "vocabulary info {odd}",
]
# What is written as a whole, as a folder, or kept open; a pipe takes lines, and a reader may come later.
WRITES = [
    "run --replay {frames} --map-out {odd}",
    "run --replay {frames} --map-store {odd}",
    "run --replay {frames} --record-frames {odd}",
    "run --replay {frames} --report {odd}",
    "simulate static_xyz --frames 1 --out {odd}",
    "vocabulary train --images {frames} --every 5 --levels 2 --out {odd}",
    "run --replay {frames} --trajectory {odd}",
    "run --replay {frames} --poses {odd}",
    "run --replay {frames} --trajectory-final {odd}",
    "run --replay {frames} --state-hashes {odd}",
    "run --replay {frames} --record {odd}",
]
# Files of a recording that may be something else: refused, or skipped with a sentence.
INSIDE = ["rgb.txt", "depth.txt", "groundtruth.txt", "camera.toml", "an image of colour", "an image of depth"]


class Odd:
    """Something under a file's name that is none."""

    def __init__(self, kind, path):
        self.kind, self.path, self.socket = kind, path, None
        if os.path.lexists(path):
            os.remove(path)
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "socket":
            self.socket = socket.socket(socket.AF_UNIX)
            here = os.getcwd()
            os.chdir(os.path.dirname(path))
            self.socket.bind(os.path.basename(path))
            os.chdir(here)
        elif kind == "folder":
            os.mkdir(path)
        elif kind == "device":
            os.symlink("/dev/zero", path)  # that never ends

    def is_there(self):
        return os.path.lexists(self.path) and not os.path.isfile(self.path)


def run(command, cwd, seconds):
    """Exit code, seconds and what was said; None for a program that did not end."""
    begin = time.monotonic()
    try:
        done = subprocess.run(command, cwd=cwd, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=seconds)
        return done.returncode, time.monotonic() - begin, done.stderr.decode(errors="replace")
    except subprocess.TimeoutExpired as over:
        return None, time.monotonic() - begin, (over.stderr or b"").decode(errors="replace")


def end_of(command, cwd, delay_s):
    """What SIGTERM makes of a program so many seconds after its start."""
    with subprocess.Popen(command, cwd=cwd, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as child:
        begin = time.monotonic()
        while time.monotonic() - begin < delay_s and child.poll() is None:
            time.sleep(0.002)
        child.send_signal(signal.SIGTERM)
        sent = time.monotonic()
        try:
            _, err = child.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            child.kill()
            return None, 20, ""
        return child.returncode, time.monotonic() - sent, err.decode(errors="replace")


def main():
    program, recorder = map(os.path.abspath, sys.argv[1:3])
    is_all = "--all" in sys.argv
    kinds = ("pipe", "socket", "folder", "device") if is_all else ("pipe",)
    failed = []

    def check(is_well, command, sentence):
        if not is_well:
            failed.append(command)
            print(f"FAILED {command}\n    {sentence}", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        frames, record, odd = (os.path.join(folder, name) for name in ("frames", "run.rec", "odd.oni"))
        subprocess.run([recorder, "static_xyz", "1", "0", "8", "160", "120", frames], check=True)
        subprocess.run([program, "run", "--replay", frames, "--record", record], check=True, cwd=folder,
                       stdout=subprocess.DEVNULL)
        fill = lambda words: [program] + [w.format(frames=frames, record=record, odd=odd) for w in words.split()]
        tried = 0
        for words in READS + WRITES:
            for kind in kinds:
                if os.path.isdir(odd) and not os.path.islink(odd):
                    shutil.rmtree(odd)
                thing = Odd(kind, odd)
                code, seconds, err = run(fill(words), folder, REFUSED_WITHIN_S)
                tried += 1
                command = f"{words} ({kind})"
                takes_lines = words in WRITES[-5:] and kind in ("pipe", "device")
                takes_folders = (words in WRITES[1:5] or words.endswith("--map-store {odd}")) and kind == "folder"
                check(code is not None, command, f"waits: {err}")
                check(code is None or code >= 0, command, f"ended by signal {code}")
                check(takes_lines or takes_folders or code in (None, 2) or
                      words.endswith("--map {odd}") and code == 1, command, f"exit code {code}: {err}")
                check(takes_lines or takes_folders or os.path.basename(odd) in err, command, f"does not name it: {err}")
                check(thing.is_there(), command, "was replaced")
                if thing.socket:
                    thing.socket.close()
        if os.path.isdir(odd) and not os.path.islink(odd):
            shutil.rmtree(odd)
        for name in INSIDE:
            for kind in kinds:
                copy = os.path.join(folder, "copy")
                shutil.rmtree(copy, ignore_errors=True)
                shutil.copytree(frames, copy)
                side = "rgb" if "colour" in name else "depth"
                target = os.path.join(copy, name)
                if " " in name:
                    images = sorted(os.listdir(os.path.join(copy, side)))
                    target = os.path.join(copy, side, images[3])
                thing = Odd(kind, target)
                for words in ("run --replay {frames}", "rerun {record} --replay {frames}",
                              "vocabulary train --images {frames} --levels 2 --out words.bin"):
                    if "train" in words and side != "rgb" and name != "rgb.txt":
                        continue
                    command = [w.replace(frames, copy) for w in fill(words)]
                    code, seconds, err = run(command, folder, REFUSED_WITHIN_S)
                    tried += 1
                    check(code is not None, f"{words}: {name} a {kind}", "waits")
                    is_read = "run" == words[:3] or " " in name and "rerun" in words
                    check(not is_read or code in (None, 1, 2), f"{words}: {name} a {kind}", f"exit code {code}: {err}")
                if thing.socket:
                    thing.socket.close()
        print(f"{tried} commands with what is no file")
        # SIGTERM, from the start to the end.
        slow = {
            "starting": ("run --simulate walking_xyz:1 --map-out room.map --trajectory path.txt", (0.0, 0.02, 0.1, 0.3)),
            "running, saving all the time": ("run --simulate walking_xyz:1 --map-out room.map --map-every 0.1 --report report "
                                             "--trajectory-final final.txt", (1.5,)),
            "waiting for a camera": ("run --camera auto --wait", (0.3, 1.0)),
            "capturing": ("capture --camera auto --wait --out captured", (0.5,)),
            "rendering": ("simulate walking_xyz --out rendered", (0.5,)),
            "collecting images": ("vocabulary train --simulate walking_xyz:1-50 --out words.bin", (0.5,)),
            "growing a tree": ("vocabulary train --images {frames} --out words.bin --features 4000 --levels 8 --branching 20",
                               (0.8, 2.0)),
        }
        for where, (words, delays) in slow.items():
            for delay in delays if is_all else delays[-1:]:
                for name in ("rendered", "report", "captured"):
                    shutil.rmtree(os.path.join(folder, name), ignore_errors=True)
                code, seconds, err = end_of(fill(words), folder, delay)
                check(code is not None and seconds < ENDS_WITHIN_S, f"{words} ({where})", f"{seconds:.1f} s after SIGTERM: {err}")
                check(code in (143, -15, 2, 0, 1), f"{words} ({where})", f"exit code {code}: {err}")
                check(code in (143, -15) or "waiting" in where or "capturing" in where or "growing" in where,
                      f"{words} ({where})", f"exit code {code}: {err}")
    print(f"{len(failed)} not as promised")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
