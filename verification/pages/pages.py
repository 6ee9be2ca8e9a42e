"""Pages of blocks as files: HTML that needs nothing else, with style, script, charts and pictures in it, or Markdown.

There is a list of pages to choose from; without its script, and on paper, all are seen, one below the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from html import escape
from importlib.resources import files
from typing import NamedTuple

from verification.pages.blocks import ReportBlock, Verdict, as_markdown
from verification.pages.markup import identifier, plain

_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


class Page(NamedTuple):
    """A page of a report of several; `note`: a word in the list of pages."""

    id: str
    title: str
    note: str
    verdict: Verdict
    blocks: tuple[ReportBlock, ...]


def html_pages(content: Sequence[Page], footer: str, style: str = "") -> str:
    """Document of several pages, with a list to choose from; `style`: more rules of CSS."""
    links = "".join(f"<li>{_link_to(page)}</li>" for page in content)
    body = "\n".join(map(_section, content))
    return _document(
        content[0].title,
        _text("page.css") + _text("pages.css") + style,
        f'<nav aria-label="Pages"><ul>{links}</ul>'
        '<label class="only"><input type="checkbox" id="short"> only what fell short</label></nav>\n'
        f"<main>\n{body}\n{_footer(footer)}\n</main>\n<script>\n{_text('pages.js')}</script>",
    )


def markdown_pages(content: Iterable[Page], footer: str) -> str:
    """Several pages as Markdown, one after the other."""
    text = as_markdown(block for page in content for block in (_heading(page), *page.blocks))
    return f"{text}\n\n{footer}\n"


def _document(title: str, style: str, body: str) -> str:
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}\n</body>\n</html>\n"
    )


def _footer(text: str) -> str:
    return f"<footer>{escape(text)}</footer>"


@cache
def _text(name: str) -> str:
    return files("verification.pages").joinpath(name).read_text(encoding="utf-8")


def _link_to(page: Page) -> str:
    name = "Summary" if page.id == "summary" else page.id
    note = f'<small class="{page.verdict}">{escape(page.note)}</small>'
    return f'<a href="#{identifier(page.id)}">{escape(name)}{note}</a>'


def _heading(page: Page) -> ReportBlock:
    return ReportBlock(f"<h1>{escape(page.title)}</h1>", f"# {plain(page.title)}")


def _section(page: Page) -> str:
    body = "\n".join(block.html for block in (_heading(page), *page.blocks))
    return f'<section class="page" id="{identifier(page.id)}">\n{body}\n</section>'
