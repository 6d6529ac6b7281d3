"""A page in Debian's Chromium without a screen, for tests."""
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

from run_view import WAIT_S


CODES = {"Tab": 9, "Enter": 13, " ": 32, "End": 35, "Home": 36, "ArrowLeft": 37, "ArrowRight": 39}


class Browser:
    """One page, driven by the W3C protocol of chromedriver."""

    def __init__(self, pictures=None):
        self.pictures = pathlib.Path(pictures) if pictures else None  # folder for pictures
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
            "browserName": "chrome", "timeouts": {"script": WAIT_S * 1000},
            "goog:loggingPrefs": {"browser": "ALL"}, "goog:chromeOptions": {"args": arguments}}}})
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
                                                         "windowsVirtualKeyCode": CODES.get(key, 0)})

    def touch(self, steps):
        """Fingers: at each step where each of them is, in pixels of the view."""
        for kind, fingers in [("touchStart", steps[0]), *(("touchMove", step) for step in steps[1:]), ("touchEnd", [])]:
            self.devtools("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [
                {"x": x, "y": y, "id": number} for number, (x, y) in enumerate(fingers)]})

    def point(self, element, x, y, *kinds):
        """The mouse at shares x and y of an element: mouseMoved, mousePressed, mouseReleased."""
        find = f"document.querySelector('{element}')"
        self.script(f"{find}.scrollIntoView({{block: 'center'}})")
        left, top, width, height = self.script(f"const r = {find}.getBoundingClientRect(); return [r.left, r.top, r.width, r.height]")
        for kind in kinds or ("mouseMoved",):
            self.devtools("Input.dispatchMouseEvent", {"type": kind, "x": left + x * width, "y": top + y * height,
                                                       "button": "none" if kind == "mouseMoved" else "left", "clickCount": 1})

    def complaints(self):
        return [entry["message"] for entry in self.post(self.session + "/se/log", {"type": "browser"})]

    def has_no_complaint(self):
        # On a busy machine a browser may take nothing for two seconds: then it is dropped, as it shall be, and comes back.
        said = [line for line in self.complaints() if not ("/stream" in line and "ERR_INCOMPLETE_CHUNKED_ENCODING" in line)]
        said = [line for line in said if "willReadFrequently" not in line]  # who reads the picture often is the test
        assert said == [], said

    def picture(self, name):
        if self.pictures is None:
            return
        self.pictures.mkdir(parents=True, exist_ok=True)
        taken = self.devtools("Page.captureScreenshot", {"captureBeyondViewport": True})
        (self.pictures / f"{name}.png").write_bytes(base64.b64decode(taken["data"]))

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


# How many pixels of the map have nearly a colour of the style sheet.
PIXELS = """(() => { const c = map.canvas, s = document.createElement('canvas'); s.width = c.width; s.height = c.height;
  const x = s.getContext('2d'), was = new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue('--%s').trim());
  map.draw(); x.drawImage(c, 0, 0); const p = x.getImageData(0, 0, s.width, s.height).data; let n = 0;
  for (let i = 0; i < p.length; i += 4)
    n += Math.abs(p[i] - 255 * was.r) + Math.abs(p[i + 1] - 255 * was.g) + Math.abs(p[i + 2] - 255 * was.b) < 24 && p[i + 3] > 200;
  return n })()"""


def keep_promises(promises):
    """Each with a browser of its own; pictures go to the folder that is the second argument."""
    if not shutil.which("chromedriver") or not shutil.which("chromium"):
        print("no chromium or chromedriver: ./run view-test installs them")
        sys.exit(77)
    os.environ.pop("DISPLAY", None)
    for promise in promises:
        begin = time.monotonic()
        browser = Browser(sys.argv[2] if len(sys.argv) > 2 else None)
        try:
            promise(browser)
        finally:
            browser.close()
        print(f"ok {promise.__name__} ({time.monotonic() - begin:.1f} s)", flush=True)
