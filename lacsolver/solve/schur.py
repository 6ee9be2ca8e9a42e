"""Pressures and displacements where some rows are held: K q + B_A^T p = f, D_A q = G_A, for any set A on one K.

With a factor of K, pressures are sought on the Schur complement D K^-1 B^T by generalised conjugate residuals, a short
loop of products with K^-1, and q follows on the way, without a solve of its own. With the preconditioner of `saddle`
the number of products hardly grows with the mesh: 2 to 5 to a tenth of the residual, 20 to 25 to round-off. With
multigrid, where K^-1 is a loop itself, both are sought in one loop (`coupled`).

Where bodies move freely but for contact (`stiffness`), pressures stay in balance with the load along each free motion
(the coarse projection of FETI, Farhat and Roux), so that the springs which make K definite carry nothing, and the
motions themselves follow from the gaps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.refine import backward_error
from lacsolver.solve.coupled import solve_coupled
from lacsolver.solve.saddle import Goal, Rows, Skins, Solved
from lacsolver.solve.stiffness import Stiffness

__all__ = ["Goal", "Rows", "Solved", "solve_rows"]

#: products without a new least: residuals stay where they are while the motions that hardly anything resists are found
_PATIENCE = 40
#: products in all
_MOST = 400
#: the backward error (`linear.refine`) of forces in balance, some units of rounding, and corrections until they are
_BALANCED, _CORRECTIONS = 2e-15, 3
#: a round that leaves more than this of the residual has met rounding
_SLOW = 0.5
#: an image that keeps less than this of its length when the others are taken out is not orthogonal yet; is noise
_LOST, _NOISE = 0.1, 1e-12


def solve_rows(
    K: Stiffness,
    rows: Rows,
    active: Ints,
    f: Floats,
    G: Floats,
    q: Floats,
    p: Floats,
    goal: Goal,
    turning: csr_array | None = None,
) -> Solved:
    """q and p with K q + B_A^T p + `turning` (q - q_0) = f and D_A q = G_A, from a guess q_0, p, to a goal.

    `turning` (n, n): how contact forces change as the skins move, small beside K; its forces are unknowns of the loop.
    """
    if K.cycles:
        return solve_coupled(K, rows, active, f, G, q, p, goal, turning)
    loop = _Loop(K, rows, active, turning, q, G[active])
    now = loop.settled(f, q, p, np.zeros(len(loop.turned)))
    loosely, products = goal.reduction * _over(now.r, loop.unit) * loop.unit, now.products
    while products < _MOST:
        allowed = np.maximum(loosely, loop.allowed(now, goal))
        left = _over(now.r, allowed)
        if left <= 1:
            break
        dq, dp, ds, count = loop.run(now, allowed, _MOST - products)
        then = loop.settled(f, now.q + dq, now.p + dp, now.s + ds)
        products += count + then.products
        less = _over(then.r, allowed)
        now = then if less < left else now
        if not less < _SLOW * left:
            break
    return Solved(now.q, now.p, products, _over(now.r[: loop.n], loop.unit[: loop.n]))


class _Found(NamedTuple):
    """Unknowns q (n,), pressures p (m,) and forces of `turned` s in balance; the residual r of gaps, and of s.

    `force`: the largest of loads and of contact; `products`: solves with K that the balance took.
    """

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    s: NDArray[np.floating]
    r: NDArray[np.floating]
    force: float
    products: int


def _over(r: Floats, allowed: Floats) -> float:
    """The largest residual, over what is allowed of it; over its unit, a length."""
    return float((np.abs(r) / allowed).max(initial=0.0))


def _in_balance(K: Stiffness, f: Floats, terms: Floats, q: Floats) -> tuple[NDArray[np.floating], int]:
    """q such that K q = f to rounding, and how many solves it took. terms (n,): the sizes of what f is summed from.

    What is in balance is left as it is: another solve would bring noise, which soft bodies turn into gaps.
    """
    if not f.any():  # what is left of earlier loads is noise, and nothing that it could be compared with
        return K.R @ (K.R.T @ q), 0
    scale = 1 / np.sqrt(np.abs(K.diagonal))
    for count in range(_CORRECTIONS):
        r = f - K.K @ q
        if backward_error(scale, q, r, terms) <= _BALANCED:
            return q, count
        q = q + K.solve(r)
    return q, _CORRECTIONS


class _Loop:
    """What the products of one active set share. Residuals are gaps of the active rows, then forces of `turned`."""

    def __init__(
        self, K: Stiffness, rows: Rows, active: Ints, turning: csr_array | None, start: Floats, G: Floats
    ) -> None:
        self.K, self.rows, self.active, self.start, self.G = K, rows, active, start, G
        self.D, self.n = rows.D[active], len(active)
        self.turned = np.empty(0, np.int64) if turning is None else np.flatnonzero(np.diff(turning.indptr))
        self.turning = csr_array((0, K.K.shape[0])) if turning is None else turning[self.turned]
        self.skins = Skins(K, rows, active)
        stiff = np.abs(K.diagonal[self.turned]) if len(self.turned) else np.empty(0)
        self.unit = np.concatenate([rows.w[active], stiff])  # residuals over it are lengths
        self.QB, self.QD = self.skins.QB, np.concatenate([self.skins.QD, self.turning @ K.R])

    def spread(self, s: Floats) -> NDArray[np.floating]:
        """(n,): forces of `turned` on all unknowns."""
        out = np.zeros(self.K.K.shape[0])
        out[self.turned] = s
        return out

    def balanced(self, p: Floats, f: Floats) -> NDArray[np.floating]:
        """Pressures of the active rows alone that carry the load along every free motion which these hold."""
        out = np.zeros_like(p)
        out[self.active] = p[self.active]
        out[self.active] += self.skins.carrying(self.K.R.T @ (f - self.rows.B_T @ out))
        return out

    def precondition(self, r: Floats) -> NDArray[np.floating]:
        """About what makes the residual r, in balance along the free motions: pressures, then forces."""
        s = r[self.n :]
        z = self.skins.pressing(r[: self.n])
        moment = self.QB.T @ z + self.K.R[self.turned].T @ s
        return np.concatenate([z - self.skins.carrying(moment), s])

    def project(self, r: Floats) -> NDArray[np.floating]:
        """What is left of a residual after the best free motion."""
        return np.asarray(r - self.QD @ self.motion(r))

    def motion(self, r: Floats) -> NDArray[np.floating]:
        """(r,): the free motion that closes the gaps of a residual best."""
        return np.asarray(self.skins.inverse @ (self.QB.T @ r[: self.n]))

    def moved(self, z: Floats) -> NDArray[np.floating]:
        """K^-1 (B_A^T p + s)."""
        full = np.zeros(self.rows.B.shape[0])
        full[self.active] = z[: self.n]
        return self.K.solve(self.rows.B_T @ full + self.spread(z[self.n :]))

    def residual(self, q: Floats, s: Floats) -> NDArray[np.floating]:
        """How far gaps are open, and how far the forces s are from those that the turning makes."""
        return np.concatenate([self.D @ q - self.G, self.turning @ (q - self.start) - s])

    def settled(self, f: Floats, q: Floats, p: Floats, s: Floats) -> _Found:
        """Unknowns near q in balance with p and s, moved freely so that gaps are closed best, and what is left."""
        p = self.balanced(p, f - self.spread(s))
        pressing, turned = self.rows.B_T @ p, self.spread(s)
        terms = np.abs(f) + abs(self.rows.B_T) @ np.abs(p) + np.abs(turned)
        q, products = _in_balance(self.K, f - pressing - turned, terms, q)
        if self.K.R.shape[1]:
            q = q - self.K.R @ self.motion(self.residual(q, s))
        acting = f + self.spread(self.turning @ self.start)
        force = max(float(np.abs(v).max(initial=0.0)) for v in (acting, pressing))
        return _Found(q, p, s, self.residual(q, s), force, products)

    def allowed(self, now: _Found, goal: Goal) -> NDArray[np.floating]:
        """What may be left of each residual: of gaps the least of the goal, of forces as much of the largest one."""
        forces = np.full(len(self.turned), max(goal.relative * now.force, 1e-300))
        return np.concatenate([max(goal.least(now.q), 1e-300) * self.unit[: self.n], forces])

    def run(self, now: _Found, allowed: Floats, most: int) -> tuple[Floats, Floats, Floats, int]:
        """Generalised conjugate residuals, of lengths: gaps as means over macro-elements, forces over stiffness.

        Returns steps of q, p and s, and how many directions there were. The loop ends where what is left of a residual
        is `allowed`, or no longer falls, or where a direction is one of those before but for rounding.
        """
        unit, ends = self.unit, allowed / self.unit
        r = self.project(now.r) / unit
        left = best = _over(r, ends)
        z, y_all, since = np.zeros(len(unit)), np.zeros_like(now.q), 0
        directions: list[tuple[Floats, Floats, Floats]] = []
        while left > 1 and since < _PATIENCE and len(directions) < most:
            d = self.precondition(r * unit)
            y = self.moved(d)
            image = self.project(np.concatenate([self.D @ y, self.turning @ y + d[self.n :]])) / unit
            whole = size = float(np.linalg.norm(image))
            for _ in range(2):
                before = size
                for d0, y0, image0 in directions:
                    a = image @ image0
                    d, y, image = d - a * d0, y - a * y0, image - a * image0
                size = float(np.linalg.norm(image))
                if size >= _LOST * before:
                    break
            if not size > _NOISE * whole:
                break
            d, y, image = d / size, y / size, image / size
            directions.append((d, y, image))
            a = r @ image
            z, y_all, r = z + a * d, y_all + a * y, r - a * image
            left = _over(r, ends)
            since = 0 if left < 0.9 * best else since + 1
            best = min(best, left)
        dp = np.zeros_like(now.p)
        dp[self.active] = z[: self.n]
        return -y_all, dp, z[self.n :], len(directions)
