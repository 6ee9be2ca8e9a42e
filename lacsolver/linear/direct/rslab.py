"""rslab: L D L^T in Rust, supernodal, nested dissection; it comes with lacmesh."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from lacmesh.mesh import Floats
from lacsolver.linear.direct.triangle import Factorise, Solve, Triangle
from lacsolver.linear.errors import Breakdown

#: number of rows up to which one thread is as fast as several, which wait for each other
_ALONE = 5_000


def analyse(triangle: Triangle, threads: int, definite: bool = True) -> Factorise:
    """Analyse the pattern of a triangle: order its elimination. Unless `definite`, negative pivots are accepted."""
    import rslab

    entries = np.ones(len(triangle.indices)), triangle.indices, triangle.indptr
    pattern = csc_array(entries, shape=(triangle.n,) * 2)
    analysis = rslab.analyze(pattern, path="ldlt", threads=threads if triangle.n > _ALONE else 1)

    def factor(values: Floats) -> Solve:
        try:
            numeric = analysis.factor(values)
        except RuntimeError:
            raise Breakdown from None
        positive, negative, _ = numeric.inertia
        if positive + (0 if definite else negative) < numeric.n:
            raise Breakdown
        return lambda b: numeric.solve(b) if b.ndim == 1 else numeric.solve_many(b)

    return factor
