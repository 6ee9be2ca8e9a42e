"""Types of keys whose values vary with time and place, or come as tables: values, weights, curves; see `kinds`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf
from typing import Any

from lacsolver.case.errors import Mistake
from lacsolver.case.formula import Formula
from lacsolver.case.kinds import POSITIVE, Kind, numbers, schema_of, several
from lacsolver.case.value import Value, plain, value_from

Rows = tuple[tuple[float, float], ...]


def _increasing(times: tuple[float, ...]) -> tuple[float, ...]:
    for k, (before, after) in enumerate(pairwise(times)):
        if after <= before:
            raise Mistake(f"has {after:g} after {before:g}; times must increase", (k + 1,))
    return times


#: times that increase, all after 0
TIMES = replace(several(POSITIVE, "a list of increasing times > 0", 1), after=_increasing)


def varying(*, place: bool = True, normals: bool = False, least: str = "", infinite: bool = False) -> Kind:
    """A number, a formula, a table of times, or a function.

    `place`: True if it may depend on x, y, z; `normals`: True if a function takes normals too; `least`: `>= 0` or `> 0`
    for numbers that are not negative, or positive; `infinite`: True if the number may be `inf`.
    """

    def read(given: Any) -> Value:
        stored = given.source if isinstance(given, Value) else given
        if infinite and isinstance(stored, float) and stored == inf:
            return Value(inf)
        source = value_from(given)
        if not place and isinstance(source, Formula) and source.variables & {"x", "y", "z"}:
            raise Mistake("depends on x, y or z, and is one value for a whole body; write a formula of t")
        numbers = [v for _, v in source] if isinstance(source, tuple) else [source]
        low = [v for v in numbers if isinstance(v, (int, float)) and (v < 0 or (least == "> 0" and v == 0))]
        if least and low:
            raise Mistake(f"is {low[0]:g}; it must be {least}")
        value = given if isinstance(given, Value) else Value(source)
        return replace(value, takes_normals=normals and callable(source), placeless=not place)

    words = f"a value{'' if place else ' of time'} {least}".rstrip() + (", or inf" if infinite else "")
    number = {"type": "number", **{"> 0": {"exclusiveMinimum": 0}, ">= 0": {"minimum": 0}}.get(least, {})}
    row = {"type": "array", "items": [{"type": "number"}, number], "minItems": 2, "maxItems": 2}
    schema = {"anyOf": [number, {"type": "string", "minLength": 1}, {"type": "array", "items": row, "minItems": 1}]}
    return Kind(words, before=read, schema=schema)


VALUE = varying()
VALUE_OF_TIME = varying(place=False)


_WEIGHT_ROWS = several(numbers(2), "a formula of x, y, z, or a list [[node, weight], ...]", 1)


def _weights(given: Any) -> Value | Rows:
    given = plain(given)
    if not isinstance(given, (list, tuple)):
        value: Value = VALUE.before(given)
        if isinstance(value.source, Formula) and "t" in value.source.variables:
            raise Mistake("depends on t, and weights are those of the undeformed nodes; write a formula of x, y, z")
        return value
    if not given:
        raise Mistake(f"is an empty list; it takes {WEIGHTS.words}")
    rows: Rows = _WEIGHT_ROWS.read(given)
    if odd := [row for row in rows if row[0] != int(row[0]) or row[0] < 0]:
        raise Mistake(f"is of node {odd[0][0]:g}; it takes {WEIGHTS.words}")
    if len({number for number, _ in rows}) < len(rows):
        raise Mistake("names a node twice")
    return rows


#: weights of nodes
WEIGHTS = Kind(
    _WEIGHT_ROWS.words, before=_weights,
    schema={"anyOf": [{"type": "number"}, {"type": "string", "minLength": 1}, schema_of(_WEIGHT_ROWS)]},
)  # fmt: skip

#: a component of a rotation that is neither prescribed nor held
FREE = "free"
_COMPONENT = Kind("a value of time", before=lambda given: FREE if given == FREE else VALUE_OF_TIME.before(given))
_THREE_VALUES = several(VALUE_OF_TIME, "three values of time; one in a plane", 3, 3)
_COMPONENTS = several(_COMPONENT, 'three values of time, each may be "free"; one in a plane', 3, 3)


def _is_row(given: Any) -> bool:
    """True for a row [t, value] of a table of times."""
    pair = isinstance(given, (list, tuple)) and len(given) == 2
    return pair and not any(isinstance(g, (list, tuple, str)) for g in given)


def _vector_of_time(given: Any) -> tuple[Value, ...]:
    given = plain(given)
    if isinstance(given, (list, tuple)) and len(given) == 3 and not all(map(_is_row, given)):
        values: tuple[Value, ...] = _THREE_VALUES.read(given)
        return values
    if isinstance(given, tuple) and len(given) == 1:
        given = given[0]
    return (VALUE_OF_TIME.before(given),)


def _rotation(given: Any) -> tuple[Value | str, ...]:
    given = plain(given)
    items = given if isinstance(given, (list, tuple)) else (given,)
    if not any(isinstance(item, str) and item == FREE for item in items):
        return _vector_of_time(given)
    values: tuple[Value | str, ...] = (FREE,) if len(items) == 1 else _COMPONENTS.read(given)
    return values


def _other_rotation(values: Sequence[Any], dim: int) -> str:
    if len(values) == (3 if dim == 3 else 1):
        return ""
    return (
        "is one value; a 3d model needs a vector of three" if dim == 3 else "is a vector; a plane model needs one value"
    )


_VECTOR = {"anyOf": [*(VALUE_OF_TIME.schema or {})["anyOf"], schema_of(_THREE_VALUES)]}
#: a rotation or a moment: a vector of three values that depend on time in 3d, one such value in a plane
VECTOR_OF_TIME = Kind(_THREE_VALUES.words, before=_vector_of_time, schema=_VECTOR, misfit=_other_rotation)
#: a rotation of which some components may be free
ROTATION = Kind(_COMPONENTS.words, before=_rotation, schema=_VECTOR, misfit=_other_rotation)


def _yield_stresses(rows: Rows) -> Rows:
    for k, (stress, strain) in enumerate(rows):
        before = rows[k - 1] if k else None
        if not stress > 0:
            raise Mistake(f"has the yield stress {stress:g}; yield stresses must be above 0", (k,))
        if before is None and strain != 0:
            raise Mistake(f"begins at a plastic strain of {strain:g}; the first row must be at 0", (k,))
        if before is not None and strain <= before[1]:
            raise Mistake(f"has the plastic strain {strain:g} after {before[1]:g}; plastic strains must increase", (k,))
        if before is not None and stress < before[0]:
            falls = f"falls from {before[0]:g} to {stress:g}; a metal that softens is not available"
            raise Mistake(f"{falls}, since its results depend on the size of the cells", (k,))
    return rows


def _rising(rows: Rows) -> Rows:
    if rows[0][0] != 0:
        raise Mistake(f"begins with the pressure {rows[0][0]:g}; the first pressure must be 0", (0,))
    for k, ((p, overlap), (more, further)) in enumerate(pairwise(rows)):
        if more <= p or further <= overlap:
            message = (
                f"goes from [{p:g}, {overlap:g}] to [{more:g}, {further:g}]; pressure and overlap must both increase"
            )
            raise Mistake(message, (k + 1,))
    return rows


#: pressures from 0 on that grow with the overlap
PRESSURES = replace(several(numbers(2), "two or more rows [[pressure, overlap], ...]", 2), after=_rising)
#: yield stresses that do not fall, at plastic strains that grow from 0
HARDENING = replace(several(numbers(2), "rows [[yield stress, plastic strain], ...]", 1), after=_yield_stresses)
