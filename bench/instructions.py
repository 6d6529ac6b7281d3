#!/usr/bin/env python3
"""Counts the instructions that a program executes inside some functions, with callgrind: the same number on every run.

usage: instructions.py --inside 'stillmesh::Delaunay::triangulate*' [--divide N] [--max N] -- PROGRAM [ARG ...]

Prints the count divided by --divide. Exit 1: above --max. Exit 77: valgrind is not installed (a skipped test).
"""
import argparse
import re
import shutil
import subprocess
import sys
import tempfile


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inside", required=True, help="functions to count in, as callgrind's --toggle-collect")
    parser.add_argument("--divide", type=int, default=1, help="calls in one run of the program")
    parser.add_argument("--max", type=int)
    parser.add_argument("command", nargs="+")
    arguments = parser.parse_args()
    if shutil.which("valgrind") is None:
        print("skipped: valgrind is not installed")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        ran = subprocess.run(
            ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out",
             f"--toggle-collect={arguments.inside}", *arguments.command], capture_output=True, text=True)
    found = re.search(r"Collected : (\d+)", ran.stderr)
    if ran.returncode != 0 or found is None or int(found[1]) == 0:
        print(ran.stdout + ran.stderr)
        print("nothing was counted: the program failed, or no such function was called")
        return 1
    count = int(found[1]) // arguments.divide
    limit = "" if arguments.max is None else f" (at most {arguments.max})"
    print(f"{count} instructions{limit}")
    return 0 if arguments.max is None or count <= arguments.max else 1


if __name__ == "__main__":
    sys.exit(main())
