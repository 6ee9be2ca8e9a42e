"""Start of a step of a linear problem from columns of the Schur complement that are kept while a factor serves.

    B q = h - C p,    h = B K^-1 f,    C = B K^-1 B^T

With K and B the same in every step, a column of C is found when its row closes for the first time, by one application
of K^-1, and kept. The active set of a later step is then found on the rows alone, and a step takes two applications:
one for h, from the start that the step has anyway, and one for q. The loop of `active_set` starts from there and checks
the result by its own tolerances, so that kept columns cannot change what is found.

For bodies that only contact supports, p balances the loads along the rigid-body modes R, and q has their amplitudes a:

    [C_AA + S_A  -B_A R] [p_A]   [h_A - G_A]
    [R^T B_A^T      0  ] [ a ] = [  R^T f  ]

What is done in a step depends on its start and on the case, not on the columns that are there: a run that is continued
goes on to the last bit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, lu_factor, lu_solve
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.contact.laws import Bools
from lacsolver.equilibrium.active_set import Pivots, close_rows_against_rigid_modes
from lacsolver.equilibrium.state import Iterate
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.row_group import Rows
from lacsolver.saddle.row_set import RowSet
from lacsolver.saddle.saddle import REGULAR
from lacsolver.saddle.schur import in_balance
from lacsolver.saddle.stiffness import Stiffness
from lacsolver.saddle.tolerances import ConvergenceTolerance

#: applications of K^-1 that columns save in a step, about: a case has so many columns at most for each of its steps
SAVED = 10
#: largest memory of the columns, in bytes
_MEMORY = 2**27
#: most active sets that are tried on the rows
_SETS = 50


class KeptColumns:
    """Columns of C (m, m) for a stiffness and rows B (m, n); `most`: largest number of closed rows that they serve.

    `stored`: largest number of columns that are kept.
    """

    def __init__(self, K: Stiffness, rows: Rows, most: int) -> None:
        m = len(rows.w)
        self.K, self.rows, self.stored = K, rows, _MEMORY // (8 * max(m, 1))
        self.most = min(most, self.stored)
        self.BR = np.asarray(rows.B @ K.R)
        self._values = np.empty((0, m))
        self._at = np.full(m, -1)
        self._last: tuple[bytes, _Solved] | None = None

    def serve(self, K: Operator, rows: Rows) -> bool:
        """True for the same stiffness, and rows of the same entries."""
        return K is self.K and same_entries(rows.B, self.rows.B)

    def columns(self, rows: Ints) -> NDArray[np.floating]:
        """Return columns of C (m, a), as they are kept or by one application of K^-1 each.

        Each is found alone, so that its bits do not depend on the others.
        """
        new = rows[self._at[rows] < 0]
        if len(self._values) + len(new) > self.stored:  # those of rows that are open now are dropped
            self._values, new = self._values[:0], rows
            self._at[:] = -1
        if len(new):
            B = self.rows.B
            columns = [B @ self.K.solve(B[[row]].toarray().ravel()) for row in new]
            self._at[new] = len(self._values) + np.arange(len(new))
            self._values = np.concatenate([self._values, columns])
        return self._values[self._at[rows]].T

    def solved(self, active: Bools, S: Floats) -> _Solved:
        """Return the solution of the rows of an active set (m,) with compliances S (a,); the last is kept."""
        key = active.tobytes() + S.tobytes()
        if self._last is None or self._last[0] != key:
            at = np.flatnonzero(active)
            self._last = key, _Solved.of(self.columns(at), at, S, self.BR)
        return self._last[1]


class _Solved(NamedTuple):
    """Columns of C (m, a) at the rows `at` (a,) of an active set, B R (m, r), and the factor of their matrix."""

    C: NDArray[np.floating]
    at: Ints
    BR: NDArray[np.floating]
    factor: tuple[NDArray[np.floating], NDArray[np.integer]]

    @staticmethod
    def of(C: Floats, at: Ints, S: Floats, BR: Floats) -> _Solved:
        """Factorise. Raises LinAlgError if the rows do not constrain all rigid-body modes."""
        own, r = C[at], BR.shape[1]
        own = (own + own.T) / 2 + np.diag(REGULAR * np.abs(own.diagonal()) + S)
        matrix = np.block([[own, -BR[at]], [BR[at].T, np.zeros((r, r))]])
        if r and np.linalg.matrix_rank(BR[at]) < r:
            raise LinAlgError("rigid-body modes without a row")
        return _Solved(np.asarray(C), at, np.asarray(BR), lu_factor(matrix) if len(matrix) else (matrix, at))

    def pressures(self, gap: Floats, load: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return the pressures (m,) for gaps (m,) to be opened and loads (r,), and the amplitudes (r,) of the modes."""
        p, right = np.zeros(len(gap)), np.concatenate([gap[self.at], load])
        x = lu_solve(self.factor, right) if len(right) else right
        p[self.at] = x[: len(self.at)]
        return p, x[len(self.at) :]

    def closing(self, p: Floats, a: Floats) -> NDArray[np.floating]:
        """Return the change -C p + B R a (m,) of B q."""
        return np.asarray(self.BR @ a - self.C @ p[self.at])


def start_from_columns(
    kept: KeptColumns, f: Floats, contact: ContactSystem, start: Iterate, tolerance: ConvergenceTolerance
) -> Iterate:
    """Return the solution of K q = f - B^T p with contact, from columns of the Schur complement.

    `contact`: the system at `start`. The start itself is returned where it is the solution, and where columns do not
    serve: with friction, with too many closed rows, or for bodies that the rows that are found do not hold.
    """
    K, rows = kept.K, kept.rows
    active = contact.start_active(start.active)
    p = np.where(active, start.p, 0.0)
    if contact.sheared or active.sum() > kept.most:
        return start
    base, count = in_balance(K, f - rows.B_T @ p, np.abs(f) + abs(rows.B_T) @ np.abs(p), start.q, most=1)
    contact = contact.with_gaps(contact.G - rows.B @ (base - start.q))
    if not count and _fulfilled(contact, active, p, start.q, tolerance):
        return start
    try:
        solution = _closed_rows(kept, f, contact, (p, active), tolerance.threshold(base))
    except LinAlgError:
        solution = None
    if solution is None:
        return start
    then, a, active = solution
    change = rows.B_T @ (then - p)
    q = base - K.solve(change) if change.any() else base
    return Iterate(q + K.R @ a, then, active)


def _fulfilled(contact: ContactSystem, active: Bools, p: Floats, q: Floats, tolerance: ConvergenceTolerance) -> bool:
    """True if the laws are fulfilled by pressures in balance with q."""
    return bool(np.abs(contact.residuals(p, active)).max(initial=0.0) <= tolerance.threshold(q))


def _closed_rows(
    kept: KeptColumns, f: Floats, contact: ContactSystem, start: tuple[Floats, Bools], threshold: float
) -> tuple[Floats, Floats, Bools] | None:
    """Return pressures (m,), amplitudes (r,) and the active set (m,); None if it has too many rows, or takes springs.

    `contact`: the system at the displacements that are in balance with the pressures of `start`.
    """
    p, rows = start[0], RowSet.of(start[1])
    R, pivots = kept.K.R, Pivots(contact)
    before = np.flatnonzero(p)
    gap = contact.G - kept.columns(before) @ p[before]  # without pressures
    a: Floats = np.zeros(R.shape[1])
    load = R.T @ f
    for _ in range(_SETS):
        rows = close_rows_against_rigid_modes(R, contact, rows, p, load)
        active = rows.active
        if active.sum() > kept.most:
            return None
        G, S = contact.equations(p, active)
        solved = kept.solved(active, S[active])
        p, a = solved.pressures(contact.G - G - gap, load)
        contact = contact.with_gaps(gap - solved.closing(p, a))
        wanted = contact.next_rows(rows, p, threshold)
        if wanted.equals(rows) and np.abs(contact.residuals(p, active)).max(initial=0.0) <= threshold:
            break
        following = pivots.next(rows, wanted, True, p, np.inf)
        if following is None or pivots.springs:
            return None
        rows = following
    return p, a, active


def same_entries(A: csr_array, B: csr_array) -> bool:
    """True for matrices of the same entries in the same order."""
    return A is B or (
        A.shape == B.shape
        and np.array_equal(A.indptr, B.indptr)
        and np.array_equal(A.indices, B.indices)
        and np.array_equal(A.data, B.data)
    )
