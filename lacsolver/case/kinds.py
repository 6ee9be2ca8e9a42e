# ruff: noqa: D102 (Kind says what each method of a kind does)
"""Types of values that keys take: each reads a value from a file or from Python, and describes itself.

A type describes itself in words and in JSON Schema. `read` returns the value that a record stores, or raises Mistake
with the end of a sentence that begins with the key's name.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from lacmesh.errors import did_you_mean
from lacsolver.case.errors import Mistake
from lacsolver.case.formula import Formula
from lacsolver.case.value import Value, described, number_from, value_from

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh

Schema = dict[str, Any]


class KeyType(Protocol):
    """Interface of the types of values."""

    @property
    def words(self) -> str:
        """Short description: `a number > 0`."""

    def read(self, given: Any) -> Any:
        """Return the value to store for a given value. Raises Mistake."""

    def schema(self) -> Schema:
        """Return the description in JSON Schema."""


@dataclass(frozen=True)
class Bounds:
    """Interval that a number must lie in; None for an end without limit. `open`: True if the ends are excluded."""

    low: float | None = None
    high: float | None = None
    open: bool = True

    @property
    def words(self) -> str:
        """Description of the limits: `> 0`, or an empty string."""
        less, more = ("<", ">") if self.open else ("<=", ">=")
        parts = [f"{more} {self.low:g}"] if self.low is not None else []
        parts += [f"{less} {self.high:g}"] if self.high is not None else []
        return " and ".join(parts)

    def check(self, number: float) -> None:
        """Raise Mistake for a number outside the interval."""
        below = self.low is not None and (number <= self.low if self.open else number < self.low)
        above = self.high is not None and (number >= self.high if self.open else number > self.high)
        if below or above:
            raise Mistake(f"is {number:g}; it must be {self.words}")

    def schema(self) -> Schema:
        """Return the limits in JSON Schema."""
        low, high = ("exclusiveMinimum", "exclusiveMaximum") if self.open else ("minimum", "maximum")
        return {name: end for name, end in ((low, self.low), (high, self.high)) if end is not None}


FREE = Bounds()
POSITIVE = Bounds(low=0)
NOT_NEGATIVE = Bounds(low=0, open=False)


@dataclass(frozen=True)
class Number:
    """A finite number within bounds."""

    bounds: Bounds = FREE

    @property
    def words(self) -> str:
        return f"a number {self.bounds.words}".strip()

    def read(self, given: Any) -> float:
        number = number_from(given)
        self.bounds.check(number)
        return number

    def schema(self) -> Schema:
        return {"type": "number", **self.bounds.schema()}


@dataclass(frozen=True)
class Count:
    """A whole number from `least` on."""

    least: int

    @property
    def words(self) -> str:
        return f"a whole number >= {self.least}"

    def read(self, given: Any) -> int:
        if isinstance(given, bool) or not isinstance(given, int):
            raise Mistake(f"is {described(given)}; it takes a whole number")
        if given < self.least:
            raise Mistake(f"is {given}; it must be >= {self.least}")
        if given >= 2**31:
            raise Mistake("is a whole number too large to be meant; it must be below 2147483648")
        return given

    def schema(self) -> Schema:
        return {"type": "integer", "minimum": self.least, "exclusiveMaximum": 2**31}


@dataclass(frozen=True)
class Flag:
    """True or false."""

    words = "true or false"

    def read(self, given: Any) -> bool:
        if not isinstance(given, bool):
            raise Mistake(f"is {described(given)}; it takes true or false")
        return given

    def schema(self) -> Schema:
        return {"type": "boolean"}


@dataclass(frozen=True)
class Text:
    """A text that is not empty; `what` describes it in messages."""

    what: str = "a text"

    @property
    def words(self) -> str:
        return self.what

    def read(self, given: Any) -> str:
        if not isinstance(given, str):
            raise Mistake(f"is {described(given)}; it takes {self.what}, as text")
        if not given.strip() or not given.isprintable():
            raise Mistake(f"is empty or cannot be printed; it takes {self.what}")
        return given

    def schema(self) -> Schema:
        return {"type": "string", "minLength": 1}


@dataclass(frozen=True)
class MeshFile:
    """A path to a mesh, which `read_case` makes relative to the case's file; from Python also a mesh."""

    words = "a path, relative to the case's file"

    def read(self, given: Any) -> Path | Mesh:
        loaded = sys.modules.get("lacmesh.mesh")  # a file has no mesh in it, and reading one needs no numpy
        if loaded is not None and isinstance(given, loaded.Mesh):
            return given
        return given if isinstance(given, Path) else Path(Text("a path").read(given))

    def schema(self) -> Schema:
        return {"type": "string", "minLength": 1}


@dataclass(frozen=True)
class Group:
    """A group of the mesh, by name, or by tag in an msh file (`5`, `"2:5"`)."""

    words = "a group"

    def read(self, given: Any) -> str:
        if isinstance(given, int) and not isinstance(given, bool) and given >= 0:
            return str(Count(0).read(given))
        return Text("the name of a group").read(given)

    def schema(self) -> Schema:
        return {"anyOf": [{"type": "string", "minLength": 1}, {"type": "integer", "minimum": 0}]}


@dataclass(frozen=True)
class Groups:
    """A list of groups."""

    words = "a list of groups"

    def read(self, given: Any) -> tuple[str, ...]:
        if not isinstance(given, (list, tuple)):
            example = f'["{given}"]' if isinstance(given, str) and given.isprintable() else '["a", "b"]'
            raise Mistake(f"is {described(given)}; it takes a list of groups, as {example}")
        if not given:
            raise Mistake("is an empty list; leave the key out where the whole mesh is meant")
        names = _each(Group().read, given)
        if len(set(names)) < len(names):
            raise Mistake(f"names the group {next(n for n in names if names.count(n) > 1)!r} twice")
        return names

    def schema(self) -> Schema:
        return {"type": "array", "items": Group().schema(), "minItems": 1}


@dataclass(frozen=True)
class TwoGroups(Groups):
    """Two groups, whose order does not count: they are read in that of the alphabet."""

    words = "a list of two groups"

    def read(self, given: Any) -> tuple[str, ...]:
        names = super().read(given)
        if len(names) != 2:
            raise Mistake(f'has {len(names)} groups; it takes two, as ["a", "b"]')
        return tuple(sorted(names))

    def schema(self) -> Schema:
        return {**super().schema(), "minItems": 2, "maxItems": 2}


@dataclass(frozen=True)
class Option:
    """One of the words that a key takes, its meaning, and the kinematics for which it is allowed."""

    word: str
    meaning: str
    kinematics: str = "any"


@dataclass(frozen=True)
class Choice:
    """One word of several. `added`: others that a program may have added, see `case.added`."""

    options: tuple[Option, ...]
    added: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @property
    def known(self) -> tuple[str, ...]:
        """The words that may be chosen."""
        return (*(option.word for option in self.options), *self.added)

    @property
    def words(self) -> str:
        return ", ".join(self.known)

    def read(self, given: Any) -> str:
        if not isinstance(given, str):
            raise Mistake(f"is {described(given)}; it takes one of {self.words}")
        if given not in self.known:
            raise Mistake(f'is "{given[:40]}"{did_you_mean(given, self.known)}')
        return given

    def schema(self) -> Schema:
        return {"type": "string", "enum": list(self.known)}


@dataclass(frozen=True)
class NumberTable:
    """A table of numbers by name."""

    words = "a table of numbers, { a = 1.0, b = 2.0 }"

    def read(self, given: Any) -> dict[str, float]:
        if not isinstance(given, Mapping) or not given:
            raise Mistake(f"is {described(given)}; it takes {self.words}")
        return {str(name): number_from(value) for name, value in given.items()}

    def schema(self) -> Schema:
        return {"type": "object", "additionalProperties": {"type": "number"}, "minProperties": 1}


@dataclass(frozen=True)
class ThreeNumbers:
    """Three numbers, or, if `alone`, a single number too."""

    bounds: Bounds = FREE
    alone: bool = True

    @property
    def words(self) -> str:
        return f"{Number(self.bounds).words}, or three" if self.alone else f"three numbers {self.bounds.words}".strip()

    def read(self, given: Any) -> float | tuple[float, ...]:
        if self.alone and not isinstance(given, (list, tuple)):
            return Number(self.bounds).read(given)
        if not isinstance(given, (list, tuple)) or len(given) != 3:
            raise Mistake(f"is {described(given)}; it takes {self.words}")
        return _each(Number(self.bounds).read, given)

    def schema(self) -> Schema:
        number = Number(self.bounds).schema()
        three = {"type": "array", "items": number, "minItems": 3, "maxItems": 3}
        return {"anyOf": [number, three]} if self.alone else three


@dataclass(frozen=True)
class TwoNumbers:
    """Two numbers within bounds."""

    bounds: Bounds = FREE

    @property
    def words(self) -> str:
        return f"two numbers {self.bounds.words}".strip()

    def read(self, given: Any) -> tuple[float, ...]:
        if not isinstance(given, (list, tuple)) or len(given) != 2:
            raise Mistake(f"is {described(given)}; it takes {self.words}")
        return _each(Number(self.bounds).read, given)

    def schema(self) -> Schema:
        return {"type": "array", "items": Number(self.bounds).schema(), "minItems": 2, "maxItems": 2}


@dataclass(frozen=True)
class Point:
    """A point: one coordinate for each dimension of the model (checked once the model is known)."""

    words = "[x, y, z]; [x, y] in a plane"

    def read(self, given: Any) -> tuple[float, ...]:
        given = given.tolist() if hasattr(given, "tolist") else given
        if not isinstance(given, (list, tuple)) or len(given) not in (2, 3):
            raise Mistake(f"is {described(given)}; it takes {self.words}")
        return _each(number_from, given)

    def schema(self) -> Schema:
        return {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}


@dataclass(frozen=True)
class Axes:
    """Two vectors that are not parallel."""

    words = "two vectors [[..], [..]]"

    def read(self, given: Any) -> tuple[tuple[float, ...], ...]:
        given = given.tolist() if hasattr(given, "tolist") else given
        if not isinstance(given, (list, tuple)) or len(given) != 2:
            raise Mistake(f"is {described(given)}; it takes {self.words}")
        a, b = _each(Point().read, given)
        if len(a) != len(b):
            raise Mistake("has vectors of different dimensions")
        (ax, ay, az), (bx, by, bz) = ((*v, 0.0)[:3] for v in (a, b))
        cross = (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
        aa, bb, cc = (sum(c * c for c in v) for v in (a, b, cross))
        if not cc > 1e-12 * aa * bb:
            raise Mistake("has vectors that lie on one line; give two that span the plane of axes 1 and 2")
        return a, b

    def schema(self) -> Schema:
        return {"type": "array", "items": Point().schema(), "minItems": 2, "maxItems": 2}


@dataclass(frozen=True)
class Times:
    """Times that increase, all after 0."""

    words = "a list of increasing times > 0"

    def read(self, given: Any) -> tuple[float, ...]:
        given = given.tolist() if hasattr(given, "tolist") else given
        if not isinstance(given, (list, tuple)) or not given:
            raise Mistake(f"is {described(given)}; it takes {self.words}")
        times = _each(Number(POSITIVE).read, given)
        for k, (before, after) in enumerate(pairwise(times)):
            if after <= before:
                raise Mistake(f"has {after:g} after {before:g}; times increase", (k + 1,))
        return times

    def schema(self) -> Schema:
        return {"type": "array", "items": {"type": "number", **POSITIVE.schema()}, "minItems": 1}


@dataclass(frozen=True)
class Varying:
    """A number, a formula, a table of times, or a function.

    `place`: True if it may depend on x, y, z; `normals`: True if a function takes normals too.
    """

    place: bool = True
    normals: bool = False

    @property
    def words(self) -> str:
        return "a value" if self.place else "a value of time"

    def read(self, given: Any) -> Value:
        source = value_from(given)
        if not self.place and isinstance(source, Formula) and source.variables & {"x", "y", "z"}:
            raise Mistake("depends on x, y or z; it is one value for a whole body, so write a formula of t")
        made = given if isinstance(given, Value) else Value(source)
        return replace(made, takes_normals=self.normals and callable(source), placeless=not self.place)

    def schema(self) -> Schema:
        row = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
        table = {"type": "array", "items": row, "minItems": 1}
        return {"anyOf": [{"type": "number"}, {"type": "string", "minLength": 1}, table]}


@dataclass(frozen=True)
class Turning:
    """A rotation or a moment: a vector of three values that depend on time in 3d, one such value in a plane."""

    words = "three values of time; one in a plane"

    def read(self, given: Any) -> tuple[Value, ...]:
        given = given.tolist() if hasattr(given, "tolist") else given
        if isinstance(given, (list, tuple)) and len(given) == 3 and not all(_is_row(g) for g in given):
            return _each(Varying(place=False).read, given)
        if isinstance(given, tuple) and len(given) == 1:
            given = given[0]
        return (Varying(place=False).read(given),)

    def schema(self) -> Schema:
        one = Varying(place=False).schema()
        return {"anyOf": [*one["anyOf"], {"type": "array", "items": one, "minItems": 3, "maxItems": 3}]}


@dataclass(frozen=True)
class Reserved:
    """A reserved key, whose only value is 0 until the feature exists."""

    why: str
    words = "0"

    def read(self, given: Any) -> float:
        if number_from(given) != 0:
            raise Mistake(f"is {described(given)}; {self.why}")
        return 0.0

    def schema(self) -> Schema:
        return {"const": 0}


def _is_row(given: Any) -> bool:
    """True for a row [t, value] of a table of times."""
    numbers = isinstance(given, (list, tuple)) and len(given) == 2
    return numbers and not any(isinstance(g, (list, tuple, str)) for g in given)


def _each(read: Callable[[Any], Any], given: Sequence[Any]) -> tuple[Any, ...]:
    """Read every item; a mistake names the item, counted from 1, and keeps its position."""
    made = []
    for k, item in enumerate(given):
        try:
            made.append(read(item))
        except Mistake as mistake:
            raise Mistake(f"has an item (number {k + 1}) that {mistake.message}", (k, *mistake.inside)) from None
    return tuple(made)
