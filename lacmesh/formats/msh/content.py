"""Content of a msh file, independent of its version, and its conversion to a mesh.

The readers of the versions fill a `Content`; `to_mesh` assembles the mesh: numbers become indices, cells one block per
type, physical tags groups, and our notes add what msh cannot hold.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import LacmeshWarning, some
from lacmesh.formats.ids import Index, repeated
from lacmesh.formats.msh import fields as msh_fields
from lacmesh.formats.msh.names import unnamed
from lacmesh.formats.msh.notes import SECTION, Notes
from lacmesh.formats.msh.scan import MshBytes
from lacmesh.mesh import Floats, Ints, Mesh, Model, Periodic, Tag


@dataclass
class Piece:
    """Cells of one type: `number` (m,), `nodes` (m, n of the type) by number.

    `at`: the position of the first in the file, or of each; `entity` (2,) or (m, 2), (-1, -1) where it is unknown;
    `partition`: one, or one for each, -1 for none; `groups`: physical groups that all of them are in;
    `physical` (m,): tags of physical groups of the cells' dimension, 0 for none.
    """

    type: str
    number: Ints
    nodes: Ints
    at: int | Ints
    entity: Any = (-1, -1)
    partition: int | Ints = -1
    groups: tuple[Tag, ...] = ()
    physical: Ints | None = None


class Repeats(NamedTuple):
    """Elements that repeated cells `of` for a further physical group: both numbers, dimension and tag of the group."""

    number: Ints
    of: Ints
    dim: Ints
    physical: Ints


_NONE = np.empty(0, np.int64)


@dataclass
class Content:
    """A file's content. `names`: (dimension or None, tag, name); `repeats`: elements merged into others.

    `links`: slave, master, affine map, pairs of node numbers (m, 2). `elements_at`: where the elements begin.
    """

    source: MshBytes
    names: list[tuple[int | None, int, str]] = field(default_factory=list)
    node_number: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    points: Floats = field(default_factory=lambda: np.empty((0, 3)))
    node_entity: Ints | None = None
    pieces: list[Piece] = field(default_factory=list)
    repeats: Repeats = field(default_factory=lambda: Repeats(_NONE, _NONE, _NONE, _NONE))
    boundary: dict[Tag, tuple[int, ...]] = field(default_factory=dict)
    links: list[tuple[Tag, Tag, tuple[float, ...], Ints]] = field(default_factory=list)
    rows: list[msh_fields.Rows] = field(default_factory=list)
    notes: Notes = field(default_factory=Notes)
    nodes_at: int = 0
    elements_at: int = 0


@dataclass
class _Cells:
    blocks: list[tuple[str, Ints]]
    number: Ints
    entity: Ints
    partition: Ints | None
    file_order: Ints | None
    first: list[int]  # of each piece, in the order of `Content.pieces`


def to_mesh(content: Content) -> Mesh:
    """Convert a file's content to a mesh. Raises ReadError."""
    nodes = _node_index(content)
    notes = _fitting(content)
    _add_extra_cells(content, notes)
    cells = _cells(content, nodes)
    index = {"node": nodes, "cell": _cell_index(content, cells)}
    groups, group_tags = _groups(content, cells, notes, index["cell"])
    fields = msh_fields.to_mesh(content.source, content.rows, index, notes.fields)
    lost = fields.stray
    node_groups = {}
    for name, number in notes.node_groups.items():
        node_groups[name], n = _known(nodes, number)
        lost += n
    if lost:
        _warn(f"{lost} values or members belong to nodes or cells that the file does not hold: left out")
    if (cells.entity > 0).any():
        fields.cell_data["entity"] = cells.entity
    if cells.partition is not None:
        fields.cell_data["partition"] = cells.partition
    entity = _node_entity(content, notes)
    if entity is not None:
        fields.node_data["entity"] = entity
    return Mesh.create(
        content.points,
        cells.blocks,
        space_dim=notes.space_dim,
        node_number=content.node_number,
        cell_number=cells.number,
        file_order=cells.file_order,
        cell_groups=groups,
        node_groups=node_groups,
        cell_data=fields.cell_data,
        node_data=fields.node_data,
        group_tags=group_tags,
        steps=fields.steps,
        zones=notes.zones,
        model=_model(content, notes, nodes),
        name="mesh" if notes.name is None else notes.name,
    )


def _warn(message: str) -> None:
    warnings.warn(LacmeshWarning(message), stacklevel=5)


def _node_index(content: Content) -> Index:
    numbers = content.node_number
    if len(numbers) and numbers.min() < 1:
        raise content.source.error(f"a node has the number {numbers.min()}; numbers start at 1", content.nodes_at)
    twice = repeated(numbers)
    if twice is not None:
        raise content.source.error(f"two nodes have the number {twice}", content.nodes_at)
    finite = np.isfinite(content.points)
    if not finite.all():
        bad = some(numbers[~finite.all(axis=1)])
        raise content.source.error(f"the coordinates of nodes {bad} are not finite numbers", content.nodes_at)
    return Index(numbers)


def _fitting(content: Content) -> Notes:
    """Our notes; what they say by number is dropped, with a warning, if they were written for another mesh."""
    notes = content.notes
    n_cells = sum(len(p.number) for p in content.pieces) + sum(len(c.number) for c in notes.extra_cells)
    numbered = notes.node_groups or notes.cell_groups or notes.extra_cells or notes.node_entity is not None
    if numbered and (notes.nodes, notes.cells) != (len(content.node_number), n_cells):
        _warn(
            f"the section ${SECTION} was written for {notes.nodes} nodes and {notes.cells} cells, and the file now "
            f"has {len(content.node_number)} and {n_cells}: its node groups and further cells are left out"
        )
        notes.node_groups, notes.cell_groups, notes.extra_cells, notes.node_entity = {}, {}, (), None
    return notes


def _add_extra_cells(content: Content, notes: Notes) -> None:
    """Add the cells that our notes hold, as pieces, at their positions among the others. Raises ReadError."""
    source = content.source
    n = sum(len(p.number) for p in content.pieces)
    extra = sum(len(c.number) for c in notes.extra_cells)
    if not extra:
        return
    taken = np.zeros(n + extra, bool)
    for c in notes.extra_cells:
        sizes = {len(c.number), len(c.nodes), len(c.entity), len(c.at)}
        if len(sizes) > 1 or c.at.min(initial=0) < 0 or c.at.max(initial=0) >= n + extra or taken[c.at].any():
            raise source.error(f"the cells of the section ${SECTION} do not fit together")
        taken[c.at] = True
    free = np.flatnonzero(~taken)
    if len(free) != n:
        raise source.error(f"the cells of the section ${SECTION} do not fit together")
    for p in content.pieces:
        p.at = free[p.at : p.at + len(p.number)] if isinstance(p.at, int) else free[p.at]
    for c in notes.extra_cells:
        if (np.abs(c.entity) >= 2**31).any():
            raise source.error(f"the cells of the section ${SECTION} have an entity beyond all limits")
        content.pieces.append(Piece(c.type, c.number, c.nodes, c.at, c.entity))


def _cells(content: Content, nodes: Index) -> _Cells:
    """Join all pieces, one block per type, in order of first appearance in the file. Raises ReadError."""
    pieces = [p for p in content.pieces if len(p.number)]
    sizes_of: dict[str, int] = {}
    start = [p.at if isinstance(p.at, int) else int(p.at.min()) for p in pieces]
    for k in sorted(range(len(pieces)), key=start.__getitem__):
        sizes_of.setdefault(pieces[k].type, 0)
    for p in pieces:
        sizes_of[p.type] += len(p.number)
    sizes = list(sizes_of.values())
    total = sum(sizes)
    following = dict(zip(sizes_of, np.cumsum([0, *sizes[:-1]]).tolist() if sizes else [], strict=True))
    begin = dict(following)
    index = np.int32 if len(content.node_number) < 2**31 else np.int64
    arrays = {cell_type: np.empty((n, ALL_CELLS[cell_type].n_nodes), index) for cell_type, n in sizes_of.items()}
    number, entity = np.empty(total, np.int64), np.empty((total, 2), np.int32)
    partition = None if all(isinstance(p.partition, int) and p.partition < 0 for p in pieces) else np.empty(total, "i4")
    first = []
    for p in content.pieces:
        a = following.get(p.type, 0)
        b = a + len(p.number)
        first.append(a)
        if a == b:
            continue
        following[p.type] = b
        number[a:b], entity[a:b] = p.number, p.entity
        if partition is not None:
            partition[a:b] = p.partition
        bad = nodes.convert(p.nodes, arrays[p.type][a - begin[p.type] : b - begin[p.type]])
        if bad is not None:
            lost = [int(n) for n in p.nodes[bad] if nodes.places(n) < 0]
            message = f"the {p.type} {p.number[bad]} has node {some(lost)}, which $Nodes does not hold"
            raise content.source.error(message, content.elements_at)
    order = _file_order(content.pieces, first, total)
    return _Cells(list(arrays.items()), number, entity, partition, order, first)


def _file_order(pieces: list[Piece], first: list[int], total: int) -> Ints | None:
    """The cells' indices in the order of the file; None where they stand in order already."""
    if all(isinstance(p.at, int) and (p.at == a or not len(p.number)) for p, a in zip(pieces, first, strict=True)):
        return None
    order = np.empty(total, np.int64)
    for p, a in zip(pieces, first, strict=True):
        m = len(p.number)
        order[slice(p.at, p.at + m) if isinstance(p.at, int) else p.at] = np.arange(a, a + m)
    return None if np.array_equal(order, np.arange(total)) else order


def _cell_index(content: Content, cells: _Cells) -> Index:
    """Map from cell numbers, also of those merged into another, to indices. Raises ReadError."""
    if len(cells.number) and cells.number.min() < 1:
        number = cells.number.min()
        raise content.source.error(f"a cell has the number {number}; numbers start at 1", content.elements_at)
    twice = repeated(cells.number)
    if twice is not None:
        raise content.source.error(f"two cells have the number {twice}", content.elements_at)
    return Index(cells.number, content.repeats.number, content.repeats.of)


def _known(index: Index, number: Ints) -> tuple[Ints, int]:
    """The indices of some numbers, and how many of them are unknown."""
    places = index.places(number)
    known = places[places >= 0]
    return known, len(places) - len(known)


def _groups(
    content: Content, cells: _Cells, notes: Notes, index: Index
) -> tuple[dict[str, Ints], dict[str, tuple[Tag, ...]]]:
    """Indices and tags of the cell groups, by name; a group without a name is named after its tag."""
    members = _members(content, cells.first, index)
    named: dict[Tag, str] = {}
    for dim, tag, name in content.names:
        for d in (dim,) if dim is not None else sorted({d for d, t in members if t == tag}):
            if named.setdefault((d, tag), name) != name:
                _warn(f"the physical group {d}:{tag} has two names, {named[d, tag]!r} and {name!r}: the first is kept")
    for name, tags in notes.groups.items():
        named.update(dict.fromkeys(tags, name))
    groups: dict[str, list[Ints]] = {name: [] for name in [*named.values(), *notes.groups]}
    group_tags: dict[str, list[Tag]] = {}
    for group in [*named, *sorted(t for t in members if t not in named)]:
        name = named.get(group, unnamed(group))
        while group not in named and name in groups:
            name += "'"
        group_tags.setdefault(name, []).append(group)
        groups.setdefault(name, []).extend(members.get(group, []))
    lost = 0
    for name, number in notes.cell_groups.items():
        known, n = _known(index, number)
        groups.setdefault(name, []).append(known)
        lost += n
    if lost:
        _warn(f"{lost} members of groups are cells that the file does not hold: left out")
    joined = {name: parts[0] if len(parts) == 1 else _joined(parts) for name, parts in groups.items()}
    return joined, {name: tuple(tags) for name, tags in group_tags.items()}


def _joined(parts: list[Ints]) -> Ints:
    return np.concatenate([np.empty(0, np.int64), *parts])


def _members(content: Content, first: list[int], index: Index) -> dict[Tag, list[Ints]]:
    """Indices of the cells of each physical group, in parts."""
    members: dict[Tag, list[Ints]] = {}
    small = np.int32 if sum(len(p.number) for p in content.pieces) < 2**31 else np.int64
    for p, a in zip(content.pieces, first, strict=True):
        for tag in p.groups:
            members.setdefault(tag, []).append(np.arange(a, a + len(p.number), dtype=small))
        if p.physical is not None:
            for physical, rows in _by_value(p.physical):
                members.setdefault((ALL_CELLS[p.type].dim, physical), []).append(rows + a)
    for dim in range(4):
        here = content.repeats.dim == dim
        if here.any():
            cells = index.places(content.repeats.number[here])
            for physical, rows in _by_value(content.repeats.physical[here]):
                members.setdefault((dim, physical), []).append(cells[rows])
    return members


def _by_value(values: Ints) -> Iterator[tuple[int, Ints]]:
    """Yield each value other than 0, and the rows that have it."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    cuts = np.flatnonzero(ordered[1:] != ordered[:-1]) + 1
    for rows in np.split(order, cuts):
        if len(rows) and values[rows[0]]:
            yield int(values[rows[0]]), rows


def _node_entity(content: Content, notes: Notes) -> Ints | None:
    """Entities of the nodes, (n, 2), from the file or from our notes; None if unknown. Raises ReadError."""
    if content.node_entity is not None or notes.node_entity is None:
        return content.node_entity
    n = len(content.node_number)
    dim, tag, count = notes.node_entity.T
    if (count < 0).any() or (count > n).any() or count.sum() != n or (np.abs([dim, tag]) >= 2**31).any():
        raise content.source.error(f"the entities of nodes in the section ${SECTION} do not fit the nodes")
    return np.repeat(np.stack([dim, tag], axis=1).astype(np.int32), count, axis=0)


def _model(content: Content, notes: Notes, nodes: Index) -> Model | None:
    boundary = content.boundary or notes.boundary
    periodic = []
    for slave, master, affine, pairs in content.links:
        places = nodes.places(pairs)
        periodic.append(Periodic(slave, master, affine, places[(places >= 0).all(axis=1)]))
    return Model(boundary, tuple(periodic)) if boundary or periodic else None
