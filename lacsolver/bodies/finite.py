"""Bodies at finite strains, in the undeformed configuration (total Lagrangian).

laws = hyperelastic energies, stress and tangent at a point      (hyperelastic, dilatation)
f_int(u), K(u), stress and energy of these laws and of others    (pointwise)
thermal stretch at integration points                            (here)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.bodies.hyperelastic import NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.points import Field, Piece, gathered
from lacsolver.bodies.small.fields import TemperatureField, temperature_at, temperatures
from lacsolver.space.space import Space

__all__ = ["InadmissibleError", "NeoHookean", "SaintVenantKirchhoff", "thermal_stretches"]


def thermal_stretches(
    space: Space, materials: Materials, temperature: TemperatureField | None, t: float = 1.0, degree: int | None = None
) -> Field | None:
    """Return the thermal stretches (cells, points) at time t: 1 + expansion (T - T0), and 1 where no T is given.

    None if no temperature is given at all. `temperature` as in `bodies.small.stress`. Raises DataError for a
    temperature that shrinks a cell to nothing.
    """
    given = temperatures(space, temperature)
    if not given:
        return None
    expansion = np.array([law.expansion if isinstance(law, Elastic) else 0.0 for law in materials.laws])
    start = np.array([law.reference_temperature for law in materials.laws])

    def stretch(part: Piece) -> NDArray[np.floating]:
        T = temperature_at(space, part, given, t)
        assert T is not None
        return 1.0 + expansion[part.law] * np.nan_to_num(T - start[part.law], nan=0.0)

    stretches = gathered(space, stretch, laws=materials.law, degree=degree)
    for block, theta in zip(space.blocks, stretches, strict=True):
        gone = block.cell[theta.min(axis=1) <= 0]
        if len(gone):
            message = f"at time {t:.6g} the temperature shrinks cells {space.mesh.cell_names(gone)} to nothing"
            raise DataError(f"{message}; check expansion, and that temperatures are given in its unit")
    return stretches
