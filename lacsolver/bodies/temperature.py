"""Temperatures of bodies at their integration points, as differences from the one without thermal strain.

Small strains lose the thermal strain (T - T0) alpha. Finite strains split F = F_e theta, theta = 1 + expansion (T -
T0): a law is a function of F_e, per volume of the warm, stress-free body, W = theta^3 W_e(F / theta).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError
from lacmesh.mesh import Ints, mask_of
from lacsolver.bodies.material import Materials
from lacsolver.bodies.points import Field, Piece, coordinates, gathered
from lacsolver.space.space import Space
from lacsolver.space.values import ScalarField, evaluate

#: a temperature of the whole body, or (temperature, cells) pairs, where None means all cells and later pairs override
#: earlier ones
TemperatureField = ScalarField | Sequence[tuple[ScalarField, Ints | None]]


def warming(space: Space, materials: Materials, temperature: TemperatureField | None, t: float = 1.0) -> Field | None:
    """Return T - T0 (cells, points) at time t, 0 in cells that have no temperature; None if nothing is given.

    Raises DataError for a temperature that shrinks a cell of a law of finite strains to nothing.
    """
    if temperature is None:
        return None
    given = temperature if isinstance(temperature, Sequence) else [(temperature, None)]
    masks = [None if cells is None else mask_of(space.mesh.n_cells, cells) for _, cells in given]

    def of_piece(part: Piece) -> NDArray[np.floating]:
        x, index = coordinates(space, part), space.blocks[part.block].cell[part.cells]
        out = np.zeros(x.shape[:2])
        for (value, _), mask in zip(given, masks, strict=True):
            rows = slice(None) if mask is None else np.flatnonzero(mask[index])
            out[rows] = evaluate(value, x[rows], t, "temperature") - materials.laws[part.law].reference_temperature
        return out

    warmer = gathered(space, of_piece, laws=materials.law)
    for block, theta in zip(space.blocks, stretches(space, materials, warmer), strict=True):
        gone = block.cell[theta.min(axis=1) <= 0]
        if len(gone):
            message = f"at time {t:.6g} the temperature shrinks cells {space.mesh.cell_names(gone)} to nothing"
            raise DataError(f"{message}; check expansion, and that temperatures are given in its unit")
    return warmer


def stretches(space: Space, materials: Materials, warmer: Field) -> Field:
    """Return the thermal stretches theta (cells, points) of laws of finite strains, 1 for others, from T - T0."""
    finite = np.array([law.finite for law in materials.at_points])
    expansion = np.where(finite, materials.thermal_strain[:, 0, 0], 0.0)
    return tuple(1.0 + expansion[law][:, None] * values for law, values in zip(materials.law, warmer, strict=True))
