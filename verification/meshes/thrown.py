"""Rings and discs that are thrown at a wall or at one another, whose nodes do not match."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh, generate
from verification.grids import half_disc, turned
from verification.meshes.blocks import bent, joined, with_skin
from verification.meshes.bodies import body
from verification.meshes.bodies import joined as of_bodies

#: radii of a ring; the outer one is that of a ball
INNER, OUTER = 0.8, 1.0


def ring(around: int, rows: int, centre: tuple[float, float]) -> Mesh:
    """A ring of `around` by `rows` QUAD4 about a centre. Groups: `body`, `outer`."""
    mesh = joined([(generate.ring((rows, around), (INNER, OUTER)), {"body": "body", "outer": "outer"})])
    return bent(mesh, lambda x: x + np.array([*centre, 0.0]))


def disc(n: int, centre: tuple[float, float]) -> Mesh:
    """A disc with 8 n QUAD4 along its circle. Groups: `body`, `outer`."""
    lower = half_disc(OUTER, n, max(2, n // 2))
    skins = {"outer": lambda x, y: np.abs(np.hypot(x, y) - OUTER) < 1e-9}
    mesh = of_bodies({"body": body(*lower, *(turned(grid, 2) for grid in lower), skins=skins)})
    return bent(mesh, lambda x: x + np.array([*centre, 0.0]))


def on_wall(thrown: Mesh, width: float = 6.0) -> Mesh:
    """A body above a rigid wall at height 0, which faces up. Groups: `body`, `slave`, `wall`."""
    wall = np.array([[width / 2, 0.0], [-width / 2, 0.0]])
    return with_skin(joined([(thrown, {"body": "body", "outer": "slave"})]), "SEG2", wall, np.array([[0, 1]]), "wall")


def two_rings(around: tuple[int, int], rows: int, gap: float) -> Mesh:
    """Two rings beside one another, `gap` apart. Groups: left, right, slave, master."""
    x = OUTER + gap / 2
    left, right = (ring(n, rows, (place, 0.0)) for n, place in zip(around, (-x, x), strict=True))
    return joined([(left, {"body": "left", "outer": "slave"}), (right, {"body": "right", "outer": "master"})])
