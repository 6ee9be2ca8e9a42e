"""Direct solution: the code that all factorising backends share."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats
from lacsolver.linear.accuracy import TOLERANCE, Matrix, by_rows, refined, right_hand_sides
from lacsolver.linear.direct.triangle import Factorise, Solve, Triangle
from lacsolver.linear.errors import Breakdown, SingularError
from lacsolver.linear.regular import check_regular, indefinite, least_motion, positive_diagonal, singular
from lacsolver.linear.vectors import WHOLE, Vectors

#: shifts, relative to the diagonal, that make a singular matrix factorisable to find its null motion; the smaller the
#: shift, the clearer the motion
_SHIFTS = (1e-13, 1e-11, 1e-9)


class DirectFactor:
    """A factor of K, with K itself for residuals. `n_solves`: right-hand sides solved so far."""

    iterative = False
    vectors: Vectors = WHOLE

    def __init__(self, K: Matrix, d: Floats, solve: Solve) -> None:
        self.n_solves = 0
        self._K = K
        self._scale = 1 / np.sqrt(d)
        self._solve: Solve | None = solve

    def solve(self, b: Floats, *, tolerance: float = TOLERANCE, x0: Floats | None = None) -> Floats:
        """Return K^-1 b to round-off; tolerance and x0 are for iterative solvers."""
        b = right_hand_sides(b, len(self._scale))
        solve = self._solve
        if solve is None:
            raise RequestError("this factor was replaced by a newer one of the same analysis; solve with that one")
        self.n_solves += b.shape[1] if b.ndim == 2 else 1
        return refined(self._K, self._scale, lambda r: solve(np.array(r, order="F")), b)

    def release(self) -> None:
        """Free the backend's memory; the factor cannot be used afterwards."""
        self._solve = None


class DirectAnalysis:
    """The analysis of a pattern by a direct backend; every factor replaces the one before.

    `definite`: True if a matrix that is not positive definite is an error.
    """

    def __init__(
        self, backend: str, K: Matrix, analyse: Callable[[Triangle], Factorise], definite: bool = True
    ) -> None:
        self.backend, self._definite = backend, definite
        csr = by_rows(K)
        self._pattern = csr.indptr, csr.indices
        self._triangle = Triangle.of(csr)
        self._factorise: Factorise = analyse(self._triangle) if self._triangle.n else lambda values: lambda b: b
        self._last: Callable[[], DirectFactor | None] = lambda: None

    def factor(self, K: Matrix) -> DirectFactor:
        """Return the factor of K, and release the previous one.

        Raises SingularError, and RequestError for another pattern than the one analysed.
        """
        csr = by_rows(K)
        if not all(map(np.array_equal, self._pattern, (csr.indptr, csr.indices))):
            raise RequestError("the matrix does not have the pattern that was analysed; analyse it again")
        last = self._last()
        if last is not None:
            last.release()
        factor = DirectFactor(K, *self._numbers(csr))
        self._last = weakref.ref(factor)
        return factor

    def _numbers(self, csr: csr_array) -> tuple[Floats, Solve]:
        """Return the diagonal of a matrix, and its factor."""
        d = positive_diagonal(csr) if self._definite else _size(csr)
        values = self._triangle.values(csr)
        try:
            solve = self._factorise(values)
        except Breakdown as breakdown:
            raise (self._explained(csr, values, d, breakdown.dof) if self._definite else singular()) from None
        if self._definite:
            check_regular(csr, d, solve)
        return d, solve

    def _explained(self, csr: csr_array, values: Floats, d: Floats, dof: int | None) -> SingularError:
        """Return the error for a K without a factor: a free motion if a tiny shift helps, else negative stiffness."""
        for shift in _SHIFTS:
            values[self._triangle.indptr[:-1]] = (1 + shift) * d
            try:
                solve = self._factorise(values)
            except Breakdown:
                continue
            return singular(least_motion(csr, d, solve, clear=np.inf))
        return indefinite(dof)


def _size(K: csr_array) -> NDArray[np.floating]:
    """Return a positive diagonal (n,) to scale K with."""
    d = np.abs(K.diagonal())
    return np.where(d > 0, d, d.mean() or 1.0)
