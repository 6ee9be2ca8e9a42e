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

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.coupled import solve_coupled
from lacsolver.saddle import Goal, Rows, Skins, Solved
from lacsolver.stiffness import Stiffness

__all__ = ["Goal", "Rows", "Solved", "solve_rows"]

#: residuals that stop falling are what rounding leaves: this many products without a new least
_PATIENCE = 6
_MOST = 400
#: forces that add up to this much of the largest one are in balance
_BALANCED = 1e-14
#: what rounding leaves of the balance and of the gaps after a long loop is taken away by so many short ones
_REFINEMENTS = 2


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
    loop = _Loop(K, rows, active, turning)
    start = q
    p = loop.balanced(p, f)
    s: NDArray[np.floating] = np.zeros(len(loop.turned))
    q, products = _in_balance(K, f - rows.B_T @ p, q)
    left = 0.0
    for _ in range(1 + (_REFINEMENTS if goal.reduction == 0 else 0)):
        q, p, s, count, left = loop.run(q, p, s, G, start, goal)
        q, more = _in_balance(K, f - rows.B_T @ p - loop.spread(s), q)
        products += count + more
        if count <= 1:
            break
    return Solved(q, p, products, left)


def _in_balance(K: Stiffness, f: Floats, q: Floats) -> tuple[NDArray[np.floating], int]:
    """q such that K q = f, by one more solve where it does not hold."""
    inner = K.K @ q
    r = f - inner
    size = max(float(np.abs(v).max(initial=0.0)) for v in (f, inner))
    if np.abs(r).max(initial=0.0) <= _BALANCED * size:
        return q, 0
    return q + K.solve(r), 1


class _Loop:
    """What the products of one active set share. Residuals are gaps of the active rows, then forces of `turned`."""

    def __init__(self, K: Stiffness, rows: Rows, active: Ints, turning: csr_array | None) -> None:
        self.K, self.rows, self.active = K, rows, active
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

    def residual(self, q: Floats, s: Floats, G: Floats, start: Floats) -> NDArray[np.floating]:
        """How far gaps are open, and how far the forces s are from those that the turning makes."""
        return np.concatenate([self.D @ q - G[self.active], self.turning @ (q - start) - s])

    def run(
        self, q: Floats, p: Floats, s: Floats, G: Floats, start: Floats, goal: Goal
    ) -> tuple[Floats, Floats, Floats, int, float]:
        """Generalised conjugate residuals, of lengths: gaps as means over macro-elements, forces over stiffness."""
        unit = self.unit
        r = self.project(self.residual(q, s, G, start)) / unit
        left = best = float(np.abs(r).max(initial=0.0))
        least = max(goal.least(q), goal.reduction * left)
        z, y_all, since = np.zeros(len(unit)), np.zeros_like(q), 0
        directions: list[tuple[Floats, Floats, Floats]] = []
        while left > least and since < _PATIENCE and len(directions) < _MOST:
            d = self.precondition(r * unit)
            y = self.moved(d)
            image = self.project(np.concatenate([self.D @ y, self.turning @ y + d[self.n :]])) / unit
            for d0, y0, image0 in directions:
                a = image @ image0
                d, y, image = d - a * d0, y - a * y0, image - a * image0
            size = float(np.linalg.norm(image))
            if not size > 0:
                break
            d, y, image = d / size, y / size, image / size
            directions.append((d, y, image))
            a = r @ image
            z, y_all, r = z + a * d, y_all + a * y, r - a * image
            left = float(np.abs(r).max(initial=0.0))
            since = 0 if left < 0.9 * best else since + 1
            best = min(best, left)
        p, q, s = p.copy(), q - y_all, s + z[self.n :]
        p[self.active] += z[: self.n]
        if self.K.R.shape[1]:
            q = q - self.K.R @ self.motion(self.residual(q, s, G, start))
        left = float(np.abs(self.residual(q, s, G, start) / unit).max(initial=0.0))
        return q, p, s, len(directions), left
