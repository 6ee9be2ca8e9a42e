"""The records of a cut: integer data of the mesh, and `Cut`, a view of them (`docs/conventions.md`)."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lacmesh.errors import CutError, some
from lacmesh.facts import Described, listed
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.skin import FACE_TYPES

#: integer data that a cut is kept in, -1 where they say nothing (`docs/conventions.md`)
CELL_RECORDS = ("lac_macro", "lac_zone", "lac_child", "lac_parent")
NODE_RECORD = "lac_internal"


class Origin(NamedTuple):
    """Origin of the cells and nodes of a cut mesh, as rows of the mesh before the cut.

    `cell` (n_cells,): the cell that each one is, or replaces with others. `node` (n_nodes,): the node that each one is;
    for a new node the first node of the face or cell that it was put into. `children` (c,): the cells of the cut mesh
    that replace others.
    """

    cell: Ints
    node: Ints
    children: Ints


@dataclass(frozen=True, repr=False)
class Cut(Described):
    """A view of the records of a cut in its mesh, where they are ordinary data, so that file formats keep them.

    `origin`: the rows of cells and nodes in the mesh before the cut; None where that is not known, as of a file.
    Raises CutError if the mesh carries no cut.

    >>> from lacmesh import cut_skin, read
    >>> cut = Cut(cut_skin(read("data/two_blocks.msh"), "slave").mesh)
    >>> cut.zones, cut.n_macros, cut.faces_of_macro[0].tolist()
    (('slave',), 36, [330, 331, 332, 333])
    """

    mesh: Mesh
    origin: Origin | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not is_cut(self.mesh):
            raise CutError("this mesh carries no cut; lacmesh.cut_skin makes one")
        faces = np.flatnonzero(self.macro_of_face >= 0)
        kinds = {kind for kind, _, _ in self.mesh.select(faces)}
        zones = self.zone_of_face[faces]
        if not kinds <= set(FACE_TYPES[1:]) or zones.min() < 0 or zones.max() >= len(self.zones):
            raise CutError("the data lac_macro and lac_zone of this mesh are not those of a cut; take them out")

    def _facts(self) -> dict[str, str]:
        first = [faces[0] for faces in self.faces_of_macro]
        counts = np.bincount(self.zone_of_face[first], minlength=len(self.zones))
        macros = (f"{name} ({count:,})" for name, count in zip(self.zones, counts, strict=True))
        return {"macro-elements": listed(macros), "mesh": f"{self.mesh.n_nodes:,} nodes, {self.mesh.n_cells:,} cells"}

    @property
    def zones(self) -> tuple[str, ...]:
        """Names of the zones: one for each slave group."""
        return self.mesh.zones

    @cached_property
    def n_macros(self) -> int:
        """Number of macro-elements."""
        return int(self.macro_of_face.max(initial=-1)) + 1

    @property
    def macro_of_face(self) -> Ints:
        """(n_cells,): the macro-element that a slave face is part of, -1 for every other cell."""
        return self.mesh.cell_data["lac_macro"]

    @property
    def zone_of_face(self) -> Ints:
        """(n_cells,): the index in `zones` of a slave face's zone, -1 for every other cell."""
        return self._cell_record("lac_zone")

    @property
    def child_kind(self) -> Ints:
        """(n_cells,): 1 to 5 for the slave faces E1 to E5 of a macro-element, -1 for every other cell."""
        return self._cell_record("lac_child")

    @property
    def parent_of_cell(self) -> Ints:
        """(n_cells,): id in the file of the cell that a child replaces, -1 for a cell that the cut left unchanged."""
        return self._cell_record("lac_parent")

    @property
    def macro_of_node(self) -> Ints:
        """(n_nodes,): the macro-element whose internal dof a node carries, -1 for every other node."""
        internal = self.mesh.node_data.get(NODE_RECORD)
        return np.full(self.mesh.n_nodes, -1, np.int32) if internal is None else internal

    def _cell_record(self, name: str) -> Ints:
        """Return a record, or -1 for every cell if the file has none (`lac_parent` if all faces were left whole)."""
        values = self.mesh.cell_data.get(name)
        return np.full(self.mesh.n_cells, -1, np.int32) if values is None else values

    @cached_property
    def internal_nodes(self) -> tuple[Ints, ...]:
        """For each macro-element, the nodes that carry an internal dof of it."""
        nodes = np.flatnonzero(self.macro_of_node >= 0)
        return split(nodes, self.macro_of_node[nodes], self.n_macros)

    @cached_property
    def faces_of_macro(self) -> tuple[Ints, ...]:
        """For each macro-element, its slave faces, E1 first."""
        faces = np.flatnonzero(self.macro_of_face >= 0)
        faces = faces[np.argsort(self.child_kind[faces], kind="stable")]
        return split(faces, self.macro_of_face[faces], self.n_macros)

    def parents_in(self, before: Mesh) -> tuple[Ints, Ints]:
        """Rows of the children, and of the cells of the mesh `before` that they replace, (c,) each.

        Known from `origin` where that is of this mesh, else from the cells' numbers. Raises CutError if it has others.
        """
        children = np.flatnonzero(self.parent_of_cell >= 0)
        numbers, known = self.parent_of_cell[children], before.cell_number
        if self.origin is not None:
            parents = self.origin.cell[children]
            if parents.max(initial=-1) < before.n_cells and np.array_equal(known[parents], numbers):
                return children, parents
        missing = np.setdiff1d(numbers, known)
        if len(missing):
            raise CutError(f"the cut is of another mesh: the one before has no cells {some(missing)}", missing)
        order = np.argsort(known, kind="stable")
        return children, order[np.searchsorted(known, numbers, sorter=order)]


def split(members: Ints, owner: Ints, count: int) -> tuple[Ints, ...]:
    """Group `members` by their `owner`, 0 to `count` - 1, keeping their order."""
    order = np.argsort(owner, kind="stable")
    return tuple(np.split(members[order], np.cumsum(np.bincount(owner, minlength=count))[:-1]))


def is_cut(mesh: Mesh) -> bool:
    """True if a mesh carries the records of a cut."""
    macro = mesh.cell_data.get("lac_macro")
    return macro is not None and bool((macro >= 0).any())


def cut_of(mesh: Mesh) -> Cut | None:
    """Return the cut that a mesh carries; None without one, or if its data only have the names of records."""
    with suppress(CutError):
        return Cut(mesh)
    return None


def with_records(mesh: Mesh, cells: Mapping[str, Ints], internal: Ints, zones: tuple[str, ...]) -> Mesh:
    """Return the mesh with the records of a cut: of cells by their names, (n_cells,) each, and of nodes (n_nodes,)."""
    return replace(
        mesh, cell_data={**mesh.cell_data, **cells}, node_data={**mesh.node_data, NODE_RECORD: internal}, zones=zones
    )


def without_records(mesh: Mesh) -> Mesh:
    """Return the mesh without the records of a cut."""
    if NODE_RECORD not in mesh.node_data and not any(name in mesh.cell_data for name in CELL_RECORDS):
        return mesh
    cells = {name: values for name, values in mesh.cell_data.items() if name not in CELL_RECORDS}
    nodes = {name: values for name, values in mesh.node_data.items() if name != NODE_RECORD}
    return replace(mesh, cell_data=cells, node_data=nodes, zones=())
