"""Rows of equality: equations c(u) = g(t) between displacements that are kept, each with a multiplier.

They stand in the linear system beside the rows of contact (`saddle.contact_system`), so that an equation between many
nodes leaves the stiffness sparse, and one that is not linear has its own tangent. With the multipliers p (k,) they act
on the bodies by forces -C^T p, C = dc/du.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.case.entry import Entry
from lacsolver.contact.laws import Bilateral, ContactLaw, RowState

#: length of a row on the unknowns that remain, relative to that on all nodes, which is round-off
_ROUNDING = 1e-13
#: relative difference below which two times are the same
_SAME = 1e-9


class EqualityAt(NamedTuple):
    """Rows of equality at one displacement and time.

    `gap` (k,): g(t) - c(u), lengths; `C` (k, n_dof): dc/du.
    """

    gap: NDArray[np.floating]
    C: csr_array


class EqualityRows(Protocol):
    """Rows of equality of one record of a case, under the `name` of their multipliers in the results.

    Equations are of about the size of one displacement each: their coefficients add up to about 1.
    """

    @property
    def name(self) -> str:
        """Name in the results."""

    @property
    def record(self) -> Entry:
        """The record of the case, for messages."""

    @property
    def linear(self) -> bool:
        """True if c is linear in u."""

    def at(self, u: Floats, t: float) -> EqualityAt:
        """Return the rows at u (n_dof,) and time t; their number never changes."""

    def curvature(self, u: Floats, t: float, p: Floats) -> csr_array | None:
        """Return the derivative (n_dof, n_dof) of C^T p by u at multipliers p (k,); None where C is constant."""

    def law(self, t: float) -> ContactLaw:
        """Return what the rows obey at time t: `Bilateral()` holds them, `Free()` lets them go.

        A law with a history keeps values from step to step.
        """


def moves(rows: csr_array, on_nodes: csr_array) -> NDArray[np.bool_]:
    """Return whether some unknown moves each of some rows (m, n_q); `on_nodes` (m, n_dof): these on all nodes.

    What prescribed displacements and equations leave of a row that they determine is round-off.
    """
    return np.asarray(lengths(rows) > _ROUNDING * lengths(on_nodes))


def lengths(rows: csr_array) -> NDArray[np.floating]:
    """Return the length (m,) of each row. (SciPy's norm sums duplicates of its argument in place.)"""
    row = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    return np.asarray(np.sqrt(np.bincount(row, np.square(rows.data), rows.shape[0])))


class Free(Bilateral):
    """No row is held, and none has a force."""

    def next_active(self, rows: RowState) -> NDArray[np.bool_]:
        """Return no row."""
        return np.zeros(len(rows.gap), bool)

    def residual(self, rows: RowState) -> Floats:
        """Return 0."""
        return np.zeros(len(rows.gap))


class Unlocked(Free):
    """A gap that is free, and remembered at the end of each step."""

    n_history = 1

    def commit(self, rows: RowState) -> Floats:
        """Return the gaps."""
        return rows.gap[:, None]


@dataclass(frozen=True)
class Locked(Bilateral):
    """A gap that stays what it was, or a `part` of that.

    >>> rows = RowState(np.array([-0.3]), np.zeros(1), np.array([True]), np.ones(1), np.array([[-0.2]]))
    >>> Locked().residual(rows).round(12).tolist()
    [-0.1]
    """

    part: float = 1.0
    n_history = 1

    def linearise(self, rows: RowState) -> tuple[Floats, Floats]:
        """Return the gaps that are kept, without a compliance."""
        return self.part * rows.history[:, 0], np.zeros(len(rows.gap))

    def residual(self, rows: RowState) -> Floats:
        """Return the change of the gaps."""
        return rows.gap - self.part * rows.history[:, 0]


def until(t: float, end: float) -> bool:
    """True for times up to an end, with round-off."""
    return t <= end * (1 + _SAME)
