"""Checks of the skins: their faces, parent cells, orientation, and the nodes that they share."""

from __future__ import annotations

from collections.abc import Iterator
from shlex import quote

import numpy as np

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.checks.findings import Place, rule
from lacmesh.checks.request import Bools, CheckedSkin, Request, is_carried
from lacmesh.errors import counted
from lacmesh.mesh import Floats, Ints, concatenated, mask_of
from lacmesh.topology.orientation import analyse_orientation, face_normals
from lacmesh.topology.skin import FACE_TYPES, Faces, boundary_edges, cells_of_dim, edge_uses, find_owners, find_repeats

_ORDER = np.array([CELLS[name].order for name in FACE_TYPES])
_NONE = np.empty(0, np.int64)


# ---- the groups


def _by_dim(request: Request, side: CheckedSkin) -> Iterator[tuple[str, Ints, Ints, Ints]]:
    """Yield each group's name, all its cells, and those above and below the dimension of the skin."""
    for name, cells in zip(side.names, side.groups, strict=True):
        dims = request.mesh.cell_dim[cells]
        yield name, cells, cells[dims > request.dim], cells[dims < request.dim]


@rule("empty-skin", "error", "name the group of the surface", "group")
def empty_skin(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A slave or master group has no faces."""
    for name, cells, _, lower in _by_dim(request, side):
        if len(lower) == len(cells):
            message = f"the {side.what} group {name!r} has no faces (cells of dimension {request.dim})"
            yield Place(message, cells, group=name)


@rule("wrong-dimension", "error", "name the group of the surface, one dimension lower", "group")
def wrong_dimension(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A slave or master group has cells of the dimension of the body."""
    for name, _, higher, _ in _by_dim(request, side):
        if len(higher):
            message = f"the {side.what} group {name!r} has {counted(len(higher), 'cell')} of dimension "
            message += f"{int(request.mesh.cell_dim[higher].max())} ({request.numbers(higher)})"
            advice = f"name the group of its surface, of dimension {request.dim}"
            yield Place(message, higher, group=name, advice=advice)


@rule("lower-dimension", "warning", "remove them", "group")
def lower_dimension(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A slave or master group also has lines or points, which are ignored."""
    for name, cells, higher, lower in _by_dim(request, side):
        if len(lower) and len(lower) < len(cells) and not len(higher):
            message = f"the {side.what} group {name!r} also has {counted(len(lower), 'cell')} of lower dimension "
            yield Place(f"{message}({request.numbers(lower)})", lower, group=name)


@rule("unsupported-face", "error", "mesh with linear or quadratic cells", "group")
def unsupported_faces(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A slave or master face, or the cell behind a slave face, is of order 3 or higher."""
    for name, cells in zip(side.names, side.groups, strict=True):
        faces = cells[request.mesh.cell_dim[cells] == request.dim]
        odd = concatenated(c for kind, c, _ in request.mesh.select(faces) if is_carried(kind))
        for place in request.places(odd, "is|are", "of order 3 or higher", side):
            yield place._replace(group=name)


@rule("repeated-face", "error", "remove the copy", "group")
def repeated_faces(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """The slave or the master groups have a face twice, as two cells on the same nodes."""
    yield from request.places(side.copies, "occurs|occur", "twice, as cells on the nodes of others", side)


@rule("duplicate", "info", "nothing", "slave")
def duplicates(request: Request) -> Iterator[Place]:
    """Another surface cell, outside the group, lies on the same nodes as a slave face; the cut cuts both."""
    side = request.slave
    repeats = find_repeats(side.faces, list(cells_of_dim(request.mesh, request.dim)), request.mesh.n_nodes)
    others = np.setdiff1d(repeats.cell, np.concatenate(side.groups))
    text = "in other groups and on slave faces: both are cut"
    yield from request.places(others, "is|are", text, side, noun="skin cell")


@rule("face-in-two-zones", "info", "nothing, or separate the groups")
def faces_in_two_zones(request: Request) -> Iterator[Place]:
    """A face is in two slave groups; it belongs to the contact of the first."""
    cells, count = np.unique(np.concatenate(request.slave.groups), return_counts=True)
    text = "in several slave groups and belong to the contact of the first"
    yield from request.places(cells[count > 1], "is|are", text, request.slave, noun="cell")


# ---- the parent cells, and the way that the faces point


def _parentless(request: Request, side: CheckedSkin) -> tuple[Ints, Ints]:
    """Cells on faces without parent cells: those of nothing, and those of cells of order 3 or higher."""
    mesh, blocks = request.mesh, []
    for k, (kind, nodes) in enumerate(mesh.blocks):
        cell = ALL_CELLS[kind]
        if is_carried(kind) and cell.dim == request.dim + 1:
            blocks.append((cell.linear, nodes[:, : cell.n_corners], mesh.offsets[k] + np.arange(len(nodes))))
    carried = mask_of(len(side), find_owners(side.faces, blocks, mesh.n_nodes).face)
    bare = request.n_parents(side) == 0
    return side.cells[bare & ~carried], side.cells[bare & carried]


def _is_cut_alone(request: Request, side: CheckedSkin) -> bool:
    """True if by the records of a cut in a plane, or of a shell, no slave face without parent cell is uncut."""
    macro = request.mesh.cell_data.get("lac_macro")
    cells = request.once(_parentless, side)[0]
    return side.what == "slave" and request.mesh.dim == 2 and macro is not None and bool((macro[cells] >= 0).all())


@rule("no-parent", "error", "remove them from the group, or mesh the body; --skin-only cuts a shell", "slave")
def no_parent(request: Request) -> Iterator[Place]:
    """A slave face has no parent cell."""
    side = request.slave
    cells = request.once(_parentless, side)[0]
    if not _is_cut_alone(request, side):
        yield from request.places(cells, "has|have", "no parent cell", side)


@rule("bare-master", "info", "nothing, if the master is rigid", "skin")
def bare_master(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """Master faces have no parent cells: a rigid master."""
    if side.what == "master":
        cells = request.once(_parentless, side)[0]
        yield from request.places(cells, "has|have", "no parent cell: the master, or that part of it, is rigid", side)


@rule("unsupported-face", scope="skin")
def on_unsupported_cells(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A face is one of a cell of order 3 or higher."""
    cells = request.once(_parentless, side)[1]
    if not _is_cut_alone(request, side):
        yield from request.places(cells, "lies|lie", "on cells of order 3 or higher", side)


@rule("interface", "warning", "double the nodes (lacmesh split), or remove the faces from the group", "skin")
def interfaces(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A slave or master face lies between two cells, inside the body, where no gap can open."""
    cells = side.cells[request.n_parents(side) == 2]
    if not _is_cut_alone(request, side):
        yield from request.places(cells, "lies|lie", "between two cells, where no gap can open", side)


@rule("mid-nodes-differ", scope="skin")
def mid_nodes_of_parents(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A face has the corners of a facet of its parent cell, but not its mid-nodes."""
    parents = request.parents[side.what]
    cells = side.cells[np.unique(parents.face[~parents.same])]
    if not _is_cut_alone(request, side):
        yield from request.places(cells, "does|do", "not have the mid-nodes of their parent cells", side)


@rule("orientation", "warning", "lacmesh orient, or cut with --orient outward", "skin")
def orientation(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """Slave or master faces point inward, or, on a surface without parent cells, opposite to their neighbours."""
    analysis = analyse_orientation(request.mesh, side.cells)
    against = np.intersect1d(analysis.to_flip, analysis.parentless)
    inward = np.setdiff1d(analysis.to_flip, analysis.parentless)
    advice = f"flip them: lacmesh orient {' '.join(f'--group {name}' for name in side.names)}"
    if len(inward):
        message = f"{len(inward):,} of {side.counted(len(side), 'points|point')} inward ({request.numbers(inward)})"
        yield Place(message, inward, advice=advice)
    noun, text = f"{side.what} face without parent cell", "opposite to their neighbours, or inward"
    yield from request.places(against, "points|point", text, side, noun=noun, advice=advice)


@rule("non-manifold", "error", "remove the branching faces from the group", "skin")
def branches(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """Three or more faces of one surface meet at an edge."""
    uses = edge_uses(side.faces)
    count = np.bincount(uses.edge)
    cells = side.cells[np.unique(uses.face[count[uses.edge] > 2])]
    if len(cells):
        message = f"three or more {side.what} faces meet at {counted(int((count > 2).sum()), 'edge')} (cells "
        yield Place(f"{message}{request.numbers(cells)})", cells)


@rule("mixed-order", "warning", "elevate the order of the linear part, or make two contacts", "skin")
def mixed_orders(request: Request, side: CheckedSkin) -> Iterator[Place]:
    """A surface has linear and quadratic faces."""
    order = _ORDER[side.faces.type]
    if order.min() < order.max():
        few = side.cells[order == (1 if 2 * (order == 1).sum() <= len(order) else 2)]
        message = f"the {side.what} surface has linear and quadratic faces (fewer of one: {request.numbers(few)})"
        yield Place(message, few)


# ---- nodes that two skins share


@rule("crack-front", "info", "nothing, if the surfaces are the sides of a crack (lacmesh split)", "pair")
def crack_front(request: Request) -> Iterator[Place]:
    """Slave and master share nodes where they lie on each other, at the front of a crack, which stays closed."""
    front = request.once(_front)
    if len(front):
        message = f"slave and master are the two sides of a crack, and share {counted(len(front), 'node')} of its "
        message += f"front ({request.node_numbers(front)}), which stay closed"
        yield Place(message, nodes=front, group=_both(request))


@rule("shared-nodes", "error", "double the nodes (lacmesh split), or remove faces from one of the groups", "pair")
def shared_nodes(request: Request) -> Iterator[Place]:
    """Slave and master share nodes, where no gap can open."""
    slave = request.slave
    common = np.setdiff1d(_common(request), request.once(_front))
    inside = _closed(request) & (request.n_parents(slave) == 2) if len(common) else np.zeros(0, bool)
    if inside.any():
        message = f"bodies share {slave.counted(int(inside.sum()), 'with the master')}, where no gap can open"
        divide = " ".join(f"--faces {quote(name)}" for name in slave.names)
        sides = " and ".join(", ".join(f"{name}_{side}" for name in slave.names) for side in "ab")
        advice = f"divide the mesh there: lacmesh split MESH {divide}, and take {sides} as slave and master"
        yield Place(message, nodes=common, group=_both(request), advice=advice)
    elif len(common):
        message = f"slave and master share {counted(len(common), 'node')} ({request.node_numbers(common)}), where no "
        yield Place(f"{message}gap can open", nodes=common, group=_both(request))


@rule("zones-share-nodes", "warning", "keep a row of faces between the slaves, or make them one")
def zones_share_nodes(request: Request) -> Iterator[Place]:
    """Two slaves share nodes: the contact conditions of both act on them."""
    side = request.slave
    rows, place = np.nonzero(side.faces.nodes >= 0)
    pairs = np.unique(np.column_stack([side.faces.nodes[rows, place], side.zone[rows]]), axis=0)
    nodes, count = np.unique(pairs[:, 0], return_counts=True)
    shared = nodes[count > 1]
    if len(shared):
        message = f"slaves share {counted(len(shared), 'node')} ({request.node_numbers(shared)})"
        yield Place(message, nodes=shared, group=side.group)


def is_glued(request: Request) -> bool:
    """True if there is a slave face that has all its nodes on the master."""
    return bool(_closed(request).any())


def _both(request: Request) -> str:
    return " / ".join(side.group for side in request.sides)


def _common(request: Request) -> Ints:
    """Nodes of both skins."""
    return _NONE if request.master is None else np.intersect1d(request.slave.nodes, request.master.nodes)


def _closed(request: Request) -> Bools:
    """(f,): True for slave faces that have all their nodes on the master."""
    nodes = request.slave.faces.nodes
    return np.asarray((np.isin(nodes, _common(request)) | (nodes < 0)).all(axis=1))


def _front(request: Request) -> Ints:
    """Nodes where the boundaries of both skins have an edge (in a plane, an end) in common, and lie on each other.

    The angle between the skins is below 60 degrees there: that of a crack is 0, that of skins side by side 180. None
    if a slave face lies on the master with all its nodes.
    """
    if request.master is None or is_glued(request):
        return _NONE
    if request.dim == 1 and request.mesh.space_dim == 3:  # lines in space have no normals
        return _NONE
    slave, master = (_boundary_edges(side.faces) for side in request.sides)
    nodes = np.array(sorted(node for edge in slave.keys() & master.keys() for node in slave[edge]), np.int64)
    nodes = np.unique(nodes)
    normals = [_mean_normals(request, side, nodes) for side in request.sides]
    return nodes[(normals[0] * normals[1]).sum(axis=1) < -0.5]


def _boundary_edges(faces: Faces) -> dict[tuple[int, ...], list[int]]:
    """Edges that one face has alone, by their corners: their nodes, with the mid-node of quadratic faces."""
    return {tuple(sorted(row[:2])): [node for node in row if node >= 0] for row in boundary_edges(faces).tolist()}


def _mean_normals(request: Request, side: CheckedSkin, nodes: Ints) -> Floats:
    """(k, 3): unit normals of a skin at some of its nodes, the mean of those of the faces there; 0 for none."""
    listed = side.faces.nodes
    row, column = np.nonzero(np.isin(listed, nodes) & (listed >= 0))
    total = np.zeros((request.mesh.n_nodes, 3))
    np.add.at(total, listed[row, column], face_normals(request.mesh, side.faces)[row])
    size = np.linalg.norm(total[nodes], axis=1)
    return total[nodes] / np.where(size > 0, size, 1)[:, None]
