#!/usr/bin/env python3
"""The same bits on every processor: the state hash of every frame of a few short runs, against golden.txt.

usage: golden.py [--update] [--only NAME] [--part runs|stories] [--data DIR] [--rendered DIR] PROGRAM [PROGRAM ...]

A PROGRAM is a path of `stillmesh`, or a command such as 'qemu-arm -L SYSROOT stillmesh'. Every program must give the hashes
of the first one, frame by frame, and the hash over all frames that golden.txt holds. --update writes golden.txt from the
first program, for the commit that changes numbers on purpose. Real recordings are looked for in --data (the environment's
STILLMESH_TEST_DATA); without them, CI fails and others are told. STILLMESH_NATIVE_PROGRAM in the environment is a program
before the others, built of the same source: what others give is then compared with it at every frame. --rendered keeps what
stories show in a folder, for many programs that differ in the engine alone (tests/proofs/mutants.py).
Exit: 0 equal, 1 not, 77 nothing could be compared.
"""
import argparse
import hashlib
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

GOLDEN = pathlib.Path(__file__).parent / "golden.txt"
# Short, because emulators are slow; together they hold people, mapping with its keyframes, small limits and a real camera.
RUNS = {
    "walking_xyz": ["--simulate", "walking_xyz:1", "--frames", "12"],
    "trolley_first_pocket": ["--simulate", "trolley_first:2", "--frames", "8", "--limits", "pocket"],
    "fr1_rpy_a": ["--replay", "{data}/fr1_rpy_a", "--frames", "30"],
    "fr1_rpy_a_walking_pocket": ["--replay", "{data}/fr1_rpy_a_walking", "--frames", "20", "--limits", "pocket"],
}
# Longer stories in small pictures, rendered by the program itself: what is rendered, in which order it is shown (rendering,
# first frame, frames, step), what runs before, the run, and what its summary must say has happened, or the hash is of another
# story.
SMALL_POOLS = ["--set", "limits.keyframes_max=8", "--set", "keyframes.gap_min=2", "--set", "store.gap_frames=10", "--set",
               "mapping.window_keyframes=4", "--set", "loop.inliers_min=25"]
SEQUENCES = {
    # Once round the desk with a focal length that is 2 % wrong, so that the map does not close by itself; at this pace few
    # keyframes see a place again, and few features of it.
    "loop_closed": {
        "render": ["static_loop --seed 2 --width 320 --every 3 --frames 750"],
        "focal": 0.98,
        "show": [(0, 0, 250, 1)],
        "run": ["--set", "keyframes.gap_min=4", "--set", "keyframes.tracked_share_max=1", "--set", "keyframes.new_points_min=1",
                "--set", "loop.consistency=1", "--set", "loop.gap_frames=100", "--set", "loop.inliers_min=30", "--set",
                "loop.drift_share=1"],
        "happened": {("loops", "closed"): 1},
    },
    # Another room for half a second; then where the camera was at first, too far from where it was last for anything but words.
    "relocalised": {
        "render": ["static_loop --width 320 --every 2 --frames 80", "static_loop --seed 7 --width 320 --every 2 --frames 32"],
        "show": [(0, 0, 40, 1), (1, 0, 16, 1), (0, 0, 25, 1)],
        "run": ["--limits", "pocket"],
        "happened": {("loops", "relocalisations"): 1},
    },
    # The second run in a store.
    "region_returned": {
        "render": ["static_loop --width 320 --frames 40"],
        "show": [(0, 0, 40, 1)],
        "before": [["--limits", "pocket", *SMALL_POOLS, "--map-store", "{work}/store"]],
        "run": ["--limits", "pocket", *SMALL_POOLS, "--map-store", "{work}/store"],
        "happened": {("map_store", "returned"): 1, ("map_store", "useful"): 1},
    },
    # The same room on another day. A pose is measured within the map that was read, or not at all.
    "map_loaded": {
        "render": ["static_xyz --width 320 --every 2 --frames 60", "static_xyz --day 5 --width 320 --every 2 --frames 40"],
        "show": [(1, 0, 20, 1)],
        "before": [["--limits", "pocket", "--map-out", "{work}/room.map"]],
        "run": ["--limits", "pocket", "--map-in", "{work}/room.map"],
        "happened": {("maps", 0, "keyframes"): 2, ("share_tracked",): 0.3},
    },
}
FRAME_S = 1 / 30
HEADER = """\
# The state hash over all frames of each run of golden.py. Who changes numbers on purpose writes this file anew, and says so:
#   ./run golden --update
"""


def said_by(program, arguments):
    ran = subprocess.run([*shlex.split(program), *arguments], capture_output=True, text=True, check=False)
    if ran.returncode not in (0, 1):
        sys.exit(f"golden: {program} {' '.join(arguments)} ends with {ran.returncode}:\n{ran.stderr[-2000:]}")
    return ran


def hashes_of(program, arguments, happened=None):
    """The state hash of every frame, and what should have happened and has not."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "hashes.txt"
        ran = said_by(program, ["run", *arguments, "--state-hashes", str(file), "--json"])
        if not file.is_file() or not file.read_text():
            sys.exit(f"golden: {program} {' '.join(arguments)} gave no hashes:\n{ran.stderr[-2000:]}")
        missing = []
        for path, least in (happened or {}).items():
            found = json.loads(ran.stdout)
            try:
                for key in path:
                    found = found[key]
            except (KeyError, IndexError, TypeError):  # no map was read, no store was used
                found = 0
            if found < least:
                missing.append(f"{'.'.join(map(str, path))} is {found}, not {least}")
        return file.read_text().splitlines(), missing


def scene_of(program, scene, out):
    """Renders a scene into a folder, unless it is there from another program."""
    if not out.is_dir():
        with tempfile.TemporaryDirectory(dir=out.parent) as folder:
            said_by(program, ["simulate", *scene.split(), "--out", str(pathlib.Path(folder) / "scene"), "--json"])
            os.rename(pathlib.Path(folder) / "scene", out)
    return out


def sequence_of(program, name, folder, kept):
    """Renders and orders the frames of a sequence; the arguments of its run."""
    sequence = SEQUENCES[name]
    work = pathlib.Path(folder)
    frames = work / "frames"
    frames.mkdir()
    rendered = []
    for i, scene in enumerate(sequence["render"]):
        out = scene_of(program, scene, (kept or work) / f"{name}{i}")
        (work / f"scene{i}").symlink_to(out)
        (frames / str(i)).symlink_to(out)
        rendered.append([[line.split()[1] for line in (out / f"{kind}.txt").read_text().splitlines() if line[0] != "#"]
                         for kind in ("rgb", "depth")])
    camera = (work / "scene0" / "camera.yaml").read_text()
    (frames / "camera.yaml").write_text(re.sub(r"(Camera\.f[xy]: )([\d.]+)", lambda found: found[1] + str(
        round(float(found[2]) * sequence.get("focal", 1), 4)), camera))
    shown = [(scene, first + step * i) for scene, first, count, step in sequence["show"] for i in range(count)]
    for kind, text in enumerate(("rgb", "depth")):
        (frames / f"{text}.txt").write_text("".join(
            f"{1 + i * FRAME_S:.6f} {scene}/{rendered[scene][kind][at]}\n" for i, (scene, at) in enumerate(shown)))

    def placed(words):
        return [word.replace("{work}", str(work)) for word in words]
    for before in sequence.get("before", []):
        folder_before = ["--replay", str(work / "scene0")]
        said_by(program, ["run", *folder_before, *placed(before), "--json"])
    return ["--replay", str(frames), *placed(sequence["run"])]


def outcome(program, name, data, kept):
    """The state hashes of a run, and what should have happened in it and has not."""
    if name in RUNS:
        return hashes_of(program, [word.replace("{data}", data) for word in RUNS[name]])
    with tempfile.TemporaryDirectory() as folder:
        return hashes_of(program, sequence_of(program, name, folder, kept), SEQUENCES[name]["happened"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true")
    parser.add_argument("--only", choices=[*RUNS, *SEQUENCES])
    parser.add_argument("--part", choices=["runs", "stories"], help="the short runs, or the longer stories")
    parser.add_argument("--data", default=os.environ.get("STILLMESH_TEST_DATA", ""))
    parser.add_argument("--rendered", type=lambda name: pathlib.Path(name).resolve(), help="an existing folder")
    parser.add_argument("programs", nargs="+", metavar="PROGRAM")
    arguments = parser.parse_args()
    if os.environ.get("STILLMESH_NATIVE_PROGRAM"):
        arguments.programs.insert(0, os.environ["STILLMESH_NATIVE_PROGRAM"])
    golden = dict(line.split() for line in GOLDEN.read_text().splitlines() if line and not line.startswith("#")) \
        if GOLDEN.is_file() else {}
    compared, wrong = 0, 0
    for name in [*RUNS, *SEQUENCES]:
        if arguments.only not in (None, name) or arguments.part == ("stories" if name in RUNS else "runs"):
            continue
        if "{data}" in " ".join(RUNS.get(name, [])) and not arguments.data:
            print(f"golden: {name} NOT compared: STILLMESH_TEST_DATA names no folder of recordings")
            wrong += "CI" in os.environ
            continue
        first = None
        for program in arguments.programs:
            lines, missing = outcome(program, name, arguments.data, arguments.rendered)
            for sentence in missing:
                print(f"golden: {name}: '{program}': {sentence}")
                wrong += 1
            digest = hashlib.sha256("\n".join(lines).encode()).hexdigest()[:16]
            if first is None:
                first = lines
                if arguments.update:
                    golden[name] = digest
            elif lines != first:
                at = next((i for i, pair in enumerate(zip(first, lines)) if pair[0] != pair[1]), min(len(first), len(lines)))
                print(f"golden: {name}: frame {at} of '{program}' differs from '{arguments.programs[0]}'")
                wrong += 1
            if golden.get(name) != digest:
                print(f"golden: {name}: '{program}' gives {digest}, golden.txt holds {golden.get(name)}")
                wrong += 1
            compared += 1
            print(f"golden: {name} {len(lines)} frames {digest} {program}", flush=True)
    if arguments.update:
        GOLDEN.write_text(HEADER + "".join(f"{name} {golden[name]}\n" for name in [*RUNS, *SEQUENCES] if name in golden))
    if wrong:
        print("golden: if this commit changes numbers on purpose, on every processor: ./run golden --update")
        return 1
    return 0 if compared else 77


if __name__ == "__main__":
    sys.exit(main())
