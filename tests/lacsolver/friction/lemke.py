"""Lemke's algorithm, and plane friction as a linear complementarity problem (Klarbring): a referee of the solver."""

from __future__ import annotations

import numpy as np


def lemke(M, q, most=5000):
    """Return z >= 0 with w = M z + q >= 0, z w = 0; None after a ray, or after too many pivots."""
    n = len(q)
    if (q >= 0).all():
        return np.zeros(n)
    table = np.hstack([np.eye(n), -M, -np.ones((n, 1)), q[:, None]])  # w, z, z_0, right side
    basis, enters = np.arange(n), 2 * n
    row = int(q.argmin())
    for _ in range(most):
        table[row] /= table[row, enters]
        others = np.arange(n) != row
        table[others] -= np.outer(table[others, enters], table[row])
        leaves, basis[row] = basis[row], enters
        if leaves == 2 * n:
            z = np.zeros(2 * n + 1)
            z[basis] = table[:, -1]
            return z[n : 2 * n]
        enters = leaves + n if leaves < n else leaves - n
        column = table[:, enters]
        ratio = np.where(column > 1e-12, table[:, -1] / np.where(column > 1e-12, column, 1.0), np.inf)
        row = int(ratio.argmin())
        if ratio[row] == np.inf:
            return None
        least = np.flatnonzero(ratio <= ratio[row] + 1e-12)
        last = least[basis[least] == 2 * n]
        row = int(last[0]) if len(last) else row
    return None


def plane_friction(C, h, G, s, mu):
    """Return (p, t) (m,) each of plane Coulomb friction; C (2m, 2m), h (2m,): G - B_N u and B_T u = h - C (p, t).

    s (m,): what the slip is counted from. None where Lemke's algorithm ends in a ray.
    """
    m = len(G)
    A, D = C[:m], C[m:]
    p_t = np.hstack([np.vstack([np.eye(m), -mu * np.eye(m)]), np.vstack([np.zeros((m, m)), np.eye(m)])])
    zero = np.zeros((m, m))
    M = np.vstack(
        [
            np.hstack([A @ p_t, zero]),
            np.hstack([D @ p_t, np.eye(m)]),
            np.hstack([2 * mu * np.eye(m), -np.eye(m), zero]),
        ]
    )
    z = lemke(M, np.concatenate([G - h[:m], s - h[m:], np.zeros(m)]))
    return None if z is None else (z[:m], z[m : 2 * m] - mu * z[:m])
