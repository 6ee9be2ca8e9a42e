"""The tables of the pages, written from the code between markers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction

from drawing.measures import own_table
from drawing.patterns import children_text, patterns
from drawing.solids import body
from lacmesh.cells import CELLS
from lacmesh.cutting.patterns import WHOLE, WHOLE_FACES
from lacmesh.exchange.targets import TARGETS, element
from lacmesh.formats.registry import FORMATS
from lacmesh.quality import corner_jacobian
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import shape
from lacsolver.case.schema import page_tables


def counts_table() -> Iterator[str]:
    """Every pattern: the macro-element, the children, what a slave face adds, and the minimum Jacobian."""
    yield from _head(
        "cell", "slave face", "variant", "macro-element", "children", "nodes added >", "cells added >",
        "internal nodes >", "minimum Jacobian >", "figure",
    )  # fmt: skip
    for p in patterns():
        whole = p.kind == WHOLE
        volume, skin = p.volume, p.skin
        nodes = len(volume.on_face) + len(volume.inside)
        cells = 0 if whole else volume.n_children + skin.n_children - 2
        variant = f"`{p.variant}`" if p.variant in ("hexa", "pyramid") else p.variant
        macro, children = (f"1 {p.face}", f"1 {p.cell}") if whole else (children_text(skin), children_text(volume))
        it = body(p)
        worst = min(float(corner_jacobian(kind, it.points[ids][None], it.flat)[0]) for kind, ids in it.children)
        yield (
            f"| {p.cell} | {p.face} | {variant} | {macro} | {children} | {nodes} | {cells} "
            f"| {len(it.pattern.carriers)} | {worst:.2f} | [drawing](figures/{p.figure}) |"
        )


def integrals_table() -> Iterator[str]:
    """For each face type, the mean of its shape functions: which nodes can carry an internal dof."""
    yield from _head("face", "corners", "mid-nodes", "centre", "inside the face")
    for name in ("SEG2", "SEG3", "TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9"):
        cell = CELLS[name]
        X, w = rule(cell.family, 6)
        mean = w @ shape(name, X) / w.sum()
        n, m = cell.n_corners, cell.n_corners + (len(cell.edges) if cell.order == 2 else 0)
        parts = [_fraction(mean[k]) if len(mean) > k else "" for k in (0, n, m)]
        if cell.dim == 1:
            parts = [parts[0], "", parts[1]] if cell.order == 2 else parts
        inside = f"node {WHOLE_FACES[name]}" if name in WHOLE_FACES else "none"
        yield f"| {name} | {' | '.join(parts)} | {inside} |"


def _fraction(value: float) -> str:
    return str(Fraction(float(value)).limit_denominator(1000)).replace("-", "\u2212")


def families_table() -> Iterator[str]:
    """Corners, edges and facets of every family."""
    yield from _head("family", "corners, reference coordinates", "edges", "facets, outward, by their corners")
    for family in dict.fromkeys(c.family for c in CELLS.values() if c.dim):
        cell = next(c for c in CELLS.values() if c.family == family and c.order == 1)
        corners = " ".join(f"({', '.join(f'{x:g}' for x in p)})" for p in cell.reference)
        yield (
            f"| {family} | {corners.replace('-', chr(0x2212))} | {' '.join(_digits(e) for e in cell.edges)} "
            f"| {' '.join(_digits(f.nodes) for f in cell.facets)} |"
        )


def suffixes_table() -> Iterator[str]:
    """Every format, and the suffixes that mean it."""
    yield from _head("format", "suffixes", "options of `lacmesh.write`")
    for form in FORMATS:
        options = ", ".join(f"`{name}`" for name in form.options)
        yield f"| {form.title} | {' '.join(form.suffixes)} | {options} |"


def elements_table() -> Iterator[str]:
    """Type of cell by target: the target's name for it."""
    yield from _head("cell", *TARGETS.values())
    for kind in CELLS:
        names = [dict.fromkeys(element(kind, target, plane=p) or "none" for p in (False, True)) for target in TARGETS]
        flat = CELLS[kind].dim == 2
        told = [" / ".join(n) if flat or len(n) < 2 else next(iter(n)) for n in names]
        yield f"| {kind} | {' | '.join(told)} |"


def targets_table() -> Iterator[str]:
    """Every pattern by target: whether it takes what the cell becomes."""
    yield from _head("cell", "slave face", "variant", "becomes", *TARGETS.values())
    for p in patterns():
        kinds = {p.cell} if p.kind == WHOLE else {block.type for block in p.volume.children}
        what = f"1 {p.cell}" if p.kind == WHOLE else children_text(p.volume)
        told = []
        for target in TARGETS:
            lacking = {k for k in {p.cell, *kinds} if element(k, target, CELLS[p.cell].dim == 2) is None}
            alone = p.cell in lacking or (target == "fenics" and kinds != {p.cell})
            told.append(f"no {', '.join(sorted(lacking & kinds))}" if lacking & kinds else "alone" if alone else "yes")
        yield f"| {p.cell} | {p.face} | {p.variant} | {what} | {' | '.join(told)} |"


def _head(*columns: str) -> Iterator[str]:
    """The head of a table; a column that ends in > is set to the right."""
    yield f"| {' | '.join(c.removesuffix(' >') for c in columns)} |"
    yield f"|{'|'.join('---:' if c.endswith(' >') else '---' for c in columns)}|"


def _digits(nodes: tuple[int, ...]) -> str:
    return "-".join(str(n) for n in nodes)


#: page -> the tables that stand in it, by the name of their markers
TABLES = {
    "cut.md": {"counts": counts_table, "integrals": integrals_table},
    "case.md": {name: table.splitlines for name, table in page_tables().items()},
    "conventions.md": {"families": families_table},
    "formats.md": {
        "suffixes": suffixes_table,
    },
    "targets.md": {"patterns": targets_table, "elements": elements_table},
    "quality.md": {"own": own_table},
}


def with_tables(page: str, text: str) -> str:
    """A page's text with its tables as they should be, between `<!-- name: begin -->` and `<!-- name: end -->`."""
    for name, rows in TABLES[page].items():
        begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
        found = re.search(f"{re.escape(begin)}\n.*?{re.escape(end)}", text, re.DOTALL)
        if not found:
            raise SystemExit(f"docs/{page} has no markers {begin} ... {end}")
        table = "\n".join(rows())
        text = text[: found.start()] + f"{begin}\n{table}\n{end}" + text[found.end() :]
    return text
