"""Contact with Coulomb friction on condensed matrices, by methods that share nothing with the solver's.

Unknowns: pressures p (m,) and shear tractions t (m, d - 1), integrals over macro-elements left to the rows. With the
rows B_N, B_T, the stiffness K and u = u_f - K^-1 (B_N^T p + B_T^T t), the gaps and slips are affine,

    [G; -S] = [G_f; -S_f] + A [p; t],   A = [B_N; B_T] K^-1 [B_N; B_T]^T

    0 <= p  with  G >= 0,  p G = 0;    |t| <= b(p) = mu p,  S = |S| t / |t| where |t| = b

`lemke` (plane): the linear complementarity problem of Klarbring (1986), t = mu p - x,

    G  >= 0  with  p  >= 0,    S + S_  >= 0  with  x >= 0,    2 mu p - x >= 0  with  S_ >= 0

by Lemke's method with lexicographic ratios (Cottle, Pang, Stone, The linear complementarity problem, 4.4). `tresca`
(plane): bounds held fixed, a convex problem with bounds on p and t, solved by block pivoting with Murty's rule behind
it (Judice and Pires 1994); the bounds follow p until they stay (Necas, Jarusek, Haslinger 1980).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]


@dataclass(frozen=True)
class Condensed:
    """`A` (m d, m d): the pressures' rows first, then the shears', macro-element by macro-element; `G` (m,), `S`
    (m, d - 1) without tractions; `friction` (m,) of each macro-element.
    """

    A: Floats
    G: Floats
    S: Floats
    friction: Floats

    @property
    def right(self) -> Floats:
        """[G; -S] without tractions."""
        return np.concatenate([self.G, -self.S.ravel()])

    def gaps(self, p: Floats, t: Floats) -> tuple[Floats, Floats]:
        """Gaps (m,) and slips (m, d - 1) under tractions."""
        both = self.right + self.A @ np.concatenate([p, t.ravel()])
        return both[: len(p)], -both[len(p) :].reshape(self.S.shape)

    def residual(self, p: Floats, t: Floats) -> float:
        """Largest violation of all conditions, as a pressure over the largest one that overlap alone would raise."""
        m = len(p)
        G, S = self.gaps(p, t)
        diagonal = np.diag(self.A)
        a_n, a_t = diagonal[:m], diagonal[m:].reshape(self.S.shape).mean(axis=1)
        bound = self.friction * np.maximum(p, 0.0)
        off_n = p - np.maximum(p - G / a_n, 0.0)
        off_t = t - projected(t + S / a_t[:, None], bound)
        size = max(np.abs(self.G / a_n).max(), np.abs(p).max())
        return float(max(np.abs(off_n).max(), np.abs(off_t).max()) / size)


def condensed(
    K: object, f: Floats, rows: tuple[Floats, Floats], gap: Floats, friction: float | Floats, slip: Floats | float = 0.0
) -> Condensed:
    """The condensed problem of dense or sparse K (n, n) and loads f (n,), rows B_N (m, n) and B_T (m (d - 1), n).

    `gap` (m,) and `slip` (m, d - 1): without displacement.
    """
    dense = K.toarray() if hasattr(K, "toarray") else np.asarray(K)
    normal, tangential = (B.toarray() if hasattr(B, "toarray") else np.asarray(B) for B in rows)
    m = len(normal)
    B = np.vstack([normal, tangential])
    solution = np.linalg.solve(dense, np.column_stack([f, B.T]))
    values = B @ solution
    return Condensed(
        values[:, 1:],
        gap - values[:m, 0],
        values[m:, 0].reshape(m, -1) + slip,
        np.broadcast_to(friction, (m,)).astype(float),
    )


def projected(t: Floats, bound: Floats) -> Floats:
    """Tractions (m, d - 1) moved to the nearest ones of a length of at most `bound` (m,)."""
    length = np.linalg.norm(t, axis=1)
    return np.asarray(t * np.minimum(1.0, bound / np.maximum(length, 1e-300))[:, None])


# ---- Lemke


def lemke(given: Condensed) -> tuple[Floats, Floats]:
    """p (m,) and t (m, 1). Raises ArithmeticError where the method ends on a ray."""
    m = len(given.G)
    A, mu = given.A, given.friction
    size = 1 / np.sqrt(np.diag(A))  # rows and columns of size 1
    A = size[:, None] * A * size
    # t = mu p - x in scaled unknowns: p = size_n p', t = size_t t'
    mu = mu * size[:m] / size[m:]
    A_nn, A_nt, A_tt = A[:m, :m], A[:m, m:], A[m:, m:]
    one, none = np.eye(m), np.zeros((m, m))
    M = np.block(
        [
            [A_nn + A_nt * mu, -A_nt, none],
            [-A_nt.T - A_tt * mu, A_tt, one],
            [2 * np.diag(mu), -one, none],
        ]
    )
    q = np.concatenate([given.G * size[:m], given.S[:, 0] * size[m:], np.zeros(m)])
    scale = np.abs(q).max() or 1.0
    z = complementary(M, q / scale) * scale
    p = z[:m]
    return p * size[:m], ((mu * p - z[m : 2 * m]) * size[m:])[:, None]


def complementary(M: Floats, q: Floats, most: int = 0) -> Floats:
    """z >= 0 with w = M z + q >= 0 and z w = 0, by Lemke's method; the basis is inverted anew at every pivot."""
    n = len(q)
    if (q >= 0).all():
        return np.zeros(n)
    columns = np.hstack([np.eye(n), -M, -np.ones((n, 1))])  # of w, z and the artificial variable
    basis = np.arange(n)
    leaving = int(_least(np.column_stack([q, np.eye(n)])))
    basis[leaving], entering = 2 * n, n + leaving
    for _ in range(most or 50 * n):
        inverse = np.linalg.inv(columns[:, basis])
        way, table = inverse @ columns[:, entering], np.column_stack([inverse @ q, inverse])
        may = np.flatnonzero(way > 1e-11 * np.abs(way).max())
        if not len(may):
            raise ArithmeticError("Lemke's method ends on a ray")
        row = int(may[_least(table[may] / way[may, None])])
        if 2 * n in basis[may]:  # the artificial variable goes as soon as it can
            own = int(np.flatnonzero(basis == 2 * n)[0])
            if table[own, 0] / way[own] <= table[row, 0] / way[row] + 1e-14:
                row = own
        gone, basis[row] = int(basis[row]), entering
        if gone == 2 * n:
            values = np.zeros(2 * n)
            values[basis] = np.linalg.solve(columns[:, basis], q)
            return np.maximum(values[n:], 0.0)
        entering = gone + n if gone < n else gone - n
    raise ArithmeticError("Lemke's method does not end")


def _least(rows: Floats) -> int:
    """The lexicographically smallest row, entries closer than rounding being equal."""
    left = np.arange(len(rows))
    for column in rows.T:
        own = column[left]
        left = left[own <= own.min() + 1e-13 * max(1.0, np.abs(own).max())]
        if len(left) == 1:
            break
    return int(left[0])


# ---- fixed point on Tresca's bounds


def tresca(given: Condensed, *, tolerance: float = 1e-12, most: int = 2000) -> tuple[Floats, Floats]:
    """p (m,) and t (m, 1). Raises ArithmeticError where the bounds do not settle."""
    m = len(given.G)
    p = bounded(given.A[:m, :m], given.G, np.zeros(m), np.full(m, np.inf))
    states: Ints | None = None
    for _ in range(most):
        bound = given.friction * p
        low, high = np.concatenate([np.zeros(m), -bound]), np.concatenate([np.full(m, np.inf), bound])
        z, states = with_bounds(given.A, given.right, low, high, states)
        before, p = p, z[:m]
        if np.abs(p - before).max() <= tolerance * max(np.abs(p).max(), 1e-300):
            return p, z[m:, None]
    raise ArithmeticError("the bounds of Tresca's problems do not settle")


def bounded(A: Floats, b: Floats, low: Floats, high: Floats) -> Floats:
    """z (n,) between bounds that makes z.(A z / 2 + b) least, A symmetric positive definite."""
    return with_bounds(A, b, low, high, None)[0]


def with_bounds(
    A: Floats, b: Floats, low: Floats, high: Floats, states: Ints | None
) -> tuple[Floats, Ints]:  # fmt: skip
    """z (n,) between bounds that makes z.(A z / 2 + b) least, and where it is: -1 low, 0 between, 1 high.

    All that are wrong change at once as long as their number falls to new leasts, else the last one alone (Murty).
    """
    n = len(b)
    states = np.zeros(n, int) if states is None else states.copy()
    least, chances = n + 1, 3
    slack = 1e-13
    for _ in range(100 * n):
        z = np.where(states < 0, low, np.where(states > 0, high, 0.0))
        free = states == 0
        if free.any():
            z[free] = lu_solve(lu_factor(A[np.ix_(free, free)]), -(b[free] + A[np.ix_(free, ~free)] @ z[~free]))
        slope = A @ z + b
        size = slack * max(np.abs(z).max(), 1e-300)
        steep = slack * max(np.abs(b).max(), np.abs(slope).max())
        wanted = states.copy()
        wanted[free & (z < low - size)], wanted[free & (z > high + size)] = -1, 1
        wanted[(states < 0) & (slope < -steep) & (high > low)] = 0
        wanted[(states > 0) & (slope > steep) & (high > low)] = 0
        wrong = np.flatnonzero(wanted != states)
        if not len(wrong):
            return np.clip(z, low, high), states
        chances = 3 if len(wrong) < least else chances - 1
        least = min(least, len(wrong))
        which = wrong if chances > 0 else wrong[-1:]
        states[which] = wanted[which]
    raise ArithmeticError("the problem with bounds is not solved")
