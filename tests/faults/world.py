#!/usr/bin/env python3
"""Promise: in a world where one seed decides which camera, disk, clock, memory, thread and signal fails, and when the power
does, over several lives of the program in a row: it never crashes, hangs, or leaves a map that cannot be read, never gives
out a pose that is not where the camera was, and once the world is whole again it tracks within 30 frames.

  world.py PROGRAM FAILING_CALLS SMALL_RECORDING [--seeds FIRST-LAST] [--seconds S] [--jobs N] [--keep DIR]

A failing seed prints the command line that repeats it. What hangs on the clock may not come again: --keep has the files that
its last life began with in DIR/SEED.
"""
import argparse
import collections
import concurrent.futures
import hashlib
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time

TIMEOUT_S = 90          # for hangs
SPREAD_MAX_M = 0.15     # of where the world's origin is, seen from poses of one life: beyond it one is invented
STORE_HEADER_BYTES = 64
TRACKS_WITHIN = 30      # frames of a usable view
# Of one room: scene, seed, day, frames. Without faults each is tracked from its first frame on, and within 13 frames in the
# map of any other, so that what takes longer is a fault's doing.
RECORDINGS = {
    "calm": ("static_xyz", 1, 0, 60), "turning": ("static_rpy", 1, 0, 60), "people": ("sitting_xyz", 1, 0, 60),
    "another day": ("static_xyz", 1, 3, 60),
}
DISK = [("write", "ENOSPC"), ("write", "EIO"), ("write", "SHORT"), ("write", "EINTR"), ("read", "EIO"), ("read", "SHORT"),
        ("read", "EINTR"), ("open", "EMFILE"), ("open", "EROFS"), ("open", "EACCES"), ("sync", "EIO"), ("rename", "EIO"),
        ("rename", "EROFS"), ("cut", "EIO"), ("make", "ENOSPC"), ("look", "EIO"), ("close", "EIO")]
CLOCK = ["STEP1", "STEP3600", "STEPBACK"]
ENDS = ["KILL", "POWER", "TERM", "INT", "HUP"]

Pose = collections.namedtuple("Pose", "time t q")
Life = collections.namedtuple("Life", "recording options faults is_injected end rot")


def schedule(seed):
    """The lives of this seed, the last one without a fault."""
    rng = random.Random(seed)
    lives = []
    for _ in range(rng.randint(1, 3)):
        faults = []
        for _ in range(rng.choice((0, 1, 1, 2, 3))):
            kind, what = rng.choice(DISK)
            reach = 12 if kind in ("sync", "rename", "cut", "make") else 150
            count = rng.choice((1, 1, 3, 20, 0))
            if what == "EINTR":
                count = max(count, 1)  # a call that is interrupted for ever is none of this world's
            faults.append(f"{kind}:{rng.randint(1, reach)}:{count}:{what}")
        if rng.random() < 0.25:
            faults.append(f"clock:{rng.randint(1, 4000)}:1:{rng.choice(CLOCK)}")
        if rng.random() < 0.2:
            faults.append(rng.choice((f"memory:{rng.randint(2300, 9000)}:1:ENOMEM",
                                      f"memory:{rng.randint(2300, 9000)}:1:CEILING",
                                      f"memory:{rng.randint(2300, 9000)}:0:ENOMEM")))
        if rng.random() < 0.1:
            faults.append(f"thread:{rng.randint(1, 6)}:1:EAGAIN")
        end = rng.choice(ENDS) if rng.random() < 0.5 else ""
        if end:
            faults.append(f"io:{rng.randint(1, 700)}:1:{end}")
        options = ["--map", "room.map", "--map-every", rng.choice(("0.1", "0.3"))]
        if rng.random() < 0.8:
            options += ["--trajectory-final", "final.txt"]
        if rng.random() < 0.4:
            options += ["--map-store", "store"]
        if rng.random() < 0.4:
            options += ["--record", "run.rec"]
        if rng.random() < 0.2:
            options += ["--state-hashes", "hashes.txt"]
        if rng.random() < 0.1:
            options += ["--report", "report"]
        if rng.random() < 0.3:  # starved
            options += ["--set", f"schedule.units_per_frame={rng.choice((1, 20, 200))}"]
        if rng.random() < 0.1:
            options += ["--realtime"]
        if rng.random() < 0.2:
            options += ["--trajectory-limit", "0.002"]
        is_injected = rng.random() < 0.3
        if is_injected:
            options += ["--inject", str(rng.randint(0, 10**6))]
        rot = rng.choice(("room.map", "store", "path.txt", "run.rec")) if rng.random() < 0.25 else ""
        lives.append(Life(rng.choice(list(RECORDINGS)), options, ",".join(faults), is_injected, end, rot))
    lives.append(Life(rng.choice(("calm", "another day")),
                      ["--map", "room.map", "--trajectory-final", "final.txt", "--map-store", "store"], "", False, "", ""))
    return rng, lives


# --- poses -----------------------------------------------------------------------------------------------------------

def rotate(q, v):
    x, y, z, w = q
    c = (y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0])
    d = (y * c[2] - z * c[1], z * c[0] - x * c[2], x * c[1] - y * c[0])
    return [v[i] + 2 * (w * c[i] + d[i]) for i in range(3)]


def multiply(a, b):
    return [a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
            a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]]


def origin(truth, pose):
    """Where the map's origin truly is, if the camera is where the pose says: truth * pose^-1."""
    q = multiply(truth.q, [-pose.q[0], -pose.q[1], -pose.q[2], pose.q[3]])
    moved = rotate(q, pose.t)
    return [truth.t[i] - moved[i] for i in range(3)]


def poses_of(text, is_torn_allowed):
    """Measured poses of a path; None: a line that cannot be."""
    out = []
    for line in text.decode(errors="replace").splitlines():
        if not line or line.startswith("#"):
            continue
        try:
            n = [float(word) for word in line.split()]
        except ValueError:
            n = []
        if len(n) != 8 or not all(map(math.isfinite, n)) or abs(sum(x * x for x in n[4:]) - 1) > 1e-3:
            if is_torn_allowed:
                continue
            return None
        out.append(Pose(n[0], n[1:4], n[4:8]))
    return out


class World:
    def __init__(self, folder, program, shim, recorder, keep=None):
        self.keep = keep
        self.folder, self.program, self.shim = folder, program, shim
        self.truth = {}
        for i, (name, (scene, seed, day, frames)) in enumerate(RECORDINGS.items()):
            path = self.path(name)
            subprocess.run([recorder, scene, str(seed), str(day), str(frames), "160", "120", path], check=True)
            with open(os.path.join(path, "groundtruth.txt"), "rb") as stream:
                self.truth[name] = {round(p.time, 3): p for p in poses_of(stream.read(), False)}

        # Of the least map that a whole recording gives.
        self.keyframes_whole = 10**9
        for name in RECORDINGS:
            run = self.run(Life(name, ["--map-out", name[:2] + ".map"], "", False, "", ""), 1, folder)
            assert run.returncode == 0, run.stderr
            self.keyframes_whole = min(self.keyframes_whole, json.loads(run.stdout)["keyframes_made"])

    def path(self, name):
        return os.path.join(self.folder, "frames_" + name.replace(" ", "_"))

    def run(self, life, seed, cwd):
        command = [self.program, "run", "--replay", self.path(life.recording), "--limits", "pocket", "--json",
                   "--trajectory", "path.txt", "--append"] + life.options
        environment = dict(os.environ, LD_PRELOAD=self.shim, STILLMESH_FAULTS=life.faults, STILLMESH_FAULTS_SEED=str(seed))
        return subprocess.run(command, cwd=cwd, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=TIMEOUT_S)

    def reads_map(self, file):
        run = subprocess.run([self.program, "run", "--replay", self.path("calm"), "--frames", "1", "--map-in", file,
                              "--localize", "--limits", "pocket"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        return run.returncode != 2

    def rot(self, rng, work, what):
        """Bits of a file that change while nobody looks; what is there is kept apart, to be compared."""
        path = os.path.join(work, what)
        if os.path.isdir(path):
            files = sorted(f for f in os.listdir(path) if os.path.isfile(os.path.join(path, f)))
            path = os.path.join(path, rng.choice(files)) if files else ""
        if not path or not os.path.isfile(path) or os.path.getsize(path) == 0:
            return
        with open(path, "rb") as stream:
            data = bytearray(stream.read())
        # A store whose segment is damaged at its begin is refused, as its specification says.
        first = STORE_HEADER_BYTES if what == "store" else 0
        if len(data) <= first:
            return
        if rng.random() < 0.2:
            data = data[:rng.randrange(first, len(data))]
        else:
            for _ in range(rng.choice((1, 1, 8))):
                data[rng.randrange(first, len(data))] ^= 1 << rng.randrange(8)
        with open(path, "wb") as stream:
            stream.write(data)


def digest(file):
    with open(file, "rb") as stream:
        return hashlib.sha256(stream.read()).hexdigest()


def maps_in(work):
    return {digest(os.path.join(work, f)) for f in os.listdir(work)
            if f.startswith("room.map") and not f.endswith(".part") and ".kept" not in f}


def read(file):
    if not os.path.exists(file):
        return b""
    with open(file, "rb") as stream:
        return stream.read()


def invented(world, life, fresh):
    """A pose of this life that is not where the camera was; empty: none."""
    if life.is_injected:  # its clock may have jumped: no pose can be held against the truth
        far = [p for p in fresh if max(map(abs, p.t)) > 10]
        return f"a pose {far[0].t} outside the room" if far else ""
    truth = world.truth[life.recording]
    origins = [(p.time, origin(truth[round(p.time, 3)], p)) for p in fresh if round(p.time, 3) in truth]
    if len(origins) < len(fresh):
        return "a pose at a time without a frame"
    if not origins:
        return ""
    middle = [sorted(o[i] for _, o in origins)[len(origins) // 2] for i in range(3)]
    worst, when = max((math.dist(o, middle), t) for t, o in origins)
    return f"the pose at {when} is {worst:.3f} m beside the others of its life" if worst > SPREAD_MAX_M else ""


def live(world, seed):
    """The lives of a seed; what went wrong."""
    rng, lives = schedule(seed)
    work = tempfile.mkdtemp(dir=world.folder)
    wrong = []
    try:
        is_path_torn = is_path_rotten = is_map_rotten = False
        for number, life in enumerate(lives):
            is_last = number == len(lives) - 1

            def say(sentence):
                wrong.append(f"life {number + 1} of {len(lives)} ({life.faults or 'no fault'}; {' '.join(life.options)}): "
                             + sentence)
            kept = os.path.join(world.keep, str(seed)) if world.keep and is_last else None
            if kept:
                shutil.copytree(work, kept, dirs_exist_ok=True)
            before_path = read(os.path.join(work, "path.txt"))
            room = os.path.join(work, "room.map")
            was_map = digest(room) if os.path.exists(room) else ""
            try:
                run = world.run(life, seed, work)
            except subprocess.TimeoutExpired:
                say(f"not over after {TIMEOUT_S} s")
                break
            err = run.stderr.decode(errors="replace")
            is_cut = run.returncode == -9 and life.end in ("KILL", "POWER")
            is_mute = any(f.startswith("write:") for f in life.faults.split(","))
            if run.returncode < 0 and not is_cut:
                # Before the program catches them, and behind its last word, these end it at once.
                if not (life.end in ("TERM", "INT", "HUP") and run.returncode in (-15, -2, -1)):
                    say(f"ended by signal {-run.returncode}: {err[-300:]}")
            elif not is_cut and run.returncode not in (0, 1, 2, 130, 143):
                say(f"exit code {run.returncode}: {err[-300:]}")
            if run.returncode in (1, 2) and "stillmesh: " not in err and not is_mute:
                say(f"exit code {run.returncode} without a sentence")
            if "a bug of ours" in err:
                say(err[-300:])
            if is_last and run.returncode == 2:
                say("refused in a whole world: " + err[-300:])
            # The map: whole, or as it was.
            if os.path.exists(room) and not (is_map_rotten and digest(room) == was_map) and not world.reads_map(room):
                say("the map cannot be read")
            if not (os.path.exists(room) and digest(room) == was_map):
                if was_map and not os.path.exists(room) and not is_cut and was_map not in maps_in(work):
                    say("the map is gone")
                if is_map_rotten and was_map and was_map not in maps_in(work) and run.returncode >= 0 and \
                        keyframes_read(run) == 0:  # bits that nobody reads may rot
                    say("the map that could not be read was not kept")
                is_map_rotten = is_map_rotten and was_map == (digest(room) if os.path.exists(room) else "")
            # The path: what was there is there, and what came is true.
            path = read(os.path.join(work, "path.txt"))
            is_path_torn = is_path_torn or is_cut
            has_turned = "--trajectory-limit" in life.options
            if path.startswith(before_path):
                fresh = poses_of(path[len(before_path):], is_path_torn or is_path_rotten)
                if fresh is None:
                    say("a line of the path is torn")
                elif sentence := invented(world, life, fresh):
                    say(sentence)
                elif is_last and run.returncode != 2:
                    first = min(world.truth[life.recording])
                    within = [p for p in fresh if p.time - first < TRACKS_WITHIN / 30]
                    # A life that ended early leaves too little of a place to know it again from another side.
                    if not within and not 0 < keyframes_read(run) < world.keyframes_whole:
                        say(f"no pose within {TRACKS_WITHIN} frames: {err[-300:]}")
            elif not has_turned and life.end != "POWER":
                say("the earlier path was changed")
            if life.rot and not is_last:
                world.rot(rng, work, life.rot)
                is_path_rotten = is_path_rotten or life.rot == "path.txt"
                is_map_rotten = is_map_rotten or life.rot == "room.map"
            if not is_last and os.path.exists(os.path.join(work, "run.rec")) and rng.random() < 0.5:
                rerun = subprocess.run([world.program, "rerun", "run.rec", "--replay", world.path(life.recording)], cwd=work,
                                       stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                       timeout=TIMEOUT_S)
                if rerun.returncode not in (0, 1, 2):
                    say(f"rerun ended with {rerun.returncode}: {rerun.stderr.decode(errors='replace')[-300:]}")
        if world.keep and not wrong:
            shutil.rmtree(os.path.join(world.keep, str(seed)), ignore_errors=True)
        return wrong
    finally:
        shutil.rmtree(work, ignore_errors=True)


def keyframes_read(run):
    """Of the map that the run went on in; 0: of none."""
    try:
        return sum(m["keyframes"] for m in json.loads(run.stdout)["maps"] if m["what"] == "read")
    except ValueError:
        return 0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("shim")
    parser.add_argument("recorder")
    parser.add_argument("--seeds", default="1-10000")
    parser.add_argument("--seconds", type=float, help="no seed is begun after so long")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--keep", metavar="DIR", help="keeps there what the last life of a failing seed began with")
    options = parser.parse_args()
    paths = list(map(os.path.abspath, (options.program, options.shim, options.recorder)))
    first, last = (int(n) for n in (options.seeds + "-" + options.seeds).split("-")[:2])
    begin = time.monotonic()
    tried = failed = 0
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as folder:
        world = World(folder, *paths, keep=os.path.abspath(options.keep) if options.keep else None)

        def attempt(seed):
            if options.seconds and time.monotonic() - begin > options.seconds:
                return None
            return live(world, seed)
        with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
            seeds = range(first, last + 1)
            for seed, wrong in zip(seeds, pool.map(attempt, seeds)):
                if wrong is None:
                    break
                tried += 1
                if wrong:
                    failed += 1
                    print(f"FAILED {' '.join([sys.argv[0]] + paths)} --seeds {seed}")
                    for sentence in wrong:
                        print("    " + sentence.replace("\n", "\n    "), flush=True)
    print(f"{tried} seeds lived through, {failed} not survived, {time.monotonic() - begin:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
