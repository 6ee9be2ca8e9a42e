"""A report as one file of HTML that needs nothing else: style, script, charts and pictures are within it.

One page has no script (`page`). Several pages have a list to choose from (`pages`); without their script, and on paper,
everything is seen, one page below the other.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from html import escape
from importlib.resources import files

from lacmesh.report import charts, histograms
from lacmesh.report.blocks import (
    Bars,
    Chart,
    Column,
    Command,
    Drawing,
    Fact,
    Facts,
    Figure,
    Figures,
    Image,
    Line,
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
from lacmesh.report.images import address

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
_SCRIPTED = f"{_POLICY}; script-src 'unsafe-inline'"
_CODE = re.compile(r"`([^`]+)`")
_BOLD, _EMPHASIS = re.compile(r"\*\*([^*]+)\*\*"), re.compile(r"\*(\w[^*]*)\*")
#: an option of the command in a literal sentence, and its value
_OPTION = re.compile(r"--[a-z]+(?:-[a-z]+)*(?: (?:pyramid|hexa|auto)\b)?")


def page(blocks: Iterable[Simple], title: str, footer: str) -> str:
    """Document of a single page, without a script."""
    body = "\n".join(_block(block) for block in blocks)
    return _document(title, _POLICY, _text("page.css"), f"<main>\n{body}\n{_footer(footer)}\n</main>")


def pages(content: Sequence[Page], footer: str, style: str = "") -> str:
    """Document of several pages, with a list to choose from; `style`: more rules of CSS."""
    links = "".join(f"<li>{_link_to(page)}</li>" for page in content)
    body = "\n".join(_page(page) for page in content)
    return _document(
        content[0].title,
        _SCRIPTED,
        _text("page.css") + _text("pages.css") + style,
        f'<nav aria-label="Pages"><ul>{links}</ul>'
        '<label class="only"><input type="checkbox" id="short"> only what fell short</label></nav>\n'
        f"<main>\n{body}\n{_footer(footer)}\n</main>\n<script>\n{_text('pages.js')}</script>",
    )


def _document(title: str, policy: str, style: str, body: str) -> str:
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _footer(text: str) -> str:
    return f"<footer>{escape(text)}</footer>"


@cache
def _text(name: str) -> str:
    return files("lacmesh.report").joinpath(name).read_text(encoding="utf-8")


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
            pairs = "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in block.pairs)
            return f"<dl>{pairs}</dl>"
        case Command():
            return f'<p class="command"><code>{escape(block.text)}</code></p>'
        case Figures():
            return _figures(block)
        case Drawing():
            return block.svg


def _prose(text: Text) -> str:
    marked = f' class="{text.verdict}"' if text.verdict else ""
    if text.literal:
        lead = f"<b{marked}>{escape(text.lead)}</b>: " if text.lead else ""
        words = _OPTION.sub(r"<code>\g<0></code>", escape(text.text))
        return f"<p{'' if lead else marked}>{lead}{words}</p>"
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
    prose = [_BOLD.sub(r"<strong>\1</strong>", escape(part, quote=False)) for part in parts[::2]]
    prose = [_EMPHASIS.sub(r"<em>\1</em>", part) for part in prose]
    code = [f"<code>{escape(part, quote=False)}</code>" for part in parts[1::2]] + [""]
    return "".join(a + b for a, b in zip(prose, code, strict=True))


def _fact(fact: Fact) -> str:
    return (
        f'<div class="fact {fact.verdict}"><span>{escape(fact.label)}</span><b>{escape(fact.value)}</b>'
        f"<span>{escape(fact.note)}</span></div>"
    )


def _table(table: Table) -> str:
    head = "".join(f'<th{_kind(c)} scope="col">{escape(c.name)}</th>' for c in table.columns)
    body = "".join(_row(row, table.columns) for row in table.rows)
    foot = "".join(_row(row, table.columns) for row in table.foot)
    end = f"<tfoot>{foot}</tfoot>" if foot else ""
    rows = f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>{end}"
    scrolled = f'<div class="scroll" tabindex="0"><table>{rows}</table></div>'
    return f"<details><summary>{escape(table.folded)}</summary>{scrolled}</details>" if table.folded else scrolled


def _kind(column: Column) -> str:
    return ' class="n"' if column.number else ' class="w"' if column.wide else ""


def _row(row: TableRow, columns: Sequence[Column]) -> str:
    classes = " ".join(filter(None, (row.verdict, "again" if row.again else "")))
    marked = f' class="{classes}"' if classes else ""
    return f"<tr{marked}>{''.join(_cell(cell, c) for cell, c in zip(row.cells, columns, strict=True))}</tr>"


def _cell(cell: TableCell, column: Column) -> str:
    text = escape(cell.text, quote=False)
    if cell.link:
        text = f'<a href="#{_id(cell.link)}">{text}</a>'
    if cell.verdict:
        text = f'<span class="badge {cell.verdict}">{text}</span>'
    sort = "" if cell.sort is None or math.isnan(cell.sort) else f' data-sort="{cell.sort:.17g}"'
    return f"<td{_kind(column)}{sort}>{text}</td>"


def _figures(figures: Figures) -> str:
    bars = any(isinstance(figure.content, Bars) for figure in figures.figures)
    key = f"{histograms.KEY}\n" if bars else ""
    return f'{key}<div class="figures">{"".join(map(_figure, figures.figures))}</div>'


def _figure(figure: Figure) -> str:
    own = f' id="{_id(figure.id)}"' if figure.id else ""
    caption = (
        f'<figcaption><a href="#{_id(figure.link)}">{escape(figure.source)}</a> <code>{escape(figure.command)}</code>'
        "</figcaption>"
    )
    title = f"<h4>{escape(figure.title)}</h4>"
    return f"<figure{own}>{title}{_content(figure.content)}{caption if figure.source else ''}</figure>"


def _content(content: Chart | Bars | Image) -> str:
    match content:
        case Chart():
            return _chart(content)
        case Bars():
            return histograms.svg(content)
        case Image():
            return _image(content)


def _image(image: Image) -> str:
    try:
        source = address(image.path)
    except OSError:
        return f'<p class="none">The picture {escape(image.path.name)} is not in the folder of the run.</p>'
    return (
        '<button class="enlarge" title="larger, smaller">'
        f'<img src="{source}" alt="{escape(image.alt, quote=True)}"></button>'
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
