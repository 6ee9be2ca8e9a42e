"""Reading .mail: nodes, cells and groups of names become arrays, names become numbers."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lacmesh.errors import LacmeshWarning, ReadError, did_you_mean
from lacmesh.formats.ids import Index, repeated
from lacmesh.formats.mail import names as mail_names
from lacmesh.formats.mail.names import Names
from lacmesh.formats.mail.sub_files import SubFile, body, sub_files
from lacmesh.formats.mail.types import NODES, NOT_READ
from lacmesh.formats.source import SourceFile
from lacmesh.formats.text import bad_line, chunks, decoded, parsed
from lacmesh.mesh import Floats, Ints, Mesh, concatenated

_COORDINATES = {"COOR_1D": 1, "COOR_2D": 2, "COOR_3D": 3}
_GROUPS = {"GROUP_NO": "nodes", "GROUP_MA": "cells"}
#: Keywords that code_aster knows, and that say nothing of a mesh, or nothing that a Mesh holds.
_LEFT_OUT = {"DUMP", "DEBUG", "GROUP_FA", "SYS_UNIT", "SYS_COOR", "MACRO_AR", "MACRO_FA", "MACRO_EL", "MATERIAU"}
#: A real number's letters: Fortran's exponent D is E; separators are blanks.
_REAL = bytes.maketrans(b"Dd,=\t", b"ee   ")


@dataclass
class _Section:
    """Cells of one sub-file: the keys of their names (k,) and of their nodes (k, n), and the sub-file itself."""

    type: str
    part: SubFile
    name: Ints
    nodes: Ints


@dataclass
class _Content:
    source: SourceFile
    names: Names = field(default_factory=Names)
    title: list[str] = field(default_factory=list)
    dim: int = 0
    node_name: list[Ints] = field(default_factory=list)
    points: list[Floats] = field(default_factory=list)
    nodes_at: int = 0
    sections: list[_Section] = field(default_factory=list)
    groups: dict[str, dict[str, tuple[SubFile, Ints]]] = field(default_factory=lambda: {"nodes": {}, "cells": {}})
    left_out: dict[str, None] = field(default_factory=dict)

    def check(self, keyword: str, at: int) -> None:
        """Raise ReadError for an unknown keyword, or that of cells which are not read."""
        known = [*NODES, *_COORDINATES, *_GROUPS, "TITRE"]
        if keyword in NOT_READ:
            raise self.source.error(f"cells of type {keyword} are not read; take them out of the mesh", at)
        if keyword not in known and keyword not in _LEFT_OUT:
            near = did_you_mean(keyword[:40], known)
            raise self.source.error(f"{keyword[:40]!r} is no keyword of a .mail file{near}", at)

    def misplaced(self, part: SubFile, place: int, text: bytes, word: int) -> int:
        """Byte offset in the file of a word of `text`, which stands at `place` in a sub-file's body."""
        return part.begin + place + int(mail_names.words(text).begin[max(0, word)])


def read(path: Path) -> Mesh:
    """Read the mesh of a .mail file. Raises ReadError, with the line.

    Names are kept as their numbers where each has one (N12, MA7) and no two have the same; else nodes, or cells, are
    numbered 1, 2 ... in the file's order, with a warning.
    """
    content = _Content(SourceFile(path))
    for part in sub_files(content.source, content.check):
        _take(content, part)
    if not content.points:
        raise content.source.error("there are no nodes: no COOR_3D, COOR_2D or COOR_1D stands before FIN")
    if content.left_out:
        _warn(path, f"left out, as they are no part of a mesh: {', '.join(content.left_out)}")
    return _mesh(path, content)


def _warn(path: Path, message: str) -> None:
    warnings.warn(LacmeshWarning(f"{path}: {message}"), stacklevel=4)


def _take(content: _Content, part: SubFile) -> None:
    """Process one sub-file according to its keyword."""
    keyword = part.keyword
    if keyword in NODES:
        content.sections.append(_cells(content, part))
    elif keyword in _COORDINATES:
        _take_nodes(content, part, _COORDINATES[keyword])
    elif keyword in _GROUPS:
        _take_group(content, part)
    elif keyword == "TITRE":
        lines = bytes(content.source.data[part.begin : part.end]).splitlines()  # % is a letter like others here
        content.title += [decoded(line).strip() for line in lines if line.strip()]
    else:
        content.left_out[keyword] = None


def _take_nodes(content: _Content, part: SubFile, dim: int) -> None:
    """Read the names and coordinates of nodes: `dim` real numbers after each name, on one line or several."""
    source = content.source
    if content.dim and content.dim != dim:
        raise source.error(f"nodes have {content.dim} coordinates above, and {dim} here", part.at)
    content.dim, content.nodes_at = dim, part.at
    width = dim + 1
    before = 0  # words of this sub-file passed so far
    keys, values = [], []
    for at, text in chunks(body(source, part)):
        words = mail_names.words(text)
        heads = np.arange(-before % width, len(words.begin), width)
        if not words.first[heads].all():
            bad = content.misplaced(part, at, text, int(heads[words.first[heads].argmin()]) - width)
            raise source.error(f"each node should begin a line, and have {dim} coordinates", bad)
        names, reals = _split(words, heads)
        keys.append(content.names.keys(names))
        numbers = parsed(reals, np.float64)
        if numbers is None:
            raise source.error("coordinates should be real numbers", part.begin + at + bad_line(reals, np.float64))
        values.append(numbers)
        before += len(words.begin)
    if before % width:
        raise source.error(f"the last node here has fewer than {dim} coordinates", part.end)
    points = np.zeros((before // width, 3))
    points[:, :dim] = np.concatenate([np.empty(0), *values]).reshape(-1, dim)
    content.node_name.append(concatenated(keys))
    content.points.append(points)


def _split(words: mail_names.Words, heads: Ints) -> tuple[bytes, bytes]:
    """Split the words of a text into two texts: the names, which are the words `heads`, and the coordinates."""
    begin, size = words.begin[heads], (words.end - words.begin)[heads]
    width = int(size.max(initial=0)) + 1
    names = np.full((len(heads), width), 32, np.uint8)
    rest = words.text.copy()
    for k in range(width - 1):
        has = size > k
        names[has, k] = words.text[begin[has] + k]
        rest[begin[has] + k] = 32
    return names.tobytes(), rest.tobytes().translate(_REAL)


def _cells(content: _Content, part: SubFile) -> _Section:
    """Read the cells of one sub-file; each begins a line, and may continue over several."""
    source = content.source
    width = 1 + len(NODES[part.keyword])
    before = 0
    keys = []
    for at, text in chunks(body(source, part)):
        key, first = content.names.lines(text)
        heads = first[-before % width :: width]
        if not heads.all():
            bad = content.misplaced(part, at, text, -before % width + width * (int(heads.argmin()) - 1))
            raise source.error(f"each {part.keyword} should begin a line, and have {width - 1} nodes", bad)
        keys.append(key)
        before += len(key)
    if before % width:
        raise source.error(f"the last {part.keyword} here has fewer than {width - 1} nodes", part.end)
    table = concatenated(keys).reshape(-1, width)
    return _Section(part.keyword, part, table[:, 0].copy(), table[:, 1:])


def _take_group(content: _Content, part: SubFile) -> None:
    """Read a group: its name, in the header or else the first word, then its members."""
    source, known = content.source, content.groups[_GROUPS[part.keyword]]
    text = body(source, part)
    word = part.name
    if word is None:
        text = text.lstrip()
        word = text.replace(b",", b" ").split(None, 1)[0] if text else None
        text = text[len(word) :] if word else b""
    if word is None:
        raise source.error(f"this {part.keyword} has neither a name nor members", part.at)
    name = decoded(word).strip("'\"")
    if name in known:
        raise source.error(f"there are two {part.keyword} named {name!r}", part.at)
    keys = [content.names.keys(piece) for _, piece in chunks(text)]
    known[name] = part, concatenated(keys)


def _mesh(path: Path, content: _Content) -> Mesh:
    source = content.source
    points, names = np.concatenate(content.points), np.concatenate(content.node_name)
    _check_distinct(content, names, "nodes", content.nodes_at)
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        bad = content.names.name(int(names[finite.argmin()]))
        raise source.error(f"the coordinates of node {bad} are not finite numbers", content.nodes_at)
    nodes = Index(names)
    order, blocks = _blocks(content, nodes)
    of_cells = concatenated(s.name for s in content.sections)
    _check_distinct(content, of_cells, "cells", content.sections[0].part.at if content.sections else 0)
    of_cells = of_cells[order]
    return Mesh.create(
        points,
        blocks,
        space_dim=max(content.dim, 2),
        node_number=_numbers(path, content, names, "nodes"),
        cell_number=_numbers(path, content, of_cells, "cells"),
        file_order=None if (order[1:] > order[:-1]).all() else np.argsort(order),
        node_groups=_groups(content, "nodes", nodes),
        cell_groups=_groups(content, "cells", Index(of_cells)),
        name=content.title[0] if len(content.title) == 1 else "mesh",
    )


def _check_distinct(content: _Content, keys: Ints, what: str, at: int) -> None:
    twice = repeated(keys) if len(keys) else None
    if twice is not None:
        raise content.source.error(f"two {what} have the name {content.names.name(twice)}", at)


def _numbers(path: Path, content: _Content, keys: Ints, what: str) -> Ints:
    """The numbers in the names, or 1, 2 ... with a warning."""
    ids = mail_names.numbers(keys)
    if ids is not None:
        return ids
    example = content.names.name(int(keys.max()))
    _warn(path, f"the names of {what} (as {example}) are not distinct numbers after letters: they become 1, 2 ...")
    return np.arange(1, len(keys) + 1)


def _blocks(content: _Content, nodes: Index) -> tuple[Ints, list[tuple[str, Ints]]]:
    """Position of each cell in the file, and one block of nodes per type, types in order of first appearance."""
    first = np.cumsum([0, *(len(s.name) for s in content.sections)])
    order: list[Ints] = [np.empty(0, np.int64)]
    blocks: list[tuple[str, Ints]] = []
    for cell_type in dict.fromkeys(s.type for s in content.sections):
        mine = [k for k, s in enumerate(content.sections) if s.type == cell_type]
        rows = np.empty((sum(len(content.sections[k].name) for k in mine), len(NODES[cell_type])), np.int32)
        start = 0
        for k in mine:
            _place(content, content.sections[k], nodes, rows[start:])
            start += len(content.sections[k].name)
        order += [np.arange(first[k], first[k + 1]) for k in mine]
        blocks.append((cell_type, rows))
    return np.concatenate(order), blocks


def _place(content: _Content, section: _Section, nodes: Index, out: Ints) -> None:
    """Write the node indices of a section's cells to `out`, in lacmesh's order. Raises ReadError for unknown nodes."""
    places = np.empty(section.nodes.shape, np.int32)
    bad = nodes.convert(section.nodes, places)
    if bad is not None:
        wrong = section.nodes[bad][nodes.places(section.nodes[bad]) < 0][0]
        cell, node = content.names.name(int(section.name[bad])), content.names.name(int(wrong))
        message = f"{section.type} {cell} has the node {node}, which is not among the nodes"
        raise _at_row(content.source, section, bad, message)
    _check_repeats(content, section, places)
    out[: len(places), list(NODES[section.type])] = places


def _check_repeats(content: _Content, section: _Section, places: Ints) -> None:
    """Warn of cells that have a node twice."""
    if places.shape[1] < 2:
        return
    ordered = np.sort(places, axis=1)
    bad = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
    if len(bad):
        names = [content.names.name(int(key)) for key in section.name[bad[:5]]]
        _warn(content.source.path, f"{len(bad)} cells {section.type} have a node twice, the first {', '.join(names)}")


def _at_row(source: SourceFile, section: _Section, row: int, message: str) -> ReadError:
    """The error for one cell of a section: at the line where it begins."""
    text = body(source, section.part)
    words_before = row * (1 + section.nodes.shape[1])
    for at, piece in chunks(text):
        begin = mail_names.words(piece).begin
        if words_before < len(begin):
            return source.error(message, section.part.begin + at + int(begin[words_before]))
        words_before -= len(begin)
    return source.error(message, section.part.at)


def _groups(content: _Content, what: str, index: Index) -> dict[str, Ints]:
    """Sorted indices of the members of each group. Raises ReadError for an unknown node or cell."""
    groups = {}
    for name, (part, keys) in content.groups[what].items():
        places = index.places(keys)
        if (places < 0).any():
            wrong = [content.names.name(int(key)) for key in keys[places < 0][:5]]
            message = f"the group {name!r} has members that are not among the {what}: {', '.join(wrong)}"
            raise content.source.error(message, part.at)
        groups[name] = places
    return groups
