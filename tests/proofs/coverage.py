#!/usr/bin/env python3
"""Which branches of the engine its tests take, room by room, against gates.

usage: coverage.py [--rooms A,B] [--lines] [--no-run] [BUILD]

BUILD (build/proofs) is of the preset `proofs`: clang writes down how often each condition was true and how often false.
Run are the unit tests of the engine's rooms, the committed inputs of the fuzzers that look at the engine, and the golden runs and
stories of the program (recordings: STILLMESH_TEST_DATA). A branch is one outcome of one condition, so `a && b` has four; what
templates make of one line is one.

Left out, by place in the source alone, since no test can take them: what stands inside STILLMESH_CHECK(...), and check.cpp behind
it, whose other outcome ends the program; `if constexpr`; comparisons that the compiler writes (`= default`); that none of the cases
of a switch without `default` fits (-Wswitch holds enumerations to all of theirs). What is not compiled for this processor is not
there.

Gates: the engine 95 %, the rooms base, mesh, static_region and record 98 % each. --lines prints each branch that was never
taken, --rooms only those of some rooms, --no-run reads what the last run wrote. Exit: 0 all gates hold, 1 not.
"""
import argparse
import collections
import json
import os
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
LEFT_OUT_FILES = ("engine/base/check.cpp",)
GATES = {"base": 98, "mesh": 98, "static_region": 98, "record": 98}
ENGINE_GATE = 95
TESTS = """adjust base engine features geometry loop_closing map mapping matching mesh persist place pose recognition schedule
static_region store tracking world""".split()
FUZZED = "engine features map map_store mesh vocabulary".split()


def targets():
    return [f"test_{name}" for name in TESTS] + [f"fuzz_replay_{name}" for name in FUZZED] + ["stillmesh"]


def program_of(build, target):
    if target == "stillmesh":
        return build / "platform" / "cli" / "stillmesh"
    if target.startswith("fuzz_"):
        return build / "fuzz" / target
    return build / "tests" / target.removeprefix("test_") / target


def run(build, raw):
    """Every program once; what it reached lies in raw."""
    raw.mkdir(exist_ok=True)
    for old in raw.glob("*.profraw"):
        old.unlink()
    failed = []
    for target in targets():
        program = program_of(build, target)
        command = [str(program), "--gtest_brief=1"]
        if target.startswith("fuzz_"):
            name = target.removeprefix("fuzz_replay_")
            folders = [ROOT / "fuzz" / kind / name for kind in ("corpus", "regressions")]
            command = [str(program), *(str(folder) for folder in folders if folder.is_dir())]
        if target == "stillmesh":
            command = [sys.executable, str(ROOT / "tests/determinism/golden.py"), str(program)]
        environment = {**os.environ, "LLVM_PROFILE_FILE": str(raw / f"{target}-%m.profraw")}
        ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        print(f"coverage: {target} {'passed' if ran.returncode == 0 else f'ended with {ran.returncode}'}", flush=True)
        if ran.returncode != 0:
            failed.append(target)
            print((ran.stdout + ran.stderr)[-3000:])
    return failed


def measured(build, raw):
    """The branches of every file of the engine: {file: {(line, column): [true, false]}}."""
    data = build / "coverage.profdata"
    subprocess.run(["llvm-profdata", "merge", "-sparse", "-o", str(data), *map(str, sorted(raw.glob("*.profraw")))], check=True)
    programs = [program_of(build, target) for target in targets()]
    command = ["llvm-cov", "export", f"-instr-profile={data}", "-skip-expansions", str(programs[0])]
    for program in programs[1:]:
        command += ["-object", str(program)]
    # Of nothing but the engine: the rest of the export would be hundreds of megabytes.
    command += [str(file) for file in sorted((ROOT / "engine").rglob("*.[ch]pp"))]
    exported = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    found = {}
    for file in exported["data"][0]["files"]:
        name = pathlib.Path(file["filename"]).resolve().relative_to(ROOT).as_posix()
        outcomes = found.setdefault(name, {})
        for line, column, _, _, is_true, is_false, *_ in file.get("branches", []):
            counts = outcomes.setdefault((line, column), [0, 0])
            counts[0] += is_true
            counts[1] += is_false
    return found


def checks_of(text):
    """The spans of STILLMESH_CHECK(...) in a source, as offsets."""
    spans = []
    for begin in re.finditer(r"STILLMESH_CHECK\(", text):
        depth, end = 1, begin.end()
        while depth and end < len(text):
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            end += 1
        spans.append((begin.start(), end))
    return spans


def counted(found):
    """{file: [taken, all, [(line, column, what was never so)]]}, without what stands inside a check."""
    result = {}
    for name, outcomes in found.items():
        if name in LEFT_OUT_FILES:
            continue
        text = (ROOT / name).read_text()
        lines = text.splitlines()
        starts = [0]
        for line in text.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        spans = checks_of(text)
        taken, every, missed = 0, 0, []
        for (line, column), counts in sorted(outcomes.items()):
            offset = starts[line - 1] + column - 1
            if any(begin <= offset < end for begin, end in spans) or "= default" in lines[line - 1]:
                continue
            if lines[line - 1][:column - 1].endswith(("if constexpr (", "switch (")):
                continue
            every += 2
            taken += (counts[0] > 0) + (counts[1] > 0)
            for count, word in zip(counts, ("true", "false")):
                if count == 0:
                    missed.append((line, column, word))
        if every:
            result[name] = [taken, every, missed]
    return result


def room_of(name):
    parts = name.split("/")
    return parts[1] if len(parts) > 2 else "(engine itself)"


def report(result, rooms, with_lines):
    """Prints rooms and the worst files; the gates that do not hold."""
    sums = collections.defaultdict(lambda: [0, 0])
    for name, (taken, every, _) in result.items():
        for key in (room_of(name), "engine"):
            sums[key][0] += taken
            sums[key][1] += every
    below = []
    for room, (taken, every) in sorted(sums.items(), key=lambda item: item[1][0] / item[1][1]):
        gate = ENGINE_GATE if room == "engine" else GATES.get(room)
        share = 100 * taken / every
        print(f"{room:18} {share:6.2f} %  {taken:5} of {every:5}" + (f"   gate {gate} %" if gate else ""))
        if gate and share < gate:
            below.append(room)
    print("\nfiles with the most branches that were never taken:")
    for name, (taken, every, missed) in sorted(result.items(), key=lambda item: -len(item[1][2]))[:25]:
        if missed:
            print(f"{len(missed):4}  {100 * taken / every:6.2f} %  {name}")
    if with_lines:
        for name, (_, _, missed) in sorted(result.items()):
            if missed and (not rooms or room_of(name) in rooms):
                lines = (ROOT / name).read_text().splitlines()
                for line, column, word in missed:
                    print(f"{name}:{line}:{column}: never {word}: {lines[line - 1].strip()[:110]}")
    return below


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", default="")
    parser.add_argument("--lines", action="store_true")
    parser.add_argument("--no-run", action="store_true")
    parser.add_argument("--targets", action="store_true", help="only print what has to be built")
    parser.add_argument("build", nargs="?", type=pathlib.Path, default=ROOT / "build/proofs")
    arguments = parser.parse_args()
    if arguments.targets:
        print(*targets())
        return 0
    raw = arguments.build / "raw"
    failed = [] if arguments.no_run else run(arguments.build, raw)
    rooms = [room for room in arguments.rooms.split(",") if room]
    below = report(counted(measured(arguments.build, raw)), rooms, arguments.lines)
    for target in failed:
        print(f"coverage: {target} failed: what it reached counts, but mend it first")
    for room in below:
        print(f"coverage: {room} is below its gate")
    return 1 if failed or below else 0


if __name__ == "__main__":
    sys.exit(main())
