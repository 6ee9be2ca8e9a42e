"""Assignment of cells and nodes to elementary entities, shared by msh 4.1, msh 2.2 and gmsh's in-memory model.

In gmsh a cell belongs to one entity (dimension, tag) and physical groups are lists of entities. `assign` derives such a
table from groups that may overlap: a cell keeps the entity of `cell_data["entity"]`, and an entity is split only if
group membership differs inside it. New entities hold cells of one order.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import DataError, LacmeshWarning
from lacmesh.indices import codes, divided
from lacmesh.mesh import Ints, Mesh, Tag

_LARGEST = 2**31 - 1


class Entity(NamedTuple):
    """An elementary entity, and the tags of the physical groups (of its own dimension) that it belongs to, sorted."""

    dim: int
    tag: int
    groups: tuple[int, ...]


@dataclass(frozen=True)
class Assignment:
    """Table of entities, sorted by dimension and tag, and the row of each cell and node in it.

    `cell` (n_cells,) and `node` (n_nodes,) are rows of `entities`. `group_tags`: for every cell group the physical
    groups that stand for it. `boundary`: the signed tags of the entities that bound an entity, all of them in the
    table (beyond the largest tag of their dimension: gmsh's way to write an entity embedded in another).
    """

    entities: tuple[Entity, ...]
    cell: Ints
    node: Ints
    group_tags: Mapping[str, tuple[Tag, ...]]
    boundary: Mapping[Tag, tuple[int, ...]]


def assign(mesh: Mesh) -> Assignment:
    """Assign the cells and nodes of a mesh to gmsh's entities (see the module). Warns if two groups claim one tag.

    Where an entity is split, its most numerous combination of groups keeps the tag, the others follow the largest tag
    of the dimension. Without entities there is one for each dimension and combination of groups. Nodes keep
    `node_data["entity"]`, otherwise they take that of the lowest-dimensional cell they belong to; nodes of no cell take
    an existing one. Raises DataError where the data "entity" are not (n, 2) integers.
    """
    group_tags = _group_tags(mesh)
    of_cell, source, groups = _classes(mesh)
    known, node_class = _distinct(mesh.node_data.get("entity"), mesh.n_nodes, "node")
    modelled: list[Tag] = []
    if mesh.model is not None:
        modelled += [*mesh.model.boundary, *(tag for link in mesh.model.periodic for tag in (link.slave, link.master))]
    table: dict[Tag, tuple[int, ...]] = dict.fromkeys(_valid([*modelled, *known]), ())
    before = {*table, *_valid(source)}
    tags = _tags(source, np.bincount(of_cell, minlength=len(source)), table)
    physical = [{dim: tag for dim, tag in reversed(group_tags[name])} for name in mesh.cell_groups]
    for tag, inside in zip(tags, groups, strict=True):
        table[tag] = tuple(sorted(physical[g][tag[0]] for g in inside))
    if not table and mesh.n_nodes:
        table[mesh.space_dim, 1] = ()
    row = {tag: k for k, tag in enumerate(sorted(table))}
    cell = np.array([row[t] for t in tags], np.int32)[of_cell]
    node = np.array([row.get((int(d), int(t)), -1) for d, t in known], np.int32)[node_class]
    parts: dict[Tag, list[int]] = {}  # tags of the new parts of entities that were split
    for old, tag in zip(source, tags, strict=True):
        if old[1] and old != tag:
            parts.setdefault(old, []).append(tag[1])
    return Assignment(
        entities=tuple(Entity(*tag, table[tag]) for tag in row),
        cell=cell,
        node=_every_node(mesh, node, cell, [dim for dim, _ in row]),
        group_tags=group_tags,
        boundary=_boundary(mesh, before, row, parts),
    )


def _classes(mesh: Mesh) -> tuple[Ints, list[Tag], list[tuple[int, ...]]]:
    """Return the class (n_cells,) of each cell: those with the same entity, dimension and groups.

    And of each class, the entity that it comes from (tag 0: from none), and the places of its groups.
    """
    known, which = _distinct(mesh.cell_data.get("entity"), mesh.n_cells, "cell")
    # places n and n + 1 stand for an unknown entity, or one of another dimension than the cell's: linear cells,
    # and higher ones apart, since gmsh's getElements shows one order of a shape in an entity
    n = len(known)
    width = n + 2
    code = np.empty(mesh.n_cells, np.int32)
    for block, a, b in _spans(mesh):
        dim, new = ALL_CELLS[block].dim, n + (ALL_CELLS[block].order > 1)
        code[a:b] = np.where((known[:, 0] == dim) & (known[:, 1] > 0), np.arange(n), new)[which[a:b]] + dim * width
    used, place = codes(code), np.zeros(4 * width, np.int32)
    place[used] = np.arange(len(used))
    tags = np.append(known[:, 1], [0, 0])
    of_cell, first, groups = divided(place[code], len(used), mesh.cell_groups.values())
    source = [(u // width, int(tags[u % width])) for u in used.tolist()]
    return of_cell, [source[k] for k in first], groups


def _tags(source: list[Tag], count: Ints, others: Iterable[Tag]) -> list[Tag]:
    """Entity of each class: the largest class of an entity keeps its tag, the rest follow the largest tag."""
    last = [0, 0, 0, 0]
    for dim, tag in [*others, *source]:
        last[dim] = max(last[dim], tag)
    keeper: dict[Tag, int] = {}
    for c in np.argsort(-count, kind="stable").tolist():
        keeper.setdefault(source[c], c)
    tags = []
    for c, (dim, tag) in enumerate(source):
        if tag == 0 or keeper[dim, tag] != c:
            last[dim] += 1
            tag = last[dim]
        tags.append((dim, tag))
    if max(last) > _LARGEST:
        raise DataError("no tag is left for a new entity; give the entities of the mesh smaller tags")
    return tags


def _distinct(entity: Any, n: int, what: str) -> tuple[Ints, Ints]:
    """Distinct rows of entity data, (u, 2), and each row's index among them, (n,); without data, one unknown entity."""
    if entity is None:
        return np.full((1, 2), -1), np.zeros(n, np.int32)
    entity = np.asarray(entity)
    if entity.shape != (n, 2) or entity.dtype.kind not in "iu":
        raise DataError(f"{what} data 'entity' must be integers of shape ({n}, 2), not {entity.dtype} {entity.shape}")
    if entity.dtype != np.int32 and n and (entity.max() > _LARGEST or entity.min() < -_LARGEST):
        raise DataError(f"{what} data 'entity' has a tag above {_LARGEST}")
    pair = np.ascontiguousarray(entity, np.int32).view(np.int64).ravel()
    start = np.flatnonzero(np.append(True, pair[1:] != pair[:-1])) if n else np.empty(0, np.intp)
    heads = np.sort(pair[start])
    unique = heads[np.append(True, heads[1:] != heads[:-1])] if n else heads
    which = np.searchsorted(unique, pair[start])
    runs = np.diff(np.append(start, n))
    return unique.view(np.int32).reshape(-1, 2), np.repeat(which.astype(np.int32), runs)


def _spans(mesh: Mesh) -> Iterator[tuple[str, int, int]]:
    """Yield (type, first cell, end) of each block."""
    for block, a, b in zip(mesh.blocks, mesh.offsets[:-1], mesh.offsets[1:], strict=True):
        yield block.type, int(a), int(b)


def _valid(tags: Iterable[Any]) -> Iterator[Tag]:
    for dim, tag in tags:
        if 0 <= dim <= 3 and 0 < tag <= _LARGEST:
            yield int(dim), int(tag)


def _group_tags(mesh: Mesh) -> dict[str, tuple[Tag, ...]]:
    """Physical groups of every cell group: its own tags, and a new one for each dimension of its cells without any."""
    tags: dict[str, list[Tag]] = {}
    owner: dict[Tag, str] = {}
    for name in mesh.cell_groups:
        tags[name] = []
        for tag in dict.fromkeys(_valid(mesh.group_tags.get(name, ()))):
            if owner.setdefault(tag, name) == name:
                tags[name].append(tag)
            else:
                message = f"groups {owner[tag]!r} and {name!r} both have the tag {tag[0]}:{tag[1]}: the second loses it"
                warnings.warn(LacmeshWarning(message), stacklevel=3)
    last = [max((t for d, t in owner if d == dim), default=0) for dim in range(4)]
    for name, cells in mesh.cell_groups.items():
        place = np.searchsorted(cells, mesh.offsets)
        for dim in sorted({ALL_CELLS[b.type].dim for b, n in zip(mesh.blocks, np.diff(place), strict=True) if n}):
            if all(d != dim for d, _ in tags[name]):
                last[dim] += 1
                tags[name].append((dim, last[dim]))
    return {name: tuple(t) for name, t in tags.items()}


def _every_node(mesh: Mesh, node: Ints, cell: Ints, dims: list[int]) -> Ints:
    """Fill in missing rows of nodes: that of the lowest-dimensional cell, else the first of the highest dimension."""
    lost = node < 0
    if not lost.any():
        return node
    rows = np.full(mesh.n_nodes, dims.index(max(dims)), np.int32)
    for block, a, b in sorted(_spans(mesh), key=lambda span: -ALL_CELLS[span[0]].dim):
        row = cell[a:b]
        for column in mesh.block(block).T:
            rows[column] = row
    return np.where(lost, rows, node)


def _boundary(
    mesh: Mesh, before: set[Tag], after: Iterable[Tag], parts: Mapping[Tag, list[int]]
) -> dict[Tag, tuple[int, ...]]:
    """Boundaries in the model, restricted to existing entities; the parts of a split entity bound what it bounded.

    `before`, `after`: the entities before and after splitting. A tag beyond the largest of its dimension is gmsh's way
    to write an entity that is embedded in another, so it moves with the largest.
    """
    if mesh.model is None:
        return {}
    was, now = ([max((t for d, t in tags if d == dim), default=0) for dim in range(4)] for tags in (before, after))
    kept: dict[Tag, tuple[int, ...]] = {}
    for (dim, tag), signed in mesh.model.boundary.items():
        if (dim, tag) not in before:
            continue
        bounds: list[int] = []
        for s in signed if dim else ():
            sign, bound, below = (1 if s > 0 else -1), abs(s), dim - 1
            if (below, bound) in before:
                more = parts.get((below, bound), []) if below else []  # a curve has two ends, no more
                bounds += [sign * t for t in (bound, *more)]
            elif (below, bound - was[below]) in before:
                bounds.append(sign * (bound - was[below] + now[below]))
        kept[dim, tag] = tuple(bounds)
    return kept
