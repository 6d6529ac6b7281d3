#!/usr/bin/env python3
"""Promise: however long the program runs, with every kind of fault in its pictures and with the service's own arguments, its
memory stays what it was after the first tenth, a frame takes what it took in the second, and the same pictures give the same
state.

  soak.py PROGRAM [--frames N] [--again N] [--width 160|640] [--inject SEED] [--scene NAME[:SEED]] [--json FILE]

A recording of 300 frames is shown forwards and backwards as often as it takes, under new times, with truth left out. Two programs
run side by side: one over all N frames, one over the first AGAIN (all, if not given), and their state hashes are compared,
window by window, a fiftieth of N each. Memory is what is resident without files; the time of a frame is the processor time of
the program, over that of a fixed piece of work done beside it in the same moments, since machines have their moods.
"""
import argparse
import hashlib
import itertools
import json
import os
import pathlib
import shlex
import statistics
import subprocess
import sys
import tempfile
import threading
import time

FRAMES_SHOWN = 300
WINDOWS = 50
MEMORY_GROWTH_MAX_KB = 2048  # from the first tenth to the end; a page of a library's buffer now and then is less
TIME_GROWTH_MAX = 1.1        # median of the last tenth over that of the second: in the first the map is still small
TRACKED_MIN = 0.98           # of the frames shown; faults of a camera spoil some beyond tracking
SERVICE = pathlib.Path(__file__).resolve().parents[2] / "packaging/stillmesh.default"


def forwards_and_backwards():
    return itertools.cycle([*range(FRAMES_SHOWN), *range(FRAMES_SHOWN - 2, 0, -1)])


def show_again_and_again(folder, frames):
    """The recording's lists, long enough for so many frames: faults leave some out."""
    for name in ("rgb", "depth"):
        lines = [line.split() for line in (folder / f"{name}.txt").read_text().splitlines() if line[:1] != "#"]
        files = [line[1] for line in lines]
        with open(folder / f"{name}.txt", "w", encoding="ascii") as out:
            for i, shown in zip(range(frames + frames // 4 + FRAMES_SHOWN), forwards_and_backwards()):
                out.write(f"{1 + i / 30:.6f} {files[shown]}\n")
    (folder / "groundtruth.txt").unlink()


def service_arguments(folder):
    """What the service is started with, but for its camera, its clock (of which nothing repeats) and where it writes."""
    line = next(line for line in SERVICE.read_text().splitlines() if line.startswith("STILLMESH_ARGUMENTS="))
    words = shlex.split(line.split("=", 1)[1])[0].split()
    for word, count in (("--camera", 2), ("--wait", 1), ("--realtime", 1), ("--config", 2)):
        at = words.index(word)
        del words[at:at + count]
    return [word.replace("/var/lib/stillmesh", str(folder)) for word in words]


def fixed_work_s():
    """Processor time of something that is always the same."""
    begin, data = time.thread_time(), bytes(1 << 20)
    for _ in range(16):
        data = hashlib.sha256(data).digest() * 32768
    return time.thread_time() - begin


class Program(threading.Thread):
    """One run, watched from beside: its state hashes through a pipe, and memory and time at the end of each window. What it says
    goes to files, so that it waits for nobody at its end."""

    def __init__(self, folder, command, window):
        super().__init__()
        folder.mkdir()
        self.window, self.folder = window, folder
        self.rows, self.digests, self.seen = [], [], 0
        self.hashes, far_end = os.pipe()  # ends with the program, whether it opened it or was refused
        command = [*command, "--state-hashes", f"/dev/fd/{far_end}", *service_arguments(folder)]
        with open(folder / "summary", "wb") as summary, open(folder / "said", "wb") as said:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=summary, stderr=said, pass_fds=[far_end],
                                            start_new_session=True)  # a Ctrl-C is passed on once
        os.close(far_end)
        self.start()

    def run(self):
        digest, before_s = hashlib.sha256(), 0.0
        with open(self.hashes, "rb") as lines:
            for line in lines:
                digest.update(line)
                self.seen += 1
                if self.seen % self.window:
                    continue
                self.digests.append(digest.hexdigest())
                memory_kb, spent_s = self.memory_kb(), self.spent_s()
                if memory_kb is not None:
                    self.rows.append((self.seen, memory_kb, 1e3 * (spent_s - before_s) / self.window, fixed_work_s()))
                before_s = spent_s
        self.process.wait()

    def memory_kb(self):
        """None: it has just ended."""
        lines = pathlib.Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        return next((int(line.split()[1]) for line in lines if line.startswith("RssAnon:")), None)

    def spent_s(self):
        words = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")

    def ended(self):
        """Waits; the summary."""
        self.join()
        if self.process.returncode not in (0, 1, 130, 143):
            said = (self.folder / "said").read_text(errors="replace")
            sys.exit(f"soak: the program ended with {self.process.returncode}: {said[-2000:]}")
        return json.loads((self.folder / "summary").read_text())


def watch(runs):
    """Prints each window of the first run as it ends; Ctrl-C ends both, and what there is counts."""
    told = 0
    while runs[0].is_alive():
        try:
            time.sleep(.5)
        except KeyboardInterrupt:
            for run in runs:
                run.process.terminate()
        for row in runs[0].rows[told:]:
            print("{:>8} frames  {:>7} kB  {:6.2f} ms a frame  {:.3f} s fixed work".format(*row), flush=True)
        told = len(runs[0].rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--again", type=int)
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--inject", type=int, help="faults, from a seed")
    parser.add_argument("--scene", default="sitting_xyz:1")
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    program = os.path.abspath(options.program)
    window = max(options.frames // WINDOWS, 1)
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as name:
        folder = pathlib.Path(name)
        recording = folder / "recording"
        subprocess.run([program, "simulate", options.scene, "--frames", str(FRAMES_SHOWN), "--width", str(options.width),
                        "--out", str(recording), "--json"], check=True, stdout=subprocess.DEVNULL)
        show_again_and_again(recording, options.frames)
        command = [program, "run", "--replay", str(recording), "--limits", "pocket", "--json"]
        command += ["--inject", str(options.inject)] if options.inject is not None else []
        again = min(options.again or options.frames, options.frames)
        again = min(again + window, options.frames)  # faults leave some out, and a window that is not full does not count
        runs = [Program(folder / name, [*command, "--frames", str(frames)], window)
                for name, frames in (("all", options.frames), ("again", again))]
        watch(runs)
        summaries = [run.ended() for run in runs]
    return judge(runs, summaries, options)


def judge(runs, summaries, options):
    rows = runs[0].rows
    if len(rows) < 20:
        sys.exit(f"soak: stopped after {runs[0].seen} frames, too few to judge by")
    tenth = len(rows) // 10
    grown_kb = rows[-1][1] - rows[tenth - 1][1]
    share = [ms / work for _, _, ms, work in rows]
    slower = statistics.median(share[-tenth:]) / statistics.median(share[tenth:2 * tenth])
    equal = sum(a == b for a, b in zip(runs[0].digests, runs[1].digests))
    states = {name: summaries[0][f"share_{name}"] for name in ("tracked", "unsure", "predicted", "none")}
    print(f"states: {states}; faults: {summaries[0]['faults']}")
    print(f"memory: {grown_kb:+} kB since the first tenth (at most {MEMORY_GROWTH_MAX_KB})")
    print(f"time: {slower:.3f} times that of the second tenth (at most {TIME_GROWTH_MAX})")
    print(f"state hashes: equal in {equal} of {len(runs[1].digests)} windows of {runs[0].window} frames")
    wrong = [what for what, is_wrong in (("memory", grown_kb > MEMORY_GROWTH_MAX_KB), ("time", slower > TIME_GROWTH_MAX),
                                         ("hashes", equal < len(runs[1].digests) or not equal),
                                         ("frames", runs[0].seen < TRACKED_MIN * options.frames)) if is_wrong]
    if options.json:
        options.json.write_text(json.dumps({"rows": rows, "grown_kb": grown_kb, "slower": slower, "states": states,
                                            "wrong": wrong}))
    if wrong:
        print(f"soak: failed: {', '.join(wrong)}; {runs[0].seen} of {options.frames} frames", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
