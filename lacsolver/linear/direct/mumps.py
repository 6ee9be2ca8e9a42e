"""MUMPS through python-mumps: L D L^T, multifrontal."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_array

from lacmesh.mesh import Floats
from lacsolver.linear.direct.triangle import Factorise, Solve, Triangle, limited
from lacsolver.linear.errors import Breakdown, LinearError

#: values of INFOG(1) for a structurally and for a numerically singular matrix
_SINGULAR = (-6, -10)
_NEGATIVE_PIVOTS = 12


class _Mumps:
    """An instance of MUMPS, which holds the analysis and one factor at a time."""

    def __init__(self, triangle: Triangle, threads: int) -> None:
        import mumps

        self._triangle, self._threads = triangle, threads
        self._context = mumps.Context()
        self._error = mumps.MUMPSError
        self._set(np.ones(len(triangle.indices)))
        with limited(threads):
            self._call(self._context.analyze, ordering="metis")

    def factor(self, values: Floats) -> Solve:
        self._set(values)
        with limited(self._threads):
            self._call(self._context.factor, reuse_analysis=True, pivot_tol=0.0)
        if self._context.mumps_instance.infog[_NEGATIVE_PIVOTS]:
            raise Breakdown
        return self.solve

    def solve(self, b: Floats) -> Floats:
        with limited(self._threads):
            return self._call(self._context.solve, b, overwrite_b=True)

    def _set(self, values: Floats) -> None:
        t = self._triangle
        upper = coo_array((values, (t.columns, t.indices)), shape=(t.n, t.n))
        self._context.set_matrix(upper, symmetric=True)

    def _call(self, job: Any, *arguments: Any, **options: Any) -> Any:
        try:
            return job(*arguments, **options)
        except self._error as error:
            if error.error in _SINGULAR:
                raise Breakdown from None
            raise LinearError(f"the linear solver mumps gave up: {error}; try backend = rslab") from None


def analyse(triangle: Triangle, threads: int) -> Factorise:
    """Analyse the pattern of a triangle: order its elimination."""
    return _Mumps(triangle, threads).factor
