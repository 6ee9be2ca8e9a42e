"""The part of a mesh that one process needs: the cells that touch its own nodes, and skins that all processes need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import RequestError
from lacmesh.mesh import Ints, Mesh, Model
from lacmesh.origin import origin_of_mesh
from lacmesh.topology.bodies import label_bodies
from lacmesh.topology.faces import cells_of_dim, faces_of
from lacmesh.topology.skin import TYPE_CODE, find_owners, first_of_each, label_faces

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
    as slaves and masters, that are in every part, with the cells behind them. Raises GroupNotFoundError, RequestError.

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
    for skin in cells_of_skins(mesh, everywhere):
        cells[skin] = True
    nodes = nodes_of(mesh, cells)
    nodes[owner == rank] = True
    node, cell = np.flatnonzero(nodes), np.flatnonzero(cells)
    body = bodies_of(mesh)
    return Part(
        mesh=restrict(mesh, node, cell),
        rank=rank,
        n_ranks=n_ranks,
        node=node,
        owner=owner[node],
        cell=cell,
        body=body[node],
        **facts_of(mesh, body),
    )


def bodies_of(mesh: Mesh) -> Ints:
    """Return the connected body (n_nodes,) of each node, of the cells of the highest dimension; -1 for none."""
    return label_bodies([nodes for _, nodes, _ in cells_of_dim(mesh, mesh.dim)], mesh.n_nodes)


def facts_of(mesh: Mesh, body: Ints) -> dict[str, Any]:
    """Return the fields of `Part` that are of the whole mesh; `body` (n_nodes,): the result of `bodies_of`."""
    x = np.ascontiguousarray(mesh.points[body >= 0].T)
    return {
        "n_nodes": mesh.n_nodes,
        "n_cells": mesh.n_cells,
        "n_bodies": int(body.max(initial=-1)) + 1,
        "dim": mesh.dim,
        "origin": origin_of_mesh(mesh),
        "box": np.stack([x.min(axis=1), x.max(axis=1)]) if x.size else np.zeros((2, 3)),
    }


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


def cells_of_skins(mesh: Mesh, groups: Sequence[str]) -> list[Ints]:
    """Return for each of some groups of skin faces its cells and the cells behind its faces, ascending.

    Raises GroupNotFoundError, and RequestError for a group that holds cells of the highest dimension.
    """
    members = [np.asarray(mesh.cells_of(name)) for name in groups]
    for name, cells in zip(groups, members, strict=True):
        if (mesh.cell_dim[cells] == mesh.dim).any():
            raise RequestError(f"group {name!r} holds cells of dimension {mesh.dim}; name a group of skin faces")
    named = np.unique(np.concatenate([np.empty(0, np.int64), *members]))
    known = np.array([b.type in TYPE_CODE and ALL_CELLS[b.type].dim == mesh.dim - 1 for b in mesh.blocks], bool)
    skin = named[known[np.searchsorted(mesh.offsets, named, side="right") - 1]]
    faces = faces_of(mesh, skin)
    first, face = first_of_each(*label_faces(faces))
    behind = find_owners(faces.take(first), cells_of_dim(mesh, mesh.dim), mesh.n_nodes)
    found = []
    for cells in members:
        of_group = np.zeros(len(first), bool)
        of_group[face[np.isin(skin, cells, assume_unique=True)]] = True
        found.append(np.union1d(cells, behind.cell[of_group[behind.face]]))
    return found


def restrict(mesh: Mesh, nodes: Ints, cells: Ints) -> Mesh:
    """Return a mesh of some of the nodes and cells, by their indices, ascending; all nodes of the cells are among them.

    Blocks, groups and data that have nothing left are still there, and empty.
    """
    rows = np.split(cells, np.searchsorted(cells, mesh.offsets[1:-1]))
    return replace(
        mesh,
        points=mesh.points[nodes],
        blocks=tuple(
            block._replace(nodes=positions(nodes, block.nodes[own - start]).astype(block.nodes.dtype))
            for block, own, start in zip(mesh.blocks, rows, mesh.offsets, strict=False)
        ),
        node_number=mesh.node_number[nodes],
        cell_number=mesh.cell_number[cells],
        file_order=None if mesh.file_order is None else _left(cells, mesh.file_order),
        cell_groups={name: _left(cells, members) for name, members in mesh.cell_groups.items()},
        node_groups={name: _left(nodes, members) for name, members in mesh.node_groups.items()},
        cell_data={name: values[cells] for name, values in mesh.cell_data.items()},
        node_data={name: values[nodes] for name, values in mesh.node_data.items()},
        model=None if mesh.model is None else periodic_left(mesh.model, nodes),
    )


def positions(index: Ints, members: Ints) -> Ints:
    """Return the position in `index` (k,), ascending, of each member, in the shape of `members`; -1 if it is not there.

    >>> positions(np.array([2, 5, 7]), np.array([[7, 2], [3, 9]])).tolist()
    [[2, 0], [-1, -1]]
    """
    if not len(index):
        return np.full(members.shape, -1)
    place = np.minimum(np.searchsorted(index, members), len(index) - 1)
    return np.where(index[place] == members, place, -1)


def _left(index: Ints, members: Ints) -> Ints:
    """Return the positions in `index` of those members that are there."""
    place = positions(index, members)
    return place[place >= 0]


def periodic_left(model: Model, nodes: Ints) -> Model:
    """Return the model with those pairs of periodic nodes that are both among `nodes`, by their positions there."""
    links = []
    for link in model.periodic:
        pairs = positions(nodes, link.nodes)
        links.append(replace(link, nodes=pairs[(pairs >= 0).all(axis=1)]))
    return replace(model, periodic=tuple(links))
