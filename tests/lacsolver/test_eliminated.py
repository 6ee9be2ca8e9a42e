"""Equations that are eliminated and rows of equality: what they hold, the forces that they exert, their mistakes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_array, csr_array, diags_array

from lacmesh import Mesh
from lacmesh.errors import DataError, LacmeshWarning
from lacsolver.case import (
    Case,
    CaseError,
    Displacement,
    Dynamics,
    Equation,
    Material,
    Pressure,
    Rigid,
    Solver,
    Steps,
    Traction,
)
from lacsolver.constraints import of_case
from lacsolver.constraints.equality_rows import EqualityAt
from lacsolver.constraints.equations import Equations, EquationSystem
from lacsolver.contact.laws import Bilateral
from lacsolver.equilibrium.stepping import march
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import Problem
from lacsolver.running import run

LAWS = {"small": "elastic", "finite": "neo_hookean"}
FIXED = Displacement(group="left", ux=0, uy=0)


def halves(m=5):
    """Two unit squares beside each other, not connected; the nodes of both at x = 1; and the same as one body."""
    x, y = np.meshgrid(np.linspace(0, 1, m + 1), np.linspace(0, 1, m + 1), indexing="ij")
    square = np.stack([x.ravel(), y.ravel()], axis=1)
    quads = np.array([[i * (m + 1) + j + k for k in (0, m + 1, m + 2, 1)] for i in range(m) for j in range(m)])
    n, edge = len(square), np.arange(m + 1)
    points, cells = np.vstack([square, square + np.array([1, 0])]), np.vstack([quads, quads + n])
    sides = np.vstack([np.stack([at[:-1], at[1:]], axis=1) for at in (edge, n + m * (m + 1) + edge)])
    groups = {"left": len(cells) + np.arange(m), "right": len(cells) + m + np.arange(m)}
    a, b = m * (m + 1) + edge, n + edge
    apart = Mesh.create(points, [("QUAD4", cells), ("SEG2", sides)], cell_groups=groups)
    of = np.arange(2 * n)
    of[b] = a
    used = np.unique(of)
    new = np.searchsorted(used, of)
    whole = Mesh.create(points[used], [("QUAD4", new[cells]), ("SEG2", new[sides])], cell_groups=groups)
    return apart, whole, a, b, new


APART, WHOLE, A, B, NEW = halves()


def made(kinematics="small", mesh=WHOLE, **keys):
    material = Material(young=100.0, poisson=0.3, density=1.0, law=LAWS[kinematics])
    keys = {"displacement": FIXED, "steps": Steps(count=2)} | keys
    return Case(mesh=mesh, model="plane_strain", kinematics=kinematics, material=material, **keys)


def solved(case):
    problem = Problem.of(case)
    *_, state = march(problem)
    return problem, state


def joined(shortening=None, more=()):
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


@pytest.mark.parametrize("kinematics", LAWS)
def test_halves_joined_by_equations_are_the_whole(kinematics, equations):
    load = Traction(group="right", tx=1.0, ty=3.0)
    _, whole = solved(made(kinematics, traction=load))
    equations(joined())
    problem, state = solved(made(kinematics, APART, traction=load))
    np.testing.assert_allclose(state.u.reshape(-1, 2), whole.u.reshape(-1, 2)[NEW], rtol=0, atol=1e-13)
    np.testing.assert_allclose(state.equations["joint"].reshape(-1, 2).sum(axis=0), [-1, -3], atol=1e-11)
    reactions = problem.constraints.reactions(state.reaction, state.equations)
    np.testing.assert_allclose(reactions["left"], [-1, -3], atol=1e-11)


@pytest.mark.parametrize("kinematics", LAWS)
def test_a_further_unknown_carries_its_load(kinematics, equations):
    equations(joined(2.5))
    held = [FIXED, Displacement(group="right", ux=0, uy=0)]
    problem, state = solved(made(kinematics, APART, displacement=held))
    (s,) = state.further["joint"]
    jump = (state.u.reshape(-1, 2)[B] - state.u.reshape(-1, 2)[A]) @ [1, 0]
    assert s > 0 and np.allclose(jump, -s, rtol=0, atol=1e-14)
    np.testing.assert_allclose(state.equations["joint"].reshape(-1, 2).sum(axis=0), [-2.5, 0], atol=1e-11)
    np.testing.assert_allclose(problem.constraints.reactions(state.reaction, state.equations)["left"][0], -2.5)


def test_motion_with_equations_is_that_of_the_whole(equations):
    load, moving = Traction(group="right", ty="3"), Dynamics()
    steps = Steps(end=0.2, count=8)
    _, whole = solved(made(traction=load, dynamics=moving, steps=steps))
    equations(joined())
    _, state = solved(made("small", APART, traction=load, dynamics=moving, steps=steps))
    np.testing.assert_allclose(state.u.reshape(-1, 2), whole.u.reshape(-1, 2)[NEW], rtol=0, atol=1e-12)


def test_a_half_that_its_shortening_leaves_free_is_named(equations):
    equations(joined(2.5))
    with pytest.raises(DataError, match="the body with 'right' moves along x"):
        solved(made("small", APART))


def test_an_equation_that_follows_from_others_is_named(equations):
    equations(joined(more=[(([0, 3], [1.0, 2.0]), 0.0)]))
    with pytest.warns(LacmeshWarning, match="the sum follows from equation 0 and equation 3: such equations carry"):
        Problem.of(made("small", APART))


def test_an_equation_that_contradicts_others_is_named(equations):
    equations(joined(more=[(([0, 3], [1.0, 2.0]), 1.0)]))
    with pytest.raises(CaseError, match=r"the sum contradicts equation 0 and equation 3: it is off by 0\.5 at"):
        Problem.of(made("small", APART))


def test_an_equation_of_prescribed_terms_is_named(equations):
    held = Displacement(group="left", ux=0.1, uy=0)

    def hold(space, case):
        C = coo_array(([1.0], ([0], [0])), shape=(1, space.n_dof)).tocsr()
        yield Equations("one", C, lambda t: np.array([0.2 * t]), lambda i: "equation 'one'")

    equations(hold)
    with pytest.raises(CaseError, match="equation 'one' contradicts what its terms are prescribed to"):
        Problem.of(made(displacement=held))


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


@pytest.mark.parametrize("backend", ["auto", "multigrid"])
@pytest.mark.parametrize("kinematics", LAWS)
def test_rows_of_equality_hold_a_mean(kinematics, backend, monkeypatch):
    monkeypatch.setattr(of_case, "EQUALITIES", [lambda space, case: [Mean(space, case)]])
    problem, state = solved(made(kinematics, solver=Solver(backend=backend)))
    (mean,) = problem.equalities
    assert abs(mean.C @ state.u - 0.1).max() < 1e-12
    reaction = problem.constraints.reactions(state.reaction)["left"]
    np.testing.assert_allclose(reaction, [-state.equations["mean"][0], 0], atol=1e-9)


def test_a_body_may_hang_on_rows_of_equality_alone(monkeypatch):
    monkeypatch.setattr(of_case, "EQUALITIES", [lambda space, case: [Mean(space, case)]])
    held = [Displacement(group="left", uy=0), Displacement(group="right", uy=0)]
    _, state = solved(made(displacement=held, pressure=Pressure(group="left", value=1.0)))
    np.testing.assert_allclose(state.equations["mean"], [-1.0], atol=1e-12)
    with pytest.raises(DataError, match=r"nothing holds a part of the model: the body turns about the point"):
        solved(made(displacement=held[0], pressure=Pressure(group="left", value=1.0)))


def test_rows_of_equality_that_nothing_moves_are_named(monkeypatch):
    monkeypatch.setattr(of_case, "EQUALITIES", [lambda space, case: [Mean(space, case)]])
    with pytest.raises(CaseError, match=r"it is off by .* and all that it acts on is prescribed"):
        solved(made(displacement=[FIXED, Displacement(group="right", ux=0)]))


def test_terms_that_are_not_there_are_named():
    def said(**term):
        case = made(equation=Equation(name="e", terms=[{"factor": 1.0, "component": "ux", **term}]))
        with pytest.raises(CaseError) as error:
            Problem.of(case)
        return str(error.value)

    assert "no node" not in said(node=10_000) and "term at node 10000, which the mesh does not have" in said(
        node=10_000
    )
    assert "group 'left', which has 6 nodes; name a group of one node" in said(group="left")
    assert "no node at [3, 0]" in said(at=[3, 0])
    points = np.vstack([WHOLE.points, [[5, 5, 0]]])
    loose = Mesh.create(points, [(b.type, b.nodes) for b in WHOLE.blocks], cell_groups=WHOLE.cell_groups)
    with pytest.raises(CaseError, match="belong to no cell of a body and to no rigid body"):
        Problem.of(made(mesh=loose, equation=Equation(terms=[{"factor": 1, "component": "ux", "at": [5, 5]}])))


def test_a_restart_goes_on_with_equations(tmp_path):
    lid = Equation(group="right", same=["ux", "uy"])
    case = made(traction=Traction(group="right", tx=0.1, ty=0.2), equation=lid, steps=Steps(count=4))
    folder = create_output(tmp_path / "out")
    whole = run(case, folder)
    start = read_state(tmp_path / "out", case, 0.5)
    again = run(case, create_output(tmp_path / "again"), start=start)
    assert again.steps[-1].equations == pytest.approx(whole.steps[-1].equations, rel=1e-9)
    assert list(whole.steps[-1].equations) == ["right"] and whole.steps[-1].equations["right"] > 0


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
    axis = Displacement(group="right", ux=0.0, axes={"x": [-tilt, 1.0]})
    _, state = solved(made(displacement=[FIXED, axis], pressure=Pressure(group="right", value=-1.0)))
    assert (np.abs(state.u).max() > 5e-3) == moves


def test_round_off_of_a_moment_arm_is_no_equation(equations):
    """A rigid side turns about its middle by the moment: equations uy = 0 at its nodes ask nothing of it."""
    equations(on_the_side)
    for x in (2.0, np.nextafter(2.0, 3.0)):
        side = Rigid(group="right", ux=0.0, uy=0.0, moment=1.0, centre=[x, 0.5])
        problem, state = solved(made(rigid=side))
        assert problem.constraints.n_q == problem.constraints.plain.n_q
        assert state.rigid["right"][2] > 0.01
