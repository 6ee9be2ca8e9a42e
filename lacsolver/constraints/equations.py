"""Linear equations C u + E s = g(t) between displacements u and further unknowns s, which are eliminated.

Prescribed displacements and rigid bodies come first: u = T x + u0(t), with the nodes' own unknowns and the free motions
of rigid bodies in x, and then the further unknowns s of the equations. So A x = h(t), with A = [C T, E] and h = g - C
u0. One unknown of each equation is expressed by the others,

    x = Z q + Y h(t),        A_d Y_d = 1,  Z_d = -A_d^-1 A_i        d: eliminated, i: kept, x_i = q

which keeps the stiffness Z^T K Z sparse as long as an equation has few terms; one that has many is better a row of its
own (`equality_rows`). An equation that follows from those before it is left out: it carries no force. The forces lambda
of the equations act on the bodies by C^T lambda, and on s by E^T lambda.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, hstack, vstack
from scipy.sparse.linalg import SuperLU, splu

from lacmesh.mesh import Floats, Ints
from lacsolver.case.errors import CaseError, Issue
from lacsolver.constraints.equality_rows import lengths
from lacsolver.space.sparse import joined_columns, sparse

#: a coefficient below this part of the largest of its equation is not divided by, as long as there is a choice
_SMALL = 0.1
#: an equation that differs from others by less than this part of itself follows from them
_SAME = 1e-10
#: coefficients below this part of the largest are round-off
_NOTHING = 1e-14
#: an equation of which prescribed displacements leave less than this part follows from them: that much turns the axes
#: that coordinates in single precision give, as those of many decks
_PRESCRIBED = 1e-7
#: round-off allowed in an equation between unknowns that are all prescribed
_ROUNDING = 1e-9
#: columns that are solved for at once
_COLUMNS = 256
#: equations that are named in one message
_NAMED = 3
#: most coefficients of equations that share their unknowns so widely that none can be eliminated by itself
_WIDE = 50_000_000


@dataclass(frozen=True, eq=False)
class Equations:
    """Equations C u + E s = g(t) of one record of a case, under the `name` of their forces in the results.

    `C` (k, n_dof); `values(t)`: returns g (k,). `E` (k, n_s): coefficients of n_s further unknowns, which are lengths,
    None without any; `loads(t)`: returns the forces (n_s,) on these. `said(i)`: equation i in words, with its line, for
    a message that begins with it. `may_follow`: True where it is no mistake that one follows from others.
    `support`: name of the reaction that their forces are a part of, "" for none.
    """

    name: str
    C: csr_array
    values: Callable[[float], Floats]
    said: Callable[[int], str]
    E: csr_array | None = None
    loads: Callable[[float], Floats] | None = None
    may_follow: bool = False
    support: str = ""

    def on(self, unknowns: Ints) -> Equations:
        """Return the equations on some of the unknowns (k,), among which are all that they have."""
        return replace(self, C=csr_array(self.C[:, unknowns]))

    @property
    def n_further(self) -> int:
        """Number of further unknowns."""
        return 0 if self.E is None else self.E.shape[1]

    def load(self, t: float) -> NDArray[np.floating]:
        """Return the forces (n_s,) on the further unknowns at time t."""
        return np.zeros(self.n_further) if self.loads is None else np.asarray(self.loads(t), float)


@dataclass(frozen=True, eq=False)
class EquationSystem:
    """All equations of a model, A x = h, and the unknowns that they eliminate; built by `EquationSystem.of`.

    `A` (k, n_x). `rows`, `columns` (r,): independent equations, and the unknown that each of them eliminates; `kept`
    (n_q,): the other unknowns. `Z` (n_x, n_q): x for q, without h.
    """

    A: csr_array
    rows: Ints
    columns: Ints
    kept: Ints
    Z: csr_array

    @classmethod
    def of(cls, A: csr_array, n_nodal: int) -> EquationSystem:
        """Choose the unknowns to eliminate, of the first `n_nodal` where possible. Raises CaseError for too many."""
        A = _without_round_off(A)
        rows, columns = _pivots(A, n_nodal)
        kept = np.setdiff1d(np.arange(A.shape[1]), columns)
        return cls(A, rows, columns, kept, _expression(A, rows, columns, kept))

    @cached_property
    def _factor(self) -> SuperLU:
        return splu(csc_array(self.A[self.rows][:, self.columns]))

    def offset(self, h: Floats) -> NDArray[np.floating]:
        """Return Y h (n_x,), the unknowns x at q = 0."""
        x = np.zeros(self.A.shape[1])
        if len(self.rows):
            x[self.columns] = self._factor.solve(h[self.rows])
        return x

    def forces(self, r: Floats) -> NDArray[np.floating]:
        """Return the forces lambda (k,) with A^T lambda = r (n_x,); 0 for equations that follow from others."""
        out = np.zeros(self.A.shape[0])
        if len(self.rows):
            out[self.rows] = self._factor.solve(r[self.columns], "T")
        return out

    @property
    def following(self) -> Ints:
        """Equations that follow from others, or contradict them."""
        return np.setdiff1d(np.arange(self.A.shape[0]), self.rows)


def stacked(equations: tuple[Equations, ...], T: csr_array) -> csr_array:
    """Return A = [C T, E] (k, n_x) of all equations, each with columns for its further unknowns after those of T.

    An equation of which prescribed displacements and rigid bodies leave round-off alone has no coefficients.
    """
    C = csr_array(vstack([one.C for one in equations]))
    parts, n, first = [], sum(one.n_further for one in equations), 0
    for one in equations:
        E = coo_array((one.C.shape[0], 0)) if one.E is None else one.E.tocoo()
        parts.append(coo_array((E.data, (E.row, E.col + first)), shape=(one.C.shape[0], n)))
        first += one.n_further
    A = csr_array(hstack([C @ T, vstack(parts)]))
    given = csr_array(hstack([C, vstack(parts)]))
    left = lengths(A) > _PRESCRIBED * lengths(given)
    return csr_array(diags_array(left.astype(float)) @ A)


def contradiction(
    equations: tuple[Equations, ...], system: EquationSystem, h: Floats, t: float, terms: Floats
) -> CaseError | None:
    """Return the error for values h (k,) at time t that no displacements fulfil; None if there is none.

    `terms` (k,): sums of the magnitudes of what h consists of, for its round-off.
    """
    x = system.offset(h)
    off = np.abs(system.A @ x - h)
    size = terms + np.asarray(abs(system.A) @ np.abs(x)).ravel()
    bad = np.flatnonzero(off > _ROUNDING * np.maximum(size, size.max(initial=0.0) * 1e-3))
    if not len(bad):
        return None
    i = int(bad[0])
    message = f"{words_of(equations, i)} contradicts {_partners(equations, system, i)}: it is off by {off[i]:.6g}"
    return CaseError([Issue(f"{message} at t = {t:g}; leave one out, or make them agree")])


def words_of(equations: tuple[Equations, ...], i: int) -> str:
    """Return equation i of all in words."""
    ends = np.cumsum([one.C.shape[0] for one in equations])
    k = int(np.searchsorted(ends, i, side="right"))
    return equations[k].said(i - int(ends[k] - equations[k].C.shape[0]))


def _partners(equations: tuple[Equations, ...], system: EquationSystem, i: int) -> str:
    """Return in words what equation i contradicts or follows from."""
    row = system.A[[i]]
    if not row.nnz:
        return "what its terms are prescribed to"
    part = np.zeros(len(system.rows))
    part[:] = system.forces(row.toarray().ravel())[system.rows]
    others = system.rows[np.abs(part) > _SAME * np.abs(part).max(initial=0.0)]
    words = list(dict.fromkeys(words_of(equations, int(k)) for k in others))
    return " and ".join(words[:_NAMED]) + (" and others" if len(words) > _NAMED else "")


def following(equations: tuple[Equations, ...], system: EquationSystem) -> str:
    """Return a sentence about equations that follow from others, and should not; "" if there are none."""
    mistaken = np.repeat([not one.may_follow for one in equations], [one.C.shape[0] for one in equations])
    rows = [int(i) for i in system.following if mistaken[i]]
    if not rows:
        return ""
    parts = [f"{words_of(equations, i)} follows from {_partners(equations, system, i)}" for i in rows[:_NAMED]]
    more = f" and {len(rows) - _NAMED} more follow from others" if len(rows) > _NAMED else ""
    return f"{', '.join(parts)}{more}: such equations carry no force"


def _without_round_off(A: csr_array) -> csr_array:
    A = csr_array(A)
    A.sum_duplicates()
    largest = abs(A).max(axis=1).toarray().ravel() if A.nnz else np.zeros(A.shape[0])
    row = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
    A.data[np.abs(A.data) <= _NOTHING * largest[row]] = 0.0
    A.eliminate_zeros()
    return A


def _pivots(A: csr_array, n_nodal: int) -> tuple[Ints, Ints]:
    """Return independent rows of A, and a column for each, such that the square matrix of both is regular.

    Columns that only one of the remaining rows has are taken first, round after round; what is left is solved densely,
    for each set of rows that share columns.
    """
    coo = A.tocoo()
    row, column, size = coo.row.astype(np.int64), coo.col.astype(np.int64), np.abs(coo.data)
    largest = np.zeros(A.shape[0])
    np.maximum.at(largest, row, size)
    rank = np.where(column < n_nodal, size / largest[row], 0.0)  # motions and further unknowns only where needed
    left = np.ones(A.shape[0], bool)
    rows: list[Ints] = [np.empty(0, np.int64)]
    columns: list[Ints] = [np.empty(0, np.int64)]
    while len(row):
        alone = (np.bincount(column, minlength=A.shape[1])[column] == 1) & (rank >= _SMALL)
        if not alone.any():
            break
        at = np.flatnonzero(alone)
        at = at[np.lexsort((column[at], -rank[at], row[at]))]
        at = at[np.unique(row[at], return_index=True)[1]]
        rows.append(row[at])
        columns.append(column[at])
        left[row[at]] = False
        on = left[row]
        row, column, size, rank = row[on], column[on], size[on], rank[on]
    for some in _connected(A, np.flatnonzero(left)):
        own = _dense_pivots(A, some, n_nodal)
        rows.append(own[0])
        columns.append(own[1])
    return np.concatenate(rows), np.concatenate(columns)


def _connected(A: csr_array, rows: Ints) -> list[Ints]:
    """Return sets of rows that share columns; rows without an entry are left out."""
    rows = rows[np.diff(A.indptr)[rows] > 0]
    if not len(rows):
        return []
    label = joined_columns(csr_array(A[rows].T))
    return [rows[label == k] for k in range(label.max() + 1)]


def _dense_pivots(A: csr_array, rows: Ints, n_nodal: int) -> tuple[Ints, Ints]:
    """Return independent ones of some rows, the earlier ones first, and a column for each."""
    own = csr_array(A[rows])
    used = np.unique(own.indices)
    if len(rows) * len(used) > _WIDE:
        message = f"{len(rows)} equations share their {len(used)} unknowns so widely that they cannot be eliminated"
        raise CaseError([Issue(f"{message}; write them with fewer terms, or take a [[coupling]] or [[rigid]]")])
    M = own[:, used].toarray()
    M /= np.linalg.norm(M, axis=1)[:, None]
    R = qr(M.T, mode="r")[0]
    independent: Ints = np.arange(len(rows))
    if len(used) < len(rows) or (np.abs(R.diagonal()) < _SAME).any():
        independent = _independent(M)
    weight = np.where(used < n_nodal, 1.0, 1e-3)
    order = qr(M[independent] * weight, mode="r", pivoting=True)[1]
    return rows[independent], used[order[: len(independent)]]


def _independent(M: Floats) -> Ints:
    """Return the rows of M (m, c), of size 1, that do not follow from those before, by Gram-Schmidt."""
    basis, out = np.zeros((0, M.shape[1])), []
    for i, row in enumerate(M):
        rest = row - (row @ basis.T) @ basis
        rest = rest - (rest @ basis.T) @ basis
        size = np.linalg.norm(rest)
        if size > _SAME:
            basis = np.concatenate([basis, rest[None] / size])
            out.append(i)
    return np.array(out, np.int64)


def _expression(A: csr_array, rows: Ints, columns: Ints, kept: Ints) -> csr_array:
    """Return Z (n_x, n_q): the identity at unknowns that are kept, and -A_d^-1 A_i at the eliminated ones."""
    n_q, own = len(kept), A[rows]
    A_d, A_i = csr_array(own[:, columns]), csc_array(own[:, kept])
    if A_d.nnz == len(rows) and A_d.diagonal().all():
        Z_d = csr_array(diags_array(-1 / A_d.diagonal()) @ A_i)
    else:
        Z_d = _solved(csc_array(A_d), A_i)
    Z_d = _without_round_off(Z_d).tocoo()
    return sparse((A.shape[1], n_q), (kept, np.arange(n_q), 1.0), (columns[Z_d.row], Z_d.col, Z_d.data))


def _solved(A_d: csc_array, A_i: csc_array) -> csr_array:
    """Return -A_d^-1 A_i, whose columns are solved for by the dozen, as they are few or sparse."""
    used, factor = np.flatnonzero(np.diff(A_i.indptr)), splu(A_d)
    parts = []
    for first in range(0, len(used), _COLUMNS):
        some = used[first : first + _COLUMNS]
        values = factor.solve(A_i[:, some].toarray())
        row, column = np.nonzero(np.abs(values) > _NOTHING * np.abs(values).max(initial=0.0))
        parts.append((row, some[column], -values[row, column]))
    return sparse(A_i.shape, *parts) if parts else csr_array(A_i.shape)
