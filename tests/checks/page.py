"""docs/check.md: its list of rules and its example; `python -m tests.checks.page` writes them again."""

from __future__ import annotations

import contextlib
import io
import os
import re
from pathlib import Path
from unittest.mock import patch

from lacmesh.checks import RULES

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "check.md"
ASKED = "check disc_on_block.msh --slave slave --master master --dirichlet symmetry_x"
#: columns of the terminal that the example is printed on
WIDTH = 100


def rules() -> str:
    """Every rule, errors first, in the order of the code."""
    rows = ["| rule | severity | what it means | what to do |", "|---|---|---|---|"]
    for severity in ("error", "warning", "info"):
        rows += [f"| `{k}` | {severity} | {r.means} | {r.advice} |" for k, r in RULES.items() if r.severity == severity]
    return "\n".join(rows)


def example() -> str:
    """Output of the command for data/disc_on_block.msh, without seconds and memory."""
    from rich.console import Console

    from lacmesh.cli import main

    said, here = io.StringIO(), Path.cwd()
    os.chdir(ROOT / "data")
    try:
        terminal = patch(
            "lacmesh.cli.check.console", lambda: Console(file=said, width=WIDTH, highlight=False, markup=False)
        )
        with terminal, contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            status = main(ASKED.split())
    finally:
        os.chdir(here)
    text = re.sub(r"\n{2,}", "\n\n", "\n".join(line.rstrip() for line in said.getvalue().splitlines())).strip("\n")
    text = re.sub(r"(read|check) [\d.]+ s|\d+ MB", lambda m: re.sub(r"[\d.]+", "...", m.group()), text)
    return f"```\n$ lacmesh {ASKED}\n{text}\n$ echo $?\n{status}\n```"


PARTS = {"rules": rules, "example": example}


def with_parts(text: str) -> str:
    """The page with its parts, between markers, as the code says."""
    for name, part in PARTS.items():
        begin, end = f"<!-- {name}: begin -->\n", f"\n<!-- {name}: end -->"
        before, rest = text.split(begin)
        text = before + begin + part() + end + rest.split(end, 1)[1]
    return text


if __name__ == "__main__":
    PAGE.write_text(with_parts(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
