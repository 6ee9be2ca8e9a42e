"""Types of keys that name directions: axes, components of displacement, terms of equations; see `kinds`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, NotRequired

from pydantic import ConfigDict, with_config
from typing_extensions import TypedDict

from lacsolver.case.errors import Mistake
from lacsolver.case.kinds import (
    GROUP,
    NUMBER,
    POINT,
    Kind,
    Schema,
    choice,
    distinct,
    items,
    numbers,
    other_dimension,
    schema_of,
    several,
    whole,
)

Vectors = tuple[tuple[float, ...], ...]


def _spanning(vectors: Vectors) -> Vectors:
    """Return two vectors. Raises Mistake if they span no plane."""
    a, b = vectors
    if len(a) != len(b):
        raise Mistake("has vectors of different dimensions")
    (ax, ay, az), (bx, by, bz) = ((*v, 0.0)[:3] for v in (a, b))
    cross = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    aa, bb, cc = (sum(c * c for c in v) for v in (a, b, cross))
    if not cc > 1e-12 * aa * bb:
        raise Mistake("has vectors that lie on one line; give two that span the plane of axes 1 and 2")
    return vectors


def _out_of_plane(axes: Sequence[Sequence[float]], dim: int) -> str:
    if dim == 3:
        return "" if len(axes[0]) == 3 else "has vectors of 2 components; 3d has 3"
    outside = any(any(v[2:]) for v in axes)
    return "has vectors out of the plane of the model; give axes 1 and 2 in it" if outside else ""


#: two vectors that are not parallel
AXES = replace(several(POINT, "two vectors [[..], [..]]", 2, 2), after=_spanning, misfit=_out_of_plane)

_X_OR_AXIS: Schema = {"oneOf": [{"required": ["x"]}, {"required": ["origin", "axis"]}]}


@with_config(ConfigDict(extra="forbid", json_schema_extra=_X_OR_AXIS))
class _Axes(TypedDict):
    origin: NotRequired[Annotated[Any, POINT]]
    x: NotRequired[Annotated[Any, POINT]]
    xy: NotRequired[Annotated[Any, POINT]]
    axis: NotRequired[Annotated[Any, numbers(3)]]


def _local_axes(axes: dict[str, Any]) -> dict[str, Any]:
    if ("x" in axes) == ("axis" in axes):
        raise Mistake(f"needs x, or axis, and not both; it takes {LOCAL_AXES.words}")
    if "axis" in axes:
        if "xy" in axes or "origin" not in axes:
            raise Mistake(f"is cylindrical, so it needs origin and axis, and no xy; it takes {LOCAL_AXES.words}")
        if not any(axes["axis"]):
            raise Mistake("has an axis of length 0; give its direction")
    elif not any(axes["x"]):
        raise Mistake("has an x of length 0; give its direction")
    elif "xy" in axes:
        _spanning((axes["x"], axes["xy"]))
    return axes


def _axes_misfit(axes: Mapping[str, Any], dim: int) -> str:
    short = [name for name in ("origin", "x", "xy") if name in axes and len(axes[name]) != dim]
    if short:
        return f"has {short[0]} of {len(axes[short[0]])} components; the model has {dim}"
    if dim == 3:
        return "" if "axis" in axes or "xy" in axes else "needs xy, a second vector in the plane of x and y"
    turned = any(axes.get("axis", ())[:2])
    return "has an axis that is not z, the only one in a plane model; write axis = [0, 0, 1]" if turned else ""


#: local axes: Cartesian, or cylindrical
LOCAL_AXES = Kind(
    "{ x = [..], xy = [..] }, or cylindrical { origin = [..], axis = [..] }", _Axes, after=_local_axes,
    misfit=_axes_misfit,
)  # fmt: skip

_COMPONENT = choice({"ux": "along x", "uy": "along y", "uz": "along z"})
_OUT_OF_PLANE = "has uz, which a plane model does not have"


#: components of displacement
COMPONENTS = Kind(
    'a list of components, as ["ux", "uy"]', items(_COMPONENT, 1),
    after=lambda names: distinct(names, "the component"),
    schema={"type": "array", "items": schema_of(_COMPONENT), "minItems": 1, "uniqueItems": True},
    misfit=lambda names, dim: _OUT_OF_PLANE if dim == 2 and "uz" in names else "",
)  # fmt: skip

GROUP_KIND = choice({"cell": "a group of cells", "node": "a group of nodes"})
_ONE_PLACE: Schema = {"oneOf": [{"required": [name]} for name in ("node", "group", "at")]}


@with_config(ConfigDict(extra="forbid", json_schema_extra=_ONE_PLACE))
class _Term(TypedDict):
    factor: Annotated[float, replace(NUMBER, schema={"type": "number", "not": {"const": 0}})]
    component: Annotated[str, _COMPONENT]
    node: NotRequired[Annotated[int, whole(0)]]
    group: NotRequired[Annotated[str, GROUP]]
    kind: NotRequired[Annotated[str, GROUP_KIND]]
    at: NotRequired[Annotated[Any, POINT]]


def _one_place(term: dict[str, Any]) -> dict[str, Any]:
    if sum(name in term for name in ("node", "group", "at")) != 1:
        raise Mistake(f"needs one of node, group, at; it takes {_TERM.words}")
    if "kind" in term and "group" not in term:
        raise Mistake("has a kind, which only a group has; remove it")
    if not term["factor"]:
        raise Mistake("has the factor 0; remove the term")
    return term


def _terms_misfit(terms: Sequence[Mapping[str, Any]], dim: int) -> str:
    if dim == 2 and any(term["component"] == "uz" for term in terms):
        return _OUT_OF_PLANE
    points = (other_dimension(term["at"], dim) for term in terms if "at" in term)
    return next((f"has a term whose at {words}" for words in points if words), "")


_TERM = Kind('{ factor = 1.0, component = "ux", node = 12 } (or group = "..", or at = [..])', _Term, after=_one_place)
#: the terms of an equation
TERMS = replace(several(_TERM, f"a list of {_TERM.words}", 1), misfit=_terms_misfit, is_group=True)
