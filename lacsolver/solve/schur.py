"""Solution of K q + B_A^T p = f, D_A q = G_A by the Schur complement, for any active set A with one factor of K.

With a factor of K, the pressures are solved for on the Schur complement D K^-1 B^T by generalised conjugate residuals,
a short loop of applications of K^-1, and q is updated in the same loop, without a solve of its own. With the
preconditioner of `saddle` the number of applications hardly grows with the mesh: 2 to 5 for a tenth of the residual, 20
to 25 to round-off. With multigrid, where K^-1 is itself iterative, both are solved for in one loop (`coupled`).

For bodies that only contact supports (`stiffness`), pressures are kept in balance with the load along each rigid-body
mode (the coarse projection of FETI, Farhat and Roux), so that the springs that make K definite carry no force, and the
rigid-body motions themselves follow from the gaps.
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

#: largest number of applications without a decrease: residuals stagnate while motions of little resistance are found
_PATIENCE = 40
#: largest number of applications of K^-1 in all
_MOST = 400
#: backward error (`linear.refine`) of forces in balance, a few units of round-off, and most corrections to reach it
_BALANCED, _CORRECTIONS = 2e-15, 3
#: a cycle that leaves more than this fraction of the residual has reached round-off
_SLOW = 0.5
#: orthogonalise a second time when the first pass leaves less than this fraction of the norm; fraction that is noise
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
    """Solve K q + B_A^T p + `turning` (q - q_0) = f and D_A q = G_A for q and p, from a start q_0, p, to a goal.

    `turning` (n, n): geometric stiffness, small compared with K; its forces are further unknowns of the loop.
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
    """An iterate in balance: unknowns q (n,), pressures p (m,), forces s of `turned`; residual r of gaps and of s.

    `force`: largest force of loads and contact; `products`: number of solves with K for the balance.
    """

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    s: NDArray[np.floating]
    r: NDArray[np.floating]
    force: float
    products: int


def _over(r: Floats, allowed: Floats) -> float:
    """Return the largest residual relative to `allowed`; relative to its unit it is a length."""
    return float((np.abs(r) / allowed).max(initial=0.0))


def _in_balance(K: Stiffness, f: Floats, terms: Floats, q: Floats) -> tuple[NDArray[np.floating], int]:
    """Correct q until K q = f to round-off; return q and the number of solves.

    terms (n,): sums of the magnitudes of the terms of f. A q that is in balance is left unchanged: another solve would
    add noise, which soft bodies turn into gaps.
    """
    if not f.any():  # no load: the rest of q is noise of earlier loads, without a scale to compare it with
        return K.R @ (K.R.T @ q), 0
    scale = 1 / np.sqrt(np.abs(K.diagonal))
    for count in range(_CORRECTIONS):
        r = f - K.K @ q
        if backward_error(scale, q, r, terms) <= _BALANCED:
            return q, count
        q = q + K.solve(r)
    return q, _CORRECTIONS


class _Loop:
    """Operators of one active set. Residuals are gaps of the active rows, then forces of the unknowns `turned`."""

    def __init__(
        self, K: Stiffness, rows: Rows, active: Ints, turning: csr_array | None, start: Floats, G: Floats
    ) -> None:
        self.K, self.rows, self.active, self.start, self.G = K, rows, active, start, G
        self.D, self.n = rows.D[active], len(active)
        self.turned = np.empty(0, np.int64) if turning is None else np.flatnonzero(np.diff(turning.indptr))
        self.turning = csr_array((0, K.K.shape[0])) if turning is None else turning[self.turned]
        self.skins = Skins(K, rows, active)
        stiff = np.abs(K.diagonal[self.turned]) if len(self.turned) else np.empty(0)
        self.unit = np.concatenate([rows.w[active], stiff])  # residuals divided by it are lengths
        self.QB, self.QD = self.skins.QB, np.concatenate([self.skins.QD, self.turning @ K.R])

    def spread(self, s: Floats) -> NDArray[np.floating]:
        """Return forces s of `turned` on all unknowns, (n,)."""
        out = np.zeros(self.K.K.shape[0])
        out[self.turned] = s
        return out

    def balanced(self, p: Floats, f: Floats) -> NDArray[np.floating]:
        """Return pressures, 0 on inactive rows, that balance the load along modes that the active rows constrain."""
        out = np.zeros_like(p)
        out[self.active] = p[self.active]
        out[self.active] += self.skins.carrying(self.K.R.T @ (f - self.rows.B_T @ out))
        return out

    def precondition(self, r: Floats) -> NDArray[np.floating]:
        """Return the preconditioned correction for r, in balance along the rigid-body modes: pressures, then forces."""
        s = r[self.n :]
        z = self.skins.pressing(r[: self.n])
        moment = self.QB.T @ z + self.K.R[self.turned].T @ s
        return np.concatenate([z - self.skins.carrying(moment), s])

    def project(self, r: Floats) -> NDArray[np.floating]:
        """Return the part of a residual that remains after the best rigid-body motion."""
        return np.asarray(r - self.QD @ self.motion(r))

    def motion(self, r: Floats) -> NDArray[np.floating]:
        """Return the amplitudes (r,) of the rigid-body modes that best close the gaps of a residual."""
        return np.asarray(self.skins.inverse @ (self.QB.T @ r[: self.n]))

    def moved(self, z: Floats) -> NDArray[np.floating]:
        """Return K^-1 (B_A^T p + s)."""
        full = np.zeros(self.rows.B.shape[0])
        full[self.active] = z[: self.n]
        return self.K.solve(self.rows.B_T @ full + self.spread(z[self.n :]))

    def residual(self, q: Floats, s: Floats) -> NDArray[np.floating]:
        """Return the residual of gaps, and the difference between the forces of `turning` and s."""
        return np.concatenate([self.D @ q - self.G, self.turning @ (q - self.start) - s])

    def settled(self, f: Floats, q: Floats, p: Floats, s: Floats) -> _Found:
        """Return an iterate near q in balance with p and s, with the rigid-body motion that best closes the gaps."""
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
        """Return the tolerance of each residual: for gaps the lower limit of the goal, for forces a part of `force`."""
        forces = np.full(len(self.turned), max(goal.relative * now.force, 1e-300))
        return np.concatenate([max(goal.least(now.q), 1e-300) * self.unit[: self.n], forces])

    def run(self, now: _Found, allowed: Floats, most: int) -> tuple[Floats, Floats, Floats, int]:
        """Run generalised conjugate residuals on lengths: gaps as means over macro-elements, forces over stiffness.

        Returns steps of q, p and s, and the number of directions. The loop ends when the residual is at most `allowed`,
        when it no longer falls, or when a direction depends on the earlier ones up to round-off.
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
