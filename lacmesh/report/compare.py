"""Comparison of a mesh with its cut: quality and size of the touched cells before and after, and the worst new cells.

Only touched cells are compared: the others do not change. Solid cells and their skin are compared apart, and so are, in
a plane mesh, surfaces and lines.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.cut import Cut
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.quality.measures import ACCEPTED, measure_cells, measures_of
from lacmesh.quality.statistics import Statistics, statistics
from lacmesh.quality.summary import Quality, groups_of, quality_of
from lacmesh.reference.quadrature import measure
from lacmesh.report.records import CutSummary, summarise
from lacmesh.report.touched import Touched, hexahedra, touched, variants

if TYPE_CHECKING:
    from lacmesh.checks.findings import Finding

#: of the JSON that `as_json` gives; raised when a name changes its meaning or goes
SCHEMA = 1
#: children named as the worst
WORST = 10
_PIECE = 1 << 10


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

    def as_json(self) -> dict[str, Any]:
        """The comparison as plain data."""
        return {
            "dim": self.dim,
            "cells": {"before": self.cells[0], "after": self.cells[1]},
            "invalid": {"before": self.invalid[0], "after": self.invalid[1]},
            "before": {m: v.as_json() for m, v in self.before.items()},
            "after": {m: v.as_json() for m, v in self.after.items()},
            "ratio_to_parent": self.ratio.as_json(),
        }


@dataclass(frozen=True)
class Size:
    """Length, area or volume of the touched cells of a group (None: of all), before and after the cut."""

    group: str | None
    dim: int
    before: float
    after: float

    @property
    def change(self) -> float:
        """Relative change: (after - before) / before."""
        return (self.after - self.before) / self.before if self.before else self.after - self.before


@dataclass(frozen=True)
class WorstChild:
    """One of the worst new cells: its number, parent and place, both least corner Jacobians, its extreme angles.

    `better`: the variant that would serve its parent better, and the least corner Jacobian of the children then.
    """

    number: int
    type: str
    parent: int
    parent_type: str
    groups: tuple[str, ...]
    centroid: tuple[float, float, float]
    value: float
    parent_value: float
    angles: tuple[float, float]
    better: tuple[str, float] | None

    def as_json(self) -> dict[str, Any]:
        """The child as plain data."""
        out = {k: v for k, v in asdict(self).items() if k not in ("number", "value", "parent_value", "better")}
        out["centroid"] = [None if np.isnan(v) else v for v in self.centroid]
        out |= {"cell": self.number, "corner_jacobian": self.value, "corner_jacobian_of_parent": self.parent_value}
        out["angles"] = [None if np.isnan(a) else a for a in self.angles]
        better = self.better
        return out | {"better_variant": better and {"hexa": better[0], "corner_jacobian": better[1]}}


@dataclass(frozen=True)
class Variants:
    """The two ways to cut the hexahedra: least corner Jacobian of all children `now`, and by each variant (`least`).

    `better`: for how many hexahedra a variant gives better children than they have.
    """

    hexahedra: int
    now: float
    least: dict[str, float]
    better: dict[str, int]


@dataclass(frozen=True)
class CutReport:
    """Effect of a cut on the quality of the cells it touched; `types_before` and `types_after`: Verdict's measures.

    `internal`: for each zone its macro-elements, and the least number of internal nodes in one of them. `findings`:
    those of the check of the cut; None where it was not checked.
    """

    summary: CutSummary
    internal: dict[str, tuple[int, int]]
    comparisons: tuple[Comparison, ...]
    types_before: Quality
    types_after: Quality
    sizes: tuple[Size, ...]
    worst: tuple[WorstChild, ...]
    variants: Variants | None
    findings: tuple[Finding, ...] | None = None

    def as_json(self) -> dict[str, Any]:
        """Report as plain data, which `write_report` puts into a .json file (described in `docs/quality.md`)."""
        s = self.summary
        return {
            "schema": f"lacmesh.cut_report/{SCHEMA}",
            "zones": {z: {"macro_elements": n, "least_internal_nodes": k} for z, (n, k) in self.internal.items()},
            "nodes": {"before": s.nodes[0], "after": s.nodes[1]},
            "cells": {"before": s.cells[0], "after": s.cells[1]},
            "replaced": s.replaced,
            "children": s.children,
            "touched": [c.as_json() for c in self.comparisons],
            "sizes": [{**asdict(size), "relative_change": size.change} for size in self.sizes],
            "worst": [child.as_json() for child in self.worst],
            "variants": None if self.variants is None else asdict(self.variants),
            "types_before": [t.as_json() for t in self.types_before.types],
            "types_after": [t.as_json() for t in self.types_after.types],
            "findings": None if self.findings is None else [f.as_dict() for f in self.findings],
        }


def cut_report(
    before: Mesh,
    cut: Cut,
    *,
    ring: float = 1 / 3,
    depth: float = 1 / 2,
    findings: Iterable[Finding] | None = None,
    cells: Touched | None = None,
) -> CutReport:
    """Report the effect of a cut on the cells it touched; `ring` and `depth` as they were given to `cut_skin`.

    `before`: the mesh that was cut. `findings`: those of `lacmesh.check` for the cut, to be included in the report.
    `cells`: the touched ones, where they are known already (`touched`). Raises CutError where the cut is not of that
    mesh.
    """
    cells = touched(before, cut) if cells is None else cells
    by_variant = variants(before, cut, cells, ring, depth)
    return CutReport(
        summary=summarise(before, cut, cells),
        internal=_internal(cut),
        comparisons=tuple(_comparisons(before, cut, cells)),
        types_before=quality_of(before, cells.parents),
        types_after=quality_of(cut.mesh, cells.children),
        sizes=tuple(_sizes(before, cut, cells)),
        worst=tuple(_worst(before, cut, cells, by_variant)),
        variants=_variants(before, cells, by_variant),
        findings=None if findings is None else tuple(findings),
    )


def _internal(cut: Cut) -> dict[str, tuple[int, int]]:
    count = np.bincount(cut.macro_of_node[cut.macro_of_node >= 0], minlength=cut.n_macros)
    first = np.flatnonzero(cut.child_kind == 1)
    zone = np.zeros(cut.n_macros, int)
    zone[cut.macro_of_face[first]] = cut.zone_of_face[first]
    return {
        name: (int(np.count_nonzero(zone == k)), int(count[zone == k].min(initial=np.iinfo(int).max)))
        for k, name in enumerate(cut.zones)
        if (zone == k).any()
    }


def _comparisons(before: Mesh, cut: Cut, cells: Touched) -> Iterator[Comparison]:
    old, new = before.cell_dim[cells.parents], cut.mesh.cell_dim[cells.children]
    for dim in range(int(old.max(initial=0)), 0, -1):
        if not (old == dim).any():
            continue
        was, now = _measured(before, cells.parents[old == dim]), _measured(cut.mesh, cells.children[new == dim])
        parent = cells.before[cells.of]
        ratio = np.divide(cells.after, parent, out=np.full(len(parent), np.nan), where=parent > 0)
        yield Comparison(
            dim=dim,
            cells=(int((old == dim).sum()), int((new == dim).sum())),
            invalid=(_invalid(was), _invalid(now)),
            before={m: statistics(m, v) for m, v in was.items()},
            after={m: statistics(m, v) for m, v in now.items()},
            ratio=statistics("corner_jacobian", ratio[new == dim]),
        )


def _measured(mesh: Mesh, cells: Ints) -> dict[str, Floats]:
    """The measures that all types of a dimension have, over all of them."""
    parts: dict[str, list[Floats]] = {}
    for kind, _, nodes in mesh.select(cells):
        own = [m for m in measures_of(kind) if m not in ACCEPTED.get(kind, ())]
        for name, values in measure_cells(kind, mesh.points, nodes, own).items():
            parts.setdefault(name, []).append(values)
    return {name: np.concatenate(values) for name, values in parts.items()}


def _invalid(values: dict[str, Floats]) -> int:
    return int(np.count_nonzero(~(values["validity"] > 0)))


def _sizes(before: Mesh, cut: Cut, cells: Touched) -> Iterator[Size]:
    """Sizes of all touched cells, then of those of each group that holds some; by dimension."""
    old, new = _each_size(before, cells.parents), _each_size(cut.mesh, cells.children)
    old_dim, new_dim = before.cell_dim[cells.parents], cut.mesh.cell_dim[cells.children]
    for dim in range(int(old_dim.max(initial=0)), 0, -1):
        if (old_dim == dim).any():
            yield Size(None, dim, float(old[old_dim == dim].sum()), float(new[new_dim == dim].sum()))
    for name, members in before.cell_groups.items():
        inside = np.isin(cells.parents, members, assume_unique=True)
        after = np.isin(cells.children, cut.mesh.cell_groups[name], assume_unique=True)
        for dim in range(int(old_dim[inside].max(initial=0)), 0, -1):
            if (old_dim[inside] == dim).any():
                yield Size(
                    name, dim, float(old[inside & (old_dim == dim)].sum()), float(new[after & (new_dim == dim)].sum())
                )


def _each_size(mesh: Mesh, cells: Ints) -> Floats:
    out = np.zeros(len(cells))
    for kind, which, nodes in mesh.select(cells):
        at = np.searchsorted(cells, which)
        for start in range(0, len(which), _PIECE):
            piece = slice(start, start + _PIECE)
            out[at[piece]] = measure(kind, mesh.points[nodes[piece]])
    return out


def _worst(before: Mesh, cut: Cut, cells: Touched, by_variant: Any) -> Iterator[WorstChild]:
    """The children of the lowest quality; lines have none to compare."""
    dim = cut.mesh.cell_dim[cells.children]
    order = np.argsort(np.where(dim > 1, cells.after.round(9), np.inf), kind="stable")  # the first of equal ones
    able = hexahedra(before, cells)
    for k in order[: min(WORST, int((dim > 1).sum()))].tolist():
        child, parent = int(cells.children[k]), int(cells.of[k])
        ((kind, _, nodes),) = cut.mesh.select(np.array([child]))
        ((parent_kind, row, _),) = before.select(cells.parents[parent : parent + 1])
        x, y, z = cut.mesh.points[nodes[0, : CELLS[kind].n_corners]].mean(axis=0).tolist()
        names = ("min_dihedral", "max_dihedral") if CELLS[kind].dim == 3 else ("min_corner_angle", "max_corner_angle")
        angles = measure_cells(kind, cut.mesh.points, nodes, names)
        best = max(by_variant, key=lambda v: by_variant[v][parent]) if able[parent] else None
        yield WorstChild(
            number=int(cut.mesh.cell_number[child]),
            type=kind,
            parent=int(before.cell_number[row[0]]),
            parent_type=parent_kind,
            groups=groups_of(cut.mesh, child),
            centroid=(x, y, z),
            value=float(cells.after[k]),
            parent_value=float(cells.before[parent]),
            angles=(float(angles[names[0]][0]), float(angles[names[1]][0])),
            better=_if_better(best, by_variant, parent, float(cells.least[parent])),
        )


def _if_better(best: str | None, by_variant: Any, parent: int, now: float) -> tuple[str, float] | None:
    if best is None or by_variant[best][parent] <= now + 1e-9:
        return None
    return best, float(by_variant[best][parent])


def _variants(before: Mesh, cells: Touched, by_variant: Any) -> Variants | None:
    able = hexahedra(before, cells)
    if not by_variant:
        return None
    now = cells.least[able]
    return Variants(
        hexahedra=int(able.sum()),
        now=float(now.min()),
        least={name: float(values[able].min()) for name, values in by_variant.items()},
        better={name: int(np.count_nonzero(values[able] > now + 1e-9)) for name, values in by_variant.items()},
    )
