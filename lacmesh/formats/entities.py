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
    classes = _Classes(mesh)
    classes.split_by_groups(mesh)
    known, node_class = _distinct(mesh.node_data.get("entity"), mesh.n_nodes, "node")
    names = list(mesh.cell_groups)
    table: dict[Tag, tuple[int, ...]] = {tag: () for tag in [*_modelled(mesh), *_valid(known)]}
    before = {*table, *_valid(classes.source)}
    tags = classes.choose_tags(table)
    for tag, groups in zip(tags, classes.groups, strict=True):
        table[tag] = tuple(sorted(_tag_of(group_tags[names[g]], tag[0]) for g in groups))
    if not table and mesh.n_nodes:
        table[mesh.space_dim, 1] = ()
    row = {tag: k for k, tag in enumerate(sorted(table))}
    cell = np.array([row[t] for t in tags], np.int32)[classes.of_cell]
    node = np.array([row.get((int(d), int(t)), -1) for d, t in known], np.int32)[node_class]
    return Assignment(
        entities=tuple(Entity(*tag, table[tag]) for tag in row),
        cell=cell,
        node=_every_node(mesh, node, cell, [dim for dim, _ in row]),
        group_tags=group_tags,
        boundary=_boundary(mesh, before, row, classes.parts(tags)),
    )


class _Classes:
    """Classes of cells that have the same entity, dimension and groups; refined by one group after the other.

    `of_cell` (n_cells,): the class of a cell; `source`: the entity that a class comes from (tag 0: from none);
    `groups`: the groups of a class, as positions in `mesh.cell_groups`.
    """

    def __init__(self, mesh: Mesh) -> None:
        known, which = _distinct(mesh.cell_data.get("entity"), mesh.n_cells, "cell")
        # places n and n + 1 stand for an unknown entity, or one of another dimension than the cell's: linear cells,
        # and higher ones apart, since gmsh's getElements shows one order of a shape in an entity
        n = len(known)
        width = n + 2
        dims = known[:, 0]
        valid = known[:, 1] > 0
        code = np.empty(mesh.n_cells, np.int32)
        for block, a, b in _spans(mesh):
            dim, new = ALL_CELLS[block].dim, n + (ALL_CELLS[block].order > 1)
            code[a:b] = np.where((dims == dim) & valid, np.arange(n), new)[which[a:b]] + dim * width
        count = np.bincount(code, minlength=4 * width)
        used = np.flatnonzero(count)
        place = np.zeros(len(count), np.int32)
        place[used] = np.arange(len(used))
        tags = np.append(known[:, 1], [0, 0])
        self.of_cell: Ints = place[code]
        self.count: Ints = count[used]
        self.source: list[Tag] = [(int(u) // width, int(tags[u % width])) for u in used]
        self.groups: list[list[int]] = [[] for _ in used]

    def split_by_groups(self, mesh: Mesh) -> None:
        for g, cells in enumerate(mesh.cell_groups.values()):
            if len(cells):
                self._split(g, cells)

    def _split(self, group: int, cells: Ints) -> None:
        """Divide every class that lies partly in a group; note the group in those that lie in it."""
        member = self.of_cell[cells]
        inside = np.bincount(member, minlength=len(self.count))
        touched = np.flatnonzero(inside)
        part = touched[inside[touched] < self.count[touched]]
        for c in touched[inside[touched] == self.count[touched]].tolist():
            self.groups[c].append(group)
        if not len(part):
            return
        new = np.arange(len(self.count), dtype=np.int32)
        new[part] = len(self.count) + np.arange(len(part))
        self.of_cell[cells] = new[member]
        self.count[part] -= inside[part]
        self.count = np.append(self.count, inside[part])
        self.source += [self.source[c] for c in part.tolist()]
        self.groups += [[*self.groups[c], group] for c in part.tolist()]

    def choose_tags(self, others: Iterable[Tag]) -> list[Tag]:
        """Entity of each class: the largest class of an entity keeps its tag, the rest follow the largest tag."""
        last = [0, 0, 0, 0]
        for dim, tag in [*others, *self.source]:
            last[dim] = max(last[dim], tag)
        keeper: dict[Tag, int] = {}
        for c in np.argsort(-self.count, kind="stable").tolist():
            keeper.setdefault(self.source[c], c)
        tags = []
        for c, (dim, tag) in enumerate(self.source):
            if tag == 0 or keeper[dim, tag] != c:
                last[dim] += 1
                tag = last[dim]
            tags.append((dim, tag))
        if max(last) > _LARGEST:
            raise DataError("no tag is left for a new entity; give the entities of the mesh smaller tags")
        return tags

    def parts(self, tags: list[Tag]) -> dict[Tag, list[int]]:
        """Tags of the new parts of each entity that was split."""
        parts: dict[Tag, list[int]] = {}
        for source, tag in zip(self.source, tags, strict=True):
            if source[1] and source != tag:
                parts.setdefault(source, []).append(tag[1])
        return parts


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


def _modelled(mesh: Mesh) -> Iterator[Tag]:
    """Entities that the geometry model of the mesh names."""
    if mesh.model is not None:
        yield from _valid(mesh.model.boundary)
        for link in mesh.model.periodic:
            yield from _valid((link.slave, link.master))


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
        for dim in _dims(mesh, cells):
            if all(d != dim for d, _ in tags[name]):
                last[dim] += 1
                tags[name].append((dim, last[dim]))
    return {name: tuple(t) for name, t in tags.items()}


def _dims(mesh: Mesh, cells: Ints) -> list[int]:
    """The dimensions of a group's cells (sorted indices), ascending."""
    place = np.searchsorted(cells, mesh.offsets)
    return sorted({ALL_CELLS[b.type].dim for b, n in zip(mesh.blocks, np.diff(place), strict=True) if n})


def _tag_of(tags: Iterable[Tag], dim: int) -> int:
    return next(tag for d, tag in tags if d == dim)


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
