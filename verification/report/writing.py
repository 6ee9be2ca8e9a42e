"""The report of a run put into files: each whole or not at all."""

from __future__ import annotations

from pathlib import Path

from lacmesh.formats.output import replace_file
from verification.report.html import html
from verification.report.markdown import markdown
from verification.report.outline import outline
from verification.running.folder import Run


def write(run: Run, path: Path) -> None:
    """Write the report of a run: `path` as HTML, and the same name with .md and .json. Raises WriteError."""
    pages = list(outline(run))
    footer = f"lacmesh {run.version}, suite {run.suite}"
    replace_file(path, html(pages, footer).encode())
    replace_file(path.with_suffix(".md"), markdown(pages, footer).encode())
    replace_file(path.with_suffix(".json"), (run.path / "results.json").read_bytes())
