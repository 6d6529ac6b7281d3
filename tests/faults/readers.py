#!/usr/bin/env python3
"""Promise: whoever reads what a run gives out may die, sleep, be slow or never come, and the disk may be full at any write:
tracking goes on to its last frame and decides the same to the bit, and where anything was lost, it is said, counted and the exit
code 1. What slow readers got and what was said to be lost to them are together every line since they came. Of each kind of trouble so many seeds:

  readers.py PROGRAM SMALL_RECORDING [--seeds FIRST-LAST] [--jobs N]

Exit 77 where no small tmpfs may be mounted. A failing seed prints its kind and number.
"""
import argparse
import concurrent.futures
import json
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

FRAMES = 60
TIMEOUT_S = 120         # for hangs
LOST = re.compile(r"(\d+)(?: of \d+)? (?:lines|messages) ")


class Trouble:
    """A run with one kind of trouble around it: `options`, what happens while it goes on, and whether it may lose nothing."""
    may_lose_nothing = True
    frames = FRAMES

    def __init__(self, rng, folder):
        self.rng, self.folder = rng, folder
        self.options = []

    def path(self, name):
        return os.path.join(self.folder, name)

    def beside(self, run):
        """Runs in a thread of its own until the run is over."""

    def wrong(self):
        """What is wrong with what was read or written; empty: nothing."""
        return ""

    def miscounted(self, problems):
        """What is wrong with what the run says it has lost; empty: nothing."""
        del problems
        return ""


def whole_lines(data, name):
    """Each line but the last can be read alone."""
    for line in data.decode(errors="replace").split("\n")[:-1]:
        try:
            json.loads(line)
        except ValueError:
            return f"{name}: a line is torn: {line[:80]}"
    return ""


def connect(kind, address, run, room):
    """A socket of a reader, once the run listens; None: it is over. `room`: of its buffer and its segments; None: as it is."""
    while run.poll() is None:
        reader = socket.socket(kind)
        for level, name, value in ((socket.SOL_SOCKET, socket.SO_RCVBUF, room[0]), (socket.IPPROTO_TCP, socket.TCP_MAXSEG, room[1])):
            if value is not None:
                reader.setsockopt(level, name, value)
        try:
            reader.connect(address)
            return reader
        except OSError:
            reader.close()
            time.sleep(0.002)
    return None


class KilledReader(Trouble):
    """Processes that read a socket, killed after some time, one after the other."""
    CODE = "import socket, sys\ns = socket.socket(socket.AF_UNIX)\ns.connect(sys.argv[1])\nwhile s.recv(int(sys.argv[2])): pass\n"

    def __init__(self, rng, folder):
        super().__init__(rng, folder)
        self.options = ["--poses", "unix:" + self.path("s")]

    def beside(self, run):
        while run.poll() is None and not os.path.exists(self.path("s")):
            time.sleep(0.002)
        while run.poll() is None:
            reader = subprocess.Popen([sys.executable, "-c", self.CODE, self.path("s"), str(self.rng.choice((1, 100, 65536)))],
                                      stderr=subprocess.DEVNULL)
            time.sleep(self.rng.uniform(0, 0.15))
            reader.send_signal(signal.SIGKILL)
            reader.wait()


class FullDisk(Trouble):
    """What a run writes, on a disk of some hundred kilobytes, of which somebody else takes the rest at any moment."""
    may_lose_nothing = False
    OUTPUTS = [["--trajectory", "t"], ["--record", "r"], ["--map-out", "m", "--map-every", "0.1"], ["--trajectory-final", "f"],
               ["--report", "rep"], ["--record-frames", "frames"], ["--map-store", "store"]]

    def __init__(self, rng, folder):
        super().__init__(rng, folder)
        self.disk = self.path("disk")
        os.mkdir(self.disk)
        outputs = [["--poses", "p"]] + rng.sample(self.OUTPUTS, rng.randint(0, 5))
        size_k = rng.randint(16, 200) + (600 if self.OUTPUTS[-1] in outputs else 0)  # a store begins with some room, or not
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_k}k", "tmpfs", self.disk], check=True)
        for option, name, *more in outputs:
            self.options += [option, os.path.join(self.disk, name)] + more

    def beside(self, run):
        while run.poll() is None and not os.path.exists(self.disk + "/p"):
            time.sleep(0.002)
        time.sleep(self.rng.uniform(0, 0.2))
        with open(self.disk + "/full", "wb", buffering=0) as stream:
            try:
                while stream.write(b"x" * self.rng.choice((1, 100, 4096))):
                    pass
            except OSError:
                pass

    def wrong(self):
        text = b""
        if os.path.exists(self.disk + "/p"):
            with open(self.disk + "/p", "rb") as stream:
                text = stream.read()
        # A run that is over before the disk is full loses nothing.
        self.may_lose_nothing = text.count(b'"type":"pose"') == FRAMES
        subprocess.run(["umount", self.disk], check=True)
        return whole_lines(text, "poses")


class LonelyPipe(Trouble):
    """Named pipes without a reader, or with one that opens and never reads."""
    may_lose_nothing = False

    def __init__(self, rng, folder):
        super().__init__(rng, folder)
        self.reader = None
        os.mkfifo(self.path("fifo"))
        self.options = [rng.choice(("--poses", "--trajectory")), self.path("fifo")]
        if rng.random() < 0.5:
            os.mkfifo(self.path("other"))
            self.options += ["--poses", self.path("other")]

    def beside(self, run):
        if self.rng.random() < 0.5:
            time.sleep(self.rng.uniform(0, 0.3))
            self.may_lose_nothing = True  # 64 KiB go into the pipe
            self.reader = os.open(self.path("fifo"), os.O_RDONLY | os.O_NONBLOCK)

    def wrong(self):
        if self.reader is not None:
            os.close(self.reader)
        return ""


class BrokenPipe(Trouble):
    """Somebody reads some bytes of standard output and leaves."""
    may_lose_nothing = False

    def __init__(self, rng, folder):
        super().__init__(rng, folder)
        self.options = ["--poses", "-"]

    def beside(self, run):
        left = self.rng.choice((0, 1, 500, 5000, 20000))
        while left > 0:
            data = run.stdout.read(min(left, 300))
            if not data:
                return
            left -= len(data)
        run.stdout.close()


class FullDevice(Trouble):
    """Each write says ENOSPC."""
    may_lose_nothing = False

    def __init__(self, rng, folder):
        super().__init__(rng, folder)
        os.symlink("/dev/full", self.path("full"))
        self.options = rng.choice((["--poses", "/dev/full"], ["--trajectory", "/dev/full"], ["--state-hashes", "/dev/full"],
                                   ["--trajectory-final", "/dev/full"], ["--poses", self.path("full"), "--append"]))


class SlowReader(Trouble):
    """Readers over TCP that take some bytes now and then, or none at all; the first of them none. What a connection holds by itself
    is made small before it begins: the reader's window, and by the size of its segments the room that the sender's kernel takes.
    Without that a loopback holds 2.5 MB, and nobody is slow."""
    frames = 150  # 240 kB of lines
    ROOM = ((1, 536), (10000, 536), (None, None))  # 35 kB, 80 kB, all

    def __init__(self, rng, folder):
        super().__init__(rng, folder)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.options = ["--poses", f"tcp:{self.port}", "--mavlink", "udp:127.0.0.1:9"] if rng.random() < 0.3 else \
            ["--poses", f"tcp:{self.port}"]
        self.texts = []

    def beside(self, run):
        readers = []
        for number in range(self.rng.randint(1, 10)):
            reader = connect(socket.AF_INET, ("127.0.0.1", self.port), run, self.ROOM[0 if number == 0 else self.rng.randrange(3)])
            if reader:
                reader.setblocking(False)
                readers.append(reader)
        self.texts = [b""] * len(readers)
        while readers and run.poll() is None:
            for i, reader in enumerate(readers):
                if i % 3 != 0:
                    self.texts[i] += self.some(reader, self.rng.choice((1, 100, 3000)))
            time.sleep(self.rng.uniform(0, 0.02))
        for i, reader in enumerate(readers):  # what is on the way
            reader.settimeout(5)
            while data := self.some(reader, 65536):
                self.texts[i] += data
            reader.close()

    @staticmethod
    def some(reader, most):
        try:
            return reader.recv(most)
        except OSError:
            return b""

    def missing(self):
        """Lines that each reader did not get whole, of those since his first; whoever was turned away has none."""
        for text in self.texts:
            lines = [json.loads(line)["frame"] for line in text.decode().split("\n")[:-1]]
            yield self.frames - lines[0] - len(lines) if lines else 0

    def wrong(self):
        problem = next(filter(None, (whole_lines(text, "a reader") for text in self.texts)), "")
        if not problem:
            self.may_lose_nothing = sum(self.missing()) <= len(self.texts)
        return problem

    def miscounted(self, problems):
        said = sum(int(n) for p in problems if p.startswith("--poses") for n in LOST.findall(p))
        missing = sum(self.missing())
        # The line that a reader was being given when the run ended is neither lost nor whole.
        return "" if said <= missing <= said + len(self.texts) else f"{missing} lines are missing, {said} were said to be lost"


KINDS = {"killed reader": KilledReader, "full disk": FullDisk, "lonely pipe": LonelyPipe, "broken pipe": BrokenPipe,
         "ENOSPC": FullDevice, "slow TCP reader": SlowReader}


def attempt(program, recordings, alone, kind, seed):
    """(what is wrong, lines lost) of one run."""
    rng = random.Random(f"{kind} {seed}")
    folder = tempfile.mkdtemp()
    try:
        trouble = KINDS[kind](rng, folder)
        hashes = os.path.join(folder, "hashes")
        to_hashes = [] if "--state-hashes" in trouble.options else ["--state-hashes", hashes]
        command = [program, "run", "--replay", recordings[trouble.frames], "--limits", "pocket", "--json"] + to_hashes + trouble.options
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
            errors = []
            listener = threading.Thread(target=lambda: errors.append(run.stderr.read()))
            answers = []
            speaker = threading.Thread(target=lambda: answers.append(run.stdout.read()))
            beside = threading.Thread(target=trouble.beside, args=(run,))
            for thread in (listener, beside) if kind == "broken pipe" else (listener, beside, speaker):
                thread.start()
            try:
                run.wait(TIMEOUT_S)
            except subprocess.TimeoutExpired:
                run.kill()
                return f"not over after {TIMEOUT_S} s", 0
            for thread in (listener, beside) if kind == "broken pipe" else (listener, beside, speaker):
                thread.join()
        problem = trouble.wrong()
        if problem:
            return problem, 0
        err = errors[0].decode(errors="replace")
        if "{" not in (err if kind == "broken pipe" else answers[0].decode()):
            return f"exit code {run.returncode}: {err[-300:]}", 0
        text = err[err.index("{"):err.rindex("}") + 1] if kind == "broken pipe" else answers[0].decode()
        summary = json.loads(text)
        if summary["frames"] != trouble.frames:
            return f"{summary['frames']} of {trouble.frames} frames: {err[-300:]}", 0
        expected = alone[trouble.frames, "--map-store" in trouble.options]
        if to_hashes:
            with open(hashes, encoding="utf-8") as stream:
                if stream.read() != expected:
                    return "other decisions", 0
        elif summary["state_hash"] != expected.split()[-1]:
            return "another state", 0
        if run.returncode != (1 if summary["problems"] else 0):
            return f"exit code {run.returncode}: {err[-300:]}", 0
        if not summary["problems"] and not trouble.may_lose_nothing:
            return f"nothing was said to be lost: {err[-300:]}", 0
        said = [p for p in summary["problems"] if p not in err]
        if said:
            return f"in the summary alone: {said}", 0
        problem = trouble.miscounted(summary["problems"])
        if problem:
            return problem, 0
        return "", sum(int(n) for p in summary["problems"] for n in LOST.findall(p))
    finally:
        if os.path.ismount(folder + "/disk"):
            subprocess.run(["umount", folder + "/disk"], check=False)
        shutil.rmtree(folder, ignore_errors=True)


def may_mount():
    with tempfile.TemporaryDirectory() as folder:
        return subprocess.run(f"mount -t tmpfs -o size=4096 tmpfs {folder} && umount {folder}", shell=True, check=False,
                              capture_output=True).returncode == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("recorder")
    parser.add_argument("--seeds", default="1-100")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    program, recorder = os.path.abspath(options.program), os.path.abspath(options.recorder)
    first, last = (int(n) for n in (options.seeds + "-" + options.seeds).split("-")[:2])
    if not may_mount():
        print("no tmpfs may be mounted here")
        return 77
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        recordings = {kind.frames: os.path.join(folder, str(kind.frames)) for kind in KINDS.values()}
        alone = {}  # what is decided in a whole world; a store has an engine of its own size
        for frames, recording in recordings.items():
            subprocess.run([recorder, "sitting_xyz", "1", "0", str(frames), "160", "120", recording], check=True)
            for has_store in (False, True):
                hashes = os.path.join(folder, "hashes")
                more = ["--map-store", os.path.join(folder, f"store{frames}")] if has_store else []
                subprocess.run([program, "run", "--replay", recording, "--limits", "pocket", "--state-hashes", hashes] + more,
                               check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                with open(hashes, encoding="utf-8") as stream:
                    alone[frames, has_store] = stream.read()
        with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
            for kind in KINDS:
                seeds = range(first, last + 1)
                results = list(pool.map(lambda seed, kind=kind: attempt(program, recordings, alone, kind, seed), seeds))
                for seed, (problem, _) in zip(seeds, results):
                    if problem:
                        failed += 1
                        print(f"WRONG: {kind}, seed {seed}: {problem}")
                lost = [n for problem, n in results if not problem]
                if KINDS[kind] is SlowReader and not any(lost):
                    failed += 1
                    print(f"WRONG: {kind}: nobody has lost a line: the connections hold them all")
                print(f"{kind}: {len(results)} seeds, {len(lost)} tracked to the end with the same bits; lines lost in "
                      f"{sum(n > 0 for n in lost)} of them, {sum(lost)} in all", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
