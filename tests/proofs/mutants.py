#!/usr/bin/env python3
"""Small bugs planted in the engine, one at a time: which of them do the tests notice?

usage: mutants.py [--count N] [--minutes M] [--seed S] [--rooms A,B] [--jobs N] [--units] [--again] [--only FILE:LINE]
                  [BUILD]

A mutant is one source of the engine with one change: a sign or a comparison turned, a bound moved by one, a condition dropped
or turned, least for most. It is compiled alone, beside the build folder and with that folder's own command (and checks of
indices, libstdc++'s and the compiler's: who reads past an end dies), and linked before the engine's library: nothing that was
built is touched, so mutants are tried side by side (--jobs). Then the unit tests of its room run, those of one number over all
first, and if they notice nothing the number over the whole engine in tests/tracking, what tests/engine promises of its
interface, and the golden runs and stories of the program, one after another until one notices (recordings:
STILLMESH_TEST_DATA; what the stories show is rendered once). Caught is what fails, dies, or needs more than ten times as
long as without; what the compiler refuses is no mutant and another is drawn.

No mutants, since no test of results can tell them from the engine, by rule and not by list:
  memory  fetching ahead, and room that is reserved: lines with `prefetch`, `kAhead`, `arena` or `create(`
  work    what a piece of work is said to have cost: lines that assign to `units`, call `spend(` or return units, and *units_max
          and *_units functions, whole; a share of a limit that is returned
  bound   `>=` for `>` in `if (x > y) y = x;`, which does the same, and `<=` for `<` in a loop over the slots of a pool that first
          asks whether the slot is taken, which behind the last one it is not
  tie     `<` for `<=` and the like between two computed floating-point numbers, which differ only where both are equal to the
          last bit (clang says which are floating-point, -Wfloat-equal; a comparison with a literal is a mutant)
  same    what survives and compiles with -O2 to the same instructions as the engine
The first three are never drawn, the others looked for among survivors; they are counted and named, and are not in the share.

--units: the unit tests alone, which says what they promise by themselves; what survives them is tried anew without it. What was
tried is kept in BUILD/mutants.jsonl, by the text of the file and of the change: stopped and started again it goes on, and a mutant
that survived is tried anew only with --again (after a test was written). BUILD is build/proofs (preset `proofs`); any other
with tests will do, build/release among them.
Survivors are printed with file, line and change. Exit: 0 at least 95 % caught, 1 not, 2 the tests fail without a mutant.
"""
import argparse
import collections
import concurrent.futures
import contextlib
import json
import os
import pathlib
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

GATE = 95
GOLDEN = pathlib.Path(__file__).resolve().parents[1] / "determinism/golden.py"
sys.path.insert(0, str(GOLDEN.parent))
import golden  # noqa: E402  # the names of its runs and stories
from planted import LEFT_OUT, ROOT, is_no_change, mutants_of, room_of, tie_of  # noqa: E402
# The unit tests of a room: test_<room> of tests/<room>, or those.
TESTS = {"frame": ["features", "matching"], "paging": ["store"], "record": ["persist"], "world": ["world", "mapping"],
         "": ["engine", "store", "persist"]}


def tests_of(room):
    return [f"test_{test}" for test in TESTS.get(room, [room])]


class Build:
    """A build folder: how one source of the engine is compiled, and how a program is linked."""

    def __init__(self, folder):
        self.folder = folder
        self.compile_of = {entry["file"]: entry["command"] for entry in json.loads((folder / "compile_commands.json").read_text())
                           if "stillmesh_engine_objects" in entry["command"]}
        self.link_of = {}
        self.known_instructions = {}
        self.scratch = None  # a folder for mutants, and for what stories show

    @staticmethod
    def path_of(target):
        return f"platform/cli/{target}" if target == "stillmesh" else f"tests/{target[5:]}/{target}"

    def link_command(self, target):
        if target not in self.link_of:
            said = subprocess.run(["ninja", "-C", str(self.folder), "-t", "commands", "-s", self.path_of(target)],
                                  capture_output=True, text=True, check=True).stdout
            self.link_of[target] = self.command_of(said, target)
        return list(self.link_of[target])

    @staticmethod
    def command_of(said, target):
        for line in said.splitlines():
            for part in line.split(" && "):
                words = shlex.split(part) if " -o " in part and "++" in part else []
                if words and " -c " not in part and pathlib.Path(words[words.index("-o") + 1]).name == target:
                    return words
        sys.exit(f"mutants: how {target} is linked is not to be found in the build folder")

    def compiled(self, mutant, work):
        """The object of the mutated source, None if the compiler refuses it."""
        original = ROOT / mutant.file
        source, made = work / original.name, work / "mutant.o"
        source.write_text(with_line(original.read_text(), mutant.line, mutant.after))
        # Indices are checked in the mutated source: who reads one past the end of a span or an array dies, and is caught.
        checks = ("-D_GLIBCXX_ASSERTIONS", "-fsanitize=bounds", "-fsanitize-undefined-trap-on-error")
        words = [*self.without_header(mutant.file), *checks, "-o", str(made), "-c", str(source)]
        ran = subprocess.run(words, cwd=self.folder, capture_output=True, check=False)
        return made if ran.returncode == 0 else None

    def without_header(self, name):
        """The command that compiles a source, without what goes in and out and the header that was compiled before."""
        words, kept = shlex.split(self.compile_of[str(ROOT / name)]), []
        while words:
            word = words.pop(0)
            if word in ("-Xclang", "-o", "-c"):
                words.pop(0)
            elif word not in ("-Winvalid-pch", "-Werror"):
                kept.append(word)
        return kept

    def linked(self, target, mutated, work):
        words = self.link_command(target)
        program = work / target
        words[words.index("-o") + 1] = str(program)
        # First: what the mutated object defines is not looked for in the libraries, and of what headers define its copy counts,
        # which checks indices. The program brings the engine as one object, in which nothing can be replaced; here it gets the
        # library of objects.
        words.insert(1, str(mutated))
        words = [word.replace("libstillmesh-engine.a", "libstillmesh_engine_inner.a") for word in words]
        if shutil.which("ld.lld"):
            words.insert(1, "-fuse-ld=lld")
        ran = subprocess.run(words, cwd=self.folder, capture_output=True, text=True, check=False)
        if ran.returncode != 0:
            sys.exit(f"mutants: {target} does not link:\n{ran.stderr[-2000:]}")
        return program

    def alone(self, name, text, work, *options):
        """The compiler over a text in place of a source, without what only counting needs."""
        source = work / pathlib.Path(name).name
        source.write_text(text)
        counting = ("-O1", "-fprofile-instr-generate", "-fcoverage-mapping")
        words = [word for word in self.without_header(name) if word not in counting]
        return subprocess.run([*words, *options, source.name], cwd=work, capture_output=True, text=True, check=False)

    def instructions(self, name, text, work):
        return self.alone(name, text, work, "-O2", "-S", "-o", "-").stdout

    def instructions_of_engine(self, name, text, work):
        if name not in self.known_instructions:
            self.known_instructions[name] = self.instructions(name, text, work)
        return self.known_instructions[name]

    def equivalent(self, mutant, work):
        """The rule by which a survivor is no mutant, or None."""
        text = (ROOT / mutant.file).read_text()
        turned = tie_of(mutant)
        if turned:
            said = self.alone(mutant.file, with_line(text, mutant.line, turned), work, "-fsyntax-only", "-Wfloat-equal").stderr
            if re.search(rf":{mutant.line}:\d+: warning: comparing floating.point", said):
                return "tie"
        mutated = with_line(text, mutant.line, mutant.after)
        engine = self.instructions_of_engine(mutant.file, text, work)
        return "same" if engine and engine == self.instructions(mutant.file, mutated, work) else None


def with_line(text, line, new):
    lines = text.splitlines(keepends=True)
    lines[line - 1] = new + "\n"
    return "".join(lines)


RUNNING = set()  # groups of processes, which end with this program
SCRATCH = []  # its folder, which goes with it


def ended(command, limit_s):
    """The exit code, and `slow` when the time was up."""
    environment = {**os.environ, "LLVM_PROFILE_FILE": "/dev/null", "STILLMESH_NATIVE_PROGRAM": ""}
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment,
                          start_new_session=True) as process:
        RUNNING.add(process.pid)
        try:
            return process.wait(limit_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return "slow"
        finally:
            RUNNING.discard(process.pid)


def stop(*_):
    """Ctrl-C and the like: what was tried is kept."""
    for group in list(RUNNING):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(group, signal.SIGKILL)
    if SCRATCH:
        shutil.rmtree(SCRATCH[0], ignore_errors=True)
    os._exit(1)


# Tests of one number over all that a room does: they notice most, in a moment.
NUMBERS = "*GoldenBits*"
# All of the engine within seconds: tests/tracking/golden_test.cpp.
WHOLE = ("golden engine", "test_tracking")


def steps_of(room, is_golden):
    """What is run for a mutant of a room: a name and the target that it needs; what notices most for its time first."""
    names = sorted((*golden.RUNS, *golden.SEQUENCES), key=lambda name: name == "loop_closed")
    units = [(test + of, test) for of in (" numbers", "") for test in tests_of(room)]
    whole = [WHOLE] if room != "tracking" else []
    interface = [("test_engine", "test_engine")] if "test_engine" not in tests_of(room) else []
    return units + [step for step in (*whole, *interface, *((f"golden {name}", "stillmesh") for name in names)) if is_golden]


def command_of(build, name, program):
    if name.startswith("golden ") and name != WHOLE[0]:
        return [sys.executable, str(GOLDEN), "--only", name.split()[1], "--rendered", str(build.scratch), str(program)]
    which = "Tracking.GoldenBits" if name == WHOLE[0] else NUMBERS if name.endswith(" numbers") else f"-{NUMBERS}"
    return [str(program), "--gtest_brief=1", "--gtest_fail_fast", f"--gtest_filter={which}"]


def try_mutant(build, mutant, limits, is_golden):
    """What caught it: the name of a test, `compiler`, `rule` and its name: it is none, or None: it survived."""
    with tempfile.TemporaryDirectory(dir=build.scratch) as folder:
        work = pathlib.Path(folder)
        made = build.compiled(mutant, work)
        if made is None:
            return "compiler"
        programs = {}
        for name, target in steps_of(room_of(mutant.file), is_golden):
            if target not in programs:
                programs[target] = build.linked(target, made, work)
            code = ended(command_of(build, name, programs[target]), limits.limit_s(name, target))
            if code not in (0, 77):
                return name + (" (time)" if code == "slow" else "")
        rule = build.equivalent(mutant, work)
        return f"rule {rule}" if rule else None


class Limits:
    """How long each test may take: ten times what it takes without a mutant, which is measured when it is first needed, linked as
    mutants are, and kept until the program is linked anew."""

    def __init__(self, build):
        self.build = build
        self.file = build.folder / "mutants_seconds.json"
        self.kept = json.loads(self.file.read_text()) if self.file.is_file() else {}
        self.of_name = collections.defaultdict(threading.Lock)

    def limit_s(self, name, target):
        with self.of_name[name]:
            linked_s = (self.build.folder / self.build.path_of(target)).stat().st_mtime
            if self.kept.get(name, [0])[0] != linked_s:
                self.kept[name] = [linked_s, self.measured_s(name, target)]
                print(f"mutants: {name} takes {self.kept[name][1]:.1f} s", flush=True)
                self.file.write_text(json.dumps(dict(self.kept)))
            return 10 * self.kept[name][1] + 20

    def measured_s(self, name, target):
        with tempfile.TemporaryDirectory(dir=self.build.scratch) as folder:
            work = pathlib.Path(folder)
            some = next(file for file in self.build.compile_of if file.endswith("engine/base/check.cpp"))
            words = shlex.split(self.build.compile_of[some])
            shutil.copy(self.build.folder / words[words.index("-o") + 1], work / "mutant.o")
            command = command_of(self.build, name, self.build.linked(target, work / "mutant.o", work))
            begin = time.monotonic()
            code = ended(command, 1800)
            if code not in (0, 77):
                print(f"mutants: {name} fails without a mutant ({code}): {shlex.join(command)}", flush=True)
                os._exit(2)  # of a thread; nothing that is tried by now would mean anything
            return time.monotonic() - begin


def drawn(arguments):
    """All mutants of the rooms in the order of the seed."""
    rooms = {}
    for path in sorted((ROOT / "engine").rglob("*.cpp")):
        name = path.relative_to(ROOT).as_posix()
        wanted = not arguments.rooms or room_of(name) in arguments.rooms.split(",")
        if wanted and not LEFT_OUT.search(name):
            rooms.setdefault(room_of(name), []).extend(mutants_of(name))
    generator = random.Random(arguments.seed)
    everything = [mutant for mutants in rooms.values() for mutant in mutants]
    generator.shuffle(everything)
    everything = [mutant for mutant in everything if not is_no_change(mutant)]
    if arguments.only:
        return [mutant for mutant in everything if f"{mutant.file}:{mutant.line}" == arguments.only]
    return everything


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no mutant after that")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", default="")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--units", action="store_true", help="the unit tests alone, without golden runs and stories")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--only", help="FILE:LINE: every mutant of one line")
    parser.add_argument("--targets", action="store_true", help="only print what has to be built")
    parser.add_argument("build", nargs="?", type=pathlib.Path, default=ROOT / "build/proofs")
    arguments = parser.parse_args()
    mutants = drawn(arguments)
    rooms = sorted({room_of(mutant.file) for mutant in mutants})
    if arguments.targets:
        print(*([] if arguments.units else ["stillmesh"]),
              *sorted({target for room in rooms for _, target in steps_of(room, not arguments.units)} - {"stillmesh"}))
        return 0
    if not mutants:
        sys.exit("mutants: nothing to change there: --rooms names folders of engine/, --only a line of a .cpp file of it")
    build = Build(arguments.build.resolve())
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    with tempfile.TemporaryDirectory(prefix="mutants", dir=build.folder) as folder:
        SCRATCH.append(folder)
        build.scratch = pathlib.Path(folder)
        return say(*try_all(build, mutants, Limits(build), arguments))


def known_before(file, is_units):
    """What was tried before, by key; that a mutant survives the unit tests alone says nothing of all tests."""
    known = {}
    for line in file.read_text().splitlines() if file.is_file() else []:
        entry = json.loads(line)
        if entry["caught"] or entry["units"] == is_units:
            known[entry["key"]] = entry["caught"]
    return known


def try_all(build, mutants, limits, arguments):
    """As many mutants as are asked for, side by side: those tried with what caught them, and those that are none by rule."""
    known_file = build.folder / "mutants.jsonl"
    known = known_before(known_file, arguments.units)
    end = time.monotonic() + 60 * arguments.minutes
    tried, none, waiting = [], [], iter(mutants)

    def one(mutant):
        key = mutant.key((ROOT / mutant.file).read_text())
        caught = known.get(key)
        if key not in known or (caught is None and arguments.again):
            caught = try_mutant(build, mutant, limits, not arguments.units)
            with known_file.open("a") as file:
                file.write(json.dumps({"key": key, "at": f"{mutant.file}:{mutant.line}", "caught": caught,
                                       "units": arguments.units}) + "\n")
        return mutant, caught

    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        running = set()
        while True:
            left = arguments.count - len(tried) - len(running) if time.monotonic() < end else 0
            for mutant in [m for _, m in zip(range(min(left, arguments.jobs - len(running))), waiting)]:
                running.add(pool.submit(one, mutant))
            if not running:
                return tried, none
            done, running = concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED)
            for mutant, caught in (future.result() for future in done):
                if caught == "compiler":
                    continue
                is_none = caught is not None and caught.startswith("rule ")
                (none if is_none else tried).append((mutant, caught))
                print(f"{len(tried):4} {'SURVIVED' if caught is None else caught}: {mutant}", flush=True)


def say(tried, none):
    survivors = [mutant for mutant, caught in tried if caught is None]
    for mutant in survivors:
        print(f"survived: {mutant}")
    units = sum(caught is not None and caught.startswith("test_") for _, caught in tried)
    share = 100 * (len(tried) - len(survivors)) / max(1, len(tried))
    rules = collections.Counter(caught.removeprefix("rule ") for _, caught in none)
    print(f"mutants: {len(tried)} tried, {len(tried) - len(survivors)} caught ({share:.1f} %): {units} by unit tests of their "
          f"room, {len(tried) - len(survivors) - units} by golden hashes alone; gate {GATE} %; not counted by rule: "
          + (", ".join(f"{count} {rule}" for rule, count in sorted(rules.items())) or "none"))
    return 0 if share >= GATE else 1


if __name__ == "__main__":
    sys.exit(main())
