"""Selection of what a cut changes: the slave faces, the cells on them, and their parents.

slave = the faces of the slave groups, each once             (slave_skin)
selection = the same with the cells on them and behind them  (select)
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from lacmesh.cells import ALL_CELLS, CARRIED, CELLS
from lacmesh.errors import CutError, LacmeshError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, concatenated, distinct
from lacmesh.topology.orientation import flip_outward
from lacmesh.topology.skin import (
    TYPE_CODE,
    FaceIncidence,
    Faces,
    cells_of_dim,
    distinct_faces,
    find_owners,
    find_repeats,
    lacking,
)


@dataclass(frozen=True)
class SlaveSkin:
    """The slave faces of some groups, `names`: `cells` (c,), each once, with the place of its first group, `zone` (c,).

    `faces`, each once; `first` (f,): the row of the cell that gives each face its node order. `refusals`: why these
    groups cannot be cut, the first that counts first; `remarks`: what a cut of them leaves out or takes twice.
    """

    names: tuple[str, ...]
    cells: Ints
    zone: Ints
    faces: Faces
    first: Ints
    refusals: tuple[LacmeshError, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Selection:
    """The cells that a cut changes: `faces`, one per macro-element, with the place of each in `zones`, `zone` (f,).

    `slave` (f,): the cell of the mesh that gave each face its node order. `skin`: every cell on a face, the slave cells
    and their duplicates; sorted by cell. `parents`: the parent cells.
    """

    faces: Faces
    zones: tuple[str, ...]
    zone: Ints
    slave: Ints
    skin: FaceIncidence
    parents: FaceIncidence


def skin_faces(mesh: Mesh, groups: Sequence[Ints], dim: int) -> tuple[Ints, Ints, Faces, Ints]:
    """Return the cells in groups that are skin faces of a dimension, each once; the place of the first group that holds
    each; the faces; and the rows of the cells that these are from.
    """
    known = np.array([b.type in TYPE_CODE and ALL_CELLS[b.type].dim == dim > 0 for b in mesh.blocks] or [False], bool)
    parts = [cells[known[np.searchsorted(mesh.offsets, cells, side="right") - 1]] for cells in groups]
    cells = concatenated(parts)
    group = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    if len(parts) > 1:
        once = np.sort(np.unique(cells, return_index=True)[1])
        cells, group = cells[once], group[once]
    faces, first = distinct_faces(mesh, cells) if len(cells) else (Faces.join([]), np.empty(0, np.int64))
    return cells, group, faces, first


def slave_skin(mesh: Mesh, specs: Sequence[str], *, skin_only: bool = False) -> SlaveSkin:
    """Return the skin faces of some groups; cells that are no skin faces of a type that can be cut are left out.

    They have dimension d - 1 or, without any and with `skin_only`, the highest of their group.
    """
    names = tuple(_name(mesh, spec) for spec in specs)
    dims = [_skin_dim(mesh, name, skin_only) for name in names]
    highest = max((dim for dim in dims if dim < 3), default=0)
    cells, zone, faces, first = skin_faces(mesh, [np.asarray(mesh.cells_of(name)) for name in names], highest)
    refusals = tuple(_refusals(mesh, names, dims, skin_only))
    remarks = [_lower(mesh, name, dim) for name, dim in zip(names, dims, strict=True)]
    remarks += [_empty_zones(names, zone), _duplicates(mesh, cells, first)]
    return SlaveSkin(names, cells, zone, faces, first, refusals, tuple(filter(None, remarks)))


def _name(mesh: Mesh, spec: str) -> str:
    """Name of a slave group, or of an entity of msh, in the records of a cut."""
    if not spec.startswith("entity:") or spec in mesh.cell_groups:
        return mesh.group(spec)
    mesh.cells_of(spec)
    return ":".join(["entity", *(str(int(part)) for part in spec.split(":")[1:])])


def _skin_dim(mesh: Mesh, name: str, skin_only: bool) -> int:
    """Dimension of the cells of a group that are taken for its skin faces."""
    dims = mesh.cell_dim[mesh.cells_of(name)]
    return mesh.dim - 1 if not skin_only and (dims == mesh.dim - 1).any() else int(dims.max(initial=0))


def _refusals(mesh: Mesh, names: tuple[str, ...], dims: list[int], skin_only: bool) -> Iterator[LacmeshError]:
    """Yield the reasons why groups whose faces have the dimensions `dims` cannot be cut."""
    if not names:
        yield RequestError("no slave group was given")
    if len(set(names)) < len(names):
        yield RequestError(f"a slave group is given twice: {', '.join(names)}")
    for name, dim in zip(names, dims, strict=True):
        yield from _refusals_of_group(mesh, name, dim, skin_only)
    if mesh.dim < 2:
        yield CutError(f"{lacking(mesh, 2)}: there is no skin to cut")
    if len(set(dims)) > 1:
        yield CutError(
            f"the slave groups {', '.join(names)} have faces of dimensions {sorted(set(dims))}; cut them apart"
        )


def _refusals_of_group(mesh: Mesh, name: str, dim: int, skin_only: bool) -> Iterator[CutError]:
    """Yield the reasons why a group whose faces have dimension `dim` cannot be cut."""
    cells = mesh.cells_of(name)
    if not len(cells):
        yield CutError(f"the slave group {name!r} is empty")
        return
    dims = mesh.cell_dim[cells]
    wrong = cells[(dims < 1) | (dims > 2)] if skin_only else cells[dims > mesh.dim - 1]
    odd = wrong if len(wrong) or skin_only or dim == mesh.dim - 1 else cells
    if len(odd) and (dims == mesh.dim).any() and mesh.dim < mesh.space_dim and not skin_only:
        message = f"the slave group {name!r} has nothing behind it: {lacking(mesh, mesh.dim + 1)}"
        yield CutError(f"{message}; --skin-only cuts a shell", mesh.cell_number[odd])
    elif len(odd):
        yield CutError(
            f"the slave group {name!r} holds cells of dimension {int(mesh.cell_dim[odd].max())} "
            f"({mesh.cell_names(odd)}); a slave skin is made of faces of dimension "
            + ("1 or 2" if skin_only else f"{max(mesh.dim - 1, 1)}, one less than the cells behind it"),
            mesh.cell_number[odd],
        )
    for kind, which, _ in mesh.select(cells[dims == dim]):
        if kind not in CELLS:
            message = f"slave faces of type {kind} ({mesh.cell_names(which)}) cannot be cut"
            yield CutError(message, mesh.cell_number[which])


def _lower(mesh: Mesh, name: str, dim: int) -> str:
    if not (mesh.cell_dim[mesh.cells_of(name)] < dim).any():
        return ""
    return f"the slave group {name!r} also holds cells of lower dimension: they are left as they are"


def _empty_zones(names: tuple[str, ...], zone: Ints) -> str:
    empty = [name for k, name in enumerate(names) if not (zone == k).any()]
    return (
        f"every face of {', '.join(empty)} is in an earlier slave group: no macro-element is of that zone"
        if empty
        else ""
    )


def _duplicates(mesh: Mesh, cells: Ints, first: Ints) -> str:
    if len(first) == len(cells):
        return ""
    copies = mesh.cell_names(np.setdiff1d(cells, cells[first]))
    return (
        f"slave faces stand twice in the slave groups (cells {copies} repeat others): one macro-element each, both "
        "copies cut"
    )


def select(mesh: Mesh, slave: SlaveSkin, *, interface: str, orient: str, skin_only: bool) -> tuple[Mesh, Selection]:
    """Select what is cut with some slave faces, which are flipped outward first if `orient` says so.

    Returns the mesh with the faces as they are cut. Raises CutError for what cannot be cut.
    """
    check_numbers(mesh)
    for refusal in slave.refusals:
        raise refusal
    for remark in slave.remarks:
        warnings.warn(remark, LacmeshWarning, stacklevel=3)
    cells, faces, first = slave.cells, slave.faces, slave.first
    dim = int(mesh.cell_dim[cells[0]])
    _refuse_higher_order(mesh, faces, dim)
    parents = find_owners(faces, cells_of_dim(mesh, dim + 1), mesh.n_nodes)
    _check_parents(mesh, faces, cells[first], parents, interface, skin_only)
    if orient == "outward":
        mesh, faces = flip_outward(mesh, cells, faces, first, parents)
    skin = find_repeats(faces, cells_of_dim(mesh, dim), mesh.n_nodes).by_cell()
    if not skin.same.all():
        odd = skin.cell[~skin.same]
        raise CutError(
            f"cells {mesh.cell_names(odd)} lie on slave faces with other nodes (linear on quadratic?); remove them",
            mesh.cell_number[odd],
        )
    return mesh, Selection(faces, slave.names, slave.zone[first], cells[first], skin, parents)


def check_numbers(mesh: Mesh) -> None:
    """Check that the numbers of cells and of nodes are unique, because records refer to them. Raises CutError."""
    for what, numbers in (("cells", mesh.cell_number), ("nodes", mesh.node_number)):
        if len(numbers) and (numbers.min() < 0 or not distinct(numbers)):
            raise CutError(f"the numbers of {what} are not distinct, or some are negative: number them again")


def _check_parents(
    mesh: Mesh, faces: Faces, slave: Ints, parents: FaceIncidence, interface: str, skin_only: bool
) -> None:
    def fail(which: Ints, message: str) -> None:
        names = mesh.cell_names(slave[which])
        raise CutError(f"slave faces {names} {message}", mesh.cell_number[slave[which]])

    count = np.bincount(parents.face, minlength=len(faces))
    if skin_only:
        if (count > 0).any():
            fail(np.flatnonzero(count), "have cells behind them, which a cut of the skin only would tear apart")
        return
    if (count == 0).any():
        fail(
            np.flatnonzero(count == 0),
            "have no parent cell; gmsh saves the cells of physical groups alone: is their body in one? "
            "--skin-only cuts a surface without parent cells (a shell)",
        )
    if (count > 2).any():
        fail(np.flatnonzero(count > 2), "have more than two cells behind them: the mesh is not a manifold there")
    if not parents.same.all():
        odd = np.unique(parents.face[~parents.same])
        behind = mesh.cell_names(parents.cell[~parents.same])
        fail(
            odd, f"and the cells behind them ({behind}) do not have the same mid-nodes: elevate the order of both alike"
        )
    if interface == "refuse" and (count == 2).any():
        fail(np.flatnonzero(count == 2), "lie between two cells; --interface both cuts both sides")


def _refuse_higher_order(mesh: Mesh, faces: Faces, dim: int) -> None:
    """Raise an error if a cell of order 3 or higher has a slave face or lies on one: such cells are never cut."""
    corners = None
    for kind, nodes, cells in (
        b for d in (dim, dim + 1) for b in cells_of_dim(mesh, d) if b[0] in CARRIED and len(b[1])
    ):
        if corners is None:
            corners = {tuple(sorted(c for c in row if c >= 0)) for row in faces.corners.tolist()}
        own = nodes[:, : CARRIED[kind].n_corners]
        for row in np.flatnonzero(np.count_nonzero(np.isin(own, faces.corners), axis=1) > dim):
            sets = (s for n in {len(c) for c in corners} for s in combinations(sorted(own[row].tolist()), n))
            if not corners.isdisjoint(sets):
                message = (
                    f"the {kind} {mesh.cell_number[cells[row]]} has a slave face, and cells of its order are not cut"
                )
                raise CutError(message, [mesh.cell_number[cells[row]]])
