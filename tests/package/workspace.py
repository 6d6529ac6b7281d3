#!/usr/bin/env python3
"""Promise: packaging/ros2 is a package that colcon builds and installs as docs/ros2.md says: the program where `ros2 run` looks, the
launch file where `ros2 launch` looks, both in the index that ROS 2 looks them up in; the launch file starts the installed program with the
arguments it was given; and that program takes them, and waits for a camera's images from ROS 2. ROS's own launch is not in Debian: the few
names of it that the file uses are played here.

  workspace.py --source DIR [--program FILE]     FILE: what was built already; without it colcon builds it (minutes)

Exit 77: colcon or ament_cmake is not installed (Debian: colcon, ament-cmake)."""
import argparse
import os
import pathlib
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import types

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
from ros_domain import own_domain  # noqa: E402

SYSTEM = "/usr/bin:/bin:/usr/sbin:/sbin"  # Debian's Python, which colcon and ament are installed for
BUILD_S, WAIT_S = 3600, 120


def run(command, folder, limit_s=WAIT_S):
    environment = {"PATH": SYSTEM, "HOME": folder, "LANG": "C.UTF-8"}
    if "CMAKE_GENERATOR" in os.environ:  # that of this build: not every machine has make
        environment["CMAKE_GENERATOR"] = os.environ["CMAKE_GENERATOR"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=limit_s, check=False)
    if done.returncode != 0:
        sys.exit(f"{shlex.join(command)}: exit code {done.returncode}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}")
    return done.stdout


class Word:
    """What `ros2 launch NAME:=VALUE` puts in the place of a name."""

    def __init__(self, name):
        self.name = name


def command_of(launch_file, prefix, given):
    """The command that the file starts. `given`: values of its arguments, which are filled up with its defaults."""
    started = []

    def module(name, **contents):
        sys.modules[name] = types.ModuleType(name)
        vars(sys.modules[name]).update(contents)

    def declare(name, default_value, description):
        assert description, name
        given.setdefault(name, default_value)
    module("launch", LaunchDescription=list)
    module("launch.actions", DeclareLaunchArgument=declare, ExecuteProcess=lambda cmd, output: started.append(cmd))
    module("launch.substitutions", LaunchConfiguration=Word)
    module("ament_index_python")
    module("ament_index_python.packages", get_package_prefix=lambda package: str(prefix) if package == "stillmesh" else None)
    space = {}
    exec(compile(launch_file.read_text(encoding="utf-8"), str(launch_file), "exec"), space)
    space["generate_launch_description"]()
    assert len(started) == 1, started

    def text(part):
        if isinstance(part, list):
            return "".join(text(one) for one in part)
        return given[part.name] if isinstance(part, Word) else part
    return [text(part) for part in started[0]]


def starts_and_waits(command, folder):
    """The command runs until it is told to end, and says what images it waits for."""
    environment = {"PATH": SYSTEM, "HOME": folder, "ROS_LOCALHOST_ONLY": "1", "ROS_DOMAIN_ID": own_domain()}
    with open(f"{folder}/said", "w+", encoding="utf-8") as said:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=said, stderr=said)
        try:
            end = time.monotonic() + WAIT_S
            text = ""
            while "/my/colour" not in text and process.poll() is None and time.monotonic() < end:
                time.sleep(0.2)
                text = pathlib.Path(said.name).read_text(encoding="utf-8")
            assert process.poll() is None, text
            assert "/my/colour" in text, text
            process.send_signal(signal.SIGINT)
            process.wait(WAIT_S)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--source", required=True)
    parser.add_argument("--program")
    arguments = parser.parse_args()
    if shutil.which("colcon", path=SYSTEM) is None or not pathlib.Path("/usr/share/ament_cmake").exists():
        print("skipped: colcon or ament-cmake is not installed")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        settings = ["--cmake-args", f"-DSTILLMESH_PROGRAM={pathlib.Path(arguments.program).resolve()}"] if arguments.program else []
        run(["colcon", "build", "--base-paths", f"{pathlib.Path(arguments.source).resolve()}/packaging/ros2", *settings], folder, BUILD_S)
        found = run(["bash", "-c", ". install/setup.bash && printf %s \"$AMENT_PREFIX_PATH\""], folder)
        prefix = pathlib.Path(found)
        assert prefix.is_absolute() and str(prefix).startswith(folder), found
        for entry in ("share/ament_index/resource_index/packages/stillmesh", "share/stillmesh/package.xml",
                      "share/stillmesh/launch/rgbd.launch.py", "lib/stillmesh/stillmesh"):
            assert (prefix / entry).is_file(), entry
        program = str(prefix / "lib/stillmesh/stillmesh")
        assert "stillmesh" in run([program, "--version"], folder)
        given = {"colour": "/my/colour", "base_from_camera": "0.1,0,0.3", "tf": "--no-tf"}
        command = command_of(prefix / "share/stillmesh/launch/rgbd.launch.py", prefix, given)
        assert command[0] == program, command
        assert "ros2:/my/colour,/camera/aligned_depth_to_color/image_raw,/camera/color/camera_info" in command, command
        assert command[command.index("--base-from-camera") + 1] == "0.1,0,0.3" and "--no-tf" in command, command
        starts_and_waits(command, folder)
    print(f"colcon built, installed and started it: {shlex.join(command[1:])}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
