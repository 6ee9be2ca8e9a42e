"""A report as Markdown: the same without what is drawn."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from verification.report.blocks import (
    Cell,
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
    TableRow,
    Text,
    Title,
)


def markdown(pages: Iterable[Page], footer: str) -> str:
    """The pages of `outline` as Markdown."""
    parts = [text for page in pages for text in _page(page)]
    return "\n\n".join([*parts, footer]) + "\n"


def blocks(found: Iterable[Simple], deeper: int = 0) -> Iterator[str]:
    """Blocks as Markdown; `deeper`: levels by which headings are lowered."""
    for block in found:
        text = _block(block, deeper)
        if text:
            yield text


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
            return plain(block.text) if block.signs else block.text.strip()
        case Facts():
            return "\n".join(f"- {plain(f.label)}: {_bold(f.value, f.note)}" for f in block.facts)
        case Table():
            return _table(block)
        case NamedValues():
            return "; ".join(f"{plain(name)}: {plain(value)}" for name, value in block.pairs)
        case Command():
            return f"```console\n$ {block.text}\n```"
        case Figures():
            return _pictures(block)
        case Drawing():
            return ""


def _bold(value: str, note: str) -> str:
    return f"**{plain(value)}**" + (f" ({plain(note)})" if note else "")


def _pictures(figures: Figures) -> str:
    """List the files of the pictures in the folder of the run; only the charts are shown on the page."""
    found = [(f, f.content) for f in figures.figures if isinstance(f.content, Image)]
    return "\n".join(
        f"- {plain(f.source)}, {plain(f.title)}: `cases/{i.path.parent.name}/{i.path.name}`" for f, i in found
    )


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
    return "\n".join([head, rule, *(_row(row) for row in (*table.rows, *table.foot))])


def _row(row: TableRow) -> str:
    return f"| {' | '.join(_cell(cell) for cell in row.cells)} |"


def _cell(cell: Cell) -> str:
    return f"**{plain(cell.text)}**" if cell.verdict in ("missed", "none") else plain(cell.text)
