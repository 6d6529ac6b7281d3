"""The program with --view on a port of its own choice, for tests."""
import http.client
import json
import os
import re
import subprocess
import threading
import time

WAIT_S = int(os.environ.get("STILLMESH_WAIT_S", "120"))  # for a busy machine; more where a sanitizer slows the program


class Run:
    """`stillmesh run --simulate ... --view 0` as long as the block lasts."""

    def __init__(self, program, *arguments, place="0"):
        self.command = [program, "run", *arguments, "--view", place]
        self.lines = []

    def __enter__(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.found = threading.Event()
        self.port = None
        self.out = []
        self.readers = [threading.Thread(target=self.read_errors), threading.Thread(target=self.read_output)]
        for reader in self.readers:
            reader.start()
        if not self.found.wait(WAIT_S) or self.port is None:
            self.__exit__()
            raise AssertionError(f"no port was said: {self.lines}")
        return self

    def read_errors(self):
        for line in self.process.stderr:
            self.lines.append(line)
            said = re.search(r"view: http://[^/]*:(\d+)/", line)
            if said:
                self.port = int(said[1])
                self.found.set()
        self.found.set()

    def read_output(self):
        self.out.extend(self.process.stdout)

    def wait(self):
        code = self.process.wait(WAIT_S)
        for reader in self.readers:
            reader.join(WAIT_S)
        return code

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.wait()

    def get(self, path, method="GET", headers=None):
        """Status, headers, body."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        try:
            connection.request(method, path, headers=headers or {})
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()


class Stream:
    """Server-sent events, one by one: (name, parsed data)."""

    def __init__(self, run):
        self.connection = http.client.HTTPConnection("127.0.0.1", run.port, timeout=WAIT_S)
        self.connection.request("GET", "/stream")
        self.answer = self.connection.getresponse()
        self.status = self.answer.status

    def events(self):
        end = time.monotonic() + WAIT_S
        name = None
        while time.monotonic() < end:
            line = self.answer.readline().decode()
            if not line:
                return
            if line.startswith("event: "):
                name = line[7:].strip()
            elif line.startswith("data: "):
                yield name, json.loads(line[6:]), len(line)

    def close(self):
        self.connection.close()
