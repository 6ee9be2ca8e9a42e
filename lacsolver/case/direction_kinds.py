"""Types of keys that name directions: axes, components of displacement, terms of equations; see `kinds`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lacmesh.errors import did_you_mean
from lacsolver.case.errors import Mistake
from lacsolver.case.kinds import GROUP, NUMBER, POINT, Choice, Kind, each, numbers, other_dimension, several, whole
from lacsolver.case.value import described

_TWO_VECTORS = several(POINT, "two vectors [[..], [..]]", 2, 2)


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
    names = each(_COMPONENT.read, given)
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
    return each(_term, given)


def _terms_misfit(terms: Sequence[Mapping[str, Any]], dim: int) -> str:
    if dim == 2 and any(term["component"] == "uz" for term in terms):
        return _OUT_OF_PLANE
    points = (other_dimension(term["at"], dim) for term in terms if "at" in term)
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
