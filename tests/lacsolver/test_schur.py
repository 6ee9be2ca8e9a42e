"""Solutions of the saddle system on one factor of K, against dense elimination; and how many products they take."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from lacsolver.case import parse_case
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.problem.problem import Problem
from lacsolver.saddle.kept_directions import KeptDirections
from lacsolver.saddle.tolerances import LinearTolerance
from tests.lacsolver.contact_cases import HEAD, JOINT, MATERIAL, SLIDING, YOUNG, at, held, pressed
from tests.lacsolver.patch_meshes import stack
from tests.lacsolver.systems import factorised, saddle, solve_rows, system

EXACT = LinearTolerance(0.0, 1e-14, 1e-18, 0.0)
KINDS = {
    "held": {},
    "one set of rows for forces, another for gaps": {"same": False},
    "free to move": {"free": 3},
    "free to move, two sets": {"free": 3, "same": False},
    "turning": {"turning": 0.3, "same": False},
    "turning and free": {"turning": 0.1, "same": False, "free": 2},
}
for_kinds = pytest.mark.parametrize("kind", KINDS)


def solved(s, active, goal=EXACT, q0=None, p0=None, K=None, kept=None):
    n, m = len(s.K), len(s.B)
    q0, p0 = np.zeros(n) if q0 is None else q0, np.zeros(m) if p0 is None else p0
    turning = csr_array(s.C) if s.C.any() else None
    return solve_rows(s.held if K is None else K, s.rows, np.asarray(active), s.f, s.G, q0, p0, goal, turning, kept)


def held_by_cycles(s):
    """K of a small system with a hierarchy, which is the coarsest level alone."""
    return factorised(csr_array(s.K), s.R, backend="multigrid")


@for_kinds
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("multigrid", [False, True], ids=["factor", "multigrid"])
def test_the_saddle_system(kind, seed, multigrid):
    s = system(seed, **KINDS[kind])
    rng, K = np.random.default_rng(seed), held_by_cycles(s) if multigrid else s.held
    for size in (4, 9, 12):
        active = np.sort(rng.permutation(12)[:size])
        q0, p0 = rng.normal(size=30), rng.normal(size=12)
        made = solved(s, active, q0=q0, p0=p0, K=K)
        q, p = saddle(s, active, q0)
        np.testing.assert_allclose(made.q, q, atol=1e-10 * np.abs(q).max())
        np.testing.assert_allclose(made.p, p, atol=1e-10 * np.abs(p).max())
        left = np.abs(s.G - s.D @ q)[active] / s.w[active]
        assert made.left <= 1e-12 * np.abs(q).max() and left.max() <= 1e-12 * np.abs(q).max()
        assert (made.p[np.setdiff1d(np.arange(12), active)] == 0).all()


@pytest.mark.parametrize("kind", ["held", "one set of rows for forces, another for gaps"])
def test_no_row_at_all(kind):
    s = system(0, **KINDS[kind])
    made = solved(s, np.empty(0, int))
    np.testing.assert_allclose(made.q, np.linalg.solve(s.K, s.f), rtol=1e-10)
    assert (made.p == 0).all() and made.applications == 1


def test_what_is_known_costs_nothing():
    s = system(0)
    active = np.arange(8)
    once = solved(s, active)
    again = solved(s, active, goal=LinearTolerance(0.0, 1e-10, 1e-18, 0.0), q0=once.q, p0=once.p)
    assert again.applications <= 1
    np.testing.assert_allclose(again.q, once.q, atol=1e-12)


def test_rows_that_say_the_same_carry_it_together():
    s = system(0)
    B, G = s.B.copy(), s.G.copy()
    B[1], G[1] = B[0], G[0]
    s = s._replace(B=B, D=B, G=G)
    made = solved(s, np.arange(6))
    q, p = saddle(s, np.array([0, 2, 3, 4, 5]), np.zeros(30))
    np.testing.assert_allclose(made.q, q, atol=1e-9 * np.abs(q).max())
    assert made.p[0] + made.p[1] == pytest.approx(p[0], rel=1e-8)


@pytest.mark.parametrize("free", [0, 2])
def test_directions_of_the_system_before_save_applications(free):
    """Rows, their set and the geometric stiffness have changed a little since: the solution is that without them."""
    s, rng, kept = system(3, n=60, m=20, turning=0.1, same=False, free=free), np.random.default_rng(3), KeptDirections()
    q0, few, K = rng.normal(size=60), np.setdiff1d(np.arange(20), [4, 11]), s.held
    solved(s, np.arange(20), q0=q0, K=K, kept=kept)
    B, D = (A if free else A * (1 + 1e-3 * rng.normal(size=A.shape)) for A in (s.B, s.D))
    now, loose = s._replace(B=B, D=D, C=1.01 * s.C), LinearTolerance(1e-3, 1e-14, 1e-18, 0.0)
    alone, sooner = solved(now, few, loose, q0, K=K), solved(now, few, loose, q0, K=K, kept=kept)
    assert sooner.applications <= 0.5 * alone.applications
    made, (q, p) = solved(now, few, q0=q0, K=K, kept=kept), saddle(now, few, q0)
    np.testing.assert_allclose(made.q, q, atol=1e-10 * np.abs(q).max())
    np.testing.assert_allclose(made.p, p, atol=1e-10 * np.abs(p).max())


def test_directions_of_another_stiffness_are_dropped():
    s, kept = system(3, turning=0.1, same=False), KeptDirections()
    solved(s, np.arange(8), kept=kept)
    first, stiffer = list(kept.each), s._replace(K=2 * s.K)
    made = solved(stiffer, np.arange(8), kept=kept)
    q, _ = saddle(stiffer, np.arange(8), np.zeros(30))
    np.testing.assert_allclose(made.q, q, atol=1e-10 * np.abs(q).max())
    assert first and not any(one is other for one in first for other in kept.each)


def test_a_loose_goal_is_met_and_costs_less():
    s = system(3, n=60, m=30)
    active = np.arange(30)
    q0 = np.linalg.solve(s.K, s.f)
    start = np.abs((s.D @ q0 - s.G) / s.w).max()
    loose = solved(s, active, goal=LinearTolerance(0.1, 1e-14, 1e-18, 0.0), q0=q0)
    exact = solved(s, active, q0=q0)
    assert 1e-6 * start < np.abs((s.D @ loose.q - s.G) / s.w).max() <= 0.1 * start
    assert loose.left == pytest.approx(np.abs((s.D @ loose.q - s.G) / s.w).max(), rel=1e-6)
    assert loose.applications < exact.applications / 2
    np.testing.assert_allclose(s.K @ loose.q + s.B.T @ loose.p, s.f, atol=1e-12 * np.abs(s.f).max())


@pytest.mark.parametrize(
    "relative, absolute, moved, stops", [(1e-3, 0, 0, 1e-3), (1e-3, 0, 5, 5e-3), (0, 0.01, 0, 0.01)]
)
def test_the_gap_that_need_not_be_closed(relative, absolute, moved, stops):
    assert LinearTolerance(0, relative, absolute, moved).threshold(1.0) == pytest.approx(stops)


# ---- on a mesh


def moment(count, free=False, ratio=1.0, backend="auto", threads=1):
    """Two blocks pressed together by a load that is not uniform: the instant at the end of the step.

    `ratio`: stiffness of the upper block, which has the master, relative to that of the lower one.
    """
    mesh = stack("HEXA8", "TETRA4", 3, counts=(count, count))
    fixed = held("bottom", ux=0.0, uy=0.0, uz=0.0)
    upright = at([0.0, 0.0, 2.0], ux=0.0, uy=0.0) + at([1.0, 0.0, 2.0], uy=0.0) if free else SLIDING
    upper = MATERIAL.replace(f"young = {YOUNG}", f'groups = ["upper"]\nyoung = {YOUNG * ratio}')
    lower = MATERIAL + 'groups = ["lower"]\n'
    head = HEAD.format(model="3d").replace("threads = 1", f'threads = {threads}\nbackend = "{backend}"')
    text = head + lower + upper + JOINT + fixed + upright + pressed("top", "1 + x * y")
    return LoadStep(ReducedProblem(Problem.of(parse_case(text), mesh)), 1.0)


@pytest.mark.parametrize("free", [False, True])
def test_products_hardly_grow_with_the_mesh(free):
    """A few to a tenth of the residual, some twenty to rounding, of pressures by the dozen and by the hundred."""
    counts = []
    for count in (5, 10):
        now = moment(count, free)
        K = now.reference
        found = now.contact(np.zeros(len(now.f)))
        m = len(found.G)
        loose, exact = (
            solve_rows(K, found.rows, np.arange(m), now.f, found.G, np.zeros(len(now.f)), np.zeros(m), goal)
            for goal in (LinearTolerance(0.1, 1e-13, 1e-18, 0.0), LinearTolerance(0.0, 1e-13, 1e-18, 0.0))
        )
        assert m == count * count and loose.applications <= 12 and exact.applications <= 40
        np.testing.assert_allclose(K.K @ exact.q + found.rows.B_T @ exact.p, now.f, atol=1e-12 * np.abs(now.f).max())
        counts.append(exact.applications)
    assert counts[1] <= 1.5 * counts[0]


@pytest.mark.parametrize("free", [False, True])
def test_products_hardly_grow_with_the_ratio_of_stiffnesses(free):
    """The rows are scaled by the diagonal of K: without that it takes two to three times as many."""
    counts = []
    for ratio in (1.0, 100.0, 0.01):
        now = moment(8, free, ratio)
        found = now.contact(np.zeros(len(now.f)))
        m, start = len(found.G), np.zeros(len(now.f))
        made = solve_rows(now.reference, found.rows, np.arange(m), now.f, found.G, start, np.zeros(m), EXACT)
        counts.append(made.applications)
    assert max(counts[1:]) <= 1.5 * counts[0], counts
