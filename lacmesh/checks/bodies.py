"""Checks of positions: number of bodies, torn bodies, coincident nodes, hanging nodes, skins that cross themselves.

Self-intersections and overlaps of a skin are those of triangles in space, of segments in the plane. Faces are split
into flat pieces that share their nodes with the pieces of neighbouring faces (a quadratic face is split at its
mid-nodes), so that the test follows a curved skin. Two pieces whose boxes intersect cross when an edge of one, or its
centre, enters the interior of the other. Along an edge the distance to the other's plane and the barycentric
coordinates in it are linear, so that each condition holds on an interval: the pieces cross if all intervals intersect.
Pieces that share nodes need no special treatment: their common corner or edge is on the boundary of both, not inside.
Pieces that touch only at their boundaries do not cross. Distances below EPSILON of a piece's size count as zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from lacmesh.cells import PIECES
from lacmesh.checks.findings import Place, rule
from lacmesh.checks.request import PLACE, SHOWN, Bools, CheckedSkin, Request
from lacmesh.errors import counted, listed
from lacmesh.mesh import Floats, Ints, mask_of
from lacmesh.topology.bodies import label_components
from lacmesh.topology.boxes import meeting, meeting_each_other
from lacmesh.topology.skin import FACE_TYPES, Faces, boundary_edges, distinct_edges, label_rows

#: pairs of pieces that are compared at once
_PIECE = 1 << 15
#: a node is inside an edge when its distance to it is below this part of the edge's length
ON_EDGE = 1e-6
#: distances to a plane below this part of a piece's size are zero
EPSILON = 1e-9
#: a point is inside a piece when its barycentric coordinates are above this
INSIDE = 1e-7


@rule("bodies", "info", "nothing, if this is the expected number")
def bodies(request: Request) -> Iterator[Place | dict[str, Any]]:
    """Number of separate bodies."""
    count, of_sides = request.n_bodies, {}
    if count:  # the bodies on which each skin lies, of skins that have faces
        of_node = {side.what: request.bodies[side.nodes] for side in request.sides if len(side)}
        of_sides = {what: np.unique(of[of >= 0]) for what, of in of_node.items()}
    yield {"bodies": count} | {f"bodies_of_{what}": len(which) for what, which in of_sides.items()}
    if count:
        message = f"the cells make {counted(count, 'body', 'separate bodies')}"
        message += f" ({_named(request, np.arange(count))})" if count > 1 else ""
        if len(of_sides) == 2 and all(map(len, of_sides.values())):
            common = np.intersect1d(of_sides["slave"], of_sides["master"])
            same = f"the same body{f', {_named(request, common)}' if count > 1 else ''}"
            message += f"; slave and master are on {same if len(common) else 'different ones'}"
        yield Place(message)


def _boundary(request: Request) -> tuple[Ints, Ints]:
    """The corners (k, 4) of the boundary facets, and their nodes with finite coordinates."""
    corners = request.facets.corners(*request.facets.boundary)
    nodes = np.unique(corners[corners >= 0])
    return corners, nodes[request.finite[nodes]]


def _named(request: Request, bodies: Ints) -> str:
    """Return the names of some bodies, the first few of many."""
    names = [request.body_names[body] for body in bodies[:SHOWN].tolist()]
    more = [f"{len(bodies) - SHOWN:,} more"] if len(bodies) > SHOWN else []
    return listed([*names, *more], "and")


def _on_sides(request: Request, a: Ints, b: Ints) -> Bools:
    """True for pairs of nodes (or of a node and an edge) that contact explains: one on the slave, one on the master.

    Pairs of two bodies are also explained where one of the two is on either skin.
    """
    on = _sides_of(request)
    apart = request.bodies[a] != request.bodies[b]
    either = apart & (on[:, a] | on[:, b]).any(axis=0)
    # without a known master, whatever touches the slave may be it
    return either if request.master is None else either | (on[0, a] & on[1, b]) | (on[1, a] & on[0, b])


def _sides_of(request: Request) -> Bools:
    """(2, n_nodes): True for nodes of the slave, and of the master."""
    on = np.zeros((2, request.mesh.n_nodes), bool)
    for k, side in enumerate(request.sides):
        on[k, side.nodes] = True
    return on


@rule("coincident-nodes", "warning", "merge the nodes, unless the mesh is meant to be open there")
def coincident_nodes(request: Request) -> Iterator[Place]:
    """Two nodes have the same coordinates, and not because slave and master touch there: the body is torn, or there is
    a crack or another contact.
    """
    corners, nodes = request.once(_boundary)
    place = same_place(request.mesh.points[nodes], PLACE * _edge_length(request, corners, nodes))
    shared = np.bincount(place, minlength=len(nodes))[place] > 1
    nodes, place = nodes[shared], place[shared]
    again, torn = _unexplained(request, nodes, place)
    if again.any():
        what = "the body is torn there, or has a crack" if torn.any() else "the bodies are not joined there"
        message = f"{np.count_nonzero(again):,} nodes coincide at {counted(len(np.unique(place[again])), 'point')} "
        message += f"({request.node_numbers(nodes[again])}): {what}"
        yield Place(message, nodes=nodes[again], advice="merge the nodes if this is not intended")


def _unexplained(request: Request, nodes: Ints, place: Ints) -> tuple[Bools, Bools]:
    """(k,) each: nodes in an unexplained coincidence with any other node; those in one with a node of the same body.

    A pair of nodes is explained if one is on the slave and one on the master, or if they belong to two bodies and one
    is on a skin (`_on_sides`). Nodes are counted place by place: thousands at one place would make millions of pairs.
    """
    slave, master = _sides_of(request)[:, nodes]
    off = ~(slave | master)
    body = np.unique(np.column_stack([place, request.bodies[nodes]]), axis=0, return_inverse=True)[1].ravel()
    kinds = off, slave & ~master, master & ~slave
    n_off, n_slave, n_master = (np.bincount(body, kind)[body] for kind in kinds)
    members = np.bincount(body)[body]
    torn = np.where(off, members > 1, n_off > 0)
    torn |= (kinds[1] & (n_slave > 1)) | (kinds[2] & (n_master > 1))
    return torn | (off & (np.bincount(place, off)[place] > 1)), torn


def _edge_length(request: Request, corners: Ints, nodes: Ints) -> float:
    """Median over the boundary nodes of the shortest edge at a node, so that a few stray nodes do not affect it."""
    a, b = distinct_edges(corners)[0].T
    length = np.linalg.norm(request.mesh.points[a] - request.mesh.points[b], axis=1)
    good = request.finite[a] & request.finite[b] & (length > 0)
    shortest = np.full(request.mesh.n_nodes, np.inf)
    for end in (a, b):
        np.minimum.at(shortest, end[good], length[good])
    lengths = shortest[nodes]
    lengths = lengths[np.isfinite(lengths)]
    return float(np.median(lengths)) if len(lengths) else 0.0


def same_place(x: Floats, room: float) -> Ints:
    """(n,): labels of places, the same for points (n, 3) that lie within `room` of each other along each axis."""
    from scipy.spatial import cKDTree

    label, count = label_rows((x + 0.0).view(np.int64))  # 0.0 is -0.0
    points = x[np.unique(label, return_index=True)[1]]
    near = cKDTree(points).query_pairs(room, p=np.inf, output_type="ndarray").T if room > 0 else np.empty((2, 0), int)
    return label_components(near[0], near[1], count)[label]


@rule("torn-body", "warning", "mesh both sides conformingly, or tie them in the solver")
def torn_bodies(request: Request) -> Iterator[Place]:
    """A node lies inside an edge of the boundary of the body that it belongs to: the cells do not conform."""
    corners, nodes = request.once(_boundary)
    a, b = distinct_edges(corners)[0].T
    node, edge = inside_edges(request, nodes, a, b)
    inside = (request.bodies[node] == request.bodies[a[edge]]) & ~_on_sides(request, node, a[edge])
    hanging = mask_of(request.mesh.n_nodes, *(request.once(_hanging, side) for side in request.sides))
    node = np.unique(node[inside & ~hanging[node]])  # hanging nodes are an error of their own
    if len(node):
        message = counted(len(node), "node lies inside an edge", "nodes lie inside edges")
        owner = _named(request, np.unique(request.bodies[node])) if request.bodies.max() else "the body"
        message += f" of their own body, {owner} ({request.node_numbers(node)}): its cells do not conform there"
        yield Place(message, nodes=node)


def inside_edges(request: Request, nodes: Ints, a: Ints, b: Ints) -> tuple[Ints, Ints]:
    """(node, edge): pairs of a node of the list and a straight edge a b that contains it, away from the edge's ends."""
    x, y = request.mesh.points[a], request.mesh.points[b]
    length = np.linalg.norm(y - x, axis=1)
    good = np.flatnonzero(request.finite[a] & request.finite[b] & (length > 0))
    room = (ON_EDGE * length[good])[:, None]
    low, high = np.minimum(x, y)[good] - room, np.maximum(x, y)[good] + room
    place = same_place(request.mesh.points[nodes], 0.0)
    order = np.argsort(place, kind="stable")  # the nodes of a place, of which one is asked for all
    size = np.bincount(place)
    start = np.cumsum(size) - size
    at = request.mesh.points[nodes[order[start]]]
    edge, point = meeting(low, high, at, at)
    edge = good[edge]
    along = (y - x)[edge] / length[edge][:, None]
    off = at[point] - x[edge]
    far = (off * along).sum(axis=1)
    apart = np.linalg.norm(off - far[:, None] * along, axis=1)
    tol = ON_EDGE * length[edge]
    keep = (apart <= tol) & (far > tol) & (far < length[edge] - tol)
    edge, point = edge[keep], point[keep]
    hit = np.repeat(np.arange(len(point)), size[point])
    nth = np.arange(len(hit)) - np.repeat(np.cumsum(size[point]) - size[point], size[point])
    return nodes[order[start[point[hit]] + nth]], edge[hit]


def _hanging(request: Request, side: CheckedSkin) -> Ints:
    """Corners of a skin that lie inside an edge on the boundary of the same skin, on the same body."""
    if request.dim != 2 or not len(side):
        return np.empty(0, np.int64)
    corners = side.faces.corners
    a, b, _ = boundary_edges(side.faces).T
    nodes = np.unique(corners[corners >= 0])
    node, edge = inside_edges(request, nodes[request.finite[nodes]], a, b)
    return np.unique(node[request.bodies[node] == request.bodies[a[edge]]])


@rule("hanging-node", "error", "mesh the surface conformingly", "skin of pair")
def hanging_nodes(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A node of a surface lies inside an edge of another of its faces: the surface does not conform."""
    noun, text = f"node of the {side.what} skin", "inside edges of its other faces"
    yield from request.places(request.once(_hanging, side), "lies|lie", text, side, noun=noun)


@rule("self-intersection", "error", "repair the geometry there", "skin of pair")
def self_intersections(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """Faces of one surface cross or overlap."""
    if request.dim == 1 and request.mesh.space_dim == 3:  # lines in space hardly ever meet
        return
    nodes = side.faces.nodes
    good = np.flatnonzero((request.finite[nodes] | (nodes < 0)).all(axis=1))
    pairs = crossing(request.mesh.points, side.faces.take(good))
    if len(pairs):
        cells = side.cells[good[np.unique(pairs)]]
        one, many = f"pair of {side.what} faces crosses or overlaps", f"pairs of {side.what} faces cross or overlap"
        yield Place(f"{counted(len(pairs), one, many)} ({request.numbers(cells)})", cells)


# ---- faces that cross


def crossing(points: Floats, faces: Faces) -> Ints:
    """(k, 2): pairs of faces i < j that cross or overlap; points (n, 3), in the plane z = 0 for segments."""
    nodes, face = pieces_of(faces)
    x = points[nodes]
    low, high = x.min(axis=1, initial=np.inf), x.max(axis=1, initial=-np.inf)
    room = 1e-6 * (high - low) + EPSILON * (high - low).max(axis=1, keepdims=True)
    i, j = meeting_each_other(low - room, high + room)
    hit = np.zeros(len(i), bool)
    for start in range(0, len(i), _PIECE):
        rows = slice(start, start + _PIECE)
        hit[rows] = _reaches(x[i[rows]], x[j[rows]]) | _reaches(x[j[rows]], x[i[rows]])
    hit &= face[i] != face[j]
    return np.unique(np.sort(np.column_stack([face[i[hit]], face[j[hit]]]), axis=1), axis=0)


def pieces_of(faces: Faces) -> tuple[Ints, Ints]:
    """(nodes (p, 2 or 3), face (p,)): the flat pieces of faces of one dimension, face by face."""
    parts, owner = [], []
    for code in np.unique(faces.type):
        rows = np.flatnonzero(faces.type == code)
        places = np.array(PIECES[FACE_TYPES[code]])
        parts.append(faces.nodes[rows][:, places].reshape(-1, places.shape[1]))
        owner.append(np.repeat(rows, len(places)))
    if not parts:
        return np.empty((0, 3), np.int64), np.empty(0, np.int64)
    nodes, face = np.concatenate(parts), np.concatenate(owner)
    order = np.argsort(face, kind="stable")
    return nodes[order], face[order]


def _reaches(x: Floats, other: Floats) -> Bools:
    """(k,): True if an edge of a piece x (k, m, 3), or its centre, enters the other piece (k, m, 3)."""
    m = x.shape[1]
    a, b = other[:, 1] - other[:, 0], other[:, -1] - other[:, 0]
    normal = np.cross(a, b if m == 3 else np.array([0.0, 0.0, 1.0]))
    square = (normal * normal).sum(axis=1)
    size = np.sqrt(np.maximum((a * a).sum(axis=1), (b * b).sum(axis=1)))
    with np.errstate(all="ignore"):  # a degenerate piece has no inside
        rows = [normal / np.sqrt(square)[:, None]]
        inverse = [np.cross(b, normal), np.cross(normal, a)] if m == 3 else [a]
        rows += [row / square[:, None] for row in inverse]
        corners = np.concatenate([x, x.mean(axis=1, keepdims=True)], axis=1) - other[:, :1]
        distance, *inside = (np.einsum("kcs,ks->kc", corners, row) for row in rows)
        room = EPSILON * size[:, None]
        inside.append(1 - sum(inside))
        positive = np.stack([room - distance, room + distance, *(value - INSIDE for value in inside)], axis=2)
        start, stop = ([0, 1, 2, 3], [1, 2, 0, 3]) if m == 3 else ([0, 2], [1, 2])
        f, g = positive[:, start], positive[:, stop]
        t = f / (f - g)
        low, high = np.where(f < 0, t, 0.0).max(axis=2), np.where((f >= 0) & (g < 0), t, 1.0).min(axis=2)
        meets = ((f >= 0) | (g >= 0)).all(axis=2) & (low <= high)
    return meets.any(axis=1) & (square > 0)
