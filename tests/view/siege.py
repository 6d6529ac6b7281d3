#!/usr/bin/env python3
"""The page's server under siege, with the real program: siege.py PROGRAM. Each function below is a promise."""
import contextlib
import functools
import os
import resource
import socket
import subprocess
import sys
import tempfile
import time

from run_view import Run, Stream, WAIT_S

PROGRAM = sys.argv[1]
CONNECTIONS = 1000
FRAMES = "90"
SCENE = ("--simulate", "walking_static:1", "--frames", FRAMES)


def lines_of(file):
    if not os.path.exists(file):
        return 0  # the run has not begun yet
    with open(file, "rb") as lines:
        return lines.read().count(b"\n")


def memory_kb(run):
    with open(f"/proc/{run.process.pid}/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmRSS:"))


def descriptors(run):
    return len(os.listdir(f"/proc/{run.process.pid}/fd"))


def connect(run):
    client = socket.socket()
    client.setblocking(False)
    with contextlib.suppress(BlockingIOError, OSError):
        client.connect(("127.0.0.1", run.port))
    return client


def send(client, data):
    with contextlib.suppress(OSError):
        client.send(data)


@functools.cache
def hashes_alone():
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([PROGRAM, "run", *SCENE, "--state-hashes", f"{folder}/alone"], check=True, capture_output=True,
                       timeout=WAIT_S * 4)
        with open(f"{folder}/alone", "rb") as alone:
            return alone.read()


def besiege(kind):
    """A run under a thousand connections: silent, that send a header's byte a moment, or headers without end; its
    hashes are those of the same run alone, its memory and descriptors stay bounded, and the page is there behind it."""
    with tempfile.TemporaryDirectory() as folder:
        with Run(PROGRAM, *SCENE, "--state-hashes", f"{folder}/besieged") as run:
            while lines_of(f"{folder}/besieged") < 5:
                assert run.process.poll() is None, run.lines
                time.sleep(0.1)
            before = memory_kb(run)
            clients = [connect(run) for _ in range(CONNECTIONS)]
            try:
                while run.process.poll() is None and lines_of(f"{folder}/besieged") < int(FRAMES) - 10:
                    for client in clients:
                        send(client, kind)
                    assert descriptors(run) < 100, descriptors(run)
                    time.sleep(0.2)
                if run.process.poll() is None:
                    grown = memory_kb(run) - before
                    assert grown < 16 * 1024, grown  # 14 threads with what each has read; the map grows, too
            finally:
                for client in clients:
                    client.close()
            assert run.wait() == 0, run.lines
        with open(f"{folder}/besieged", "rb") as seen:
            assert seen.read() == hashes_alone()


def silent_connections():
    """A thousand connections that say nothing."""
    besiege(b"")


def slow_headers():
    """A thousand that send a header bit by bit, without end (slowloris)."""
    besiege(b"X-a: b\r\n")


def huge_headers():
    """A thousand that send headers of any size."""
    besiege(b"GET / HTTP/1.1\r\nHost: localhost\r\nX-a: " + b"b" * 60000)


def the_page_is_there_behind_it():
    """When the siege is over, the page is served again within seconds, and shows the run."""
    with Run(PROGRAM, "--simulate", "walking_static:1", "--frames", "100000") as run:
        clients = [connect(run) for _ in range(CONNECTIONS)]
        for client in clients:
            send(client, b"GET / HTTP/1.1\r\n")
        time.sleep(1)
        for client in clients:
            client.close()
        end = time.monotonic() + WAIT_S
        while True:
            with contextlib.suppress(OSError):
                if run.get("/")[0] == 200:
                    break
            assert time.monotonic() < end
            time.sleep(0.3)
        assert any(name == "frame" for name, _, _ in Stream(run).events())


def main():
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(most, 4096), most))
    for promise in (silent_connections, slow_headers, huge_headers, the_page_is_there_behind_it):
        begin = time.monotonic()
        promise()
        print(f"ok {promise.__name__} ({time.monotonic() - begin:.1f} s)", flush=True)


main()
