"""The saddle system on one factor of K: against dense elimination, how many products it takes, columns that are kept.

Columns of the Schur complement serve over the steps: applications of K^-1 are counted, results are as without."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from scipy.sparse import csr_array

import lacsolver.equilibrium.reduced
from lacsolver.case import Displacement, Dynamics, Initial, Material, Pressure, Rigid, Solver, Steps
from lacsolver.equilibrium import kept_columns
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.state import CONTACT
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.saddle.stiffness import Stiffness
from lacsolver.saddle.tolerances import LinearTolerance
from tests.lacsolver.patch_meshes import stack
from tests.lacsolver.systems import factorised, saddle, solve_rows, system
from tests.problems import ELASTIC, case_of, contact, fix, move
from verification.meshes.thrown import disc, on_wall

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
UPRIGHT = Displacement(at=[0.0, 0.0, 2.0], ux=0.0, uy=0.0), Displacement(at=[1.0, 0.0, 2.0], uy=0.0)


def solved(s, active, goal=EXACT, q0=None, p0=None, K=None):
    n, m = len(s.K), len(s.B)
    q0, p0 = np.zeros(n) if q0 is None else q0, np.zeros(m) if p0 is None else p0
    turning = csr_array(s.C) if s.C.any() else None
    return solve_rows(s.held if K is None else K, s.rows, np.asarray(active), s.f, s.G, q0, p0, goal, turning)


def held_by_cycles(s):
    """K of a small system with a hierarchy, which is the coarsest level alone."""
    return factorised(csr_array(s.K), s.R, backend="multigrid")


@pytest.mark.rows("factor-1-free to move, two sets", "multigrid-3-held", "multigrid-4-free to move")
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
def test_no_row_at_all_and_rows_whose_answer_is_known(kind):
    s = system(0, **KINDS[kind])
    none = solved(s, np.empty(0, int))
    np.testing.assert_allclose(none.q, np.linalg.solve(s.K, s.f), rtol=1e-10)
    assert (none.p == 0).all() and none.applications == 1
    once = solved(s, np.arange(8))
    again = solved(s, np.arange(8), goal=LinearTolerance(0.0, 1e-10, 1e-18, 0.0), q0=once.q, p0=once.p)
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


# ---- on a mesh


def moment(count, free=False, ratio=1.0, backend="auto", threads=1):
    """Two blocks pressed together by a load that is not uniform: the instant at the end of the step.

    `ratio`: stiffness of the upper block, which has the master, relative to that of the lower one.
    """
    mesh = stack("HEXA8", "TETRA4", 3, counts=(count, count))
    held = fix("bottom", "xyz"), *(UPRIGHT if free else (fix("x0", "x"), fix("y0", "y")))
    lower, upper = replace(ELASTIC, groups=["lower"]), replace(ELASTIC, groups=["upper"], young=1000.0 * ratio)
    load = Pressure(group="top", value="1 + x * y"), Solver(threads=threads, backend=backend)
    problem = Problem.of(case_of(mesh, lower, upper, contact(), *held, *load, model="3d"), mesh)
    return LoadStep(ReducedProblem(problem), 1.0)


def on_all_rows(now, *goals):
    """Solutions with all rows closed, from rest, to some goals."""
    found, start = now.contact(np.zeros(len(now.f))), np.zeros(len(now.f))
    m = len(found.G)
    rows, every, rest = found.rows, np.arange(m), np.zeros(m)
    return found, [solve_rows(now.reference, rows, every, now.f, found.G, start, rest, goal) for goal in goals]


@pytest.mark.rows("False")
@pytest.mark.parametrize("free", [False, True])
def test_products_hardly_grow_with_the_mesh_and_the_ratio_of_stiffnesses(free):
    """A few to a tenth of the residual, some twenty to rounding, of pressures by the dozen and by the hundred.

    The rows are scaled by the diagonal of K: without that a ratio takes two to three times as many.
    """
    counts = []
    for count in (5, 10):
        now = moment(count, free)
        found, (loose, near, exact) = on_all_rows(
            now, *(LinearTolerance(r, 1e-13, 1e-18, 0.0) for r in (0.1, 1e-8, 0.0))
        )
        assert len(found.G) == count * count and loose.applications <= 12 and exact.applications <= 40
        left = now.reference.K @ exact.q + found.rows.B_T @ exact.p
        np.testing.assert_allclose(left, now.f, atol=1e-12 * np.abs(now.f).max())
        counts.append(near.applications)  # at rounding the last few are noise
    assert counts[1] <= 1.5 * counts[0]
    one, *others = (on_all_rows(moment(8, free, ratio), EXACT)[1][0].applications for ratio in (1.0, 100.0, 0.01))
    assert max(others) <= 1.5 * one, others


# ---- columns that are kept over the steps

#: contact of two blocks that spreads from the middle while the upper one is pressed down, and shrinks again
ROUND = "0.02 * ((x - 0.5)**2 + (y - 0.5)**2)"
PRESSED = move("top", ux=0.0, uy=0.0, uz="-0.02 * sin(3 * t)")


def counted(problem, start=None):
    """(states, applications of K^-1 in each step, rows in contact at its end, rows closed so far)."""
    made, states, table, ever = [0], [], [], np.zeros(0, bool)
    solve = Stiffness.solve

    def counting(self, f):
        made[0] += 1
        return solve(self, f)

    with patch.object(Stiffness, "solve", counting):
        for state in march(problem, start=start):
            closed = np.concatenate([zone.status == CONTACT for zone in state.zones])
            ever = closed | (ever if len(ever) else closed)
            states.append(state)
            table.append((made[0], int(closed.sum()), int(ever.sum())))
            made[0] = 0
    return states, np.array(table)


def without(problem):
    """Return what `counted` does, without columns."""
    with patch.object(lacsolver.equilibrium.reduced, "SAVED", 0):
        return counted(problem)


def per_step(table):
    """Applications in a step in contact, on average, of steps that close no row for the first time."""
    again = np.diff(table[:, 2], prepend=0) == 0
    return table[(table[:, 1] > 0) & again, 0].mean()


def static(count, *records, counts=(7, 6)):
    mesh = stack("HEXA8", "HEXA8", 3, counts=counts, even=True)
    records = records or (contact(clearance=ROUND), PRESSED)
    return Problem.of(case_of(mesh, ELASTIC, fix("bottom", "xyz"), *records, Steps(count=count), model="3d"), mesh)


def impact():
    """A disc on a wall, small kinematics: rows close and open one after the other."""
    solid, thrown = Material(young=1.0, poisson=0.3, density=1.0), Initial(groups=["body"], vy=-0.1)
    records = solid, contact(master="wall"), Rigid(group="wall"), Dynamics(), thrown, Steps(end=4.0, count=50)
    return Problem.of(case_of(on_wall(disc(8, (0.0, 1.01))), *records, model="plane_strain"))


@pytest.mark.rows("dynamics")
@pytest.mark.parametrize("made", [impact, lambda: static(50)], ids=["dynamics", "statics"])
def test_a_step_in_contact_takes_at_most_three_applications(made):
    """One more for each row that closes for the first time; without columns it takes several times as many."""
    states, table = counted(made())
    plain, before = without(made())
    on = table[:, 1] > 0
    assert on.sum() > 30 and table[:, 1].max() >= 8
    assert per_step(table) <= 3 < 2 * per_step(table) < per_step(before)
    assert table[on, 0].sum() <= 3 * on.sum() + table[-1, 2] * 1.5
    assert table[:, 0].sum() < 0.6 * before[:, 0].sum()
    np.testing.assert_array_equal(table[:, 1:], before[:, 1:])
    for one, other in zip(states, plain, strict=True):
        assert np.abs(one.u - other.u).max() <= 1e-10 * np.abs(other.u).max()
        p, q = one.zones[0].pressure, other.zones[0].pressure
        assert np.abs(p - q).max() <= 1e-9 * max(np.abs(q).max(), 1e-300)


def test_columns_are_those_of_the_system_and_their_memory_is_bounded():
    now = LoadStep(ReducedProblem(static(1, counts=(4, 3))), 1.0)
    K, rows = now.reference, now.contact(np.zeros(len(now.f))).rows
    whole, B = kept_columns.KeptColumns(K, rows, 9), rows.B.toarray()
    assert whole.serve(K, rows) and not whole.serve(moment(4).reference, rows)
    C = whole.columns(np.arange(2))
    np.testing.assert_allclose(C, B @ np.linalg.solve(K.K.toarray(), B[:2].T), rtol=1e-9, atol=1e-12 * C.max())
    with patch.object(kept_columns, "_MEMORY", 8 * len(rows.w)):
        small = kept_columns.KeptColumns(K, rows, 9)
    asked = [small.columns(np.array([k])) for k in (0, 1, 0)]
    np.testing.assert_array_equal(np.hstack(asked), C[:, [0, 1, 0]])
    assert small.most == 1 == len(small._values)
