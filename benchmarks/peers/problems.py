"""The peers' problem, a cylinder on a block, and errors of its pressures against Hertz. Needs numpy alone.

A lower and an upper body in plane strain, each a grid of bilinear quadrangles; all sides are known by name, the slave's
side is `slave`, the other `master`. One half is modelled: x = 0 is a plane of symmetry.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

#: grid lines beyond the fine part grow by this
GROWTH = 1.25
#: radius, moduli of cylinder and block, Poisson's ratio, how far the cylinder is pushed
RADIUS, STEEL, ALLOY, POISSON, PUSH = 50.0, 210000.0, 70000.0, 0.3, 0.2
#: force a length that the mesh is made for
FORCE = 3500.0
#: facets of a quadrangle across each axis, at its low and its high end, outward
_SIDES = {"x0": (3, 0), "x1": (1, 2), "y0": (0, 1), "y1": (2, 3)}


class Body(NamedTuple):
    """A grid: points (n, 2), cells (m, 4), faces (k, 2) by the name of their side, outward; its modulus."""

    points: np.ndarray
    cells: np.ndarray
    sides: dict[str, np.ndarray]
    young: float


class Pair(NamedTuple):
    """Two bodies. `supports`: side -> axes of no displacement; `h`: size of a slave face; `push`: uy of the top."""

    lower: Body
    upper: Body
    h: float
    supports: tuple[tuple[str, int], ...] = (("bottom", 0), ("bottom", 1), ("x0", 0))
    push: float = -PUSH

    @property
    def bodies(self) -> dict[str, Body]:
        """The lower and the upper body by name."""
        return {"lower": self.lower, "upper": self.upper}

    def named(self, side: str) -> list[str]:
        """The names of the bodies that have a side."""
        return [name for name, body in self.bodies.items() if side in body.sides]


def grid(x: np.ndarray, y: np.ndarray, young: float, names: dict[str, str]) -> Body:
    """The cells between grid lines; `names`: those of sides, where not x0, x1 ..."""
    points = np.stack([a.ravel() for a in np.meshgrid(x, y, indexing="ij")], axis=1)
    n = np.arange(len(points)).reshape(len(x), len(y))
    cells = np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], axis=-1)
    ends = {"x0": cells[0], "x1": cells[-1], "y0": cells[:, 0], "y1": cells[:, -1]}
    sides = {names.get(name, name): ends[name][:, nodes] for name, nodes in _SIDES.items()}
    return Body(points, cells.reshape(-1, 4), sides, young)


def half_width(force: float) -> float:
    """Hertz: the half-width of contact under a force a length; 1 / E* = (1 - nu^2) / E_1 + (1 - nu^2) / E_2."""
    return float(np.sqrt(4 * force * RADIUS / np.pi * (1 - POISSON**2) * (1 / STEEL + 1 / ALLOY)))


def hertz(n: int) -> Pair:
    """Half a cylinder (the slave) on half a block; n slave faces to the half-width, the master's 2/3 as large."""
    a = half_width(FORCE)
    h, fine = a / n, a / n / 1.5
    below = {"y0": "bottom", "y1": "master"}
    lower = grid(lines(100.0, fine, 1.5 * a), -lines(200.0, fine, a)[::-1], ALLOY, below)
    upper = grid(lines(40.0, h, 1.5 * a), lines(50.0, h, a), STEEL, {"y0": "slave", "y1": "top"})
    x, y = upper.points.T
    rise = RADIUS - np.sqrt(RADIUS**2 - x**2)
    upper.points[:, 1] = rise + y * (1 - rise / 50.0)
    return Pair(lower, upper, h)


def lines(length: float, h: float, fine: float) -> np.ndarray:
    """Grid lines from 0 to a length: steps of about h up to `fine`, then growing ones, scaled to end there."""
    near = np.linspace(0, fine, max(1, round(fine / h)) + 1)
    left = length - fine
    count = int(np.ceil(np.log1p(left * (GROWTH - 1) / (h * GROWTH)) / np.log(GROWTH)))
    steps = h * GROWTH ** np.arange(1, count + 1)
    return np.concatenate([near, fine + np.cumsum(steps) * left / steps.sum()])


class HertzErrors(NamedTuple):
    """Relative errors: peak, rms of p for r < 0.9 a over the peak, and the half-width that is fitted to p."""

    peak: float
    rms: float
    width: float


def hertz_errors(x: np.ndarray, p: np.ndarray, force: float) -> HertzErrors:
    """Errors of pressures p at distances x from the axis against the half-space under the same force per length.

    The half-width is the zero of the line fitted to p^2 over x^2 in the outer half of contact.
    """
    a = half_width(force)
    top = 2 * force / (np.pi * a)
    inner = x <= 0.9 * a
    off = p[inner] - top * np.sqrt(1 - (x[inner] / a) ** 2)
    outer = (x > 0.5 * a) & (p > 0.15 * top)
    slope, start = np.polyfit(x[outer] ** 2, p[outer] ** 2, 1)
    return HertzErrors(p.max() / top - 1, float(np.sqrt(np.mean(off**2))) / top, float(np.sqrt(-start / slope)) / a - 1)


def lame(young: float) -> tuple[float, float]:
    """Lame's two moduli."""
    return young * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), young / (2 * (1 + POISSON))


def answer(solve: Callable[[Pair], dict]) -> None:
    """Solve the problem of the size that the command names, and write its results: `MODULE N ANSWER.npz`."""
    np.savez(sys.argv[2], **solve(hertz(int(sys.argv[1]))))
