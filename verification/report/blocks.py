"""Building blocks of a report, which a page of HTML or Markdown only has to format."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from verification.records import Plot

#: how a figure, a case or a row stands; `none`: a case without an outcome
Verdict = Literal["", "met", "missed", "informative", "none"]


@dataclass(frozen=True)
class Title:
    """A heading within a page, of `level` 2 or 3."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Text:
    """Paragraphs and lists, with words in `code` and in **bold**; `signs`: these signs are only signs."""

    text: str
    verdict: Verdict = ""
    signs: bool = False


@dataclass(frozen=True)
class Fact:
    """A number to be seen first, and a word on it."""

    label: str
    value: str
    note: str = ""
    verdict: Verdict = ""


@dataclass(frozen=True)
class Facts:
    """The numbers to be seen first."""

    facts: tuple[Fact, ...]


@dataclass(frozen=True)
class Column:
    """A column of a table. `number`: set to the right; `wide`: sentences, which take several lines."""

    name: str
    number: bool = False
    wide: bool = False


@dataclass(frozen=True)
class Cell:
    """A word of a table. `sort`: what its column is sorted by, where not by the word; `link`: the id it leads to."""

    text: str
    sort: float | None = None
    link: str = ""
    verdict: Verdict = ""


@dataclass(frozen=True)
class TableRow:
    """A row of a table."""

    cells: tuple[Cell, ...]
    verdict: Verdict = ""


@dataclass(frozen=True)
class Table:
    """Rows under columns; the rows of `foot` stay below when the others are sorted."""

    columns: tuple[Column, ...]
    rows: tuple[TableRow, ...]
    foot: tuple[TableRow, ...] = ()


@dataclass(frozen=True)
class NamedValues:
    """Names and their values."""

    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Command:
    """Command line to type."""

    text: str


@dataclass(frozen=True)
class Chart:
    """A plot to draw. `slopes`: of triangles drawn beside the lines; `links`: the ids that the lines lead to."""

    plot: Plot
    slopes: tuple[float, ...] = ()
    links: tuple[str, ...] = ()


@dataclass(frozen=True)
class Image:
    """A picture: its file, and what is seen on it."""

    path: Path
    alt: str


@dataclass(frozen=True)
class Figure:
    """A chart or a picture with what is told of it. `link`: the id of its case; `command`: what makes it again."""

    id: str
    title: str
    source: str
    link: str
    command: str
    content: Chart | Image


@dataclass(frozen=True)
class Figures:
    """Figures that stand side by side."""

    figures: tuple[Figure, ...]


@dataclass(frozen=True)
class Drawing:
    """The problem of a family, drawn: the name of the drawing."""

    family: str


Simple = Title | Text | Facts | Table | NamedValues | Command | Figures | Drawing


@dataclass(frozen=True)
class Section:
    """Section on one case: folded where a page has many."""

    id: str
    title: str
    note: str
    verdict: Verdict
    blocks: tuple[Simple, ...]


@dataclass(frozen=True)
class Page:
    """A page of the report; `note`: a word in the list of pages."""

    id: str
    title: str
    note: str
    verdict: Verdict
    blocks: tuple[Simple | Section, ...]
