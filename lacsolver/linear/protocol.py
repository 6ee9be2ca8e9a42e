"""What a linear solver offers: the analysis of a pattern, factors of values, solutions of right-hand sides.

The three steps are shared by all backends, direct or not. Inside a direct backend's module they are smaller ones:
`Symbolic` knows the order of elimination, `Numeric` the factor, and both speak of one triangle and of arrays only.
"""

from __future__ import annotations

from typing import Protocol, TypeAlias

from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats

#: a residual, relative to the right-hand side, that an iterative backend goes down to
TOLERANCE = 1e-12

Matrix: TypeAlias = csr_array | bsr_array


class Factor(Protocol):
    """A matrix made ready to be solved with."""

    #: right-hand sides solved so far
    n_solves: int

    def solve(self, b: Floats, *, tolerance: float = TOLERANCE, x0: Floats | None = None) -> Floats:
        """K^-1 b for b (n,) or (n, k); see `lacsolver.linear.analyse`."""


class Analysis(Protocol):
    """A pattern made ready for values."""

    backend: str

    def factor(self, K: Matrix) -> Factor:
        """A factor of a matrix that has the pattern which was analysed."""


class Numeric(Protocol):
    """A direct backend's factor."""

    def solve(self, b: Floats) -> Floats:
        """K^-1 b for b (n,), or (n, k) stored by columns; b may be overwritten."""


class Symbolic(Protocol):
    """A direct backend's analysis of a triangle."""

    def factor(self, values: Floats) -> Numeric:
        """The factor of a triangle's values, which may overwrite the one before. Raises Breakdown."""
