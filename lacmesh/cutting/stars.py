"""Macro-elements of whole faces, without a cut: stars around nodes.

    carriers = nodes off the rim whose function has a positive integral over their star, the faces that hold them
    seeds    = as many carriers as possible, no two of them on one face         (`_choose`, `_swap`)
    macros   = the stars of the seeds; every face left over joins the neighbour that stays smallest    (`_join`)

A seed's function vanishes outside its star, so that each macro-element owns a dof of its own, on any mesh and without a
new node. The rim of the skin, creases, borders of zones and fixed nodes carry nothing. Carriers follow from integrals
on the real geometry: corners of SEG2, TRIA3 and QUAD4, mid-nodes of TRIA6 and QUAD8, whose stars are pairs of faces.
Faces that own a dof as they are (SEG3, TRIA7, QUAD9) are macro-elements as they are.

The largest independent set is sought as by Andrade, Resende and Werneck (Journal of Heuristics 18, 2012): in the order
of the fewest free neighbours, then by swaps of one seed for two. Nodes and faces are taken by their place, so that the
partition does not depend on how they are numbered.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import WHOLE_FACES
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints, Mesh, codes, mask_of, places_of
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacmesh.topology.bodies import label_components
from lacmesh.topology.orientation import face_normals
from lacmesh.topology.skin import (
    FACE_TYPES,
    MAX_CORNERS,
    MAX_NODES,
    N_CORNERS,
    N_NODES,
    TYPE_CODE,
    Faces,
    edge_uses,
    mid_nodes,
)

Array = NDArray[Any]
#: least integral of a carrier's function, as a part of its star's area
LEAST = 0.05
#: grid on which places are compared, as a part of the skin's size: what is equal but for rounding is in one cell
_GRID = 1e-6
_DEGREE = 6
#: in place of a cost: the face is in a star
_STAR = -(2**62)
#: by the codes of face types: True for those that own a dof as they are, and the node that carries it
WHOLE = np.array([name in WHOLE_FACES for name in FACE_TYPES])
_CENTRE = np.array([WHOLE_FACES.get(name, 0) for name in FACE_TYPES])


class Stars(NamedTuple):
    """`macro` (f,): the macro-element of each face, -1 for faces that no star reaches; `carrier` (m,): their nodes."""

    macro: Ints
    carrier: Ints


class _Skin(NamedTuple):
    """Faces as a graph: `across` (f, 4): neighbours across edges that are no rim, else -1; `length` (f, 4) of these.

    `size` (f,): area or length; `value` (f, 9): integral of each node's function over the face; `rim`: nodes on rims.
    """

    across: Ints
    length: Floats
    size: Floats
    value: Floats
    rim: Ints


def whole_faces(faces: Faces) -> Stars:
    """Return the macro-elements that faces are as they stand: SEG3, TRIA7 and QUAD9."""
    whole = WHOLE[faces.type]
    centre = faces.nodes[whole, _CENTRE[faces.type[whole]]]
    return Stars(np.where(whole, np.cumsum(whole) - 1, -1), centre)


def find_stars(
    mesh: Mesh, faces: Faces, zone: Ints, crease_angle: float = 40.0, fixed: Ints | None = None, *,
    pairs: bool = False, join: bool = False,
) -> Stars:  # fmt: skip
    """Join slave faces, each once, to macro-elements of one `zone` (f,), which bend at edges by `crease_angle` at most.

    `fixed`: nodes whose displacement is given, which carry nothing. `pairs`: QUAD8 are joined in pairs; else in no
    star, as one pressure for two of them costs the displacement its order. `join`: faces that no star reaches join
    others across creases.
    """
    x = np.where((faces.corners >= 0)[..., None], mesh.points[faces.corners], 0.0)
    order = _by_place(x.sum(axis=1) / N_CORNERS[faces.type][:, None])
    faces, zone = faces.take(order), zone[order]
    skin = _skin(mesh, faces, zone, crease_angle)
    whole = whole_faces(faces)
    out = (whole.macro >= 0) | ((faces.type == TYPE_CODE["QUAD8"]) & (not pairs))
    bare = mask_of(mesh.n_nodes, skin.rim, *([] if fixed is None else [fixed]))
    inside = faces.nodes >= 0
    integral = np.bincount(faces.nodes[inside], skin.value[inside], mesh.n_nodes)
    carriers = _carriers(mesh, faces, skin, integral, bare, out)
    carrier = np.concatenate([_seeds(*carriers, skin.across), whole.carrier])
    macro = np.where(inside, places_of(carrier, mesh.n_nodes)[faces.nodes], -1).max(axis=1)
    for graph in (skin, _skin(mesh, faces, zone, 180.0)) if join else (skin,):
        total = np.bincount(macro[macro >= 0], skin.size[macro >= 0], len(carrier))
        _join(graph.across, graph.length, skin.size, ~out, macro, total, integral[carrier])
    return Stars(macro[np.argsort(order)], carrier)


def _by_place(x: Floats) -> Ints:
    """Return the order of some places x (n, 3) along the axes, where those in one cell of a fine grid are alike."""
    low, high = x.min(axis=0, initial=np.inf), x.max(axis=0, initial=-np.inf)
    step = max(float((high - low).max()), np.finfo(float).tiny) * _GRID
    return np.lexsort(np.round((x - low) / step).T)


# ---- the skin


def _skin(mesh: Mesh, faces: Faces, zone: Ints, crease_angle: float) -> _Skin:
    """Return the graph of the faces. An edge is a rim with one face or more than two, between zones, at a crease."""
    uses = edge_uses(faces)
    a, b = uses.pairs
    f, g = uses.face[a], uses.face[b]
    normal = face_normals(mesh, faces)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    along = (normal[f] * normal[g]).sum(axis=1) * np.where(uses.forward[a] != uses.forward[b], 1, -1)
    smooth = (along > np.cos(np.radians(crease_angle))) & (zone[f] == zone[g])
    a, b = a[smooth], b[smooth]
    across, length = np.full((len(faces), MAX_CORNERS), -1), np.zeros((len(faces), MAX_CORNERS))
    start, stop = uses.start[a], uses.stop[a]
    edge = np.where(stop < 0, 0.0, np.linalg.norm(mesh.points[start] - mesh.points[stop], axis=1))
    for one, other in ((a, b), (b, a)):
        across[uses.face[one], uses.place[one]] = uses.face[other]
        length[uses.face[one], uses.place[one]] = edge
    rim = np.ones(len(uses.edge), bool)
    rim[a] = rim[b] = False
    nodes = np.concatenate([uses.start[rim], uses.stop[rim], mid_nodes(faces, uses.face[rim], uses.place[rim])])
    value = node_integrals(mesh.points, faces)
    return _Skin(across, length, value.sum(axis=1), value, np.unique(nodes[nodes >= 0]))


def node_integrals(points: Floats, faces: Faces) -> Floats:
    """(f, 9): the integral of each node's function over each face, on the real geometry; 0 for padding."""
    value = np.zeros((len(faces), MAX_NODES))
    for code in codes(faces.type):
        rows = np.flatnonzero(faces.type == code)
        kind, n = FACE_TYPES[code], N_NODES[code]
        X, w = rule(CELLS[kind].family, _DEGREE)
        J = jacobian(kind, points[faces.nodes[rows, :n]], X)
        size = np.linalg.norm(np.cross(J[..., 0], J[..., 1]) if CELLS[kind].dim == 2 else J[..., 0], axis=-1)
        value[rows, :n] = (size * w) @ shape(kind, X)
    return value


# ---- carriers and seeds


def _carriers(
    mesh: Mesh, faces: Faces, skin: _Skin, integral: Array, fixed: NDArray[np.bool_], out: NDArray[np.bool_]
) -> tuple[Ints, Ints]:
    """Return the nodes (c,) that can carry a dof of their star, by place; (f, 9): the carriers on faces, or -1."""
    face, k = np.nonzero(faces.nodes >= 0)
    node = faces.nodes[face, k]
    size = np.bincount(node, skin.size[face], mesh.n_nodes)
    good = (integral >= LEAST * size) & (size > 0) & _connected(faces, skin.across, mesh.n_nodes)
    good[fixed] = False
    good[node[out[face]]] = False
    node = np.flatnonzero(good)
    if len(node):
        node = node[_by_place(mesh.points[node])]
    on = places_of(node, mesh.n_nodes)[faces.nodes]
    on[faces.nodes < 0] = -1
    return node, on


def _connected(faces: Faces, across: Ints, n_nodes: int) -> NDArray[np.bool_]:
    """(n_nodes,): True for nodes whose faces are joined across edges at the node."""
    inside = faces.nodes >= 0
    entry, node = np.cumsum(inside).reshape(inside.shape) - 1, faces.nodes[inside]
    f, place = np.nonzero(across > np.arange(len(faces))[:, None])
    g = across[f, place]
    pair, i, j = np.nonzero((faces.nodes[f, :, None] == faces.nodes[g, None]) & inside[f, :, None])
    part = label_components(entry[f[pair], i], entry[g[pair], j], len(node))
    return np.bincount(node[np.unique(part, return_index=True)[1]], minlength=n_nodes) == 1


def _seeds(node: Ints, on: Ints, across: Ints) -> Ints:
    """Return the nodes of a set of carriers, no two on one face, that is as large as two orders and swaps find."""
    if not len(node):
        return node
    face, k = np.nonzero(on >= 0)
    order = np.argsort(on[face, k], kind="stable")
    star = face[order]
    star_start = np.searchsorted(on[face, k][order], np.arange(len(node) + 1))
    on = np.compress((on >= 0).any(axis=0), on, axis=1)  # corners or mid-nodes, not both, for most skins
    a, b = np.repeat(on, on.shape[1], axis=1), np.tile(on, on.shape[1])
    pair = (a >= 0) & (b >= 0) & (a != b)
    key = np.unique(a[pair] * np.int64(len(node)) + b[pair])
    beside, start = key % len(node), np.searchsorted(key // len(node), np.arange(len(node) + 1))
    sets = [_choose(start, beside, star_start, star, on, across, front) for front in (False, True)]
    for chosen in sets:
        _swap(start, beside, chosen)
    return node[max(sets, key=np.count_nonzero)]


@kernel
def _choose(
    start: Array, beside: Array, star_start: Array, star: Array, on: Array, across: Array, front: bool
) -> Array:
    """(c,) True for a maximal set of carriers, none `beside` another; rows of `start` for each.

    Next is the carrier with the fewest free ones beside it, or, in a `front`, with the most faces beside its star that
    are in stars or at the rim; then by the other of the two, the size of the star, and the place.
    """
    n = len(start) - 1
    chosen, closed, taken = np.zeros(n, np.bool_), np.zeros(n, np.bool_), np.zeros(len(on), np.bool_)
    free, size, touch = start[1:] - start[:-1], star_start[1:] - star_start[:-1], np.zeros(n, np.int64)
    a, b = (touch, free) if front else (free, touch)  # the order of the heap; an entry is out of date if they changed
    heap = [(a[c], b[c], size[c], np.int64(c)) for c in range(n)]
    heapify(heap)
    while len(heap) > 0:
        first, second, _, c = heappop(heap)
        if closed[c] or a[c] != first or b[c] != second:
            continue
        chosen[c] = closed[c] = True
        for other in beside[start[c] : start[c + 1]]:
            if closed[other]:
                continue
            closed[other] = True
            for d in beside[start[other] : start[other + 1]]:
                if not closed[d]:
                    free[d] -= 1
                    heappush(heap, (a[d], b[d], size[d], d))
        faces = star[star_start[c] : star_start[c + 1]]
        taken[faces] = True
        for f in faces:
            for g in across[f]:
                if g < 0 or taken[g]:
                    continue
                for d in on[g]:
                    if d >= 0 and not closed[d]:
                        touch[d] -= 1
                        heappush(heap, (a[d], b[d], size[d], d))
    return chosen


@kernel
def _swap(start: Array, beside: Array, chosen: Array) -> None:
    """Take two carriers in place of one wherever that is possible, and every carrier that becomes free."""
    around = np.zeros(len(chosen), np.int64)  # number of chosen carriers beside each
    for own in np.flatnonzero(chosen):
        around[beside[start[own] : start[own + 1]]] += 1
    again = True
    while again:
        again = False
        for c in range(len(chosen)):
            if not chosen[c]:
                continue
            near = beside[start[c] : start[c + 1]]
            single = near[around[near] == 1]
            a, b = _apart(start, beside, single)
            if a < 0:
                continue
            again, chosen[c] = True, False
            around[near] -= 1
            for d in np.concatenate((np.array([a, b]), single)):
                if around[d] == 0 and not chosen[d]:
                    chosen[d] = True
                    around[beside[start[d] : start[d + 1]]] += 1


@kernel
def _apart(start: Array, beside: Array, some: Array) -> tuple[int, int]:
    """Return the first two of `some` carriers, in ascending order, that are not beside one another, or -1 twice."""
    for a in some:
        near = beside[start[a] : start[a + 1]]
        for b in some:
            if b > a and not (near == b).any():
                return a, b
    return -1, -1


# ---- faces left over


@kernel
def _join(across: Array, length: Array, size: Array, free: Array, macro: Array, total: Array, integral: Array) -> None:
    """Join `free` faces to macro-elements beside them, where that costs least; `macro` (f,) and `total` are changed.

    `total` (m,): sizes of the macro-elements; `integral` (m,): of their carriers' functions.
    """
    heap: Any = [(np.int64(_STAR), np.int64(f), np.int64(macro[f])) for f in np.flatnonzero(macro >= 0)]
    while len(heap) > 0:
        cost, f, m = heappop(heap)
        if cost != _STAR:
            if macro[f] >= 0:
                continue
            now = _cost(across, length, size, macro, total, integral, f, m)
            if now != cost:
                heappush(heap, (now, f, m))
                continue
            macro[f] = m
            total[m] += size[f]
        for g in across[f]:
            if g >= 0 and free[g] and macro[g] < 0:
                heappush(heap, (_cost(across, length, size, macro, total, integral, g, m), np.int64(g), m))


@kernel
def _cost(
    across: Array, length: Array, size: Array, macro: Array, total: Array, integral: Array, f: Any, m: Any
) -> int:
    """Cost of face f in macro-element m, less for a long common edge: its area by the inverse of its carrier's part.

    As a logarithm in millionths, so that costs are equal where they are but for rounding.
    """
    shared = 0.0
    for k in range(4):
        if across[f, k] >= 0 and macro[across[f, k]] == m:
            shared += length[f, k]
    area = total[m] + size[f]
    return int(np.round(1e6 * np.log(area * area / integral[m] / (1 + shared / (4 * np.sqrt(size[f]))))))
