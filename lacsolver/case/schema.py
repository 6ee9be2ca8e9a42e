"""The table of keys for people and editors: as text, as JSON Schema, and as the tables of docs/case.md."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from lacsolver.case.case import Case
from lacsolver.case.formula import CONSTANTS, FUNCTIONS, VARIABLES
from lacsolver.case.keys import Key, Section, told_default
from lacsolver.case.kinds import Schema

_WIDE = 118


def records() -> list[Any]:
    """Return the records of the table: the top of the file, then every section."""
    return [Case, *Case.SECTIONS.values()]


def schema_text() -> str:
    """Return a text with every section and key: its meaning, type of value, unit and default."""
    parts = [textwrap.fill(_INTRODUCTION, _WIDE), *("\n".join(_section_text(record)) for record in records())]
    return "\n\n".join(parts) + "\n"


_INTRODUCTION = (
    "A value is a number, a formula of x, y, z, t, or a table of times [[t, v], ...], linear in between. A value "
    "marked * is a load: a number is ramped from 0 at the start to its value at the end of the steps, or at the "
    "start of [dynamics] (a temperature: from the material's reference). Use any consistent units; the units listed "
    "here are dimensions."
)


def _section_text(record: Any) -> Iterator[str]:
    section = record.SECTION
    yield f"{section.header}  {section.meaning}" if section.name else "# the top of the file"
    for name, key in record.KEYS.items():
        default = told_default(key, record.DEFAULTS[name])
        words = "one of these" if key.kind.options else key.kind.words
        takes = f"{words}{'*' if key.load else ''}{f' [{key.unit}]' if key.unit else ''}"
        without = default if default.startswith("required") else f"default: {default}" if default else "optional"
        yield textwrap.fill(
            f"{key.text}. Takes {takes}; {without}.", _WIDE, initial_indent=f"  {name:<22} ", subsequent_indent=" " * 25
        )
        for word, meaning in key.kind.options.items():
            kinematics = key.kind.kinematics.get(word)
            only = f" (kinematics: {kinematics})" if kinematics else ""
            yield f"{'':27}{word}: {meaning}{only}"
    yield from (f"  {rule}" for rule in _rules(section))


def _rules(section: Section) -> list[str]:
    """Return the rules for combinations of a section's keys, in words."""
    rules = [f"exactly one of {', '.join(names)}" for names in section.one_of]
    rules += [f"at least one of {', '.join(names)}" for names in section.some_of]
    return rules + [f"not both {one} and {other}" for one, other in section.not_both]


class _Generator(GenerateJsonSchema):
    """JSON Schema as editors of TOML take it: no titles, and defaults only where a file could have them."""

    def default_schema(self, schema: Any) -> Schema:
        """Return the schema of a field that has a default."""
        made: Schema = self.generate_inner(schema["schema"])
        default = schema.get("default")
        return {**made, "default": default} if isinstance(default, (bool, int, float, str)) else made

    def field_title_should_be_set(self, schema: Any) -> bool:
        """Return False: the name of a key is its title."""
        return False


def json_schema() -> Schema:
    """Return the table in JSON Schema (draft 7), by which editors check and complete TOML.

    It holds the rules of each row and section; only `validate` checks rules on the model or between sections.
    """
    made = Case.model_json_schema(schema_generator=_Generator)
    records = made.pop("$defs")
    made["required"] = ["mesh", *made["required"]]
    title = {"$schema": "http://json-schema.org/draft-07/schema#", "title": "A case of lacsolver"}
    return {**_inlined(made, records), **title}


def _inlined(schema: Any, records: Schema) -> Any:
    """Return a schema with those that it refers to in their places."""
    if isinstance(schema, list):
        return [_inlined(one, records) for one in schema]
    if not isinstance(schema, dict):
        return schema
    whole = records[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else {}
    own = {name: one for name, one in schema.items() if name != "$ref"}
    return {name: _inlined(one, records) for name, one in {**whole, **own}.items()}


def page_tables() -> dict[str, str]:
    """Return the tables of docs/case.md, by the names of their markers."""
    tables = {r.SECTION.name or "top": "\n".join(_key_table(r)) for r in records()}
    return {**tables, "formulas": "\n".join(_formula_table())}


def _key_table(record: Any) -> Iterator[str]:
    section = record.SECTION
    if section.name:
        yield f"### {section.header}\n\n{section.meaning[0].upper()}{section.meaning[1:]}.\n"
    yield "| key | takes | unit | default | meaning |\n|---|---|---|---|---|"
    for name, key in record.KEYS.items():
        default = told_default(key, record.DEFAULTS[name])
        takes = f"{key.kind.words}{', ramped' if key.load else ''}"
        yield f"| `{name}` | {_takes(key, takes)} | {key.unit} | {default} | {key.text} |"
    rules = _rules(section)
    if rules:
        yield f"\n{'; '.join(rules)[0].upper()}{'; '.join(rules)[1:]}."


def _takes(key: Key, words: str) -> str:
    if not key.kind.options:
        return words
    only = key.kind.kinematics
    return "<br>".join(
        f"`{word}`: {meaning}" + (f" ({only[word]})" if word in only else "")
        for word, meaning in key.kind.options.items()
    )


def _formula_table() -> Iterator[str]:
    yield "| in a formula | means |\n|---|---|"
    yield from (f"| `{name}` | {meaning} |" for name, meaning in VARIABLES.items())
    yield from (f"| `{name}` | {value} |" for name, value in CONSTANTS.items())
    for name, (least, most, meaning) in FUNCTIONS.items():
        arguments = ", ".join("abc"[: most or least]) + ("" if most else ", ...")
        yield f"| `{name}({arguments})` | {meaning} |"
