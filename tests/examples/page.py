#!/usr/bin/env python3
"""A page shows what is in the repository, and what a program prints:

  page.py PAGE --source DIR [--program NAME=FILE]...   exit 0 when every block that names its origin is true
  page.py --selftest                                   each wrong page is noticed

A fenced block whose line before is `<!-- file: PATH -->` is that file, `<!-- output: NAME -->` what that program prints.
"""
import argparse
import pathlib
import re
import subprocess
import sys

BLOCK = re.compile(r"^<!-- (file|output): (\S+) -->\n```\w*\n(.*?)^```$", re.M | re.S)
MARK = re.compile(r"<!-- (?:file|output):")


def complaints_about(page, files, outputs):
    """files: {path: text}, outputs: {program: what it printed}; both may lack what the page names."""
    complaints = []
    blocks = BLOCK.findall(page)
    if not blocks or len(blocks) != len(MARK.findall(page)):
        complaints.append("an origin without its block, or no block at all")
    for kind, name, text in blocks:
        there = (files if kind == "file" else outputs).get(name)
        if there is None:
            complaints.append(f"{kind} {name}: not there")
        elif there != text:
            complaints.append(f"{kind} {name}: the page shows another text")
    return complaints


def selftest():
    good = "<!-- file: main.c -->\n```cpp\nint main() {}\n```\n\n<!-- output: a -->\n```\nhello\n```\n"
    files, outputs = {"main.c": "int main() {}\n"}, {"a": "hello\n"}
    assert complaints_about(good, files, outputs) == []
    wrong = {
        "another program": (good, {"main.c": "int main() { }\n"}, outputs),
        "another output": (good, files, {"a": "hello\n\n"}),
        "no such file": (good, {}, outputs),
        "no such program": (good, files, {}),
        "a block gone": (good.replace("```\nhello", "hello"), files, outputs),
        "a page without blocks": ("text\n", files, outputs),
    }
    for name, arguments in wrong.items():
        assert complaints_about(*arguments), name
    print(f"{len(wrong)} wrong pages noticed")
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", nargs="?")
    parser.add_argument("--source", type=pathlib.Path)
    parser.add_argument("--program", action="append", default=[])
    parser.add_argument("--selftest", action="store_true")
    arguments = parser.parse_args()
    if arguments.selftest:
        return selftest()
    page = (arguments.source / arguments.page).read_text(encoding="utf-8")
    files = {name: (arguments.source / name).read_text(encoding="utf-8")
             for kind, name, _ in BLOCK.findall(page) if kind == "file" and (arguments.source / name).is_file()}
    outputs = {}
    for pair in arguments.program:
        name, program = pair.split("=", 1)
        outputs[name] = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    complaints = complaints_about(page, files, outputs)
    for complaint in complaints:
        print("WRONG:", complaint)
    print(f"{arguments.page}: {len(BLOCK.findall(page))} blocks, {len(complaints)} complaints")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
