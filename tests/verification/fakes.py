"""Cases that solve nothing, and the command of the worker that ends them.

`python -m tests.verification.fakes PREPARED NAME,NAME ...` is `python -m verification ...` with such cases.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from verification.cli import main
from verification.records import Case, Outcome, at_most
from verification.running import plan, pool
from verification.running.folder import write_case_result
from verification.running.plan import Planned, sources


@dataclass(frozen=True)
class Given:
    sizes: tuple[float, ...] = (0.5, 0.25)


def outcome_of(name):
    """`missed...` misses one figure of two, `failed...` has no outcome, others meet both."""
    if name.startswith("failed"):
        return Outcome(failure="ValueError: the\x1b[31m mesh\n is <wrong>")
    missed = 2.0 if name.startswith("missed") else 0.5
    return Outcome((at_most("error", missed, 1.0, source="us"), at_most("balance", 0.0, 1.0, source="us")))


def planned(prepared, names, *, levels=2, digest=None, given=None, alone=()):
    """Cases of family `cut`, and in `prepared` what their worker is to leave."""
    made = []
    for name in names:
        solve = partial(outcome_of, given or Given())
        case = Case("cut", name, f"about {name}", solve, {"quick": levels}, exclusive=name in alone)
        made.append(Planned(case, levels, digest or sources("cut")))
        if name[:4] not in ("slow", "kill", "exit", "sile"):
            write_case_result(case, levels, 0.25, 1000, outcome_of(name), prepared, made[-1].sources)
    return made


def command(prepared):
    return (sys.executable, "-I", "-S", str(Path(__file__).with_name("fake_worker.py")), str(prepared))


def ran(prepared):
    """name -> (process, time, threads, levels), of the cases that a worker was started for, in their order."""
    lines = [line.split() for line in (prepared / "ran").read_text().splitlines()]
    assert len({line[0] for line in lines}) == len(lines), "a case was run twice"
    (prepared / "ran").unlink()
    return {name: (int(pid), float(when), int(threads), int(levels)) for name, pid, when, threads, levels in lines}


if __name__ == "__main__":
    where, cases = Path(sys.argv[1]), planned(Path(sys.argv[1]), sys.argv[2].split(","))
    pool.COMMAND = command(where)
    plan.plan = lambda *which: cases
    sys.exit(main(sys.argv[3:]))
