#!/usr/bin/env python3
"""What a frame costs on every processor, in instructions by stage: the engine alone, counted inside qemu-user.

usage: cost.py [--scene NAME] [--frames N] [--limits room|pocket] [--max-ratio R] [ARCHITECTURE ...]

An ARCHITECTURE is amd64 (with SSE2 kernels alone), arm64 or armhf; its build folder must have engine_workload
(ninja -C build/release|arm64|armhf engine_workload). Exit 1: arm64 needs more than --max-ratio times amd64's instructions.
"""
import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
SETTINGS = {
    "amd64": (["qemu-x86_64", "-cpu", "Conroe"], "release"),
    "arm64": (["qemu-aarch64", "-L", str(ROOT / "build/sysroot/arm64")], "arm64"),
    "armhf": (["qemu-arm", "-L", str(ROOT / "build/sysroot/armhf")], "armhf"),
}
STAGES = {10: "prepare", 11: "features", 12: "matching", 13: "mesh", 14: "region", 15: "pose", 16: "local map",
          17: "map update", 1: "between", 2: "background"}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="walking_xyz")
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--limits", default="room")
    parser.add_argument("--max-ratio", type=float)
    parser.add_argument("architectures", nargs="*", default=[], metavar="ARCHITECTURE")
    arguments = parser.parse_args()
    counts, said = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        plugin = pathlib.Path(folder) / "count.so"
        subprocess.run(["g++", "-O2", "-shared", "-fPIC", str(ROOT / "tests/board/count_instructions.cpp"), "-o", plugin], check=True)
        for name in arguments.architectures or list(SETTINGS):
            emulator, build = SETTINGS[name]
            program = ROOT / "build" / build / "tests/board/engine_workload"
            if not program.is_file():
                sys.exit(f"cost: {program} is not built")
            ran = subprocess.run([emulator[0], "-plugin", plugin, *emulator[1:], program, arguments.scene,
                                  str(arguments.frames), arguments.limits, "auto"], capture_output=True, text=True, check=False)
            found = {int(i): int(n) for i, n in re.findall(r"^instructions (\d+) (\d+)$", ran.stderr, re.M)}
            if ran.returncode != 0 or not found:
                sys.exit(f"cost: {name}: exit {ran.returncode}\n{ran.stdout}{ran.stderr}")
            counts[name] = {i: n / arguments.frames / 1e6 for i, n in found.items() if i in STAGES}
            said[name] = dict(line.split() for line in ran.stdout.splitlines())
    names = list(counts)
    print(f"{arguments.scene}, {arguments.frames} frames, {arguments.limits}: million instructions a frame")
    print("| stage | " + " | ".join(f"{name} ({said[name]['kernels']})" for name in names) + " |")
    print("|---|" + "---|" * len(names))
    for i, stage in STAGES.items():
        print(f"| {stage} | " + " | ".join(f"{counts[name].get(i, 0):.2f}" for name in names) + " |")
    totals = {name: sum(counts[name].values()) for name in names}
    print("| all | " + " | ".join(f"{totals[name]:.2f}" for name in names) + " |")
    if len({said[name]["hash"] for name in names}) != 1:
        print("cost: the state hashes differ: ", {name: said[name]["hash"] for name in names})
        return 1
    if arguments.max_ratio and "amd64" in totals and "arm64" in totals:
        ratio = totals["arm64"] / totals["amd64"]
        print(f"arm64 / amd64: {ratio:.2f} (at most {arguments.max_ratio})")
        return 0 if ratio <= arguments.max_ratio else 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
