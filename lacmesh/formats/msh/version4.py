"""The sections of msh 4.1: entities, nodes and elements in blocks of one entity, periodic links."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.entities import Assignment
from lacmesh.formats.msh.reader import LARGEST_TAG, TYPE_NAMES, UNKNOWN_TYPE, Elements, MshReader
from lacmesh.formats.msh.streams import MshSource, Output
from lacmesh.formats.orders import file_order
from lacmesh.indices import CHUNK
from lacmesh.mesh import Floats, Ints, Mesh, Tag, mask_of


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
            self.boundary = [(*tag, e.boundary) for tag, e in self._entities.items()]

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
            pairs = source.take("size", 2 * n).astype(np.int64)
            self.links.append((*self.check_tag(dim, slave), *self.check_tag(dim, master), affine, pairs))


# ---- writing


class _Chunk(NamedTuple):
    """Cells of one type in one entity: its row in the table, gmsh's type, their numbers (k,) and nodes (k, n)."""

    row: int
    type: int | None
    number: Ints
    nodes: Ints


def write_sections(out: Output, mesh: Mesh, entities: Assignment, node_number: Ints, cell_number: Ints) -> None:
    """Write $Entities, $Nodes, $Elements, $Periodic. Cells of types that msh lacks are skipped."""
    of_nodes = list(_runs(entities.node, np.arange(mesh.n_nodes)))
    chunks = list(_chunks(mesh, entities, cell_number))
    _write_entities(out, mesh, entities, of_nodes, chunks)
    out.text("$Nodes\n")
    out.record("4q", len(of_nodes), mesh.n_nodes, *_extremes([node_number]))
    for row, which in of_nodes:
        number = node_number[which]
        out.record("3iq", *entities.entities[row][:2], 0, len(number))
        out.rows(["<i8"], number)
        out.rows(["<f8"], mesh.points[which])
    out.end("Nodes")
    chunks = [c for c in chunks if c.type is not None]
    out.text("$Elements\n")
    out.record("4q", len(chunks), sum(len(c.number) for c in chunks), *_extremes([c.number for c in chunks]))
    for c in chunks:
        out.record("3iq", *entities.entities[c.row][:2], c.type or 0, len(c.number))
        for a in range(0, len(c.number), CHUNK):
            out.rows(("<i8", "<i8"), c.number[a : a + CHUNK], node_number[c.nodes[a : a + CHUNK]])
    out.end("Elements")
    links = () if mesh.model is None else mesh.model.periodic
    if links:
        out.text("$Periodic\n")
        out.record("q", len(links))
        for link in links:
            out.record("3i", *link.slave, link.master[1])
            out.record(f"q{len(link.affine)}d", len(link.affine), *link.affine)
            out.record("q", len(link.nodes))
            out.rows(["<i8"], node_number[np.asarray(link.nodes, np.int64).reshape(-1, 2)])
        out.end("Periodic")


def _chunks(mesh: Mesh, entities: Assignment, number: Ints) -> Iterator[_Chunk]:
    """The cells by entity and type, in the order in which these first appear in the file, stable inside."""
    order = file_order(mesh)
    block = np.repeat(np.arange(len(mesh.blocks), dtype=np.int32), np.diff(mesh.offsets))
    block = block if mesh.file_order is None else block[order]
    for key, which in _runs(entities.cell[order] * np.int32(len(mesh.blocks)) + block, order):
        row, k = divmod(key, len(mesh.blocks))
        (kind, nodes), first = mesh.blocks[k], int(mesh.offsets[k])
        inside = slice(which.start - first, which.stop - first) if isinstance(which, slice) else which - first
        yield _Chunk(row, ALL_CELLS[kind].msh, number[which], nodes[inside])


def _runs(key: Ints, members: Ints) -> Iterator[tuple[int, slice | Ints]]:
    """Each key, in order of first appearance, and its members in order: a slice where they are consecutive."""
    begin = np.flatnonzero(np.append(True, key[1:] != key[:-1])[: len(key)])
    heads = key[begin]
    present, first = np.unique(heads, return_index=True)
    if len(present) < len(heads):
        rank = np.empty(int(present[-1]) + 1, np.uint16 if len(present) <= 1 << 16 else np.int32)  # sorted by radix
        rank[present[np.argsort(first)]] = np.arange(len(present))
        order = np.argsort(rank[key], kind="stable")
        key, members = key[order], members[order]
        begin = np.flatnonzero(np.append(True, key[1:] != key[:-1]))
    for a, b in pairwise([*begin.tolist(), len(key)]):
        some = members[a:b]
        consecutive = int(some[-1]) - int(some[0]) + 1 == len(some) and (some[1:] > some[:-1]).all()
        yield int(key[a]), slice(int(some[0]), int(some[-1]) + 1) if consecutive else some


def _write_entities(
    out: Output, mesh: Mesh, entities: Assignment, of_nodes: list[tuple[int, slice | Ints]], chunks: list[_Chunk]
) -> None:
    box = np.full((len(entities.entities), 6), np.nan)
    for row, which in of_nodes:
        _widen(box[row], mesh.points[which])
    for c in chunks:
        if c.nodes.size < mesh.n_nodes:
            _widen(box[c.row], mesh.points[c.nodes.ravel()])
        else:
            used = mask_of(mesh.n_nodes, c.nodes)
            _widen(box[c.row], mesh.points if used.all() else mesh.points[used])
    out.text("$Entities\n")
    out.record("4q", *(sum(e.dim == dim for e in entities.entities) for dim in range(4)))
    for e, limits in zip(entities.entities, np.nan_to_num(box).tolist(), strict=True):
        corners = limits if e.dim else limits[:3]
        layout, values = f"i{len(corners)}dq{len(e.groups)}i", [e.tag, *corners, len(e.groups), *e.groups]
        if e.dim:
            boundary = entities.boundary.get((e.dim, e.tag), ())
            layout, values = f"{layout}q{len(boundary)}i", [*values, len(boundary), *boundary]
        out.record(layout, *values)
    out.end("Entities")


def _widen(box: Floats, points: Floats) -> None:
    """Enlarge a box (6,), least and greatest coordinates, in place to contain points (n, 3) too."""
    for axis in range(3):  # numpy takes twenty times as long for the minimum over axis 0 of (n, 3)
        box[axis] = np.fmin(box[axis], points[:, axis].min())
        box[axis + 3] = np.fmax(box[axis + 3], points[:, axis].max())


def _extremes(numbers: list[Ints]) -> tuple[int, int]:
    there = [n for n in numbers if len(n)]
    return (min(int(n.min()) for n in there), max(int(n.max()) for n in there)) if there else (0, 0)
