"""The split: a mesh divided along interior faces into two skins that touch, with the nodes between them doubled.

    groups = the faces of each group, all of them once                   (_groups)
    flipped = which of the two cells at each face is on its side a       (_second_is_a)
    division = the copies of nodes, and the corners of cells with them   (_divide)
    mesh = the cells with the copies, lower cells on them doubled        (_divided_mesh)
    the groups G_a, G_b, outward                                         (_with_skins)

Around a node, cells that share a facet are on one side, unless the mesh is divided along this facet. A node in the
middle of the faces has two sides; one where several sheets of faces meet has more; one on the front, where the faces
end inside the body, has one and stays closed. Cells that met at a node without a common facet still meet there.
`docs/split.md` says how front edges and junctions are treated.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS, CARRIED
from lacmesh.cutting.assemble import ChildCells, NewNodes, assemble, nodes_of
from lacmesh.cutting.records import is_cut
from lacmesh.cutting.select import check_numbers
from lacmesh.errors import CutError, DataError, LacmeshWarning, RequestError
from lacmesh.mesh import Block, Ints, Mesh, MeshLike, as_mesh, mask_of, spec_list
from lacmesh.topology.bodies import label_bodies, label_components
from lacmesh.topology.facets import ALONE, FACETS, Solid, pair_facets
from lacmesh.topology.orientation import (
    ONE_SIDED,
    OPEN,
    analyse_orientation,
    consistent_windings,
    face_normals,
    is_inverted,
    relative_listing,
    reverse,
    skin_cells,
)
from lacmesh.topology.skin import (
    Bools,
    FaceIncidence,
    Faces,
    cells_of_dim,
    distinct_faces,
    facets_of,
    find_owners,
    find_repeats,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array

#: means of normals, relative to the faces' area, below which a component counts as zero
_FLAT = 1e-9


@dataclass(frozen=True)
class Split:
    """A mesh that was divided along faces.

    `skins`: the groups of both sides of each group of faces, (a, b). `closed`: cells of the mesh before that stay
    closed, since all their corners would lie on the front. `n_sides`: for each node on the faces that opened, by how
    many sides meet there: 1 on the front, 2 between two sides, more at a junction; sorted by node, (k,). `bodies`:
    number of separate bodies before and after.
    """

    mesh: Mesh
    skins: Mapping[str, tuple[str, str]]
    closed: Ints
    n_sides: Ints
    bodies: tuple[int, int]


class _Division(NamedTuple):
    """The cells `solid` around the faces with their nodes in the mesh and in the divided mesh, `old` and `new` (k, n).

    Both are padded with -1. In the divided mesh the copies come after the old nodes; `copied` (c,): the node that each
    copy repeats, ascending.
    """

    solid: Solid
    old: Ints
    new: Ints
    copied: Ints

    def places(self, cell: Ints, node: Ints) -> Ints:
        """(p, c): places in `old`, flat, of nodes (p, c) in cells (p,); -1 where a cell does not have the node."""
        row = np.searchsorted(self.solid.cells, cell)
        here = (self.old[row][:, None] == node[:, :, None]) & (node >= 0)[:, :, None]
        return np.where(here.any(axis=2), row[:, None] * self.old.shape[1] + here.argmax(axis=2), -1)

    def renamed(self, cell: Ints, node: Ints) -> Ints:
        """(p, c): nodes in the divided mesh of nodes (p, c), each row as a cell (p,) has them."""
        place = self.places(cell, node)
        return np.where(place >= 0, self.new.ravel()[place], node)


def split(mesh: MeshLike, faces: str | int | Sequence[str | int]) -> Mesh:
    """Divide a mesh along the interior faces of a group G (or several) into two skins, the groups `G_a` and `G_b`.

    `mesh`: a mesh, or the path of its file. `faces`: a group or several, named as `Mesh.group` takes them, of faces
    inside a body; of edges in a plane mesh. Nodes on them are doubled, and the cells on side b take the copies; at a
    junction of several sheets of faces there is a node for each side. Where the faces end inside the body, on the front
    of a crack, nodes are shared and stay closed. The normals of the faces as listed point from side a to side b; where
    they do not agree, most of them decide. G then has the faces of both sides, as any group that had them. Copies of
    nodes follow the largest number, and enter the node groups of their nodes. Both skins point outward.

    Raises GroupNotFoundError and RequestError, DataError if the faces are none inside a body or cannot have two sides,
    CutError for a mesh that carries a cut.

    >>> cells = [("TRIA3", [[0, 1, 2], [2, 1, 3]]), ("SEG2", [[1, 2]])]
    >>> square = Mesh.create([[0, 0], [1, 0], [0, 1], [1, 1]], cells, cell_groups={"G": [2]})
    >>> parts = split(square, "G")
    >>> parts.n_nodes, {name: len(cells) for name, cells in parts.cell_groups.items()}
    (6, {'G': 2, 'G_a': 1, 'G_b': 1})
    """
    return split_skins(as_mesh(mesh), spec_list(faces)).mesh


def split_skins(mesh: Mesh, specs: Sequence[str]) -> Split:
    """Divide a mesh as `split` does, and return it with the sides at its nodes."""
    if is_cut(mesh):
        raise CutError("this mesh carries a cut, whose macro-elements a split would change; split first, then cut")
    check_numbers(mesh)
    groups, faces = _groups(mesh, specs)
    owners = find_owners(faces, cells_of_dim(mesh, mesh.dim), mesh.n_nodes)
    _check_owners(mesh, groups, faces, owners)
    known, flipped = (np.zeros(len(faces), bool) for _ in range(2))
    by_group = []  # (m,) rows of faces and True where the second cell is on side a; a face's first group decides
    for name, on in groups.items():
        rows = np.unique(on.face)
        try:
            second = _second_is_a(mesh, faces.take(rows), owners.take((2 * rows[:, None] + np.arange(2)).ravel()))
        except DataError as error:
            raise DataError(f"the group {name!r} {error}", error.cells) from None
        by_group.append((rows, second))
        flipped[rows] = np.where(known[rows], flipped[rows], second)
        known[rows] = True
    division, opened = _divide(mesh, faces, [_side(owners, flipped), _side(owners, ~flipped)])
    closed = _closed(mesh, groups, opened)
    if mesh.model is not None and mesh.model.periodic:
        message = "the mesh has periodic links: the copies of nodes on them have no periodic partner"
        warnings.warn(message, LacmeshWarning, stacklevel=3)
    new = _divided_mesh(mesh, division)
    skins: dict[str, tuple[str, str]] = {}
    for name, (rows, second) in zip(groups, by_group, strict=True):
        skins[name] = f"{name}_a", f"{name}_b"
        at = opened[rows]
        cells = [owners.cell[2 * rows[at] + side[at]] for side in (second, ~second)]
        new = _with_skins(new, division, faces.take(rows[at]), cells, skins[name])
    nodes = faces.take(np.flatnonzero(opened)).distinct_nodes
    n_sides = 1 + np.bincount(division.copied, minlength=mesh.n_nodes)[nodes]
    bodies = [int(label_bodies([Solid.of(m).corners], m.n_nodes).max(initial=-1)) + 1 for m in (mesh, new)]
    return Split(new, skins, closed, n_sides, (bodies[0], bodies[1]))


def _groups(mesh: Mesh, specs: Sequence[str]) -> tuple[dict[str, FaceIncidence], Faces]:
    """Return the cells of each group on the faces, and the faces under all of them, each once."""
    if not specs:
        raise RequestError("no group of faces was given")
    names = [
        spec if spec.startswith("entity:") and spec not in mesh.cell_groups else mesh.group(spec) for spec in specs
    ]
    if len(set(names)) < len(names):
        raise RequestError(f"a group is given twice: {', '.join(names)}")
    taken = [name + end for name in names for end in ("_a", "_b") if name + end in mesh.cell_groups]
    if taken:
        raise RequestError(f"the mesh has a group {taken[0]!r} already, the name of a side; rename it")
    parts = []
    for name in names:
        if not len(mesh.cells_of(name)):
            raise DataError(f"the group {name!r} is empty: it has no faces to split the mesh along")
        parts.append(cells := skin_cells(mesh, name))
        if (dim := int(mesh.cell_dim[cells[0]])) != mesh.dim - 1:
            what = f"{('', 'lines', 'surfaces')[dim]} ({mesh.cell_names(cells)})"
            message = f"the group {name!r} has {what}; this mesh is split along cells of dimension {mesh.dim - 1}"
            raise DataError(message, mesh.cell_number[cells])
    faces, _ = distinct_faces(mesh, np.unique(np.concatenate(parts)))
    on = (find_repeats(faces, [(k, nodes, ids) for k, ids, nodes in mesh.select(c)], mesh.n_nodes) for c in parts)
    return {
        name: cells.take(np.argsort(cells.cell, kind="stable")) for name, cells in zip(names, on, strict=True)
    }, faces


def _check_owners(mesh: Mesh, groups: dict[str, FaceIncidence], faces: Faces, owners: FaceIncidence) -> None:
    """Check that each face lies between two cells. Raises DataError."""
    count = np.bincount(owners.face, minlength=len(faces))
    differs = mask_of(len(faces), owners.face[~owners.same])
    for name, on in groups.items():
        behind = count[on.face]
        for wrong, why in (
            (behind == 0, "are not facets of any cell, so there is nothing to split; gmsh saves only the cells of "
             "physical groups: is the body in one, and were the faces embedded in it?"),
            (behind == 1, "lie on the surface of the body; name faces inside the body, between two cells"),
            (behind > 2, "have more than two cells on them: the mesh is not a manifold there"),
            (differs[on.face], "and the cells on them do not have the same mid-nodes: elevate the order of both "
             "alike"),
        ):  # fmt: skip
            if wrong.any():
                cells = on.cell[wrong]
                raise DataError(f"faces {mesh.cell_names(cells)} of the group {name!r} {why}", mesh.cell_number[cells])


def _side(owners: FaceIncidence, second: Bools) -> FaceIncidence:
    """Return one of the two cells of each face, (f,): the second ones where `second`."""
    return owners.take(2 * np.arange(len(second)) + second)


def _second_is_a(mesh: Mesh, faces: Faces, owners: FaceIncidence) -> Bools:
    """(f,): True for faces whose side a is their second cell: the normals of the faces point from side a to side b.

    Where faces of one sheet do not agree, most of them decide; a closed sheet has its side a inside. If as many faces
    point one way as the other, side b is where x grows along the mean normal, or else y, or z.
    Raises DataError for a sheet with one side only, and for faces that their two cells list alike.
    """
    flip, kind, sheet = consistent_windings(mesh, faces)
    if (kind == ONE_SIDED).any():
        raise DataError("has one side only, like a Moebius strip, and cannot be split")
    n = np.bincount(sheet)
    half = (2 * np.bincount(sheet, flip) == n) & (np.bincount(sheet, kind == OPEN) == n)
    normal = face_normals(mesh, faces) * np.where(flip, -1.0, 1.0)[:, None]
    size = np.bincount(sheet, np.linalg.norm(normal, axis=1))
    mean = np.stack([np.bincount(sheet, normal[:, k]) for k in range(3)], axis=1)
    mean[np.abs(mean) <= _FLAT * size[:, None]] = 0
    leading = np.take_along_axis(mean, (mean != 0).argmax(axis=1)[:, None], axis=1)[:, 0]
    flip ^= (half & (leading < 0))[sheet]
    agrees = []
    for side in (_side(owners, np.full(len(faces), second)) for second in (False, True)):
        listed = relative_listing(faces, facets_of(mesh, side)) % 2 == 0
        agrees.append(listed ^ is_inverted(mesh, side.cell, mesh.space_dim == 2) ^ flip)
    alike = np.flatnonzero(agrees[0] == agrees[1])
    if len(alike):
        cells = owners.cell[np.concatenate([2 * alike, 2 * alike + 1])]
        message = "has a face whose two cells lie on the same side of it, or are oriented differently "
        raise DataError(f"{message}({mesh.cell_names(cells)}); see lacmesh check", mesh.cell_number[cells])
    return agrees[1]


# ---- sides of nodes


def _divide(mesh: Mesh, faces: Faces, sides: list[FaceIncidence]) -> tuple[_Division, Bools]:
    """Divide a mesh along faces; return the nodes of the cells around them, and True for faces that open (f,).

    The cells on side a keep the nodes, the others take copies. A face that would have the same corners on both sides,
    all of them on the front, is not opened, which moves the front. Raises DataError for cells of order 3 and higher at
    the faces.
    """
    touched = mask_of(mesh.n_nodes, faces.distinct_nodes)
    solid = Solid.of(mesh)
    solid = solid.take(np.flatnonzero((touched[solid.corners] & (solid.corners >= 0)).any(axis=1)))
    listed = list(mesh.select(solid.cells))
    old = np.full((len(solid.cells), max(nodes.shape[1] for *_, nodes in listed)), -1, np.int64)
    for kind, cells, nodes in listed:
        if kind in CARRIED:
            message = f"has cells of type {kind}, of order 3 or higher, at it ({mesh.cell_names(cells)})"
            raise DataError(f"{message}; they are not split", mesh.cell_number[cells])
        old[np.searchsorted(solid.cells, cells), : nodes.shape[1]] = nodes
    division = _Division(solid, old, old, np.empty(0, np.int64))
    # the cells around each node are linked over each facet with this node that they share
    opposite, _ = pair_facets(solid)
    number = np.flatnonzero(opposite > np.maximum(np.arange(len(opposite)), ALONE))
    cell, facet = np.divmod(np.stack([number, opposite[number]]), FACETS)
    cell = solid.cells[cell]
    owners = FaceIncidence(np.arange(len(number)), cell[0].astype(np.int64), facet[0], np.ones(len(number), bool))
    nodes = facets_of(mesh, owners).nodes
    nodes = np.where(touched[nodes], nodes, -1)
    links = np.stack([division.places(beside, nodes) for beside in cell])
    pair, column = np.nonzero((links >= 0).all(axis=0))  # mid-nodes that differ link nothing
    links = links[:, pair, column]
    whole = label_components(links[0], links[1], old.size)
    numbers = [np.searchsorted(solid.cells, side.cell) * FACETS + side.facet for side in sides]
    pair_of_face = np.searchsorted(number, np.minimum(*numbers))
    a, b = (division.places(side.cell, faces.nodes) for side in sides)
    corner = faces.corners >= 0
    opened = np.ones(len(faces), bool)
    while True:
        linked = ~np.isin(pair, pair_of_face[opened])
        part = label_components(links[0, linked], links[1, linked], old.size)
        new, copied = _with_copies(old, mesh.n_nodes, whole, part, a[opened][a[opened] >= 0])
        closed = opened & ~((new.ravel()[a] != new.ravel()[b])[:, : corner.shape[1]] & corner).any(axis=1)
        if not closed.any():
            return division._replace(new=new, copied=copied), opened
        opened &= ~closed


def _with_copies(old: Ints, n_nodes: int, whole: Ints, part: Ints, keeps: Ints) -> tuple[Ints, Ints]:
    """Return the nodes of cells in the divided mesh, as `old`, and the node that each copy repeats.

    The parts (m,) of what was one around a node, `whole` (m,), have a node each. The part with one of the places
    `keeps` has the old node, or else the first.
    """
    first, label = np.unique(part, return_index=True, return_inverse=True)[1:]
    behind = np.ones(len(first), bool)
    behind[label[keeps]] = False
    order = np.lexsort((first, behind, whole[first]))
    copy = order[1:][whole[first[order[1:]]] == whole[first[order[:-1]]]]
    node = old.ravel()[first]
    copy = copy[np.argsort(node[copy], kind="stable")]
    copied = node[copy]
    node[copy] = n_nodes + np.arange(len(copy))
    return node[label].reshape(old.shape), copied


def _closed(mesh: Mesh, groups: dict[str, FaceIncidence], opened: Bools) -> Ints:
    """Return the cells of the groups on faces that stay closed, and warn of them. Raises DataError if all do."""
    cells = np.unique(np.concatenate([on.cell[~opened[on.face]] for on in groups.values()]))
    for name, on in groups.items():
        if not opened[on.face].any():
            why = "all corners of each lie on the front, whose nodes are not doubled; refine the mesh there"
            raise DataError(f"no face of the group {name!r} can open: {why}", mesh.cell_number[on.cell])
    if len(cells):
        why = "all their corners lie on the front, whose nodes are not doubled; refine the mesh there to open them"
        message = f"faces {mesh.cell_names(cells)} stay closed and are on neither side: {why}"
        warnings.warn(message, LacmeshWarning, stacklevel=4)
    return cells


# ---- the mesh


def _divided_mesh(mesh: Mesh, division: _Division) -> Mesh:
    """Return the mesh with its nodes copied and the lower cells on them doubled, one for each side at their nodes."""
    copied = division.copied[:, None]
    new_nodes = NewNodes("POI1", copied, np.empty((1, 0)), mesh.n_nodes + np.arange(len(copied))[:, None], copied)
    on_copies = mask_of(mesh.n_nodes, division.copied)
    around = _incidence(division.solid.corners, mesh.n_nodes).T.tocsr()
    cells = division.solid.cells
    blocks, children = [], []
    for k, (kind, listed) in enumerate(mesh.blocks):
        nodes = listed.copy()
        if ALL_CELLS[kind].dim == mesh.dim:
            rows = slice(*np.searchsorted(cells, mesh.offsets[k : k + 2]))
            nodes[cells[rows] - mesh.offsets[k]] = division.new[rows, : nodes.shape[1]]
        elif len(lower := np.flatnonzero(on_copies[listed].any(axis=1))):
            corners = listed[lower][:, : ALL_CELLS[kind].n_corners]
            shared = (_incidence(corners, mesh.n_nodes) @ around).tocoo()  # number of corners in each cell around
            inside = shared.data == corners.shape[1]
            row, beside = lower[shared.row[inside]], cells[shared.col[inside]]
            variants = np.unique(np.column_stack([row, division.renamed(beside, listed[row])]), axis=0)
            first, count = np.unique(variants[:, 0], return_index=True, return_counts=True)[1:]
            index = np.arange(len(variants)) - np.repeat(first, count)
            single = variants[first[count == 1]]
            nodes[single[:, 0]] = single[:, 1:]
            several = variants[np.repeat(count, count) > 1]
            index = index[np.repeat(count, count) > 1]
            children.append(ChildCells(kind, several[:, 1:], mesh.offsets[k] + several[:, 0], index))
        blocks.append(Block(kind, nodes))
    new = replace(mesh, blocks=tuple(blocks), **nodes_of(mesh, [new_nodes], True))
    return assemble(new, [], children, extend=True)[0]


def _incidence(corners: Ints, n_nodes: int) -> csr_array:
    """(k, n_nodes): 1 where a cell has a node for a corner; `corners` (k, c), padded with -1."""
    from scipy.sparse import csr_array

    row, column = np.nonzero(corners >= 0)
    return csr_array((np.ones(len(row), np.int8), (row, corners[row, column])), shape=(len(corners), n_nodes))


def _with_skins(mesh: Mesh, division: _Division, faces: Faces, cells: list[Ints], names: tuple[str, str]) -> Mesh:
    """Return the divided mesh with the skins on both sides of faces, outward; `cells`: the cells there, (f,) each."""
    group = names[0].removesuffix("_a")
    parts = [(kind, nodes, members) for kind, members, nodes in mesh.select(mesh.cells_of(group))]
    skins = []
    for beside in cells:
        on = find_repeats(Faces(faces.type, division.renamed(beside, faces.nodes)), parts, mesh.n_nodes)
        skins.append(np.sort(on.cell[np.unique(on.face, return_index=True)[1]]))
    turned = reverse(mesh, analyse_orientation(mesh, np.sort(np.concatenate(skins))).to_flip)
    return replace(turned, cell_groups={**turned.cell_groups, **dict(zip(names, skins, strict=True))})
