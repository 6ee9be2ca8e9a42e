"""The visible surface of a mesh, and the role of each face: of a body, of the slave skin, of the master.

    keys = a number for each facet of each solid cell, the same from both sides      (`FaceKeys`)
    outer = facets of one cell only, cells of surfaces that lie on no solid           (`_outer`, `_loose`)
    skin = the faces of the slave and of the master, with the cell behind each        (`_skin`)

The cost is one pass over the cells and one sort of their facets' keys.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.cutting.cut import is_cut
from lacmesh.errors import DataError, RequestError, some
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.topology.skin import FACE_TYPES, Faces, find_owners

Vector = tuple[float, float, float]
Groups = str | Sequence[str] | None

#: the largest coordinate that is drawn: squares of greater ones are no numbers
FARTHEST = 1e150
#: what a face is
BODY, SLAVE, MASTER = range(3)


@dataclass(frozen=True)
class VisibleSurface:
    """The visible faces, a row each (segments too: slave and master of a plane mesh, and all of a mesh of lines).

    `role` (f,) BODY, SLAVE or MASTER; `cell` (f,) the cell behind the face, or the face's own where there is none;
    `skin` (f,) the slave or master cell that the face is, -1 in bodies; `body` (f,) which body it is of; `cut_open`
    (f,) True if a cutaway shows it; `macro` (f,) the macro-element of a slave face, -1 elsewhere (in a mesh that
    carries no cut, each slave face counts for itself). `internal` (n,): nodes that carry an internal dof.
    `body_of_node` (n_nodes,): the body that each node of the mesh is of; `kept` (n_cells,): whether `near` and
    `cutaway` leave a cell.
    """

    faces: Faces
    role: Ints
    cell: Ints
    skin: Ints
    body: Ints
    cut_open: NDArray[np.bool_]
    macro: Ints
    internal: Ints
    body_of_node: Ints
    kept: NDArray[np.bool_]

    def rows(self, role: int) -> Ints:
        """The rows of faces of a role."""
        return np.flatnonzero(self.role == role)

    @cached_property
    def slave_bodies(self) -> Ints:
        """The bodies that carry slave faces."""
        return np.unique(self.body[self.role == SLAVE])

    @property
    def hidden(self) -> bool:
        """True if another body is in sight, which may hide the slave skin."""
        return bool(len(self.slave_bodies)) and not np.isin(self.body, self.slave_bodies).all()


def find_visible(
    mesh: Mesh,
    slave: Groups = None,
    master: Groups = None,
    *,
    near: float | None = None,
    cutaway: Vector | None = None,
) -> VisibleSurface:
    """The visible surface of a mesh; `view.picture` explains the options.

    Raises RequestError, GroupNotFoundError, DataError.
    """
    far = np.flatnonzero(used_nodes(mesh) & (np.abs(mesh.points) > FARTHEST).any(axis=1))
    if len(far):
        numbers = some(mesh.node_number[far])
        raise DataError(f"nodes {numbers} lie too far away for anything to be drawn; correct their coordinates")
    slaves = _slave_cells(mesh, slave)
    masters = np.setdiff1d(_cells_of(mesh, master), slaves)
    kept = _kept(mesh, slaves, near, cutaway)
    keys = FaceKeys(mesh)
    skin, skin_cell, behind = _skin(mesh, np.concatenate([slaves, masters]), kept, keys)
    taken = np.sort(keys.of(skin))
    solid, solid_cell, cut_open = _outer(mesh, kept, keys, taken)
    loose, loose_cell = _loose(mesh, kept, keys, taken)
    faces = stack([solid, loose, skin])
    if not len(faces):
        raise RequestError("there is nothing to draw: no cells of dimension 1, 2 or 3, or none left in sight")
    role = np.repeat([BODY, BODY, SLAVE], [len(solid), len(loose), len(skin)])
    role[len(solid) + len(loose) :][np.isin(skin_cell, masters)] = MASTER
    body = _bodies(mesh)
    plain = np.full(len(solid) + len(loose), -1)
    return VisibleSurface(
        faces=faces,
        role=role,
        cell=np.concatenate([solid_cell, loose_cell, behind]),
        skin=np.concatenate([plain, skin_cell]),
        body=body[faces.nodes[:, 0]],
        cut_open=np.concatenate([cut_open, np.zeros(len(loose) + len(skin), bool)]),
        macro=np.concatenate([plain, _macros(mesh, skin_cell, role[len(plain) :] == SLAVE)]),
        internal=_internal_nodes(mesh, skin.take(np.flatnonzero(role[len(plain) :] == SLAVE))),
        body_of_node=body,
        kept=kept,
    )


def drawn_as(kind: str) -> str:
    """The type that a cell is drawn as: itself, or its corners alone where its order is above 2."""
    return kind if kind in CELLS else ALL_CELLS[kind].linear


def as_faces(mesh: Mesh, cells: Ints) -> tuple[Faces, Ints]:
    """Cells of dimension 1 and 2 as faces, and their indices, type by type."""
    chosen = list(mesh.select(cells))
    kinds = [drawn_as(kind) for kind, _, _ in chosen]
    parts = [(kind, nodes[:, : CELLS[kind].n_nodes]) for kind, (_, _, nodes) in zip(kinds, chosen, strict=True)]
    return Faces.join(parts), np.concatenate([np.empty(0, np.int64), *(ids for _, ids, _ in chosen)])


def facets_of(mesh: Mesh, cells: Ints) -> tuple[Faces, Ints]:
    """Every facet of some solid cells, and the cell that it is of."""
    parts: list[tuple[str, Ints]] = []
    owners: list[Ints] = [np.empty(0, np.int64)]
    for kind, ids, nodes in mesh.select(cells):
        for facet in CELLS[drawn_as(kind)].facets:
            parts.append((facet.type, nodes[:, facet.nodes]))
            owners.append(ids)
    return Faces.join(parts), np.concatenate(owners)


class FaceKeys:
    """A number for each face that does not depend on how its corners are listed: the sum of one for each node.

    Numbers of 64 bits, drawn at random: that two different faces of a mesh share one is less likely than a fault of
    the machine, and where solid facets meet a second draw has to agree (`solid`).
    """

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh
        self._weights, self._second = (
            np.append(np.random.default_rng(seed).integers(1, 1 << 63, mesh.n_nodes, np.uint64), np.uint64(0))
            for seed in (1, 2)
        )

    def of(self, faces: Faces) -> NDArray[np.uint64]:
        """Keys of some faces, (f,)."""
        return self._sum(faces.corners.T, self._weights)

    @cached_property
    def solid(self) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Keys and second keys of every facet of every solid cell, in the order of `blocks`."""
        parts = [(block, facet) for block, facets in self.blocks for facet in facets]
        keys = [[self._sum(block[:, corners].T, w) for block, corners in parts] for w in (self._weights, self._second)]
        first, second = (np.concatenate([np.empty(0, np.uint64), *k]) for k in keys)
        return first, second

    @cached_property
    def blocks(self) -> list[tuple[Ints, list[tuple[int, ...]]]]:
        """The nodes of solid cells, a block a type, and the corners of each facet."""
        found = []
        for block in self._mesh.blocks:
            facets = CELLS[drawn_as(block.type)].facets if ALL_CELLS[block.type].dim == 3 else ()
            if facets:
                found.append((block.nodes, [f.nodes[: CELLS[f.type].n_corners] for f in facets]))
        return found

    @staticmethod
    def _sum(corners: Ints, weights: NDArray[np.uint64]) -> NDArray[np.uint64]:
        total = weights[corners[0]]
        for corner in corners[1:]:
            total = total + weights[corner]
        return total


def _outer(mesh: Mesh, kept: NDArray[np.bool_], keys: FaceKeys, taken: NDArray) -> tuple[Faces, Ints, NDArray]:
    """Facets of one kept solid only, those in `taken` left out; the cell of each; True if another was cut away."""
    first, second = keys.solid
    facet, cut_open = np.arange(len(first)), np.zeros(len(first), bool)
    solid = _solid_cells(mesh)
    owner = np.concatenate([np.empty(0, np.int64), *(np.tile(ids, n) for ids, n in solid)])
    if not kept.all():
        gone = np.sort(first[~kept[owner]])
        facet = np.flatnonzero(kept[owner])
        cut_open = _among(first[facet], gone)
    once = _single(first[facet], second[facet])
    once = once[~_among(first[facet[once]], taken)]
    return _pick(mesh, facet[once]), owner[facet[once]], cut_open[once]


def _solid_cells(mesh: Mesh) -> list[tuple[Ints, int]]:
    """Indices of the solid cells of each block, and how many facets they have."""
    return [
        (np.arange(mesh.offsets[k], mesh.offsets[k + 1]), len(CELLS[drawn_as(b.type)].facets))
        for k, b in enumerate(mesh.blocks)
        if ALL_CELLS[b.type].dim == 3
    ]


def _single(first: NDArray, second: NDArray) -> Ints:
    """Rows whose key occurs once."""
    order = np.argsort(first)
    key, check = first[order], second[order]
    same = (key[1:] == key[:-1]) & (check[1:] == check[:-1])
    alone = np.ones(len(order), bool)
    alone[1:] &= ~same
    alone[:-1] &= ~same
    return np.sort(order[alone])


def _among(values: NDArray, ordered: NDArray) -> NDArray[np.bool_]:
    """True for each value that is in a sorted list."""
    if not len(ordered):
        return np.zeros(len(values), bool)
    return ordered[np.minimum(np.searchsorted(ordered, values), len(ordered) - 1)] == values


def _pick(mesh: Mesh, facet: Ints) -> Faces:
    """Faces of some facets, given by their ascending positions in the list of all facets of solids."""
    parts, start = [], 0
    for block in mesh.blocks:
        if ALL_CELLS[block.type].dim < 3:
            continue
        for side in CELLS[drawn_as(block.type)].facets:
            low, high = np.searchsorted(facet, [start, start + len(block.nodes)])
            if high > low:
                parts.append((side.type, block.nodes[facet[low:high] - start][:, side.nodes]))
            start += len(block.nodes)
    return Faces.join(parts)


def _loose(mesh: Mesh, kept: NDArray[np.bool_], keys: FaceKeys, taken: NDArray) -> tuple[Faces, Ints]:
    """Cells of surfaces that lie on no solid, of lines too where there is no solid; those in `taken` are left out."""
    dims = mesh.cell_dim
    faces, cells = as_faces(mesh, np.flatnonzero(((dims == 2) | ((dims == 1) & (mesh.dim < 3))) & kept))
    if not len(faces):
        return faces, cells
    key = keys.of(faces)
    free = ~_among(key, taken)
    if mesh.dim == 3:
        free &= ~_among(key, np.sort(keys.solid[0]))
    rows = np.flatnonzero(free)
    return faces.take(rows), cells[rows]


def _skin(mesh: Mesh, cells: Ints, kept: NDArray[np.bool_], keys: FaceKeys) -> tuple[Faces, Ints, Ints]:
    """Slave and master faces in sight, each once: the faces, their cells, the cells behind (a kept one first)."""
    faces, ids = as_faces(mesh, cells)
    rows = np.sort(np.unique(keys.of(faces), return_index=True)[1])  # a duplicate lies on the one that is drawn
    faces, ids = faces.take(rows), ids[rows]
    solids = ((b.type, b.nodes, np.arange(mesh.offsets[k], mesh.offsets[k + 1])) for k, b in enumerate(mesh.blocks))
    linear = ((drawn_as(kind), nodes[:, : CELLS[drawn_as(kind)].n_nodes], i) for kind, nodes, i in solids)
    found = find_owners(faces, linear, mesh.n_nodes)
    behind = ids.copy()
    order = np.argsort(kept[found.cell], kind="stable")  # the kept ones last: they stay
    behind[found.face[order]] = found.cell[order]
    shown = np.flatnonzero(kept[behind])
    return faces.take(shown), ids[shown], behind[shown]


def stack(parts: Sequence[Faces]) -> Faces:
    """Faces, one part after the other."""
    return Faces(np.concatenate([p.type for p in parts]), np.vstack([p.nodes for p in parts]))


def _cells_of(mesh: Mesh, groups: Groups) -> Ints:
    """Sorted indices of the faces of some groups: the cells of the highest dimension among them, 1 or 2."""
    specs = [] if groups is None else [groups] if isinstance(groups, str) else list(groups)
    return _faces_among(mesh, np.unique(np.concatenate([np.empty(0, np.int64), *map(mesh.cells_of, specs)])))


def _faces_among(mesh: Mesh, cells: Ints) -> Ints:
    dims = mesh.cell_dim[cells]
    return cells[(dims == dims.max(initial=0)) & (dims < 3) & (dims > 0)]


def _slave_cells(mesh: Mesh, slave: Groups) -> Ints:
    """Indices of the slave faces: those of the groups, or all of a cut."""
    if slave is None:
        return _faces_among(mesh, np.flatnonzero(mesh.cell_data["lac_macro"] >= 0 if is_cut(mesh) else []))
    return _cells_of(mesh, slave)


def _kept(mesh: Mesh, slave: Ints, near: float | None, cutaway: Vector | None) -> NDArray[np.bool_]:
    """True for cells whose centre is near enough and not cut away, (n_cells,). Raises RequestError."""
    kept = np.ones(mesh.n_cells, bool)
    if near is None and cutaway is None:
        return kept
    centres = np.concatenate([np.empty((0, 3)), *(mesh.points[b.nodes].mean(axis=1) for b in mesh.blocks)])
    if near is not None:
        from scipy.spatial import cKDTree

        on_skin = np.unique(np.concatenate([np.empty(0, int), *(n.ravel() for _, _, n in mesh.select(slave))]))
        if not len(on_skin):
            raise RequestError("near means near slave faces, and there are none; name them")
        kept &= cKDTree(mesh.points[on_skin]).query(centres)[0] <= near * diagonal(mesh.points[used_nodes(mesh)])
    if cutaway is not None and kept.any():
        along = centres @ unit(cutaway)
        kept &= along <= (along[kept].min() + along[kept].max()) / 2
    return kept


def used_nodes(mesh: Mesh) -> NDArray[np.bool_]:
    """True for nodes of any cell, (n_nodes,)."""
    used = np.zeros(mesh.n_nodes, bool)
    for block in mesh.blocks:
        used[block.nodes] = True
    return used


def unit(v: Any) -> Floats:
    """Unit vector along `v`; the zero vector stays zero."""
    v = np.asarray(v, float)
    largest = float(np.abs(v).max())
    if not largest > 0:
        return np.zeros(3)
    v = v / largest  # squares of very large and very small numbers are none
    return v / float(np.linalg.norm(v))


def diagonal(points: Floats) -> float:
    """The diagonal of the box around some points."""
    return float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 0.0


def _bodies(mesh: Mesh) -> Ints:
    """Body of each node, (n_nodes,); cells that share a node are of one body (lines count in a mesh of lines)."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    blocks = [b.nodes for b in mesh.blocks if ALL_CELLS[b.type].dim >= min(2, mesh.dim)]
    n_cells = sum(len(b) for b in blocks)
    # a graph of cells and nodes, as rows of their nodes: no sorting
    lengths = np.concatenate([np.zeros(1, np.int64), *(np.full(len(b), b.shape[1]) for b in blocks)])
    starts = np.concatenate([np.cumsum(lengths), np.full(mesh.n_nodes, lengths.sum())])
    nodes = np.concatenate([np.empty(0, np.int64), *(b.ravel() for b in blocks)])
    size = n_cells + mesh.n_nodes
    dtype = np.int32 if max(size, len(nodes)) < 1 << 31 else np.int64
    ends = (nodes + n_cells).astype(dtype)
    graph = csr_matrix((np.ones(len(ends), np.int8), ends, starts.astype(dtype)), shape=(size, size))
    label = connected_components(graph, directed=True, connection="weak")[1][n_cells:]
    _, first, label = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[label] if len(first) else label  # counted in the order of the nodes


def _macros(mesh: Mesh, cells: Ints, slave: NDArray[np.bool_]) -> Ints:
    """Macro-element of each slave face, (s,); a face that is part of none counts by itself."""
    macro = mesh.cell_data["lac_macro"][cells] if is_cut(mesh) else np.full(len(cells), -1)
    macro = np.where(slave, macro, -1).astype(np.int64)
    alone = slave & (macro < 0)
    macro[alone] = macro.max(initial=-1) + 1 + np.arange(np.count_nonzero(alone))
    return macro


def _internal_nodes(mesh: Mesh, slaves: Faces) -> Ints:
    """Nodes of the slave faces that carry an internal dof."""
    owner = mesh.node_data.get("lac_internal")
    nodes = np.unique(slaves.nodes[slaves.nodes >= 0])
    return nodes[owner[nodes] >= 0] if owner is not None else nodes[:0]


def is_segment(faces: Faces) -> NDArray[np.bool_]:
    """True for faces that are segments, (f,)."""
    return np.isin(faces.type, [FACE_TYPES.index("SEG2"), FACE_TYPES.index("SEG3")])
