"""Draft of a record: the values given, those that could be read, and the mistakes that the table of keys can tell."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, replace
from functools import partial
from typing import Any, NamedTuple

from lacmesh.errors import did_you_mean
from lacsolver.case.errors import Mistake
from lacsolver.case.formula import Formula
from lacsolver.case.keys import ANY, PLANE, Key, defaults_of, keys_of, section_of
from lacsolver.case.kinds import Axes, Choice, Point, Turning
from lacsolver.case.lines import KeyPath
from lacsolver.case.value import Value, values_in, with_values


class Found(NamedTuple):
    """A mistake: the path of its key, which leads to a line, and a message that begins with its subject."""

    path: KeyPath
    message: str


@dataclass(frozen=True)
class Draft:
    """A record to be made of the keys `given`.

    `values`: those values that could be read. `path`: `("contact", 0)`, or () for the top of the file.
    """

    record: type
    path: KeyPath
    given: Mapping[str, Any]
    values: Mapping[str, Any]

    @property
    def section(self) -> str:
        """Name of the record's section."""
        return section_of(self.record).name

    def has(self, key: str) -> bool:
        """True if a key was given, valid or not."""
        return key in self.given

    def get(self, key: str) -> Any:
        """Return the value of a key, or its default; None if it has no default or could not be read."""
        if key in self.given:
            return self.values.get(key)
        default = defaults_of(self.record)[key]
        return None if default is MISSING else default

    def told(self) -> dict[str, Any]:
        """Return the values that could be read and that differ from their defaults."""
        defaults = defaults_of(self.record)
        return {name: value for name, value in self.values.items() if not same(value, defaults[name])}

    def wrong(self, message: str, key: str | None = None, inside: KeyPath = ()) -> Found:
        """Return a mistake of the whole record, or of one key."""
        path = self.path if key is None else (*self.path, key, *inside)
        return Found(path, f"{subject(self.record, key)} {message}")


def subject(record: type, key: str | None = None) -> str:
    """Return the subject of a message: `[[pressure]]`, `pressure.value`, `model`."""
    section = section_of(record)
    if key is None:
        return section.header
    return f"{section.name}.{key}" if section.name else key


def same(value: Any, default: Any) -> bool:
    """True if a value is the default."""
    return value is default or (type(value) is type(default) and bool(value == default))


def draft(record: type, path: KeyPath, given: Mapping[str, Any]) -> tuple[Draft, list[Found]]:
    """Read the values given for one record; return its draft, and the mistakes within this record."""
    keys, values, mistakes = keys_of(record), {}, []
    for name in [n for n in given if n in keys]:
        try:
            read = keys[name].kind.read(given[name])
        except Mistake as mistake:
            mistakes.append((name, mistake))
        else:
            values[name] = with_values(read, partial(_named, name=subject(record, name)))
    made = Draft(record, path, given, values)
    found = [made.wrong(m.message, name, m.inside) for name, m in mistakes]
    return made, [*found, *_unknown(made), *_missing(made), *_exclusive(made), *_needs(made)]


def _named(value: Value, name: str) -> Value:
    return replace(value, name=name) if value.name == "value" else value


def _unknown(made: Draft) -> Iterator[Found]:
    known = keys_of(made.record)
    for name in made.given:
        if name not in known:
            yield made.wrong(f"is no key of {section_of(made.record).header}{did_you_mean(name, known)}", name)


def _missing(made: Draft) -> Iterator[Found]:
    for name, default in defaults_of(made.record).items():
        key = keys_of(made.record)[name]
        required = default is MISSING or (key.unless and not made.has(key.unless))
        if required and not made.has(name):
            yield made.wrong(f"needs {name} ({key.meaning}; {key.kind.words})")


def _exclusive(made: Draft) -> Iterator[Found]:
    section = section_of(made.record)
    for names in section.one_of:
        given = [n for n in names if made.has(n)]
        if not given:
            yield made.wrong(f"needs {' or '.join(names)}")
        elif len(given) > 1:
            yield made.wrong(f"stands beside {given[0]}; give one of {' and '.join(names)}", given[1])
    for names in section.some_of:
        if not any(made.has(n) for n in names):
            yield made.wrong(f"needs at least one of {', '.join(names)}")
    for one, other in section.not_both:
        if made.has(one) and made.has(other):
            yield made.wrong(f"stands beside {one}; give one of the two", other)


def _needs(made: Draft) -> Iterator[Found]:
    for name in made.told():
        needs = keys_of(made.record)[name].needs
        if needs is None:
            continue
        kind = keys_of(made.record)[needs.key].kind
        added = kind.added if needs.added and isinstance(kind, Choice) else ()
        if made.get(needs.key) not in (*needs.values, *added, None):
            wanted = " or ".join(f'{needs.key} = "{value}"' for value in needs.values)
            yield made.wrong(f"means something only with {wanted}; leave it out, or say that", name)


def check_context(made: Draft, model: str | None, kinematics: str | None) -> Iterator[Found]:
    """Yield the mistakes of a record under this model and these kinematics (None: not known, so not checked)."""
    told = made.told()
    for name, key in keys_of(made.record).items():
        if kinematics is not None and made.get(name) is not None:
            yield from _against_kinematics(made, name, key, kinematics)
        if model is not None and name in told:
            yield from _against_model(made, name, key, model)


def _against_kinematics(made: Draft, name: str, key: Key, kinematics: str) -> Iterator[Found]:
    """Yield mistakes against the kinematics; options are checked for defaults too, such as a material's default law."""
    if key.kinematics not in (ANY, kinematics) and name in made.told():
        yield made.wrong(f'means something only with kinematics = "{key.kinematics}"; leave it out, or say that', name)
    if not isinstance(key.kind, Choice):
        return
    needs = {option.word: option.kinematics for option in key.kind.options}
    value = made.get(name)
    if needs.get(value, ANY) not in (ANY, kinematics):
        fitting = [word for word, of in needs.items() if of in (ANY, kinematics)]
        message = f'is "{value}", which needs kinematics = "{needs[value]}"; with "{kinematics}" it is one of'
        yield made.wrong(f"{message} {', '.join(fitting)}", name)


def _against_model(made: Draft, name: str, key: Key, model: str) -> Iterator[Found]:
    value = made.get(name)
    if model not in key.models:
        yield made.wrong(f"is of the models {', '.join(key.models)}, and the model is {model}; leave it out", name)
        return
    yield from (made.wrong(message, name) for message in _dimensions(key, value, 3 if model == "3d" else 2))
    formulas = [v.source for v in values_in(value) if isinstance(v.source, Formula)]
    if model in PLANE and any("z" in formula.variables for formula in formulas):
        yield made.wrong(f"uses z, which the model {model} does not have", name)


def _dimensions(key: Key, value: Any, dim: int) -> Iterator[str]:
    where = "3d" if dim == 3 else "a plane model"
    if isinstance(key.kind, Point) and len(value) != dim:
        yield f"has {len(value)} coordinates; {where} has {dim}"
    if isinstance(key.kind, Axes) and dim == 3 and len(value[0]) != 3:
        yield "has vectors of 2 components; 3d has 3"
    if isinstance(key.kind, Axes) and dim == 2 and any(any(v[2:]) for v in value):
        yield "has vectors out of the plane of the model; give axes 1 and 2 in it"
    count = 3 if dim == 3 else 1
    if isinstance(key.kind, Turning) and len(value) != count:
        yield "is one value; in 3d it is a vector of three" if dim == 3 else "is a vector; in a plane it is one value"


def by_section(drafts: Iterable[Draft]) -> dict[str, list[Draft]]:
    """Return the drafts of each section, in their order."""
    sorted_: dict[str, list[Draft]] = {}
    for made in drafts:
        sorted_.setdefault(made.section, []).append(made)
    return sorted_
