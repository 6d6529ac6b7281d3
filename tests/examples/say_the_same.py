#!/usr/bin/env python3
"""Promise: every program of platform/examples has a comment that says what it is for and fewer than 60 lines, is built and run,
and prints what is written in said.txt, whatever language it is in.

  say_the_same.py --source DIR --stillmesh FILE [--program NAME=FILE]... [--python PYTHON] [--without END OF A NAME]...
NAME: that of the example, with _in_c behind it for C. said.txt: [NAME], and what it prints.
"""
import argparse
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import time

LINES_MAX = 59
# The camera's part; run by hears_ros.py.
NO_PROGRAMS = {"wall.hpp", "wall.h", "wall.py", "ros2_listener.c", "ros2_listener.cpp", "ros2_listener.py"}


def sections_of(text):
    return {name: body for name, body in re.findall(r"^\[(\w+)\]\n(.*?)(?=^\[|\Z)", text, re.M | re.S)}


def heard(command, stillmesh, work):
    """What one says who hears the poses of a run."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with subprocess.Popen([*command, str(port)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as listener:
        end = time.monotonic() + 50  # he gives up after 60 s
        while f":{port:04X} " not in pathlib.Path("/proc/net/udp").read_text(encoding="utf-8") and time.monotonic() < end:
            time.sleep(0.05)
        subprocess.run([stillmesh, "run", "--simulate", "walking_xyz:1", "--frames", "5", "--limits", "pocket", "--poses",
                        f"udp:127.0.0.1:{port}"], capture_output=True, check=True, cwd=work)
        out, err = listener.communicate(timeout=100)
    return subprocess.CompletedProcess(command, listener.returncode, out, err)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--source", required=True, type=pathlib.Path)
    parser.add_argument("--stillmesh", required=True)
    parser.add_argument("--program", action="append", default=[])
    parser.add_argument("--python")
    parser.add_argument("--without", action="append", default=[])
    arguments = parser.parse_args()
    folder = arguments.source / "platform/examples"
    wanted = sections_of((arguments.source / "tests/examples/said.txt").read_text(encoding="utf-8"))
    commands = {name: [file] for name, file in (pair.split("=", 1) for pair in arguments.program)}
    complaints, missing = [], []
    for file in sorted(folder.iterdir()):
        if not file.is_file():
            continue
        lines = file.read_text(encoding="utf-8").splitlines()
        if len(lines) > LINES_MAX:
            complaints.append(f"{file.name}: {len(lines)} lines, at most {LINES_MAX}")
        if not lines[0].startswith(("//", "/*", "#", '"""')):
            complaints.append(f"{file.name}: does not begin with what it is for")
        if file.name in NO_PROGRAMS:
            continue
        name = file.stem + {".cpp": "", ".c": "_in_c", ".py": "_in_python"}[file.suffix]
        if file.suffix == ".py" and arguments.python and not file.name.endswith(tuple(arguments.without)):
            commands[name] = [arguments.python, "-B", str(file)]
        if name not in commands and file.name.endswith(tuple(arguments.without)):
            missing.append(file.name)
        elif name not in commands:
            complaints.append(f"{file.name}: is not built and run")
    for name, command in sorted(commands.items()):
        if name == "localise":
            command = command + [str(arguments.source / "vocabulary/default.voc")]
        with tempfile.TemporaryDirectory() as work:
            if name.startswith("poses_udp"):
                run = heard(command, arguments.stillmesh, work)
            else:
                run = subprocess.run(command, capture_output=True, text=True, check=False, cwd=work)
        example = re.sub("_in_(c|python)$", "", name)
        if run.returncode != 0 or run.stdout != wanted.get(example):
            complaints.append(f"{name}: exit {run.returncode}, and said\n{run.stdout}{run.stderr}and not\n{wanted.get(example)}")
    for complaint in complaints:
        print("WRONG:", complaint)
    print(f"{len(commands)} programs said what they should; not in this build: {', '.join(missing) or 'none'}")
    return 1 if complaints or not commands else 0


if __name__ == "__main__":
    sys.exit(main())
