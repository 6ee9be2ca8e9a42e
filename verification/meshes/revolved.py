"""Quarters and halves of bodies of revolution: a section of QUAD4 in the plane of r and z, turned about z."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh import Mesh
from lacmesh.generate.parts import assembled
from verification.meshes.blocks import bent
from verification.meshes.bodies import Body

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]
Bools = NDArray[np.bool_]
#: cells or faces of one type, with the name of their group, "" for that of the body
_Rows = Iterator[tuple[str, str, Ints]]


def revolved(section: Body, sectors: int, name: str, turn: float = np.pi / 2) -> Mesh:
    """Turn a section by an angle, of a quarter or a half, into HEXA20, and PENTA15 along the axis; mid-nodes of edges
    around the axis lie on their circles.

    Groups: `name` (the cells), `y0` (the plane y = 0 where the turn starts), `x0` (the plane where it ends: x = 0 of a
    quarter), and the faces of the section's skins.

    >>> square = Body(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), np.array([[0, 1, 2, 3]]), {})
    >>> revolved(square, 2, "disc").cells_by_type
    {'PENTA15': 2, 'QUAD8': 2}
    """
    (r, z), n = section.points.T, len(section.points)
    axis = np.abs(r) < 1e-9 * r.max()
    angle = np.linspace(0, turn, sectors + 1)[:, None]
    points = np.stack([np.cos(angle) * r, np.sin(angle) * r, z + 0 * angle], axis=-1)
    points[np.abs(points) < 1e-12 * r.max()] = 0.0
    number = np.where(axis, 0, n * np.arange(sectors + 1)[:, None]) + np.arange(n)
    rows: dict[tuple[str, str], list[Ints]] = defaultdict(list)
    for before, after in pairwise(number):
        for kind, group, nodes in (*_solids(section, axis, before, after), *_faces(section, axis, before, after)):
            rows[kind, group or name].append(nodes)
    rows["QUAD4", "y0"] = [number[0][section.cells]]
    rows["QUAD4", "x0"] = [number[-1][section.cells[:, ::-1]]]
    used = np.unique(number)
    cells = {key: np.searchsorted(used, np.concatenate(nodes)) for key, nodes in rows.items()}
    return _rounded(
        lacmesh.raise_order(assembled(points.reshape(-1, 3)[used], cells, 3), surface="faces"), turn / 2 / sectors
    )


def _solids(section: Body, axis: Bools, before: Ints, after: Ints) -> _Rows:
    """Yield the cells between two half-planes: hexahedra, and prisms where two corners are on the axis."""
    cells = section.cells
    thin = axis[cells].any(axis=1)
    if (~thin).any():
        yield "HEXA8", "", np.hstack([after[cells[~thin]], before[cells[~thin]]])
    on = axis[cells[thin]]
    first = (on & np.roll(on, 1, axis=1)).argmax(axis=1)  # the corner on the axis after which the others follow
    a, b, c, d = np.take_along_axis(cells[thin], (first[:, None] + np.arange(4)) % 4, axis=1).T
    if thin.any():
        yield "PENTA6", "", np.stack([after[a], before[b], after[b], after[d], before[c], after[c]], axis=1)


def _faces(section: Body, axis: Bools, before: Ints, after: Ints) -> _Rows:
    """Yield the faces of the section's skins between two half-planes, outward; triangles where they meet the axis."""
    for group, edges in section.skins.items():
        a, b = edges.T
        whole, starts, ends = ~axis[edges].any(axis=1), axis[a], axis[b]
        for kind, there, nodes in (
            ("QUAD4", whole, (before[a], after[a], after[b], before[b])),
            ("TRIA3", starts, (before[a], after[b], before[b])),
            ("TRIA3", ends, (before[a], after[a], before[b])),
        ):
            if there.any():
                yield kind, group, np.stack(nodes, axis=1)[there]


def _rounded(mesh: Mesh, half: float) -> Mesh:
    """Put the mid-nodes at odd multiples of the angle `half`, those of edges around the axis, on their circles."""

    def where(x: Floats) -> Floats:
        turn = np.rint(np.arctan2(x[:, 1], x[:, 0]) / half).astype(int)
        return np.asarray(x * np.where(turn % 2 == 1, [[1 / np.cos(half)]] * 2 + [[1.0]], 1.0).T)

    return bent(mesh, where)
