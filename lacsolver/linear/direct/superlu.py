"""SuperLU, which comes with SciPy: L U without pivoting, for small models, or if no other backend is installed."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array, dia_array
from scipy.sparse.linalg import SuperLU, splu

from lacmesh.mesh import Floats
from lacsolver.linear.direct.triangle import Triangle
from lacsolver.linear.errors import Breakdown


class _Numeric:
    def __init__(self, factor: SuperLU) -> None:
        self._factor = factor

    def solve(self, b: Floats) -> Floats:
        return self._factor.solve(b)


class _Symbolic:
    """The pattern alone: SuperLU has no analysis that is separate from the factorisation."""

    def __init__(self, triangle: Triangle) -> None:
        self._triangle = triangle

    def factor(self, values: Floats) -> _Numeric:
        t = self._triangle
        lower = csc_array((values, t.indices, t.indptr), shape=(t.n, t.n))
        K = csc_array(lower + lower.T - dia_array((values[t.indptr[:-1]][None], [0]), shape=lower.shape))
        try:
            made = factor_of(K)
        except RuntimeError:  # an exact zero
            raise Breakdown from None
        # rows are permuted apart from columns only for a zero on the diagonal; the pivots are the diagonal of U
        pivots = made.U.diagonal()
        if (made.perm_r != made.perm_c).any() or (pivots <= 0).any():
            raise Breakdown(_worst(pivots, made.perm_c))
        return _Numeric(made)


def factor_of(K: csc_array) -> SuperLU:
    """Return the factor of a symmetric positive definite matrix, a third of the time of one that is not symmetric."""
    return splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _worst(pivots: Floats, perm_c: Floats) -> int:
    """Return the row of the least pivot: column k of the matrix is eliminated at perm_c[k]."""
    return int(np.flatnonzero(perm_c == pivots.argmin())[0])


def analyse(triangle: Triangle, threads: int) -> _Symbolic:
    """Keep the pattern; SuperLU runs on one core."""
    return _Symbolic(triangle)
