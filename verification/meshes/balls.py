"""Spheres of radius 1 above a rigid wall, of quadratic cells that are small near the lowest point: axisymmetric, and a
quarter and a half in space.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh import Mesh
from lacmesh.generate.parts import assembled
from verification.grids import between, lines
from verification.meshes.blocks import bent
from verification.meshes.blocks import joined as together
from verification.meshes.bodies import Body, body, joined
from verification.meshes.revolved import revolved

Floats = NDArray[np.floating]
#: cells of one size reach this far along the skin and up, in radii of the contact; the others grow by a factor
_EVEN, _GROWTH = (1.25, 0.5), 1.6
#: rows of cells in the upper half, sectors of a quarter
_ROWS, _SECTORS = 4, 3


def sphere_on_wall(contact: float, gap: float, fineness: int = 10) -> Mesh:
    """An axisymmetric sphere of QUAD8 whose lowest point is at height `gap`; `contact`: radius of the contact, about.

    Cells near it have a size of contact / fineness. Groups: `ball`, `slave` (an arc around the lowest point), `rest`
    (of its surface), `wall`.
    """
    ball = lacmesh.raise_order(joined({"ball": _section(contact, contact / fineness)}), surface="faces")
    x = np.array([[1.5, 0.0, 0.0], [0.0, 0.0, 0.0]])  # it faces up
    wall = assembled(x, {("SEG2", "wall"): np.array([[0, 1]])}, 2)
    return together([(_round(ball, gap), {}), (wall, {})], keep=True)


def quarter_sphere_on_wall(contact: float, gap: float, fineness: int = 10) -> Mesh:
    """A quarter of that sphere in space, x, y >= 0, of HEXA20, and PENTA15 along the axis z, which goes up.

    Groups: as above, and `x0`, `y0`, the planes of symmetry.
    """
    return _over_plane(revolved(_section(contact, contact / fineness), _SECTORS, "ball"), gap)


def half_sphere_on_wall(contact: float, gap: float, fineness: int = 6) -> Mesh:
    """The half of that sphere with y >= 0. Groups: as above; `y0`, `x0`: the two halves of its plane of symmetry."""
    return _over_plane(revolved(_section(contact, contact / fineness), 2 * _SECTORS, "ball", np.pi), gap)


def _over_plane(ball: Mesh, gap: float) -> Mesh:
    x = np.array([[-1.5, -0.5, 0.0], [1.5, -0.5, 0.0], [1.5, 1.5, 0.0], [-1.5, 1.5, 0.0]])
    wall = assembled(x, {("QUAD4", "wall"): np.arange(4)[None]}, 3)
    return together([(_round(ball, gap), {}), (wall, {})], keep=True)


def _section(contact: float, h: float) -> Body:
    """Half a disc that stands on the origin, its cells of size h there; its skins: `slave`, below 45 degrees, `rest`.

    Away from the contact lines are spread more evenly than on the skin there and on the axis: flat cells are stiff, and
    leave round-off.
    """
    turn = np.pi / 4
    along, up = (lines(end, h, k * contact, _GROWTH) for end, k in zip((turn, 1.0), _EVEN, strict=True))
    even, rows = np.linspace(0, 1, len(along)), np.linspace(0, 1, _ROWS + 1)
    flat, side = (along / turn + 3 * even) / 4, (up + 3 * np.linspace(0, 1, len(up))) / 4
    middle = np.stack([flat, np.ones_like(flat)], axis=-1)
    lower = between(_arc(along), middle, _axis(up), _arc(turn * (1 + side)))
    upper = between(middle, _arc(np.pi - turn * even), _axis(1 + rows), _arc(turn * (2 + rows)))

    def skin(x: Floats, y: Floats, sign: int) -> NDArray[np.bool_]:
        return (np.abs(np.hypot(x, y - 1) - 1) < 1e-9) & (sign * (y - 1 + np.cos(turn)) > -1e-9)

    return body(lower, upper, skins={"slave": lambda x, y: skin(x, y, -1), "rest": lambda x, y: skin(x, y, 1)})


def _arc(angle: Floats) -> Floats:
    """Points (n, 2) of the circle of radius 1 that stands on the origin, by their angles from there."""
    return np.stack([np.sin(angle), 1 - np.cos(angle)], axis=-1)


def _axis(y: Floats) -> Floats:
    """Points (n, 2) of the axis."""
    return np.stack([np.zeros_like(y), y], axis=-1)


def _round(ball: Mesh, gap: float) -> Mesh:
    """Put all nodes of the skins on the sphere, and lift it by `gap`."""
    up = np.eye(3)[ball.space_dim - 1]
    points = ball.points - up
    for name in ("slave", "rest"):
        for _, _, nodes in ball.select(ball.cell_groups[name]):
            points[nodes] /= np.linalg.norm(points[nodes], axis=-1, keepdims=True)
    return bent(ball, lambda x: points + (1 + gap) * up)
