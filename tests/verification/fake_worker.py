"""A worker that solves nothing: by the name of its case it copies a prepared outcome, or ends in another way.

`fake_worker.py PREPARED FAMILY CASE LEVELS FOLDER`; `PREPARED/ran` has a line for each case, with its process, the time
and how many threads it is allowed. It needs nothing but Python.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path


def main(prepared, family, name, levels, folder):
    with (prepared / "ran").open("a") as ran:
        ran.write(f"{name} {os.getpid()} {time.monotonic()} {os.environ['OMP_NUM_THREADS']} {levels}\n")
    place = folder / "cases" / family
    if name.startswith("slow"):  # with a child, and a file that is being written
        child = subprocess.Popen(["sleep", "60"])
        (place / f".{name}-0123.json").write_text("{")
        (prepared / "child.new").write_text(str(child.pid))
        (prepared / "child.new").replace(prepared / "child")
        time.sleep(60)
    if name.startswith("killed"):
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("exits"):
        sys.exit(7)
    if name.startswith("halting"):
        time.sleep(0.3)
    if not name.startswith("silent"):
        shutil.copy(prepared / "cases" / family / f"{name}.json", place / f".{name}-4567.json")
        (place / f".{name}-4567.json").replace(place / f"{name}.json")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:5], Path(sys.argv[5]))
