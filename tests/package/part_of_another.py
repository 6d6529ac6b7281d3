#!/usr/bin/env python3
"""Promise: the source as a folder of another project leaves that project's build type and install alone, and is optimised all
the same; the engine alone, built for itself, installs what finds it.

  part_of_another.py --source DIR --compiler CXX     configures only: nothing is compiled
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile


def configured(source, build, *options):
    run = subprocess.run(["cmake", "-S", source, "-B", build, "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", *options],
                         capture_output=True, text=True, check=False)
    if run.returncode != 0:
        sys.exit(f"cmake -S {source} {' '.join(options)}: {run.stderr[-2000:]}")
    cache = (pathlib.Path(build) / "CMakeCache.txt").read_text(encoding="utf-8")
    commands = json.loads((pathlib.Path(build) / "compile_commands.json").read_text(encoding="utf-8"))
    installs = "\n".join(p.read_text(encoding="utf-8") for p in pathlib.Path(build).rglob("cmake_install.cmake"))
    return cache, commands, installs


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--source", required=True)
    parser.add_argument("--compiler", required=True)
    arguments = parser.parse_args()
    compiler = f"-DCMAKE_CXX_COMPILER={arguments.compiler}"
    complaints = []

    def expect(holds, sentence):
        if not holds:
            complaints.append(sentence)
    with tempfile.TemporaryDirectory() as work:
        cache, commands, installs = configured(f"{arguments.source}/tests/examples/by_source", f"{work}/part",
                                               f"-DSTILLMESH_SOURCE={arguments.source}", compiler)
        build_type = re.search(r"^CMAKE_BUILD_TYPE:\w+=(.*)$", cache, re.M)
        expect(build_type is None or build_type.group(1) == "", "the other project's build type was set")
        expect("engine.hpp" not in installs, "the other project would install our headers")
        engine = [c["command"] for c in commands if "/engine/" in c["file"]]
        own = [c["command"] for c in commands if c["file"].endswith("follow_wall.cpp")]
        expect(engine and all(" -O2 " in c for c in engine), "the engine is not optimised")
        expect(len(own) == 1 and " -O2 " not in own[0], "the other project's file has our optimisation")
        expect(len(own) == 1 and "-std=c++20" in own[0].replace("gnu", "c"), "the other project's file is not C++20")

        cache, _, installs = configured(arguments.source, f"{work}/alone", "-DSTILLMESH_ENGINE_ONLY=ON", compiler)
        expect("CMAKE_BUILD_TYPE:STRING=Release" in cache, "by itself it is no Release build")
        for name in ("libstillmesh-engine.a", "engine.hpp", "stillmesh-config.cmake", "stillmesh.pc", "default.voc",
                     "step_pacer.hpp"):
            expect(f"/{name}" in installs, f"the engine alone installs no {name}")
        expect("cpu_kernels" not in installs, "the engine alone installs what it does not build")
    for complaint in complaints:
        print("WRONG:", complaint)
    print(f"{len(complaints)} complaints")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
