"""The data lines of *NODE, *ELEMENT, *NSET, *ELSET and *SURFACE as arrays."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from lacmesh.formats.inp.cards import Card, label
from lacmesh.formats.text import AS_INTEGERS, AS_REALS, bad_line, chunks, decoded, integers, parsed, values_in_lines
from lacmesh.mesh import Floats, Ints, mask_of

_LARGEST = 10**9
_FACE = re.compile(rb"^[ \t]*(\d{1,18})[ \t]*,[ \t]*([A-Za-z]\w*)[ \t]*,?[ \t]*\r?$", re.MULTILINE)
_NUMBER = re.compile(r"[+-]?\d{1,18}")


class Members(NamedTuple):
    """Members that a set's data lines list: numbers, ranges of numbers, names of sets."""

    numbers: Ints
    ranges: tuple[range, ...]
    names: tuple[str, ...]


def nodes(card: Card) -> tuple[Ints, Floats]:
    """Numbers (n,) and coordinates (n, 3) of the nodes of a card; missing coordinates are 0. Raises ReadError."""
    text = card.text()
    numbers, points = [np.empty(0, np.int64)], [np.empty((0, 3))]
    for at, piece in chunks(text):
        table = _even(piece)
        if table is None:
            table = _uneven_nodes(card, piece, at)
        with np.errstate(invalid="ignore"):
            number = table[:, 0].astype(np.int64)
        wrong = np.flatnonzero(~((number == table[:, 0]) & (number > 0) & (number < _LARGEST)))
        if len(wrong):
            message = f"a node's number should be an integer from 1 to {_LARGEST - 1}, not {table[wrong[0], 0]:g}"
            raise card.error(message, at + _line(piece, int(wrong[0])))
        wrong = np.flatnonzero(~np.isfinite(table).all(axis=1))
        if len(wrong):
            message = f"the coordinates of node {number[wrong[0]]} are not finite numbers"
            raise card.error(message, at + _line(piece, int(wrong[0])))
        xyz = np.zeros((len(table), 3))
        xyz[:, : table.shape[1] - 1] = table[:, 1:4]
        numbers.append(number)
        points.append(xyz)
    return np.concatenate(numbers), np.concatenate(points)


def _even(text: bytes) -> Floats | None:
    """Table of the numbers in lines of equal length, the first 4 columns at most; None if the lengths differ."""
    counts = values_in_lines(text)
    counts = counts[counts > 0]
    values = parsed(text.translate(AS_REALS), np.float64)
    if values is None or not len(counts) or counts.min() != counts.max() or counts[0] < 2:
        return None
    if len(values) != len(counts) * counts[0]:  # something was left out between commas
        return None
    return values.reshape(len(counts), -1)[:, :4]


def _uneven_nodes(card: Card, text: bytes, at: int) -> Floats:
    """Numbers (n, 4) of lines of unequal length, read one by one; those that are left out are 0."""
    rows = []
    for line in text.translate(_EXPONENT).splitlines(keepends=True):
        if line.strip():
            fields = [f.strip() or b"0" for f in line.split(b",")[:4]]
            try:
                rows.append([float(f) for f in fields] + [0.0] * (4 - len(fields)))
            except ValueError:
                shown = decoded(line).strip()[:60]
                raise card.error(f"{shown!r} should be a node's number and its coordinates", at) from None
        at += len(line)
    return np.array(rows, float).reshape(-1, 4)


_EXPONENT = bytes.maketrans(b"Dd", b"ee")


def _line(text: bytes, n: int) -> int:
    """Byte offset of the n-th line (from 0) that is not blank."""
    at = 0
    for line in text.splitlines(keepends=True):
        if line.strip():
            if n == 0:
                return at
            n -= 1
        at += len(line)
    return at


def elements(card: Card, n_nodes: int) -> tuple[Ints, Ints]:
    """Elements of a card as rows (k, 1 + n_nodes) of number and nodes; an element may continue over several lines.

    If all lines have equally many numbers, more than an element needs, the surplus is left out, as CalculiX does (the
    orientation node of a beam); the second array, (k,), counts what was left out of each row. Raises ReadError.
    """
    text = card.text()
    width = 1 + n_nodes
    tables: list[Ints] = [np.empty((0, width), np.int64)]
    left: Ints = np.empty(0, np.int64)
    lost: list[Ints] = [np.empty(0, np.int64)]
    for at, piece in chunks(text):
        values = integers(piece)
        if values is None:
            place = bad_line(piece.translate(AS_INTEGERS), np.int64)
            shown = decoded(piece[place:].split(b"\n", 1)[0]).strip()[:60]
            raise card.error(f"{shown!r} should be an element's number and its nodes'", at + place)
        counts = values_in_lines(piece)
        listed = int(counts.max(initial=0))
        if listed > width and not len(left) and len(values) == counts.sum() and set(counts.tolist()) <= {0, listed}:
            tables.append(values.reshape(-1, listed)[:, :width])
            lost.append(np.full(len(tables[-1]), listed - width))
            continue
        _check_rows(card, piece, at, counts, len(values), len(left), width)
        values = np.concatenate([left, values])
        whole = len(values) // width * width
        tables.append(values[:whole].reshape(-1, width))
        lost.append(np.zeros(len(tables[-1]), np.int64))
        left = values[whole:]
    if len(left):
        raise card.error(f"element {left[0]} has {len(left) - 1} nodes, and should have {n_nodes}", len(text) - 1)
    return np.concatenate(tables), np.concatenate(lost)


def _check_rows(card: Card, text: bytes, at: int, counts: Ints, n_values: int, before: int, width: int) -> None:
    """Raise ReadError if an element does not begin a line; `before`: count of numbers of an element begun earlier."""
    ends = np.cumsum(counts) + before
    if len(ends) and ends[-1] - before != n_values:
        raise card.error("there are fields without a number among these elements", at)
    begins = mask_of(n_values + before + 1, [0, *([before] if before else [])])
    begins[ends] = True
    wrong = np.flatnonzero(~begins[width::width])
    if len(wrong):
        line = int(np.searchsorted(ends, wrong[0] * width, side="right"))
        lines = text.split(b"\n", line + 1)
        place = at + sum(len(row) + 1 for row in lines[:line])
        raise card.error(f"an element here should have {width - 1} nodes, and the next one begin a line", place)


def members(card: Card) -> Members:
    """Read the members that the data lines of a set list. Raises ReadError."""
    text = card.text()
    generated = "GENERATE" in card.parameters
    values = None if generated else integers(text)
    if values is not None:
        return Members(values, (), ())
    numbers: list[int] = []
    ranges: list[range] = []
    names: list[str] = []
    at = 0
    for line in text.splitlines(keepends=True):
        fields = [f for part in decoded(line).split(",") if (f := part.strip())]
        if generated and fields:
            ranges.append(_range(card, fields, at))
        elif not generated:
            for f in fields:
                if _NUMBER.fullmatch(f):
                    numbers.append(int(f))
                else:
                    names.append(f)
        at += len(line)
    return Members(np.array(numbers, np.int64), tuple(ranges), tuple(names))


def _range(card: Card, fields: list[str], at: int) -> range:
    if len(fields) not in (2, 3) or not all(_NUMBER.fullmatch(f) for f in fields):
        raise card.error(f"{', '.join(fields)[:60]!r} should be first, last, step of numbers to generate", at)
    first, last, step = (*map(int, fields), 1)[:3]
    if step < 1:
        raise card.error(f"the step of numbers to generate is {step}, and should be 1 or more", at)
    return range(first, last + 1, step)


def faces(card: Card) -> list[tuple[str, Ints | str]]:
    """Entries of a *SURFACE of elements: (label of a face, element numbers or the name of a set). Raises ReadError."""
    text = card.text()
    rows = _FACE.findall(text)
    if len(rows) == int(np.count_nonzero(values_in_lines(text))):
        number = np.array([row[0] for row in rows], dtype="S").astype(np.int64)
        face = np.array([row[1].upper() for row in rows], dtype="S")
        return [(decoded(bytes(face_label)), number[face == face_label]) for face_label in sorted(set(face.tolist()))]
    entries: list[tuple[str, Ints | str]] = []
    at = 0
    for line in text.splitlines(keepends=True):
        fields = [f.strip() for f in decoded(line).split(",")]
        if line.strip():
            if not fields[0]:
                raise card.error("a surface's line should begin with an element or a set of elements", at)
            which = fields[1].upper() if len(fields) > 1 else ""
            number_of = int(fields[0]) if _NUMBER.fullmatch(fields[0]) else None
            entries.append((which, fields[0] if number_of is None else np.array([number_of])))
        at += len(line)
    return entries


def key(name: str) -> str:
    """Name of a set in the form used for comparison."""
    return label(name)[1]
