"""The split: a mesh divided along interior faces into two skins that touch, with the nodes between them doubled.

    groups = the faces of each group, all of them once        (_groups)
    sides = the cells on their sides a and b                  (topology.division)
    nodes, opened = the copies of nodes, and who takes them   (topology.division)
    children = the faces, and lower cells on them, doubled    (_doubled)
    mesh = the mesh with all this, and the groups G_a, G_b

`docs/split.md` says how front edges and junctions are treated.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.assemble import assemble, nodes_of
from lacmesh.cutting.records import Origin, is_cut
from lacmesh.cutting.select import check_numbers
from lacmesh.cutting.subdivide import ChildCells, NewNodes
from lacmesh.errors import CutError, DataError, LacmeshWarning, RequestError
from lacmesh.mesh import Block, Ints, Mesh, MeshLike, as_mesh, mask_of, positions, spec_list
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.division import Bools, CellNodes, FaceSides, divide, second_is_a
from lacmesh.topology.faces import cells_of_dim, distinct_faces
from lacmesh.topology.facets import Solid
from lacmesh.topology.orientation import analyse_orientation, reverse, skin_cells
from lacmesh.topology.skin import FaceIncidence, Faces, find_owners, find_repeats


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


class _Group(NamedTuple):
    """A group of faces: its name, its cells (c,), and the face (c,) that each cell lies on."""

    name: str
    cells: Ints
    face: Ints


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
    """Divide a mesh as `split` does, and return it with what was found at its nodes."""
    if is_cut(mesh):
        raise CutError("this mesh carries a cut, whose skins a split would change; split the mesh before it is cut")
    check_numbers(mesh)
    groups, faces = _groups(mesh, specs)
    owners = find_owners(faces, cells_of_dim(mesh, mesh.dim), mesh.n_nodes)
    _check_owners(mesh, groups, faces, owners)
    sides, exchanged = _sides(mesh, groups, faces, FaceSides.of(owners))
    nodes, opened = divide(mesh, faces, sides)
    closed = _closed(mesh, groups, opened)
    groups = [group._replace(face=np.where(opened[group.face], group.face, -1)) for group in groups]
    new, places = _divided(mesh, nodes)
    skins: dict[str, tuple[str, str]] = {}
    for group, other in zip(groups, exchanged, strict=True):
        new, skins[group.name] = _with_skins(new, group, sides.exchanged(other), places)
    on = faces.take(np.flatnonzero(opened)).distinct_nodes
    n_sides = 1 + np.bincount(nodes.copied, minlength=mesh.n_nodes)[on]
    return Split(new, skins, closed, n_sides, (_n_bodies(mesh), _n_bodies(new)))


def _groups(mesh: Mesh, specs: Sequence[str]) -> tuple[list[_Group], Faces]:
    """Return the groups of faces, and the faces under all of them, each once."""
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
    cells = [_faces_of_group(mesh, name) for name in names]
    faces, _ = distinct_faces(mesh, np.unique(np.concatenate(cells)))
    groups = []
    for name, own in zip(names, cells, strict=True):
        on = find_repeats(
            faces, [(kind, nodes, some) for kind, some, nodes in mesh.select(own)], mesh.n_nodes
        ).by_cell()
        groups.append(_Group(name, on.cell, on.face))
    return groups, faces


def _faces_of_group(mesh: Mesh, name: str) -> Ints:
    cells = mesh.cells_of(name)
    if not len(cells):
        raise DataError(f"the group {name!r} is empty: it has no faces to split the mesh along")
    cells = skin_cells(mesh, name)
    dim = int(mesh.cell_dim[cells[0]])
    if dim != mesh.dim - 1:
        what = ("", "lines", "surfaces")[dim]
        message = f"the group {name!r} has {what} ({mesh.cell_names(cells)}); a mesh of dimension {mesh.dim} is split "
        raise DataError(f"{message}along cells of dimension {mesh.dim - 1}", mesh.cell_number[cells])
    return cells


def _check_owners(mesh: Mesh, groups: list[_Group], faces: Faces, owners: FaceIncidence) -> None:
    """Check that each face lies between two cells. Raises DataError."""
    count = np.bincount(owners.face, minlength=len(faces))
    differs = mask_of(len(faces), owners.face[~owners.same])
    for group in groups:
        own = count[group.face]
        for wrong, why in (
            (own == 0, "are no facets of cells, so that there is nothing to split; gmsh saves the cells of physical "
             "groups alone: is the body in one, and were the faces embedded in it?"),
            (own == 1, "lie on the surface already; name faces inside the body, between two cells"),
            (own > 2, "have more than two cells on them: the mesh is not a manifold there"),
            (differs[group.face], "and the cells on them do not have the same mid-nodes: elevate the order of both "
             "alike"),
        ):  # fmt: skip
            if wrong.any():
                cells = group.cells[wrong]
                message = f"faces {mesh.cell_names(cells)} of the group {group.name!r} {why}"
                raise DataError(message, mesh.cell_number[cells])


def _sides(mesh: Mesh, groups: list[_Group], faces: Faces, sides: FaceSides) -> tuple[FaceSides, list[Bools]]:
    """Return the sides a and b of the faces, by the first group of each, and for each group (f,): its sides differ."""
    known = np.zeros(len(faces), bool)
    flipped = np.zeros(len(faces), bool)
    by_group = []
    for group in groups:
        rows = np.unique(group.face)
        own = np.zeros(len(faces), bool)
        try:
            own[rows] = second_is_a(mesh, faces.take(rows), sides.take(rows))
        except DataError as error:
            raise DataError(f"the group {group.name!r} {error}", error.cells) from None
        new = rows[~known[rows]]
        flipped[new], known[new] = own[new], True
        by_group.append((rows, own))
    exchanged = []
    for rows, own in by_group:
        differs = np.zeros(len(faces), bool)
        differs[rows] = own[rows] != flipped[rows]
        exchanged.append(differs)
    return sides.exchanged(flipped), exchanged


def _closed(mesh: Mesh, groups: list[_Group], opened: Bools) -> Ints:
    """Return the cells of the groups on faces that stay closed, and warn of them. Raises DataError if all do."""
    cells = np.unique(np.concatenate([group.cells[~opened[group.face]] for group in groups]))
    if not len(cells):
        return cells
    for group in groups:
        if not opened[group.face].any():
            message = f"no face of the group {group.name!r} can open: the corners of each lie on the front, where the "
            message += "faces end inside the body and its nodes stay shared; refine the mesh there, or take more faces"
            raise DataError(message, mesh.cell_number[group.cells])
    message = (
        f"faces {mesh.cell_names(cells)} stay closed and are in neither skin: all their corners lie on the front, "
    )
    warnings.warn(
        f"{message}where the nodes are shared; refine the mesh there to open them", LacmeshWarning, stacklevel=4
    )
    return cells


class _Places(NamedTuple):
    """Doubled cells in the new mesh, `new` (p,), by the old cell and a cell beside it, of which `key` (p,) is made."""

    key: Ints
    new: Ints
    n_cells: int

    def find(self, cell: Ints, beside: Ints) -> Ints:
        """(q,): the new cell that took the place of a cell and belongs to the cell beside it."""
        return self.new[np.searchsorted(self.key, cell.astype(np.int64) * self.n_cells + beside)]


def _divided(mesh: Mesh, nodes: CellNodes) -> tuple[Mesh, _Places]:
    """Return the mesh with its nodes copied and the lower cells on them doubled, and the places of these."""
    if mesh.model is not None and mesh.model.periodic:
        message = "the mesh has periodic links: the copies of nodes on them have no periodic partner"
        warnings.warn(message, LacmeshWarning, stacklevel=4)
    new = _with_copies(mesh, nodes)
    blocks = list(new.blocks)
    children, pairs, indices = [], [], []
    for kind, pair, seen in _seen_by_cells(mesh, nodes):
        k = next(j for j, block in enumerate(blocks) if block.type == kind)
        variants, which = np.unique(np.column_stack([pair[0], seen]), axis=0, return_inverse=True)
        first, count = np.unique(variants[:, 0], return_index=True, return_counts=True)[1:]
        index = np.arange(len(variants)) - np.repeat(first, count)
        moved = variants[first[count == 1]]
        listed = blocks[k].nodes.copy()
        listed[moved[:, 0] - mesh.offsets[k]] = moved[:, 1:]
        blocks[k] = Block(kind, listed)
        several = np.flatnonzero(np.repeat(count, count) > 1)
        children.append(ChildCells(kind, variants[several, 1:], variants[several, 0], index[several]))
        pairs.append(np.stack(pair))
        indices.append(index[which.ravel()])
    new, origin = assemble(replace(new, blocks=tuple(blocks)), [], children, extend=True)
    return new, _places(mesh.n_cells, np.concatenate(pairs, axis=1), np.concatenate(indices), origin)


def _with_copies(mesh: Mesh, nodes: CellNodes) -> Mesh:
    """Return the mesh with the copies of nodes, which the cells of its dimension have taken."""
    copied = nodes.copied[:, None]
    ids = mesh.n_nodes + np.arange(len(copied))[:, None]
    new_nodes = [NewNodes("POI1", copied, np.empty((1, 0)), ids, copied)]
    block = np.searchsorted(mesh.offsets, nodes.cell, side="right") - 1
    blocks = []
    for k, (kind, listed) in enumerate(mesh.blocks):
        rows = np.flatnonzero((block == k) & (nodes.new_node != nodes.node))
        if len(rows):
            listed = listed.copy()
            listed[nodes.cell[rows] - mesh.offsets[k], nodes.column[rows]] = nodes.new_node[rows]
        blocks.append(Block(kind, listed))
    return replace(mesh, blocks=tuple(blocks), **nodes_of(mesh, new_nodes, True))


def _seen_by_cells(mesh: Mesh, nodes: CellNodes) -> Iterator[tuple[str, tuple[Ints, Ints], Ints]]:
    """Yield cells below the mesh's dimension that have a copied node, type by type, once for each cell beside them.

    (type, their indices and those of the cells beside (p,) each, their nodes in the divided mesh as these have them).
    """
    start = np.full(mesh.n_nodes + 1, 0)
    np.cumsum(np.bincount(nodes.node, minlength=mesh.n_nodes), out=start[1:])
    around = nodes.cell[np.argsort(nodes.node, kind="stable")]
    copied = mask_of(mesh.n_nodes, nodes.copied)
    for block, first in zip(mesh.blocks, mesh.offsets[:-1], strict=True):
        cell = ALL_CELLS[block.type]
        rows = np.flatnonzero(copied[block.nodes].any(axis=1)) if cell.dim < mesh.dim else np.empty(0, np.int64)
        if not len(rows):
            continue
        own = block.nodes[rows]
        pivot = own[np.arange(len(rows)), copied[own].argmax(axis=1)]
        many = start[pivot + 1] - start[pivot]
        row = np.repeat(np.arange(len(rows)), many)
        beside = around[np.repeat(start[pivot], many) + np.arange(len(row)) - np.repeat(np.cumsum(many) - many, many)]
        inside = _has_nodes(mesh, beside, own[row][:, : cell.n_corners])
        row, beside = row[inside], beside[inside]
        seen = nodes.in_divided_mesh(np.broadcast_to(beside[:, None], own[row].shape), own[row])
        yield block.type, (first + rows[row], beside), seen


def _has_nodes(mesh: Mesh, cells: Ints, wanted: Ints) -> Bools:
    """(p,): True for cells that have all nodes of their row of `wanted` (p, c)."""
    distinct, which = np.unique(cells, return_inverse=True)
    listed = np.full((len(distinct), 27), -1)
    done = 0
    for _, chosen, nodes in mesh.select(distinct):
        listed[done : done + len(chosen), : nodes.shape[1]] = nodes
        done += len(chosen)
    own = listed[which.ravel()]
    return np.asarray(np.all([(own == column[:, None]).any(axis=1) for column in wanted.T], axis=0))


def _places(n_cells: int, pairs: Ints, index: Ints, origin: Origin) -> _Places:
    """Return the places of doubled cells: of the pairs (2, p) of a cell and one beside it, the child `index` (p,)."""
    cell, beside = pairs
    first = positions(origin.cell[origin.children], cell)
    doubled = first >= 0
    key = (cell.astype(np.int64) * n_cells + beside)[doubled]
    order = np.argsort(key)
    return _Places(key[order], origin.children[(first + index)[doubled]][order], n_cells)


def _with_skins(mesh: Mesh, group: _Group, sides: FaceSides, places: _Places) -> tuple[Mesh, tuple[str, str]]:
    """Return the divided mesh with the skins of a group, outward, and their names."""
    face, first = np.unique(group.face, return_index=True)
    face, first = face[face >= 0], first[face >= 0]
    names = group.name + "_a", group.name + "_b"
    skins = [np.sort(places.find(group.cells[first], cell[face])) for cell in sides.cell]
    inward = analyse_orientation(mesh, np.sort(np.concatenate(skins))).to_flip
    turned = reverse(mesh, inward)
    groups = {**turned.cell_groups, **dict(zip(names, skins, strict=True))}
    return replace(turned, cell_groups=groups), names


def _n_bodies(mesh: Mesh) -> int:
    return int(label_bodies([Solid.of(mesh).corners], mesh.n_nodes).max(initial=-1)) + 1
