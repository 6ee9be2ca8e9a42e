"""The mesh after a cut: children replace their parents; numbers, groups and data are carried over.

In a block the unchanged cells come first, in their old order, then the children, parent by parent; in the file the
children take the place of their parent. The first child keeps the parent's number, the others follow the largest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import Origin
from lacmesh.cutting.subdivide import ChildCells, NewNodes, n_added, node_values
from lacmesh.errors import DataError
from lacmesh.mesh import Block, Ints, Mesh, mask_of, places_of, positions


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

    @property
    def parent(self) -> Ints:
        """(c,): the old cell that each child replaces."""
        return self.origin[self.child]


def assemble(mesh: Mesh, new_nodes: list[NewNodes], children: list[ChildCells], *, extend: bool) -> tuple[Mesh, Origin]:
    """Build the mesh with new nodes and with the cells that replace others; return it with their origin.

    `extend`: new nodes enter the node groups that hold every corner of the edge, face or cell that they lie on.
    """
    layout = _lay_out(mesh, children)
    new = replace(
        mesh,
        blocks=layout.blocks,
        cell_number=_cell_numbers(mesh, layout),
        file_order=_file_order(mesh, layout),
        cell_groups={name: _group(ids, layout) for name, ids in mesh.cell_groups.items()},
        cell_data={name: values[layout.origin] for name, values in mesh.cell_data.items()},
        **nodes_of(mesh, new_nodes, extend),
    )
    if "entity" in new.node_data and "entity" in mesh.cell_data:
        cells = ((block.type, block.nodes, mesh.cell_data["entity"][block.parent]) for block in children)
        entity = node_entities(new.node_data["entity"], mesh.n_nodes, cells)
        new = replace(new, node_data={**new.node_data, "entity": entity})
    return new, Origin(layout.origin, _node_origin(mesh, new_nodes), layout.child)


def nodes_of(mesh: Mesh, new_nodes: list[NewNodes], extend: bool) -> dict[str, Any]:
    """Fields of a mesh with new nodes that concern nodes: points, numbers, groups and data, by name."""
    return {
        "points": node_values(mesh.points, new_nodes),
        "node_number": _more_numbers(mesh.node_number, n_added(new_nodes)),
        "node_groups": _node_groups(mesh, new_nodes, extend),
        "node_data": _node_data(mesh, new_nodes),
    }


def _node_origin(mesh: Mesh, new_nodes: list[NewNodes]) -> Ints:
    """(n_nodes,): each node itself, and for a new node the first of the face or cell that it was put into."""
    first = [np.repeat(nodes.sources.min(axis=1), nodes.ids.shape[1]) for nodes in new_nodes]
    return np.concatenate([np.arange(mesh.n_nodes), *first], dtype=np.int32)


def _lay_out(mesh: Mesh, children: list[ChildCells]) -> _Layout:
    gone = mask_of(mesh.n_cells, *(block.parent for block in children))
    old = {block.type: k for k, block in enumerate(mesh.blocks)}
    n_children = sum(len(block.parent) for block in children)
    origin = np.empty(mesh.n_cells - np.count_nonzero(gone) + n_children, np.int32)
    new_index = np.empty(mesh.n_cells, np.int32)
    blocks, child, index = [], [], []
    start = 0
    for kind in dict.fromkeys([*old, *(block.type for block in children)]):
        own = _joined(kind, [block for block in children if block.type == kind])
        first, stop = mesh.offsets[old[kind] : old[kind] + 2] if kind in old else (0, 0)
        kept = np.flatnonzero(~gone[first:stop])
        np.cumsum(~gone[first:stop], out=new_index[first:stop])
        new_index[first:stop] += start - 1
        blocks.append(Block(kind, _nodes(mesh, old.get(kind), gone[first:stop], len(kept), own)))
        end = start + len(kept) + len(own.parent)
        np.add(kept, first, out=origin[start : start + len(kept)], casting="same_kind")
        origin[start + len(kept) : end] = own.parent
        child.append(np.arange(start + len(kept), end, dtype=np.int32))
        index.append(own.child_index)
        start = end
    new_index[gone] = -1
    all_child, all_index = (np.concatenate([np.empty(0, np.int32), *parts]) for parts in (child, index))
    order = np.lexsort((all_index, origin[all_child]))
    return _Layout(tuple(blocks), origin, new_index, all_child[order], all_index[order])


def _joined(kind: str, children: list[ChildCells]) -> ChildCells:
    """Join the children of one type, sorted by the cell they replace."""
    empty = ChildCells(kind, np.empty((0, ALL_CELLS[kind].n_nodes), np.int64), *(np.empty(0, np.int64),) * 2)
    parts = [empty, *children]
    joined = ChildCells(
        kind, *(np.concatenate([getattr(p, f) for p in parts]) for f in ("nodes", "parent", "child_index"))
    )
    return joined.take(np.lexsort((joined.child_index, joined.parent)))


def _nodes(mesh: Mesh, k: int | None, gone: NDArray[np.bool_], kept: int, own: ChildCells) -> Ints:
    """Node lists of the cells of one type: first the cells that stay, then the children."""
    if k is None:
        return own.nodes.astype(mesh.blocks[0].nodes.dtype)
    old = mesh.blocks[k].nodes
    nodes = np.empty((kept + len(own.parent), old.shape[1]), old.dtype)
    _copy_kept(old, gone, nodes[:kept])
    nodes[kept:] = own.nodes
    return nodes


def _copy_kept(old: NDArray, gone: NDArray[np.bool_], target: NDArray) -> None:
    """Copy the rows old[~gone] into `target`; run by run if these are few: several times faster."""
    gaps = np.flatnonzero(gone)
    if len(gaps) * 50 > len(old):
        target[:] = old[~gone]
        return
    start = done = 0
    for stop in (*gaps.tolist(), len(old)):
        if stop > start:
            target[done : done + stop - start] = old[start:stop]
            done += stop - start
        start = stop + 1


def _cell_numbers(mesh: Mesh, layout: _Layout) -> Ints:
    numbers = mesh.cell_number[layout.origin]
    first = _next_number(mesh.cell_number, len(layout.child), "cells")
    if first + len(layout.child) > np.iinfo(numbers.dtype).max:
        numbers = numbers.astype(np.int64)
    order = np.lexsort((layout.child_index, mesh.places_in_file(layout.parent)))  # new numbers grow along the file
    later = layout.child[order][layout.child_index[order] > 0]
    numbers[later] = first + np.arange(len(later))
    return numbers


def _more_numbers(numbers: Ints, added: int) -> Ints:
    """Append `added` numbers that follow the largest one. Raises DataError if none are left."""
    first = _next_number(numbers, added, "nodes")
    dtype = numbers.dtype if first + added <= np.iinfo(numbers.dtype).max else np.dtype(np.int64)
    return np.concatenate([numbers, np.arange(first, first + added, dtype=dtype)], dtype=dtype)


def _next_number(numbers: Ints, added: int, what: str) -> int:
    largest = int(numbers.max(initial=0))
    if largest + added > np.iinfo(np.int64).max:
        raise DataError(f"no numbers are left for new {what} after {largest}: number them again")
    return largest + 1


def _file_order(mesh: Mesh, layout: _Layout) -> Ints | None:
    """Order of the cells in the new file; None if it is that of the indices."""
    count = np.ones(mesh.n_cells, np.int16)
    count[layout.parent] = 0
    np.add.at(count, layout.parent, 1)
    in_file = count if mesh.file_order is None else count[mesh.file_order]
    start = np.cumsum(in_file, dtype=np.int32)
    start -= in_file
    if mesh.file_order is not None:
        start[mesh.file_order] = start.copy()
    place = start[layout.origin]
    del start, count, in_file
    place[layout.child] += layout.child_index.astype(np.int32)
    if (place[1:] > place[:-1]).all():
        return None
    return places_of(place, len(place), np.int32)


def _group(members: Ints, layout: _Layout) -> Ints:
    """Members of a cell group after the cut: the cells that remain, and the children of those that were replaced."""
    if not len(members):
        return members
    consecutive = int(members[-1]) - int(members[0]) + 1 == len(members)
    new = layout.new_index[slice(members[0], members[-1] + 1) if consecutive else members]
    inside = positions(members, layout.parent.astype(members.dtype)) >= 0
    if inside.any():
        new = np.concatenate([new[new >= 0], layout.child[inside]])
        new.sort(kind="stable")
    return new.copy() if consecutive and not inside.any() else new


def _node_data(mesh: Mesh, new_nodes: list[NewNodes]) -> dict[str, NDArray]:
    """Node data of old and new nodes: interpolated; integer data by `_common_values`."""
    return {
        name: node_values(old, new_nodes) if old.dtype.kind in "fc" else _common_values(name, old, new_nodes)
        for name, old in mesh.node_data.items()
    }


def _common_values(name: str, old: NDArray, new_nodes: list[NewNodes]) -> NDArray:
    """Integer data of old and new nodes: a new node takes the value that all nodes of its source cell share, else -1.

    Unsigned and boolean data become signed.
    """
    if old.dtype.kind not in "iub":
        raise DataError(f"the node data {name!r} hold {old.dtype}: only numbers can be carried to new nodes")
    if old.dtype.kind in "ub":
        old = old.astype(np.promote_types(old.dtype, np.int8) if old.dtype != np.uint64 else np.int64)
    values = np.concatenate([old, np.full((n_added(new_nodes), *old.shape[1:]), -1, old.dtype)])
    for nodes in new_nodes:
        around = values[nodes.sources]
        agreed = np.where((around == around[:, :1]).all(axis=1), around[:, 0], -1)
        values[nodes.ids] = agreed[:, None]
    return values


def node_entities(values: NDArray, first: int, cells: Iterable[tuple[str, Ints, NDArray]]) -> NDArray:
    """Entities of nodes (n, 2); nodes from `first` on take that of the lowest-dimensional cell that contains them.

    `cells`: parts (type, nodes (k, m), entities (k, 2)).
    """
    values = values.copy()
    for _, nodes, entity in sorted(cells, key=lambda part: -ALL_CELLS[part[0]].dim):  # the lowest dimension writes last
        rows, columns = np.nonzero(nodes >= first)
        values[nodes[rows, columns]] = entity[rows]
    return values


def _node_groups(mesh: Mesh, new_nodes: list[NewNodes], extend: bool) -> dict[str, Ints]:
    """Node groups after the cut; with `extend`, a new node enters those with all corners of its edge, face or cell."""
    if not extend:
        return dict(mesh.node_groups)
    size = mesh.n_nodes + n_added(new_nodes)
    groups: dict[str, Ints] = {}
    for name, members in mesh.node_groups.items():
        inside = mask_of(size, members)
        for nodes in new_nodes:
            inside[nodes.ids[inside[nodes.on].all(axis=1)]] = True
        groups[name] = np.flatnonzero(inside)
    return groups
