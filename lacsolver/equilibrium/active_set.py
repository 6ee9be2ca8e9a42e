"""Active set of contact rows for one linearisation: which rows are closed, by semi-smooth Newton steps.

    K q = f - B^T p                                                    (26), (35)
    0 <= p_m, 0 <= G_m(q), p_m G_m = 0                                 (27), (29)

K, B and D are constant here; `newton` is for those that change. This is a semi-smooth Newton method on p_m - max(0,
p_m - c_m G_m / w_m) = 0 (32), (33): some rows are held closed, G_m = 0, the others are open, p_m = 0, and one linear
system gives the next q and p; closed rows under pressure stay closed, open rows that overlap are closed (this is the
sign of p_m - c_m G_m / w_m, whatever c_m). Other contact laws say themselves which rows they close, and as what. It is
block principal pivoting (Portugal, Judice and Vicente 1994), which is made finite by Murty's rule, one exchange at a
time, the first row first, where block exchanges make no progress. With friction, where that is no proof, a set that
returns is left to `splitting`, once it is solved to round-off. Systems are solved inexactly until an active set is
met again, then to round-off.

c_m = w_m (b K b^T) / (b b^T)^2 with b the row of B: the stiffness of the macro-element's own skin, stress per length,
so that no constant depends on units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.equilibrium.search import Trial
from lacsolver.equilibrium.splitting import split
from lacsolver.linear.vectors import products
from lacsolver.results.state import Iterate
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.operator import Operator, product
from lacsolver.saddle.row_group import Rows
from lacsolver.saddle.row_set import OUT, LinearRows, RowSet
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import ConvergenceTolerance, ForceTerms, Residual, equilibrium_residual, sizes

#: reduction of the residual in an inexact solve, and largest number of such solves
_LOOSE, _LOOSE_SOLVES = 0.2, 16
#: residual, relative to the tolerance, above which directions of slides in space take one more solve: they converge
#: quadratically, and tractions change by more than gaps
_TURNED = 1e-3
#: reduction with friction, where the size of a traction decides: at 1e-2 slender bodies, as belts, slide to and fro
_LOOSE_WITH_FRICTION = 3e-4
#: block exchanges allowed while the number of violated rows does not fall, before Murty's single exchange
_BLOCKS = 3
#: relative tolerance for the rank of the active rows on the rigid-body modes, and for the load left along them
_STOPPED = 1e-8


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

    If an inexact solve leaves the active set unchanged, the same system is solved to full accuracy in the same trial,
    with friction in space along the directions that the first solve gives.
    """
    free = K.R if free is None else free
    vectors = tolerance.vectors
    resistance = products(vectors, free, product(K, free, geometric))
    q, p, _ = start
    contact = contact_at(q)
    rows = contact.first_rows(start.active, p, held=not free.shape[1])
    p = np.where(rows.state, p, 0.0)
    turned, unsplit, tried = False, True, np.zeros(len(p), bool)
    pivots = Pivots(_LOOSE_WITH_FRICTION if contact.sheared else _LOOSE)
    while True:
        if free.shape[1]:
            load = vectors.dots(free.T, f - _internal_force(K, geometric, q))
            rows = close_rows_against_rigid_modes(free, contact, rows, p, load, resistance)
        rows = rows.same(vectors.same)
        (linear, problem), applications = _system(K, f, geometric, contact, rows, Iterate(q, p, rows.active)), 0
        for reduction in (0.0 if contact.exact else pivots.begin(rows), 0.0):
            goal = tolerance.linear(reduction)
            q, reduced, more, _ = solve_saddle(problem, q, linear.reduced(p), goal)
            p, contact, applications = linear.full(reduced), contact_at(q), applications + more
            wanted = contact.next_rows(rows, p, tolerance.gaps(contact.rows.B, q))
            if reduction == 0 or not wanted.equals(rows):
                break
            if linear.turns:
                rows = wanted
                linear, problem = _system(K, f, geometric, contact, rows, Iterate(q, p, rows.active))
        off = _residual_of_forces(K, geometric, contact.rows, f, q, p, tolerance, reduction == 0)
        gap = tolerance.relative_gap(contact.residuals(p, rows.active), contact.rows.B, q)
        residual = Residual(off, gap)
        done = tolerance.fulfilled(residual, q)
        again = done and linear.turns and not turned and gap > _TURNED * tolerance.tolerance
        yield Trial(Iterate(q, p, rows.active), contact, residual, applications, exact=reduction == 0 and not again)
        turned = turned or (again and reduction == 0)
        tried |= rows.state != OUT
        found = None
        if unsplit and not done and reduction == 0 and contact.sheared:
            if pivots.returned(rows):
                found, unsplit = split(K, f, contact.with_gaps(contact.G + contact.rows.D @ q), free, tried), False
            pivots.record_exact(rows)
        p, rows = found or (p, wanted if done else pivots.next(rows, wanted, reduction == 0))


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

    Each added row is the first that the moving body reaches, provided that it reaches it before it comes to rest by
    itself: `resistance` (r, r), none by default, is the stiffness along the modes from follower forces and the like. A
    load along a mode that no row constrains remains. p (m,): pressures and tractions, for what slides.
    """
    if not R.shape[1]:
        return rows
    moves = (contact.rows.D @ R) / contact.rows.w[:, None]
    for _ in range(R.shape[1]):
        linear = contact.linear(rows, p)
        w = linear.rows.w[:, None]
        free, loaded = (_null_space((A @ R / w)[linear.active]) for A in (linear.rows.D, linear.rows.B))
        along = free @ (free.T @ (loaded @ (loaded.T @ load)))
        closing = moves @ along
        open_rows = contact.may_carry & (rows.state == OUT) & ~contact.along_tangents
        nearing = open_rows & (closing > _STOPPED * np.abs(closing).max(initial=0.0))
        if not nearing.any() or np.linalg.norm(along) <= _STOPPED * np.linalg.norm(load):
            break
        way = np.where(nearing, contact.G / contact.rows.w / np.where(nearing, closing, 1.0), np.inf)
        resisted = 0.0 if resistance is None else along @ resistance @ along
        if resisted > 0 and along @ load < resisted * way.min():
            break
        rows = contact.with_closed(rows, int(way.argmin()))
    return rows


def _null_space(A: Floats) -> NDArray[np.floating]:
    """Return an orthonormal basis (r, k) of the null space of A (m, r)."""
    if not len(A):
        return np.eye(A.shape[1])
    _, size, V = np.linalg.svd(A)
    return np.asarray(V[(size > _STOPPED * size.max(initial=0.0)).sum() :].T)


class Pivots:
    """Update of the active set by block principal pivoting, made finite by Murty's rule.

    All violated rows are exchanged as long as their number falls within a few steps; otherwise only the first one is,
    until fewer rows than ever before are violated. A set is solved inexactly when it is met for the first time, and
    only a limited number of times in all.
    """

    def __init__(self, reduction: float = _LOOSE) -> None:
        self._reduction = reduction
        self._seen: set[bytes] = set()
        self._solved, self._last = set[bytes](), b""
        self._fewest, self._patience, self._loose = np.inf, _BLOCKS, _LOOSE_SOLVES

    def begin(self, rows: RowSet) -> float:
        """Take up a set; return the tolerance it is first solved to: 0 (exactly), or a loose one."""
        key = rows.state.tobytes()
        loose = key not in self._seen and self._loose > 0
        self._seen.add(key)
        self._loose -= loose
        return self._reduction if loose else 0.0

    def returned(self, rows: RowSet) -> bool:
        """True for a set that was solved to round-off, and others since then."""
        key = rows.state.tobytes()
        return key in self._solved and key != self._last

    def record_exact(self, rows: RowSet) -> None:
        """Record a set that was solved to round-off."""
        self._last = rows.state.tobytes()
        self._solved.add(self._last)

    def next(self, rows: RowSet, wanted: RowSet, exact: bool) -> RowSet:
        """Return the next row set after a solve that asks for the set `wanted`."""
        changes = rows.changes(wanted)
        if not exact or not len(changes):
            return wanted
        self._loose = 0  # from here on the numbers of changes are compared, which needs exact solves
        if len(changes) < self._fewest:
            self._fewest, self._patience = len(changes), _BLOCKS
            return wanted
        if self._patience > 0:
            self._patience -= 1
            return wanted
        return rows.exchanged(wanted, int(changes[0]))


def _internal_force(K: Operator, geometric: csr_array | None, q: Floats) -> NDArray[np.floating]:
    """Return (K + C) q (n,)."""
    return K.apply(q) if geometric is None else K.apply(q) + K.vectors.summed(geometric @ q)


def _residual_of_forces(
    K: Operator, geometric: csr_array | None, rows: Rows, f: Floats, q: Floats, p: Floats,
    tolerance: ConvergenceTolerance, exact: bool,
) -> float:  # fmt: skip
    """Return the relative residual of the forces f - (K + C) q - B^T p."""
    inner, contact = _internal_force(K, geometric, q), rows.B_T @ p
    largest = tolerance.vectors.largest_of_body
    force = np.maximum(np.maximum(largest(f), largest(inner)), largest(contact))

    def terms() -> ForceTerms:
        size = K.vectors.summed(sizes(K.K, q) + (0.0 if geometric is None else sizes(geometric, q)))
        return ForceTerms(np.abs(f) + size + abs(rows.B_T) @ np.abs(p), K.vectors.summed(K.K.diagonal()))

    return equilibrium_residual(f - inner - contact, force, terms if exact else None, tolerance, q)
