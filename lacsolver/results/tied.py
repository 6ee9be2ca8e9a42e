"""Ties across a gap whose skins turn far: the arm from one skin to the other follows the slave's normal linearly.

A tie holds the mean of u(x) + r dn(u) - u(x_bar), with r the gap and dn(u) the linear change of the slave's normal n
under u. A rigid motion of both skins has r (n(u) - n) in the place of r dn(u): their difference, of about r times half
the square of the angle, is how far the skins are from where they belong.
"""

from __future__ import annotations

import numpy as np

from lacmesh.surface.maps import coefficients, slopes
from lacmesh.surface.normals import dual_vectors, normals_of, unit
from lacsolver.contact import Interface
from lacsolver.problem.problem import Problem
from lacsolver.results.state import State

#: how far skins may be from where they belong, relative to the size of a macro-element
_OFF = 0.01


def turned_across_a_gap(problem: Problem, state: State, face: Interface) -> str:
    """Return a warning about a tie whose skins a rotation takes apart, "" without one; `face`: its interface."""
    space, points, slave = problem.space, face.points, face.slave
    before, now = (
        slopes(coefficients(skin), points.slave, points.xi_slave, slave.dim)
        for skin in (slave, slave.at(space.places(state.u)))
    )
    n, turned = unit(normals_of(before)), unit(normals_of(now))
    linear = -np.einsum("ksa,kt,kta->ks", dual_vectors(before), n, now - before)
    arm = points.ray * np.sign((n * points.normal).sum(axis=1))
    off = (arm * points.weight)[:, None] * (turned - n - linear)
    area = space.share.total(np.bincount(points.macro, points.weight, len(face.w)).astype(float))
    sums = [space.share.total(np.bincount(points.macro, off[:, k], len(face.w)).astype(float)) for k in range(3)]
    away = np.linalg.norm(sums, axis=0) / np.where(area > 0, area, 1.0)
    worst = int((away / face.length).argmax())
    if not away[worst] > _OFF * face.length[worst]:
        return ""
    gap = space.share.largest(float(np.abs(points.ray).max(initial=0.0)))
    cosine = np.clip((n * turned).sum(axis=1), -1, 1)
    angle = space.share.largest(float(np.arccos(cosine).max(initial=0.0)))
    place = ", ".join(space.told(face.centre[worst] + space.origin[: space.dim]))
    return (
        f"tie {face.zone.name!r} has a gap of up to {gap:.4g} between its skins, which turn by {angle:.3g} radian by "
        f"time {state.time:.6g}: it is for small rotations, and takes them {away[worst]:.4g} from where they belong "
        f"near ({place}); close the gap in the mesh"
    )
