"""Reports in Markdown, and pages of HTML made from it that need nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from importlib import import_module

_STYLE = """body { font: 15px/1.5 system-ui, sans-serif; color: #1d2733 }
body { margin: 2rem auto; max-width: 70rem; padding: 0 1rem }
table { border-collapse: collapse; font-variant-numeric: tabular-nums } td, th { padding: .2rem .7rem }
th { text-align: left; border-bottom: 2px solid #c9d1da } td { border-bottom: 1px solid #e2e5e8 }
img { max-width: 100% } pre { background: #f5f6f7; padding: .7rem; overflow: auto }"""


def plain(text: str) -> str:
    r"""Return text as Markdown in which signs are only signs.

    >>> plain("a|b*")
    'a\\|b\\*'
    """
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text.replace("\n", " "))
    for sign in "\\`*_<>[]|&#":
        text = text.replace(sign, "\\" + sign)
    return text


def table(names: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown: rows of words under the names of columns."""
    head = list(names)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def html_page(text: str, title: str) -> str:
    """Return Markdown as a page of HTML without scripts, whose pictures are in the page (`data:`)."""
    body = import_module("markdown_it").MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    head = f'<meta charset="utf-8">\n<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
    head += f"<title>{escape(title)}</title>\n<style>\n{_STYLE}\n</style>"
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}</body>\n</html>\n'
