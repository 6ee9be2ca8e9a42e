"""Building blocks of a report, which a page of HTML or Markdown only has to format."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lacmesh.quality.statistics import Histogram

#: how a result, a case or a row stands; `missed`: it needs attention; `none`: a case without an outcome
Verdict = Literal["", "met", "missed", "informative", "none"]


@dataclass(frozen=True)
class Title:
    """A heading of `level` 1 (of a page) to 4."""

    text: str
    level: int = 2


@dataclass(frozen=True)
class Text:
    """Paragraphs and lists of Markdown, with words in `code`, in **bold** and in *italics*.

    `literal`: one paragraph in which such signs are only signs; `lead`: the word that it explains.
    """

    text: str
    verdict: Verdict = ""
    literal: bool = False
    lead: str = ""


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


def columns(names: Iterable[str], *, numbers: Container[str] = (), wide: Container[str] = ()) -> tuple[Column, ...]:
    """Columns by their names, those of numbers and of sentences marked."""
    return tuple(Column(name, number=name in numbers, wide=name in wide) for name in names)


@dataclass(frozen=True)
class TableCell:
    """A word of a table. `sort`: what its column is sorted by, where not by the word; `link`: the id it leads to."""

    text: str
    sort: float | None = None
    link: str = ""
    verdict: Verdict = ""


@dataclass(frozen=True)
class TableRow:
    """A row of a table. `again`: it goes on with the row above, whose first word it repeats."""

    cells: tuple[TableCell, ...]
    verdict: Verdict = ""
    again: bool = False

    @classmethod
    def of(cls, cells: Iterable[TableCell | str], verdict: Verdict = "") -> TableRow:
        """A row of cells, of which those that are only a word may be that word."""
        return cls(tuple(TableCell(cell) if isinstance(cell, str) else cell for cell in cells), verdict)


@dataclass(frozen=True)
class Table:
    """Rows under columns; the rows of `foot` stay below when the others are sorted.

    `folded`: the summary of a table that is shown folded.
    """

    columns: tuple[Column, ...]
    rows: tuple[TableRow, ...]
    foot: tuple[TableRow, ...] = ()
    folded: str = ""

    @classmethod
    def of_words(cls, heads: Sequence[Column], rows: Iterable[Sequence[str]], folded: str = "") -> Table:
        """A table of words alone.

        >>> Table.of_words(columns(["a"]), [["b"]]).rows[0].cells[0].text
        'b'
        """
        return cls(tuple(heads), tuple(map(TableRow.of, rows)), folded=folded)


@dataclass(frozen=True)
class NamedValues:
    """Names and their values."""

    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Command:
    """Command line to type."""

    text: str


@dataclass(frozen=True)
class Line:
    """A line of a plot. `style`: `line` (an exact solution), `points`, `both`, `steps` (constant between its x)."""

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    style: Literal["line", "points", "both", "steps"] = "both"


@dataclass(frozen=True)
class Plot:
    """Lines to draw. `kind`: what a report groups plots by, such as `pressure`, `Newton`, `inf-sup`."""

    kind: str
    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    log_x: bool = False
    log_y: bool = False


@dataclass(frozen=True)
class Chart:
    """A plot to draw. `slopes`: of triangles drawn beside the lines; `links`: the ids that the lines lead to."""

    plot: Plot
    slopes: tuple[float, ...] = ()
    links: tuple[str, ...] = ()


@dataclass(frozen=True)
class Bars:
    """A measure of cells before a cut and after it; `before` is None where there was none (the ratio to the parent).

    `scale`: what its values are: `unit` (0 to 1), `ratio` or `angle`.
    """

    measure: str
    scale: str
    before: Histogram | None
    after: Histogram

    @property
    def histograms(self) -> tuple[Histogram, ...]:
        """The histograms that there are, before and after."""
        return (self.after,) if self.before is None else (self.before, self.after)


@dataclass(frozen=True)
class Image:
    """A picture: its file, and what is seen on it."""

    path: Path
    alt: str


@dataclass(frozen=True)
class Figure:
    """A chart or a picture under its title.

    `id`: its own; `source`: what it is of; `link`: the id that this leads to; `command`: what makes it again.
    """

    title: str
    content: Chart | Bars | Image
    id: str = ""
    source: str = ""
    link: str = ""
    command: str = ""


@dataclass(frozen=True)
class Figures:
    """Figures that stand side by side."""

    figures: tuple[Figure, ...]


@dataclass(frozen=True)
class Drawing:
    """An <svg> element that a page of HTML shows as it is, and Markdown leaves out."""

    svg: str


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
    """A page of a report of several; `note`: a word in the list of pages."""

    id: str
    title: str
    note: str
    verdict: Verdict
    blocks: tuple[Simple | Section, ...]
