"""Runs of the family `impact`: what an impact is made of, its case, and what is looked at of its motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.exact import impact as exact
from verification.meshes.bars import bar_on_wall
from verification.records import Result, at_least, at_most
from verification.solving import Solved, case_text, entry, model_of, solve

Floats = NDArray[np.floating]
#: the account of energy, and what may be left of it, relative to the largest energy
ACCOUNT, CLOSED = "kinetic + strain - external + damped + contact + numerical = 0", 1e-10


@dataclass(frozen=True)
class Impact:
    """A kind of impact: `wall`, `limit` (of small steps), `plain` (mass), `bars`, `rod`, `bounce`, `aster`, `sphere`,
    `ring`, `disc`, `ball` and `rings` (thrown); or of smooth motion: `spin`, `vibration`, `order`.

    `cell`: type of cells; `n`: cells along a bar on the coarsest level; `cfl`: cells that a wave crosses in a step;
    `dynamics`: keys of [dynamics]; `allowed`: of the error of pressures on the finest level; `approach` of a sphere.
    """

    kind: str
    cell: str = "QUAD4"
    n: int = 16
    cfl: float = 0.5
    dynamics: tuple[tuple[str, Any], ...] = ()
    allowed: float = 0.02
    approach: float = 1e-3
    young: float = 1.0
    poisson: float = 0.3
    speed: float = 0.01

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return CELLS[self.cell].dim

    @property
    def c(self) -> float:
        """Speed of waves in a bar of density 1."""
        return sqrt(exact.modulus(self.young, self.poisson))


@dataclass(frozen=True, eq=False)
class ImpactRun:
    """A solved impact: `time` (steps,), `pressure` (steps, n), `energies` (steps, 8).

    `account` (steps,): sums of the account of energy.
    """

    solved: Solved
    time: Floats
    pressure: Floats
    energies: Floats
    account: Floats

    @property
    def last(self) -> Any:
        """Motion at the end: velocities, momentum, impulses."""
        return self.solved.state.step.motion

    @property
    def whole(self) -> Floats:
        """Kinetic and strain energy (steps,), relative to that at the start."""
        start = self.energies[0, 2]
        return self.energies[:, :2].sum(axis=1) / start

    @property
    def unbalanced(self) -> float:
        """Largest error of the account of energy, relative to the largest energy."""
        return float(np.abs(self.account).max() / np.abs(self.energies).max())

    def error(self, right: float, start: float, last: float) -> float:
        """Root mean square of the error of pressures from 10 % to 90 % of a contact, relative to the right one."""
        inside = (self.time > start + 0.1 * last) & (self.time < start + 0.9 * last)
        return float(np.sqrt(np.mean((self.pressure[inside] / right - 1) ** 2)))


def run(text: str, mesh: Mesh) -> ImpactRun:
    """Solve an impact. Raises what `solve` raises."""
    solved = solve(text, mesh)
    motions = [state.step.motion for state in solved.states]
    figures = [motion for motion in motions if motion is not None]
    return ImpactRun(
        solved, np.array([state.time for state in solved.states]),
        np.array([state.zones[0].pressure for state in solved.states]), np.array([m.energies for m in figures]),
        np.array([m.account for m in figures]),
    )  # fmt: skip


def bars_text(given: Impact, end: float, count: int, *tables: str, density: float = 1.0) -> str:
    """The case of bars that cannot move sideways, as TOML."""
    sides = [(a, f"{a}{e}") for a in "xyz"[: given.dim - 1] for e in "01"]
    return case_text(
        model_of(given.dim),
        entry("material", young=given.young, poisson=given.poisson, density=density),
        *(entry("displacement", group=side, **{f"u{axis}": 0.0}) for axis, side in sides),
        *tables,
        entry("dynamics", **dict(given.dynamics)),
        entry("steps", end=end, count=count),
    )


def on_wall(given: Impact, n: int) -> tuple[ImpactRun, float]:
    """Throw a bar of n cells on a wall; return the run, and the error of its pressures."""
    dt, last = given.cfl / n / given.c, 2 / given.c
    wait = 2.5 * dt
    count = ceil((wait + 1.3 * last) / dt)
    impact = run(
        bars_text(
            given, count * dt, count, entry("contact", slave="slave", master="wall"), entry("rigid", group="wall"),
            entry("initial", groups=["bar"], **{f"v{'xyz'[given.dim - 1]}": -given.speed}),
        ),
        bar_on_wall(given.cell, n, wait * given.speed),
    )  # fmt: skip
    return impact, impact.error(given.c * given.speed, wait, last)


def energies(impact: ImpactRun, least: float, closed: float = CLOSED, reason: str = "") -> Iterator[Result]:
    """The results about energy that every impact has; `least`: what is left at the end."""
    yield at_most("largest energy", impact.whole.max(), 1.001, source="no energy is created")
    yield at_least("energy at the end", impact.whole[-1], least, source="the rebound is elastic")
    yield at_most("account of energy", impact.unbalanced, closed, source=ACCOUNT, reason=reason)
