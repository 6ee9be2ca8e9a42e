"""Patterns that cut one slave face and its parent: two rules, and the tables that fix the order of the children.

The **cone**: a point c at the centre of the slave face, joined to every other facet of the parent. The **ring**: an
inner polygon on the face (at `ring` of the half-width) carried to `depth` inside the parent; for QUAD4 in 2D, HEXA8 and
HEXA20. A face that owns an internal dof already (SEG3, TRIA7, QUAD9) is left **whole**, and its parent with it.
A quadratic cell is cut like its linear cell; each new mid-node lies halfway, in the parent's reference element, between
the two ends of its edge, so that the parent's map gives its position. Positions, counts and the order of the children
are those of code_aster's DECOUPE_LAC (R5.03.55, 3.1), for the cells that it supports.

A template lists children in a *frame* of nodes: first the cell's own, then the points on the face (in the order of
`face_pattern`, for a face that starts at the facet's first corner and has its winding), then the points inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS, Cell, Nodes, Point
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient, shape

WHOLE, CONE, RING = "whole", "cone", "ring"
#: faces that own an internal dof as they are: the node that carries it
WHOLE_FACES = {"SEG3": 2, "TRIA7": 6, "QUAD9": 8}
#: parents that the ring can cut
RING_PARENTS = ("QUAD4", "HEXA8", "HEXA20")

FAR = -1
#: (parent, corners of the slave face): its other facets in the order of the children; k stands for the facet on the
#: face's edge k (from corner k to k + 1), FAR for the one that shares no edge with the face
CONE_ORDER: dict[tuple[str, int], Nodes] = {
    ("TETRA4", 3): (0, 1, 2),
    ("TETRA", 3): (0, 2, 1),
    ("HEXA", 4): (0, 1, 2, 3, FAR),
    ("PENTA", 3): (2, 0, 1, FAR),
    ("PENTA", 4): (1, 3, 2, 0),
    ("PYRAM", 4): (3, 2, 1, 0),
    ("PYRAM", 3): (0, 1, FAR, 2),
}
#: the ring's children around the face: edges in this order, then the frustum behind, then the plug under the centre
RING_ORDER: Nodes = (1, 2, 3, 0)


@dataclass(frozen=True)
class Children:
    """Children of one type: `nodes` (n, n_nodes of the type), indices in the frame; `rank` (n,) among all children."""

    type: str
    nodes: NDArray[np.intp]
    rank: NDArray[np.intp]


@dataclass(frozen=True)
class Template:
    """The children of a cell. `on_face`, `inside`: the new nodes, as points of the cell's reference element."""

    children: tuple[Children, ...]
    on_face: NDArray[np.floating]
    inside: NDArray[np.floating]

    @property
    def n_children(self) -> int:
        """Number of children of all types."""
        return sum(len(c.rank) for c in self.children)


@cache
def face_pattern(face: str, kind: str, ring: float = 1 / 3) -> Template:
    """Return the cut of a skin face of type `face`, in its own node order: the ring's sides first, the centre last."""
    cell = CELLS[face]
    points = [tuple(p) for p in cell.reference[: cell.n_corners]]
    n = cell.n_corners
    sides: list[Nodes]
    if kind == WHOLE:
        return _template(cell, [tuple(range(n))], points)
    if kind == CONE:
        points.append(tuple(np.mean(points, axis=0)))
        sides = [(k, (k + 1) % n, n) for k in range(n)] if cell.dim == 2 else [(0, 2), (2, 1)]
    else:
        points += [tuple(ring * x for x in p) for p in points]
        if cell.dim == 1:
            sides = [(0, 2), (2, 3), (3, 1)]
        else:
            sides = [(k, (k + 1) % n, n + (k + 1) % n, n + k) for k in range(n)]
            sides.append(tuple(range(n, 2 * n)))
    return _template(cell, sides, points)


@cache
def parent_pattern(parent: str, facet: int, kind: str, ring: float = 1 / 3, depth: float = 1 / 2) -> Template:
    """Return the cut of a cell of type `parent` whose slave face is its facet number `facet`."""
    cell = CELLS[parent]
    if kind == WHOLE:
        return _template(cell, [tuple(range(cell.n_corners))], list(cell.reference[: cell.n_corners]))
    X = face_pattern(cell.facets[facet].type, kind, ring).on_face
    return _cone(cell, facet, X) if kind == CONE else _ring(cell, facet, X, depth)


def _on_facet(cell: Cell, facet: int, X: NDArray, corners: Nodes | None = None) -> NDArray:
    """Map points X from a facet's reference element to the cell's.

    `corners`: those of another facet, listed to match this one's, to which the points are mapped instead.
    """
    flat = CELLS[cell.facets[facet].type].linear
    return shape(flat, X) @ np.array([cell.reference[c] for c in corners or cell.facets[facet].corners])


def _cone(cell: Cell, facet: int, X: NDArray) -> Template:
    on_face = _on_facet(cell, facet, X)
    points = [*cell.reference[: cell.n_corners], tuple(on_face[0])]
    apex = cell.n_corners
    children = []
    for other in _other_facets(cell, facet):
        side = cell.facets[other].corners
        # outward for the parent is outward for the child: base against the apex
        children.append((*side, apex) if cell.dim == 2 else (side[0], *side[:0:-1], apex))
    return _template(cell, children, points, on_face)


def _other_facets(cell: Cell, facet: int) -> list[int]:
    """The other facets, in the order of the children."""
    corners = cell.facets[facet].corners
    n = len(cell.facets)
    if cell.dim == 2:
        return [(facet - k) % n for k in range(1, n)]
    order = CONE_ORDER.get((cell.name, len(corners))) or CONE_ORDER[cell.family, len(corners)]
    edges = [{corners[k], corners[(k + 1) % len(corners)]} for k in range(len(corners))]
    at_edge = {}  # edge of the face, or FAR -> the facet there
    for j in (j for j in range(n) if j != facet):
        shared = set(cell.facets[j].corners) & set(corners)
        at_edge[edges.index(shared) if len(shared) == 2 else FAR] = j
    return [at_edge[k] for k in order]


def _ring(cell: Cell, facet: int, X: NDArray, depth: float) -> Template:
    f = cell.facets[facet].corners
    behind = {c: b for e in cell.edges for c, b in (e, e[::-1]) if c in f and b not in f}
    g = tuple(behind[c] for c in f)
    n, first = len(f), cell.n_corners
    on_face, opposite = _on_facet(cell, facet, X), _on_facet(cell, facet, X, g)
    inner_points = on_face + depth * (opposite - on_face)
    points = [*cell.reference[:first], *(tuple(p) for p in (*on_face[:n], *inner_points[:n]))]
    ring, inner = range(first, first + n), range(first + n, first + 2 * n)
    if cell.dim == 2:
        (v1, v2), (v4, v3), (n1, n2), (m1, m2) = f, g, ring, inner
        children: list[Nodes] = [(v1, n1, m1, v4), (n1, n2, m2, m1), (n2, v2, v3, m2), (v3, v4, m1, m2)]
    else:
        children = []
        for i in RING_ORDER:
            j = (i + 1) % n
            children.append((ring[i], ring[j], f[j], f[i], inner[i], inner[j], g[j], g[i]))
        children.append((*inner[::-1], *g[::-1]))
        children.append((*ring[::-1], *inner[::-1]))
    return _template(cell, children, points, on_face)


def _template(cell: Cell, children: Sequence[Nodes], points: list[Point], on_face: NDArray | None = None) -> Template:
    """Make the template of children given by corners among `points`: the cell's corners, points on the face, the rest.

    The other nodes of quadratic children are found by their position: nodes of the cell, points of the face, or new.
    """
    own = [tuple(p) for p in cell.reference]
    # a face's own pattern has all its new points on it
    of_face = points[cell.n_corners :] if on_face is None else [tuple(p) for p in on_face]
    listed: list[tuple[str, list[Point]]] = []  # type of each child, of the order of its parent, and its nodes' places
    for corners in ([points[c] for c in child] for child in children):
        kind = _LINEAR[cell.dim, len(corners)]
        if cell.order == 1:
            listed.append((kind, corners))
        else:
            kind = _quadratic(cell, CELLS[kind].family, corners)
            on_corners = ([corners[c] for c in on] for on in CELLS[kind].corners_of_node)
            listed.append((kind, [tuple(np.mean(some, axis=0)) for some in on_corners]))
    every = [*own, *of_face, *(p for _, places in listed for p in places)]
    keys = [tuple(round(x, 9) + 0.0 for x in p) for p in every]
    frame = {key: k for k, key in enumerate(dict.fromkeys(keys))}
    place = iter([frame[key] for key in keys[len(own) + len(of_face) :]])
    by_type: dict[str, list[tuple[int, Nodes]]] = {}
    for rank, (kind, places) in enumerate(listed):
        by_type.setdefault(kind, []).append((rank, tuple(islice(place, len(places)))))
    blocks = tuple(
        Children(kind, np.array([nodes for _, nodes in rows]), np.array([rank for rank, _ in rows]))
        for kind, rows in by_type.items()
    )
    first = [keys.index(key) for key in frame]
    new = np.array([every[k] for k in first[len(own) :]], float).reshape(-1, cell.dim)
    split = len(new) if on_face is None else len(on_face)
    return Template(blocks, new[:split], new[split:])


#: (dimension, corners) -> linear type
_LINEAR = {(c.dim, c.n_corners): c.name for c in CELLS.values() if c.order == 1}


def _quadratic(cell: Cell, family: str, corners: list[Point]) -> str:
    """Quadratic type of a child; it keeps the centre node of a face that it takes over whole (PENTA18 -> PYRAM14)."""
    if (
        cell.family == family
        and len(corners) == cell.n_corners
        and np.allclose(corners, cell.reference[: len(corners)])
    ):
        return cell.name
    if family == "PYRAM":
        base = np.mean(corners[:4], axis=0)
        centres = [cell.reference[f.nodes[8]] for f in cell.facets if f.type == "QUAD9"]
        return "PYRAM14" if any(np.allclose(base, c) for c in centres) else "PYRAM13"
    return {"SEG": "SEG3", "TRIA": "TRIA6", "QUAD": "QUAD8", "TETRA": "TETRA10", "HEXA": "HEXA20"}[family]


@cache
def listings(face: str, kind: str, ring: float = 1 / 3) -> NDArray[np.intp]:
    """(2 n_corners, n_points): permutations of the points of a face's pattern for every other listing of its nodes.

    Row 2 s + r is for a listing that starts at this face's corner s with the same (r = 0) or the opposite winding
    (r = 1): point k of that listing's pattern is point `listings[2 s + r, k]` of this face's.
    """
    cell = CELLS[face]
    flat = CELLS[cell.linear]
    X = face_pattern(face, kind, ring).on_face
    n = cell.n_corners
    if not len(X):
        return np.zeros((2 * n, 0), dtype=np.intp)
    rows = []
    for s in range(n):
        for step in (1, -1):
            listed = np.array([flat.reference[(s + step * k) % n] for k in range(n)])
            there = shape(flat.name, X) @ listed
            rows.append(np.linalg.norm(there[:, None] - X[None], axis=2).argmin(axis=1))
    return np.array(rows, dtype=np.intp).reshape(2 * n, len(X))


@cache
def internal_points(face: str, kind: str, ring: float = 1 / 3) -> NDArray[np.intp]:
    """Points of a face's pattern that carry an internal dof: their function has a positive integral over the face.

    The integral of a corner's function is zero on a TRIA6 and negative on a QUAD8: there the mid-nodes carry the dof.
    """
    template = face_pattern(face, kind, ring)
    cell = CELLS[face]
    places = np.vstack([np.array(cell.reference), template.on_face])
    total = np.zeros(len(places))
    for block in template.children:
        X, w = rule(CELLS[block.type].family, 6)
        N, dN = shape(block.type, X), gradient(block.type, X)
        for nodes in block.nodes:
            J = np.einsum("ns,pnd->psd", places[nodes], dN)
            np.add.at(total, nodes, N.T @ (w * np.abs(np.linalg.det(J))))
    return np.flatnonzero(total[cell.n_nodes :] > 1e-9)
