"""The table of keys: each key is a field of a record, and its row of the table is stored with the field.

    young: float = key(POSITIVE, "stress", "Young's modulus")

The record's field has the key's name and default; `Key` has the other columns. The reader, `validate`, the schemas, the
page of docs and the checks of records made from Python all read these rows, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import MISSING
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from pydantic import Field, GetCoreSchemaHandler, ValidationInfo
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, PydanticOmit, core_schema

from lacsolver.case.kinds import Kind, Schema
from lacsolver.case.value import Value, ValueLike

MODELS = ("3d", "plane_strain", "plane_stress", "axisymmetric")
PLANE = MODELS[1:]
#: kinematics of a key or an option that is valid for all kinematics
ANY = "any"


class Needs(NamedTuple):
    """Condition for a key to have a meaning: another `key` has one of these `values` (also by default).

    `added`: True if values that a program has added (`case.added`) will do as well.
    """

    key: str
    values: tuple[str, ...]
    added: bool = False


if TYPE_CHECKING:
    _Stored = TypeVar("_Stored", covariant=True)
    _Given = TypeVar("_Given", contravariant=True)

    class As(Generic[_Stored, _Given]):
        """Type of a field that stores a value of one type, and is given as another: a list, an integer, a formula."""

        def __get__(self, record: object, owner: Any = None) -> _Stored: ...
        def __set__(self, record: object, value: _Given) -> None: ...

else:

    class As:
        """For type checkers alone: the kind of a key says what pydantic reads."""

        def __class_getitem__(cls, types: tuple[Any, Any]) -> Any:
            return Any


Load = As[Value | None, ValueLike | None]
Values = As[tuple[Value, ...] | None, ValueLike | Sequence[ValueLike] | None]
Rotation = As[tuple[Value | str, ...] | None, ValueLike | Sequence[ValueLike] | None]
Groups = As[tuple[str, ...] | None, Sequence[str] | None]
Numbers = As[tuple[float, ...] | None, Sequence[float] | None]


class Key(NamedTuple):
    """A row of the table; the key's name is that of the field.

    `unit`: a dimension (units are the user's own, consistent ones). `load`: a plain number is ramped from 0 (a
    temperature: from the material's reference) over the steps. `models`, `kinematics`: those for which the key is
    allowed. `default_words`: description of the default, where the stored default (None) does not describe it.
    `unless`: another key, without which this one is required.
    """

    kind: Kind
    unit: str
    meaning: str
    load: bool = False
    models: tuple[str, ...] = MODELS
    kinematics: str = ANY
    needs: Needs | None = None
    default_words: str = ""
    unless: str = ""

    @property
    def text(self) -> str:
        """The meaning of the key, and the conditions under which it is allowed."""
        parts = [self.meaning]
        parts += [] if self.models == MODELS else [f"models {', '.join(self.models)}"]
        parts += [] if self.kinematics == ANY else [f"kinematics {self.kinematics}"]
        parts += [f"with {self.needs.key} = {' or '.join(self.needs.values)}"] if self.needs else []
        return "; ".join(parts)

    def __call__(self, schema: Schema) -> None:
        """Describe the key in its JSON Schema, which pydantic makes."""
        schema["description"] = f"{self.text}; unit: {self.unit}" if self.unit else self.text


def key(kind: Kind, unit: str, meaning: str, default: Any = ..., default_words: str = "", **rest: Any) -> Any:
    """Return a field that is a key; without a default it is required. `rest`: other columns of Key."""
    return _field(default, kind, Key(kind, unit, meaning, default_words=default_words, **rest))


def _field(default: Any, kind: Any, row: Any = None) -> FieldInfo:
    """Return a field of pydantic whose values a kind reads."""
    info: FieldInfo = Field(default, json_schema_extra=row)
    info.metadata.append(kind)
    return info


class _OfPrograms:
    """Kind of a field that is no key: programs set it, and a file does not have it."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(self._take)

    def _take(self, given: Any, info: ValidationInfo) -> Any:
        if info.context is not None:
            raise PydanticCustomError("extra_forbidden", "no key")
        return given

    def __get_pydantic_json_schema__(self, core: core_schema.CoreSchema, handler: Callable[[Any], Schema]) -> Schema:
        raise PydanticOmit


def hidden(default: Any) -> Any:
    """Return a field that is no key, and that records are not compared by."""
    return _field(default, _OfPrograms())


class Section(NamedTuple):
    """A table of the file: `[[name]]` if there may be several, `[name]` if there is one.

    `one_of`: exactly one key of each of these sets is given; `some_of`: at least one; `not_both`: never both.
    `named_after`: the key whose value is the name of a record that is given none.
    """

    name: str
    several: bool
    meaning: str
    one_of: tuple[tuple[str, ...], ...] = ()
    some_of: tuple[tuple[str, ...], ...] = ()
    not_both: tuple[tuple[str, str], ...] = ()
    named_after: str = ""

    @property
    def header(self) -> str:
        """Header of the section in a file, or words for the top of the file."""
        if not self.name:
            return "the top of the file"
        return f"[[{self.name}]]" if self.several else f"[{self.name}]"


class _Records(NamedTuple):
    """Kind of a field of the case for the records of a section: a tuple of them, or a single one."""

    record: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        several = self.record.SECTION.several
        record: Any = self.record
        inner = handler.generate_schema(tuple[record, ...] if several else record)
        return core_schema.with_info_before_validator_function(self._given, inner)

    def _given(self, given: Any, info: ValidationInfo) -> Any:
        """Return what a file gives, or the records that a program gives. Raises TypeError."""
        if info.context is not None:
            return given
        record, several = self.record, self.record.SECTION.several
        records = tuple(given) if several and isinstance(given, (list, tuple)) else (given,)
        if not all(isinstance(one, record) for one in records):
            what = f"a list of {record.__name__} records" if several else f"a {record.__name__} record"
            raise TypeError(f"{record.SECTION.name} is {what}, not {given!r}")
        return records if several else given


def section(record: Any, default: Any = None) -> Any:
    """Return a field of the case for the records of a section: a tuple of them, or a single one or `default`."""
    return _field(() if record.SECTION.several else default, _Records(record))


def table_of(fields: dict[str, FieldInfo]) -> tuple[dict[str, Key], dict[str, Any], dict[str, Any]]:
    """Return the keys of a record's fields, their defaults, and the records of its sections, each by name."""
    keys = {name: one.json_schema_extra for name, one in fields.items() if isinstance(one.json_schema_extra, Key)}
    defaults = {name: MISSING if fields[name].is_required() else fields[name].default for name in keys}
    kinds = {name: kind for name, one in fields.items() for kind in one.metadata if isinstance(kind, _Records)}
    return keys, defaults, {name: kind.record for name, kind in kinds.items()}


def told_default(key: Key, default: Any) -> str:
    """Return the default as it is written in a file, or its description."""
    if default is MISSING:
        return "required"
    if key.default_words:
        return key.default_words
    if default is None:
        return ""
    if isinstance(default, bool):
        return str(default).lower()
    return f'"{default}"' if isinstance(default, str) else f"{default}"
