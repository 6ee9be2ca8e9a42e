"""rslab: L D L^T in Rust, supernodal, nested dissection; it comes with lacmesh."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from scipy.sparse import csc_array

from lacmesh.mesh import Floats
from lacsolver.linear.direct.triangle import Factorise, Solve, Triangle
from lacsolver.linear.errors import Breakdown

#: number of rows up to which one thread is as fast as several, which wait for each other
_ALONE = 5_000
#: words of its error for a matrix with a pivot of nothing
_SINGULAR = "rank-deficient"


def analyse(triangle: Triangle, threads: int, definite: bool = True) -> Factorise:
    """Analyse the pattern of a triangle: order its elimination. Unless `definite`, negative pivots are accepted."""
    import rslab

    entries = np.ones(len(triangle.indices)), triangle.indices, triangle.indptr
    pattern = csc_array(entries, shape=(triangle.n,) * 2)
    with _panics():
        analysis = rslab.analyze(pattern, path="ldlt", threads=threads if triangle.n > _ALONE else 1)

    def factor(values: Floats) -> Solve:
        try:
            with _panics():
                numeric = analysis.factor(values)
        except RuntimeError as error:
            if _SINGULAR not in str(error):
                raise
            raise Breakdown from None

        def solve(b: Floats) -> Floats:
            with _panics():
                return np.asarray(numeric.solve(b) if b.ndim == 1 else numeric.solve_many(b))

        positive, negative, _ = numeric.inertia
        if positive + (0 if definite else negative) < numeric.n:
            raise Breakdown(solve=solve)
        return solve

    return factor


@contextmanager
def _panics() -> Iterator[None]:
    """Turn a panic of Rust, which is no `Exception`, into a RuntimeError."""
    try:
        yield
    except BaseException as error:
        if type(error).__name__ != "PanicException":
            raise
        raise RuntimeError(str(error)) from None
