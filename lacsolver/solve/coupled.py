"""Displacements and pressures in one loop, where multigrid stands for K^-1: a V-cycle an iteration, no inner solves.

Generalised conjugate residuals (GMRES with any preconditioner, Saad 1993) on

    [K + C  B_A^T] [dq]   [r_f]
    [D_A    0    ] [dp] = [r_G]

where dp = -M r_G, with M the stiffness of the skins (`saddle`), then dq = V (r_f - B_A^T dp), with V a V-cycle for K.
With V = K^-1 it takes as many iterations as the loop on the Schur complement; with V some half as many again. Nothing
but V is built for K, and that serves every set of rows, and stiffnesses that are like it.

Residuals are weighed such that both are energies: forces over the root of K's diagonal, gaps by the root of the
stiffness of their own row. They are recurred within a round and computed anew between rounds, so that the last round
ends at what rounding allows. Where a body moves freely but for contact, its motions are directions from the start, dp
carries what is not in balance along them, and the springs that make K definite carry nothing.
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

#: directions of a round, which are kept; and iterations in all
_ROUND, _MOST = 80, 400
#: what a round reduces residuals by, until they are computed anew
_RECURRED = 1e-9
#: forces that add up to this much of the largest one are in balance
_BALANCED = 3e-14
#: a round that leaves more than this of the residual has met rounding
_SLOW = 0.5
#: forces further than this from balance are no rounding
_FAILED = 1e-6
#: an image that keeps less than this of its length when the others are taken out is not orthogonal yet; is noise
_LOST, _NOISE = 0.1, 1e-12
#: energies below this, relative to the diagonal's, are negative
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
    """As `solve_rows`; a loose goal leaves forces off balance too, by as much of the residual.

    Raises LinearError where forces do not come into balance, SingularError where K is seen not to be definite.
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
    """Where a loop ends: at the largest gap and force, or, loosely, at sizes of the whole residual and of its gaps."""

    gap: float
    force: float
    loosely: float
    gaps: float

    def met(self, system: _System, r: Floats) -> bool:
        """Whether a residual is small enough."""
        norm = system.team.norm
        if self.loosely > 0 and norm(r) <= self.loosely and norm(r[system.n :]) <= self.gaps:
            return True
        return system.gap(r) <= self.gap and system.force(r) <= self.force


class _System:
    """The matrix, the preconditioner and the weights of a set of rows. Vectors are unknowns and then pressures."""

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
        """What is off, weighed."""
        force = self.f - self.forces(x[: self.n], x[self.n :])
        if self.turning is not None:
            force += self.turning @ self.start
        return np.concatenate([self._balanced(force), self.G - self.D @ x[: self.n]]) * self.weight

    def forces(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """(K + C) q + B^T p."""
        made = self.K.times(q) + self.B_T @ p
        return made if self.turning is None else made + self.turning @ q

    def _balanced(self, force: Floats) -> NDArray[np.floating]:
        """Forces without those along motions that no row stops, which are the springs'."""
        return force - self.loose @ (self.loose.T @ force) if self.loose.shape[1] else force

    def image(self, z: Floats) -> NDArray[np.floating]:
        """The matrix times a vector, weighed. Raises SingularError where K gives energy away."""
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
        """About what makes a weighed residual, in balance along the free motions."""
        force, gap = r[: self.n] / self.weight[: self.n], r[self.n :] / self.weight[self.n :]
        p = -self.skins.pressing(gap)
        p += self.skins.carrying(self.K.R.T @ force - self.skins.QB.T @ p)
        return np.concatenate([self.K.cycle(force - self.B_T @ p), p])

    def free(self) -> NDArray[np.floating]:
        """(k, ...): the free motions that rows stop."""
        return np.concatenate([self.stopped.T, np.zeros((self.stopped.shape[1], len(self.w)))], axis=1)

    def gap(self, r: Floats) -> float:
        """The largest gap of a weighed residual, as a length."""
        return float(np.abs(r[self.n :] / (self.weight[self.n :] * self.w)).max(initial=0.0))

    def force(self, r: Floats) -> float:
        """The largest force of a weighed residual."""
        return float(np.abs(r[: self.n] / self.weight[: self.n]).max(initial=0.0))

    def largest_force(self, x: Floats) -> float:
        """What forces are compared with."""
        q, forces = x[: self.n], [self.f, self.K.times(x[: self.n])]
        if self.turning is not None:
            forces = [self.f + self.turning @ self.start, forces[1] + self.turning @ q]
        return max(float(np.abs(v).max(initial=0.0)) for v in forces)

    def check(self, x: Floats, r: Floats, count: int, goal: Goal) -> None:
        """Raises LinearError where forces stayed off balance."""
        nothing = goal.absolute * float(self.diagonal.max(initial=0.0))  # moves nodes by lengths of no account
        off = self.force(r) / max(self.largest_force(x), nothing, 1e-300)
        if not off <= _FAILED:
            message = f"multigrid with contact stopped at forces {off:.1e} off balance, after {count} V-cycles"
            raise LinearError(f"{message}; try a direct backend, and look for what is hardly held, or thin cells")


def _round(system: _System, r: Floats, ends: _Ends, most: int) -> tuple[NDArray[np.floating], int]:
    """The step that makes a weighed residual least among all directions, and how many there were.

    Directions Z stay as they were made; their images A Z = I T^T have orthonormal rows I.
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
    """Take orthonormal rows `others` out of an image, in place: how much of each there was, and the length left."""
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
    """Free motions that rows stop, which move by moves (a, r), and those that they do not, (n, ...) orthonormal."""
    if not moves.size:
        return R[:, :0], R
    _, size, V = np.linalg.svd(moves)
    k = int((size > HELD * size[0]).sum())
    return R @ V[:k].T, R @ V[k:].T
