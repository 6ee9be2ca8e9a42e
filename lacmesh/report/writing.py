"""Writing of reports to files, whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path

from lacmesh.errors import RequestError, did_you_mean
from lacmesh.formats.output import check_place, replace_file
from lacmesh.report.compare import CutReport
from lacmesh.report.outline import heading, outline
from lacmesh.report.pages import html_page, markdown_page

SUFFIXES = (".html", ".md", ".json")


def write_report(path: str | os.PathLike[str], report: CutReport, *, name: str = "", force: bool = True) -> None:
    """Write a report of a cut in the format of the suffix: .html (one page, opens offline), .md, .json.

    `name`: of the mesh, for the title. An existing file is replaced, whole, unless `force` is False. Raises
    RequestError, WriteError.
    """
    path = Path(path)
    check_report(path, force=force)
    replace_file(path, report_bytes(path.suffix.lower(), report, name))


def report_bytes(suffix: str, report: CutReport, name: str = "") -> bytes:
    """Content of a report in the format of a suffix."""
    if suffix == ".json":
        content = {"name": name, **report.as_json()}
        return (json.dumps(content, ensure_ascii=False, indent=1, allow_nan=False) + "\n").encode()
    from lacmesh import __version__

    blocks, footer = outline(report, name), f"lacmesh {__version__}"
    text = html_page(blocks, heading(name), footer) if suffix == ".html" else markdown_page(blocks, footer)
    return text.encode()


def check_report(path: Path, *, force: bool = True) -> None:
    """Check early that a report can be written. Raises RequestError, WriteError."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RequestError(f"{path}: no report is written as {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    check_place(path, force=force)
