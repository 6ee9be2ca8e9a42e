"""Direct solution: the code that all factorising backends share."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from importlib import import_module

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import LacmeshError, RequestError
from lacmesh.mesh import Floats
from lacsolver.linear.accuracy import TOLERANCE, Matrix, by_rows, refined, right_hand_sides, solves
from lacsolver.linear.direct.reserve import superlu_serves
from lacsolver.linear.direct.triangle import Factorise, Solve, Triangle
from lacsolver.linear.errors import Breakdown, Doubted, LinearError, SingularError
from lacsolver.linear.regular import check_regular, indefinite, is_free, least_motion, positive_diagonal, singular
from lacsolver.linear.vectors import WHOLE, Vectors

#: shifts, relative to the diagonal, that make a singular matrix factorisable to find its null motion; the smaller the
#: shift, the clearer the motion
_SHIFTS = (1e-13, 1e-11, 1e-9)


class DirectFactor:
    """A factor of K, with K itself for residuals. `n_solves`: right-hand sides solved so far.

    `reserve`: takes the error of a solver that fails, and returns the solution with K by another one; None if there is
    none.
    """

    iterative = False
    vectors: Vectors = WHOLE

    def __init__(self, K: Matrix, d: Floats, solve: Solve, reserve: Callable[[Exception], Solve] | None = None) -> None:
        self.n_solves = 0
        self._K = K
        self._scale = 1 / np.sqrt(d)
        self._solve: Solve | None = solve
        self._reserve = reserve

    def solve(self, b: Floats, *, tolerance: float = TOLERANCE, x0: Floats | None = None) -> Floats:
        """Return K^-1 b to round-off; tolerance and x0 are for iterative solvers."""
        b = right_hand_sides(b, len(self._scale))
        solve = self._solve
        if solve is None:
            raise RequestError("this factor was replaced by a newer one of the same analysis; solve with that one")
        self.n_solves += b.shape[1] if b.ndim == 2 else 1
        try:
            return self._refined(solve, b)
        except MemoryError:
            raise
        except Exception as failure:
            if self._reserve is None:
                raise
            self._solve, self._reserve = self._reserve(failure), None
        return self._refined(self._solve, b)

    def release(self) -> None:
        """Free the backend's memory; the factor cannot be used afterwards."""
        self._solve = self._reserve = None

    def _refined(self, solve: Solve, b: Floats) -> NDArray[np.floating]:
        return refined(self._K, self._scale, lambda r: solve(np.array(r, order="F")), b)


class DirectAnalysis:
    """The analysis of a pattern by a direct backend; every factor replaces the one before.

    `definite`: True if a matrix that is not positive definite is an error. Where rslab fails, SuperLU takes its place
    for the rest of the analysis: `backend` is then that, and `note` a sentence about it.
    """

    def __init__(self, backend: str, K: Matrix, threads: int, definite: bool = True, note: str = "") -> None:
        self.backend, self.note = backend, note
        self._threads, self._definite = threads, definite
        csr = by_rows(K)
        self._pattern = csr.indptr, csr.indices
        self._triangle = Triangle.of(csr)
        self._last: Callable[[], DirectFactor | None] = lambda: None
        try:
            self._factorise = self._analysed(backend)
        except Exception as failure:
            if not self._is_failure(failure):
                raise
            self._replace(self._analysed("superlu"), failure)

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
        d = positive_diagonal(csr) if self._definite else _size(csr)
        factor = self._factor(K, csr, d)
        self._last = weakref.ref(factor)
        return factor

    def _factor(self, K: Matrix, csr: csr_array, d: Floats) -> DirectFactor:
        """Return the factor of a matrix, K as it is and by rows, with the diagonal d: by SuperLU where rslab fails."""
        try:
            solve = self._checked(self._factorise, csr, d)
        except Exception as failure:
            if isinstance(failure, Doubted) and self.backend != "rslab":
                raise failure.error from None
            if not self._is_failure(failure):
                raise
            return DirectFactor(K, d, self._by_superlu(csr, d, failure))
        reserve = (lambda failure: self._by_superlu(csr, d, failure)) if self.backend == "rslab" else None
        return DirectFactor(K, d, solve, reserve)

    def _analysed(self, backend: str) -> Factorise:
        """Return the factorisation of the pattern by a backend. Only rslab and SuperLU take indefinite ones."""
        if not self._triangle.n:
            return lambda values: lambda b: b
        method = import_module(f"lacsolver.linear.direct.{backend}")
        return method.analyse(self._triangle, self._threads, *(() if self._definite else (False,)))

    def _is_failure(self, failure: Exception) -> bool:
        """True for an error that says something about the solver, not about the matrix, if another one can serve."""
        of_the_solver = isinstance(failure, Doubted) or not isinstance(failure, (LacmeshError, MemoryError))
        return self.backend == "rslab" and of_the_solver

    def _by_superlu(self, csr: csr_array, d: Floats, failure: Exception) -> Solve:
        """Return the solution by SuperLU, which takes the place of the backend if it does better.

        Raises SingularError, and LinearError for a matrix that is not symmetric.
        """
        factorise = self._analysed("superlu")
        try:
            solve = self._checked(factorise, csr, d)
        except Doubted as doubt:
            raise doubt.error from None
        if not solves(csr, d, solve):  # nor is it the solver's fault
            raise failure
        self._replace(factorise, failure)
        return solve

    def _replace(self, factorise: Factorise, failure: Exception) -> None:
        """Put SuperLU in the place of the backend, and say so."""
        why = "it solves a system wrongly" if isinstance(failure, LinearError) else str(failure) or repr(failure)
        self._factorise, self.backend = factorise, "superlu"
        self.note = superlu_serves("failed", why, "a newer version may not fail: pip install -U rslab")

    def _checked(self, factorise: Factorise, csr: csr_array, d: Floats) -> Solve:
        """Return the solution with a factor of a matrix with the diagonal d.

        Raises SingularError, Doubted for a matrix whose factor alone says that it is singular, or other errors of the
        backend.
        """
        values = self._triangle.values(csr)
        try:
            solve = factorise(values)
            if self._definite:
                check_regular(csr, d, solve)
            return solve
        except Breakdown as breakdown:
            if not self._definite:
                raise singular() from None
            error = self._explained(factorise, csr, values, d, breakdown.dof)
            shown = breakdown.solve is not None and solves(csr, d, breakdown.solve)
        except SingularError as claim:
            error, shown = claim, False
        if shown or (error.mode is not None and is_free(csr, error.mode)):
            raise error from None
        raise Doubted(error)

    def _explained(
        self, factorise: Factorise, csr: csr_array, values: Floats, d: Floats, dof: int | None
    ) -> SingularError:
        """Return the error for a K without a factor: a free motion if a tiny shift helps, else negative stiffness."""
        for shift in _SHIFTS:
            values[self._triangle.indptr[:-1]] = (1 + shift) * d
            try:
                solve = factorise(values)
            except Breakdown:
                continue
            return singular(least_motion(csr, d, solve, clear=np.inf))
        return indefinite(dof)


def _size(K: csr_array) -> NDArray[np.floating]:
    """Return a positive diagonal (n,) to scale K with."""
    d = np.abs(K.diagonal())
    return np.where(d > 0, d, d.mean() or 1.0)
