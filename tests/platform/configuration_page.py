#!/usr/bin/env python3
"""docs/configuration.md is what the program says of its keys: configuration_page.py [--update] PROGRAM PAGE

Promise: the reference page names every key with the default, range and effect that the program has. --update writes it.
Exit: 0 the page is right, 1 it is not.
"""
import pathlib
import re
import subprocess
import sys

HEAD = """\
# Configuration

Every key that a run takes, as `stillmesh run --print-config` prints it: defaults, ranges, what it does. Give them in a file
(`--config FILE`, TOML) or one by one (`--set KEY=VALUE`); what is unknown or out of its range is refused by name. `--scene outdoor`
sets the paper's outdoor thresholds. Numbers of the method that are no user's concern stand beside the code that uses them
(`tuning.hpp` in the rooms of `engine/`), each in one line of the same form.

This page is made from the program (`tests/platform/configuration_page.py --update`), and a test compares the two.
"""


def printed(program, *arguments):
    text = subprocess.run([program, "run", "--print-config", *arguments], capture_output=True, text=True, check=True).stdout
    return dict((key, (value, about)) for key, value, about in re.findall(r"^([\w.]+) = (\S+)\s+# (.*)$", text, re.M))


def page(program):
    room, pocket = printed(program), printed(program, "--limits", "pocket")
    out = [HEAD]
    group = None
    for key, (value, about) in room.items():
        if key.split(".")[0] != group:
            group = key.split(".")[0]
            out.append(f"\n## {group}\n| key | default | under pocket | range | what it does |\n|---|---|---|---|---|\n" if group == "limits"
                       else f"\n## {group}\n| key | default | range | what it does |\n|---|---|---|---|\n")
        allowed, effect = about.split(": ", 1)
        small = f" {pocket[key][0]} |" if group == "limits" else ""
        out.append(f"| `{key}` | {value} |{small} {allowed} | {effect} |\n")
    return "".join(out)


def main():
    arguments = [a for a in sys.argv[1:] if a != "--update"]
    program, file = arguments[0], pathlib.Path(arguments[1])
    wanted = page(program)
    if "--update" in sys.argv:
        file.write_text(wanted)
        return 0
    if file.is_file() and file.read_text() == wanted:
        return 0
    print(f"{file} is not what the program says; tests/platform/configuration_page.py --update PROGRAM {file} writes it anew")
    return 1


sys.exit(main())
