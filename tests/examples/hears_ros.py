#!/usr/bin/env python3
"""Promise: platform/examples/ros2_listener hears the poses that a run publishes: of five seconds in real time at least a third, each with
the time of its image and where the run's own trajectory has it, and it ends by itself.

  hears_ros.py --listener FILE --stillmesh FILE
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile

FRAMES = 150
LINE = re.compile(r"^(\d+\.\d{9}): (-?\d+\.\d\d) m ahead, (-?\d+\.\d\d) m to the left, \+- (\d+\.\d{3}) m$")
ROUNDED_M = 0.0051
LOOPBACK = ("<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='127.0.0.1' multicast='true'/></Interfaces></General>"
            "<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--listener", required=True)
    parser.add_argument("--stillmesh", required=True)
    arguments = parser.parse_args()
    environment = dict(os.environ, ROS_DOMAIN_ID=str(1 + os.getpid() % 100), CYCLONEDDS_URI=LOOPBACK)
    with tempfile.TemporaryDirectory() as work:
        with subprocess.Popen([arguments.listener], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment) as listener:
            subprocess.run([arguments.stillmesh, "run", "--simulate", "static_xyz:1", "--frames", str(FRAMES), "--realtime", "--limits",
                            "pocket", "--publish", "ros2", "--trajectory", "path.txt"],
                           capture_output=True, check=True, cwd=work, env=environment, timeout=300)
            said, errors = listener.communicate(timeout=200)
        path = [line.split() for line in (pathlib.Path(work) / "path.txt").read_text(encoding="utf-8").splitlines()
                if not line.startswith("#")]
    # The camera's z is ahead of it, its x to the right.
    places = {float(time): (float(z), -float(x)) for time, x, _, z, *_ in path}
    assert listener.returncode == 0, (listener.returncode, errors)
    lines = [LINE.match(line) for line in said.splitlines()]
    assert all(lines), said
    for line in lines:
        time, ahead, left, sigma = map(float, line.groups())
        nearest = min(places, key=lambda one: abs(one - time))
        assert abs(nearest - time) < 2e-6, (line[0], nearest)
        assert max(abs(ahead - places[nearest][0]), abs(left - places[nearest][1])) <= ROUNDED_M, (line[0], places[nearest])
        assert sigma < 0.1, line[0]
    assert len({line[1] for line in lines}) == len(lines) >= FRAMES // 3, len(lines)
    print(f"{len(lines)} of {len(path)} poses heard")
    return 0


if __name__ == "__main__":
    sys.exit(main())
