"""Directions of the loop on the pressures, kept from one linear system of a search to the next (Parks et al. 2006).

A direction is y = K^-1 f under some forces f. While K stays, it is one of a later system as well, whatever the rows
there: with the pressures that it had, what these do not give of f are forces of the geometric stiffness. Its image
takes products with few rows, and no application of K^-1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacsolver.saddle.operator import Operator

#: most directions that are kept; they take as much memory as a small part of a factor of K
_MOST = 60


class Direction(NamedTuple):
    """Displacements y (n,) under forces f (k,) at the unknowns `at` (k,), those of pressures p (m,) among them."""

    y: Floats
    at: Ints
    f: Floats
    p: Floats

    def beside(self, contact: Floats, at: Ints) -> NDArray[np.floating]:
        """Return what f has beside the forces `contact` (n,), at the unknowns `at`, which are all that either has."""
        beside = -contact
        beside[self.at] += self.f
        return np.asarray(beside[at])


class KeptDirections:
    """The last directions `each` for one stiffness K."""

    def __init__(self) -> None:
        self._K: Operator | None = None
        self.each: list[Direction] = []

    def begin(self, K: Operator) -> None:
        """Begin a system with K: directions of another one are dropped."""
        if K is not self._K:
            self._K, self.each = K, []

    def add(self, direction: Direction) -> None:
        """Keep a direction, in the place of the oldest if there are too many."""
        self.each = [*self.each[1 - _MOST :], direction]

    def unknowns(self, others: Ints) -> Ints:
        """Return the unknowns at which directions have forces, and others, ascending."""
        return np.unique(np.concatenate([others, *(one.at for one in self.each)]))
