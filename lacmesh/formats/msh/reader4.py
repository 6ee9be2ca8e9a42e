"""The sections of msh 4.1: entities, nodes and elements in blocks of one entity, periodic links.

The layout is the same in ASCII and in binary; `Numbers` hides the difference.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.msh.content import Content, Piece
from lacmesh.formats.msh.scan import MshBytes, Numbers
from lacmesh.formats.msh.types import TYPE_NAMES, UNKNOWN_TYPE
from lacmesh.formats.slices import Slice
from lacmesh.mesh import Floats, Ints, Tag

_LARGEST = 2**31 - 1


class _Entity(NamedTuple):
    """Data of one entity in $Entities, or in $PartitionedEntities of the part of one that lies in a partition."""

    groups: tuple[Tag, ...] = ()
    boundary: tuple[int, ...] = ()
    parent: Tag | None = None
    partition: int = -1


class Reader4:
    """Reads the sections of one file into a `Content`; `dropped` names what the mesh has no place for.

    Of the nodes it reads those of a slice, `piece`; of the elements it finds the places, and reads none.
    """

    def __init__(self, source: MshBytes, dropped: dict[str, None], piece: Slice) -> None:
        self.content = Content(source)
        self.dropped, self._piece = dropped, piece
        self._entities: dict[Tag, _Entity] = {}
        self._parts: dict[Tag, _Entity] = {}
        self._used: set[Tag] = set()

    def read(self, section: str) -> bool:
        """Read the section that starts here, if it is one of those that differ between versions."""
        source = self.content.source
        if section == "Entities":
            self._read_entities(source.numbers(section, True))
        elif section == "PartitionedEntities":
            self._read_parts(source.numbers(section, True))
        elif section == "Nodes":
            self._read_nodes(source.numbers(section, True))
        elif section == "Elements":
            self._read_elements(source.numbers(section, False))
        elif section == "Periodic":
            self._read_periodic(source.numbers(section, True))
        else:
            return False
        return True

    def finish(self) -> Content:
        """Complete the content: replace parts of entities by their parents, and add the boundaries if there are any."""
        for piece in self.content.pieces:
            entity = self._parts.get(piece.entity) or self._entities.get(piece.entity) or _Entity()
            piece.groups, piece.partition = entity.groups, entity.partition
            if entity.parent is not None and entity.parent[0] == piece.entity[0]:
                piece.entity = entity.parent
        if any(e.boundary for e in self._entities.values()) or not self._used.issuperset(self._entities):
            self.content.boundary = {tag: e.boundary for tag, e in self._entities.items()}
        return self.content

    def _read_entities(self, numbers: Numbers) -> None:
        for dim, n in enumerate(_counts(numbers, 4)):
            for _ in range(n):
                tag = _tag(numbers, dim, numbers.ints(1)[0])
                self._entities[tag] = _Entity(*self._rest(numbers, dim))
        numbers.done()

    def _read_parts(self, numbers: Numbers) -> None:
        self.content.n_partitions, ghosts = _counts(numbers, 2)
        numbers.ints(2 * ghosts)
        for dim, n in enumerate(_counts(numbers, 4)):
            for _ in range(n):
                own, parent_dim, parent_tag = numbers.ints(3).tolist()
                tag = _tag(numbers, dim, own)
                partitions = numbers.ints(_count(numbers))
                parent = _tag(numbers, parent_dim, parent_tag) if parent_tag else None
                partition = int(partitions[0]) if len(partitions) else -1
                if not -1 <= partition <= _LARGEST:
                    raise numbers.error(f"there cannot be a partition {partition}")
                self._parts[tag] = _Entity(*self._rest(numbers, dim), parent, partition)
        numbers.done()

    def _rest(self, numbers: Numbers, dim: int) -> tuple[tuple[Tag, ...], tuple[int, ...]]:
        """Read the rest of an entity, its box, physical groups and boundary; return the groups and the boundary."""
        numbers.reals(6 if dim else 3)
        groups = numbers.ints(_count(numbers)).tolist()
        boundary = numbers.ints(_count(numbers)).tolist() if dim else []
        if any(not 0 < abs(g) <= _LARGEST for g in groups):
            raise numbers.error("a physical group has an impossible tag")
        if any(g < 0 for g in groups):
            self.dropped["the sign of physical groups (cells listed the other way round)"] = None
        return tuple(dict.fromkeys((dim, abs(g)) for g in groups)), tuple(boundary)

    def _read_nodes(self, numbers: Numbers) -> None:
        n_blocks, total, _, _ = numbers.sizes(4).tolist()
        blocks: list[tuple[Tag, Ints, Floats]] = []
        for _ in _upto(n_blocks):
            dim, tag, parametric = numbers.ints(3).tolist()
            n = _count(numbers)
            entity = _tag(numbers, dim, tag)
            width = 3 + dim if parametric else 3
            number = numbers.sizes(n)
            xyz = numbers.reals(n * width).reshape(n, width)
            if parametric and n:
                self.dropped["parametric coordinates of nodes"] = None
            blocks.append((entity, number, xyz))
        numbers.done()
        if sum(len(number) for _, number, _ in blocks) != total:
            raise self.content.source.error(f"$Nodes announces {total} nodes and holds another number")
        content = self.content
        content.node_rows = rows = self._piece.rows(total)
        content.node_number = np.empty(rows.n, np.int64)
        content.points = np.empty((rows.n, 3))
        content.node_entity = np.empty((rows.n, 2), np.int32)
        first = -rows.start
        for entity, number, xyz in blocks:
            a, b = (min(max(end, 0), rows.n) for end in (first, first + len(number)))
            content.node_number[a:b] = number[a - first : b - first]
            content.points[a:b] = xyz[a - first : b - first, :3]
            part = self._parts.get(entity)
            content.node_entity[a:b] = part.parent if part and part.parent else entity
            first += len(number)
            self._used.add(entity)

    def _read_elements(self, numbers: Numbers) -> None:
        n_blocks, total, _, _ = numbers.sizes(4).tolist()
        at = 0
        for _ in _upto(n_blocks):
            dim, tag, gmsh_type = numbers.ints(3).tolist()
            n = _count(numbers)
            entity = _tag(numbers, dim, tag)
            name = TYPE_NAMES.get(gmsh_type)
            if name is None:
                raise numbers.error(UNKNOWN_TYPE.format(gmsh_type))
            width = 1 + ALL_CELLS[name].n_nodes
            rows = numbers.sizes(n * width).reshape(n, width)
            if n:
                self.content.pieces.append(Piece(name, rows[:, 0], rows[:, 1:], at, entity))
            self._used.add(entity)
            at += n
        numbers.done()
        if at != total:
            raise self.content.source.error(f"$Elements announces {total} elements and holds {at}")

    def _read_periodic(self, numbers: Numbers) -> None:
        for _ in _upto(_count(numbers)):
            dim, slave, master = numbers.ints(3).tolist()
            affine = tuple(numbers.reals(_count(numbers)).tolist())
            if not np.isfinite(affine).all():
                raise numbers.error("the map of a periodic link is not finite")
            n = _count(numbers)
            pairs = np.array(numbers.sizes(2 * n), np.int64).reshape(n, 2)
            link = _tag(numbers, dim, slave), _tag(numbers, dim, master), affine, pairs
            self.content.links.append(link)
        numbers.done()


def _counts(numbers: Numbers, n: int) -> list[int]:
    counts: list[int] = numbers.sizes(n).tolist()
    if min(counts) < 0:
        raise numbers.error("a negative count stands here")
    return counts


def _count(numbers: Numbers) -> int:
    return _counts(numbers, 1)[0]


def _upto(n: int) -> range:
    """Range over a count that a file announces, at least 0; reading past the file's end stops the loop."""
    return range(max(n, 0))


def _tag(numbers: Numbers, dim: int, tag: int) -> Tag:
    if not 0 <= dim <= 3 or not -_LARGEST <= tag <= _LARGEST:
        raise numbers.error(f"there cannot be an entity {tag} of dimension {dim}")
    return int(dim), int(tag)
