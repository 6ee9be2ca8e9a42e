"""Checks of positions: number of bodies, torn bodies, coincident nodes, hanging nodes, skins that cross themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.checks.crossing import crossing
from lacmesh.checks.findings import Finding, counted
from lacmesh.checks.subject import PLACE, SHOWN, CheckedSkin, Subject
from lacmesh.errors import listed
from lacmesh.mesh import Floats, Ints
from lacmesh.topology.bodies import label_components
from lacmesh.topology.boxes import meeting
from lacmesh.topology.skin import distinct_edges, edge_uses

#: a node is inside an edge when its distance to it is below this part of the edge's length
ON_EDGE = 1e-6
#: a direction that few nodes of a regular mesh share
_OBLIQUE = np.array([0.5773502691896258, 0.6180339887498949, 0.5346223239512241])


def check_bodies(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Count the bodies, and find coincident nodes and torn bodies."""
    bodies = subject.bodies
    count = int(bodies.max(initial=-1)) + 1
    figures: dict[str, Any] = {"bodies": count}
    findings = []
    if count:
        message = f"the cells make {counted(count, 'body', 'separate bodies')}"
        message += f" ({_named(subject, np.arange(count))})" if count > 1 else ""
        mine = {
            side.what: np.unique(bodies[side.nodes][bodies[side.nodes] >= 0]) for side in subject.sides if len(side)
        }
        figures |= {f"bodies_of_{what}": len(which) for what, which in mine.items()}
        if len(mine) == 2 and all(len(which) for which in mine.values()):
            common = np.intersect1d(mine["slave"], mine["master"])
            message += (
                f"; slave and master are on the same body, {_named(subject, common)}"
                if len(common) and count > 1
                else "; slave and master are on the same body"
                if len(common)
                else "; slave and master are on different ones"
            )
        findings.append(subject.found("bodies", message))
    rows, facet = subject.facets.boundary
    corners = subject.facets.corners(rows, facet)
    nodes = np.unique(corners[corners >= 0])
    nodes = nodes[subject.finite[nodes]]
    findings += _coincident(subject, corners, nodes)
    findings += _torn(subject, corners, nodes)
    return findings, figures


def _named(subject: Subject, bodies: Ints) -> str:
    """Return the names of some bodies, the first few of many."""
    names = [subject.body_names[body] for body in bodies[:SHOWN].tolist()]
    more = [f"{len(bodies) - SHOWN:,} more"] if len(bodies) > SHOWN else []
    return listed([*names, *more], "and")


def _on_sides(subject: Subject, a: Ints, b: Ints) -> NDArray[np.bool_]:
    """True for pairs of nodes (or of a node and an edge) that contact explains: one on the slave, one on the master.

    Pairs of two bodies are also explained where one of the two is on either skin.
    """
    if subject.master is None:
        on = np.zeros(subject.mesh.n_nodes, bool)
        on[subject.slave.nodes] = True  # the master is not known: whatever touches the slave may be it
        return (on[a] | on[b]) & (subject.bodies[a] != subject.bodies[b])
    on = np.zeros((2, subject.mesh.n_nodes), bool)
    for k, side in enumerate(subject.sides):
        on[k, side.nodes] = True
    apart = subject.bodies[a] != subject.bodies[b]
    return (on[0, a] & on[1, b]) | (on[1, a] & on[0, b]) | (apart & (on[0, a] | on[1, a] | on[0, b] | on[1, b]))


def _coincident(subject: Subject, corners: Ints, nodes: Ints) -> list[Finding]:
    """Report boundary nodes that coincide though contact does not explain it."""
    place = same_place(subject.mesh.points[nodes], PLACE * _edge_length(subject, corners, nodes))
    shared = np.bincount(place, minlength=len(nodes))[place] > 1
    nodes, place = nodes[shared], place[shared]
    again, torn = _unexplained(subject, nodes, place)
    if not again.any():
        return []
    what = "the body is torn there, or has a crack" if torn.any() else "the bodies are not joined there"
    message = f"{np.count_nonzero(again):,} nodes coincide at {counted(len(np.unique(place[again])), 'point')}"
    message += f" ({subject.node_numbers(nodes[again])}): {what}; merge them if this is not intended"
    return [subject.found("coincident-nodes", message, nodes=nodes[again])]


def _unexplained(subject: Subject, nodes: Ints, place: Ints) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(k,) each: nodes in an unexplained coincidence with any other node; those in one with a node of the same body.

    A pair of nodes is explained if one is on the slave and one on the master, or if they belong to two bodies and one
    is on a skin (`_on_sides`). Nodes are counted place by place: thousands at one place would make millions of pairs.
    """
    on = np.zeros((2, subject.mesh.n_nodes), bool)
    for k, side in enumerate(subject.sides):
        on[k, side.nodes] = True
    slave, master = on[:, nodes]
    off = ~(slave | master)
    body = np.unique(np.column_stack([place, subject.bodies[nodes]]), axis=0, return_inverse=True)[1].ravel()
    kinds = off, slave & ~master, master & ~slave
    n_off, n_slave, n_master = (np.bincount(body, kind)[body] for kind in kinds)
    members = np.bincount(body)[body]
    torn = np.where(off, members > 1, n_off > 0)
    torn |= (kinds[1] & (n_slave > 1)) | (kinds[2] & (n_master > 1))
    return torn | (off & (np.bincount(place, off)[place] > 1)), torn


def _edge_length(subject: Subject, corners: Ints, nodes: Ints) -> float:
    """Median over the boundary nodes of the shortest edge at a node, so that a few stray nodes do not affect it."""
    a, b = distinct_edges(corners)[0].T
    length = np.linalg.norm(subject.mesh.points[a] - subject.mesh.points[b], axis=1)
    good = subject.finite[a] & subject.finite[b] & (length > 0)
    shortest = np.full(subject.mesh.n_nodes, np.inf)
    for end in (a, b):
        np.minimum.at(shortest, end[good], length[good])
    lengths = shortest[nodes]
    lengths = lengths[np.isfinite(lengths)]
    return float(np.median(lengths)) if len(lengths) else 0.0


def same_place(x: Floats, room: float) -> Ints:
    """(n,): labels of places, the same for points (n, 3) that lie within `room` of each other.

    The points are sorted along a line and each is joined to the next one near it only, so that many points at one place
    do not raise the cost.
    """
    along = x @ _OBLIQUE
    order = np.argsort(along, kind="stable")
    along = along[order]
    reach = 2 * room + 4 * np.finfo(float).eps * np.abs(x[order]).sum(axis=1)  # what is equal may be projected apart
    left, right = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    alive = np.arange(len(x))
    step = 1
    while len(alive):
        alive = alive[alive + step < len(x)]
        alive = alive[along[alive + step] - along[alive] <= reach[alive]]
        i, j = order[alive], order[alive + step]
        near = (np.abs(x[i] - x[j]) <= room).all(axis=1)
        left.append(i[near])
        right.append(j[near])
        alive = alive[~near]
        step += 1
    return label_components(np.concatenate(left), np.concatenate(right), len(x))


def _torn(subject: Subject, corners: Ints, nodes: Ints) -> list[Finding]:
    """Report boundary nodes that lie inside a boundary edge of the same body."""
    a, b = distinct_edges(corners)[0].T
    node, edge = inside_edges(subject, nodes, a, b)
    mine = (subject.bodies[node] == subject.bodies[a[edge]]) & ~_on_sides(subject, node, a[edge])
    on_skin = np.zeros(subject.mesh.n_nodes, bool)
    for side in subject.sides:
        on_skin[hanging_nodes(subject, side)] = True  # these are an error of their own
    node = np.unique(node[mine & ~on_skin[node]])
    if not len(node):
        return []
    message = counted(len(node), "node lies inside an edge", "nodes lie inside edges")
    which = np.unique(subject.bodies[node])
    owner = "the body" if subject.bodies.max() == 0 else _named(subject, which)
    message += f" of {owner}, to which they belong ({subject.node_numbers(node)}): its cells do not conform there; "
    message += "mesh both sides conformingly, or tie them in the solver"
    return [subject.found("torn-body", message, nodes=node)]


def inside_edges(subject: Subject, nodes: Ints, a: Ints, b: Ints) -> tuple[Ints, Ints]:
    """(node, edge): pairs of a node of the list and a straight edge a b that contains it, away from the edge's ends."""
    x, y = subject.mesh.points[a], subject.mesh.points[b]
    length = np.linalg.norm(y - x, axis=1)
    good = np.flatnonzero(subject.finite[a] & subject.finite[b] & (length > 0))
    room = (ON_EDGE * length[good])[:, None]
    low, high = np.minimum(x, y)[good] - room, np.maximum(x, y)[good] + room
    place = same_place(subject.mesh.points[nodes], 0.0)
    order = np.argsort(place, kind="stable")  # the nodes of a place, of which one is asked for all
    size = np.bincount(place)
    start = np.cumsum(size) - size
    at = subject.mesh.points[nodes[order[start]]]
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


def hanging_nodes(subject: Subject, side: CheckedSkin) -> Ints:
    """Corners of a skin that lie inside an edge on the boundary of the same skin, on the same body."""
    if subject.dim != 2 or not len(side):
        return np.empty(0, np.int64)
    corners = side.faces.corners
    uses = edge_uses(side.faces)
    alone = np.flatnonzero(np.bincount(uses.edge)[uses.edge] == 1)
    a, b = uses.start[alone], uses.stop[alone]
    nodes = np.unique(corners[corners >= 0])
    node, edge = inside_edges(subject, nodes[subject.finite[nodes]], a, b)
    return np.unique(node[subject.bodies[node] == subject.bodies[a[edge]]])


def check_skins_in_space(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Find hanging nodes of a skin, and faces of a skin that cross or overlap."""
    findings = []
    for side in subject.sides:
        hanging = hanging_nodes(subject, side)
        if len(hanging):
            message = counted(len(hanging), f"node of the {side.what} skin lies", f"nodes of the {side.what} skin lie")
            message += f" inside edges of its other faces ({subject.node_numbers(hanging)}); mesh the skin conformingly"
            findings.append(subject.found("hanging-node", message, nodes=hanging, group=side.group))
        findings += _crossing(subject, side)
    return findings, {}


def _crossing(subject: Subject, side: CheckedSkin) -> list[Finding]:
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
