"""*Order in time*: a bar under preload on a wall, contact closed, and a smooth further load, against small steps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from verification.families.impact_runs import Impact, bars_text
from verification.meshes.bars import bar_on_wall
from verification.records import Result, levels_of, rate
from verification.solving import Solved, entry, solve

Floats = NDArray[np.floating]
#: end of the preload and of the motion, steps to the end on the coarsest level, and how much finer the reference is
_START, _END, _STEPS, _FINER = 1.0, 3.0, 60, 16


def order(given: Impact, levels: int) -> Iterator[Result]:
    """Errors at the end of displacements, of velocities of nodes with mass, and of the force of contact."""
    counts = [_STEPS << level for level in range(levels)]
    *coarser, right = (_loaded(given, count) for count in (*counts, _STEPS * _FINER))
    unknowns = [right.unknowns] * levels
    for what, kind in (("displacement", 0), ("velocity", 1), ("force of contact", 2)):
        exact = _measured(right)[kind]
        errors = [float(np.abs(_measured(one)[kind] - exact).max() / np.abs(exact).max()) for one in coarser]
        table = levels_of([_END / count for count in counts], unknowns, errors)
        yield rate(f"{what}, largest error at the end", table, 1.95, source="second order in dt",
                   reason=f"against steps of 1/{_STEPS * _FINER} of the time")  # fmt: skip


def _loaded(given: Impact, count: int) -> Solved:
    load = entry("force", group="top", fy=f"-0.01 - 0.02 * max(t - {_START}, 0) ** 4")
    text = bars_text(given, _END, count, entry("contact", slave="slave", master="wall"), entry("rigid", group="wall"),
                     load)  # fmt: skip
    return solve(text, bar_on_wall(given.cell, given.n))


def _measured(solved: Solved) -> tuple[Floats, Floats, Floats]:
    """Displacements, velocities of nodes with mass, force on the slave, all at the end."""
    inertia, motion = solved.problem.inertia, solved.state.step.motion
    assert inertia is not None and motion is not None
    return solved.state.u, np.delete(motion.velocity, inertia.massless_dofs), motion.pushes[0, 0]
