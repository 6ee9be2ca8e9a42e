"""Content of a report of a cut, in order, as blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lacmesh.quality.measures import ACCEPTED, SCALES
from lacmesh.quality.statistics import PERCENTS, Statistics
from lacmesh.quality.summary import TypeQuality
from lacmesh.report import histograms
from lacmesh.report.blocks import ReportBlock, TableRow, Verdict, fact, facts, prose, sentence, table, title
from lacmesh.report.compare import Comparison, CutReport

if TYPE_CHECKING:
    from lacmesh.checks.findings import Finding

#: below this a child is hard to compute on, whatever its parent (a tenth of the ideal)
_HARD = 0.1
_WORDS = {3: "Solid cells", 2: "Surface cells", 1: "Lines"}
_SIZE = {3: "volume", 2: "area", 1: "length"}


def heading(name: str = "") -> str:
    """The title of a report of the cut of a mesh."""
    return f"The cut of {name}" if name else "The cut"


def outline(report: CutReport, name: str = "") -> Iterator[ReportBlock]:
    """Yield the blocks of a report; `name`: of the mesh, for its title."""
    yield title(heading(name), 1)
    yield facts(_facts(report))
    yield sentence(" ".join(_sentences(report)))
    if report.findings is not None:
        yield title("What the check found")
        yield from _findings(report.findings)
    for comparison in report.comparisons:
        if comparison.dim > 1 or any(comparison.invalid):
            yield from _comparison(comparison)
    if report.worst:
        yield title("New cells of lowest quality")
        yield _worst(report)
    if report.sizes:
        yield title("What the touched cells hold")
        yield prose(
            "Lengths, areas and volumes of the touched cells, which the cut keeps; the other cells are unchanged."
        )
        yield _sizes(report)
    if report.types_after.types:
        yield title("Verdict's measures, type by type")
        yield prose("As ParaView computes them; Verdict defines none on quadratic cells. Touched cells only.")
        for when, quality in (("before", report.types_before), ("after", report.types_after)):
            for kind in quality.types:
                yield from _type(kind, when)
    yield title("What the numbers mean")
    yield from (sentence(text, lead=lead) for lead, text in _MEANINGS.items())


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


def _facts(report: CutReport) -> Iterator[ReportBlock]:
    s = report.summary
    macros = sum(n for n, _ in report.internal.values())
    yield fact("macro-elements", f"{macros:,}", ", ".join(report.internal))
    yield fact("cells", f"{s.cells[1]:,}", f"{s.cells[1] - s.cells[0]:+,}")
    yield fact("nodes", f"{s.nodes[1]:,}", f"{s.nodes[1] - s.nodes[0]:+,}")
    if not report.comparisons:
        return
    before, after = s.worst
    yield fact(
        "minimum Jacobian", number(after), f"of the parents {number(before)}", "" if after >= _HARD else "missed"
    )
    top = report.comparisons[0]
    yield fact("child / parent", number(top.ratio.median), f"median; least {number(top.ratio.least)}")
    invalid = [sum(c.invalid[k] for c in report.comparisons) for k in (0, 1)]
    verdict: Verdict = "missed" if invalid[1] else ""
    yield fact("invalid children", f"{invalid[1]:,}", f"{invalid[0]:,} invalid parents", verdict)


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
    options = ", ".join(f"--hexa {name} {number(least)}" for name, least in v.least.items())
    start = f"The minimum Jacobian of the children of the {v.hexahedra:,} hexahedra is {number(v.now)} ({options})"
    better = {name: count for name, count in v.better.items() if count}
    if not better:
        return f"{start}: no hexahedron would be better off with the other variant."
    counts = "; ".join(f"{count:,} would have better children with --hexa {name}" for name, count in better.items())
    return f"{start}: {counts}. --hexa auto chooses for each set of hexahedra that share slave faces."


def _findings(findings: Sequence[Finding]) -> Iterator[ReportBlock]:
    if not findings:
        yield prose("Nothing.")
    for f in findings:
        group = f" in {f.where.group}" if f.where.group else ""
        verdict: Verdict = "missed" if f.severity == "error" else ""
        yield sentence(f"{f.message}.", verdict, lead=f"{f.severity}, {f.rule}{group}")


def _count(cells: dict[str, int]) -> str:
    return ", ".join(f"{n:,} {kind}" for kind, n in cells.items())


#: names of the columns of statistics
_STATISTICS = ("min", *(f"{p} %" if p != 50 else "median" for p in PERCENTS), "max", "mean")


def _comparison(c: Comparison) -> Iterator[ReportBlock]:
    yield title(f"{_WORDS[c.dim]}: {c.cells[0]:,} before, {c.cells[1]:,} after")
    ordered = sorted(c.after, key=lambda m: (m != "corner_jacobian", m == "validity"))
    both = [(m, (c.before[m], c.after[m])) for m in ordered]
    rows = [
        TableRow((m, when, *_values(s)), again=when == "after")
        for m, pair in both
        for when, s in zip(("before", "after"), pair, strict=True)
    ]
    if c.dim > 1:
        charts = [histograms.Bars(m, SCALES[m].kind, tuple(s.histogram for s in pair)) for m, pair in both]
        charts.insert(1, histograms.Bars("ratio to the parent", "unit", (c.ratio.histogram,)))
        yield histograms.block(charts)
        rows.insert(2, TableRow(("ratio to the parent", "after", *_values(c.ratio))))
    yield table(("measure", "", *_STATISTICS), rows, numbers=_STATISTICS)


def _values(s: Statistics) -> tuple[str, ...]:
    return tuple(number(v) for v in (s.least, *s.percentiles, s.largest, s.mean))


def _worst(report: CutReport) -> ReportBlock:
    names: tuple[str, ...] = ("cell", "type", "corner_jacobian", "of the parent", "parent", "place", "angles", "groups")
    names += ("better",) if any(w.better for w in report.worst) else ()
    rows = []
    for w in report.worst:
        place = ", ".join(f"{v:.4g}" for v in w.centroid)
        better = "" if w.better is None else f"--hexa {w.better[0]}: {number(w.better[1])}"
        angles = "" if np.isnan(w.angles[0]) else f"{w.angles[0]:.1f} to {w.angles[1]:.1f}"
        parent = f"{w.parent_type} {w.parent}"
        values = (str(w.number), w.type, number(w.value), number(w.parent_value), parent, place, angles)
        rows.append(TableRow((*values, ", ".join(w.groups), better)[: len(names)]))
    return table(names, rows, numbers=("cell", "corner_jacobian", "of the parent"))


def _sizes(report: CutReport) -> ReportBlock:
    names = ("group", "", "before", "after", "relative change")
    rows = []
    for s in report.sizes:
        change = f"{s.change:+.1e}" if s.change else "0"
        rows.append(TableRow((s.group or "all", _SIZE[s.dim], f"{s.before:.10g}", f"{s.after:.10g}", change)))
    return table(names, rows, numbers=names[2:])


def _type(t: TypeQuality, when: str) -> Iterator[ReportBlock]:
    accepted = ACCEPTED.get(t.type, {})
    rows = []
    for m, s in t.measures.items():
        if m in accepted:
            limits = accepted[m]
            allowed = "" if limits is None else f"{number(limits[0])} to {number(limits[1])}"
            rows.append(TableRow((m, *_values(s), allowed)))
    if rows:
        names = ("measure", *_STATISTICS, "accepted")
        yield table(names, rows, numbers=names[1:], folded=f"{t.type} {when}: {t.count:,} cells")


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
