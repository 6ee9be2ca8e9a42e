"""rslab: L D L^T in Rust, supernodal, nested dissection; it comes with lacmesh."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from lacmesh.mesh import Floats
from lacsolver.linear.direct.triangle import Triangle
from lacsolver.linear.errors import Breakdown

#: number of rows up to which one thread is as fast as several, which wait for each other
_ALONE = 5_000


class _Numeric:
    def __init__(self, factor: object) -> None:
        self._factor = factor

    def solve(self, b: Floats) -> Floats:
        return self._factor.solve(b) if b.ndim == 1 else self._factor.solve_many(b)  # type: ignore[attr-defined]


class _Symbolic:
    def __init__(self, triangle: Triangle, threads: int, definite: bool) -> None:
        import rslab

        self._definite = definite
        pattern = csc_array(
            (np.ones(len(triangle.indices)), triangle.indices, triangle.indptr), shape=(triangle.n,) * 2
        )
        self._analysis = rslab.analyze(pattern, path="ldlt", threads=threads if triangle.n > _ALONE else 1)

    def factor(self, values: Floats) -> _Numeric:
        try:
            made = self._analysis.factor(values)
        except RuntimeError:
            raise Breakdown from None
        positive, negative, _ = made.inertia
        if positive + (0 if self._definite else negative) < made.n:
            raise Breakdown
        return _Numeric(made)


def analyse(triangle: Triangle, threads: int, definite: bool = True) -> _Symbolic:
    """Analyse the pattern of a triangle: order its elimination. Unless `definite`, negative pivots are accepted."""
    return _Symbolic(triangle, threads, definite)
