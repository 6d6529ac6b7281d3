#!/usr/bin/env python3
"""Checks of the house: python3 house.py CHECK --source DIR --build DIR --compiler CXX ... Exit 0 when it holds.

  symbols   the engine library needs nothing but a short list of symbols, and exports no Eigen and nothing weak
  rooms     a room of engine/ includes only rooms before it, and no file comes back to itself through what it includes;
            hal/ and platform/ see what they may; no heap headers
  headers   public headers compile alone, and no Eigen comes in with them
  text      no open ends and no absolute paths in what is committed
  flags     every file is compiled with the contract's flags
  packagers without a preset warnings are no errors
  sizes     in engine/ a function, a file and a list of parameters are short, but for exceptions.txt
  tested    every header of a room of engine/ is included by a test
  references  what a text names as a file of the repository is there
  stack     every frame in the engine is bounded and small, nothing recurses; prints the deepest path
  hardening the program is position independent, its tables are read-only once it runs, its stack guarded and no code, libc's calls
            know their buffers, and jumps and returns are marked or signed; so far its modules, each of which shows one function alone
  size      code and read-only data of the engine library stay below the limit, and it has no writable data

Every check is a function from text to a list of complaints, so that selftest.py can feed it wrong text.
"""
import argparse
import fnmatch
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import cpp_reader

# What the compiler itself may call, and the square root (correctly rounded by IEEE 754 everywhere; only compilers
# that do not optimise call it). __popcountdi2 and __ctzdi2 are libgcc's, for processors without the instruction.
# What the program may define to hear of a failed check is a weak reference.
SYMBOLS_ALLOWED = {"stillmesh_check_failed", "memcpy", "memmove", "memset", "memcmp", "sqrt", "sqrtf", "_GLOBAL_OFFSET_TABLE_", "__popcountdi2", "__ctzdi2"}
# The helpers of the ARM run-time ABI: integer division, 64-bit integers to double and back, copies.
SYMBOLS_ALLOWED_PATTERN = re.compile(r"^__aeabi_(u?l?i?divmod|u?idiv|u?l2d|[df]2u?lz|memcpy\d?|memmove\d?|memset\d?|memclr\d?)$")

# Headers of the standard library that need no heap, no locale, no clock, no threads; and intrinsics.
ENGINE_SYSTEM_HEADERS = {
    "algorithm", "array", "bit", "climits", "cmath", "compare", "concepts", "cstddef", "cstdint", "cstring",
    "initializer_list", "iterator", "limits", "new", "numbers", "numeric", "optional", "span", "tuple", "type_traits",
    "utility", "version", "emmintrin.h", "immintrin.h", "arm_neon.h"}
# Files directly in engine/ that are plain data, for every room.
ENGINE_SHARED_HEADERS = {"engine/limits.hpp", "engine/configuration.hpp", "engine/motion_hint.hpp", "engine/outputs.hpp",
                         "engine/parameters.hpp"}
# Each has a task that works on the world and knows no other task.
HAL_SEES = ("engine/geometry/camera_model.hpp", "engine/geometry/lens.hpp", "engine/geometry/rigid_transform.hpp",
            "engine/limits.hpp")
TASK_ROOMS = {"tracking", "loop_closing", "paging"}
FRAME_BYTES_MAX = 20 * 1024  # the largest is the radix sort of the corners: two histograms of 8 KiB
STACK_BYTES_MAX = 96 * 1024
SIZE_BYTES_MAX = 600 * 1024  # code, read-only data, and tables of addresses (read-only once they are relocated)
WRITABLE_BYTES_MAX = 0
FUNCTION_LINES_MAX = 70
FILE_LINES_MAX = 400
PARAMETERS_MAX = 5
EXCEPTIONS = pathlib.Path(__file__).with_name("exceptions.txt")
EXCEPTIONS_MAX = 30  # lowered with every one that goes, never raised
WRONG_ON_PURPOSE = ("tests/house/selftest.py", "tests/house/exceptions.txt")  # what names files that are not there


def tracked_files(source):
    names = []
    if shutil.which("git"):
        listed = subprocess.run(["git", "-C", source, "ls-files", "-co", "--exclude-standard"],
                                capture_output=True, text=True, check=False)
        names = listed.stdout.splitlines() if listed.returncode == 0 else []
    if not names:  # a tarball, or no git
        names = [str(p.relative_to(source)) for p in pathlib.Path(source).rglob("*") if p.is_file()]
        names = [n for n in names if not re.match(r"(build|out|\.git)[^/]*/", n) and "__pycache__" not in n]
    return sorted(n for n in names if (pathlib.Path(source) / n).is_file())


def read(path):
    return pathlib.Path(path).read_text(encoding="utf-8", errors="replace")


# --- symbols ---------------------------------------------------------------------------------------------------------

def symbol_complaints(undefined, exported):
    """undefined: names; exported: (type letter, demangled name) pairs."""
    complaints = []
    for name in sorted(undefined):
        if name not in SYMBOLS_ALLOWED and not SYMBOLS_ALLOWED_PATTERN.match(name):
            complaints.append(f"the engine needs '{name}'")
    for letter, name in exported:
        if "Eigen" in name:
            complaints.append(f"exports Eigen: {name}")
        elif letter in "WVuw":
            complaints.append(f"exports a weak symbol, which another library could replace: {name}")
        elif not re.search(r"\bstillmesh::", name):
            complaints.append(f"exports '{name}', which is not in the namespace")
    return complaints


def library_symbols(arguments, path):
    def nm(*options):
        return subprocess.run([arguments.nm, *options, str(path)], capture_output=True, text=True, check=True).stdout
    undefined = set(re.findall(r"^\s+[Uwv] (\S+)", nm("-u"), re.M))
    defined_inside = set(re.findall(r"^[0-9a-f]+ [A-Za-z] (\S+)", nm("--defined-only"), re.M))
    exported = re.findall(r"^[0-9a-f]+ ([A-Za-z]) (.+)$", nm("-g", "--defined-only", "-C"), re.M)
    return undefined - defined_inside, exported


def check_symbols(arguments):
    undefined, exported = library_symbols(arguments, arguments.library)
    print("needs:   ", ", ".join(sorted(undefined)) or "nothing")
    print(f"exports:  {len(exported)} symbols")
    for _, name in exported:
        print("         ", name)
    return symbol_complaints(undefined, exported)


# --- rooms -----------------------------------------------------------------------------------------------------------

def includes_of(text):
    return re.findall(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', text, re.M)


def cmake_list(text, name):
    found = re.search(rf"set\({name}\s+([^)]*)\)", text)
    return found.group(1).split() if found else []


def room_complaints(files, rooms, public_headers):
    """files: {path: text} of engine/, hal/ and platform/."""
    order = {room: i for i, room in enumerate(rooms)}
    complaints = []
    for path, text in sorted(files.items()):
        parts = path.split("/")
        for kind, name in includes_of(text):
            wrong = None
            target = name.split("/")
            if parts[0] == "engine":
                room = parts[1] if len(parts) > 2 else None
                if room is not None and room not in order:
                    wrong = f"engine/{room} is not in STILLMESH_ROOMS"
                elif kind == "<":
                    if name.startswith("Eigen/"):
                        if path in public_headers:
                            wrong = "a public header includes Eigen"
                    elif name not in ENGINE_SYSTEM_HEADERS:
                        wrong = f"<{name}> is not for the engine"
                elif target[0] != "engine":
                    wrong = f"the engine knows neither hal nor platform nor anybody else ({name})"
                elif len(target) == 2:
                    if room is not None and name not in ENGINE_SHARED_HEADERS:
                        wrong = f"{name} is the front door; rooms are behind it"
                elif target[1] not in order:
                    wrong = f"engine/{target[1]} is no room"
                elif room is not None and order[target[1]] > order[room]:
                    wrong = f"room {room} comes before {target[1]} ({name})"
                elif room in TASK_ROOMS and target[1] in TASK_ROOMS and room != target[1]:
                    wrong = f"rooms {room} and {target[1]} stand side by side ({name}): what they share is in engine/world"
                if wrong is None and path in public_headers and kind == '"' and name not in public_headers:
                    wrong = f"a public header includes the inner {name}"
            elif kind == '"' and target[0] == "engine":
                if name not in public_headers:
                    wrong = f"{name} is not a public header"
                elif parts[0] == "hal" and not (target[1] in ("base", "frame") or
                                                name in HAL_SEES):
                    wrong = f"hal sees engine/base, engine/frame, cameras and how they stand only ({name})"
            elif parts[0] == "hal" and kind == '"' and target[0] == "platform":
                wrong = f"hal does not know platform ({name})"
            elif name.startswith("Eigen/") and parts[0] == "hal":
                wrong = "hal has no Eigen"
            if wrong is not None:
                complaints.append(f"{path}: {wrong}")
    return complaints


def circle_complaints(files):
    """Each circle of includes once, as the path around it: the order of rooms says nothing of the files in one room."""
    graph = {path: [name for kind, name in includes_of(text) if kind == '"' and name in files] for path, text in files.items()}
    complaints, done = [], set()
    for start in sorted(graph):
        if start in done:
            continue
        done.add(start)
        way, left = [start], [iter(graph[start])]
        while way:
            name = next(left[-1], None)
            if name is None:
                way.pop()
                left.pop()
            elif name in way:
                complaints.append("a circle of includes: " + " > ".join(way[way.index(name):] + [name]))
            elif name not in done:
                done.add(name)
                way.append(name)
                left.append(iter(graph[name]))
    return complaints


def public_headers_of(arguments):
    names = cmake_list(read(f"{arguments.source}/engine/CMakeLists.txt"), "STILLMESH_PUBLIC_HEADERS")
    front = [name for name in ("engine.hpp", "configuration.hpp") if pathlib.Path(arguments.source, "engine", name).is_file()]
    return ["engine/" + name for name in dict.fromkeys(names + front)]


def check_rooms(arguments):
    rooms = cmake_list(read(f"{arguments.source}/engine/CMakeLists.txt"), "STILLMESH_ROOMS")
    files = {name: read(f"{arguments.source}/{name}") for name in tracked_files(arguments.source)
             if name.split("/")[0] in ("engine", "hal", "platform") and name.endswith((".hpp", ".cpp", ".inc", ".h"))}
    print(f"{len(files)} files; rooms: {' < '.join(rooms)}")
    return room_complaints(files, rooms, public_headers_of(arguments)) + circle_complaints(files)


# --- headers ---------------------------------------------------------------------------------------------------------

def header_complaints(arguments, source, headers):
    """Compiles one file per header that includes nothing else, without Eigen's include path, and reads what came in."""
    complaints = []
    for header in headers:
        if not (pathlib.Path(source) / header).is_file():
            complaints.append(f"{header} is listed as public and not there")
            continue
        run = subprocess.run([arguments.compiler, "-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-H",
                              "-I", source, "-x", "c++", "-"], input=f'#include "{header}"\n#include "{header}"\n',
                             capture_output=True, text=True, check=False)
        if run.returncode != 0:
            errors = [line for line in run.stderr.splitlines() if "error" in line]
            complaints.append(f"{header} does not compile alone: {errors[0] if errors else run.stderr[-300:]}")
        elif re.search(r"^\.+ .*/Eigen/", run.stderr, re.M):
            complaints.append(f"{header} brings Eigen in")
    return complaints


def check_headers(arguments):
    headers = public_headers_of(arguments)
    print(f"{len(headers)} public headers")
    return header_complaints(arguments, arguments.source, headers) + ([] if headers else ["no public headers listed"])


# --- text ------------------------------------------------------------------------------------------------------------

OPEN_END = re.compile(r"\b(TO" r"DO|FIX" r"ME|XX" r"X|HA" r"CK)\b")
ABSOLUTE_PATH = re.compile(r"(?<![\w.$}{/<])/(home|root|work|Users|mnt|srv|build)/[\w.-]+")
TEXT_SUFFIXES = (".hpp", ".cpp", ".h", ".c", ".py", ".md", ".txt", ".cmake", ".json", ".toml", ".yaml", ".yml", ".sh",
                 ".html", ".js", ".css", ".inc", ".in", ".clang-tidy", ".clang-format")
INPUTS = re.compile(r"fuzz/(corpus|regressions|dictionaries)/|tests/\w+/data/")  # what programs read


def is_text(name):
    """Whether a person wrote it to be read; scripts have no suffix."""
    return not INPUTS.match(name) and (name.endswith(TEXT_SUFFIXES) or "." not in os.path.basename(name))


def text_complaints(files):
    complaints = []
    for path, text in sorted(files.items()):
        for number, line in enumerate(text.splitlines(), 1):
            if OPEN_END.search(line):
                complaints.append(f"{path}:{number}: an open end: {line.strip()[:80]}")
            if ABSOLUTE_PATH.search(line):
                complaints.append(f"{path}:{number}: an absolute path: {line.strip()[:80]}")
    return complaints


def check_text(arguments):
    files = {name: read(f"{arguments.source}/{name}") for name in tracked_files(arguments.source)
             if is_text(name) and not name.startswith("tests/vm/")}  # its paths are those of a machine inside
    print(f"{len(files)} text files")
    return text_complaints(files)


# --- flags -----------------------------------------------------------------------------------------------------------

def flag_complaints(commands, source, warnings_are_errors):
    """commands: entries of compile_commands.json."""
    complaints = []
    seen_engine = False
    for entry in commands:
        path = os.path.relpath(os.path.join(entry["directory"], entry["file"]), source)
        if path.startswith("..") or (path.startswith("build/") and path.endswith(".c")):
            continue  # what is not ours, such as what Cyclone DDS's compiler makes of hal/ros2/messages.idl
        path = re.sub(r"^build/[^/]+/", "", path)  # several files of a room, included in one
        flags = entry["command"].split() if "command" in entry else entry["arguments"]

        def last(*names):
            return max([i for i, flag in enumerate(flags) if flag in names], default=-1)
        standard = "-std=c99" if path.endswith(".c") else "-std=c++20"
        needed = ["-ffp-contract=off", "-Wall", "-Wextra", standard] + ["-Werror"] * warnings_are_errors
        if path.startswith("engine/"):
            seen_engine = True
            needed += ["-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-fvisibility=hidden",
                       "-DEIGEN_DONT_VECTORIZE", "-DEIGEN_NO_MALLOC"]
        for flag in needed:
            if flag not in flags:
                complaints.append(f"{path}: compiled without {flag}")
        if not warnings_are_errors and "-Werror" in flags:
            complaints.append(f"{path}: compiled with -Werror, which another compiler's new warning would turn into a failure")
        for flag in flags:
            if flag in ("-Ofast", "-ffast-math", "-march=native", "-mtune=native", "-funsafe-math-optimizations",
                        "-fassociative-math", "-ffp-contract=fast", "-mfma") or flag.startswith("-DNDEBUG"):
                complaints.append(f"{path}: compiled with {flag}")
        if last("-fno-math-errno") < last("-fno-fast-math", "-fmath-errno"):
            complaints.append(f"{path}: -fno-fast-math after -fno-math-errno turns errno on again")
    if not seen_engine:
        complaints.append("no engine file in compile_commands.json")
    return complaints


def preset_complaints(presets):
    """presets: configurePresets of CMakePresets.json. Every one that can be named has warnings as errors."""
    by_name = {preset["name"]: preset for preset in presets}

    def value(name):
        own = by_name[name].get("cacheVariables", {}).get("STILLMESH_WERROR")
        parents = by_name[name].get("inherits", [])
        parents = [parents] if isinstance(parents, str) else parents
        return own or next((found for found in map(value, parents) if found), None)
    return [f"preset '{name}' does not turn warnings into errors" for name, preset in by_name.items()
            if not preset.get("hidden") and value(name) != "ON"]


def check_flags(arguments):
    presets = json.loads(read(f"{arguments.source}/CMakePresets.json"))["configurePresets"]
    commands = json.loads(read(f"{arguments.build}/compile_commands.json"))
    # A preset builds in build/NAME: what lies there is held to it, however it was configured.
    build = os.path.relpath(arguments.build, f"{arguments.source}/build")
    is_own = build in [preset["name"] for preset in presets]
    print(f"{len(commands)} compile commands; {'a build of a preset' if is_own else 'no build of a preset'}")
    cache = read(f"{arguments.build}/CMakeCache.txt")
    warnings_are_errors = is_own or re.search(r"^STILLMESH_WERROR:BOOL=(ON|1|TRUE)$", cache, re.M) is not None
    return preset_complaints(presets) + flag_complaints(commands, arguments.source, warnings_are_errors)


# --- packagers -------------------------------------------------------------------------------------------------------

def check_packagers(arguments):
    """Configures as somebody else would, the engine alone and without a preset, and reads the compile commands."""
    with tempfile.TemporaryDirectory() as build:
        run = subprocess.run(["cmake", "-S", arguments.source, "-B", build, "-DSTILLMESH_ENGINE_ONLY=ON",
                              "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", f"-DCMAKE_CXX_COMPILER={arguments.compiler}"],
                             capture_output=True, text=True, check=False)
        if run.returncode != 0:
            return [f"cmake without a preset fails: {run.stderr[-500:]}"]
        commands = json.loads(read(f"{build}/compile_commands.json"))
    print(f"{len(commands)} compile commands")
    return flag_complaints(commands, arguments.source, warnings_are_errors=False)


# --- stack -----------------------------------------------------------------------------------------------------------

def frame_complaints(usage):
    """usage: lines of gcc's .su files: place:line:column:function <tab> bytes <tab> kind."""
    frames, complaints = [], []
    for line in usage:
        place, size, kind = line.rsplit("\t", 2)
        frames.append((int(size), place))
        if kind not in ("static", "dynamic,bounded"):
            complaints.append(f"a frame of unbounded size: {place} ({kind})")
        elif int(size) > FRAME_BYTES_MAX:
            complaints.append(f"a frame of {size} bytes, limit {FRAME_BYTES_MAX}: {place}")
    return sorted(frames, reverse=True), complaints


def function_of(symbol):
    """A section of its own is named after its function; a cold part belongs to its function."""
    symbol = re.sub(r"^\.text\.(unlikely\.|hot\.|startup\.)?", "", symbol)
    return re.sub(r"\.cold(\.\d+)?$", "", symbol)


def call_graph(disassembly):
    """{function: (frame bytes, {callees}, has indirect calls)} from `objdump -dr` of x86-64 code."""
    graph, name, last = {}, None, None
    for line in disassembly.splitlines():
        head = re.match(r"^[0-9a-f]+ <(.+)>:$", line)
        if head:
            name = function_of(head.group(1))
            frame, callees, indirect = graph.get(name, (8, set(), False))
            graph[name] = (frame, callees, indirect)
            last = None
            continue
        if name is None:
            continue
        frame, callees, indirect = graph[name]
        relocation = re.match(r"^\s+[0-9a-f]+:\s+R_X86_64_\w+\s+(\S+?)([-+]0x[0-9a-f]+)?$", line)
        if relocation:
            if last in ("call", "jump"):
                callee = function_of(relocation.group(1))
                if last == "call" or callee != name:  # a jump to itself is a loop, or its cold part
                    callees.add(callee)
            last = None
            continue
        last = None
        instruction = re.match(r"^\s+[0-9a-f]+:\s+(?:bnd |notrack )?(\w+)\s*(.*)$", line)
        if not instruction:
            continue
        mnemonic, operands = instruction.groups()
        mnemonic = {"pushq": "push", "subq": "sub", "callq": "call"}.get(mnemonic, mnemonic)  # as LLVM writes them
        if mnemonic == "push":
            frame += 8
        elif mnemonic == "sub" and operands.startswith("$0x") and operands.endswith(",%rsp"):
            size = int(operands[1:].split(",")[0], 16)
            frame += size if size < 1 << 62 else 0  # a negative number gives the frame back
        elif mnemonic == "lea" and (pages := re.match(r"^-0x([0-9a-f]+000)\(%rsp\),%r11$", operands)):
            frame += int(pages.group(1), 16) - 0x1000  # the end of a loop that takes page after page; its sub is one of them
        elif mnemonic == "call" or mnemonic.startswith("j"):
            last = "call" if mnemonic == "call" else "jump"
            if operands.startswith("*"):
                indirect = indirect or last == "call"
            else:
                # A target in the middle of the function itself stands for the relocation on the next line.
                target = re.search(r"<([^>+]+)(\+0x[0-9a-f]+)?>", operands)
                if target and (function_of(target.group(1)) != name or (last == "call" and not target.group(2))):
                    callees.add(function_of(target.group(1)))
        graph[name] = (frame, callees, indirect)
    return graph


def graph_complaints(graph):
    """Recursion, and the deepest path from any function (indirect calls count as nothing: they are the ports)."""
    complaints, depth, state = [], {}, {}

    def visit(name, path):
        if name not in graph:
            return 0, [name]
        if state.get(name) == "open":
            complaints.append("recursion: " + " -> ".join(path[path.index(name):] + [name]))
            return 0, [name]
        if name in depth:
            return depth[name]
        state[name] = "open"
        deepest = (0, [])
        for callee in sorted(graph[name][1]):
            below = visit(callee, path + [name])
            deepest = max(deepest, below, key=lambda d: d[0])
        state[name] = "closed"
        depth[name] = (graph[name][0] + deepest[0], [name] + deepest[1])
        return depth[name]

    sys.setrecursionlimit(10000)
    for name in sorted(graph):
        visit(name, [])
    worst = max(depth.values(), key=lambda d: d[0], default=(0, []))
    if worst[0] > STACK_BYTES_MAX:
        complaints.append(f"the deepest path needs {worst[0]} bytes of stack, limit {STACK_BYTES_MAX}")
    return worst, complaints


def check_stack(arguments):
    usage = []
    for file in sorted(pathlib.Path(arguments.build, "engine").rglob("*.su")):
        usage += [line for line in read(file).splitlines() if line]
    frames, complaints = frame_complaints(usage)
    if not frames:
        return ["no .su files in the build: gcc's -fstack-usage is missing"]
    print(f"{len(frames)} functions; largest frames:")
    for size, place in frames[:8]:
        print(f"  {size:6d} bytes  {place[:150]}")
    machine = subprocess.run([arguments.compiler, "-dumpmachine"], capture_output=True, text=True, check=True).stdout
    if machine.startswith("x86_64"):
        disassembly = subprocess.run([arguments.objdump, "-dr", "--no-show-raw-insn", arguments.library],
                                     capture_output=True, text=True, check=True).stdout
        graph = call_graph(disassembly)
        worst, more = graph_complaints(graph)
        complaints += more
        print(f"{len(graph)} functions in the call graph, {sum(len(g[1]) for g in graph.values())} edges, "
              f"{sum(g[2] for g in graph.values())} functions call through pointers (ports, kernels)")
        print(f"deepest path: {worst[0]} bytes")
        names = subprocess.run(["c++filt"], input="\n".join(worst[1]), capture_output=True, text=True, check=True).stdout
        for name, plain in zip(worst[1], names.splitlines()):
            print(f"  {graph[name][0] if name in graph else 0:6d}  {plain[:120]}")
        if not graph:
            complaints.append("the disassembly could not be read")
    return complaints


# --- hardening -------------------------------------------------------------------------------------------------------

# What stands at the entry of a function that may be reached through a pointer, or that signs where it returns to; the feature
# in the marks of an object; and how a large frame is touched page by page.
ENTRIES = {"Advanced Micro Devices X86-64": (r"endbr64", "x86 feature: IBT, SHSTK", r"sub +\$0x1000,%rsp\n.*\b(or|mov)q +\$0x0,(0x[0-9a-f]+)?\(%rsp\)"),
           # Frames below 64 KiB are not: gcc counts on a guard of that size there.
           "AArch64": (r"paciasp|hint\s+#0x19|bti", "AArch64 feature: BTI, PAC", "")}


def mapped_complaints(file):
    """file: readelf -Whldn --dyn-syms of a program or a library."""
    return [sentence for holds, sentence in (
        ("GNU_RELRO" in file, "tables of addresses stay writable (no relro)"),
        (re.search(r"FLAGS_1.*\bNOW\b|BIND_NOW", file), "addresses are filled in while it runs (not -z now)"),
        (re.search(r"GNU_STACK(\s+0x[0-9a-f]+){5}\s+RW\s", file), "the stack is code, or is not said not to be"),
        ("TEXTREL" not in file, "code is written to when it is loaded"),
        ("__stack_chk_fail" in file, "no guards on the stack"),
        (re.search(r"\b__(?!stack)\w+_chk\b", file), "libc's calls do not know their buffers (_FORTIFY_SOURCE)")) if not holds]


def module_complaints(file):
    """file: as above, of a library that the program opens."""
    # Num: Value Size Type Bind Vis Ndx Name; version nodes are absolute
    shown = re.findall(r"^\s*\d+: [0-9a-f]+\s+\w+\s+(?:FUNC|OBJECT|TLS|NOTYPE)\s+(?:GLOBAL|WEAK|UNIQUE)\s+\w+\s+\d+ (\S+)", file, re.M)
    return mapped_complaints(file) + ([] if shown == ["stillmesh_module"] else [f"shows {shown[:8]}, not its one function"])


def hardening_complaints(program, main, library, library_notes):
    """program: readelf -Whldn --dyn-syms of it; main: its disassembled main; of the engine library: the disassembly, and readelf -n."""
    complaints = []

    def expect(holds, sentence):
        if not holds:
            complaints.append(sentence)
    expect(re.search(r"Type:\s+DYN", program) and re.search(r"FLAGS_1.*\bPIE\b", program), "not position independent")
    complaints += mapped_complaints(program)
    machine = re.search(r"Machine:\s+(.*\S)", program)
    entry, marks, touch = ENTRIES.get(machine.group(1) if machine else "", (None, None, None))
    if entry:
        expect(re.search(entry, main), "main has no mark for a jump or a return")
        expect(marks in library_notes, f"the library is not marked: {marks}")
        expect(re.search(touch, library), "large frames are not touched page by page")
    return complaints


def hardening_of(arguments, program, library):
    def said(*command):
        return subprocess.run(command, capture_output=True, text=True, check=True, env={**os.environ, "LC_ALL": "C"}).stdout
    return hardening_complaints(said(arguments.readelf, "-Whldn", "--dyn-syms", program),
                                said(arguments.objdump, "-d", "--no-show-raw-insn", "--disassemble=main", program),
                                said(arguments.objdump, "-d", "--no-show-raw-insn", library),
                                said(arguments.readelf, "-n", library))


def check_hardening(arguments):
    complaints = hardening_of(arguments, arguments.program, arguments.library)
    for module in arguments.modules:
        said = subprocess.run((arguments.readelf, "-Whldn", "--dyn-syms", module), capture_output=True, text=True,
                              check=True, env={**os.environ, "LC_ALL": "C"}).stdout
        complaints += [f"{module}: {complaint}" for complaint in module_complaints(said)]
    return complaints


# --- size ------------------------------------------------------------------------------------------------------------

def size_complaints(headers):
    """headers: what objdump -h prints. Complaints, and the bytes of code, of read-only data and of writable data."""
    code = constant = writable = 0
    for name, size, flags in re.findall(r"^\s*\d+\s+(\S+)\s+([0-9a-f]+)(?:\s+[0-9a-f]+){3}\s+2\*\*\d+\s*\n\s+(.*)$", headers, re.M):
        flags = flags.replace(" ", "").split(",")
        size = int(size, 16)
        if "ALLOC" not in flags:
            continue
        if "CODE" in flags:
            code += size
        elif "READONLY" in flags or name.startswith(".data.rel.ro"):
            constant += size
        else:
            writable += size
    complaints = []
    if code == 0:
        complaints.append("no code found in the engine library")
    if code + constant > SIZE_BYTES_MAX:
        complaints.append(f"{code + constant} bytes of code and read-only data, limit {SIZE_BYTES_MAX}")
    if writable > WRITABLE_BYTES_MAX:
        complaints.append(f"{writable} bytes of writable data, limit {WRITABLE_BYTES_MAX}: where would a second engine have its own?")
    return complaints, (code, constant, writable)


def check_size(arguments):
    headers = subprocess.run([arguments.objdump, "-h", arguments.library], capture_output=True, text=True, check=True).stdout
    complaints, (code, constant, writable) = size_complaints(headers)
    print(f"{code} bytes of code, {constant} of read-only data, {writable} of writable data")
    return complaints


# --- sizes -----------------------------------------------------------------------------------------------------------

def exceptions_of(text):
    """{(kind, place): (size, reason)} of exceptions.txt, and what is wrong with it. Size 0: the kind has none."""
    exceptions, complaints = {}, []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        found = re.fullmatch(r"(file|function|parameters|untested|reference) (\S+(?: [^\s\d]\S*)?)(?: (\d+))?: (\S.*)", line)
        if not found or (found.group(3) is None) == (found.group(1) in ("file", "function", "parameters")):
            complaints.append(f"exceptions.txt:{number}: not 'kind place size: reason': {line}")
        elif (found.group(1), found.group(2)) in exceptions:
            complaints.append(f"exceptions.txt:{number}: stands there twice: {line}")
        else:
            exceptions[found.group(1), found.group(2)] = (int(found.group(3) or 0), found.group(4))
    return exceptions, complaints


def excepted_complaints(found, exceptions, kinds):
    """found: {(kind, place): (size, sentence)} of what is too large or wrong. An exception holds for exactly the size it
    names (of all places that a * in it stands for, the largest), so that none outlives its reason and the list only shrinks."""
    complaints, largest = [], {}
    for (kind, place), (size, sentence) in sorted(found.items()):
        name = next((e for e in exceptions if e[0] == kind and fnmatch.fnmatchcase(place, e[1])), None)
        if name is None:
            complaints.append(f"{place}: {sentence}")
        elif size > exceptions[name][0]:
            complaints.append(f"{place}: {sentence}; its exception allows {exceptions[name][0]}")
        largest[name] = max(size, largest.get(name, 0))
    for name, (allowed, _) in sorted(exceptions.items()):
        if name[0] in kinds and name not in largest:
            complaints.append(f"exceptions.txt: '{' '.join(name)}' is needed no more: take it out")
        elif name[0] in kinds and largest[name] < allowed:
            complaints.append(f"exceptions.txt: '{' '.join(name)}' has shrunk from {allowed} to {largest[name]}: write that")
    return complaints


def count_complaints(count, count_max):
    if count > count_max:
        return [f"exceptions.txt: {count} exceptions, at most {count_max}"]
    return [f"exceptions.txt: {count} exceptions: lower EXCEPTIONS_MAX to that"] if count < count_max else []


def sizes_of(files):
    """files: {path: text} of engine/. What is above its limit."""
    found = {}
    for path, text in files.items():
        lines = len(text.splitlines())
        if lines > FILE_LINES_MAX:
            found["file", path] = (lines, f"{lines} lines, limit {FILE_LINES_MAX}")
        for function in cpp_reader.functions_of(text):
            place = f"{path} {function.name}"
            for kind, size, limit in (("function", function.lines, FUNCTION_LINES_MAX),
                                      ("parameters", function.parameters, PARAMETERS_MAX)):
                if size > max(limit, found.get((kind, place), (0,))[0]):  # of overloads the largest
                    unit = "parameters" if kind == "parameters" else "lines"
                    found[kind, place] = (size, f"{size} {unit}, limit {limit}")
    return found


def check_sizes(arguments):
    exceptions, complaints = exceptions_of(read(EXCEPTIONS))
    files = {name: read(f"{arguments.source}/{name}") for name in tracked_files(arguments.source)
             if name.startswith("engine/") and name.endswith((".hpp", ".cpp", ".inc"))}
    found = sizes_of(files)
    print(f"{len(files)} files; above a limit: {len(found)}")
    complaints += count_complaints(len(exceptions), EXCEPTIONS_MAX)
    return complaints + excepted_complaints(found, exceptions, ("file", "function", "parameters"))


# --- tested ----------------------------------------------------------------------------------------------------------

def untested_of(files, rooms):
    """files: {path: text} of engine/ and tests/. Headers of rooms that no file of tests/ includes."""
    included = {name for path, text in files.items() if path.startswith("tests/") for _, name in includes_of(text)}
    return {("untested", path): (0, "no test includes this header") for path in files
            if path.startswith(tuple(f"engine/{room}/" for room in rooms)) and path.endswith(".hpp") and path not in included}


def check_tested(arguments):
    exceptions, complaints = exceptions_of(read(EXCEPTIONS))
    rooms = cmake_list(read(f"{arguments.source}/engine/CMakeLists.txt"), "STILLMESH_ROOMS")
    files = {name: read(f"{arguments.source}/{name}") for name in tracked_files(arguments.source)
             if name.startswith(("engine/", "tests/")) and name.endswith((".hpp", ".cpp"))}
    found = untested_of(files, rooms)
    print(f"{len(files)} files; headers without a test: {len(found)}")
    return complaints + excepted_complaints(found, exceptions, ("untested",))


# --- references ------------------------------------------------------------------------------------------------------

# A path from the root or from the file's own folder, of a file, a folder, or a module without its suffix. Not what goes on as
# no file's name does: build/engine/..., engine/<room>/, tests/*.
PATH = re.compile(r"(?<![\w/.${}<>*-])((?:\.\./)*(?:docs|engine|hal|platform|tests|bench|fuzz|toolchains|packaging|vocabulary)"
                  r"/[\w./-]*\w)(?!/?[\w*<{$-])")
BARE_NAME = re.compile(r"(?<![\w/.}*>-])([\w-]+\.(?:md|hpp|cpp))\b(?![/(])")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")


def dangling_references(files, names):
    """files: {path: text} to read, names: of all that is in the repository. What is spoken of and is not there, by its name."""
    known = set(names)
    for name in names:
        parts = name.split("/")
        known |= {"/".join(parts[:i]) for i in range(1, len(parts))}  # folders
        known.add(os.path.splitext(name)[0])  # a module: engine/mesh/delaunay
    bare = {os.path.basename(name) for name in names}
    found = {}

    def is_there(path, folder):
        return any(os.path.normpath(candidate) in known for candidate in (path, os.path.join(folder, path)))
    for path, text in sorted(files.items()):
        folder = os.path.dirname(path)
        for number, line in enumerate(text.splitlines(), 1):
            missing = [name for name in PATH.findall(line) if not is_there(name, folder)]
            missing += [name for name in BARE_NAME.findall(line) if name not in bare]
            if path.endswith(".md"):
                missing += [name for name in LINK.findall(line) if not re.match(r"\w+:", name) and not is_there(name, folder)]
            for name in missing:
                found.setdefault(("reference", name), []).append(f"{path}:{number}")
    return {key: (0, f"not in the repository, and named in {', '.join(dict.fromkeys(places))}") for key, places in found.items()}


def check_references(arguments):
    exceptions, complaints = exceptions_of(read(EXCEPTIONS))
    names = tracked_files(arguments.source)
    files = {name: read(f"{arguments.source}/{name}") for name in names if is_text(name) and name not in WRONG_ON_PURPOSE}
    found = dangling_references(files, names)
    print(f"{len(files)} text files; names of what is not there: {len(found)}")
    return complaints + excepted_complaints(found, exceptions, ("reference",))


def main(checks):
    """checks: {name: function}; runs the one that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("check", choices=sorted(checks))
    for name in ("source", "build", "compiler", "nm", "objdump", "readelf", "library", "program"):
        parser.add_argument(f"--{name}", required=True)
    parser.add_argument("--modules", nargs="*", default=[])
    arguments = parser.parse_args()
    complaints = checks[arguments.check](arguments)
    for complaint in complaints:
        print("WRONG:", complaint)
    print("holds" if not complaints else f"{len(complaints)} complaints")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main({name[6:]: function for name, function in globals().items() if name.startswith("check_")}))
