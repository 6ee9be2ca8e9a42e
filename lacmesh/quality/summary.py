"""The quality of a mesh: the statistics of every measure and the worst cells, for each cell type and each group.

Invalid and poor cells are counted separately. A cell is *invalid* if its Jacobian determinant is not positive at a
corner, another node or an integration point (`determinant`). It is *poor*, as in `lacmesh check`, if it is valid and
the measure that ranks its type is below POOR. Verdict's own ranges, which are stricter and exist for some types only,
are independent of both.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.facts import Described
from lacmesh.mesh import Floats, Ints, Mesh, MeshLike, Spec, as_mesh, positions, spec_text
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.quality.determinant import validity_among
from lacmesh.quality.measures import ACCEPTED, POOR, RELATIVE, chosen_measures, measure_cells, primary_metric
from lacmesh.quality.statistics import Statistics, statistics

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
        out = {"cell" if name == "number" else name: value for name, value in asdict(self).items()}
        value, validity, *centroid = _finite(self.value, self.validity, *self.centroid)
        return out | {"centroid": centroid, "value": value, "validity": validity}


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
            "accepted_ranges": {m: r and _finite(*r) for m, r in accepted.items() if m in self.measures},
            "measures": {name: s.as_json() for name, s in self.measures.items()},
            "worst": [cell.as_json() for cell in self.worst],
        }


def _finite(*values: float) -> list[float | None]:
    return [v if np.isfinite(v) else None for v in values]


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
    >>> q.count, q.invalid, q.types[0].measures["scaled_jacobian"].least
    (1, 0, 1.0)
    """
    mesh = as_mesh(mesh)
    cells = np.arange(mesh.n_cells) if group is None else mesh.cells_of(group)
    names = list(mesh.cell_groups) if group is None else []
    return quality_of(mesh, cells, measures, group=None if group is None else spec_text(group), by_group=names)


def quality_of(
    mesh: Mesh,
    cells: Ints,
    measures: str | Iterable[str] | None = None,
    *,
    group: str | None = None,
    by_group: Iterable[str] = (),
) -> Quality:
    """Measure the quality of some cells of a mesh (sorted indices), and of those in each group of `by_group`."""
    chosen = chosen_measures(measures)
    local = from_origin(mesh, origin_of_mesh(mesh))
    measured = [_measured(local, *part, chosen(part[0])) for part in mesh.select(cells) if _measurable(part[0])]
    grouped = {name: _types(mesh, [part.take(mesh.cell_groups[name]) for part in measured]) for name in by_group}
    left = {kind: len(which) for kind, which, _ in mesh.select(cells) if not _measurable(kind)}
    return Quality(group, _types(mesh, measured), {name: types for name, types in grouped.items() if types}, left)


def _measurable(kind: str) -> bool:
    return primary_metric(kind) is not None


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


def _types(mesh: Mesh, measured: list[_Measured]) -> tuple[TypeQuality, ...]:
    return tuple(_type(mesh, part) for part in measured if len(part.cells))


def _type(mesh: Mesh, part: _Measured) -> TypeQuality:
    accepted = ACCEPTED.get(part.type, {})
    rank = primary_metric(part.type)
    assert rank is not None  # only types that have one are measured
    bad = ~(part.validity > 0)
    invalid = bad.any(axis=0)
    poor = None if CELLS[part.type].dim == 1 else int(np.count_nonzero(~invalid & (part.values[rank] < POOR)))
    places = PLACES if CELLS[part.type].order == 2 else (PLACES[0], PLACES[2])
    return TypeQuality(
        type=part.type,
        count=len(part.cells),
        invalid=int(invalid.sum()),
        invalid_at={name: int(bad[PLACES.index(name)].sum()) for name in places},
        poor=poor,
        measures={m: statistics(m, v, accepted.get(m)) for m, v in part.values.items()},
        worst=_worst(mesh, part, rank, bad),
    )


def _worst(mesh: Mesh, part: _Measured, rank: str, bad: NDArray) -> tuple[BadCell, ...]:
    """Return the worst cells: the invalid ones first, by validity, then the valid ones by the ranking measure."""
    key = np.where(bad.any(axis=0), np.nan_to_num(part.values["validity"], nan=-np.inf), np.inf)
    value = part.values[rank]
    among = np.arange(len(key)) if len(key) <= 4 * WORST else np.flatnonzero(key < np.inf)
    if len(among) < WORST < len(key):  # the valid ones that may be among the worst, without sorting all of them
        among = np.concatenate([among, np.argpartition(np.where(key < np.inf, np.inf, value), WORST)[:WORST]])
    order = among[np.lexsort((value[among], key[among]))]
    return tuple(_bad_cell(mesh, part, rank, bad, int(k)) for k in order[:WORST])


def _bad_cell(mesh: Mesh, part: _Measured, rank: str, bad: NDArray, k: int) -> BadCell:
    cell, of_type = int(part.cells[k]), CELLS[part.type]
    ((_, _, nodes),) = mesh.select(np.array([cell]))
    x, y, z = mesh.points[nodes[0][: of_type.n_corners]].mean(axis=0).tolist()
    return BadCell(
        number=int(mesh.cell_number[cell]),
        groups=groups_of(mesh, cell),
        centroid=(x, y, z),
        measure=rank,
        value=float(part.values[rank][k]),
        validity=float(part.values["validity"][k]),
        invalid_at=tuple(name for p, name in enumerate(PLACES) if bad[p, k] and (of_type.order == 2 or p != 1)),
    )


def groups_of(mesh: Mesh, cell: int) -> tuple[str, ...]:
    """Return the names of the cell groups that contain a cell."""
    one = np.array([cell])
    return tuple(name for name, members in mesh.cell_groups.items() if positions(members, one)[0] >= 0)
