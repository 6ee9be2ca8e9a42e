"""Interface of a stiffness for the iterative loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.vectors import Vectors


class Operator(Protocol):
    """Interface of a stiffness on the constrained unknowns, of one process (`stiffness`) or of several.

    What the iterative loops ask of it. Vectors of displacements are known at all unknowns of a process, forces at its
    own. `K`: the matrix, as far as this process has it; `R` (n, r): rigid-body modes in its null space.
    """

    @property
    def K(self) -> csr_array:
        """Matrix (n, n), of which the rows of a process's own unknowns are complete."""

    @property
    def R(self) -> NDArray[np.floating]:
        """Rigid-body modes (n, r) in the null space, with orthonormal columns."""

    @property
    def iterative(self) -> bool:
        """True if `cycle` is the basic operation and K^-1 takes many of them."""

    @property
    def definite(self) -> bool:
        """True if negative energies of K are errors, of an iterative solution."""

    @property
    def vectors(self) -> Vectors:
        """Operations on vectors of the unknowns."""

    @property
    def scaling(self) -> NDArray[np.floating]:
        """Diagonal (n,) of K with its springs; 1 where it is 0."""

    def apply(self, q: Floats) -> NDArray[np.floating]:
        """Return K q (n,)."""

    def restricted(self, unknowns: Ints) -> csr_array:
        """Return the rows and columns of K at some unknowns, which all processes have."""

    def cycle(self, f: Floats) -> NDArray[np.floating]:
        """Return an approximation of K^-1 f (n,)."""

    def cycle_with_rows(self, B: csr_array, weights: Floats) -> Callable[[Floats], NDArray[np.floating]] | None:
        """Return f -> an approximation of (K + B^T W B)^-1 f, with W = diag `weights` (m,); None if it has none.

        Rows of B (m, n) without weight have no part in it. What belongs to B is kept for other weights.
        """

    def record_convergence(self, use: str, cycles: int, first: float, last: float) -> None:
        """Record that `cycles` V-cycles reduced a residual norm from `first` to `last`."""


def product(K: Operator, V: Floats, C: csr_array | None = None) -> NDArray[np.floating]:
    """Return (K + C) V (n, k), column by column; C (n, n): a matrix whose rows each process has as those of K."""
    columns = [K.apply(v) if C is None else K.apply(v) + K.vectors.summed(C @ v) for v in V.T]
    return np.stack(columns, axis=1) if columns else np.zeros_like(V)
