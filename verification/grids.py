"""Grids of points that bodies are made of: lines that grow, a cylinder's section, a quarter and a half of a disc."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]


def lines(length: float, h: float, fine: float, growth: float) -> Floats:
    """Grid lines from 0 to a length: steps of about h up to `fine`, then growing ones, scaled to end there.

    >>> lines(10.0, 1.0, 2.0, 2.0).tolist()
    [0.0, 1.0, 2.0, 3.142857142857143, 5.428571428571429, 10.0]
    """
    near = np.linspace(0, fine, max(1, round(fine / h)) + 1)
    left = length - fine
    count = int(np.ceil(np.log1p(left * (growth - 1) / (h * growth)) / np.log(growth)))
    steps = h * growth ** np.arange(1, count + 1)
    return np.concatenate([near, fine + np.cumsum(steps) * left / steps.sum()])


def box(*lines: Floats) -> Floats:
    """(a, b, 2) or (a, b, c, 3): the points with these coordinates."""
    return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)


def under_circle(x: Floats, y: Floats, radius: float) -> Floats:
    """(a, b, 2): a box whose underside is a circle that stands on the origin, the top where it was."""
    points = box(x, y)
    wide, high = np.moveaxis(points, -1, 0)
    rise = radius - np.sqrt(radius**2 - wide**2)
    return np.stack([wide, rise + high * (1 - rise / y[-1])], axis=-1)


def quarter_disc(radius: float, along: Floats, up: Floats) -> Floats:
    """(a, b, 2): the lower right quarter of a disc that stands on the origin, by a patch of Coons (1967).

    `along`, from 0 to 1, divides the arc from the origin to 45 degrees, and the flat; `up` the axis and the other arc.
    """
    turn = np.pi / 4
    low, right = (np.stack([np.sin(a), 1 - np.cos(a)], axis=-1) for a in (along * turn, turn * (1 + up)))
    top, left = np.stack([along, np.ones_like(along)], axis=-1), np.stack([np.zeros_like(up), up], axis=-1)
    return radius * between(low, top, left, right)


def half_disc(radius: float, n: int, rows: int, core: float = 0.55) -> tuple[Floats, ...]:
    """Grids that fill the half y <= 0 of a disc about the origin: 4 n segments on its arc, and `rows` of cells around
    a rounded core of n by 2 n.
    """
    u = np.linspace(-1.0, 1.0, 2 * n + 1)
    arc = np.stack([np.cos(np.pi / 4 * u), np.sin(np.pi / 4 * u)], axis=-1)  # a quarter, about the x axis
    rim = core * (arc + np.stack([np.full_like(u, np.sqrt(0.5)), np.sqrt(0.5) * u], axis=-1)) / 2
    w = np.linspace(0.0, 1.0, rows + 1)[:, None, None]
    shell = (1 - w) * rim + w * arc
    low, high = turned(rim[n:], -1), turned(rim[: n + 1], 1)[::-1]
    left = np.stack([np.zeros_like(u), (low[0, 1] * (1 - u) + high[0, 1] * (1 + u)) / 2], axis=-1)
    around = shell, turned(shell[:, n:], -1), turned(shell[:, : n + 1], 1)
    return tuple(radius * turned(grid, -1) for grid in (between(low, high, left, rim), *around))


def turned(points: Floats, times: int) -> Floats:
    """Points (.., 2) turned to the left by so many right angles."""
    c, s = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])[times % 4]
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def between(low: Floats, high: Floats, left: Floats, right: Floats) -> Floats:
    """(a, b, 2): Coons' patch between lines that meet in its corners, `low` and `high` (a, 2), the others (b, 2).

    Each point is at the share of the lower line's length, and of the left one's, that its neighbours there are.
    """
    s, t = _share(low)[:, None, None], _share(left)[None, :, None]
    corners = (1 - s) * ((1 - t) * low[0] + t * high[0]) + s * ((1 - t) * low[-1] + t * high[-1])
    across = (1 - t) * low[:, None] + t * high[:, None]
    return np.asarray(across + (1 - s) * left[None] + s * right[None] - corners)


def quadrangles(node: Ints) -> Ints:
    """(k, 4): the cells of a grid of nodes, turning from its first axis to its second."""
    return np.stack([c.ravel() for c in (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])], axis=1)


def hexahedra(node: Ints) -> Ints:
    """(k, 8): the hexahedra of a grid of nodes with right-handed axes."""
    floors = [quadrangles(node[:, :, k]) for k in range(node.shape[2])]
    return np.concatenate([np.hstack(pair) for pair in pairwise(floors)])


def _share(line: Floats) -> Floats:
    """(n,): from 0 to 1 along a line (n, 2)."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return np.asarray(length / length[-1])
