"""Cells that a cut touched: parents before, children after, their quality; refusal of poor ones.

Cells are ranked by the least corner Jacobian (`quality.corner`).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lacmesh.cells import ALL_CELLS, CELLS
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


def _variants(before: Mesh, cut: Cut, cells: Touched) -> Iterator[tuple[str, Floats]]:
    """Yield the variants `pyramid` and `hexa` with the least corner Jacobian of each parent's children, (p,), by each.

    None if no parent can be cut in two ways.
    """
    types = np.array([b.type in RING_PARENTS and CELLS[b.type].dim == 3 for b in before.blocks], bool)
    if not types[np.searchsorted(before.offsets, cells.parents, side="right") - 1].any():
        return
    for hexa in ("pyramid", "hexa"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LacmeshWarning)  # the cut itself gave them
            other = cut_skin(before, cut.zones, hexa=hexa, recognise=False)
        yield hexa, touched(before, other).least


def refuse_poor(before: Mesh, cut: Cut, least: float, cells: Touched | None = None) -> None:
    """Raise CutError where a touched cell has a least corner Jacobian below `least` after the cut.

    The message names the worst, their parents and their places, and says which variant would be better there. `cells`:
    the touched ones, where they are known already (`touched`).
    """
    cells = touched(before, cut) if cells is None else cells
    poor = np.flatnonzero(~(cells.after >= least))
    if not len(poor):
        return
    poor = poor[np.argsort(cells.after[poor].round(9), kind="stable")]  # the first of those that are equal
    worst = poor[np.sort(np.unique(cells.of[poor], return_index=True)[1])]  # of each parent
    listed = "; ".join(_named(before, cut, cells, int(k)) for k in worst[:_NAMED])
    more = f"; and those of {len(worst) - _NAMED:,} more" if len(worst) > _NAMED else ""
    raise CutError(
        f"{counted(len(poor), 'cell')} would have a quality below {least:g} (least corner Jacobian), the worst "
        f"{listed}{more}. " + _advice(before, cut, cells, poor, least),
        cut.mesh.cell_number[cells.children[poor]],
    )


def refuse_poor_children(cut: Cut, least: float) -> None:
    """Raise CutError as `refuse_poor` does, for a cut whose original mesh is not known."""
    children = np.flatnonzero(cut.parent_of_cell >= 0)
    values = _corner(cut.mesh, children)
    poor = children[~(values >= least)]
    if len(poor):
        raise CutError(
            f"{len(poor):,} cells of this cut have a quality below {least:g} (least corner Jacobian), "
            f"{np.nanmin(values):.3g} at least: cells {cut.mesh.cell_names(poor)}; cut the mesh before again",
            cut.mesh.cell_number[poor],
        )


def _named(before: Mesh, cut: Cut, cells: Touched, k: int) -> str:
    child, parent = int(cells.children[k]), int(cells.parents[cells.of[k]])
    ((kind, _, nodes),) = cut.mesh.select(np.array([child]))
    ((parent_kind, _, _),) = before.select(np.array([parent]))
    place = ", ".join(f"{v:.4g}" for v in cut.mesh.points[nodes[0, : ALL_CELLS[kind].n_corners]].mean(axis=0))
    return (
        f"a {kind} of the {parent_kind} {before.cell_number[parent]} at ({place}) with {cells.after[k]:.3g} "
        f"(it had {cells.before[cells.of[k]]:.3g})"
    )


def _advice(before: Mesh, cut: Cut, cells: Touched, poor: Ints, least: float) -> str:
    """Advice in a sentence: the other variant, a better mesh, or a lower limit."""
    of = np.unique(cells.of[poor])
    if (cells.before[of] < least).all():
        return "Their parents were below it before: mesh them better, or ask for less"
    for hexa, values in _variants(before, cut, cells):
        there = values[of].min()
        if there > cells.least[of].min() + 1e-9:
            enough = "is enough" if values.min() >= least else "is better there, not enough"
            return f"--hexa {hexa} {enough} (at least {there:.3g})"
    return "No variant is better there: refine the mesh, or ask for less"
