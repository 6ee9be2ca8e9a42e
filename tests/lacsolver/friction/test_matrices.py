"""Friction on matrices: the loop against Lemke's algorithm in the plane, against the law itself in space."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

import lacsolver as ls
from lacmesh.errors import RequestError
from lacsolver.case import Steps
from lacsolver.contact.friction import Bounds, defect
from lacsolver.matrices import read_matrices, write_matrices
from tests.lacsolver.friction.small import coulomb, half_space, solve
from tests.lacsolver.friction.test_output import rubbed
from tests.samples import each_option, samples
from verification.exact.coulomb import condensed, lemke

POINTS = 12


def problem(seed, tangents):
    """Matrices, forces, gaps, slips at the start and a coefficient, at random: rows open, close, stick, slide."""
    rng = np.random.default_rng(seed)
    K, B = half_space(POINTS, tangents, seed)
    f = B.T @ np.concatenate([rng.normal(0.5, 1, POINTS), rng.normal(size=tangents * POINTS)])
    slip = 0.3 * rng.normal(size=tangents * POINTS)
    return K, B, f, rng.uniform(0, 0.5, POINTS), slip, rng.choice([0.1, 0.3, 0.6, 1.0])


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(samples(20, 200)))
def test_plane_is_as_lemke_finds_it(seed):
    K, B, f, G, slip, mu = problem(seed, 1)
    outcome = solve(K, B, f, G, coulomb(mu, POINTS), 1, slip=slip)
    p, t = lemke(condensed(K, f, (B[:POINTS], B[POINTS:]), G, mu, -slip[:, None]))
    assert outcome.converged and len(outcome.residuals) <= 12
    np.testing.assert_allclose(outcome.iterate.p, np.concatenate([p, t.ravel()]), atol=1e-10)


@pytest.mark.parametrize(
    ("seed", "tangents", "cohesion", "limit"),
    each_option(itertools.product(range(6), (1, 2), (0.0, 0.1), (np.inf, 0.2)), of=lambda row: [row[0], row[1:]]),
)
def test_the_law_is_fulfilled(seed, tangents, cohesion, limit):
    K, B, f, G, slip, mu = problem(100 + seed, tangents)
    bounds = Bounds(np.full(POINTS, mu), np.full(POINTS, cohesion), np.full(POINTS, limit))
    outcome = solve(K, B, f, G, bounds, tangents, slip=slip)
    assert outcome.converged
    u, (p, t) = outcome.iterate.q, np.split(outcome.iterate.p, [POINTS])
    gap, S = G - (B @ u)[:POINTS], ((B @ u)[POINTS:] - slip).reshape(POINTS, -1)
    assert np.abs(np.minimum(p, gap)).max() <= 1e-9
    t, b = t.reshape(POINTS, -1), bounds.at(p)[0]
    assert np.abs(defect(t, S, b, np.ones(POINTS))).max() <= 1e-9
    assert (t * S).sum(axis=1).min() >= -1e-9


@pytest.mark.parametrize("tangents", [1, 2])
@pytest.mark.parametrize("seed", range(4))
def test_units_do_not_matter(seed, tangents):
    """Lengths times 1e3, stresses times 1e-6: the same iterations."""
    K, B, f, G, slip, mu = problem(seed, tangents)
    one = solve(K, B, f, G, coulomb(mu, POINTS), tangents, slip=slip)
    other = solve(K * 1e-9, B, f * 1e-6, G * 1e3, coulomb(mu, POINTS), tangents, slip=slip * 1e3)
    assert len(one.residuals) == len(other.residuals)
    np.testing.assert_allclose(other.iterate.p, one.iterate.p * 1e-6, atol=1e-16)


@pytest.mark.parametrize("model", ["plane_strain", "3d"])
def test_given_matrices_are_solved_as_a_case(tmp_path, model):
    """`contact_matrices` and `solve_contact` come to what a case does; `lacsolver matrices` writes the same rows."""
    case, mesh = rubbed(model, "small")
    case = replace(case, steps=Steps(end=1.0, count=1))
    solution = ls.solve(case, mesh)
    zone = solution.contact["joint"]
    system = ls.assemble(case, mesh, t=1.0)
    pair = ls.contact_matrices(system.mesh, "slave", "master")
    given = ls.solve_contact(
        system.K, system.f, pair.B, pair.G, w=pair.w, fixed=system.fixed, u0=system.u0, B_T=pair.B_T, friction=0.4
    )
    np.testing.assert_allclose(given.pressure, zone.pressure, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(given.shear, zone.shear, rtol=1e-6, atol=1e-8)
    np.testing.assert_array_equal(given.status, zone.status)
    np.testing.assert_allclose(pair.tangents, zone.friction.tangents, atol=1e-12)
    write_matrices(tmp_path / "joint.npz", pair, friction=True)
    arrays = read_matrices(tmp_path / "joint.npz")[1]
    assert (arrays["B_T"] != pair.B_T).nnz == 0 and arrays["tangents"].shape == pair.tangents.shape


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"B_T": [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], "friction": 0.1}, "one or two tangents"),
        ({"B_T": [[0.0, 1.0]], "friction": -0.1}, "must be >= 0"),
    ],
)
def test_matrices_that_do_not_fit(given, words):
    with pytest.raises(RequestError, match=words):
        ls.solve_contact([[2.0, 0.0], [0.0, 2.0]], [6.0, 1.0], [[1.0, 0.0]], [1.0], **given)


def test_one_point_sticks_or_slides():
    for push, status, shear in ((1.0, 1, 1.0), (5.0, 2, 2.0)):
        found = ls.solve_contact(
            [[2.0, 0.0], [0.0, 2.0]], [6.0, push], [[1.0, 0.0]], [1.0], B_T=[[0.0, 1.0]], friction=0.5
        )
        assert found.pressure == pytest.approx([4.0]) and found.status.tolist() == [status]
        assert found.shear[0] == pytest.approx([shear]) and found.slip[0] == pytest.approx([(push - shear) / 2])
