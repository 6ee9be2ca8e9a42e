"""Contact on matrices that are given: the method without a mesh, a case or a file.

    K u + B^T p = f,    0 <= p, 0 <= G - B u, p (G - B u) = 0,    u = u0 at fixed unknowns

K may come from any finite-element program, or be left to it: `solve` then applies K^-1. The active set, the
saddle-point problem and its tolerances are those of a case (`active_set`, `saddle`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, vstack
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, eigsh

from lacmesh.errors import DataError, RequestError
from lacmesh.facts import Described
from lacmesh.mesh import Floats, Ints
from lacsolver.contact.friction import Bounds
from lacsolver.contact.laws import CONTACT, SLIDES, ContactLaw, Unilateral
from lacsolver.equilibrium.active_set import active_set_iterates
from lacsolver.equilibrium.search import search
from lacsolver.equilibrium.state import Iterate
from lacsolver.linear import SingularError
from lacsolver.linear.vectors import WHOLE
from lacsolver.saddle.contact_system import ContactSystem, typical_measures
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.row_group import RowGroup, Rows
from lacsolver.saddle.row_set import ShearRows
from lacsolver.saddle.stiffness import FactorCache, Stiffness
from lacsolver.saddle.tolerances import ConvergenceTolerance

#: a motion costs no energy if it costs less than this part of the mean stiffness
_FREE = 1e-9
#: part of the forces that an inverse of K may leave
_INVERSE = 1e-6
#: largest number of separate bodies whose rigid-body modes are sought in K
_BODIES = 40
#: contact does not hold a motion that it meets with less than this part of the size of its rows
_HELD = 1e-8


@dataclass(frozen=True, eq=False, repr=False)
class ContactSolution(Described):
    """Solution of contact on given matrices, with n displacements and m macro-elements of each pair.

    `u` (n,). `pressure`, `status` (1 closed, 0 open), `gap` integral G - B u: (m,) each, or a tuple of them where
    several pairs were given. `iterations`: number of active sets that were solved. With friction `status` is 2 where
    it slides, and `shear`, the traction on the master, and the `slip` integral B_T u are (m, k) each; else None.

    >>> found = solve_contact([[2.0]], [6.0], [[1.0]], [1.0])
    >>> found.u.round(12).tolist(), found.pressure.round(12).tolist()
    ([1.0], [4.0])
    """

    u: NDArray[np.floating]
    pressure: Any
    gap: Any
    status: Any
    iterations: int
    shear: Any = None
    slip: Any = None

    def _facts(self) -> dict[str, str]:
        pairs = zip(_listed(self.status), _listed(self.pressure), strict=True)
        facts = {"u": f"({len(self.u)},), at most {np.abs(self.u).max(initial=0.0):.6g}"}
        for k, (status, p) in enumerate(pairs):
            name = f"pair {k}" if isinstance(self.status, tuple) else "pressure"
            facts[name] = f"{int((status >= CONTACT).sum())} of {len(p)} closed, at most {p.max(initial=0.0):.6g}"
        return facts | {"iterations": str(self.iterations)}


def solve_contact(
    K: Any,
    f: Floats,
    B: Any,
    G: Any,
    *,
    fixed: Any = (),
    u0: Floats | None = None,
    w: Any = None,
    law: ContactLaw | Sequence[ContactLaw] | None = None,
    solve: Callable[[Floats], Floats] | None = None,
    modes: Floats | None = None,
    backend: str = "auto",
    tolerance: float = 1e-10,
    max_iterations: int = 50,
    B_T: Any = None,
    friction: Any = 0.0,
) -> ContactSolution:
    """Solve K u + Bᵀ p = f with 0 ≤ p, 0 ≤ G − B u, p (G − B u) = 0 by active sets (Semi-smooth Newton, theory.md).

    K (n, n): sparse, symmetric, positive definite on the unknowns that are not fixed; also semidefinite where contact
    holds the bodies, whose rigid-body modes are found in K unless `modes` (n, r) names them. f (n,): forces. B (m, n),
    G (m,): those of `lacsolver.contact_matrices`, or a list of each for several pairs. `fixed` (k,): indices of the
    unknowns with prescribed displacements, `u0` (n,): their values. `w` (m,): measure of each row, needed for laws with
    a compliance; by default what B tells of it, which only scales tolerances. `law`: one for all pairs, or one for each
    (`lacsolver.contact.laws`); `Unilateral()` by default. `solve`: applies K⁻¹ on the unknowns that are not fixed, in
    their order, in place of a factor made here, named by `backend`. `tolerance`: as [solver] of a case. `B_T` (m k, n):
    rows along k tangents, those of `contact_matrices`, and `friction`, its coefficient, a number, (m,), or
    `lacsolver.contact.friction.Bounds`; or a list of each. Slips are counted from u = 0.

    Raises RequestError for arguments that do not fit together, SingularError, DataError if no active set is found
    in `max_iterations`.

    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> system = ls.assemble(example("two_blocks.toml"))
    >>> pair = ls.contact_matrices(system.mesh, "slave", "master")
    >>> found = ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0)
    >>> found.u.shape, found.pressure.shape, int(found.status.sum())
    ((1536,), (36,), 36)
    """
    several = _several(B)
    pairs = _pairs(B, G, w, law) if several else _pairs([B], [G], None if w is None else [w], law)
    if B_T is not None:
        pairs = _with_friction(pairs, B_T if several else [B_T], friction if isinstance(friction, list) else [friction])
    K, f = csr_array(K, dtype=float), np.asarray(f, float)
    n = f.size
    u0 = np.zeros(n) if u0 is None else np.asarray(u0, float)
    free = _free_unknowns(fixed, n)
    _check_shapes(K, f, u0, [pair.matrix for pair in pairs], modes)
    u = u0.copy()
    u[free] = 0.0
    R = None if modes is None else np.linalg.qr(np.asarray(modes, float)[free])[0]
    stiffness = _stiffness(csr_array(K[free][:, free]), R, solve, backend)
    contact = _system(pairs, stiffness, u, free)
    _check_held(contact.rows.B, stiffness.R)
    tolerances = ConvergenceTolerance(tolerance, max_iterations, 0.0, float(np.abs(u).max(initial=0.0)))
    q = np.zeros(len(free))
    start = Iterate(q, np.zeros(len(contact.G)), contact.enforceable & (contact.G < 0))
    load = (f - K @ u)[free]

    def contact_at(q: Floats) -> ContactSystem:
        return contact.with_gaps(contact.G - contact.rows.B @ q)

    outcome = search(active_set_iterates(stiffness, load, contact_at, start, tolerances), tolerances)
    if not outcome.converged:
        balance, gap = outcome.residuals[-1]
        message = f"no active set found in {len(outcome.residuals)} solves: forces are off by {balance:.1e}, gaps by"
        raise DataError(f"{message} {gap:.1e} of the displacements; is K symmetric, and do the rows hold the bodies?")
    u[free] = outcome.iterate.q
    return _answer(u, outcome.iterate, outcome.contact, len(outcome.residuals), several)


@dataclass(frozen=True)
class _Pair:
    """The matrices of one pair, and its law."""

    B: csr_array
    G: Floats
    w: Floats
    law: ContactLaw
    B_T: csr_array | None = None
    bounds: Bounds | None = None

    @property
    def matrix(self) -> csr_array:
        """B, and below it B_T with friction."""
        return self.B if self.B_T is None else csr_array(vstack([self.B, self.B_T]))

    @property
    def n_tangents(self) -> int:
        """Tangents of a macro-element, 0 without friction."""
        return 0 if self.B_T is None else self.B_T.shape[0] // max(len(self.G), 1)


def _listed(given: Any) -> tuple[Any, ...]:
    return tuple(given) if isinstance(given, (list, tuple)) else (given,)


def _several(B: Any) -> bool:
    """True for a list of matrices, False for one, which may be nested lists of numbers."""
    return isinstance(B, (list, tuple)) and all(len(getattr(one, "shape", np.shape(one))) == 2 for one in B)


def _pairs(B: Any, G: Any, w: Any, law: Any) -> list[_Pair]:
    """Return the pairs of given matrices, lists of them. Raises RequestError if they do not belong together."""
    Bs, Gs = [csr_array(np.asarray(one) if isinstance(one, list) else one) for one in B], _listed(G)
    ws = (None,) * len(Bs) if w is None else _listed(w)
    laws = tuple(law) if isinstance(law, (list, tuple)) else (law or Unilateral(),) * len(Bs)
    if not len(Bs) == len(Gs) == len(ws) == len(laws):
        message = f"there are {len(Bs)} matrices B, {len(Gs)} G, {len(ws)} w and {len(laws)} laws"
        raise RequestError(f"{message}; give one of each for every pair")
    pairs = []
    for k, (one, gap, measure, obeyed) in enumerate(zip(Bs, Gs, ws, laws, strict=True)):
        gap = np.asarray(gap, float)
        if not hasattr(obeyed, "yields"):
            raise RequestError(f"pair {k}: law is one of lacsolver.contact.laws, such as Unilateral(), not {obeyed!r}")
        if gap.shape != (one.shape[0],):
            raise RequestError(f"pair {k}: B has {one.shape[0]} rows, and G has the shape {gap.shape}")
        if measure is None and obeyed.yields:
            raise RequestError(f"pair {k}: a law with a compliance needs w, the measure of each row")
        measure = _measures(one) if measure is None else np.asarray(measure, float)
        pairs.append(_Pair(one, gap, np.where(measure > 0, measure, 1.0), obeyed))
    return pairs


def _with_friction(pairs: Sequence[_Pair], B_T: Sequence[Any], friction: Sequence[Any]) -> list[_Pair]:
    """Return pairs with their rows along tangents and their bounds. Raises RequestError if they do not fit."""
    friction = [*friction] * (len(pairs) if len(friction) == 1 else 1)
    if not len(B_T) == len(pairs) == len(friction):
        raise RequestError(
            f"there are {len(pairs)} pairs, {len(B_T)} B_T and {len(friction)} friction; give one of each"
        )
    out = []
    for k, (pair, rows, mu) in enumerate(zip(pairs, B_T, friction, strict=True)):
        own, m = csr_array(np.asarray(rows) if isinstance(rows, list) else rows), len(pair.G)
        if own.shape[0] not in (m, 2 * m):
            raise RequestError(
                f"pair {k}: B has {m} rows and B_T {own.shape[0]}; it takes one or two tangents for each"
            )
        none = np.zeros(m), np.full(m, np.inf)
        bounds = mu if isinstance(mu, Bounds) else Bounds(np.broadcast_to(np.asarray(mu, float), (m,)).copy(), *none)
        if min(values.min(initial=0.0) for values in bounds) < 0:
            raise RequestError(f"pair {k}: friction is {min(values.min() for values in bounds):g}; it must be >= 0")
        out.append(replace(pair, B_T=own, bounds=bounds))
    return out


def _measures(B: csr_array) -> NDArray[np.floating]:
    """Return about the measure (m,) of each row: half the sum of its entries' sizes, as those of both skins add up."""
    return np.asarray(abs(B).sum(axis=1)).ravel() / 2


def _free_unknowns(fixed: Any, n: int) -> Ints:
    fixed = np.asarray(fixed) if len(fixed) else np.empty(0, np.int64)
    whole = fixed.ndim == 1 and fixed.dtype.kind in "iu"  # a mask would be taken for the unknowns 0 and 1
    if not whole or (len(fixed) and not (fixed.min() >= 0 and fixed.max() < n)):
        raise RequestError(f"fixed are indices of unknowns, from 0 to {n - 1}")
    return np.setdiff1d(np.arange(n), fixed)


def _check_shapes(K: csr_array, f: Floats, u0: Floats, Bs: Sequence[csr_array], modes: Floats | None) -> None:
    n = f.size
    if K.shape != (n, n) or f.shape != (n,) or u0.shape != (n,) or any(B.shape[1] != n for B in Bs):
        shapes = ", ".join(str(B.shape) for B in Bs)
        raise RequestError(f"K {K.shape}, f {f.shape}, u0 {u0.shape} and B {shapes} are not of the same unknowns")
    if modes is not None and np.shape(modes)[0] != n:
        raise RequestError(f"modes are (n, r) with n = {n}, not {np.shape(modes)}")
    if not all(np.isfinite(values).all() for values in (K.data, u0, *(B.data for B in Bs))):
        raise RequestError("K, u0 and B must be finite numbers")


def _check_held(B: csr_array, R: Floats) -> None:
    """Raise DataError if no row of B (m, n) meets some motion in the span of R (n, r), which costs no energy."""
    met = np.linalg.svd(B @ R, compute_uv=False)
    loose = R.shape[1] - int((met > _HELD * np.linalg.norm(B.data) * np.abs(R).max(initial=0.0)).sum())
    if loose:
        message = f"nothing holds {loose} of the motions that cost no energy: K is singular there, and no row of B"
        raise DataError(f"{message} meets them; hold them by fixed unknowns, springs in K or contact")


def _rigid_modes(K: csr_array) -> NDArray[np.floating]:
    """Return the motions (n, r) without energy of a semidefinite K, orthonormal; found by shifted inverse iteration."""
    n, scale = K.shape[0], float(np.abs(K.diagonal()).mean()) if K.shape[0] else 0.0
    if n == 0 or scale == 0:
        raise RequestError("K has no stiffness at the unknowns that are not fixed")
    count, _ = connected_components(K, directed=False)
    if count > _BODIES:
        return np.zeros((n, 0))
    shift = _FREE * scale
    k = min(6 * count, n - 1)
    if k < 1:
        return np.zeros((n, 0))
    factor = FactorCache(np.zeros((n, 0))).factorise(csr_array(K + shift * diags_array(np.ones(n))))
    inverse = LinearOperator((n, n), matvec=lambda x: factor.solve(np.ravel(x)))
    start = np.random.default_rng(1).standard_normal(n)
    size, vectors = eigsh(K, k=k, sigma=-shift, OPinv=inverse, v0=start)
    R = vectors[:, size < _FREE * scale]
    return np.linalg.qr(R)[0] if R.shape[1] else R


@dataclass(frozen=True, eq=False)
class _Applied:
    """K^-1 of another program, where a factor of ours would stand."""

    apply_inverse: Callable[[Floats], Floats]
    n: int

    iterative = False
    vectors = WHOLE

    @property
    def shape(self) -> tuple[int, int]:
        return self.n, self.n

    def solve(self, f: Floats) -> NDArray[np.floating]:
        """Return K^-1 f. Raises RequestError for a result of another shape, or that is not finite."""
        u = np.asarray(self.apply_inverse(f), float)
        if u.shape != (self.n,) or not np.isfinite(u).all():
            raise RequestError(
                f"solve returned an array of shape {u.shape}; it takes and returns {self.n} finite numbers"
            )
        return u


def _stiffness(K: csr_array, R: Floats | None, solve: Callable[[Floats], Floats] | None, backend: str) -> Stiffness:
    """Return K with a factor of ours, or with K^-1 of another program. Raises SingularError, RequestError.

    R (n, r): motions without energy; None to find them in K where it is singular.
    """
    none = np.zeros((K.shape[0], 0))
    if solve is not None:
        if R is not None:
            raise RequestError(
                "no solve can apply the inverse of a K that has motions without energy; give one of the two"
            )
        applied: Any = _Applied(solve, K.shape[0])
        _check_inverse(K, applied)
        return Stiffness(K, applied, none)
    if R is not None:
        return FactorCache(R, backend).factorise(K)
    try:
        return FactorCache(none, backend).factorise(K)
    except SingularError:
        R = _rigid_modes(K)
        if not R.shape[1]:
            raise
    return FactorCache(R, backend).factorise(K)


def _check_inverse(K: csr_array, applied: _Applied) -> None:
    """Raise RequestError if `solve` does not apply the inverse of K, by one application to forces of every kind."""
    forces = np.random.default_rng(1).standard_normal(K.shape[0]) * np.sqrt(np.abs(K.diagonal()))
    left = np.abs(K @ applied.solve(forces) - forces).max() / np.abs(forces).max()
    if not left < _INVERSE:
        message = f"solve leaves {left:.1e} of the forces: it does not apply the inverse of K on the unknowns that are"
        raise RequestError(f"{message} not fixed, or K is singular there, as for bodies that only contact holds")


def _system(pairs: Sequence[_Pair], K: Operator, u: Floats, free: Ints) -> ContactSystem:
    """Return the contact rows of all pairs on the free unknowns, with their gaps at the prescribed displacements u."""
    B, groups, first = csr_array(vstack([pair.matrix for pair in pairs])), [], 0
    G, w, yields = ([np.empty(0)] for _ in range(3))
    for pair in pairs:
        own, k = slice(first, first + len(pair.G)), pair.n_tangents
        shear = None if pair.bounds is None else ShearRows.after(own, k * len(pair.G), pair.bounds)
        groups.append(RowGroup(pair.law, own, np.zeros((len(pair.G), pair.law.n_history)), shear=shear))
        first = groups[-1].every.stop
        G.append(np.pad(pair.G, (0, k * len(pair.G))))
        w.append(groups[-1].on_rows(pair.w))
        yields.append(np.repeat([float(pair.law.yields), 0.0], [len(pair.G), k * len(pair.G)]))
    measure, every = np.concatenate(w), np.ones(len(B.indptr) - 1, bool)
    rows = Rows(csr_array(B[:, free]), measure, typical=typical_measures(measure, every, groups))
    moves = (np.diff(rows.B.indptr) > 0) | (np.concatenate(yields) > 0)
    gaps = np.concatenate(G) - B @ u
    system = ContactSystem(rows, gaps, tuple(groups), every, moves, np.ones(len(gaps)))
    return replace(system, skin_stiffness=system.skin_stiffness_of(K, rows))


def _answer(u: Floats, now: Iterate, contact: ContactSystem, iterations: int, several: bool) -> ContactSolution:
    states = list(contact.states(now.p, now.active))
    pressure = tuple(rows.pressure for _, rows in states)
    status = tuple(group.law.status(rows) for group, rows in states)
    gap = tuple(contact.G[group.rows] for group, _ in states)
    shear = tuple(None if group.shear is None else group.shear.vectors(now.p) for group, _ in states)
    slip = tuple(None if group.shear is None else -group.shear.vectors(contact.G) for group, _ in states)
    status = tuple(
        own if group.shear is None else _slides(group.shear, now, own)
        for (group, _), own in zip(states, status, strict=True)
    )
    if several:
        return ContactSolution(u, pressure, gap, status, iterations, shear, slip)
    return ContactSolution(u, pressure[0], gap[0], status[0], iterations, shear[0], slip[0])


def _slides(shear: ShearRows, now: Iterate, status: Ints) -> Ints:
    """Return the status of macro-elements with friction: SLIDES for closed ones that do not stick."""
    return np.where((status == CONTACT) & ~shear.sticks(now.active) & shear.bounds.any, SLIDES, status).astype(np.int8)
