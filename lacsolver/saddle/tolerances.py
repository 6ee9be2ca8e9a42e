"""Residuals of an equilibrium and their tolerances.

Gaps are compared with the largest displacement, forces with the largest force, of the bodies that they act on, or with
the round-off of the sums that they come from, so that no tolerance depends on units or on what else is in the model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.vectors import WHOLE, BodyVectors, Vectors

#: relative round-off of gaps, to the coordinates, and of forces, to the terms that they are summed from
ROUNDING = 1e-14
#: number of rows of a matrix that are copied at once
_ROWS = 20_000


class Residual(NamedTuple):
    """Residuals of a state: relative ones of forces and gaps, and `merit`, a force that grows with both.

    `balance` is relative to forces or to their round-off, as the tolerance is, and `relative` to forces, for people.
    """

    balance: float
    gap: float
    merit: float = np.nan
    relative: float = np.nan


class LinearTolerance(NamedTuple):
    """Tolerance of a linear solve: residual of gaps at `reduction` times the initial one, or at a lower limit.

    The limit is `relative` times the largest unknown (or `moved`), or `absolute`; both are lengths.
    """

    reduction: float
    relative: float
    absolute: float
    moved: Floats | float

    def threshold(self, largest: Floats | float) -> NDArray[np.floating]:
        """Return the lower limit of the residual of gaps, a length, for the largest unknown, or one for each row."""
        return np.maximum(self.relative * np.maximum(largest, self.moved), self.absolute)

    def at(self, rows: Ints) -> LinearTolerance:
        """Return the tolerance of some rows."""
        return self if isinstance(self.moved, float) else self._replace(moved=self.moved[rows])


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

    def relative_gap(self, gaps: Floats, B: csr_array, q: Floats) -> float:
        """Return the largest of some gaps (m,), lengths, relative to the scale of the bodies of their rows B (m, n).

        It is that of all if round-off allows no less, and `threshold` is of the scale of all.
        """
        return float((np.abs(gaps) / self.gaps(B, q)).max(initial=0.0)) * self.threshold(q) / self.scale(q)

    def gaps(self, B: csr_array, q: Floats) -> NDArray[np.floating]:
        """Return the gap that may remain in each row of B (m, n) at q (n,), (m,), or of all rows if that is one."""
        return np.maximum(self.tolerance * self.of_rows(B, q), ROUNDING * max(self.scale(q), self.length))

    def of_rows(self, B: csr_array, q: Floats) -> Floats | float:
        """Return the scale of gaps at q (n,) for each row of B (m, n): that of its bodies, of all if they are one."""
        own = self.vectors.largest_of_body(q)
        return self.scale(q) if isinstance(own, float) else largest_of_rows(B, own)

    def fulfilled(self, residual: Residual, q: Floats) -> bool:
        """True if a state is an equilibrium, to the tolerance or to the round-off of coordinates."""
        return residual.balance <= self.tolerance and residual.gap <= self.threshold(q) / self.scale(q)

    def linear(self, reduction: float, moved: Floats | float | None = None) -> LinearTolerance:
        """Return the tolerance of a linear solve, with a reduction and the scale `moved` of gaps, (m,) or of all rows.

        By default it is that of prescribed displacements, which several bodies do not have in common.
        """
        several = isinstance(self.vectors, BodyVectors)
        least = 1e-4 * ROUNDING * max(self.length, several * self.moved)
        if moved is None:
            moved = 0.0 if several else self.moved
        return LinearTolerance(reduction, 1e-3 * self.tolerance, least, moved)


class ForceTerms(NamedTuple):
    """Sums (n,) of the magnitudes of each force's terms, and the diagonal K (n,), in whose scaling solves are exact."""

    size: Floats
    K: Floats

    def rounding(self, vectors: Vectors = WHOLE) -> NDArray[np.floating]:
        """Return the round-off of each sum of forces (n,), ROUNDING D^1/2 max |D^-1/2 size|, with D the diagonal."""
        scale = np.sqrt(np.where(self.K > 0, self.K, 1.0))
        return np.asarray(ROUNDING * vectors.largest_of_body(self.size / scale) * scale)


def largest_of_rows(B: csr_array, values: Floats | float) -> Floats | float:
    """Return the largest of values (n,) >= 0 at the entries of each row of B (m, n), (m,); a number if that is one."""
    if isinstance(values, float):
        return values
    out = np.zeros(B.shape[0])
    np.maximum.at(out, np.repeat(np.arange(len(out)), np.diff(B.indptr)), values[B.indices])
    return out


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
    r: Floats, force: Floats | float, terms: Callable[[], ForceTerms] | None, tolerance: ConvergenceTolerance, q: Floats
) -> tuple[float, float]:
    """Return the residual of the force balance relative to the largest `force` on the body of each unknown.

    The first number is relative to the round-off of the sums or of the coordinates that gaps come from, where that is
    more; the second one only where the residual is within that round-off. r (n,): residual of each sum of forces at
    q (n,). `terms()`: terms of the sums, computed only if the tolerance is not met; None if the sums are exact.
    """
    vectors, force = tolerance.vectors, np.maximum(force, 1e-300)
    off = vectors.largest(r / force)
    if terms is None or off <= tolerance.tolerance:
        return off, off
    summed = terms()
    # Without a load forces come from gaps, which the round-off of coordinates limits, of each body by its own size.
    # Where gaps are linear, one solve gives all bodies by modes that move several: the largest counts for all.
    extent = max(tolerance.scale(q), tolerance.length) * (vectors.size if tolerance.length else 1.0)
    moves = np.maximum(vectors.largest_of_body(q), extent)
    of_sums = summed.rounding(vectors)
    least = np.maximum(of_sums, ROUNDING * moves * summed.K)
    shown = np.where(np.abs(r) <= least, least, of_sums)
    balance, relative = (vectors.largest(r / np.maximum(force, one / tolerance.tolerance)) for one in (least, shown))
    return balance, relative
