"""Couplings: resultants, exact rotations, prescribed motions, free axes, nodes that several records prescribe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lacsolver as ls
from lacmesh import join
from lacmesh.errors import LacmeshError
from lacmesh.generate import box, rectangle
from lacsolver.case import (
    CaseError,
    Coupling,
    Displacement,
    Dynamics,
    Equation,
    Force,
    Material,
    Rigid,
    Steps,
    Tie,
    Traction,
    parse_case,
)
from lacsolver.constraints.coupling import CouplingRows
from lacsolver.constraints.rotation import turn
from lacsolver.constraints.spread import Spread, rotation_vector
from lacsolver.doubts.held import hardly_held
from lacsolver.doubts.run import Run
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.problem.resultants import resultants
from lacsolver.results.figures import step_figures
from lacsolver.validation import validate
from tests.lacsolver.patch_meshes import block
from tests.problems import case_of, fix
from tests.samples import each_option

LAWS = {"small": "elastic", "finite": "neo_hookean"}
#: a cell of a plane and one of space, and kinematics
BOTH = pytest.mark.parametrize("cell", ["QUAD8", "HEXA8"])
EITHER = pytest.mark.parametrize("kinematics", LAWS)


def dim_of(cell):
    return 2 if cell[:4] in ("QUAD", "TRIA") else 3


def sides(dim):
    """The names of the lowest and the highest side of a block."""
    return f"{'xyz'[dim - 1]}0", f"{'xyz'[dim - 1]}1"


def along(name, values):
    """Keys of a vector: along("f", (1, 2)) is fx = 1, fy = 2."""
    return {f"{name}{axis}": value for axis, value in zip("xyz", values, strict=False)}


def made(cell="HEXA8", kinematics="small", *records, free=False, model="", **keys):
    """A block of a cell with its lowest side fixed, unless it is `free`, and records."""
    dim = dim_of(cell)
    foot = [] if free else [fix(sides(dim)[0], "xyz"[:dim])]
    material = Material(young=100.0, poisson=0.3, density=1.0, law=LAWS[kinematics])
    model = model or ("3d" if dim == 3 else "plane_strain")
    mesh = block(cell, dim, 2, sides(dim)[1])
    return case_of(mesh, material, *foot, *records, model=model, kinematics=kinematics, **keys)


def solved(case):
    problem = Problem.of(case)
    *_, state = march(problem)
    return problem, state, step_figures(problem, state)


# ---- the weights of a point


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


def test_the_tangent_of_rows_of_a_point_that_turns():
    point = Coupling(group="z1", at=[0.8, 1.6, 1.9], ux=0.05, uz=-0.1, axes={"x": [1, 1, 0], "xy": [0, 1, 0]})
    problem = Problem.of(made("HEXA8", "finite", point))
    (rows,) = problem.equalities
    assert isinstance(rows, CouplingRows) and not rows.linear
    h, p = 1e-6, np.array([1.0, -2.0])
    u, du = 0.3 * np.random.default_rng(3).standard_normal((2, problem.space.n_dof))
    ends = [rows.at(u + sign * h * du, 1.0) for sign in (1, -1)]
    np.testing.assert_allclose(rows.at(u, 1.0).C @ du, -(ends[0].gap - ends[1].gap) / (2 * h), atol=1e-7)
    bent = (ends[0].C.T @ p - ends[1].C.T @ p) / (2 * h)
    np.testing.assert_allclose(rows.curvature(u, 1.0, p) @ du, bent, atol=1e-6)


# ---- bodies that are moved and loaded


@pytest.mark.rows("small-QUAD8", "finite-TETRA10")
@pytest.mark.parametrize("cell", ["QUAD4", "QUAD8", "TRIA6", "HEXA8", "HEXA20", "TETRA10", "PENTA6"])
@EITHER
def test_a_body_pulled_by_a_coupling_strains_as_under_tractions(cell, kinematics):
    dim = dim_of(cell)
    t, side = (2.0, -1.0, 3.0)[3 - dim :], sides(dim)[1]
    _, one, _ = solved(made(cell, kinematics, Traction(group=side, **along("t", t))))
    _, other, figures = solved(made(cell, kinematics, Coupling(group=side, **along("f", t))))
    np.testing.assert_allclose(other.u, one.u, atol=1e-10 * np.abs(one.u).max())
    np.testing.assert_allclose(figures.couplings[side].force, t, atol=1e-11)
    np.testing.assert_allclose(figures.couplings[side].moment, 0, atol=1e-11)


@pytest.mark.rows("HEXA8-1.1-1")
@pytest.mark.parametrize(
    "cell, angle, count",
    each_option(
        (cell, *way)
        for way in [(None, 4), (1.1, 1), (1.5, 1), (np.pi / 2, 1), (np.pi, 1)]
        for cell in ("QUAD8", "HEXA8")
    ),
)
def test_a_free_body_turns_as_far_as_its_coupling_without_strain(cell, angle, count):
    """In one step too: the rows hold for half a turn less as well, and for a body that stays where it is at pi."""
    dim = dim_of(cell)
    axis = np.array([0.36, 0.48, 0.8] if dim == 3 else [0, 0, 1.0])
    theta = angle * axis if angle else np.array([1.5, -1.2, 0.9] if dim == 3 else [0, 0, 2.5])
    at, away = ([0.0] * dim, 0.0) if angle else ([0.3, 0.4, 2.0][:dim], 0.5)
    keys = {} if angle else {"weights": "1 + x"}
    given = list(theta) if dim == 3 else theta[2]
    turned = Coupling(group=sides(dim)[1], at=at, rotation=given, **along("u", dim * [away]), **keys)
    problem, state, figures = solved(made(cell, "finite", turned, Steps(count=count), free=True))
    arm = problem.space.mesh.points - np.array([*at, 0, 0][:3]) * [1, 1, dim == 3]
    wanted = (arm @ turn(theta).T)[:, :dim] + away
    np.testing.assert_allclose(state.u.reshape(-1, dim), wanted, atol=1e-9)
    assert figures.energy < 1e-18
    point = figures.couplings[sides(dim)[1]]
    np.testing.assert_allclose(point.displacement, away, atol=1e-12)
    if angle != np.pi:  # or the other way round
        np.testing.assert_allclose(point.rotation, given, atol=1e-12)


@EITHER
@BOTH
def test_motions_and_loads_at_a_point_far_from_its_nodes(cell, kinematics):
    """Prescribed motions are reached, loads are as given, and supports carry the whole."""
    dim = dim_of(cell)
    low, side = sides(dim)
    moment = [0.5, -0.4, 0.7] if dim == 3 else 0.5
    point = Coupling(group=side, at=[0.8, 1.6, 1.9] if dim == 3 else [0.8, 1.9], ux=0.05, fy=1.0, moment=moment)
    _, _, figures = solved(made(cell, kinematics, point, Steps(count=2)))
    coupling = figures.couplings[side]
    assert coupling.displacement[0] == pytest.approx(0.05, abs=1e-12)
    assert coupling.force[1] == pytest.approx(1.0, rel=1e-10)
    np.testing.assert_allclose(coupling.moment, moment, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(figures.reactions[low], -coupling.force, atol=1e-9)
    assert kinematics == "small" or figures.iterations <= 6


@EITHER
@BOTH
def test_a_rigid_coupling_is_a_rigid_body(cell, kinematics):
    """The same answer, also with axes, along which all components follow."""
    dim = dim_of(cell)
    side, at = sides(dim)[1], [0.3, 0.4, 2.0][:dim]
    keys = {"ux": 0.02, "moment": [0.5, -0.4, 0.7] if dim == 3 else 0.5, **along("f", [None, 0.3, 0.3][:dim])}
    _, one, _ = solved(made(cell, kinematics, Rigid(group=side, centre=at, **keys)))
    point = Coupling(group=side, at=at, kind="rigid", name="end", **keys)
    _, other, figures = solved(made(cell, kinematics, point))
    np.testing.assert_allclose(other.u, one.u, atol=1e-13)
    coupling = figures.couplings["end"]
    np.testing.assert_allclose(coupling.force[1:], 0.3, rtol=1e-9)
    np.testing.assert_allclose(coupling.moment, keys["moment"], rtol=1e-9)
    axes = {"x": [1, 0, 0], "xy": [0, 1, 0]} if dim == 3 else {"x": [1, 0]}
    if kinematics == "small":
        _, third, figures = solved(made(cell, kinematics, replace(point, axes=axes)))
        np.testing.assert_allclose(third.u, one.u, atol=1e-12)
        for now, then in zip(figures.couplings["end"], coupling, strict=True):
            np.testing.assert_allclose(now, then, atol=1e-10)


def test_axisymmetric_points_move_along_the_axis():
    def of(record):
        return solved(made("QUAD8", "small", record, model="axisymmetric"))[1:]

    (state, figures), (pulled, _) = of(Coupling(group="y1", fy=3.0)), of(Force(group="y1", fy=3.0, total=True))
    np.testing.assert_allclose(figures.reactions["y0"][1], -3.0)
    np.testing.assert_allclose(state.u, pulled.u, atol=1e-13)
    moved = of(Coupling(group="y1", uy=0.01))[1].couplings["y1"]
    assert moved.displacement[1] == pytest.approx(0.01) and len(moved.rotation) == 0


def test_a_body_hangs_on_a_coupling_in_motion():
    hung = Coupling(group="z0", ux=0, uy=0, uz=0, rotation=[0, 0, 0]), Traction(group="z1", tx=1.0)
    _, _, figures = solved(made("HEXA8", "small", *hung, Dynamics(), Steps(end=0.2, count=4), free=True))
    np.testing.assert_allclose(figures.couplings["z0"].displacement, 0, atol=1e-12)


def test_a_moment_of_a_force_is_spread_as_that_of_a_coupling():
    load = {"group": "z1", "fx": 1.0, "moment": [0.1, 0.2, 0.3]}
    problem, _, figures = solved(made("HEXA8", "small", Force(**load, total=True)))
    (one,) = resultants(problem.loads, 1.0)
    np.testing.assert_allclose(one.force, [1, 0, 0], atol=1e-13)
    _, _, other = solved(made("HEXA8", "small", Coupling(**load)))
    np.testing.assert_allclose(figures.reactions["z0"], other.reactions["z0"], atol=1e-12)
    assert figures.energy == pytest.approx(other.energy, rel=1e-10)


def test_a_rotation_that_an_equation_holds_already_has_no_moment():
    """A top that is level by an equation: round-off of the rotation's rows is no row."""
    lid = Equation(group="z1", same=["uz"])
    (first,), (second,) = (
        solved(made("HEXA8", "small", Coupling(group="z1", uz=0.1, **keys), lid))[2].couplings.values()
        for keys in ({}, {"rotation": [0.0, 0.0, 0.0]})
    )
    np.testing.assert_allclose(second.force, first.force, rtol=0, atol=1e-9 * abs(first.force[2]))
    np.testing.assert_allclose(second.moment, 0.0, rtol=0, atol=1e-9 * abs(first.force[2]))


@pytest.mark.rows("distributing-2.0")
@pytest.mark.parametrize("kind, theta", [("distributing", 2.0), ("distributing", 2 * np.pi), ("rigid", 2 * np.pi)])
def test_a_beam_is_bent_the_way_that_is_prescribed(kind, theta):
    """One step leads where many do: not half a turn short of it, and not back to the straight beam at a full turn."""
    law = Material(young=100.0, poisson=0.0, law="saint_venant_kirchhoff")
    records = law, fix("left", "xy"), Coupling(group="right", kind=kind, rotation=theta)
    plane, mesh = {"model": "plane_strain", "kinematics": "finite"}, rectangle((8, 1), (10, 1))
    few, many = (solved(case_of(mesh, *records, Steps(count=count), **plane))[2] for count in (1, 5))
    assert few.energy == pytest.approx(many.energy, rel=1e-6) and many.energy > 1.0
    np.testing.assert_allclose(few.couplings["right"].moment, many.couplings["right"].moment, rtol=1e-6)


@EITHER
def test_a_body_that_a_coupling_moves_is_not_held_by_contact_alone(kinematics):
    """It goes three times as far as it is long; another one, which is tied to it, goes with it."""
    low, high = rectangle(2).renamed(top="m"), rectangle((3, 2), corner=(0, 1)).renamed(bottom="s")
    mesh = join(low.renamed(body="body0").only("body0", "bottom", "m"), high.renamed(body="body1").only("body1", "s"))
    material = Material(young=100.0, poisson=0.3, law=LAWS[kinematics])
    records = material, Tie(slave="s", master="m"), Coupling(group="bottom", ux=3, uy=0, rotation=0)
    case = case_of(mesh, *records, model="plane_strain", kinematics=kinematics)
    problem, state = solved(case)[:2]
    assert not any("body0" in one.words for one in state.held)
    assert list(hardly_held(Run(problem, problem.joints, last=state))) == []
    assert not any("body0" in words for words in validate(case).held)


# ---- rotations prescribed about some axes and free about others

#: moments about x and y of the lid of a column of 1 x 2 x 3
MX, MY = 3.0, 2.0
AXES = {"x": [0.8, 0.6, 0.0], "xy": [-0.6, 0.8, 0.0]}
KINDS = {
    "distributing": {"kind": "distributing"},
    "distributing at a place": {"kind": "distributing", "at": (0.2, 0.7, 3.5), "ux": 0.002},
    "distributing along other axes": {"kind": "distributing", "axes": AXES},
    "rigid": {"kind": "rigid"},
    "rigid, components": {"kind": "rigid", "components": ["ux", "uz"]},
    "rigid, other axes": {"kind": "rigid", "axes": AXES},
    "body": {"fx": 0.0, "fy": 0.0, "fz": 0.0},
}


def column(finite=False, **keys):
    """The solution of a column on its foot whose lid is a coupling, or without a `kind` a rigid body."""
    material = Material(young=1000.0, poisson=0.3, law="saint_venant_kirchhoff" if finite else "elastic")
    lid = (Coupling if "kind" in keys else Rigid)(group="top", **keys)
    records = material, fix("bottom", "xyz"), lid
    return ls.solve(case_of(box(2, (1, 2, 3)), *records, model="3d", kinematics="finite" if finite else "small"))


def moved(solution):
    """Rotation of the lid, and the moment on its nodes."""
    point = solution.figures.couplings.get("top")
    if point is not None:
        return point.rotation, point.moment
    problem, state, _ = solution._solved
    reaction = problem.constraints.rigid_reactions(state.reaction, state.rigid)["top"]
    return state.rigid["top"][3:], reaction[3:]


@pytest.mark.parametrize("kind", KINDS)
def test_a_rotation_that_a_moment_would_give(kind):
    """Prescribed about y as a moment has turned it, free about x and z: the same answer, with that moment about y."""
    keys = KINDS[kind]
    free = column(**keys, moment=(MX, MY, 0.0))
    theta, moment = moved(free)
    if "axes" not in keys:
        np.testing.assert_allclose(moment, (MX, MY, 0.0), atol=1e-8)
    R = np.eye(3)
    if "axes" in keys:
        x, y = np.array(AXES["x"]), np.array(AXES["xy"])
        R = np.stack([x, y, np.cross(x, y)])
    hinged = column(**keys, rotation=("free", (R @ theta)[1], "free"), moment=(MX, 0.0, 0.0))
    np.testing.assert_allclose(hinged.u, free.u, atol=1e-9 * np.abs(free.u).max())
    np.testing.assert_allclose(moved(hinged)[0], theta, atol=1e-9 * np.abs(theta).max())
    np.testing.assert_allclose(moved(hinged)[1], moment, atol=1e-8)


@pytest.mark.parametrize("keys", [KINDS["rigid"], KINDS["body"]])
def test_large_rotations_about_one_axis(keys):
    """Rotations with 0.3 about y: the one that is found has the least energy, whose derivatives by the others are 0."""
    hinged = column(True, **keys, rotation=("free", 0.3, "free"))
    theta = moved(hinged)[0]
    assert theta[1] == pytest.approx(0.3, rel=1e-12)

    def energy(x, z):
        return column(True, **keys, rotation=(theta[0] + x, 0.3, theta[2] + z)).figures.energy

    least, h = hinged.figures.energy, 1e-3
    for way in ((h, 0.0), (0.0, h)):
        more, less = energy(*way), energy(-way[0], -way[1])
        assert more > least < less
        assert abs(more - less) < 2e-3 * (more + less - 2 * least)


def test_large_rotations_under_a_moment_about_a_free_axis():
    """About x alone the body turns as if it were free about all axes, by symmetry."""
    free = column(True, kind="rigid", moment=(60.0, 0.0, 0.0))
    hinged = column(True, kind="rigid", rotation=("free", 0.0, 0.0), moment=(60.0, 0.0, 0.0))
    assert moved(free)[0][0] > 0.1
    np.testing.assert_allclose(hinged.u, free.u, atol=1e-7)


def test_components_that_follow_large_rotations():
    """Along its axes all components follow: the equations are those of a rigid body."""
    turned = {"rotation": (0.0, 0.4, 0.1), "fx": 1.0, "at": (0.3, 1.0, 3.2), "kind": "rigid"}
    body = column(True, **turned)
    along_axes = column(True, axes={"x": [1.0, 0.0, 0.0], "xy": [0.0, 1.0, 0.0]}, **turned)
    np.testing.assert_allclose(along_axes.u, body.u, atol=1e-9)
    for one, other in zip(along_axes.figures.couplings["top"], body.figures.couplings["top"], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)
    partly = column(True, components=["ux", "uz"], **turned)
    lid = body.mesh.nodes_on(body.mesh.cells_of("top"))
    one, other = (solution.u[lid] - solution.u[lid[0]] for solution in (partly, body))
    np.testing.assert_allclose(one[:, [0, 2]], other[:, [0, 2]], atol=1e-9)
    assert abs(partly.u[lid] - body.u[lid])[:, 1].max() > 1e-3


# ---- nodes that several records prescribe

PLANES = fix("bottom", "z"), fix("left", "x"), fix("front", "y")
COLUMN = {
    "small": Material(young=1000.0, poisson=0.0),
    "finite": Material(young=1000.0, poisson=0.0, law="saint_venant_kirchhoff"),
}
STILL = {"ux": 0.0, "uy": 0.0, "uz": 0.01, "rotation": (0, 0, 0)}


def lidded(*records, kinematics="small", mesh=None):
    """The solution of a cube with planes of symmetry x = 0, y = 0, z = 0, unless records say so, and a lid."""
    given = records if any(isinstance(record, Displacement) for record in records[1:]) else (*PLANES, *records)
    case = case_of(box(2) if mesh is None else mesh, COLUMN[kinematics], *given, model="3d", kinematics=kinematics)
    return ls.solve(case)


@pytest.mark.parametrize(
    ("lid", "kinematics"),
    [
        (Coupling(group="top", kind="rigid", **STILL), "small"),
        (Coupling(group="top", kind="rigid", **STILL), "finite"),
        (Rigid(group="top", uz=0.01), "small"),
        (Coupling(group="top", kind="rigid", ux=0.0, uz=0.01), "small"),
        (Coupling(group="top", kind="rigid", fz=10.0), "small"),
    ],
)
def test_a_lid_on_planes_of_symmetry(lid, kinematics):
    """A column of nu = 0 under a rigid lid, whose nodes on the planes have a component twice: u = F / E."""
    solution = lidded(lid, kinematics=kinematics)
    np.testing.assert_allclose(solution.u, 0.01 * solution.mesh.points * [0, 0, 1], atol=1e-12)
    force = 10.0 if kinematics == "small" else 1000.0 * (1.01**2 - 1) / 2 * 1.01
    reactions = solution.figures.reactions
    assert reactions["top"][2] == pytest.approx(force, rel=1e-9)
    assert reactions["bottom"][2] == pytest.approx(-force, rel=1e-9)


def test_reactions_of_a_plane_on_a_rigid_lid():
    """The lid is pushed along x: the plane and the lid's own nodes on it take all of it, and so reactions add up."""
    solution = lidded(Coupling(group="top", kind="rigid", at=(0.5, 0.5, 1.5), fx=7.0, fz=10.0))
    reactions, lid = solution.figures.reactions, solution.figures.couplings["top"]
    np.testing.assert_allclose(lid.force, [7, 0, 10], atol=1e-9)
    np.testing.assert_allclose(lid.moment, 0, atol=1e-9)
    total = sum(reactions[name] for name in ("bottom", "left", "front"))
    np.testing.assert_allclose(total, [-7, 0, -10], atol=1e-9)
    on_plane = solution.mesh.nodes_on(solution.mesh.cells_of("left"))
    np.testing.assert_allclose(solution.u[on_plane, 0], 0.0, atol=1e-12)


def test_a_lid_on_a_plane_of_symmetry_that_tilts():
    """It turns freely about x by finite rotations: nodes on the plane x = 0 hold it along x, as its own ux = 0 does."""
    mesh = box(2).with_groups("nodes", below=lambda x: (x[0] < 1e-9) & (x[2] < 1 - 1e-9))
    lid = Coupling(group="top", kind="rigid", ux=0.0, rotation=("free", 0, 0), moment=(25.0, 0, 0))
    one, other = (
        lidded(lid, fix("bottom", "xyz"), fix(plane, "x"), Steps(count=2), kinematics="finite", mesh=mesh)
        for plane in ("left", "below")
    )
    assert one.figures.couplings["top"].rotation[0] > 0.2
    np.testing.assert_allclose(one.u, other.u, atol=1e-9)


HEAD = 'mesh = "cube.msh"\nmodel = "3d"\n[[material]]\nyoung = 1.0\npoisson = 0.0\n'


def test_a_component_that_two_records_prescribe_alike():
    """Equal values are taken, in other axes too; another value is a mistake, and the message has both lines."""
    turned = {"x": [0.0, 1.0, 0.0], "xy": [-1.0, 0.0, 0.0]}
    again = fix("left", "x"), Displacement(group="left", uy=0.0, axes=turned), Displacement(group="top", uz=0.01)
    assert lidded(*PLANES, *again).figures.reactions["top"][2] == pytest.approx(10.0, rel=1e-9)
    twice = HEAD + '[[displacement]]\ngroup = "g"\nux = 0.1\n[[displacement]]\ngroup = "g"\nux = {}\n'
    assert len(parse_case(twice.format("0.1")).displacement) == 2
    with pytest.raises(CaseError, match=r"line 11: .* line 6"):
        parse_case(twice.format("0.2"))


# ---- what is refused

LID = {"group": "z1", "kind": "rigid"}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([Coupling(group="z1", at=[0, 0, 2], fx=1.0, weights="x > 0.999 and y > 0.999")], "take no moment"),
        ([Coupling(group="z1", fx=1.0, weights=[[999, 1.0]])], "node 999"),
        ([Coupling(group="z1", fx=1.0, weights="-1")], "nodes add up to"),
        ([Coupling(**LID, components=["ux"], fy=1.0)], "follows its fy"),
        ([Coupling(**LID, components=["ux"], rotation=[1, 0, 0])], "follows its rotation"),
        ([Coupling(group="z0", ux=0.1)], "all its displacements are prescribed"),
        # a motion that both hold has no force of its own in either, whether they agree or not
        (
            [Coupling(group="z1", ux=0.1), Coupling(group="z1", ux=0.1, name="again")],
            "constraints follow from coupling 'z1'",
        ),
        (
            [Coupling(group="z1", ux=0.1), Coupling(group="z1", ux=0.2, name="again")],
            "constraints follow from coupling 'z1'",
        ),
        ([Coupling(**LID, rotation=("free", 0.1, 0.0), moment=(0.0, 1.0, 0.0))], "rotation is prescribed"),
        ([Coupling(**LID, rotation=(0.0, 0.1, 0.0), moment=(0.0, 1.0, 0.0))], "cannot be combined with rotation"),
    ],
)
def test_couplings_that_are_refused(given, words):
    with pytest.raises(LacmeshError, match=words):
        solved(made("HEXA8", "small", *given))


@pytest.mark.parametrize(
    ("cell", "given", "words"),
    [
        ("HEXA8", [Coupling(group="z1", rotation=("free", 0.1, 0.0))], "about none"),
        (
            "HEXA8",
            [Coupling(**LID, components=["uz"], rotation=("free", 0.1, 0.0))],
            "needs prescribed finite rotations",
        ),
        ("HEXA8", [Coupling(**LID, components=["uz"], fz=1.0)], "needs prescribed finite rotations"),
        ("HEXA8", [fix("x0", "x"), Coupling(**LID, uz=0.01)], "freely by finite rotations"),
        ("QUAD4", [Coupling(group="y1", rotation=3.0, ux=0, uy=0), Steps(max_halvings=0)], "a quarter of a turn"),
    ],
)
def test_finite_rotations_that_are_refused(cell, given, words):
    with pytest.raises(LacmeshError, match=words):
        solved(made(cell, "finite", *given, free=cell == "QUAD4"))
