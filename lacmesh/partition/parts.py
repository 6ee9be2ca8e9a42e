"""The part of a mesh that one process needs: the cells that touch its own nodes, and skins that all processes need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import RequestError
from lacmesh.joining import restrict
from lacmesh.mesh import Ints, Mesh, mask_of
from lacmesh.origin import bounds_of, bounds_of_mesh, origin_of
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.skin import cells_of_dim

Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Part:
    """The part of a mesh that process `rank` of `n_ranks` needs.

    `mesh`: the cells that touch a node of this process, those of the groups `everywhere`, and the nodes that all
    processes need, with the cells that have no others; nodes and cells are in the order of the whole mesh, so that sums
    over the cells at a node have the terms of the whole mesh in the same order. It has all groups, numbers, data and
    records of a cut of the whole mesh, as far as they are on its nodes and cells. `node` (k,), `cell` (c,): the indices
    of its nodes and cells in the whole mesh, ascending. `owner` (k,): the rank that owns each node. `body` (k,): the
    connected body of the whole mesh, of the cells of its highest dimension, to which each node belongs, numbered by
    `topology.bodies.label_bodies`; -1 for none.

    The rest are figures of the whole mesh. `types`: each type of cells, in the order of the blocks, with the number of
    its cells. `dim`: the highest dimension of a cell. `largest_node`, `largest_cell`: the largest of the file's
    numbers. `used` (2, 3), `box` (2, 3): lower and upper corner of the box of the nodes of all cells, and of those of
    the highest dimension.
    """

    mesh: Mesh
    rank: int
    n_ranks: int
    node: Ints
    owner: Ints
    cell: Ints
    body: Ints
    everywhere: tuple[str, ...]
    n_nodes: int
    types: tuple[tuple[str, int], ...]
    dim: int
    n_bodies: int
    largest_node: int
    largest_cell: int
    used: NDArray[np.floating]
    box: NDArray[np.floating]

    @property
    def own(self) -> Bools:
        """(k,): True for the nodes that this process owns."""
        return np.asarray(self.owner == self.rank)

    @property
    def n_cells(self) -> int:
        """Number of cells of the whole mesh."""
        return sum(count for _, count in self.types)

    @cached_property
    def origin(self) -> NDArray[np.floating]:
        """(3,): the origin of the coordinates of the whole mesh, as by `origin_of_mesh`."""
        return origin_of(self.used)


def part_of(mesh: Mesh, owner: Ints, rank: int, *, everywhere: Sequence[str] = (), nodes: Bools | None = None) -> Part:
    """Return the part of a mesh that process `rank` needs.

    `owner` (n_nodes,): the rank that owns each node, as by `distribute_nodes`. `everywhere`: groups of skin faces, such
    as slaves and masters, that are in every part, with all cells that touch them. `nodes` (n_nodes,): a mask of nodes
    that are in every part, with the cells all of whose nodes are among them. Raises GroupNotFoundError, and
    RequestError.

    >>> row = Mesh.create([[0, 0], [1, 0], [2, 0], [3, 0]], [("SEG2", [[0, 1], [1, 2], [2, 3]])])
    >>> part = part_of(row, np.array([0, 0, 1, 1]), 1)
    >>> part.node.tolist(), part.cell.tolist(), part.own.tolist()
    ([1, 2, 3], [1, 2], [False, True, True])
    """
    owner = np.asarray(owner)
    n_ranks = int(owner.max(initial=0)) + 1
    if owner.shape != (mesh.n_nodes,) or not 0 <= rank < n_ranks:
        raise ValueError(f"no rank {rank} of {n_ranks} owns nodes of a mesh of {mesh.n_nodes} nodes")
    node, cell = needed(mesh, owner == rank, everywhere, nodes)
    body = bodies_of(mesh)
    return Part(
        mesh=restrict(mesh, node, cell),
        rank=rank,
        n_ranks=n_ranks,
        node=node,
        owner=owner[node],
        cell=cell,
        body=body[node],
        everywhere=tuple(skin_name(mesh, name) for name in everywhere),
        **figures_of(mesh, body),
    )


def bodies_of(mesh: Mesh) -> Ints:
    """Return the connected body (n_nodes,) of each node, of the cells of the highest dimension; -1 for none."""
    return label_bodies([nodes for _, nodes, _ in cells_of_dim(mesh, mesh.dim)], mesh.n_nodes)


def figures_of(mesh: Mesh, body: Ints) -> dict[str, Any]:
    """Return the figures of a whole mesh that each `Part` has; `body` (n_nodes,): the result of `bodies_of`."""
    return {
        "n_nodes": mesh.n_nodes,
        "types": tuple((block.type, len(block.nodes)) for block in mesh.blocks),
        "dim": mesh.dim,
        "n_bodies": int(body.max(initial=-1)) + 1,
        "largest_node": int(mesh.node_number.max(initial=0)),
        "largest_cell": int(mesh.cell_number.max(initial=0)),
        "used": bounds_of_mesh(mesh),
        "box": bounds_of(mesh.points[body >= 0]),
    }


def needed(mesh: Mesh, own: Bools, everywhere: Sequence[str] = (), nodes: Bools | None = None) -> tuple[Ints, Ints]:
    """Return the nodes and the cells, ascending, that a process needs: see `Part`; `own` (n_nodes,): its own nodes.

    `nodes` (n_nodes,): nodes that all processes need.
    """
    cells = _touching(mesh, own)
    for name in everywhere:
        cells |= cells_of_skin(mesh, name)
    if nodes is not None:
        own = own | nodes
        cells |= ~_touching(mesh, ~nodes)
    return nodes_of(mesh, cells, own), np.flatnonzero(cells)


def _touching(mesh: Mesh, nodes: Bools) -> Bools:
    """Return a mask (n_cells,) of the cells with at least one of the nodes of a mask (n_nodes,)."""
    touched = np.zeros(mesh.n_cells, bool)
    for k, block in enumerate(mesh.blocks):
        of_block = touched[mesh.offsets[k] : mesh.offsets[k + 1]]
        for column in block.nodes.T:
            of_block |= nodes[column]
    return touched


def nodes_of(mesh: Mesh, cells: Bools, more: Bools | None = None) -> Ints:
    """Return the nodes, ascending, of the cells of a mask (n_cells,), and those of the mask `more` (n_nodes,)."""
    nodes = np.zeros(mesh.n_nodes, bool) if more is None else more.copy()
    for k, block in enumerate(mesh.blocks):
        nodes[block.nodes[cells[mesh.offsets[k] : mesh.offsets[k + 1]]]] = True
    return np.flatnonzero(nodes)


def cells_of_skin(mesh: Mesh, name: str) -> Bools:
    """Return a mask (n_cells,) of the cells of a group of skin faces, and of all cells that touch one of their nodes.

    Where a cut has made such a cell, the other children of the same parent are there, too. Raises GroupNotFoundError,
    and RequestError for a group that has cells of the highest dimension.
    """
    faces = mesh.cells_of(name)
    if (mesh.cell_dim[faces] == mesh.dim).any():
        raise RequestError(f"group {name!r} holds cells of dimension {mesh.dim}; name a group of skin faces")
    cells = _touching(mesh, mask_of(mesh.n_nodes, mesh.nodes_on(faces)))
    parent = mesh.cell_data.get("lac_parent")
    if parent is not None:
        cells |= (parent >= 0) & np.isin(parent, parent[cells])
    return cells


def skin_name(mesh: Mesh, spec: str) -> str:
    """Return the name of the group that `spec` denotes (`Mesh.group`), or `spec` if it is an entity of msh.

    Raises GroupNotFoundError.
    """
    return spec if spec.startswith("entity:") and spec not in mesh.cell_groups else mesh.group(spec)
