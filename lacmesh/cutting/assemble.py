"""The mesh with new nodes and children: children replace their parents; numbers, groups and data are carried over.

In a block the unchanged cells come first, in their old order, then the children, parent by parent; in the file the
children take the place of their parent. The first child keeps the parent's number, the others follow the largest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import Origin
from lacmesh.errors import DataError
from lacmesh.mesh import Block, Floats, Ints, Mesh, mask_of, positions
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
    """Cells of one type that replace others: `nodes` (k, n), `parent` (k,), and `child_index` (k,) in that, from 0."""

    type: str
    nodes: Ints
    parent: Ints
    child_index: Ints

    def take(self, rows: Ints) -> ChildCells:
        """Some of the cells."""
        return ChildCells(self.type, self.nodes[rows], self.parent[rows], self.child_index[rows])


@dataclass(frozen=True)
class _Layout:
    """Layout of the new mesh: `blocks`; `origin` (n_cells,): the old cell that each cell is, or replaces with others.

    `new_index` (old cells,): -1 for those that were replaced. `child` (c,): indices of the children, sorted by the cell
    that they replace, then by `child_index` (c,) in that.
    """

    blocks: tuple[Block, ...]
    origin: Ints
    new_index: Ints
    child: Ints
    child_index: Ints


def assemble(mesh: Mesh, new_nodes: list[NewNodes], children: list[ChildCells], *, extend: bool) -> tuple[Mesh, Origin]:
    """Build the mesh with new nodes and with the cells that replace others; return it with their origin.

    `extend`: new nodes enter the node groups that hold every corner of the edge, face or cell that they lie on.
    """
    layout = _lay_out(mesh, children)
    number, file_order = _numbers_and_order(mesh, layout)
    new = replace(
        mesh,
        blocks=layout.blocks,
        cell_number=number,
        file_order=file_order,
        cell_groups={name: _group(ids, layout) for name, ids in mesh.cell_groups.items()},
        cell_data={name: values[layout.origin] for name, values in mesh.cell_data.items()},
        **nodes_of(mesh, new_nodes, extend),
    )
    cells = ((block.type, block.nodes, block.parent) for block in children)
    first = [np.repeat(nodes.sources.min(axis=1), nodes.ids.shape[1]) for nodes in new_nodes]
    origin_of_node = np.concatenate([np.arange(mesh.n_nodes), *first], dtype=np.int32)
    return with_node_entities(new, mesh, cells), Origin(layout.origin, origin_of_node, layout.child)


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


def _lay_out(mesh: Mesh, children: list[ChildCells]) -> _Layout:
    gone = mask_of(mesh.n_cells, *(block.parent for block in children))
    old = {block.type: k for k, block in enumerate(mesh.blocks)}
    origin = np.empty(mesh.n_cells - np.count_nonzero(gone) + sum(len(block.parent) for block in children), np.int32)
    new_index = np.empty(mesh.n_cells, np.int32)
    blocks, child, index = [], [], []
    start = 0
    for kind in dict.fromkeys([*old, *(block.type for block in children)]):
        mine = _joined(kind, [block for block in children if block.type == kind])
        first, stop = mesh.offsets[old[kind] : old[kind] + 2] if kind in old else (0, 0)
        stays = ~gone[first:stop]
        np.cumsum(stays, out=new_index[first:stop])
        new_index[first:stop] += start - 1
        rows = [mesh.blocks[old[kind]].nodes] if kind in old else []
        gaps = np.flatnonzero(~stays)
        if len(gaps) * 50 > len(stays):
            rows = [rows[0][stays]]
        elif rows:  # few cells go: the rows between them are several times faster to copy
            rows = [rows[0][a + 1 : b] for a, b in pairwise([-1, *gaps.tolist(), len(stays)])]
        dtype = mesh.blocks[old.get(kind, 0)].nodes.dtype
        blocks.append(Block(kind, np.concatenate([*rows, mine.nodes], dtype=dtype)))
        middle = start + int(np.count_nonzero(stays))
        np.add(np.flatnonzero(stays), first, out=origin[start:middle], casting="same_kind")
        start = middle + len(mine.parent)
        origin[middle:start] = mine.parent
        child.append(np.arange(middle, start, dtype=np.int32))
        index.append(mine.child_index)
    new_index[gone] = -1
    all_child, all_index = (np.concatenate([np.empty(0, np.int32), *parts]) for parts in (child, index))
    order = np.lexsort((all_index, origin[all_child]))
    return _Layout(tuple(blocks), origin, new_index, all_child[order], all_index[order])


def _joined(kind: str, children: list[ChildCells]) -> ChildCells:
    """Join the children of one type, sorted by the cell they replace."""
    parts = [(c.nodes, c.parent, c.child_index) for c in children]
    none = np.empty(0, np.int64)
    columns = zip((np.empty((0, ALL_CELLS[kind].n_nodes), np.int64), none, none), *parts, strict=True)
    joined = ChildCells(kind, *(np.concatenate(column) for column in columns))
    return joined.take(np.lexsort((joined.child_index, joined.parent)))


def _numbers_and_order(mesh: Mesh, layout: _Layout) -> tuple[Ints, Ints | None]:
    """Return the numbers of the cells, and their order in the new file: None if it is that of the indices."""
    parent = layout.origin[layout.child]
    following = _following_numbers(mesh.cell_number, len(parent), "cells")
    numbers = mesh.cell_number[layout.origin].astype(following.dtype, copy=False)
    order = np.lexsort((layout.child_index, mesh.places_in_file(parent)))  # new numbers grow along the file
    later = layout.child[order][layout.child_index[order] > 0]
    numbers[later] = following[: len(later)]
    place = mesh.places_in_file(layout.origin) * np.int64(1 + layout.child_index.max(initial=0))
    place[layout.child] += layout.child_index
    return numbers, None if (place[1:] > place[:-1]).all() else np.argsort(place, kind="stable").astype(np.int32)


def _following_numbers(numbers: Ints, added: int, what: str) -> Ints:
    """(added,): the numbers that follow the largest one. Raises DataError if none are left."""
    largest = int(numbers.max(initial=0))
    if largest + added > np.iinfo(np.int64).max:
        raise DataError(f"no numbers are left for new {what} after {largest}: number them again")
    dtype = numbers.dtype if largest + 1 + added <= np.iinfo(numbers.dtype).max else np.int64
    return (largest + np.arange(1, added + 1)).astype(dtype)


def _group(members: Ints, layout: _Layout) -> Ints:
    """Members of a cell group after the cut: the cells that remain, and the children of those that were replaced."""
    if not len(members):
        return members
    consecutive = int(members[-1]) - int(members[0]) + 1 == len(members)
    new = layout.new_index[slice(members[0], members[-1] + 1) if consecutive else members]
    inside = positions(members, layout.origin[layout.child].astype(members.dtype)) >= 0
    if inside.any():
        new = np.concatenate([new[new >= 0], layout.child[inside]])
        new.sort(kind="stable")
    return new.copy() if consecutive and not inside.any() else new
