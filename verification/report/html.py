"""A report as one page of HTML that needs nothing else: style, script, charts and pictures are within it.

Without its script, and on paper, everything is seen, one family below the other.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from functools import cache
from html import escape
from importlib.resources import files

from verification.records import Line
from verification.report import charts
from verification.report.blocks import (
    Cell,
    Chart,
    Column,
    Command,
    Drawing,
    Fact,
    Facts,
    Figure,
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
from verification.report.drawings import drawing
from verification.report.pictures import address

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
_CODE = re.compile(r"`([^`]+)`")
_BOLD, _EMPHASIS = re.compile(r"\*\*([^*]+)\*\*"), re.compile(r"\*(\w[^*]*)\*")


def html(pages: Sequence[Page], footer: str) -> str:
    """The pages of `outline` as one document."""
    links = "".join(f"<li>{_link_to(page)}</li>" for page in pages)
    body = "\n".join(_page(page) for page in pages)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f"<title>{escape(pages[0].title)}</title>\n<style>\n{_text('page.css')}</style>\n</head>\n<body>\n"
        f'<nav aria-label="Pages"><ul>{links}</ul>'
        '<label class="only"><input type="checkbox" id="short"> only what fell short</label></nav>\n'
        f"<main>\n{body}\n<footer>{escape(footer)}</footer>\n</main>\n"
        f"<script>\n{_text('page.js')}</script>\n</body>\n</html>\n"
    )


@cache
def _text(name: str) -> str:
    return files("verification.report").joinpath(name).read_text(encoding="utf-8")


def _link_to(page: Page) -> str:
    name = "Summary" if page.id == "summary" else page.id
    return f'<a href="#{_id(page.id)}">{escape(name)}<small class="{page.verdict}">{escape(page.note)}</small></a>'


def _id(text: str) -> str:
    """A name as an id: without spaces and quotes."""
    return escape(re.sub(r"\s+", "-", text), quote=True)


def _page(page: Page) -> str:
    body = "\n".join(_section(b) if isinstance(b, Section) else _block(b) for b in page.blocks)
    return f'<section class="page" id="{_id(page.id)}">\n<h1>{escape(page.title)}</h1>\n{body}\n</section>'


def _section(section: Section) -> str:
    body = "\n".join(_block(block) for block in section.blocks)
    return (
        f'<details class="case {section.verdict}" id="{_id(section.id)}" open><summary><h3>{escape(section.title)}</h3>'
        f'<span class="badge {section.verdict}">{escape(section.note)}</span></summary>\n{body}\n</details>'
    )


def _block(block: Simple) -> str:
    match block:
        case Title():
            return f"<h{block.level}>{escape(block.text)}</h{block.level}>"
        case Text():
            return _prose(block)
        case Facts():
            return f'<div class="facts">{"".join(map(_fact, block.facts))}</div>'
        case Table():
            return _table(block)
        case NamedValues():
            found = "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in block.pairs)
            return f"<dl>{found}</dl>"
        case Command():
            return f'<p class="command"><code>{escape(block.text)}</code></p>'
        case Figures():
            return f'<div class="figures">{"".join(map(_figure, block.figures))}</div>'
        case Drawing():
            return drawing(block.family)


def _prose(text: Text) -> str:
    marked = f' class="{text.verdict}"' if text.verdict else ""
    if text.signs:
        return f"<p{marked}>{escape(text.text)}</p>"
    parts = []
    for kind, lines in paragraphs(text.text):
        if kind == "list":
            parts.append(f"<ul>{''.join(f'<li>{inline(line)}</li>' for line in lines)}</ul>")
        else:
            parts.append(f"<p{marked}>{inline(' '.join(lines))}</p>")
    return "\n".join(parts)


def paragraphs(text: str) -> Iterator[tuple[str, list[str]]]:
    """Paragraphs and lists of Markdown: what it is, and its lines or items.

    >>> list(paragraphs("One\\ntwo.\\n\\n- a\\n- b\\n  c"))
    [('text', ['One', 'two.']), ('list', ['a', 'b c'])]
    """
    for part in re.split(r"\n\s*\n", text.strip()):
        lines = [line.strip() for line in part.splitlines()]
        if lines and lines[0].startswith(("- ", "* ")):
            yield "list", re.split(r" ?\n[-*] ", "\n" + "\n".join(_joined(lines)))[1:]
        elif lines:
            yield "text", lines


def _joined(lines: Sequence[str]) -> list[str]:
    """Items in a line each."""
    items: list[str] = []
    for line in lines:
        if line.startswith(("- ", "* ")):
            items.append(line)
        else:
            items[-1] += f" {line}"
    return items


def inline(text: str) -> str:
    """Words in `code`, in **bold** and in *italics*.

    >>> inline("`a<b` is **not** *c*")
    '<code>a&lt;b</code> is <strong>not</strong> <em>c</em>'
    """
    parts = _CODE.split(text)
    told = [_BOLD.sub(r"<strong>\1</strong>", escape(part, quote=False)) for part in parts[::2]]
    told = [_EMPHASIS.sub(r"<em>\1</em>", part) for part in told]
    code = [f"<code>{escape(part, quote=False)}</code>" for part in parts[1::2]] + [""]
    return "".join(a + b for a, b in zip(told, code, strict=True))


def _fact(fact: Fact) -> str:
    return (
        f'<div class="fact {fact.verdict}"><span>{escape(fact.label)}</span><b>{escape(fact.value)}</b>'
        f"<span>{escape(fact.note)}</span></div>"
    )


def _table(table: Table) -> str:
    head = "".join(f'<th{_kind(c)} scope="col"><button>{escape(c.name)}</button></th>' for c in table.columns)
    body = "".join(_row(row, table.columns) for row in table.rows)
    foot = "".join(_row(row, table.columns) for row in table.foot)
    end = f"<tfoot>{foot}</tfoot>" if foot else ""
    rows = f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>{end}"
    return f'<div class="scroll" tabindex="0"><table>{rows}</table></div>'


def _kind(column: Column) -> str:
    return ' class="n"' if column.number else ' class="w"' if column.wide else ""


def _row(row: TableRow, columns: Sequence[Column]) -> str:
    marked = f' class="{row.verdict}"' if row.verdict else ""
    return f"<tr{marked}>{''.join(_cell(cell, c) for cell, c in zip(row.cells, columns, strict=True))}</tr>"


def _cell(cell: Cell, column: Column) -> str:
    text = escape(cell.text, quote=False)
    if cell.link:
        text = f'<a href="#{_id(cell.link)}">{text}</a>'
    if cell.verdict:
        text = f'<span class="badge {cell.verdict}">{text}</span>'
    sort = "" if cell.sort is None or math.isnan(cell.sort) else f' data-sort="{cell.sort:.17g}"'
    return f"<td{_kind(column)}{sort}>{text}</td>"


def _figure(figure: Figure) -> str:
    content = _chart(figure.content) if isinstance(figure.content, Chart) else _image(figure.content)
    return (
        f'<figure id="{_id(figure.id)}"><h4>{escape(figure.title)}</h4>{content}<figcaption>'
        f'<a href="#{_id(figure.link)}">{escape(figure.source)}</a> <code>{escape(figure.command)}</code>'
        "</figcaption></figure>"
    )


def _image(image: Image) -> str:
    try:
        kept = address(image.path)
    except OSError:
        return f'<p class="none">The picture {escape(image.path.name)} is not in the folder of the run.</p>'
    return (
        '<button class="enlarge" title="larger, smaller">'
        f'<img src="{kept}" alt="{escape(image.alt, quote=True)}"></button>'
    )


def _chart(chart: Chart) -> str:
    lines = chart.plot.lines
    links = chart.links or ("",) * len(lines)
    named = zip(lines, charts.ranks(lines), links, strict=True)
    legend = "".join(f"<li>{_named(line, rank, link)}</li>" for line, rank, link in named if line.label)
    return f'{charts.svg(chart)}<ul class="legend">{legend}</ul>'


def _named(line: Line, rank: int, link: str) -> str:
    label = escape(line.label, quote=False)
    return charts.swatch(line, rank) + (f'<a href="#{_id(link)}">{label}</a>' if link else label)
