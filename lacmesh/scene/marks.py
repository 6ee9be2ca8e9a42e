"""Marks and values drawn over a mesh: the cells and nodes that findings name, and a value for each cell."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import RequestError, did_you_mean
from lacmesh.formats.ids import Index
from lacmesh.mesh import Floats, Ints, Mesh, concatenated
from lacmesh.scene.colours import INVALID, RAMP, SEVERITIES, SPAN, ends_of, on_ramp, rgb
from lacmesh.scene.visible import SLAVE, VisibleSurface, as_faces, facets_of
from lacmesh.topology.skin import Faces

#: a ratio this many times the median has the colour of the worst
STRETCH = 10.0


class MarkedFinding(Protocol):
    """Interface of a finding of `lacmesh check`; `cells` and `nodes` are the file's numbers."""

    @property
    def severity(self) -> str:
        """Severity of the finding: `error`, `warning` or `info`."""

    @property
    def cells(self) -> Sequence[int]:
        """The cells it names."""

    @property
    def nodes(self) -> Sequence[int]:
        """The nodes it names."""

    @property
    def message(self) -> str:
        """The finding as a sentence."""


@dataclass(frozen=True)
class Marks:
    """Findings, the worst first, and what they name.

    `severity` and `message` (m,); `faces` (g,): the facets of solid cells, other cells themselves, with `of` (g,) the
    finding and `cell` (g,) the index of the cell; `nodes` (k,) indices of nodes, with `node_of` (k,) the finding.
    """

    severity: tuple[str, ...]
    message: tuple[str, ...]
    faces: Faces
    of: Ints
    cell: Ints
    nodes: Ints
    node_of: Ints

    def __len__(self) -> int:
        return len(self.severity)

    @property
    def wrong(self) -> bool:
        """True if any finding is an error or a warning."""
        return bool({"error", "warning"} & set(self.severity))


@dataclass(frozen=True)
class Values:
    """A value for each cell: `what` it is, `values` (n_cells,), NaN where there is none, and its bad and good ends.

    `invalid` (n_cells,): cells that no solver can use. `ramp`: colours from the bad end to the good one. `on_skin`:
    values are those of slave faces alone, such as a pressure, and not of the cells behind; none of them is the worst.
    """

    what: str
    values: Floats
    bad: float
    good: float
    invalid: NDArray[np.bool_]
    ramp: tuple[str, ...] = RAMP
    on_skin: bool = False

    def of(self, visible: VisibleSurface) -> NDArray[np.floating]:
        """Value of each visible face (f,), NaN where there is none."""
        if not self.on_skin:
            return np.asarray(self.values[visible.cell])
        return np.where(visible.role == SLAVE, self.values[visible.skin], np.nan)

    def colours(self, visible: VisibleSurface) -> NDArray[np.uint8]:
        """Colour of each visible face, (f, 3)."""
        out = on_ramp(self.of(visible), self.bad, self.good, self.ramp)
        if not self.on_skin:
            out[self.invalid[visible.cell]] = rgb((INVALID,))
        return out

    def worst(self, count: int) -> Ints:
        """The cells of the worst values, the worst first."""
        if self.on_skin:
            return np.empty(0, np.int64)
        known = np.flatnonzero(np.isfinite(self.values))
        away = self.values[known] if self.good >= self.bad else -self.values[known]
        few = np.argpartition(away, min(count, len(away)) - 1)[:count] if len(away) else np.empty(0, np.int64)
        return known[few[np.argsort(away[few], kind="stable")]]


def find_marks(mesh: Mesh, findings: Iterable[MarkedFinding], kept: NDArray[np.bool_] | None = None) -> Marks:
    """Look up what findings name; numbers that the mesh lacks, and cells that are not `kept`, are left out."""
    rank = {name: k for k, name in enumerate(SEVERITIES)}
    listed = sorted(findings, key=lambda f: rank.get(f.severity, len(rank)))
    cells, cell_of = _found(mesh.cell_number, [f.cells for f in listed])
    if kept is not None:
        cells, cell_of = cells[kept[cells]], cell_of[kept[cells]]
    nodes, node_of = _found(mesh.node_number, [f.nodes for f in listed])
    faces, row = _faces_of(mesh, cells)
    return Marks(
        severity=tuple(f.severity if f.severity in rank else "info" for f in listed),
        message=tuple(f.message for f in listed),
        faces=faces,
        of=cell_of[row],
        cell=cells[row],
        nodes=nodes,
        node_of=node_of,
    )


def _found(number: Ints, lists: list[Sequence[int]]) -> tuple[Ints, Ints]:
    """Indices of the known cells or nodes in several lists of the file's numbers, and the list that each stands in."""
    asked = concatenated(np.asarray(list(part), np.int64) for part in lists)
    of = np.repeat(np.arange(len(lists)), [len(part) for part in lists])
    place = Index(number, table=False).places(asked)
    return place[place >= 0], of[place >= 0]


def _faces_of(mesh: Mesh, cells: Ints) -> tuple[Faces, Ints]:
    """The faces that show some cells, a cell as often as it is listed, and the row of the list that each is of."""
    wanted, back = np.unique(cells, return_inverse=True)
    solid = mesh.cell_dim[wanted] == 3
    flat = mesh.cell_dim[wanted] % 3 > 0
    parts = [facets_of(mesh, wanted[solid]), as_faces(mesh, wanted[flat])]
    owner = np.searchsorted(wanted, np.concatenate([c for _, c in parts]))
    order = np.argsort(owner, kind="stable")
    start = np.searchsorted(owner[order], np.arange(len(wanted) + 1))
    count = np.diff(start)[back]
    row = np.repeat(np.arange(len(cells)), count)
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    face = order[start[back][row] + within]
    types = np.concatenate([f.type for f, _ in parts])
    nodes = np.vstack([f.nodes for f, _ in parts])
    return Faces(types[face], nodes[face]), row


def cell_values(mesh: Mesh, measure: str = "corner_jacobian") -> Values:
    """A measure of quality (`lacmesh.quality.measures`) of each cell of dimension 2 or 3 that has it.

    Raises RequestError where there is no such measure, or no cell that has it.
    """
    from lacmesh.quality import measure_cells, measures_of, validity_of
    from lacmesh.quality.measures import chosen_measures

    chosen_measures(measure)
    values = np.full(mesh.n_cells, np.nan)
    for k, block in enumerate(mesh.blocks):
        if ALL_CELLS[block.type].dim > 1 and measure in measures_of(block.type):
            measured = measure_cells(block.type, mesh.points, block.nodes, [measure])[measure]
            values[mesh.offsets[k] : mesh.offsets[k + 1]] = measured
    if mesh.n_cells and np.isnan(values).all():
        known = set().union(*(measures_of(b.type) for b in mesh.blocks))
        raise RequestError(f"no cell of this mesh has the measure {measure!r}{did_you_mean(measure, known)}")
    solid = np.flatnonzero(mesh.cell_dim > 1)
    invalid = np.zeros(mesh.n_cells, bool)
    invalid[solid] = validity_of(mesh, solid) <= 0
    return Values(measure.replace("_", " "), values, *_ends(measure, values), invalid)


def _ends(measure: str, values: Floats) -> tuple[float, float]:
    """The bad and the good end of a measure: fixed where it lies between 0 and 1, else those of the mesh's cells."""
    from lacmesh.quality.measures import SCALES

    kind, better = SCALES[measure]
    known = values[np.isfinite(values)]
    low, high = ends_of(values)
    if kind == "unit":
        low, high = 0.0, 1.0
    elif kind == "ratio":  # from 1 on; a few that are without bound would leave no colour to the others
        low, high = 1.0, max(1.0 + SPAN, min(high, STRETCH * float(np.median(known)) if len(known) else 2.0))
    return (high, low) if better < 0 else (low, high)
