""".mail, the text format of code_aster's own meshes (documentation U3.01.00).

A file is a list of sub-files: coordinates, cells of one type, groups, a title. It keeps nodes, cells, groups of both
(overlapping and empty ones too), their numbers, the order of cells within a type, the number of coordinates, and the
mesh's name as title; the records of a cut are in comments, other fields are not kept.

The grammar is code_aster's: FIN and FINSF count at the start of a line only; the header of a sub-file is the rest of
the keyword's line, or as many lines as its NBLIGE says; of its other words only NOM means anything (NOM=INDEFINI does
not); % begins a comment.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import LacmeshWarning, WriteError, did_you_mean
from lacmesh.formats import notes
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.notes import left_out
from lacmesh.formats.orders import blocks_in_order, check_types, is_plane, numbers_within
from lacmesh.formats.text import (
    AS_REALS,
    SourceFile,
    changes,
    decoded,
    in_lines,
    labels,
    node_lines,
    parsed,
    rows_of_text,
)
from lacmesh.indices import repeated
from lacmesh.mesh import Floats, Ints, Mesh

#: Keyword -> our place of the node that the file lists k-th. Corners are ordered as in gmsh, not as in MED; mid-nodes
#: follow the edges of the base, those that leave it, those of the top.
_AS_OURS = "POI1 SEG2 SEG3 SEG4 TRIA3 TRIA6 TRIA7 QUAD4 QUAD8 QUAD9 TETRA4 PYRAM5 PENTA6 HEXA8"
NODES: dict[str, tuple[int, ...]] = {
    **{kind: tuple(range(ALL_CELLS[kind].n_nodes)) for kind in _AS_OURS.split()},
    "TETRA10": (0, 1, 2, 3, 4, 5, 6, 7, 9, 8),
    "PYRAM13": (0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12),
    "PENTA15": (0, 1, 2, 3, 4, 5, 6, 9, 7, 8, 10, 11, 12, 14, 13),
    "PENTA18": (0, 1, 2, 3, 4, 5, 6, 9, 7, 8, 10, 11, 12, 14, 13, 15, 17, 16),
    "HEXA20": (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 10, 12, 14, 15, 16, 18, 19, 17),
    "HEXA27": (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 10, 12, 14, 15, 16, 18, 19, 17, 20, 21, 23, 24, 22, 25, 26),
}
#: Cells of code_aster that lacmesh has not: its own between facing surfaces, and types with more centres.
_NOT_READ = re.compile(
    "SEG22|SEG33|TRIA33|TRIA66|QUAD44|QUAD88|QUAD99|TETRA9|TETRA15|PENTA7|PENTA21|PYRAM19|HEXA9|TRIA4|SEG32|SEG23|"
    "TR[36](TR|QU)[34689]|QU[489](TR|QU)[34689]|SE[23](TR|QU)[34689]|HE8HE8|PE6PE6|TE4TE4|H20H20|P15P15|T10T10"
)
_COORDINATES = {"COOR_1D": 1, "COOR_2D": 2, "COOR_3D": 3}
_GROUPS = {"GROUP_NO": "node", "GROUP_MA": "cell"}
#: Keywords that code_aster knows, and that say nothing of a mesh, or nothing that a Mesh holds.
_LEFT_OUT = {"DUMP", "DEBUG", "GROUP_FA", "SYS_UNIT", "SYS_COOR", "MACRO_AR", "MACRO_FA", "MACRO_EL", "MATERIAU"}
#: What a comment line with a part of lacmesh's note begins with.
_NOTE = "% lacmesh: "
_NOTE_LINE = re.compile(rb"^" + re.escape(_NOTE.encode()) + rb"(.*)", re.MULTILINE)
_COMMENT = re.compile(rb"%[^\n]*")
_BLANKS = bytes.maketrans(b"=,\t", b"   ")
#: Blanks and comments between words.
_BETWEEN = re.compile(rb"(?:[\s=,]+|%[^\n]*)*")
_END = re.compile(rb"^[ \t]*FIN(SF)?(?![A-Za-z0-9_])", re.MULTILINE)
_NUMBERED = re.compile(rb"[A-Za-z_]{1,7}(0|[1-9][0-9]{0,8})")
#: code_aster's limits: characters of a group's name, and of a node's or cell's (a letter and seven digits).
_GROUP_NAME, _LARGEST = 24, 9_999_999
_LINE, _PER_LINE = 80, 8


class SubFile(NamedTuple):
    """A sub-file: its `keyword` at byte `at`, the `name` in its header, its body from byte `begin` to `end`."""

    keyword: str
    at: int
    name: bytes | None
    begin: int
    end: int


def read(path: Path) -> Mesh:
    """Read the mesh of a .mail file. Raises ReadError, with the line.

    Names are kept as their numbers where each has one (N12, MA7) and no two have the same; else nodes, or cells, are
    numbered 1, 2 ... in the file's order, with a warning.
    """
    return _Reader(SourceFile(path)).mesh()


class _Reader:
    """Sub-files of a file; `places`: that of each name among those of nodes, or of cells."""

    def __init__(self, source: SourceFile) -> None:
        self.source, self.data = source, bytes(source.data)
        self.builder = MeshBuilder(source.path, rows_from=0)
        self.places: dict[str, dict[bytes, int]] = {"node": {}, "cell": {}}

    def mesh(self) -> Mesh:
        """Return the mesh. Raises ReadError."""
        parts = list(self._sub_files())
        dims = [(part, _COORDINATES[part.keyword]) for part in parts if part.keyword in _COORDINATES]
        if not dims:
            raise self.source.error("there are no nodes: no COOR_3D, COOR_2D or COOR_1D stands before FIN")
        dim = dims[0][1]
        for part, other in dims:
            if other != dim:
                raise self.source.error(f"nodes have {dim} coordinates above, and {other} here", part.at)
        points = np.concatenate([self._nodes(part, dim) for part, _ in dims])
        cells = [(part.keyword, self._cells(part)) for part in parts if part.keyword in NODES]
        numbers = {on: self._numbers_in_names(on) for on in self.places}
        at = dims[-1][0].at
        self.builder.nodes(numbers["node"], points, error=lambda message: self.source.error(message, at))
        first = 0
        for kind, rows in cells:
            self.builder.cells(kind, numbers["cell"][first : first + len(rows)], rows)
            first += len(rows)
        groups = set[tuple[str, str]]()
        for part in parts:
            if part.keyword in _GROUPS:
                on, name, members = self._group(part)
                if (on, name) in groups:
                    raise self.source.error(f"there are two {part.keyword} named {name!r}", part.at)
                groups.add((on, name))
                self.builder.group(on, name, members)
        if unread := dict.fromkeys(part.keyword for part in parts if part.keyword in _LEFT_OUT):
            self.builder.warnings.append(f"left out, as they are no part of a mesh: {', '.join(unread)}")
        titles = [part for part in parts if part.keyword == "TITRE"]
        lines = [line for part in titles for line in self.data[part.begin : part.end].splitlines() if line.strip()]
        if note := b"".join(match[1].strip() for match in _NOTE_LINE.finditer(self.data)):
            self.builder.read_note(note)
        return self.builder.mesh(space_dim=max(dim, 2), name=decoded(lines[0]).strip() if len(lines) == 1 else "mesh")

    def _sub_files(self) -> Iterator[SubFile]:
        """Yield the sub-files up to FIN. Raises ReadError where FINSF or FIN is missing, or for a keyword."""
        data, at = self.data, 0
        while True:
            between = _BETWEEN.match(data, at)
            at = between.end() if between else at
            if at >= len(data):
                raise self.source.error("the file ends without FIN: it may be cut off", len(data))
            begin = data.find(b"\n", at) + 1 or len(data)
            first, *words = _COMMENT.sub(b"", data[at:begin]).translate(_BLANKS).split()
            if first == b"FIN":
                return
            if first == b"FINSF":
                at = begin
                continue
            keyword, known = decoded(first), [*NODES, *_COORDINATES, *_GROUPS, "TITRE"]
            if _NOT_READ.fullmatch(keyword):
                raise self.source.error(f"cells of type {keyword} are not read; take them out of the mesh", at)
            if keyword not in known and keyword not in _LEFT_OUT:
                near = did_you_mean(keyword[:40], known)
                raise self.source.error(f"{keyword[:40]!r} is no keyword of a .mail file{near}", at)
            header = dict(pairwise([*words, b""]))
            lines = header.get(b"NBLIGE", b"1")
            if not re.fullmatch(rb"[0-9]{1,6}", lines):
                raise self.source.error("NBLIGE should be the number of lines of the header", at)
            for _ in range(int(lines) - 1):
                begin = data.find(b"\n", begin) + 1 or len(data)
            name = None if header.get(b"NOM") in (b"", b"INDEFINI") else header.get(b"NOM")
            end = _END.search(data, begin)
            if end is None:
                raise self.source.error(f"{keyword} has no FINSF after it: the file may be cut off", at)
            yield SubFile(keyword, at, name, begin, end.start())
            if end[1] is None:
                return
            at = end.end()

    def _body(self, part: SubFile) -> bytes:
        """Text of a sub-file, blanks in place of comments and other separators."""
        text = self.data[part.begin : part.end]
        if b"%" in text:
            text = _COMMENT.sub(lambda comment: b" " * len(comment[0]), text)
        return text.translate(_BLANKS)

    def _rows(self, part: SubFile, on: str, width: int, values: str) -> tuple[list[bytes], list[bytes], list[int]]:
        """Return names, the words that follow them, `width` - 1 each, and the bytes where their lines begin.

        Each entry begins a line, and may go on over several. Raises ReadError.
        """
        entry, at = ("node" if on == "node" else part.keyword), part.begin
        names, words, begin = list[bytes](), list[bytes](), list[int]()
        for line in self._body(part).split(b"\n"):
            found = line.split()
            if found and len(words) == len(names) * (width - 1):
                names.append(found.pop(0))
                begin.append(at)
            words += found
            if len(words) > len(names) * (width - 1):
                raise self.source.error(f"each {entry} should begin a line, and have {width - 1} {values}", begin[-1])
            at += len(line) + 1
        if len(words) < len(names) * (width - 1):
            raise self.source.error(f"the last {entry} here has fewer than {width - 1} {values}", part.end)
        known = self.places[on]
        for place, name in enumerate(names, start=len(known)):
            if known.setdefault(name, place) != place:
                raise self.source.error(f"two {on}s have the name {decoded(name)}", part.at)
        return names, words, begin

    def _nodes(self, part: SubFile, dim: int) -> Floats:
        """Return the coordinates (k, dim) of the nodes of a sub-file. Raises ReadError."""
        _, words, begin = self._rows(part, "node", dim + 1, "coordinates")
        values = parsed(b" ".join(words).translate(AS_REALS), np.float64)
        if values is None or len(values) != len(words):
            bad = next(k for k, word in enumerate(words) if parsed(word.translate(AS_REALS), np.float64) is None)
            raise self.source.error("coordinates should be real numbers", begin[bad // dim])
        return values.reshape(-1, dim)

    def _cells(self, part: SubFile) -> Ints:
        """Return the places (k, n) of the nodes of the cells of a sub-file, in lacmesh's order. Raises ReadError."""
        kind, order = part.keyword, list(NODES[part.keyword])
        names, words, begin = self._rows(part, "cell", 1 + len(order), "nodes")
        known = self.places["node"]
        table = np.array([known.get(word, -1) for word in words], np.int64).reshape(-1, len(order))
        if (table < 0).any():
            bad = int((table < 0).argmax())
            row, lost = bad // len(order), decoded(words[bad])
            message = f"{kind} {decoded(names[row])} has the node {lost}, which is not among the nodes"
            raise self.source.error(message, begin[row])
        ordered = np.sort(table, axis=1)
        twice = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1)).tolist()
        if twice:
            shown = ", ".join(decoded(names[row]) for row in twice[:5])
            self.builder.warnings.append(f"{len(twice)} cells {kind} have a node twice, the first {shown}")
        return table[:, np.argsort(order)]

    def _group(self, part: SubFile) -> tuple[str, str, Ints]:
        """Return what a group is of, its name, in the header or else the first word, and the places of its members.

        Raises ReadError.
        """
        on, words = _GROUPS[part.keyword], self._body(part).split()
        if part.name is None and not words:
            raise self.source.error(f"this {part.keyword} has neither a name nor members", part.at)
        word, members = (words[0], words[1:]) if part.name is None else (part.name, words)
        name, known = decoded(word).strip("'\""), self.places[on]
        if strays := [decoded(word) for word in members if word not in known]:
            message = f"the group {name!r} has members that are not among the {on}s: {', '.join(strays[:5])}"
            raise self.source.error(message, part.at)
        return on, name, np.array([known[word] for word in members], np.int64)

    def _numbers_in_names(self, on: str) -> Ints:
        """The numbers in the names, or 1, 2 ... with a warning."""
        names = list(self.places[on])
        matches = [_NUMBERED.fullmatch(name) for name in names]
        numbers = np.array([int(match[1]) if match else -1 for match in matches], np.int64)
        if repeated(numbers) is None and not (numbers < 0).any():
            return numbers
        first: dict[int, int] = {}
        odd = (k for k, number in enumerate(numbers.tolist()) if number < 0 or first.setdefault(number, k) != k)
        shown = f"the names of {on}s (as {decoded(names[next(odd)])})"
        self.builder.warnings.append(f"{shown} are not distinct numbers after letters: they become 1, 2 ...")
        return np.arange(1, len(names) + 1)


def write(path: Path, mesh: Mesh) -> None:
    """Write a mesh as a .mail file, replacing any content.

    Nodes are N and their number, cells M and theirs. Cells go by type, within a type as in `mesh.file_order`. Raises
    WriteError for cells that code_aster has not; one LacmeshWarning names what is changed or left out.
    """
    check_types(path, mesh, NODES, "code_aster")
    clauses = left_out(mesh)
    for n, what in ((mesh.n_nodes, "nodes"), (mesh.n_cells, "cells")):
        if n > _LARGEST:
            raise WriteError(path, f"code_aster's names number {_LARGEST} {what} at most; write a .med file")
    node = numbers_within(mesh.node_number, 0, _LARGEST, "nodes", clauses)
    cell = numbers_within(mesh.cell_number, 0, _LARGEST, "cells", clauses)
    note = notes.dump(mesh, "zones", "records", node_number=node, cell_number=cell)
    with path.open("w", encoding="utf-8", newline="\n") as file:
        line = " ".join(mesh.name.split())
        if line and mesh.name != "mesh" and len(line.encode()) <= _LINE and not line.startswith("FIN"):
            file.write(f"TITRE\n{line}\nFINSF\n")
        dim = 2 if is_plane(mesh) else 3
        file.write(f"COOR_{dim}D\n")
        for number, row in node_lines(node, mesh.points[:, :dim]):
            line = f"N{number} {' '.join(row)}"
            if len(line) > _LINE:  # three digits in an exponent: the last coordinate on a line of its own
                line = "\n".join(line.rsplit(" ", 1))
            file.write(f"{line}\n")
        file.write("FINSF\n")
        for block, lo, here in blocks_in_order(mesh):
            places = list(NODES[block.type])
            form = "M%d" + "".join("\nN%d" if k % _PER_LINE == 0 else " N%d" for k in range(1, len(places) + 1)) + "\n"
            file.write(f"{block.type}\n")
            file.writelines(rows_of_text(form, np.column_stack([cell[here], node[block.nodes[here - lo][:, places]]])))
            file.write("FINSF\n")
        for keyword, form, groups, numbers in (
            ("GROUP_NO", "N%d", mesh.node_groups, node),
            ("GROUP_MA", "M%d", mesh.cell_groups, cell),
        ):
            label_of = labels(groups, "A-Za-z0-9_", _GROUP_NAME, ["FIN", "FINSF"])
            if changed := changes(label_of):
                clauses.append(f"names of {keyword} have {_GROUP_NAME} letters, digits and _ at most: {changed}")
            for name, members in groups.items():
                file.write(f"{keyword}\n{label_of[name]}\n")
                file.writelines(in_lines(numbers[members], form, _PER_LINE))
                file.write("FINSF\n")
        file.writelines(f"{_NOTE}{text}\n" for text in notes.in_lines(note, _LINE - len(_NOTE)) if note)
        file.write("FIN\n")
    if clauses:
        warnings.warn(LacmeshWarning(".mail: " + "; ".join(clauses)), stacklevel=2)
