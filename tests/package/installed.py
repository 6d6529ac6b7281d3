#!/usr/bin/env python3
"""Promise: what `cmake --install` leaves is enough for somebody else's project, wherever it is put, and names nothing that is
not there.

  installed.py --source DIR --build DIR --compiler CXX     installs what was built and uses it
  installed.py --selftest                                  what is missing is noticed
"""
import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

# A file that a comment or an include names: a path, or a name with a suffix of ours.
NAMED = re.compile(r"(?<![\w/.*-])((?:[\w-]+/)*[\w-]+\.(?:hpp|cpp|h|md|inc))\b")


def not_there(headers):
    """headers: {path: text}. What a header names and is not among them: by its path, from its own folder, or by its name."""
    names = set(headers) | {os.path.basename(name) for name in headers}
    complaints = []
    for path, text in sorted(headers.items()):
        for number, line in enumerate(text.splitlines(), 1):
            if re.match(r"\s*#\s*include\s*<", line):
                continue
            complaints += [f"{path}:{number}: {name} is not installed" for name in NAMED.findall(line) if name not in names]
    return complaints


def selftest():
    good = {"engine/engine.hpp": '#include <cstddef>\n#include "engine/base/status.hpp"\n// see status.hpp\n',
            "engine/base/status.hpp": "int a;\n"}
    assert not_there(good) == []
    for wrong in ("// as docs/method.md says", "// (engine.cpp)", '#include "engine/limits.hpp"'):
        assert not_there({**good, "engine/engine.hpp": wrong}), wrong
    print("3 wrong headers noticed")
    return 0


def said(*command, **options):
    run = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False, **options)
    if run.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit {run.returncode}\n{run.stdout[-3000:]}{run.stderr[-3000:]}")
    return run.stdout


def use(arguments, prefix, work):
    complaints = []
    include = next(prefix.rglob("include/stillmesh"))
    headers = {str(p.relative_to(include)): p.read_text(encoding="utf-8") for p in include.rglob("*") if p.is_file()}
    complaints += not_there(headers)
    for header in headers:
        if "opencv" not in header and header.endswith(".hpp"):
            said(arguments.compiler, "-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", "-I", include, "-x", "c++", "-",
                 input=f'#include "{header}"\n')
    # Somebody else's compiler is told nothing of C++20 but by the targets.
    said("cmake", "-S", f"{arguments.source}/tests/package/consumer", "-B", f"{work}/cmake", f"-DCMAKE_PREFIX_PATH={prefix}",
         f"-DCMAKE_CXX_COMPILER={arguments.compiler}", f"-DCMAKE_C_COMPILER={arguments.c_compiler}", "-DCMAKE_CXX_STANDARD=17")
    said("cmake", "--build", f"{work}/cmake")
    print(said(f"{work}/cmake/consumer"), end="")
    print(said(f"{work}/cmake/consumer_in_c"), end="")
    packages = {**os.environ, "PKG_CONFIG_PATH": str(next(prefix.rglob("pkgconfig")))}
    flags = said("pkg-config", "--cflags", "--libs", "stillmesh", env=packages).split()
    if any(flag[:2] in ("-I", "-L") and not pathlib.Path(flag[2:]).resolve().is_relative_to(prefix.resolve()) for flag in flags):
        complaints.append(f"pkg-config leads away from the prefix: {flags}")
    vocabulary = said("pkg-config", "--variable=vocabulary", "stillmesh", env=packages).strip()
    if not pathlib.Path(vocabulary).is_file():
        complaints.append(f"pkg-config's vocabulary is not there: {vocabulary}")
    said(arguments.compiler, "-std=c++20", f"{arguments.source}/tests/package/consumer/main.cpp", *flags, "-o", f"{work}/consumer")
    print(said(f"{work}/consumer"), end="")
    flags = said("pkg-config", "--cflags", "--libs", "stillmesh-c", env=packages).split()
    said(arguments.c_compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", f"{arguments.source}/tests/package/consumer/main.c",
         *flags, "-o", f"{work}/consumer_in_c")
    libraries = next(prefix.rglob("libstillmesh_c.so.0")).parent
    print(said(f"{work}/consumer_in_c", env={**os.environ, "LD_LIBRARY_PATH": str(libraries)}), end="")
    print(f"{len(headers)} headers in {include.relative_to(prefix)}")
    return complaints


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("source", "build", "compiler", "c-compiler"):
        parser.add_argument(f"--{name}")
    parser.add_argument("--selftest", action="store_true")
    arguments = parser.parse_args()
    if arguments.selftest:
        return selftest()
    with tempfile.TemporaryDirectory() as work:
        first, moved = pathlib.Path(work) / "first", pathlib.Path(work) / "moved"
        for component in ("library", "runtime"):
            said("cmake", "--install", arguments.build, "--prefix", first, "--component", component)
        shutil.move(first, moved)
        complaints = use(arguments, moved, work)
    for complaint in complaints:
        print("WRONG:", complaint)
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
