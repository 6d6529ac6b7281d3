#!/usr/bin/env python3
"""The README's tables of simulated rooms and of real recordings, made from measured runs.

  bench/compare/tables.py take RESULTS.json ...   what `accuracy --json` wrote, into docs/measured/simulated.csv; a run
                                                  that is there already is replaced
  bench/compare/tables.py take --set-seed N RESULTS.json ...   likewise of recordings, run with --set seed=N, into
                                                  docs/measured/recordings.csv
  bench/compare/tables.py write                   the tables in README.md, anew
  bench/compare/tables.py check                   fails, and says which lines differ, unless they are what the runs say

The runs: ./run accuracy --scenes SCENES --seeds 1-10 --region both --method paper --variant
alone:mapping.is_enabled=false --json FILE; of recordings, for N from 1 to 12: ./run accuracy --test-data --scenes none
--region on --method paper --set seed=N --json FILE. What other programs reach is in docs/measured/others.csv, with its
source.
"""
import argparse
import csv
import json
import pathlib
import statistics
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
KEYS = ["scene", "seed", "variant"]
MEASURES = ["frames", "ate_m", "tracked", "none", "judged_tracked", "wrong_tracked", "right", "right_tracked"]
RECORDINGS_MEASURES = [*MEASURES, "unsure"]
HEAD = ["scene", "mean", "worst run", "mean, no mapping", "worst, no mapping", "mean, region off",
        "mean, paper to the letter"]
# Recordings as the README calls them, and the programs beside ours.
RECORDINGS = {"freiburg1_rpy, first 12 s": "fr1_rpy_a",
              "the same with two people walking before the camera": "fr1_rpy_a_walking"}
OTHERS = ["ORB-SLAM2", "ORB-SLAM3", "Joint-VO-SF"]
RECORDINGS_HEAD = ["recording", "frames", "Stillmesh, mean", "worst run", "with a pose", "paper to the letter, mean", "worst run",
                   "with a pose", *OTHERS]


class Refused(Exception):
    pass


def read_runs(path):
    """{(scene, seed, variant): row}; empty without a file."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {tuple(row[k] for k in KEYS): row for row in csv.DictReader(file)}


def take(paths, runs, set_seed):
    """`set_seed`: of recordings; None: clean simulated rooms are wanted."""
    for path in paths:
        for result in json.loads(pathlib.Path(path).read_text()):
            if set_seed is None and (result["is_recording"] or result.get("dirt")):
                raise Refused(f"{path}: {result['scene']}: a recording, or dirt; this table has clean simulated rooms. "
                              "(Of recordings: --set-seed N.)")
            if set_seed is not None and not result["is_recording"]:
                raise Refused(f"{path}: {result['scene']}: no recording; --set-seed is theirs.")
            seed = result["seed"] if set_seed is None else set_seed
            row = {"scene": result["scene"], "seed": str(seed), "variant": result["variant"]}
            for measure in MEASURES if set_seed is None else RECORDINGS_MEASURES:
                value = result["measures"][measure]
                row[measure] = f"{value:.6f}" if isinstance(value, float) else str(value)
            runs[tuple(row[k] for k in KEYS)] = row


def write_runs(path, runs, measures):
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, KEYS + measures, lineterminator="\n")
        writer.writeheader()
        writer.writerows(runs[key] for key in sorted(runs, key=lambda k: (k[0], int(k[1]), k[2])))


def values_of(runs, scene, variant, measure="ate_m"):
    found = [float(row[measure]) for key, row in runs.items() if key[0] == scene and key[2] == variant]
    if not found:
        raise Refused(f"{scene}: no run of '{variant}' was taken in.")
    return found


def room(scene, runs):
    """The cells behind the scene's name."""
    ours, alone = values_of(runs, scene, "on"), values_of(runs, scene, "alone")
    return [f"{statistics.fmean(ours):.4f}", f"{max(ours):.4f}", f"{statistics.fmean(alone):.4f}",
            f"{max(alone):.4f}", f"{statistics.fmean(values_of(runs, scene, 'off')):.3f}",
            f"{statistics.fmean(values_of(runs, scene, 'paper')):.3f}"]


def recording(name, runs, others):
    if name not in RECORDINGS:
        raise Refused(f"README.md: '{name}' is no recording that this table knows.")
    scene = RECORDINGS[name]
    frames = {int(value) for variant in ("on", "paper") for value in values_of(runs, scene, variant, "frames")}
    if len(frames) != 1:
        raise Refused(f"{scene}: its runs have {sorted(frames)} frames; one number was expected.")
    cells = [str(frames.pop())]
    for variant in ("on", "paper"):
        errors = values_of(runs, scene, variant)
        measured = sum(sum(values_of(runs, scene, variant, state)) for state in ("tracked", "unsure"))
        share = measured / sum(values_of(runs, scene, variant, "frames"))
        cells += [f"{statistics.fmean(errors):.3f}", f"{max(errors):.3f}", f"{100 * share:.0f} %"]
    for program in OTHERS:
        if (scene, program) not in others:
            raise Refused(f"docs/measured/others.csv: nothing of {program} on {scene}.")
        cells.append(others[scene, program])
    return cells


def read_others(path):
    """{(recording, program): error}; empty without a file."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {(row["recording"], row["program"]): row["ate_m"] for row in csv.DictReader(file)}


def find(text, head):
    """Where the table is in these lines: its begin, its end, and the names of its rows."""
    first = "| " + " | ".join(head) + " |"
    if first not in text:
        raise Refused(f"README.md: no table begins with '{first}'.")
    begin = end = text.index(first)
    while end < len(text) and text[end].startswith("|"):
        end += 1
    return begin, end, [line.split("|")[1].strip() for line in text[begin + 2:end]]


def made(text, head, cells_of):
    """Begin and end of the table in the text, and its lines as they should be."""
    begin, end, names = find(text, head)
    rows = [head, *([name, *cells_of(name)] for name in names)]
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return begin, end, [lines[0], "|" + "---|" * len(head), *lines[1:]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["take", "write", "check"])
    parser.add_argument("results", nargs="*", help="what accuracy --json wrote")
    parser.add_argument("--set-seed", type=int, help="the results are of recordings, run with --set seed=N")
    parser.add_argument("--root", type=pathlib.Path, default=ROOT, help="the repository")
    arguments = parser.parse_intermixed_args()
    measured, readme = arguments.root / "docs/measured", arguments.root / "README.md"
    if arguments.what == "take":
        is_rooms = arguments.set_seed is None
        path = measured / ("simulated.csv" if is_rooms else "recordings.csv")
        runs = read_runs(path)
        take(arguments.results, runs, arguments.set_seed)
        write_runs(path, runs, MEASURES if is_rooms else RECORDINGS_MEASURES)
        print(f"{path}: {len(runs)} runs")
        return 0
    rooms, recordings = read_runs(measured / "simulated.csv"), read_runs(measured / "recordings.csv")
    others = read_others(measured / "others.csv")
    text = readme.read_text().split("\n")
    wrong = []
    for head, cells_of in ((RECORDINGS_HEAD, lambda name: recording(name, recordings, others)),
                           (HEAD, lambda name: room(name, rooms))):
        begin, end, table = made(text, head, cells_of)
        wrong += [(is_, be) for is_, be in zip(text[begin:end], table) if is_ != be]
        text[begin:end] = table
    if arguments.what == "write":
        readme.write_text("\n".join(text))
        return 0
    for is_, be in wrong:
        print(f"README.md says   {is_}\nmeasured was     {be}", file=sys.stderr)
    if wrong:
        print("'bench/compare/tables.py write' brings it up to date.", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Refused as refused:
        sys.exit(f"tables.py: {refused}")
