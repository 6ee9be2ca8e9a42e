"""Selection of what a cut changes: the slave faces, the cells on them, and their parents.

slave = the faces of the slave groups, each once             (slave_skin)
selection = the same with the cells on them and behind them  (select)
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lacmesh.cells import CARRIED, CELLS
from lacmesh.errors import CutError, GroupNotFoundError, LacmeshError, LacmeshWarning, RequestError
from lacmesh.indices import repeated
from lacmesh.mesh import Ints, Mesh, concatenated, mask_of
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
    types = [kind for kind in TYPE_CODE if CELLS[kind].dim == dim > 0]
    parts = [cells[mesh.of_type(cells, types)] for cells in groups]
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
    names, dims = [], []
    for spec in specs:
        members = mesh.cells_of(spec)  # an entity of msh is named by its numbers
        entity = spec.startswith("entity:") and spec not in mesh.cell_groups
        names.append(":".join(["entity", *(str(int(n)) for n in spec.split(":")[1:])]) if entity else mesh.group(spec))
        of_skin = not skin_only and (mesh.cell_dim[members] == mesh.dim - 1).any()
        dims.append(mesh.dim - 1 if of_skin else int(mesh.cell_dim[members].max(initial=0)))
    highest = max((dim for dim in dims if dim < 3), default=0)
    cells, zone, faces, first = skin_faces(mesh, [np.asarray(mesh.cells_of(name)) for name in names], highest)
    refusals = tuple(_refusals(mesh, names, dims, skin_only))
    remarks = [
        f"the slave group {name!r} also holds cells of lower dimension: they are left as they are"
        for name, dim in zip(names, dims, strict=True)
        if (mesh.cell_dim[mesh.cells_of(name)] < dim).any()
    ]
    empty = ", ".join(name for k, name in enumerate(names) if not (zone == k).any())
    if empty:
        remarks.append(f"every face of {empty} is in an earlier slave group: {empty} has no macro-element")
    if len(first) != len(cells):
        copies = mesh.cell_names(np.setdiff1d(cells, cells[first]))
        remarks.append(f"slave faces occur twice in the slave groups (cells {copies} repeat others); both are cut")
    return SlaveSkin(tuple(names), cells, zone, faces, first, refusals, tuple(remarks))


def _refusals(mesh: Mesh, names: list[str], dims: list[int], skin_only: bool) -> Iterator[LacmeshError]:
    """Yield the reasons why groups whose faces have the dimensions `dims` cannot be cut."""
    if not names:
        yield RequestError("no slave group was given")
    if len(set(names)) < len(names):
        yield RequestError(f"a slave group is given twice: {', '.join(names)}")
    for name, dim in zip(names, dims, strict=True):
        cells = mesh.cells_of(name)
        if not len(cells):
            yield CutError(f"the slave group {name!r} is empty")
            continue
        of = mesh.cell_dim[cells]
        wrong = cells[(of < 1) | (of > 2)] if skin_only else cells[of > mesh.dim - 1]
        odd = wrong if len(wrong) or skin_only or dim == mesh.dim - 1 else cells
        if len(odd) and (of == mesh.dim).any() and mesh.dim < mesh.space_dim and not skin_only:
            what = f"has nothing behind it: {lacking(mesh, mesh.dim + 1)}; --skin-only cuts a shell"
            yield CutError(f"the slave group {name!r} {what}", mesh.cell_number[odd])
        elif len(odd):
            needed = "1 or 2" if skin_only else f"{max(mesh.dim - 1, 1)}, one less than the cells behind it"
            what = f"holds cells of dimension {int(mesh.cell_dim[odd].max())} ({mesh.cell_names(odd)}); "
            what += f"a slave surface is made of faces of dimension {needed}"
            yield CutError(f"the slave group {name!r} {what}", mesh.cell_number[odd])
        for kind, which, _ in mesh.select(cells[of == dim]):
            if kind not in CELLS:
                names_of = mesh.cell_names(which)
                yield CutError(f"slave faces of type {kind} ({names_of}) cannot be cut", mesh.cell_number[which])
    if mesh.dim < 2:
        yield CutError(f"{lacking(mesh, 2)}: there is no surface to cut")
    if len(set(dims)) > 1:
        groups = f"the slave groups {', '.join(names)} have faces of dimensions {sorted(set(dims))}"
        yield CutError(f"{groups}; cut one dimension only")


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
    skin = find_repeats(faces, cells_of_dim(mesh, dim), mesh.n_nodes)
    skin = skin.take(np.argsort(skin.cell, kind="stable"))
    if not skin.same.all():
        odd = skin.cell[~skin.same]
        why = "lie on slave faces with other nodes (linear on quadratic?); remove them"
        raise CutError(f"cells {mesh.cell_names(odd)} {why}", mesh.cell_number[odd])
    return mesh, Selection(faces, slave.names, slave.zone[first], cells[first], skin, parents)


def nodes_of_group(mesh: Mesh, spec: str) -> Ints:
    """The nodes of a node group, or of the cells of a cell group. Raises GroupNotFoundError."""
    if spec in mesh.node_groups:
        return np.union1d(mesh.node_groups[spec], mesh.nodes_on(mesh.cell_groups.get(spec, np.empty(0, int))))
    try:
        return mesh.nodes_on(mesh.cells_of(spec))
    except GroupNotFoundError as error:
        raise GroupNotFoundError(spec, [*mesh.cell_groups, *mesh.node_groups], "cell or node group") from error


def check_numbers(mesh: Mesh) -> None:
    """Check that the numbers of cells and of nodes are unique, because records refer to them. Raises CutError."""
    for what, numbers in (("cells", mesh.cell_number), ("nodes", mesh.node_number)):
        if len(numbers) and (numbers.min() < 0 or repeated(numbers) is not None):
            raise CutError(f"the numbers of {what} are not distinct, or some are negative: number them again")


def _check_parents(
    mesh: Mesh, faces: Faces, slave: Ints, parents: FaceIncidence, interface: str, skin_only: bool
) -> None:
    count = np.bincount(parents.face, minlength=len(faces))
    differs = mask_of(len(faces), parents.face[~parents.same])
    behind = mesh.cell_names(parents.cell[~parents.same])
    for wrong, why in (
        (skin_only & (count > 0), "have cells behind them, from which --skin-only would separate them"),
        ((not skin_only) & (count == 0), "have no parent cell; gmsh saves only the cells of physical groups: is their "
         "body in one? --skin-only cuts a surface without parent cells (a shell)"),
        (count > 2, "have more than two cells behind them: the mesh is not a manifold there"),
        (differs, f"and the cells behind them ({behind}) do not have the same mid-nodes: elevate the order of both "
         "alike"),
        ((interface == "refuse") & (count == 2), "lie between two cells; --interface both cuts both sides"),
    ):  # fmt: skip
        if wrong.any():
            cells = slave[wrong]
            raise CutError(f"slave faces {mesh.cell_names(cells)} {why}", mesh.cell_number[cells])


def _refuse_higher_order(mesh: Mesh, faces: Faces, dim: int) -> None:
    """Raise an error if a cell of order 3 or higher has a slave face or lies on one: such cells are never cut."""
    for d, find in ((dim, find_repeats), (dim + 1, find_owners)):
        carried = ((CARRIED[kind], nodes, cells) for kind, nodes, cells in cells_of_dim(mesh, d) if kind in CARRIED)
        owners = find(
            faces, [(one.linear, nodes[:, : one.n_corners], ids) for one, nodes, ids in carried], mesh.n_nodes
        )
        if len(owners.cell):
            cell = owners.cell.min()
            kind = mesh.blocks[int(np.searchsorted(mesh.offsets, cell, side="right")) - 1].type
            number = mesh.cell_number[cell]
            raise CutError(f"the {kind} {number} has a slave face, and cells of its order are not cut", [number])
