"""Edges and angles of every cell of dimension 2 and 3, linear or curved, at its corners.

The edge ratio compares the lengths of the curved edges. The angle at a corner of a surface cell is that between its
edges; a dihedral angle of a solid is that between two facets at either end of their common edge, measured between the
planes that are tangent to the edges there. All are in degrees, 0 to 180, without sign. Corners with an edge of zero
length are left out; NaN if all are.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats
from lacmesh.quality.vectors import cross, dot, nodes_first, norm, ratio

#: points and weights that measure a curved edge, on [0, 1] (Gauss, 3 points)
GAUSS_AT = 0.5 + np.sqrt(0.15) * np.array([-1, 0, 1])
GAUSS_WEIGHT = np.array([5, 8, 5]) / 18


class Corners(NamedTuple):
    """Edges and corners of a cell type. `edges` (e, 2): the ends of each; `ways` (w, 2): an edge and its starting end.

    `angles` (a, 2): two ways out of a corner of a surface cell. `dihedral` (d, 3): a way along an edge of a solid, and
    those along the next edges of the two facets that meet there.
    """

    edges: NDArray
    angles: NDArray
    dihedral: NDArray


@cache
def corners_of(name: str) -> Corners:
    """Return the edges and corners of a cell type; way 2 e + s runs along edge e from its end s."""
    cell = CELLS[name]
    out = {(a, b): 2 * k for k, (a, b) in enumerate(cell.edges)} | {
        (b, a): 2 * k + 1 for k, (a, b) in enumerate(cell.edges)
    }
    if cell.dim == 2:
        turns = [tuple(range(cell.n_corners))]
    else:
        turns = [f.nodes[: CELLS[CELLS[f.type].linear].n_corners] for f in cell.facets]
    pairs = [(out[t[k], t[k - 1]], out[t[k], t[(k + 1) % len(t)]]) for t in turns for k in range(len(t))]
    beside: dict[int, list[int]] = {}
    for a, b in pairs:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    dihedral = [(way, *others) for way, others in beside.items() if len(others) == 2] if cell.dim == 3 else []
    angles = pairs if cell.dim == 2 else []
    return Corners(np.array(cell.edges), *(np.array(t, int).reshape(-1, w) for t, w in ((angles, 2), (dihedral, 3))))


def tangents(name: str, x: NDArray) -> NDArray:
    """(2 e, 3, k): tangents at both ends of the edges of cells x (n, 3, k), as derivatives; a straight edge itself."""
    cell = CELLS[name]
    a, b = (x[[e[s] for e in cell.edges]] for s in (0, 1))
    if cell.order == 1:
        return np.stack([b - a, a - b], axis=1).reshape(-1, *x.shape[1:])
    m = x[cell.n_corners : cell.n_corners + len(cell.edges)]
    return np.stack([4 * m - 3 * a - b, 4 * m - 3 * b - a], axis=1).reshape(-1, *x.shape[1:])


def edge_ratio(name: str, x: Floats) -> Floats:
    """(k,): the longest edge of cells at x (k, n_nodes, 3) over the shortest; infinite if an edge has no length.

    >>> float(edge_ratio("QUAD4", np.array([[[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0.0]]]))[0])
    2.0
    """
    return ratio(*_extremes(name, nodes_first(x)), otherwise=np.inf)


def _extremes(name: str, x: NDArray) -> tuple[NDArray, NDArray]:
    """(k,) each: length of the longest and of the shortest edge."""
    t = tangents(name, x)
    if CELLS[name].order == 1:
        lengths = [norm(e) for e in t[::2]]
    else:  # the derivative along a curved edge is linear: from one end's tangent to the other's, turned
        lengths = [
            np.sum([w * norm((1 - s) * a - s * b) for s, w in zip(GAUSS_AT, GAUSS_WEIGHT, strict=True)], axis=0)
            for a, b in zip(t[::2], t[1::2], strict=True)
        ]
    return np.max(lengths, axis=0), np.min(lengths, axis=0)


def angles(name: str, x: Floats) -> tuple[Floats, Floats]:
    """(k,) each: least and largest angle of cells at x (k, n_nodes, 3): corner angles, or dihedral angles of solids.

    >>> [round(float(a[0]), 6) for a in angles("TETRA4", np.array([CELLS["TETRA4"].reference]))]
    [54.73561, 90.0]
    """
    t = tangents(name, nodes_first(x))
    table = corners_of(name)
    low, high = np.full(len(x), np.inf), np.full(len(x), -np.inf)  # of the cosines
    for sides in _sides(t, table):
        a, b = sides
        with np.errstate(divide="ignore", invalid="ignore"):
            cosine = dot(a, b) / np.sqrt(dot(a, a) * dot(b, b))
        low, high = np.fmin(low, cosine), np.fmax(high, cosine)
    none = np.isinf(low)
    least, largest = (np.degrees(np.arccos(np.clip(c, -1, 1))) for c in (high, low))
    return np.where(none, np.nan, least), np.where(none, np.nan, largest)


def _sides(t: NDArray, table: Corners) -> list[tuple[NDArray, NDArray]]:
    if len(table.angles):
        return [(t[a], t[b]) for a, b in table.angles]
    return [(cross(t[e], t[a]), cross(t[e], t[b])) for e, a, b in table.dihedral]
