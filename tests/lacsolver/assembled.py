"""Forces and tangent of bodies at finite strains together, and their first Piola stress."""

from __future__ import annotations

from lacsolver.bodies import finite
from lacsolver.bodies.finite.fields import evaluated


def force_and_tangent(space, materials, u, **options):
    """Return f_int (n_dof,) and K (n_dof, n_dof)."""
    rest = {name: value for name, value in options.items() if name != "out"}
    return finite.internal_force(space, materials, u, **rest), finite.tangent(space, materials, u, **options)


def first_piola(space, materials, u, **options):
    """Return the first Piola stress P_si (cells, points, 3, 3) of each block."""
    return evaluated(space, materials, u, lambda P, F, w: P, **options)
