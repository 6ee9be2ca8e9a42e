"""The subject of a check: the mesh, its slave and master skins, the macro-elements, the constrained nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.checks.findings import Finding, Where, counted
from lacmesh.checks.macros import Macros, macros_of
from lacmesh.checks.rules import RULES
from lacmesh.cutting.records import CELL_RECORDS
from lacmesh.cutting.select import in_first_group
from lacmesh.errors import GroupNotFoundError, some
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.body_names import body_names
from lacmesh.topology.faces import cells_of_dim, distinct_faces
from lacmesh.topology.facets import Facets
from lacmesh.topology.skin import TYPE_CODE, FaceIncidence, Faces, find_owners

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

    `recognise`: treat a slave skin that looks cut and has no records as cut (`lacmesh.cut_skin`). The mesh's points are
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
    dim = _skin_dim(mesh, np.concatenate([np.empty(0, np.int64), *groups["slave"]]))
    sides = {what: _side(mesh, what, specs, groups[what], dim) for what, specs in _both(slave, master)}
    fixed_nodes = np.unique(np.concatenate([np.empty(0, np.int64), *fixed]))
    return Subject(mesh, dim, sides["slave"], sides.get("master"), fixed_nodes, dirichlet, options, origin, recognise)


def _both(slave: tuple[str, ...], master: tuple[str, ...]) -> list[tuple[str, tuple[str, ...]]]:
    return [("slave", slave), ("master", master)] if master else [("slave", slave)]


def _skin_dim(mesh: Mesh, cells: Ints) -> int:
    """Dimension of the skins: one less than the mesh's, or 2 for surface cells in a mesh without solids (a shell)."""
    bare = mesh.dim == 2 and mesh.space_dim == 3 and len(cells) and (mesh.cell_dim[cells] == 2).all()
    return 2 if bare else mesh.dim - 1


def _side(mesh: Mesh, what: str, names: tuple[str, ...], groups: tuple[Ints, ...], dim: int) -> CheckedSkin:
    known = np.array([b.type in TYPE_CODE and ALL_CELLS[b.type].dim == dim > 0 for b in mesh.blocks] or [False], bool)
    parts = [cells[known[np.searchsorted(mesh.offsets, cells, side="right") - 1]] for cells in groups]
    cells, zone = in_first_group(parts)
    faces, rows = distinct_faces(mesh, cells) if len(cells) else (Faces.join([]), np.empty(0, np.int64))
    copies = np.setdiff1d(cells, cells[rows])
    return CheckedSkin(what, names, groups, cells[rows], zone[rows], faces, copies)


def _nodes_of(mesh: Mesh, spec: str) -> Ints:
    """The nodes of a node group, or of the cells of a cell group."""
    if spec in mesh.node_groups:
        mine = [mesh.node_groups[spec]]
        if spec in mesh.cell_groups:
            mine += [nodes.ravel() for _, _, nodes in mesh.select(mesh.cell_groups[spec])]
        return np.unique(np.concatenate(mine))
    try:
        cells = mesh.cells_of(spec)
    except GroupNotFoundError as error:
        raise GroupNotFoundError(spec, [*mesh.cell_groups, *mesh.node_groups], "cell or node group") from error
    return np.unique(np.concatenate([np.empty(0, np.int64), *(n.ravel() for _, _, n in mesh.select(cells))]))


def is_carried(name: str) -> bool:
    """True for types that are passed through unchanged: cells of order 3 and higher."""
    return name not in CELLS
