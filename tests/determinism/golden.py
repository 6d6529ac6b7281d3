#!/usr/bin/env python3
"""The same bits on every processor: the state hash of every frame of a few short runs, against golden.txt.

usage: golden.py [--update] [--only NAME] [--data DIR] PROGRAM [PROGRAM ...]

A PROGRAM is a path of `stillmesh`, or a command such as 'qemu-arm -L SYSROOT stillmesh'. Every program must give the hashes
of the first one, frame by frame, and the hash over all frames that golden.txt holds. --update writes golden.txt from the
first program, for the commit that changes numbers on purpose. Real recordings are looked for in --data (the environment's
STILLMESH_TEST_DATA); without them, CI fails and others are told. STILLMESH_NATIVE_PROGRAM in the environment is a program
before the others, built of the same source: what others give is then compared with it at every frame.
Exit: 0 equal, 1 not, 77 nothing could be compared.
"""
import argparse
import hashlib
import os
import pathlib
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
HEADER = """\
# The state hash over all frames of each run of golden.py. Who changes numbers on purpose writes this file anew, and says so:
#   ./run golden --update
"""


def hashes_of(program, arguments):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "hashes.txt"
        ran = subprocess.run([*shlex.split(program), "run", *arguments, "--state-hashes", str(file), "--json"],
                             capture_output=True, text=True, check=False)
        if ran.returncode not in (0, 1) or not file.is_file() or not file.read_text():
            sys.exit(f"golden: {program} {' '.join(arguments)} gave no hashes:\n{ran.stderr[-2000:]}")
        return file.read_text().splitlines()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true")
    parser.add_argument("--only", choices=RUNS)
    parser.add_argument("--data", default=os.environ.get("STILLMESH_TEST_DATA", ""))
    parser.add_argument("programs", nargs="+", metavar="PROGRAM")
    arguments = parser.parse_args()
    if os.environ.get("STILLMESH_NATIVE_PROGRAM"):
        arguments.programs.insert(0, os.environ["STILLMESH_NATIVE_PROGRAM"])
    golden = dict(line.split() for line in GOLDEN.read_text().splitlines() if line and not line.startswith("#")) \
        if GOLDEN.is_file() else {}
    compared, wrong = 0, 0
    for name, run in RUNS.items():
        if arguments.only not in (None, name):
            continue
        if "{data}" in " ".join(run) and not arguments.data:
            print(f"golden: {name} NOT compared: STILLMESH_TEST_DATA names no folder of recordings")
            wrong += "CI" in os.environ
            continue
        run = [word.replace("{data}", arguments.data) for word in run]
        first = None
        for program in arguments.programs:
            lines = hashes_of(program, run)
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
        GOLDEN.write_text(HEADER + "".join(f"{name} {golden[name]}\n" for name in RUNS if name in golden))
    if wrong:
        print("golden: if this commit changes numbers on purpose, on every processor: ./run golden --update")
        return 1
    return 0 if compared else 77


if __name__ == "__main__":
    sys.exit(main())
