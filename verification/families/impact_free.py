"""*Free motion*, without contact: a body that spins and flies, under finite kinematics, and a bar that vibrates.
*Order in time*: a bar that stays in contact.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacsolver import natural_modes, parse_case
from lacsolver.problem.problem import Problem
from verification.families.impact_runs import ACCOUNT, CLOSED, Impact, bars_text
from verification.meshes.bars import WIDTH, bar, bar_on_wall
from verification.records import Result, at_least, at_most, levels_of, rate
from verification.solving import Solved, case_text, entry, model_of, solve

Floats = NDArray[np.floating]
#: velocity and angular velocity of a body in one turn, in a plane and in space
_FLIGHT = (0.3, 0.1, -0.2)
_TURN = {2: 1.0, 3: [0.6, 0.0, 0.8]}
#: steps of the turn on the coarsest level
_STEPS = 40
#: how many natural frequencies are compared
_MODES = 2


def spin(given: Impact, levels: int) -> Iterator[Result]:
    """One turn of a neo-Hookean bar that flies and starts unstretched, each level in twice as many steps."""
    counts = [_STEPS << level for level in range(levels)]
    runs = [_turned(given, count) for count in counts]
    off = [_errors(solved, given.dim) for solved in runs]
    yield at_most(
        "linear momentum", max(e["linear"] for e in off), 1e-12, source="no force acts", reason="in every step"
    )
    steps, unknowns = [2 * np.pi / count for count in counts], [runs[0].unknowns] * levels
    for what in ("angular momentum", "energy"):
        table = levels_of(steps, unknowns, [e[what] for e in off])
        yield rate(f"{what}, its largest error", table, 1.95, source="second order in dt", reason="relative, in a turn")
    yield at_most("account of energy", max(e["account"] for e in off), 10 * CLOSED, source=ACCOUNT,
                  reason="Newton's method ends at the round-off of K u, 1e-14 of it, in every step")  # fmt: skip


def _turned(given: Impact, count: int) -> Solved:
    """Let a bar turn once in so many steps."""
    dim = given.dim
    text = case_text(
        model_of(dim),
        entry("material", law="neo_hookean", young=given.young, poisson=given.poisson, density=1.0),
        entry("initial", rotation=_TURN[dim], **dict(zip(("vx", "vy", "vz"), _FLIGHT[:dim], strict=False))),
        entry("dynamics", **dict(given.dynamics)),
        entry("steps", end=2 * np.pi, count=count),
        kinematics="finite",
    )
    return solve(text, bar(given.cell, given.n))


def _errors(solved: Solved, dim: int) -> dict[str, float]:
    """Largest relative errors over a motion of what a free body keeps, and of the account of energy."""
    motions = [motion for state in solved.states if (motion := state.step.motion) is not None]
    linear = np.array([m.linear for m in motions]) / WIDTH ** (dim - 1) - _FLIGHT[:dim]
    angular = np.array([np.atleast_1d(m.angular) for m in motions])
    table = np.array([m.energies for m in motions])
    whole = table[:, :2].sum(axis=1)
    return {
        "linear": float(np.linalg.norm(linear, axis=1).max() / np.linalg.norm(_FLIGHT[:dim])),
        "angular momentum": float(np.linalg.norm(angular - angular[0], axis=1).max() / np.linalg.norm(angular[0])),
        "energy": float(np.abs(whole / table[0, 2] - 1).max()),
        "account": float(max(abs(m.account) for m in motions) / np.abs(table).max()),
    }


def vibration(given: Impact, levels: int) -> Iterator[Result]:
    """Lowest natural frequencies of a bar that one end holds and that cannot move sideways."""
    right = (2 * np.arange(_MODES) + 1) * given.c / 4
    counts, errors, unknowns = [given.n << level for level in range(levels)], [], []
    for n in counts:
        low = f"{'xyz'[given.dim - 1]}0"
        text = bars_text(given, 1.0, 1, entry("displacement", group=low, **{f"u{low[0]}": 0.0}))
        modes = natural_modes(Problem.of(parse_case(text), bar(given.cell, n)), count=_MODES)
        errors.append(float((modes.frequencies / right - 1).max()))
        unknowns.append(modes.unknowns)
    yield at_least("least error of a frequency", min(errors), 0.0, source="a consistent mass: all come from above")
    yield rate(f"largest error of {_MODES} frequencies", levels_of([1 / n for n in counts], unknowns, errors),
               2.0 * CELLS[given.cell].order - 0.05, source="h^2 and h^4: frequencies (2 k - 1) c / 4 L")  # fmt: skip


# ---- order in time: a bar under preload on a wall, contact closed, and a smooth further load, against small steps

#: end of the preload and of the motion, steps to the end on the coarsest level, and how much finer the reference is
_LOADED, _END, _COUNT, _FINER = 1.0, 3.0, 60, 16


def order(given: Impact, levels: int) -> Iterator[Result]:
    """Errors at the end of displacements, of velocities of nodes with mass, and of the force of contact."""
    counts = [_COUNT << level for level in range(levels)]
    *coarser, right = (_loaded(given, count) for count in (*counts, _COUNT * _FINER))
    unknowns = [right.unknowns] * levels
    for what, kind in (("displacement", 0), ("velocity", 1), ("force of contact", 2)):
        exact = _measured(right)[kind]
        errors = [float(np.abs(_measured(one)[kind] - exact).max() / np.abs(exact).max()) for one in coarser]
        table = levels_of([_END / count for count in counts], unknowns, errors)
        yield rate(f"{what}, largest error at the end", table, 1.95, source="second order in dt",
                   reason=f"against steps of 1/{_COUNT * _FINER} of the time")  # fmt: skip


def _loaded(given: Impact, count: int) -> Solved:
    load = entry("force", group="top", fy=f"-0.01 - 0.02 * max(t - {_LOADED}, 0) ** 4")
    skins = entry("contact", slave="slave", master="wall"), entry("rigid", group="wall")
    text = bars_text(given, _END, count, *skins, load)
    return solve(text, bar_on_wall(given.cell, given.n))


def _measured(solved: Solved) -> tuple[Floats, Floats, Floats]:
    """Displacements, velocities of nodes with mass, force on the slave, all at the end."""
    inertia, motion = solved.problem.inertia, solved.state.step.motion
    assert inertia is not None and motion is not None
    return solved.state.u, np.delete(motion.velocity, inertia.massless_dofs), motion.pushes[0, 0]
