"""Saddle-point problem of the active contact rows: its data, and its preconditioner.

(K + C) q + B_A^T p = f,    D_A q - S_A p = G_A       S: compliance of the rows, 0 for rigid contact
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.direct.superlu import factor_of
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.row_group import Rows

#: added to the diagonal of B D^-1 B^T, relative to it, as rows may repeat one another
REGULAR = 1e-13
#: relative tolerance for the rank of the active rows on the rigid-body modes
RANK_TOLERANCE = 1e-8


class SaddleProblem(NamedTuple):
    """The linear problem of one active set: a stiffness K, `rows`, indices (a,) of the `active` ones, f (n,), G (m,).

    `compliance` (m,): S, lengths times measure per stress; None for 0. `geometric` (n, n): geometric stiffness C, small
    compared with K; None for 0.
    """

    K: Operator
    rows: Rows
    active: Ints
    f: Floats
    G: Floats
    compliance: Floats | None = None
    geometric: csr_array | None = None

    @property
    def S(self) -> NDArray[np.floating]:
        """Compliance (a,) of the active rows."""
        return np.zeros(len(self.active)) if self.compliance is None else self.compliance[self.active]

    def geometric_forces(self, q: Floats) -> NDArray[np.floating]:
        """Return C q (n,)."""
        return np.zeros_like(q) if self.geometric is None else self.K.vectors.summed(self.geometric @ q)


class SaddleSolution(NamedTuple):
    """Solution of a problem: unknowns q (n,), pressures p (m,), and `left`, the largest remaining residual of gaps.

    `applications`: number of applications of K^-1, or of V-cycles with multigrid.
    """

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    applications: int
    left: float


class SchurPreconditioner:
    """Approximate pressures for given gaps of the active rows A, and pressures that balance a load.

    M = (B D^-1 B^T)^-1 B D^-1 K D^-1 B^T (B D^-1 B^T)^-1, with D the diagonal of K, is the stiffness of the skins in
    terms of pressures: the lumped preconditioner of Farhat and Roux (1991), with the scaling of the rows by D, which
    makes it that of the softer side. A row with compliance is in series with it. `size` (a,): b D^-1 b^T of each row b,
    the compliance of its skin; `stiffness` (a,): that of each row alone, force per gap integral, 1 / (size + S). `D`:
    the rows D of A; `QB`, `QD` (a, r): products of the rows with the rigid-body modes R. `constrained`, `free` (r, k):
    combinations of the modes that the rows constrain, and the others.

    Motions and pressures are weighed so that neither units nor sizes count: the mean gap of a row has the weight of its
    measure, relative to that of the other rows of its pair.
    """

    def __init__(self, problem: SaddleProblem) -> None:
        K, rows, active = problem.K, problem.rows, problem.active
        self.n = len(active)
        self.diagonal = np.abs(K.scaling)
        B, self.D, unit = rows.B[active], rows.D[active], 1 / np.sqrt(self.diagonal)  # in these units D is the identity
        at = np.searchsorted(rows.touched, B.indices)
        self.B = csr_array((B.data * unit[B.indices], at, B.indptr), shape=(self.n, len(rows.touched)))
        self.B_T, self.inner = self.B.T.tocsr(), scaled(K.restricted(rows.touched), unit[rows.touched])
        gram = self.B @ self.B_T
        self.size = gram.diagonal()
        if self.n:
            self.gram = factor_of(csc_array(gram + diags_array(np.where(self.size > 0, REGULAR * self.size, 1.0))))
        soft = self.size + problem.S
        self.stiffness = 1 / np.where(soft > 0, soft, 1.0)
        self.weight = 1 / (rows.w * rows.typical)[active]
        self.QB, self.QD = B @ K.R, self.D @ K.R
        self.constrained, self.free = constrained_motions(self.QD / rows.w[active, None])
        V = self.constrained
        self._inverse = V @ np.linalg.pinv((self.QB @ V).T @ (self.weight[:, None] * (self.QD @ V))) @ V.T

    def pressures(self, gap: Floats) -> NDArray[np.floating]:
        """Return the approximate pressures (a,) that open gaps by `gap` (a,)."""
        if not self.n:
            return gap
        rigid = self.gram.solve(self.B @ (self.inner @ (self.B_T @ self.gram.solve(gap))))
        return self.stiffness * np.where(self.size > 0, self.size * rigid, gap)  # a spring alone where nothing moves

    def balancing(self, load: Floats) -> NDArray[np.floating]:
        """Return pressures (a,) that balance a load (r,) along the rigid-body modes."""
        return np.asarray(self.weight * (self.QD @ (self._inverse @ load)))

    def motion(self, gap: Floats) -> NDArray[np.floating]:
        """Return the amplitudes (r,) of the rigid-body modes that best close gaps (a,)."""
        return np.asarray(self._inverse @ (self.QB.T @ (self.weight * gap)))


def scaled(A: csr_array, d: Floats) -> csr_array:
    """Return diag(d) A diag(d), for d (n,)."""
    values = A.data * np.repeat(d, np.diff(A.indptr)) * d[A.indices]
    return csr_array((values, A.indices, A.indptr), shape=A.shape)


def constrained_motions(moves: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return combinations (r, k) of rigid-body modes that rows constrain, and the others (r, r - k), orthonormal.

    `moves` (a, r): the mean gaps that the modes close in each row; those of the combinations are orthonormal.
    """
    if not moves.size:
        return np.zeros((moves.shape[1], 0)), np.eye(moves.shape[1])
    _, size, V = np.linalg.svd(np.linalg.qr(moves, mode="r"))
    k = int((size > RANK_TOLERANCE * size[0]).sum())
    return V[:k].T / size[:k], V[k:].T
