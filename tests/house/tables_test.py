#!/usr/bin/env python3
"""Promise: the README's table is what bench/compare/tables.py makes of the measured runs: a figure that differs from
them, a scene without runs and a table that is gone are found and named; taking runs in and writing mends the table."""
import json
import pathlib
import subprocess
import sys
import tempfile

SCRIPT = pathlib.Path(sys.argv[1])
MEASURES = dict(frames=300, ate_m=0.0, tracked=300, none=0, judged_tracked=270, wrong_tracked=0, right=270,
                right_tracked=270)


def run(root, *arguments):
    answer = subprocess.run([sys.executable, "-B", SCRIPT, *arguments, "--root", root], capture_output=True, text=True)
    return answer.returncode, answer.stdout + answer.stderr


def result(variant, seed, ate_m, scene="walking_xyz"):
    return {"scene": scene, "seed": seed, "variant": variant, "is_recording": False, "dirt": "",
            "measures": MEASURES | {"ate_m": ate_m}}


with tempfile.TemporaryDirectory() as folder:
    root = pathlib.Path(folder)
    runs = [result("on", 1, 0.001), result("on", 2, 0.002), result("alone", 1, 0.003), result("off", 1, 0.25),
            result("paper", 1, 0.5)]
    (root / "runs.json").write_text(json.dumps(runs))
    head = ("| scene | mean | worst run | mean, no mapping | worst, no mapping | mean, region off | "
            "mean, paper to the letter |\n|---|---|---|---|---|---|---|\n")
    right = "| walking_xyz | 0.0015 | 0.0020 | 0.0030 | 0.0030 | 0.250 | 0.500 |\n"
    readme = root / "README.md"

    assert run(root, "take", root / "runs.json")[0] == 0
    readme.write_text("before\n" + head + right + "\nafter | not of it\n")
    assert run(root, "check") == (0, ""), run(root, "check")

    readme.write_text("before\n" + head + right.replace("0.0020", "0.0019") + "\nafter | not of it\n")
    code, said = run(root, "check")
    assert code == 1 and "0.0019" in said and "0.0020" in said, said
    assert run(root, "write")[0] == 0
    assert readme.read_text() == "before\n" + head + right + "\nafter | not of it\n"

    # A run that is measured again takes the other's place.
    (root / "runs.json").write_text(json.dumps([result("on", 2, 0.004)]))
    assert run(root, "take", root / "runs.json")[0] == 0
    assert "0.0025 | 0.0040" in run(root, "check")[1]

    readme.write_text(head + right.replace("walking_xyz", "walking_rpy"))
    code, said = run(root, "check")
    assert code == 1 and "walking_rpy: no run of 'on'" in said, said
    readme.write_text("no table\n")
    code, said = run(root, "check")
    assert code == 1 and "no table begins with" in said, said
    for odd in ({"is_recording": True}, {"dirt": "shake=1"}):
        (root / "runs.json").write_text(json.dumps([result("on", 1, 0.001) | odd]))
        code, said = run(root, "take", root / "runs.json")
        assert code == 1 and "clean simulated rooms" in said, said
