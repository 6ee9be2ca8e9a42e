"""The sections of msh 2.0, 2.1 and 2.2: nodes, elements one by one, periodic links.

gmsh writes a cell of several physical groups once for each of them: such elements are made one cell again.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import LacmeshWarning, ReadError
from lacmesh.formats.ids import repeated
from lacmesh.formats.msh import runs as msh_runs
from lacmesh.formats.msh.content import Content, Piece
from lacmesh.formats.msh.scan import MshBytes, TextNumbers
from lacmesh.formats.msh.types import TYPE_NAMES
from lacmesh.mesh import Ints, concatenated

_LARGEST = 2**31 - 1


class Reader2:
    """Reads the sections of one file into a `Content`."""

    def __init__(self, source: MshBytes) -> None:
        self.content = Content(source)

    def read(self, section: str) -> bool:
        """Read the section that starts here, if it is one of those that differ between versions."""
        if section == "Nodes":
            self._read_nodes()
        elif section == "Elements":
            self._read_elements()
        elif section == "Periodic":
            self._read_periodic()
        elif section == "ParametricNodes":
            raise self.content.source.error("nodes with parametric coordinates in msh 2 are not read; save as msh 4.1")
        else:
            return False
        return True

    def finish(self) -> Content:
        """Complete the content: merge elements that repeat a cell for a group, and warn of them. Raises ReadError."""
        content = self.content
        number = concatenated(p.number for p in content.pieces)
        twice = repeated(number) if len(number) and number.min() > 0 else None
        if twice is not None:
            raise content.source.error(f"two cells have the number {twice}", content.elements_at)
        if not content.pieces:
            return content
        content.repeats = np.concatenate([_merge(piece) for piece in content.pieces], axis=1)
        gone = content.repeats.shape[1]
        if not gone:
            return content
        _close_gaps(content.pieces)
        warnings.warn(
            LacmeshWarning(
                f"{gone} elements repeat another one for a further physical group, as gmsh writes overlapping "
                "groups in msh 2.2: each is one cell with its group"
            ),
            stacklevel=4,
        )
        return content

    def _read_nodes(self) -> None:
        content = self.content
        n = content.source.count("Nodes")
        numbers = content.source.numbers("Nodes", True)
        number, points = numbers.numbered(n, 3, "node")
        content.node_number, content.points = np.array(number, np.int64), np.array(points, np.float64)
        numbers.done()

    def _read_elements(self) -> None:
        source = self.content.source
        n = source.count("Elements")
        start = source.position
        if source.binary:
            table = source.take(source.order + "i4", (source.size - start) // 4)

            def error(message: str, place: int) -> ReadError:
                at = start + 4 * place
                if (
                    source.data[at : at + 8].lstrip().startswith(b"$End")
                ):  # no element: more were announced than stand here
                    message = f"$Elements ends too early: {n} elements were announced"
                return source.error(message, at)

            elements = msh_runs.find(table, n, True, error)
            source.position = start + 4 * elements.end
            source.end("Elements")
        else:
            numbers = TextNumbers(source, "Elements", False)
            table = numbers.values
            elements = msh_runs.find(table, n, False, numbers.error_at)
            numbers.place = elements.end
            numbers.done()
        gmsh_types, first = np.unique(elements.kind, return_index=True)
        for gmsh_type in gmsh_types[np.argsort(first)].tolist():
            self.content.pieces.append(self._piece(table, elements, gmsh_type))

    def _piece(self, table: Ints, elements: msh_runs.ElementRuns, gmsh_type: int) -> Piece:
        """The elements of one type."""
        source, cell = self.content.source, ALL_CELLS[TYPE_NAMES[gmsh_type]]
        at = np.flatnonzero(elements.kind == gmsh_type)
        place, n_tags = elements.place[at], elements.n_tags[at]
        tags_at = place + (1 if source.binary else 3)

        def tag(j: int, least: int) -> Ints:
            """The j-th tag of each element, 0 where it has fewer than `least`."""
            return np.where(n_tags >= least, table[np.minimum(tags_at + j, len(table) - 1)], 0).astype(np.int64)

        physical, elementary = tag(0, 1), tag(1, 2)
        partition = tag(3, 4) if source.version == "2.2" else tag(2, 3)
        for tags in (physical, elementary, partition):
            if tags.max() > _LARGEST or tags.min() < -_LARGEST:
                raise source.error("an element has a tag beyond all limits")
        nodes = np.stack([table[tags_at + n_tags + j] for j in range(cell.n_nodes)], axis=1)
        entity = np.stack([np.full(len(at), cell.dim), elementary], axis=1)
        entity[elementary <= 0] = -1
        return Piece(
            cell.name,
            table[place].astype(np.int64),
            nodes,
            at,
            entity,
            np.where(partition > 0, partition, -1) if partition.any() else -1,
            physical=np.abs(physical),
        )

    def _read_periodic(self) -> None:
        """Read periodic links, text in binary files too; `Affine` precedes the 16 numbers of a map, if there is one."""
        numbers = TextNumbers(self.content.source, "Periodic", True, (b"Affine", b" -16 "))
        for _ in range(int(numbers.ints(1)[0])):
            dim, slave, master, n = numbers.ints(4).tolist()
            affine: tuple[float, ...] = ()
            if n == -16:
                affine = tuple(numbers.reals(16).tolist())
                n = int(numbers.ints(1)[0])
            if n < 0 or not 0 <= dim <= 3 or max(abs(slave), abs(master)) > _LARGEST or not np.isfinite(affine).all():
                raise numbers.error("this is no periodic link")
            pairs = numbers.ints(2 * n).reshape(n, 2)
            self.content.links.append(((dim, slave), (dim, master), affine, pairs))
        numbers.done()


def _merge(piece: Piece) -> Ints:
    """Remove from a piece the elements that repeat another one for a further group; the smallest number is kept.

    Returns their columns of `Content.repeats`. Repeats have the same nodes in the same order and the same entity, and
    each another group.
    """
    assert piece.physical is not None
    group, rows = _equal(piece)
    # of equal elements, the first of each physical group can be merged; the others repeat it truly
    order = np.lexsort((piece.number[rows], piece.physical[rows], group))
    group, rows = group[order], rows[order]
    again = (group[1:] == group[:-1]) & (piece.physical[rows[1:]] == piece.physical[rows[:-1]])
    group, rows = (a[~np.append(False, again)[: len(a)]] for a in (group, rows))
    order = np.lexsort((piece.number[rows], group))
    group, rows = group[order], rows[order]
    begins = np.append(True, group[1:] != group[:-1])[: len(rows)]
    keeper = rows[begins][np.cumsum(begins) - 1]
    gone = rows[~begins]
    dim = np.full(len(gone), ALL_CELLS[piece.type].dim)
    repeats = np.stack([piece.number[gone], piece.number[keeper[~begins]], dim, piece.physical[gone]])
    if len(gone):
        kept = np.ones(len(piece.number), bool)
        kept[gone] = False
        piece.number, piece.nodes, piece.entity = piece.number[kept], piece.nodes[kept], piece.entity[kept]
        piece.at, piece.physical = np.asarray(piece.at)[kept], piece.physical[kept]
        if not isinstance(piece.partition, int):
            piece.partition = piece.partition[kept]
    return repeats


def _equal(piece: Piece) -> tuple[Ints, Ints]:
    """Elements in a group with the nodes and entity of another one: a label for each set of equals, and their rows."""
    none = np.empty(0, np.int64)
    if piece.physical is None or piece.physical.min() == piece.physical.max():
        return none, none
    rows = np.flatnonzero(piece.physical)
    columns = [*piece.nodes.T, piece.entity[:, 1]]
    code = _code([column[rows] for column in columns])
    ordered = np.sort(code)
    if not (ordered[1:] == ordered[:-1]).any():
        return none, none
    order = np.argsort(code, kind="stable")
    code, rows = code[order], rows[order]
    alike = code[1:] == code[:-1]
    for column in columns:
        alike &= column[rows[1:]] == column[rows[:-1]]
    group = np.cumsum(np.append(True, ~alike))
    several = np.append(alike, False) | np.append(False, alike)
    return group[several], rows[several]


def _code(columns: list[Ints]) -> NDArray[np.uint64]:
    """Hash of each row of a table: equal rows have the same, different rows almost surely not."""
    weights = np.random.default_rng(0).integers(2**64, size=len(columns), dtype=np.uint64) | np.uint64(1)
    code = np.zeros(len(columns[0]), np.uint64)
    for column, weight in zip(columns, weights, strict=True):
        code += column.astype(np.uint64) * weight
    return code


def _close_gaps(pieces: list[Piece]) -> None:
    """Renumber the positions in the file without the elements that were merged into others."""
    places = np.concatenate([np.asarray(p.at) for p in pieces])
    rank = np.empty(int(places.max()) + 1, np.int64)
    rank[np.sort(places)] = np.arange(len(places))
    for p in pieces:
        p.at = rank[p.at]
