"""Groups of a msh file, or of a slice of it: physical tags and our notes become groups of cells, by name."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.communicator import Communicator
from lacmesh.formats.ids import Index
from lacmesh.formats.msh.content import Content
from lacmesh.formats.msh.names import unnamed
from lacmesh.formats.msh.notes import Notes
from lacmesh.mesh import Ints, Tag


def known(index: Index, number: Ints) -> Ints:
    """The indices of those numbers that the slice has."""
    places = index.places(number)
    return places[places >= 0]


def cell_groups(
    content: Content, first: list[int], notes: Notes, index: Index, comm: Communicator, said: list[str]
) -> tuple[dict[str, Ints], dict[str, tuple[Tag, ...]]]:
    """Indices and tags of the cell groups, by name; a group without a name is named after its tag.

    `first`: the index of the first cell of each piece; `index`: from numbers of cells to indices.
    """
    members = _members(content, first, index)
    named: dict[Tag, str] = {}
    for dim, tag, name in content.names:
        for d in (dim,) if dim is not None else sorted({d for d, t in members if t == tag}):
            if named.setdefault((d, tag), name) != name:
                names = f"{named[d, tag]!r} and {name!r}"
                said.append(f"the physical group {d}:{tag} has two names, {names}: the first is kept")
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
    n_placed = 0
    for name, number in notes.cell_groups.items():
        here = known(index, number)
        groups.setdefault(name, []).append(here)
        n_placed += len(here)
    lost = sum(map(len, notes.cell_groups.values())) - int(comm.total(np.array(n_placed)))
    if lost:
        said.append(f"{lost} members of groups are cells that the file does not hold: left out")
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
    repeated, _, dims, tags = content.repeats
    for dim in range(4):
        here = dims == dim
        if here.any():
            cells = index.places(repeated[here])
            for physical, rows in _by_value(tags[here]):
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
