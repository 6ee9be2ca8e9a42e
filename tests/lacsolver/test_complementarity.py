"""The search for equilibrium on random systems, whatever contact they might come from.

Small ones are solved by trying every set. With K definite, p is the one solution of 0 <= p, 0 <= S p - g, their product
0, with S = B K^-1 B^T and g = B K^-1 f - G_0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.sparse import csr_array

from lacsolver.results.state import Iterate
from lacsolver.saddle.contact_system import skin_stiffness
from lacsolver.saddle.tolerances import ConvergenceTolerance
from tests.lacsolver.systems import contact_system, factorised, rows, solve_active_set

#: of `random_system`, those on which exchanging all rows that want it goes round in a circle
CIRCLES = (57, 66, 567, 768, 790, 1180, 1492, 1762, 2407, 2675, 3132, 3173)


class System(NamedTuple):
    """K q + B^T p = f, G = G_0 - B q."""

    K: np.ndarray
    B: np.ndarray
    f: np.ndarray
    G0: np.ndarray
    start: np.ndarray

    @property
    def reduced(self):
        """S and g."""
        made = np.linalg.solve(self.K, np.column_stack([self.B.T, self.f]))
        return self.B @ made[:, :-1], self.B @ made[:, -1] - self.G0


def random_system(seed, m=6, n=8):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    K = A @ A.T + 1e-3 * np.eye(n)
    B, G0, f = rng.normal(size=(m, n)), rng.normal(size=m), rng.normal(size=n) * 3
    return System(K, B, f, G0, rng.random(m) < 0.5)


def search(system, *, R=None, held=None, paired=None, iterations=100):
    """The outcome for a system; `R`: motions that K does not resist."""
    m, n = system.B.shape
    held = np.zeros(m, bool) if held is None else held
    paired = np.ones(m, bool) if paired is None else paired
    K = factorised(csr_array(system.K), np.zeros((n, 0)) if R is None else R)
    there = rows(system.B, system.B, np.ones(m))
    c = skin_stiffness(K, there)

    def contact(q):
        return contact_system(there, system.G0 - system.B @ q, paired, held, c)

    start = Iterate(np.zeros(n), np.zeros(m), system.start)
    return solve_active_set(K, system.f, contact, start, ConvergenceTolerance(1e-10, iterations, 1.0))


def by_trying_every_set(system, held=None, paired=None):
    """Pressures of every active set that meets all conditions."""
    S, g = system.reduced
    m = len(g)
    held = np.zeros(m, bool) if held is None else held
    paired = np.ones(m, bool) if paired is None else paired
    found = []
    for bits in range(1 << m):
        on = np.array([bits >> k & 1 for k in range(m)], bool)
        if (on & ~paired).any() or (held & paired & ~on).any():
            continue
        p = np.zeros(m)
        p[on] = np.linalg.solve(S[np.ix_(on, on)], g[on])
        free = paired & ~held
        if (p[free] >= 0).all() and ((S @ p - g)[free & ~on] >= 0).all():
            found.append(p)
    return found


def goes_round(system):
    """True if exchanging all violated rows at once, and nothing else, returns to an earlier active set: a cycle."""
    S, g = system.reduced
    on, seen = system.start.copy(), set()
    while on.tobytes() not in seen:
        seen.add(on.tobytes())
        p = np.zeros(len(g))
        p[on] = np.linalg.solve(S[np.ix_(on, on)], g[on])
        wanted = np.where(on, p > 0, S @ p - g < 0)
        if (wanted == on).all():
            return False
        on = wanted
    return True


def check(outcome, wanted):
    assert outcome.converged, outcome.residuals[-1]
    np.testing.assert_allclose(outcome.iterate.p, wanted, atol=1e-8 * max(1.0, np.abs(wanted).max()))


@pytest.mark.parametrize("seed", range(100))
def test_a_random_system_has_the_solution_that_trying_every_set_finds(seed):
    system = random_system(seed, m=3 + seed % 5, n=8 + seed % 3)
    (p,) = by_trying_every_set(system)
    check(search(system), p)


@pytest.mark.parametrize("seed", CIRCLES)
def test_a_search_that_would_go_round_in_a_circle_ends(seed):
    system = random_system(seed)
    assert goes_round(system)
    (p,) = by_trying_every_set(system)
    check(search(system), p)


@pytest.mark.parametrize("seed", range(40))
def test_rows_that_are_held_and_rows_that_are_not_paired(seed):
    rng = np.random.default_rng(1000 + seed)
    system = random_system(seed)
    held, paired = rng.random(6) < 0.3, rng.random(6) < 0.8
    (p,) = by_trying_every_set(system, held, paired)
    outcome = search(system, held=held, paired=paired)
    check(outcome, p)
    assert (outcome.iterate.p[~paired] == 0).all()


@pytest.mark.parametrize("seed", range(20))
def test_rows_that_only_touch(seed):
    """p = 0 and G = 0 at once, in half of the rows: where a set may change for ever on round-off."""
    system = random_system(seed)
    rng = np.random.default_rng(seed)
    p = np.where(rng.random(6) < 0.5, rng.uniform(0.1, 1, 6), 0.0)
    q = np.linalg.solve(system.K, system.f - system.B.T @ p)
    check(search(system._replace(G0=system.B @ q)), p)


@pytest.mark.parametrize("seed", range(20))
def test_rows_that_say_the_same_twice(seed):
    """Pressures are not unique where rows repeat, their sum is."""
    system = random_system(seed, m=4)
    (p,) = by_trying_every_set(system)
    twice = system._replace(B=np.vstack([system.B, system.B]), G0=np.tile(system.G0, 2), start=np.tile(system.start, 2))
    outcome = search(twice)
    assert outcome.converged and (outcome.iterate.p >= -1e-10).all()
    np.testing.assert_allclose(outcome.iterate.p.reshape(2, 4).sum(axis=0), p, atol=1e-8 * max(1.0, p.max()))


def floating(seed, stiff, start):
    """A system with motions that K does not resist, its solution (p, G) chosen; R, p."""
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
    first = {"none": np.zeros(m, bool), "all": np.ones(m, bool), "random": rng.random(m) < 0.5}[start]
    return System(K, B, K @ q + B.T @ p, G + B @ q, first), R, p


@pytest.mark.parametrize("start", ["none", "all", "random"])
@pytest.mark.parametrize("stiff", [1.0, 1e5])
def test_bodies_that_only_contact_holds(stiff, start):
    """Stiff ones move far before anything stops them, much farther than they are strained."""
    for seed in range(40):
        system, R, p = floating(seed, stiff, start)
        outcome = search(system, R=R)
        assert outcome.converged, seed
        assert np.abs(outcome.iterate.p - p).max() <= 1e-6, seed


def test_a_load_that_nothing_stops_is_no_equilibrium():
    system, R, _ = floating(0, 1.0, "all")
    assert not search(system._replace(f=system.f - 100 * R[:, 0] * np.sign((system.B @ R[:, 0]).sum())), R=R).converged
