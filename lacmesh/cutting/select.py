"""Selection of what a cut changes: the slave faces, the cells on them, and their parents.

slave = the faces of the slave groups, each once             (slave_skin)
selection = the same with the cells on them and behind them  (select)
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from lacmesh.cells import CARRIED, CELLS
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Ints, Mesh, codes, distinct
from lacmesh.topology.faces import cells_of_dim, distinct_faces, lacking
from lacmesh.topology.orientation import flip_outward
from lacmesh.topology.skin import TYPE_CODE, FaceIncidence, Faces, find_owners, find_repeats


@dataclass(frozen=True)
class SlaveSkin:
    """The slave faces: `cells` (c,), each once, with the place of its first group, `zone` (c,); `faces`, each once.

    `first` (f,): the row of the cell that gives each face its node order.
    """

    cells: Ints
    zone: Ints
    faces: Faces
    first: Ints


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


def in_first_group(groups: Sequence[Ints]) -> tuple[Ints, Ints]:
    """Return the cells of some groups, each once, and the place of the first group that holds each."""
    cells = np.concatenate([np.empty(0, np.int64), *groups])
    group = np.repeat(np.arange(len(groups)), [len(g) for g in groups])
    if len(groups) < 2:
        return cells, group
    first = np.sort(np.unique(cells, return_index=True)[1])
    return cells[first], group[first]


def slave_skin(mesh: Mesh, specs: Sequence[str], *, skin_only: bool = False) -> SlaveSkin:
    """Return the skin faces of some groups; cells that are no skin faces of a type that can be cut are ignored.

    They have dimension d - 1 or, without any and with `skin_only`, the highest of their group.
    """
    known = np.array([b.type in TYPE_CODE and b.type != "POI1" for b in mesh.blocks], bool)
    groups = []
    for spec in specs:
        cells = np.asarray(mesh.cells_of(spec))
        dims = mesh.cell_dim[cells]
        want = mesh.dim - 1 if not skin_only and (dims == mesh.dim - 1).any() else dims.max(initial=0)
        cells = cells[dims == want]
        groups.append(cells[known[np.searchsorted(mesh.offsets, cells, side="right") - 1]])
    cells, zone = in_first_group(groups)
    same = mesh.cell_dim[cells] == mesh.cell_dim[cells].max(initial=0)
    cells, zone = cells[same], zone[same]
    faces, first = distinct_faces(mesh, cells) if len(cells) else (Faces.join([]), np.empty(0, np.int64))
    return SlaveSkin(cells, zone, faces, first)


def select(
    mesh: Mesh, specs: Sequence[str], slave: SlaveSkin, *, interface: str, orient: str, skin_only: bool
) -> tuple[Mesh, Selection]:
    """Select what is cut for some groups, whose skin is `slave`; flip its faces outward first if `orient` says so.

    Returns the mesh with the faces as they are cut. Raises CutError for what cannot be cut.
    """
    _check_numbers(mesh)
    zones = _check_groups(mesh, specs, slave, skin_only)
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
    _warn_of_duplicates(mesh, cells, first)
    return mesh, Selection(faces, zones, slave.zone[first], cells[first], skin, parents)


def _check_numbers(mesh: Mesh) -> None:
    """Check that the numbers of cells and of nodes are unique, because the records of a cut refer to them."""
    for what, numbers in (("cells", mesh.cell_number), ("nodes", mesh.node_number)):
        if len(numbers) and (numbers.min() < 0 or not distinct(numbers)):
            raise CutError(f"the numbers of {what} are not distinct, or some are negative: number them again")


def _check_groups(mesh: Mesh, specs: Sequence[str], slave: SlaveSkin, skin_only: bool) -> tuple[str, ...]:
    """Check that the slave groups hold faces that can be cut, of one dimension; return the names of the zones."""
    if not specs:
        raise RequestError("no slave group was given")
    names = [_name(mesh, spec) for spec in specs]
    if len(set(names)) < len(names):
        raise RequestError(f"a slave group is given twice: {', '.join(names)}")
    dims = codes(np.array([_check_group(mesh, name, skin_only) for name in names]))
    if mesh.dim < 2:
        raise CutError(f"{lacking(mesh, 2)}: there is no skin to cut")
    empty = [name for k, name in enumerate(names) if not (slave.zone == k).any()]
    if empty and len(dims) == 1:
        message = f"every face of {', '.join(empty)} is in an earlier slave group: no macro-element is of that zone"
        warnings.warn(message, LacmeshWarning, stacklevel=4)
    if len(dims) > 1:
        raise CutError(f"the slave groups {', '.join(names)} have faces of dimensions {dims.tolist()}; cut them apart")
    return tuple(names)


def _name(mesh: Mesh, spec: str) -> str:
    if not spec.startswith("entity:") or spec in mesh.cell_groups:
        return mesh.group(spec)
    mesh.cells_of(spec)
    return ":".join(["entity", *(str(int(part)) for part in spec.split(":")[1:])])


def _check_group(mesh: Mesh, name: str, skin_only: bool) -> int:
    """Check that a slave group holds skin faces of types that can be cut; return their dimension."""
    cells = mesh.cells_of(name)
    if not len(cells):
        raise CutError(f"the slave group {name!r} is empty")
    dims = mesh.cell_dim[cells]
    want = int(dims.max()) if skin_only else mesh.dim - 1
    wrong = cells[dims > want] if not skin_only else cells[(dims < 1) | (dims > 2)]
    if len(wrong) or not (dims == want).any():
        odd = wrong if len(wrong) else cells
        if (dims == mesh.dim).any() and mesh.dim < mesh.space_dim and not skin_only:
            message = f"the slave group {name!r} has nothing behind it: {lacking(mesh, mesh.dim + 1)}"
            raise CutError(f"{message}; --skin-only cuts a shell", mesh.cell_number[odd])
        raise CutError(
            f"the slave group {name!r} holds cells of dimension {int(mesh.cell_dim[odd].max())} "
            f"({mesh.cell_names(odd)}); a slave skin is made of faces of dimension "
            + ("1 or 2" if skin_only else f"{max(want, 1)}, one less than the cells behind it"),
            mesh.cell_number[odd],
        )
    if (dims < want).any():
        message = f"the slave group {name!r} also holds cells of lower dimension: they are left as they are"
        warnings.warn(message, LacmeshWarning, stacklevel=5)
    faces = cells[dims == want]
    for kind, which, _ in mesh.select(faces):
        if kind not in CELLS:
            message = f"slave faces of type {kind} ({mesh.cell_names(which)}) cannot be cut"
            raise CutError(message, mesh.cell_number[which])
    return want


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


def _warn_of_duplicates(mesh: Mesh, cells: Ints, first: Ints) -> None:
    if len(first) < len(cells):
        copies = np.setdiff1d(cells, cells[first])
        message = f"slave faces stand twice in the slave groups (cells {mesh.cell_names(copies)} repeat others): "
        warnings.warn(message + "one macro-element each, both copies cut", LacmeshWarning, stacklevel=4)
