"""Tables of the pages that are made from the code, and all patterns of the cut.

A page has a long table where it has the line `<!-- table: name -->`: the table is in the pages that are built, for a
browser or by the command `docs`. A short one is kept in the page, between `<!-- name: begin -->` and
`<!-- name: end -->`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.checks import RULES
from lacmesh.cutting.patterns import (
    CONE,
    RING,
    RING_PARENTS,
    WHOLE,
    WHOLE_FACES,
    Template,
    face_pattern,
    internal_points,
    parent_pattern,
)
from lacmesh.exchange.targets import TARGETS, element
from lacmesh.formats.registry import FORMATS
from lacmesh.quality import corner_jacobian
from lacmesh.quality.measures import ACCEPTED
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import shape
from lacsolver.case.schema import page_tables


class Pattern(NamedTuple):
    """A way to cut: a cell type, the first of its facets of some type, and the kind of cut."""

    cell: str
    facet: int
    kind: str

    @property
    def face(self) -> str:
        """Type of the slave face."""
        return CELLS[self.cell].facets[self.facet].type

    @property
    def variant(self) -> str:
        """Name by which the user selects this kind; empty if there is no choice."""
        if self.kind == WHOLE:
            return "whole"
        if self.cell not in RING_PARENTS:
            return ""
        if self.cell == "QUAD4":
            return "default" if self.kind == RING else "beside a TRIA3"
        return "hexa" if self.kind == RING else "pyramid"

    @property
    def figure(self) -> str:
        """Name of the figure's file."""
        return f"{self.cell}_{self.face}_{self.kind}.svg".lower()

    @property
    def title(self) -> str:
        """One line that says what is cut, and into what."""
        variant = f", {self.variant}" if self.variant not in ("", "whole") else ""
        what = "left whole" if self.kind == WHOLE else children_text(self.volume)
        return f"{self.cell} by a {self.face}{variant}: {what}"

    @property
    def volume(self) -> Template:
        """The cut of the cell."""
        return parent_pattern(self.cell, self.facet, self.kind)

    @property
    def carriers(self) -> set[int]:
        """The nodes that carry an internal dof: the cell's own, or new ones, counted as the template's frame counts."""
        cell = CELLS[self.cell]
        if self.kind == WHOLE:
            return {cell.facets[self.facet].nodes[WHOLE_FACES[self.face]]}
        return {cell.n_nodes + int(p) for p in internal_points(self.face, self.kind)}

    @property
    def skin(self) -> Template:
        """The cut of the face."""
        return face_pattern(self.face, self.kind)


def patterns() -> list[Pattern]:
    """Every pattern, once: facets of the same type are cut alike."""
    found = []
    for cell in CELLS.values():
        faces = [f.type for f in cell.facets] if cell.dim > 1 else []
        for face in dict.fromkeys(faces):
            kinds = [WHOLE] if face in WHOLE_FACES else [RING, CONE] if cell.name in RING_PARENTS else [CONE]
            found += [Pattern(cell.name, faces.index(face), kind) for kind in kinds]
    return found


def children_text(template: Template) -> str:
    """The children of a pattern by type, as `3 PYRAM5 + 1 TETRA4`."""
    return " + ".join(f"{len(block.rank)} {block.type}" for block in template.children)


def in_order(template: Template) -> list[tuple[str, NDArray[np.intp]]]:
    """The children of a pattern, in their order: type and nodes."""
    ranked = [(r, b.type, nodes) for b in template.children for r, nodes in zip(b.rank, b.nodes, strict=True)]
    return [(kind, nodes) for _, kind, nodes in sorted(ranked, key=lambda child: child[0])]


def ideal(family: str) -> NDArray[np.floating]:
    """Corners of a cell whose edges are all as long: x to the right, y away, z up."""
    r = 3**0.5
    triangle = np.array([(-1, -1 / r), (1, -1 / r), (0, 2 / r)])
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    if family in ("TRIA", "QUAD"):
        return triangle if family == "TRIA" else square
    base = triangle if family in ("TETRA", "PENTA") else square
    if family in ("TETRA", "PYRAM"):
        height = (8 / 3) ** 0.5 if family == "TETRA" else 2**0.5
        return np.vstack([np.pad(base, ((0, 0), (0, 1))), [(0, 0, height)]])
    return np.vstack([np.pad(base, ((0, 0), (0, 1)), constant_values=z) for z in (-1, 1)])


def points_of(pattern: Pattern) -> NDArray[np.floating]:
    """(n, 3): the cell's own nodes in an ideal cell, the new ones on the face, those inside."""
    cell, template = CELLS[pattern.cell], pattern.volume
    where = np.vstack([np.array(cell.reference), template.on_face, template.inside])
    points = shape(cell.linear, where) @ ideal(cell.family)
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


# ---- tables


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
        points, flat = points_of(p), CELLS[p.cell].dim == 2
        worst = min(float(corner_jacobian(kind, points[ids][None], flat)[0]) for kind, ids in in_order(volume))
        yield (
            f"| {p.cell} | {p.face} | {variant} | {macro} | {children} | {nodes} | {cells} "
            f"| {len(p.carriers)} | {worst:.2f} | [drawing](figures/{p.figure}) |"
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


def rules_table() -> Iterator[str]:
    """Every rule of the check: how serious it is, its meaning, and what to do."""
    yield from _head("rule", "severity", "meaning", "what to do")
    for name, rule_ in RULES.items():
        yield f"| `{name}` | {rule_.severity} | {rule_.means} | {rule_.advice} |"


def measures_table() -> Iterator[str]:
    """Verdict's measures by type of cell: the range that Verdict accepts."""
    yield from _head("measure", *ACCEPTED)
    for name in sorted({name for ranges in ACCEPTED.values() for name in ranges}):
        cells = [_range(ranges[name]) if name in ranges else "" for ranges in ACCEPTED.values()]
        yield f"| `{name}` | {' | '.join(cells)} |"


def _range(accepted: tuple[float, float] | None) -> str:
    if accepted is None:
        return "any"
    return f"{accepted[0]:.4g} and more" if accepted[1] == inf else f"{accepted[0]:.4g} to {accepted[1]:.4g}"


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


#: page -> its tables, by the names of their marks
TABLES = {
    "check.md": {"rules": rules_table},
    "cut.md": {"counts": counts_table, "integrals": integrals_table},
    "case.md": {name: table.splitlines for name, table in page_tables().items()},
    "conventions.md": {"families": families_table},
    "formats.md": {"suffixes": suffixes_table, "patterns": targets_table, "elements": elements_table},
    "quality.md": {"measures": measures_table},
}


def with_tables(page: str, text: str, *, built: bool = False) -> str:
    """Fill in the tables of a page.

    A table of a few lines is kept in the repository, between `<!-- name: begin -->` and `<!-- name: end -->`. A long
    one is only in the built pages (`built`), where it takes the place of the line `<!-- table: name -->`.
    """
    for name, rows in TABLES.get(page, {}).items():
        begin, end, line = f"<!-- {name}: begin -->", f"<!-- {name}: end -->", f"<!-- table: {name} -->"
        kept = re.search(f"{re.escape(begin)}\n.*?{re.escape(end)}", text, re.DOTALL)
        if kept:
            text = text[: kept.start()] + "\n".join([begin, *rows(), end]) + text[kept.end() :]
        elif text.count(f"\n{line}\n") != 1:
            raise SystemExit(f"docs/{page} has neither {begin} ... {end} nor one line {line}")
        elif built:
            text = text.replace(line, "\n".join(rows()))
    return text
