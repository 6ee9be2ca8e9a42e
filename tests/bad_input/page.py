"""docs/bad_input.md: what is said of every bad input; `python -m tests.bad_input.page` writes it again."""

from __future__ import annotations

import re
import tempfile
from functools import cache
from itertools import product
from pathlib import Path
from typing import NamedTuple

from tests.bad_input import case, command_cases, mesh_cases, stop_cases, text_cases, xml_med_cases
from tests.bad_input.case import Case, Outcome
from tests.bad_input.stop_cases import Stop

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bad_input.md"
BEGIN, END = "<!-- cases: begin -->", "<!-- cases: end -->"

#: kind -> title of its section in the page, which says what is decided for it
KINDS = {
    "not a mesh": "Files that are no mesh",
    "cut short": "Files that are cut short",
    "magic": "Files that begin otherwise",
    "version": "Versions",
    "sections": "Parts of a file",
    "counts": "Counts",
    "numbers": "Numbers of nodes and cells, and what is no number",
    "coordinates": "Coordinates",
    "nodes of cells": "Nodes of cells",
    "types": "Types of cells",
    "content": "Meshes without content",
    "names": "Names",
    "groups": "Groups",
    "slave faces": "Slave faces",
    "fields": "Fields",
    "links": "Links inside and between files",
    "our notes": "lacmesh's own notes",
    "several meshes": "Several meshes in a file",
    "verdicts": "Meshes that cannot be used",
    "decks": "Decks that contradict themselves",
    "geometry": "Geometry",
    "request": "Commands",
    "output": "Places of the output",
    "permission": "Permissions",
    "full disk": "A full disk",
    "stopped": "Interrupted, terminated",
}


@cache
def all_cases() -> tuple[Case, ...]:
    """Every case but those of `stop_cases`."""
    sources = (mesh_cases, text_cases, xml_med_cases, command_cases)
    return tuple(case for source in sources for case in source.cases())


class Row(NamedTuple):
    """An answer of the page: cases of several formats that get the same one are one."""

    what: str
    status: int
    said: str


def row(case: Case | Stop, outcome: Outcome) -> Row:
    """The line of one case; what depends on the library or the machine is left out of the sentence."""
    said = re.sub(r"\((HDF5: |choose from ).*\)", r"(\1…)", outcome.sentence)
    said = re.sub(r"is damaged \(.*\);", "is damaged (…);", said)
    said = re.sub(r"\d+ of its \d+ bytes", "… of its … bytes", said)
    said = re.sub(r"(declares \d+ bytes, in a file of) \d+", r"\1 …", said)
    said = re.sub(r"x{50,}", "x…", said)
    said = re.sub(rf"^{re.escape(tempfile.gettempdir())}/\w+", "TMPDIR", said)
    said = re.sub(r"(there are: (?:[^,]+, ){2}[^,]+), .* and \d+ more", r"\1, …", said)
    if case.kind == "geometry":  # words of gmsh, of whatever version
        said = re.sub(r"(gmsh [\w ]+) \(.*\)", r"\1 (…)", said)
        said = re.sub(r"([?)]); (Undefined|Incorrect) .*", r"\1", said)
    said = re.sub(r"\bbad\.\w+(, (line|byte) \d+| holds|(, |: )/[\w/.-]+?(?=: )|:)?", _place, said)
    return Row(case.what, outcome.status, said)


def _place(found: re.Match[str]) -> str:
    """Replace a file name and a place in it by words that are the same for all formats."""
    rest = found[1] or ""
    if found[2]:
        return "FILE, PLACE"
    if rest.startswith((", /", ": /")):
        return "FILE, " + re.sub(r"^[,:] /(?:.*/)?([^/]+/[^/]+|[^/]+)$", r"…/\1", rest)
    return f"FILE{rest}"


def written(text: str, rows: dict[str, dict[Row, list[str]]]) -> str:
    """The page with other tables, from kind -> row -> formats; what it says above them stays."""
    for kind, title in KINDS.items():
        lines = [_line(whats, *answer) for answer, whats in _alike(rows[kind]).items()]
        table = re.compile(rf"\n## {re.escape(title)}\n[^|]*(?:\|[^\n]*\n){{2}}((?:\|[^\n]*\n)*)").search(text)
        assert table is not None, title
        begin, end = table.span(1)
        text = text[:begin] + "".join(f"{line}\n" for line in lines) + text[end:]
    return text


def _alike(rows: dict[Row, list[str]]) -> dict[tuple[str, int, str], list[str]]:
    """Inputs that get the same answer in the same formats: (formats, status, sentence) -> what is wrong, each."""
    alike: dict[tuple[str, int, str], list[str]] = {}
    for one, formats in rows.items():
        alike.setdefault((", ".join(formats), one.status, one.said), []).append(one.what)
    return alike


def _line(whats: list[str], formats: str, status: int, said: str) -> str:
    return f"| {'; '.join(map(_safe, whats))} | {formats} | {status} | {_safe(said) or 'nothing'} |"


def _safe(text: str) -> str:
    return re.sub(r"([|<>*])", r"\\\1", text)


def parsed(text: str) -> dict[tuple[str, str, str], str]:
    """Parse the page: (title, what is wrong, format) -> status and sentence."""
    found = {}
    title = ""
    for line in text.split(BEGIN)[1].split(END)[0].splitlines():
        if line.startswith("## "):
            title = line[3:]
        cells = [c.strip() for c in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) == 4 and cells[0] != "what is wrong" and cells[0].strip("-"):
            for what, name in product(cells[0].split("; "), cells[1].split(", ")):
                found[title, what, name] = f"{cells[2]} {cells[3]}"
    return found


def entry(case: Case | Stop, outcome: Outcome) -> tuple[tuple[str, str, str], str]:
    """Entry of a case that `parsed` should find in the page: key, then status and sentence."""
    line = row(case, outcome)
    return (KINDS[case.kind], _safe(line.what), case.format), f"{line.status} {_safe(line.said) or 'nothing'}"


def main() -> None:
    """Run all cases, and write the page."""
    rows: dict[str, dict[Row, list[str]]] = {kind: {} for kind in KINDS}
    for one in (*all_cases(), *stop_cases.cases()):
        with tempfile.TemporaryDirectory() as folder:
            outcome = stop_cases.run(one, Path(folder)) if isinstance(one, Stop) else case.run(one, Path(folder))
        rows[one.kind].setdefault(row(one, outcome), []).append(one.format)
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8"), rows), encoding="utf-8")
    print(f"{PAGE}: {len(all_cases()) + len(stop_cases.cases())} cases")


if __name__ == "__main__":
    main()
