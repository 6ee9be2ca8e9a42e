"""Reports and pictures put into files: whole or not at all."""

from __future__ import annotations

import json
import os
import secrets
from contextlib import suppress
from pathlib import Path

from lacmesh.errors import RequestError, WriteError, did_you_mean
from lacmesh.report.compare import CutReport
from lacmesh.report.html import html
from lacmesh.report.markdown import markdown
from lacmesh.report.outline import Title, outline

SUFFIXES = (".html", ".md", ".json")


def write_report(path: str | os.PathLike[str], report: CutReport, *, name: str = "", force: bool = True) -> None:
    """Write a report of a cut; the suffix says as what: .html (one page, opens offline), .md, .json.

    `name`: of the mesh, for the title. An existing file is replaced, whole, unless `force` is False. Raises
    RequestError, WriteError.
    """
    path = Path(path)
    check_report(path, force=force)
    if path.suffix.lower() == ".json":
        text = json.dumps({"name": name, **report.as_json()}, ensure_ascii=False, indent=1, allow_nan=False) + "\n"
    else:
        from lacmesh import __version__

        blocks = list(outline(report, name))
        footer = f"lacmesh {__version__}"
        title = next(block.text for block in blocks if isinstance(block, Title))
        text = html(blocks, title, footer) if path.suffix.lower() == ".html" else markdown(blocks, footer)
    replace_file(path, text.encode())


def check_report(path: Path, *, force: bool = True) -> None:
    """Say at once what would stop the writing of a report at the end. Raises RequestError, WriteError."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RequestError(f"{path}: no report is written as {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    check_free(path, force)


def check_free(path: Path, force: bool) -> None:
    """Raise RequestError where the file exists (and no `force`), WriteError where its folder does not."""
    if path.exists() and not force:
        raise RequestError(f"{path} exists already; --force replaces it")
    if path.exists() and not path.is_file():
        raise WriteError(path, "is no file; write to another one")
    if not path.parent.is_dir():
        raise WriteError(path, f"the folder {path.parent} does not exist")


def replace_file(path: Path, content: bytes) -> None:
    """Put some content into a file, beside it first: what was there stays whole until the new is."""
    beside = path.with_name(f".{path.stem[:40]}-{secrets.token_hex(8)}{path.suffix}")
    try:
        beside.write_bytes(content)
        beside.replace(path)
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error
    finally:
        with suppress(OSError):
            beside.unlink()
