"""Types of keys whose values vary with time and place, or come as tables: values, weights, curves; see `kinds`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf
from typing import Any

from lacsolver.case.errors import Mistake
from lacsolver.case.formula import Formula
from lacsolver.case.kinds import POSITIVE, TEXT, Kind, each, numbers, plain, several
from lacsolver.case.value import Value, described, value_from

_POSITIVE_TIMES = several(POSITIVE, "a list of increasing times > 0", 1)


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
    return Kind("a value" if place else "a value of time", {"anyOf": [{"type": "number"}, TEXT, table]}, read)


VALUE = varying()
VALUE_OF_TIME = varying(place=False)


def _weights(given: Any) -> Any:
    given = plain(given)
    if not isinstance(given, (list, tuple)):
        value = VALUE.read(given)
        if isinstance(value.source, Formula) and "t" in value.source.variables:
            raise Mistake("depends on t; weights are of the undeformed nodes")
        return value
    rows = each(numbers(2).read, given)
    odd = [row for row in rows if row[0] != int(row[0]) or row[0] < 0]
    if odd or not rows:
        raise Mistake(f"is {'an empty list' if not rows else f'of node {odd[0][0]:g}'}; it takes {WEIGHTS.words}")
    if len({number for number, _ in rows}) < len(rows):
        raise Mistake("names a node twice")
    return rows


#: weights of nodes
WEIGHTS = Kind(
    "a formula of x, y, z, or a list [[node, weight], ...]",
    {"anyOf": [{"type": "number"}, TEXT, {"type": "array", "items": numbers(2).schema, "minItems": 1}]},
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
    schema = {"anyOf": [number, TEXT, {"type": "array", "items": row, "minItems": 1}]}
    words = f"{kind.words} {least}" + (", or inf" if infinite else "")
    return Kind(words, schema, read)


def _vector_of_time(given: Any) -> tuple[Value, ...]:
    given = plain(given)
    if isinstance(given, (list, tuple)) and len(given) == 3 and not all(_is_row(g) for g in given):
        return each(VALUE_OF_TIME.read, given)
    if isinstance(given, tuple) and len(given) == 1:
        given = given[0]
    return (VALUE_OF_TIME.read(given),)


def _is_row(given: Any) -> bool:
    """True for a row [t, value] of a table of times."""
    pair = isinstance(given, (list, tuple)) and len(given) == 2
    return pair and not any(isinstance(g, (list, tuple, str)) for g in given)


def _other_rotation(values: Sequence[Any], dim: int) -> str:
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


def _rotation(given: Any) -> tuple[Value | str, ...]:
    given = plain(given)
    items = given if isinstance(given, (list, tuple)) and any(item == FREE for item in given) else (given,)
    if not any(isinstance(item, str) and item == FREE for item in items):
        return _vector_of_time(given)
    if len(items) not in (1, 3):
        raise Mistake(f"is {described(given)}; it takes {ROTATION.words}")
    return each(lambda item: FREE if item == FREE else VALUE_OF_TIME.read(item), items)


#: a component of a rotation that is neither prescribed nor held
FREE = "free"
#: a rotation of which some components may be free
ROTATION = Kind(
    'three values of time, each may be "free"; one in a plane', VECTOR_OF_TIME.schema, _rotation, _other_rotation
)


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


_PRESSURES = several(numbers(2), "two or more rows [[pressure, overlap], ...]", 2)
#: pressures from 0 on that grow with the overlap
PRESSURES = replace(_PRESSURES, read=_pressures)
_ROWS = several(numbers(2), "rows [[yield stress, plastic strain], ...]", 1)
#: yield stresses that do not fall, at plastic strains that grow from 0
HARDENING = replace(_ROWS, read=_hardening)
