"""Residuals of an equilibrium and their tolerances.

Gaps are compared with the largest displacement, forces with the largest force, or with the round-off of the sums that
they come from, so that no tolerance depends on units.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacmesh.records import dataclass
from lacsolver.linear.vectors import WHOLE, Vectors

#: relative round-off of gaps, to the coordinates, and of forces, to the terms that they are summed from
ROUNDING = 1e-14
#: number of rows of a matrix that are copied at once
_ROWS = 20_000


class Residual(NamedTuple):
    """Residuals of a state: relative ones of forces and gaps, and `merit`, a force that grows with both."""

    balance: float
    gap: float
    merit: float = np.nan


class LinearTolerance(NamedTuple):
    """Tolerance of a linear solve: residual of gaps at `reduction` times the initial one, or at a lower limit.

    The limit is `relative` times the largest unknown (or `moved`), or `absolute`; both are lengths.
    """

    reduction: float
    relative: float
    absolute: float
    moved: float

    def threshold(self, largest: float) -> float:
        """Return the lower limit of the residual of gaps, a length, for the largest unknown."""
        return max(self.relative * max(largest, self.moved), self.absolute)


@dataclass(frozen=True)
class ConvergenceTolerance:
    """Convergence criteria: `tolerance` of both residuals, and `max_iterations`.

    `length`: size of the coordinates from which gaps are recomputed, whose round-off limits them; 0 if gaps are linear,
    with only the round-off of displacements. `moved`: largest prescribed displacement, part of the scale of gaps.
    `vectors`: operations on vectors of the unknowns.
    """

    tolerance: float
    max_iterations: int
    length: float
    moved: float = 0.0
    vectors: Vectors = WHOLE

    def scale(self, q: Floats) -> float:
        """Return the scale of gaps at q (n,), a length."""
        return max(self.vectors.largest(q), self.moved, ROUNDING * self.length, 1e-300)

    def threshold(self, q: Floats) -> float:
        """Return the gap that may remain at q (n,): the tolerance times the scale, or round-off."""
        return max(self.tolerance * self.scale(q), ROUNDING * max(self.scale(q), self.length))

    def fulfilled(self, residual: Residual, q: Floats) -> bool:
        """True if a state is an equilibrium, to the tolerance or to the round-off of coordinates."""
        return residual.balance <= self.tolerance and residual.gap <= self.threshold(q) / self.scale(q)

    def linear(self, reduction: float, moved: float) -> LinearTolerance:
        """Return the tolerance of a linear solve, with a reduction and the scale `moved` of gaps."""
        return LinearTolerance(reduction, 1e-3 * self.tolerance, 1e-4 * ROUNDING * self.length, moved)


class ForceTerms(NamedTuple):
    """Sums (n,) of the magnitudes of each force's terms, and the diagonal K (n,), in whose scaling solves are exact."""

    size: Floats
    K: Floats

    def rounding(self, vectors: Vectors = WHOLE) -> NDArray[np.floating]:
        """Return the round-off of each sum of forces (n,), ROUNDING D^1/2 max |D^-1/2 size|, with D the diagonal."""
        scale = np.sqrt(np.where(self.K > 0, self.K, 1.0))
        return ROUNDING * vectors.largest(self.size / scale) * scale


def sizes(K: csr_array, q: Floats) -> NDArray[np.floating]:
    """Return |K| |q| (n,), by slices of rows: a copy of all of K would take as much memory as K."""
    q, out = np.abs(q), np.empty(K.shape[0])
    for first in range(0, len(out), _ROWS):
        start = K.indptr[first : first + _ROWS + 1]
        own = slice(start[0], start[-1])
        rows = csr_array((np.abs(K.data[own]), K.indices[own], start - start[0]), shape=(len(start) - 1, len(q)))
        out[first : first + _ROWS] = rows @ q
    return out


def equilibrium_residual(
    r: Floats, force: float, terms: Callable[[], ForceTerms] | None, tolerance: ConvergenceTolerance
) -> float:
    """Return the residual of the force balance relative to the largest `force`, or to the round-off of the sums.

    r (n,): residual of each sum of forces. `terms()`: terms of the sums, computed only if the tolerance is not met;
    None if the sums are exact.
    """
    vectors, off = tolerance.vectors, tolerance.vectors.largest(r) / max(force, 1e-300)
    if terms is not None and off > tolerance.tolerance:
        off = vectors.largest(r / np.maximum(force, terms().rounding(vectors) / tolerance.tolerance))
    return off
