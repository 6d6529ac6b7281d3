#!/usr/bin/env python3
"""Promises: libstillmesh_c exports what its header declares and nothing else; whatever Engine can do has a counterpart in C,
every statistic included; and what a program was compiled against stays as it was (abi.txt: symbols, sizes, offsets).

  abi.py check    --source DIR --library FILE --nm NM --compiler CC    exit 0 when all hold
  abi.py update   ...                                                  writes abi.txt anew
  abi.py selftest ...                                                  each wrong header is noticed
abi.txt is that of 64-bit processors. A line that changes or goes breaks programs: the library's number is raised with it
(STILLMESH_C_ABI); a struct that begins with its size may grow at its end.
"""
import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

# Members of Engine, and what does the same in C.
COUNTERPARTS = {
    "create": "sm_engine_create", "start_at": "sm_start_at", "submit": "sm_submit", "step": "sm_step", "pose": "sm_get_pose",
    "frame_statistics": "sm_get_frame_statistics", "statistics": "sm_get_statistics",
    "tracking_view": "sm_get_tracking_view", "features": "sm_get_features", "keyframes": "sm_keyframes",
    "keyframe_links": "sm_keyframe_links",
    "depth_image": "sm_get_depth_image",
    "reference_keyframe": "sm_reference_keyframe", "state_hash": "sm_state_hash", "begin_map_copy": "sm_begin_map_copy",
    "step_map_copy": "sm_step_map_copy", "load_map": "sm_load_map", "set_map_use": "sm_set_map_use", "step_store": "sm_step_store",
    "set_stage_observer": "sm_set_stage_observer", "reset": "sm_reset"}
# Functions of map_merge.hpp, likewise.
MAP_COUNTERPARTS = {"merge_map": "sm_merge_map", "fit_map": "sm_fit_map"}
# Statistics of outputs.hpp, their struct in C and what their fields begin with there.
STATISTICS = {"FrameStatistics": ("sm_frame_statistics", ""), "EngineStatistics": ("sm_statistics", ""),
              "MapStatistics": ("sm_statistics", ""), "MappingStatistics": ("sm_statistics", "mapping_"),
              "LoopStatistics": ("sm_statistics", "loop_"), "StoreStatistics": ("sm_statistics", "store_"),
              "ScheduleStatistics": ("sm_statistics", "schedule_")}
POOLS = [f"{pool}_{part}" for pool in ("keyframes", "map_points", "keyframe_queue") for part in ("size", "high_water", "capacity")]


def without_comments(text):
    return re.sub(r"/\*.*?\*/|//[^\n]*", "", text, flags=re.S)


def functions_of(header):
    return sorted(re.findall(r"SM_API\s[^;(]*?\b(sm_\w+)\(", without_comments(header)))


def structs_of(header):
    """{name: [field]} of the header's structs."""
    found = {}
    for body, name in re.findall(r"typedef struct \w+ \{(.*?)\n\} (\w+);", without_comments(header), re.S):
        fields = [field.strip() for field in body.split(";") if field.strip()]
        found[name] = []
        for field in fields:
            function = re.search(r"\(\*(\w+)\)", field)
            found[name] += [function.group(1)] if function else [re.search(r"(\w+)(?:\[\d+\])?\s*$", part).group(1)
                                                                 for part in field.split(",")]
    return found


def members_of(engine):
    """Public functions of class Engine."""
    body = re.search(r"class STILLMESH_API Engine \{\s*public:(.*?)\nprotected:", without_comments(engine), re.S).group(1)
    return sorted({re.search(r"(\w+)\(", part).group(1) for part in body.split(";") if "(" in part})


def numbers_of(text, struct):
    """Names of the numbers in a struct of outputs.hpp or scheduler.hpp."""
    body = re.search(rf"struct {struct}\b[^{{]*\{{(.*?)\n\}};", without_comments(text), re.S).group(1)
    names = []
    for kind, rest in re.findall(r"(std::u?int\d+_t|std::size_t|double|bool|UnsureReason)\s+([^;]+);", body):
        names += [re.match(r"\w+", part.strip()).group(0) for part in rest.split(",")]
    return names


def complaints_about(header, version_map, exported, engine, outputs, merge):
    complaints = []
    declared, listed = set(functions_of(header)), set(re.findall(r"^\s+(sm_\w+);", version_map, re.M))
    for what, names in (("version script", listed), ("library", set(exported))):
        complaints += [f"{name}: declared, and not in the {what}" for name in sorted(declared - names)]
        complaints += [f"{name}: in the {what}, and not declared" for name in sorted(names - declared)]
    members = members_of(engine)
    complaints += [f"Engine::{name} has no counterpart in C" for name in members if COUNTERPARTS.get(name) not in declared]
    complaints += [f"Engine::{name} is no more" for name in COUNTERPARTS if name not in members]
    functions = re.findall(r"STILLMESH_API\s+\w+\s+(\w+)\(", without_comments(merge))
    complaints += [f"{name} has no counterpart in C" for name in functions if MAP_COUNTERPARTS.get(name) not in declared]
    complaints += [f"{name} is no more" for name in MAP_COUNTERPARTS if name not in functions]
    structs = structs_of(header)
    for name, (struct, begin) in STATISTICS.items():
        complaints += [f"{name}::{field} is not in {struct}" for field in numbers_of(outputs, name)
                       if begin + field not in structs.get(struct, [])]
    complaints += [f"{field} is not in sm_statistics" for field in POOLS if field not in structs.get("sm_statistics", [])]
    return complaints


def layout_of(header_folder, header, compiler):
    """Lines 'struct sm_x BYTES' and 'field sm_x.y OFFSET BYTES', by the compiler."""
    lines = []
    for name, fields in structs_of(header).items():
        lines.append(f'printf("struct {name} %zu\\n", sizeof({name}));')
        lines += [f'printf("field {name}.{field} %zu %zu\\n", offsetof({name}, {field}), sizeof((({name} *)0)->{field}));'
                  for field in fields]
    with tempfile.TemporaryDirectory() as work:
        program = pathlib.Path(work) / "layout.c"
        program.write_text('#include <stdio.h>\n#include "stillmesh.h"\nint main(void) {\n' + "\n".join(lines) + "\nreturn 0;\n}\n",
                           encoding="utf-8")
        subprocess.run([compiler, "-std=c99", "-I", header_folder, str(program), "-o", f"{work}/layout"], check=True)
        return subprocess.run([f"{work}/layout"], check=True, capture_output=True, text=True).stdout


def changed(committed, now):
    """What is other than it was. A struct with a size may have more fields behind those that it had."""
    sizes = {line.split()[1] for line in committed.splitlines() if line.startswith("struct")}
    growing = {name for name in sizes if f"field {name}.size 0 4" in committed.splitlines()}
    before, after = set(committed.splitlines()), set(now.splitlines())
    complaints = [f"was: {line}" for line in sorted(before - after)
                  if not (line.startswith("struct") and line.split()[1] in growing)]
    for line in sorted(after - before):
        words = line.split()
        is_new = words[0] in ("symbol", "struct") or words[1].split(".")[0] in growing | {w.split()[1] for w in after - before
                                                                                         if w.startswith("struct")} - sizes
        if not is_new:
            complaints.append(f"is:  {line}")
    if complaints:
        return complaints
    return ["new, and not in abi.txt yet (abi.py update): " + line for line in sorted(after - before)]


def selftest(header, version_map, exported, engine, outputs, merge):
    assert complaints_about(header, version_map, exported, engine, outputs, merge) == []
    wrong = [
        (header.replace("SM_API uint64_t sm_state_hash", "uint64_t sm_state_hash"), version_map, exported, engine, outputs, merge),
        (header, version_map.replace("    sm_step;\n", ""), exported, engine, outputs, merge),
        (header, version_map, exported + ["_ZN9stillmesh6EngineE"], engine, outputs, merge),
        (header, version_map, exported, engine.replace("void reset() noexcept;", "void reset() noexcept;\n    void forget();"), outputs, merge),
        (header, version_map, exported, engine, outputs.replace("std::uint64_t queries = 0;", "std::uint64_t queries = 0, more = 0;"), merge),
        (header, version_map, exported, engine, outputs, merge + "STILLMESH_API void halve_map(Engine& engine) noexcept;"),
    ]
    for i, arguments in enumerate(wrong):
        assert complaints_about(*arguments), i
    was = "symbol sm_a\nstruct sm_b 8\nfield sm_b.size 0 4\nfield sm_b.x 4 4\nstruct sm_c 4\nfield sm_c.x 0 4\n"
    assert changed(was, was) == []
    for now in (was.replace("symbol sm_a\n", ""), was.replace("sm_b.x 4 4", "sm_b.x 4 2"), was.replace("sm_c 4", "sm_c 8"),
                was + "field sm_c.y 4 4\n", was.replace("field sm_b.x", "field sm_b.z")):
        assert any(c.startswith(("was", "is")) for c in changed(was, now)), now
    grown = was.replace("struct sm_b 8", "struct sm_b 12") + "field sm_b.y 8 4\nsymbol sm_d\nstruct sm_e 4\nfield sm_e.x 0 4\n"
    assert all(c.startswith("new") for c in changed(was, grown)) and changed(was, grown)
    print(f"{len(wrong) + 5} wrong ones noticed")
    return []


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("check", "update", "selftest"))
    for name in ("source", "library", "nm", "compiler"):
        parser.add_argument(f"--{name}", required=True)
    arguments = parser.parse_args()
    source = pathlib.Path(arguments.source)
    folder = source / "platform/c_api"

    def read(path):
        return path.read_text(encoding="utf-8")
    said = subprocess.run([arguments.nm, "-D", "--defined-only", arguments.library], check=True, capture_output=True, text=True).stdout
    exported = [name.split("@")[0] for kind, name in re.findall(r"^[0-9a-f]+ (\w) (\S+)$", said, re.M) if kind != "A"]
    parts = (read(folder / "stillmesh.h"), read(folder / "stillmesh_c.map"), exported, read(source / "engine/engine.hpp"),
             read(source / "engine/outputs.hpp") + read(source / "engine/schedule/scheduler.hpp"),
             read(source / "engine/map_merge.hpp"))
    now = "".join(f"symbol {name}\n" for name in sorted(exported)) + layout_of(folder, parts[0], arguments.compiler)
    abi = source / "tests/c_api/abi.txt"
    if arguments.what == "update":
        abi.write_text(now, encoding="utf-8")
        return 0
    complaints = selftest(*parts) if arguments.what == "selftest" else complaints_about(*parts) + changed(read(abi), now)
    for complaint in complaints:
        print("WRONG:", complaint)
    print(f"{len(exported)} symbols, {len(structs_of(parts[0]))} structs, {len(complaints)} complaints")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
