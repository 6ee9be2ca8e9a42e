"""Figures of a motion before it is computed: wave speeds, the smallest cell, the step that they suggest, momentum."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lacmesh.cells import CELLS
from lacsolver.problem.initial import fitted, initial_motion
from lacsolver.problem.problem import Problem


class MotionFound(NamedTuple):
    """Figures of a case with [dynamics].

    `speeds`: lowest and highest speed of pressure waves; `cell`: smallest size of a cell that the cut has left whole;
    `crossed`: number of such cells that a wave crosses in the longest step; `suggested`: time in which it goes from one
    corner of such a cell to the next, or to the mid-node of a quadratic one.
    `mass`: of all cells and rigid bodies; `massless`: number of nodes without mass; `moved`: largest relative change of
    a body's inertia by them; `momentum` (dim,) at the start; `told`: warnings.
    """

    speeds: tuple[float, float]
    cell: float
    crossed: float
    suggested: float
    mass: float
    massless: int
    moved: float
    momentum: tuple[float, ...]
    told: tuple[str, ...] = ()


def motion_found(problem: Problem) -> MotionFound:
    """Return the figures of a problem with [dynamics]. Raises CaseError for an initial motion that is excluded."""
    inertia, space, case = problem.inertia, problem.space, problem.case
    assert inertia is not None and case.dynamics is not None
    start, n = case.dynamics.start, space.n_dof
    displacements, velocities = initial_motion(space, case, start)
    fitted(problem, displacements, problem.constraints.u0(start), "displacement")
    rate = fitted(problem, velocities, np.zeros(n), "velocity")
    momentum = (inertia.M @ (inertia.tangent(0 * rate, start) @ rate)).reshape(-1, space.dim).sum(axis=0)
    speeds, (cell, spacing) = _speeds(problem), _smallest(problem)
    ends = np.array([0.0, *case.steps.planned])
    step = np.diff([start, *ends[ends > start]]).max()
    one = np.tile(np.eye(space.dim)[-1], inertia.M.shape[0] // space.dim)
    moved = max(inertia.moved().values(), key=abs, default=0.0)
    low, high = float(speeds.min()), float(speeds.max())
    return MotionFound(
        (low, high), cell, float(high * step / cell), spacing / high,
        float(one @ inertia.M @ one), int(inertia.massless.nodes.sum()), moved, tuple(momentum.tolist()),
    )  # fmt: skip


def _speeds(problem: Problem) -> np.ndarray:
    """Return the speed of pressure waves in each law, the largest of all axes, sqrt(A_kkkk / rho)."""
    density = np.array([law.density for law in problem.materials.laws])
    stiff = np.einsum("ckkkk->ck", problem.materials.tensors).max(axis=1)
    return np.sqrt(stiff / density)


def _smallest(problem: Problem) -> tuple[float, float]:
    """Return the smallest extent of a cell along an axis, and the smallest distance of nodes that this gives.

    Children of the cut do not count where there are other cells.
    """
    space, sizes = problem.space, []
    parent = space.mesh.cell_data.get("lac_parent")
    for block in space.blocks:
        x = space.local.points[block.nodes][:, :, : space.dim]
        extent = np.ptp(x, axis=1).min(axis=1)
        whole = np.ones(len(extent), bool) if parent is None else parent[block.cell] < 0
        least = float((extent[whole] if whole.any() else extent).min())
        sizes.append((least, least / CELLS[block.type].order))
    cells, spacings = zip(*sizes, strict=True)
    return min(cells), min(spacings)
