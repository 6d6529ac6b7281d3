#!/usr/bin/env python3
"""The page's server with the real program: server.py PROGRAM. Each function below is a promise."""
import base64
import re
import socket
import subprocess
import sys
import tempfile
import time

from run_view import Run, Stream, WAIT_S

PROGRAM = sys.argv[1]
LONG = ("--simulate", "walking_static:1", "--realtime", "--frames", "100000")  # ended by us


def page_is_served_whole():
    """The page and all that it names are served, with headers that let nothing in from elsewhere; nothing else is."""
    with Run(PROGRAM, *LONG) as run:
        status, headers, page = run.get("/")
        assert status == 200 and b"Stillmesh" in page
        named = re.findall(r'(?:src|href)="(/[^"]*\.(?:js|css))"', page.decode())
        assert len(named) >= 4, named
        for name in ["/"] + named:
            status, headers, body = run.get(name)
            assert status == 200 and len(body) > 500, (name, status)
            policy = headers["Content-Security-Policy"]
            assert "default-src 'none'" in policy and "unsafe" not in policy, policy
            assert headers["X-Content-Type-Options"] == "nosniff"
            assert headers["Access-Control-Allow-Origin"] is None
        assert not re.search(rb"<script>|<style>| on[a-z]+=| style=|https?://", page), "inline, or from elsewhere"
        for wrong in ("/index.html", "/view", "/view.js/", "//view.js", "/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd",
                      "/stream/x", "/" + "a" * 4000, "/viewXjs", "/posesXcsv", "/trajectory%2Ftxt", "/?x"):
            status, _, body = run.get(wrong)
            assert status == (200 if wrong == "/?x" else 404), (wrong, status)
            assert b"root:" not in body
        time.sleep(1.1)  # for the rate


def others_are_refused():
    """Another site's name, another method, a body, ranges and a storm of requests are refused; the page is there behind them."""
    with Run(PROGRAM, *LONG) as run:
        for host, allowed in (("evil.example", False), (f"evil.example:{run.port}", False), ("", False),
                              ("localhost", True), (f"127.0.0.1:{run.port}", True)):
            status, _, _ = run.get("/", headers={"Host": host})
            assert status == (200 if allowed else 403), (host, status)
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "PATCH"):
            status, headers, _ = run.get("/", method)
            assert status == 405 and headers["Access-Control-Allow-Origin"] is None, (method, status)
        assert run.get("/three.js", "HEAD")[0] == 200
        ranges = ",".join(f"{i}-{i + 1}" for i in range(1, 900))
        assert run.get("/three.js", headers={"Range": "bytes=0-,0-,0-"})[0] == 416
        assert run.get("/three.js", headers={"Range": "bytes=" + ranges})[0] == 416
        for hostile in (b"GET /" + b"a" * 100000 + b" HTTP/1.1\r\n\r\n", b"\0" * 5000, b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 5000,
                        b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\n" + b"x" * 10000,
                        b"GET / HTTP/1.1\r\nHost: localhost\r\nRange: bytes=" + b"0-,:" * 1900 + b"\r\n\r\n"):
            with socket.create_connection(("127.0.0.1", run.port), timeout=WAIT_S) as client:
                try:
                    client.sendall(hostile)
                    client.shutdown(socket.SHUT_WR)
                    while client.recv(65536):
                        pass
                except OSError:
                    pass  # it hung up, as it may
        time.sleep(1.1)
        answers = [run.get("/")[0] for _ in range(150)]
        assert 200 in answers, answers
        assert run.process.poll() is None
        end = time.monotonic() + WAIT_S
        while run.get("/")[0] != 200:
            assert time.monotonic() < end
            time.sleep(0.2)


def stream_tells_the_run():
    """Who comes late is told the path and what keyframes saw, then frames that go up, and the end."""
    with Run(PROGRAM, "--simulate", "walking_static:1", "--realtime", "--frames", "110") as run:
        time.sleep(1)
        stream = Stream(run)
        frames, points, path, ends = [], 0, 0, 0
        for name, data, size in stream.events():
            assert size < 512 * 1024, size
            if name == "frame":
                frames.append(data["frame"])
                assert data["state"] in ("tracked", "unsure", "predicted", "none")
                assert base64.b64decode(data["picture"]).startswith(b"\x89PNG")
                assert len(base64.b64decode(data["features"])) % 8 == 0
                assert len(data["stages"]) == 8
            elif name == "news":
                path = data["path_begin"] + len(base64.b64decode(data["path"])) // 16
                points += sum(len(base64.b64decode(cloud["points"])) // 8 for cloud in data["clouds"])
            elif name == "end":
                ends += 1
        assert ends == 1
        assert len(frames) >= 3 and frames == sorted(set(frames)), frames
        assert points > 100 and path > 10, (points, path)
        assert run.wait() == 0, run.lines


def at_most_eight_look_on():
    """Eight streams are served, the ninth is told why it is not, and has room when one has left."""
    with Run(PROGRAM, *LONG) as run:
        streams = [Stream(run) for _ in range(8)]
        assert [s.status for s in streams] == [200] * 8
        ninth = Stream(run)
        assert ninth.status == 503, ninth.status
        assert run.get("/")[0] == 200  # the page is there all the same
        streams[0].close()
        end = time.monotonic() + WAIT_S
        while True:
            again = Stream(run)
            if again.status == 200:
                break
            assert time.monotonic() < end
            time.sleep(0.2)
        next(again.events())


def nobody_is_waited_for():
    """Clients that never read, or never say what they want, hold nobody up: others are served, and the run ends."""
    with Run(PROGRAM, "--simulate", "walking_static:1", "--realtime", "--frames", "180") as run:
        silent = []
        for request in [b"GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n"] * 4 + [b"GET / HT"] * 4 + [b""] * 12:
            client = socket.create_connection(("127.0.0.1", run.port), timeout=WAIT_S)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            client.sendall(request)
            silent.append(client)
        assert run.get("/")[0] == 200
        stream = Stream(run)
        assert stream.status == 200
        names = [name for name, _, _ in stream.events()]
        assert names.count("frame") >= 3 and names[-1] == "end", names[-5:]
        assert run.wait() == 0, run.lines
        for client in silent:
            client.close()


def the_run_is_the_same():
    """With somebody who looks on, every frame has the state hash that it has without --view."""
    with tempfile.TemporaryDirectory() as folder:
        common = ("--simulate", "walking_xyz:1", "--frames", "70", "--state-hashes")
        subprocess.run([PROGRAM, "run", *common, f"{folder}/alone"], check=True, capture_output=True, timeout=WAIT_S * 4)
        frames = 0
        for _ in range(5):  # on a busy machine a run may be over before somebody looks
            with Run(PROGRAM, *common, f"{folder}/seen") as run:
                try:
                    frames = sum(name == "frame" for name, _, _ in Stream(run).events())
                except OSError:
                    frames = 0
                assert run.wait() == 0, run.lines
            with open(f"{folder}/alone", "rb") as alone, open(f"{folder}/seen", "rb") as seen:
                assert alone.read() == seen.read()
            if frames > 0:
                break
        assert frames > 0, "nobody saw a frame"


def ports_and_addresses():
    """A port that is taken, and an address that is not ours, are refused with a sentence before anything is begun."""
    with Run(PROGRAM, *LONG) as run:
        for place in (f"{run.port}", "203.0.113.1:0", "x", "70000"):
            with tempfile.TemporaryDirectory() as folder:
                refused = subprocess.run([PROGRAM, "run", "--simulate", "walking_xyz:1", "--frames", "5", "--view", place,
                                          "--trajectory", f"{folder}/path.txt"], capture_output=True, text=True, timeout=WAIT_S)
                assert refused.returncode == 2, (place, refused)
                assert "--view" in refused.stderr, refused.stderr
                assert subprocess.run(["ls", folder], capture_output=True, text=True).stdout == ""
    with Run(PROGRAM, *LONG, place="0.0.0.0:0") as run:
        assert any("everybody" in line for line in run.lines), run.lines
        assert run.get("/")[0] == 200


def main():
    for promise in (page_is_served_whole, others_are_refused, stream_tells_the_run, at_most_eight_look_on,
                    nobody_is_waited_for, the_run_is_the_same, ports_and_addresses):
        begin = time.monotonic()
        promise()
        print(f"ok {promise.__name__} ({time.monotonic() - begin:.1f} s)", flush=True)


main()
