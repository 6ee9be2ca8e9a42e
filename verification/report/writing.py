"""The report of a run put into files: each whole or not at all."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from lacmesh.formats.output import replace_file
from verification.pages.pages import html_pages, markdown_pages
from verification.report.outline import outline
from verification.running.folder import RESULTS, Run


def write(run: Run, path: Path) -> None:
    """Write the report of a run: `path` as HTML, and the same name with .md. Raises WriteError.

    Away from the run's folder its results stand beside the page, with .json; in that folder they are `results.json`.
    """
    style = (files("verification.report") / "problems" / "style.css").read_text(encoding="utf-8")
    pages = list(outline(run))
    footer = f"lacmesh {run.version}, suite {run.suite}"
    replace_file(path, html_pages(pages, footer, style).encode())
    replace_file(path.with_suffix(".md"), markdown_pages(pages, footer).encode())
    if not (path.parent.exists() and path.parent.samefile(run.path)):
        replace_file(path.with_suffix(".json"), (run.path / RESULTS).read_bytes())
