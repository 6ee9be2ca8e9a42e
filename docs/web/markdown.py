"""Markdown of texts that are plain or nearly so: docstrings and help."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator


def escaped(text: str) -> str:
    """The text with the marks of HTML, links and tables escaped, but for those between backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    plain = [re.sub(r"([<*|\[\]])", r"\\\1", part) if k % 2 == 0 else part for k, part in enumerate(parts)]
    return "".join(part.replace("|", r"\|") if k % 2 else plain[k] for k, part in enumerate(parts))


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """The lines of a table; none without rows."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    names = list(head)
    return [f"| {' | '.join(names)} |", "|---" * len(names) + "|", *lines, ""] if lines else []


def of_docstring(text: str) -> Iterator[str]:
    """The lines of a docstring: paragraphs, indented blocks and examples as code."""
    for block in re.split(r"\n\s*\n", inspect.cleandoc(text)):
        if block.lstrip().startswith(">>>"):
            yield from ("```pycon", *block.splitlines(), "```")
        elif all(line.startswith("    ") for line in block.splitlines()):
            yield from ("```text", *(line[4:] for line in block.splitlines()), "```")
        else:
            yield escaped(block)
        yield ""
