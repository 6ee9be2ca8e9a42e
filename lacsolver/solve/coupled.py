"""Solution for displacements and pressures in one Krylov loop, with a multigrid V-cycle in place of K^-1.

Generalised conjugate residuals (GMRES with any preconditioner, Saad 1993) on

    [K + C  B_A^T] [dq]   [r_f]
    [D_A    0    ] [dp] = [r_G]

preconditioned by dp = -M r_G, with M the stiffness of the skins (`saddle`), then dq = V (r_f - B_A^T dp), with V a
V-cycle for K. With V = K^-1 it would take as many iterations as the loop on the Schur complement; with a V-cycle it
takes about 1.5 times as many. Only V is built for K, and it serves every active set, and similar stiffnesses.

Residuals are weighted so that both parts are energies: forces are divided by the root of K's diagonal, gaps multiplied
by the root of the stiffness of their own row. They follow by recurrence within a restart cycle and are computed anew
after it, so that the last cycle ends at round-off. For a body that only contact supports, its rigid-body modes are
search directions from the start, dp balances the load along them, and the springs that make K definite carry no force.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear import LinearError
from lacsolver.linear.cycle import Team
from lacsolver.linear.regular import indefinite
from lacsolver.solve.saddle import HELD, Goal, Rows, Skins, Solved
from lacsolver.solve.stiffness import Stiffness

#: most directions of a restart cycle, all of which are stored; most iterations in all
_ROUND, _MOST = 80, 400
#: reduction of the residual in a cycle, after which it is computed anew
_RECURRED = 1e-9
#: forces are in balance if their residual is below this fraction of the largest
_BALANCED = 3e-14
#: a cycle that leaves more than this fraction of the residual has reached round-off
_SLOW = 0.5
#: relative imbalance of forces that is larger than round-off
_FAILED = 1e-6
#: orthogonalise a second time when the first pass leaves less than this fraction of the norm; fraction that is noise
_LOST, _NOISE = 0.1, 1e-12
#: energies below this, relative to that of the diagonal, are negative
_NEGATIVE = -1e-12


def solve_coupled(
    K: Stiffness,
    rows: Rows,
    active: Ints,
    f: Floats,
    G: Floats,
    q: Floats,
    p: Floats,
    goal: Goal,
    turning: csr_array | None = None,
) -> Solved:
    """Solve the system of `solve_rows` by multigrid; an inexact goal leaves an imbalance of forces too.

    Raises LinearError if the forces do not reach balance, SingularError if K is found not to be positive definite.
    """
    system = _System(K, rows, active, f, G[active], q, turning)
    held = np.zeros_like(p)
    held[active] = p[active]
    x = np.concatenate([q, p[active] + system.skins.carrying(K.R.T @ (f - rows.B_T @ held))])
    norm = system.team.norm
    r, from_nothing = system.residual(x), system.residual(np.zeros_like(x))
    if norm(from_nothing) < norm(r) and not K.R.shape[1]:
        x, r = np.zeros_like(x), from_nothing
    first = best = norm(r)
    loosely = goal.reduction * first
    gaps, count, paid = goal.reduction * max(norm(r[len(f) :]), loosely), 0, 0
    while count < _MOST:
        ends = _Ends(goal.least(x[: len(f)]), _BALANCED * system.largest_force(x), loosely, gaps)
        if ends.met(system, r):
            break
        step, more = _round(system, r, ends, min(_ROUND, _MOST - count))
        count += more
        left = system.residual(x + step)
        size = norm(left)
        if size < best:
            x, r = x + step, left
        if not size < _SLOW * best:
            break
        best, paid = size, count
    held[active] = x[len(f) :]
    if goal.reduction == 0:
        system.check(x, r, count, goal)
        K.note("with rows", paid, first, best)
    return Solved(x[: len(f)], held, count, system.gap(r))


class _Ends(NamedTuple):
    """Stopping criteria: largest gap and force, or, for an inexact solve, norms of the residual and of its gaps."""

    gap: float
    force: float
    loosely: float
    gaps: float

    def met(self, system: _System, r: Floats) -> bool:
        """True if a residual meets the criteria."""
        norm = system.team.norm
        if self.loosely > 0 and norm(r) <= self.loosely and norm(r[system.n :]) <= self.gaps:
            return True
        return system.gap(r) <= self.gap and system.force(r) <= self.force


class _System:
    """Matrix, preconditioner and weights of an active set. Vectors have the unknowns first, then the pressures."""

    def __init__(
        self, K: Stiffness, rows: Rows, active: Ints, f: Floats, G: Floats, start: Floats, turning: csr_array | None
    ) -> None:
        self.K, self.skins, self.turning, self.n = K, Skins(K, rows, active), turning, len(f)
        self.f, self.G, self.start, self.team = f, G, start, K.team
        self.B, self.D, self.w = rows.B[active], rows.D[active], rows.w[active]
        self.B_T = self.B.T.tocsr()
        self.diagonal = np.abs(K.diagonal)
        B = self.skins.B
        energy = np.asarray((B @ self.skins.inner).multiply(B).sum(axis=1)).ravel()
        own = np.asarray(B.multiply(B).sum(axis=1)).ravel()
        stiff = np.where(energy > 0, energy, 1.0) / np.where(own > 0, own, 1.0) ** 2
        self.weight = np.concatenate([1 / np.sqrt(self.diagonal), np.sqrt(stiff)])
        self.stopped, self.loose = _told_apart(K.R, self.skins.QD)

    def residual(self, x: Floats) -> NDArray[np.floating]:
        """Return the weighted residual at x."""
        force = self.f - self.forces(x[: self.n], x[self.n :])
        if self.turning is not None:
            force += self.turning @ self.start
        return np.concatenate([self._balanced(force), self.G - self.D @ x[: self.n]]) * self.weight

    def forces(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """Return (K + C) q + B^T p."""
        made = self.K.times(q) + self.B_T @ p
        return made if self.turning is None else made + self.turning @ q

    def _balanced(self, force: Floats) -> NDArray[np.floating]:
        """Return forces without those along rigid-body modes that no row constrains; the springs balance these."""
        return force - self.loose @ (self.loose.T @ force) if self.loose.shape[1] else force

    def image(self, z: Floats) -> NDArray[np.floating]:
        """Return the weighted product of the matrix with a vector. Raises SingularError for a negative energy of K."""
        q, p = z[: self.n], z[self.n :]
        Kq = self.K.times(q)
        energy, most = self.team.dots(np.stack([Kq, self.diagonal * q]), q)
        if energy < _NEGATIVE * most:
            raise indefinite()
        force = Kq + self.B_T @ p
        if self.turning is not None:
            force += self.turning @ q
        return np.concatenate([self._balanced(force), self.D @ q]) * self.weight

    def precondition(self, r: Floats) -> NDArray[np.floating]:
        """Return the preconditioned correction for a weighted residual, in balance along the rigid-body modes."""
        force, gap = r[: self.n] / self.weight[: self.n], r[self.n :] / self.weight[self.n :]
        p = -self.skins.pressing(gap)
        p += self.skins.carrying(self.K.R.T @ force - self.skins.QB.T @ p)
        return np.concatenate([self.K.cycle(force - self.B_T @ p), p])

    def free(self) -> NDArray[np.floating]:
        """Return the rigid-body modes that rows constrain, as search directions (k, unknowns + pressures)."""
        return np.concatenate([self.stopped.T, np.zeros((self.stopped.shape[1], len(self.w)))], axis=1)

    def gap(self, r: Floats) -> float:
        """Return the largest gap of a weighted residual, as a length."""
        return float(np.abs(r[self.n :] / (self.weight[self.n :] * self.w)).max(initial=0.0))

    def force(self, r: Floats) -> float:
        """Return the largest force of a weighted residual."""
        return float(np.abs(r[: self.n] / self.weight[: self.n]).max(initial=0.0))

    def largest_force(self, x: Floats) -> float:
        """Return the scale of the force balance: the largest load or internal force."""
        q, forces = x[: self.n], [self.f, self.K.times(x[: self.n])]
        if self.turning is not None:
            forces = [self.f + self.turning @ self.start, forces[1] + self.turning @ q]
        return max(float(np.abs(v).max(initial=0.0)) for v in forces)

    def check(self, x: Floats, r: Floats, count: int, goal: Goal) -> None:
        """Raise LinearError if the forces are not in balance."""
        nothing = goal.absolute * float(self.diagonal.max(initial=0.0))  # moves nodes by negligible lengths
        off = self.force(r) / max(self.largest_force(x), nothing, 1e-300)
        if not off <= _FAILED:
            message = f"multigrid with contact stopped at forces {off:.1e} off balance, after {count} V-cycles"
            raise LinearError(f"{message}; try a direct backend, and look for what is hardly held, or thin cells")


def _round(system: _System, r: Floats, ends: _Ends, most: int) -> tuple[NDArray[np.floating], int]:
    """Return the step that minimises a weighted residual over all directions of a cycle, and their number.

    Directions Z are stored as they were computed; their images A Z = I T^T have orthonormal rows I.
    """
    free = system.free()
    known = len(free)
    Z, images = np.empty((known + most, len(r))), np.empty((known + most, len(r)))
    T, along = np.zeros((known + most,) * 2), np.zeros(known + most)
    norm, dots = system.team.norm, system.team.dots
    end, k = _RECURRED * norm(r), 0
    r = r.copy()
    while k < known + most and (k < known or not ends.met(system, r)) and norm(r) > end:
        Z[k] = free[k] if k < known else system.precondition(r)
        image = system.image(Z[k])
        whole = norm(image)
        T[k, :k], T[k, k] = _orthogonal(image, images[:k], system.team)
        if not T[k, k] > _NOISE * whole:
            break
        images[k] = image / T[k, k]
        along[k] = dots(images[k : k + 1], r)[0]
        r -= along[k] * images[k]
        k += 1
    if not k:
        return np.zeros_like(r), 0
    step = np.zeros_like(r)
    system.team.subtract(-solve_triangular(T[:k, :k], along[:k], trans="T", lower=True), Z[:k], step)
    return step, max(k - known, 0)


def _orthogonal(image: Floats, others: Floats, team: Team) -> tuple[NDArray[np.floating], float]:
    """Orthogonalise an image against orthonormal rows `others`, in place; return the products and the norm left."""
    before = team.norm(image)
    parts = team.dots(others, image)
    team.subtract(parts, others, image)
    left = team.norm(image)
    if left < _LOST * before:
        again = team.dots(others, image)
        team.subtract(again, others, image)
        parts, left = parts + again, team.norm(image)
    return parts, left


def _told_apart(R: Floats, moves: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Split the rigid-body modes R (n, r) into those that the active rows constrain and the others, both orthonormal.

    `moves` (a, r): the products D R of the rows with the modes.
    """
    if not moves.size:
        return R[:, :0], R
    _, size, V = np.linalg.svd(moves)
    k = int((size > HELD * size[0]).sum())
    return R @ V[:k].T, R @ V[k:].T
