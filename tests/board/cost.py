#!/usr/bin/env python3
"""What a frame costs on every processor, in instructions by stage: the engine alone, counted inside qemu-user.

usage: cost.py [--scene NAME] [--frames N] [--limits room|pocket] [--max-ratio R] [ARCHITECTURE ...]
       cost.py [ARCHITECTURE ...] --worst [R] [--scenes NAME,...] [--frames N] [--limits room|pocket]

An ARCHITECTURE is amd64 (with SSE2 kernels alone), arm64 or armhf; its build folder must have engine_workload
(ninja -C build/release|arm64|armhf engine_workload), and build/release workload_frames, which renders what is counted on.
Exit 1: arm64 needs more than --max-ratio times amd64's instructions; the state hashes differ; or, with --worst, the dearest
frame of a hostile scene needs more than R (2.5) times those of the dearest frame of the nominal scene.
"""
import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
RENDERER = ROOT / "build/release/tests/board/workload_frames"
VOCABULARY = ROOT / "vocabulary/default.voc"
SETTINGS = {
    "amd64": (["qemu-x86_64", "-cpu", "Conroe"], "release"),
    "arm64": (["qemu-aarch64", "-cpu", "cortex-a72", "-L", str(ROOT / "build/sysroot/arm64")], "arm64"),
    "armhf": (["qemu-arm", "-L", str(ROOT / "build/sysroot/armhf")], "armhf"),
}
STAGES = {10: "prepare", 11: "features", 12: "matching", 13: "mesh", 14: "region", 15: "pose", 16: "local map",
          17: "map update", 1: "between", 2: "background"}
BACKGROUND = 2
NOMINAL = ["walking_xyz"]


class Counter:
    """Runs engine_workload on a scene: millions of instructions of each frame by stage, and what it said."""

    def __init__(self, folder, limits):
        self.folder = folder
        self.limits = limits
        self.plugin = folder / "count.so"
        subprocess.run(["g++", "-O2", "-shared", "-fPIC", str(ROOT / "tests/board/count_instructions.cpp"), "-o", self.plugin],
                       check=True)

    def render(self, scene, frames):
        file = self.folder / "frames"
        if subprocess.run([RENDERER, scene, str(frames), file], check=False).returncode != 0:
            sys.exit(f"cost: {RENDERER} knows no scene {scene}, or is not built")
        return file

    def map_of(self, world):
        """The file of a full map of a world, made once: [], if the scene begins without one."""
        if not world:
            return []
        file = self.folder / f"{world}.map"
        if not file.is_file() and subprocess.run([RENDERER, "--map", world, self.limits, VOCABULARY, file], check=False,
                                                 stdout=subprocess.DEVNULL).returncode != 0:
            sys.exit(f"cost: there is no map of {world}")
        return [file]

    def count(self, name, frames, begin_in=()):
        emulator, build = SETTINGS[name]
        program = ROOT / "build" / build / "tests/board/engine_workload"
        if not program.is_file():
            sys.exit(f"cost: {program} is not built")
        ran = subprocess.run([emulator[0], "-plugin", self.plugin, *emulator[1:], program, frames, self.limits, "auto", VOCABULARY,
                              *begin_in], capture_output=True, text=True, check=False)
        found = [{int(stage): int(n) / 1e6 for stage, n in re.findall(r"(\d+):(\d+)", line) if int(stage) in STAGES}
                 for line in re.findall(r"^instructions (.*)$", ran.stderr, re.M)]
        if ran.returncode != 0 or not found:
            sys.exit(f"cost: {name}: exit {ran.returncode}\n{ran.stdout}{ran.stderr}")
        return found, dict(line.split() for line in ran.stdout.splitlines())


def tracked(frame):
    return sum(n for stage, n in frame.items() if stage != BACKGROUND)


def worst(counter, names, scenes, frames, ratio_max):
    """The dearest frame of every scene, beside that of the nominal one."""
    said = subprocess.run([RENDERER], capture_output=True, text=True, check=True).stdout
    hostile = {name: world for name, world, _ in (line.split("\t") for line in said.splitlines())}
    unknown = [scene for scene in scenes if scene not in hostile]
    if unknown:
        sys.exit(f"cost: no such hostile scene: {', '.join(unknown)} (there are {', '.join(hostile)})")
    nominal = {name: {"tracked": 0, "all": 0} for name in names}
    failures = []
    print(f"{frames} frames, {counter.limits}: million instructions of the dearest frame by stage, and times those of the dearest"
          " nominal one; the same of what is tracked alone")
    print("| scene | processor | frame | " + " | ".join(STAGES.values()) + " | all | times | tracked | times | frames tracked |")
    print("|---|---|---|" + "---|" * (len(STAGES) + 5))
    for scene in NOMINAL + (scenes or list(hostile)):
        file = counter.render(scene, frames)
        begin_in = counter.map_of(hostile.get(scene, ""))
        hashes = set()
        for name in names:
            counts, said = counter.count(name, file, begin_in)
            hashes.add(said["hash"])
            dearest = max(range(len(counts)), key=lambda i: sum(counts[i].values()))
            cost = {"tracked": max(map(tracked, counts)), "all": sum(counts[dearest].values())}
            if scene in NOMINAL:
                nominal[name] = {key: max(nominal[name][key], cost[key]) for key in cost}
            times = {key: cost[key] / nominal[name][key] for key in cost}
            print(f"| {scene} | {name} | {dearest} | " + " | ".join(f"{counts[dearest].get(i, 0):.1f}" for i in STAGES) +
                  f" | {cost['all']:.1f} | {times['all']:.2f} | {cost['tracked']:.1f} | {times['tracked']:.2f} |"
                  f" {said['states'].count('T')} |", flush=True)
            if times["all"] > ratio_max:
                failures.append(f"{scene}, {name}: {times['all']:.2f} times nominal")
        if len(hashes) != 1:
            failures.append(f"{scene}: the state hashes differ")
    for failure in failures:
        print(f"cost: {failure} (at most {ratio_max})")
    return 1 if failures else 0


def mean(counter, names, scene, frames, ratio_max):
    """The mean frame by stage, a processor beside the other."""
    file = counter.render(scene, frames)
    means, said = {}, {}
    for name in names:
        counts, said[name] = counter.count(name, file)
        means[name] = {i: sum(frame.get(i, 0) for frame in counts) / len(counts) for i in STAGES}
    print(f"{scene}, {frames} frames, {counter.limits}: million instructions a frame")
    print("| stage | " + " | ".join(f"{name} ({said[name]['kernels']})" for name in names) + " |")
    print("|---|" + "---|" * len(names))
    for i, stage in STAGES.items():
        print(f"| {stage} | " + " | ".join(f"{means[name][i]:.2f}" for name in names) + " |")
    totals = {name: sum(means[name].values()) for name in names}
    print("| all | " + " | ".join(f"{totals[name]:.2f}" for name in names) + " |")
    if len({said[name]["hash"] for name in names}) != 1:
        print("cost: the state hashes differ: ", {name: said[name]["hash"] for name in names})
        return 1
    if ratio_max and "amd64" in totals and "arm64" in totals:
        ratio = totals["arm64"] / totals["amd64"]
        print(f"arm64 / amd64: {ratio:.2f} (at most {ratio_max})")
        return 0 if ratio <= ratio_max else 1
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="walking_xyz")
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--limits", default="room")
    parser.add_argument("--max-ratio", type=float)
    parser.add_argument("--worst", type=float, metavar="R", nargs="?", const=2.5)
    parser.add_argument("--scenes", default="", help="hostile ones; default: all")
    parser.add_argument("architectures", nargs="*", default=[], metavar="ARCHITECTURE")
    arguments = parser.parse_args()
    names = arguments.architectures or list(SETTINGS)
    with tempfile.TemporaryDirectory() as folder:
        counter = Counter(pathlib.Path(folder), arguments.limits)
        if arguments.worst:
            return worst(counter, names, [s for s in arguments.scenes.split(",") if s], arguments.frames, arguments.worst)
        return mean(counter, names, arguments.scene, arguments.frames, arguments.max_ratio)


if __name__ == "__main__":
    sys.exit(main())
