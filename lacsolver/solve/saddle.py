"""The saddle system of a set of rows that are held, what it is asked to, and how the pressures of skins go with gaps.

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

#: a motion is held by rows that move with it by at least this much of those that move most
HELD = 1e-8


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
    """Unknowns q (n,), pressures p (m,), and the largest |G_A - D_A q| / w that is left.

    `products`: with K^-1, or V-cycles where multigrid stands for it.
    """

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


class Skins:
    """The rows that are held, A: which pressures close their gaps, about, and which carry a load on a free motion.

    (B B^T)^-1 B K B^T (B B^T)^-1 is the stiffness of the skins themselves, put in terms of pressures (Farhat and Roux's
    lumped preconditioner of 1991, with the scaling of the rows). `QB`, `QD` (a, r): what rows feel of free motions.
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
        """(a,): about the pressures that open gaps (a,) by."""
        if not self.n:
            return gap
        return np.asarray(self.gram.solve(self.B @ (self.inner @ (self.B_T @ self.gram.solve(gap)))))

    def carrying(self, load: Floats) -> NDArray[np.floating]:
        """(a,): pressures that carry a load (r,) along the free motions."""
        return np.asarray(self.QD @ (self.inverse @ load))


def pseudo_inverse(A: Floats) -> NDArray[np.floating]:
    """The inverse of A (r, r) along what it holds."""
    if not A.size:
        return np.zeros(A.shape)
    U, size, V = np.linalg.svd(A)
    kept = size > HELD**2 * size.max()
    return np.asarray((V[kept].T / size[kept]) @ U[:, kept].T)
