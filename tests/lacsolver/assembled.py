"""Forces, tangent, energy and stress of bodies at finite strains, each by one call; whether two of these agree."""

from __future__ import annotations

from lacsolver.bodies.pointwise import DisplacedBodies


def internal_force(space, materials, u, **options):
    """Return f_int (n_dof,)."""
    return DisplacedBodies(space, materials, u, **options).internal_force()


def tangent(space, materials, u, *, out=None, **options):
    """Return K (n_dof, n_dof)."""
    return DisplacedBodies(space, materials, u, **options).tangent(out)


def force_and_tangent(space, materials, u, *, out=None, **options):
    """Return f_int (n_dof,) and K (n_dof, n_dof)."""
    body = DisplacedBodies(space, materials, u, **options)
    return body.internal_force(), body.tangent(out)


def stored_energy(space, materials, u, **options):
    """Return the stored energy."""
    return DisplacedBodies(space, materials, u, **options).energy()


def cauchy_stress(space, materials, u, **options):
    """Return the Cauchy stress (cells, points, 4 or 6) of each block."""
    return DisplacedBodies(space, materials, u, **options).cauchy_stress()


def first_piola(space, materials, u, **options):
    """Return the first Piola stress P_si (cells, points, 3, 3) of each block."""
    return DisplacedBodies(space, materials, u, **options).evaluated(lambda P, F: P)


def agree(one, other):
    """True if two arrays or sparse matrices agree to round-off, relative to the largest entry.

    Their last bits may depend on the number of threads: numpy has other loops for other layouts of an array.
    """
    return bool(abs(one - other).max() <= 1e-14 * abs(other).max())
