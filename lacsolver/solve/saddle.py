"""Saddle-point system of the active contact rows: its data, tolerances and preconditioner.

The system is K q + B_A^T p = f, D_A q = G_A.
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
from lacsolver.solve.stiffness import Stiffness

#: relative tolerance for the rank of the active rows on the rigid-body modes
HELD = 1e-8


@dataclass(frozen=True, eq=False)
class Rows:
    """Contact rows on the constrained unknowns: B, D (m, n), and w (m,), the measure that G is integrated over."""

    B: csr_array
    D: csr_array
    w: NDArray[np.floating]

    @cached_property
    def B_T(self) -> csr_array:
        """The transpose of B, (n, m)."""
        return self.B.T.tocsr()

    @cached_property
    def touched(self) -> Ints:
        """Indices of the unknowns with an entry in B."""
        return np.unique(self.B.indices)

    @cached_property
    def gram(self) -> csr_array:
        """The product B B^T."""
        return csr_array(self.B @ self.B_T)


class Solved(NamedTuple):
    """Solution of a system: unknowns q (n,), pressures p (m,), and `left`, the largest remaining |G_A - D_A q| / w.

    `products`: number of applications of K^-1, or of V-cycles with multigrid.
    """

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    products: int
    left: float


class Goal(NamedTuple):
    """Tolerance of a linear solve: residual of gaps at `reduction` times the initial one, or at a lower limit.

    The limit is `relative` times the largest unknown (or `moved`), or `absolute`; both are lengths.
    """

    reduction: float
    relative: float
    absolute: float
    moved: float

    def least(self, q: Floats) -> float:
        """Return the lower limit of the residual of gaps, a length."""
        return max(self.relative * max(float(np.abs(q).max(initial=0.0)), self.moved), self.absolute)


class Skins:
    """Preconditioner of the active rows A: approximate pressures for given gaps, and pressures that balance a load.

    (B B^T)^-1 B K B^T (B B^T)^-1 is the stiffness of the skins in terms of pressures (the lumped preconditioner of
    Farhat and Roux 1991, with the scaling of the rows). `QB`, `QD` (a, r): products of the rows with the rigid-body
    modes R.
    """

    def __init__(self, K: Stiffness, rows: Rows, active: Ints) -> None:
        self.n = len(active)
        self.B, self.inner = rows.B[active][:, rows.touched], K.K[rows.touched][:, rows.touched]
        self.B_T = self.B.T
        if self.n:
            gram = rows.gram[active][:, active]
            self.gram = splu(csc_array(gram + 1e-13 * gram.diagonal().max() * eye_array(self.n)))
        self.QB, self.QD = rows.B[active] @ K.R, rows.D[active] @ K.R
        self.inverse = pseudo_inverse(self.QB.T @ self.QD)

    def pressing(self, gap: Floats) -> NDArray[np.floating]:
        """Return the approximate pressures (a,) that open gaps by `gap` (a,)."""
        if not self.n:
            return gap
        return np.asarray(self.gram.solve(self.B @ (self.inner @ (self.B_T @ self.gram.solve(gap)))))

    def carrying(self, load: Floats) -> NDArray[np.floating]:
        """Return pressures (a,) that balance a load (r,) along the rigid-body modes."""
        return np.asarray(self.QD @ (self.inverse @ load))


def pseudo_inverse(A: Floats) -> NDArray[np.floating]:
    """Return the pseudo-inverse of A (r, r)."""
    if not A.size:
        return np.zeros(A.shape)
    U, size, V = np.linalg.svd(A)
    kept = size > HELD**2 * size.max()
    return np.asarray((V[kept].T / size[kept]) @ U[:, kept].T)
