#!/usr/bin/env python3
"""Promise: the README's tables are what bench/compare/tables.py makes of the measured runs: a figure that differs from
them, a row without runs, a program without a figure and a table that is gone are found and named; taking runs in and
writing mends the tables."""
import json
import pathlib
import subprocess
import sys
import tempfile

SCRIPT = pathlib.Path(sys.argv[1])
MEASURES = dict(frames=300, ate_m=0.0, tracked=300, none=0, judged_tracked=270, wrong_tracked=0, right=270,
                right_tracked=270, unsure=0)
HEAD = ("| scene | mean | worst run | mean, no mapping | worst, no mapping | mean, region off | "
        "mean, paper to the letter |\n|---|---|---|---|---|---|---|\n")
RIGHT = "| walking_xyz | 0.0015 | 0.0020 | 0.0030 | 0.0030 | 0.250 | 0.500 |\n"
OTHER_HEAD = ("| recording | frames | Stillmesh, mean | worst run | with a pose | paper to the letter, mean | worst run | with a pose | "
              "ORB-SLAM2 | ORB-SLAM3 | Joint-VO-SF |\n|" + 11 * "---|" + "\n")
OTHER_RIGHT = "| freiburg1_rpy, first 12 s | 300 | 0.013 | 0.015 | 100 % | 0.040 | 0.040 | 75 % | 0.1 | 0.2 | 0.3 |\n"
OTHERS = "recording,program,ate_m,source\n" + "".join(
    f"fr1_rpy_a,{program},{error},somebody\n" for program, error in (("ORB-SLAM2", 0.1), ("ORB-SLAM3", 0.2), ("Joint-VO-SF", 0.3)))


def run(root, *arguments):
    answer = subprocess.run([sys.executable, "-B", SCRIPT, *arguments, "--root", root], capture_output=True, text=True)
    return answer.returncode, answer.stdout + answer.stderr


def result(variant, seed, ate_m, scene="walking_xyz", is_recording=False):
    return {"scene": scene, "seed": seed, "variant": variant, "is_recording": is_recording, "dirt": "",
            "measures": MEASURES | {"ate_m": ate_m}}


def take(root, results, *arguments):
    (root / "runs.json").write_text(json.dumps(results))
    return run(root, "take", *arguments, root / "runs.json")


def readme_of(head=HEAD, right=RIGHT, other_head=OTHER_HEAD, other_right=OTHER_RIGHT):
    return "before\n" + other_head + other_right + "\nbetween\n" + head + right + "\nafter | not of it\n"


with tempfile.TemporaryDirectory() as folder:
    root = pathlib.Path(folder)
    readme = root / "README.md"
    assert take(root, [result("on", 1, 0.001), result("on", 2, 0.002), result("alone", 1, 0.003), result("off", 1, 0.25),
                       result("paper", 1, 0.5)])[0] == 0
    for seed, ours, paper in ((1, 0.011, 0.04), (2, 0.015, 0.04)):
        results = [result("on", 7, ours, "fr1_rpy_a", True), result("paper", 7, paper, "fr1_rpy_a", True)]
        results[1]["measures"] = results[1]["measures"] | {"tracked": 200, "unsure": 25}
        assert take(root, results, "--set-seed", str(seed))[0] == 0
    others = root / "docs/measured/others.csv"
    others.write_text(OTHERS)
    readme.write_text(readme_of())
    assert run(root, "check") == (0, ""), run(root, "check")

    for wrong, was, be in ((readme_of(right=RIGHT.replace("0.0020", "0.0019")), "0.0019", "0.0020"),
                           (readme_of(other_right=OTHER_RIGHT.replace("0.013", "0.012")), "0.012", "0.013"),
                           (readme_of(other_right=OTHER_RIGHT.replace("| 0.3 |", "| 0.4 |")), "0.4", "0.3")):
        readme.write_text(wrong)
        code, said = run(root, "check")
        assert code == 1 and was in said and be in said, said
        assert run(root, "write")[0] == 0
        assert readme.read_text() == readme_of()

    # A run that is measured again takes the other's place.
    assert take(root, [result("on", 2, 0.004)])[0] == 0
    assert "0.0025 | 0.0040" in run(root, "check")[1]
    assert take(root, [result("on", 7, 0.021, "fr1_rpy_a", True)], "--set-seed", "2")[0] == 0
    assert "0.016 | 0.021" in run(root, "check")[1]

    readme.write_text(readme_of(right=RIGHT.replace("walking_xyz", "walking_rpy")))
    code, said = run(root, "check")
    assert code == 1 and "walking_rpy: no run of 'on'" in said, said
    readme.write_text(readme_of(other_right=OTHER_RIGHT.replace("freiburg1_rpy", "freiburg1_xyz")))
    code, said = run(root, "check")
    assert code == 1 and "freiburg1_xyz, first 12 s" in said and "no recording" in said, said
    readme.write_text(readme_of())
    others.write_text(OTHERS.replace("Joint-VO-SF", "DVO"))
    code, said = run(root, "check")
    assert code == 1 and "nothing of Joint-VO-SF on fr1_rpy_a" in said, said
    others.write_text(OTHERS)
    for gone in (readme_of(head="", right=""), readme_of(other_head="", other_right="")):
        readme.write_text(gone)
        code, said = run(root, "check")
        assert code == 1 and "no table begins with" in said, said
    for odd in ({"is_recording": True}, {"dirt": "shake=1"}):
        code, said = take(root, [result("on", 1, 0.001) | odd])
        assert code == 1 and "clean simulated rooms" in said, said
    code, said = take(root, [result("on", 1, 0.001)], "--set-seed", "1")
    assert code == 1 and "no recording" in said, said
    # Runs of another length are not averaged.
    longer = result("on", 3, 0.01, "fr1_rpy_a", True)
    longer["measures"] = longer["measures"] | {"frames": 200}
    assert take(root, [longer], "--set-seed", "3")[0] == 0
    readme.write_text(readme_of())
    code, said = run(root, "check")
    assert code == 1 and "[200, 300] frames" in said, said
