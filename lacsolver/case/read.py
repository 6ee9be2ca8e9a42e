"""Read a Case from a TOML file: each key by its row of the table, and every mistake reported with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

from lacmesh.errors import ReadError, RequestError, did_you_mean
from lacsolver.case.case import Case
from lacsolver.case.draft import Draft, Found, draft
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.keys import keys_of, section_of, sections_of
from lacsolver.case.lines import Lines
from lacsolver.case.misread import meant, other_than_case
from lacsolver.case.rules import check
from lacsolver.case.value import described, with_values


def read_case(path: str | Path, *, matrices: bool = False) -> Case:
    """Read a case file. `matrices`: the case is only for contact matrices, which need no material.

    Raises ReadError (with the line) if the file is not TOML text, CaseError with every other mistake.

    >>> case = read_case("data/two_blocks.toml")
    >>> case.model, case.contact[0].slave, case.steps.count
    ('3d', 'slave', 2)
    """
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise ReadError(path, other_than_case(path) or f"cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError as error:
        if other := other_than_case(path):
            raise ReadError(path, other) from None
        line = error.object.count(b"\n", 0, error.start) + 1
        raise ReadError(path, "is not UTF-8 text; save it as such", f"line {line}") from None
    if not text.strip():
        raise ReadError(path, other_than_case(path))
    return parse_case(text, path, matrices=matrices)


def as_case(case: Case | str | PathLike[str]) -> Case:
    """Return a case; a path is read. Raises ReadError, CaseError, RequestError for anything else."""
    if isinstance(case, Case):
        return case
    if isinstance(case, (str, PathLike)):
        return read_case(Path(case))
    raise RequestError(f"a case is a lacsolver.Case or the path of a case file, not {type(case).__name__}")


def parse_case(text: str, path: str | Path = "case.toml", *, matrices: bool = False) -> Case:
    r"""Return the case of a text in TOML, as if it were the file at `path`. Raises as `read_case`.

    >>> text = "mesh = 'bar.msh'\nmodel = '3d'\nmaterial = [{young = 1.0, poisson = 0.0}]\n"
    >>> text += "displacement = [{group = 'end', ux = 0.0, uy = 0.0, uz = 0.0}]"
    >>> parse_case(text).displacement[0].group
    'end'
    """
    path = Path(path)
    document, lines = _document(text, path)
    top, drafts, found = _drafts(document)
    found += [*check(top, drafts), *_needed(top, drafts, found, matrices)]
    if found:
        raise CaseError(dict.fromkeys(Issue(f.message, lines[f.path]) for f in found), path)
    return _case(top, drafts, lines, path)


def _document(text: str, path: Path) -> tuple[dict[str, Any], Lines]:
    """Return the document of a TOML text, and the lines of its keys. Raises ReadError."""
    try:
        return tomllib.loads(text), Lines(text)
    except RecursionError:
        raise ReadError(path, "is nested too deeply to be read") from None
    except ValueError as error:  # of TOML, or a whole number of thousands of digits, which has no place
        said = str(error)
        at = re.search(r" \(at line (\d+), column (\d+)\)$", said)
        if at:
            message = meant(text.split("\n")[int(at[1]) - 1])
            if not message and (other := other_than_case(path)):
                raise ReadError(path, other) from None
            raise ReadError(path, message or f"{said[: at.start()]} (column {at[2]})", f"line {at[1]}") from None
        if said.endswith(" (at end of document)"):
            last = f"line {text.count(chr(10)) + 1}"
            if message := meant(text.split("\n")[-1]):
                raise ReadError(path, message, last) from None
            raise ReadError(path, said.removesuffix(" (at end of document)") + " (the file ends)", last) from None
        raise ReadError(path, f"is no TOML text ({said})") from None


def _drafts(document: Mapping[str, Any]) -> tuple[Draft, list[Draft], list[Found]]:
    """Read the top of the file and every section; return their drafts, and the mistakes within each of them."""
    sections = sections_of(Case)
    top, found = draft(Case, (), {k: v for k, v in document.items() if k in keys_of(Case)})
    drafts = []
    for name, given in document.items():
        if name in sections:
            tables, wrong = _tables(name, sections[name], given)
            found += wrong
            for path, table in tables:
                made, mistakes = draft(sections[name], path, table)
                drafts.append(made)
                found += _explained(mistakes, made)
        elif name not in keys_of(Case):
            known = [*keys_of(Case), *sections]
            what = "section" if isinstance(given, dict) or _is_tables(given) else "key"
            found.append(Found((name,), f"{name} is no {what} of a case{did_you_mean(name, known)}"))
    return top, drafts, found


def _tables(name: str, record: type, given: Any) -> tuple[list[tuple[tuple[str | int, ...], Any]], list[Found]]:
    """Return the tables of a section with their paths; and a mistake for `[x]` or `[[x]]` confused, or no table."""
    section = section_of(record)
    if section.several and _is_tables(given):
        return [((name, k), table) for k, table in enumerate(given)], []
    if not section.several and isinstance(given, dict):
        return [((name,), given)], []
    if section.several and isinstance(given, dict):  # its keys are worth reading all the same
        return [((name,), given)], [Found((name,), f"[{name}] may stand several times; write {section.header}")]
    if _is_tables(given) and given:
        message = f"[[{name}]] stands once; write {section.header}"
        return [((name, 0), given[0])], [Found((name, len(given) - 1), message)]
    return [], [Found((name,), f"{name} is {described(given)}; write {section.header} and its keys below it")]


def _is_tables(given: Any) -> bool:
    return isinstance(given, list) and all(isinstance(item, dict) for item in given)


def _explained(mistakes: list[Found], made: Draft) -> Iterator[Found]:
    """Yield the mistakes; a key that belongs at the top of the file but is below a header gets a hint."""
    elsewhere = {(*made.path, name): name for name in made.given if name in keys_of(Case)}
    for found in mistakes:
        name = elsewhere.get(found.path)
        if name is not None and name not in keys_of(made.record):
            hint = "; it belongs at the top of the file, before the first section"
            yield Found(found.path, f"{name} is no key of {section_of(made.record).header}{hint}")
        else:
            yield found


def _needed(top: Draft, drafts: list[Draft], found: list[Found], matrices: bool) -> Iterator[Found]:
    """Yield a mistake if a required section is missing, unless a mistake of that section is already reported."""
    there = {made.section for made in drafts} | {f.path[0] for f in found if f.path}
    mesh = keys_of(Case)["mesh"]
    if not top.has("mesh"):
        yield top.wrong(f"needs mesh ({mesh.meaning}; {mesh.kind.words})")
    if matrices:
        if not there & {"contact", "tie"}:
            yield top.wrong("needs a [[contact]] or a [[tie]], for its matrices are wanted")
    elif "material" not in there:
        yield top.wrong("needs a [[material]]")


def _case(top: Draft, drafts: list[Draft], lines: Lines, path: Path) -> Case:
    held: dict[str, Any] = {}
    for made in drafts:
        kind: Any = made.record
        record = kind.of_read(_placed(made, lines, path))
        if section_of(kind).several:
            held.setdefault(made.section, []).append(record)
        else:
            held[made.section] = record
    mesh = path.parent / top.values["mesh"]
    return Case.of_read({**top.values, "mesh": mesh, **held, "path": path, "place": str(path)})


def _placed(made: Draft, lines: Lines, path: Path) -> dict[str, Any]:
    """Return the values of a draft, each Value named by its file, line and key, and the record's place."""

    def place(*key: str) -> str:
        line = lines[(*made.path, *key)]
        return f"{path}, line {line}"

    def named(key: str, stored: Any) -> Any:
        return with_values(stored, lambda value: replace(value, name=f"{place(key)}: {value.name}"))

    return {**{key: named(key, stored) for key, stored in made.values.items()}, "place": place()}
