"""Interfaces of a linear solver: analysis of a pattern, factorisation of values, solution for right-hand sides.

All backends, direct or not, implement `Analysis` and `Factor`. The modules of direct backends implement smaller
interfaces: `Symbolic` for the order of elimination and `Numeric` for the factor, which handle one triangle as arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats
from lacsolver.linear.vectors import Vectors

#: default residual of an iterative backend, relative to the right-hand side
TOLERANCE = 1e-12

Matrix: TypeAlias = csr_array | bsr_array


class Factor(Protocol):
    """A factorised or otherwise prepared matrix.

    `iterative`: True if the basic operation is `cycle`, an approximation of K^-1 b, of which a solution takes many; the
    cycle of a direct backend is its solution. `vectors`: the operations on its vectors.
    """

    #: right-hand sides solved so far
    n_solves: int
    iterative: bool
    vectors: Vectors

    def apply(self, x: Floats) -> Floats:
        """Return K x."""

    def cycle(self, b: Floats) -> Floats:
        """Return an approximation of K^-1 b (n,)."""

    def cycle_with_rows(self, B: bsr_array, weights: Floats) -> Callable[[Floats], Floats]:
        """Return b -> an approximation of (K + B^T W B)^-1 b, with W = diag `weights` (m,); iterative backends only.

        B (m, n) has blocks (1, b) for nodes of b unknowns.
        """

    def record_convergence(self, use: str, cycles: int, decades: float) -> None:
        """Record that `cycles` reduced a residual by so many decades, in a kind of use."""

    def solve(self, b: Floats, *, tolerance: float = TOLERANCE, x0: Floats | None = None) -> Floats:
        """Return K^-1 b for b (n,) or (n, k); see `lacsolver.linear.analyse`."""


class Analysis(Protocol):
    """The analysis of a pattern."""

    backend: str

    def factor(self, K: Matrix, reuse: Factor | None = None) -> Factor:
        """Return the factor of a matrix with the pattern that was analysed.

        `reuse`: factor of a similar matrix by the same backend, of which an iterative backend keeps what it can.
        """


class Numeric(Protocol):
    """A direct backend's factor."""

    def solve(self, b: Floats) -> Floats:
        """Return K^-1 b for b (n,), or (n, k) stored by columns; b may be overwritten."""


class Symbolic(Protocol):
    """A direct backend's analysis of a triangle."""

    def factor(self, values: Floats) -> Numeric:
        """Return the factor of a triangle's values, which may overwrite the previous one. Raises Breakdown."""
