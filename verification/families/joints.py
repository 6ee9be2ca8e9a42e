"""Joints: cracks, bolts, couplings, sectors and metals that yield, against exact solutions."""

from __future__ import annotations

from collections.abc import Callable

from verification.families import joints_constraints, joints_plastic, joints_split
from verification.records import Case, Family, Outcome

NAME = "joints"

_PROBLEMS = (joints_split, joints_plastic, joints_constraints)
#: what solves a case, by the type of its parameters
_SOLVERS: dict[type, Callable[[Case, int], Outcome]] = {
    kind: solve for problems in _PROBLEMS for kind, solve in problems.SOLVERS.items()
}


def solve_case(case: Case, levels: int) -> Outcome:
    """Solve a case on so many levels."""
    return _SOLVERS[type(case.parameters)](case, levels)


FAMILY = Family(
    NAME,
    "Joints",
    "\n\n".join(problems.__doc__ or "" for problems in _PROBLEMS),
    tuple(case for problems in _PROBLEMS for case in problems.cases(NAME)),
    solve_case,
)
