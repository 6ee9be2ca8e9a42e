"""A report as Markdown: tables, and histograms in characters; other charts and pictures are left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lacmesh.report.blocks import (
    Bars,
    Command,
    Drawing,
    Facts,
    Figures,
    Image,
    NamedValues,
    Page,
    Section,
    Simple,
    Table,
    TableCell,
    TableRow,
    Text,
    Title,
)
from lacmesh.report.histograms import text


def page(content: Iterable[Simple], footer: str) -> str:
    """A single page as Markdown."""
    return "\n\n".join([*blocks(content), footer]) + "\n"


def pages(content: Iterable[Page], footer: str) -> str:
    """Several pages as Markdown, one after the other."""
    parts = [text for page in content for text in _page(page)]
    return "\n\n".join([*parts, footer]) + "\n"


def blocks(content: Iterable[Simple], deeper: int = 0) -> Iterator[str]:
    """Blocks as Markdown; `deeper`: levels by which headings are lowered."""
    yield from filter(None, (_block(block, deeper) for block in content))


def _page(page: Page) -> Iterator[str]:
    yield f"# {plain(page.title)}"
    for block in page.blocks:
        if isinstance(block, Section):
            yield f"### {plain(block.title)} ({plain(block.note)})"
            yield from blocks(block.blocks, 1)
        else:
            yield from blocks([block])


def _block(block: Simple, deeper: int) -> str:
    match block:
        case Title():
            return f"{'#' * (block.level + deeper)} {plain(block.text)}"
        case Text():
            lead = f"**{plain(block.lead)}**: " if block.lead else ""
            return f"{lead}{plain(block.text)}" if block.literal else block.text.strip()
        case Facts():
            return "\n".join(f"- {plain(f.label)}: {_bold(f.value, f.note)}" for f in block.facts)
        case Table():
            return _table(block)
        case NamedValues():
            return "; ".join(f"{plain(name)}: {plain(value)}" for name, value in block.pairs)
        case Command():
            return f"```console\n$ {block.text}\n```"
        case Figures():
            return _figures(block)
        case Drawing():
            return ""


def _bold(value: str, note: str) -> str:
    return f"**{plain(value)}**" + (f" ({plain(note)})" if note else "")


def _figures(figures: Figures) -> str:
    """Histograms in characters, and the files of pictures in the folder of a run."""
    bars = [text(figure.content) for figure in figures.figures if isinstance(figure.content, Bars)]
    pictures = [(figure, figure.content) for figure in figures.figures if isinstance(figure.content, Image)]
    lines = [f"- {plain(f.source)}, {plain(f.title)}: `cases/{i.path.parent.name}/{i.path.name}`" for f, i in pictures]
    return "\n".join([*(["```text", *bars, "```"] if bars else []), *lines])


def plain(text: str) -> str:
    """Text whose signs are only signs.

    >>> plain("a|b*")
    'a\\\\|b\\\\*'
    """
    for sign in "\\`*_<>[]|":
        text = text.replace(sign, "\\" + sign)
    return text.replace("\n", " ")


def _table(table: Table) -> str:
    head = f"| {' | '.join(plain(c.name) for c in table.columns)} |"
    rule = f"|{'|'.join('---:' if c.number else '---' for c in table.columns)}|"
    folded = [f"**{plain(table.folded)}**", ""] if table.folded else []
    return "\n".join([*folded, head, rule, *(_row(row) for row in (*table.rows, *table.foot))])


def _row(row: TableRow) -> str:
    return f"| {' | '.join(_cell(cell) for cell in row.cells)} |"


def _cell(cell: TableCell) -> str:
    return f"**{plain(cell.text)}**" if cell.verdict in ("missed", "none") else plain(cell.text)
