"""Runs of the family `impact`: what a bar is made of, its case, and what is looked at of its motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
from verification.solving import Solved, case_text, contact, entry, fixed, material, model_of, solve

Floats = NDArray[np.floating]
#: the account of energy, and what may be left of it, relative to the largest energy
ACCOUNT, CLOSED = "kinetic + strain - external + damped + contact + numerical = 0", 1e-10


@dataclass(frozen=True)
class Bar:
    """A bar of density 1. `n`: cells along it on the coarsest level; `cfl`: cells that a wave crosses in a step.

    `scheme`, `massless`, `start`: keys of [dynamics], None for the default.
    """

    cell: str = "QUAD4"
    n: int = 16
    cfl: float = 0.5
    scheme: str | None = None
    massless: str | None = None
    start: float | None = None
    young: float = 1.0
    poisson: float = 0.3
    speed: float = 0.01

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return CELLS[self.cell].dim

    @property
    def c(self) -> float:
        """Speed of waves."""
        return sqrt(exact.modulus(self.young, self.poisson))

    def timing(self, n: int) -> tuple[float, float, float, int]:
        """Of a bar of n cells: size of a step, time to the impact, time that it lasts, and number of steps."""
        dt, last = self.cfl / n / self.c, 2 / self.c
        wait = 2.5 * dt
        return dt, wait, last, ceil((wait + 1.3 * last) / dt)

    def text(self, end: float, count: int, *tables: str, density: float = 1.0, free: bool = False) -> str:
        """The case of bars, as TOML, which cannot move sideways unless they are `free`."""
        sides = [(f"{a}{e}", a) for a in "xyz"[: self.dim - 1] for e in "01"]
        return case_text(
            model_of(self.dim), material(self.young, self.poisson, density=density),
            *(fixed(*side) for side in sides if not free), *tables,
            entry("dynamics", scheme=self.scheme, massless=self.massless, start=self.start),
            entry("steps", end=end, count=count),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class ImpactRun:
    """A solved impact: `time` (steps,), `motions` (energies, momenta, velocities), `pressure` (steps, n), `energies`
    (steps, 8).
    """

    solved: Solved
    time: Floats
    motions: list[Any]
    pressure: Floats
    energies: Floats

    @property
    def whole(self) -> Floats:
        """Kinetic and strain energy (steps,), relative to that at the start."""
        return self.energies[:, :2].sum(axis=1) / self.energies[0, 2]

    @property
    def unbalanced(self) -> float:
        """Largest error of the account of energy, relative to the largest energy."""
        return float(np.abs([motion.account for motion in self.motions]).max() / np.abs(self.energies).max())

    def error(self, right: float, start: float, last: float) -> float:
        """Root mean square of the error of pressures from 10 % to 90 % of a contact, relative to the right one."""
        inside = (self.time > start + 0.1 * last) & (self.time < start + 0.9 * last)
        return float(np.sqrt(np.mean((self.pressure[inside] / right - 1) ** 2)))


def run(text: str, mesh: Mesh) -> ImpactRun:
    """Solve an impact. Raises what `solve` raises."""
    solved = solve(text, mesh)
    motions: list[Any] = [state.step.motion for state in solved.states]
    pressure = np.array([state.zones[0].pressure if state.zones else [] for state in solved.states])
    time, energies = np.array([state.time for state in solved.states]), np.array([m.energies for m in motions])
    return ImpactRun(solved, time, motions, pressure, energies)


def on_wall(given: Bar, n: int) -> tuple[ImpactRun, float]:
    """Throw a bar of n cells on a wall; return the run, and the error of its pressures."""
    dt, wait, last, count = given.timing(n)
    velocity: Mapping[str, Any] = {f"v{'xyz'[given.dim - 1]}": -given.speed}
    tables = contact(master="wall"), entry("rigid", group="wall")
    text = given.text(count * dt, count, *tables, entry("initial", groups=["bar"], **velocity))
    impact = run(text, bar_on_wall(given.cell, n, wait * given.speed))
    return impact, impact.error(given.c * given.speed, wait, last)


def account(impact: ImpactRun, most: float = CLOSED, reason: str = "") -> Result:
    """The result about the account of energy that every motion has."""
    return at_most("account of energy", impact.unbalanced, most, source=ACCOUNT, reason=reason)


def energies(impact: ImpactRun, least: float, most: float = CLOSED, reason: str = "") -> Iterator[Result]:
    """The results about energy of an elastic rebound; `least`: what is left at the end."""
    yield at_most("largest energy", impact.whole.max(), 1.001, source="no energy is created")
    yield at_least("energy at the end", impact.whole[-1], least, source="the rebound is elastic")
    yield account(impact, most, reason)
