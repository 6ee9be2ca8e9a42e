"""The visible surface of a mesh, and the role of each face: of a body, of the slave skin, of the master.

    skin = the faces of the slave and of the master, with the cell behind each        (`_skin`)
    outer = facets of one cell only, cells of surfaces that lie on no solid           (`_outer`, `_loose`)

The cost is that of pairing the facets (`lacmesh.topology.facets`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.cutting.cut import is_cut
from lacmesh.errors import DataError, RequestError, some
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, mask_of, places_of
from lacmesh.topology.bodies import body_names, label_bodies
from lacmesh.topology.facets import ALONE, FACETS, Solid, pair_facets
from lacmesh.topology.skin import FACE_TYPES, Faces, cells_of_dim, find_owners, label_faces

Bools = NDArray[np.bool_]
Vector = tuple[float, float, float]
Groups = str | Sequence[str] | None

#: the largest coordinate that is drawn: squares of greater ones are no numbers
FARTHEST = 1e150
#: bodies of a mesh whose bodies are named
MOST_NAMED = 200
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
    cut_open: Bools
    macro: Ints
    internal: Ints
    body_of_node: Ints
    kept: Bools

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


def names_of_bodies(mesh: Mesh, visible: VisibleSurface) -> dict[int, str]:
    """Return the names that groups give the bodies in sight, for a sentence; none where there are very many bodies.

    >>> cells = [("QUAD4", [[0, 1, 2, 3], [4, 5, 6, 7]])]
    >>> points = [[x + k, y] for k in (0, 3) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    >>> mesh = Mesh.create(points, cells, cell_groups={"left": [0]})
    >>> names_of_bodies(mesh, find_visible(mesh))
    {0: "'left'"}
    """
    solid = [b.nodes for b in mesh.blocks if ALL_CELLS[b.type].dim == mesh.dim and len(b.nodes)]
    n = 1 + max((int(visible.body_of_node[nodes].max()) for nodes in solid), default=-1)
    if not 0 < n <= MOST_NAMED:
        return {}
    of_node = np.where(visible.body_of_node < n, visible.body_of_node, -1)
    names = body_names(mesh, of_node, n)
    return {k: names[k] for k in np.unique(visible.body).tolist() if k < n and "'" in names[k]}


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
    skin, skin_cell, behind = _skin(mesh, np.concatenate([slaves, masters]), kept)
    solid, solid_cell, cut_open = _outer(mesh, kept, skin)
    loose, loose_cell = _loose(mesh, kept, skin)
    faces = Faces.stack([solid, loose, skin])
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
    return Faces.join(parts), concatenated(ids for _, ids, _ in chosen)


def facets_of(mesh: Mesh, cells: Ints) -> tuple[Faces, Ints]:
    """Every facet of some solid cells, and the cell that it is of."""
    parts: list[tuple[str, Ints]] = []
    owners: list[Ints] = [np.empty(0, np.int64)]
    for kind, ids, nodes in mesh.select(cells):
        for facet in CELLS[drawn_as(kind)].facets:
            parts.append((facet.type, nodes[:, facet.nodes]))
            owners.append(ids)
    return Faces.join(parts), np.concatenate(owners)


def _outer(mesh: Mesh, kept: Bools, skin: Faces) -> tuple[Faces, Ints, Bools]:
    """Facets of one kept solid only, without those on `skin`; the cell of each; True if another was cut away."""
    if mesh.dim < 3:
        return Faces.join([]), np.empty(0, np.int64), np.empty(0, bool)
    whole = Solid.of(mesh)
    rows = np.flatnonzero(kept[whole.cells])
    opposite = pair_facets(whole)[0].reshape(-1, FACETS)
    cut_open = opposite[rows] != ALONE
    if len(rows) < len(whole.cells):
        opposite = pair_facets(whole.take(rows))[0].reshape(-1, FACETS)
    free = opposite == ALONE
    on_skin = find_owners(skin, _as_drawn(mesh, 3), mesh.n_nodes)
    place = places_of(whole.cells[rows], mesh.n_cells)
    known = place[on_skin.cell] >= 0
    free[place[on_skin.cell[known]], on_skin.facet[known]] = False
    row, facet = np.nonzero(free)
    faces, order = _pick(mesh, whole.cells[rows[row]], facet)
    return faces, whole.cells[rows[row[order]]], cut_open[row[order], facet[order]]


def _as_drawn(mesh: Mesh, *dims: int) -> Iterator[tuple[str, Ints, Ints]]:
    """Iterate over the cells of some dimensions as they are drawn: (type, nodes, indices)."""
    for dim in dims:
        for kind, nodes, cells in cells_of_dim(mesh, dim):
            yield drawn_as(kind), nodes[:, : CELLS[drawn_as(kind)].n_nodes], cells


def _pick(mesh: Mesh, cell: Ints, facet: Ints) -> tuple[Faces, Ints]:
    """Faces of some facets of solids, given by ascending cells, type by type; the rows of the list in that order."""
    parts, order = [], [np.empty(0, np.int64)]
    for kind, nodes, cells in _as_drawn(mesh, 3):
        low, high = np.searchsorted(cell, [cells[0], cells[-1] + 1]) if len(cells) else (0, 0)
        for j, side in enumerate(CELLS[kind].facets):
            rows = low + np.flatnonzero(facet[low:high] == j)
            if len(rows):
                parts.append((side.type, nodes[cell[rows] - cells[0]][:, side.nodes]))
                order.append(rows)
    return Faces.join(parts), np.concatenate(order)


def _loose(mesh: Mesh, kept: Bools, skin: Faces) -> tuple[Faces, Ints]:
    """Cells of surfaces that lie on no solid and not on `skin`; of lines too where there is no solid."""
    dims = mesh.cell_dim
    faces, cells = as_faces(mesh, np.flatnonzero(((dims == 2) | ((dims == 1) & (mesh.dim < 3))) & kept))
    label, count = label_faces(Faces.stack([skin, faces]))
    on_skin, mine = np.split(label, [len(skin)])
    taken = mask_of(count, on_skin)
    taken[mine[find_owners(faces, _as_drawn(mesh, 3), mesh.n_nodes).face]] = True
    rows = np.flatnonzero(~taken[mine])
    return faces.take(rows), cells[rows]


def _skin(mesh: Mesh, cells: Ints, kept: Bools) -> tuple[Faces, Ints, Ints]:
    """Slave and master faces in sight, each once: the faces, their cells, the cells behind (a kept one first)."""
    faces, ids = as_faces(mesh, cells)
    rows = np.sort(np.unique(label_faces(faces)[0], return_index=True)[1])  # a duplicate lies on the one that is drawn
    faces, ids = faces.take(rows), ids[rows]
    owners = find_owners(faces, _as_drawn(mesh, 2, 3), mesh.n_nodes)
    behind = ids.copy()
    order = np.argsort(kept[owners.cell], kind="stable")  # the kept ones last: they stay
    behind[owners.face[order]] = owners.cell[order]
    seen = np.flatnonzero(kept[behind])
    return faces.take(seen), ids[seen], behind[seen]


def _cells_of(mesh: Mesh, groups: Groups) -> Ints:
    """Sorted indices of the faces of some groups: the cells of the highest dimension among them, 1 or 2."""
    specs = [] if groups is None else [groups] if isinstance(groups, str) else list(groups)
    return _faces_among(mesh, np.unique(concatenated(map(mesh.cells_of, specs))))


def _faces_among(mesh: Mesh, cells: Ints) -> Ints:
    dims = mesh.cell_dim[cells]
    return cells[(dims == dims.max(initial=0)) & (dims < 3) & (dims > 0)]


def _slave_cells(mesh: Mesh, slave: Groups) -> Ints:
    """Indices of the slave faces: those of the groups, or all of a cut."""
    if slave is None:
        return _faces_among(mesh, np.flatnonzero(mesh.cell_data["lac_macro"] >= 0 if is_cut(mesh) else []))
    return _cells_of(mesh, slave)


def _kept(mesh: Mesh, slave: Ints, near: float | None, cutaway: Vector | None) -> Bools:
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


def used_nodes(mesh: Mesh) -> Bools:
    """True for nodes of any cell, (n_nodes,)."""
    return mask_of(mesh.n_nodes, *(block.nodes for block in mesh.blocks))


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
    body = label_bodies((b.nodes for b in mesh.blocks if ALL_CELLS[b.type].dim >= min(2, mesh.dim)), mesh.n_nodes)
    free = np.flatnonzero(body < 0)
    body[free] = body.max(initial=-1) + 1 + np.arange(len(free))
    return body


def _macros(mesh: Mesh, cells: Ints, slave: Bools) -> Ints:
    """Macro-element of each slave face, (s,); a face that is part of none counts by itself."""
    macro = mesh.cell_data["lac_macro"][cells] if is_cut(mesh) else np.full(len(cells), -1)
    macro = np.where(slave, macro, -1).astype(np.int64)
    alone = slave & (macro < 0)
    macro[alone] = macro.max(initial=-1) + 1 + np.arange(np.count_nonzero(alone))
    return macro


def _internal_nodes(mesh: Mesh, slaves: Faces) -> Ints:
    """Nodes of the slave faces that carry an internal dof."""
    owner = mesh.node_data.get("lac_internal")
    nodes = slaves.distinct_nodes
    return nodes[owner[nodes] >= 0] if owner is not None else nodes[:0]


def is_segment(faces: Faces) -> Bools:
    """True for faces that are segments, (f,)."""
    return np.isin(faces.type, [FACE_TYPES.index("SEG2"), FACE_TYPES.index("SEG3")])
