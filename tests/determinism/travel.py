#!/usr/bin/env python3
"""What one processor writes another one reads: maps, recordings and vocabularies.

usage: travel.py PROGRAM [PROGRAM ...]

A PROGRAM is a path of `stillmesh`, or a command such as 'qemu-arm -L SYSROOT stillmesh'; STILLMESH_NATIVE_PROGRAM in the
environment is one before them. Each one trains a small vocabulary, maps a room with it, and records a run in that map; all
of them must write the same bytes. Then each one goes on in every other's map, to the same state hash at every frame, and
repeats every other's recording bit for bit.
Exit: 0 everything travels, 1 something does not, 77 only one program was named.
"""
import filecmp
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

WRITTEN = {  # file: what writes it, {0} is the program's own folder; in this order
    "words.voc": "vocabulary train --simulate static_xyz:1 --frames 3 --features 300 --branching 5 --levels 3"
                 " --direct-level 1 --out {0}/words.voc",
    "room.map": "run --simulate static_xyz:1 --frames 12 --limits pocket --vocabulary {0}/words.voc --map-out {0}/room.map",
    "run.rec": "run --simulate static_xyz:1+5 --frames 20 --limits pocket --vocabulary {0}/words.voc"
               " --map-in {0}/room.map --record {0}/run.rec --record-frames {0}/frames",
}
GO_ON = ("run --replay {0}/frames --limits pocket --vocabulary {0}/words.voc --map-in {0}/room.map"
         " --state-hashes {1} --map-out {2}")
REPEAT = "rerun {0}/run.rec --replay {0}/frames --vocabulary {0}/words.voc --map-in {0}/room.map"


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
        homes = {}
        for program in programs:
            homes[program] = pathlib.Path(folder) / str(len(homes))
            homes[program].mkdir()
            for name, command in WRITTEN.items():
                run(program, command, homes[program])
                first = homes[programs[0]] / name
                if not filecmp.cmp(first, homes[program] / name, shallow=False):
                    print(f"travel: '{program}' writes another {name} than '{programs[0]}'")
                    wrong += 1
            print(f"travel: written by {program}: " + ", ".join(
                f"{name} {(homes[program] / name).stat().st_size} bytes" for name in WRITTEN), flush=True)
        for maker, home in homes.items():
            first = None
            for number, program in enumerate(programs):
                hashes, onward = home / f"hashes{number}", home / f"onward{number}.map"
                run(program, GO_ON, home, hashes, onward)
                seen = (hashes.read_text(), onward.read_bytes())
                if not seen[0]:
                    sys.exit(f"travel: '{program}' gave no state hashes")
                first = first or seen
                if seen != first:
                    print(f"travel: '{program}' goes on otherwise than '{programs[0]}' in the map of '{maker}'")
                    wrong += 1
                run(program, REPEAT, home)
            print(f"travel: what {maker} wrote was read by all, {first[0].count(chr(10))} state hashes, recording repeated",
                  flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
