"""Read a Case from a TOML file: each key by its row of the table, and every mistake reported with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from lacmesh.errors import ReadError, RequestError, did_you_mean
from lacsolver.case.case import Case
from lacsolver.case.entry import Entry
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.keys import keys_of, sections_of
from lacsolver.case.lines import KeyPath, Lines
from lacsolver.case.misread import meant, other_than_case
from lacsolver.case.rules import check
from lacsolver.case.value import described


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
    if not isinstance(text, str):
        raise RequestError(f"parse_case takes a text in TOML, not {type(text).__name__}; read_case takes a path")
    path = Path(path)
    document, lines = _document(text, path)
    case, mistakes = _drafted(document, lines, path)
    mistakes += [*check(case), *_needed(case, document, matrices)]
    if mistakes:
        raise CaseError(dict.fromkeys(mistakes), path)
    assert isinstance(case.mesh, Path)
    case = case.altered(mesh=path.parent / case.mesh, path=path)
    case.settle()
    return case


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


def _drafted(document: Mapping[str, Any], lines: Lines, path: Path) -> tuple[Case, list[Issue]]:
    """Return the case with the records of all sections, and the mistakes that each of them shows."""
    sections, top = sections_of(Case), keys_of(Case)
    case, mistakes = Case.from_table({k: v for k, v in document.items() if k in top}, (), lines, path)
    for name, given in document.items():
        if name in sections:
            record = sections[name]
            tables, wrong = _tables(name, record, given, lines)
            read = [_record(record, table, at, lines, path) for at, table in tables]
            mistakes += [*wrong, *(mistake for _, some in read for mistake in some)]
            records = tuple(one for one, _ in read)
            if records or record.SECTION.several:
                case = case.altered(**{name: records if record.SECTION.several else records[0]})
        elif name not in top:
            what = "section" if isinstance(given, dict) or _is_tables(given) else "key"
            near = did_you_mean(name, [*top, *sections])
            mistakes.append(Issue(f"{name} is no {what} of a case{near}", lines[(name,)]))
    return case, mistakes


def _record(record: Any, table: Mapping[str, Any], at: KeyPath, lines: Lines, path: Path) -> tuple[Entry, list[Issue]]:
    """Return the record of a table, and its mistakes; keys that belong at the top of the file get a hint."""
    top = [name for name in table if name in keys_of(Case) and name not in keys_of(record)]
    entry, mistakes = record.from_table({k: v for k, v in table.items() if k not in top}, at, lines, path)
    hint = f"is no key of {record.SECTION.header}; it belongs at the top of the file, before the first section"
    return entry, [*mistakes, *(Issue(f"{name} {hint}", lines[(*at, name)]) for name in top)]


def _tables(name: str, record: Any, given: Any, lines: Lines) -> tuple[list[tuple[KeyPath, Any]], list[Issue]]:
    """Return the tables of a section with their paths; and a mistake for `[x]` or `[[x]]` confused, or no table."""
    section, line = record.SECTION, lines[(name,)]
    if section.several and _is_tables(given):
        return [((name, k), table) for k, table in enumerate(given)], []
    if not section.several and isinstance(given, dict):
        return [((name,), given)], []
    if section.several and isinstance(given, dict):  # its keys are worth reading all the same
        return [((name,), given)], [Issue(f"[{name}] may stand several times; write {section.header}", line)]
    if _is_tables(given) and given:
        last = lines[(name, len(given) - 1)]
        return [((name, 0), given[0])], [Issue(f"[[{name}]] stands once; write {section.header}", last)]
    return [], [Issue(f"{name} is {described(given)}; write {section.header} and its keys below it", line)]


def _is_tables(given: Any) -> bool:
    return isinstance(given, list) and all(isinstance(item, dict) for item in given)


def _needed(case: Case, document: Mapping[str, Any], matrices: bool) -> Iterator[Issue]:
    """Yield a mistake if the mesh or a required section is missing."""
    there = {name for name, given in document.items() if given != []}
    mesh = keys_of(Case)["mesh"]
    if not case.has("mesh"):
        yield case.wrong(f"needs mesh ({mesh.meaning}; {mesh.kind.words})")
    if matrices:
        if not there & {"contact", "tie"}:
            yield case.wrong("needs a [[contact]] or a [[tie]], for its matrices are wanted")
    elif "material" not in there:
        yield case.wrong("needs a [[material]]")
