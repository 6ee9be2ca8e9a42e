"""Blocks of a report, each in both forms: HTML, for a page that needs nothing else, and Markdown.

A page is put together from blocks by `pages`; figures hold charts (`charts`), histograms (`histograms`) or pictures.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Literal, NamedTuple

from verification.pages.images import address
from verification.pages.markup import identifier, plain
from verification.pages.markup import prose as prose_html

#: how a result, a case or a row stands; `missed`: it needs attention; `none`: a case without an outcome
Verdict = Literal["", "met", "missed", "informative", "none"]
#: an option of the command in a sentence, and its value
_OPTION = re.compile(r"--[a-z]+(?:-[a-z]+)*(?: (?:pyramid|hexa|auto)\b)?")


class ReportBlock(NamedTuple):
    """A part of a report in both forms. What only a page shows has no Markdown."""

    html: str
    markdown: str


def title(text: str, level: int = 2) -> ReportBlock:
    """A heading of `level` 1 (of a page) to 4."""
    return ReportBlock(f"<h{level}>{escape(text)}</h{level}>", f"{'#' * level} {plain(text)}")


def prose(text: str) -> ReportBlock:
    """Paragraphs and lists of Markdown, with words in `code`, in **bold** and in *italics*."""
    return ReportBlock(prose_html(text), text.strip())


def sentence(text: str, verdict: Verdict = "", lead: str = "") -> ReportBlock:
    """A paragraph in which the signs of Markdown are only signs; `lead`: the word that it explains."""
    marked = f' class="{verdict}"' if verdict else ""
    first = f"<b{marked}>{escape(lead)}</b>: " if lead else ""
    words = _OPTION.sub(r"<code>\g<0></code>", escape(text))
    bold = f"**{plain(lead)}**: " if lead else ""
    return ReportBlock(f"<p{'' if lead else marked}>{first}{words}</p>", f"{bold}{plain(text)}")


def fact(label: str, value: str, note: str = "", verdict: Verdict = "") -> ReportBlock:
    """A number to be seen first, and a word on it."""
    return ReportBlock(
        f'<div class="fact {verdict}"><span>{escape(label)}</span><b>{escape(value)}</b>'
        f"<span>{escape(note)}</span></div>",
        f"- {plain(label)}: **{plain(value)}**" + (f" ({plain(note)})" if note else ""),
    )


def facts(numbers: Iterable[ReportBlock]) -> ReportBlock:
    """Several of `fact`, side by side."""
    numbers = tuple(numbers)
    html = "".join(number.html for number in numbers)
    return ReportBlock(f'<div class="facts">{html}</div>', "\n".join(number.markdown for number in numbers))


def named_values(pairs: Iterable[tuple[str, str]]) -> ReportBlock:
    """Names and their values."""
    pairs = tuple(pairs)
    rows = "".join(f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>" for name, value in pairs)
    return ReportBlock(f"<dl>{rows}</dl>", "; ".join(f"{plain(name)}: {plain(value)}" for name, value in pairs))


def command(text: str) -> ReportBlock:
    """A command line to type."""
    return ReportBlock(f'<p class="command"><code>{escape(text)}</code></p>', f"```console\n$ {text}\n```")


def drawing(svg: str) -> ReportBlock:
    """An <svg> element, which a page shows as it is."""
    return ReportBlock(svg, "")


def section(name: str, heading: str, note: str, verdict: Verdict, blocks: Iterable[ReportBlock]) -> ReportBlock:
    """A section on one case, with an id, folded where a page has many."""
    blocks = tuple(blocks)
    body = "\n".join(block.html for block in blocks)
    return ReportBlock(
        f'<details class="case {verdict}" id="{identifier(name)}" open><summary><h3>{escape(heading)}</h3>'
        f'<span class="badge {verdict}">{escape(note)}</span></summary>\n{body}\n</details>',
        as_markdown([ReportBlock("", f"### {plain(heading)} ({plain(note)})"), *blocks]),
    )


def as_markdown(blocks: Iterable[ReportBlock]) -> str:
    """Blocks one below the other, as Markdown."""
    return "\n\n".join(block.markdown for block in blocks if block.markdown)


# ---- tables


class TableCell(NamedTuple):
    """A word of a table. `sort`: what its column is sorted by, where not by the word; `link`: the id it leads to."""

    text: str
    sort: float | None = None
    link: str = ""
    verdict: Verdict = ""


class TableRow(NamedTuple):
    """A row of a table, cells or only words. `again`: it goes on with the row above, whose first word it repeats."""

    cells: Sequence[TableCell | str]
    verdict: Verdict = ""
    again: bool = False


def table(
    names: Sequence[str],
    rows: Sequence[TableRow],
    *,
    numbers: Container[str] = (),
    wide: Container[str] = (),
    foot: Sequence[TableRow] = (),
    folded: str = "",
) -> ReportBlock:
    """Rows under the names of columns: those of `numbers` are set to the right, `wide` ones hold sentences.

    The rows of `foot` stay below when the others are sorted. `folded`: the summary of a table that is shown folded.
    """
    kinds = [' class="n"' if name in numbers else ' class="w"' if name in wide else "" for name in names]
    head = "".join(f'<th{kind} scope="col">{escape(name)}</th>' for name, kind in zip(names, kinds, strict=True))
    body, end = ("".join(_row_html(row, kinds) for row in part) for part in (rows, foot))
    end = f"<tfoot>{end}</tfoot>" if end else ""
    html = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody>{end}</table>"
    html = f'<div class="scroll" tabindex="0">{html}</div>'
    html = f"<details><summary>{escape(folded)}</summary>{html}</details>" if folded else html
    lines = [f"**{plain(folded)}**", ""] if folded else []
    lines.append(f"| {' | '.join(map(plain, names))} |")
    lines.append(f"|{'|'.join('---:' if name in numbers else '---' for name in names)}|")
    return ReportBlock(html, "\n".join([*lines, *(_row_markdown(row) for row in (*rows, *foot))]))


def _cells(row: TableRow) -> list[TableCell]:
    return [TableCell(cell) if isinstance(cell, str) else cell for cell in row.cells]


def _row_html(row: TableRow, kinds: Sequence[str]) -> str:
    classes = " ".join(filter(None, (row.verdict, "again" if row.again else "")))
    marked = f' class="{classes}"' if classes else ""
    return f"<tr{marked}>{''.join(_cell_html(cell, kind) for cell, kind in zip(_cells(row), kinds, strict=True))}</tr>"


def _cell_html(cell: TableCell, kind: str) -> str:
    text = escape(cell.text, quote=False)
    if cell.link:
        text = f'<a href="#{identifier(cell.link)}">{text}</a>'
    if cell.verdict:
        text = f'<span class="badge {cell.verdict}">{text}</span>'
    sort = "" if cell.sort is None or math.isnan(cell.sort) else f' data-sort="{cell.sort:.17g}"'
    return f"<td{kind}{sort}>{text}</td>"


def _row_markdown(row: TableRow) -> str:
    words = (f"**{plain(c.text)}**" if c.verdict in ("missed", "none") else plain(c.text) for c in _cells(row))
    return f"| {' | '.join(words)} |"


# ---- figures


def figure(
    heading: str, html: str, markdown: str = "", *, name: str = "", source: str = "", link: str = "", command: str = ""
) -> ReportBlock:
    """A chart or a picture under its title.

    `name`: its id; `source`: what it is of; `link`: the id that this leads to; `command`: what makes it again.
    """
    own = f' id="{identifier(name)}"' if name else ""
    caption = (
        f'<figcaption><a href="#{identifier(link)}">{escape(source)}</a> <code>{escape(command)}</code></figcaption>'
        if source
        else ""
    )
    return ReportBlock(f"<figure{own}><h4>{escape(heading)}</h4>{html}{caption}</figure>", markdown)


def figures(content: Iterable[ReportBlock]) -> ReportBlock:
    """Several of `figure`, side by side."""
    content = tuple(content)
    html = "".join(one.html for one in content)
    return ReportBlock(f'<div class="figures">{html}</div>', "\n".join(one.markdown for one in content if one.markdown))


def picture(path: Path, alt: str) -> str:
    """A picture of a file as HTML, in the page itself; a sentence where the file is gone."""
    try:
        source = address(path)
    except OSError:
        return f'<p class="none">The picture {escape(path.name)} is not in the folder of the run.</p>'
    return (
        f'<button class="enlarge" title="larger, smaller"><img src="{source}" alt="{escape(alt, quote=True)}"></button>'
    )
