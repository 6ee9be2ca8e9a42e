"""Coulomb friction against exact solutions, integral equations, Lemke's method, and code_aster."""

from __future__ import annotations

from collections.abc import Callable

from verification.families import (
    balance,
    friction_bank,
    friction_bodies,
    friction_cattaneo,
    friction_cost,
    friction_inf_sup,
)
from verification.families import friction_motion as motion
from verification.families import friction_moving as moving
from verification.families import friction_patch as patch
from verification.families import friction_published as published
from verification.records import Case, Family, Outcome

NAME = "friction"

#: what solves a case, by the type of its parameters
_SOLVERS: dict[type, Callable[[Case, int], Outcome]] = {
    patch.Sheared: patch.solve_case,
    balance.Touch: balance.run,
    friction_inf_sup.Tractions: friction_inf_sup.solve_case,
    friction_cattaneo.PressedCylinders: friction_cattaneo.solve_pressed,
    friction_cattaneo.Steps: friction_cattaneo.solve_steps,
    friction_cattaneo.Balls: friction_cattaneo.solve_balls,
    friction_cattaneo.Rolling: friction_cattaneo.solve_rolling,
    friction_bodies.Incline: friction_bodies.solve_incline,
    friction_bodies.Pull: friction_bodies.solve_fit,
    friction_bodies.Belt: friction_bodies.solve_belt,
    friction_bodies.Slit: friction_bodies.solve_crack,
    friction_bodies.SpencePunch: friction_bodies.solve_punch,
    moving.PulledBlock: moving.solve_dragged,
    moving.Carried: moving.solve_carried,
    moving.Cycled: moving.solve_cycled,
    moving.Wheel: moving.solve_wheel,
    moving.RoundedDie: moving.solve_ledger,
    friction_cost.Applications: friction_cost.solve_applications,
    published.Plate: published.solve_plate,
    published.Roller: published.solve_roller,
    published.RoundedPunch: published.solve_rounded,
    published.LoadedPin: published.solve_pin,
    published.Ironing: published.solve_ironing,
    motion.Thrown: motion.solve_thrown,
    motion.Spinning: motion.solve_spinning,
    motion.Leaning: motion.solve_leaning,
    friction_bank.FrictionBank: friction_bank.solve_bank,
    friction_bank.Units: friction_bank.solve_units,
}


def solve_case(case: Case, levels: int) -> Outcome:
    """Solve a case on so many levels."""
    return _SOLVERS[type(case.parameters)](case, levels)


_PROBLEMS = (
    patch,
    friction_inf_sup,
    friction_cattaneo,
    friction_bodies,
    moving,
    motion,
    published,
    friction_bank,
    friction_cost,
)
FAMILY = Family(
    NAME,
    "Friction",
    "\n\n".join(own.__doc__ or "" for own in _PROBLEMS),
    tuple(case for problems in _PROBLEMS for case in problems.cases(NAME)),
    solve_case,
)
