"""The sections of msh 4.1: entities with their boxes, nodes and elements in blocks of one entity, periodic links."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.entities import Assignment
from lacmesh.formats.ids import CHUNK, counts_up
from lacmesh.formats.msh.output import Output, pieces
from lacmesh.mesh import Floats, Ints, Mesh, codes


class _Chunk(NamedTuple):
    """Cells of one type in one entity: its row in the table, the block, which of the block's cells, in file order."""

    row: int
    block: int
    cells: slice | Ints
    size: int


def write_sections(out: Output, mesh: Mesh, entities: Assignment, node_number: Ints, cell_number: Ints) -> None:
    """Write $Entities, $Nodes, $Elements, $Periodic. Cells of types that msh lacks are skipped."""
    node_chunks = list(_runs(entities.node, np.arange(mesh.n_nodes)))
    chunks = list(_chunks(mesh, entities))
    _write_entities(out, mesh, entities, node_chunks, chunks)
    _write_nodes(out, mesh, entities, node_chunks, node_number)
    written = [c for c in chunks if ALL_CELLS[mesh.blocks[c.block].type].msh is not None]
    _write_elements(out, mesh, entities, written, node_number, cell_number)
    _write_periodic(out, mesh, node_number)


def _chunks(mesh: Mesh, entities: Assignment) -> Iterator[_Chunk]:
    """The cells by entity and type, in the order in which these first appear in the file, stable inside."""
    n_blocks = len(mesh.blocks)
    if mesh.file_order is None:
        order = np.arange(mesh.n_cells)
        block = np.repeat(np.arange(n_blocks, dtype=np.int32), np.diff(mesh.offsets))
    else:
        order = np.asarray(mesh.file_order)
        block = (np.searchsorted(mesh.offsets, order, side="right") - 1).astype(np.int32)
    key = entities.cell[order] * np.int32(n_blocks) + block
    for k, cells in _runs(key, order):
        row, b = divmod(k, n_blocks)
        yield _Chunk(row, b, *_within(cells, int(mesh.offsets[b])))


def _within(cells: slice | Ints, offset: int) -> tuple[slice | Ints, int]:
    if isinstance(cells, slice):
        return slice(cells.start - offset, cells.stop - offset), cells.stop - cells.start
    return cells - offset, len(cells)


def _runs(key: Ints, members: Ints) -> Iterator[tuple[int, slice | Ints]]:
    """Each key, in order of first appearance, and its members in order: a slice where they are consecutive."""
    if not len(key):
        return
    begin = np.flatnonzero(np.append(True, key[1:] != key[:-1]))
    heads = key[begin]
    present = codes(heads)
    if len(present) < len(heads):
        first = np.full(int(present[-1]) + 1, len(heads))
        np.minimum.at(first, heads, np.arange(len(heads)))
        rank = np.empty(len(first), np.uint16 if len(present) <= 1 << 16 else np.int32)  # short: sorted by radix
        rank[present[np.argsort(first[present])]] = np.arange(len(present))
        order = np.argsort(rank[key], kind="stable")
        key, members = key[order], members[order]
        begin = np.flatnonzero(np.append(True, key[1:] != key[:-1]))
    for a, b in zip(begin.tolist(), [*begin[1:].tolist(), len(key)], strict=True):
        some = members[a:b]
        consecutive = int(some[-1]) - int(some[0]) + 1 == len(some) and (some[1:] > some[:-1]).all()
        yield int(key[a]), slice(int(some[0]), int(some[-1]) + 1) if consecutive else some


def _write_entities(
    out: Output, mesh: Mesh, entities: Assignment, nodes: list[tuple[int, slice | Ints]], chunks: list[_Chunk]
) -> None:
    box = np.full((len(entities.entities), 6), np.nan)
    for row, which in nodes:
        _widen(box[row], mesh.points[which])
    for c in chunks:
        _widen(box[c.row], _touched(mesh, c))
    box = np.nan_to_num(box)
    out.text("$Entities\n")
    out.record("4q", *(sum(e.dim == dim for e in entities.entities) for dim in range(4)))
    for e, limits in zip(entities.entities, box.tolist(), strict=True):
        corners = limits if e.dim else limits[:3]
        layout, values = f"i{len(corners)}dq{len(e.groups)}i", [e.tag, *corners, len(e.groups), *e.groups]
        if e.dim:
            boundary = entities.boundary.get((e.dim, e.tag), ())
            layout, values = f"{layout}q{len(boundary)}i", [*values, len(boundary), *boundary]
        out.record(layout, *values)
    out.end("Entities")


def _widen(box: Floats, points: Floats) -> None:
    """Enlarge a box (6,), least and greatest coordinates, in place to contain points (n, 3) too."""
    if len(points):
        for axis in range(3):  # numpy takes twenty times as long for the minimum over axis 0 of (n, 3)
            box[axis] = np.fmin(box[axis], points[:, axis].min())
            box[axis + 3] = np.fmax(box[axis + 3], points[:, axis].max())


def _touched(mesh: Mesh, chunk: _Chunk) -> Floats:
    """Points of a chunk's cells; those of a small chunk may be repeated."""
    nodes = mesh.blocks[chunk.block].nodes
    if chunk.size * nodes.shape[1] < mesh.n_nodes:
        return mesh.points[nodes[chunk.cells].ravel()]
    used = np.zeros(mesh.n_nodes, bool)
    for part in pieces(chunk.size):
        used[nodes[_some(chunk.cells, part)]] = True
    return mesh.points if used.all() else mesh.points[used]


def _write_nodes(
    out: Output, mesh: Mesh, entities: Assignment, chunks: list[tuple[int, slice | Ints]], number: Ints
) -> None:
    out.text("$Nodes\n")
    out.record("4q", len(chunks), mesh.n_nodes, *_extremes(number))
    for row, which in chunks:
        e = entities.entities[row]
        of_entity = number[which]
        out.record("3iq", e.dim, e.tag, 0, len(of_entity))
        out.int_rows(of_entity[:, None])
        out.real_rows(mesh.points[which])
    out.end("Nodes")


def _write_elements(
    out: Output, mesh: Mesh, entities: Assignment, chunks: list[_Chunk], node_number: Ints, cell_number: Ints
) -> None:
    up = counts_up(node_number)
    spans = [cell_number[a:b] for a, b in zip(mesh.offsets[:-1], mesh.offsets[1:], strict=True)]
    numbers = [spans[c.block][c.cells] for c in chunks]
    least, greatest = zip(*(_extremes(n) for n in numbers), strict=True) if numbers else ([0], [0])
    out.text("$Elements\n")
    out.record("4q", len(chunks), sum(map(len, numbers)), min(least), max(greatest))
    for c, number in zip(chunks, numbers, strict=True):
        e, block = entities.entities[c.row], mesh.blocks[c.block]
        out.record("3iq", e.dim, e.tag, int(ALL_CELLS[block.type].msh or 0), c.size)
        rows = np.empty((min(c.size, CHUNK), 1 + block.nodes.shape[1]), "<i8")
        for part in pieces(c.size):
            some = rows[: part.stop - part.start]
            some[:, 0] = number[part]
            nodes = block.nodes[_some(c.cells, part)]
            if up:
                np.add(nodes, 1, out=some[:, 1:])
            else:
                some[:, 1:] = node_number[nodes]
            out.int_rows(some)
    out.end("Elements")


def _some(cells: slice | Ints, part: slice) -> slice | Ints:
    """A part of a chunk's cells."""
    if isinstance(cells, slice):
        return slice(cells.start + part.start, cells.start + part.stop)
    return cells[part]


def _extremes(numbers: Ints) -> tuple[int, int]:
    return (int(numbers.min()), int(numbers.max())) if len(numbers) else (0, 0)


def _write_periodic(out: Output, mesh: Mesh, node_number: Ints) -> None:
    links = () if mesh.model is None else mesh.model.periodic
    if not links:
        return
    out.text("$Periodic\n")
    out.record("q", len(links))
    for link in links:
        out.record("3i", *link.slave, link.master[1])
        out.record(f"q{len(link.affine)}d", len(link.affine), *link.affine)
        out.record("q", len(link.nodes))
        out.int_rows(node_number[np.asarray(link.nodes, np.int64).reshape(-1, 2)])
    out.end("Periodic")
