"""The sections of msh 4.1: entities, nodes and elements in blocks of one entity, periodic links."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.entities import Assignment
from lacmesh.formats.ids import CHUNK, counts_up
from lacmesh.formats.msh.output import Output, pieces
from lacmesh.formats.msh.reader import LARGEST_TAG, TYPE_NAMES, UNKNOWN_TYPE, Elements, MshReader
from lacmesh.formats.msh.source import MshSource
from lacmesh.mesh import Floats, Ints, Mesh, Tag, codes


class _Entity(NamedTuple):
    """Data of one entity in $Entities, or in $PartitionedEntities of the part of one that lies in a partition."""

    groups: tuple[Tag, ...] = ()
    boundary: tuple[int, ...] = ()
    parent: Tag | None = None
    partition: int = -1


class Reader4(MshReader):
    """Reads the sections of msh 4.1."""

    def __init__(self, source: MshSource) -> None:
        super().__init__(source)
        self._entities: dict[Tag, _Entity] = {}
        self._parts: dict[Tag, _Entity] = {}
        self._used: set[Tag] = set()

    def read_section(self, name: str) -> bool:
        """Read the section that starts here, if it is one of those that differ between versions. Raises ReadError."""
        read = {
            "Entities": self._read_entities,
            "PartitionedEntities": self._read_parts,
            "Nodes": self._read_nodes,
            "Elements": self._read_elements,
            "Periodic": self._read_periodic,
        }.get(name)
        if read is None:
            return False
        self.source.begin(name, integers=name == "Elements")
        read()
        self.source.end()
        return True

    def complete(self) -> None:
        """Give the elements their groups and partitions, those on a part of an entity the entity itself."""
        for e in self.elements:
            entity = self._parts.get(e.entity) or self._entities.get(e.entity) or _Entity()
            e.groups, e.partition = entity.groups, entity.partition
            if entity.parent is not None and entity.parent[0] == e.entity[0]:
                e.entity = entity.parent
        if any(e.boundary for e in self._entities.values()) or not self._used.issuperset(self._entities):
            self.boundary = {tag: e.boundary for tag, e in self._entities.items()}

    def _read_entities(self) -> None:
        for dim, n in enumerate(self.source.counts(4)):
            for _ in range(n):
                tag = self.check_tag(dim, int(self.source.take("int", 1)[0]))
                self._entities[tag] = _Entity(*self._rest(dim))

    def _read_parts(self) -> None:
        source = self.source
        self.n_partitions, ghosts = source.counts(2)
        source.take("int", 2 * ghosts)
        for dim, n in enumerate(source.counts(4)):
            for _ in range(n):
                tag, parent_dim, parent_tag = source.take("int", 3).tolist()
                partitions = source.take("int", source.counts(1)[0])
                parent = self.check_tag(parent_dim, parent_tag) if parent_tag else None
                partition = int(partitions[0]) if len(partitions) else -1
                if not -1 <= partition <= LARGEST_TAG:
                    raise source.here(f"there cannot be a partition {partition}")
                self._parts[self.check_tag(dim, tag)] = _Entity(*self._rest(dim), parent, partition)

    def _rest(self, dim: int) -> tuple[tuple[Tag, ...], tuple[int, ...]]:
        """Take the rest of an entity, its box, physical groups and boundary; return the groups and the boundary."""
        source = self.source
        source.take("real", 6 if dim else 3)
        groups = source.take("int", source.counts(1)[0]).tolist()
        boundary = source.take("int", source.counts(1)[0]).tolist() if dim else []
        if any(not 0 < abs(g) <= LARGEST_TAG for g in groups):
            raise source.here("a physical group has an impossible tag")
        if any(g < 0 for g in groups):
            self.dropped["the sign of physical groups (cells listed the other way round)"] = None
        return tuple(dict.fromkeys((dim, abs(g)) for g in groups)), tuple(boundary)

    def _read_nodes(self) -> None:
        source, out = self.source, self.out
        n_blocks, total, _, _ = source.take("size", 4).tolist()
        for _ in range(n_blocks):
            dim, tag, parametric = source.take("int", 3).tolist()
            (n,) = source.counts(1)
            entity = self.check_tag(dim, tag)
            self._used.add(entity)
            part = self._parts.get(entity)
            number = source.take("size", n)
            points = source.take("real", n * (3 + dim * bool(parametric))).reshape(n, -1) if n else np.empty((0, 3))
            if parametric and n:
                self.dropped["parametric coordinates of nodes"] = None
            of_nodes = np.broadcast_to(np.array(part.parent if part and part.parent else entity, np.int32), (n, 2))
            out.nodes(number, points[:, :3], error=self.error("Nodes"), entity=of_nodes)
        if out.size("node") != total:
            raise source.error(f"$Nodes announces {total} nodes and holds another number")

    def _read_elements(self) -> None:
        source = self.source
        n_blocks, total, _, _ = source.take("size", 4).tolist()
        for _ in range(n_blocks):
            dim, tag, gmsh_type = source.take("int", 3).tolist()
            (n,) = source.counts(1)
            entity, name = self.check_tag(dim, tag), TYPE_NAMES.get(gmsh_type)
            self._used.add(entity)
            if name is None:
                raise source.here(UNKNOWN_TYPE.format(gmsh_type))
            width = 1 + ALL_CELLS[name].n_nodes
            rows = source.take("size", n * width).reshape(n, width)
            if n:
                self.elements.append(Elements(name, rows[:, 0], rows[:, 1:], entity))
        n = sum(len(e.number) for e in self.elements)
        if n != total:
            raise source.error(f"$Elements announces {total} elements and holds {n}")

    def _read_periodic(self) -> None:
        source = self.source
        for _ in range(source.counts(1)[0]):
            dim, slave, master = source.take("int", 3).tolist()
            affine = tuple(source.take("real", source.counts(1)[0]).tolist())
            if not np.isfinite(affine).all():
                raise source.here("the map of a periodic link is not finite")
            (n,) = source.counts(1)
            pairs = source.take("size", 2 * n).astype(np.int64).reshape(n, 2)
            self.links.append((self.check_tag(dim, slave), self.check_tag(dim, master), affine, pairs))


# ---- writing


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
