"""**Cost.** Cylinders and spheres of Cattaneo's and Mindlin's problem: how many times K^-1 is applied to solve the
linear system of the last set to rounding, from nothing, over the same for contact that is pressed without friction.
Tractions along tangents make the systems two and three times as large.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.results.state import StepState
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import ConvergenceTolerance
from verification.families import friction_cattaneo as cattaneo
from verification.records import Case, Outcome, at_most, informative
from verification.solving import Solved, balanced

Floats = NDArray[np.floating]
#: times those without friction, by dimension
MOST = {2: 1.6, 3: 3.2}
_SOURCE = {2: "measured on a prototype: 1.25 to 1.45", 3: "measured on a prototype: 2 to 3"}


def applications(one: Solved, reduction: float = 0.0) -> int:
    """Applications of K^-1 for the linear system of the last set, from nothing, to a reduction of its residual."""
    model, states = ReducedProblem(one.problem), one.states
    step = LoadStep(model, states[-1].time, states[-2].step if len(states) > 1 else StepState())
    iterate = states[-1].step.iterate
    assert iterate is not None
    q, p, active = iterate
    contact = step.contact(q)
    linear = contact.linear(contact.first_rows(active, p), p)
    h, G = linear.load(step.f, contact.rows.B_T), linear.G + linear.rows.D @ q
    problem = SaddleProblem(step.reference, linear.rows, linear.active, h, G, linear.S)
    moved = float(np.abs(step.u0).max())
    goal = ConvergenceTolerance(1e-10, 50, 0.0, moved, model.vectors).linear(reduction, moved)
    return solve_saddle(problem, np.zeros_like(q), np.zeros_like(p), goal).applications


def _solved(cell: str, dim: int, k: int, rubs: bool) -> Solved:
    """Press, and with friction shear."""
    if dim == 3:
        exact = cattaneo.SPHERES
        times, friction = ((1.0, 2.0), exact.friction) if rubs else ((1.0,), None)
        return cattaneo.solved_balls(exact, cell, k, friction, times)
    pressed = cattaneo.PressedCylinders(cell, cattaneo.PressedCylinders(cell).turns if rubs else ())
    return cattaneo.solved(pressed, k, None if rubs else 0.0)


def solve_applications(cell: str, dim: int, sizes: tuple[int, ...], *, levels: int) -> Outcome:
    """Count for cells of a type, about so many (`sizes`) to the half-width on each level."""
    results, solutions = [], []
    for k in sizes[:levels]:
        pair = [_solved(cell, dim, k, rubs) for rubs in (True, False)]
        solutions += pair
        with_it, without = (applications(one) for one in pair)
        results.append(at_most(
            f"applications of K^-1 over those without friction, k = {k}", with_it / without, MOST[dim],
            source=_SOURCE[dim],
        ))  # fmt: skip
        results.append(informative(f"applications of K^-1, k = {k}", with_it, reason=f"{without} without friction"))
        loose = applications(pair[0], 1e-4) / applications(pair[1], 1e-4)
        results.append(informative(f"the same to 1e-4 of the residual, ratio, k = {k}", loose, reason="no bound"))
    return Outcome((*results, *balanced(solutions)))


def cases(family: str) -> Iterator[Case]:
    """In the plane and in space."""
    for cell in ("TRIA3", "QUAD4", "QUAD8"):
        description = f"applications of K^-1 with friction and without, {cell}"
        solve = partial(solve_applications, cell, 2, (16, 32))
        yield Case(family, f"cost-{cell}", description, solve, {"quick": 1, "full": 2}, 10.0)
    for cell, counts in (("TETRA4", (4,)), ("HEXA8", (4, 6))):
        description = f"applications of K^-1 with friction and without, {cell}"
        solve = partial(solve_applications, cell, 3, counts)
        yield Case(family, f"cost-{cell}", description, solve, {"full": len(counts)}, 60.0)
