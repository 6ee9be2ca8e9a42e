"""Results of metals that yield: the accumulated plastic strain, and the energy that the flow has taken."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.bodies.plastic import Plastic
from lacsolver.bodies.points import Field, weights
from lacsolver.equilibrium.state import State
from lacsolver.problem.problem import Problem
from lacsolver.results.nodal import nodal_values, von_mises
from lacsolver.results.results import PlasticFigures


def yields(problem: Problem) -> bool:
    """True if a material of the case yields."""
    return any(isinstance(law, Plastic) for law in problem.materials.laws)


def plastic_strain(problem: Problem, history: tuple[Floats, ...]) -> Field:
    """Return the accumulated plastic strain at integration points, (cells, points) for each block; 0 in other laws.

    `history`: what the laws keep after a step, () at the start.
    """
    laws, out = problem.materials.laws, []
    for k, W in enumerate(weights(problem.space)):
        p = np.zeros(W.shape)
        if history:
            own = np.array([isinstance(law, Plastic) for law in laws])[problem.materials.law[k]]
            p[own] = history[k][own, :, 0]
        out.append(p)
    return tuple(out)


def nodal_plastic_strain(problem: Problem, state: State) -> NDArray[np.floating] | None:
    """Return the accumulated plastic strain at the nodes (n_nodes,), None if no material yields.

    It is extrapolated as a stress is, but never below 0.
    """
    if not yields(problem):
        return None
    p = plastic_strain(problem, state.step.histories.materials)
    at_nodes = nodal_values(problem.space, [values[:, :, None] for values in p], 1)
    return np.maximum(problem.space.share.update(at_nodes)[:, 0], 0.0)


def plastic_figures(problem: Problem, state: State, stress: Field) -> PlasticFigures | None:
    """Return the figures of the flow in the step that led to a state; None if no material yields.

    `stress`: that of the state at integration points.
    """
    if not yields(problem):
        return None
    space, share = problem.space, problem.space.share
    after = dissipated(problem, state.step.histories.materials, state.time)
    before = dissipated(problem, state.history, state.time)
    p = plastic_strain(problem, state.step.histories.materials)
    strain = max((values.max(initial=0.0) for values in p), default=0.0)
    most = 0.0
    for k, values in enumerate(stress):
        own = [isinstance(problem.materials.laws[law], Plastic) for law in problem.materials.law[k]]
        chosen = values[np.array(own, bool)]
        most = max(most, float(von_mises(chosen.reshape(-1, space.model.n_stress)).max(initial=0.0)))
    return PlasticFigures(share.largest(float(strain)), share.largest(most), (after - before, after))


def dissipated(problem: Problem, history: tuple[Floats, ...], t: float) -> float:
    """Return the energy that the flow has taken in the cells of all processes; 0 if no material yields."""
    space, total = problem.space, 0.0
    if not yields(problem):
        return total
    stretches = problem.kinematics.stretches(t) if problem.kinematics.finite else None
    for k, (block, p, W) in enumerate(zip(space.blocks, plastic_strain(problem, history), weights(space), strict=True)):
        volume = W if stretches is None else W * stretches[k] ** 3  # energies are those of the warm, stress-free cells
        for which, law in enumerate(problem.materials.laws):
            if isinstance(law, Plastic):
                own = (problem.materials.law[k] == which) & space.own_cells(block)
                total += float((volume[own] * law.dissipated(p[own])).sum())
    return float(problem.space.share.total(np.array(total)))
