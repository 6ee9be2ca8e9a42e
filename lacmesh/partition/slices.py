"""The part of a mesh that each process needs, dealt out from slices of its file: no process holds the whole mesh.

Each process reads a slice (`lacmesh.formats.slices`): some consecutive nodes, and some cells of each type. All
nodes are bisected together, so that each has an owner (`lacmesh.partition.bisection`). A process then sends each of its
cells to the owners of the cell's nodes, and those that touch a skin to all; it asks for the points, numbers and
data of its nodes where they are kept (`homes`). The result is that of `part_of`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.communicator import Communicator
from lacmesh.errors import GroupNotFoundError, LacmeshWarning, RequestError
from lacmesh.formats import detect_format, med, msh
from lacmesh.formats.slices import MeshSlice
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, mask_of
from lacmesh.model import entity_rows, entity_tag
from lacmesh.origin import bounds_of
from lacmesh.partition import Part
from lacmesh.partition.bisection import distribute_points
from lacmesh.partition.parts import WholeMesh, check_skins, nodes_of, periodic_left, touching
from lacmesh.partition.pieces import PieceIndices, cells_of_ranks
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.faces import cells_of_dim


class Homes:
    """Homes of all nodes; this process is that of the nodes `start` to `stop`, the next one of those after them."""

    def __init__(self, comm: Communicator, start: int, stop: int) -> None:
        self.comm, self._start, self._n = comm, start, stop - start
        self._ends = comm.gather(np.array([stop]))

    def _counts(self, node: Ints) -> Ints:
        """Return how many of some nodes, ascending, are at home on each process, (size,)."""
        return np.diff(np.searchsorted(node, self._ends), prepend=0)

    def ask(self, node: Ints) -> Callable[[NDArray], NDArray]:
        """Return a function of the values at home (stop - start, ...) that returns those of some nodes, ascending."""
        own = self._counts(node)
        asked, counts = self.comm.exchange(node, own)
        return lambda values: self.comm.exchange(values[asked - self._start], counts, own)[0]

    def give(self, node: Ints, values: Ints) -> Ints:
        """Return the values (stop - start,) at home that all processes give to their nodes, ascending; -1 for none."""
        given = np.full(self._n, -1, values.dtype)
        index, counts = self.comm.exchange(node, self._counts(node))
        given[index - self._start] = self.comm.exchange(values, self._counts(node), counts)[0]
        return given


def join_bodies(mesh: Mesh, dim: int, node: Ints, own: NDArray[np.bool_], homes: Homes) -> tuple[Ints, int]:
    """Return the body (n_nodes,) of the whole mesh to which each node of a part belongs, and the number of bodies.

    `dim`: the highest dimension of the whole mesh's cells; `node`, `own` (n_nodes,): as in a Part. Bodies of the part
    are joined where an owner has a node in another one, and numbered by their first nodes, as by `label_bodies`.
    """
    comm = homes.comm
    label = label_bodies([nodes for _, nodes, _ in cells_of_dim(mesh, dim)], mesh.n_nodes)
    count = int(label.max(initial=-1)) + 1
    label[label >= 0] += comm.before(count)
    n_labels = int(comm.total(np.array(count)))
    of_owner = homes.ask(node)(homes.give(node[own], label[own]))
    joined = label_bodies([comm.gather(_pairs(label, of_owner))], n_labels)
    first = np.full(int(joined.max(initial=-1)) + 1, np.iinfo(np.int64).max)
    ours = own & (label >= 0)
    np.minimum.at(first, joined[label[ours]], node[ours])
    first = -comm.greatest(-first)
    number = np.argsort(np.argsort(first))
    return np.where(of_owner < 0, -1, number[joined[of_owner]] if len(number) else -1), len(number)


def _pairs(one: Ints, other: Ints) -> Ints:
    """Return the different pairs (k, 2) of labels of the nodes that have one in both."""
    both = (one >= 0) & (other >= 0)
    return np.unique(np.column_stack([one[both], other[both]]), axis=0)


_Bools = NDArray[np.bool_]
#: types of cells, with their nodes (k, n)
_Blocks = list[tuple[str, Ints]]
#: what makes the values on the nodes or cells of a part of those in the slice
_Dealt = Callable[[NDArray], NDArray]
_NONE = np.empty(0, np.int64)
#: formats that are read by slices
SLICE_OF = {"med": med.reader.slice_of, "msh": msh.reader.slice_of}


def read_in_slices(path: Path, comm: Communicator, everywhere: Sequence[str]) -> Part | None:
    """Return the part of the mesh in a MED or msh file that this process needs; None if it must be read as a whole.

    `everywhere`: groups of skin faces that are in every part, as for `part_of`; those that the file does not have are
    left out of `Part.everywhere`. A mesh is read as a whole if there are fewer cells of each type of the highest
    dimension than processes, or if a cut is recorded without the names of its zones; a msh file, too, that is not msh
    4.1 in binary, or has cells of a type that msh lacks. Raises ReadError, DataError and RequestError, on all processes
    alike.
    """
    slice_of = SLICE_OF[comm.on_each(lambda: detect_format(path).format)]
    content = slice_of(path, comm)
    if content is None or _must_be_whole(content, comm):
        return None
    for message in content.said:
        warnings.warn(message, LacmeshWarning, stacklevel=2)
    owner = distribute_points(content.points, content.node_number, comm.size, comm)
    return _Dealer(content, owner, comm).part(everywhere)


def _must_be_whole(content: MeshSlice, comm: Communicator) -> bool:
    """True for a mesh that `read_in_slices` does not read."""
    most = max((c.rows.size for c in content.cells if ALL_CELLS[c.type].dim == content.dim), default=0)
    if min(most, content.rows.size) < comm.size:
        return True
    macro = content.cell_data.get("lac_macro")
    if macro is None or content.noted.get("zones"):
        return False
    return bool(comm.greatest(np.array(macro.max(initial=-1))) >= 0)


@dataclass(frozen=True)
class _Dealer:
    """A slice of a mesh, with the `owner` (k,) of each of its nodes."""

    content: MeshSlice
    owner: Ints
    comm: Communicator

    @cached_property
    def homes(self) -> Homes:
        """The processes that have the nodes in their slices."""
        return Homes(self.comm, self.content.rows.start, self.content.rows.stop)

    @cached_property
    def index(self) -> Ints:
        """(k,): index in the whole mesh of each cell of the slice."""
        first = np.cumsum([0, *(c.rows.size for c in self.content.cells)])
        ours = [np.arange(c.rows.start, c.rows.stop) for c in self.content.cells]
        return concatenated(start + rows for start, rows in zip(first, ours, strict=False))

    def part(self, everywhere: Sequence[str]) -> Part:
        """Return the part of this process."""
        groups = {**self.content.cell_groups, **self._entities(everywhere)}
        names = self._named(everywhere, groups)
        sent = self._cells_to_send(names, groups)
        n_sent = np.diff(sent.start)
        index, n_received = self.comm.exchange(self.index[sent.index], n_sent)
        order = np.argsort(index)
        blocks = self._blocks(sent)
        node = _distinct([self._own_nodes(), *(nodes for _, nodes in blocks)])
        ask = self.homes.ask(node)
        mesh = self._mesh(
            node, blocks, ask, lambda values: self.comm.exchange(values[sent.index], n_sent, n_received)[0][order]
        )
        owner = ask(self.owner)
        own = np.asarray(owner == self.comm.rank)
        body, n_bodies = join_bodies(mesh, self.content.dim, node, own, self.homes)
        whole = self._whole(mesh, own, body, n_bodies)
        return Part(mesh, self.comm.rank, self.comm.size, node, owner, index[order], body, whole, names)

    def _mesh(self, node: Ints, blocks: _Blocks, of_nodes: _Dealt, of_cells: _Dealt) -> Mesh:
        """Return the mesh of some nodes and blocks, by indices in the whole mesh; values on them come by functions."""
        content = self.content
        noted = dict(content.noted)
        if noted.get("model") is not None:
            noted["model"] = periodic_left(noted["model"], node)
        if content.cell_place is not None:
            noted["file_order"] = np.argsort(of_cells(content.cell_place))
        return Mesh.create(
            of_nodes(content.points),
            [(kind, np.searchsorted(node, nodes).astype(nodes.dtype)) for kind, nodes in blocks],
            space_dim=content.space_dim,
            node_number=of_nodes(content.node_number),
            cell_number=of_cells(content.cell_number),
            cell_groups=_groups(content.cell_groups, len(content.cell_number), of_cells),
            node_groups=_groups(content.node_groups, content.rows.n, of_nodes),
            cell_data={name: of_cells(values) for name, values in content.cell_data.items()},
            node_data={name: of_nodes(values) for name, values in content.node_data.items()},
            **noted,
        )

    def _entities(self, everywhere: Sequence[str]) -> dict[str, Ints]:
        """Return the members in the slice of the entities of msh among some names, as far as the file has them."""
        entity = entity_rows(self.content.cell_data, len(self.index))
        tagged = {}
        for name in everywhere:
            if name.startswith("entity:") and name not in self.content.cell_groups:
                with suppress(RequestError):
                    tagged[name] = np.flatnonzero((entity == entity_tag(name)).all(axis=1))
        return {name: here for name, here in tagged.items() if self.comm.total(np.array(len(here)))}

    def _named(self, everywhere: Sequence[str], groups: Mapping[str, Ints]) -> tuple[str, ...]:
        """Return the names of those groups that the file has. Raises RequestError for a tag of several groups."""
        tags = self.content.noted.get("group_tags", {})
        header = Mesh.create(np.empty((0, 3)), [], cell_groups=dict.fromkeys(groups, _NONE), group_tags=tags)
        names = []
        for name in everywhere:
            with suppress(GroupNotFoundError):
                names.append(header.group(name))
        return tuple(names)

    def _own_nodes(self) -> Ints:
        """Return the nodes that this process owns, ascending."""
        order = np.argsort(self.owner, kind="stable")
        counts = np.bincount(self.owner, minlength=self.comm.size)
        return self.comm.exchange(self.content.rows.start + order, counts)[0]

    def _blocks(self, sent: PieceIndices) -> _Blocks:
        """Return the nodes of the cells of each type that come to this process, in the order of the whole mesh."""
        blocks, start = [], 0
        for c in self.content.cells:
            mine = (sent.index >= start) & (sent.index < start + c.rows.n)
            counts = np.diff(sent.count(mine))
            blocks.append((c.type, self.comm.exchange(c.nodes[sent.index[mine] - start], counts)[0]))
            start += c.rows.n
        return blocks

    def _cells_to_send(self, names: Sequence[str], groups: Mapping[str, Ints]) -> PieceIndices:
        """Return the cells of the slice that each process needs: those at its own nodes, and those of some skins."""
        node = _distinct([c.nodes for c in self.content.cells])
        mesh = Mesh.create(
            np.zeros((len(node), 3)),
            [(c.type, np.searchsorted(node, c.nodes)) for c in self.content.cells],
            cell_groups=groups,
        )
        owner = self.homes.ask(node)(self.owner)
        return cells_of_ranks(mesh, owner, self.comm.size, self._around_skins(mesh, node, names))

    def _around_skins(self, mesh: Mesh, node: Ints, names: Sequence[str]) -> Ints:
        """Return the cells of the slice that `cells_of_skins` finds for some groups of the whole mesh, ascending.

        `mesh`: the slice, of the nodes (k,) of the whole mesh.
        """
        self.comm.on_each(lambda: check_skins(mesh, names))
        around = mask_of(mesh.n_cells, *(mesh.cells_of(name) for name in names))
        skin = np.unique(self.comm.gather(node[nodes_of(mesh, around)]))
        around |= touching(mesh, np.isin(node, skin))
        parent = self.content.cell_data.get("lac_parent")
        if parent is not None:
            cut = np.unique(self.comm.gather(np.unique(parent[around & (parent >= 0)])))
            around |= np.isin(parent, cut)
        return np.flatnonzero(around)

    def _whole(self, mesh: Mesh, own: _Bools, body: Ints, n_bodies: int) -> WholeMesh:
        """Return the figures of the whole mesh from those of all parts; `own`, `body` (n_nodes,): as in a Part."""
        used = nodes_of(mesh, np.ones(mesh.n_cells, bool)) if self.content.cells else np.ones(mesh.n_nodes, bool)
        numbers = self.content.node_number, self.content.cell_number
        largest = [int(self.comm.greatest(np.array(number.max(initial=0)))) for number in numbers]
        return WholeMesh(
            n_nodes=self.content.rows.size,
            types=tuple((c.type, c.rows.size) for c in self.content.cells),
            dim=self.content.dim,
            n_bodies=n_bodies,
            largest_node=largest[0],
            largest_cell=largest[1],
            used=self._bounds(mesh.points[own & used]),
            box=self._bounds(mesh.points[own & (body >= 0)]),
        )

    def _bounds(self, x: Floats) -> NDArray[np.floating]:
        """Return the corners (2, 3) of the box of the points x (k, 3) of all processes, as by `bounds_of`."""
        if not self.comm.total(np.array(len(x))):
            return np.zeros((2, 3))
        low, high = bounds_of(x) if len(x) else np.full((2, 3), [[np.inf], [-np.inf]])
        return np.array([-self.comm.greatest(-low), self.comm.greatest(high)])


def _distinct(nodes: Sequence[Ints]) -> Ints:
    """Return the different nodes in some arrays of any shape, ascending."""
    return np.unique(concatenated(map(np.unique, nodes)))


def _groups(members: Mapping[str, Ints], size: int, dealt: _Dealt) -> dict[str, Ints]:
    """Return the members of each group that a part has, of those in a slice of `size` nodes or cells: a bit each."""
    bits = np.zeros((size, (len(members) + 7) // 8), np.uint8)
    for k, index in enumerate(members.values()):
        bits[index, k // 8] |= 1 << k % 8
    there = dealt(bits)
    return {name: np.flatnonzero(there[:, k // 8] & (1 << k % 8)) for k, name in enumerate(members)}
