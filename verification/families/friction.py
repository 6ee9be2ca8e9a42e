"""Coulomb friction against exact solutions, integral equations, Lemke's method, and code_aster."""

from __future__ import annotations

from verification.families import (
    friction_bank,
    friction_blocks,
    friction_bodies,
    friction_cattaneo,
    friction_moving,
    friction_published,
)
from verification.records import Family

_PROBLEMS = (
    friction_blocks,
    friction_cattaneo,
    friction_bodies,
    friction_moving,
    friction_published,
    friction_bank,
)
FAMILY = Family(
    "friction",
    "Friction",
    "\n\n".join(own.__doc__ or "" for own in _PROBLEMS),
    tuple(case for problems in _PROBLEMS for case in problems.cases("friction")),
)
