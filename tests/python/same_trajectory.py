#!/usr/bin/env python3
"""Promise: the module over a recording gives the path that `stillmesh run` gives, byte for byte, as it is given out and as it is
known at the end.

  same_trajectory.py PROGRAM
"""
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image

import stillmesh

HEADER = "# timestamp tx ty tz qx qy qz qw (camera to world, s, m)\n"
FRAMES = 40


def lines_of(file):
    return [line.split() for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]


def nanoseconds(seconds):
    whole, part = seconds.split(".")
    return int(whole) * 10**9 + int(part.ljust(9, "0"))


def path_by_module(folder):
    """The text of the path, and of the one known at the end."""
    said = dict(line.split(": ") for line in (folder / "camera.yaml").read_text(encoding="utf-8").splitlines() if ": " in line)
    numbers = {name: float(said[f"Camera.{name}"]) for name in ("fx", "fy", "cx", "cy")}
    camera = stillmesh.Camera(int(said["Camera.width"]), int(said["Camera.height"]), **numbers)
    engine = stillmesh.Engine(stillmesh.Settings("room"), camera)
    trajectory = stillmesh.Trajectory(engine)
    text = HEADER
    for (time, colour), (_, depth) in zip(lines_of(folder / "rgb.txt"), lines_of(folder / "depth.txt")):
        pixels = np.asarray(Image.open(folder / depth)).astype(np.uint16)
        pose = engine.submit(np.asarray(Image.open(folder / colour)), pixels, nanoseconds(time),
                             depth_units_per_m=float(said["DepthMapFactor"]))
        trajectory.add()
        text += f"# none {time}\n" if pose.state == "none" else ("# predicted " if pose.state == "predicted" else "") + pose.line()
        engine.step()
    final = HEADER
    for time_ns, pose in zip(*trajectory.known()):
        final += f"{time_ns // 10**9}.{time_ns % 10**9:09d} " + " ".join(f"{number:.9f}" for number in pose) + "\n"
    return text, final, engine


def main():
    with tempfile.TemporaryDirectory() as work:
        folder = pathlib.Path(work) / "recording"
        subprocess.run([sys.argv[1], "simulate", "walking_xyz", "--frames", str(FRAMES), "--out", str(folder)], check=True,
                       capture_output=True)
        subprocess.run([sys.argv[1], "run", "--replay", str(folder), "--trajectory", f"{work}/path", "--trajectory-final",
                        f"{work}/final"], check=True, capture_output=True)
        wanted = [pathlib.Path(f"{work}/{name}").read_text(encoding="utf-8") for name in ("path", "final")]
        *given, engine = path_by_module(folder)
    complaints = [f"{name}: the module's is another:\n{a[-300:]}\nand not\n{b[-300:]}"
                  for name, a, b in zip(("path", "final"), given, wanted) if a != b]
    poses = sum(not line.startswith("#") for line in wanted[0].splitlines())
    if poses < FRAMES / 2 or engine.statistics["frames"] != FRAMES:
        complaints.append(f"only {poses} poses")
    for complaint in complaints:
        print("WRONG:", complaint)
    print(f"{poses} poses, state hash {engine.state_hash:016x}")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
