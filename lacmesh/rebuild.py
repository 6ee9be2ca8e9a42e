"""The mesh after a cut: children in the place of their cells, numbers, groups and data carried over.

In a block the cells left alone come first, in their old order, then the children, cell by cell; in the file a cell's
children stand where it stood. The first child keeps its cell's number, the others follow the largest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.mesh import Block, Ints, Mesh
from lacmesh.subdivide import Birth, Leaves, Subdivision


@dataclass(frozen=True)
class _Layout:
    """Where cells go: `source` (new cells,) the old cell each comes from, `new_index` (old cells,) -1 where replaced.

    `child` (c,) indices of the children sorted by `root` (c,), the cell they replace, then in order: `seq` (c,).
    """

    blocks: tuple[Block, ...]
    source: Ints
    new_index: Ints
    child: Ints
    root: Ints
    seq: Ints


@dataclass(frozen=True)
class Origin:
    """Where cells of the new mesh come from: `child` (c,) replaces the old cell `root` (c,), as number `rank` (c,) of
    its children; `followed`: the new indices of the old cells asked about, -1 for those that were replaced.
    """

    child: Ints
    root: Ints
    rank: Ints
    followed: Ints


def rebuild(mesh: Mesh, made: Subdivision, follow: Ints, *, extend: bool) -> tuple[Mesh, Origin]:
    """The new mesh, and where its cells come from; `follow`: old cells whose new indices are wanted.

    `extend`: new nodes enter the node groups that hold every corner of what they lie on.
    """
    layout = _lay_out(mesh, made.leaves)
    numbers = _cell_numbers(mesh, layout)
    cell_groups = {name: _group(ids, layout) for name, ids in mesh.cell_groups.items()}
    added = made.n_nodes - mesh.n_nodes
    first_number = int(mesh.node_number.max(initial=0)) + 1
    new = replace(
        mesh,
        points=node_values(mesh.points, made.births, added),
        blocks=layout.blocks,
        node_number=np.concatenate([mesh.node_number, first_number + np.arange(added)]),
        cell_number=numbers,
        file_order=_file_order(mesh, layout),
        cell_groups=cell_groups,
        node_groups=node_groups(mesh, made.births, extend),
        cell_data={name: _carry(values, layout.source) for name, values in mesh.cell_data.items()},
        node_data=node_data(mesh, made.births, added),
    )
    if "entity" in new.node_data and "entity" in mesh.cell_data:
        new = replace(new, node_data={**new.node_data, "entity": _node_entities(mesh, made, new.node_data["entity"])})
    return new, Origin(layout.child, layout.root, layout.seq, layout.new_index[follow])


def _lay_out(mesh: Mesh, leaves: list[Leaves]) -> _Layout:
    by_type: dict[str, list[Leaves]] = {}
    for leaf in leaves:
        by_type.setdefault(leaf.type, []).append(leaf)
    replaced = np.zeros(mesh.n_cells, bool)
    for leaf in leaves:
        replaced[leaf.root] = True
    old = {block.type: k for k, block in enumerate(mesh.blocks)}
    new_index = np.full(mesh.n_cells, -1, np.int32)
    blocks, source, child, root, key = [], [], [], [], []
    start = 0
    for kind in [*old, *(t for t in by_type if t not in old)]:
        nodes, cells, made = _block(mesh, old.get(kind), replaced, kind, by_type.get(kind, []))
        kept = len(cells)
        new_index[cells] = np.arange(start, start + kept, dtype=np.int32)
        child.append(np.arange(start + kept, start + len(nodes), dtype=np.int32))
        source += [cells, made.root.astype(np.int32)]
        root.append(made.root)
        key.append(made.key)
        blocks.append(Block(kind, nodes))
        start += len(nodes)
    all_root, all_key, all_child = (np.concatenate(part) for part in (root, key, child))
    order = np.lexsort((all_key, all_root))
    all_root = all_root[order]
    first = np.flatnonzero(np.diff(all_root, prepend=-1))
    seq = np.arange(len(order)) - np.repeat(first, np.diff(first, append=len(order)))
    filled = tuple(b for b in blocks if len(b.nodes) or b.type in old)
    return _Layout(filled, np.concatenate(source), new_index, all_child[order], all_root, seq)


def _block(
    mesh: Mesh, k: int | None, replaced: NDArray[np.bool_], kind: str, made: list[Leaves]
) -> tuple[Ints, Ints, Leaves]:
    """A type's nodes: cells left alone, then children by cell; the old indices of the former, and the latter."""
    width = ALL_CELLS[kind].n_nodes
    empty = Leaves(kind, np.empty((0, width), np.int64), np.empty(0, np.int64), np.empty(0, np.int64))
    parts = [empty, *made]
    joined = Leaves(kind, *(np.concatenate([getattr(p, f) for p in parts]) for f in ("nodes", "root", "key")))
    joined = joined.take(np.lexsort((joined.key, joined.root)))
    if k is None:
        dtype = mesh.blocks[0].nodes.dtype if mesh.blocks else np.int64
        return joined.nodes.astype(dtype), np.empty(0, np.int32), joined
    old = mesh.blocks[k].nodes
    here = replaced[mesh.offsets[k] : mesh.offsets[k + 1]]
    rows = np.flatnonzero(~here).astype(np.int32)
    nodes = np.empty((len(rows) + len(joined.root), width), old.dtype)
    _copy_rows(old, here, rows, nodes)
    nodes[len(rows) :] = joined.nodes
    return nodes, rows + np.int32(mesh.offsets[k]), joined


def _copy_rows(old: Ints, left_out: NDArray[np.bool_], rows: Ints, target: Ints) -> None:
    """target[: len(rows)] = old[rows], run by run where there are few: copying is several times faster than picking."""
    gaps = np.flatnonzero(left_out)
    if len(gaps) * 20 > len(old):
        np.take(old, rows, axis=0, out=target[: len(rows)], mode="clip")
        return
    start = done = 0
    for stop in (*gaps.tolist(), len(old)):
        if stop > start:
            target[done : done + stop - start] = old[start:stop]
            done += stop - start
        start = stop + 1


def _carry(values: NDArray, source: Ints) -> NDArray:
    """values[source]; pairs of 4 bytes (entities) go as one number of 8, many times faster."""
    if values.ndim == 2 and values.shape[1] == 2 and values.itemsize == 4 and values.flags.c_contiguous:
        return np.take(values.view(np.int64)[:, 0], source).view(values.dtype).reshape(-1, 2)
    return np.take(values, source, axis=0)


def _cell_numbers(mesh: Mesh, layout: _Layout) -> Ints:
    numbers = np.take(mesh.cell_number, layout.source)
    if mesh.file_order is None:
        place = layout.root
    else:
        rank = np.empty(mesh.n_cells, np.int32)
        rank[mesh.file_order] = np.arange(mesh.n_cells, dtype=np.int32)
        place = rank[layout.root]
    order = np.lexsort((layout.seq, place))  # new numbers grow along the file
    later = layout.child[order][layout.seq[order] > 0]
    numbers[later] = int(mesh.cell_number.max(initial=0)) + 1 + np.arange(len(later))
    return numbers


def _file_order(mesh: Mesh, layout: _Layout) -> Ints | None:
    """The new file's order of cells; None where it is that of the indices."""
    count = np.ones(mesh.n_cells, np.int16)
    count[layout.root] = 0
    np.add.at(count, layout.root, 1)
    in_file = count if mesh.file_order is None else count[mesh.file_order]
    start = np.cumsum(in_file, dtype=np.int32)
    start -= in_file
    if mesh.file_order is not None:
        start[mesh.file_order] = start.copy()
    place = start[layout.source]
    del start, count, in_file
    place[layout.child] += layout.seq.astype(np.int32)
    if (place[1:] > place[:-1]).all():
        return None
    order = np.empty(len(place), np.int32)
    order[place] = np.arange(len(place), dtype=np.int32)
    return order


def _group(members: Ints, layout: _Layout) -> Ints:
    """A cell group after the cut: its cells, and the children of those that were replaced."""
    new = layout.new_index[members]
    at = np.searchsorted(members, layout.root)
    inside = at < len(members)
    inside[inside] = members[at[inside]] == layout.root[inside]
    if inside.any():
        new = np.concatenate([new[new >= 0], layout.child[inside]])
        new.sort(kind="stable")
    return new.astype(np.int64)


def node_values(old: NDArray, births: list[Birth], added: int) -> NDArray:
    """(n + added, ...): values of old and new nodes, by the shape functions of the cells in which these are born."""
    values = np.concatenate([old, np.zeros((added, *old.shape[1:]), old.dtype)])
    for birth in births:
        values[birth.ids] = birth.values(values)
    return values


def node_data(mesh: Mesh, births: list[Birth], added: int) -> dict[str, NDArray]:
    """Node data of old and new nodes: interpolated, or what the nodes around agree on where it is integer."""
    return {
        name: (node_values if old.dtype.kind == "f" else _common_values)(old, births, added)
        for name, old in mesh.node_data.items()
    }


def _common_values(old: NDArray, births: list[Birth], added: int) -> NDArray:
    """Integer values: that of the nodes around where they agree, else -1."""
    values = np.concatenate([old, np.full((added, *old.shape[1:]), -1, old.dtype)])
    for birth in births:
        around = values[birth.sources]
        agreed = np.where((around == around[:, :1]).all(axis=1), around[:, 0], -1)
        values[birth.ids] = agreed[:, None]
    return values


def _node_entities(mesh: Mesh, made: Subdivision, values: NDArray) -> NDArray:
    """New nodes belong to the entity of the lowest-dimensional cell they lie on: their slave face, else the parent."""
    values = values.copy()
    for leaf in sorted(made.leaves, key=lambda leaf: -CELLS[leaf.type].dim):  # the lowest dimension writes last
        fresh = leaf.nodes >= mesh.n_nodes
        values[leaf.nodes[fresh]] = np.repeat(mesh.cell_data["entity"][leaf.root], fresh.sum(axis=1), axis=0)
    return values


def node_groups(mesh: Mesh, births: list[Birth], extend: bool) -> dict[str, Ints]:
    """Node groups, with the new nodes that lie on an edge, face or cell all of whose corners they hold (`extend`)."""
    if not extend:
        return dict(mesh.node_groups)
    size = max((int(b.ids.max()) + 1 for b in births), default=mesh.n_nodes)
    groups: dict[str, Ints] = {}
    for name, members in mesh.node_groups.items():
        inside = np.zeros(size, bool)
        inside[members] = True
        for birth in births:
            inside[birth.ids[inside[birth.on].all(axis=1)]] = True
        groups[name] = np.flatnonzero(inside)
    return groups
