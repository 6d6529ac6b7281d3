#!/usr/bin/env python3
"""The README's table of simulated rooms, made from measured runs.

  bench/compare/tables.py take RESULTS.json ...   what `accuracy --json` wrote, into docs/measured/simulated.csv; a run
                                                  that is there already is replaced
  bench/compare/tables.py write                   the table in README.md, anew
  bench/compare/tables.py check                   fails, and says which lines differ, unless it is what the runs say

The runs: ./run accuracy --scenes SCENES --seeds 1-10 --region both --method paper --variant
alone:mapping.is_enabled=false --json FILE
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
HEAD = ["scene", "mean", "worst run", "mean, no mapping", "worst, no mapping", "mean, region off",
        "mean, paper to the letter"]
RULE = "|" + "---|" * len(HEAD)


class Refused(Exception):
    pass


def read_runs(path):
    """{(scene, seed, variant): row}; empty without a file."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {tuple(row[k] for k in KEYS): row for row in csv.DictReader(file)}


def take(paths, runs):
    for path in paths:
        for result in json.loads(pathlib.Path(path).read_text()):
            if result["is_recording"] or result.get("dirt"):
                raise Refused(f"{path}: {result['scene']}: a recording, or dirt; this table has clean simulated rooms.")
            row = {"scene": result["scene"], "seed": str(result["seed"]), "variant": result["variant"]}
            for measure in MEASURES:
                value = result["measures"][measure]
                row[measure] = f"{value:.6f}" if isinstance(value, float) else str(value)
            runs[tuple(row[k] for k in KEYS)] = row


def write_runs(path, runs):
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, KEYS + MEASURES, lineterminator="\n")
        writer.writeheader()
        writer.writerows(runs[key] for key in sorted(runs, key=lambda k: (k[0], int(k[1]), k[2])))


def table_of(scenes, runs):
    """The lines of the table, a row a scene in this order."""
    lines = ["| " + " | ".join(HEAD) + " |", RULE]
    for scene in scenes:
        def errors(variant):
            found = [float(row["ate_m"]) for key, row in runs.items() if key[0] == scene and key[2] == variant]
            if not found:
                raise Refused(f"{scene}: no run of '{variant}' was taken in.")
            return found
        ours, alone = errors("on"), errors("alone")
        cells = [f"{statistics.fmean(ours):.4f}", f"{max(ours):.4f}", f"{statistics.fmean(alone):.4f}",
                 f"{max(alone):.4f}", f"{statistics.fmean(errors('off')):.3f}",
                 f"{statistics.fmean(errors('paper')):.3f}"]
        lines.append(f"| {scene} | " + " | ".join(cells) + " |")
    return lines


def table_in(text):
    """Where the table is in these lines: its begin, its end, and the scenes of its rows."""
    head = "| " + " | ".join(HEAD) + " |"
    if head not in text:
        raise Refused(f"README.md: no table begins with '{head}'.")
    begin = end = text.index(head)
    while end < len(text) and text[end].startswith("|"):
        end += 1
    return begin, end, [line.split("|")[1].strip() for line in text[begin + 2:end]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["take", "write", "check"])
    parser.add_argument("results", nargs="*", help="what accuracy --json wrote")
    parser.add_argument("--root", type=pathlib.Path, default=ROOT, help="the repository")
    arguments = parser.parse_args()
    csv_path, readme = arguments.root / "docs/measured/simulated.csv", arguments.root / "README.md"
    runs = read_runs(csv_path)
    if arguments.what == "take":
        take(arguments.results, runs)
        write_runs(csv_path, runs)
        print(f"{csv_path}: {len(runs)} runs")
        return 0
    text = readme.read_text().split("\n")
    begin, end, scenes = table_in(text)
    table = table_of(scenes, runs)
    if arguments.what == "write":
        readme.write_text("\n".join(text[:begin] + table + text[end:]))
        return 0
    wrong = [(is_, be) for is_, be in zip(text[begin:end], table) if is_ != be]
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
