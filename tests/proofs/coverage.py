#!/usr/bin/env python3
"""Which branches of the engine its tests take, room by room, against gates.

usage: coverage.py [--rooms A,B] [--units] [--lines] [--no-run] [--again] [--jobs N] [BUILD]

BUILD (build/proofs) is of the preset `proofs`: clang writes down how often each condition was true and how often false.
Run are the unit tests of the engine's rooms, the committed inputs of the fuzzers that look at the engine, and the golden runs and
stories of the program (recordings: STILLMESH_TEST_DATA). A branch is one outcome of one condition, so `a && b` has four; what
templates make of one line is one.

Left out, by place in the source alone, since no test can take them: what stands inside STILLMESH_CHECK(...), and check.cpp behind
it, whose other outcome ends the program; `if constexpr`; comparisons that the compiler writes (`= default`); that none of the cases
of a switch without `default` fits (-Wswitch holds enumerations to all of theirs). What is not compiled for this processor is not
there.

Gates: the engine 95 %, the rooms base, mesh, static_region and record 98 % each. --lines prints each branch that was never
taken, --rooms only those of some rooms. --units runs the unit tests alone, with --rooms those of these rooms alone: what a room's
own tests promise about it (no gate for the engine then). What a program reached is kept beside the build until it is linked anew
or its inputs change, so that only what changed is run again; --again runs all of it, --no-run nothing. A program that fails is
named, and what it reached counts. Exit: 0 all gates hold and nothing failed, 1 not.
"""
import argparse
import collections
import concurrent.futures
import json
import os
import pathlib
import re
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
LEFT_OUT_FILES = ("engine/base/check.cpp",)
GATES = {"base": 98, "mesh": 98, "static_region": 98, "record": 98}
ENGINE_GATE = 95
TESTS = """adjust base engine features geometry loop_closing map mapping matching mesh persist place pose recognition schedule
static_region store tracking world""".split()
# The unit tests of a room where they are not test_<room>.
TESTS_OF = {"frame": ["features", "matching"], "paging": ["store"], "record": ["persist"], "motion": ["tracking"], "": ["engine"]}
FUZZED = "engine features map map_store mesh vocabulary".split()
LIMIT_S = 1800  # for one program; the longest took 5 minutes on a busy machine


def targets(rooms, is_units):
    if is_units:
        wanted = sorted({test for room in rooms for test in TESTS_OF.get(room, [room])}) if rooms else TESTS
        return [f"test_{name}" for name in wanted]
    return [f"test_{name}" for name in TESTS] + [f"fuzz_replay_{name}" for name in FUZZED] + ["stillmesh"]


def program_of(build, target):
    if target == "stillmesh":
        return build / "platform" / "cli" / "stillmesh"
    if target.startswith("fuzz_"):
        return build / "fuzz" / target
    return build / "tests" / target.removeprefix("test_") / target


def command_of(build, target):
    program = str(program_of(build, target))
    if target == "stillmesh":
        return [sys.executable, str(ROOT / "tests/determinism/golden.py"), program]
    if target.startswith("fuzz_"):
        folders = [ROOT / "fuzz" / kind / target.removeprefix("fuzz_replay_") for kind in ("corpus", "regressions")]
        return [program, *(str(folder) for folder in folders if folder.is_dir())]
    return [program, "--gtest_brief=1"]


def run_one(build, raw, target):
    """One program; what it reached lies in raw/<target>.profdata. False: it failed."""
    for old in raw.glob(f"{target}-*.profraw"):
        old.unlink()
    environment = {**os.environ, "LLVM_PROFILE_FILE": str(raw / f"{target}-%m.profraw")}
    begin = time.monotonic()
    try:
        ran = subprocess.run(command_of(build, target), env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             text=True, errors="replace", check=False, timeout=LIMIT_S)
        code, said = ran.returncode, ran.stdout
    except subprocess.TimeoutExpired:
        code, said = f"nothing within {LIMIT_S} s", ""
    print(f"coverage: {target} {'passed' if code == 0 else f'ended with {code}'} ({time.monotonic() - begin:.0f} s)", flush=True)
    if code != 0:
        print(said[-3000:], flush=True)
    written = sorted(raw.glob(f"{target}-*.profraw"))
    if written:  # what a program that was killed wrote may be torn: the others count
        subprocess.run(["llvm-profdata", "merge", "-sparse", "-failure-mode=all", "-o", str(raw / f"{target}.profdata"),
                        *map(str, written)], check=True, stderr=subprocess.DEVNULL)
    for old in written:
        old.unlink()
    return code == 0


def run(build, raw, wanted, arguments):
    """What has been linked since it was run last; those that failed."""
    raw.mkdir(exist_ok=True)
    due = []
    for target in wanted:
        kept, program = raw / f"{target}.profdata", program_of(build, target)
        if not program.is_file():
            sys.exit(f"coverage: {program} is not there: ./run coverage builds it")
        changed_s = max(os.stat(word).st_mtime for word in command_of(build, target) if os.path.exists(word))
        if arguments.again or not kept.is_file() or kept.stat().st_mtime < changed_s:
            kept.unlink(missing_ok=True)
            due.append(target)
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        passed = pool.map(lambda target: run_one(build, raw, target), due)
        failed = [target for target, is_passed in zip(due, passed) if not is_passed]
    for target in failed:  # and will be run anew
        if (raw / f"{target}.profdata").is_file():
            os.utime(raw / f"{target}.profdata", (0, 0))
    return failed


def measured(build, raw, wanted):
    """The branches of every file of the engine: {file: {(line, column): [true, false]}}."""
    data = build / "coverage.profdata"
    kept = [raw / f"{target}.profdata" for target in wanted]
    missing = [file.stem for file in kept if not file.is_file()]
    if missing:
        print(f"coverage: nothing is known of what these reach: {' '.join(missing)}")
    kept = [str(file) for file in kept if file.is_file()]
    if not kept:
        sys.exit("coverage: nothing was run")
    subprocess.run(["llvm-profdata", "merge", "-sparse", "-o", str(data), *kept], check=True)
    programs = [program_of(build, target) for target in wanted]
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


def report(result, rooms, with_lines, is_units):
    """Prints rooms and the worst files; the gates that do not hold."""
    sums = collections.defaultdict(lambda: [0, 0])
    for name, (taken, every, _) in result.items():
        for key in (room_of(name), "engine"):
            sums[key][0] += taken
            sums[key][1] += every
    below = []
    for room, (taken, every) in sorted(sums.items(), key=lambda item: item[1][0] / item[1][1]):
        if is_units and (room == "engine" or (rooms and room not in rooms)):
            continue  # others' tests were not run
        gate = ENGINE_GATE if room == "engine" else GATES.get(room)
        share = 100 * taken / every
        print(f"{room:18} {share:6.2f} %  {taken:5} of {every:5}" + (f"   gate {gate} %" if gate else ""))
        if gate and share < gate:
            below.append(room)
    print("\nfiles with the most branches that were never taken:")
    looked_at = {name: entry for name, entry in result.items() if entry[2] and (not rooms or room_of(name) in rooms)}
    for name, (taken, every, missed) in sorted(looked_at.items(), key=lambda item: -len(item[1][2]))[:25]:
        print(f"{len(missed):4}  {100 * taken / every:6.2f} %  {name}")
    for name, (_, _, missed) in sorted(looked_at.items()) if with_lines else []:
        lines = (ROOT / name).read_text().splitlines()
        for line, column, word in missed:
            print(f"{name}:{line}:{column}: never {word}: {lines[line - 1].strip()[:110]}")
    return below


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", default="")
    parser.add_argument("--units", action="store_true")
    parser.add_argument("--lines", action="store_true")
    parser.add_argument("--no-run", action="store_true")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--targets", action="store_true", help="only print what has to be built")
    parser.add_argument("build", nargs="?", type=pathlib.Path, default=ROOT / "build/proofs")
    arguments = parser.parse_args()
    rooms = [room for room in arguments.rooms.split(",") if room]
    for room in rooms:
        if room != "" and not (ROOT / "engine" / room).is_dir():
            sys.exit(f"coverage: there is no room '{room}' in engine/: --rooms names folders of it")
    wanted = targets(rooms, arguments.units)
    if arguments.targets:
        print(*wanted)
        return 0
    raw = arguments.build / "raw"
    failed = [] if arguments.no_run else run(arguments.build, raw, wanted, arguments)
    below = report(counted(measured(arguments.build, raw, wanted)), rooms, arguments.lines, arguments.units)
    for target in failed:
        print(f"coverage: {target} failed: what it reached counts, but mend it first")
    for room in below:
        print(f"coverage: {room} is below its gate")
    return 1 if failed or below else 0


if __name__ == "__main__":
    sys.exit(main())
