#!/usr/bin/env python3
"""Promise: platform/examples/ros2_listener, in each of its languages, hears the poses that a run publishes: of five seconds in real time at least a third, each with
the time of its image and where the run's own trajectory has it, and it ends by itself.

  hears_ros.py --stillmesh FILE --listener COMMAND... [--listener COMMAND...]...
"""
import argparse
import contextlib
import os
import pathlib
import re
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))
from ros_domain import own_domain  # noqa: E402

FRAMES = 150
LINE = re.compile(r"^(\d+\.\d{9}): (-?\d+\.\d\d) m ahead, (-?\d+\.\d\d) m to the left, \+- (\d+\.\d{3}) m$")
ROUNDED_M = 0.0051
LOOPBACK = ("<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='127.0.0.1' multicast='true'/></Interfaces></General>"
            "<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>")


def heard_wrong(said, places):
    """What is wrong with a listener's lines; places: {time: (ahead, left)} of the trajectory."""
    lines = [LINE.match(line) for line in said.splitlines()]
    if not all(lines):
        return said
    for line in lines:
        time, ahead, left, sigma = map(float, line.groups())
        nearest = min(places, key=lambda one: abs(one - time))
        if abs(nearest - time) >= 2e-6:
            return f"{line[0]}: no pose of that time, the nearest {nearest}"
        if max(abs(ahead - places[nearest][0]), abs(left - places[nearest][1])) > ROUNDED_M or sigma >= 0.1:
            return f"{line[0]}: the trajectory has {places[nearest]}"
    return "" if len({line[1] for line in lines}) == len(lines) >= FRAMES // 3 else f"{len(lines)} lines of {FRAMES} frames"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--listener", required=True, action="append", nargs="+")
    parser.add_argument("--stillmesh", required=True)
    arguments = parser.parse_args()
    environment = dict(os.environ, ROS_DOMAIN_ID=own_domain(), CYCLONEDDS_URI=LOOPBACK)
    with tempfile.TemporaryDirectory() as work, contextlib.ExitStack() as stack:
        listeners = [stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment))
                     for command in arguments.listener]
        subprocess.run([arguments.stillmesh, "run", "--simulate", "static_xyz:1", "--frames", str(FRAMES), "--realtime", "--limits",
                        "pocket", "--publish", "ros2", "--trajectory", "path.txt"],
                       capture_output=True, check=True, cwd=work, env=environment, timeout=300)
        answers = [listener.communicate(timeout=200) for listener in listeners]
        path = [line.split() for line in (pathlib.Path(work) / "path.txt").read_text(encoding="utf-8").splitlines()
                if not line.startswith("#")]
    # The camera's z is ahead of it, its x to the right.
    places = {float(time): (float(z), -float(x)) for time, x, _, z, *_ in path}
    shifted = {time: (ahead + 0.02, left) for time, (ahead, left) in places.items()}
    for command, listener, (said, errors) in zip(arguments.listener, listeners, answers):
        assert listener.returncode == 0, (command, listener.returncode, errors)
        assert not heard_wrong(said, places), (command, heard_wrong(said, places))
        assert heard_wrong(said, shifted) and heard_wrong("", places)  # another path, and silence, are noticed
        print(f"{pathlib.Path(command[-1]).name}: {len(said.splitlines())} of {len(path)} poses heard")
    return 0


if __name__ == "__main__":
    sys.exit(main())
