"""Direct solution: the code that all factorising backends share."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats
from lacsolver.linear.direct.triangle import Triangle
from lacsolver.linear.errors import Breakdown, SingularError
from lacsolver.linear.protocol import TOLERANCE, Factor, Matrix, Numeric, Symbolic
from lacsolver.linear.refine import refined
from lacsolver.linear.regular import check_regular, indefinite, least_motion, positive_diagonal, singular
from lacsolver.linear.sides import by_rows, right_hand_sides
from lacsolver.linear.vectors import WHOLE, Vectors

#: shifts, relative to the diagonal, that make a singular matrix factorisable to find its null motion; the smaller the
#: shift, the clearer the motion
_SHIFTS = (1e-13, 1e-11, 1e-9)


class DirectFactor:
    """A factor of K, with K itself for residuals. `n_solves`: right-hand sides solved so far."""

    iterative = False
    vectors: Vectors = WHOLE

    def __init__(self, K: Matrix, d: Floats, numeric: Numeric) -> None:
        self.n_solves = 0
        self._K = K
        self._scale = 1 / np.sqrt(d)
        self._numeric: Numeric | None = numeric

    def solve(self, b: Floats, *, tolerance: float = TOLERANCE, x0: Floats | None = None) -> Floats:
        """Return K^-1 b to round-off; tolerance and x0 are for iterative solvers."""
        b = right_hand_sides(b, len(self._scale))
        if self._numeric is None:
            raise RequestError("this factor was replaced by a newer one of the same analysis; solve with that one")
        self.n_solves += b.shape[1] if b.ndim == 2 else 1
        return refined(self._K, self._scale, self._backend_solve, b)

    def apply(self, x: Floats) -> Floats:
        """Return K x."""
        return np.asarray(self._K @ x)

    def cycle(self, b: Floats) -> Floats:
        """Return K^-1 b."""
        return self.solve(b)

    def cycle_with_rows(self, B: bsr_array, weights: Floats) -> Callable[[Floats], Floats]:
        """Raise NotImplementedError: with a factor, contact is solved for on the Schur complement."""
        raise NotImplementedError("a direct backend has no V-cycle")

    def record_convergence(self, use: str, cycles: int, decades: float) -> None:
        """Do nothing: a direct solution always takes one step."""

    def release(self) -> None:
        """Free the backend's memory; the factor cannot be used afterwards."""
        self._numeric = None

    def _backend_solve(self, b: Floats) -> Floats:
        assert self._numeric is not None
        return self._numeric.solve(np.array(b, order="F"))


class DirectAnalysis:
    """The analysis of a pattern by a direct backend; every factor replaces the one before.

    `definite`: True if a matrix that is not positive definite is an error. `asked`: the backend's name and `definite`.
    """

    def __init__(self, backend: str, K: Matrix, analyse: Callable[[Triangle], Symbolic], definite: bool = True) -> None:
        self.backend, self._definite = backend, definite
        self.asked = backend, definite
        csr = by_rows(K)
        self._pattern = csr.indptr, csr.indices
        self._triangle = Triangle.of(csr)
        self._symbolic = analyse(self._triangle) if self._triangle.n else _Nothing()
        self._last: Callable[[], DirectFactor | None] = lambda: None

    def factor(self, K: Matrix, reuse: Factor | None = None) -> DirectFactor:
        """Return the factor of K, and release the previous one; `reuse` is for iterative backends.

        Raises SingularError, and RequestError for another pattern than the one analysed.
        """
        csr = by_rows(K)
        if not all(map(np.array_equal, self._pattern, (csr.indptr, csr.indices))):
            raise RequestError("the matrix does not have the pattern that was analysed; analyse it again")
        last = self._last()
        if last is not None:
            last.release()
        made = DirectFactor(K, *self._numbers(csr))
        self._last = weakref.ref(made)
        return made

    def _numbers(self, csr: csr_array) -> tuple[Floats, Numeric]:
        """Return the diagonal of a matrix, and its factor."""
        d = positive_diagonal(csr) if self._definite else _size(csr)
        values = self._triangle.values(csr)
        try:
            numeric = self._symbolic.factor(values)
        except Breakdown as breakdown:
            raise (self._explained(csr, values, d, breakdown.dof) if self._definite else singular()) from None
        if self._definite:
            check_regular(csr, d, numeric.solve)
        return d, numeric

    def _explained(self, csr: csr_array, values: Floats, d: Floats, dof: int | None) -> SingularError:
        """Return the error for a K without a factor: a free motion if a tiny shift helps, else negative stiffness."""
        for shift in _SHIFTS:
            values[self._triangle.indptr[:-1]] = (1 + shift) * d
            try:
                numeric = self._symbolic.factor(values)
            except Breakdown:
                continue
            return singular(least_motion(csr, d, numeric.solve, clear=np.inf))
        return indefinite(dof)


def _size(K: csr_array) -> NDArray[np.floating]:
    """Return a positive diagonal (n,) to scale K with."""
    d = np.abs(K.diagonal())
    return np.where(d > 0, d, d.mean() or 1.0)


class _Nothing:
    """Analysis and factor of a matrix without rows."""

    def factor(self, values: Floats) -> Numeric:
        return self

    def solve(self, b: Floats) -> Floats:
        return b
