"""Report on a cut: the touched cells before and after, the worst new ones; as Markdown, as HTML made from it, as JSON.

Only touched cells are compared: the others do not change. Solid cells and their skin are compared apart, and so are, in
a plane mesh, surfaces and lines.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.cut import Cut
from lacmesh.errors import RequestError, did_you_mean
from lacmesh.facts import without_nan
from lacmesh.formats.output import check_place, replace_file
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.quality import corner_jacobian, measure_cells, measures_of
from lacmesh.quality.summary import PERCENTS, Statistics, statistics
from lacmesh.report.markdown import html_page, plain, table
from lacmesh.report.touched import Touched, WorstChild, touched, worst_children

if TYPE_CHECKING:
    from lacmesh.checks.findings import Finding

SUFFIXES = (".html", ".md", ".json")
#: measures that are compared, in this order
MEASURES = ("corner_jacobian", "validity", "edge_ratio", "min_dihedral", "max_dihedral", "min_corner_angle",
            "max_corner_angle")  # fmt: skip
#: children named as the worst
WORST = 10
_STATISTICS = ("min", *(f"{p} %" if p != 50 else "median" for p in PERCENTS), "max", "mean")
_WORDS = {3: "Solid cells", 2: "Surface cells", 1: "Lines"}
_MEANINGS = """\
**corner_jacobian**: the least, over the corners, of the determinant of the edges brought to length 1, over
that of the ideal cell: 1 ideal, 0 flat, negative folded over. A cut makes flat cells of any parent: judge it by the
ratio of child to parent and by validity, not by the ranges meant for meshes as they are generated.

**validity**: the least Jacobian determinant at the corners, mid-nodes and integration points, over its mean. A cell
where it is not positive is invalid: solvers refuse it, or compute nonsense. **edge_ratio**: the longest edge over the
shortest. Angles are in degrees: dihedral in solids, at the corners of surfaces."""


@dataclass(frozen=True)
class CutSummary:
    """Summary of a cut; pairs are before and after it.

    `zones`: macro-elements of each; `replaced`, `children`: numbers of cells by type; `worst`: least quality of the
    touched cells (NaN: none).
    """

    zones: dict[str, int]
    replaced: dict[str, int]
    children: dict[str, int]
    nodes: tuple[int, int]
    cells: tuple[int, int]
    worst: tuple[float, float]

    @classmethod
    def of(cls, before: Mesh, cut: Cut, cells: Touched | None = None) -> CutSummary:
        """Compare a mesh with its cut; `cells`: the touched ones, where they are known already (`touched`)."""
        cells = touched(before, cut) if cells is None else cells
        macros = np.bincount(cut.zone_of_face[cut.child_kind == 1], minlength=len(cut.zones))
        old, new = before.cell_dim[cells.parents] > 1, cut.mesh.cell_dim[cells.children] > 1  # lines have no quality
        worst = [float(q.min()) if len(q) else math.nan for q in (cells.before[old], cells.after[new])]
        return cls(
            zones={name: int(n) for name, n in zip(cut.zones, macros, strict=True)},
            replaced={kind: len(of_kind) for kind, of_kind, _ in before.select(cells.parents)},
            children={kind: len(of_kind) for kind, of_kind, _ in cut.mesh.select(cells.children)},
            nodes=(before.n_nodes, cut.mesh.n_nodes),
            cells=(before.n_cells, cut.mesh.n_cells),
            worst=(worst[0], worst[1]),
        )

    def rows(self) -> Iterator[tuple[str, ...]]:
        """Yield the rows of a table: what, before, after, added."""
        for what, (a, b) in (("nodes", self.nodes), ("cells", self.cells)):
            yield what, f"{a:,}", f"{b:,}", f"{b - a:+,}"
        yield from ((f"macro-elements of {zone}", "", f"{n:,}", "") for zone, n in self.zones.items())
        for kind in dict.fromkeys([*self.replaced, *self.children]):
            old, new = self.replaced.get(kind, 0), self.children.get(kind, 0)
            yield f"{kind} touched", f"{old:,}", f"{new:,}", f"{new - old:+,}"
        if self.replaced:
            yield "worst quality of the touched cells", *map(number, self.worst), ""
        else:
            yield "no cell is cut", "", "", ""


@dataclass(frozen=True)
class Comparison:
    """Touched cells of one dimension: statistics of each measure over all types, `before` and `after` the cut.

    `ratio`: a child's least corner Jacobian over its parent's. `invalid` counts cells before, after.
    """

    dim: int
    cells: tuple[int, int]
    invalid: tuple[int, int]
    before: dict[str, Statistics]
    after: dict[str, Statistics]
    ratio: Statistics


@dataclass(frozen=True)
class CutReport:
    """Effect of a cut on the quality of the cells it touched.

    `internal`: for each zone its macro-elements, and the least number of internal nodes in one of them. `findings`:
    those of the check of the cut; None where it was not checked.
    """

    summary: CutSummary
    internal: dict[str, tuple[int, int]]
    comparisons: tuple[Comparison, ...]
    worst: tuple[WorstChild, ...]
    findings: tuple[Finding, ...] | None = None

    def as_json(self) -> dict[str, Any]:
        """Report as plain data, without what is not a number."""
        plain: dict[str, Any] = without_nan(asdict(self))
        return plain | {"findings": None if self.findings is None else [f.as_dict() for f in self.findings]}


@dataclass(frozen=True)
class ChildrenQuality:
    """Children of a cut: how many there are and are `invalid`, and statistics of their least corner Jacobian.

    Lines, which have none, are left out of these.
    """

    children: int
    invalid: int
    child: Statistics

    def as_json(self) -> dict[str, Any]:
        """The quality as plain data."""
        return {"children": self.children, "invalid_children": self.invalid, "corner_jacobian": self.child.as_json()}


def children_quality(cut: Cut) -> ChildrenQuality | None:
    """Quality of the children of a cut; None if no cell was cut."""
    mesh = cut.mesh
    children = np.flatnonzero(cut.parent_of_cell >= 0)
    if not len(children):
        return None
    ranked: list[Floats] = [np.empty(0)]
    invalid = 0
    for kind, _, nodes in mesh.select(children):
        invalid += _invalid(measure_cells(kind, mesh.points, nodes, ["validity"]))
        if CELLS[kind].dim > 1:
            ranked.append(corner_jacobian(kind, mesh.points[nodes]))
    return ChildrenQuality(len(children), invalid, statistics("corner_jacobian", np.concatenate(ranked)))


def cut_report(before: Mesh, cut: Cut, *, findings: Iterable[Finding] | None = None) -> CutReport:
    """Report the effect of a cut on the cells it touched.

    `before`: the mesh that was cut. `findings`: those of `lacmesh.check` for the cut, to be included in the report.
    Raises CutError where the cut is not of that mesh.
    """
    cells = touched(before, cut)
    summary = CutSummary.of(before, cut, cells)
    count = np.bincount(cut.macro_of_node[cut.macro_of_node >= 0], minlength=cut.n_macros)
    zone, first = np.zeros(cut.n_macros, int), np.flatnonzero(cut.child_kind == 1)
    zone[cut.macro_of_face[first]] = cut.zone_of_face[first]
    dim = cut.mesh.cell_dim[cells.children]  # lines have no quality to compare
    order = np.argsort(np.where(dim > 1, cells.after.round(9), np.inf), kind="stable")  # the first of equal ones
    return CutReport(
        summary=summary,
        internal={name: (n, int(count[zone == k].min())) for k, (name, n) in enumerate(summary.zones.items()) if n},
        comparisons=tuple(_comparisons(before, cut, cells)),
        worst=tuple(worst_children(before, cut, cells, order[: min(WORST, int((dim > 1).sum()))])),
        findings=None if findings is None else tuple(findings),
    )


def _comparisons(before: Mesh, cut: Cut, cells: Touched) -> Iterator[Comparison]:
    old, new = before.cell_dim[cells.parents], cut.mesh.cell_dim[cells.children]
    parent = cells.before[cells.of]
    ratio = np.divide(cells.after, parent, out=np.full(len(parent), np.nan), where=parent > 0)
    for dim in sorted(set(old.tolist()) - {0}, reverse=True):
        was, now = _measured(before, cells.parents[old == dim]), _measured(cut.mesh, cells.children[new == dim])
        yield Comparison(
            dim=dim,
            cells=(int((old == dim).sum()), int((new == dim).sum())),
            invalid=(_invalid(was), _invalid(now)),
            before={m: statistics(m, v) for m, v in was.items()},
            after={m: statistics(m, v) for m, v in now.items()},
            ratio=statistics("corner_jacobian", ratio[new == dim]),
        )


def _measured(mesh: Mesh, cells: Ints) -> dict[str, Floats]:
    """The values of MEASURES over all cells of a dimension."""
    parts: dict[str, list[Floats]] = {}
    for kind, _, nodes in mesh.select(cells):
        own = [m for m in MEASURES if m in measures_of(kind)]
        for name, values in measure_cells(kind, mesh.points, nodes, own).items():
            parts.setdefault(name, []).append(values)
    return {name: np.concatenate(parts[name]) for name in MEASURES if name in parts}


def _invalid(values: Mapping[str, Floats]) -> int:
    return int(np.count_nonzero(~(values["validity"] > 0)))


# ---- the report as text


def write_report(path: str | os.PathLike[str], report: CutReport, *, name: str = "", force: bool = True) -> None:
    """Write a report of a cut in the format of the suffix: .html (one page, opens offline), .md, .json.

    `name`: of the mesh, for the title. An existing file is replaced, whole, unless `force` is False. Raises
    RequestError, WriteError.
    """
    path = Path(path)
    check_report(path, force=force)
    replace_file(path, report_bytes(path.suffix.lower(), report, name))


def check_report(path: Path, *, force: bool = True) -> None:
    """Check early that a report can be written. Raises RequestError, WriteError."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RequestError(f"{path}: no report is written as {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    check_place(path, force=force)


def report_bytes(suffix: str, report: CutReport, name: str = "") -> bytes:
    """Content of a report in the format of a suffix."""
    if suffix == ".json":
        return (json.dumps({"name": name, **report.as_json()}, ensure_ascii=False, indent=1) + "\n").encode()
    text = "\n\n".join(_paragraphs(report, name)) + "\n"
    if suffix == ".md":
        return text.encode()
    return html_page(text, _title(name)).encode()


def _title(name: str) -> str:
    return f"The cut of {name}" if name else "The cut"


def _paragraphs(report: CutReport, name: str) -> Iterator[str]:
    """Paragraphs, tables and titles of a report in Markdown; `name`: of the mesh."""
    from lacmesh import __version__

    s = report.summary
    yield f"# {plain(_title(name))}"
    rows = [(plain(name), *values) for name, *values in s.rows()]
    yield table(("", "before", "after", "added"), rows)
    yield " ".join(_sentences(report))
    if report.findings is not None:
        yield "## What the check found"
        for f in report.findings:
            where = f" in {plain(f.where.group)}" if f.where.group else ""
            yield f"**{f.severity}, {f.rule}{where}**: {plain(f.message)}."
        if not report.findings:
            yield "Nothing."
    for c in report.comparisons:
        if c.dim > 1 or any(c.invalid):
            yield f"## {_WORDS[c.dim]}: {c.cells[0]:,} before, {c.cells[1]:,} after"
            pairs = ((m, when, own[m]) for m in c.after for when, own in (("before", c.before), ("after", c.after)))
            rows = [(m, when, *values(of)) for m, when, of in pairs]
            yield table(("measure", "", *_STATISTICS), [*rows, ("child / parent", "", *values(c.ratio))])
    if report.worst:
        yield "## New cells of lowest quality"
        names = ("cell", "type", "of", "corner_jacobian", "of its parent", "centroid", "groups")
        yield table(names, [_row(w) for w in report.worst])
    yield "## What the numbers mean"
    yield _MEANINGS
    yield f"lacmesh {__version__}"


def _row(w: WorstChild) -> tuple[str, ...]:
    place = ", ".join(f"{v:.4g}" for v in w.centroid)
    values = (number(w.corner_jacobian), number(w.corner_jacobian_of_parent))
    return (str(w.cell), w.type, f"{w.parent_type} {w.parent}", *values, place, plain(", ".join(w.groups)))


def _sentences(report: CutReport) -> Iterator[str]:
    if not report.comparisons:
        yield "Every slave face owned an internal dof already: no cell was cut."
        return
    bad = [plain(zone) for zone, (_, least) in report.internal.items() if not least]
    if bad:
        yield f"Some macro-elements of {', '.join(bad)} own no internal dof: the hypothesis of LAC does not hold."
    else:
        yield "Every macro-element owns an internal dof."
    old, new = (sum(c.invalid[k] for c in report.comparisons) for k in (0, 1))
    yield (
        f"{new:,} children are invalid, of {old:,} parents that were invalid before." if new else "No child is invalid."
    )


def values(s: Statistics) -> tuple[str, ...]:
    """Format the least value of a measure, percentiles, the largest and the mean."""
    return tuple(number(v) for v in (s.least, *s.percentiles, s.largest, s.mean))


def number(value: float) -> str:
    """Format a number of a report with three digits; a dash if it is not defined.

    >>> number(0.12345), number(1234.5), number(float("nan")), number(-2e-17), number(float("inf"))
    ('0.123', '1.23e+03', '–', '0', 'inf')
    """
    if math.isnan(value):
        return "–"
    return "0" if abs(value) < 1e-12 else f"{value:.3g}"
