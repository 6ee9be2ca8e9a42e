"""Displacements and pressures in one loop: against dense elimination, against a factor, and what it takes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array

from lacsolver.case import Pressure, Solver
from lacsolver.equilibrium.stepping import march
from lacsolver.linear import SingularError, analyse
from lacsolver.problem.problem import Problem
from lacsolver.saddle.stiffness import FactorCache
from lacsolver.saddle.tolerances import LinearTolerance
from tests.lacsolver.patch_meshes import stack
from tests.lacsolver.systems import factorised, solve_rows, system
from tests.lacsolver.test_schur import held_by_cycles, moment
from tests.problems import ELASTIC, case_of, contact, fix, move

EXACT = LinearTolerance(0.0, 1e-14, 1e-18, 0.0)


def test_a_motion_that_no_row_stops_takes_no_part():
    """Its load is the springs', and all the rest is in balance; one row stops one of three."""
    s = system(0, free=3)
    made = solve_rows(held_by_cycles(s), s.rows, np.array([2]), s.f, s.G, np.zeros(30), np.zeros(12), EXACT)
    off = s.f - s.K @ made.q - s.B.T @ made.p
    np.testing.assert_allclose(off, s.R @ (s.R.T @ off), atol=1e-12)
    assert np.abs(s.R.T @ off).max() > 1e-3 and made.left <= 1e-12
    assert np.abs(s.B[2] @ s.R @ (s.R.T @ off)) < 1e-12


def test_nothing_to_do_is_nothing_done():
    s = system(0)
    K, active = held_by_cycles(s), np.arange(8)
    once = solve_rows(K, s.rows, active, s.f, s.G, np.zeros(30), np.zeros(12), EXACT)
    loose = LinearTolerance(0.0, 1e-10, 1e-18, 0.0)
    again = solve_rows(K, s.rows, active, s.f, s.G, once.q, once.p, loose)
    assert again.applications <= 6 and np.abs(again.q - once.q).max() <= 1e-13 * np.abs(once.q).max()
    nothing = solve_rows(K, s.rows, active, 0 * s.f, 0 * s.G, once.q, once.p, EXACT)
    assert not nothing.q.any() and not nothing.p.any() and nothing.applications == 0


# ---- on meshes of several levels


def solution(now, reduction=0.0, active=None):
    K, found = now.reference, now.contact(np.zeros(len(now.f)))
    m = len(found.G)
    active = np.arange(m) if active is None else active
    goal = LinearTolerance(reduction, 1e-13, 1e-18, 0.0)
    return found, solve_rows(K, found.rows, active, now.f, found.G, np.zeros(len(now.f)), np.zeros(m), goal)


@pytest.mark.rows("False")
@pytest.mark.parametrize("free", [False, True])
def test_as_with_a_factor_and_with_few_cycles(free):
    """Results agree with those of a factor, with not many more cycles than K alone needs."""
    for count in (6, 10):
        _, exact = solution(moment(count, free, backend="rslab"))
        now = moment(count, free, backend="multigrid")
        found, made = solution(now)
        np.testing.assert_allclose(made.q, exact.q, atol=1e-10 * np.abs(exact.q).max())
        np.testing.assert_allclose(made.p, exact.p, atol=1e-10 * np.abs(exact.p).max())
        left = now.f - now.reference.K @ made.q - found.rows.B_T @ made.p
        assert np.abs(left).max() <= 1e-12 * np.abs(now.f).max()
        now.reference.solve(now.f - found.rows.B_T @ made.p)
        assert made.applications <= 2.0 * now.reference.factor.n_iterations


def test_a_loose_solve_costs_less():
    now = moment(8, backend="multigrid")
    _, exact = solution(now)
    _, loose = solution(now, 0.1)
    assert 1 <= loose.applications < exact.applications / 3
    assert 1e-6 < np.abs(loose.p - exact.p).max() / np.abs(exact.p).max() < 0.5


def test_hertz_is_as_with_a_factor():
    """A clearance of r^2 / 2R, all steps of the active set."""
    mesh = stack("HEXA8", "HEXA8", 3, counts=(9, 8))
    records = (
        ELASTIC,
        contact(clearance="0.05 * (x**2 + y**2)"),
        fix("bottom", "xyz"),
        move("top", ux=0, uy=0, uz=-0.02),
    )
    (exact,), (made,) = (
        march(Problem.of(case_of(mesh, *records, Solver(backend=name), model="3d"))) for name in ("rslab", "multigrid")
    )
    (one,), (other,) = exact.zones, made.zones
    assert 10 < (one.status == 1).sum() < len(one.status) - 10
    np.testing.assert_array_equal(other.status, one.status)
    np.testing.assert_allclose(made.u, exact.u, atol=1e-9 * np.abs(exact.u).max())
    np.testing.assert_allclose(other.pressure, one.pressure, atol=1e-9 * one.pressure.max())


@pytest.mark.parametrize(
    "slave, master, options",
    [
        ("TETRA10", "HEXA20", {}),
        ("PENTA6 quadrangle", "HEXA27", {"geometry": "current"}),
        ("HEXA8", "TETRA4", {"type": "bilateral"}),
    ],
)
def test_uniform_pressure_goes_through(slave, master, options):
    """Columns on rollers, which multigrid solves as exactly as a factor."""
    rollers = fix("x0", "x"), fix("y0", "y"), fix("bottom", "z")
    records = ELASTIC, contact(**options), *rollers, Pressure(group="top", value=10.0), Solver(backend="multigrid")
    (state,) = march(Problem.of(case_of(stack(slave, master, 3), *records, model="3d")))
    np.testing.assert_allclose(state.zones[0].pressure, 10.0, rtol=1e-9)


# ---- a stiffness like the one before


def changed(K, part):
    """K with springs of a part of its diagonal, on every third unknown: no motion is free any more."""
    return csr_array(K + diags_array(part * K.diagonal() * (np.arange(K.shape[0]) % 3 == 0)))


def multigrid_of(now):
    """Multigrid for stiffnesses like that of a step, whose own is factorised: the cache, and the factor."""
    cache = FactorCache(now.reference.R[:, :0], "multigrid", 1, now.model._whole)
    return cache, cache.factorise(changed(now.reference.K, 0.02))


def test_a_hierarchy_serves_a_stiffness_that_is_like_its_own():
    now = moment(8, backend="multigrid")
    cache, first = multigrid_of(now)
    other = changed(now.reference.K, 0.05)
    made = cache.factorise(other)
    assert made.factor.hierarchy is first.factor.hierarchy
    f = now.f
    q = made.solve(f)
    assert np.linalg.norm(other @ q - f) <= 1e-11 * np.linalg.norm(f)
    found = now.contact(np.zeros(len(f)))
    m = len(found.G)
    exact = factorised(other, first.R[:, :0], backend="rslab")
    one, two = (solve_rows(K, found.rows, np.arange(m), f, found.G, 0 * f, np.zeros(m), EXACT) for K in (made, exact))
    np.testing.assert_allclose(one.q, two.q, atol=1e-9 * np.abs(two.q).max())
    np.testing.assert_allclose(one.p, two.p, atol=1e-9 * np.abs(two.p).max())


def test_a_hierarchy_that_is_stale_is_made_anew():
    now = moment(8, backend="multigrid")
    cache, first = multigrid_of(now)
    first.solve(now.f)
    at_first = first.factor.n_iterations
    other = changed(now.reference.K, 1.0)
    stale = cache.factorise(other)
    stale.solve(now.f)
    assert stale.factor.hierarchy is first.factor.hierarchy and stale.factor.n_iterations > 1.5 * at_first
    fresh = cache.factorise(other)
    assert fresh.factor.hierarchy is not stale.factor.hierarchy
    fresh.solve(now.f)
    assert fresh.factor.n_iterations < stale.factor.n_iterations


def test_a_stiffness_that_is_not_definite_is_an_error():
    """With an older hierarchy too, in a solve and in the loop with rows."""
    now = moment(8, backend="multigrid")
    cache, first = multigrid_of(now)
    n = first.K.shape[0]
    made = cache.factorise(csr_array(now.reference.K - diags_array(0.05 * first.K.diagonal())))
    with pytest.raises(SingularError):
        made.solve(now.f)
    found = now.contact(np.zeros(n))
    m = len(found.G)
    with pytest.raises(SingularError):
        solve_rows(made, found.rows, np.arange(m), now.f, found.G, np.zeros(n), np.zeros(m), EXACT)


@pytest.mark.parametrize("backend", ["rslab", "superlu"])
def test_an_analysis_serves_again(backend, monkeypatch):
    now, made = moment(3, backend=backend), []
    monkeypatch.setattr("lacsolver.saddle.stiffness.analyse", lambda *a, **k: made.append(analyse(*a, **k)) or made[-1])
    f, K = now.f, now.reference.K
    cache = FactorCache(now.reference.R[:, :0], backend)
    for part in (0.2, 0.5):
        other = changed(K, part)
        np.testing.assert_allclose(other @ cache.factorise(other).solve(f), f, atol=1e-11 * np.abs(f).max())
    assert len(made) == 2  # one of the step's own, one of the cache
    wider = csr_array(other + csr_array(([1.0, 1.0], ([0, len(f) - 1], [len(f) - 1, 0])), shape=other.shape))
    np.testing.assert_allclose(wider @ cache.factorise(wider).solve(f), f, atol=1e-11 * np.abs(f).max())
    assert len(made) == 3
