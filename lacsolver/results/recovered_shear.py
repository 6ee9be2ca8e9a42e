"""Recovery of a continuous traction of friction on the slave from the means t_m, as `recovery` does for the pressure.

The traction of what slides is b(p) d, with the bound b at the recovered pressure p and the direction d of t. At the
edge of what sticks t leaves the bound as a square root: in Cattaneo's and Mindlin's problem the rest of the bound,

    r = b(p) - |t| >= 0,    0 where it slides,

is the pressure of a smaller contact, the area that sticks. So r is recovered as a pressure is, from its means r_m =
b(p_m) - |t_m|, with what slides in the place of what is open, and

    t = (b(p) - r) d.

d is the direction of parabolas that are fitted to the components of t_m. Where these parabolas are below half of the
bound, as where t goes through 0 and |t| has a kink, t is theirs. Nowhere is |t| above the bound.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacmesh.surface.normals import unit
from lacsolver.contact.friction import Bounds
from lacsolver.contact.laws import CONTACT, OPEN, SLIDES
from lacsolver.results.recovery import recover_pressure

#: part of the bound above which a traction has a direction
_HALF = 0.5


def recover_shear(
    surface: Surface,
    macro: Ints,
    shear: Floats,
    pressure: tuple[Floats, Floats],
    status: Ints,
    bounds: Bounds,
    *,
    axisymmetric: bool = False,
    coverage: Floats | None = None,
) -> NDArray[np.floating]:
    """Return a continuous traction of friction on the master at nodes (n_nodes, d), NaN off the slave's surface.

    `surface`, `macro` (faces,), `status` and `coverage` (n_macros,) as for `recover_pressure`; `shear` t_m
    (n_macros, d), vectors of space; `pressure`: p_m (n_macros,), and the recovered one at nodes (n_nodes,); `bounds`
    of the macro-elements.
    """
    p_m, p = pressure

    def recovered(means: Floats, states: Ints, unilateral: bool) -> NDArray[np.floating]:
        return recover_pressure(
            surface, macro, means, states, axisymmetric=axisymmetric, unilateral=unilateral, coverage=coverage
        )[0]

    plain = np.stack([recovered(means, status, False) for means in shear.T], axis=1)
    limit = _at_nodes(surface, macro, bounds, status >= CONTACT).at(np.where(np.isnan(p), 0.0, p))[0]
    finite, b_m = np.isfinite(limit), bounds.at(p_m)[0]
    left = np.where(np.isfinite(b_m), b_m - np.linalg.norm(shear, axis=1), 0.0)
    rest = recovered(np.maximum(left, 0.0), np.where(status == SLIDES, OPEN, status), True)
    size = np.linalg.norm(plain, axis=1)
    near = finite & (size > _HALF * limit)
    wanted = np.where(near, np.maximum(limit - rest, 0.0), np.where(finite, np.minimum(size, limit), size))
    return np.asarray(wanted[:, None] * unit(plain))


def _at_nodes(surface: Surface, macro: Ints, bounds: Bounds, contact: NDArray[np.bool_]) -> Bounds:
    """Return bounds (n_nodes,), at each node the means over its faces in contact; 0 without any."""
    n, on = len(surface.x), (macro >= 0) & contact[macro]
    face, k = np.nonzero((surface.faces.nodes >= 0) & on[:, None])
    node, own = surface.faces.nodes[face, k], macro[face]
    count = np.bincount(node, minlength=n)

    def mean(values: Floats) -> NDArray[np.floating]:
        return np.divide(np.bincount(node, values[own], n), count, out=np.zeros(n), where=count > 0)

    return Bounds(*map(mean, bounds))
