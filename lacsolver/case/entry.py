"""The record of a section: a model of pydantic, filled from the keys that a file or a program gives.

A value is converted once, by the kind of its key, wherever it comes from. pydantic finds the mistakes of all keys of a
case at once; `mistakes` are those that keys show together, which are looked at when each key is right.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import MISSING, FrozenInstanceError, make_dataclass, replace
from inspect import Parameter, Signature, get_annotations
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import ErrorDetails

from lacmesh.errors import did_you_mean
from lacmesh.facts import Described
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.formula import Formula
from lacsolver.case.keys import ANY, PLANE, Key, Section, hidden, table_of
from lacsolver.case.kinds import Schema
from lacsolver.case.lines import KeyPath, Lines
from lacsolver.case.value import Value, values_in, with_values


def same(value: Any, default: Any) -> bool:
    """True if a value is the default."""
    return value is default or (type(value) is type(default) and bool(value == default))


def _with_rules(schema: Schema, record: type[Entry]) -> None:
    """Add the rules of a section to its JSON Schema."""
    section, keys = record.SECTION, record.KEYS
    rules: list[Schema] = [{"oneOf": [{"required": [name]} for name in names]} for names in section.one_of]
    either = [(name, key.unless) for name, key in keys.items() if key.unless]
    rules += [{"anyOf": [{"required": [name]} for name in names]} for names in (*section.some_of, *either)]
    rules += [{"not": {"required": list(pair)}} for pair in section.not_both]
    schema["description"] = section.meaning
    if rules:
        schema["allOf"] = rules


class Entry(Described, BaseModel):
    """Base class of the records. `place`: file and line of the record, for messages; empty for records from Python.

    A subclass gives the header of its section, and the rules that a `Section` has; the first paragraph of its docstring
    is the header and the section's meaning. A program makes a record from what a file would give, arrays and functions
    included: an unknown or a missing key is a TypeError, other mistakes are a CaseError.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", json_schema_extra=_with_rules)
    SECTION: ClassVar[Section]
    KEYS: ClassVar[dict[str, Key]]
    DEFAULTS: ClassVar[dict[str, Any]]
    SECTIONS: ClassVar[dict[str, Any]]
    place: str = hidden("")
    #: path in the file, ("contact", 0), and the lines of that
    _path: KeyPath = PrivateAttr(())
    _lines: Lines | None = PrivateAttr(None)

    def __init_subclass__(cls, **rules: Any) -> None:
        """Take the rules of a section, which pydantic hands on to `__pydantic_init_subclass__`."""
        super().__init_subclass__()

    @classmethod
    def __pydantic_init_subclass__(cls, header: str | None = None, **rules: Any) -> None:
        """Set the table of the record's keys, and its section."""
        cls.KEYS, cls.DEFAULTS, cls.SECTIONS = table_of(cls.model_fields)
        # `dataclasses.replace` and `fields` look at the fields of a dataclass
        shadow: Any = make_dataclass(cls.__name__, list(cls.model_fields), init=False, repr=False, eq=False)
        cls.__dataclass_fields__ = shadow.__dataclass_fields__
        cls.__signature__ = _signature(cls)
        if header is not None:
            meaning = " ".join((cls.__doc__ or "").split("\n\n")[0].split()).removeprefix(f"{header}: ").rstrip(".")
            cls.SECTION = Section(header.strip("[]"), header.startswith("[["), meaning, **rules)

    @model_validator(mode="wrap")
    @classmethod
    def _checked(cls, given: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo) -> Self:
        """Return the record of what is given. Raises CaseError, TypeError for mistakes of a program's record."""
        if info.context is not None or not isinstance(given, dict):
            return handler(given)
        absent = {n for n in cls.SECTIONS if given.get(n, ()) is None}
        absent |= {n for n, default in cls.DEFAULTS.items() if same(given.get(n, MISSING), default)}
        try:
            record = handler({n: v for n, v in given.items() if n not in absent})
        except ValidationError as error:
            wrong = [cls.issue(one) for one in error.errors()]
            if any(one["type"] in ("missing", "extra_forbidden") for one in error.errors()):
                raise TypeError("; ".join(one.message for one in wrong)) from None
            raise CaseError(wrong, given.get("place") or None) from None
        if mistakes := list(record.mistakes()):
            raise CaseError([Issue(one.message) for one in mistakes], record.place or None)
        record.settle()
        return record

    def model_post_init(self, context: Any) -> None:
        """Name values after their keys, and the record after the key that its section says."""
        for name in self.model_fields_set & self.KEYS.keys():
            self._set(name, _named(getattr(self, name), self.subject(name)))
        after = self.SECTION.named_after
        if after and not self.has("name"):
            self._set("name", getattr(self, after))

    def locate(self, path: KeyPath, lines: Lines, file: str | Path) -> None:
        """Set the place of a record that was read from a file: its path there, and the lines of all keys."""
        self._path, self._lines = path, lines
        self._set("place", f"{file}, line {lines[path]}" if path else str(file))
        for name in self.model_fields_set & self.KEYS.keys():
            self._set(name, _placed(getattr(self, name), f"{file}, line {lines[(*path, name)]}"))

    def settle(self) -> None:
        """Set values that depend on others; of a case alone."""

    def altered(self, **values: Any) -> Self:
        """Return the record with other values, which are not checked."""
        other = copy(self)
        other.__dict__.update(values)
        return other

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return the record with other values, which are checked as those of `dataclasses.replace`."""
        return replace(self, **(update or {}))

    def has(self, key: str) -> bool:
        """True if a key was given."""
        return key in self.model_fields_set

    def told(self) -> dict[str, Any]:
        """Return the values that differ from their defaults."""
        return {n: v for n in self.KEYS if not same(v := getattr(self, n), self.DEFAULTS[n])}

    def wrong(self, message: str, key: str | None = None) -> Issue:
        """Return a mistake of the whole record, or of one key."""
        path = self._path if key is None else (*self._path, key)
        return Issue(f"{self.subject(key)} {message}", self._lines[path] if self._lines else None)

    @classmethod
    def subject(cls, key: str | None = None) -> str:
        """Return the subject of a message: `[[pressure]]`, `pressure.value`, `model`."""
        if key is None:
            return cls.SECTION.header
        return f"{cls.SECTION.name}.{key}" if cls.SECTION.name else key

    @classmethod
    def issue(cls, one: ErrorDetails, path: KeyPath = (), lines: Lines | None = None) -> Issue:
        """Return a mistake that pydantic found in a key of the record, which has this path in a file."""
        name = str(one["loc"][-1])
        if one["type"] == "missing":
            message = f"{cls.SECTION.header} needs {name} ({cls.KEYS[name].meaning}; {cls.KEYS[name].kind.words})"
            return Issue(message, lines[path] if lines else None)
        if one["type"] == "extra_forbidden":
            message = f"{cls.subject(name)} is not a key of {cls.SECTION.header}{did_you_mean(name, cls.KEYS)}"
            return Issue(message, lines[(*path, name)] if lines else None)
        mistake = one["ctx"]["error"]
        line = lines[(*path, name, *mistake.inside)] if lines else None
        return Issue(f"{cls.subject(name)} {mistake}", line)

    def __setattr__(self, name: str, value: Any) -> None:
        if not name.startswith("_"):
            raise FrozenInstanceError(f"cannot assign to field {name!r}")
        super().__setattr__(name, value)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._compared() == other._compared()

    def __hash__(self) -> int:
        return hash(self._compared())

    def __repr__(self) -> str:
        words = (f"{name}={value}" for name, value in self._facts().items())
        return f"{type(self).__name__}({', '.join(words)})"

    def __str__(self) -> str:
        return repr(self)

    def _facts(self) -> dict[str, str]:
        return {name: _plainly(value) for name, value in self.told().items()}

    def _compared(self) -> tuple[Any, ...]:
        return tuple(getattr(self, name) for name in (*self.KEYS, *self.SECTIONS))

    def _set(self, name: str, value: Any) -> None:
        self.__dict__[name] = value

    def mistakes(self) -> Iterator[Issue]:
        """Yield the mistakes that the keys of this record alone show together."""
        for name, key in self.KEYS.items():
            if key.unless and not self.has(key.unless) and not self.has(name):
                yield self.wrong(f"needs {name} ({key.meaning}; {key.kind.words})")
        yield from self._exclusive()
        yield from self._needs()

    def _exclusive(self) -> Iterator[Issue]:
        for names in self.SECTION.one_of:
            given = [n for n in names if self.has(n)]
            if not given:
                yield self.wrong(f"needs {' or '.join(names)}")
            elif len(given) > 1:
                yield self.wrong(f"cannot be combined with {given[0]}; give one of {' and '.join(names)}", given[1])
        for names in self.SECTION.some_of:
            if not any(self.has(n) for n in names):
                yield self.wrong(f"needs at least one of {', '.join(names)}")
        for one, other in self.SECTION.not_both:
            if self.has(one) and self.has(other):
                yield self.wrong(f"cannot be combined with {one}; give one of the two", other)

    def _needs(self) -> Iterator[Issue]:
        for name in self.told():
            needs = self.KEYS[name].needs
            if needs is None:
                continue
            added = self.KEYS[needs.key].kind.added if needs.added else ()
            if getattr(self, needs.key) not in (*needs.values, *added):
                wanted = " or ".join(f'{needs.key} = "{value}"' for value in needs.values)
                yield self.wrong(f"has an effect only with {wanted}; set that, or remove this key", name)

    def against(self, model: str, kinematics: str) -> Iterator[Issue]:
        """Yield the mistakes under this model and these kinematics."""
        given = self.told()
        for name, key in self.KEYS.items():
            if getattr(self, name) is not None:
                yield from self._against_kinematics(name, key, kinematics, name in given)
            if name in given:
                yield from self._against_model(name, key, model)

    def _against_kinematics(self, name: str, key: Key, kinematics: str, given: bool) -> Iterator[Issue]:
        """Yield mistakes against the kinematics; words are checked by default too, such as a material's law."""
        if key.kinematics not in (ANY, kinematics) and given:
            only = f'kinematics = "{key.kinematics}"'
            yield self.wrong(f"has an effect only with {only}; set that, or remove this key", name)
        value, needs = getattr(self, name), key.kind.kinematics
        if needs and needs.get(value, kinematics) != kinematics:
            fitting = [word for word in key.kind.options if needs.get(word, kinematics) == kinematics]
            message = f'is "{value}", which needs kinematics = "{needs[value]}"; with "{kinematics}" it is one of'
            yield self.wrong(f"{message} {', '.join(fitting)}", name)

    def _against_model(self, name: str, key: Key, model: str) -> Iterator[Issue]:
        value = getattr(self, name)
        if model not in key.models:
            yield self.wrong(
                f"applies to the models {', '.join(key.models)}, and the model is {model}; remove it", name
            )
            return
        if misfit := key.kind.misfit(value, 3 if model == "3d" else 2):
            yield self.wrong(misfit, name)
        formulas = [v.source for v in values_in(value) if isinstance(v.source, Formula)]
        if model in PLANE and any("z" in formula.variables for formula in formulas):
            yield self.wrong(f"uses z, which the model {model} does not have", name)


def _signature(record: type[Entry]) -> Signature:
    """Return the signature of a record: its keys and sections, with their types as they are written."""
    types = {name: one for base in reversed(record.__mro__) for name, one in get_annotations(base).items()}
    fields = {name: one for name, one in record.model_fields.items() if name in {*record.KEYS, *record.SECTIONS}}
    defaults = {name: Parameter.empty if one.is_required() else one.default for name, one in fields.items()}
    kind = Parameter.KEYWORD_ONLY
    return Signature([Parameter(name, kind, default=defaults[name], annotation=types[name]) for name in fields])


def _named(stored: Any, subject: str) -> Any:
    """Return what is stored for a key, with values named after the key if they have no name yet."""
    return with_values(stored, lambda value: replace(value, name=subject) if value.name == "value" else value)


def _placed(stored: Any, place: str) -> Any:
    """Return what is stored for a key, with file and line in front of the names of values."""
    return with_values(stored, lambda value: replace(value, name=f"{place}: {value.name}"))


def _plainly(value: Any) -> str:
    """Return a value of a record as it could be given."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_plainly, value))}{',' if len(value) == 1 else ''})"
    source = value.source if isinstance(value, Value) else value
    return repr(source.text) if isinstance(source, Formula) else repr(source)
