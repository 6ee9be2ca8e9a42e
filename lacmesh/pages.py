"""The pages of the documentation that come with lacmesh, for the command `docs`.

They are the files of `docs/`: in the wheel beside this module, in a checkout at its top.
"""

from __future__ import annotations

import os
import re
import sys
import webbrowser
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from lacmesh.errors import RequestError, did_you_mean
from lacmesh.examples import data_folder

#: the page with the list of all
OVERVIEW = "README"
_STYLE = "body { max-width: 60em; margin: 2em auto; padding: 0 1em; font: 16px/1.5 sans-serif } img { max-width: 100% }\
 table { border-collapse: collapse } td, th { border: 1px solid #ccc; padding: .2em .5em; text-align: left }\
 pre { background: #f4f5f7; padding: .7em; overflow: auto }"


def pages_folder() -> Path:
    """Return the folder of all pages."""
    installed = Path(__file__).parent / "docs"
    return installed if installed.is_dir() else Path(__file__).parents[1] / "docs"


def pages() -> dict[str, Path]:
    """Name -> file in Markdown of each page: those of the folder, and the tutorials.

    >>> pages()["solver"].name
    'solver.md'
    """
    folder = pages_folder()
    return {path.stem: path for path in (*sorted(folder.glob("tutorials/*.md")), *sorted(folder.glob("*.md")))}


def page(name: str = OVERVIEW) -> Path:
    """Return the file of a page. Raises RequestError.

    >>> page("solvr")
    Traceback (most recent call last):
    lacmesh.errors.RequestError: there is no page 'solvr'; did you mean solver?
    """
    known = pages()
    if name not in known:
        raise RequestError(f"there is no page {name!r}{did_you_mean(name, known)}")
    return known[name]


def write_pages(folder: Path) -> None:
    """Write every page into a folder as HTML, with the tables that the code makes."""
    with_tables = _tables().with_tables
    for path in pages().values():
        text = with_tables(path.name, path.read_text(encoding="utf-8"), built=True)
        target = folder / path.relative_to(pages_folder()).with_suffix(".html")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(_html(text, path), encoding="utf-8")


def show(file: Path) -> bool:
    """Open a file in the user's browser; False where there is none."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    return webbrowser.open(file.resolve().as_uri())


def _tables() -> Any:
    """The module `tables.py` beside the pages, which is of no package."""
    spec = spec_from_file_location("lacmesh_page_tables", pages_folder() / "tables.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _html(text: str, path: Path) -> str:
    """The HTML of a page whose file is `path`: its links lead to other pages, and to files where they are installed."""
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"html": True}).enable("table")
    tokens = parser.parse(text)
    title = path.stem
    for k, token in enumerate(tokens):
        if token.type == "heading_open":
            words = tokens[k + 1].content
            title = words if token.tag == "h1" else title
            token.attrSet("id", re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-"))
        dead = False  # a link to a file of the checkout alone: its text stays
        for child in token.children or ():
            for key in {"link_open": ("href",), "image": ("src",)}.get(child.type, ()):
                link = _link(str(child.attrs[key]), path)
                child.attrSet(key, link or "")
                dead = link is None if key == "href" else dead
            child.hidden = dead and child.type in ("link_open", "link_close")
    body = parser.renderer.render(tokens, parser.options, {})
    return f'<!doctype html><meta charset="utf-8"><title>{title}</title><style>{_STYLE}</style>\n{body}'


def _link(target: str, path: Path) -> str | None:
    """Where a link of a page leads from its HTML; None if its file is not installed.

    Pages lie as their files do; other files stay where they are.
    """
    name, mark, anchor = target.partition("#")
    if not name or ":" in name:
        return target
    if name.endswith(".md") and (path.parent / name).resolve() in {one.resolve() for one in pages().values()}:
        return f"{name.removesuffix('.md')}.html{mark}{anchor}"
    inside = re.sub(r"^(?:\.\./)+data/", "", name)
    file = data_folder() / inside if inside != name else path.parent / name
    return file.resolve().as_uri() + mark + anchor if file.exists() else None
