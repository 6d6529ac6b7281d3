#!/usr/bin/env python3
"""The report in a browser, from a file: report_browser.py PROGRAM [FOLDER for pictures]. Each function below is a promise. Exit 77:
there is no Chromium (packages chromium, chromium-driver)."""
import atexit
import base64
import csv
import functools
import io
import json
import re
import shutil
import subprocess
import sys
import tempfile

from browser_driver import SHADES, keep_promises
from run_view import WAIT_S

PROGRAM = sys.argv[1]
FOLDER = tempfile.mkdtemp()
atexit.register(shutil.rmtree, FOLDER, ignore_errors=True)
SIZES = ((1300, 1000, "light"), (1300, 1000, "dark"), (390, 844, "light"), (390, 844, "dark"))


@functools.cache
def report(scene="walking_xyz:1", frames=120, pictures=50, *arguments):
    """A run's report, made once; beside it poses.jsonl."""
    folder = f"{FOLDER}/{scene.replace(':', '-')}-{frames}"
    subprocess.run([PROGRAM, "run", "--simulate", scene, "--frames", str(frames), "--report", folder, "--report-frames", str(pictures),
                    "--poses", f"{FOLDER}/poses-{scene.replace(':', '-')}-{frames}.jsonl", *arguments],
                   check=True, capture_output=True, timeout=WAIT_S * 4)
    return folder


def open_report(browser, width=1300, height=1000, scheme="light"):
    browser.open(f"file://{report()}/index.html", width, height, scheme)
    browser.becomes("shown && document.getElementById('camera').dataset.frame")


def it_is_seen_from_a_file(browser):
    """Picture, map and curves are drawn, the console is silent, nothing is wider than the screen and no table than its box: large and
    small, light and dark."""
    for width, height, scheme in SIZES:
        open_report(browser, width, height, scheme)
        browser.becomes(SHADES % "camera" + " > 100")
        browser.becomes(SHADES % "map" + " > 15")
        assert browser.script("return Number(document.getElementById('map').dataset.links)") > 3
        assert browser.script("return document.getElementById('n-loops').textContent") == "0"
        drawn = browser.script("""return [...document.querySelectorAll('#curves canvas')].map((c) => { const x = c.getContext('2d');
          return new Set(new Uint32Array(x.getImageData(0, 0, c.width, c.height).data.buffer)).size })""")
        assert len(drawn) == 4 and min(drawn) > 3, drawn
        wide = browser.script("return document.documentElement.scrollWidth")
        assert wide <= width, (wide, width)
        cut = browser.script("""return [...document.querySelectorAll('.scroll')].filter((e) => e.scrollWidth > e.clientWidth)
          .map((e) => e.textContent.slice(0, 40))""")
        assert cut == [], cut
        # Above what it plays the player leaves room on a phone, where it stays in sight.
        high = browser.script("return document.getElementById('player').offsetHeight")
        assert high < 150, high
        ground = browser.script("return getComputedStyle(document.body).backgroundColor")
        assert (sum(int(v) for v in re.findall(r"\d+", ground)[:3]) < 200) == (scheme == "dark"), ground
        browser.picture(f"report-{width}-{scheme}")
    browser.has_no_complaint()


def the_slider_moves_all(browser):
    """The slider goes over all frames: picture, state, curves and the camera in the map follow; what is shown is the frame's own
    picture or the nearest that was kept, and says so."""
    open_report(browser)
    assert browser.script("return [document.getElementById('slider').min, document.getElementById('slider').max]") == ["0", "119"]
    seen = set()
    for frame in (0, 30, 61, 119):
        browser.script(f"const s = document.getElementById('slider'); s.value = {frame}; s.dispatchEvent(new Event('input'))")
        browser.becomes(f"Math.abs(Number(document.getElementById('camera').dataset.frame) - {frame}) <= 3")  # every fourth was kept
        picture = int(browser.script("return document.getElementById('camera').dataset.frame"))
        said = browser.script("return document.getElementById('picture-of').textContent")
        assert (said == "") == (picture == frame), (said, picture, frame)
        pose, now, time = browser.script("return [map.pose, curves.now, run.time[current]]")
        assert now == time and abs(time - frame / 30) < 0.01
        wanted = browser.script(f"return Array.from(run.pose.subarray({7 * frame}, {7 * frame + 7}))")
        assert pose == wanted
        seen.add(browser.script("return document.getElementById('camera').toDataURL()"))
    assert len(seen) == 4
    browser.script("at('speed').value = '8'; show(0); play()")
    browser.becomes("current === frames - 1 && clock === null")  # it ends by itself
    browser.has_no_complaint()


def curves_are_read(browser):
    """Pointing at a curve tells what was then, and marks it in the map; a click goes there; a stretch that is dragged over fills the
    width; a path is a way back to its frame."""
    open_report(browser)
    canvas = "#curves figure:nth-child(2) canvas"
    browser.point(canvas, 0.5, 0.5)
    said = browser.script("return document.getElementById('readout').textContent")
    assert re.match(r"[\d.]+ s · frame \d+ · tracked.* · error [\d.]+ cm · \d+ static, \d+ moving · [\d.]+ ms", said), said
    assert browser.script("return map.path.marked.visible")
    browser.point(canvas, 0.25, 0.5, "mouseMoved", "mousePressed", "mouseReleased")
    second = browser.script("return run.time[current]")
    assert 0.5 < second < 1.2, second
    browser.point(canvas, 0.4, 0.5, "mouseMoved", "mousePressed")
    browser.point(canvas, 0.6, 0.5, "mouseMoved", "mouseReleased")
    begin, end = browser.script("return [curves.from, curves.to]")
    assert 1.2 < begin < 1.8 and 2.0 < end < 2.8, (begin, end)
    browser.picture("report-zoomed")
    browser.script("at('zoom-all').click()")
    assert browser.script("return curves.to - curves.from === curves.end")
    browser.script("map.all(); map.draw()")
    at = browser.script("""const v = new THREE.Vector3(...map.path.places[100].slice(0, 3)).applyMatrix4(map.root.matrixWorld).project(map.eye);
      return [(v.x + 1) / 2, (1 - v.y) / 2]""")
    browser.script("show(0)")
    browser.point("#map", *at, "mouseMoved", "mousePressed", "mouseReleased")
    assert browser.script("return Math.hypot(...[0, 1, 2].map((k) => run.pose[7 * current + k] - run.pose[700 + k]))") < 0.02
    browser.has_no_complaint()


def keys_play(browser):
    """By keyboard alone: arrows step, Home and End, space plays; Tab goes through the page in the order it is read, and whatever has
    the focus is seen to have it."""
    open_report(browser)
    browser.press("Home")
    assert browser.script("return current") == 0
    browser.press("ArrowRight", "ArrowRight", "ArrowLeft")
    assert browser.script("return current") == 1
    browser.press("End")
    assert browser.script("return current") == 119
    browser.press("Home", " ")
    browser.becomes("current > 3")
    browser.press(" ")
    assert browser.script("return clock === null")
    places = []
    for _ in range(40):
        browser.press("Tab")
        place = browser.script("""const e = document.activeElement; if (e === document.body) return null; const s = getComputedStyle(e);
          const all = [...document.querySelectorAll('*')]; return [e.id || e.tagName, all.indexOf(e), s.outlineStyle !== 'none']""")
        if place is None or (places and place[1] <= places[0][1]):
            break
        places.append(place)
    order = [place[1] for place in places]
    assert order == sorted(order), places
    assert {"show-kept", "map", "play", "slider", "zoom-in", "csv"} <= {place[0] for place in places}, places
    assert all(place[2] for place in places), places
    browser.script("map.canvas.focus()")
    before, turn = browser.script("return [current, map.turn.azimuth]")
    browser.press("ArrowLeft")  # turns the map, and steps nowhere
    after, turned = browser.script("return [current, map.turn.azimuth]")
    assert before == after and turn != turned


# Pixels of the camera's picture that have a colour of picture.js.
RIVAL_PIXELS = """return (() => { const c = at('camera'), p = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0;
  const [r, g, b] = [1, 3, 5].map((i) => parseInt(RIVAL_COLOUR.slice(i, i + 2), 16));
  for (let i = 0; i < p.length; i += 4) n += Math.abs(p[i] - r) + Math.abs(p[i + 1] - g) + Math.abs(p[i + 2] - b) < 24;
  return n })()"""


def go_to(browser, frame):
    browser.script(f"show({frame})")
    browser.becomes(f"document.getElementById('camera').dataset.frame === String(run.frame[{frame}])")


def keep_sheet(browser, frames):
    """Pictures of some frames side by side, each with its state in words, as rival.jpg."""
    if browser.pictures is None:
        return
    for k, frame in enumerate(frames):
        go_to(browser, frame)
        browser.script(f"""const c = at('camera'), k = {k}, i = {frame}, gap = 8;
          if (k === 0) {{ window.sheet = document.createElement('canvas'); sheet.width = {len(frames)} * (c.width + gap) - gap; sheet.height = c.height + 46;
            sheet.getContext('2d').fillStyle = '#fff'; sheet.getContext('2d').fillRect(0, 0, sheet.width, sheet.height); }}
          const x = sheet.getContext('2d'); x.drawImage(c, k * (c.width + gap), 0); x.fillStyle = '#17202b'; x.font = '14px sans-serif';
          [`${{run.time[i].toFixed(1)}} s: ${{stateOf(i)}}`,
           `surface explained: ${{run.chosen[i]}} %, by the rival ${{run.rival[i]}} %`]
            .forEach((line, row) => x.fillText(line, k * (c.width + gap), c.height + 18 * (row + 1)))""")
    data = browser.script("return sheet.toDataURL('image/jpeg', 0.8)")
    (browser.pictures / "rival.jpg").write_bytes(base64.b64decode(data.split(",")[1]))


def the_rival_is_told(browser):
    """Where another motion explains more than the one chosen, the state says how much of the surface each of both does, and the picture
    shows what only the rival does, as much of it as the legend counts; the box takes it away."""
    browser.open(f"file://{report('trolley_returns:1', 345, 345, '--vocabulary', 'none')}/index.html", 1300, 1000, "light")
    browser.becomes("shown && document.getElementById('camera').dataset.frame")
    browser.script("show(run.reason.findIndex((reason, i) => run.state[i] === 2 && run.reasons[reason] === 'rival motion'))")
    frame = browser.script("return current")
    go_to(browser, frame)
    said = browser.script("return document.getElementById('advice').textContent")
    told = re.match(r"Rival motion: the motion chosen explains (\d+) % of the surface in view, its rival (\d+) %\.", said)
    assert told and int(told[1]) < int(told[2]) <= 100, said
    assert f"explains {told[1]} % of the surface in view, its rival {told[2]} %" in browser.script("return document.getElementById('readout').textContent")
    count = int(browser.script("return document.getElementById('n-rival').textContent"))
    assert count > 5 and browser.script(RIVAL_PIXELS) > 5 * count, (count, browser.script(RIVAL_PIXELS))
    browser.script("document.getElementById('show-rival').click()")
    assert browser.script(RIVAL_PIXELS) == 0
    browser.script("document.getElementById('show-rival').click()")
    for width, height, scheme in SIZES:
        browser.open("about:blank", width, height, scheme)
        browser.open(f"file://{report('trolley_returns:1', 345, 345, '--vocabulary', 'none')}/index.html", width, height, scheme)
        browser.becomes("shown")
        go_to(browser, frame)
        assert browser.script(CONTRAST) == []
        browser.picture(f"rival-{width}-{scheme}")
    keep_sheet(browser, [frame - 1, frame])
    browser.has_no_complaint()


# Each element with text of its own: its contrast against what lies behind it, by WCAG.
CONTRAST = """
  const channel = (v) => (v /= 255, v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  const light = ([r, g, b]) => 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b);
  const parse = (text) => text.match(/[\\d.]+/g).map(Number);
  const behind = (e) => { for (; e; e = e.parentElement) { const c = parse(getComputedStyle(e).backgroundColor); if (c.length === 3 || c[3] > 0.9) return c }
    return [255, 255, 255] };
  const found = [];
  for (const e of document.body.querySelectorAll('*')) {
    if (!e.getClientRects().length || e.disabled || e.closest('[hidden], script, .hidden')) continue;
    if (![...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim())) continue;
    const style = getComputedStyle(e);
    const [a, b] = [light(parse(style.color)), light(behind(e))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const isLarge = parseFloat(style.fontSize) >= 24 || (parseFloat(style.fontSize) >= 18.6 && Number(style.fontWeight) >= 700);
    if (ratio < (isLarge ? 3 : 4.5)) found.push([e.tagName, e.id, e.textContent.trim().slice(0, 40), ratio]);
  }
  return found"""


def all_is_legible(browser):
    """Text stands out from its ground by 4.5 (large: 3), in the light and in the dark; the four states differ in brightness or
    shape: each has a row of its own, and a sign."""
    for width, height, scheme in SIZES[:2]:
        open_report(browser, width, height, scheme)
        assert browser.script(CONTRAST) == []
    assert browser.script("return new Set(Object.keys(STATES).slice(1, 5).map((s) => STATES[s][0])).size") == 4


def the_csv_is_the_run(browser):
    """Data behind the curves: a line for each frame, with the numbers that --poses gave at the time."""
    open_report(browser)
    rows = list(csv.DictReader(io.StringIO(browser.script("return csvOf(run)"))))
    with open(f"{FOLDER}/poses-walking_xyz-1-120.jsonl") as lines:
        poses = [pose for pose in map(json.loads, lines) if "state" in pose]
    assert len(rows) == len(poses) == 120, (len(rows), len(poses))
    for row, pose in zip(rows, poses):
        assert int(row["frame"]) == pose["frame"] and row["state"] == pose["state"], (row, pose)
        assert abs(float(row["time_s"]) - float(pose["time"])) < 1e-6, (row, pose)
        given = pose["map_from_camera"]["p"] + pose["map_from_camera"]["q"]
        kept = [float(row[name]) for name in ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")]
        assert max(abs(a - b) for a, b in zip(kept, given)) < 1e-5, (row, pose)
        assert row["error_m"] != "" and float(row["ms"]) > 0
    browser.script("at('csv').addEventListener('click', (e) => e.preventDefault()); at('csv').click()")
    assert browser.script("return document.getElementById('csv').href").startswith("blob:")


def gaps_are_gaps(browser):
    """Where there was no pose, the path has a gap: no line leads over it. The map of another stretch is another map."""
    open_report(browser)
    whole = browser.script("return map.path.line.geometry.attributes.position.count")
    assert whole == 2 * 119, whole
    cut = browser.script("run.state.fill(0, 40, 60); mapShown = 0; showMap(0); return map.path.line.geometry.attributes.position.count")
    assert cut == 2 * (119 - 21), cut
    assert browser.script("return map.path.dots.geometry.attributes.position.count") == 100
    other = browser.script("run.map.fill(2, 60); film.map = 2; mapShown = 0; showMap(0); return [map.path.places.length, map.clouds.size]")
    assert other == [40, 0], other
    browser.script("show(80)")
    assert browser.script("return map.path.places.length") == 60 and browser.script("return map.clouds.size") > 0
    browser.script("show(45)")
    assert browser.script("return document.getElementById('state').dataset.state") == "none"
    browser.picture("report-gap")


def runs_lie_side_by_side(browser):
    """`stillmesh report A B`: one page with each run's numbers, curves and path."""
    page = f"{FOLDER}/comparison.html"
    subprocess.run([PROGRAM, "report", report(), report("static_xyz:1", 60, 5), "--out", page], check=True, capture_output=True,
                   timeout=WAIT_S)
    for width, height, scheme in SIZES:
        browser.open(f"file://{page}", width, height, scheme)
        browser.becomes("map && curves")
        browser.becomes(SHADES % "map" + " > 5")
        table = browser.script("return [...document.getElementById('numbers').rows].map((r) => [...r.cells].map((c) => c.textContent))")
        assert len(table[0]) == 3 and ["frames", "120", "60"] in table, table
        assert any("✓" in cell for row in table for cell in row)
        assert browser.script("return map.path.lines.size") == 2
        wide = browser.script("return document.documentElement.scrollWidth")
        assert wide <= width, (wide, width)
        browser.picture(f"comparison-{width}-{scheme}")
    browser.point("#curves figure:nth-child(3) canvas", 0.3, 0.5)
    assert "static_xyz" in browser.script("return document.getElementById('readout').textContent")
    assert browser.script(CONTRAST) == []
    browser.has_no_complaint()


keep_promises((it_is_seen_from_a_file, the_slider_moves_all, curves_are_read, keys_play, all_is_legible, the_csv_is_the_run,
               gaps_are_gaps, runs_lie_side_by_side, the_rival_is_told))
