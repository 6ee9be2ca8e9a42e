"""The part of a mesh that one process needs: the cells that touch its own nodes, and skins that all processes need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.mesh import Ints, Mesh, Model
from lacmesh.origin import origin_of_mesh
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.faces import cells_of_dim, faces_of
from lacmesh.topology.skin import TYPE_CODE, find_owners

Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Part:
    """The part of a mesh that process `rank` of `n_ranks` needs.

    `mesh`: the cells that touch a node of this process, and those asked for besides; nodes and cells are in the order
    of the whole mesh, so that sums over the cells at a node have the terms of the whole mesh in the same order. It has
    all groups, numbers, data and records of a cut of the whole mesh, as far as they are on its nodes and cells.
    `node` (n_nodes,), `cell` (n_cells,): the indices of its nodes and cells in the whole mesh, ascending. `owner`
    (n_nodes,): the rank that owns each node. `body` (n_nodes,): the connected body of the whole mesh, of the cells of
    its highest dimension, to which each node belongs, numbered by `topology.bodies.label_bodies`; -1 for none.

    Of the whole mesh: `n_nodes`, `n_cells`, `n_bodies`, its `dim`, its `origin` (3,) as by `origin_of_mesh`, and the
    lower and upper corner of the `box` (2, 3) of the nodes of these cells.
    """

    mesh: Mesh
    rank: int
    n_ranks: int
    node: Ints
    owner: Ints
    cell: Ints
    n_nodes: int
    n_cells: int
    n_bodies: int
    dim: int
    origin: NDArray[np.floating]
    box: NDArray[np.floating]
    body: Ints

    @property
    def own(self) -> Bools:
        """(n_nodes,): True for the nodes that this process owns."""
        return np.asarray(self.owner == self.rank)


def part_of(mesh: Mesh, owner: Ints, rank: int, *, everywhere: Sequence[str] = ()) -> Part:
    """Return the part of a mesh that process `rank` needs.

    `owner` (n_nodes,): the rank that owns each node, as by `distribute_nodes`. `everywhere`: groups of skin faces, such
    as slaves and masters, that are in every part, with the cells behind them. Raises GroupNotFoundError.

    >>> row = Mesh.create([[0, 0], [1, 0], [2, 0], [3, 0]], [("SEG2", [[0, 1], [1, 2], [2, 3]])])
    >>> part = part_of(row, np.array([0, 0, 1, 1]), 1)
    >>> part.node.tolist(), part.cell.tolist(), part.own.tolist()
    ([1, 2, 3], [1, 2], [False, True, True])
    """
    owner = np.asarray(owner)
    n_ranks = int(owner.max(initial=0)) + 1
    if owner.shape != (mesh.n_nodes,) or not 0 <= rank < n_ranks:
        raise ValueError(f"no rank {rank} of {n_ranks} owns nodes of a mesh of {mesh.n_nodes} nodes")
    cells = touching(mesh, owner == rank)
    cells[everywhere_cells(mesh, everywhere)] = True
    nodes = nodes_of(mesh, cells)
    nodes[owner == rank] = True
    node, cell = np.flatnonzero(nodes), np.flatnonzero(cells)
    solids = [kind_nodes for _, kind_nodes, _ in cells_of_dim(mesh, mesh.dim)]
    body = label_bodies(solids, mesh.n_nodes)
    x = mesh.points[body >= 0]
    return Part(
        mesh=restrict(mesh, node, cell),
        rank=rank,
        n_ranks=n_ranks,
        node=node,
        owner=owner[node],
        cell=cell,
        n_nodes=mesh.n_nodes,
        n_cells=mesh.n_cells,
        n_bodies=int(body.max(initial=-1)) + 1,
        dim=mesh.dim,
        origin=origin_of_mesh(mesh),
        box=np.stack([x.min(axis=0), x.max(axis=0)]) if len(x) else np.zeros((2, 3)),
        body=body[node],
    )


def touching(mesh: Mesh, nodes: Bools) -> Bools:
    """Return a mask (n_cells,) of the cells with at least one of the nodes of a mask (n_nodes,)."""
    touched = np.zeros(mesh.n_cells, bool)
    for k, block in enumerate(mesh.blocks):
        mine = touched[mesh.offsets[k] : mesh.offsets[k + 1]]
        for column in block.nodes.T:
            mine |= nodes[column]
    return touched


def nodes_of(mesh: Mesh, cells: Bools) -> Bools:
    """Return a mask (n_nodes,) of the nodes of the cells of a mask (n_cells,)."""
    nodes = np.zeros(mesh.n_nodes, bool)
    for k, block in enumerate(mesh.blocks):
        nodes[block.nodes[cells[mesh.offsets[k] : mesh.offsets[k + 1]]]] = True
    return nodes


def everywhere_cells(mesh: Mesh, groups: Sequence[str]) -> Ints:
    """Return the cells of some groups of skin faces, and the cells behind these faces. Raises GroupNotFoundError."""
    named = np.unique(np.concatenate([np.empty(0, np.int64), *(mesh.cells_of(name) for name in groups)]))
    known = np.array([b.type in TYPE_CODE and ALL_CELLS[b.type].dim == mesh.dim - 1 for b in mesh.blocks], bool)
    skin = named[known[np.searchsorted(mesh.offsets, named, side="right") - 1]]
    behind = find_owners(faces_of(mesh, skin), cells_of_dim(mesh, mesh.dim), mesh.n_nodes)
    return np.union1d(named, behind.cell)


def restrict(mesh: Mesh, nodes: Ints, cells: Ints) -> Mesh:
    """Return a mesh of some of the nodes and cells, by their indices, ascending; all nodes of the cells are among them.

    Blocks, groups and data that have nothing left are still there, and empty.
    """
    new_node = np.full(mesh.n_nodes, -1, np.int64)
    new_node[nodes] = np.arange(len(nodes))
    new_cell = np.full(mesh.n_cells, -1, np.int64)
    new_cell[cells] = np.arange(len(cells))
    rows = np.split(cells, np.searchsorted(cells, mesh.offsets[1:-1]))
    return replace(
        mesh,
        points=mesh.points[nodes],
        blocks=tuple(
            block._replace(nodes=new_node[block.nodes[own - start]].astype(block.nodes.dtype))
            for block, own, start in zip(mesh.blocks, rows, mesh.offsets, strict=False)
        ),
        node_number=mesh.node_number[nodes],
        cell_number=mesh.cell_number[cells],
        file_order=None if mesh.file_order is None else _left(mesh.file_order, new_cell),
        cell_groups={name: _left(members, new_cell) for name, members in mesh.cell_groups.items()},
        node_groups={name: _left(members, new_node) for name, members in mesh.node_groups.items()},
        cell_data={name: values[cells] for name, values in mesh.cell_data.items()},
        node_data={name: values[nodes] for name, values in mesh.node_data.items()},
        model=None if mesh.model is None else _periodic_left(mesh.model, new_node),
    )


def _left(members: Ints, new: Ints) -> Ints:
    """Return the new indices of those members that are left; `new`: the new index of each old one, -1 for none."""
    indices = new[members]
    return indices[indices >= 0]


def _periodic_left(model: Model, new_node: Ints) -> Model:
    """Return the model with those pairs of periodic nodes that are both left."""
    links = []
    for link in model.periodic:
        pairs = new_node[link.nodes]
        links.append(replace(link, nodes=pairs[(pairs >= 0).all(axis=1)]))
    return replace(model, periodic=tuple(links))
