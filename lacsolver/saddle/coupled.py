"""Solution for displacements and pressures in one Krylov loop, with a multigrid V-cycle in place of K^-1.

Generalised conjugate residuals (`linear.krylov`) on

    [K + C  B_A^T] [dq]   [r_f]
    [D_A    -S_A ] [dp] = [r_G]

preconditioned by a block triangle of the augmented system, in which W times the second row is added to the first:

    dp = -(W + E M) r_G,    dq = V (r_f + B_A^T (W r_G - E dp)),    W = (1 / c + S_A)^-1,  E = 1 - W S_A

V is a V-cycle for K + B_A^T W B_A, with the hierarchy of K (`multigrid.row_term`); M is the stiffness of the skins
(`saddle`), and c, diagonal, a multiple of that of each row alone. The Schur complement of the augmented system has the
inverse W + E M if that of the system itself, B_A K^-1 B_A^T + S_A, has the inverse M. M is right for pressures that
change from row to row, and too stiff for even ones, for which W makes up: together they leave little that depends on
the mesh or on the ratio of both bodies' stiffnesses, and an iteration takes about as many V-cycles as K alone. Only the
preconditioner is augmented. (Augmented systems: Benzi, Golub and Liesen 2005.)

Residuals are weighted so that both parts are energies: forces are divided by the root of K's diagonal, gaps multiplied
by the root of the stiffness of their own row. They follow by recurrence within a restart cycle and are computed anew
after it, so that the last cycle ends at round-off. For a body that only contact supports, its rigid-body modes are
search directions from the start, dp balances the load along them, and the springs that make K definite carry no force.
"""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.linear import LinearError
from lacsolver.linear.krylov import minimise
from lacsolver.linear.regular import indefinite
from lacsolver.linear.vectors import WHOLE
from lacsolver.saddle.saddle import SaddleProblem, SaddleSolution, SchurPreconditioner
from lacsolver.saddle.tolerances import LinearTolerance

#: most directions of a restart cycle, all of which are stored; most iterations in all
_ROUND, _MOST = 40, 400
#: stiffness that is added to K for each row, relative to that of the row's own skin
_AUGMENTED = 2.0
#: reduction of the residual in a cycle, after which it is computed anew
_RECURRED = 1e-9
#: forces are in balance if their residual is below this fraction of the largest
_BALANCED = 3e-14
#: a cycle that leaves more than this fraction of the residual has reached round-off
_SLOW = 0.5
#: relative imbalance of forces that is larger than round-off
_FAILED = 1e-6
#: energies below this, relative to that of the diagonal, are negative
_NEGATIVE = -1e-12


def solve_coupled(problem: SaddleProblem, q: Floats, p: Floats, tolerance: LinearTolerance) -> SaddleSolution:
    """Solve a saddle-point problem by multigrid from a start; an inexact tolerance leaves an imbalance of forces too.

    Raises LinearError if the forces do not reach balance, SingularError if K is found not to be positive definite.
    """
    system = _System(problem)
    K, rows, active, n = problem.K, problem.rows, problem.active, len(problem.f)
    pressures = np.zeros_like(p)
    pressures[active] = p[active]
    load = K.vectors.dots(K.R.T, problem.f - problem.geometric_forces(q) - rows.B_T @ pressures)
    x = np.concatenate([q, K.vectors.same(p[active] + system.preconditioner.balancing(load))])
    r, force = system.residual(x)
    norm = system.vectors.norm
    if norm(system.load) < norm(r) and not K.R.shape[1]:
        x, r, force = np.zeros_like(x), system.load, system.vectors.largest(problem.f)
    first = best = norm(r)
    loose = tolerance.reduction * first
    loose_gaps, count, counted = tolerance.reduction * max(WHOLE.norm(r[n:]), loose), 0, 0
    while count < _MOST:
        gap = float(tolerance.threshold(system.vectors.largest(x[:n])))
        excess = partial(system.excess, gap, _BALANCED * force, (loose, loose_gaps))
        if excess(r) <= 1:
            break
        most, least = min(_ROUND, _MOST - count), _RECURRED * norm(r)
        dx, _, more = minimise(system, r, excess, most, known=system.constrained, least=least)
        count += more
        then = x + dx
        residual, then_force = system.residual(then)
        size = norm(residual)
        if size < best:
            x, r, force = then, residual, then_force
        if not size < _SLOW * best:
            break
        best, counted = size, count
    pressures[active] = x[n:]
    if tolerance.reduction == 0:
        system.check(r, force, count, tolerance)
        K.record_convergence("with rows", counted, first, best)
    return SaddleSolution(x[:n], pressures, count, system.gap(r))


def _ratio(value: float, limit: float) -> float:
    """Return value / limit, for a limit that may be 0."""
    return value / limit if limit > 0 else np.inf if value > 0 else 0.0


class _System:
    """Matrix, preconditioner and weights of a problem. Vectors have the unknowns first, then the pressures."""

    def __init__(self, problem: SaddleProblem) -> None:
        K, rows, active = problem.K, problem.rows, problem.active
        self.problem, self.K, self.n, self.vectors = problem, K, len(problem.f), K.vectors
        self.preconditioner = SchurPreconditioner(problem)
        self.B, self.D, self.w = rows.B[active], rows.D[active], rows.w[active]
        self.G, self.S = problem.G[active], problem.S
        self.B_T = self.B.T.tocsr()
        self.diagonal = self.preconditioner.diagonal
        self.weight = np.concatenate([1 / np.sqrt(self.diagonal), np.sqrt(self.preconditioner.stiffness)])
        soft = self.preconditioner.size / _AUGMENTED + self.S
        self.W = 1 / np.where(soft > 0, soft, 1.0)
        weights = np.zeros(rows.B.shape[0])
        weights[active] = self.W
        augmented = K.cycle_with_rows(rows.B, weights) if len(active) else None
        self.cycle = augmented or K.cycle
        if augmented is None:
            self.W = np.zeros_like(self.W)
        modes, self.unconstrained = K.R @ self.preconditioner.constrained, K.R @ self.preconditioner.free
        #: rigid-body modes that rows constrain, as search directions
        self.constrained = np.concatenate([modes.T, np.zeros((modes.shape[1], len(active)))], axis=1)

    @cached_property
    def load(self) -> NDArray[np.floating]:
        """Weighted right-hand side, the residual at 0."""
        return np.concatenate([self._balanced(self.problem.f), self.G]) * self.weight

    def residual(self, x: Floats) -> tuple[NDArray[np.floating], float]:
        """Return the weighted residual at x, unknowns first, then pressures, and the largest load or internal force."""
        q, p, f, largest = x[: self.n], x[self.n :], self.problem.f, self.vectors.largest
        inner = self.K.apply(q) + self.problem.geometric_forces(q)
        force = self._balanced(f - (inner + self.B_T @ p))
        r = np.concatenate([force, self.G - self.D @ q + self.S * p]) * self.weight
        return r, max(largest(f), largest(inner))

    def _balanced(self, force: Floats) -> NDArray[np.floating]:
        """Return forces without those along rigid-body modes that no row constrains; the springs balance these."""
        free = self.unconstrained
        return force - free @ self.vectors.dots(free.T, force) if free.shape[1] else force

    def image(self, z: Floats) -> NDArray[np.floating]:
        """Return the weighted product of the matrix with a vector. Raises SingularError for a negative energy of K."""
        q, p = z[: self.n], z[self.n :]
        Kq = self.K.apply(q)
        if self.K.definite:
            energy, most = self.vectors.dots(np.stack([Kq, self.diagonal * q]), q)
            if energy < _NEGATIVE * most:
                raise indefinite()
        force = Kq + self.B_T @ p + self.problem.geometric_forces(q)
        return np.concatenate([self._balanced(force), self.D @ q - self.S * p]) * self.weight

    def precondition(self, r: Floats) -> NDArray[np.floating]:
        """Return the preconditioned correction for a weighted residual, in balance along the rigid-body modes."""
        force, gap = r[: self.n] / self.weight[: self.n], r[self.n :] / self.weight[self.n :]
        schur, own, part = self.preconditioner, self.W * gap, 1 - self.W * self.S
        p = -(own + part * schur.pressures(gap))
        p += schur.balancing(self.vectors.dots(self.K.R.T, force) + schur.QB.T @ (own - part * p))
        p = self.vectors.same(p)
        return np.concatenate([self.cycle(force + self.B_T @ (own - part * p)), p])

    def gap(self, r: Floats) -> float:
        """Return the largest gap of a weighted residual, as a length."""
        return WHOLE.largest(r[self.n :] / (self.weight[self.n :] * self.w))

    def force(self, r: Floats) -> float:
        """Return the largest force of a weighted residual."""
        return self.vectors.largest(r[: self.n] / self.weight[: self.n])

    def excess(self, gap: float, force: float, loose: tuple[float, float], r: Floats) -> float:
        """Return a residual relative to the largest gap and force that may be left; at most 1 if it is below them.

        `loose`: norms of the residual and of its gaps that do for an inexact solve, 0 for an exact one.
        """
        exact = max(_ratio(self.gap(r), gap), _ratio(self.force(r), force))
        if not loose[0] > 0:
            return exact
        return min(exact, max(_ratio(self.vectors.norm(r), loose[0]), _ratio(WHOLE.norm(r[self.n :]), loose[1])))

    def check(self, r: Floats, force: float, count: int, tolerance: LinearTolerance) -> None:
        """Raise LinearError if the forces are not in balance; `force`: the largest of them."""
        nothing = tolerance.absolute * self.vectors.largest(self.diagonal)  # moves nodes by negligible lengths
        off = self.force(r) / max(force, nothing, 1e-300)
        if not off <= _FAILED:
            message = f"multigrid with contact stopped at forces {off:.1e} off balance, after {count} V-cycles"
            raise LinearError(f"{message}; try a direct backend, and look for what is hardly held, or thin cells")
