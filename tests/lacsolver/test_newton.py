"""Newton's method on forces, gaps and set at once: small problems made up, with closed answers."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_array

from lacsolver.bodies.finite import InadmissibleError
from lacsolver.results.state import Iterate
from lacsolver.saddle.tolerances import ConvergenceTolerance
from tests.lacsolver.systems import (
    Linearized,
    contact,
    contact_system,
    enumerated,
    factorised,
    rows,
    solve_active_set,
    solve_newton,
    system,
)

LIMITS = ConvergenceTolerance(1e-12, 50, 1.0)


def at_rest(contact):
    """The undeformed bodies, without contact."""
    m, n = contact.rows.B.shape
    return Iterate(np.zeros(n), np.zeros(m), np.zeros(m, bool))


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
        every = np.ones(len(gap), bool)
        made = contact_system(turned, gap, every, ~every, np.ones(len(gap)))
        r = s.f - s.K @ q - size * q**3

        def turning(p):
            return csr_array(-size / 2 * s.B.T @ np.diag(p) @ s.D)

        return Linearized(
            r,
            np.abs(s.f).max(),
            made,
            lambda *_: K,
            turning,
            s.R,
        )

    return at


@pytest.mark.parametrize("seed", range(6))
def test_linear_problems_have_the_answer_of_solve_active_set(seed):
    s = system(seed, n=12, m=6)
    gaps = contact(s)
    start = at_rest(gaps(np.zeros(12)))
    one = solve_newton(linear(s), start, LIMITS)
    other = solve_active_set(s.held, s.f, gaps, start, LIMITS)
    assert one.converged and other.converged and one.iterate.active.any()
    np.testing.assert_allclose(one.iterate.q, other.iterate.q, atol=1e-11)
    np.testing.assert_allclose(one.iterate.p, other.iterate.p, atol=1e-10)
    np.testing.assert_allclose(one.iterate.q, enumerated(s, np.ones(6, bool), np.zeros(6, bool))[0], atol=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_it_converges_quadratically(seed):
    """Each residual below 1e-2 is about the square of the previous one."""
    s = system(seed, n=20, m=8)
    at = nonlinear(s, 0.5)
    outcome = solve_newton(at, at_rest(at(np.zeros(20)).contact), LIMITS)
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


#: Murty's: exchanges of all rows that want it go round in a ring of three sets
MURTY = np.array([[1.0, 2, 0], [0, 1, 2], [2, 0, 1]]), -np.ones(3)


def test_a_cycle_of_sets_is_broken():
    """Complementarity problem M p + r >= 0 with M unsymmetric as D and B are: whole exchanges cycle."""
    M, r = MURTY
    K = np.eye(3)
    there = rows(np.eye(3), M, np.ones(3))  # gap r - M q, q = -p
    every = np.ones(3, bool)
    held = factorised(csr_array(K), np.zeros((3, 0)), backend="superlu")

    def at(q):
        made = contact_system(there, r - M @ q, every, ~every, np.ones(3))
        return Linearized(-q, 1.0, made, lambda damping, *_: held, lambda p: None, np.zeros((3, 0)))

    active, seen = np.array([True, False, False]), []
    for _ in range(7):  # what whole exchanges do
        p = np.zeros(3)
        a = np.flatnonzero(active)
        p[a] = np.linalg.solve(M[np.ix_(a, a)], -r[a])
        seen.append(tuple(active))
        active = np.where(active, p > 0, M @ p + r < 0)
    outcome = solve_newton(at, at_rest(at(np.zeros(3)).contact)._replace(active=np.array([True, False, False])), LIMITS)
    assert len(set(seen)) < len(seen) and tuple(active) != (True, True, True)
    assert outcome.converged and outcome.iterate.active.all()
    np.testing.assert_allclose(outcome.iterate.p, 1 / 3, rtol=1e-12)


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


def test_the_closed_form_of_the_truss():
    y = -np.sqrt(np.hypot(1.0, 0.4) ** (2 / 3) - 1)
    place = truss(0.0)(np.array([0.4 + y]))
    assert -place.r[0] == pytest.approx(PEAK, rel=1e-12)
    before, after = (truss(0.0)(np.array([0.4 + y + d])).stiffness(0.0, True).K[0, 0] for d in (-1e-7, 1e-7))
    assert before * after < 0 and abs(before + after) <= 1e-12


def test_below_the_snap_the_near_equilibrium_is_found():
    outcome = solve_newton(truss(0.9 * PEAK), begin(0.0), LIMITS)
    assert outcome.converged and 0 < outcome.iterate.q[0] < 0.4


def test_a_snap_through_is_got_over_when_dampingged():
    """Just beyond the peak the only equilibrium is far on the other side; Newton's method gives up."""
    at = truss(1.02 * PEAK)
    plain = solve_newton(at, begin(0.2), LIMITS)
    made = solve_newton(at, begin(0.2), LIMITS, damping=1.0)
    assert not plain.converged
    assert made.converged and made.iterate.q[0] > 0.8
    assert abs(at(made.iterate.q).r[0]) <= 1e-12


def test_steps_that_are_not_admissible_are_taken_in_part():
    """Near the limit the tangent is soft and the whole step back far too long."""
    met = []

    def admissible(q):
        met.append(q)
        return q > -0.05

    near = solve_newton(truss(0.9 * PEAK), begin(0.0), LIMITS)
    outcome = solve_newton(truss(0.9 * PEAK, admissible), begin(0.173), LIMITS)
    assert min(met) <= -0.05 and outcome.converged
    assert outcome.iterate.q[0] == pytest.approx(near.iterate.q[0], rel=1e-9)


def test_a_guess_that_is_not_admissible_is_told():
    with pytest.raises(InadmissibleError, match="that far"):
        solve_newton(truss(0.5 * PEAK, lambda q: q < 0.3), begin(0.35), LIMITS)


def test_a_search_that_gets_nowhere_ends():
    """Before it has spent all iterations: no better state in ten steps."""
    outcome = solve_newton(truss(1.02 * PEAK), begin(0.2), ConvergenceTolerance(1e-12, 200, 1.0))
    assert not outcome.converged and len(outcome.residuals) < 100
