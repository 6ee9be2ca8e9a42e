"""The part of a mesh that each process needs, dealt out from slices of its file: no process holds the whole mesh.

Each process reads a slice (`lacmesh.formats.med.reader`): some consecutive nodes, and some cells of each type. All
nodes are bisected together, so that each has an owner (`lacmesh.partition.bisection`). A process then sends each of its
cells to the owners of the cell's nodes, and those that touch a skin to all; it asks for the points, numbers and
data of its nodes where they are kept (`homes`). The result is that of `part_of`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import GroupNotFoundError, LacmeshWarning
from lacmesh.formats.med import families
from lacmesh.formats.med.blocks import Slice
from lacmesh.formats.med.reader import MeshSlice, read_slice
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.origin import bounds_of
from lacmesh.partition import Part
from lacmesh.partition.bisection import distribute_points
from lacmesh.partition.parts import WholeMesh, check_skins, nodes_of, periodic_left, skin_name, touching
from lacmesh.partition.pieces import PieceIndices, cells_of_ranks
from lacsolver.distributed.collective import Collective, Routes
from lacsolver.distributed.homes import Homes, join_bodies

_Bools = NDArray[np.bool_]
#: types of cells, with their nodes (k, n)
_Blocks = list[tuple[str, Ints]]
#: what makes the values on the nodes or cells of a part of those in the slice
_Dealt = Callable[[NDArray], NDArray]
_NONE = np.empty(0, np.int64)


def read_in_slices(path: Path, together: Collective, everywhere: Sequence[str]) -> Part | None:
    """Return the part of the mesh in a MED file that this process needs; None for a mesh that must be read as a whole.

    `everywhere`: groups of skin faces that are in every part, as for `part_of`; those that the file does not have are
    left out of `Part.everywhere`. A mesh is read as a whole if one of them is an entity of msh, if there are fewer
    cells of each type of the highest dimension than processes, or if a cut is recorded without the names of its zones.
    Raises ReadError, DataError and RequestError, on all processes alike.
    """
    content = together.on_each(lambda: read_slice(path, Slice(together.rank, together.n)))
    if _must_be_whole(content, everywhere, together):
        return None
    said = list(content.said)
    for what, used, defined in (
        ("cells", content.cell_family, content.cell_families),
        ("nodes", content.node_family, content.node_families),
    ):
        said += families.undefined(np.unique(together.gather(np.unique(used))), defined, what)
    numbers = content.numbers(lambda number: _repeated(number, together), said)
    if said:
        warnings.warn(f"{path}: {'; '.join(said)}", LacmeshWarning, stacklevel=2)
    owner = distribute_points(content.points, numbers[0], together.n, together)
    return _Dealer(content, numbers, owner, together).part(everywhere)


def _must_be_whole(content: MeshSlice, everywhere: Sequence[str], together: Collective) -> bool:
    """True for a mesh that `read_in_slices` does not read."""
    most = max((c.rows.size for c in content.cells if ALL_CELLS[c.kind.type].dim == content.dim), default=0)
    if min(most, content.rows.size) < together.n or any(name.startswith("entity:") for name in everywhere):
        return True
    macro = content.data.cell_data.get("lac_macro")
    if macro is None or content.noted.get("zones"):
        return False
    return bool(together.greatest(np.array(macro.max(initial=-1))) >= 0)


@dataclass(frozen=True)
class _Dealer:
    """A slice of a mesh, with the `numbers` of its nodes and cells, and the `owner` (k,) of each of its nodes."""

    content: MeshSlice
    numbers: tuple[Ints, Ints]
    owner: Ints
    together: Collective

    @cached_property
    def homes(self) -> Homes:
        """The processes that have the nodes in their slices."""
        return Homes(self.together, self.content.rows.start, self.content.rows.stop)

    @cached_property
    def groups(self) -> dict[str, Ints]:
        """The members of each group of cells in the slice."""
        return families.members(self.content.cell_family, self.content.cell_families)

    @cached_property
    def index(self) -> Ints:
        """(k,): index in the whole mesh of each cell of the slice."""
        first = np.cumsum([0, *(c.rows.size for c in self.content.cells)])
        ours = [np.arange(c.rows.start, c.rows.stop) for c in self.content.cells]
        return np.concatenate([_NONE, *(start + rows for start, rows in zip(first, ours, strict=False))])

    def part(self, everywhere: Sequence[str]) -> Part:
        """Return the part of this process."""
        names = self._named(everywhere)
        sent = self._cells_to_send(names)
        routes = Routes(self.together, np.diff(sent.start))
        index = routes.there(self.index[sent.index])
        order = np.argsort(index)
        blocks = self._blocks(sent)
        node = _distinct([self._own_nodes(), *(nodes for _, nodes in blocks)])
        ask = self.homes.ask(node)
        mesh = self._mesh(node, blocks, ask, lambda values: routes.there(values[sent.index])[order])
        owner = ask(self.owner)
        own = np.asarray(owner == self.together.rank)
        body, n_bodies = join_bodies(mesh, self.content.dim, node, own, self.homes)
        whole = self._whole(mesh, own, body, n_bodies)
        return Part(mesh, self.together.rank, self.together.n, node, owner, index[order], body, whole, names)

    def _mesh(self, node: Ints, blocks: _Blocks, of_nodes: _Dealt, of_cells: _Dealt) -> Mesh:
        """Return the mesh of some nodes and blocks, by indices in the whole mesh; values on them come by functions."""
        content = self.content
        noted = dict(content.noted)
        if noted.get("model") is not None:
            noted["model"] = periodic_left(noted["model"], node)
        return Mesh.create(
            of_nodes(content.points),
            [(kind, np.searchsorted(node, nodes)) for kind, nodes in blocks],
            space_dim=content.space_dim,
            node_number=of_nodes(self.numbers[0]),
            cell_number=of_cells(self.numbers[1]),
            cell_groups=families.members(of_cells(content.cell_family), content.cell_families),
            node_groups=families.members(of_nodes(content.node_family), content.node_families),
            cell_data={name: of_cells(values) for name, values in content.data.cell_data.items()},
            node_data={name: of_nodes(values) for name, values in content.data.node_data.items()},
            steps=content.data.steps,
            name=content.name,
            **noted,
        )

    def _named(self, everywhere: Sequence[str]) -> tuple[str, ...]:
        """Return the names of those groups that the file has. Raises RequestError for a tag of several groups."""
        tags = self.content.noted.get("group_tags", {})
        header = Mesh.create(np.empty((0, 3)), [], cell_groups=dict.fromkeys(self.groups, _NONE), group_tags=tags)
        names = []
        for name in everywhere:
            with suppress(GroupNotFoundError):
                names.append(skin_name(header, name))
        return tuple(names)

    def _own_nodes(self) -> Ints:
        """Return the nodes that this process owns, ascending."""
        order = np.argsort(self.owner, kind="stable")
        return Routes(self.together, np.bincount(self.owner, minlength=self.together.n)).there(
            self.content.rows.start + order
        )

    def _blocks(self, sent: PieceIndices) -> _Blocks:
        """Return the nodes of the cells of each type that come to this process, in the order of the whole mesh."""
        blocks, start = [], 0
        for c in self.content.cells:
            mine = (sent.index >= start) & (sent.index < start + c.rows.n)
            routes = Routes(self.together, np.diff(sent.count(mine)))
            blocks.append((c.kind.type, routes.there(c.nodes[sent.index[mine] - start])))
            start += c.rows.n
        return blocks

    def _cells_to_send(self, names: Sequence[str]) -> PieceIndices:
        """Return the cells of the slice that each process needs: those at its own nodes, and those of some skins."""
        node = _distinct([c.nodes for c in self.content.cells])
        mesh = Mesh.create(
            np.zeros((len(node), 3)),
            [(c.kind.type, np.searchsorted(node, c.nodes)) for c in self.content.cells],
            cell_groups=self.groups,
        )
        owner = self.homes.ask(node)(self.owner)
        return cells_of_ranks(mesh, owner, self.together.n, self._around_skins(mesh, node, names))

    def _around_skins(self, mesh: Mesh, node: Ints, names: Sequence[str]) -> Ints:
        """Return the cells of the slice that `cells_of_skins` finds for some groups of the whole mesh, ascending.

        `mesh`: the slice, of the nodes (k,) of the whole mesh.
        """
        self.together.on_each(lambda: check_skins(mesh, names))
        around = np.zeros(mesh.n_cells, bool)
        for name in names:
            around[mesh.cells_of(name)] = True
        skin = np.unique(self.together.gather(node[nodes_of(mesh, around)]))
        around |= touching(mesh, np.isin(node, skin))
        parent = self.content.data.cell_data.get("lac_parent")
        if parent is not None:
            cut = np.unique(self.together.gather(np.unique(parent[around & (parent >= 0)])))
            around |= np.isin(parent, cut)
        return np.flatnonzero(around)

    def _whole(self, mesh: Mesh, own: _Bools, body: Ints, n_bodies: int) -> WholeMesh:
        """Return the figures of the whole mesh from those of all parts; `own`, `body` (n_nodes,): as in a Part."""
        used = nodes_of(mesh, np.ones(mesh.n_cells, bool)) if self.content.cells else np.ones(mesh.n_nodes, bool)
        largest = [int(self.together.greatest(np.array(number.max(initial=0)))) for number in self.numbers]
        return WholeMesh(
            n_nodes=self.content.rows.size,
            types=tuple((c.kind.type, c.rows.size) for c in self.content.cells),
            dim=self.content.dim,
            n_bodies=n_bodies,
            largest_node=largest[0],
            largest_cell=largest[1],
            used=self._bounds(mesh.points[own & used]),
            box=self._bounds(mesh.points[own & (body >= 0)]),
        )

    def _bounds(self, x: Floats) -> NDArray[np.floating]:
        """Return the corners (2, 3) of the box of the points x (k, 3) of all processes, as by `bounds_of`."""
        if not self.together.total(np.array(len(x))):
            return np.zeros((2, 3))
        low, high = bounds_of(x) if len(x) else np.full((2, 3), [[np.inf], [-np.inf]])
        return np.array([-self.together.greatest(-low), self.together.greatest(high)])


def _distinct(nodes: Sequence[Ints]) -> Ints:
    """Return the different nodes in some arrays of any shape, ascending."""
    return np.unique(np.concatenate([_NONE, *map(np.unique, nodes)]))


def _repeated(number: Ints, together: Collective) -> int | None:
    """Return the smallest of the numbers (k,) of all processes that occurs several times, or None."""
    ends = together.gather(number[[0, -1]] if len(number) else number)
    ascending = (np.diff(number) > 0).all() and (ends[1:-1:2] < ends[2::2]).all()
    if together.greatest(np.array(not ascending, np.int64)) == 0:
        return None
    where = number % together.n
    order = np.argsort(where, kind="stable")
    ordered = np.sort(Routes(together, np.bincount(where, minlength=together.n)).there(number[order]))
    again = ordered[1:][ordered[1:] == ordered[:-1]]
    none = np.iinfo(np.int64).max
    least = -int(together.greatest(np.array(-again[0] if len(again) else -none)))
    return None if least == none else least
