"""Couplings: resultants at any weights, strains as under tractions, exact rotations, prescribed motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh.errors import LacmeshError
from lacsolver.case import (
    Case,
    CaseError,
    Coupling,
    Displacement,
    Dynamics,
    Equation,
    Force,
    Material,
    Rigid,
    Solver,
    Steps,
    Tie,
    Traction,
)
from lacsolver.constraints.coupling import CouplingRows
from lacsolver.constraints.rotation import turn
from lacsolver.constraints.spread import Spread, rotation_vector
from lacsolver.equilibrium.holding import warnings_of
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.problem.resultants import resultants
from lacsolver.results.figures import step_figures
from lacsolver.validation import validate
from tests.checks.blocks import block as grid
from tests.checks.blocks import join, skin
from tests.lacsolver.patch_meshes import block

LAWS = {"small": "elastic", "finite": "neo_hookean"}
CELLS = ["QUAD4", "QUAD8", "TRIA6", "HEXA8", "HEXA20", "TETRA10", "PENTA6"]


def dim_of(cell):
    return 2 if cell[:4] in ("QUAD", "TRIA") else 3


def made(cell="HEXA8", kinematics="small", model="", **keys):
    dim = dim_of(cell)
    side = "xyz"[dim - 1]
    keys = {"displacement": Displacement(group=f"{side}0", **{f"u{a}": 0 for a in "xyz"[:dim]})} | keys
    material = Material(young=100.0, poisson=0.3, density=1.0, law=LAWS[kinematics])
    model = model or ("3d" if dim == 3 else "plane_strain")
    return Case(mesh=block(cell, dim, 2, f"{side}1"), model=model, kinematics=kinematics, material=material, **keys)


def solved(case):
    problem = Problem.of(case)
    *_, state = march(problem)
    return problem, state, step_figures(problem, state)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("seed", range(5))
def test_a_spread_has_the_resultant_and_the_moment_at_any_displacement(dim, seed):
    rng = np.random.default_rng(seed)
    k = 9
    x = np.zeros((k, 3))
    x[:, :dim] = rng.standard_normal((k, dim))
    s = Spread.of(np.arange(k), rng.random(k), x, np.append(rng.standard_normal(dim), np.zeros(3 - dim)), dim, True)
    theta = s.full(rng.standard_normal(len(s.axes)) * 0.9)
    R = np.eye(3) + turn(theta)
    u = (x @ (R - np.eye(3)).T)[:, :dim] + 0.2 * rng.standard_normal((k, dim)) + 3.0
    F, M = np.append(rng.standard_normal(dim), np.zeros(3 - dim)), s.full(rng.standard_normal(len(s.axes)))
    f = s.forces(F, M, s.shape(u.ravel()))
    np.testing.assert_allclose(f.sum(axis=0), F, atol=1e-12)
    place = np.append(s.point(u.ravel()), np.zeros(3 - dim)) + s.d
    now = s.r + s.moved(u.ravel())
    np.testing.assert_allclose(np.cross(now - place, f).sum(axis=0)[s.axes], M[s.axes], atol=1e-12)
    rigid = (x @ (R - np.eye(3)).T)[:, :dim].ravel()
    np.testing.assert_allclose(s.rotation(rigid), theta[s.axes], atol=1e-12)
    du, h = rng.standard_normal(u.shape), 1e-6
    ends = [s.forces(F, M, s.shape((u + sign * h * du).ravel())) for sign in (1, -1)]
    wanted = ((ends[0] - ends[1]) / (2 * h))[:, :dim].ravel()
    np.testing.assert_allclose(s.tangent(F, M, s.shape(u.ravel())) @ du.ravel(), wanted, atol=1e-6)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.5, 3.0, np.pi - 1e-9])
def test_a_rotation_vector_comes_back(angle):
    axis = np.array([0.48, -0.6, 0.64])
    np.testing.assert_allclose(
        rotation_vector(np.eye(3) + turn(angle * axis)), angle * axis, atol=1e-7 if angle > 3.1 else 1e-12
    )


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("kinematics", LAWS)
def test_a_body_pulled_by_a_coupling_strains_as_under_tractions(cell, kinematics):
    dim = dim_of(cell)
    side = f"{'xyz'[dim - 1]}1"
    t = dict(zip("xyz", (2.0, -1.0, 3.0)[3 - dim :], strict=False))
    pulled = {f"t{a}": v for a, v in t.items()}
    _, one, _ = solved(made(cell, kinematics, traction=Traction(group=side, **pulled)))
    case = made(cell, kinematics, coupling=Coupling(group=side, **{f"f{a}": v for a, v in t.items()}))
    _, other, figures = solved(case)
    np.testing.assert_allclose(other.u, one.u, atol=1e-10 * np.abs(one.u).max())
    coupling = figures.couplings[side]
    np.testing.assert_allclose(coupling.force, list(t.values()), atol=1e-11)
    np.testing.assert_allclose(coupling.moment, 0, atol=1e-11)


@pytest.mark.parametrize("cell", ["QUAD8", "HEXA8"])
def test_large_rotations_are_without_strain(cell):
    dim = dim_of(cell)
    side = f"{'xyz'[dim - 1]}1"
    theta = [1.5, -1.2, 0.9] if dim == 3 else 2.5
    at = [0.3, 0.4, 2.0][:dim]
    moved = {f"u{a}": 0.5 for a in "xyz"[:dim]}
    turned = Coupling(group=side, at=at, rotation=theta, weights="1 + x", **moved)
    problem, state, figures = solved(made(cell, "finite", displacement=[], coupling=turned, steps=Steps(count=4)))
    full = np.array(theta if dim == 3 else [0, 0, theta])
    arm = problem.space.mesh.points - np.array([*at, 0, 0][:3]) * ([1, 1, dim == 3])
    wanted = (arm @ turn(full).T)[:, :dim] + 0.5
    np.testing.assert_allclose(state.u.reshape(-1, dim), wanted, atol=1e-11)
    assert figures.energy < 1e-20
    np.testing.assert_allclose(figures.couplings[side].displacement, 0.5, atol=1e-12)
    np.testing.assert_allclose(figures.couplings[side].rotation, theta, atol=1e-12)


@pytest.mark.parametrize("kinematics", LAWS)
@pytest.mark.parametrize("cell", ["QUAD8", "HEXA8"])
def test_motions_and_loads_at_a_point_far_from_its_nodes(cell, kinematics):
    """Prescribed motions are reached, loads are as given, and supports carry the whole."""
    dim = dim_of(cell)
    side, low = f"{'xyz'[dim - 1]}1", f"{'xyz'[dim - 1]}0"
    at = [0.8, 1.6, 1.9][:dim] if dim == 3 else [0.8, 1.9]
    moment = [0.5, -0.4, 0.7] if dim == 3 else 0.5
    point = Coupling(group=side, at=at, ux=0.05, fy=1.0, moment=moment)
    _, _, figures = solved(made(cell, kinematics, coupling=point, steps=Steps(count=2)))
    coupling = figures.couplings[side]
    assert coupling.displacement[0] == pytest.approx(0.05, abs=1e-12)
    assert coupling.force[1] == pytest.approx(1.0, rel=1e-10)
    np.testing.assert_allclose(coupling.moment, moment, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(figures.reactions[low], -coupling.force, atol=1e-9)
    assert kinematics == "small" or figures.iterations <= 6


def test_the_tangent_of_rows_of_a_point_that_turns():
    point = Coupling(group="z1", at=[0.8, 1.6, 1.9], ux=0.05, uz=-0.1, axes={"x": [1, 1, 0], "xy": [0, 1, 0]})
    problem = Problem.of(made("HEXA8", "finite", coupling=point))
    (rows,) = problem.equalities
    assert isinstance(rows, CouplingRows) and not rows.linear
    rng = np.random.default_rng(3)
    u, du, h, p = 0.3 * rng.standard_normal((2, problem.space.n_dof)), None, 1e-6, np.array([1.0, -2.0])
    u, du = u
    ends = [rows.at(u + sign * h * du, 1.0) for sign in (1, -1)]
    np.testing.assert_allclose(rows.at(u, 1.0).C @ du, -(ends[0].gap - ends[1].gap) / (2 * h), atol=1e-7)
    bent = (ends[0].C.T @ p - ends[1].C.T @ p) / (2 * h)
    np.testing.assert_allclose(rows.curvature(u, 1.0, p) @ du, bent, atol=1e-6)


@pytest.mark.parametrize("kinematics", LAWS)
@pytest.mark.parametrize("cell", ["QUAD8", "HEXA8"])
def test_a_rigid_coupling_is_a_rigid_body(cell, kinematics):
    dim = dim_of(cell)
    side, at = f"{'xyz'[dim - 1]}1", [0.3, 0.4, 2.0][:dim]
    moment = [0.5, -0.4, 0.7] if dim == 3 else 0.5
    loads = {f"f{a}": 0.3 for a in "xyz"[1:dim]}
    body = Rigid(group=side, centre=at, ux=0.02, moment=moment, **loads)
    _, one, _ = solved(made(cell, kinematics, rigid=body))
    point = Coupling(group=side, at=at, kind="rigid", name="end", ux=0.02, moment=moment, **loads)
    _, other, figures = solved(made(cell, kinematics, coupling=point))
    np.testing.assert_allclose(other.u, one.u, atol=1e-13)
    coupling = figures.couplings["end"]
    np.testing.assert_allclose(coupling.force[1:], 0.3, rtol=1e-9)
    np.testing.assert_allclose(coupling.moment, moment, rtol=1e-9)
    if kinematics == "small":
        along = {"axes": {"x": [1, 0, 0], "xy": [0, 1, 0]} if dim == 3 else {"x": [1, 0]}}
        _, third, figures = solved(made(cell, coupling=replace(point, **along)))
        np.testing.assert_allclose(third.u, one.u, atol=1e-12)
        for now, then in zip(figures.couplings["end"], coupling, strict=True):
            np.testing.assert_allclose(now, then, atol=1e-10)


def test_components_that_follow_leave_the_others_free():
    """A lid that stays plane and is tilted, whose nodes slide in it: the strains of a bar that is bent."""
    lid = Coupling(group="z1", kind="rigid", components=["uz"], fz=2.0, rotation=[0.01, 0.0, 0.0])
    problem, state, figures = solved(made(coupling=lid, steps=Steps(count=1)))
    u, x = state.u.reshape(-1, 3), problem.space.mesh.points
    top = x[:, 2] == x[:, 2].max()
    coupling = figures.couplings["z1"]
    wanted = coupling.displacement[2] + 0.01 * (x[top, 1] - x[top, 1].mean())
    np.testing.assert_allclose(u[top, 2], wanted, atol=1e-12)
    assert coupling.force[2] == pytest.approx(2.0) and np.ptp(u[top, 0]) > 1e-4
    np.testing.assert_allclose(figures.reactions["z0"], [0, 0, -2], atol=1e-10)


def test_axisymmetric_points_move_along_the_axis():
    point = Coupling(group="y1", fy=3.0)
    _, state, figures = solved(made("QUAD8", model="axisymmetric", coupling=point))
    np.testing.assert_allclose(figures.reactions["y0"][1], -3.0)
    _, pulled, _ = solved(made("QUAD8", model="axisymmetric", force=Force(group="y1", fy=3.0, total=True)))
    np.testing.assert_allclose(state.u, pulled.u, atol=1e-13)
    _, _, moved = solved(made("QUAD8", model="axisymmetric", coupling=Coupling(group="y1", uy=0.01)))
    assert moved.couplings["y1"].displacement[1] == pytest.approx(0.01) and len(moved.couplings["y1"].rotation) == 0


def test_a_body_hangs_on_a_coupling_with_multigrid_and_in_motion():
    held = Coupling(group="z0", ux=0, uy=0, uz=0, rotation=[0, 0, 0])
    pulled = Traction(group="z1", tx=1.0)
    answers = []
    for backend in ("auto", "multigrid"):
        case = made(displacement=[], coupling=held, traction=pulled, solver=Solver(backend=backend))
        answers.append(solved(case)[1].u)
    np.testing.assert_allclose(answers[1], answers[0], atol=1e-9 * np.abs(answers[0]).max())
    case = made(displacement=[], coupling=held, traction=pulled, dynamics=Dynamics(), steps=Steps(end=0.2, count=4))
    _, _, figures = solved(case)
    np.testing.assert_allclose(figures.couplings["z0"].displacement, 0, atol=1e-12)


def test_a_moment_of_a_force_is_spread():
    force = Force(group="z1", fx=1.0, moment=[0.1, 0.2, 0.3], total=True)
    problem, _, figures = solved(made(force=force))
    (one,) = resultants(problem.space, problem.materials, problem.case, 1.0)
    np.testing.assert_allclose(one.force, [1, 0, 0], atol=1e-13)
    centre = problem.space.mesh.points[problem.space.mesh.points[:, 2] == problem.space.extent].mean(axis=0)
    _, _, other = solved(made(coupling=Coupling(group="z1", fx=1.0, moment=[0.1, 0.2, 0.3])))
    np.testing.assert_allclose(figures.reactions["z0"], other.reactions["z0"], atol=1e-12)
    assert centre.shape == (3,) and figures.energy == pytest.approx(other.energy, rel=1e-10)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"at": [0, 0, 2], "fx": 1.0, "weights": "x > 0.999 and y > 0.999"}, "one point, so that they take no moment"),
        ({"fx": 1.0, "weights": [[999, 1.0]]}, "its weights name node 999, which is not in the group"),
        ({"fx": 1.0, "weights": "-1"}, "the weights of its nodes add up to"),
        ({"kind": "rigid", "components": ["ux"], "fy": 1.0}, "no node follows its fy, with these components"),
        ({"kind": "rigid", "components": ["ux"], "rotation": [1, 0, 0]}, "no node follows its rotation"),
    ],
)
def test_couplings_that_cannot_be_are_named(keys, words):
    with pytest.raises(CaseError, match=words):
        solved(made(coupling=Coupling(group="z1", **keys)))


def test_a_coupling_between_prescribed_nodes_is_named():
    with pytest.raises(LacmeshError, match=r"coupling: it is off by .* all that it acts on is prescribed"):
        solved(made(coupling=Coupling(group="z0", ux=0.1)))


@pytest.mark.parametrize("ux", [0.1, 0.2])
def test_two_couplings_of_one_motion_are_named(ux):
    """A motion that both hold has no force of its own in either, whether they agree or not."""
    couplings = [Coupling(group="z1", ux=0.1), Coupling(group="z1", ux=ux, name="again")]
    with pytest.raises(CaseError, match=r"what it holds follows from coupling 'z1', or contradicts it; leave one out"):
        solved(made(coupling=couplings))


def test_a_rotation_that_an_equation_holds_already_has_no_moment():
    """A top that is level by an equation: round-off of the rotation's rows is no row."""
    lid = Equation(group="z1", same=["uz"])
    _, _, one = solved(made(coupling=Coupling(group="z1", uz=0.1), equation=lid))
    _, _, other = solved(made(coupling=Coupling(group="z1", uz=0.1, rotation=[0.0, 0.0, 0.0]), equation=lid))
    (first,), (second,) = one.couplings.values(), other.couplings.values()
    np.testing.assert_allclose(second.force, first.force, rtol=0, atol=1e-9 * abs(first.force[2]))
    np.testing.assert_allclose(second.moment, 0.0, rtol=0, atol=1e-9 * abs(first.force[2]))


# ---- far turns in one step


@pytest.mark.parametrize("cell", ["QUAD4", "HEXA8"])
@pytest.mark.parametrize("angle", [1.1, 1.5, np.pi / 2, np.pi])
def test_a_free_body_turns_as_far_as_its_coupling_in_one_step(cell, angle):
    """The rows of the coupling hold for half a turn less as well, and for a body that stays where it is at pi."""
    dim = dim_of(cell)
    axis = np.array([0.36, 0.48, 0.8]) if dim == 3 else np.array([0.0, 0.0, 1.0])
    side, zero = f"{'xyz'[dim - 1]}1", {f"u{a}": 0 for a in "xyz"[:dim]}
    turned = Coupling(group=side, at=[0.0] * dim, rotation=list(angle * axis) if dim == 3 else angle, **zero)
    problem, state, figures = solved(made(cell, "finite", displacement=[], coupling=turned))
    wanted = (problem.space.mesh.points @ turn(angle * axis).T)[:, :dim]
    np.testing.assert_allclose(state.u.reshape(-1, dim), wanted, atol=1e-9)
    assert figures.energy < 1e-18


def bent_beam(kind, theta, count):
    """A slender beam, held at its foot; the rotation of its end is prescribed."""
    cells = grid((8, 1), (0, 0), (10, 1), "QUAD4")
    ends = {name: skin(*cells, lambda x, at=at: np.isclose(x[..., 0], at)) for name, at in (("foot", 0), ("end", 10))}
    case = Case(
        mesh=join([(*cells, ends)]), model="plane_strain", kinematics="finite",
        material=Material(young=100.0, poisson=0.0, law="saint_venant_kirchhoff"), steps=Steps(count=count),
        displacement=Displacement(group="foot", ux=0, uy=0), coupling=Coupling(group="end", kind=kind, rotation=theta),
    )  # fmt: skip
    return solved(case)[2]


@pytest.mark.parametrize("kind, theta", [("distributing", 2.0), ("distributing", 2 * np.pi), ("rigid", 2 * np.pi)])
def test_a_beam_is_bent_the_way_that_is_prescribed(kind, theta):
    """One step leads where many do: not half a turn short of it, and not back to the straight beam at a full turn."""
    few, many = (bent_beam(kind, theta, count) for count in (1, 5))
    assert few.energy == pytest.approx(many.energy, rel=1e-6) and many.energy > 1.0
    np.testing.assert_allclose(few.couplings["end"].moment, many.couplings["end"].moment, rtol=1e-6)


def test_a_rotation_that_is_too_large_for_a_step_is_refused():
    turned = Coupling(group="y1", rotation=3.0, ux=0, uy=0)
    case = made("QUAD4", "finite", displacement=[], coupling=turned, steps=Steps(max_halvings=0))
    words = "'y1' turns by 3 radian in the step to time 1, and bodies follow a quarter of a turn at most; take more"
    with pytest.raises(LacmeshError, match=words):
        solved(case)


@pytest.mark.parametrize("kinematics", LAWS)
def test_a_body_that_a_coupling_moves_is_not_held_by_contact_alone(kinematics):
    """It goes three times as far as it is long; another one, which is tied to it, goes with it."""
    low, high = grid((2, 2), (0, 0), (1, 1), "QUAD4"), grid((3, 2), (0, 1), (1, 2), "QUAD4")
    skins = {
        "foot": skin(*low, lambda x: np.isclose(x[..., 1], 0)),
        "m": skin(*low, lambda x: np.isclose(x[..., 1], 1)),
    }
    mesh = join([(*low, skins), (*high, {"s": skin(*high, lambda x: np.isclose(x[..., 1], 1))})])
    case = Case(
        mesh=mesh, model="plane_strain", kinematics=kinematics, tie=Tie(slave="s", master="m"),
        material=Material(young=100.0, poisson=0.3, law=LAWS[kinematics]),
        coupling=Coupling(group="foot", ux=3, uy=0, rotation=0),
    )  # fmt: skip
    state = solved(case)[1]
    assert not any("body0" in one.words for one in state.held)
    assert [message for message in warnings_of(state.held, state.prescribed)] == []
    assert not any("body0" in words for words in validate(case).held)
