"""A cylinder on a block and a sphere on its like, as finite bodies: pressures by finite elements that are written here.

    PYTHONPATH=. python data/provenance/finite_bodies.py

prints `PROFILES` of `verification/exact/finite_bodies.py` (a minute and a half of one core).

Nothing of lacmesh or lacsolver is in it. Bodies are grids of QUAD4 (small strains, 2 x 2 Gauss points), 128 cells to
the contact's half-width; a slave node and the point that it meets are both nodes, so that contact is between nodes: the
flexibility of the two skins and the gaps make a linear complementarity problem, solved by a primal-dual active set
(Hintermueller, Ito, Kunisch, SIAM J. Optim. 13, 2003). A nodal force over the area of its node is the pressure.
`linear`: the direction of contact is the normal of the plane master. `current`: normals of the slave and the points
that they hit are those of the deformed skins; the master's grid lines are moved until its nodes are there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from verification.exact.finite_bodies import (
    ALLOY,
    APPROACH,
    BLOCK,
    CYLINDER,
    FORCE,
    POISSON,
    PROFILES,
    PUSH,
    RADIUS,
    SPHERE,
    SPHERE_RADIUS,
    STEEL,
    Hertz,
    Profile,
)  # fmt: skip
from verification.grids import box, lines, quadrangles, quarter_disc, under_circle

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]

#: cells beyond the contact grow by this
GROWTH = 1.06
#: slave nodes up to this part of the half-width may meet a master
_REACH = 1.25
#: of a profile: where it is fitted, in parts of the half-space's radius; the first nodes of a sphere are left out, as
#: their areas vanish with the radius
_FITTED, _AXIS = 0.96, 0.06
_CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])


def fitted(s: Floats, p: Floats, force: float, first: float = 0.0) -> Profile:
    """A profile fitted to pressures at distances, both normalised as a profile's, from the distance `first` on."""
    used = (first <= s) & (s <= _FITTED)

    def off(t: Floats) -> Floats:
        return Profile(force, t[0], tuple(t[1:]))(s[used]) - p[used]

    t = least_squares(off, [1.0, 1.0, 0.0, 0.0], xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    return Profile(force, float(t[0]), (float(t[1]), float(t[2]), float(t[3])))


#: distance of slave nodes from the axis and pressure there, both of the undeformed body; and the total force
PressureProfile = tuple[Floats, Floats, float]


class Held(NamedTuple):
    """An elastic body, held and moved at some degrees of freedom: `u0` is its displacement without other forces."""

    points: Floats
    u0: Floats
    solve: Callable[[Floats], Floats]


def cylinder(n: int, *, current: bool = False, growth: float = GROWTH, turns: int = 4) -> PressureProfile:
    """The cylinder on the block, n cells to the half-width; with `current`, so many turns of moving the master."""
    a = Hertz.plane(FORCE).radius
    x = lines(CYLINDER[0], a / n, 1.5 * a, growth)
    upper, skin = _cylinder(x, lines(CYLINDER[1], a / n, a, growth))
    count = int((x <= _REACH * a).sum())
    slave = skin[:count]
    start = upper.points[slave]
    along = RADIUS * np.arcsin(x[: count + 1] / RADIUS)
    normal: Floats = (start - [0.0, RADIUS]) / RADIUS if current else np.tile([0.0, -1.0], (count, 1))
    place = _ahead(start, normal, np.zeros((1, 2)), np.zeros(1))
    for _ in range(turns if current else 1):
        lower, master = _block(place, lines(BLOCK[0], a / n, 1.5 * a, growth), lines(BLOCK[1], a / n, a, growth))
        of_slave, of_master = _along(upper, slave, -normal), _along(lower, master, normal)
        flexible = np.einsum("ic,icj->ij", normal, of_master - of_slave)
        gap = ((lower.points[master] - start - _at(upper.u0, slave)) * normal).sum(axis=1)
        force = complementary(flexible, gap)
        if current:
            moved = start + _at(upper.u0, slave) + of_slave @ force
            pushed = lower.points[master] + of_master @ force
            normal = _outward(moved, along[:count])
            place = _ahead(moved, normal, pushed, lower.points[master, 0])
    area = np.concatenate([[along[1] / 2], (along[2:] - along[:-2]) / 2])
    return start[:, 0], force / area, float(-2 * normal[:, 1] @ force)


def sphere(n: int, *, growth: float = GROWTH) -> PressureProfile:
    """One of two like spheres, n cells to a radius of 10: by symmetry it stands on a plane that is rigid."""
    arc = np.pi / 4 * SPHERE_RADIUS
    along = lines(arc, 10.0 / n, 13.0, growth)
    x = quarter_disc(SPHERE_RADIUS, along / arc, lines(SPHERE_RADIUS, 10.0 / n, 10.0, growth) / SPHERE_RADIUS)
    node = np.arange(x[..., 0].size).reshape(x.shape[:2])
    points = x.reshape(-1, 2)
    flat = 2 * node[:, -1] + 1
    body = held(points, quadrangles(node), SPHERE, {-APPROACH: flat, 0.0: 2 * node[0]}, axisymmetric=True)
    skin = node[along <= 13.0, 0]
    up = np.tile([0.0, 1.0], (len(skin), 1))
    force = complementary(_along(body, skin, up)[:, 1], points[skin, 1] + body.u0[2 * skin + 1])
    r = points[node[: len(skin) + 1, 0]]
    ring = 2 * np.pi * np.linalg.norm(np.diff(r, axis=0), axis=1) / 6
    area = ring * (2 * r[:-1, 0] + r[1:, 0])
    area[1:] += (ring * (r[:-1, 0] + 2 * r[1:, 0]))[:-1]
    return r[:-1, 0], force / area, float(force.sum())


def profile(name: str, n: int = 128) -> Profile:
    """A profile of `PROFILES`, from finite elements of n cells to the half-width."""
    if name == "spheres":
        x, p, force = sphere(n)
        half_space, first = Hertz.round(force), _AXIS
    else:
        x, p, force = cylinder(n, current=name == "current")
        half_space, first = Hertz.plane(force), 0.0
    return fitted(x / half_space.radius, p / half_space.peak, force, first)


def held(points: Floats, cells: Ints, young: float, fixed: dict[float, Ints], *, axisymmetric: bool = False) -> Held:
    """A body (n, 2) of QUAD4 (k, 4) with prescribed values at some degrees of freedom, its stiffness factorised."""
    K = stiffness(points, cells, young, axisymmetric=axisymmetric)
    u0 = np.zeros(points.size)
    for value, dofs in fixed.items():
        u0[dofs] = value
    free = np.setdiff1d(np.arange(points.size), np.concatenate(list(fixed.values())))
    factor = splu(K[free][:, free], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)

    def solve(load: Floats) -> Floats:
        u = np.zeros_like(load)
        u[free] = factor.solve(np.ascontiguousarray(load[free]))
        return u

    u0[free] = factor.solve(-(K @ u0)[free])
    return Held(points, u0, solve)


def stiffness(points: Floats, cells: Ints, young: float, *, axisymmetric: bool = False) -> csc_matrix:
    """Stiffness matrix of QUAD4 in plane strain or axisymmetric about x = 0. Raises ValueError for an inverted cell."""
    lame, mu = young * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), young / (2 * (1 + POISSON))
    D = np.diag([2 * mu, 2 * mu, 2 * mu, mu])
    D[:3, :3] += lame
    own = np.zeros((len(cells), 8, 8))
    for s, t in _CORNERS / np.sqrt(3):
        N = (1 + _CORNERS[:, 0] * s) * (1 + _CORNERS[:, 1] * t) / 4
        dN = _CORNERS * (1 + _CORNERS * [s, t])[:, ::-1] / 4
        J = np.einsum("kni,nj->kij", points[cells], dN)
        w = np.linalg.det(J)
        if (w <= 0).any():
            raise ValueError("cells are inside out")
        G = dN @ np.linalg.inv(J)
        B = np.zeros((len(cells), 4, 8))
        B[:, 0, 0::2] = B[:, 3, 1::2] = G[..., 0]
        B[:, 1, 1::2] = B[:, 3, 0::2] = G[..., 1]
        if axisymmetric:
            r = points[cells][..., 0] @ N
            B[:, 2, 0::2] = N / r[:, None]
            w = w * 2 * np.pi * r
        own += np.einsum("kai,ab,kbj->kij", B, D, B * w[:, None, None], optimize=True)
    dof = (2 * cells[..., None] + [0, 1]).reshape(len(cells), 8)
    where = np.repeat(dof, 8, axis=1).ravel(), np.tile(dof, (1, 8)).ravel()
    return csc_matrix((own.ravel(), where), shape=(points.size, points.size))


def complementary(flexible: Floats, gap: Floats, limit: int = 100) -> Floats:
    """Forces f >= 0 with gaps A f + g >= 0 that are 0 where f > 0. Raises RuntimeError without convergence."""
    touching = gap < 0
    for _ in range(limit):
        f = np.zeros(len(gap))
        f[touching] = np.linalg.solve(flexible[np.ix_(touching, touching)], -gap[touching])
        closed = np.where(touching, f > 0, flexible @ f + gap < 0)
        if (closed == touching).all():
            return f
        touching = closed
    raise RuntimeError(f"the set of nodes in contact does not settle in {limit} turns")


def _cylinder(x: Floats, y: Floats) -> tuple[Held, Ints]:
    """The cylinder, and the nodes of its underside."""
    node = np.arange(len(x) * len(y)).reshape(len(x), len(y))
    fixed = {-PUSH: 2 * node[:, -1] + 1, 0.0: 2 * node[0]}
    return held(under_circle(x, y, RADIUS).reshape(-1, 2), quadrangles(node), STEEL, fixed), node[:, 0]


def _block(place: Floats, x: Floats, y: Floats) -> tuple[Held, Ints]:
    """The block, with the first nodes of its top at places; and those nodes."""
    count = len(place)
    rest = place[-1] + (x[count:] - x[count - 1]) * (x[-1] - place[-1]) / (x[-1] - x[count - 1])
    x = np.concatenate([place, rest])
    node = np.arange(len(x) * len(y)).reshape(len(x), len(y))
    points = box(x, -y[::-1]).reshape(-1, 2)
    fixed = np.concatenate([2 * node[:, 0], 2 * node[:, 0] + 1, 2 * node[0, 1:]])
    return held(points, quadrangles(node), ALLOY, {0.0: fixed}), node[:count, -1]


def _along(body: Held, nodes: Ints, n: Floats) -> Floats:
    """Flexibility (k, 2, k): displacement of each node under a unit force along n (k, 2) at each node in turn."""
    load = np.zeros((body.points.size, len(nodes)))
    each = np.arange(len(nodes))
    load[2 * nodes, each], load[2 * nodes + 1, each] = n.T
    return _at(body.solve(load), nodes)


def _at(u: Floats, nodes: Ints) -> Floats:
    return u.reshape(-1, 2, *u.shape[1:])[nodes]


def _outward(x: Floats, along: Floats) -> Floats:
    """(n, 2): normals of a line of points, downward; the first lies on the plane of symmetry."""
    t = np.gradient(x, along, axis=0, edge_order=2)
    t[0, 1] = 0.0
    n = np.stack([t[:, 1], -t[:, 0]], axis=-1)
    return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))


def _ahead(x: Floats, n: Floats, skin: Floats, place: Floats) -> Floats:
    """(k,): the undeformed places of what lies ahead of points along n, on a skin whose points were at `place`."""
    hit = x[:, 0]
    for _ in range(20):
        hit = x[:, 0] + n[:, 0] / n[:, 1] * (np.interp(hit, *skin.T) - x[:, 1])
    at = hit - np.interp(hit, skin[:, 0], skin[:, 0] - place)
    at[0] = 0.0
    return at


if __name__ == "__main__":
    for name in PROFILES:
        print(f'"{name}": {profile(name)}', flush=True)
