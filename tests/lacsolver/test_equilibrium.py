"""Which rows are closed, against all sets there are; that the search ends, on what, and what it costs."""

from __future__ import annotations

import numpy as np
import pytest

import lacsolver.equilibrium.active_set
from lacsolver.results.state import Iterate
from lacsolver.saddle.contact_system import skin_stiffness
from lacsolver.saddle.row_set import RowSet
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import ROUNDING, ConvergenceTolerance
from tests.lacsolver.systems import System, complementarity, contact, enumerated, saddle, solve_active_set, system
from tests.samples import samples

LIMITS = ConvergenceTolerance(1e-10, 50, 1.0)
STARTS = ("none", "all", "random")


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


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", STARTS)
def test_random_problems_from_any_start(kind):
    for seed in range(samples(12, 40)):
        s = system(seed, n=12, m=6)
        outcome = found(s, start(s, kind, seed))
        check(s, outcome)
        assert len(outcome.residuals) <= 12


@pytest.mark.parametrize("kind", STARTS)
def test_rows_that_are_held_and_rows_that_are_not_paired(kind):
    for seed in range(20):
        s, rng = system(seed, n=12, m=7), np.random.default_rng(seed)
        enforceable, equality = rng.uniform(size=7) < 0.7, rng.uniform(size=7) < 0.3
        outcome = found(s, start(s, kind, seed), enforceable=enforceable, equality=equality)
        check(s, outcome, enforceable, equality)
        assert (outcome.iterate.p[~enforceable] == 0).all()


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", STARTS)
def test_a_body_that_contact_alone_holds(kind):
    """Pressed along its free motion, it is stopped; nothing else is asked of what stops it."""
    count, seeds = 0, samples(14, 40)
    for seed in range(seeds):
        s = system(seed, n=10, m=6, free=1)
        if not (s.B @ s.R[:, 0] * np.sign(s.R[:, 0] @ s.f) > 0).any() or enumerated(s, *masks(6)) is None:
            continue  # nothing is in the way
        count += 1
        check(s, found(s, start(s, kind, seed)))
    assert count >= seeds / 2


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


@pytest.mark.parametrize("seed", range(20))
def test_rows_that_say_the_same_twice(seed):
    """Pressures are not unique where rows repeat, their sum is."""
    s = system(seed, n=8, m=4)
    _, p = enumerated(s, *masks(4))
    B = np.vstack([s.B, s.B])
    twice = s._replace(B=B, D=B, w=np.tile(s.w, 2), G=np.tile(s.G, 2))
    outcome = found(twice, start(twice, "random", seed))
    assert outcome.converged and (outcome.iterate.p >= -1e-10).all()
    np.testing.assert_allclose(outcome.iterate.p.reshape(2, 4).sum(axis=0), p, atol=1e-8 * max(1.0, p.max()))


@pytest.mark.parametrize("seed", [0, 23, 26])
def test_rows_that_say_the_same_eight_times(seed):
    """An open row whose twin is closed has a gap of round-off, which closes it no more."""
    s = system(seed, n=8, m=4)
    _, p = enumerated(s, *masks(4))
    B = np.tile(s.B, (8, 1))
    many = s._replace(B=B, D=B, w=np.tile(s.w, 8), G=np.tile(s.G, 8))
    outcome = found(many, start(many, "random", seed))
    assert outcome.converged and (outcome.iterate.p >= -1e-10).all() and len(outcome.residuals) <= 15
    np.testing.assert_allclose(outcome.iterate.p.reshape(8, 4).sum(axis=0), p, atol=1e-8 * max(1.0, p.max()))


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


@pytest.mark.fuzz
@pytest.mark.parametrize("kind", STARTS)
@pytest.mark.parametrize("stiff", [1.0, 1e5])
def test_bodies_that_only_contact_holds(stiff, kind):
    """Stiff ones move far before anything stops them, much farther than they are strained."""
    for seed in range(samples(10, 40)):
        s, p = floating(seed, stiff)
        outcome = found(s, start(s, kind, seed), ConvergenceTolerance(1e-10, 100, 1.0))
        assert outcome.converged, seed
        assert np.abs(outcome.iterate.p - p).max() <= 1e-6, seed


# ---- cycles


def exchanged(M, r, most=200):
    """True if exchanging all violated rows at once converges, starting with every row open."""
    active = np.zeros(len(r), bool)
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
            outcome = found(s, start(s, kind), ConvergenceTolerance(1e-10, 200, 1.0))
            check(s, outcome)
            assert len(outcome.residuals) <= 40


def test_matrices_with_positive_minors_that_are_not_symmetric():
    """Rows of gaps that are others than those of forces: M = 1 + 4 P, P a cycle of five, has minors 1 and 1 + 4^5."""
    rng, count = np.random.default_rng(2), 0
    M = np.eye(5) + 4 * np.roll(np.eye(5), 1, axis=1)
    while count < 5:
        r = rng.normal(size=5)
        if exchanged(M, r):
            continue
        count += 1
        s = complementarity(np.eye(5), r)._replace(D=M)  # q = -p, G = r - M q
        for kind in STARTS:
            outcome = solve_active_set(s.held, s.f, contact(s), start(s, kind), ConvergenceTolerance(1e-10, 200, 1.0))
            p = outcome.iterate.p
            assert outcome.converged and (p >= 0).all() and np.abs(np.minimum(p, M @ p + r)).max() <= 1e-9


# ---- where it ends, and what it costs


def test_it_says_so_if_it_was_not_let_go_on():
    s = system(1, n=12, m=6)
    outcome = found(s, start(s, "random"), ConvergenceTolerance(1e-10, 1, 1.0))
    assert not outcome.converged and len(outcome.residuals) == 1


def test_every_iteration_is_told():
    s, told = system(1, n=12, m=6), []
    outcome = solve_active_set(
        s.held, s.f, contact(s), start(s, "all"), LIMITS, report=lambda *figures: told.append(figures)
    )
    assert [number for number, *_ in told] == list(range(1, len(outcome.residuals) + 1))
    assert [(balance, gap) for *_, balance, gap in told] == list(outcome.residuals)
    assert told[0][1] == 6 and told[-1][1] == (outcome.iterate.p > 0).sum()


def test_sets_are_tried_loosely_and_the_last_one_is_exact(monkeypatch):
    goals = []

    def spied(problem, q, p, tolerance):
        goals.append((tuple(problem.active), tolerance.reduction))
        return solve_saddle(problem, q, p, tolerance)

    monkeypatch.setattr(lacsolver.equilibrium.active_set, "solve_saddle", spied)
    s = system(3, n=60, m=30)
    outcome = solve_active_set(s.held, s.f, contact(s), start(s, "none"), LIMITS)
    assert outcome.converged and goals[-1][1] == 0
    q, p = saddle(s, np.flatnonzero(outcome.iterate.active), np.zeros(60))
    np.testing.assert_allclose(outcome.iterate.q, q, atol=1e-12 * np.abs(q).max())
    np.testing.assert_allclose(outcome.iterate.p, p, atol=1e-12 * np.abs(p).max())
    loose = [active for active, reduction in goals if reduction > 0]
    assert len(set(loose)) == len(loose), "a set that comes back is solved exactly"
    assert len(loose) >= 2


def test_gaps_of_rounding_end_it():
    """A load of nothing leaves gaps that are known to rounding of the coordinates; less is not asked."""
    s = system(0, n=12, m=6)
    length = 100.0
    s = s._replace(f=np.zeros(12), G=0.5 * ROUNDING * length * np.array([1, -1, 1, -1, 1, -1]))
    outcome = found(s, start(s, "none"), ConvergenceTolerance(1e-10, 5, length))
    assert outcome.converged
    beyond = found(s._replace(G=1e6 * s.G), start(s, "none"), ConvergenceTolerance(1e-10, 1, length))
    assert not beyond.converged or beyond.iterate.p.any()


def test_a_step_that_is_as_the_one_before_takes_one_solve():
    """From the answer itself, whatever it weighs."""
    s = system(2, n=12, m=6)
    first = found(s, start(s, "none"))
    again = found(s, first.iterate)
    assert len(again.residuals) == 1 and again.applications <= 2


def test_scaling_changes_nothing():
    """Other units of force and of length: as many solves, the same set."""
    s = system(4, n=30, m=12)
    first = found(s, start(s, "none"))
    for force, length in ((1e9, 1e-3), (1e-6, 1e3)):
        other = s._replace(K=force / length * s.K, f=force * s.f, G=length * s.G, R=s.R)
        made = solve_active_set(
            other.held, other.f, contact(other), start(other, "none"), ConvergenceTolerance(1e-10, 50, length)
        )
        assert made.converged and len(made.residuals) == len(first.residuals)
        np.testing.assert_array_equal(made.iterate.active, first.iterate.active)
        np.testing.assert_allclose(made.iterate.q, length * first.iterate.q, rtol=1e-6, atol=1e-9 * length)


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
