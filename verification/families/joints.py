"""Joints: cracks, bolts, couplings, sectors and metals that yield, against exact solutions."""

from __future__ import annotations

from verification.families import joints_constraints, joints_plastic, joints_split, joints_units
from verification.records import Family

NAME = "joints"

_PROBLEMS = (joints_split, joints_plastic, joints_constraints, joints_units)
FAMILY = Family(
    NAME,
    "Joints",
    "\n\n".join(problems.__doc__ or "" for problems in _PROBLEMS),
    tuple(case for problems in _PROBLEMS for case in problems.cases(NAME)),
)
