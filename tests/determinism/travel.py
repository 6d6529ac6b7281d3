#!/usr/bin/env python3
"""What one processor writes another one reads: maps, recordings and vocabularies.

usage: travel.py PROGRAM [PROGRAM ...]

A PROGRAM is a path of `stillmesh`, or a command such as 'qemu-arm -L SYSROOT stillmesh'; STILLMESH_NATIVE_PROGRAM in the
environment is one before them. The first one draws what the others look at. Each one trains a small vocabulary, maps a
room with it, and records a run in that map; all of them must write the same bytes. Then each one goes on in the map of
another, to the same state hash at every frame and the same map, and repeats the other's recording bit for bit.
Exit: 0 everything travels, 1 something does not, 77 only one program was named.
"""
import filecmp
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

DRAWN = ("simulate static_xyz:1 --frames 12 --out {0}/monday", "simulate static_xyz:1+5 --frames 20 --out {0}/tuesday")
WRITTEN = {  # file: what writes it, {0} is the program's own folder, {1} that of what was drawn; in this order
    "words.voc": "vocabulary train --images {1}/monday --every 4 --features 300 --branching 5 --levels 3 --direct-level 1"
                 " --out {0}/words.voc",
    "room.map": "run --replay {1}/monday --limits pocket --vocabulary {0}/words.voc --map-out {0}/room.map",
    "run.rec": "run --replay {1}/tuesday --limits pocket --vocabulary {0}/words.voc --map-in {0}/room.map"
               " --record {0}/run.rec",
}
# {0} is now another's folder.
GO_ON = ("run --replay {1}/tuesday --limits pocket --vocabulary {0}/words.voc --map-in {0}/room.map"
         " --state-hashes {2} --map-out {3}")
REPEAT = "rerun {0}/run.rec --replay {1}/tuesday --vocabulary {0}/words.voc --map-in {0}/room.map"


def main():
    programs = [name for name in [os.environ.get("STILLMESH_NATIVE_PROGRAM"), *sys.argv[1:]] if name]
    if not programs or programs[0].startswith("-"):
        print(__doc__)
        return 2
    if len(programs) < 2:
        print("travel: one program alone; STILLMESH_NATIVE_PROGRAM may name another one, of another processor")
        return 77

    def run(program, command, *places):
        ran = subprocess.run([*shlex.split(program), *command.format(*places).split()], capture_output=True, text=True,
                             check=False)
        if ran.returncode != 0:
            sys.exit(f"travel: '{program} {command.format(*places)}' ends with {ran.returncode}:\n"
                     f"{ran.stdout[-1000:]}{ran.stderr[-1000:]}")

    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for command in DRAWN:
            run(programs[0], command, folder)
        homes = [pathlib.Path(folder) / str(number) for number in range(len(programs))]
        for program, home in zip(programs, homes):
            home.mkdir()
            for name, command in WRITTEN.items():
                run(program, command, home, folder)
                if not filecmp.cmp(homes[0] / name, home / name, shallow=False):
                    print(f"travel: '{program}' writes another {name} than '{programs[0]}'")
                    wrong += 1
            print(f"travel: written by {program}: " + ", ".join(
                f"{name} {(home / name).stat().st_size} bytes" for name in WRITTEN), flush=True)
        first = None
        for number, program in enumerate(programs):
            home = homes[number - 1]  # the neighbour's
            hashes, onward = homes[number] / "hashes", homes[number] / "onward.map"
            run(program, GO_ON, home, folder, hashes, onward)
            seen = (hashes.read_text(), onward.read_bytes())
            if not seen[0]:
                sys.exit(f"travel: '{program}' gave no state hashes")
            first = first or seen
            if seen != first:
                print(f"travel: '{program}' goes on otherwise than '{programs[0]}'")
                wrong += 1
            run(program, REPEAT, home, folder)
            print(f"travel: {program} read what {programs[number - 1]} wrote: {first[0].count(chr(10))} state hashes,"
                  " recording repeated", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
