"""Cells of a msh file, or of a slice of it: the pieces of its content become one block a type, numbers indices."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.communicator import Communicator
from lacmesh.errors import some
from lacmesh.formats.ids import Index
from lacmesh.formats.msh.content import Content, Piece
from lacmesh.formats.msh.notes import SECTION, Notes
from lacmesh.formats.msh.scan import MshBytes
from lacmesh.formats.slices import CellRows, Slice, repeated
from lacmesh.mesh import Ints

_NEVER = np.iinfo(np.int64).max


class AllCells(NamedTuple):
    """Properties of all cells of a file: how many there are of each type, in order of first appearance.

    `in_order`: True if the file has them type by type; `entities`, `partitions`: True if some cell has one.
    """

    sizes: dict[str, int]
    in_order: bool
    entities: bool
    partitions: bool


@dataclass
class SliceCells:
    """Cells of a slice by types: number (m,), entity (m, 2); partition (m,) and position in the file (m,), or None.

    `first`: the index of the first cell of each of `Content.pieces`.
    """

    rows: tuple[CellRows, ...]
    number: Ints
    entity: Ints
    partition: Ints | None
    place: Ints | None
    first: list[int]


def add_extra_cells(content: Content, notes: Notes) -> None:
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


def describe(pieces: list[Piece]) -> AllCells:
    """Return the properties of all cells of a file."""
    pieces = [p for p in pieces if len(p.number)]
    start = [p.at if isinstance(p.at, int) else int(p.at.min()) for p in pieces]
    sizes = dict.fromkeys((pieces[k].type for k in sorted(range(len(pieces)), key=start.__getitem__)), 0)
    for p in pieces:
        sizes[p.type] += len(p.number)
    first = zip(pieces, _first(pieces, sizes), strict=True)
    return AllCells(
        sizes,
        in_order=all(p.at == a if isinstance(p.at, int) else _counts_from(a, p.at) for p, a in first),
        entities=any((np.asarray(p.entity) > 0).any() for p in pieces),
        partitions=any(not isinstance(p.partition, int) or p.partition >= 0 for p in pieces),
    )


def _counts_from(first: int, at: Ints) -> bool:
    return np.array_equal(at, np.arange(first, first + len(at)))


def _first(pieces: list[Piece], sizes: dict[str, int]) -> list[int]:
    """The index of each piece's first cell, where there are so many cells of each type, one type after the other."""
    following = dict(zip(sizes, accumulate(sizes.values(), initial=0), strict=False))
    first = []
    for p in pieces:
        first.append(following.get(p.type, 0))
        following[p.type] = first[-1] + len(p.number)
    return first


def in_slice(pieces: list[Piece], sizes: dict[str, int], piece: Slice) -> list[Piece]:
    """The cells of a slice, in as many pieces, of which some may be empty; pieces that are divided are of msh 4.1."""
    passed = dict.fromkeys((p.type for p in pieces), 0)
    mine = []
    for p in pieces:
        rows, a, n = piece.rows(sizes.get(p.type, 0)), passed[p.type], len(p.number)
        passed[p.type] += n
        low, high = (min(max(end - a, 0), n) for end in (rows.start, rows.stop))
        if high - low < n:
            p = replace(p, number=p.number[low:high], nodes=p.nodes[low:high], at=p.at + low)
        mine.append(p)
    return mine


def joined(content: Content, whole: AllCells, nodes: Index, comm: Communicator) -> SliceCells:
    """Join the pieces of a slice, one block a type; `nodes`: from numbers to indices in the whole. Raises ReadError."""
    rows = {name: Slice(comm.rank, comm.size).rows(size) for name, size in whole.sizes.items()}
    sizes = {name: r.n for name, r in rows.items()}
    first, total = _first(content.pieces, sizes), sum(sizes.values())
    begin = dict(zip(sizes, accumulate(sizes.values(), initial=0), strict=False))
    index = np.int32 if nodes.n < 2**31 else np.int64
    arrays = {name: np.empty((n, ALL_CELLS[name].n_nodes), index) for name, n in sizes.items()}
    number, entity = np.empty(total, np.int64), np.empty((total, 2), np.int32)
    partition = np.empty(total, np.int32) if whole.partitions else None
    place = None if whole.in_order else np.empty(total, np.int64)
    stray = None
    for p, a in zip(content.pieces, first, strict=True):
        b = a + len(p.number)
        if a == b:
            continue
        number[a:b], entity[a:b] = p.number, p.entity
        if partition is not None:
            partition[a:b] = p.partition
        if place is not None:
            place[a:b] = np.arange(p.at, p.at + b - a) if isinstance(p.at, int) else p.at
        bad = nodes.convert(p.nodes, arrays[p.type][a - begin[p.type] : b - begin[p.type]])
        if bad is not None:
            stray = p, bad
            break
    _check_nodes(content, stray, nodes, comm)
    cells = tuple(CellRows(name, rows[name], nodes) for name, nodes in arrays.items())
    return SliceCells(cells, number, entity, partition, place, first)


def _check_nodes(content: Content, stray: tuple[Piece, int] | None, nodes: Index, comm: Communicator) -> None:
    """Raise the ReadError of the file's first cell with an unknown node; `stray`: piece and row of this slice's."""
    place = _NEVER
    if stray is not None:
        at = stray[0].at
        place = at + stray[1] if isinstance(at, int) else int(at[stray[1]])
    least = -int(comm.greatest(np.array(-place, np.int64)))

    def check() -> None:
        if stray is not None and place == least:
            p, bad = stray
            lost = [int(n) for n in p.nodes[bad] if nodes.places(n) < 0]
            message = f"the {p.type} {p.number[bad]} has node {some(lost)}, which $Nodes does not hold"
            raise content.source.error(message, content.elements_at)

    comm.on_each(check)


def cell_index(content: Content, number: Ints, comm: Communicator) -> Index:
    """Map from cell numbers, also of those merged into another, to indices in the slice. Raises ReadError."""
    check_numbers("cell", number, content.source, content.elements_at, comm)
    return Index(number, content.repeats[0], content.repeats[1], table=comm.size == 1)


def check_numbers(what: str, number: Ints, source: MshBytes, place: int, comm: Communicator) -> None:
    """Raise ReadError, at a place in the file, unless the numbers of all processes are positive and distinct."""
    least = ~int(comm.greatest(~number.min(initial=1)))
    if least < 1:
        raise source.error(f"a {what} has the number {least}; numbers start at 1", place)
    twice = repeated(number, comm)
    if twice is not None:
        raise source.error(f"two {what}s have the number {twice}", place)
