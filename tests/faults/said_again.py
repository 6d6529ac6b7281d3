#!/usr/bin/env python3
"""Promise: a save that fails time and again is said once within a minute (MapSaver.SaysOnceAMinuteThatSavesFail: and
again after it); a recording that fails is said at once; and the summary names it all the same.

  said_again.py PROGRAM FAILING_CALLS SMALL_RECORDING
"""
import os
import resource
import subprocess
import sys
import tempfile


def main():
    program, shim, recorder = map(os.path.abspath, sys.argv[1:4])
    with tempfile.TemporaryDirectory() as folder:
        frames = os.path.join(folder, "frames")
        subprocess.run([recorder, "static_xyz", "1", "0", "60", "160", "120", frames], check=True)

        def lines(faults, *arguments, limit=None):
            environment = dict(os.environ, LD_PRELOAD=shim, STILLMESH_FAULTS=faults)
            run = subprocess.run([program, "run", "--replay", frames, "--limits", "pocket", *arguments], cwd=folder,
                                 env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, timeout=120,
                                 preexec_fn=limit and (lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))))
            assert run.returncode == 1, (run.returncode, run.stderr)
            return run.stderr.decode().splitlines()

        save = ("--realtime", "--map-out", "room.map", "--map-every", "0.1")
        said = [line for line in lines("rename:1:0:EIO", *save) if "tried again every" in line]
        assert len(said) == 1, f"some twenty saves that fail within two seconds are said {len(said)} times"
        said = lines("", "--record", "run.rec", limit=4000)
        news = [i for i, line in enumerate(said) if line.startswith("run.rec: ")]
        end = [i for i, line in enumerate(said) if line.startswith("stillmesh: run.rec: ")]
        assert len(news) == 1 and len(end) == 1 and news < end, said
    print("said when it failed, and at the end")


if __name__ == "__main__":
    sys.exit(main())
