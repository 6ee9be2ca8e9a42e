"""Tangential rows of an interface: tangents of the slave's skin at its contact points, and the slip along them.

    B_T v = int_{T_m} e_alpha.(v(x) + r dn(v) - v(x_bar)) dGamma

is the slip of the slave over its master along the tangents e_alpha: the virtual work of a traction on the master along
e_alpha of size 1. r = (x_bar - x).n is the ray from face to face, and dn(v) the change of a normal that leans on the
slave's face at slopes that stay, but for a part along n,

    dn(v) = sum_a (a^a.n) (N.dv/dxi^a) N - (n.dv/dxi^a) a^a

with the dual vectors a^a of the face's tangents and its own normal N. It is that of the normals of smooth surfaces.
Normals that depend on other faces too, smoothed ones and those of the master, change as a vector that the face draws
along,

    dn(v) = sum_a (a^a.n) dv/dxi^a - (N.n) (N.dv/dxi^a) a^a

as the other form leaves edges that fold under without an equilibrium. If v is a rotation, both are the change of n, and
the slip is 0: the moments of tractions balance across a gap, as their forces do.

The tangents move with the skin: the vector A_1, one for each macro-element (`first_directions`), has the components
c^a = A^a.A_1 in the undeformed face, and

    a_1 = c^a dx/dxi^a,   e_1 = (a_1 - n n.a_1) / |..|,   e_2 = n x e_1

at every point. In a plane e_1 is n turned by a right angle, which is the direction of the skin's segments; about an
axis it lies in the meridian's plane, and there is no twist. Being orthonormal, they give a traction its size at every
point: t_alpha e_alpha is as large as t.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacmesh.surface import ContactPoints, Surface
from lacmesh.surface.normals import dual_vectors, normals_of, unit
from lacmesh.surface.points import face_measure
from lacmesh.surface.record import mean_normals
from lacsolver.contact.faces import tangents
from lacsolver.contact.rows import macro_rows
from lacsolver.contact.zone import Zone

#: axes whose parts along the normals differ by less than this, of all of them, are equally tangential
_ALIKE = 1e-3
#: a macro-element whose unit normal has more than this along the axis of its zone takes the next axis
_STEEP = 0.9


def first_directions(zone: Zone) -> NDArray[np.floating]:
    """Return A_1 of each macro-element in space, a unit vector of its undeformed mean plane, (m, 3).

    It is the projection of one axis for the whole zone: of that which is most tangential to it, the first of several.
    """
    sums = zone.sums(mean_normals(zone.slave)[0] * face_measure(zone.slave)[:, None])
    n = unit(sums)
    along = (np.abs(sums) * np.abs(n)).sum(axis=0)
    axis = int(np.flatnonzero(along <= along.min() + _ALIKE * along.sum())[0])
    of_macro = np.where(np.abs(n[:, axis]) > _STEEP, (axis + 1) % 3, axis)
    e = np.eye(3)[of_macro]
    return unit(e - (e * n).sum(axis=1, keepdims=True) * n)


def _components(zone: Zone, face: Ints, xi: Floats) -> NDArray[np.floating]:
    """Return the components c (points, 2) of A_1 in the undeformed faces at points xi (points, 2) of them."""
    dual = dual_vectors(tangents(zone.slave, face, xi))
    return np.einsum("psa,ps->pa", dual, first_directions(zone)[zone.macro[face]])


class Tangents(NamedTuple):
    """Tangents e_alpha (points, d - 1, d) of a slave, and the components c (points, 2) of a_1 in its faces."""

    e: Floats
    c: Floats


def frames(zone: Zone, face: Ints, xi: Floats, n: Floats, J: Floats) -> Tangents:
    """Return the tangents at points xi (points, 2) of faces with unit normals n (points, 3).

    `J` (points, 3, dim of the skins): tangents of the faces along their coordinates, as they are deformed.
    """
    if J.shape[2] == 1:
        return Tangents(np.stack([-n[:, 1], n[:, 0]], axis=1)[:, None], np.tile([1.0, 0.0], (len(n), 1)))
    c = _components(zone, face, xi)
    a = np.einsum("psa,pa->ps", J, c)
    e = unit(a - (a * n).sum(axis=1, keepdims=True) * n)
    return Tangents(np.stack([e, np.cross(n, e)], axis=1), c)


def jump_rows(
    slave: Surface, master: Surface, points: ContactPoints, weight: Floats, e: Floats, m: int, J: Floats,
    leans: bool = True,
) -> csr_array:  # fmt: skip
    """Return the rows int e_alpha.(v(x) + r dn(v) - v(x_bar)), (m k, n_dof), of directions e (points, k, d).

    `J` (points, 3, dim of the skins): tangents of the slave's faces; `leans`: True if normals are those of the slave's
    faces, or lean on them.
    """
    d = e.shape[2]
    dual, N, n = dual_vectors(J), unit(normals_of(J)), points.normal
    out, along = np.einsum("psa,ps->pa", dual, n), (e @ dual[:, :d]).transpose(0, 2, 1)
    if leans:
        turned = out[:, :, None] * (e @ N[:, :d, None]).transpose(0, 2, 1)
        arms = turned[..., None] * N[:, None, None, :d] - along[..., None] * n[:, None, None, :d]
    else:
        share = (N * n).sum(axis=1)[:, None, None] * along
        arms = out[:, :, None, None] * e[:, None] - share[..., None] * N[:, None, None, :d]
    arms *= (weight * points.ray)[:, None, None, None]
    return macro_rows(points, slave, master, weight[:, None, None] * e, m, arms)


def integrals(e: Floats, macro: Ints, weight: Floats, m: int) -> NDArray[np.floating]:
    """Return the integrals over macro-elements, (m, ...), of values e (points, ...) at points with their weights."""
    flat = weight[:, None] * e.reshape(len(e), int(np.prod(e.shape[1:])))
    sums = np.stack([np.bincount(macro, column, m).astype(float) for column in flat.T], axis=1)
    return sums.reshape(m, *e.shape[1:])
