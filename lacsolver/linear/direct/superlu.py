"""SuperLU, which comes with SciPy: L U without pivoting, for small models, or if no other backend is installed."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array, dia_array
from scipy.sparse.linalg import SuperLU, splu

from lacmesh.mesh import Floats
from lacsolver.linear.direct.triangle import Factorise, Solve, Triangle
from lacsolver.linear.errors import Breakdown


def factor_of(K: csc_array) -> SuperLU:
    """Return the factor of a symmetric positive definite matrix, a third of the time of one that is not symmetric."""
    return splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def analyse(triangle: Triangle, threads: int, definite: bool = True) -> Factorise:
    """Keep the pattern: SuperLU has no analysis that is separate from the factorisation. It runs on one core.

    Unless `definite`, rows are exchanged for larger pivots, and negative ones are accepted.
    """

    def factor(values: Floats) -> Solve:
        lower = csc_array((values, triangle.indices, triangle.indptr), shape=(triangle.n,) * 2)
        diagonal = dia_array((values[triangle.indptr[:-1]][None], [0]), shape=lower.shape)
        try:
            lu = (factor_of if definite else splu)(csc_array(lower + lower.T - diagonal))
        except RuntimeError:  # an exact zero
            raise Breakdown from None
        if not definite:
            pivots = np.abs(lu.U.diagonal())
            if pivots.min() <= np.finfo(float).eps * pivots.max():
                raise Breakdown
            return lu.solve
        # rows are permuted apart from columns only for a zero on the diagonal; the pivots are the diagonal of U
        pivots = lu.U.diagonal()
        if (lu.perm_r != lu.perm_c).any() or (pivots <= 0).any():
            raise Breakdown(int(np.flatnonzero(lu.perm_c == pivots.argmin())[0]))  # column k is eliminated at perm_c[k]
        return lu.solve

    return factor
