"""Active set of contact rows for one linearisation: which rows are closed, by semi-smooth Newton steps.

    K q = f - B^T p                                                    (26), (35)
    0 <= p_m, 0 <= G_m(q), p_m G_m = 0                                 (27), (29)

K, B and D are constant here; `newton` is for those that change. This is a semi-smooth Newton method on p_m - max(0,
p_m - c_m G_m / w_m) = 0 (32), (33): some rows are held closed, G_m = 0, the others are open, p_m = 0, and one linear
system gives the next q and p; closed rows under pressure stay closed, open rows that overlap are closed (this is the
sign of p_m - c_m G_m / w_m, whatever c_m). Other contact laws say themselves which rows they close, and as what. It is
block principal pivoting (Portugal, Judice and Vicente 1994). With friction a set that returns is left to `splitting`,
once it is solved to round-off. Systems are solved inexactly until an active set is met again, then to round-off.

Where skins peel, block exchanges move the edge of contact by about one row in each step, or make no progress. Then the
set is found on springs between the skins that get stiffer and stiffer (Hintermüller and Kunisch 2006): soft springs
carry over many rows, and the set of one stiffness is near that of the next. Skins on springs have an energy that is
convex and smooth, and each step goes to its least value along the way to the next solution, so that it ends. With
friction, and other laws, Murty's rule takes their place: one exchange at a time, the first row first.

c_m = w_m (b K b^T) / (b b^T)^2 with b the row of B: the stiffness of the macro-element's own skin, stress per length,
so that no constant depends on units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.equilibrium.search import Trial
from lacsolver.equilibrium.splitting import split
from lacsolver.equilibrium.state import Iterate
from lacsolver.linear.vectors import products
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.operator import Operator, product
from lacsolver.saddle.row_set import OUT, LinearRows, RowSet
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import ConvergenceTolerance, ForceTerms, Residual, equilibrium_residual, sizes

#: reduction of the residual in an inexact solve, and largest number of such solves. At 0.2 the gaps that a solve leaves
#: hide which rows are to be exchanged, and an exact solve of three times the applications has to follow
_LOOSE, _LOOSE_SOLVES = 1e-2, 16
#: residual, relative to the tolerance, above which directions of slides in space take one more solve: they converge
#: quadratically, and tractions change by more than gaps
_TURNED = 1e-3
#: reduction with friction, where the size of a traction decides: at 1e-2 slender bodies, as belts, slide to and fro
_LOOSE_WITH_FRICTION = 3e-4
#: block exchanges allowed while the number of violated rows does not fall, before springs or Murty's single exchange:
#: in one linear problem, and in each of Newton's method; fraction of the fewest so far that counts as a fall, before
#: springs
_BLOCKS, BLOCKS_OF_NEWTON, _FALL = 5, 3, 0.7
#: factor from the compliance of one level of springs to the next; compliance of the first level below which pivoting
#: goes on without springs, and of the last level, relative to that of a macro-element's own skin
_STIFFER, _STIFF, _STIFFEST = 0.1, 0.1, 1e-12
#: reduction of the residual in a solve with springs
LOOSE_WITH_SPRINGS = 1e-6
#: part of the largest displacement below which a step on springs has not moved the bodies
_RESTS = 1e-12
#: accuracy of gaps and pressures in a solve, relative to the tolerance: smaller ones are round-off. In thin bodies
#: pressures within the tolerance carry a part of the load
_ACCURACY = 1e-3
#: relative tolerance for the rank of the active rows on the rigid-body modes, and for the load left along them
_STOPPED = 1e-8
#: stiffness along a mode in place of zero, in any units: a load moves the body farther than any gap; part of the
#: stiffness of the bodies, or of other modes, below which it is round-off
_NO_STIFFNESS, _ROUNDING = 1e-150, 1e-15


def active_set_iterates(
    K: Operator,
    f: Floats,
    contact_at: Callable[[Floats], ContactSystem],
    start: Iterate,
    tolerance: ConvergenceTolerance,
    *,
    free: Floats | None = None,
    geometric: csr_array | None = None,
) -> Iterator[Trial]:
    """Yield trials of the equilibrium under forces f (n,), one active set each, for gaps that are linear in q.

    The stiffness is `K` plus `geometric` (n, n), if given, which acts on few unknowns: it removes the stabilisation
    added to K for rigid-body motions of little energy. `free` (n, r): these motions and those without energy, `K.R`,
    which is the default.

    If an inexact solve leaves the active set unchanged, but for tensions that are smaller, as lengths, than the gaps
    that it left in their rows, the same system is solved to full accuracy in the same trial, with friction in space
    along the directions that the first solve gives.
    """
    free = K.R if free is None else free
    vectors, accuracy = tolerance.vectors, replace(tolerance, tolerance=_ACCURACY * tolerance.tolerance)
    resistance = stiffness_along(K, free, geometric)
    (q, p, _), contact = start, contact_at(start.q)
    rows = contact.first_rows(start.active, p, held=not free.shape[1])
    p = np.where(rows.state, p, 0.0)
    turned, pivots = False, Pivots(contact, convex=contact.rows.derivative is None)
    while True:
        before, then = Iterate(q, p, rows.active), contact
        if free.shape[1]:
            load = vectors.dots(free.T, f - _internal_force(K, geometric, q))
            rows = close_rows_against_rigid_modes(free, contact, rows, p, load, resistance)
        rows = rows.same(vectors.same)
        (linear, problem), applications = _system(K, f, geometric, pivots.softened(contact), rows, before), 0
        for reduction in (0.0 if contact.exact else pivots.begin(rows), 0.0):
            goal = tolerance.linear(reduction)
            q, reduced, more, _ = solve_saddle(problem, q, linear.reduced(p), goal)
            p, contact, applications = linear.full(reduced), contact_at(q), applications + more
            known = accuracy.gaps(contact.rows.B, q)
            part, wanted = pivots.wanted(rows, then, before.p, contact, p, known)
            known = np.maximum(known, _left_open(contact, p, rows.active))
            if reduction == 0 or pivots.springs or not contact.next_rows(rows, p, known).equals(rows):
                break
            if linear.turns:
                rows = wanted
                linear, problem = _system(K, f, geometric, contact, rows, Iterate(q, p, rows.active))
        if part < 1:
            q, p = before.q + part * (q - before.q), before.p + part * (p - before.p)
            contact = contact_at(q)
        exact = reduction == 0 and not pivots.springs
        at = Iterate(q, p, rows.active)
        residual = _residual(K, geometric, contact, f, at, tolerance, exact)
        met = tolerance.fulfilled(residual, q) and not pivots.springs
        better = met and exact and pivots.improves(rows, wanted)
        done = met and not better
        again = done and linear.turns and not turned and residual.gap > _TURNED * tolerance.tolerance
        yield Trial(at, contact, residual, applications, exact=exact and done and not again)
        turned = turned or (again and reduction == 0)
        found = None
        if exact and not done:
            if pivots.cycles(rows):
                found = split(K, f, contact.with_gaps(contact.G + contact.rows.D @ q), free, pivots.tried)
            pivots.record(rows, wanted, better)
        springs, moved = pivots.springs, tolerance.scale(q)
        following = wanted if done or found else pivots.next(rows, wanted, reduction == 0, p, moved)
        rests = pivots.springs == springs > 0 and tolerance.scale(q - before.q) <= _RESTS * moved
        if following is None or rests:  # bodies that have come to rest on their springs without a set have none
            return
        p, rows = found or (p, following)


def _left_open(contact: ContactSystem, p: Floats, active: NDArray[np.bool_]) -> NDArray[np.floating]:
    """Return the mean gaps (m,) by which a solve with `active` rows misses their equations, lengths >= 0."""
    G, S = contact.equations(p, active)
    return np.where(active, np.abs(G + S * p) / contact.rows.w, 0.0)


def _system(
    K: Operator, f: Floats, geometric: csr_array | None, contact: ContactSystem, rows: RowSet, at: Iterate
) -> tuple[LinearRows, SaddleProblem]:
    """Return the linear system of a row set at an iterate, whose unknowns are the whole q."""
    linear = contact.linear(rows, at.p)
    G = linear.G + linear.rows.D @ at.q
    h = linear.load(f, contact.rows.B_T)
    return linear, SaddleProblem(K, linear.rows, linear.active, h, G, linear.S, geometric)


def close_rows_against_rigid_modes(
    R: Floats, contact: ContactSystem, rows: RowSet, p: Floats, load: Floats, resistance: Floats | None = None
) -> RowSet:
    """Return the row set with rows added until no rigid-body mode R (n, r) moves along its load (r,).

    Each added row is the first that the body reaches, which moves on from there. No row is added where the body has a
    state of rest, stable or not, before it reaches one: `resistance` (r, r), zero by default, is the stiffness along
    the modes from springs, from follower forces and from contact forces that move with the body. A load along a mode
    that no row constrains remains. p (m,): pressures and tractions, for what slides.
    """
    if not R.shape[1]:
        return rows
    moves = (contact.rows.D @ R) / contact.rows.w[:, None]
    stiffness = np.zeros((R.shape[1],) * 2) if resistance is None else resistance
    place, least = np.zeros(R.shape[1]), _STOPPED * float(np.linalg.norm(load))
    for _ in range(R.shape[1]):
        linear = contact.linear(rows, p)
        w = linear.rows.w[:, None]
        free, loaded = (_null_space((A @ R / w)[linear.active]) for A in (linear.rows.D, linear.rows.B))
        left = free.T @ (loaded @ (loaded.T @ (load - stiffness @ place)))
        onward, to_rest = (free @ motion for motion in _motions(free.T @ stiffness @ free, left, least))
        gaps = contact.G / contact.rows.w - moves @ place
        way = _part_to_rows(contact, rows, gaps, moves @ onward)
        if np.isinf(way).all() or min(way.min(), _part_to_rows(contact, rows, gaps, moves @ to_rest).min()) > 1:
            break
        rows = contact.with_closed(rows, int(way.argmin()))
        place += max(float(way.min()), 0.0) * onward
    return rows


def stiffness_along(K: Operator, R: Floats, C: csr_array | None = None) -> NDArray[np.floating]:
    """Return the stiffness R^T (K + C) R (r, r) along modes R (n, r), zero where it is round-off of the bodies' own."""
    A = products(K.vectors, R, product(K, R, C))
    size = K.vectors.dots((R * R).T, np.abs(K.scaling)).max(initial=0.0)
    stiffness, axes = np.linalg.eigh((A + A.T) / 2)
    return np.asarray((axes * np.where(np.abs(stiffness) > _ROUNDING * size, stiffness, 0.0)) @ axes.T)


def _motions(K: Floats, load: Floats, least: float) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return two motions (r,) along modes of stiffness K (r, r): where a load pushes a body, and to its state of rest.

    They differ where the stiffness is negative: then rest is unstable, and the load pushes away from it. Where there is
    no stiffness, the body goes on without end. `least`: load along an axis of K that is round-off.
    """
    stiffness, axes = np.linalg.eigh((K + K.T) / 2)
    along = axes.T @ load
    resists = np.abs(stiffness) > _ROUNDING * np.abs(stiffness).max(initial=0.0)
    pushed = np.where(np.abs(along) > least, along, 0.0) / np.where(resists, np.abs(stiffness), _NO_STIFFNESS)
    return axes @ pushed, axes @ (np.sign(stiffness) * pushed)


def _part_to_rows(contact: ContactSystem, rows: RowSet, gaps: Floats, closing: Floats) -> NDArray[np.floating]:
    """Return the part (m,) of a motion after which it closes each open row, inf where it does not.

    `gaps` (m,): mean gaps before the motion; `closing` (m,): what the whole motion takes from each.
    """
    open_rows = contact.may_carry & (rows.state == OUT) & ~contact.along_tangents
    nearing = open_rows & (closing > _STOPPED * np.abs(closing).max(initial=0.0))
    return np.where(nearing, gaps / np.where(nearing, closing, 1.0), np.inf)


def _null_space(A: Floats) -> NDArray[np.floating]:
    """Return an orthonormal basis (r, k) of the null space of A (m, r)."""
    if not len(A):
        return np.eye(A.shape[1])
    _, size, V = np.linalg.svd(A)
    return np.asarray(V[(size > _STOPPED * size.max(initial=0.0)).sum() :].T)


class Pivots:
    """Update of the active set: block principal pivoting, and where that makes no progress springs or Murty's rule.

    All violated rows are exchanged as long as their number falls within a few steps. Otherwise unilateral contact gets
    springs, whose compliance `springs` falls from level to level; 0 without them. At each level rows are exchanged
    until the set is that of the level. Other laws, and friction, take Murty's rule: only the first violated row is
    exchanged, until fewer rows than ever before are violated.

    A set is solved inexactly when it is met for the first time, and only a limited number of times in all.
    """

    def __init__(self, contact: ContactSystem, *, convex: bool = True, blocks: int = _BLOCKS) -> None:
        self._blocks = blocks
        self._skin = contact.skin_compliance if convex and contact.with_springs(0.0) is not None else None
        self._least, self._fewest, self._patience = np.inf, np.inf, blocks
        self._reduction, self._loose = _LOOSE_WITH_FRICTION if contact.sheared else _LOOSE, _LOOSE_SOLVES
        self._seen, self._solved, self._before, self._splits = set[bytes](), set[bytes](), b"", bool(contact.sheared)
        self.tried = np.zeros(len(contact.G), bool)
        self._begin(0.0)
        self._level, self._last = np.inf, _STIFF * (self._skin or 0.0)

    def begin(self, rows: RowSet) -> float:
        """Take up a set; return the tolerance it is first solved to: 0 (exactly), or a loose one."""
        if self.springs:
            return LOOSE_WITH_SPRINGS
        key = rows.state.tobytes()
        loose = key not in self._seen and self._loose > 0
        self._seen.add(key)
        self._loose -= loose
        return self._reduction if loose else 0.0

    def cycles(self, rows: RowSet) -> bool:
        """Return True if a set was solved to round-off before, and others since, with friction; until it was once."""
        key = rows.state.tobytes()
        return self._splits and key in self._solved and key != self._before

    def record(self, rows: RowSet, wanted: RowSet, better: bool) -> None:
        """Record a set that was solved to round-off; `better`: as an equilibrium that `improves`."""
        self._splits = self._splits and not self.cycles(rows)
        self._before = rows.state.tobytes()
        self._solved.add(self._before)
        self._least = len(rows.changes(wanted)) if better else self._least

    def improves(self, rows: RowSet, wanted: RowSet) -> bool:
        """Return True if fewer rows of an equilibrium ask for another state than of those before.

        An equilibrium to the tolerance may have rows in tension, as this is small compared with the stiffness of skins;
        of thin bodies it may carry a part of the load.
        """
        changes = len(rows.changes(wanted)) if self._skin else 0
        return 0 < changes < self._least

    def softened(self, contact: ContactSystem) -> ContactSystem:
        """Return a contact system with the springs of this level."""
        soft = contact.with_springs(self.springs) if self.springs else None
        return contact if soft is None else soft

    def wanted(
        self, rows: RowSet, before: ContactSystem, p_before: Floats, contact: ContactSystem, p: Floats,
        allowed: Floats | float,
    ) -> tuple[float, RowSet]:  # fmt: skip
        """Return the part of the last step to go, and the row set that is asked for there.

        `before`, `contact`: the system before and after a solve with a row set, with pressures `p_before`, p (m,).
        `allowed`: gaps, (m,) or of all rows, that may remain. With springs a step that does not bring the number of
        violated rows down goes to the least energy on its way.
        """
        self.tried |= rows.state != OUT
        soft = self.softened(contact)
        wanted = soft.next_rows(rows, p, allowed)
        if not self.springs or self._patience > 0 or len(rows.changes(wanted)) < self._fewest:
            return 1.0, wanted
        part = soft.least_energy(before.G, p_before, p)
        there = soft.with_gaps(before.G + part * (contact.G - before.G))
        none = np.zeros(len(p))
        return part, wanted if part == 1 else there.next_rows(RowSet.of(none > 0), none, 0.0)

    def next(self, rows: RowSet, wanted: RowSet, exact: bool, p: Floats, moved: float) -> RowSet | None:
        """Return the next row set after a solve that asks for the set `wanted`; None if there is no equilibrium.

        p (m,): pressures of the solve; `moved`: largest displacement.
        """
        changes = rows.changes(wanted)
        if self.springs:
            return self._stiffened(wanted, len(changes))
        if not len(changes):
            self._patience -= exact
            if self._skin is None or self._patience >= 0:
                return wanted
            return self._without_springs(rows) if self._skin else None
        if not self._skin:
            if not exact:
                return wanted
            self._loose = 0  # from here on the numbers of changes are compared, which needs exact solves
        least = self._fewest * (_FALL if self._skin else 1.0)
        if len(changes) <= least and len(changes) < self._fewest:
            self._fewest, self._patience = len(changes), self._blocks
        elif self._patience > 0:
            self._patience -= 1
        elif not self._skin:
            return rows.exchanged(wanted, int(changes[0]))
        elif p.any():
            return self._with_springs(wanted, p, moved)
        return wanted

    def _without_springs(self, rows: RowSet) -> RowSet:
        """Return no row, from where exchanges go on without springs: the rows of this set depend on one another."""
        self._skin, self._patience, self._fewest = 0.0, self._blocks, np.inf
        return RowSet.of(np.zeros(len(rows.state), bool))

    def _with_springs(self, wanted: RowSet, p: Floats, moved: float) -> RowSet | None:
        """Begin with springs, which give as much as the bodies move under the mean pressure, or go on with them."""
        assert self._skin is not None
        self._level = min(self._level * _STIFFER, moved / float(np.abs(p[p != 0]).mean()))
        if self._level < _STIFFEST * self._skin:
            return None
        self._loose = 0
        self._begin(self._level)
        return wanted

    def _begin(self, springs: float) -> None:
        """Begin with springs of another level, or without them."""
        self.springs, self._patience, self._tried, self._fewest = springs, self._blocks, 0, np.inf

    def _stiffened(self, wanted: RowSet, changes: int) -> RowSet:
        """Return the next set of this level; or make the springs stiffer, or leave them, once its set is found."""
        self._patience = self._blocks if changes < self._fewest else max(self._patience - 1, 0)
        self._fewest, self._tried = min(self._fewest, changes), self._tried + 1
        stiffer = self.springs * _STIFFER
        if changes > (stiffer >= self._last):
            return wanted
        self._level = self.springs
        if stiffer < self._last or (self._tried == 1 and not changes):
            self._last, stiffer = min(self._last, stiffer), 0.0
        self._begin(stiffer)
        return wanted


def _internal_force(K: Operator, geometric: csr_array | None, q: Floats) -> NDArray[np.floating]:
    """Return (K + C) q (n,)."""
    return K.apply(q) if geometric is None else K.apply(q) + K.vectors.summed(geometric @ q)


def _residual(
    K: Operator, geometric: csr_array | None, contact: ContactSystem, f: Floats, at: Iterate,
    tolerance: ConvergenceTolerance, exact: bool,
) -> Residual:  # fmt: skip
    """Return the relative residuals of the forces f - (K + C) q - B^T p, and of gaps."""
    q, p, active = at
    inner, forces = _internal_force(K, geometric, q), contact.rows.B_T @ p
    largest = tolerance.vectors.largest_of_body
    force = np.maximum(np.maximum(largest(f), largest(inner)), largest(forces))

    def terms() -> ForceTerms:
        size = K.vectors.summed(sizes(K.K, q) + (0.0 if geometric is None else sizes(geometric, q)))
        return ForceTerms(np.abs(f) + size + abs(contact.rows.B_T) @ np.abs(p), K.vectors.summed(K.K.diagonal()))

    balance, relative = equilibrium_residual(f - inner - forces, force, terms if exact else None, tolerance, q)
    gap = tolerance.relative_gap(contact.residuals(p, active), contact.rows.B, q)
    return Residual(balance, gap, relative=relative)
