#!/usr/bin/env python3
"""The page of --view in a browser: browser.py PROGRAM [FOLDER for pictures]. Each function below is a promise. Exit 77: there is
no Chromium (packages chromium, chromium-driver)."""
import os
import re
import sys
import tempfile
import time

from browser_driver import PIXELS, SHADES, keep_promises
from run_view import Run

PROGRAM = sys.argv[1]
SCENE = ("--simulate", "walking_xyz:1", "--realtime", "--frames", "100000")  # ended by us


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
            browser.becomes("document.getElementById('word').textContent === 'Tracked'")  # a busy machine may be silent meanwhile
            assert browser.script("return document.getElementById('stages').rows.length") == 9
            assert browser.script("return document.getElementById('pools').rows.length") == 3
            wide = browser.script("return document.documentElement.scrollWidth")
            assert wide <= width, (wide, width)
            ground = browser.script("return getComputedStyle(document.body).backgroundColor")
            is_dark = sum(int(v) for v in re.findall(r"\d+", ground)[:3]) < 200
            assert is_dark == (scheme == "dark"), ground
            browser.picture(f"{width}-{scheme}")
        browser.has_no_complaint()


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
        assert {"show-static", "show-moving", "show-rival", "show-neither", "show-kept", "show-cut"} <= set(reached), reached
        turn, near = browser.script("return [map.turn.azimuth, map.turn.distance]")
        browser.press("ArrowLeft", "+", "+")
        turned, nearer = browser.script("return [map.turn.azimuth, map.turn.distance]")
        assert turned != turn and nearer < near
        browser.press("Home")
        assert browser.script("return map.follow") is False
        browser.has_no_complaint()


def a_finger_scrolls_and_turns(browser):
    """On a phone a finger that goes up over the map scrolls the page and leaves the map as it lies; one that goes sideways turns
    it and leaves the page; two that part come closer."""
    def drag(*ways):
        where = "const r = at('map').getBoundingClientRect(); return [r.left + r.width / 2, r.top + r.height / 2]"
        x, y = browser.script(where)
        browser.touch([[(x + dx * step / 8, y + dy * step / 8) for dx, dy in ways] for step in range(9)])
        time.sleep(0.3)
        return browser.script("return [scrollY, map.turn.azimuth, map.turn.height, map.turn.distance]")
    with Run(PROGRAM, *SCENE) as run:
        browser.open(f"http://127.0.0.1:{run.port}/", 390, 844, "light")
        browser.devtools("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 2})
        browser.becomes("Number(document.getElementById('map').dataset.points) > 100")
        browser.script("at('map').scrollIntoView({block: 'center'}); map.follow = false; map.come(1)")
        lies = browser.script("return [scrollY, map.turn.azimuth, map.turn.height, map.turn.distance]")
        scrolled = drag((0, -120))
        assert scrolled[0] > lies[0] + 60 and scrolled[1:] == lies[1:], (lies, scrolled)
        turned = drag((100, 0))
        assert turned[0] == scrolled[0] and turned[1] != scrolled[1] and turned[3] == scrolled[3], (scrolled, turned)
        near = drag((-60, -60), (60, 60))
        assert near[0] == turned[0] and near[3] < turned[3], (turned, near)
        browser.devtools("Emulation.setTouchEmulationEnabled", {"enabled": False})
        browser.has_no_complaint()


def the_graph_is_drawn(browser):
    """Keyframes that see the same points are joined by lines, which their box switches off. A loop, told by a message of ours, is
    some pixels wide, from near and from far, and is counted in the legend; there is none before."""
    with Run(PROGRAM, *SCENE) as run:
        for width, height, scheme in ((1300, 1000, "light"), (390, 844, "dark")):
            browser.open(f"http://127.0.0.1:{run.port}/", width, height, scheme)
            browser.becomes("Number(document.getElementById('map').dataset.links) > 3")
            joined, keyframes = browser.script("return [map.covisibleLines.geometry.attributes.position.count / 2, map.keyframes.size]")
            assert joined <= 3 * keyframes, (joined, keyframes)
            browser.script("at('show-links').click()")
            assert browser.script("return map.covisibleLines.visible") is False
            browser.script("at('show-links').click()")
            assert browser.script("return map.covisibleLines.visible") is True
            assert browser.script("return at('n-loops').textContent") == "0"
            assert browser.script("return " + PIXELS % "loop") == 0
            long_px = """ / (() => { const [a, b] = [-0.5, 0.5].map((x) => new THREE.Vector3(x, 0, 1).applyMatrix4(map.root.matrixWorld)
              .project(map.eye)); return Math.hypot((a.x - b.x) * map.canvas.width, (a.y - b.y) * map.canvas.height) / 2 })()"""
            far = browser.script("""onFrame = () => {}; const listed = [[7, [-0.5, 0, 1, 0, 0, 0, 1]], [9, [0.5, 0, 1, 0, 0, 0, 1]]];
              map.setFollow(false); map.setKeyframes(listed); map.setLinks(listed, [], [0, 1]); map.target.set(0, 0, 0);
              map.turn = { azimuth: 0, height: 0.6, distance: 9 }; return """ + PIXELS % "loop" + long_px)
            near = browser.script("map.come(0.3); return " + PIXELS % "loop" + long_px)
            # Four wide, less what is blended at its rims, and two squares of 8 x 8.
            assert 2 < near < 5 and 2 < far < 10, (near, far)
            browser.picture(f"loop-{width}-{scheme}")
        browser.has_no_complaint()


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
                "latest.message.chosen_percent = 8; latest.message.rival_percent = 61;"
                "showState(); return ['word', 'advice', 'sign'].map((id) => document.getElementById(id).textContent)")
            browser.picture(f"state-{state}-{reason.replace(' ', '-')}")
        assert "chosen explains 8 % of the surface in view, its rival 61 %" in words[("unsure", "rival motion")][1], words
        assert len({tuple(said[:2]) for said in words.values()}) == len(words), words
        assert len({words[(s, r)][2] for s, r in words}) == 4  # a sign for each state, so that colour is not alone
        silent = browser.script("isConnected = true; silent_s = 12.3; showState(); return document.getElementById('advice').textContent")
        assert "12 s" in silent and "plugged in" in silent, silent


def it_says_that_it_waits(browser):
    """With --wait and no camera the page is there, and says what is missing."""
    with Run(PROGRAM, "--camera", "openni2:no-such-camera", "--wait") as run:
        browser.open(f"http://127.0.0.1:{run.port}/", 390, 844, "light")
        browser.becomes("document.getElementById('state').dataset.state === 'waiting'")
        browser.becomes("document.getElementById('advice').textContent.includes('plugged in')")
        assert browser.script("return document.getElementById('control').hidden")
        browser.picture("waiting")
        browser.has_no_complaint()


def who_has_the_token_steers(browser):
    """The token in the address opens the bar, and leaves the address; pause, step and speed work by its buttons; a new map wants
    two presses. Who has none is asked for it, and a wrong one is said to be wrong."""
    scene = ("--simulate", "walking_xyz:1", "--frames", "100000", "--view-token", "a-token-for-tests")
    with Run(PROGRAM, *scene) as run:
        browser.open(f"http://127.0.0.1:{run.port}/", 1300, 1000, "light")
        browser.becomes("!document.getElementById('control').hidden")
        assert browser.script("return [at('steer').hidden, at('token-box').hidden]") == [True, False]
        browser.script("at('token').value = 'not-the-token'; at('token').dispatchEvent(new Event('change')); at('pause').click()")
        browser.becomes("!at('token-box').hidden")
        assert len(browser.complaints()) == 1  # the browser tells of the 403
        browser.open("about:blank", 1300, 1000, "light")
        browser.open(f"http://127.0.0.1:{run.port}/#token=a-token-for-tests", 1300, 1000, "light")
        browser.becomes("latest && !at('control').hidden && !at('steer').hidden")
        assert browser.script("return location.hash") == ""
        browser.script("at('pause').click()")
        browser.becomes("control.paused && document.getElementById('state').dataset.state === 'paused'")
        browser.picture("paused")
        browser.script("at('step').click()")
        browser.script("at('pace').value = '2'; at('pace').dispatchEvent(new Event('change'))")
        browser.becomes("control.speed === 2")
        browser.script("at('pause').click()")
        browser.becomes("!control.paused && document.getElementById('state').dataset.state === 'tracked'")
        browser.script("at('reset').click()")
        assert browser.script("return at('reset').textContent").startswith("Press again")
        browser.script("at('reset').click()")
        browser.becomes("document.getElementById('mapnumber').textContent === '2'")
        browser.has_no_complaint()


def the_map_is_steered_by_keyboard(browser):
    """By keyboard alone, on a phone's width, dark and light: Tab reaches both buttons of the map, Space saves it to the file of
    --map-out and has it kept as it is and added to again, which the button shows and the page tells; nothing is wider than the
    screen. A run without --map-out has the first switched off."""
    scene = ("--simulate", "walking_xyz:1", "--realtime", "--frames", "100000", "--view-token", "a-token-for-tests")

    def reach(name):
        for _ in range(12):
            browser.press("Tab")
            if browser.script("return document.activeElement.id") == name:
                return
        raise AssertionError(f"Tab does not reach {name}")

    def told(words):
        return f"at('events').textContent.includes('as was asked on the page: {words}')"
    with tempfile.TemporaryDirectory() as folder, Run(PROGRAM, *scene, "--map-out", f"{folder}/room.map") as run:
        address = f"http://127.0.0.1:{run.port}/#token=a-token-for-tests"
        for scheme in ("dark", "light"):
            browser.open("about:blank", 390, 844, scheme)
            browser.open(address, 390, 844, scheme)
            browser.becomes("latest && control.may_steer && !at('steer').hidden && !at('save-map').disabled")
            reach("save-map")
            browser.press(" ")
            browser.becomes(told("the map is saved to"))
            reach("localise")
            browser.press(" ")
            browser.becomes("at('localise').getAttribute('aria-pressed') === 'true'")
            browser.becomes(told("from here on the map stays as it is"))
            assert browser.script("return document.documentElement.scrollWidth") <= 390
            browser.picture(f"map-buttons-{scheme}")
            browser.press(" ")
            browser.becomes("at('localise').getAttribute('aria-pressed') === 'false'")
            browser.becomes(told("from here on the map is added to"))
        assert os.path.getsize(f"{folder}/room.map") > 10000
        browser.has_no_complaint()
    with Run(PROGRAM, *scene) as run:
        browser.open(f"http://127.0.0.1:{run.port}/#token=a-token-for-tests", 1300, 1000, "light")
        browser.becomes("latest && control.may_steer && !at('localise').disabled")
        assert browser.script("return at('save-map').disabled") is True
        browser.picture("map-buttons-wide")


def files_are_taken_home(browser):
    """Who has the token takes map, grid and cloud home by buttons, each under its name and with its size told; what was not saved yet
    is said not to be. Without the token, and in a run that writes none, there are no such buttons."""
    scene = ("--simulate", "static_halfsphere:1", "--realtime", "--frames", "100000", "--view-token", "a-token-for-tests")
    buttons = ("take-map", "take-grid", "take-cloud")
    hidden = f"return {list(buttons)}.map((id) => at(id).hidden)"
    with tempfile.TemporaryDirectory() as folder:
        outputs = ("--map-out", f"{folder}/o.map", "--grid", f"{folder}/o", "--cloud", f"{folder}/o.ply")
        with Run(PROGRAM, *scene, *outputs) as run:
            browser.open(f"http://127.0.0.1:{run.port}/", 390, 844, "light")
            browser.script("sessionStorage.clear(); location.reload()")
            browser.becomes("latest && control.may_steer && token === ''")
            assert browser.script(hidden) == [True, True, True]
            browser.open("about:blank", 390, 844, "light")
            browser.open(f"http://127.0.0.1:{run.port}/#token=a-token-for-tests", 390, 844, "light")
            browser.becomes("latest && control.may_steer && !at('take-cloud').hidden")
            assert browser.script(hidden) == [False, False, False]
            browser.script("window.names = []; HTMLAnchorElement.prototype.click = function () { names.push(this.download) }; at('take-map').click()")
            browser.becomes("at('taken').textContent.includes('save it first')")
            for name, button in (("o.map", "take-map"), ("o.yaml", "take-grid"), ("o.ply", "take-cloud")):
                while not os.path.exists(f"{folder}/{name}"):  # a grid wants to have seen a floor
                    browser.script("at('save-map').click()")
                    browser.becomes("at('events').textContent.includes('is saved to')")
                    time.sleep(3)
                browser.script(f"setText('taken', ''); at('{button}').click()")
                browser.becomes("at('taken').textContent.includes('MB')")
            assert browser.script("return names") == ["room.map", "grid.yaml", "grid.pgm", "cloud.ply"]
            assert browser.script("return document.documentElement.scrollWidth") <= 390
            browser.script("at('taken').scrollIntoView()")
            browser.picture("taken-home")
    with Run(PROGRAM, *scene) as run:
        browser.open(f"http://127.0.0.1:{run.port}/#token=a-token-for-tests", 1300, 1000, "light")
        browser.becomes("latest && control.may_steer")
        assert browser.script(hidden) == [True, True, True]


keep_promises((it_shows_the_run, keys_move_the_map, a_finger_scrolls_and_turns, the_graph_is_drawn, it_comes_back, every_state_is_said,
               it_says_that_it_waits, who_has_the_token_steers, the_map_is_steered_by_keyboard, files_are_taken_home))
