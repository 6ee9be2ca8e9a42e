"""Types of values that keys take: each reads a value from a file or from Python, and is described in words and JSON.

Names in capitals are types; functions return the type for some limits, words or lengths.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.errors import did_you_mean
from lacsolver.case.errors import Mistake
from lacsolver.case.formula import Formula
from lacsolver.case.value import Value, described, number_from, value_from

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
_TEXT: Schema = {"type": "string", "minLength": 1}


def text(what: str) -> Kind:
    """A text that is not empty; `what` describes it in messages."""

    def read(given: Any) -> str:
        if not isinstance(given, str):
            raise Mistake(f"is {described(given)}; it takes {what}, as text")
        if not given.strip() or not given.isprintable():
            raise Mistake(f"is empty or cannot be printed; it takes {what}")
        return given

    return Kind(what, _TEXT, read)


def _units(given: Any) -> str:
    names = [name.strip() for name in text(_UNITS).read(given).split(",")]
    if len(names) not in (3, 4) or not all(names):
        raise Mistake(f'is "{given[:40]}"; it takes {_UNITS}')
    return ", ".join(names)


_UNITS = 'names for force, length, stress and, if wanted, time, as "N, mm, MPa" or "N, mm, MPa, s"'
UNITS = Kind(_UNITS, _TEXT, _units)


def _mesh(given: Any) -> Path | Mesh:
    loaded = sys.modules.get("lacmesh.mesh")  # a file has no mesh in it, and reading one needs no numpy
    if loaded is not None and isinstance(given, loaded.Mesh):
        return given
    return given if isinstance(given, Path) else Path(text("a path").read(given))


#: a path to a mesh, which `read_case` makes relative to the case's file; from Python also a mesh
MESH_FILE = Kind("a path, relative to the case's file", _TEXT, _mesh)


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
    names = _each(_group, given)
    if len(set(names)) < len(names):
        raise Mistake(f"names the group {next(n for n in names if names.count(n) > 1)!r} twice")
    return names


def _two_groups(given: Any) -> tuple[str, ...]:
    names = _groups(given)
    if len(names) != 2:
        raise Mistake(f'has {len(names)} groups; it takes two, as ["a", "b"]')
    return tuple(sorted(names))


#: a group of the mesh, by name, or by tag in an msh file (`5`, `"2:5"`)
GROUP = Kind("a group", {"anyOf": [_TEXT, {"type": "integer", "minimum": 0}]}, _group, is_group=True)
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


def _several(item: Kind, words: str, least: int, most: int | None = None) -> Kind:
    """A list of `least` to `most` values."""

    def read(given: Any) -> tuple[Any, ...]:
        given = _plain(given)
        if not isinstance(given, (list, tuple)) or not least <= len(given) <= (most or len(given)):
            raise Mistake(f"is {described(given)}; it takes {words}")
        return _each(item.read, given)

    ends = {"minItems": least} | ({"maxItems": most} if most else {})
    return Kind(words, {"type": "array", "items": item.schema, **ends}, read)


def numbers(how_many: int, item: Kind = NUMBER) -> Kind:
    """Two or three numbers."""
    word = {2: "two", 3: "three"}[how_many]
    return _several(item, item.words.replace("a number", f"{word} numbers"), how_many, how_many)


def one_or_three(item: Kind = NUMBER) -> Kind:
    """A single number, or three."""
    three = _several(item, f"{item.words}, or three", 3, 3)

    def read(given: Any) -> Any:
        return three.read(given) if isinstance(given, (list, tuple)) else item.read(given)

    return Kind(three.words, {"anyOf": [item.schema, three.schema]}, read)


def _other_dimension(point: Sequence[float], dim: int) -> str:
    where = "3d" if dim == 3 else "a plane model"
    return "" if len(point) == dim else f"has {len(point)} coordinates; {where} has {dim}"


_COORDINATES = _several(NUMBER, "[x, y, z]; [x, y] in a plane", 2, 3)
#: a point: one coordinate for each dimension of the model
POINT = replace(_COORDINATES, misfit=_other_dimension)
_TWO_VECTORS = _several(POINT, "two vectors [[..], [..]]", 2, 2)


def _axes(given: Any) -> tuple[tuple[float, ...], ...]:
    a, b = _TWO_VECTORS.read(given)
    if len(a) != len(b):
        raise Mistake("has vectors of different dimensions")
    (ax, ay, az), (bx, by, bz) = ((*v, 0.0)[:3] for v in (a, b))
    cross = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    aa, bb, cc = (sum(c * c for c in v) for v in (a, b, cross))
    if not cc > 1e-12 * aa * bb:
        raise Mistake("has vectors that lie on one line; give two that span the plane of axes 1 and 2")
    return a, b


def _out_of_plane(axes: Sequence[Sequence[float]], dim: int) -> str:
    if dim == 3:
        return "" if len(axes[0]) == 3 else "has vectors of 2 components; 3d has 3"
    outside = any(any(v[2:]) for v in axes)
    return "has vectors out of the plane of the model; give axes 1 and 2 in it" if outside else ""


def _inner(table: Mapping[str, Any], takes: Mapping[str, Any], words: str) -> dict[str, Any]:
    """Return the keys of a table inside a key, each read by its type. Raises Mistake with the key that is wrong."""
    if not isinstance(table, Mapping):
        raise Mistake(f"is {described(table)}; it takes {words}")
    values = {}
    for name, given in table.items():
        if name not in takes:
            raise Mistake(f"has {name}{did_you_mean(name, takes)}; it takes {words}", (name,))
        try:
            values[str(name)] = takes[name].read(given)
        except Mistake as mistake:
            raise Mistake(f"has {name}, which {mistake.message}", (name, *mistake.inside)) from None
    return values


_AXES_WORDS = "{ x = [..], xy = [..] }, or cylindrical { origin = [..], axis = [..] }"


def _local_axes(given: Any) -> dict[str, Any]:
    axes = _inner(given, _IN_AXES, _AXES_WORDS)
    if ("x" in axes) == ("axis" in axes):
        raise Mistake(f"needs x, or axis, and not both; it takes {_AXES_WORDS}")
    if "axis" in axes:
        if "xy" in axes or "origin" not in axes:
            raise Mistake(f"is cylindrical, and needs origin and axis, no xy; it takes {_AXES_WORDS}")
        if not any(axes["axis"]):
            raise Mistake("has an axis of length 0; give its direction")
        return axes
    if not any(axes["x"]):
        raise Mistake("has an x of length 0; give its direction")
    return axes if "xy" not in axes else axes | dict(zip(("x", "xy"), _axes((axes["x"], axes["xy"])), strict=True))


def _axes_misfit(axes: Mapping[str, Any], dim: int) -> str:
    short = [name for name in ("origin", "x", "xy") if name in axes and len(axes[name]) != dim]
    if short:
        return f"has {short[0]} of {len(axes[short[0]])} components; the model has {dim}"
    if dim == 3:
        return "" if "axis" in axes or "xy" in axes else "needs xy, a second vector in the plane of x and y"
    return (
        "has an axis out of z, which a plane model turns about; write axis = [0, 0, 1]"
        if any(axes.get("axis", ())[:2])
        else ""
    )


_IN_AXES = {"origin": POINT, "x": POINT, "xy": POINT, "axis": numbers(3)}
#: local axes: Cartesian, or cylindrical
LOCAL_AXES = Kind(
    _AXES_WORDS,
    {
        "type": "object",
        "properties": {name: kind.schema for name, kind in _IN_AXES.items()},
        "additionalProperties": False,
        "oneOf": [{"required": ["x"]}, {"required": ["origin", "axis"]}],
    },
    _local_axes,
    _axes_misfit,
)

_COMPONENT = Choice({"ux": "along x", "uy": "along y", "uz": "along z"})
_OUT_OF_PLANE = "has uz, which a plane model does not have"


def _components(given: Any) -> tuple[str, ...]:
    if isinstance(given, str) or not isinstance(given, (list, tuple)) or not given:
        raise Mistake(f"is {described(given)}; it takes {COMPONENTS.words}")
    names = _each(_COMPONENT.read, given)
    if len(set(names)) < len(names):
        raise Mistake("names a component twice")
    return names


#: components of displacement
COMPONENTS = Kind(
    'a list of components, as ["ux", "uy"]',
    {"type": "array", "items": _COMPONENT.schema, "minItems": 1, "uniqueItems": True},
    _components,
    lambda names, dim: _OUT_OF_PLANE if dim == 2 and "uz" in names else "",
)

_GROUP_KIND = Choice({"cell": "a group of cells", "node": "a group of nodes"})
_IN_TERM: dict[str, Kind | Choice] = {
    "factor": NUMBER,
    "component": _COMPONENT,
    "node": whole(0),
    "group": GROUP,
    "kind": _GROUP_KIND,
    "at": POINT,
}
_TERM_WORDS = '{ factor = 1.0, component = "ux", node = 12 } (or group = "..", or at = [..])'


def _term(given: Any) -> dict[str, Any]:
    term = _inner(given, _IN_TERM, _TERM_WORDS)
    where = [name for name in ("node", "group", "at") if name in term]
    missing = [name for name in ("factor", "component") if name not in term]
    if missing or len(where) != 1:
        what = missing[0] if missing else "one of node, group, at"
        raise Mistake(f"needs {what}; it takes {_TERM_WORDS}")
    if "kind" in term and "group" not in term:
        raise Mistake("has a kind, which is of a group; leave it out")
    if not term["factor"]:
        raise Mistake("has the factor 0; leave the term out")
    return term


def _terms(given: Any) -> tuple[dict[str, Any], ...]:
    if isinstance(given, (str, Mapping)) or not isinstance(given, (list, tuple)) or not given:
        raise Mistake(f"is {described(given)}; it takes a list of {_TERM_WORDS}")
    return _each(_term, given)


def _terms_misfit(terms: Sequence[Mapping[str, Any]], dim: int) -> str:
    if dim == 2 and any(term["component"] == "uz" for term in terms):
        return _OUT_OF_PLANE
    points = (_other_dimension(term["at"], dim) for term in terms if "at" in term)
    return next((f"has a term whose at {words}" for words in points if words), "")


#: the terms of an equation
TERMS = Kind(
    f"a list of {_TERM_WORDS}",
    {
        "type": "array",
        "minItems": 1,
        "items": {
            "type": "object",
            "properties": {
                **{name: kind.schema for name, kind in _IN_TERM.items()},
                "factor": {"type": "number", "not": {"const": 0}},
            },
            "additionalProperties": False,
            "required": ["factor", "component"],
            "oneOf": [{"required": [name]} for name in ("node", "group", "at")],
        },
    },
    _terms,
    _terms_misfit,
    is_group=True,
)
#: two vectors that are not parallel
AXES = Kind(_TWO_VECTORS.words, _TWO_VECTORS.schema, _axes, _out_of_plane)
_POSITIVE_TIMES = _several(POSITIVE, "a list of increasing times > 0", 1)


def _times(given: Any) -> tuple[float, ...]:
    times = _POSITIVE_TIMES.read(given)
    for k, (before, after) in enumerate(pairwise(times)):
        if after <= before:
            raise Mistake(f"has {after:g} after {before:g}; times increase", (k + 1,))
    return times


#: times that increase, all after 0
TIMES = Kind(_POSITIVE_TIMES.words, _POSITIVE_TIMES.schema, _times)


def varying(*, place: bool = True, normals: bool = False) -> Kind:
    """A number, a formula, a table of times, or a function.

    `place`: True if it may depend on x, y, z; `normals`: True if a function takes normals too.
    """

    def read(given: Any) -> Value:
        source = value_from(given)
        if not place and isinstance(source, Formula) and source.variables & {"x", "y", "z"}:
            raise Mistake("depends on x, y or z; it is one value for a whole body, so write a formula of t")
        value = given if isinstance(given, Value) else Value(source)
        return replace(value, takes_normals=normals and callable(source), placeless=not place)

    row = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
    table = {"type": "array", "items": row, "minItems": 1}
    return Kind("a value" if place else "a value of time", {"anyOf": [{"type": "number"}, _TEXT, table]}, read)


VALUE = varying()
VALUE_OF_TIME = varying(place=False)


def _weights(given: Any) -> Any:
    given = _plain(given)
    if not isinstance(given, (list, tuple)):
        value = VALUE.read(given)
        if isinstance(value.source, Formula) and "t" in value.source.variables:
            raise Mistake("depends on t; weights are of the undeformed nodes")
        return value
    rows = _each(numbers(2).read, given)
    odd = [row for row in rows if row[0] != int(row[0]) or row[0] < 0]
    if odd or not rows:
        raise Mistake(f"is {'an empty list' if not rows else f'of node {odd[0][0]:g}'}; it takes {WEIGHTS.words}")
    if len({number for number, _ in rows}) < len(rows):
        raise Mistake("names a node twice")
    return rows


#: weights of nodes
WEIGHTS = Kind(
    "a formula of x, y, z, or a list [[node, weight], ...]",
    {"anyOf": [{"type": "number"}, _TEXT, {"type": "array", "items": numbers(2).schema, "minItems": 1}]},
    _weights,
)


def not_negative(*, positive: bool = False, infinite: bool = False, place: bool = True) -> Kind:
    """A value that is never negative; `positive`: nor 0; `infinite`: it may be `inf`; `place`: as in `varying`."""
    least = "> 0" if positive else ">= 0"
    kind = VALUE if place else VALUE_OF_TIME

    def read(given: Any) -> Value:
        if infinite and isinstance(given, float) and given == inf:
            return Value(inf)
        value = kind.read(given)
        source = value.source
        numbers = [v for _, v in source] if isinstance(source, tuple) else [source]
        low = [v for v in numbers if isinstance(v, (int, float)) and (v < 0 or (positive and v == 0))]
        if low and not (infinite and source == inf):
            raise Mistake(f"is {low[0]:g}; it must be {least}")
        return value

    bound = {"exclusiveMinimum": 0} if positive else {"minimum": 0}
    number = {"type": "number", **bound}
    row = {"type": "array", "items": [{"type": "number"}, number], "minItems": 2, "maxItems": 2}
    schema = {"anyOf": [number, _TEXT, {"type": "array", "items": row, "minItems": 1}]}
    words = f"{kind.words} {least}" + (", or inf" if infinite else "")
    return Kind(words, schema, read)


def _vector_of_time(given: Any) -> tuple[Value, ...]:
    given = _plain(given)
    if isinstance(given, (list, tuple)) and len(given) == 3 and not all(_is_row(g) for g in given):
        return _each(VALUE_OF_TIME.read, given)
    if isinstance(given, tuple) and len(given) == 1:
        given = given[0]
    return (VALUE_OF_TIME.read(given),)


def _is_row(given: Any) -> bool:
    """True for a row [t, value] of a table of times."""
    pair = isinstance(given, (list, tuple)) and len(given) == 2
    return pair and not any(isinstance(g, (list, tuple, str)) for g in given)


def _other_rotation(values: Sequence[Value], dim: int) -> str:
    if len(values) == (3 if dim == 3 else 1):
        return ""
    return "is one value; in 3d it is a vector of three" if dim == 3 else "is a vector; in a plane it is one value"


_THREE_VALUES = {"type": "array", "items": VALUE_OF_TIME.schema, "minItems": 3, "maxItems": 3}
#: a rotation or a moment: a vector of three values that depend on time in 3d, one such value in a plane
VECTOR_OF_TIME = Kind(
    "three values of time; one in a plane",
    {"anyOf": [*VALUE_OF_TIME.schema["anyOf"], _THREE_VALUES]},
    _vector_of_time,
    _other_rotation,
)


def _plain(given: Any) -> Any:
    """Return an array of numpy as lists, anything else as it is."""
    return given.tolist() if hasattr(given, "tolist") else given


def _hardening(given: Any) -> tuple[tuple[float, float], ...]:
    rows = _ROWS.read(given)
    for k, (stress, strain) in enumerate(rows):
        before = rows[k - 1] if k else None
        if not stress > 0:
            raise Mistake(f"has the yield stress {stress:g}; yield stresses are above 0", (k,))
        if before is None and strain != 0:
            raise Mistake(f"begins at a plastic strain of {strain:g}; the first row is the first yield, at 0", (k,))
        if before is not None and strain <= before[1]:
            raise Mistake(f"has the plastic strain {strain:g} after {before[1]:g}; plastic strains grow", (k,))
        if before is not None and stress < before[0]:
            message = (
                f"falls from {before[0]:g} to {stress:g}; a metal that softens is not available, since its results"
            )
            raise Mistake(f"{message} depend on the size of the cells", (k,))
    return rows


def _pressures(given: Any) -> tuple[tuple[float, float], ...]:
    rows = _PRESSURES.read(given)
    if rows[0][0] != 0:
        raise Mistake(f"begins with the pressure {rows[0][0]:g}; begin where the pressure does, at 0", (0,))
    for k, ((p, overlap), (more, further)) in enumerate(pairwise(rows)):
        if more <= p or further <= overlap:
            message = f"goes from [{p:g}, {overlap:g}] to [{more:g}, {further:g}]; pressure and overlap both grow"
            raise Mistake(message, (k + 1,))
    return rows


_PRESSURES = _several(numbers(2), "two or more rows [[pressure, overlap], ...]", 2)
#: pressures from 0 on that grow with the overlap
PRESSURES = replace(_PRESSURES, read=_pressures)
_ROWS = _several(numbers(2), "rows [[yield stress, plastic strain], ...]", 1)
#: yield stresses that do not fall, at plastic strains that grow from 0
HARDENING = replace(_ROWS, read=_hardening)


def _each(read: Callable[[Any], Any], given: Sequence[Any]) -> tuple[Any, ...]:
    """Read every item; a mistake names the item, counted from 1, and keeps its position."""
    values = []
    for k, item in enumerate(given):
        try:
            values.append(read(item))
        except Mistake as mistake:
            raise Mistake(f"has an item (number {k + 1}) that {mistake.message}", (k, *mistake.inside)) from None
    return tuple(values)
