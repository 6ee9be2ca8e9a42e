"""A cycle completed by a few unknowns that all processes have: the free motions of rigid bodies.

    [K_nn  K_nr] [x_n]   [f_n]         Z = V K_nr,  S = K_rr - K_rn Z,
    [K_rn  K_rr] [x_r] = [f_r],        x_r = S^-1 (f_r - K_rn V f_n),  x_n = V f_n - Z x_r

with the cycle V in place of K_nn^-1: block elimination, at one cycle for each application, and one for each column of
K_nr before. Rows of contact add B^T W B to each block; V has theirs already.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.linear.vectors import Vectors

#: relative eigenvalue of S below which a motion is left alone
_NOTHING = 1e-13


def bordered(
    V: Callable[[Floats], Floats], K: csr_array, n: int, vectors: Vectors,
    B: csr_array | None = None, weights: Floats | None = None,
) -> Callable[[Floats], NDArray[np.floating]]:  # fmt: skip
    """Complete the cycle V of the first n unknowns of K, whose last r rows are parts of sums over all processes.

    `B` (a, n + r), `weights` (a,): rows of contact, the same on all processes. The result takes forces (n + r,).
    """
    K_nr, K_rn, K_rr = K[:n, n:].toarray(), csr_array(K[n:, :n]), K[n:, n:].toarray()
    B = csr_array((0, K.shape[1])) if B is None else B
    W_B_r = (np.zeros(0) if weights is None else weights)[:, None] * B[:, n:].toarray()
    B_n, zeros = csr_array(B[:, :n]), np.zeros(n)
    K_nr = K_nr + B_n.T @ W_B_r

    def summed(f: Floats) -> NDArray[np.floating]:
        return vectors.summed(np.append(zeros, f))[n:]

    def row(x: Floats) -> NDArray[np.floating]:
        return summed(K_rn @ x) + W_B_r.T @ (B_n @ x)

    Z = np.stack([V(column) for column in K_nr.T], axis=1)
    whole = np.stack([summed(column) for column in K_rr.T], axis=1) + B[:, n:].toarray().T @ W_B_r
    S = vectors.same(whole - np.stack([row(column) for column in Z.T], axis=1))
    S_inverse = np.linalg.pinv((S + S.T) / 2, rcond=_NOTHING, hermitian=True)

    def cycle(f: Floats) -> NDArray[np.floating]:
        x = V(f[:n])
        motion = vectors.same(S_inverse @ (f[n:] - row(x)))
        return np.concatenate([x - Z @ motion, motion])

    return cycle
