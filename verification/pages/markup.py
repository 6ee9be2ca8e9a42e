"""Words as HTML and as Markdown have them: ids, signs that are only signs, and prose of Markdown as HTML."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from html import escape

_CODE = re.compile(r"`([^`]+)`")
_BOLD, _EMPHASIS = re.compile(r"\*\*([^*]+)\*\*"), re.compile(r"\*(\w[^*]*)\*")


def identifier(text: str) -> str:
    """A name as an id of HTML: without spaces and quotes."""
    return escape(re.sub(r"\s+", "-", text), quote=True)


def plain(text: str) -> str:
    """Text as Markdown in which signs are only signs.

    >>> plain("a|b*")
    'a\\\\|b\\\\*'
    """
    for sign in "\\`*_<>[]|":
        text = text.replace(sign, "\\" + sign)
    return text.replace("\n", " ")


def prose(text: str, marked: str = "") -> str:
    """Paragraphs and lists of Markdown as HTML; `marked`: attributes of the paragraphs."""
    parts = []
    for kind, lines in paragraphs(text):
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
            yield "list", _items(lines)
        elif lines:
            yield "text", lines


def _items(lines: Sequence[str]) -> list[str]:
    """Items of a list, each in one line."""
    items: list[str] = []
    for line in lines:
        if line.startswith(("- ", "* ")):
            items.append(line[2:])
        else:
            items[-1] += f" {line}"
    return items


def inline(text: str) -> str:
    """Words in `code`, in **bold** and in *italics* as HTML.

    >>> inline("`a<b` is **not** *c*")
    '<code>a&lt;b</code> is <strong>not</strong> <em>c</em>'
    """
    parts = _CODE.split(text)
    words = [_BOLD.sub(r"<strong>\1</strong>", escape(part, quote=False)) for part in parts[::2]]
    words = [_EMPHASIS.sub(r"<em>\1</em>", part) for part in words]
    code = [f"<code>{escape(part, quote=False)}</code>" for part in parts[1::2]] + [""]
    return "".join(a + b for a, b in zip(words, code, strict=True))
