"""Draw every pattern of the cut, and write the tables of the pages, all from the code's own tables.

    python docs/make_figures.py             write docs/figures/*.svg and the tables between markers
    python docs/make_figures.py --check     say what is out of date, and exit with 1 if anything is
    python docs/make_figures.py --png DIR   the figures as PNG, to look at

Every figure carries a digest of what it draws (the pattern, and the code that draws it), so that --check needs neither
drawing nor matplotlib. A figure has up to three panels: the new nodes in their parent, the children moved apart, the
slave face with its macro-element. Cells are shown with the slave face on top, their edges all as long. Bodies are
painted from back to front; two convex children have a plane between them, whose normal says which is in front.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from drawing.page import save
from drawing.panels import figure, overview
from drawing.patterns import Pattern, in_order, patterns, shown
from drawing.tables import TABLES, with_tables

from lacmesh.cutting.patterns import Template

DOCS = Path(__file__).resolve().parent
FIGURES = DOCS / "figures"
OVERVIEW = "patterns.svg"
_SOURCES = ("patterns", "solids", "page", "panels")


def figures() -> dict[str, list[Pattern]]:
    """File name -> the patterns that it shows."""
    return {OVERVIEW: shown(), **{p.figure: [p] for p in patterns()}}


def write_figure(name: str, path: Path) -> None:
    """Draw one figure into a file."""
    of = figures()[name]
    if name == OVERVIEW:
        page, title = overview(), "The children of a slave face's parent, moved apart"
    else:
        page, title = figure(of[0]), of[0].title
    save(page, path, name, title, f"lacmesh {digest(of)}")


def digest(of: list[Pattern]) -> str:
    """A short hash of all that a figure depends on: its patterns, and the code that draws."""

    def plain(template: Template) -> list[Any]:
        where = [np.round(x * 5040).astype(int).tolist() for x in (template.on_face, template.inside)]
        return [where, [[kind, nodes.tolist()] for kind, nodes in in_order(template)]]

    shown_here = json.dumps([[p, plain(p.volume), plain(p.skin), sorted(p.carriers)] for p in of])
    code = [(DOCS / "drawing" / f"{name}.py").read_text(encoding="utf-8") for name in _SOURCES]
    return hashlib.sha256("\n".join([shown_here, *code]).encode()).hexdigest()[:16]


def stale_figures() -> list[str]:
    """Figures that are absent, out of date, or of no pattern."""
    there = {path.name: path.read_text(encoding="utf-8") for path in FIGURES.glob("*.svg")}
    wanted = figures()
    stale = [name for name, of in wanted.items() if digest(of) not in there.get(name, "")]
    return stale + sorted(set(there) - set(wanted))


def stale_pages() -> list[str]:
    """Pages whose tables are not what the code says."""
    texts = {page: (DOCS / page).read_text(encoding="utf-8") for page in TABLES}
    return [page for page, text in texts.items() if with_tables(page, text) != text]


def main() -> int:
    """Write, check or show."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit with 1 if anything is out of date")
    parser.add_argument("--png", type=Path, metavar="DIR", help="write the figures there as PNG, and nothing else")
    args = parser.parse_args()
    if args.check:
        stale = stale_figures() + stale_pages()
        print("\n".join(f"out of date: {name}" for name in stale) or "all current")
        return 1 if stale else 0
    target = args.png or FIGURES
    target.mkdir(parents=True, exist_ok=True)
    for name in figures():
        write_figure(name, target / name if args.png is None else (target / name).with_suffix(".png"))
    if args.png is None:
        for page in TABLES:
            path = DOCS / page
            path.write_text(with_tables(page, path.read_text(encoding="utf-8")), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
