"""The table of keys: each key is a field of a record, and its row of the table is stored in the field's metadata.

    young: float = key(POSITIVE, "stress", "Young's modulus")

The record's field has the key's name and default; `Key` has the other columns. The parser, `validate`, the schemas, the
page of docs and the checks of records made from Python all read these rows, and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, field, fields
from typing import Any, Generic, NamedTuple, TypeVar

from lacsolver.case.kinds import Choice, Kind
from lacsolver.case.value import Value, ValueLike

MODELS = ("3d", "plane_strain", "plane_stress", "axisymmetric")
PLANE = MODELS[1:]
#: kinematics of a key or an option that is valid for all kinematics
ANY = "any"


#: what the tables of keys say of a key that a file must have
REQUIRED = "required"


class Needs(NamedTuple):
    """Condition for a key to have a meaning: another `key` has one of these `values` (also by default).

    `added`: True if values that a program has added (`case.added`) will do as well.
    """

    key: str
    values: tuple[str, ...]
    added: bool = False


_Stored = TypeVar("_Stored", covariant=True)
_Given = TypeVar("_Given", contravariant=True)


class As(Generic[_Stored, _Given]):
    """Type of a field that stores a value of one type, and is given as another: a list, an integer, a formula.

    For type checkers alone; no value of it is made.
    """

    def __get__(self, record: object, owner: Any = None) -> _Stored:
        """Type of the field."""
        raise NotImplementedError

    def __set__(self, record: object, value: _Given) -> None:
        """Type of the argument."""
        raise NotImplementedError


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

    kind: Kind | Choice
    unit: str
    meaning: str
    load: bool = False
    models: tuple[str, ...] = MODELS
    kinematics: str = ANY
    needs: Needs | None = None
    default_words: str = ""
    unless: str = ""


def key(
    kind: Kind | Choice, unit: str, meaning: str, default: Any = MISSING, default_words: str = "", **rest: Any
) -> Any:
    """Return a field that is a key; without a default it is required. `rest`: other columns of Key."""
    return field(default=default, metadata={"key": Key(kind, unit, meaning, default_words=default_words, **rest)})


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


def keys_of(record: Any) -> dict[str, Key]:
    """Return the keys of a record, by name, in the order of the table."""
    return {f.name: f.metadata["key"] for f in fields(record) if "key" in f.metadata}


def defaults_of(record: Any) -> dict[str, Any]:
    """Return the defaults of a record's keys; MISSING for required keys."""
    return {f.name: f.default for f in fields(record) if "key" in f.metadata}


def section(record: Any, default: Any = None) -> Any:
    """Return a field of the case for the records of a section: a tuple of them, or a single one or `default`."""
    return field(default=() if record.SECTION.several else default, metadata={"section": record})


def sections_of(case: Any) -> dict[str, Any]:
    """Return the record of each section of a case, by the section's name."""
    return {f.name: f.metadata["section"] for f in fields(case) if "section" in f.metadata}


def is_required(key: Key, default: Any) -> bool:
    """True if a file must have the key; Python may give the mesh of a case elsewhere."""
    return default is MISSING or (key.default_words == REQUIRED and not key.unless)


def told_default(key: Key, default: Any) -> str:
    """Return the default as it is written in a file, or its description."""
    if default is MISSING:
        return REQUIRED
    if key.default_words:
        return key.default_words
    if default is None:
        return ""
    if isinstance(default, bool):
        return str(default).lower()
    return f'"{default}"' if isinstance(default, str) else f"{default}"
