"""One factor of K serves every active set: pressures are sought on the Schur complement D K^-1 B^T.

With rows A held, the saddle system

    K q + B_A^T p = f,   D_A q = G_A

is solved for p by generalised conjugate residuals, a short loop of products with K^-1, and q follows on the way,
without a solve of its own. The preconditioner (B B^T)^-1 B K B^T (B B^T)^-1 is the stiffness of the skins themselves,
put in terms of pressures (Farhat and Roux's lumped preconditioner of 1991, with the scaling of the rows); with it the
number of products hardly grows with the mesh: 2 to 5 to a tenth of the residual, 20 to 25 to round-off.

Where bodies move freely but for contact (`stiffness`), pressures stay in balance with the load along each free motion
(the coarse projection of FETI, Farhat and Roux), so that the springs which make K definite carry nothing, and the
motions themselves follow from the gaps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import splu

from lacmesh.mesh import Floats, Ints
from lacsolver.stiffness import Stiffness

#: residuals that stop falling are what rounding leaves: this many products without a new least
_PATIENCE = 6
_MOST = 400
#: forces that add up to this much of the largest one are in balance
_BALANCED = 1e-14
#: what rounding leaves of the balance and of the gaps after a long loop is taken away by so many short ones
_REFINEMENTS = 2
#: a motion is held by rows that move with it by at least this much of those that move most
_HELD = 1e-8


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of contact on the constrained unknowns: B, D (m, n), w (m,) what G is a mean over."""

    B: csr_array
    D: csr_array
    w: NDArray[np.floating]

    @cached_property
    def B_T(self) -> csr_array:
        """(n, m)."""
        return self.B.T.tocsr()

    @cached_property
    def touched(self) -> Ints:
        """The unknowns that some row moves."""
        return np.unique(self.B.indices)

    @cached_property
    def gram(self) -> csr_array:
        """B B^T."""
        return csr_array(self.B @ self.B_T)


class Solved(NamedTuple):
    """Unknowns q (n,), pressures p (m,), products with K^-1, and the largest |G_A - D_A q| / w that is left."""

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    products: int
    left: float


class Goal(NamedTuple):
    """Where a solve ends: gaps at `reduction` of what they are off at the start, or at what numbers allow.

    That is `relative` of the largest unknown (or of `moved`), or `absolute`, lengths.
    """

    reduction: float
    relative: float
    absolute: float
    moved: float

    def least(self, q: Floats) -> float:
        """The gap that need not be closed further."""
        return max(self.relative * max(float(np.abs(q).max(initial=0.0)), self.moved), self.absolute)


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
        self.B, self.inner = rows.B[active][:, rows.touched], K.K[rows.touched][:, rows.touched]
        if self.n:
            gram = rows.gram[active][:, active]
            self.gram = splu(csc_array(gram + 1e-13 * gram.diagonal().max() * eye_array(self.n)))
        stiff = np.abs(K.K.diagonal()[self.turned]) if len(self.turned) else np.empty(0)
        self.unit = np.concatenate([rows.w[active], stiff])  # residuals over it are lengths
        self.QB, self.QD = rows.B[active] @ K.R, np.concatenate([self.D @ K.R, self.turning @ K.R])
        self.inverse = _pseudo_inverse(self.QB.T @ self.QD[: self.n])

    def spread(self, s: Floats) -> NDArray[np.floating]:
        """(n,): forces of `turned` on all unknowns."""
        out = np.zeros(self.K.K.shape[0])
        out[self.turned] = s
        return out

    def balanced(self, p: Floats, f: Floats) -> NDArray[np.floating]:
        """Pressures of the active rows alone that carry the load along every free motion which these hold."""
        out = np.zeros_like(p)
        out[self.active] = p[self.active]
        out[self.active] += self._carrying(self.K.R.T @ (f - self.rows.B_T @ out))
        return out

    def _carrying(self, load: Floats) -> NDArray[np.floating]:
        """Pressures that carry a load (r,) along the free motions."""
        return np.asarray(self.QD[: self.n] @ (self.inverse @ load))

    def precondition(self, r: Floats) -> NDArray[np.floating]:
        """About what makes the residual r, in balance along the free motions: pressures, then forces."""
        s = r[self.n :]
        if not self.n:
            return s
        z = self.gram.solve(self.B @ (self.inner @ (self.B.T @ self.gram.solve(r[: self.n]))))
        moment = self.QB.T @ z + self.K.R[self.turned].T @ s
        return np.concatenate([z - self._carrying(moment), s])

    def project(self, r: Floats) -> NDArray[np.floating]:
        """What is left of a residual after the best free motion."""
        return np.asarray(r - self.QD @ self.motion(r))

    def motion(self, r: Floats) -> NDArray[np.floating]:
        """(r,): the free motion that closes the gaps of a residual best."""
        return np.asarray(self.inverse @ (self.QB.T @ r[: self.n]))

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


def _pseudo_inverse(A: Floats) -> NDArray[np.floating]:
    """The inverse of A (r, r) along what it holds."""
    if not A.size:
        return np.zeros(A.shape)
    U, size, V = np.linalg.svd(A)
    kept = size > _HELD**2 * size.max()
    return np.asarray((V[kept].T / size[kept]) @ U[:, kept].T)
