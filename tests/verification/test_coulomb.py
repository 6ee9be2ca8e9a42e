"""Lemke's method, Tresca's fixed point and projections: three independent ways to one solution of Coulomb's problem."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from verification.exact.coulomb import Condensed, bounded, complementary, condensed, gauss_seidel, lemke, tresca

FRICTION = (0.1, 0.3, 0.6, 1.0, 1.5)


def random_problem(m, across, friction, seed):
    """A chain of macro-elements, pressed, opened and sheared at random; pressure and shear are coupled."""
    rng = np.random.default_rng(seed)
    x = np.arange(m) / m
    near = np.exp(-3 * np.abs(x[:, None] - x))
    A = 0.3 * np.eye(m * (1 + across))
    A[:m, :m] += near
    for axis in range(across):
        A[m + axis :: across, m + axis :: across] += near
    A[:m, m::across] += 0.25 * np.sign(x[:, None] - x) * near
    A[m::across, :m] = A[:m, m::across].T
    return Condensed(A, rng.normal(-0.5, 0.7, m), rng.standard_normal((m, across)), np.full(m, friction))


@pytest.mark.parametrize("seed", range(20))
def test_three_ways_find_the_same_tractions(seed):
    given = random_problem(12, 1, FRICTION[seed % 5], seed)
    solutions = [way(given) for way in (lemke, tresca, gauss_seidel)]
    for p, t in solutions:
        assert given.residual(p, t) < 1e-11
        np.testing.assert_allclose(p, solutions[0][0], atol=1e-9)
        np.testing.assert_allclose(t, solutions[0][1], atol=1e-9)


def test_solution_does_not_depend_on_units():
    given = random_problem(10, 1, 0.5, 3)
    scaled = Condensed(1e-9 * given.A, 1e-3 * given.G, 1e-3 * given.S, given.friction)
    for way in (lemke, tresca, gauss_seidel):
        np.testing.assert_allclose(way(scaled)[0], 1e6 * way(given)[0], rtol=1e-8, atol=1e-2)


@pytest.mark.parametrize("seed", range(3))
def test_projections_solve_problems_in_space(seed):
    given = random_problem(9, 2, 0.6, seed)
    p, t = gauss_seidel(given)
    G, S = given.gaps(p, t)
    assert p.min() >= 0 and G.min() > -1e-10 and np.abs(p * G).max() < 1e-9
    length, slides = np.linalg.norm(t, axis=1), np.linalg.norm(S, axis=1) > 1e-8
    slides &= p > 0
    assert (length <= 0.6 * p + 1e-12).all() and slides.any() and not slides.all()
    np.testing.assert_allclose(t[slides], 0.6 * p[slides, None] * _unit(S[slides]), atol=1e-8)


def _unit(v):
    return v / np.linalg.norm(v, axis=1)[:, None]


def test_residual_sees_what_is_wrong():
    given = random_problem(8, 1, 0.3, 0)
    p, t = lemke(given)
    closed = int(p.argmax())
    for off_p, off_t in ((1e-3, 0.0), (0.0, 1e-3)):
        q, s = p.copy(), t.copy()
        q[closed], s[closed] = q[closed] + off_p, s[closed] + off_t
        assert given.residual(q, s) > 1e-5


def test_one_block_on_a_plane_slides_where_more_than_friction_is_asked():
    """A spring of stiffness 1 either way, pressed in by 2 and moved aside by s: t = min(s, mu 2)."""
    for s, t in ((0.1, 0.1), (0.59, 0.59), (0.61, 0.6), (-5.0, -0.6)):
        given = Condensed(np.eye(2), np.array([-2.0]), np.array([[s]]), np.array([0.3]))
        for way in (lemke, tresca, gauss_seidel):
            found = way(given)
            assert (found[0][0], found[1][0, 0]) == pytest.approx((2.0, t))


def test_matrices_are_condensed():
    """Two springs: what they do under tractions is what A says."""
    K, f = np.diag([2.0, 4.0]), np.array([1.0, -1.0])
    given = condensed(K, f, (np.array([[0.0, -1.0]]), np.array([[1.0, 0.0]])), np.array([0.1]), 0.3)
    p, t = np.array([0.7]), np.array([[0.2]])
    u = np.linalg.solve(K, f - np.array([t[0, 0], -p[0]]))
    G, S = given.gaps(p, t)
    assert (G[0], S[0, 0]) == pytest.approx((0.1 + u[1], u[0]))


def test_complementarity_problems_are_solved():
    """Against trying every set of unknowns that are zero."""
    rng = np.random.default_rng(0)
    for _ in range(10):
        L, q = rng.standard_normal((5, 5)), rng.standard_normal(5)
        M = L @ L.T + 0.1 * np.eye(5)
        z, w = _by_trying(M, q)
        np.testing.assert_allclose(complementary(M, q), z, atol=1e-10)
        np.testing.assert_allclose(bounded(M, q, np.zeros(5), np.full(5, np.inf)), z, atol=1e-10)
        assert w.min() >= -1e-12


def _by_trying(M, q):
    for free in itertools.product([False, True], repeat=len(q)):
        at, z = np.array(free), np.zeros(len(q))
        z[at] = np.linalg.solve(M[np.ix_(at, at)], -q[at])
        w = M @ z + q
        if z.min() >= -1e-12 and w.min() >= -1e-12:
            return z, w
    raise AssertionError


def test_problem_without_solution_is_refused():
    with pytest.raises(ArithmeticError):
        complementary(np.array([[0.0, 1.0], [0.0, -1.0]]), np.array([-1.0, -1.0]))
