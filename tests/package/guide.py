#!/usr/bin/env python3
"""Promise: what docs/guide.md tells a newcomer to type works at the first try, with nothing but what is installed.

  guide.py PAGE [--prefix DIR] [--python PYTHON] [--without FEATURE]...   copies the blocks out of the page, builds and runs
                                                        them; PYTHON: one with numpy
  guide.py PAGE --build DIR [...]                       the same, with what `cmake --install` makes of a build
  guide.py --selftest                                   each wrong page is noticed

Without a prefix: what is installed in /usr, and the packages to be installed lie in the folder where this is called (a fresh
Debian, tests/package/run). The line before each block of the page says what it is:
  <!-- guide: file NAME -->         saved under that name
  <!-- guide: run -->               typed into one shell after the other, in the folder of those files
  <!-- guide: run with FEATURE -->  the same, unless the build is --without it
  <!-- guide: install -->           typed before all others, in a fresh Debian alone
  <!-- guide: output -->            what the `run` before it prints last
  <!-- guide: needs REASON -->      only shown
Nothing is changed but the port 14550, which another test on this machine may have: a free one stands for it.
"""
import argparse
import os
import pathlib
import re
import socket
import subprocess
import sys
import tempfile

BLOCK = re.compile(r"(?:^<!-- guide: ([^\n]*) -->\n)?^```(\w*)\n(.*?)^```$", re.M | re.S)
KIND = re.compile(r"file \S+|run(?: with \w+)?|install|output|needs .+")
FILE_LINES_MAX = 40  # of a newcomer's first program
# No program may wait for something that does not come.
SECONDS_MAX = 900


def blocks_of(page):
    """[(kind, text)] in the order of the page; SystemExit where the page cannot be followed."""
    blocks = [(kind, text) for kind, _, text in BLOCK.findall(page)]
    if page.count("\n```") != 2 * len(blocks) or page.count("<!-- guide:") != sum(kind != "" for kind, _ in blocks):
        sys.exit("WRONG: a block without its end, or a mark without its block")
    for kind, text in blocks:
        if not KIND.fullmatch(kind):
            sys.exit(f"WRONG: a block is not said to be run, shown or saved ('{kind}'):\n{text[:200]}")
        if kind.startswith("file") and len(text.splitlines()) > FILE_LINES_MAX:
            sys.exit(f"WRONG: {kind} has {len(text.splitlines())} lines, at most {FILE_LINES_MAX}")
    if not any(kind == "run" for kind, _ in blocks):
        sys.exit("WRONG: nothing is run")
    return blocks


def environment_of(prefix):
    """Where somebody finds what lies under a prefix of its own."""
    if prefix is None:
        return dict(os.environ)
    libraries = next(prefix.rglob("libstillmesh_c.so.0")).parent
    return {**os.environ,
            "PATH": f"{prefix}/bin:{os.environ['PATH']}",
            "CMAKE_PREFIX_PATH": str(prefix),
            "PKG_CONFIG_PATH": str(libraries / "pkgconfig"),
            "LD_LIBRARY_PATH": str(libraries),
            "PYTHONPATH": str(next(prefix.rglob("dist-packages"))),
            "STILLMESH_LIBRARY": str(libraries / "libstillmesh_c.so.0")}


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


def typed(text, folder, environment):
    """What a shell prints; it stops at the first line that fails."""
    # In a fresh Debian one is root and has no sudo.
    begin = "set -euo pipefail\nexport DEBIAN_FRONTEND=noninteractive\ncommand -v sudo >/dev/null || sudo() { \"$@\"; }\n"
    run = subprocess.run(["bash", "-c", begin + text], cwd=folder, env=environment, capture_output=True, text=True, check=False,
                         timeout=SECONDS_MAX)
    if run.returncode != 0:
        sys.exit(f"WRONG: exit {run.returncode} of\n{text}\n{run.stdout[-3000:]}{run.stderr[-3000:]}")
    return run.stdout


def follow(page, prefix, without, python=None):
    port = free_port()
    blocks = [(kind, text.replace("14550", port)) for kind, text in blocks_of(page)]
    environment = environment_of(prefix)
    if prefix is None:
        for text in (text for kind, text in blocks if kind == "install"):
            typed(text, os.getcwd(), environment)
    said, counts = None, {"file": 0, "run": 0, "output": 0}
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as programs:
        if python:  # `python3` is that one
            pathlib.Path(programs, "python3").symlink_to(python)
            environment["PATH"] = f"{programs}:{environment['PATH']}"
        for kind, text in blocks:
            what = kind.split()[0]
            if what in counts:
                counts[what] += 1
            if what == "file":
                (pathlib.Path(folder) / kind.split()[1]).write_text(text, encoding="utf-8")
            elif what == "run" and not (" with " in kind and kind.split()[2] in without):
                said = typed(text, folder, environment)
            elif what == "output" and (said is None or not said.endswith(text)):
                sys.exit(f"WRONG: printed was\n{said}and not\n{text}")
    print(f"{counts['file']} files saved, {counts['run']} blocks run, {counts['output']} outputs as the page says")


def selftest():
    good = "<!-- guide: file a.txt -->\n```\nhello\n```\n\n<!-- guide: run -->\n```sh\ncat a.txt\n```\n\n" \
           "<!-- guide: output -->\n```\nhello\n```\n\n<!-- guide: needs a camera -->\n```sh\nfalse\n```\n"
    follow(good, None, [])
    wrong = {
        "another output": good.replace("\nhello\n```\n\n<!-- guide: needs", "\nHello\n```\n\n<!-- guide: needs"),
        "a command that fails": good.replace("cat a.txt", "cat b.txt\ntrue"),
        "a pipe that fails": good.replace("cat a.txt", "cat b.txt | cat"),
        "a block without a mark": good.replace("<!-- guide: needs a camera -->\n", ""),
        "an unknown mark": good.replace("needs a camera", "a camera"),
        "a mark without its block": good + "<!-- guide: run -->\n",
        "an output without a run": good.replace("guide: run -->", "guide: run with x -->"),
        "a long program": good.replace("hello\n", "hello\n" * (FILE_LINES_MAX + 1)),
    }
    for name, page in wrong.items():
        try:
            follow(page, None, ["x"])
        except SystemExit as end:
            assert str(end).startswith("WRONG"), name
        else:
            sys.exit(f"not noticed: {name}")
    print(f"{len(wrong)} wrong pages noticed")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", nargs="?", type=pathlib.Path)
    parser.add_argument("--prefix", type=pathlib.Path)
    parser.add_argument("--build")
    parser.add_argument("--python")
    parser.add_argument("--without", action="append", default=[])
    parser.add_argument("--selftest", action="store_true")
    arguments = parser.parse_args()
    if arguments.selftest:
        return selftest()
    page = arguments.page.read_text(encoding="utf-8")
    if not arguments.build:
        return follow(page, arguments.prefix, arguments.without, arguments.python)
    with tempfile.TemporaryDirectory() as work:
        prefix = pathlib.Path(work) / "prefix"
        for component in ("program", "library", "runtime", "python"):
            subprocess.run(["cmake", "--install", arguments.build, "--prefix", str(prefix), "--component", component],
                           check=True, stdout=subprocess.DEVNULL)
        follow(page, prefix, arguments.without, arguments.python)
    return None


if __name__ == "__main__":
    sys.exit(main())
