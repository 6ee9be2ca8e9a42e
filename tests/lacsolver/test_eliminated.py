"""Equations that are eliminated and rows of equality: what they hold, the forces that they exert, their mistakes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array, csr_array, diags_array

from lacmesh import Mesh, join
from lacmesh.errors import DataError, LacmeshWarning
from lacmesh.generate import rectangle
from lacsolver.case import CaseError, Dynamics, Equation, Material, Rigid, Solver, Steps, Traction
from lacsolver.constraints import of_case
from lacsolver.constraints.equality_rows import EqualityAt
from lacsolver.constraints.equations import Equations, EquationSystem
from lacsolver.contact.laws import Bilateral
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.contact_cases import load
from tests.problems import case_of, fix, move

#: two unit squares beside each other, not connected, the nodes of both at x = 1; and the same as one body
APART = join(rectangle(5).only("body", "left"), rectangle(5, corner=(1, 0)).only("body", "right"))
WHOLE = rectangle((10, 5), (2, 1))
A, B = np.flatnonzero(APART.points[:, 0] == 1).reshape(2, -1)
#: of each node of the two, that of the one body
NEW = ((APART.points[:, None] - WHOLE.points[None]) ** 2).sum(axis=2).argmin(axis=1)
FIXED = fix("left", "xy")
PULL = Traction(group="right", tx=1.0, ty=3.0)
KINEMATICS = pytest.mark.parametrize("kinematics", ["small", "finite"])


def made(*records, mesh=WHOLE, kinematics="small", held=(FIXED,)):
    """A case in plane strain, in two steps unless there are others."""
    law = {"small": "elastic", "finite": "neo_hookean"}[kinematics]
    steps = () if any(isinstance(one, Steps) for one in records) else (Steps(count=2),)
    material = Material(young=100.0, poisson=0.3, density=1.0, law=law)
    return case_of(mesh, material, *held, *records, *steps, model="plane_strain", kinematics=kinematics)


def solved(*records, **options):
    problem = Problem.of(made(*records, **options))
    *_, state = march(problem)
    return problem, state


def joint(shortening=None, more=()):
    """Equations u_b - u_a + s n = 0 at the nodes of both halves, s under a load; `more`: ((rows, factors), value)."""

    def equations(space, case):
        rows = np.arange(2 * len(A))
        entries = np.append(np.ones(len(rows)), -np.ones(len(rows)))
        places = np.append(space.dofs(B).ravel(), space.dofs(A).ravel())
        C = coo_array((entries, (np.tile(rows, 2), places)), shape=(len(rows), space.n_dof)).tocsr()
        one = Equations("joint", C, lambda t: np.zeros(len(rows)), lambda i: f"equation {i}")
        if shortening is not None:
            E = csr_array(np.tile([[1.0], [0.0]], (len(A), 1)))
            one = replace(one, E=E, loads=lambda t: np.array([shortening * t]))
        yield one
        for (which, factors), value in more:
            sums = csr_array(csr_array(np.array([factors])) @ C[which])
            yield Equations("sum", sums, lambda t, value=value: np.array([value * t]), lambda i: "the sum")

    return equations


@pytest.fixture
def equations(monkeypatch):
    """A function that makes equations part of every case."""
    return lambda one: monkeypatch.setattr(of_case, "EQUATIONS", [one])


def by_node(state):
    return state.u.reshape(-1, 2)


@KINEMATICS
def test_halves_joined_by_equations_are_the_whole(kinematics, equations):
    _, whole = solved(PULL, kinematics=kinematics)
    equations(joint())
    problem, state = solved(PULL, mesh=APART, kinematics=kinematics)
    np.testing.assert_allclose(by_node(state), by_node(whole)[NEW], rtol=0, atol=1e-13)
    np.testing.assert_allclose(state.equations["joint"].reshape(-1, 2).sum(axis=0), [-1, -3], atol=1e-11)
    reactions = problem.constraints.reactions(state.reaction, state.equations)
    np.testing.assert_allclose(reactions["left"], [-1, -3], atol=1e-11)


@KINEMATICS
def test_a_further_unknown_carries_its_load(kinematics, equations):
    equations(joint(2.5))
    problem, state = solved(mesh=APART, kinematics=kinematics, held=(FIXED, fix("right", "xy")))
    (s,), u = state.further["joint"], by_node(state)
    assert s > 0 and np.allclose((u[B] - u[A]) @ [1, 0], -s, rtol=0, atol=1e-14)
    np.testing.assert_allclose(state.equations["joint"].reshape(-1, 2).sum(axis=0), [-2.5, 0], atol=1e-11)
    np.testing.assert_allclose(problem.constraints.reactions(state.reaction, state.equations)["left"][0], -2.5)


def test_motion_with_equations_is_that_of_the_whole(equations):
    records = Traction(group="right", ty="3"), Dynamics(), Steps(end=0.2, count=8)
    _, whole = solved(*records)
    equations(joint())
    _, state = solved(*records, mesh=APART)
    np.testing.assert_allclose(by_node(state), by_node(whole)[NEW], rtol=0, atol=1e-12)


# ---- mistakes


def one_term(space, case):
    C = coo_array(([1.0], ([0], [0])), shape=(1, space.n_dof)).tocsr()
    yield Equations("one", C, lambda t: np.array([0.2 * t]), lambda i: "equation 'one'")


FOLLOWS = [0, 3], [1.0, 2.0]


@pytest.mark.parametrize(
    ("given", "options", "error", "words"),
    [
        (joint(2.5), {"mesh": APART}, DataError, "with 'right' moves along x"),
        (joint(more=[(FOLLOWS, 1.0)]), {"mesh": APART}, CaseError,
         r"the sum contradicts equation 0 and equation 3: it is off by 0\.5 at"),
        (one_term, {"held": (move("left", ux=0.1, uy=0),)}, CaseError,
         "equation 'one' contradicts what its terms are prescribed to"),
    ],
)  # fmt: skip
def test_equations_that_cannot_be_are_named(equations, given, options, error, words):
    equations(given)
    with pytest.raises(error, match=words):
        solved(**options)


def test_an_equation_that_follows_from_others_is_named(equations):
    equations(joint(more=[(FOLLOWS, 0.0)]))
    with pytest.warns(LacmeshWarning, match="the sum follows from equation 0 and equation 3"):
        Problem.of(made(mesh=APART))


@pytest.mark.parametrize(
    ("term", "words"),
    [
        ({"node": 10_000}, "term at node 10000, which the mesh does not have"),
        ({"group": "left"}, "group 'left', which has 6 nodes"),
        ({"at": [3, 0]}, r"no node at \[3, 0\]"),
        ({"at": [5, 5]}, "belong to no cell of a body"),
    ],
)
def test_terms_that_are_not_there_are_named(term, words):
    points = np.vstack([WHOLE.points, [[5, 5, 0]]])
    mesh = Mesh.create(points, WHOLE.blocks, cell_groups=WHOLE.cell_groups, space_dim=2)
    equation = Equation(name="e", terms=[{"factor": 1.0, "component": "ux", **term}])
    with pytest.raises(CaseError, match=words):
        Problem.of(made(equation, mesh=mesh))


# ---- systems of equations


@pytest.mark.parametrize("seed", range(20))
def test_random_equations_are_fulfilled_with_any_pattern(seed):
    rng = np.random.default_rng(seed)
    k, n = int(rng.integers(1, 30)), 60
    A_ = (rng.random((k, n)) < rng.choice([0.03, 0.1, 0.5])) * rng.standard_normal((k, n))
    if k > 3:
        A_[-1] = A_[0] - 2 * A_[1]
    system = EquationSystem.of(csr_array(A_), n - 5)
    rank = np.linalg.matrix_rank(A_)
    assert len(system.rows) == rank and system.Z.shape == (n, n - rank)
    assert abs(A_ @ system.Z.toarray()).max() < 1e-9
    h = A_ @ rng.standard_normal(n)
    assert abs(A_ @ system.offset(h) - h).max() < 1e-9
    forces = np.zeros(k)
    forces[system.rows] = rng.standard_normal(rank)
    np.testing.assert_allclose(system.forces(A_.T @ forces), forces, atol=1e-9)


def test_chains_and_stars_of_equations_are_eliminated():
    n = 400
    chain = csr_array(diags_array([np.ones(n), -np.ones(n)], offsets=[0, 1], shape=(n, n + 1)))
    system = EquationSystem.of(chain, n + 1)
    assert system.Z.shape == (n + 1, 1) and abs(system.Z.toarray() - 1).max() < 1e-12


def on_the_side(space, case):
    """Equations uy = 0 at the nodes at x = 2."""
    node = np.flatnonzero(np.isclose(space.mesh.points[:, 0], 2.0))
    rows = np.arange(len(node))
    C = coo_array((np.ones(len(node)), (rows, 2 * node + 1)), shape=(len(node), space.n_dof)).tocsr()
    yield Equations("side", C, lambda t: np.zeros(len(node)), lambda i: f"equation {i}", may_follow=True)


@pytest.mark.parametrize("tilt, moves", [(6e-17, True), (4e-8, True), (1e-6, False), (0.1, False)])
def test_round_off_of_an_axis_is_no_equation(tilt, moves, equations):
    """The side may move along an axis alone, which is x but for round-off of double or of single precision, or not."""
    equations(on_the_side)
    _, state = solved(load("right", -1.0), held=(FIXED, move("right", ux=0.0, axes={"x": [-tilt, 1.0]})))
    assert (np.abs(state.u).max() > 5e-3) == moves


def test_round_off_of_a_moment_arm_is_no_equation(equations):
    """A rigid side turns about its middle by the moment: equations uy = 0 at its nodes ask nothing of it."""
    equations(on_the_side)
    for x in (2.0, np.nextafter(2.0, 3.0)):
        problem, state = solved(Rigid(group="right", ux=0.0, uy=0.0, moment=1.0, centre=[x, 0.5]))
        assert problem.constraints.n_q == problem.constraints.plain.n_q
        assert state.rigid["right"][2] > 0.01


# ---- rows of equality


class Mean:
    """The mean of ux over the right end is 0.1 t."""

    name, linear = "mean", True

    def __init__(self, space, case):
        nodes = space.mesh.nodes_on(space.mesh.cells_of("right"))
        w = 1 + np.arange(len(nodes)) / len(nodes)
        self.C = coo_array((w / w.sum(), (0 * nodes, 2 * nodes)), shape=(1, space.n_dof)).tocsr()
        self.record = case.material[0]

    def at(self, u, t):
        return EqualityAt(np.array([0.1 * t]) - self.C @ u, self.C)

    def curvature(self, u, t, p):
        return None

    def law(self, t):
        return Bilateral()


@pytest.fixture
def mean(monkeypatch):
    """A row of equality is part of every case."""
    monkeypatch.setattr(of_case, "EQUALITIES", [lambda space, case: [Mean(space, case)]])


@pytest.mark.parametrize("backend", ["auto", "multigrid"])
@KINEMATICS
def test_rows_of_equality_hold_a_mean(kinematics, backend, mean):
    problem, state = solved(Solver(backend=backend), kinematics=kinematics)
    (row,) = problem.equalities
    assert abs(row.C @ state.u - 0.1).max() < 1e-12
    reaction = problem.constraints.reactions(state.reaction)["left"]
    np.testing.assert_allclose(reaction, [-state.equations["mean"][0], 0], atol=1e-9)


def test_a_body_may_hang_on_rows_of_equality_alone(mean):
    _, state = solved(load("left", 1.0), held=(fix("left", "y"), fix("right", "y")))
    np.testing.assert_allclose(state.equations["mean"], [-1.0], atol=1e-12)
    with pytest.raises(DataError, match="turns about the point"):
        solved(load("left", 1.0), held=(fix("left", "y"),))


def test_rows_of_equality_that_nothing_moves_are_named(mean):
    with pytest.raises(CaseError, match="all its displacements are prescribed"):
        solved(held=(FIXED, fix("right", "x")))
