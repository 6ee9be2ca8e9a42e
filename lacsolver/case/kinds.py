"""Types of values that keys take: each reads a value from a file or from Python, and is described in words and JSON.

Names in capitals are types; functions return the type for some limits, words or lengths.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.errors import did_you_mean
from lacsolver.case.errors import Mistake
from lacsolver.case.value import described, number_from

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh

Schema = dict[str, Any]


@dataclass(frozen=True)
class Kind:
    """Type of the values of a key.

    `words`: short description, `a number > 0`. `schema`: description in JSON Schema. `read` returns the value to store
    for a given one, or raises Mistake with the end of a sentence that begins with the key's name. `misfit` returns what
    is wrong with a value in a model of 2 or 3 dimensions, "" if nothing is. `is_group`: the values name groups.
    """

    words: str
    schema: Schema
    read: Callable[[Any], Any]
    misfit: Callable[[Any, int], str] = lambda value, dim: ""
    is_group: bool = False


@dataclass(frozen=True)
class Choice:
    """Type of a key that takes one word of several: `options` has the meaning of each.

    `kinematics`: the only ones that a word is for, by word. `added`: words that a program may have added, see
    `case.added`.
    """

    options: Mapping[str, str]
    kinematics: Mapping[str, str] = field(default_factory=dict)
    added: Mapping[str, Any] = field(default_factory=dict)
    is_group = False

    @property
    def known(self) -> tuple[str, ...]:
        """The words that may be chosen."""
        return (*self.options, *self.added)

    @property
    def words(self) -> str:
        """The words that may be chosen, as one text."""
        return ", ".join(self.known)

    @property
    def schema(self) -> Schema:
        """Description in JSON Schema."""
        return {"type": "string", "enum": list(self.known)}

    def read(self, given: Any) -> str:
        """Return the word. Raises Mistake."""
        if not isinstance(given, str):
            raise Mistake(f"is {described(given)}; it takes one of {self.words}")
        if given not in self.known:
            raise Mistake(f'is "{given[:40]}"{did_you_mean(given, self.known)}')
        return given

    def misfit(self, value: str, dim: int) -> str:
        """Return "": words are the same in all models."""
        return ""


def number(low: float | None = None, high: float | None = None, *, open: bool = True) -> Kind:
    """A finite number between limits, which are excluded if `open`."""
    less, more = ("<", ">") if open else ("<=", ">=")
    least, most = ("exclusiveMinimum", "exclusiveMaximum") if open else ("minimum", "maximum")
    limits = " and ".join(f"{sign} {end:g}" for sign, end in ((more, low), (less, high)) if end is not None)
    schema = {name: end for name, end in ((least, low), (most, high)) if end is not None}

    def read(given: Any) -> float:
        value = number_from(given)
        below = low is not None and (value <= low if open else value < low)
        if below or (high is not None and (value >= high if open else value > high)):
            raise Mistake(f"is {value:g}; it must be {limits}")
        return value

    return Kind(f"a number {limits}".strip(), {"type": "number", **schema}, read)


NUMBER = number()
POSITIVE = number(low=0)
NOT_NEGATIVE = number(low=0, open=False)


def whole(least: int) -> Kind:
    """A whole number from `least` on."""

    def read(given: Any) -> int:
        if isinstance(given, bool) or not isinstance(given, int):
            raise Mistake(f"is {described(given)}; it takes a whole number")
        if given < least:
            raise Mistake(f"is {given}; it must be >= {least}")
        if given >= 2**31:
            raise Mistake("is a whole number too large to be meant; it must be below 2147483648")
        return given

    schema = {"type": "integer", "minimum": least, "exclusiveMaximum": 2**31}
    return Kind(f"a whole number >= {least}", schema, read)


def _flag(given: Any) -> bool:
    if not isinstance(given, bool):
        raise Mistake(f"is {described(given)}; it takes true or false")
    return given


FLAG = Kind("true or false", {"type": "boolean"}, _flag)
TEXT: Schema = {"type": "string", "minLength": 1}


def text(what: str) -> Kind:
    """A text that is not empty; `what` describes it in messages."""

    def read(given: Any) -> str:
        if not isinstance(given, str):
            raise Mistake(f"is {described(given)}; it takes {what}, as text")
        if not given.strip() or not given.isprintable():
            raise Mistake(f"is empty or cannot be printed; it takes {what}")
        return given

    return Kind(what, TEXT, read)


def _units(given: Any) -> str:
    names = [name.strip() for name in text(_UNITS).read(given).split(",")]
    if len(names) not in (3, 4) or not all(names):
        raise Mistake(f'is "{given[:40]}"; it takes {_UNITS}')
    return ", ".join(names)


_UNITS = 'names for force, length, stress and, if wanted, time, as "N, mm, MPa" or "N, mm, MPa, s"'
UNITS = Kind(_UNITS, TEXT, _units)


def _mesh(given: Any) -> Path | Mesh:
    loaded = sys.modules.get("lacmesh.mesh")  # a file has no mesh in it, and reading one needs no numpy
    if loaded is not None and isinstance(given, loaded.Mesh):
        return given
    return given if isinstance(given, Path) else Path(text("a path").read(given))


#: a path to a mesh, which `read_case` makes relative to the case's file; from Python also a mesh
MESH_FILE = Kind("a path, relative to the case's file", TEXT, _mesh)


def each(read: Callable[[Any], Any], given: Sequence[Any]) -> tuple[Any, ...]:
    """Read every item; a mistake names the item, counted from 1, and keeps its position."""
    values = []
    for k, item in enumerate(given):
        try:
            values.append(read(item))
        except Mistake as mistake:
            raise Mistake(f"has an item (number {k + 1}) that {mistake.message}", (k, *mistake.inside)) from None
    return tuple(values)


def _group(given: Any) -> str:
    if isinstance(given, int) and not isinstance(given, bool) and given >= 0:
        return str(whole(0).read(given))
    return text("the name of a group").read(given)


def _groups(given: Any) -> tuple[str, ...]:
    if not isinstance(given, (list, tuple)):
        example = f'["{given}"]' if isinstance(given, str) and given.isprintable() else '["a", "b"]'
        raise Mistake(f"is {described(given)}; it takes a list of groups, as {example}")
    if not given:
        raise Mistake("is an empty list; leave the key out where the whole mesh is meant")
    names = each(_group, given)
    if len(set(names)) < len(names):
        raise Mistake(f"names the group {next(n for n in names if names.count(n) > 1)!r} twice")
    return names


def _two_groups(given: Any) -> tuple[str, ...]:
    names = _groups(given)
    if len(names) != 2:
        raise Mistake(f'has {len(names)} groups; it takes two, as ["a", "b"]')
    return tuple(sorted(names))


#: a group of the mesh, by name, or by tag in an msh file (`5`, `"2:5"`)
GROUP = Kind("a group", {"anyOf": [TEXT, {"type": "integer", "minimum": 0}]}, _group, is_group=True)
GROUPS = Kind("a list of groups", {"type": "array", "items": GROUP.schema, "minItems": 1}, _groups, is_group=True)
#: two groups, whose order does not count: they are read in that of the alphabet
TWO_GROUPS = Kind("a list of two groups", {**GROUPS.schema, "minItems": 2, "maxItems": 2}, _two_groups, is_group=True)


def _number_table(given: Any) -> dict[str, float]:
    if not isinstance(given, Mapping) or not given:
        raise Mistake(f"is {described(given)}; it takes {NUMBER_TABLE.words}")
    return {str(name): number_from(value) for name, value in given.items()}


NUMBER_TABLE = Kind(
    "a table of numbers, { a = 1.0, b = 2.0 }",
    {"type": "object", "additionalProperties": {"type": "number"}, "minProperties": 1},
    _number_table,
)


def _thickness(given: Any) -> float | dict[str, float]:
    if not isinstance(given, Mapping):
        return float(POSITIVE.read(given))
    if not given:
        raise Mistake(f"is an empty table; it takes {THICKNESS.words}")
    out = {}
    for name, value in given.items():
        try:
            out[GROUP.read(name)] = POSITIVE.read(value)
        except Mistake as mistake:
            raise Mistake(f"has an entry {name!r} that {mistake.message}", (name, *mistake.inside)) from None
    return out


#: a number, or a table of numbers by groups of cells
THICKNESS = Kind(
    "a number > 0, or { group = number, ... }",
    {
        "anyOf": [
            POSITIVE.schema,
            {"type": "object", "additionalProperties": POSITIVE.schema, "minProperties": 1},
        ]
    },
    _thickness,
    is_group=True,
)


def plain(given: Any) -> Any:
    """Return an array of numpy as lists, anything else as it is."""
    return given.tolist() if hasattr(given, "tolist") else given


def several(item: Kind, words: str, least: int, most: int | None = None) -> Kind:
    """A list of `least` to `most` values."""

    def read(given: Any) -> tuple[Any, ...]:
        given = plain(given)
        if not isinstance(given, (list, tuple)) or not least <= len(given) <= (most or len(given)):
            raise Mistake(f"is {described(given)}; it takes {words}")
        return each(item.read, given)

    ends = {"minItems": least} | ({"maxItems": most} if most else {})
    return Kind(words, {"type": "array", "items": item.schema, **ends}, read)


def numbers(how_many: int, item: Kind = NUMBER) -> Kind:
    """Two or three numbers."""
    word = {2: "two", 3: "three"}[how_many]
    return several(item, item.words.replace("a number", f"{word} numbers"), how_many, how_many)


def one_or_three(item: Kind = NUMBER) -> Kind:
    """A single number, or three."""
    three = several(item, f"{item.words}, or three", 3, 3)

    def read(given: Any) -> Any:
        return three.read(given) if isinstance(given, (list, tuple)) else item.read(given)

    return Kind(three.words, {"anyOf": [item.schema, three.schema]}, read)


def other_dimension(point: Sequence[float], dim: int) -> str:
    """Return what is wrong with a point in a model of 2 or 3 dimensions, "" if nothing is."""
    where = "3d" if dim == 3 else "a plane model"
    return "" if len(point) == dim else f"has {len(point)} coordinates; {where} has {dim}"


_COORDINATES = several(NUMBER, "[x, y, z]; [x, y] in a plane", 2, 3)
#: a point: one coordinate for each dimension of the model
POINT = replace(_COORDINATES, misfit=other_dimension)
