"""Saddle-point problem of the active contact rows: its data, and its preconditioner.

(K + C) q + B_A^T p = f,    D_A q - S_A p = G_A       S: compliance of the rows, 0 for rigid contact
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, eye_array
from scipy.sparse.linalg import splu

from lacmesh.mesh import Floats, Ints
from lacsolver.solve.contact_system import Rows, row_energies
from lacsolver.solve.stiffness import Operator

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
        return np.zeros_like(q) if self.geometric is None else self.geometric @ q


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

    (B B^T)^-1 B K B^T (B B^T)^-1 is the stiffness of the skins in terms of pressures (the lumped preconditioner of
    Farhat and Roux 1991, with the scaling of the rows); a row with compliance is in series with it. `QB`, `QD` (a, r):
    products of the rows with the rigid-body modes R.
    """

    def __init__(self, problem: SaddleProblem) -> None:
        K, rows, active = problem.K, problem.rows, problem.active
        self.n = len(active)
        self.B, self.inner = rows.B[active][:, rows.touched], K.restricted(rows.touched)
        self.B_T = self.B.T
        if self.n:
            gram = rows.gram[active][:, active]
            self.gram = splu(csc_array(gram + (1e-13 * gram.diagonal().max() or 1.0) * eye_array(self.n)))
        self.QB, self.QD = rows.B[active] @ K.R, rows.D[active] @ K.R
        self.inverse = pseudo_inverse(self.QB.T @ self.QD)
        self._S = problem.S

    @cached_property
    def _fixed(self) -> NDArray[np.bool_]:
        """Mask (a,) of rows that no unknown moves, where the spring alone answers."""
        return (np.diff(self.B.indptr) == 0) & (self._S > 0)

    @cached_property
    def _stiff(self) -> NDArray[np.floating]:
        """Stiffness (a,) of each row's skin, force per gap integral; 1 where it has none."""
        energy, size = row_energies(self.B, self.inner)
        return np.where(energy > 0, energy, 1.0) / np.where(size > 0, size, 1.0) ** 2

    @cached_property
    def own(self) -> NDArray[np.floating]:
        """Stiffness (a,) of each row alone, force per gap integral: of its skin and its spring in series."""
        alone = np.divide(1.0, self._S, out=np.zeros(self.n), where=self._fixed)
        return np.where(self._fixed, alone, self._stiff / (1 + self._stiff * self._S))

    def pressures(self, gap: Floats) -> NDArray[np.floating]:
        """Return the approximate pressures (a,) that open gaps by `gap` (a,)."""
        if not self.n:
            return gap
        rigid = self.gram.solve(self.B @ (self.inner @ (self.B_T @ self.gram.solve(gap))))
        if not self._S.any():
            return np.asarray(rigid)
        return np.where(self._fixed, self.own * gap, rigid / (1 + self._stiff * self._S))

    def balancing(self, load: Floats) -> NDArray[np.floating]:
        """Return pressures (a,) that balance a load (r,) along the rigid-body modes."""
        return np.asarray(self.QD @ (self.inverse @ load))


def pseudo_inverse(A: Floats) -> NDArray[np.floating]:
    """Return the pseudo-inverse of A (r, r)."""
    if not A.size:
        return np.zeros(A.shape)
    U, size, V = np.linalg.svd(A)
    kept = size > RANK_TOLERANCE**2 * size.max()
    return np.asarray((V[kept].T / size[kept]) @ U[:, kept].T)
