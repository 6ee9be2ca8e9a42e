"""Slave nodes moved onto their master before a solution: `[[contact]] adjust`.

Each node of the slave, also one that the cut has made, that is within the distance of the master, or where that is 0
inside it, goes to its closest point there: onto the faces, or the smooth surface over them. Where it overhangs the
master's boundary it goes along the master's normal. These are the reference positions, so that nothing is strained.
What depends on them follows: mid-nodes and centres that have not been moved themselves go with the corners of their
edge, face or cell; nodes that the cut has put on linear faces keep their place in the face before the cut, and those
inside a cell go with their neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from lacmesh.cells import CELLS
from lacmesh.cutting.records import Cut, is_cut
from lacmesh.errors import LacmeshError, some
from lacmesh.mesh import Floats, Ints, Mesh, mask_of
from lacmesh.origin import format_coordinates, from_origin, origin_of_mesh
from lacmesh.quality.geometry import validity_among
from lacmesh.reference.shapes import shape
from lacmesh.smooth import surface_of
from lacmesh.smooth.parents import parents_of
from lacmesh.surface import Surface
from lacmesh.surface.closest import Closest, closest_points
from lacmesh.surface.record import mean_normals
from lacmesh.topology.skin import FACE_TYPES, N_CORNERS, N_NODES, cells_of_dim, label_rows
from lacsolver.case import Case, Contact
from lacsolver.space.places import wrong
from lacsolver.space.sparse import sparse

#: way of a node, relative to the size of the slave's faces, that is round-off
_ROUNDING = 1e-12
#: distance from the axis, relative to the extent of the mesh, at which a node is on it
_ON_AXIS = 1e-9
#: part of the longest way by which a later contact may move nodes off the master of an earlier one
_KEPT = 1e-3

Bools = NDArray[np.bool_]


class Adjustment(NamedTuple):
    """Nodes of a slave that were moved onto the master: how many, and the largest and the mean of their ways."""

    count: int  # type: ignore[assignment]  # a tuple's method, which is not asked for
    largest: float
    mean: float


class _Pair(NamedTuple):
    """A contact with nodes to move: its record, its slave nodes (k,) without those that follow, and its master."""

    record: Contact
    nodes: Ints
    outward: Floats
    master: Surface

    @classmethod
    def of(cls, mesh: Mesh, record: Contact) -> _Pair:
        """Return the slave and the master of a contact as they are in a mesh. Raises CaseError."""
        try:
            slave, master = (
                surface_of(mesh, mesh.cells_of(name), record.surface, record.crease_angle)
                for name in (record.slave, record.master)
            )
        except LacmeshError as error:
            raise wrong(record, str(error)) from None
        nodes = np.setdiff1d(slave.faces.distinct_nodes, _made_by_cut(mesh, slave))
        outward = np.zeros((mesh.n_nodes, 3))
        n = mean_normals(slave)[0]
        for k in range(slave.faces.nodes.shape[1]):
            there = slave.faces.nodes[:, k] >= 0
            np.add.at(outward, slave.faces.nodes[there, k], n[there])
        return cls(record, nodes, outward[nodes], master)

    def closest(self, x: Floats) -> Closest:
        """Return the closest points of the master to the slave's nodes, with all nodes at x (n_nodes, 3)."""
        assert self.record.adjust is not None
        if self.record.adjust:
            return closest_points(self.master, x[self.nodes], self.outward, self.record.adjust)
        closest = closest_points(self.master, x[self.nodes], self.outward, float(self.master.size.max(initial=0.0)))
        outside = (closest.way * self.outward).sum(axis=1) >= 0
        return closest._replace(face=np.where(outside, -1, closest.face))


def adjusted(case: Case, mesh: Mesh, origin: Floats | None = None) -> tuple[Mesh, dict[str, Adjustment]]:
    """Return a cut mesh with the slave nodes of its contacts moved, as they ask for, and how far, by contact.

    `origin` (3,): that of the coordinates of the whole model; by default of the mesh. Contacts follow one another in
    the order of the case. Raises CaseError where a cell would be turned over, and where two contacts move the same
    nodes and cannot both have their way.
    """
    records = [record for record in case.contact if record.adjust is not None]
    if not records:
        return mesh, {}
    origin = origin_of_mesh(mesh) if origin is None else origin
    local = from_origin(mesh, origin)
    begin, adjustments, done = local.points, {}, []
    for record in records:
        pair = _Pair.of(local, record)
        x, ways = _moved(case, local, pair, origin)
        _check_cells(record, local, x)
        local = replace(local, points=x)
        adjustments[record.name] = _adjustment(ways, pair)
        done.append((pair, np.flatnonzero(ways > 0), float(ways.max(initial=0.0))))
    _check_kept(local, done, origin)
    return replace(mesh, points=mesh.points + (local.points - begin)), adjustments


def _adjustment(ways: Floats, pair: _Pair) -> Adjustment:
    """Return the figures of the ways (n_nodes,) of a contact's nodes."""
    ways = ways[pair.nodes]
    moved = ways[ways > 0]
    return Adjustment(len(moved), float(moved.max(initial=0.0)), float(moved.mean()) if len(moved) else 0.0)


def _moved(case: Case, mesh: Mesh, pair: _Pair, origin: Floats) -> tuple[Floats, Floats]:
    """Return the nodes (n_nodes, 3) of a mesh after the adjustment of a contact, and the ways (n_nodes,) of its nodes.

    The ways of nodes that only follow are 0.
    """
    x, closest = mesh.points.copy(), pair.closest(mesh.points)
    near = closest.face >= 0
    nodes, way = pair.nodes[near], closest.way[near]
    if case.model == "axisymmetric":
        axis = x[nodes, 0] + origin[0] <= _ON_AXIS * np.ptp(mesh.points, axis=0).max()
        way[axis, 0] = 0.0
    length = np.linalg.norm(way, axis=1)
    moves = length > _ROUNDING * pair.master.size.max()
    nodes, way = nodes[moves], way[moves]
    x[nodes] += way
    ways = np.zeros(mesh.n_nodes)
    ways[nodes] = length[moves]
    if len(nodes):
        _follow(mesh, x, ways > 0)
    return x, ways


def _follow(mesh: Mesh, x: Floats, moved: Bools) -> None:
    """Move what follows the nodes `moved` (n_nodes,) of a mesh, in the coordinates x (n_nodes, 3) after their way."""
    if is_cut(mesh):
        _follow_in_faces(mesh, x)
        _follow_in_cells(mesh, x)
    shift = x - mesh.points
    for kind, nodes, _ in cells_of_dim(mesh, mesh.dim):
        cell = CELLS.get(kind)
        if cell is None:  # of higher order: the space refuses it
            continue
        for k in range(cell.n_corners, cell.n_nodes):
            mean = shift[nodes[:, list(cell.corners_of_node[k])]].mean(axis=1)
            own = nodes[:, k]
            goes = mean.any(axis=1) & ~moved[own]
            x[own[goes]] = mesh.points[own[goes]] + mean[goes]


def _made_by_cut(mesh: Mesh, skin: Surface) -> Ints:
    """Return the nodes that the cut has put into linear faces of a skin."""
    linear = skin.faces.type[:, None] == [k for k, name in enumerate(FACE_TYPES) if CELLS[name].order == 1]
    rows = np.flatnonzero(linear.any(axis=1))
    if not (is_cut(mesh) and len(rows)):
        return np.empty(0, np.int64)
    some_faces = skin.take(rows)
    return np.setdiff1d(some_faces.faces.distinct_nodes, parents_of(mesh, some_faces).faces.faces.distinct_nodes)


def _follow_in_faces(mesh: Mesh, x: Floats) -> None:
    """Put the nodes that the cut has made on linear faces where they were in the face before the cut."""
    skin = Surface.of(mesh, np.flatnonzero(Cut(mesh).macro_of_face >= 0))
    rows = np.flatnonzero(np.isin(skin.faces.nodes, np.flatnonzero((x != mesh.points).any(axis=1))).any(axis=1))
    if not len(rows):
        return
    by_cut = mask_of(mesh.n_nodes, _made_by_cut(mesh, skin))
    parents = parents_of(mesh, skin)
    kind, mother = skin.faces.type, parents.faces.faces.type[parents.of]
    for code in np.unique(mother):
        name = FACE_TYPES[code]
        if CELLS[name].order > 1:
            continue
        own = np.flatnonzero(mother == code)
        ring = parents.faces.faces.nodes[parents.of[own], : N_NODES[code]]
        goes = (x[ring] != mesh.points[ring]).any(axis=(1, 2))
        for k in range(int(N_CORNERS[kind[own]].max(initial=0))):
            node = skin.faces.nodes[own, k]
            chosen = np.flatnonzero(goes & (N_CORNERS[kind[own]] > k) & by_cut[node])
            N = shape(name, parents.corner[own[chosen], k, : CELLS[name].dim])
            x[node[chosen]] = np.einsum("pn,pns->ps", N, x[ring[chosen]])


def _follow_in_cells(mesh: Mesh, x: Floats) -> None:
    """Move the nodes that the cut has put inside cells by the mean of their neighbours along edges."""
    inner = _inside_cells(mesh)
    shift = x - mesh.points
    if not len(inner) or not shift.any():
        return
    W = _edges_of_children(mesh)[inner]
    degree = np.asarray(W.sum(axis=1)).ravel()
    own = csr_array(W[:, inner])
    right = W @ np.where(np.isin(np.arange(mesh.n_nodes), inner)[:, None], 0.0, shift)
    x[inner] = mesh.points[inner] + splu((diags_array(degree) - own).tocsc()).solve(right)


def _children(mesh: Mesh) -> Ints:
    """Return the cells of bodies that the cut has made."""
    return np.flatnonzero((Cut(mesh).parent_of_cell >= 0) & (mesh.cell_dim == mesh.dim))


def _inside_cells(mesh: Mesh) -> Ints:
    """Return the corners of children that lie inside the cell before the cut: on none of its facets."""
    children, parent = _children(mesh), Cut(mesh).parent_of_cell
    rows: list[Ints] = [np.empty((0, 5), np.int64)]
    used = np.zeros(mesh.n_nodes, bool)
    for kind, cells, nodes in mesh.select(children):
        used[nodes[:, : CELLS[kind].n_corners]] = True
        for facet in CELLS[kind].facets:
            corners = nodes[:, facet.nodes[: CELLS[facet.type].n_corners]]
            padded = np.pad(corners, ((0, 0), (0, 4 - corners.shape[1])), constant_values=-1)
            rows.append(np.column_stack([np.sort(padded, axis=1) + 1, parent[cells]]))
    facets = np.concatenate(rows)
    labels, count = label_rows(facets)
    outer = facets[np.bincount(labels, minlength=count)[labels] == 1, :4] - 1
    used[outer[outer >= 0]] = False
    return np.flatnonzero(used)


def _edges_of_children(mesh: Mesh) -> csr_array:
    """Return the edges (n_nodes, n_nodes) of the cells that the cut has made, 1 between their ends."""
    ends: list[Ints] = [np.empty((0, 2), np.int64)]
    for kind, _, nodes in mesh.select(_children(mesh)):
        ends += [nodes[:, list(edge[:2])] for edge in CELLS[kind].edges]
    a, b = np.unique(np.sort(np.concatenate(ends), axis=1), axis=0).T
    return sparse((mesh.n_nodes, mesh.n_nodes), (a, b, 1.0), (b, a, 1.0))


def _check_cells(record: Contact, mesh: Mesh, x: Floats) -> None:
    """Raise CaseError if a cell of a mesh is turned over when its nodes go to x (n_nodes, 3)."""
    goes = (x != mesh.points).any(axis=1)
    for kind, nodes, cells in cells_of_dim(mesh, mesh.dim):
        near = np.flatnonzero(goes[nodes].any(axis=1))
        if not len(near):
            continue
        before, after = (validity_among(kind, places, nodes[near], plane=True).least for places in (mesh.points, x))
        bad = near[(before > 0) & ~(after > 0)]
        if len(bad):
            way = float(np.linalg.norm(x - mesh.points, axis=1)[nodes[bad[0]]].max())
            message = f"is {record.adjust:g}, which would invert cells {some(mesh.cell_number[cells[bad]])}"
            message += f": a node of {mesh.cell_number[cells[bad[0]]]} moves by {way:.4g}"
            raise wrong(record, f"adjust {message}; give a smaller one, a clearance, or a mesh without the gap")


def _check_kept(mesh: Mesh, done: Sequence[tuple[_Pair, Ints, float]], origin: Floats) -> None:
    """Raise CaseError if a later contact has moved nodes off the master of an earlier one."""
    for k, (pair, nodes, _) in enumerate(done):
        skins = np.union1d(nodes, pair.master.faces.distinct_nodes)
        for later, others, longest in done[k + 1 :]:
            if not len(np.intersect1d(skins, others)):
                continue
            now = pair._replace(master=pair.master.at(mesh.points))
            off = now.closest(mesh.points)
            off_by = np.where(off.face < 0, np.inf, np.linalg.norm(off.way, axis=1))[np.isin(pair.nodes, nodes)]
            if off_by.max(initial=0.0) > _KEPT * longest:
                at = nodes[int(off_by.argmax())]
                place, size = (mesh.points[at] + origin)[: mesh.space_dim], float(np.ptp(mesh.points, axis=0).max())
                where = ", ".join(format_coordinates(place, size))
                message = f"adjust moves nodes that {pair.record.name!r} has moved onto its master, as near ({where})"
                raise wrong(later.record, f"{message}; adjust one of the two only, or exchange their order")
