"""The mesh with new nodes and children: children replace their parents; numbers, groups and data are carried over.

In a block the unchanged cells come first, in their old order, then the children, parent by parent; in the file the
children take the place of their parent. The first child keeps the parent's number, the others follow the largest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import Origin
from lacmesh.errors import DataError
from lacmesh.mesh import Block, Floats, Ints, Mesh, mask_of
from lacmesh.reference.shapes import shape


@dataclass(frozen=True)
class NewNodes:
    """New nodes `ids` (k, m) in k cells of one type with nodes `sources` (k, n), at reference points `at` (m, dim).

    `on` (k, c): the corners of the face, edge or cell on which they lie.
    """

    type: str
    sources: Ints
    at: Floats
    ids: Ints
    on: Ints


@dataclass
class NodeList:
    """The `parts` of new nodes in the order of their ids, from that of the `following` node on."""

    following: int
    parts: list[NewNodes] = field(default_factory=list)

    def add(self, kind: str, sources: Ints, at: Floats, on: Ints) -> Ints:
        """Add nodes at the points `at` of some cells, numbered cell by cell; return their ids (k, m)."""
        ids = self.following + np.arange(len(sources) * len(at)).reshape(len(sources), len(at))
        self.following += ids.size
        self.parts.append(NewNodes(kind, sources, at, ids, on))
        return ids


@dataclass(frozen=True)
class ChildCells:
    """Cells of one type that replace others: `nodes` (k, n), `parent` (k,), and their order in it, `child_index` (k,).

    The first child of a parent has the index 0.
    """

    type: str
    nodes: Ints
    parent: Ints
    child_index: Ints

    def take(self, rows: Ints) -> ChildCells:
        """Some of the cells."""
        return ChildCells(self.type, self.nodes[rows], self.parent[rows], self.child_index[rows])


def assemble(mesh: Mesh, new_nodes: list[NewNodes], children: list[ChildCells], *, extend: bool) -> tuple[Mesh, Origin]:
    """Build the mesh with new nodes and with the cells that replace others; return it with their origin.

    `extend`: new nodes enter the node groups that hold every corner of the edge, face or cell that they lie on.
    """
    gone = mask_of(mesh.n_cells, *(block.parent for block in children))
    old = {block.type: k for k, block in enumerate(mesh.blocks)}
    new_index = np.empty(mesh.n_cells, np.int32)  # -1 for the cells that are replaced
    new_index[gone] = -1
    blocks, origins, ranks = [], [], []  # ranks of children in the cell that they replace, -1 for cells that stay
    start = 0
    for kind in dict.fromkeys([*old, *(block.type for block in children)]):
        first, stop = mesh.offsets[old[kind] : old[kind] + 2] if kind in old else (0, 0)
        stays = np.flatnonzero(~gone[first:stop])
        mine = _joined(kind, [block for block in children if block.type == kind])
        nodes = mesh.block(kind) if kind in old else mine.nodes.astype(mesh.blocks[0].nodes.dtype)[:0]
        nodes = nodes if len(stays) == len(nodes) else nodes[stays]
        blocks.append(Block(kind, np.concatenate([nodes, mine.nodes], dtype=nodes.dtype)))
        new_index[first + stays] = start + np.arange(len(stays), dtype=np.int32)
        origins += [first + stays, mine.parent]
        ranks += [np.full(len(stays), -1, np.int32), mine.child_index]
        start += len(blocks[-1].nodes)
    origin, rank = (np.concatenate([np.empty(0, np.int32), *parts], dtype=np.int32) for parts in (origins, ranks))
    child = np.flatnonzero(rank >= 0).astype(np.int32)
    child = child[np.lexsort((rank[child], origin[child]))]
    # in the file children take the place of their parent; new numbers grow along it
    place = mesh.places_in_file(origin) * np.int64(1 + rank.max(initial=0)) + np.maximum(rank, 0)
    following = _following_numbers(mesh.cell_number, len(child), "cells")
    number = mesh.cell_number[origin].astype(following.dtype, copy=False)
    later = child[rank[child] > 0]
    number[later[np.argsort(place[later])]] = following[: len(later)]
    in_order = bool((place[1:] > place[:-1]).all())

    def members(ids: Ints) -> Ints:
        """Members of a cell group: the cells that remain, and the children of those that were replaced."""
        born = child[mask_of(mesh.n_cells, ids)[origin[child]]]
        return np.sort(np.concatenate([new_index[ids[~gone[ids]]], born]), kind="stable")

    new = replace(
        mesh,
        blocks=tuple(blocks),
        cell_number=number,
        file_order=None if in_order else np.argsort(place, kind="stable").astype(np.int32),
        cell_groups={name: members(ids) for name, ids in mesh.cell_groups.items()},
        cell_data={name: values[origin] for name, values in mesh.cell_data.items()},
        **nodes_of(mesh, new_nodes, extend),
    )
    cells = ((block.type, block.nodes, block.parent) for block in children)
    first_node = [np.repeat(nodes.sources.min(axis=1), nodes.ids.shape[1]) for nodes in new_nodes]
    origin_of_node = np.concatenate([np.arange(mesh.n_nodes), *first_node], dtype=np.int32)
    return with_node_entities(new, mesh, cells), Origin(origin, origin_of_node, child)


def nodes_of(mesh: Mesh, new_nodes: list[NewNodes], extend: bool) -> dict[str, Any]:
    """Fields of a mesh with new nodes that concern nodes: points, numbers, groups and data, by name."""
    size = mesh.n_nodes + sum(nodes.ids.size for nodes in new_nodes)
    groups = dict(mesh.node_groups)
    for name, members in mesh.node_groups.items() if extend else ():
        inside = mask_of(size, members)
        for nodes in new_nodes:
            inside[nodes.ids[inside[nodes.on].all(axis=1)]] = True
        groups[name] = np.flatnonzero(inside)
    for name, old in mesh.node_data.items():
        if old.dtype.kind not in "fciub":
            raise DataError(f"the node data {name!r} hold {old.dtype}: only numbers can be carried to new nodes")
    data = {name: node_values(old, new_nodes) for name, old in mesh.node_data.items()}
    numbers = _following_numbers(mesh.node_number, size - mesh.n_nodes, "nodes")
    number = np.concatenate([mesh.node_number, numbers], dtype=numbers.dtype)
    points = node_values(mesh.points, new_nodes)
    return {"points": points, "node_number": number, "node_groups": groups, "node_data": data}


def node_values(old: NDArray, new_nodes: list[NewNodes]) -> NDArray:
    """(n + added, ...): values at old and new nodes; reals are interpolated in the cells that new nodes lie in.

    An integer is the value that all nodes of that cell share, else -1; unsigned and boolean data become signed.
    """
    real = old.dtype.kind in "fc"
    if old.dtype.kind in "ub":
        old = old.astype(np.promote_types(old.dtype, np.int8) if old.dtype != np.uint64 else np.int64)
    added = sum(nodes.ids.size for nodes in new_nodes)
    values = np.concatenate([old, np.full((added, *old.shape[1:]), 0 if real else -1, old.dtype)])
    for nodes in new_nodes:
        around = values[nodes.sources]
        if real:
            functions = shape(nodes.type, nodes.at)
            values[nodes.ids] = np.einsum("mn,kn...->km...", functions, around, optimize=True)
        else:
            values[nodes.ids] = np.where((around == around[:, :1]).all(axis=1), around[:, 0], -1)[:, None]
    return values


def with_node_entities(new: Mesh, mesh: Mesh, cells: Iterable[tuple[str, Ints, Ints]]) -> Mesh:
    """Return the mesh `new` with entities of its new nodes: that of the lowest-dimensional of some cells with each.

    `cells`: parts (type, nodes (k, m), indices (k,) in `mesh`, the mesh before). Nothing is done without entities.
    """
    if "entity" not in mesh.node_data or "entity" not in mesh.cell_data:
        return new
    values = new.node_data["entity"].copy()
    for _, nodes, index in sorted(cells, key=lambda part: -ALL_CELLS[part[0]].dim):  # the lowest dimension writes last
        rows, columns = np.nonzero(nodes >= mesh.n_nodes)
        values[nodes[rows, columns]] = mesh.cell_data["entity"][index[rows]]
    return replace(new, node_data={**new.node_data, "entity": values})


# ---- cells


def _joined(kind: str, children: list[ChildCells]) -> ChildCells:
    """Join the children of one type, sorted by the cell they replace."""
    parts = [(c.nodes, c.parent, c.child_index) for c in children]
    none = np.empty(0, np.int64)
    columns = zip((np.empty((0, ALL_CELLS[kind].n_nodes), np.int64), none, none), *parts, strict=True)
    joined = ChildCells(kind, *(np.concatenate(column) for column in columns))
    return joined.take(np.lexsort((joined.child_index, joined.parent)))


def _following_numbers(numbers: Ints, added: int, what: str) -> Ints:
    """(added,): the numbers that follow the largest one. Raises DataError if none are left."""
    largest = int(numbers.max(initial=0))
    if largest + added > np.iinfo(np.int64).max:
        raise DataError(f"no numbers are left for new {what} after {largest}: number them again")
    dtype = numbers.dtype if largest + 1 + added <= np.iinfo(numbers.dtype).max else np.int64
    return (largest + np.arange(1, added + 1)).astype(dtype)
