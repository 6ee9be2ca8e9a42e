"""docs/bad_input.md: what is said of every bad input; `python -m tests.bad_input.page` writes it again."""

from __future__ import annotations

import re
import tempfile
import textwrap
from itertools import product
from pathlib import Path
from typing import NamedTuple

from tests.bad_input import case, stop_cases
from tests.bad_input.case import Case, Outcome
from tests.bad_input.corpus import all_cases
from tests.bad_input.stop_cases import Stop

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bad_input.md"
BEGIN, END = "<!-- cases: begin -->", "<!-- cases: end -->"

#: What is decided for each kind, in the order of the page: title, and a sentence or two.
KINDS = {
    "not a mesh": (
        "Files that are no mesh",
        "A file is known by its first bytes, whatever its suffix. A pipe is refused: it gives its content once.",
    ),
    "cut short": (
        "Files that are cut short",
        "No part of a truncated file is taken for the whole, wherever it ends.",
    ),
    "magic": ("Files that begin otherwise", "What begins as no format does is not searched for a mesh."),
    "version": ("Versions", "A version that is not read is refused, with the way to one that is."),
    "sections": (
        "Parts of a file",
        "What must be there is missed, what may be there once is refused twice. What nobody knows is left out, and "
        "named.",
    ),
    "counts": (
        "Counts",
        "What a file announces is compared with what it holds before any memory is taken.",
    ),
    "numbers": (
        "Numbers of nodes and cells, and what is no number",
        "Numbers must tell nodes and cells apart. Where a format only carries them (MED) they are counted anew, which "
        "is said; where its cells are made of them they are an error.",
    ),
    "coordinates": (
        "Coordinates",
        "A coordinate that is no finite number is an error when it is read, in every command. A mesh that is flat or "
        "inverted is a mesh: it is read, cut with a warning, and `lacmesh check` and `lacmesh quality` say where.",
    ),
    "nodes of cells": (
        "Nodes of cells",
        "A node that is not there is an error. A node that stands twice in a cell is not: many meshers collapse cells "
        "that way. Such a cell is read; behind a slave face it is cut with a warning where its facet is whole.",
    ),
    "types": ("Types of cells", "A type that cannot be kept is an error, so that no cell is lost without a word."),
    "content": ("Meshes without content", "A file without cells is a mesh; it has no group to cut."),
    "names": ("Names", "UTF-8, or else Latin-1. Control characters of a name are shown as escapes in messages."),
    "groups": ("Groups", "A name that is not there is answered with those that are like it."),
    "slave faces": (
        "Slave faces",
        "A slave face needs a cell behind it. A face that stands twice is one face: both copies are cut alike.",
    ),
    "fields": (
        "Fields",
        "A field that does not fit the mesh is an error; one that is outside it is left out, and said.",
    ),
    "links": ("Links inside and between files", "What another file holds is not fetched."),
    "our notes": (
        "lacmesh's own notes",
        "In msh they hold groups and cells: damaged ones are an error. In MED they hold only names and tags: damaged "
        "ones are left out, and said.",
    ),
    "several meshes": ("Several meshes in a file", "None is chosen for the user."),
    "verdicts": (
        "Meshes that cannot be used",
        "What a command was asked to see to is not so: nothing is written, and the status is 1. `lacmesh check` prints "
        "its findings first; `lacmesh quality` measures, and its status is 0 whatever it measures.",
    ),
    "decks": (
        "Decks that contradict themselves",
        "A deck is judged where it is written as a deck: `info` and `check` need its mesh alone. `--lenient` goes on "
        "with a warning.",
    ),
    "geometry": (
        "Geometry",
        "`lacmesh mesh` lets gmsh work in a process of its own, so that gmsh may fail in any way, and may be stopped.",
    ),
    "request": ("Commands", "A wrong command does nothing."),
    "output": ("Places of the output", "They are looked at before anything is read."),
    "permission": ("Permissions", "Whether a file may be made in the folder is known before anything is read."),
    "full disk": (
        "A full disk",
        "The output is written beside its place and renamed when it is whole and on the disk.",
    ),
    "stopped": (
        "Interrupted, terminated",
        "SIGINT and SIGTERM stop the command wherever it is (in the middle of a MED file: when HDF5 has closed it; of "
        "the two files of XDMF: when both are in their place).",
    ),
}


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


def written(rows: dict[str, dict[Row, list[str]]]) -> str:
    """The tables, from kind -> row -> formats."""
    lines = []
    for kind, (title, decision) in KINDS.items():
        lines += [f"## {title}", "", textwrap.fill(decision, 120, break_long_words=False), ""]
        lines += ["| what is wrong | in | status | what is said |", "|---|---|---:|---|"]
        lines += [_line(whats, *answer) for answer, whats in _alike(rows[kind]).items()]
        lines.append("")
    return "\n".join(lines)


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
    return (KINDS[case.kind][0], _safe(line.what), case.format), f"{line.status} {_safe(line.said) or 'nothing'}"


def main() -> None:
    """Run all cases, and write the page."""
    rows: dict[str, dict[Row, list[str]]] = {kind: {} for kind in KINDS}
    for one in (*all_cases(), *stop_cases.cases()):
        with tempfile.TemporaryDirectory() as folder:
            outcome = stop_cases.run(one, Path(folder)) if isinstance(one, Stop) else case.run(one, Path(folder))
        rows[one.kind].setdefault(row(one, outcome), []).append(one.format)
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    text = f"{before}{BEGIN}\n{written(rows)}{END}{rest.split(END)[1]}"
    PAGE.write_text(text, encoding="utf-8")
    print(f"{PAGE}: {len(all_cases()) + len(stop_cases.cases())} cases")


if __name__ == "__main__":
    main()
