#!/usr/bin/env python3
"""Promise: whichever call of the program fails, it goes on or ends with a sentence and an exit code, in time, and leaves
earlier outputs and the map whole; where it says that all is done, all is there.

  nth_call.py PROGRAM FAILING_CALLS SMALL_RECORDING [--sample N] [--only COMMAND] [--kind KIND:WHAT] [--from N] [--jobs N]

Each command of the table below is run once to count its calls, then once for each call and each way to fail. --sample:
so many of them, evenly spread, instead of all. A failure prints the command line that repeats it.
"""
import argparse
import concurrent.futures
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile

TIMEOUT_S = 60  # for hangs
MEMORY_OF_ARGUMENTS = 2400
WAYS = (  # of failing: kind, what, for how many calls (0: from there on)
    ("memory", "ENOMEM", 1), ("memory", "CEILING", 1), ("memory", "ENOMEM", 0), ("map", "ENOMEM", 1),
    ("thread", "EAGAIN", 1), ("io", "EIO", 1), ("write", "ENOSPC", 1), ("write", "ENOSPC", 0), ("write", "SHORT", 1),
    ("write", "EINTR", 1), ("read", "EINTR", 1), ("read", "SHORT", 1), ("open", "EMFILE", 0), ("io", "KILL", 1),
)


class World:
    """What the commands begin with, made once: recordings, a map and a path of an earlier run, a vocabulary."""

    def __init__(self, folder, program, shim, recorder):
        self.folder, self.program, self.shim = folder, program, shim
        self.frames = os.path.join(folder, "frames")
        made = subprocess.run([recorder, "static_xyz", "1", "0", "20", "160", "120", self.frames])
        assert made.returncode == 0
        self.before = os.path.join(folder, "before")
        os.mkdir(self.before)
        run = self.call(self.fill(RUN), self.before)
        assert run.returncode == 0, run.stderr
        # Of the earlier run what a new one replaces or adds to; the rest would be refused, being there.
        shutil.rmtree(os.path.join(self.before, "recorded"))
        self.earlier = {name: digest(os.path.join(self.before, name)) for name in os.listdir(self.before)
                        if os.path.isfile(os.path.join(self.before, name))}
        self.path = open(os.path.join(self.before, "path.txt"), "rb").read()
        self.good_maps = {}  # digest: whether the program reads it

    def fill(self, words):
        return [self.program] + [w.format(frames=self.frames, before=self.before) for w in words.split()]

    def call(self, command, cwd, faults=None, counts=None):
        environment = dict(os.environ, LD_PRELOAD=self.shim)
        if faults:
            environment["STILLMESH_FAULTS"] = faults
        if counts:
            environment["STILLMESH_FAULTS_COUNTS"] = counts
        return subprocess.run(command, cwd=cwd, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=TIMEOUT_S)

    def reads_map(self, file):
        key = digest(file)
        if key not in self.good_maps:
            run = subprocess.run([self.program, "run", "--replay", self.frames, "--frames", "1", "--map-in", file,
                                  "--localize", "--limits", "pocket"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
            self.good_maps[key] = run.returncode != 2
        return self.good_maps[key]


RUN = ("run --replay {frames} --limits pocket --map room.map --map-every 0.1 --map-store store --trajectory path.txt --append "
       "--poses poses.jsonl --trajectory-final final.txt --state-hashes hashes.txt --record run.rec --record-frames recorded --report report "
       "--set region.is_enabled=true")
COMMANDS = {  # name: words, share of the calls that are tried when all are (each such run waits for its camera or renders)
    "run": (RUN, 1),
    "realtime": ("run --replay {frames} --limits pocket --realtime --map room.map --map-every 0.1 --map-store store "
                 "--trajectory path.txt --append --json", 5),
    "faulty": ("run --replay {frames} --inject 1 --limits pocket --map-in room.map --map-out room.map", 3),
    "simulated": ("run --simulate static_xyz:1 --frames 2 --limits pocket --trajectory path.txt --append "
                  "--poses unix:poses.sock --poses udp:127.0.0.1:9", 8),
    "rerun": ("rerun {before}/run.rec --replay {frames}", 1),
    "eval": ("eval --groundtruth {frames}/groundtruth.txt --trajectory {before}/path.txt", 1),
    "info": ("vocabulary info", 1),
    "train": ("vocabulary train --images {frames} --every 5 --levels 2 --out words.bin", 2),
    "simulate": ("simulate static_xyz --frames 1 --out made", 2),
    "cameras": ("cameras", 1),
    "refused": ("run --replay {frames} --calibration {before}/path.txt", 3),
    "config": ("run --simulate static_xyz:1 --print-config", 2),
}


def digest(file):
    with open(file, "rb") as stream:
        return hashlib.sha256(stream.read()).hexdigest()


def poses_of(text):
    """The poses of a path, or None if a line is torn."""
    out = []
    for line in text.decode().splitlines():
        if line.startswith("#") or not line:
            continue
        words = line.split()
        if len(words) != 8:
            return None
        out.append(words)
    return out


def problems(world, folder, name, run, reference, faults, what):
    """What is wrong behind a run in `folder`; empty: nothing."""
    out = []
    err = run.stderr.decode(errors="replace")
    is_mute = faults.startswith("write:") and ":0:" in faults  # nor can standard error be written
    is_killed = what == "KILL" and run.returncode == -9
    if run.returncode < 0 and not is_killed:
        out.append(f"ended by signal {-run.returncode}: {err[-200:]}")
    elif not is_killed and run.returncode not in (0, 1, 2):
        out.append(f"exit code {run.returncode}")
    if run.returncode in (1, 2) and "stillmesh: " not in err and reference.returncode == 0 and not is_mute:
        out.append(f"exit code {run.returncode} without a sentence")
    if "a bug of ours" in err or "terminate called" in err:
        out.append("says: " + err[-200:])
    if run.returncode == 2 and reference.returncode == 0:
        for file, before in world.earlier.items():
            # A start that is refused changes nothing.
            there = os.path.join(folder, file)
            if not os.path.exists(there) or digest(there) != before:
                out.append(f"refused, but {file} is not what it was")
    room = os.path.join(folder, "room.map")
    if not os.path.exists(room):
        out.append("the map is gone")
    elif not world.reads_map(room):
        out.append("the map cannot be read")
    with open(os.path.join(folder, "path.txt"), "rb") as stream:
        path = stream.read()
    if not path.startswith(world.path):
        out.append("the earlier path was changed")
    poses = poses_of(path)
    if poses is None and not is_killed:
        out.append("a line of the path is torn")
    for file in ("final.txt",):
        there = os.path.join(folder, file)
        if os.path.exists(there) and poses_of(open(there, "rb").read()) is None:
            out.append(f"{file} is torn")
    if run.returncode == 0 and reference.returncode == 0:
        for file, size in reference.files.items():
            there = os.path.join(folder, file)
            # The report's times and the map's moments differ from run to run, and with them some sizes; in real time
            # what is late is left out.
            if not os.path.exists(there):
                out.append(f"exit code 0, but {file} is not there")
            elif name != "realtime" and file in ("path.txt", "final.txt", "hashes.txt", "words.bin") and os.path.getsize(there) != size:
                out.append(f"exit code 0, but {file} has {os.path.getsize(there)} bytes instead of {size}")
        if name in ("info", "eval", "config", "simulate") and run.stdout != reference.stdout:
            out.append(f"exit code 0, but it printed {len(run.stdout)} bytes instead of {len(reference.stdout)}")
    return out


def files_of(folder):
    out = {}
    for above, _, names in os.walk(folder):
        for name in names:
            file = os.path.join(above, name)
            if not file.endswith(".part"):
                out[os.path.relpath(file, folder)] = os.path.getsize(file)
    return out


def attempt(world, name, faults, reference, what):
    folder = tempfile.mkdtemp(dir=world.folder)
    try:
        work = os.path.join(folder, "work")
        shutil.copytree(world.before, work)
        try:
            run = world.call(world.fill(COMMANDS[name][0]), work, faults)
        except subprocess.TimeoutExpired:
            return [f"not over after {TIMEOUT_S} s"]
        return problems(world, work, name, run, reference, faults, what)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def plan_of(world, options):
    """Every (command, faults, reference, what) there is."""
    for name in COMMANDS:
        if options.only and name not in options.only.split(","):
            continue
        work = os.path.join(world.folder, "counted_" + name)
        shutil.copytree(world.before, work)
        counts = os.path.join(world.folder, "counts_" + name)
        reference = world.call(world.fill(COMMANDS[name][0]), work, counts=counts)
        reference.files = files_of(work)
        # Up to here every command reads its arguments: tried with the first command.
        common = 0 if name == "run" else MEMORY_OF_ARGUMENTS
        calls = dict((k, int(n)) for k, n in (line.split() for line in open(counts)))
        print(f"{name}: exit code {reference.returncode}, " +
              ", ".join(f"{n} {k}" for k, n in calls.items() if n and k not in ("clock",)), flush=True)
        for kind, what, count in WAYS:
            if options.kind and options.kind != f"{kind}:{what}:{count}":
                continue
            stride = COMMANDS[name][1] * (options.coarse if count == 0 or what in ("CEILING", "KILL") else 1)
            # A few more than were counted: threads make some more or less.
            for n in range(max(common if kind == "memory" else 1, options.start), calls[kind] + 3, stride):
                yield name, f"{kind}:{n}:{count}:{what}", reference, what


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("shim")
    parser.add_argument("recorder")
    parser.add_argument("--sample", type=int)
    parser.add_argument("--only")
    parser.add_argument("--kind")
    parser.add_argument("--start", type=int, default=1)
    parser.add_argument("--coarse", type=int, default=4, help="only each so manyth call for failures that last")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    options.program, options.shim, options.recorder = map(os.path.abspath,
                                                          (options.program, options.shim, options.recorder))
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as folder:
        world = World(folder, options.program, options.shim, options.recorder)
        plan = list(plan_of(world, options))
        if options.sample and options.sample < len(plan):
            # Primes between them, so that each command and each way comes in turn, at another place.
            plan = [plan[i * len(plan) // options.sample] for i in range(options.sample)]
        failed = 0
        with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
            for (name, faults, _, _), found in zip(plan, pool.map(lambda p: attempt(world, *p), plan)):
                if not found:
                    continue
                failed += 1
                print(f"FAILED STILLMESH_FAULTS={faults} LD_PRELOAD={options.shim} " +
                      " ".join(world.fill(COMMANDS[name][0])))
                for sentence in found:
                    print("    " + sentence.replace("\n", "\n    "), flush=True)
        print(f"{len(plan)} failing calls tried, {failed} not survived")
        return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
