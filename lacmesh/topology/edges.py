"""Edges of faces: the faces at each edge, the neighbour across it, and every edge once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints
from lacmesh.topology.skin import MAX_CORNERS, N_CORNERS, Faces, label_rows


class EdgeUses(NamedTuple):
    """One row for each edge of each face, or each end of each segment: `face` (m,), `place` (m,), `edge` (m,) labels.

    `place` k: the edge from corner k to the next, or the end k. `start`, `stop` (m,): its nodes, as the face lists
    them; -1 for the `stop` of a segment's end. `forward` (m,): direction in which the face runs along the edge; two
    faces have consistent windings if they run along their common edge in opposite directions.
    """

    face: Ints
    place: Ints
    edge: Ints
    start: Ints
    stop: Ints
    forward: NDArray[np.bool_]


def edge_uses(faces: Faces) -> EdgeUses:
    """Label the edges of faces, and return the faces at each of them."""
    n = N_CORNERS[faces.type]
    corners = faces.corners
    parts = []
    for k in range(MAX_CORNERS):
        rows = np.flatnonzero(k < n)
        a, b = corners[rows, k], corners[rows, (k + 1) % n[rows]]
        segment = n[rows] == 2
        b = np.where(segment, -1, b)
        parts.append((rows, np.full(len(rows), k), a, b, np.where(segment, k == 0, a < b)))
    face, place, start, stop, forward = (np.concatenate(p) for p in zip(*parts, strict=True))
    ends = np.column_stack([np.minimum(start, stop) + 1, np.maximum(start, stop) + 1])
    return EdgeUses(face, place, label_rows(ends)[0], start, stop, forward)


def neighbours(faces: Faces) -> Ints:
    """(f, 4): the neighbour across the edge from corner k to the next (at corner k, for segments), or -1.

    At an edge of more than two faces it is one of the others.

    >>> neighbours(Faces.join([("TRIA3", np.array([[0, 1, 2], [2, 1, 3]]))])).tolist()
    [[-1, 1, -1, -1], [0, -1, -1, -1]]
    """
    uses = edge_uses(faces)
    order = np.lexsort((uses.place, uses.face, uses.edge))
    one, next_one = order[:-1], order[1:]
    same = uses.edge[one] == uses.edge[next_one]
    one, next_one = one[same], next_one[same]
    out = np.full((len(faces), MAX_CORNERS), -1)
    out[uses.face[next_one], uses.place[next_one]] = uses.face[one]
    out[uses.face[one], uses.place[one]] = uses.face[next_one]
    return out


def distinct_edges(corners: Ints) -> tuple[Ints, Ints]:
    """Return the edges (e, 2) of faces with corners (f, n), padded with -1, each once, and how many faces have each.

    A segment, of two corners, is an edge itself.
    """
    n = (corners >= 0).sum(axis=1)
    size = np.int64(corners.max(initial=0)) + 1
    keys = [np.empty(0, np.int64)]
    for k in range(corners.shape[1]):
        rows = np.flatnonzero((k < n) & ((k == 0) | (n > 2)))
        u, v = corners[rows, k], corners[rows, (k + 1) % n[rows]]
        keys.append(np.minimum(u, v) * size + np.maximum(u, v))
    key, count = np.unique(np.concatenate(keys), return_counts=True)
    return np.column_stack(np.divmod(key, size)), count
