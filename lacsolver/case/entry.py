"""The record of a section, filled from the keys that a file or a program gives, and the mistakes of these keys.

A value is converted once, by the type of its key, wherever it comes from. Keys that cannot be read are None, and the
record goes on to the rules of the case all the same, so that all mistakes are reported at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, ClassVar, Self

from lacmesh.errors import did_you_mean
from lacmesh.facts import Described
from lacsolver.case.errors import CaseError, Issue, Mistake
from lacsolver.case.formula import Formula
from lacsolver.case.keys import ANY, PLANE, Key, Section, defaults_of, keys_of
from lacsolver.case.kinds import Choice
from lacsolver.case.lines import KeyPath, Lines
from lacsolver.case.value import Value, values_in, with_values


def same(value: Any, default: Any) -> bool:
    """True if a value is the default."""
    return value is default or (type(value) is type(default) and bool(value == default))


@dataclass(frozen=True, kw_only=True, repr=False)
class Entry(Described):
    """Base class of the records. `place`: file and line of the record, for messages; empty for records from Python."""

    SECTION: ClassVar[Section]
    #: names of the keys that were given, valid or not
    _given: ClassVar[frozenset[str]] = frozenset()
    #: path in the file, ("contact", 0), and the lines of that
    _path: ClassVar[KeyPath] = ()
    _lines: ClassVar[Lines | None] = None
    place: str = field(default="", repr=False, compare=False)

    def __post_init__(self) -> None:
        """Convert and check the given values, as from a file. Raises CaseError."""
        if mistakes := self._take(self.told()):
            raise CaseError(mistakes, self.place or None)

    @classmethod
    def from_table(
        cls, table: Mapping[str, Any], path: KeyPath, lines: Lines, file: str | Path
    ) -> tuple[Self, list[Issue]]:
        """Return the record of a table of a file, and the mistakes in it; keys that cannot be read are None."""
        record = object.__new__(cls)
        for one in fields(cls):
            record._set(one.name, None if one.default is MISSING else one.default)
        record._set("place", f"{file}, line {lines[path]}" if path else str(file))
        record._set("_path", path)
        record._set("_lines", lines)
        mistakes = record._take(table)
        for name in record._given & keys_of(cls).keys():
            place = f"{file}, line {lines[(*path, name)]}"
            record._set(name, _placed(getattr(record, name), place))
        return record, mistakes

    def altered(self, **values: Any) -> Self:
        """Return the record with other values, which are not checked."""
        other = copy(self)
        for name, value in values.items():
            other._set(name, value)
        return other

    def has(self, key: str) -> bool:
        """True if a key was given, valid or not."""
        return key in self._given

    def told(self) -> dict[str, Any]:
        """Return the values that differ from their defaults."""
        defaults = defaults_of(type(self))
        values = {name: getattr(self, name) for name in defaults}
        return {n: v for n, v in values.items() if not same(v, defaults[n]) and not (v is None and self.has(n))}

    def wrong(self, message: str, key: str | None = None, inside: KeyPath = ()) -> Issue:
        """Return a mistake of the whole record, or of one key."""
        path = self._path if key is None else (*self._path, key, *inside)
        return Issue(f"{self._subject(key)} {message}", self._lines[path] if self._lines else None)

    def __repr__(self) -> str:
        words = (f"{name}={value}" for name, value in self._facts().items())
        return f"{type(self).__name__}({', '.join(words)})"

    def _facts(self) -> dict[str, str]:
        return {name: _plainly(value) for name, value in self.told().items()}

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _subject(self, key: str | None = None) -> str:
        """Return the subject of a message: `[[pressure]]`, `pressure.value`, `model`."""
        if key is None:
            return self.SECTION.header
        return f"{self.SECTION.name}.{key}" if self.SECTION.name else key

    def _take(self, given: Mapping[str, Any]) -> list[Issue]:
        """Convert and store the given values; return the mistakes that this record alone shows."""
        keys, mistakes = keys_of(type(self)), []
        self._set("_given", frozenset(given))
        for name in [n for n in given if n in keys]:
            value = None
            try:
                value = _named(keys[name].kind.read(given[name]), self._subject(name))
            except Mistake as mistake:
                mistakes.append(self.wrong(mistake.message, name, mistake.inside))
            self._set(name, value)
        mistakes += [*self._unknown(given), *self._missing(), *self._exclusive(), *self._needs()]
        after = self.SECTION.named_after
        if after and not self.has("name"):
            self._set("name", getattr(self, after))
        return mistakes

    def _unknown(self, given: Mapping[str, Any]) -> Iterator[Issue]:
        known = keys_of(type(self))
        for name in given:
            if name not in known:
                yield self.wrong(f"is no key of {self.SECTION.header}{did_you_mean(name, known)}", name)

    def _missing(self) -> Iterator[Issue]:
        for name, default in defaults_of(type(self)).items():
            key = keys_of(type(self))[name]
            required = default is MISSING or (key.unless and not self.has(key.unless))
            if required and not self.has(name):
                yield self.wrong(f"needs {name} ({key.meaning}; {key.kind.words})")

    def _exclusive(self) -> Iterator[Issue]:
        for names in self.SECTION.one_of:
            given = [n for n in names if self.has(n)]
            if not given:
                yield self.wrong(f"needs {' or '.join(names)}")
            elif len(given) > 1:
                yield self.wrong(f"stands beside {given[0]}; give one of {' and '.join(names)}", given[1])
        for names in self.SECTION.some_of:
            if not any(self.has(n) for n in names):
                yield self.wrong(f"needs at least one of {', '.join(names)}")
        for one, other in self.SECTION.not_both:
            if self.has(one) and self.has(other):
                yield self.wrong(f"stands beside {one}; give one of the two", other)

    def _needs(self) -> Iterator[Issue]:
        keys = keys_of(type(self))
        for name in self.told():
            needs = keys[name].needs
            if needs is None:
                continue
            kind = keys[needs.key].kind
            added = kind.added if needs.added and isinstance(kind, Choice) else ()
            if getattr(self, needs.key) not in (*needs.values, *added, None):
                wanted = " or ".join(f'{needs.key} = "{value}"' for value in needs.values)
                yield self.wrong(f"means something only with {wanted}; leave it out, or say that", name)

    def against(self, model: str | None, kinematics: str | None) -> Iterator[Issue]:
        """Yield the mistakes under this model and these kinematics (None: not known, so not checked)."""
        given = self.told()
        for name, key in keys_of(type(self)).items():
            if kinematics is not None and getattr(self, name) is not None:
                yield from self._against_kinematics(name, key, kinematics, name in given)
            if model is not None and name in given:
                yield from self._against_model(name, key, model)

    def _against_kinematics(self, name: str, key: Key, kinematics: str, given: bool) -> Iterator[Issue]:
        """Yield mistakes against the kinematics; words are checked by default too, such as a material's law."""
        if key.kinematics not in (ANY, kinematics) and given:
            yield self.wrong(
                f'means something only with kinematics = "{key.kinematics}"; leave it out, or say that', name
            )
        if not isinstance(key.kind, Choice):
            return
        value, needs = getattr(self, name), key.kind.kinematics
        if needs.get(value, kinematics) != kinematics:
            fitting = [word for word in key.kind.options if needs.get(word, kinematics) == kinematics]
            message = f'is "{value}", which needs kinematics = "{needs[value]}"; with "{kinematics}" it is one of'
            yield self.wrong(f"{message} {', '.join(fitting)}", name)

    def _against_model(self, name: str, key: Key, model: str) -> Iterator[Issue]:
        value = getattr(self, name)
        if model not in key.models:
            yield self.wrong(f"is of the models {', '.join(key.models)}, and the model is {model}; leave it out", name)
            return
        if misfit := key.kind.misfit(value, 3 if model == "3d" else 2):
            yield self.wrong(misfit, name)
        formulas = [v.source for v in values_in(value) if isinstance(v.source, Formula)]
        if model in PLANE and any("z" in formula.variables for formula in formulas):
            yield self.wrong(f"uses z, which the model {model} does not have", name)


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
