"""Read a Case from a TOML file: each key by its row of the table, and every mistake reported with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from lacmesh.errors import ReadError, RequestError, did_you_mean
from lacsolver.case.case import Case
from lacsolver.case.entry import Entry
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.lines import KeyPath, Lines
from lacsolver.case.misread import meant, other_than_case
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
    mistakes = [*_needed(document, matrices)]
    confused, paths = _confused(document, lines)
    mistakes += confused
    case = None
    try:
        case = Case.model_validate(document, context=path)
    except ValidationError as error:
        mistakes += [_issue(one, document, paths, lines) for one in error.errors()]
    if case is not None and not mistakes:
        read = [((), case), *((at, record) for at, record in case.records() if at[0] in document)]
        for at, record in read:
            record.locate(at, lines, path)
        mistakes = [mistake for _, record in reversed(read) for mistake in record.mistakes()]
    if mistakes or case is None:
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
        raise ReadError(path, f"is not TOML ({said})") from None


def _confused(document: dict[str, Any], lines: Lines) -> tuple[list[Issue], dict[str, KeyPath]]:
    """Return mistakes for `[x]` or `[[x]]` confused, or no table, and the paths of the former; drop or mend these.

    The keys of a section whose header is wrong are worth reading all the same.
    """
    mistakes: list[Issue] = []
    paths: dict[str, KeyPath] = {}
    for name, record in Case.SECTIONS.items():
        given, header = document.get(name), record.SECTION.header
        if name not in document or (_is_tables(given) if record.SECTION.several else isinstance(given, dict)):
            continue
        message, line = f"{name} is {described(given)}; write {header} and its keys below it", lines[(name,)]
        if isinstance(given, dict):
            message, paths[name] = f"[{name}] may occur several times; write {header}", (name,)
            document[name] = [given]
        elif _is_tables(given) and given:
            message, line = f"[[{name}]] is a single section; write {header}", lines[(name, len(given) - 1)]
            document[name], paths[name] = given[0], (name, 0)
        else:
            del document[name]
        mistakes.append(Issue(message, line))
    return mistakes, paths


def _is_tables(given: Any) -> bool:
    return isinstance(given, list) and all(isinstance(item, dict) for item in given)


def _issue(one: ErrorDetails, document: Mapping[str, Any], paths: Mapping[str, KeyPath], lines: Lines) -> Issue:
    """Return a mistake that pydantic found in a key of a file; `paths`: of sections whose header is wrong."""
    first, name = str(one["loc"][0]), str(one["loc"][-1])
    record: type[Entry] | None = Case.SECTIONS.get(first)
    if record is not None:
        at = paths.get(first, one["loc"][:-1])
        if one["type"] == "extra_forbidden" and name in Case.KEYS:
            hint = "it belongs at the top of the file, before the first section"
            return Issue(f"{name} is not a key of {record.SECTION.header}; {hint}", lines[(*at, name)])
        return record.issue(one, at, lines)
    if one["type"] == "extra_forbidden":
        what = "section" if isinstance(document[name], dict) or _is_tables(document[name]) else "key"
        return Issue(
            f"{name} is not a {what} of a case{did_you_mean(name, [*Case.KEYS, *Case.SECTIONS])}", lines[(name,)]
        )
    return Case.issue(one, (), lines)


def _needed(document: Mapping[str, Any], matrices: bool) -> Iterator[Issue]:
    """Yield a mistake if the mesh or a required section is missing."""
    there, top = {name for name, given in document.items() if given != []}, Case.SECTION.header
    if "mesh" not in document:
        yield Issue(f"{top} needs mesh ({Case.KEYS['mesh'].meaning}; {Case.KEYS['mesh'].kind.words})")
    if matrices:
        if not there & {"contact", "tie"}:
            yield Issue(f"{top} needs a [[contact]] or a [[tie]], whose matrices to write")
    elif "material" not in there:
        yield Issue(f"{top} needs a [[material]]")
