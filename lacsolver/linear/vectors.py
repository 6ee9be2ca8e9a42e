"""Operations on vectors that the iterative loops use: products, norms and sums; the only place that a loop sums in.

`lacsolver.linear.cycle.Team` has the same operations on several threads. A distributed vector would have them over its
parts.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats


class Vectors(Protocol):
    """Interface of the operations on vectors (n,)."""

    def dots(self, A: Floats, x: Floats) -> NDArray[np.floating]:
        """Return the products (k,) of rows A (k, n) with x."""

    def norm(self, x: Floats) -> float:
        """Return the Euclidean norm."""

    def largest(self, x: Floats) -> float:
        """Return the largest magnitude of an entry, 0 for an empty vector."""

    def subtract(self, c: Floats, A: Floats, x: Floats) -> None:
        """Subtract c A from x in place, for rows A (k, n)."""


class WholeVectors:
    """Vectors that are whole arrays of numpy.

    >>> WholeVectors().norm(np.array([3.0, 4.0])), WholeVectors().largest(np.array([3.0, -4.0]))
    (5.0, 4.0)
    """

    def dots(self, A: Floats, x: Floats) -> NDArray[np.floating]:
        """Return the products (k,) of rows A (k, n) with x."""
        return np.asarray(A @ x)

    def norm(self, x: Floats) -> float:
        """Return the Euclidean norm."""
        return float(np.linalg.norm(x))

    def largest(self, x: Floats) -> float:
        """Return the largest magnitude of an entry, 0 for an empty vector."""
        return float(np.abs(x).max(initial=0.0))

    def subtract(self, c: Floats, A: Floats, x: Floats) -> None:
        """Subtract c A from x in place, for rows A (k, n)."""
        x -= c @ A


#: whole arrays
WHOLE = WholeVectors()
