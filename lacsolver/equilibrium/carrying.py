"""Least friction with which contact carries a load along rigid-body motions: by statics alone, for bodies of any kind.

Forces P >= 0 along normals and |T| <= phi b(P) along tangents carry a load f along motions R if R^T B^T (P, T) = R^T f.
For a given factor phi this is a linear program, with T along some directions in each tangent plane, and the least phi
follows by bisection. Where phi = 1 is enough, friction is no reason for a search that fails.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, hstack, vstack

from lacmesh.mesh import Floats
from lacmesh.surface.normals import unit
from lacsolver.equilibrium.state import Iterate
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.row_set import ShearRows
from lacsolver.space.sparse import sparse

#: load that may be left, relative to the whole
_LEFT = 1e-9
#: largest factor of friction that is tried, and the relative accuracy of the least one
_MOST, _NARROW = 1e6, 1e-7
#: directions of tractions in space, beside those along the motion under the load of bodies on a bed of springs
_DIRECTIONS = 16


class Asked(NamedTuple):
    """Name of a pair, and the parts of its pressure that its friction `carries` and that a load `asks` for."""

    pair: str
    carries: float
    asks: float


def carries(contact: ContactSystem, motions: Floats, load: Floats) -> bool:
    """Return True if contact can carry a load (r,) along motions (r, n), whatever gaps there are."""
    return not len(load) or _Statics.of(contact, motions, load).left(1.0)[0] <= _LEFT


def may_press_alone(contact: ContactSystem, motions: Floats) -> bool:
    """Return True if pressures may balance one another without a load along motions (r, n).

    So they do on bodies that are squeezed, shrunk on, or jammed by their friction.
    """
    most = _Statics.of(contact, motions, np.zeros(len(motions))).pressed()
    return most > 0.5  # it is 1 at least, or 0


def least_friction(contact: ContactSystem, motions: Floats, load: Floats, along: Floats) -> Asked | None:
    """Return what a load (r,) along motions (r, n) asks of the friction of the first pair that slides `along` (n,).

    None where contact carries it with the friction that there is, or without any, or with no friction at all.
    """
    statics = _Statics.of(contact, motions, load)
    if statics.left(1.0)[0] <= _LEFT or statics.left(_MOST)[0] > _LEFT:
        return None
    low, high = 1.0, _MOST
    while high > low * (1 + _NARROW):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if statics.left(middle)[0] <= _LEFT else (middle, high)
    P = statics.left(high)[1]
    for group in contact.pairs:
        if group.shear is not None and group.shear.vectors(contact.rows.B @ along).any():
            own, w = P[group.rows], contact.rows.w[group.rows]
            b = np.where(group.shear.bounds.rough, 0.0, group.shear.bounds.at(statics.size * own / w)[0])
            if b.any():
                part = float((b * w).sum() / (statics.size * own.sum()))
                return Asked(group.pair.name, part, high * part)
    return None


def friction_at(contact: ContactSystem, at: Iterate, load: float, along: Floats) -> Asked | None:
    """Return what a load along a motion `along` (n,) asks of friction under the pressures of an iterate.

    None where contact has more to resist it than friction, or where friction is enough. Rigid bodies may carry a load
    by pressures that elastic bodies do not have: then `least_friction` is None although the bodies slide.
    """
    move = contact.rows.B @ along
    if np.abs(move[at.active]).any():
        return None
    pressed = carried = 0.0
    name = ""
    for group in contact.pairs:
        if group.shear is not None and group.shear.vectors(move).any():
            way, p = np.linalg.norm(group.shear.vectors(move), axis=1), contact.lawful(at.p)[group.rows]
            pressed, carried = pressed + float(p @ way), carried + float(group.shear.bounds.at(p)[0] @ way)
            name = name or group.pair.name
    return Asked(name, carried / pressed, abs(load) / pressed) if abs(load) > carried > 0 and pressed > 0 else None


class _Statics:
    """The linear program, in forces (pressures times areas) in parts of the load's `size`.

    Its unknowns are the forces of all rows (m,), those along tangents in place of which there are the forces along
    directions of each macro-element, and what is left of the load, with either sign.
    """

    def __init__(self, contact: ContactSystem, motions: Floats, load: Floats) -> None:
        self.size = float(np.abs(load).max()) or 1.0
        self.load, m, w = load / self.size, len(contact.G), contact.rows.w
        self.n_rows = m
        unit_forces = csr_array((contact.rows.B @ motions.T / w[:, None]).T)
        bed = unit_forces * (w * contact.enforceable) @ unit_forces.T  # of springs, as stiff as their areas
        along = np.linalg.pinv(bed.toarray(), rcond=_LEFT, hermitian=True) @ load @ motions
        parts = [_directions(contact, shear, along) for shear in contact.sheared]
        columns = [unit_forces @ one.turned for one in parts]
        left = eye_array(len(load))
        self.A = hstack([unit_forces, *columns, left, -left], format="csr")
        n = [m, *(one.turned.shape[1] for one in parts), 2 * len(load)]
        bounds: list[tuple[float | None, float | None]] = [
            (0.0, 0.0) if shut else (0.0, None) if one_sided else (None, None)
            for shut, one_sided in zip(~contact.enforceable | contact.along_tangents, contact.one_sided, strict=True)
        ]
        self.bounds = bounds + [(0.0, None)] * sum(n[1:])
        self.cost = np.concatenate([np.zeros(sum(n[:-1])), np.ones(n[-1])])
        first, width = np.cumsum(n), len(self.cost)
        self._limits = [
            (
                sparse((len(one.slope), width), (one.of, start + np.arange(len(one.of)), 1.0)),
                sparse((len(one.slope), width), (np.arange(len(one.slope)), one.normal, one.slope)),
                one.rest / self.size,
                one.limit / self.size,
            )
            for one, start in zip(parts, first[:-2], strict=True)
        ]

    @classmethod
    def of(cls, contact: ContactSystem, motions: Floats, load: Floats) -> _Statics:
        """Return the program for motions of any size."""
        scale = np.abs(motions).max(axis=1, initial=0.0)
        scale[scale == 0] = 1.0
        return cls(contact, motions / scale[:, None], load / scale)

    def left(self, factor: float) -> tuple[float, NDArray[np.floating]]:
        """Return what is left of the load at best, with bounds times a factor, and the forces of all rows (m,)."""
        return self._best(self.cost, factor, self.bounds)

    def pressed(self) -> float:
        """Return the largest sum of pressures, each at most 1, in balance with the load."""
        normal = np.array([low == 0 and high is None for low, high in self.bounds[: self.n_rows]])
        bounds = [(low, 1.0 if n else high) for n, (low, high) in zip(normal, self.bounds[: self.n_rows], strict=True)]
        cost = np.zeros(len(self.cost))
        cost[np.flatnonzero(normal)] = -1.0
        nothing_left = [(0.0, 0.0) if c else one for c, one in zip(self.cost, self.bounds, strict=True)]
        return -self._best(cost, 1.0, bounds + nothing_left[self.n_rows :])[0]

    def _best(self, cost: Floats, factor: float, bounds: Sequence[tuple[float | None, float | None]]) -> tuple[
        float, NDArray[np.floating]
    ]:  # fmt: skip
        """Return the least cost, with bounds of friction times a factor, and the unknowns."""
        from scipy.optimize import linprog

        rows, most = [], []
        for taken, slope, rest, limit in self._limits:
            for matrix, bound in ((taken - factor * slope, factor * rest), (taken, factor * limit)):
                finite = np.flatnonzero(np.isfinite(bound))
                rows.append(csr_array(matrix)[finite])
                most.append(bound[finite])
        upper = (vstack(rows, format="csr"), np.concatenate(most)) if rows else (None, None)
        found = linprog(cost, *upper, self.A, self.load, bounds, method="highs")
        if found.x is None:
            return np.inf, np.zeros(len(self.cost))
        return float(found.fun), found.x


class _Directions(NamedTuple):
    """Unit tractions of a pair along some directions: `turned` (m, k), and the macro-element `of` (k,) each.

    Bounds of the macro-elements (n,), as forces: `slope` times that of the row `normal`, with `rest`, up to `limit`.
    """

    turned: csr_array
    of: NDArray[np.integer]
    normal: NDArray[np.integer]
    slope: NDArray[np.floating]
    rest: NDArray[np.floating]
    limit: NDArray[np.floating]


def _directions(contact: ContactSystem, shear: ShearRows, along: Floats) -> _Directions:
    """Return the directions of a pair's tractions: both in the plane; in space some, and those of a motion `along`."""
    b, n, w = shear.bounds, shear.n_rows, contact.rows.w[shear.normal]
    if shear.n_tangents == 1:
        each = np.broadcast_to(np.array([[1.0], [-1.0]]), (n, 2, 1))
    else:
        angle = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        ring = np.broadcast_to(np.stack([np.cos(angle), np.sin(angle)], axis=1), (n, _DIRECTIONS, 2))
        slip = unit(shear.vectors(contact.rows.B @ along))[:, None]
        each = np.concatenate([ring, slip, -slip], axis=1)
    k = each.shape[1]
    column = np.arange(n * k).reshape(n, k)
    acts = contact.enforceable[shear.at] & b.any[:, None]
    turned = sparse((len(contact.G), n * k), (shear.at[:, None], column[:, :, None], each * acts[:, None]))
    slope = np.where(np.isfinite(b.friction), b.friction, 0.0)
    rest = np.where(np.isfinite(b.friction), b.cohesion * w, np.inf)
    normal = np.arange(shear.normal.start, shear.normal.stop)
    return _Directions(turned, np.repeat(np.arange(n), k), normal, slope, rest, b.limit * w)
