"""The subject of a check: the mesh, its slave and master skins, the macro-elements, the constrained nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.checks.findings import Finding, Where, counted
from lacmesh.checks.recorded import Fault, record_faults
from lacmesh.checks.rules import RULES
from lacmesh.cutting.patterns import WHOLE_FACES
from lacmesh.cutting.recognition import as_cut, find_macros
from lacmesh.cutting.records import CELL_RECORDS, Cut, is_cut
from lacmesh.cutting.select import skin_faces, slave_skin
from lacmesh.errors import CutError, GroupNotFoundError, some
from lacmesh.mesh import Ints, Mesh, concatenated
from lacmesh.topology.bodies import body_names, label_bodies
from lacmesh.topology.facets import Facets
from lacmesh.topology.skin import FACE_TYPES, FaceIncidence, Faces, cells_of_dim, find_owners

#: at most so many numbers in a sentence
SHOWN = 8
#: nodes nearer than this part of the length of edges (the median of what the nodes have as shortest) are at one place
PLACE = 1e-8


@dataclass(frozen=True, eq=False)
class CheckedSkin:
    """A skin: `what` (slave, master), the groups' `names`, its faces.

    `cells` (f,): the first cell on each face; `zone` (f,): the position of its group in `names`; `faces`: the faces,
    each once; `copies`: further cells on the same faces; `groups`: the cells of each group.
    """

    what: str
    names: tuple[str, ...]
    groups: tuple[Ints, ...]
    cells: Ints
    zone: Ints
    faces: Faces
    copies: Ints

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def group(self) -> str:
        """The names of the groups, for the place of a finding."""
        return ", ".join(self.names)

    def counted(self, n: int, one: str, many: str) -> str:
        """Format a number of its faces and a verb for a sentence: `2 slave faces turn`."""
        return counted(n, f"{self.what} face {one}", f"{self.what} faces {many}")

    @cached_property
    def nodes(self) -> Ints:
        """All nodes of the faces."""
        return self.faces.distinct_nodes


@dataclass(frozen=True, eq=False)
class Subject:
    """The mesh and the request. `dim`: dimension of the skins. `fixed`: nodes of the Dirichlet groups.

    `recognise`: as in `lacmesh.cut_skin`, for a slave skin without records of a cut. The mesh's points are
    relative to `origin` (3,); findings give positions in the coordinates of the file.
    """

    mesh: Mesh
    dim: int
    slave: CheckedSkin
    master: CheckedSkin | None
    fixed: Ints
    dirichlet: tuple[str, ...]
    options: dict[str, Any] = field(default_factory=dict)
    origin: NDArray[np.floating] = field(default_factory=lambda: np.zeros(3))
    recognise: bool | None = None

    @property
    def sides(self) -> tuple[CheckedSkin, ...]:
        """The skins."""
        return (self.slave,) if self.master is None else (self.slave, self.master)

    @cached_property
    def finite(self) -> NDArray[np.bool_]:
        """(n_nodes,): True for nodes with finite coordinates, the squares of which are finite as well."""
        return np.asarray((np.abs(self.mesh.points) < 1e150).all(axis=1))

    @cached_property
    def parents(self) -> dict[str, FaceIncidence]:
        """The parent cells of the faces, for each side."""
        blocks = list(cells_of_dim(self.mesh, self.dim + 1))
        return {side.what: find_owners(side.faces, blocks, self.mesh.n_nodes) for side in self.sides}

    @cached_property
    def facets(self) -> Facets:
        """The cells of the mesh's dimension and their facets, paired."""
        return Facets.of(self.mesh)

    @cached_property
    def bodies(self) -> Ints:
        """(n_nodes,): the body of each node, -1 for nodes of no cell."""
        return label_bodies([self.facets.solid.corners], self.mesh.n_nodes)

    @cached_property
    def body_names(self) -> list[str]:
        """The name of each body, for a sentence."""
        there = replace(self.mesh, points=self.mesh.points + self.origin)
        return body_names(there, self.bodies, int(self.bodies.max(initial=-1)) + 1)

    @cached_property
    def macros(self) -> Macros:
        """The macro-elements of the slave faces."""
        return macros_of(self.mesh, self.slave, self.recognise)

    @cached_property
    def cut_mesh(self) -> Mesh:
        """The mesh with usable records of the macro-elements: its own, or the recognised ones, or none if faulty."""
        mesh, macros = self.mesh, self.macros
        if not macros.faults and not macros.recognised:
            return mesh
        data = {name: values for name, values in mesh.cell_data.items() if name not in CELL_RECORDS}
        if macros.recognised:
            macro = np.full(mesh.n_cells, -1, np.int64)
            macro[self.slave.cells[macros.cut]] = macros.of_face[macros.cut]
            data["lac_macro"] = macro
        return replace(mesh, cell_data=data)

    def behind(self, side: CheckedSkin) -> Ints:
        """(f,): the number of parent cells of each face of a side."""
        return np.bincount(self.parents[side.what].face, minlength=len(side))

    def numbers(self, cells: Ints) -> str:
        """Ids in the file of some cells, for a sentence."""
        return some(self.mesh.cell_number[cells], SHOWN)

    def node_numbers(self, nodes: Ints) -> str:
        """Ids in the file of some nodes, for a sentence."""
        return some(self.mesh.node_number[nodes], SHOWN)

    def found(
        self, rule: str, message: str, cells: Ints | None = None, nodes: Ints | None = None, group: str | None = None
    ) -> Finding:
        """Make a finding of a rule, about cells and nodes given by their indices."""
        cells = np.empty(0, np.int64) if cells is None else np.asarray(cells, np.int64)
        nodes = np.empty(0, np.int64) if nodes is None else np.asarray(nodes, np.int64)
        return Finding(
            rule,
            RULES[rule].severity,
            tuple(self.mesh.cell_number[cells].tolist()),
            tuple(self.mesh.node_number[nodes].tolist()),
            Where(group, self._box(cells, nodes)),
            message,
        )

    def _box(self, cells: Ints, nodes: Ints) -> tuple[Any, Any] | None:
        """Bounding box of some nodes, or of some cells if no nodes are given."""
        if not len(nodes):
            parts = [n.ravel() for _, _, n in self.mesh.select(cells)]
            nodes = np.concatenate(parts) if parts else nodes
        nodes = nodes[self.finite[nodes]]
        if not len(nodes):
            return None
        x = self.mesh.points[nodes] + self.origin
        return tuple(x.min(axis=0).tolist()), tuple(x.max(axis=0).tolist())


#: a part of the check: what it finds, and figures for the summary
CheckStep = Callable[[Subject], tuple[list[Finding], dict[str, Any]]]


def make_subject(
    mesh: Mesh,
    slave: tuple[str, ...],
    master: tuple[str, ...],
    dirichlet: tuple[str, ...],
    options: dict[str, Any],
    origin: NDArray[np.floating],
    recognise: bool | None = None,
) -> Subject:
    """Collect the subject of a check. Raises GroupNotFoundError and RequestError for groups that the mesh lacks."""
    groups = {what: tuple(np.asarray(mesh.cells_of(s)) for s in specs) for what, specs in _both(slave, master)}
    fixed = [_nodes_of(mesh, spec) for spec in dirichlet]
    dim = _skin_dim(mesh, concatenated(groups["slave"]))
    sides = {what: _side(mesh, what, specs, groups[what], dim) for what, specs in _both(slave, master)}
    fixed_nodes = np.unique(concatenated(fixed))
    return Subject(mesh, dim, sides["slave"], sides.get("master"), fixed_nodes, dirichlet, options, origin, recognise)


def _both(slave: tuple[str, ...], master: tuple[str, ...]) -> list[tuple[str, tuple[str, ...]]]:
    return [("slave", slave), ("master", master)] if master else [("slave", slave)]


def _skin_dim(mesh: Mesh, cells: Ints) -> int:
    """Dimension of the skins: one less than the mesh's, or 2 for surface cells in a mesh without solids (a shell)."""
    bare = mesh.dim == 2 and mesh.space_dim == 3 and len(cells) and (mesh.cell_dim[cells] == 2).all()
    return 2 if bare else mesh.dim - 1


def _side(mesh: Mesh, what: str, names: tuple[str, ...], groups: tuple[Ints, ...], dim: int) -> CheckedSkin:
    cells, zone, faces, rows = skin_faces(mesh, groups, dim)
    copies = np.setdiff1d(cells, cells[rows])
    return CheckedSkin(what, names, groups, cells[rows], zone[rows], faces, copies)


def _nodes_of(mesh: Mesh, spec: str) -> Ints:
    """The nodes of a node group, or of the cells of a cell group."""
    if spec in mesh.node_groups:
        return np.union1d(mesh.node_groups[spec], mesh.nodes_on(mesh.cell_groups.get(spec, np.empty(0, int))))
    try:
        cells = mesh.cells_of(spec)
    except GroupNotFoundError as error:
        raise GroupNotFoundError(spec, [*mesh.cell_groups, *mesh.node_groups], "cell or node group") from error
    return mesh.nodes_on(cells)


def is_carried(name: str) -> bool:
    """True for types that are passed through unchanged: cells of order 3 and higher."""
    return name not in CELLS


# ---- the macro-elements of the slave skin, from the records of the cut, or recognised from the faces without records


#: types of faces that own an internal dof as they are
_WHOLE = np.array([name in WHOLE_FACES for name in FACE_TYPES])


@dataclass(frozen=True)
class Macros:
    """The macro-elements of the slave faces: `of_face` (f,) numbered from 0, and their `count`.

    `cut` (f,): faces that a cut made or left as a macro-element, by its records or as they were `recognised`; every
    other face is a macro-element by itself. `whole` (f,): faces of types that need no cut (SEG3, TRIA7, QUAD9).
    `number` (count,): number of each macro-element in the records, -1 without one. `faults`: reasons why the records
    cannot be used.
    """

    of_face: Ints
    count: int
    cut: NDArray[np.bool_]
    whole: NDArray[np.bool_]
    number: Ints
    recognised: bool = False
    faults: tuple[Fault, ...] = ()

    def faces(self, some: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(f,): mask of the faces that belong to some macro-elements, given as a mask (count,)."""
        return some[self.of_face]


def macros_of(mesh: Mesh, side: CheckedSkin, recognise: bool | None = None) -> Macros:
    """Return the macro-elements of a skin: from the records, else recognised, else each face by itself.

    `recognise`: as in `cut_skin`.
    """
    own, recognised = np.full(len(side), -1, np.int64), False
    faults = _faults(mesh) if is_cut(mesh) else []
    if recognise is False:
        faults = []
    elif is_cut(mesh) and not faults:
        own = Cut(mesh).macro_of_face[side.cells].astype(np.int64)
    elif recognise and len(side):
        recognised_cut = find_macros(mesh, slave_skin(mesh, side.names))
        if recognised_cut.n_cut:
            recognised = True
            own = as_cut(mesh, recognised_cut).macro_of_face[side.cells].astype(np.int64)
    whole = own >= 0
    last = int(own.max(initial=-1))
    own[~whole] = last + 1 + np.arange(np.count_nonzero(~whole))
    values, of_face = np.unique(own, return_inverse=True)
    number = np.where((values <= last) & (not recognised), values, -1)
    return Macros(of_face, len(values), whole, _WHOLE[side.faces.type], number, recognised, tuple(faults))


def _faults(mesh: Mesh) -> list[Fault]:
    """List the reasons why the records of a mesh cannot be used."""
    try:
        return record_faults(Cut(mesh))
    except (CutError, IndexError, ValueError) as error:
        return [Fault(str(error))]
