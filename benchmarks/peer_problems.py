"""The problems that contact codes are compared on, and how their answers are measured. Needs numpy alone.

Two blocks under a pressure (`blocks`), a cylinder on a block (`hertz`), two like cylinders that are pressed together,
then sheared (`cattaneo`). A lower and an upper body, each a grid of
bilinear quadrangles or trilinear hexahedra, all sides known by name; the slave's side is `slave`, the other `master`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

#: grid lines beyond the fine part grow by this
GROWTH = 1.25
#: of the cylinder on the block: radius, moduli of cylinder and block, Poisson's ratio, how far the cylinder is pushed
RADIUS, STEEL, ALLOY, POISSON, PUSH = 50.0, 210000.0, 70000.0, 0.3, 0.2
#: force a length that the mesh is made for
FORCE = 3500.0
#: of the two blocks
YOUNG, PRESSURE = 1e3, 1.0
#: of two like cylinders (Yang, Laursen and Meng 2005): radius, modulus, friction; force a length, and shear over mu
#: times it, that the mesh is made for
LIKE_RADIUS, LIKE_YOUNG, FRICTION, LIKE_FORCE, LIKE_SHEAR = 8.0, 200.0, 0.2, 10.0, 0.4681
#: how far their tops are moved, down in so many steps and then aside, for about these forces
LIKE_PUSH, LIKE_ASIDE, PRESSES = 0.1872, 0.0381, 8
#: facets of a hexahedron across each axis, at its low and its high end, outward
_SIDES = {
    2: {"x0": (3, 0), "x1": (1, 2), "y0": (0, 1), "y1": (2, 3)},
    3: {
        **{"x0": (0, 4, 7, 3), "x1": (1, 2, 6, 5), "y0": (0, 1, 5, 4)},
        **{"y1": (3, 7, 6, 2), "z0": (0, 3, 2, 1), "z1": (4, 5, 6, 7)},
    },
}
_CORNERS = {
    2: [(0, 0), (1, 0), (1, 1), (0, 1)],
    3: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}


class Body(NamedTuple):
    """A grid: points (n, d), cells (m, 4 or 8), faces (k, 2 or 4) by the name of their side, outward; its modulus."""

    points: np.ndarray
    cells: np.ndarray
    sides: dict[str, np.ndarray]
    young: float


class Pair(NamedTuple):
    """Two bodies. `held`: side -> axis of no displacement; `h`: size of a slave face.

    Either `push`, the displacement of the top along its normal, or `pressure` on it is not 0. With `friction` the top
    does not move along x, and by `aside` in a second step.
    """

    lower: Body
    upper: Body
    slave: str
    poisson: float
    held: tuple[tuple[str, int], ...]
    h: float
    push: float = 0.0
    pressure: float = 0.0
    friction: float = 0.0
    aside: float = 0.0

    @property
    def dim(self) -> int:
        """2 or 3."""
        return self.lower.points.shape[1]

    @property
    def n_dof(self) -> int:
        """Displacements of both bodies."""
        return self.lower.points.size + self.upper.points.size

    @property
    def bodies(self) -> tuple[Body, Body]:
        """The lower, the upper."""
        return self.lower, self.upper


def grid(axes: list[np.ndarray], young: float, names: dict[str, str]) -> Body:
    """The cells between grid lines; `names`: what sides are called, where not x0, x1 ..."""
    dim, shape = len(axes), tuple(len(a) for a in axes)
    points = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=1)
    number = np.arange(len(points)).reshape(shape)
    at = [number[tuple(slice(c, n - 1 + c) for c, n in zip(corner, shape, strict=True))] for corner in _CORNERS[dim]]
    cells = np.stack(at, axis=-1)
    sides = {}
    for name, nodes in _SIDES[dim].items():
        axis, end = "xyz".index(name[0]), -int(name[1])
        sides[names.get(name, name)] = cells.take(end, axis=axis).reshape(-1, 2**dim)[:, nodes]
    return Body(points, cells.reshape(-1, 2**dim), sides, young)


def blocks(lower: tuple[int, int, int], upper: tuple[int, int, int], skew: float = 0.0) -> Pair:
    """Unit cubes on one another, of so many cells, frictionless, symmetric in x and y; the lower is the slave.

    `skew` moves every node inside a horizontal section, those of the lower one way, of the upper the other.
    """
    bodies = []
    for k, (n, names) in enumerate(((lower, {"z0": "bottom", "z1": "slave"}), (upper, {"z0": "master", "z1": "top"}))):
        axes = [np.linspace(0, 1, n[0] + 1), np.linspace(0, 1, n[1] + 1), np.linspace(k, k + 1, n[2] + 1)]
        body = grid(axes, YOUNG, names)
        x, y = body.points[:, 0].copy(), body.points[:, 1].copy()
        bubble = 16 * skew * (1 - 2 * k) * x * (1 - x) * y * (1 - y)
        body.points[:, :2] += bubble[:, None] * [1.0, -0.7]
        bodies.append(body)
    held = (("bottom", 2), ("x0", 0), ("y0", 1))
    return Pair(bodies[0], bodies[1], "slave", POISSON, held, 1 / lower[0], pressure=PRESSURE)


def half_width(force: float, radius: float = RADIUS, young: tuple[float, float] = (STEEL, ALLOY)) -> float:
    """Hertz: the half-width of contact under a force a length; 1 / E* = (1 - nu^2) / E_1 + (1 - nu^2) / E_2."""
    return float(np.sqrt(4 * force * radius / np.pi * (1 - POISSON**2) * (1 / young[0] + 1 / young[1])))


def hertz(n: int) -> Pair:
    """Half a cylinder (the slave) on half a block; n slave faces to the half-width, the master's 2/3 as large."""
    a = half_width(FORCE)
    h, fine = a / n, a / n / 1.5
    low_axes = [lines(100.0, fine, 1.5 * a), -lines(200.0, fine, a)[::-1]]
    lower = grid(low_axes, ALLOY, {"y0": "bottom", "y1": "master"})
    upper = grid([lines(40.0, h, 1.5 * a), lines(50.0, h, a)], STEEL, {"y0": "slave", "y1": "top"})
    x, y = upper.points.T
    rise = RADIUS - np.sqrt(RADIUS**2 - x**2)
    upper.points[:, 1] = rise + y * (1 - rise / 50.0)
    return Pair(lower, upper, "slave", POISSON, (("bottom", 0), ("bottom", 1), ("x0", 0)), h, push=-PUSH)


def cattaneo(n: int) -> Pair:
    """Two bodies 12 wide and 8 high with cylindrical skins, the upper one the slave, n faces to the half-width."""
    a = half_width(LIKE_FORCE, LIKE_RADIUS / 2, (LIKE_YOUNG, LIKE_YOUNG))
    bodies = []
    for side, h, names in (
        (-1, a / n / 1.5, {"y0": "bottom", "y1": "master"}),
        (1, a / n, {"y0": "slave", "y1": "top"}),
    ):
        aside, up = lines(6.0, h, 1.5 * a), lines(8.0, h, a)
        body = grid([np.concatenate([-aside[:0:-1], aside]), up if side > 0 else -up[::-1]], LIKE_YOUNG, names)
        rise = LIKE_RADIUS - np.sqrt(LIKE_RADIUS**2 - body.points[:, 0] ** 2)
        body.points[:, 1] = side * rise + body.points[:, 1] * (1 - rise / 8.0)
        bodies.append(body)
    return Pair(
        *bodies, "slave", POISSON, (("bottom", 0), ("bottom", 1)), a / n, push=-LIKE_PUSH, friction=FRICTION,
        aside=LIKE_ASIDE,
    )  # fmt: skip


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


class ShearErrors(NamedTuple):
    """Relative errors: rms of t for |x| < 0.9 a over mu times the peak of p, and the half-width of what sticks."""

    rms: float
    stick: float


def shear_errors(x: np.ndarray, t: np.ndarray, force: float, shear: float) -> ShearErrors:
    """Errors of the sizes t of shear stresses at places x against Cattaneo and Mindlin under the same forces a length.

    The half-width is the zero of the line fitted to (mu p - t)^2 over x^2, mu p that of Hertz, in the outer half of
    what should stick.
    """
    a = half_width(force, LIKE_RADIUS / 2, (LIKE_YOUNG, LIKE_YOUNG))
    c, top = a * np.sqrt(1 - shear / (FRICTION * force)), FRICTION * 2 * force / (np.pi * a)
    bound = top * np.sqrt(np.maximum(1 - (x / a) ** 2, 0))
    right = bound - top * c / a * np.sqrt(np.maximum(1 - (x / c) ** 2, 0))
    inner = np.abs(x) <= 0.9 * a
    outer = (np.abs(x) > 0.5 * c) & (np.abs(x) < c)
    rms = float(np.sqrt(np.mean((t - right)[inner] ** 2))) / top
    if outer.sum() < 6:
        return ShearErrors(rms, np.nan)
    slope, start = np.polyfit(x[outer] ** 2, (bound - t)[outer] ** 2, 1)
    return ShearErrors(rms, float(np.sqrt(-start / slope)) / c - 1 if slope < 0 < start else np.nan)


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Lame's two moduli."""
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))


def save(pair: Pair, path: Path) -> None:
    """Write a pair for a program of another Python."""
    arrays: dict[str, np.ndarray] = {}
    for name, body in zip(("lower", "upper"), pair.bodies, strict=True):
        arrays |= {f"{name}.points": body.points, f"{name}.cells": body.cells, f"{name}.young": np.array(body.young)}
        arrays |= {f"{name}.side.{side}": nodes for side, nodes in body.sides.items()}
    told = {
        name: getattr(pair, name) for name in ("slave", "poisson", "held", "h", "push", "pressure", "friction", "aside")
    }
    np.savez(path, told=np.array(json.dumps(told)), **arrays)


def load(path: str | Path) -> Pair:
    """Read what `save` wrote."""
    with np.load(path) as file:
        told = json.loads(str(file["told"]))
        bodies = []
        for name in ("lower", "upper"):
            start = f"{name}.side."
            sides = {key.removeprefix(start): file[key] for key in file if key.startswith(start)}
            bodies.append(Body(file[f"{name}.points"], file[f"{name}.cells"], sides, float(file[f"{name}.young"])))
    return Pair(*bodies, **told | {"held": tuple((side, axis) for side, axis in told["held"])})
