"""The stiffness K on the constrained unknowns, as the iterative loops use it: products, approximate inverses, parts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear import Matrix
from lacsolver.linear.vectors import Vectors


class Operator(ABC):
    """K (n, n) on the unknowns of one process (`stiffness`) or of several (`shared_stiffness`).

    Vectors of displacements are known at all unknowns of a process, forces and rows of K are complete at its own.
    `matrix`: K, or blocks of K with its springs on the unknowns of all nodes. `R` (n, r): rigid-body modes in the null
    space of K, orthonormal. `spring` (n,): what the factor has in addition on the diagonal, so that it is definite, or
    None. `vectors`: operations on vectors. `iterative`: True if `cycle` is the basic operation and K^-1 takes many of
    them. `definite`: True if negative energies of K are errors, of an iterative solution.
    """

    vectors: Vectors
    iterative: bool
    definite = True

    def __init__(self, matrix: Matrix, R: NDArray[np.floating], spring: NDArray[np.floating] | None = None) -> None:
        self.matrix, self.R, self.spring = matrix, R, spring
        self._restricted: tuple[Ints, csr_array] | None = None
        self._rows: tuple[csr_array, Any] | None = None

    @cached_property
    def K(self) -> csr_array:
        """Matrix (n, n); where only blocks are kept, it is made of them once it is asked for."""
        return self.matrix if isinstance(self.matrix, csr_array) else self._submatrix(np.arange(len(self.R)))

    @property
    @abstractmethod
    def scaling(self) -> NDArray[np.floating]:
        """Diagonal (n,) of K with its springs; 1 where it is 0."""

    @abstractmethod
    def apply(self, q: Floats) -> NDArray[np.floating]:
        """Return K q (n,)."""

    @abstractmethod
    def cycle(self, f: Floats) -> NDArray[np.floating]:
        """Return an approximation of K^-1 f (n,), by one V-cycle; with multigrid only."""

    @abstractmethod
    def cycle_with_rows(self, B: csr_array, weights: Floats) -> Callable[[Floats], NDArray[np.floating]] | None:
        """Return f -> an approximation of (K + B^T W B)^-1 f, with W = diag `weights` (m,); None if there is none.

        Rows of B (m, n) without weight have no part in it.
        """

    def record_convergence(self, use: str, cycles: int, first: float, last: float) -> None:
        """Record that `cycles` V-cycles reduced a residual norm from `first` to `last`."""
        if first > 0:
            self._record(use, cycles, float(np.log10(first / max(last, 1e-16 * first))))

    @abstractmethod
    def _record(self, use: str, cycles: int, decades: float) -> None:
        """Record that `cycles` V-cycles reduced a residual by so many decades."""

    def restricted(self, unknowns: Ints) -> csr_array:
        """Return the rows and columns of K at some unknowns, which all processes have; the last are kept."""
        if self._restricted is None or not np.array_equal(self._restricted[0], unknowns):
            self._restricted = unknowns, self._total(self._submatrix(unknowns))
        return self._restricted[1]

    def _rows_of(self, B: csr_array, prepare: Callable[[csr_array], Any]) -> Any:
        """Return what a cycle needs of the rows B, whatever their weights; the last is kept."""
        if self._rows is None or self._rows[0] is not B:
            self._rows = B, prepare(B)
        return self._rows[1]

    @abstractmethod
    def _submatrix(self, unknowns: Ints) -> csr_array:
        """Return the rows and columns of K at some unknowns, without the rows of other processes."""

    def _total(self, A: csr_array) -> csr_array:
        """Return the sum of a matrix over all processes."""
        return A


def product(K: Operator, V: Floats, C: csr_array | None = None) -> NDArray[np.floating]:
    """Return (K + C) V (n, k), column by column; C (n, n): a matrix whose rows each process has as those of K."""
    columns = [K.apply(v) if C is None else K.apply(v) + K.vectors.summed(C @ v) for v in V.T]
    return np.stack(columns, axis=1) if columns else np.zeros_like(V)
