"""Contact laws: the relation between mean gap and pressure that the rows of a contact pair obey.

A law answers for a group of rows, in the state `RowState`; nothing else in the solver knows which law a row obeys:

    next_active    the rows that enter the next linear system, as an equation
    linearise      that equation: gap + compliance * pressure = offset
    residual       how far a row is from the law, as a length
    status         what is reported: OPEN or CONTACT
    in_step        the law in a step of some size, for laws that depend on rates
    stored         the energy that contact gives back as it opens
    taken          the energy that the law takes in a step
    commit         the history at the end of a step, for laws with memory

`Unilateral` is 0 <= p, 0 <= g, p g = 0 (27), (29); `Bilateral` is g = 0. With a `compliance` a (length per stress) both
are springs between the skins, p = -g / a: the linear pressure-overclosure law of soft contact, with p >= 0 for
`Unilateral`. A tie is `Tied`: `Bilateral` for all components of the jump.

Another law is a class with the members of `ContactLaw`, most easily a frozen dataclass derived from `Unilateral` or
`Bilateral`; `CONTACT_LAWS` of `lacsolver.case.added` makes it known, by a name, to the case files that the same program
reads. It should be continuous, and pressure should grow with the overlap: at a jump there may be no equilibrium.

A law that is not linear is linearised again in each iteration, at gaps and pressures that fulfil the equation of the
last one and not the law itself. Newton's method takes few iterations, however stiff the law, with the tangent at the
gap where the law is softer than the `skin_stiffness` and at the pressure where it is stiffer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints

#: status of a macro-element; one that slides is in contact too
UNPAIRED, OPEN, CONTACT, SLIDES = -1, 0, 1, 2

Bools = NDArray[np.bool_]


class RowState(NamedTuple):
    """Rows of one contact pair (m,): mean `gap`, `pressure`, `active` set of the last solve, and the law's `history`.

    For `linearise`, `active` is the set of the next solve. Gaps and pressures are 0 where a row cannot be solved.
    `skin_stiffness` (m,): of each macro-element's own skin, stress per length, which makes a pressure a length.
    `history` (m, n_history): what the law committed at the end of the last step.
    """

    gap: Floats
    pressure: Floats
    active: Bools
    skin_stiffness: Floats
    history: Floats


class ContactLaw(Protocol):
    """Interface of a contact law."""

    @property
    def all_components(self) -> bool:
        """True if each macro-element has a row for every component of the jump, False for one row along the normal."""

    @property
    def compressive(self) -> bool:
        """True if pressures are never negative.

        Then rows start open or closed by the case's `initial`, reported pressures are cut off at 0, and skins that are
        prescribed may be apart; otherwise all rows start closed.
        """

    @property
    def yields(self) -> bool:
        """True if the law allows an overlap under pressure, so that skins may be prescribed on both sides."""

    @property
    def exact(self) -> bool:
        """True if the size of a pressure, not only its sign, decides on the active set: sets are solved exactly."""

    @property
    def n_history(self) -> int:
        """Number of values that a row keeps from step to step."""

    def in_step(self, dt: float) -> ContactLaw:
        """Return the law in a step of size dt in motion, 0 at rest."""

    def next_active(self, rows: RowState) -> Bools:
        """Return the active set (m,) after a solve with `rows.active`."""

    def linearise(self, rows: RowState) -> tuple[Floats, Floats]:
        """Return (offset, compliance), (m,) each: active rows fulfil gap + compliance * pressure = offset.

        It is asked for all rows, also for open ones without pressure: both must be finite, and the compliance >= 0.
        """

    def residual(self, rows: RowState) -> Floats:
        """Return the residual (m,) of the law, a length; 0 where it is fulfilled, also in rows that are rightly open.

        It is compared with the tolerance times the largest displacement. For a law p(gap) take the difference of the
        pressures over the sum of the law's slope and the `skin_stiffness`.
        """

    def status(self, rows: RowState) -> Ints:
        """Return the status (m,) of converged rows, OPEN or CONTACT."""

    def stored(self, rows: RowState) -> Floats:
        """Return the energy per area (m,) that converged rows give back as they open; asked of laws that yield."""

    def taken(self, rows: RowState) -> Floats:
        """Return the energy per area (m,) that the law takes in a step; asked of laws that yield."""

    def commit(self, rows: RowState) -> Floats:
        """Return the history (m, n_history) at the end of a step."""


@dataclass(frozen=True)
class Bilateral:
    """No gap, and a pressure of either sign; with a `compliance`, length per stress, a spring: gap = -compliance * p.

    >>> rows = RowState(np.array([-0.2]), np.array([3.0]), np.array([True]), np.ones(1), np.empty((1, 0)))
    >>> Bilateral().residual(rows).tolist(), Bilateral(compliance=0.1).residual(rows).round(12).tolist()
    ([-0.2], [0.1])
    """

    compliance: float = 0.0

    @property
    def yields(self) -> bool:
        """True with a compliance."""
        return self.compliance > 0

    all_components = False
    compressive = False
    exact = False
    n_history = 0

    def in_step(self, dt: float) -> ContactLaw:
        """Return the law itself: it does not depend on rates."""
        return self

    def next_active(self, rows: RowState) -> Bools:
        """Return every row."""
        return np.ones(len(rows.gap), bool)

    def linearise(self, rows: RowState) -> tuple[Floats, Floats]:
        """Return offsets of 0, and the compliance."""
        return np.zeros(len(rows.gap)), np.full(len(rows.gap), self.compliance)

    def residual(self, rows: RowState) -> Floats:
        """Return gap + compliance * pressure."""
        return rows.gap + self.compliance * rows.pressure

    def status(self, rows: RowState) -> Ints:
        """Return CONTACT for every row."""
        return np.full(len(rows.gap), CONTACT, np.int8)

    def stored(self, rows: RowState) -> Floats:
        """Return the energy of the spring."""
        return np.asarray(0.5 * self.compliance * np.square(rows.pressure))

    def taken(self, rows: RowState) -> Floats:
        """Return zeros: what it stores comes back."""
        return np.zeros(len(rows.gap))

    def commit(self, rows: RowState) -> Floats:
        """Return the history unchanged."""
        return rows.history


class Unilateral(Bilateral):
    """Pressure or gap: 0 <= p, 0 <= g, p g = 0; with a `compliance` 0 <= p, 0 <= g + compliance * p, one of them 0.

    >>> rows = RowState(np.array([0.1, -0.2]), np.zeros(2), np.zeros(2, bool), np.ones(2), np.empty((2, 0)))
    >>> Unilateral().next_active(rows).tolist(), Unilateral().residual(rows).tolist()
    ([False, True], [0.0, -0.2])
    """

    compressive = True

    def next_active(self, rows: RowState) -> Bools:
        """Return active rows under pressure, and open rows that overlap."""
        return np.where(rows.active, rows.pressure > 0, rows.gap < 0)

    def residual(self, rows: RowState) -> Floats:
        """Return the smaller of pressure, as a length, and gap + compliance * pressure (32)."""
        return np.minimum(rows.pressure / rows.skin_stiffness, super().residual(rows))

    def status(self, rows: RowState) -> Ints:
        """Return CONTACT where there is pressure."""
        return np.where(rows.pressure > 0, CONTACT, OPEN).astype(np.int8)


class Tied(Bilateral):
    """No jump in any component."""

    all_components = True
