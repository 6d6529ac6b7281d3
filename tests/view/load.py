#!/usr/bin/env python3
"""The page under load for ten minutes, with the real program: load.py PROGRAM [--minutes N] [--keep FOLDER for its report].

Promise: eight look on, one of whom hardly takes anything, for N minutes of a run, a minute each with a minute without them between. From
frame to pose takes them no longer than 5 % beyond without in the median, and in the p99.9 no longer than that or than the run's
own minutes without anybody differ by (others use the machine, too); memory outside the blocks that are taken at the start stays where it
was after their first minute; and the state hashes are those of the run alone."""
import argparse
import base64
import contextlib
import http.client
import json
import os
import socket
import struct
import subprocess
import tempfile
import threading
import time

from run_view import Run, WAIT_S

TOKEN = "a-token-for-tests"
FRAMES_PER_S = 30
CLIENTS = 8
GROWN_MAX_KB = 4096


def is_served(port, client_port):
    """Whether the server's end of a connection is open: its client would see the end of it behind all that lies on the way."""
    with open("/proc/net/tcp") as lines:
        ends = [line.split()[1:4] for line in lines][1:]
    return any(int(local.split(":")[1], 16) == port and int(remote.split(":")[1], 16) == client_port and state == "01"
               for local, remote, state in ends)


class Watchers:
    """Seven that read all of the stream, and one that reads a hundred bytes a second, is dropped for it, and comes again."""

    def __init__(self, port):
        self.port, self.over = port, threading.Event()
        self.bytes_read, self.slow_drops = 0, 0
        self.threads = [threading.Thread(target=self.read_all) for _ in range(CLIENTS - 1)] + [threading.Thread(target=self.read_slowly)]
        for thread in self.threads:
            thread.start()

    def read_all(self):
        while not self.over.is_set():
            with contextlib.suppress(OSError, http.client.HTTPException):
                connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=5)
                connection.request("GET", "/stream")
                answer = connection.getresponse()
                while not self.over.is_set():
                    piece = answer.read1(1 << 17)
                    if not piece:
                        break
                    self.bytes_read += len(piece)
                connection.close()
            self.over.wait(0.2)

    def read_slowly(self):
        while not self.over.is_set():
            with contextlib.suppress(OSError):
                client = socket.socket()
                client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                client.settimeout(5)
                client.connect(("127.0.0.1", self.port))
                client.sendall(b"GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n")
                while not self.over.wait(1) and is_served(self.port, client.getsockname()[1]):
                    client.recv(100)
                self.slow_drops += 0 if self.over.is_set() else 1
                client.close()

    def leave(self):
        self.over.set()
        for thread in self.threads:
            thread.join(WAIT_S)


def resident_kb(pid):
    """Outside mappings of 16 MiB and more: those are blocks of fixed size, which a map fills."""
    size = total = 0
    with open(f"/proc/{pid}/smaps") as lines:
        for line in lines:
            if line.startswith("Size:"):
                size = int(line.split()[1])
            elif line.startswith("Rss:") and size < 16 * 1024:
                total += int(line.split()[1])
    return total


def ask(port, command):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT_S)
    connection.request("POST", "/command", command, {"X-Stillmesh-Token": TOKEN})
    assert connection.getresponse().status == 202
    connection.close()


def run_with_watchers(program, scene, minutes, folder):
    """When who looked on (windows of frames), and what was read; files in `folder`."""
    hashes = f"{folder}/watched"

    def frames():
        with contextlib.suppress(OSError), open(hashes, "rb") as lines:
            return lines.read().count(b"\n")
        return 0
    windows, memory, read, drops = [], [], 0, 0
    with Run(program, *scene, "--view-token", TOKEN, "--report", f"{folder}/report", "--report-frames", "100", "--state-hashes",
             hashes) as run:
        ask(run.port, "speed=1")  # paced, and each frame is given the same as in a run alone
        time.sleep(20)
        for minute in range(2 * minutes):
            begin = frames()
            is_watched = minute % 2 == 1
            watchers = Watchers(run.port) if is_watched else None
            time.sleep(60)
            if is_watched:
                memory.append(resident_kb(run.process.pid))
                watchers.leave()
                read += watchers.bytes_read
                drops += watchers.slow_drops
            assert run.process.poll() is None, run.lines
            windows.append((is_watched, begin + FRAMES_PER_S, frames() - FRAMES_PER_S))
            time.sleep(3)  # the last stream has ended
        ask(run.port, "speed=0")
        run.process.terminate()
        assert run.wait() == 143, run.lines
    return windows, memory, read, drops


def frame_ms(folder):
    """{number of a frame: ms from frame to pose}, from the run's report."""
    with open(f"{folder}/report/index.html", encoding="utf-8") as page:
        text = page.read()
    begin = text.index('<script type="application/json" id="run">') + len('<script type="application/json" id="run">')
    columns = json.loads(text[begin:text.index("</script>", begin)])["columns"]
    number, ms = base64.b64decode(columns["frame"]), base64.b64decode(columns["ms"])
    count = len(number) // 4
    return dict(zip(struct.unpack(f"<{count}I", number), struct.unpack(f"<{count}f", ms)))


def share(values, part):
    values = sorted(values)
    return values[int(part * (len(values) - 1))]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--minutes", type=int, default=10)
    parser.add_argument("--keep")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.keep or scratch
        os.makedirs(folder, exist_ok=True)
        scene = ("--simulate", "walking_xyz:1", "--frames", "1000000")
        windows, memory, read, drops = run_with_watchers(arguments.program, scene, arguments.minutes, folder)
        ms = frame_ms(folder)
        of = {True: [], False: []}
        for is_watched, begin, end in windows:
            of[is_watched].append([ms[i] for i in range(begin, end) if i in ms])
        with_them, alone = sum(of[True], []), sum(of[False], [])
        # The run against itself: every third of its minutes alone.
        thirds = [share(sum(of[False][i::3], []), 0.999) for i in range(min(3, len(of[False])))]
        print(f"{arguments.minutes} min with {CLIENTS} who look on, {arguments.minutes} without: {len(with_them)} and {len(alone)} frames, "
              f"{(len(with_them) + len(alone)) / 120 / arguments.minutes:.0f} a second; "
              f"{read / 1e6 / 60 / arguments.minutes:.1f} MB/s taken, the slow one dropped {drops} times")
        for part in (0.5, 0.99, 0.999):
            a, b = share(with_them, part), share(alone, part)
            print(f"frame to pose, {100 * part:g} %: {a:.2f} ms with, {b:.2f} without ({100 * (a / b - 1):+.1f} %)")
        print(f"p99.9 of thirds of the minutes without: {', '.join(f'{value:.2f}' for value in thirds)} ms")
        print(f"resident outside the blocks, each minute with them: {memory} kB", flush=True)
        assert read > 5e6 * arguments.minutes and drops > 0, (read, drops)
        assert share(with_them, 0.5) <= 1.05 * share(alone, 0.5)
        assert share(with_them, 0.999) <= max(1.05 * share(alone, 0.999), *thirds)
        assert memory[-1] - memory[0] < GROWN_MAX_KB, memory
        with open(f"{folder}/watched") as lines:
            watched = lines.read().splitlines()
        compared = min(len(watched), windows[min(7, len(windows) - 1)][2])  # four minutes with them; the rest would take as long again
        subprocess.run([arguments.program, "run", *scene[:3], str(compared), "--state-hashes", f"{folder}/alone"], check=True,
                       capture_output=True, timeout=3600)
        with open(f"{folder}/alone") as lines:
            assert lines.read().splitlines() == watched[:compared]
        print(f"state hashes of the first {compared} frames: the same")


main()
