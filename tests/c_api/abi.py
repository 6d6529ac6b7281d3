#!/usr/bin/env python3
"""Promises: libstillmesh_c exports what its header declares and nothing else; whatever Engine can do has a counterpart in C,
every statistic included; and what a program was compiled against stays as it was (stillmesh.abi, compared by abidiff).

  abi.py check    --source DIR --library FILE --nm NM --compiler CC    exit 0 when all hold
  abi.py update   ...                                                  writes stillmesh.abi anew
  abi.py selftest ...                                                  each wrong header is noticed
stillmesh.abi is abidw's description for 64-bit processors: symbols with their versions, types of arguments and results, members
of structs, values of constants. What changes or goes breaks programs: the library's number is raised with it (STILLMESH_C_ABI);
a struct that begins with its size may grow at its end.
"""
import argparse
import pathlib
import re
import shutil
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


def description_of(header, version_map, compiler):
    """abidw's description of a library that declares what the header does, and does nothing: the engine's own types stay out of
    it, and no compiler's flags matter. A constant becomes the value of an enum of its own, which a variable has."""
    text = without_comments(header)
    lines = ['#include "stillmesh.h"']
    for declaration in re.findall(r"SM_API\s+([^;(]*?\bsm_\w+\([^;]*\));", text):
        lines.append(declaration + (" {}" if re.match(r"void\s+sm_", declaration) else " { return 0; }"))
    for name in re.findall(r"#define (SM_\w+) (?!__attribute__)", text) + re.findall(r"\b(SM_\w+) = ", text):
        lines.append(f"enum value_of_{name} {{ {name}_is = {name} }} sm_constant_{name};")
    with tempfile.TemporaryDirectory() as work:
        folder = pathlib.Path(work)
        (folder / "stillmesh.h").write_text(header, encoding="utf-8")
        (folder / "api.c").write_text("\n".join(lines) + "\n", encoding="utf-8")
        (folder / "api.map").write_text(version_map.replace("global:", "global:\n    sm_constant_*;", 1), encoding="utf-8")
        subprocess.run([compiler, "-std=gnu99", "-w", "-g", "-fPIC", "-shared", "api.c", "-o", "api.so",
                        "-Wl,--version-script=api.map"], check=True, cwd=work)
        subprocess.run(["abidw", "--no-show-locs", "--no-corpus-path", "--no-comp-dir-path", "--no-elf-needed", "--no-architecture",
                        "--type-id-style", "hash", "--out-file", "api.abi", "api.so"], check=True, cwd=work)
        return (folder / "api.abi").read_text(encoding="utf-8")


def is_growth_alone(report, growing):
    """Whether abidiff tells of members behind the end of structs that may grow, and of nothing else."""
    end, has_grown = None, False
    for line in filter(None, map(str.strip, report.splitlines())):
        struct = re.fullmatch(r"'struct (\w+)' changed:", line)
        size = re.fullmatch(r"type size changed from (\d+) to \d+ \(in bits\)", line)
        member = re.fullmatch(r"'.*', at offset (\d+) \(in bits\)", line)
        if size:
            end = int(size.group(1))
        elif member and end is not None and int(member.group(1)) >= end:
            has_grown = True
        elif struct and struct.group(1) in growing:
            end = None
        elif not re.match(r"(Leaf changes|Changed leaf types|Removed/Changed/Added \w+) summary: |\d+ data member insertions?:$", line):
            return False
    return has_grown


def changed(committed, now, header):
    """What breaks programs; where nothing does, what is new and not committed yet."""
    growing = {name for name, fields in structs_of(header).items() if fields[0] == "size"}
    with tempfile.TemporaryDirectory() as work:
        for name, text in (("committed.abi", committed), ("now.abi", now)):
            (pathlib.Path(work) / name).write_text(text, encoding="utf-8")

        def compared(*options):
            run = subprocess.run(["abidiff", "--leaf-changes-only", *options, "committed.abi", "now.abi"], check=False,
                                 capture_output=True, text=True, cwd=work)
            assert run.returncode & 3 == 0, run.stdout + run.stderr  # it could not compare
            return run
        run = compared("--no-added-syms")
        if run.returncode & 8 or (run.returncode != 0 and not is_growth_alone(run.stdout, growing)):
            return ["breaks programs:\n" + run.stdout]
        run = compared()
        return ["new, and not in stillmesh.abi yet (target update_abi):\n" + run.stdout] if run.returncode != 0 else []


def not_held(header, description):
    """Structs that no function leads to: nobody would notice if they changed."""
    return [f"{name}: no function has to do with it" for name in structs_of(header) if f"name='{name}' size-in-bits=" not in description]


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
    print(f"{len(wrong)} wrong ones noticed")
    return []


def abi_selftest(header, version_map, compiler):
    """Each pair of texts is a change to the header, or to the version script if the first is found there alone."""
    committed = description_of(header, version_map, compiler)

    def complaints_after(*changes):
        after, versions = header, version_map
        for old, new in changes:
            assert old in header or old in version_map, old
            after, versions = (after.replace(old, new), versions) if old in header else (after, versions.replace(old, new))
        return changed(committed, description_of(after, versions, compiler), after)

    grown = ("} sm_statistics;", "    double more;\n} sm_statistics;")
    call = "SM_API uint64_t sm_state_hash(const sm_engine* engine);"
    swapped = ("keyframes_evicted, keyframes_redundant", "keyframes_redundant, keyframes_evicted")
    wrong = {
        "a function gone": [(call, ""), ("    sm_state_hash;\n", "")],
        "an argument's type": [("sm_step(sm_engine* engine, uint32_t", "sm_step(sm_engine* engine, uint64_t")],
        "a callback's arguments": [("(*extract)(void* user,", "(*extract)(void* user, int n,")],
        "members swapped": [swapped], "members swapped, and grown": [swapped, grown],
        "a member gone, and grown": [("uint64_t frames, frames_refused,", "uint64_t frames,"), grown],
        "a member between": [("int32_t state;\n    int64_t", "int32_t state;\n    double more;\n    int64_t")],
        "a type of the same size": [("double covariance[36]", "int64_t covariance[36]")],
        "grown without a size": [("} sm_keyframe;", "    double more;\n} sm_keyframe;")],
        "a constant": [("#define SM_FULL 1 ", "#define SM_FULL 9 ")], "a constant gone": [("#define SM_DEGENERATE 6", "")],
        "an enum's value": [("SM_LINK_LOOP = 1", "SM_LINK_LOOP = 2")],
        "a symbol's version": [("STILLMESH_0 {", "STILLMESH_1 {")],
    }
    for what, changes in wrong.items():
        complaints = complaints_after(*changes)
        assert complaints and all(line.startswith("breaks") for line in complaints), (what, complaints)
    right = {"a function": [(call, call + "\nSM_API void sm_more(void);"), ("    sm_step;\n", "    sm_step;\n    sm_more;\n")],
             "a constant": [("#define SM_END 8", "#define SM_END 8\n#define SM_MORE 9")], "members at the end": [grown]}
    for what, changes in right.items():
        complaints = complaints_after(*changes)
        assert len(complaints) == 1 and complaints[0].startswith("new"), (what, complaints)
    assert complaints_after() == []
    assert not_held(header + "typedef struct sm_alone {\n    uint32_t size;\n} sm_alone;\n", committed)
    print(f"{len(wrong)} changes break programs, {len(right)} do not")
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
    if shutil.which("abidw") is None or shutil.which("abidiff") is None:
        print("abi.py: abidw and abidiff are not here: toolchains/install test (abigail-tools)")
        return 2
    now = description_of(parts[0], parts[1], arguments.compiler)
    abi = source / "tests/c_api/stillmesh.abi"
    if arguments.what == "selftest":
        complaints = selftest(*parts) + abi_selftest(parts[0], parts[1], arguments.compiler)
    else:
        complaints = complaints_about(*parts) + not_held(parts[0], now) + changed(read(abi), now, parts[0])
    if arguments.what == "update":
        abi.write_text(now, encoding="utf-8")
    for complaint in complaints:
        print("WRONG:", complaint)
    print(f"{len(exported)} symbols, {len(structs_of(parts[0]))} structs, {len(complaints)} complaints")
    return 1 if complaints and arguments.what != "update" else 0


if __name__ == "__main__":
    sys.exit(main())
