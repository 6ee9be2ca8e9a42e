"""Searches: which rows are closed, against all sets there are; Newton's method on forces, gaps and set at once.

That they end, on what, and what it costs; small problems made up, with closed answers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_array

from lacsolver.bodies.errors import InadmissibleError
from lacsolver.equilibrium.state import Iterate
from lacsolver.saddle.contact_system import skin_stiffness
from lacsolver.saddle.row_set import RowSet
from lacsolver.saddle.tolerances import ROUNDING, ConvergenceTolerance, ForceTerms, equilibrium_residual
from tests.lacsolver.systems import (
    Linearized,
    System,
    complementarity,
    contact,
    contact_system,
    enumerated,
    factorised,
    rows,
    saddle,
    solve_active_set,
    solve_newton,
    system,
)
from tests.samples import samples

LIMITS, EXACT = ConvergenceTolerance(1e-10, 50, 1.0), ConvergenceTolerance(1e-12, 50, 1.0)
LONG = ConvergenceTolerance(1e-10, 200, 1.0)
STARTS = ("none", "all", "random")
FROM_EVERY_START = pytest.mark.parametrize("kind", STARTS)


def start(s, kind, seed=0):
    n, m = len(s.K), len(s.B)
    rng = np.random.default_rng(seed)
    if kind == "random":
        return Iterate(rng.normal(size=n), rng.normal(size=m), rng.uniform(size=m) < 0.5)
    return Iterate(np.zeros(n), np.zeros(m), np.full(m, kind == "all"))


def found(s, begin, limits=LIMITS, **rest):
    at = contact(s, **rest)
    return solve_active_set(s.held, s.f, at, begin, limits)


def check(s, outcome, enforceable=None, equality=None):
    """Assert that the search converged to the only solution."""
    m = len(s.B)
    enforceable = np.ones(m, bool) if enforceable is None else enforceable
    equality = np.zeros(m, bool) if equality is None else equality
    q, p = enumerated(s, enforceable, equality)
    assert outcome.converged
    np.testing.assert_allclose(outcome.iterate.q, q, atol=1e-9 * max(np.abs(q).max(), 1e-3))
    np.testing.assert_allclose(outcome.iterate.p, p, atol=1e-9 * max(np.abs(p).max(), 1e-3))
    np.testing.assert_allclose(outcome.contact.G, s.G - s.B @ q, atol=1e-9 * max(np.abs(q).max(), 1e-3))


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
def test_the_energy_of_a_step_is_least_where_springs_have_the_pressure_of_the_balance(unit):
    """Half of what they have at the end of the step, in which a gap of 1 becomes an overlap of 1."""
    soft = contact(complementarity(np.eye(1), np.zeros(1)))(np.ones(1)).with_springs(unit)
    half = np.full(1, 0.5 / unit)
    assert soft.least_energy(np.ones(1), half, half) == pytest.approx(0.75)


@pytest.mark.rows("none")
@pytest.mark.fuzz
@FROM_EVERY_START
def test_random_problems_from_any_start(kind):
    for seed in range(samples(12, 40)):
        s = system(seed, n=12, m=6)
        outcome = found(s, start(s, kind, seed))
        check(s, outcome)
        assert len(outcome.residuals) <= 12


@pytest.mark.rows("all")
@FROM_EVERY_START
def test_rows_that_are_held_and_rows_that_are_not_paired(kind):
    for seed in range(20):
        s, rng = system(seed, n=12, m=7), np.random.default_rng(seed)
        enforceable, equality = rng.uniform(size=7) < 0.7, rng.uniform(size=7) < 0.3
        outcome = found(s, start(s, kind, seed), enforceable=enforceable, equality=equality)
        check(s, outcome, enforceable, equality)
        assert (outcome.iterate.p[~enforceable] == 0).all()


def masks(m):
    return np.ones(m, bool), np.zeros(m, bool)


def test_a_body_that_nothing_stops():
    """The search says that it found none."""
    s = system(0, n=10, m=3, free=1)
    away = np.abs(s.B @ s.R[:, :1])
    s = s._replace(B=s.B - 2 * away * s.R.T, D=s.B - 2 * away * s.R.T, f=s.f + 5 * s.R[:, 0])
    assert (s.B @ s.R[:, 0] <= 0).all() and enumerated(s, *masks(3)) is None
    assert not found(s, start(s, "none")).converged


@pytest.mark.parametrize("seed", range(20))
def test_rows_that_only_touch(seed):
    """p = 0 and G = 0 at once, in half of the rows: where a set may change for ever on round-off."""
    s, rng = system(seed, n=8, m=6), np.random.default_rng(seed)
    p = np.where(rng.random(6) < 0.5, rng.uniform(0.1, 1, 6), 0.0)
    s = s._replace(G=s.B @ np.linalg.solve(s.K, s.f - s.B.T @ p))
    outcome = found(s, start(s, "random", seed))
    assert outcome.converged
    np.testing.assert_allclose(outcome.iterate.p, p, atol=1e-8 * max(1.0, p.max()))


@pytest.mark.parametrize("copies, seed", [*((2, seed) for seed in range(20)), (8, 0), (8, 23), (8, 26)])
def test_rows_that_say_the_same_several_times(copies, seed):
    """Pressures are not unique where rows repeat, their sum is; an open row's gap of round-off closes it no more."""
    s = system(seed, n=8, m=4)
    _, p = enumerated(s, *masks(4))
    B = np.tile(s.B, (copies, 1))
    many = s._replace(B=B, D=B, w=np.tile(s.w, copies), G=np.tile(s.G, copies))
    outcome = found(many, start(many, "random", seed))
    assert outcome.converged and (outcome.iterate.p >= -1e-10).all() and len(outcome.residuals) <= 15
    np.testing.assert_allclose(outcome.iterate.p.reshape(copies, 4).sum(axis=0), p, atol=1e-8 * max(1.0, p.max()))


@pytest.mark.parametrize("size", [1.0, 1e-20])
def test_round_off_opens_and_closes_no_row(size):
    s = system(1, n=12, m=4)._replace(G=size * np.array([1.0, -1.0, 1e-15, -1e-15]))
    at, p = contact(s)(np.zeros(12)), size * np.array([1e-15, 1.0, -1.0, -1e-15])
    for before, after in (([0, 0, 0, 0], [0, 1, 0, 0]), ([1, 1, 1, 1], [1, 1, 0, 1])):
        rows = at.next_rows(RowSet.of(np.array(before, bool)), p, 1e-12 * size)
        assert rows.active.tolist() == [bool(one) for one in after]


def floating(seed, stiff):
    """A system with motions that K does not resist, whose solution is chosen, and its pressures."""
    rng = np.random.default_rng(seed)
    r = int(rng.integers(1, 4))
    m = int(rng.integers(r + 2, 12))
    n = m + int(rng.integers(r + 1, 8))
    R = np.linalg.qr(rng.normal(size=(n, r)))[0]
    A, P = rng.normal(size=(n, n)), np.eye(n) - R @ R.T
    K = stiff * P @ (A @ A.T + 0.1 * np.eye(n)) @ P
    along = rng.normal(size=(m, r))
    along[:, 0] = np.abs(along[:, 0])  # all rows oppose one motion
    B = rng.normal(size=(m, n)) @ P + along @ R.T
    on = rng.random(m) < 0.5
    on[: r + 1] = True
    p, G = np.where(on, rng.uniform(0.1, 1, m), 0.0), np.where(on, 0.0, rng.uniform(0.01, 1, m))
    q = R @ rng.normal(size=r) + rng.normal(size=n) / stiff
    return System((K + K.T) / 2, B, B, np.zeros((n, n)), np.ones(m), R, K @ q + B.T @ p, G + B @ q), p


@pytest.mark.rows("1.0-all", "100000.0-none")
@pytest.mark.fuzz
@FROM_EVERY_START
@pytest.mark.parametrize("stiff", [1.0, 1e5])
def test_bodies_that_only_contact_holds(stiff, kind):
    """Stiff ones move far before anything stops them, much farther than they are strained."""
    for seed in range(samples(10, 40)):
        s, p = floating(seed, stiff)
        outcome = found(s, start(s, kind, seed), ConvergenceTolerance(1e-10, 100, 1.0))
        assert outcome.converged, seed
        assert np.abs(outcome.iterate.p - p).max() <= 1e-6, seed


# ---- cycles


def exchanged(M, r, most=200, first=False):
    """True if exchanging all violated rows at once converges, starting with every row open, or with `first`."""
    active = np.zeros(len(r), bool) | first
    for _ in range(most):
        p = np.zeros(len(r))
        p[active] = np.linalg.solve(M[np.ix_(active, active)], -r[active])
        wanted = np.where(active, p > 0, M @ p + r < 0)
        if (wanted == active).all():
            return True
        active = wanted
    return False


def cycling(count, m=6):
    """Symmetric, positive matrices and right-hand sides on which plain exchange goes round for ever."""
    made, rng = [], np.random.default_rng(1)
    while len(made) < count:
        root = rng.normal(size=(m, m))
        M, r = root @ root.T + 0.02 * np.eye(m), rng.normal(size=m)
        if not exchanged(M, r):
            made.append((M, r))
    return made


@pytest.mark.fuzz
def test_where_plain_exchange_goes_round_the_search_ends():
    for M, r in cycling(samples(3, 10)):
        s = complementarity(M, r)
        for kind in STARTS:
            outcome = found(s, start(s, kind), LONG)
            check(s, outcome)
            assert len(outcome.residuals) <= 40


def test_a_matrix_with_positive_minors_that_is_not_symmetric():
    """Murty's: rows of gaps are others than those of forces, and exchanges go round in a ring of three sets."""
    M, ring = np.eye(3) + 2 * np.roll(np.eye(3), 1, axis=1), np.array([True, False, False])
    assert not exchanged(M, -np.ones(3), first=ring)
    s = complementarity(np.eye(3), -np.ones(3))._replace(D=M)  # q = -p, G = r - M q
    for outcome in (
        solve_newton(linear(s), start(s, "none")._replace(active=ring), EXACT),
        solve_active_set(s.held, s.f, contact(s), start(s, "none")._replace(active=ring), LONG),
    ):
        assert outcome.converged and outcome.iterate.active.all()
        np.testing.assert_allclose(outcome.iterate.p, 1 / 3, rtol=1e-12)


# ---- where it ends, and what it costs


def test_every_iteration_is_told_and_it_says_so_if_it_was_not_let_go_on():
    s, told = system(1, n=12, m=6), []
    outcome = solve_active_set(s.held, s.f, contact(s), start(s, "all"), LIMITS, report=lambda *row: told.append(row))
    assert [number for number, *_ in told] == list(range(1, len(outcome.residuals) + 1))
    assert [(balance, gap) for *_, balance, gap in told] == list(outcome.residuals)
    assert told[0][1] == 6 and told[-1][1] == (outcome.iterate.p > 0).sum()
    short = found(s, start(s, "random"), ConvergenceTolerance(1e-10, 1, 1.0))
    assert not short.converged and len(short.residuals) == 1


def test_gaps_of_rounding_end_it():
    """A load of nothing leaves gaps that are known to rounding of the coordinates; less is not asked."""
    s = system(0, n=12, m=6)
    length = 100.0
    s = s._replace(f=np.zeros(12), G=0.5 * ROUNDING * length * np.array([1, -1, 1, -1, 1, -1]))
    outcome = found(s, start(s, "none"), ConvergenceTolerance(1e-10, 5, length))
    assert outcome.converged
    beyond = found(s._replace(G=1e6 * s.G), start(s, "none"), ConvergenceTolerance(1e-10, 1, length))
    assert not beyond.converged or beyond.iterate.p.any()


@pytest.mark.parametrize(("r", "residual"), [(1e-3, 1e-3), (3e-8, 3e-8), (3e-9, 3e-11), (0.0, 0.0)])
def test_residual_is_relative_to_the_force_above_the_round_off_of_coordinates(r, residual):
    """A force of 1 on coordinates of 1 and a stiffness of 1e6, so that round-off is 1e-8 and not the scale."""
    terms = ForceTerms(np.array([1.0]), np.array([1e6]))
    q = np.array([1e-6])
    compared, relative = equilibrium_residual(np.array([r]), 1.0, lambda: terms, LIMITS, q)
    assert relative == pytest.approx(residual) and compared == pytest.approx(r / 100)


def test_the_last_set_is_solved_exactly_and_a_step_that_is_as_the_one_before_takes_one_solve():
    s = system(3, n=60, m=30)
    first = found(s, start(s, "none"))
    q, _ = saddle(s, np.flatnonzero(first.iterate.active), np.zeros(60))
    np.testing.assert_allclose(first.iterate.q, q, atol=1e-12 * np.abs(q).max())
    again = found(s, first.iterate)
    assert len(again.residuals) == 1 and again.applications <= 2


def test_the_stiffness_of_a_row_is_that_of_its_own_skin():
    """c = w (b K b) / (b b)^2: stress over length; 1 where there is nothing to say."""
    s = system(5)
    B = s.B.copy()
    B[3] = 0.0
    s = s._replace(B=B, D=B)
    c = skin_stiffness(s.held, s.rows)
    for m in range(len(B)):
        b = B[m]
        want = s.w[m] * (b @ s.K @ b) / (b @ b) ** 2 if b.any() else 1.0
        assert c[m] == pytest.approx(want, rel=1e-12)


# ---- Newton's method


def linear(s):
    """`at` of a linear system."""
    gaps, held = contact(s), s.held
    size = np.abs(s.f).max()
    return lambda q: Linearized(s.f - s.K @ q, size, gaps(q), lambda damping, *_: held, lambda p: None, s.R)


def nonlinear(s, size):
    """`at` of a system with forces size * q^3 beside K q, and gaps that bend: G - D q + size / 4 (D q)^2."""

    def at(q):
        K = factorised(csr_array(s.K + np.diag(3 * size * q**2)), s.R, backend="superlu")
        bent = 1 - size / 2 * (s.D @ q)
        turned = rows(bent[:, None] * s.B, bent[:, None] * s.D, s.w)
        gap = s.G - s.D @ q + size / 4 * (s.D @ q) ** 2
        made = contact_system(turned, gap, *masks(len(gap)), np.ones(len(gap)))
        r = s.f - s.K @ q - size * q**3
        turning = lambda p: csr_array(-size / 2 * s.B.T @ np.diag(p) @ s.D)  # noqa: E731
        return Linearized(r, np.abs(s.f).max(), made, lambda *_: K, turning, s.R)

    return at


@pytest.mark.parametrize("seed", range(6))
def test_it_converges_quadratically(seed):
    """Each residual below 1e-2 is about the square of the previous one."""
    s = system(seed, n=20, m=8)
    at = nonlinear(s, 0.5)
    outcome = solve_newton(at, start(s, "none"), EXACT)
    assert outcome.converged and outcome.iterate.active.any()
    q, p, _ = outcome.iterate
    place = at(q)
    assert np.abs(place.r - place.contact.rows.B_T @ p).max() <= 1e-11
    assert (p >= -1e-12).all() and (place.contact.G >= -1e-11).all() and np.abs(p * place.contact.G).max() <= 1e-11
    worst = np.array([max(pair) for pair in outcome.residuals])
    tail = worst[np.flatnonzero(worst > 1e-2)[-1] + 1 :] if (worst > 1e-2).any() else worst
    assert len(tail) >= 2
    for before, after in pairwise(tail):
        assert after <= max(5 * before**2, 1e-13)


def truss(load, admissible=lambda q: True):
    """Two bars of unit stiffness from (-1, 0) and (1, 0) to a node at height 0.4, pushed down by q: one unknown.

    f(q) = 2 (1 - l0 / l) y, y = q - 0.4, l^2 = 1 + y^2: it snaps through at y^2 = l0^(2/3) - 1.
    """
    l0 = np.hypot(1.0, 0.4)
    empty = csr_array((0, 1))
    none = np.zeros(0, bool)

    def at(q):
        if not admissible(q[0]):
            raise InadmissibleError("that far is not allowed")
        y = q[0] - 0.4
        size = np.sqrt(1 + y**2)
        force, slope = 2 * (1 - l0 / size) * y, 2 * (1 - l0 / size**3)
        made = contact_system(rows(empty, empty, np.zeros(0)), np.zeros(0), none, none, np.zeros(0))
        soft = 2 * (1 - 1 / l0**2)

        def stiffness(damping, *_):
            return factorised(
                csr_array([[slope + damping * soft]]), np.zeros((1, 0)), backend="superlu", definite=False
            )

        return Linearized(
            np.array([load - force]), max(abs(load), abs(force)), made, stiffness, lambda p: None, np.zeros((1, 0))
        )

    return at


PEAK = 2 * (np.hypot(1.0, 0.4) ** (2 / 3) - 1) ** 1.5  # at its limit, pushed down


def begin(q):
    return Iterate(np.array([float(q)]), np.zeros(0), np.zeros(0, bool))


def test_the_truss_is_pushed_to_its_limit_and_beyond():
    """Beyond the peak the only equilibrium is far on the other side; Newton's method gives up, and ends before long."""
    y = -np.sqrt(np.hypot(1.0, 0.4) ** (2 / 3) - 1)
    before, peak, after = (truss(0.0)(np.array([0.4 + y + h])).r[0] for h in (-1e-6, 0.0, 1e-6))
    assert -peak == pytest.approx(PEAK, rel=1e-12) and abs(after - before) <= 1e-12
    below = solve_newton(truss(0.9 * PEAK), begin(0.0), EXACT)
    assert below.converged and 0 < below.iterate.q[0] < 0.4
    at = truss(1.02 * PEAK)
    plain = solve_newton(at, begin(0.2), ConvergenceTolerance(1e-12, 200, 1.0))
    assert not plain.converged and len(plain.residuals) < 100
    damped = solve_newton(at, begin(0.2), EXACT, damping=1.0)
    assert damped.converged and damped.iterate.q[0] > 0.8
    assert abs(at(damped.iterate.q).r[0]) <= 1e-12


def test_steps_that_are_not_admissible_are_taken_in_part():
    """Near the limit the tangent is soft and the whole step back far too long."""
    met = []

    def admissible(q):
        met.append(q)
        return q > -0.05

    near = solve_newton(truss(0.9 * PEAK), begin(0.0), EXACT)
    outcome = solve_newton(truss(0.9 * PEAK, admissible), begin(0.173), EXACT)
    assert min(met) <= -0.05 and outcome.converged
    assert outcome.iterate.q[0] == pytest.approx(near.iterate.q[0], rel=1e-9)


def test_a_guess_that_is_not_admissible_is_told():
    with pytest.raises(InadmissibleError):
        solve_newton(truss(0.5 * PEAK, lambda q: q < 0.3), begin(0.35), EXACT)
