"""The quality of a mesh: the statistics of every measure and the worst cells, for each cell type and each group.

Invalid and poor cells are counted separately. A cell is *invalid* if its Jacobian determinant is not positive at a
corner, another node or an integration point (`geometry`). It is *poor*, as in `lacmesh check`, if it is valid and
the measure that ranks its type is below POOR. Verdict's own ranges, which are stricter and exist for some types only,
are independent of both.

The bins of a histogram depend on the measure only, so that histograms of two meshes, or of one before and after its
cut, can be compared.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.facts import Described, without_nan
from lacmesh.mesh import Floats, Ints, Mesh, MeshLike, Spec, as_mesh, positions, spec_text
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.quality.geometry import validity_among
from lacmesh.quality.measures import ACCEPTED, POOR, RELATIVE, SCALES, chosen_measures, measure_cells, primary_metric

#: Verdict's infinity, also where a measure divides by zero
LARGEST = 1e30
#: percentiles that statistics hold
PERCENTS = (1, 5, 50, 95, 99)
_EDGES: Mapping[str, NDArray] = {
    "unit": np.linspace(0, 1, 21),
    "ratio": 10 ** (np.arange(21) / 10),
    "angle": np.linspace(0, 180, 37),
}
_BINS = 20


@dataclass(frozen=True)
class Histogram:
    """Histogram: `counts` (b,) between `edges` (b + 1,), the last bin closed; `below`, `above`: counts outside."""

    edges: tuple[float, ...]
    counts: tuple[int, ...]
    below: int
    above: int


@dataclass(frozen=True)
class Statistics:
    """Statistics of `count` values: extremes, percentiles (1, 5, 50, 95, 99), mean, histogram.

    The `undefined` values are left out of these: NaN, and the value that Verdict writes as 1e30, for a cell so flat
    that the measure divides by zero. `outside` counts the values beyond the range that Verdict accepts, undefined ones
    included; None if Verdict names no range.
    """

    count: int
    undefined: int
    outside: int | None
    least: float
    percentiles: tuple[float, ...]
    mean: float
    largest: float
    histogram: Histogram

    @property
    def median(self) -> float:
        """The value that half of the cells do not exceed."""
        return self.percentiles[PERCENTS.index(50)]

    def as_json(self) -> dict[str, Any]:
        """Return the statistics as plain data; None for a value that does not exist."""
        out: dict[str, Any] = {"count": self.count, "undefined": self.undefined, "outside_range": self.outside}
        out |= {"min": self.least, **{f"p{p}": v for p, v in zip(PERCENTS, self.percentiles, strict=True)}}
        plain: dict[str, Any] = without_nan(out | {"mean": self.mean, "max": self.largest})
        return plain | {"histogram": asdict(self.histogram)}


def statistics(measure: str, values: Floats, accepted: tuple[float, float] | None = None) -> Statistics:
    """Compute the statistics of the values (k,) of a measure; `accepted`: the range that Verdict accepts.

    >>> s = statistics("skew", np.array([0.0, 0.1, 0.2, 0.9]), (0, 0.5))
    >>> s.count, s.outside, round(s.median, 3), s.histogram.counts[2]
    (4, 1, 0.15, 1)
    """
    good = values[np.abs(values) < LARGEST]  # NaN is not
    outside = None
    if accepted is not None:
        slack = 1e-9 * max(abs(a) for a in accepted if np.isfinite(a)) + 1e-12  # an ideal cell is not outside
        outside = int(np.count_nonzero(~((values >= accepted[0] - slack) & (values <= accepted[1] + slack))))
    if not len(good):
        nothing = float("nan")
        empty = (nothing,) * len(PERCENTS)
        return Statistics(0, len(values), outside, nothing, empty, nothing, nothing, histogram(measure, good))
    return Statistics(
        count=len(good),
        undefined=len(values) - len(good),
        outside=outside,
        least=float(good.min()),
        percentiles=tuple(np.percentile(good, PERCENTS).tolist()),
        mean=float(good.mean()),
        largest=float(good.max()),
        histogram=histogram(measure, good),
    )


def histogram(measure: str, values: Floats) -> Histogram:
    """Make the histogram of the values (k,) of a measure, on the bins of its kind."""
    edges = _EDGES.get(SCALES[measure].kind)
    if edges is None:
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        edges = np.linspace(low, high if high > low else low + 1, _BINS + 1)
    slack = 1e-9 * np.diff(edges)  # round-off does not put an ideal cell outside
    starts = [edges[0] - slack[0], *(edges[1:-1] - slack[1:])]
    below = [int(np.count_nonzero(values < edge)) for edge in starts]
    below.append(int(np.count_nonzero(values <= edges[-1] + slack[-1])))
    return Histogram(tuple(edges.tolist()), tuple(np.diff(below).tolist()), below[0], len(values) - below[-1])


#: of the JSON that `as_json` gives; raised when a name changes its meaning or goes
SCHEMA = 2
#: cells named for each type
WORST = 10
#: where a cell may be invalid
PLACES = ("corner", "mid-node or centre", "integration point")


@dataclass(frozen=True)
class BadCell:
    """One of the worst cells: its id in the file, groups, centroid, value of the ranking measure, and validity.

    `invalid_at`: the PLACES at which it is invalid; empty for a valid cell.
    """

    number: int
    groups: tuple[str, ...]
    centroid: tuple[float, float, float]
    measure: str
    value: float
    validity: float
    invalid_at: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the cell as plain data."""
        return {"cell" if name == "number" else name: without_nan(value) for name, value in asdict(self).items()}


@dataclass(frozen=True)
class TypeQuality:
    """Quality of the cells of one type: counts of all, invalid and poor ones (None for lines), statistics, worst cells.

    `invalid_at`: numbers of cells invalid at a corner, at another node, at an integration point; a cell may count in
    each.
    """

    type: str
    count: int
    invalid: int
    invalid_at: dict[str, int]
    poor: int | None
    measures: dict[str, Statistics]
    worst: tuple[BadCell, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the quality of the type as plain data."""
        accepted = ACCEPTED.get(self.type, {})
        return {
            "type": self.type,
            "cells": self.count,
            "invalid": self.invalid,
            "invalid_at": self.invalid_at,
            "poor": self.poor,
            "ranked_by": primary_metric(self.type),
            "accepted_ranges": {m: without_nan(r) for m, r in accepted.items() if m in self.measures},
            "measures": {name: s.as_json() for name, s in self.measures.items()},
            "worst": [cell.as_json() for cell in self.worst],
        }


@dataclass(frozen=True, repr=False)
class Quality(Described):
    """The quality of a mesh, or of one group: `types` of all its cells, and of each group by itself in `groups`.

    >>> from lacmesh import read
    >>> quality = measure_quality(read("data/two_blocks.msh"), "upper")
    >>> quality.count, quality.invalid, [of_type.type for of_type in quality.types]
    (144, 0, ['HEXA8'])
    """

    group: str | None
    types: tuple[TypeQuality, ...]
    groups: dict[str, tuple[TypeQuality, ...]]
    not_measured: dict[str, int]

    def _facts(self) -> dict[str, str]:
        facts = {"cells": f"{self.count:,} measured, {self.invalid:,} invalid"}
        return facts | {t.type: f"{t.count:,}, {t.invalid:,} invalid" for t in self.types}

    @property
    def count(self) -> int:
        """Number of cells measured."""
        return sum(t.count for t in self.types)

    @property
    def invalid(self) -> int:
        """Number of invalid cells."""
        return sum(t.invalid for t in self.types)

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain data, as printed by `lacmesh quality --json` (described in `docs/quality.md`)."""
        return {
            "schema": f"lacmesh.quality/{SCHEMA}",
            "group": self.group,
            "cells": self.count,
            "invalid": self.invalid,
            "types": [t.as_json() for t in self.types],
            "groups": {name: [t.as_json() for t in types] for name, types in self.groups.items()},
            "not_measured": self.not_measured,
        }


@dataclass(frozen=True)
class _Measured:
    """The measured cells of one type: sorted indices in the mesh, and the values (k,) of each measure."""

    type: str
    cells: Ints
    values: dict[str, Floats]
    validity: NDArray  # (3, k)

    def take(self, cells: Ints) -> _Measured:
        """Select the measured values of some cells, given by sorted indices in the mesh."""
        at = positions(self.cells, cells)
        at = at[at >= 0]
        return _Measured(self.type, self.cells[at], {m: v[at] for m, v in self.values.items()}, self.validity[:, at])


def measure_quality(mesh: MeshLike, group: Spec | None = None, measures: str | Iterable[str] | None = None) -> Quality:
    """Measure the quality of a mesh, or of one `group` (named as `Mesh.cells_of` takes it).

    `measures`: names, "all", or None for the default ones. Surface cells are measured relative to their own normal.
    Raises GroupNotFoundError, RequestError.

    >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> q = measure_quality(square)
    >>> q.count, q.invalid, q.types[0].measures["corner_jacobian"].least
    (1, 0, 1.0)
    """
    mesh = as_mesh(mesh)
    chosen = chosen_measures(measures)
    local = from_origin(mesh, origin_of_mesh(mesh))
    parts = list(mesh.select(np.arange(mesh.n_cells) if group is None else mesh.cells_of(group)))
    measured = [_measured(local, *part, chosen(part[0])) for part in parts if primary_metric(part[0])]
    groups = {}
    for name, members in mesh.cell_groups.items() if group is None else ():
        of_group = [part.take(members) for part in measured]
        groups[name] = tuple(_type(mesh, part) for part in of_group if len(part.cells))
    return Quality(
        group=None if group is None else spec_text(group),
        types=tuple(_type(mesh, part) for part in measured),
        groups={name: types for name, types in groups.items() if types},
        not_measured={kind: len(which) for kind, which, _ in parts if not primary_metric(kind)},
    )


def _measured(mesh: Mesh, kind: str, cells: Ints, nodes: Ints, measures: tuple[str, ...]) -> _Measured:
    validity = np.stack(validity_among(kind, mesh.points, nodes))
    rank = primary_metric(kind)
    wanted = [m for m in dict.fromkeys((rank, *measures)) if m and m != "validity" and m not in RELATIVE]
    values = measure_cells(kind, mesh.points, nodes, wanted)
    if relative := [m for m in measures if m in RELATIVE]:  # to all cells of the mesh, whichever are measured
        first = mesh.offsets[[block.type for block in mesh.blocks].index(kind)]
        compared = measure_cells(kind, mesh.points, mesh.block(kind), relative)
        values |= {m: compared[m][cells - first] for m in relative}
    return _Measured(kind, cells, {"validity": validity.min(axis=0), **values}, validity)


def _type(mesh: Mesh, part: _Measured) -> TypeQuality:
    cell, accepted, value = CELLS[part.type], ACCEPTED.get(part.type, {}), part.values[primary_metric(part.type) or ""]
    bad = ~(part.validity > 0)
    invalid = np.asarray(bad.any(axis=0))
    places = {name: row for name, row in zip(PLACES, bad, strict=True) if cell.order == 2 or name != PLACES[1]}
    return TypeQuality(
        type=part.type,
        count=len(part.cells),
        invalid=int(invalid.sum()),
        invalid_at={name: int(row.sum()) for name, row in places.items()},
        poor=None if cell.dim == 1 else int(np.count_nonzero(~invalid & (value < POOR))),
        measures={m: statistics(m, v, accepted.get(m)) for m, v in part.values.items()},
        worst=tuple(_worst(mesh, part, value, invalid, places)),
    )


def _worst(
    mesh: Mesh, part: _Measured, value: Floats, invalid: NDArray, places: Mapping[str, NDArray]
) -> Iterator[BadCell]:
    """Yield the worst cells: the invalid ones first, by validity, then the valid ones by the ranking measure."""
    key = np.where(invalid, np.nan_to_num(part.values["validity"], nan=-np.inf), np.inf)
    among = np.arange(len(key)) if len(key) <= 4 * WORST else np.flatnonzero(invalid)
    if len(among) < WORST < len(key):  # the valid ones that may be among the worst, without sorting all of them
        among = np.concatenate([among, np.argpartition(np.where(invalid, np.inf, value), WORST)[:WORST]])
    for k in among[np.lexsort((value[among], key[among]))][:WORST]:
        one = part.cells[k : k + 1]
        ((_, _, nodes),) = mesh.select(one)
        x, y, z = mesh.points[nodes[0][: CELLS[part.type].n_corners]].mean(axis=0).tolist()
        yield BadCell(
            number=int(mesh.cell_number[one[0]]),
            groups=tuple(name for name, members in mesh.cell_groups.items() if positions(members, one)[0] >= 0),
            centroid=(x, y, z),
            measure=primary_metric(part.type) or "",
            value=float(value[k]),
            validity=float(part.values["validity"][k]),
            invalid_at=tuple(name for name, row in places.items() if row[k]),
        )
