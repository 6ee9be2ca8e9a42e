"""The folder of sources of the site: the pages of docs/ as they stand, those made from the code, and their order.

The order of the site is that of the index, docs/README.md: a section for each of its headings, with the pages that it
links to. Files that a page links to lie beside the pages as in the repository, so that links need no change.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from lacmesh.cli import PROGRAM as LACMESH
from lacsolver.case.schema import json_schema
from lacsolver.cli import PROGRAM as LACSOLVER
from verification.cli import PROGRAM as VERIFICATION
from web import commands, gallery, library

ROOT = Path(__file__).resolve().parents[2]
INDEX = ROOT / "docs" / "README.md"
LINK = re.compile(r"(\]\()([^)\s#]*)((?:#[^)\s]*)?\))")
#: too long a page for a browser; the same report as a page that is made for one
REPORT = {"docs/verification/report.md": "docs/verification/report.html"}
#: pages whose own title would not do in the list of all
TITLES = {"README.md": "Install and first commands <README>"}
#: pages made from the code, by the section of the index that they are added to
MADE = {
    "Start here": ("gallery",),
    "Reference": (
        "reference/lacsolver", "reference/lacmesh", "reference/verification", "reference/python_lacsolver",
        "reference/python_lacmesh",
    ),
}  # fmt: skip


def stage(folder: Path) -> None:
    """Write all sources into a folder, which is emptied first."""
    shutil.rmtree(folder, ignore_errors=True)
    pages = {page for _, names in sections() for page in names}
    for name in sorted(pages):
        _copy(name, folder, pages)
    made = made_pages()
    for name, text in made.items():
        path = folder / f"{name}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        _copy_linked(text, Path(), folder, pages)
    schema = json.dumps(json_schema(), ensure_ascii=False, indent=2)
    (folder / "reference" / "case.schema.json").write_text(schema, encoding="utf-8")
    shutil.copy(Path(__file__).with_name("style.css"), folder)


def sections() -> list[tuple[str, list[str]]]:
    """(heading, pages) of the index, in its order; a page is where it is named first. Paths from the root."""
    text = INDEX.read_text(encoding="utf-8")
    known: set[str] = set()
    result = []
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        heading, _, body = part.partition("\n")
        names = [
            _inside(INDEX.parent / link[1]) for link in LINK.findall(body) if link[1].endswith(".md") and link[2] == ")"
        ]
        fresh = [name for name in dict.fromkeys(names) if name not in known and name not in REPORT]
        known |= set(fresh)
        result.append((heading, fresh))
    return result


def made_pages() -> dict[str, str]:
    """Name -> text of the pages that are made from the code, and of the first page."""
    return {
        "index": first_page(),
        "gallery": gallery.page(),
        "reference/lacmesh": commands.page(LACMESH, "lacmesh"),
        "reference/lacsolver": commands.page(LACSOLVER, "lacsolver"),
        "reference/verification": commands.page(VERIFICATION, "python -m verification"),
        "reference/python_lacmesh": library.page("lacmesh"),
        "reference/python_lacsolver": library.page("lacsolver"),
    }


def first_page() -> str:
    """The landing page: what the README says first, a film, a command, and the sections with their pages."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    about = readme.partition("\n![")[0]
    command = re.findall(r"^(\$ lacsolver run .*)$", readme, re.MULTILINE)[-1]
    lines = [about, "", "![Ironing: a die is pressed into rubber and moved](docs/sliding/ironing_3d.gif)", ""]
    lines += [
        "```console",
        command,
        "```",
        "",
        "[Install, and the commands before it](README.md). [All pictures](gallery.md).",
        "",
    ]
    for heading, pages in sections():
        names = [TITLES.get(name, name.removesuffix(".md")) for name in pages] + list(MADE.get(heading, ()))
        if not names:
            continue
        lines += ["```{toctree}", ":hidden:", f":caption: {heading}", "", *names, "```", ""]
    return "\n".join([*lines, *_directory()])


def _directory() -> Iterator[str]:
    """The tables of the index, as they stand, but for their links."""
    text = INDEX.read_text(encoding="utf-8")
    body = "\n## " + text.partition("\n## ")[2].partition("\n## How these pages")[0]
    yield LINK.sub(lambda m: m[1] + (_inside(INDEX.parent / m[2]) if m[2] and ":" not in m[2] else m[2]) + m[3], body)


def _copy(name: str, folder: Path, pages: set[str]) -> None:
    """Copy a page, and the files that it links to; links to what is no page of the site are mended."""
    text = (ROOT / name).read_text(encoding="utf-8")
    here = Path(name).parent

    def mended(match: re.Match[str]) -> str:
        target = _inside(ROOT / here / match[2]) if match[2] and ":" not in match[2] else ""
        other = REPORT.get(target) or ("index.md" if target == _inside(INDEX) else "")
        return f"{match[1]}{os.path.relpath(other, here)})" if other else match[0]

    text = LINK.sub(mended, text)
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")
    _copy_linked(text, here, folder, pages)


def _copy_linked(text: str, here: Path, folder: Path, pages: set[str]) -> None:
    """Copy the files that a page links to and that are no pages of the site."""
    for _, target, _ in LINK.findall(text):
        if not target or ":" in target:
            continue
        path = ROOT / here / target
        if path.is_file() and _inside(path) not in pages:
            (folder / _inside(path)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, folder / _inside(path))


def _inside(path: Path) -> str:
    """The path from the root of the repository."""
    return path.resolve().relative_to(ROOT).as_posix()
