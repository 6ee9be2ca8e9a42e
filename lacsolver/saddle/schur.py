"""Solution of a saddle-point problem by the Schur complement, for any active set with one factor of K.

With a factor of K, the pressures are solved for on the Schur complement D K^-1 B^T + S by generalised conjugate
residuals, a short loop of applications of K^-1, and q is updated in the same loop, without a solve of its own. With the
preconditioner of `saddle` the number of applications hardly grows with the mesh: 2 to 5 for a tenth of the residual, 20
to 25 to round-off. With multigrid, where K^-1 is itself iterative, both are solved for in one loop (`coupled`).

For bodies that only contact supports (`stiffness`), pressures are kept in balance with the load along each rigid-body
mode (the coarse projection of FETI, Farhat and Roux), so that the springs that make K definite carry no force, and the
rigid-body motions themselves follow from the gaps. Forces of the geometric stiffness are further unknowns.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.accuracy import backward_error
from lacsolver.linear.krylov import minimise
from lacsolver.linear.vectors import Vectors
from lacsolver.saddle.coupled import solve_coupled
from lacsolver.saddle.saddle import SaddleProblem, SaddleSolution, SchurPreconditioner
from lacsolver.saddle.stiffness import Stiffness
from lacsolver.saddle.tolerances import ROUNDING, LinearTolerance, largest_of_rows

#: largest number of applications without a decrease: residuals stagnate while motions of little resistance are found
_PATIENCE = 40
#: largest number of applications of K^-1 in all
_MOST = 400
#: backward error (`linear.accuracy`) of forces in balance, a few units of round-off, and most corrections to reach it
_BALANCED, _CORRECTIONS = 2e-15, 3
#: backward error of forces on each body: those on a small body are a part of all that round-off hides
_BALANCED_ALONE = 1e-13
#: a cycle that leaves more than this fraction of the residual has reached round-off
_SLOW = 0.5


def solve_saddle(problem: SaddleProblem, q: Floats, p: Floats, tolerance: LinearTolerance) -> SaddleSolution:
    """Solve a saddle-point problem from a start q (n,), p (m,), of which the pressures of active rows count."""
    if problem.K.iterative:
        return solve_coupled(problem, q, p, tolerance)
    loop = _SchurLoop(problem, q)
    now = loop.balanced_near(q, p, np.zeros(len(loop.bent)))
    loose, applications = tolerance.reduction * _relative(now.r, loop.unit) * loop.unit, now.applications
    while applications < _MOST:
        allowed = np.maximum(loose, loop.threshold(now, tolerance))
        left = _relative(now.r, allowed)
        if left <= 1:
            break
        then, count = loop.improved(now, allowed, _MOST - applications)
        applications += count + then.applications
        before, left = (loop.vectors.norm(one.r / loop.unit) for one in (now, then))
        now = then if left < before else now
        if not left < _SLOW * before:
            break
    return SaddleSolution(now.q, now.p, applications, _relative(now.r[: loop.n], loop.rows.w[loop.active]))


class _Balanced(NamedTuple):
    """An iterate in balance: unknowns q (n,), pressures p (m,), forces s of `bent`; residual r of gaps and of s.

    `force`: largest force of loads and contact on the body of each unknown; `applications`: number of solves with K
    for the balance.
    """

    q: NDArray[np.floating]
    p: NDArray[np.floating]
    s: NDArray[np.floating]
    r: NDArray[np.floating]
    force: Floats | float
    applications: int


def _relative(r: Floats, allowed: Floats) -> float:
    """Return the largest residual relative to `allowed`; relative to its unit it is a length."""
    return float((np.abs(r) / allowed).max(initial=0.0))


def in_balance(
    K: Stiffness, f: Floats, terms: Floats, q: Floats, most: int = _CORRECTIONS
) -> tuple[NDArray[np.floating], int]:
    """Correct q until K q = f to round-off, at most so many times; return q and the number of solves.

    terms (n,): sums of the magnitudes of the terms of f. A q that is in balance is left unchanged: another solve would
    add noise, which soft bodies turn into gaps.
    """
    if not f.any():  # no load: the rest of q is noise of earlier loads, without a scale to compare it with
        return K.R @ (K.R.T @ q), 0
    scale = 1 / np.sqrt(np.abs(K.scaling))
    for count in range(most):
        r = f - K.apply(q)
        if _is_balanced(K.vectors, scale, q, r, terms):
            return q, count
        q = q + K.solve(r)
    return q, most


def _is_balanced(vectors: Vectors, scale: Floats, q: Floats, r: Floats, terms: Floats) -> bool:
    """True if K q = f to round-off, in all and on each body; `scale` (n,): D^-1/2, see `linear.accuracy`."""
    if backward_error(scale, q, r, terms) > _BALANCED:
        return False
    size = vectors.norm_of_body(q / scale) + vectors.norm_of_body(terms * scale)
    left = vectors.norm_of_body(r * scale)
    return bool(np.all(left <= _BALANCED_ALONE * np.maximum(size, ROUNDING * np.max(size))))


class _SchurLoop:
    """The Schur complement of one problem. Residuals are gaps of the active rows, then forces of the unknowns `bent`.

    `bent`: the unknowns that the geometric stiffness acts on. A direction of the Krylov loop is a change of q, then one
    of the active pressures and of the forces of `bent`.
    """

    def __init__(self, problem: SaddleProblem, start: Floats) -> None:
        K, rows, active, geometric = cast(Stiffness, problem.K), problem.rows, problem.active, problem.geometric
        self.problem, self.K, self.rows, self.active, self.start = problem, K, rows, active, start
        self.vectors, self.f = K.vectors, problem.f - problem.geometric_forces(start)
        self.S, self.G, self.n = problem.S, problem.G[active], len(active)
        self.bent: Ints = np.empty(0, np.int64) if geometric is None else np.flatnonzero(np.diff(geometric.indptr))
        self.C = csr_array((0, len(start))) if geometric is None else geometric[self.bent]
        self.preconditioner = SchurPreconditioner(problem)
        self.D = self.preconditioner.D
        size = np.broadcast_to(K.vectors.size, start.shape)
        stiff = np.abs(K.scaling * size)[self.bent] if len(self.bent) else np.empty(0)
        # residuals divided by it are lengths, relative to the size of the bodies
        moved = largest_of_rows(rows.B[active], K.vectors.size)
        self.unit = np.concatenate([rows.w[active] * np.where(moved > 0, moved, 1.0), stiff])
        self.QB = self.preconditioner.QB
        self.QD = np.concatenate([self.preconditioner.QD, self.C @ K.R])

    def scattered(self, s: Floats) -> NDArray[np.floating]:
        """Return forces s of `bent` on all unknowns, (n,)."""
        out = np.zeros(len(self.start))
        out[self.bent] = s
        return out

    def carrying(self, p: Floats, f: Floats) -> NDArray[np.floating]:
        """Return pressures, 0 on inactive rows, that balance the load along modes that the active rows constrain."""
        out = self.on_rows(p[self.active])
        out[self.active] += self.preconditioner.balancing(self.K.R.T @ (f - self.rows.B_T @ out))
        return out

    def precondition(self, r: Floats) -> NDArray[np.floating]:
        """Return a direction for a residual, in balance along the rigid-body modes."""
        s = (r * self.unit)[self.n :]
        z = self.preconditioner.pressures((r * self.unit)[: self.n])
        moment = self.QB.T @ z + self.K.R[self.bent].T @ s
        z = z - self.preconditioner.balancing(moment)
        y = self.K.solve(self.rows.B_T @ self.on_rows(z) + self.scattered(s))
        return np.concatenate([y, z, s])

    def on_rows(self, p: Floats) -> NDArray[np.floating]:
        """Return pressures of the active rows on all rows, (m,)."""
        out = np.zeros(self.rows.B.shape[0])
        out[self.active] = p
        return out

    def image(self, z: Floats) -> NDArray[np.floating]:
        """Return the change of the residual, as lengths, by a direction."""
        y, p, s = np.split(z, [len(self.start), len(self.start) + self.n])
        return self.project(np.concatenate([self.D @ y + self.S * p, self.C @ y + s])) / self.unit

    def project(self, r: Floats) -> NDArray[np.floating]:
        """Return the part of a residual that remains after the best rigid-body motion."""
        return np.asarray(r - self.QD @ self.motion(r))

    def motion(self, r: Floats) -> NDArray[np.floating]:
        """Return the amplitudes (r,) of the rigid-body modes that best close the gaps of a residual."""
        return self.preconditioner.motion(r[: self.n])

    def residual(self, q: Floats, p: Floats, s: Floats) -> NDArray[np.floating]:
        """Return the residual of gaps, and the difference between the forces of `bent` and s."""
        gaps = self.D @ q - self.S * p[self.active] - self.G
        return np.concatenate([gaps, self.C @ (q - self.start) - s])

    def balanced_near(self, q: Floats, p: Floats, s: Floats) -> _Balanced:
        """Return an iterate near q in balance with p and s, with the rigid-body motion that best closes the gaps."""
        p = self.carrying(p, self.f - self.scattered(s))
        contact, bending = self.rows.B_T @ p, self.scattered(s)
        terms = np.abs(self.f) + abs(self.rows.B_T) @ np.abs(p) + np.abs(bending)
        q, count = in_balance(self.K, self.f - contact - bending, terms, q)
        if self.K.R.shape[1]:
            q = q - self.K.R @ self.motion(self.residual(q, p, s))
        force = np.maximum(self.vectors.largest_of_body(self.problem.f), self.vectors.largest_of_body(contact))
        return _Balanced(q, p, s, self.residual(q, p, s), force, count)

    def threshold(self, now: _Balanced, tolerance: LinearTolerance) -> NDArray[np.floating]:
        """Return the tolerance of each residual: for gaps a length times the measure, for forces a part of `force`."""
        forces = np.broadcast_to(np.maximum(tolerance.relative * now.force, 1e-300), now.q.shape)[self.bent]
        gap = np.maximum(tolerance.at(self.active).threshold(self._moved(now.q)), 1e-300)
        return np.concatenate([gap * self.rows.w[self.active], forces])

    def _moved(self, q: Floats) -> Floats | float:
        """Return the largest displacement of the bodies of each active row, (a,); a number if all are one body."""
        return largest_of_rows(self.rows.B[self.active], self.vectors.largest_of_body(q))

    def improved(self, now: _Balanced, allowed: Floats, limit: int) -> tuple[_Balanced, int]:
        """Return a better iterate, in balance, and the number of directions that it took.

        The loop ends when the residual is at most `allowed`, or when it no longer falls.
        """
        start, ends = self.project(now.r) / self.unit, allowed / self.unit
        x, _, count = minimise(self, start, lambda r: _relative(r, ends), limit, patience=_PATIENCE)
        dq, dp, ds = np.split(x, [len(now.q), len(now.q) + self.n]) if len(x) else (0.0, 0.0, 0.0)
        p = now.p.copy()
        p[self.active] += dp
        return self.balanced_near(now.q - dq, p, now.s + ds), count
