"""Positions of the elements of a msh 2 file among numbers whose rows have different lengths.

In ASCII a record is one element: number, type, count of tags, tags, nodes. In binary it is a header (type, count of
elements that follow, count of tags) and those elements: number, tags, nodes; gmsh writes one element per header. Runs
of equal records are found by galloping, in steps that double; records that keep changing are read one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import ReadError
from lacmesh.formats.msh.types import TYPE_NAMES, UNKNOWN_TYPE
from lacmesh.mesh import Ints

#: Numbers gone through one record after the other before galloping is tried again, and when that pays.
_WINDOW, _FEW = 1 << 16, 8


class ElementRuns(NamedTuple):
    """Elements in the file's order: gmsh's type, number of tags and position of the number of each. `end`: past all."""

    kind: Ints
    n_tags: Ints
    place: Ints
    end: int


#: Leading numbers of a record, which fix its length: gmsh's type, count of elements that follow, count of tags.
_Key = tuple[int, int, int]


def find(table: Ints, n: int, binary: bool, error: Callable[[str, int], ReadError]) -> ElementRuns:
    """Find the positions of n elements; `error` makes the error for a position in the table.

    Raises ReadError for an unknown type, an impossible record, or a table that ends too early.
    """
    runs: list[tuple[_Key, int, int]] = []  # of records with equal keys: the key, where the first is, their count
    lengths: dict[_Key, int] = {}
    place, left = 0, n
    while left > 0:
        key = _key(table, place, left, binary, error)
        length = lengths[key] = _length(key, binary)
        times = _alike(table, place, length, min(left // key[1], (len(table) - place) // length), binary)
        runs.append((key, place, times))
        place += times * length
        left -= times * key[1]
        if times < _FEW:
            place, left = _walk(table, place, left, binary, lengths, runs)
    return _expanded(runs, binary, place)


def _key(table: Ints, place: int, left: int, binary: bool, error: Callable[[str, int], ReadError]) -> _Key:
    """Key of the record at a position, checked to be possible and complete. Raises what `error` makes."""
    if place + 3 > len(table):
        raise error(f"the elements end too early: {left} more were announced", place)
    first, second, third = table[place : place + 3].tolist()
    kind, follow, n_tags = key = (first, second, third) if binary else (second, 1, third)
    if kind not in TYPE_NAMES:
        raise error(UNKNOWN_TYPE.format(kind), place)
    if not 1 <= follow <= left or not 0 <= n_tags <= len(table):
        raise error(f"no element has {n_tags} tags, or {follow} of them do not follow", place)
    if place + _length(key, binary) > len(table):
        raise error(f"the elements end too early: {left} more were announced", place)
    return key


def _size(key: _Key) -> int:
    """Count of tags and nodes of one element."""
    return key[2] + ALL_CELLS[TYPE_NAMES[key[0]]].n_nodes


def _length(key: _Key, binary: bool) -> int:
    return 3 + (key[1] * (1 + _size(key)) if binary else _size(key))


def _alike(table: Ints, place: int, length: int, most: int, binary: bool) -> int:
    """Number of records, from a position on and at most `most`, that begin as the first does."""
    columns = slice(0, 3) if binary else slice(1, 3)
    begin = table[place : place + 3][columns]
    times, step = 1, _FEW
    while times < most:
        step = min(step, most - times)
        at = place + times * length
        same = (table[at : at + step * length].reshape(step, length)[:, columns] == begin).all(axis=1)
        if not same.all():
            return times + int(same.argmin())
        times += step
        step *= 2
    return times


def _walk(
    table: Ints, place: int, left: int, binary: bool, lengths: dict[_Key, int], runs: list[tuple[_Key, int, int]]
) -> tuple[int, int]:
    """Go through the records of a window one after the other; stop at one with a new key, or not complete in it.

    `lengths`: of records with the keys that are known.
    """
    window: list[int] = table[place : place + _WINDOW].tolist()
    at = 0
    while left > 0 and at + 3 <= len(window):
        first, second, third = window[at : at + 3]
        key = (first, second, third) if binary else (second, 1, third)
        length = lengths.get(key, len(window) + 1)
        if at + length > len(window) or key[1] > left:
            break
        runs.append((key, place + at, 1))
        at += length
        left -= key[1]
    return place + at, left


def _expanded(runs: list[tuple[_Key, int, int]], binary: bool, end: int) -> ElementRuns:
    """Expand the runs to one row for each element."""
    row = {key: k for k, key in enumerate(dict.fromkeys(key for key, _, _ in runs))}
    keys = np.array(list(row), np.int64).reshape(-1, 3)
    inner = np.array([1 + _size(key) for key in row], np.int64)
    outer = np.array([_length(key, binary) for key in row], np.int64)
    key, place, times = np.array([(row[key], place, times) for key, place, times in runs], np.int64).reshape(-1, 3).T
    count = times * keys[key, 1]
    which = np.repeat(key, count)
    within = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    follow = keys[which, 1]
    start = np.repeat(place, count) + (3 if binary else 0)
    start += within // follow * outer[which] + within % follow * inner[which]
    return ElementRuns(keys[which, 0], keys[which, 2], start, end)
