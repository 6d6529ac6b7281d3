#!/usr/bin/env python3
"""Steering a run from its page, with the real program: steering.py PROGRAM. Each function below is a promise."""
import http.client
import json
import os
import subprocess
import sys
import tempfile
import time

from run_view import Run, Stream, WAIT_S

PROGRAM = sys.argv[1]
TOKEN = "a-token-for-tests"
LONG = ("--simulate", "walking_static:1", "--frames", "100000")  # ended by us


def ask(run, command, token=TOKEN, headers=None):
    connection = http.client.HTTPConnection("127.0.0.1", run.port, timeout=WAIT_S)
    try:
        given = {} if token is None else {"X-Stillmesh-Token": token}
        connection.request("POST", "/command", command, {**given, **(headers or {})})
        return connection.getresponse().status
    finally:
        connection.close()


def control_when(run, holds):
    """How the run says it stands, once that is as wanted."""
    stream = Stream(run)
    try:
        for name, data, _ in stream.events():
            if name == "control" and holds(data):
                return data
    finally:
        stream.close()
    raise AssertionError("never said")


def frames_seen(run, seconds):
    stream, frames = Stream(run), []
    end = time.monotonic() + seconds
    for name, data, _ in stream.events():
        if name == "frame":
            frames.append(data["frame"])
        if time.monotonic() > end:
            break
    stream.close()
    return frames


def without_a_token_nothing_is_set():
    """A run without a token takes no command from anybody, and its page says that nobody may steer."""
    with Run(PROGRAM, *LONG) as run:
        assert ask(run, "pause") == 405
        assert control_when(run, lambda c: True)["may_steer"] is False
        status, headers, body = run.get("/trajectory.txt")
        assert status == 200 and body.startswith(b"# timestamp") and "attachment" in headers["Content-Disposition"]
        assert run.get("/poses.csv")[2].startswith(b"time_s,state,")


def the_token_opens():
    """With a token: who does not say it, or says another, is refused, five times a second; who says it is heard; what is no command,
    or too long, is refused; another site's name is refused as ever."""
    with Run(PROGRAM, *LONG, "--view-token", TOKEN) as run:
        assert any(f"#token={TOKEN}" in line for line in run.lines), run.lines
        for wrong in (None, "", "a", TOKEN[:-1], TOKEN + "x", TOKEN.upper()):
            assert ask(run, "pause", wrong) in (403, 429), wrong
        answers = [ask(run, "pause", f"guess-number-{i}") for i in range(20)]
        assert 429 in answers and 202 not in answers, answers
        assert control_when(run, lambda c: c["may_steer"])["paused"] is False
        time.sleep(1.1)
        assert ask(run, "pause", headers={"Host": "evil.example"}) == 403
        for wrong in ("", "stop", "pause&step", "speed=x", "x" * 500):
            assert ask(run, wrong) == 400, wrong
        assert ask(run, "x" * 5000) >= 400
        assert ask(run, "pause") == 202
        control_when(run, lambda c: c["paused"])
    with Run(PROGRAM, *LONG, "--view-token", "auto") as run:
        said = "".join(run.lines)
        token = said[said.index("#token=") + 7:].split()[0]
        assert len(token) == 32 and ask(run, "pause", token) == 202
    for wrong in ("short", "has space in it", "x" * 65):
        refused = subprocess.run([PROGRAM, "run", *LONG, "--view", "0", "--view-token", wrong], capture_output=True, text=True,
                                 timeout=WAIT_S)
        assert refused.returncode == 2 and "--view-token" in refused.stderr and wrong not in refused.stderr, refused


def a_recording_is_paused():
    """Pause stops the frames, a step gives one, going on gives all; at a speed they come no faster."""
    with tempfile.TemporaryDirectory() as folder:
        hashes = f"{folder}/hashes"  # a line a frame

        def frames():
            with open(hashes, "rb") as lines:
                return lines.read().count(b"\n")

        with Run(PROGRAM, *LONG, "--view-token", TOKEN, "--state-hashes", hashes) as run:
            assert ask(run, "pause") == 202
            control_when(run, lambda c: c["paused"])
            begin = frames()  # what is said to be paused is
            time.sleep(1)
            assert frames() == begin
            for _ in range(3):
                assert ask(run, "step") == 202
            end = time.monotonic() + WAIT_S
            while frames() < begin + 3:
                assert time.monotonic() < end
                time.sleep(0.1)
            time.sleep(1)
            assert frames() == begin + 3
            assert ask(run, "speed=0.25") == 202 and ask(run, "resume") == 202
            control_when(run, lambda c: c["speed"] == 0.25 and not c["paused"])
            before, began = frames(), time.monotonic()
            time.sleep(2)
            assert frames() - before <= 7.5 * (time.monotonic() - began) + 2
            assert ask(run, "speed=0") == 202
            control_when(run, lambda c: c["speed"] == 0 and not c["paused"])


def what_is_asked_changes_no_bit():
    """A run that is paused, stepped and slowed gives the state hashes of the same run alone."""
    with tempfile.TemporaryDirectory() as folder:
        scene = ("--simulate", "walking_xyz:3", "--frames", "40")
        subprocess.run([PROGRAM, "run", *scene, "--state-hashes", f"{folder}/alone"], check=True, capture_output=True,
                       timeout=WAIT_S * 3)
        with Run(PROGRAM, *scene, "--view-token", TOKEN, "--state-hashes", f"{folder}/steered") as run:
            assert ask(run, "pause") == 202
            for command in ("step", "step", "speed=2", "resume", "saving=0", "saving=1", "speed=0"):
                time.sleep(0.15)
                assert ask(run, command) == 202
            assert run.wait() == 0, run.lines
        with open(f"{folder}/alone", "rb") as alone, open(f"{folder}/steered", "rb") as steered:
            assert alone.read() == steered.read()


def saving_and_a_new_map():
    """Saving stops and goes on, and the file says where; a new map begins when it is wished, and the run says so; the report, too, and
    has no token in it."""
    with tempfile.TemporaryDirectory() as folder:
        with Run(PROGRAM, *LONG, "--view-token", TOKEN, "--trajectory", f"{folder}/path.txt", "--report", f"{folder}/report",
                 "--report-frames", "5") as run:
            control_when(run, lambda c: c["can_save"] and c["can_reset"])
            for command, holds in (("saving=0", lambda c: not c["saving"]), ("saving=1", lambda c: c["saving"])):
                assert ask(run, command) == 202
                control_when(run, holds)
                time.sleep(1)
            assert ask(run, "reset") == 202
            end = time.monotonic() + WAIT_S
            for name, data, _ in Stream(run).events():
                if name == "frame" and data["map"] == 2:
                    break
                assert time.monotonic() < end
            run.process.terminate()
            assert run.wait() == 143, run.lines
        text = open(f"{folder}/path.txt").read()
        assert "# not saved from here on" in text and "# saved again" in text and "wished on the page" in text, text[:500]
        report = open(f"{folder}/report/index.html").read()
        assert "wished on the page" in report and TOKEN not in report


def the_map_is_saved_and_kept():
    """Save map writes it where --map-out says while the run goes on; localise only leaves it as it is, keyframe by keyframe, until it is
    to be added to again; the run says so, and a run that has no place for a map does not offer to save it."""
    scene = ("--simulate", "walking_xyz:1", "--frames", "100000", "--view-token", TOKEN)
    with tempfile.TemporaryDirectory() as folder, Run(PROGRAM, *scene, "--map-out", f"{folder}/room.map") as run:
        control_when(run, lambda c: c["can_save_map"] and c["can_localise"] and not c["localising"])
        stream, events, keyframes = Stream(run), "", []

        def read_until(holds):
            nonlocal events
            end = time.monotonic() + WAIT_S
            for name, data, _ in stream.events():
                assert time.monotonic() < end, events
                if name == "news":
                    events += json.dumps(data["events"])
                if name == "frame":
                    keyframes.append(data["pools"][0]["now"])
                if holds():
                    return
        read_until(lambda: keyframes and keyframes[-1] >= 2)
        assert not os.path.exists(f"{folder}/room.map")
        assert ask(run, "save_map") == 202
        read_until(lambda: os.path.exists(f"{folder}/room.map"))
        said = subprocess.run([PROGRAM, "map", "info", f"{folder}/room.map"], capture_output=True, text=True, timeout=WAIT_S)
        assert said.returncode == 0 and "keyframes" in said.stdout, said
        assert ask(run, "localise=1") == 202
        read_until(lambda: "stays as it is" in events)
        control_when(run, lambda c: c["localising"])
        del keyframes[:]
        read_until(lambda: len(keyframes) >= 30)
        assert len(set(keyframes)) == 1, keyframes
        assert ask(run, "localise=0") == 202
        read_until(lambda: "is added to" in events)
        control_when(run, lambda c: not c["localising"])
        read_until(lambda: keyframes[-1] != keyframes[0])
        assert "as was asked on the page: the map is saved to" in events, events
        stream.close()
    with Run(PROGRAM, *LONG, "--view-token", TOKEN) as run:
        assert control_when(run, lambda c: c["can_localise"])["can_save_map"] is False


def contents(file):
    with open(file, "rb") as kept:
        return kept.read()


def files_are_taken_home():
    """Who has the token takes map, grid and cloud home while the run goes on, byte for byte as they were saved last; before they are
    saved there is none, and without the token there never is. Saving them changes no pose: the run's state hashes are its own."""
    scene = ("--simulate", "static_halfsphere:1", "--frames", "100000")
    paths = ("/room.map", "/grid.yaml", "/grid.pgm", "/cloud.ply")
    token = {"X-Stillmesh-Token": TOKEN}
    with tempfile.TemporaryDirectory() as folder:
        files = dict(zip(paths, (f"{folder}/office.map", f"{folder}/office.yaml", f"{folder}/office.pgm", f"{folder}/office.ply")))
        hashes = f"{folder}/hashes"
        with Run(PROGRAM, *scene, "--view-token", TOKEN, "--map-out", files["/room.map"], "--grid", f"{folder}/office", "--cloud",
                 files["/cloud.ply"], "--state-hashes", hashes) as run:
            assert control_when(run, lambda c: c["can_save_map"])["take"] == list(paths)
            for path in paths:
                assert run.get(path)[0] == 403 and run.get(path, headers={**token, "Host": "evil.example"})[0] == 403
                status, _, body = run.get(path, headers=token)
                assert status == 404 and b"save it first" in body, (status, body)
            time.sleep(1.1)
            assert run.get(paths[0], headers={"X-Stillmesh-Token": TOKEN[:-1]})[0] == 403
            end = time.monotonic() + WAIT_S
            while not all(os.path.exists(file) for file in files.values()):  # a grid wants to have seen a floor
                assert time.monotonic() < end, run.lines
                assert ask(run, "save_map") == 202
                time.sleep(0.5)
            assert ask(run, "pause") == 202
            control_when(run, lambda c: c["paused"])  # no further save begins; one may still be on its way to the disk
            for path, file in files.items():
                saved, before = contents(file), None
                while saved != before:  # a save that ended meanwhile: once more
                    before = saved
                    (status, headers, body), with_query = [run.get(name, headers=token) for name in (path, path + "?file=/etc/passwd")]
                    saved = contents(file)
                assert status == 200 and f"filename={path[1:]}" in headers["Content-Disposition"], (path, status)
                assert body == saved and with_query[2] == saved, path
                assert run.get(path, method="HEAD", headers=token)[0] == 200
                for near in (path.replace(".", "x"), path.replace(".", "%2F"), path.upper(), path + "/"):  # nor under another name
                    assert run.get(near)[0] == 404, near
            time.sleep(1.1)  # for the rate
            assert run.get("/../office.yaml", headers=token)[0] in (400, 404)
            run.process.terminate()
            assert run.wait() == 143, run.lines
        with open(hashes) as lines:
            saved = lines.read().splitlines()
        alone = f"{folder}/alone"
        subprocess.run([PROGRAM, "run", *scene[:3], str(len(saved)), "--state-hashes", alone], check=True, capture_output=True,
                       timeout=WAIT_S * 4)
        with open(alone) as lines:
            assert lines.read().splitlines() == saved
    with Run(PROGRAM, *LONG, "--view-token", TOKEN) as run:
        assert control_when(run, lambda c: c["can_localise"])["take"] == []
        status, _, body = run.get("/grid.pgm", headers=token)
        assert status == 404 and b"--grid" in body, (status, body)
    with Run(PROGRAM, *LONG) as run:
        assert run.get("/room.map", headers=token)[0] == 403


def a_clock_is_not_stopped():
    """Where frames come by a clock there is no pause: the page is told so, and a command for it does nothing."""
    with Run(PROGRAM, "--simulate", "walking_static:1", "--realtime", "--frames", "100000", "--view-token", TOKEN) as run:
        assert control_when(run, lambda c: c["may_steer"] and c["can_reset"])["can_pause"] is False
        assert ask(run, "pause") == 202
        assert len(frames_seen(run, 3)) >= 2


def main():
    promises = (without_a_token_nothing_is_set, the_token_opens, a_recording_is_paused, what_is_asked_changes_no_bit,
                saving_and_a_new_map, the_map_is_saved_and_kept,
                files_are_taken_home, a_clock_is_not_stopped)
    for promise in promises:
        begin = time.monotonic()
        promise()
        print(f"ok {promise.__name__} ({time.monotonic() - begin:.1f} s)", flush=True)


main()
