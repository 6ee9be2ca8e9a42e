"""Cells that a cut touched: parents before, children after, their quality; refusal of poor ones.

Cells are ranked by the least corner Jacobian (`quality.corner`).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.cutting.cut import Cut, cut_skin
from lacmesh.cutting.patterns import RING_PARENTS
from lacmesh.errors import CutError, LacmeshWarning, counted
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.quality import corner_jacobian

_NAMED = 5


@dataclass(frozen=True)
class Touched:
    """Touched cells: sorted indices `parents` (p,) before and `children` (c,) after; `of` (c,): row of the parent.

    `before` (p,) and `after` (c,): least corner Jacobian.
    """

    parents: Ints
    children: Ints
    of: Ints
    before: Floats
    after: Floats

    @property
    def least(self) -> Floats:
        """Least corner Jacobian of each parent's children, (p,)."""
        out = np.full(len(self.parents), np.inf)
        np.minimum.at(out, self.of, self.after)
        return out


def touched(before: Mesh, cut: Cut) -> Touched:
    """Find the cells that a cut touched. Raises CutError if the cut is not of the mesh `before`."""
    children, parent = cut.parents_in(before)
    parents, of = np.unique(parent, return_inverse=True)
    return Touched(parents, children, of, _corner(before, parents), _corner(cut.mesh, children))


def _corner(mesh: Mesh, cells: Ints) -> Floats:
    out = np.ones(len(cells))
    for kind, which, nodes in mesh.select(cells):
        out[np.searchsorted(cells, which)] = corner_jacobian(kind, mesh.points[nodes])
    return out


@dataclass(frozen=True)
class WorstChild:
    """One of the worst new cells: its number, parent and centroid, and the least corner Jacobians of both."""

    cell: int
    type: str
    parent: int
    parent_type: str
    groups: tuple[str, ...]
    centroid: tuple[float, float, float]
    corner_jacobian: float
    corner_jacobian_of_parent: float


def worst_children(before: Mesh, cut: Cut, cells: Touched, rows: Ints) -> Iterator[WorstChild]:
    """Describe some of the touched cells, `rows` of their children."""
    for k in rows.tolist():
        child, parent = cells.children[k], cells.of[k]
        ((kind, _, nodes),) = cut.mesh.select(cells.children[k : k + 1])
        ((parent_kind, row, _),) = before.select(cells.parents[parent : parent + 1])
        x, y, z = cut.mesh.points[nodes[0, : CELLS[kind].n_corners]].mean(axis=0).tolist()
        yield WorstChild(
            cell=int(cut.mesh.cell_number[child]),
            type=kind,
            parent=int(before.cell_number[row[0]]),
            parent_type=parent_kind,
            groups=tuple(name for name, members in cut.mesh.cell_groups.items() if child in members),
            centroid=(x, y, z),
            corner_jacobian=float(cells.after[k]),
            corner_jacobian_of_parent=float(cells.before[parent]),
        )


def refuse_poor(before: Mesh | None, cut: Cut, least: float) -> None:
    """Raise CutError where a touched cell has a least corner Jacobian below `least` after the cut.

    The message names the worst, their parents and their places, and says which variant would be better there; the worst
    alone if the mesh `before` the cut is not known.
    """
    if before is None:
        children = np.flatnonzero(cut.parent_of_cell >= 0)
        values = _corner(cut.mesh, children)
        bad = children[~(values >= least)]
        if len(bad):
            message = f"{len(bad):,} cells of this cut have a quality below {least:g} (least corner Jacobian), "
            message += f"{np.nanmin(values):.3g} at least: cells {cut.mesh.cell_names(bad)}; cut the mesh before again"
            raise CutError(message, cut.mesh.cell_number[bad])
        return
    cells = touched(before, cut)
    poor = np.flatnonzero(~(cells.after >= least))
    if not len(poor):
        return
    poor = poor[np.argsort(cells.after[poor].round(9), kind="stable")]  # the first of those that are equal
    worst = poor[np.sort(np.unique(cells.of[poor], return_index=True)[1])]  # of each parent
    listed = "; ".join(
        f"a {w.type} of the {w.parent_type} {w.parent} at ({', '.join(f'{v:.4g}' for v in w.centroid)}) with "
        f"{w.corner_jacobian:.3g} (it had {w.corner_jacobian_of_parent:.3g})"
        for w in worst_children(before, cut, cells, worst[:_NAMED])
    )
    more = f"; and those of {len(worst) - _NAMED:,} more" if len(worst) > _NAMED else ""
    raise CutError(
        f"{counted(len(poor), 'cell')} would have a quality below {least:g} (least corner Jacobian), the worst "
        f"{listed}{more}. " + _advice(before, cut, cells, poor, least),
        cut.mesh.cell_number[cells.children[poor]],
    )


def _advice(before: Mesh, cut: Cut, cells: Touched, poor: Ints, least: float) -> str:
    """Advice in a sentence: the other variant, a better mesh, or a lower limit."""
    of = np.unique(cells.of[poor])
    if (cells.before[of] < least).all():
        return "Their parents were below it before: mesh them better, or ask for less"
    ring = before.of_type(cells.parents, [kind for kind in RING_PARENTS if CELLS[kind].dim == 3]).any()
    for hexa in ("pyramid", "hexa") if ring else ():  # the two ways to cut hexahedra
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LacmeshWarning)  # the cut itself gave them
            values = touched(before, cut_skin(before, cut.zones, hexa=hexa, recognise=False)).least
        there = values[of].min()
        if there > cells.least[of].min() + 1e-9:
            enough = "is enough" if values.min() >= least else "is better there, not enough"
            return f"--hexa {hexa} {enough} (at least {there:.3g})"
    return "No variant is better there: refine the mesh, or ask for less"
