"""Bodies from grids, their skins by where they lie, and several of them as one mesh."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import assembled
from verification.grids import hexahedra, quadrangles

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]
#: true at points of a skin, by their coordinates (n,)
Where = Callable[..., NDArray[np.bool_]]
#: points nearer than this part of the body's size are one
_NEAR = 1e-9


class Body(NamedTuple):
    """Points (n, d), cells (k, 4 or 8), which are rows of `points`: QUAD4 that turn left, or HEXA8.

    `skins`: group -> faces (k, 2 or 4), outward. `parts`: group -> places in `cells`, where they are not all in one.
    """

    points: Floats
    cells: Ints
    skins: Mapping[str, Ints]
    parts: Mapping[str, Ints] = {}


def body(*grids: Floats, skins: Mapping[str, Where]) -> Body:
    """A body of grids of points (a, b, 2) or (a, b, c, 3), whose axes are right-handed; coincident points are one.

    `skins`: name -> where(x, y[, z]) is true for all nodes of the outer faces of that group.
    """
    d = grids[0].shape[-1]
    points = np.concatenate([grid.reshape(-1, d) for grid in grids])
    first = np.cumsum([0, *(grid[..., 0].size for grid in grids)])
    nodes = [k + np.arange(grid[..., 0].size).reshape(grid.shape[:-1]) for k, grid in zip(first, grids, strict=False)]
    cells = np.concatenate([quadrangles(node) if d == 2 else hexahedra(node) for node in nodes])
    place = np.round(points / (_NEAR * np.ptp(points, axis=0).max())) + 0.0
    _, kept, of = np.unique(place, axis=0, return_index=True, return_inverse=True)
    return with_skins(Body(points[kept], of.ravel()[cells], {}), skins)


def with_skins(of: Body, skins: Mapping[str, Where]) -> Body:
    """The body and groups of its outer faces, which turn outward."""
    kind = CELLS["QUAD4" if of.points.shape[1] == 2 else "HEXA8"]
    faces = np.concatenate([of.cells[:, list(facet.nodes)] for facet in kind.facets])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = faces[np.sort(first[count == 1])]
    named = {name: outer[where(*of.points.T)[outer].all(axis=1)] for name, where in skins.items()}
    return of._replace(skins={**of.skins, **named})


def at(axis: int, *values: float) -> Where:
    """Condition that holds where a coordinate has one of some values."""
    return lambda *x: np.isclose(x[axis][:, None], values, atol=1e-9).any(axis=1)


def joined(bodies: Mapping[str, Body], solid: str | None = None) -> Mesh:
    """Join bodies into one mesh: the cells of each form a group of its name, skins of one name a common group.

    `solid`: type of the cells, if not QUAD4 or HEXA8.
    """
    rows: dict[tuple[str, str], list[Ints]] = defaultdict(list)
    dim = next(iter(bodies.values())).points.shape[1]
    whole, face = ("QUAD4", "SEG2") if dim == 2 else ("HEXA8", "QUAD4")
    first = 0
    for name, own in bodies.items():
        for group, cells in (own.parts or {name: np.arange(len(own.cells))}).items():
            rows[solid or whole, group].append(own.cells[cells] + first)
        for group, faces in own.skins.items():
            rows[face, group].append(faces + first)
        first += len(own.points)
    points = np.concatenate([np.pad(own.points, ((0, 0), (0, 3 - dim))) for own in bodies.values()])
    return assembled(points, {key: np.concatenate(parts) for key, parts in rows.items()}, dim)
