"""Write the tables of docs/bad_input.md again: `python docs/make_bad_input.py`.

Every case of tests/bad_input is run, and what is said of it stands in the table of its kind; what the page says above
a table stays.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.bad_input import case, command_cases
from tests.bad_input.test_bad_input import PAGE, Row, all_cases, row, title_of


def main() -> None:
    """Run all cases, and write the page."""
    stops = command_cases.stops()
    rows: dict[str, dict[Row, list[str]]] = {}
    for one in (*all_cases(), *stops):
        with tempfile.TemporaryDirectory() as folder:
            outcome = (command_cases.run_stopped if one in stops else case.run)(one, Path(folder))
        rows.setdefault(title_of(one.kind), {}).setdefault(row(one, outcome), []).append(one.format)
    text = PAGE.read_text(encoding="utf-8")
    for title, found in rows.items():
        table = re.compile(rf"\n## {re.escape(title)}\n[^|]*(?:\|[^\n]*\n){{2}}((?:\|[^\n]*\n)*)").search(text)
        assert table is not None, title
        begin, end = table.span(1)
        text = text[:begin] + "".join(_lines(found)) + text[end:]
    PAGE.write_text(text, encoding="utf-8")


def _lines(rows: dict[Row, list[str]]) -> list[str]:
    """The lines of a table; inputs that get the same answer in the same formats are one."""
    alike: dict[tuple[str, int, str], list[str]] = {}
    for one, formats in rows.items():
        alike.setdefault((", ".join(formats), one.status, one.said), []).append(one.what)
    return [
        f"| {'; '.join(whats)} | {formats} | {status} | {said} |\n" for (formats, status, said), whats in alike.items()
    ]


if __name__ == "__main__":
    main()
