"""Content of a report of a cut, in order, as blocks that the writers of HTML and Markdown only have to format."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from lacmesh.quality.measures import SCALES
from lacmesh.quality.statistics import PERCENTS, Statistics
from lacmesh.quality.summary import TypeQuality
from lacmesh.quality.verdict import ACCEPTED
from lacmesh.report.blocks import (
    Bars,
    Fact,
    Facts,
    Figure,
    Figures,
    Simple,
    Table,
    Text,
    Title,
    Verdict,
    columns,
)
from lacmesh.report.compare import Comparison, CutReport

if TYPE_CHECKING:
    from lacmesh.checks.findings import Finding

#: below this a child is hard to compute on, whatever its parent (a tenth of the ideal)
_HARD = 0.1
_WORDS = {3: "Solid cells", 2: "Surface cells", 1: "Lines"}
_SIZE = {3: "volume", 2: "area", 1: "length"}


def outline(report: CutReport, name: str = "") -> Iterator[Simple]:
    """Yield the blocks of a report; `name`: of the mesh, for its title."""
    yield Title(f"The cut of {name}" if name else "The cut", 1)
    yield Facts(tuple(_facts(report)))
    yield Text(" ".join(_sentences(report)), literal=True)
    if report.findings is not None:
        yield Title("What the check found", 2)
        yield from _findings(report.findings)
    for comparison in report.comparisons:
        if comparison.dim > 1 or any(comparison.invalid):
            yield from _comparison(comparison)
    if report.worst:
        yield Title("New cells of lowest quality", 2)
        yield _worst(report)
    if report.sizes:
        yield Title("What the touched cells hold", 2)
        yield Text(
            "Lengths, areas and volumes of the touched cells, which the cut keeps; the other cells are unchanged."
        )
        yield _sizes(report)
    if report.types_after.types:
        yield Title("Verdict's measures, type by type", 2)
        yield Text("As ParaView computes them; Verdict defines none on quadratic cells. Touched cells only.")
        for when, quality in (("before", report.types_before), ("after", report.types_after)):
            for kind in quality.types:
                yield from _type(kind, when)
    yield Title("What the numbers mean", 2)
    yield from (Text(text, literal=True, lead=lead) for lead, text in _MEANINGS.items())


_MEANINGS = {
    "corner_jacobian": "the least, over the corners, of the determinant of the edges brought to length 1, over that of "
    "the ideal cell: 1 ideal, 0 flat, negative folded over. It ranks the children; --min-quality and --hexa auto go "
    "by it.",
    "ratio to the parent": "a child's corner_jacobian over its parent's. A cut makes flat cells of any parent: judge "
    "it by this ratio and by validity, not by the ranges meant for meshes as they are generated.",
    "validity": "the least Jacobian determinant at the corners, mid-nodes and integration points, over its mean: 1 "
    "where it is the same everywhere. A cell where it is not positive is invalid: solvers refuse it, or compute "
    "nonsense.",
    "edge_ratio": "the longest edge over the shortest.",
    "angles": "in degrees: dihedral in solids, at the corners of surfaces.",
}


def _facts(report: CutReport) -> Iterator[Fact]:
    s = report.summary
    macros = sum(n for n, _ in report.internal.values())
    yield Fact("macro-elements", f"{macros:,}", ", ".join(report.internal))
    yield Fact("cells", f"{s.cells[1]:,}", f"{s.cells[1] - s.cells[0]:+,}")
    yield Fact("nodes", f"{s.nodes[1]:,}", f"{s.nodes[1] - s.nodes[0]:+,}")
    if not report.comparisons:
        return
    before, after = s.worst
    yield Fact(
        "minimum Jacobian", number(after), f"of the parents {number(before)}", "" if after >= _HARD else "missed"
    )
    top = report.comparisons[0]
    yield Fact("child / parent", number(top.ratio.median), f"median; least {number(top.ratio.least)}")
    invalid = [sum(c.invalid[k] for c in report.comparisons) for k in (0, 1)]
    verdict: Verdict = "missed" if invalid[1] else ""
    yield Fact("invalid children", f"{invalid[1]:,}", f"{invalid[0]:,} invalid parents", verdict)


def _sentences(report: CutReport) -> Iterator[str]:
    s = report.summary
    if not report.comparisons:
        yield "Every slave face owned an internal dof already: no cell was cut."
        return
    yield f"{_count(s.replaced)} became {_count(s.children)}."
    least = min(k for _, k in report.internal.values())
    if least > 0:
        yield f"Every macro-element owns an internal dof (at least {least} of its nodes)."
    else:
        bad = [zone for zone, (_, k) in report.internal.items() if k == 0]
        yield f"Some macro-elements of {', '.join(bad)} own no internal dof: the hypothesis of LAC does not hold."
    invalid = [sum(c.invalid[k] for c in report.comparisons) for k in (0, 1)]
    if invalid[1]:
        why = " (invalid parents stay so when they are cut)" if invalid[0] else ""
        yield f"{invalid[1]:,} children are invalid, of {invalid[0]:,} parents that were invalid before{why}."
    else:
        yield "No child is invalid."
    if report.variants is not None:
        yield _variant_sentence(report)


def _variant_sentence(report: CutReport) -> str:
    v = report.variants
    assert v is not None
    found = ", ".join(f"--hexa {name} {number(least)}" for name, least in v.least.items())
    start = f"The minimum Jacobian of the children of the {v.hexahedra:,} hexahedra is {number(v.now)} ({found})"
    better = {name: count for name, count in v.better.items() if count}
    if not better:
        return f"{start}: no hexahedron would be better off with the other variant."
    counts = "; ".join(f"{count:,} would have better children with --hexa {name}" for name, count in better.items())
    return f"{start}: {counts}. --hexa auto chooses for each set of hexahedra that share slave faces."


def _findings(findings: Sequence[Finding]) -> Iterator[Text]:
    if not findings:
        yield Text("Nothing.")
    for f in findings:
        group = f" in {f.where.group}" if f.where.group else ""
        verdict: Verdict = "missed" if f.severity == "error" else ""
        yield Text(f"{f.message}.", verdict, literal=True, lead=f"{f.severity}, {f.rule}{group}")


def _count(cells: dict[str, int]) -> str:
    return ", ".join(f"{n:,} {kind}" for kind, n in cells.items())


def _comparison(c: Comparison) -> Iterator[Simple]:
    yield Title(f"{_WORDS[c.dim]}: {c.cells[0]:,} before, {c.cells[1]:,} after", 2)
    ordered = sorted(c.after, key=lambda m: (m != "corner_jacobian", m == "validity"))
    charts = [Bars(m, SCALES[m].kind, c.before[m].histogram, c.after[m].histogram) for m in ordered if c.dim > 1]
    if c.dim > 1:
        charts.insert(1, Bars("ratio to the parent", "unit", None, c.ratio.histogram))
        yield Figures(tuple(Figure(bars.measure, bars) for bars in charts))
    rows = [_values_row(m, when, s) for m in ordered for when, s in (("before", c.before[m]), ("after", c.after[m]))]
    if c.dim > 1:
        rows.insert(2, _values_row("ratio to the parent", "after", c.ratio))
    names = ("measure", "", "min", *(f"{p} %" if p != 50 else "median" for p in PERCENTS), "max", "mean")
    table = Table.of_words(columns(names, numbers=names[2:]), rows)
    again = [b[0] == a[0] for a, b in pairwise([("",), *rows])]
    yield replace(table, rows=tuple(replace(row, again=b) for row, b in zip(table.rows, again, strict=True)))


def _values_row(measure: str, when: str, s: Statistics) -> tuple[str, ...]:
    return (measure, when, *(number(v) for v in (s.least, *s.percentiles, s.largest, s.mean)))


def _worst(report: CutReport) -> Table:
    names: tuple[str, ...] = ("cell", "type", "corner_jacobian", "of the parent", "parent", "place", "angles", "groups")
    names += ("better",) if any(w.better for w in report.worst) else ()
    rows = []
    for w in report.worst:
        place = ", ".join(f"{v:.4g}" for v in w.centroid)
        better = "" if w.better is None else f"--hexa {w.better[0]}: {number(w.better[1])}"
        angles = "" if np.isnan(w.angles[0]) else f"{w.angles[0]:.1f} to {w.angles[1]:.1f}"
        parent = f"{w.parent_type} {w.parent}"
        values = (str(w.number), w.type, number(w.value), number(w.parent_value), parent, place, angles)
        rows.append((*values, ", ".join(w.groups), better)[: len(names)])
    return Table.of_words(columns(names, numbers=("cell", "corner_jacobian", "of the parent")), rows)


def _sizes(report: CutReport) -> Table:
    rows = [
        (s.group or "all", _SIZE[s.dim], f"{s.before:.10g}", f"{s.after:.10g}", f"{s.change:+.1e}" if s.change else "0")
        for s in report.sizes
    ]
    names = ("group", "", "before", "after", "relative change")
    return Table.of_words(columns(names, numbers=names[2:]), rows)


def _type(t: TypeQuality, when: str) -> Iterator[Simple]:
    accepted = ACCEPTED.get(t.type, {})
    measures = {m: s for m, s in t.measures.items() if m in accepted}
    if not measures:
        return
    names = ("measure", "min", *(f"{p} %" if p != 50 else "median" for p in PERCENTS), "max", "mean", "accepted")
    rows = []
    for m, s in measures.items():
        limits = accepted[m]
        allowed = "" if limits is None else f"{number(limits[0])} to {number(limits[1])}"
        rows.append((*(_values_row(m, "", s)[0:1] + _values_row(m, "", s)[2:]), allowed))
    yield Table.of_words(columns(names, numbers=names[1:]), rows, folded=f"{t.type} {when}: {t.count:,} cells")


def number(value: float) -> str:
    """Format a number of a report with three digits; a dash if it is not defined.

    >>> number(0.12345), number(1234.5), number(float("nan")), number(-2e-17), number(float("inf"))
    ('0.123', '1.23e+03', '–', '0', 'inf')
    """
    if np.isnan(value):
        return "–"
    if abs(value) < 1e-12:
        return "0"
    return f"{value:.3g}"
