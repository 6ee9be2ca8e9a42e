"""Types of values that keys take: pydantic reads a value from a file or from Python, and each mistake has one sentence.

Names in capitals are types; functions return the type for some limits, words or lengths.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, GetCoreSchemaHandler, Strict, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails, core_schema

from lacmesh.errors import did_you_mean
from lacsolver.case.errors import Mistake
from lacsolver.case.value import described, number_from, plain

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh

Schema = dict[str, Any]


@dataclass(frozen=True)
class Kind:
    """Type of the values of a key.

    `words`: short description, `a number > 0`. `type`: what pydantic makes of the value that `before` returns; `after`
    takes what it made. Both raise Mistake. `schema`: JSON Schema, where that of `type` does not describe the values.
    `misfit` returns what is wrong with a value in a model of 2 or 3 dimensions, "" if nothing is. `is_group`: the
    values name groups. `options`: the words that may be chosen, with the meaning of each; `kinematics`: the only ones
    that a word is for; `added`: words that a program may have added, see `case.added`.
    """

    words: str
    type: Any = Any
    before: Callable[[Any], Any] = plain
    after: Callable[[Any], Any] = lambda value: value
    schema: Schema | None = None
    misfit: Callable[[Any, int], str] = lambda value, dim: ""
    is_group: bool = False
    options: Mapping[str, str] = field(default_factory=dict)
    kinematics: Mapping[str, str] = field(default_factory=dict)
    added: Mapping[str, Any] = field(default_factory=dict)

    @property
    def known(self) -> tuple[str, ...]:
        """The words that may be chosen."""
        return (*self.options, *self.added)

    @cached_property
    def _adapter(self) -> TypeAdapter[Any]:
        return TypeAdapter(Annotated[Any, self])

    def read(self, given: Any) -> Any:
        """Return the value to store for a given one. Raises Mistake: the end of a sentence after the key's name."""
        try:
            return self._adapter.validate_python(given)
        except ValidationError as error:
            raise error.errors()[0]["ctx"]["error"] from None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_wrap_validator_function(self._made, handler.generate_schema(self.type))

    def __get_pydantic_json_schema__(self, core: core_schema.CoreSchema, handler: Callable[[Any], Schema]) -> Schema:
        return {"type": "string", "enum": list(self.known)} if self.options else self.schema or handler(core)

    def _made(self, given: Any, make: Callable[[Any], Any]) -> Any:
        given = self.before(given)
        try:
            made = make(given)
        except ValidationError as error:
            raise self._mistake(error) from None
        return self.after(made)

    def _mistake(self, error: ValidationError) -> Mistake:
        """Return the first mistake of pydantic in our words; an item is counted from 1, and its position kept."""
        one = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
        inside, takes = one["loc"], f"it takes {self.words}"
        if one["type"] == "missing":
            return Mistake(f"needs {inside[0]}; {takes}")
        if one["type"] == "extra_forbidden":
            return Mistake(f"has {inside[0]}{did_you_mean(str(inside[0]), self.type.__annotations__)}; {takes}", inside)
        mistake = _of_pydantic(one, self.words)
        if not inside:
            return mistake
        item = f"an item (number {inside[0] + 1}) that" if isinstance(inside[0], int) else f"{inside[0]}, which"
        return Mistake(f"has {item} {mistake.message}", (inside[0], *mistake.inside))


_LIMITS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")


def _of_pydantic(one: ErrorDetails, words: str) -> Mistake:
    """Return a mistake of a value that should be what the words say."""
    if one["type"] == "value_error":
        mistake: Mistake = one["ctx"]["error"]
        return mistake
    if one["type"] == "less_than" and isinstance(one["input"], int):
        return Mistake(f"is too large; it must be below {one['ctx']['lt']}")
    if one["type"] in _LIMITS:
        return Mistake(f"is {described(one['input'])}; it must be {words.partition('number ')[2]}")
    return Mistake(f"is {described(one['input'])}; it takes {words}")


def choice(
    options: Mapping[str, str], kinematics: Mapping[str, str] | None = None, added: Mapping[str, Any] | None = None
) -> Kind:
    """One word of several."""
    added = {} if added is None else added

    def read(given: Any) -> str:
        known = (*options, *added)
        if not isinstance(given, str):
            raise Mistake(f"is {described(given)}; it takes one of {', '.join(known)}")
        if given not in known:
            raise Mistake(f'is "{given[:40]}"{did_you_mean(given, known)}')
        return given

    return Kind(", ".join(options), str, read, options=options, kinematics=kinematics or {}, added=added)


def number(low: float | None = None, high: float | None = None, *, open: bool = True) -> Kind:
    """A finite number between limits, which are excluded if `open`."""
    limits = Field(gt=low, lt=high) if open else Field(ge=low, le=high)
    less, more = ("<", ">") if open else ("<=", ">=")
    words = " and ".join(f"{sign} {end:g}" for sign, end in ((more, low), (less, high)) if end is not None)
    return Kind(f"a number {words}".strip(), Annotated[float, limits], number_from)


NUMBER = number()
POSITIVE = number(low=0)
NOT_NEGATIVE = number(low=0, open=False)
FLAG = Kind("true or false", Annotated[bool, Strict()])
TEXT = Annotated[str, Field(min_length=1)]


def _whole(given: Any) -> int:
    given = plain(given)
    if isinstance(given, bool) or not isinstance(given, int):
        raise Mistake(f"is {described(given)}; it takes a whole number")
    return given


def whole(least: int) -> Kind:
    """A whole number from `least` on."""
    return Kind(f"a whole number >= {least}", Annotated[int, Field(ge=least, lt=2**31)], _whole)


def text(what: str) -> Kind:
    """A text that is not empty; `what` describes it in messages."""

    def read(given: Any) -> str:
        if not isinstance(given, str):
            raise Mistake(f"is {described(given)}; it takes {what}, as text")
        if not given.strip() or not given.isprintable():
            raise Mistake(f"is empty or cannot be printed; it takes {what}")
        return given

    return Kind(what, TEXT, read)


def _units(given: str) -> str:
    names = [name.strip() for name in given.split(",")]
    if len(names) not in (3, 4) or not all(names):
        raise Mistake(f'is "{given[:40]}"; it takes {UNITS.words}')
    return ", ".join(names)


UNITS = replace(
    text('names for force, length, stress and, if wanted, time, as "N, mm, MPa" or "N, mm, MPa, s"'), after=_units
)


def _mesh(given: Any) -> Path | Mesh:
    loaded = sys.modules.get("lacmesh.mesh")  # a file has no mesh in it, and reading one needs no numpy
    if loaded is not None and isinstance(given, loaded.Mesh):
        return given
    return given if isinstance(given, Path) else Path(text("a path").read(given))


#: a path to a mesh, which `read_case` makes relative to the case's file; from Python also a mesh
MESH_FILE = Kind("a path, relative to the case's file", before=_mesh, schema={"type": "string", "minLength": 1})

_GROUP_NAME = text("the name of a group")


def _group(given: Any) -> str:
    if isinstance(given, int) and not isinstance(given, bool) and given >= 0:
        return str(whole(0).read(given))
    return _GROUP_NAME.before(given)


#: a group of the mesh, by name, or by tag in an msh file (`5`, `"2:5"`)
GROUP = Kind(
    "a group", str, _group, is_group=True,
    schema={"anyOf": [{"type": "string", "minLength": 1}, {"type": "integer", "minimum": 0}]},
)  # fmt: skip


def items(item: Any, least: int = 0, most: int | None = None) -> Any:
    """Return the type of `least` to `most` values of a kind."""
    return Annotated[tuple[Annotated[Any, item], ...], Field(min_length=least, max_length=most)]


def _list_of_groups(given: Any) -> Any:
    if not isinstance(given, (list, tuple)):
        example = f'["{given}"]' if isinstance(given, str) and given.isprintable() else '["a", "b"]'
        raise Mistake(f"is {described(given)}; it takes a list of groups, as {example}")
    if not given:
        raise Mistake("is an empty list; remove the key if the whole mesh is meant")
    return given


def distinct(names: tuple[str, ...], what: str = "the group") -> tuple[str, ...]:
    """Return some names. Raises Mistake if one is there twice."""
    if len(set(names)) < len(names):
        raise Mistake(f"names {what} {next(n for n in names if names.count(n) > 1)!r} twice")
    return names


def _two_groups(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(distinct(names)) != 2:
        raise Mistake(f'has {len(names)} groups; it takes two, as ["a", "b"]')
    return tuple(sorted(names))


GROUPS = Kind("a list of groups", items(GROUP, 1), _list_of_groups, distinct, is_group=True)
#: two groups, whose order does not count: they are read in that of the alphabet
TWO_GROUPS = replace(
    GROUPS, words="a list of two groups", after=_two_groups,
    schema={"type": "array", "items": GROUP.schema, "minItems": 2, "maxItems": 2},
)  # fmt: skip

NUMBER_TABLE = Kind(
    "a table of numbers, { a = 1.0, b = 2.0 }", Annotated[dict[str, Annotated[Any, NUMBER]], Field(min_length=1)]
)


def schema_of(kind: Any) -> Schema:
    """Return the JSON Schema of a type."""
    return TypeAdapter(Annotated[Any, kind]).json_schema()


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


_ABOVE_0 = {"type": "number", "exclusiveMinimum": 0}
#: a number, or a table of numbers by groups of cells
THICKNESS = Kind(
    "a number > 0, or { group = number, ... }", before=_thickness, is_group=True,
    schema={"anyOf": [_ABOVE_0, {"type": "object", "additionalProperties": _ABOVE_0, "minProperties": 1}]},
)  # fmt: skip


def several(item: Kind, words: str, least: int, most: int | None = None) -> Kind:
    """A list of `least` to `most` values."""

    def read(given: Any) -> Any:
        given = plain(given)
        if not isinstance(given, (list, tuple)) or not least <= len(given) <= (most or len(given)):
            raise Mistake(f"is {described(given)}; it takes {words}")
        return given

    return Kind(words, items(item, least, most), read)


def numbers(how_many: int, item: Kind = NUMBER) -> Kind:
    """Two or three numbers."""
    word = {2: "two", 3: "three"}[how_many]
    return several(item, item.words.replace("a number", f"{word} numbers"), how_many, how_many)


def one_or_three(item: Kind = NUMBER) -> Kind:
    """A single number, or three."""
    three = several(item, f"{item.words}, or three", 3, 3)

    def read(given: Any) -> Any:
        given = plain(given)
        return three.read(given) if isinstance(given, (list, tuple)) else item.read(given)

    return Kind(three.words, before=read, schema={"anyOf": [schema_of(item), schema_of(three)]})


def other_dimension(point: Sequence[float], dim: int) -> str:
    """Return what is wrong with a point in a model of 2 or 3 dimensions, "" if nothing is."""
    where = "3d" if dim == 3 else "a plane model"
    return "" if len(point) == dim else f"has {len(point)} coordinates; {where} has {dim}"


#: a point: one coordinate for each dimension of the model
POINT = replace(several(NUMBER, "[x, y, z]; [x, y] in a plane", 2, 3), misfit=other_dimension)
