"""A domain of ROS 2 that no other test has while this process lives: as tests/ros2/ros_domain.hpp."""
import fcntl
import os
import pathlib
import tempfile

DOMAINS = 101
_held = []


def own_domain():
    """The number, as text; its lock ends with this process."""
    for i in range(DOMAINS):
        domain = 1 + (os.getpid() + i) % DOMAINS
        lock = open(pathlib.Path(tempfile.gettempdir()) / f"stillmesh_test_domain_{domain}", "a", encoding="utf-8")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        _held.append(lock)
        return str(domain)
    raise RuntimeError(f"{DOMAINS} tests have a domain of ROS 2 each")
