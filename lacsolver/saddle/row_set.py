"""Row sets: which contact rows are equations in the next linear system, and how macro-elements slide in it.

The rows of a pair with friction are those along its normals, (m,), and those along its tangents, (m, d - 1). With the
state of each macro-element (`contact.friction`) the system has, at p and t of the last solve,

    open      no row
    sticks    its rows:  B_N, D_N, G and B_T, D_T, -S
    slides    one row  B_N + b'(p) d . B_T,  D_N,  G  with the forces B_T^T (b - b' p) d at the right,
              in space another one along the tangent e across d:  e . B_T,  e . D_T - |S| / b tau,  -e . S

    p = p',    t = (b - b' p + b' p') d + tau e        p', tau: unknowns of the system

tau turns the traction: t / |t| is then the direction of the slip S + D_T dq, to first order, without a constant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints, mask_of
from lacsolver.contact.friction import Bounds, States
from lacsolver.contact.laws import Bools
from lacsolver.space.sparse import sparse

#: states of rows: not in the system, an equation of it, and rows along the tangents of a macro-element that slides, in
#: the plane with the sign of its direction
OUT, IN, SLIDES = 0, 1, 2


class RowSet(NamedTuple):
    """States of the contact rows (m,) in a linear system: OUT, IN, SLIDES or -SLIDES.

    With friction, for rows along tangents: `direction` (m,), the component of the direction of a slide; `turned` (m,),
    True for macro-elements that have turned round; `macro` (m,), the first row of each row's macro-element. All are
    empty without friction.
    """

    state: NDArray[np.int8]
    direction: NDArray[np.floating] = np.empty(0)
    turned: Bools = np.empty(0, bool)
    macro: Ints = np.empty(0, np.int64)

    @classmethod
    def of(cls, active: Bools) -> RowSet:
        """Return the set of the `active` rows (m,), without friction.

        >>> RowSet.of(np.array([True, False])).active.tolist()
        [True, False]
        """
        return cls(active.astype(np.int8))

    @property
    def active(self) -> Bools:
        """True for rows that are equations of the system, (m,)."""
        return self.state == IN

    def equals(self, other: RowSet) -> bool:
        """True for the same states; directions in space may differ."""
        return np.array_equal(self.state, other.state)

    def changes(self, wanted: RowSet) -> Ints:
        """Return the first row of each macro-element whose state differs in another set; without friction, each row."""
        rows = np.flatnonzero(self.state != wanted.state)
        return np.unique(self.macro[rows]) if len(self.macro) else rows

    def exchanged(self, wanted: RowSet, row: int) -> RowSet:
        """Return this set with the state of one macro-element, given by its first row, as in another."""
        if not len(self.macro):
            return self._replace(state=np.where(np.arange(len(self.state)) == row, wanted.state, self.state))
        own = self.macro == row
        state, direction, turned = (np.where(own, b, a) for a, b in zip(self[:3], wanted[:3], strict=True))
        return RowSet(state, direction, turned, self.macro)

    def same(self, same: Callable[[NDArray], NDArray]) -> RowSet:
        """Return the set as the first of several processes has it; `same` does that for an array."""
        if not len(self.macro):
            return RowSet(same(self.state))
        return RowSet(same(self.state), same(self.direction), same(self.turned), self.macro)


class ShearRows(NamedTuple):
    """Rows of a pair with friction: `normal` and `tangential` ones, slices, and the `bounds` of its tractions."""

    normal: slice
    tangential: slice
    bounds: Bounds

    @classmethod
    def after(cls, normal: slice, n: int, bounds: Bounds) -> ShearRows:
        """Return those with `n` tangential rows after the normal ones."""
        return cls(normal, slice(normal.stop, normal.stop + n), bounds)

    @property
    def n_rows(self) -> int:
        """Number of macro-elements."""
        return self.normal.stop - self.normal.start

    @property
    def n_tangents(self) -> int:
        """Tangents of a macro-element: 1 in the plane, 2 in space."""
        return (self.tangential.stop - self.tangential.start) // max(self.n_rows, 1)

    @property
    def at(self) -> Ints:
        """Numbers (macro-elements, tangents) of the tangential rows."""
        return np.arange(self.tangential.start, self.tangential.stop).reshape(-1, max(self.n_tangents, 1))

    def vectors(self, rows: NDArray) -> NDArray:
        """Return the values (macro-elements, tangents) of tangential rows, of those (m,) of all rows."""
        return rows[self.tangential].reshape(-1, max(self.n_tangents, 1))

    def sticks(self, active: Bools) -> Bools:
        """Return which macro-elements stick, of the `active` rows (m,): those with a row along a tangent."""
        return np.asarray(self.vectors(active).any(axis=1))

    def states(self, rows: RowSet) -> States:
        """Return the states of the macro-elements in a set."""
        turned, active = self.vectors(rows.turned)[:, 0], rows.active
        return States(active[self.normal], self.sticks(active), self.vectors(rows.direction), turned)

    def put(self, rows: RowSet, states: States, enforceable: Bools) -> None:
        """Write the states of the macro-elements into a set."""
        rows.state[self.normal] = states.closed & enforceable[self.normal]
        sliding = np.sign(states.direction) if self.n_tangents == 1 else states.slides[:, None]
        sticks = states.sticks[:, None] & self.vectors(enforceable)
        self.vectors(rows.state)[:] = np.where(sticks, IN, SLIDES * sliding)
        self.vectors(rows.direction)[:] = states.direction
        self.vectors(rows.turned)[:] = states.turned[:, None]


class LinearRows(NamedTuple):
    """Contact of one row set as a linear system: `rows`, the indices (a,) of the `active` ones, G (m,), compliances S.

    `combine` (m, m): the full pressures p are `combine` times the system's, plus `offset` (m,); None and () for the
    same. `turn` (m, m): R in D' = R D.
    """

    rows: Any
    active: Ints
    G: NDArray[np.floating]
    S: NDArray[np.floating]
    combine: csr_array | None = None
    turn: csr_array | None = None
    offset: NDArray[np.floating] = np.empty(0)

    @property
    def turns(self) -> bool:
        """True if macro-elements slide in directions that a solve changes, in space."""
        return self.turn is not None and self.turn.nnz > self.turn.shape[0]

    def full(self, p: Floats) -> NDArray[np.floating]:
        """Return the pressures and tractions (m,) for the unknowns (m,) of the system."""
        return p if self.combine is None else self.combine @ p + self.offset

    def reduced(self, p: Floats) -> NDArray[np.floating]:
        """Return the unknowns (m,) of the system, of which the active ones count, for pressures and tractions (m,)."""
        return p if self.turn is None else self.turn @ p

    def load(self, f: Floats, B_T: csr_array) -> NDArray[np.floating]:
        """Return forces f (n,) less those that tractions have without pressure; B_T (n, m): all rows, transposed."""
        return f - B_T @ self.offset if self.offset.any() else f


class Slides(NamedTuple):
    """Macro-elements that slide: `normal` rows (k,), `tangential` rows (k, d - 1), `direction` (k, d - 1).

    `bound`, `slope` (k,): b and b' at their pressures `p`; `slip` (k,): |S|.
    """

    normal: Ints
    tangential: Ints
    direction: Floats
    bound: Floats
    slope: Floats
    p: Floats
    slip: Floats

    @classmethod
    def of(cls, shear: ShearRows, rows: RowSet, p: Floats, G: Floats) -> Slides:
        """Return those of a pair in a row set, at pressures and tractions p (m,) and gap integrals G (m,)."""
        states = shear.states(rows)
        at = np.flatnonzero(states.slides)
        b, slope = shear.bounds.at(p[shear.normal])
        slip = np.linalg.norm(shear.vectors(G)[at], axis=1)
        normal = shear.normal.start + at
        return cls(normal, shear.at[at], states.direction[at], b[at], slope[at], p[normal], slip)


def combined(linear: LinearRows, slides: Iterable[Slides], make: Callable[..., Any]) -> LinearRows:
    """Return a system in which macro-elements slide, see above; `make`: makes rows of those before and both matrices.

    `linear`: the system without them.
    """
    some = [one for one in slides if len(one.normal)]
    if not some:
        return linear
    m = len(linear.G)
    S, G, offset = linear.S.copy(), linear.G, np.zeros(m)
    active = mask_of(m, linear.active)
    turned = np.zeros(m, bool)
    parts = []
    for one in some:
        offset[one.tangential] = (one.bound - one.slope * one.p)[:, None] * one.direction
        turned[one.tangential] = True
        parts += list(_turns(one))
        if one.tangential.shape[1] == 2:
            across = one.tangential[:, 1]
            S[across] = np.divide(one.slip, one.bound, out=np.zeros(len(across)), where=one.bound > 0)
            active[across] = one.bound > 0
    kept = np.flatnonzero(~turned)
    turn = sparse((m, m), *parts, (kept, kept, 1.0))
    coupling = [(one.tangential, one.normal[:, None], one.slope[:, None] * one.direction) for one in some]
    combine = csr_array(turn.T + sparse((m, m), *coupling))
    rows = make(linear.rows, combine, turn)
    return LinearRows(rows, np.flatnonzero(active), turn @ G, S, combine, turn, offset)


def _turns(one: Slides) -> Iterator[tuple[Ints, Ints, Floats | float]]:
    """Yield the entries of R: its first row of a macro-element is along the slide, the second across it."""
    rows, d = one.tangential, one.direction
    if rows.shape[1] == 1:
        yield rows[:, 0], rows[:, 0], 1.0
        return
    across = np.stack([-d[:, 1], d[:, 0]], axis=1)
    for k, axis in enumerate((d, across)):
        for j in range(2):
            yield rows[:, k], rows[:, j], axis[:, j]
