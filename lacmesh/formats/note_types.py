"""Types of notes: how a value becomes JSON data, and how such data are checked and become the value again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from lacmesh.mesh import Ints

#: What a damaged text may raise while it is read.
DAMAGE = (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, OverflowError)


class Note(NamedTuple):
    """Type of a note: `plain` makes JSON data of a value, `value` checks such data and raises one of DAMAGE."""

    plain: Callable[[Any], Any]
    value: Callable[[Any], Any]

    def through(self, take_apart: Callable[[Any], Any], put_together: Callable[[Any], Any]) -> Note:
        """Type of the values that this type holds when they are taken apart."""
        return Note(lambda value: self.plain(take_apart(value)), lambda data: put_together(self.value(data)))


NoteTable = Mapping[str, Note]


def to_plain(values: Mapping[str, Any], table: NoteTable) -> dict[str, Any]:
    """JSON data of the values that a table lists, in its order; what is None or empty is left out."""
    plain = {key: note.plain(values[key]) for key, note in table.items() if values.get(key) is not None}
    return {key: data for key, data in plain.items() if data not in ([], {})}


def from_plain(data: Any, table: NoteTable) -> dict[str, Any]:
    """Values of the notes in JSON data, as far as a table lists them. Raises one of DAMAGE."""
    known = _object(data)
    return {key: note.value(known[key]) for key, note in table.items() if key in known}


def _object(data: Any) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise ValueError("it should be an object")
    return data


def _list(data: Any) -> list[Any]:
    if not isinstance(data, list):
        raise TypeError(f"{str(data)[:40]!r} should be a list")
    return data


def _text(data: Any) -> str:
    if not isinstance(data, str):
        raise TypeError(f"{str(data)[:40]!r} should be text")
    return data


def _integer(data: Any) -> int:
    if type(data) is not int or not -(2**63) <= data < 2**63:
        raise TypeError(f"{str(data)[:40]!r} should be an integer")
    return data


def _real(data: Any) -> float:
    if type(data) not in (int, float):
        raise TypeError(f"{str(data)[:40]!r} should be a number")
    return float(data)


def _integers(data: Any, ndim: int) -> Ints:
    array = np.array(_list(data))
    if array.size == 0:
        return np.empty(0, np.int64)
    if array.ndim != ndim or array.dtype != np.int64:
        raise TypeError("a list should hold integers only")
    return array


TEXT, INTEGER, REAL, FLAG = Note(str, _text), Note(int, _integer), Note(float, _real), Note(bool, bool)
#: an array of integers, in a list without nesting whatever its shape
INTEGERS = Note(lambda values: np.asarray(values).ravel().tolist(), lambda data: _integers(data, 1))
#: rows of two integers, (n, 2), in a list of lists
PAIRS = Note(lambda values: np.asarray(values).tolist(), lambda data: _integers(data, 2).reshape(-1, 2))


def optional(item: Note) -> Note:
    """Type of a value that may be None."""
    return Note(
        lambda value: None if value is None else item.plain(value),
        lambda data: None if data is None else item.value(data),
    )


def tuple_of(item: Note) -> Note:
    """Type of a tuple of any length, a list in JSON."""
    return Note(
        lambda values: [item.plain(v) for v in values],
        lambda data: tuple(item.value(v) for v in _list(data)),
    )


def record_of(*items: Note) -> Note:
    """Type of a tuple of as many values as there are items, a list in JSON."""

    def value(data: Any) -> tuple[Any, ...]:
        if len(_list(data)) != len(items):
            raise ValueError(f"{str(data)[:40]!r} should be {len(items)} values")
        return tuple(item.value(v) for item, v in zip(items, data, strict=True))

    return Note(lambda values: [item.plain(v) for item, v in zip(items, values, strict=True)], value)


def object_of(**items: Note) -> Note:
    """Type of a mapping with these keys, an object in JSON; what else the object holds is left out."""
    return Note(
        lambda values: {key: item.plain(values[key]) for key, item in items.items()},
        lambda data: {key: item.value(_object(data)[key]) for key, item in items.items()},
    )


def mapping_of(item: Note) -> Note:
    """Type of a mapping with any keys, an object in JSON."""
    return Note(
        lambda values: {key: item.plain(v) for key, v in values.items()},
        lambda data: {key: item.value(v) for key, v in _object(data).items()},
    )


def named(key: str, item: Note) -> Note:
    """Type of a mapping, in JSON a list of objects with the name of each entry and, under `key`, its value."""
    return Note(
        lambda values: [{"name": name, key: item.plain(v)} for name, v in values.items()],
        lambda data: {_text(entry["name"]): item.value(entry[key]) for entry in _list(data)},
    )


def columns(*names: str) -> Note:
    """Type of a mapping from names to columns (n,) of integers from -1 on, an object in JSON."""

    def checked(table: dict[str, Ints]) -> dict[str, Ints]:
        if len({len(column) for column in table.values()}) > 1:
            raise ValueError("columns of several lengths")
        if any(column.min(initial=0) < -1 for column in table.values()):
            raise ValueError("a column holds integers from -1 on")
        return table

    return object_of(**dict.fromkeys(names, INTEGERS)).through(dict, checked)
