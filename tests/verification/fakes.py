"""A family of cases that solve nothing, and end as their names say; each adds a line to the file `$FAKES`.

`python -m tests.verification.fakes ...` is `python -m verification ...` with this family alone.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from verification import families
from verification.records import Case, Family, Outcome, at_most

FAILURE = "ValueError: the\x1b[31m mesh\n is <wrong>"


@dataclass(frozen=True)
class Given:
    name: str
    sizes: tuple[float, ...] = (0.5, 0.25)


def solve(given, *, levels):
    name, file = given.name, Path(os.environ["FAKES"])
    with file.open("a") as ran:
        ran.write(f"{name} {os.getpid()} {time.monotonic()} {os.environ['OMP_NUM_THREADS']}\n")
    if name == "slow":  # with a child
        child = subprocess.Popen(["sleep", "60"])
        file.with_suffix(".new").write_text(str(child.pid))
        file.with_suffix(".new").replace(file.with_suffix(".child"))
        time.sleep(60)
    if name == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "exits":
        os._exit(7)
    if name == "leaves":
        sys.exit("here")
    if name == "failed":
        print("said before")
        raise ValueError(FAILURE.partition(": ")[2])
    if name == "halting":
        time.sleep(0.5)
    value = 2.0 if name == "missed" else 0.5
    return Outcome((at_most("error", value, 1.0, source="us"), at_most("levels", levels, 9.0, source="us")))


NAMES = ("a", "b", "missed", "failed", "killed", "exits", "leaves", "slow", "halting", "timed")
FAMILY = Family(
    "fake", "Fakes", "They solve **nothing**.",
    tuple(Case("fake", n, f"about {n}", partial(solve, Given(n)), {"quick": 2}, exclusive=n == "timed") for n in NAMES),
)  # fmt: skip


def planned(names, levels=2):
    return [(case, levels) for case in FAMILY.cases if case.name in names]


def pytest_configure(config):
    """Let a process that solves cases know this family."""
    if hasattr(config, "workerinput"):
        if "FAKES" not in os.environ:
            os._exit(3)
        families.MODULES["fake"], sys.modules["verification.families.fake"] = "fake", sys.modules[__name__]


if __name__ == "__main__":
    from verification import plan, running
    from verification.cli import main

    running.ARGUMENTS += ["-p", "tests.verification.fakes"]
    families.MODULES = {"fake": "fake"}
    sys.modules["verification.families.fake"] = sys.modules[__name__]
    plan.plan = lambda *which: planned(sys.argv[1].split(","))
    sys.exit(main(sys.argv[2:]))
