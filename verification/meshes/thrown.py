"""Rings and discs that are thrown at a wall or at one another, whose nodes do not match."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.generate.parts import assembled
from verification.grids import half_disc, turned
from verification.meshes.blocks import joined as together
from verification.meshes.bodies import Body, body, joined

Floats = NDArray[np.floating]

#: radii of a ring; the outer one is that of a ball
INNER, OUTER = 0.8, 1.0


def ring(around: int, rows: int, centre: tuple[float, float], skin: str) -> Body:
    """A ring of `around` by `rows` QUAD4 about a centre, with its outer skin as a group."""
    angle = np.linspace(0.0, 2 * np.pi, around + 1)[:, None]
    radius = np.linspace(OUTER, INNER, rows + 1)
    grid = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    return _placed(body(grid, skins={skin: _outside}), centre)


def disc(n: int, centre: tuple[float, float], skin: str) -> Body:
    """A disc with 8 n QUAD4 along its circle, with its skin as a group."""
    lower = half_disc(OUTER, n, max(2, n // 2))
    return _placed(body(*lower, *(turned(grid, 2) for grid in lower), skins={skin: _outside}), centre)


def on_wall(thrown: Body, width: float = 6.0) -> Mesh:
    """A body with the skin `slave` above a rigid wall at height 0. Groups: `body`, `slave`, `wall`."""
    x = np.array([[width / 2, 0.0, 0.0], [-width / 2, 0.0, 0.0]])  # it faces up
    wall = assembled(x, {("SEG2", "wall"): np.array([[0, 1]])}, 2)
    return together([(joined({"body": thrown}), {"body": "body", "slave": "slave"}), (wall, {"wall": "wall"})])


def two_rings(around: tuple[int, int], rows: int, gap: float) -> Mesh:
    """Two rings beside one another, `gap` apart. Groups: left, right, slave, master."""
    left, right = (ring(n, rows, (side * (OUTER + gap / 2), 0.0), skin)
                   for n, side, skin in zip(around, (-1, 1), ("slave", "master"), strict=True))  # fmt: skip
    return joined({"left": left, "right": right})


def _outside(x: Floats, y: Floats) -> NDArray[np.bool_]:
    return np.abs(np.hypot(x, y) - OUTER) < 1e-9


def _placed(thrown: Body, centre: tuple[float, float]) -> Body:
    return thrown._replace(points=thrown.points + np.asarray(centre))
