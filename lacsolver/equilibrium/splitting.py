"""Contact with friction on the contact rows alone, by operator splitting: for row sets that pivoting does not find.

    G(p) = G_0 + W p - D R a,    W = D K^-1 B^T,    R^T B^T p = R^T f        p: pressures and tractions (m,)

are the gaps and slips of bodies in balance, an affine monotone map; a projection P takes p to what contact and friction
allow. The iteration of Douglas and Rachford solves the one and applies the other in turn,

    p = P(z),    (W + S + M) y - D R a = M (2 p - z) - G_0,  R^T B^T y = R^T f,    z <- z + y - p

with M = rho diag W, in which no constant has units, and rho such that y - p and M dp become alike. While the bounds of
friction stay it converges from any start (Lions and Mercier 1979); those of Coulomb follow p. It finds the row set of
the solution in some tens of iterations, long before p itself. So the set that P keeps is solved now and then as a
system, and the search ends where the laws ask for the same set.

Rows that were in no set take part once they overlap. Each row costs one application of K^-1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, lu_factor, lu_solve

from lacmesh.mesh import Floats, Ints
from lacsolver.contact.laws import Bools
from lacsolver.equilibrium.carrying import carries
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.row_set import RowSet
from lacsolver.saddle.saddle import REGULAR
from lacsolver.saddle.stiffness import Stiffness

#: largest memory of W, in bytes
_MEMORY = 2**27
#: iterations from one solve of a set to the next, most such solves, and exchanges of rows after each
_SWEEPS, _SOLVES, _EXCHANGES = 20, 10, 4
#: residual of the laws, relative to the largest gap that pressures open, below which a set is that of the solution
_MET = 1e-9
#: factor by which forces grow in an iteration that diverges, as it does on faces that have turned over
_DIVERGES = 1e6
#: largest change of rho at a time, and change of a compliance from problem to problem
_STEP = 5.0
#: its change after a problem that is not solved, most of those in a row, and its least value, in parts of W
_HARDER, _FAILURES, _LEAST = 4.0, 3, 1e-12


def split(
    K: Operator, f: Floats, contact: ContactSystem, free: Floats, rows: Bools
) -> tuple[NDArray[np.floating], RowSet] | None:
    """Return the pressures and tractions (m,) and the row set of K q + B^T p = f with contact and friction.

    `contact`: the system at q = 0; `free` (n, r): motions that only contact resists; `rows` (m,): rows of some sets
    that were tried. None where the iteration does not end, with too many rows, and where K has no factor.
    """
    if not isinstance(K, Stiffness) or K.iterative or not carries(contact, free.T, free.T @ f):
        return None
    whole, at = _Condensed.of(K, f, contact, free), rows
    while True:
        at = contact.of_macro_elements(at)
        if 8 * at.sum() * len(at) > _MEMORY:
            return None
        whole = whole.with_columns(K, np.flatnonzero(at))
        found = _found(whole)
        if found is None or not (more := found.overlapping & ~at).any():
            return None if found is None else (found.p, found.rows)
        at = at | more


def _found(problem: _Condensed) -> _State | None:
    """Return the solution by the iteration alone, or else by those of problems with compliance, one after the other.

    The compliance acts on what the pressures differ from those of the problem before (the proximal point method). It
    becomes smaller from problem to problem, and larger where one is not solved.
    """
    z: Floats = np.zeros(len(problem.DR))
    found, part, failed = _Splitting(problem, z).found(), 1.0, 0
    while found is None and failed < _FAILURES and part > _LEAST:
        now = _Splitting(problem.softened(part * problem.metric, z), z).found()
        if now is None:
            part, failed = part * _HARDER, failed + 1
            continue
        z, part, failed = now.p, part / _STEP, 0
        found = problem.exchanged(problem.state(now.p, now.a, now.rows), now.rows, set())
    return found


class _State(NamedTuple):
    """Pressures and tractions p (m,) with amplitudes a (r,) of the motions, a row set, and the contact system there."""

    p: NDArray[np.floating]
    a: NDArray[np.floating]
    rows: RowSet
    contact: ContactSystem

    @property
    def overlapping(self) -> Bools:
        """True for rows (m,) that the laws close."""
        return self.contact.next_active(self.rows.active, self.p)


class _Condensed(NamedTuple):
    """A problem on its rows: the `contact` system under loads without pressures; D R and B R (m, r); `load` R^T f.

    `W` (m, n): the columns of the rows `at` (n,).
    """

    contact: ContactSystem
    DR: NDArray[np.floating]
    BR: NDArray[np.floating]
    load: NDArray[np.floating]
    W: NDArray[np.floating]
    at: Ints

    @staticmethod
    def of(K: Stiffness, f: Floats, contact: ContactSystem, free: Floats) -> _Condensed:
        """Return the problem without columns."""
        D, m = contact.rows.D, len(contact.G)
        there = contact.with_gaps(contact.G - D @ K.solve(f))
        none: Ints = np.empty(0, np.int64)
        return _Condensed(there, D @ free, contact.rows.B @ free, free.T @ f, np.empty((m, 0)), none)

    def with_columns(self, K: Stiffness, at: Ints) -> _Condensed:
        """Return it with the columns of these rows, which those before are a part of."""
        B, D, W = self.contact.rows.B, self.contact.rows.D, np.empty((len(self.DR), len(at)))
        known = np.searchsorted(at, self.at)
        W[:, known] = self.W
        for k in np.setdiff1d(np.arange(len(at)), known):
            W[:, k] = D @ K.solve(B[[at[k]]].toarray().ravel())
        return self._replace(W=W, at=at)

    def state(self, p: Floats, a: Floats, rows: RowSet) -> _State:
        """Return the state with pressures and tractions p (m,) and amplitudes a (r,)."""
        gaps = self.contact.G + self.W @ p[self.at] - self.DR @ a
        return _State(p, a, rows, self.contact.with_gaps(gaps))

    def solved(self, now: _State, rows: RowSet) -> _State:
        """Return the solution with a row set, linearised at a state. Raises LinAlgError."""
        m, r, at = len(now.p), len(now.a), self.at
        linear = now.contact.linear(rows, now.p)
        eye = np.eye(m)[:, at]
        turn = eye.T if linear.turn is None else linear.turn[at].toarray()
        combine = eye if linear.combine is None else linear.combine[:, at].toarray()
        offset = linear.offset if len(linear.offset) else np.zeros(m)
        active = np.flatnonzero(np.isin(at, linear.active))
        chosen = at[active]
        W, DR = (turn @ self.W @ combine[at])[np.ix_(active, active)], (turn @ self.DR)[active]
        BR = (combine.T @ self.BR)[active]
        if r and np.linalg.matrix_rank(BR) < r:
            raise LinAlgError("rigid-body modes without a row")
        S = linear.S[chosen] + REGULAR * np.abs(W.diagonal())
        G = -linear.G[chosen] + (turn @ (self.W @ (now.p - offset)[at] - self.DR @ now.a))[active]
        matrix = np.block([[W + np.diag(S), -DR], [BR.T, np.zeros((r, r))]])
        x = np.linalg.solve(matrix, np.concatenate([G, self.load - self.BR.T @ offset]))
        p = np.zeros(m)
        p[chosen] = x[: len(chosen)]
        return self.state(linear.full(p), x[len(chosen) :], rows)

    @property
    def metric(self) -> NDArray[np.floating]:
        """Diagonal (m,) of |W| + S, its mean along the tangents of a macro-element; 0 where forces have no bound."""
        m, at = len(self.DR), self.at
        size = np.zeros(m)
        size[at] = np.abs(self.W[at].diagonal()) + self.contact.equations(np.zeros(m), np.ones(m, bool))[1][at]
        return np.where(self.contact.one_sided, self.contact.alike(size), 0.0)

    def softened(self, compliance: Floats, p: Floats) -> _Condensed:
        W = self.W.copy()
        W[self.at, np.arange(len(self.at))] += compliance[self.at]
        return self._replace(W=W, contact=self.contact.with_gaps(self.contact.G - compliance * p))

    def exchanged(self, now: _State, rows: RowSet, tried: set[bytes]) -> _State | None:
        """Return the solution, if some exchanges from a row set on lead to it."""
        for _ in range(_EXCHANGES):
            if not rows.direction.any() and rows.state.tobytes() in tried:
                return None
            tried.add(rows.state.tobytes())
            try:
                now = self.solved(now, rows)
            except LinAlgError:
                return None
            if self.met(now):
                return now
            rows = now.contact.next_rows(rows, now.p, self.allowed(now))
        return None

    def met(self, now: _State) -> bool:
        """True if a state fulfils the laws."""
        left = np.abs(now.contact.residuals(now.p, now.rows.active)[self.at]).max(initial=0.0)
        return bool(left <= self.allowed(now))

    def allowed(self, now: _State) -> float:
        """Return the gap that may remain, a part of the largest one that the state has opened or closed."""
        return _MET * float(np.abs((now.contact.G - self.contact.G) / self.contact.rows.w)[self.at].max(initial=0.0))


class _Splitting:
    """The iteration: `z` (n,), `p` = P(z) of the rows at hand; M (n,), 0 in rows whose forces have no bound."""

    def __init__(self, problem: _Condensed, z: Floats) -> None:
        self.problem, contact, at, m = problem, problem.contact, problem.at, len(problem.DR)
        G, S = contact.equations(np.zeros(m), np.ones(m, bool))
        self.G, self.A = G[at], problem.W[at] + np.diag(S[at])
        self.M = problem.metric[at]
        self.z, self.a = z[at], np.zeros(len(problem.load))
        self._factorise()

    def found(self) -> _State | None:
        """Return the state that fulfils the laws; None if it is not found, or if the iteration diverges."""
        tried: set[bytes] = set()
        most = _DIVERGES * float(np.linalg.norm(self.z)) or np.inf
        for _ in range(_SOLVES):
            with np.errstate(over="ignore", invalid="ignore"):
                self._sweeps()
                if not np.linalg.norm(self.z) < most:
                    return None
            p = self._on_rows(self.projected(self.z))
            rows = self.problem.contact.lawful_rows(self._on_rows(self.z))
            now = self.problem.exchanged(self.problem.state(p, self.a, rows), rows, tried)
            if now is not None:
                return now
        return None

    def _sweeps(self) -> None:
        """Iterate some times, and adapt rho to the last one."""
        p = self.projected(self.z)
        for _ in range(_SWEEPS):
            y = self._balanced(self.M * (2 * p - self.z) - self.G)
            apart = y - p
            self.z = np.where(self.M > 0, self.z + apart, y)
            p, before = self.projected(self.z), p
        size = np.sqrt(self.M)
        off, moved = np.linalg.norm(size * apart), np.linalg.norm(size * (p - before))
        rho = float(np.sqrt(np.clip(off, moved / _STEP**2, moved * _STEP**2) / moved)) if moved > 0 else _STEP
        if max(rho, 1 / rho) > 1.5:
            self.z = np.where(self.M > 0, p + (self.z - p) / rho, self.z)
            self.M = rho * self.M
            self._factorise()

    def _factorise(self) -> None:
        p, at = self.problem, self.problem.at
        r = len(p.load)
        self.factor = lu_factor(np.block([[self.A + np.diag(self.M), -p.DR[at]], [p.BR[at].T, np.zeros((r, r))]]))

    def _balanced(self, right: Floats) -> NDArray[np.floating]:
        x = lu_solve(self.factor, np.concatenate([right, self.problem.load]))
        self.a = x[len(right) :]
        return x[: len(right)]

    def projected(self, z: Floats) -> NDArray[np.floating]:
        """Return P(z)."""
        return self.problem.contact.lawful(self._on_rows(z))[self.problem.at]

    def _on_rows(self, z: Floats) -> NDArray[np.floating]:
        out = np.zeros(len(self.problem.DR))
        out[self.problem.at] = z
        return out
