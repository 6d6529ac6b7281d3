#!/usr/bin/env python3
"""The page in a browser, Debian's Chromium without a screen: browser.py PROGRAM [FOLDER for pictures]. Each function below is a
promise. Exit 77: there is no Chromium (packages chromium, chromium-driver)."""
import base64
import contextlib
import http.client
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

from run_view import Run, WAIT_S

PROGRAM = sys.argv[1]
PICTURES = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
SCENE = ("--simulate", "walking_xyz:1", "--realtime", "--frames", "100000")  # ended by us


class Browser:
    """One page, driven by the W3C protocol of chromedriver."""

    def __init__(self):
        self.folder = tempfile.mkdtemp()
        self.driver = subprocess.Popen(["chromedriver", "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        for line in self.driver.stdout:
            started = re.search(r"on port (\d+)", line)
            if started and int(started[1]) > 0:
                self.port = int(started[1])
                break
        arguments = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader",
                     "--enable-unsafe-swiftshader", f"--user-data-dir={self.folder}"]
        answer = self.post("/session", {"capabilities": {"alwaysMatch": {
            "browserName": "chrome", "goog:loggingPrefs": {"browser": "ALL"}, "goog:chromeOptions": {"args": arguments}}}})
        self.session = "/session/" + answer["sessionId"]

    def post(self, path, data):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=WAIT_S)
        connection.request("POST", path, json.dumps(data), {"Content-Type": "application/json"})
        answer = json.loads(connection.getresponse().read())["value"]
        connection.close()
        assert not (isinstance(answer, dict) and "error" in answer), answer
        return answer

    def open(self, url, width, height, scheme):
        self.devtools("Emulation.setDeviceMetricsOverride",
                      {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600})
        self.devtools("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": scheme}]})
        self.post(self.session + "/url", {"url": url})

    def devtools(self, command, parameters):
        return self.post(self.session + "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def script(self, text):
        return self.post(self.session + "/execute/sync", {"script": text, "args": []})

    def becomes(self, text):
        """Waits until the expression is true."""
        end = time.monotonic() + WAIT_S
        while not self.script(f"return Boolean({text})"):
            assert time.monotonic() < end, f"never: {text}"
            time.sleep(0.1)

    def press(self, *keys):
        for key in keys:
            for kind in ("rawKeyDown", "keyUp"):
                self.devtools("Input.dispatchKeyEvent", {"type": kind, "key": key, "code": key,
                                                         "windowsVirtualKeyCode": {"Tab": 9, "Home": 36, "ArrowLeft": 37}.get(key, 0)})

    def complaints(self):
        return [entry["message"] for entry in self.post(self.session + "/se/log", {"type": "browser"})]

    def picture(self, name):
        if PICTURES is None:
            return
        PICTURES.mkdir(parents=True, exist_ok=True)
        taken = self.devtools("Page.captureScreenshot", {"captureBeyondViewport": True})
        (PICTURES / f"{name}.png").write_bytes(base64.b64decode(taken["data"]))

    def close(self):
        with contextlib.suppress(Exception):
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
            connection.request("DELETE", self.session)
            connection.getresponse().read()
        self.driver.terminate()
        self.driver.wait(WAIT_S)
        shutil.rmtree(self.folder, ignore_errors=True)


# How many shades a canvas has: one that was never drawn on has one.
SHADES = """(() => { const c = document.getElementById('%s'), s = document.createElement('canvas'); s.width = s.height = 64;
  const x = s.getContext('2d'); if (map && c === map.canvas) map.draw(); x.drawImage(c, 0, 0, 64, 64);
  return new Set(new Uint32Array(x.getImageData(0, 0, 64, 64).data.buffer)).size })()"""


def it_shows_the_run(browser):
    """Picture, mesh, map, state, times and pools are there, the map grows, and the console is silent: large and light, and
    on a phone in the dark, where nothing is wider than the screen."""
    with Run(PROGRAM, *SCENE) as run:
        for width, height, scheme in ((1300, 1000, "light"), (390, 844, "dark"), (390, 844, "light")):
            browser.open(f"http://127.0.0.1:{run.port}/", width, height, scheme)
            browser.becomes("document.getElementById('state').dataset.state === 'tracked'")
            browser.becomes("Number(document.getElementById('map').dataset.points) > 100")
            points = browser.script("return Number(document.getElementById('map').dataset.points)")
            browser.becomes(SHADES % "camera" + " > 100")
            browser.becomes(SHADES % "map" + " > 20")
            browser.becomes(f"Number(document.getElementById('map').dataset.points) > {points}")
            assert browser.script("return document.getElementById('word').textContent") == "Tracked"
            assert browser.script("return document.getElementById('stages').rows.length") == 9
            assert browser.script("return document.getElementById('pools').rows.length") == 3
            wide = browser.script("return document.documentElement.scrollWidth")
            assert wide <= width, (wide, width)
            ground = browser.script("return getComputedStyle(document.body).backgroundColor")
            is_dark = sum(int(v) for v in re.findall(r"\d+", ground)[:3]) < 200
            assert is_dark == (scheme == "dark"), ground
            browser.picture(f"{width}-{scheme}")
        assert browser.complaints() == []


def keys_move_the_map(browser):
    """By keyboard alone: Tab reaches the map, arrows turn it, + comes closer, Home shows all; each layer has a switch."""
    with Run(PROGRAM, *SCENE) as run:
        browser.open(f"http://127.0.0.1:{run.port}/", 1300, 1000, "light")
        browser.becomes("Number(document.getElementById('map').dataset.points) > 100")
        reached = []
        for _ in range(12):
            browser.press("Tab")
            reached.append(browser.script("return document.activeElement.id"))
            if reached[-1] == "map":
                break
        assert reached[-1] == "map", reached
        assert {"show-static", "show-moving", "show-neither", "show-kept", "show-cut"} <= set(reached), reached
        turn, near = browser.script("return [map.turn.azimuth, map.turn.distance]")
        browser.press("ArrowLeft", "+", "+")
        turned, nearer = browser.script("return [map.turn.azimuth, map.turn.distance]")
        assert turned != turn and nearer < near
        browser.press("Home")
        assert browser.script("return map.follow") is False
        assert browser.complaints() == []


def it_comes_back(browser):
    """When the program is gone the page says so; when it is there again under its port, the page goes on by itself."""
    with Run(PROGRAM, *SCENE) as run:
        port = run.port
        browser.open(f"http://127.0.0.1:{port}/", 1300, 1000, "light")
        browser.becomes("document.getElementById('state').dataset.state === 'tracked'")
        run.process.kill()
        browser.becomes("document.getElementById('state').dataset.state === 'gone'")
        browser.picture("gone")
    with Run(PROGRAM, *SCENE, place=str(port)) as run:
        browser.becomes("document.getElementById('state').dataset.state === 'tracked'")
        run.process.terminate()  # it says that it ends
        browser.becomes("document.getElementById('state').dataset.state === 'ended'")


def every_state_is_said(browser):
    """Each state and reason has its word and its advice: told by the page itself, with messages of ours."""
    with Run(PROGRAM, *SCENE) as run:
        browser.open(f"http://127.0.0.1:{run.port}/", 390, 844, "light")
        browser.becomes("latest && latest.picture")
        words = {}
        for state, reason in (("tracked", ""), ("unsure", "few points"), ("unsure", "rival motion"), ("predicted", "none"),
                              ("none", "none"), ("none", "old pictures"), ("unsure", "camera fault")):
            words[(state, reason)] = browser.script(
                f"latest.message.state = '{state}'; latest.message.reason = '{reason}'; silent_s = 0; isConnected = true;"
                "showState(); return ['word', 'advice', 'sign'].map((id) => document.getElementById(id).textContent)")
            browser.picture(f"state-{state}-{reason.replace(' ', '-')}")
        assert len({tuple(said[:2]) for said in words.values()}) == len(words), words
        assert len({words[(s, r)][2] for s, r in words}) == 4  # a sign for each state, so that colour is not alone
        silent = browser.script("silent_s = 12.3; showState(); return document.getElementById('advice').textContent")
        assert "12 s" in silent and "plugged in" in silent, silent


def main():
    if not shutil.which("chromedriver") or not shutil.which("chromium"):
        print("no chromium or chromedriver: ./run view-test installs them")
        sys.exit(77)
    os.environ.pop("DISPLAY", None)
    for promise in (it_shows_the_run, keys_move_the_map, it_comes_back, every_state_is_said):
        begin = time.monotonic()
        browser = Browser()
        try:
            promise(browser)
        finally:
            browser.close()
        print(f"ok {promise.__name__} ({time.monotonic() - begin:.1f} s)", flush=True)


main()
