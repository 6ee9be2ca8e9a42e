"""CHOLMOD of SuiteSparse through kvxopt: L L^T, supernodal."""

from __future__ import annotations

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.linear.direct.triangle import Factorise, Solve, Triangle, limited
from lacsolver.linear.errors import Breakdown


class _Cholmod:
    """A factor object of CHOLMOD, which holds the analysis and one numerical factor at a time."""

    def __init__(self, triangle: Triangle, threads: int) -> None:
        from kvxopt import cholmod, matrix, spmatrix

        self._cholmod, self._matrix, self._threads = cholmod, matrix, threads
        rows, columns = (matrix(a.astype(np.int64)) for a in (triangle.indices, triangle.columns))
        self._A = spmatrix(matrix(np.ones(len(triangle.indices))), rows, columns, (triangle.n,) * 2)
        with limited(threads):
            self._factor = cholmod.symbolic(self._A)

    def factor(self, values: Floats) -> Solve:
        self._A.V = self._matrix(values)
        with limited(self._threads):
            self._cholmod.numeric(self._A, self._factor)
        try:
            self._cholmod.diag(self._factor)  # `numeric` does not report a failure
        except ValueError:
            raise Breakdown from None
        return self.solve

    def solve(self, b: Floats) -> Floats:
        x = self._matrix(b)
        with limited(self._threads):
            self._cholmod.solve(self._factor, x)
        return np.array(x).reshape(b.shape)


def analyse(triangle: Triangle, threads: int) -> Factorise:
    """Analyse the pattern of a triangle: order its elimination."""
    return _Cholmod(triangle, threads).factor
