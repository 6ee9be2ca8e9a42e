"""What is asked of places: bodies apart or torn, nodes at one place or inside edges, skins that cross."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.checks.boxes import meeting
from lacmesh.checks.crossing import crossing
from lacmesh.checks.findings import Finding, counted
from lacmesh.checks.subject import Side, Subject
from lacmesh.mesh import Floats, Ints
from lacmesh.orientation import edge_uses
from lacmesh.skin import N_CORNERS

#: nodes nearer than this part of the mesh's extent stand at one place
PLACE = 1e-9
#: a node is inside an edge when its distance to it is below this part of the edge's length
ON_EDGE = 1e-6
#: a direction that few nodes of a regular mesh share
_OBLIQUE = np.array([0.5773502691896258, 0.6180339887498949, 0.5346223239512241])


def check_bodies(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """How many bodies there are, and whether they are torn."""
    bodies = subject.bodies
    count = int(bodies.max(initial=-1)) + 1
    figures: dict[str, Any] = {"bodies": count}
    found = []
    if count:
        message = f"the cells make {counted(count, 'body', 'separate bodies')}"
        mine = {
            side.what: np.unique(bodies[side.nodes][bodies[side.nodes] >= 0]) for side in subject.sides if len(side)
        }
        figures |= {f"bodies_of_{what}": len(which) for what, which in mine.items()}
        if len(mine) == 2 and all(len(which) for which in mine.values()):
            common = np.intersect1d(mine["slave"], mine["master"])
            message += (
                "; slave and master are on the same body" if len(common) else "; slave and master are on different ones"
            )
        found.append(subject.found("bodies", message))
    rows, facet = subject.facets.boundary
    corners = subject.facets.corners(rows, facet)
    nodes = np.unique(corners[corners >= 0])
    nodes = nodes[subject.finite[nodes]]
    found += _coincident(subject, nodes)
    found += _torn(subject, corners, nodes)
    return found, figures


def _on_sides(subject: Subject, a: Ints, b: Ints) -> NDArray[np.bool_]:
    """Which pairs of nodes (of nodes and edges) slave and master explain: one on each."""
    if subject.master is None:
        on = np.zeros(subject.mesh.n_nodes, bool)
        on[subject.slave.nodes] = True  # the master is not known: whatever touches the slave may be it
        return (on[a] | on[b]) & (subject.bodies[a] != subject.bodies[b])
    on = np.zeros((2, subject.mesh.n_nodes), bool)
    for k, side in enumerate(subject.sides):
        on[k, side.nodes] = True
    apart = subject.bodies[a] != subject.bodies[b]
    return (on[0, a] & on[1, b]) | (on[1, a] & on[0, b]) | (apart & (on[0, a] | on[1, a] | on[0, b] | on[1, b]))


def _coincident(subject: Subject, nodes: Ints) -> list[Finding]:
    """Nodes of the boundary at the same place."""
    a, b = same_place(subject.mesh.points[nodes])
    a, b = nodes[a], nodes[b]
    keep = ~_on_sides(subject, a, b)
    a, b = a[keep], b[keep]
    if not len(a):
        return []
    torn = int((subject.bodies[a] == subject.bodies[b]).sum())
    what = "the body is torn there, or has a crack" if torn else "the bodies are not joined there"
    message = counted(len(a), "pair of nodes stands", "pairs of nodes stand")
    message += f" at the same place ({subject.node_numbers(a)}): {what}; merge them if not meant"
    return [subject.found("coincident-nodes", message, nodes=np.unique(np.concatenate([a, b])))]


def same_place(x: Floats) -> tuple[Ints, Ints]:
    """(i, j): pairs of points (n, 3) nearer than PLACE times their extent; sorted along a line, neighbours compared."""
    if len(x) < 2:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    room = PLACE * max(float(np.ptp(x, axis=0).max()), 1e-300)
    along = x @ _OBLIQUE
    order = np.argsort(along, kind="stable")
    along = along[order]
    left, right = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    alive = np.arange(len(x) - 1)
    step = 1
    while len(alive):
        alive = alive[alive + step < len(x)]
        alive = alive[along[alive + step] - along[alive] <= 2 * room]
        i, j = order[alive], order[alive + step]
        near = (np.abs(x[i] - x[j]) <= room).all(axis=1)
        left.append(np.minimum(i, j)[near])
        right.append(np.maximum(i, j)[near])
        step += 1
    return np.concatenate(left), np.concatenate(right)


def _torn(subject: Subject, corners: Ints, nodes: Ints) -> list[Finding]:
    """Nodes of the boundary inside edges of the boundary of the same body."""
    a, b = _edges(corners, subject.mesh.n_nodes)
    node, edge = inside_edges(subject, nodes, a, b)
    mine = (subject.bodies[node] == subject.bodies[a[edge]]) & ~_on_sides(subject, node, a[edge])
    on_skin = np.zeros(subject.mesh.n_nodes, bool)
    for side in subject.sides:
        on_skin[hanging_nodes(subject, side)] = True  # these are an error of their own
    node = np.unique(node[mine & ~on_skin[node]])
    if not len(node):
        return []
    message = counted(len(node), "node lies inside an edge", "nodes lie inside edges")
    message += f" of the body that they belong to ({subject.node_numbers(node)}): its cells do not conform there; "
    message += "mesh both sides alike, or tie them in the solver"
    return [subject.found("torn-body", message, nodes=node)]


def _edges(corners: Ints, n_nodes: int) -> tuple[Ints, Ints]:
    """(a, b): the edges of facets (k, 4) given by their corners, each once."""
    n = (corners >= 0).sum(axis=1)
    keys = [np.empty(0, np.int64)]
    for k in range(4):
        rows = np.flatnonzero((k < n) & ((k == 0) | (n > 2)))
        u, v = corners[rows, k], corners[rows, (k + 1) % n[rows]]
        keys.append(np.minimum(u, v) * n_nodes + np.maximum(u, v))
    key = np.unique(np.concatenate(keys))
    return key // n_nodes, key % n_nodes


def inside_edges(subject: Subject, nodes: Ints, a: Ints, b: Ints) -> tuple[Ints, Ints]:
    """(node, edge): nodes of a list that lie inside the straight edges a b, away from their ends."""
    x, y = subject.mesh.points[a], subject.mesh.points[b]
    length = np.linalg.norm(y - x, axis=1)
    good = np.flatnonzero(subject.finite[a] & subject.finite[b] & (length > 0))
    room = (ON_EDGE * length[good])[:, None]
    low, high = np.minimum(x, y)[good] - room, np.maximum(x, y)[good] + room
    at = subject.mesh.points[nodes]
    edge, node = meeting(low, high, at, at)
    edge = good[edge]
    keep = (nodes[node] != a[edge]) & (nodes[node] != b[edge])
    edge, node = edge[keep], node[keep]
    along = (y - x)[edge] / length[edge][:, None]
    off = at[node] - x[edge]
    place = (off * along).sum(axis=1)
    apart = np.linalg.norm(off - place[:, None] * along, axis=1)
    tol = ON_EDGE * length[edge]
    keep = (apart <= tol) & (place > tol) & (place < length[edge] - tol)
    return nodes[node[keep]], edge[keep]


def hanging_nodes(subject: Subject, side: Side) -> Ints:
    """Corners of a skin that lie inside an edge on the rim of the same skin, on the same body."""
    if subject.dim != 2 or not len(side):
        return np.empty(0, np.int64)
    corners = side.faces.corners
    uses = edge_uses(side.faces)
    alone = np.flatnonzero(np.bincount(uses.edge)[uses.edge] == 1)
    face, place = uses.face[alone], uses.place[alone]
    a, b = corners[face, place], corners[face, (place + 1) % N_CORNERS[side.faces.type[face]]]
    nodes = np.unique(corners[corners >= 0])
    node, edge = inside_edges(subject, nodes[subject.finite[nodes]], a, b)
    return np.unique(node[subject.bodies[node] == subject.bodies[a[edge]]])


def check_skins_in_space(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Nodes of a skin inside its edges, and faces of a skin that cross."""
    found = []
    for side in subject.sides:
        hanging = hanging_nodes(subject, side)
        if len(hanging):
            message = counted(len(hanging), f"node of the {side.what} skin lies", f"nodes of the {side.what} skin lie")
            message += f" inside edges of its other faces ({subject.node_numbers(hanging)}); mesh the skin conformingly"
            found.append(subject.found("hanging-node", message, nodes=hanging, group=side.group))
        found += _crossing(subject, side)
    return found, {}


def _crossing(subject: Subject, side: Side) -> list[Finding]:
    mesh = subject.mesh
    if not len(side) or (subject.dim == 1 and mesh.space_dim == 3):  # lines in space hardly ever meet
        return []
    nodes = side.faces.nodes
    good = np.flatnonzero((subject.finite[nodes] | (nodes < 0)).all(axis=1))
    pairs = crossing(mesh.points, side.faces.take(good))
    if not len(pairs):
        return []
    cells = side.cells[good[np.unique(pairs)]]
    message = counted(
        len(pairs), f"pair of {side.what} faces crosses or overlaps", f"pairs of {side.what} faces cross or overlap"
    )
    message += f" ({subject.numbers(cells)}); repair the skin there"
    return [subject.found("self-intersection", message, cells, group=side.group)]
