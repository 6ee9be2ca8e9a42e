"""Loads and springs: their work against exact integrals, their derivatives against differences, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh, join
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacmesh.generate import box, rectangle
from lacsolver.bodies import small as assemble
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.bodies.line_springs import LineSprings
from lacsolver.bodies.material import Elastic, Materials, Orthotropic
from lacsolver.bodies.points import points, weights
from lacsolver.case import (
    BodyForce,
    CaseError,
    Force,
    Gravity,
    Material,
    Pressure,
    Rigid,
    Spring,
    Steps,
    Traction,
)
from lacsolver.case.errors import EvaluationError
from lacsolver.distributed.share import Share
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.loads import load_of, on_skin, pressure, thermal_force
from lacsolver.problem.problem import Problem, _check_shared
from lacsolver.problem.rigid_modes import describe, free_motions
from lacsolver.space.space import MODELS, Space
from tests.lacsolver.bodies import (
    PAIRS,
    displacement,
    distorted,
    mixture,
    one_cell,
    plane_mixture,
    strain,
    with_skin,
)
from tests.lacsolver.test_finite import by_differences
from tests.problems import case_of
from tests.quality_cells import rotation
from tests.samples import each_option

LAW = Elastic(young=200.0, poisson=0.3, density=7.0, expansion=2e-3, reference_temperature=20.0)
EVERY = pytest.mark.parametrize(("name", "model"), PAIRS)
EACH_MODEL = pytest.mark.parametrize("model", MODELS)


def curved(name, model, distortion=0.1):
    thickness = 0.4 if model == "plane_stress" else None
    mesh = with_skin(one_cell(name, distortion if CELLS[name].order == 2 else 2 * distortion, seed=3))
    return Space.of(mesh, model, thickness=thickness), mesh.cell_groups["skin"]


def square_with_skin(**rest):
    """[1, 2] x [0, 1] as one QUAD4 with its four sides."""
    return with_skin(Mesh.create([[1, 0], [2, 0], [2, 1], [1, 1]], [("QUAD4", [[0, 1, 2, 3]])], **rest))


def acting(space, record, t=1.0):
    """The nodal forces of the load of a record."""
    return load_of(space, Materials.of(space, LAW), record, finite=False).force(t, None)


def along(letter, values, **keys):
    """Keys of a vector: along("f", (1, 2)) is fx = 1, fy = 2."""
    return {f"{letter}{axis}": value for axis, value in zip("xyz", values, strict=False)} | keys


def pressed(space, faces, value, follower=False):
    """A pressure on skin cells, by their indices."""
    record = Pressure(group="skin", value=value, follower=follower)
    return pressure(record, on_skin(space, np.asarray(faces), outer=True))


def varying(x, t):
    """A pressure by place and time."""
    return t + x[:, 0] * x[:, 1]


# ---- loads on skins


@EVERY
def test_the_work_of_a_pressure_is_that_of_the_change_of_volume(name, model):
    """int p n.v dS = int p div v + grad p . v dV for any v, exactly, on curved faces too; p = 3 + c y."""
    space, skin = curved(name, model)
    v = np.random.default_rng(0).normal(size=space.n_dof)
    degree = 24 if CELLS[name].dim == 2 else 16
    zz = (2,) if model == "axisymmetric" or space.dim == 3 else ()
    parts = weights(space, degree), points(space, degree)
    (w,), (x,), (e,), (u,) = (*parts, *(of(space, v, degree) for of in (strain, displacement)))
    exact = (w * ((3 + 4 * x[..., 1]) * e[..., [0, 1, *zz]].sum(axis=-1) + 4 * u[..., 1])).sum()
    got = pressed(space, skin, lambda x, t: 3 + t * x[:, 1]).force(4.0, None)
    assert got @ v == pytest.approx(-exact, rel=1e-12)


def test_a_pressure_on_one_side_pushes_into_the_body_however_the_side_is_listed():
    mesh = square_with_skin()
    for nodes in ([[2, 3]], [[3, 2]]):
        top = Mesh.create(mesh.points, [("QUAD4", mesh.block("QUAD4")), ("SEG2", nodes)])
        space = Space.of(top, "plane_strain")
        np.testing.assert_allclose(pressed(space, [1], 3.0).force(1.0, None), [0, 0, 0, 0, 0, -1.5, 0, -1.5])


def faces_of(row):
    """The kinds of faces that are pressed, each in its model, and the pressure."""
    name, model, value = row
    return [*((facet.type, model) for facet in CELLS[name].facets), value]


@pytest.mark.rows("QUAD4-axisymmetric-3.0", "QUAD8-plane_strain-varying")
@pytest.mark.parametrize(
    ("name", "model", "value"), each_option(((*pair, value) for pair in PAIRS for value in (varying, 3.0)), of=faces_of)
)
def test_the_load_stiffness_is_the_derivative_of_the_load(name, model, value):
    space, skin = curved(name, model)
    skin = skin[: len(skin) // 2]
    u = np.random.default_rng(0).uniform(-0.1, 0.1, space.n_dof)
    own = pressed(space, skin, value, follower=True)
    K = own.tangent(0.7, u).toarray()

    def load(v):
        return own.force(0.7, v)

    expected = by_differences(load, u, 1e-3)  # the load is a cubic of u at most: exact but for rounding
    np.testing.assert_allclose(K, expected, rtol=0, atol=1e-11 * np.abs(K).max())
    assert np.abs(K - K.T).max() > 1e-2 * np.abs(K).max()


@EVERY
def test_a_uniform_pressure_on_a_closed_skin_has_a_potential(name, model):
    """It is -p V, so that the load stiffness is symmetric, also undeformed."""
    space, skin = curved(name, model)
    u = np.random.default_rng(0).uniform(-0.1, 0.1, space.n_dof)
    K = pressed(space, skin, 3.0, follower=True).tangent(1.0, u).toarray()
    np.testing.assert_allclose(K, K.T, rtol=0, atol=1e-13 * np.abs(K).max())
    here = pressed(space, skin, 2.0, follower=True).tangent(1.0, np.zeros(space.n_dof))
    assert np.abs(here @ np.tile(np.eye(space.dim)[1], space.mesh.n_nodes)).max() < 1e-13 * abs(here).max()


@EVERY
def test_a_traction_along_the_normal_is_a_pressure(name, model):
    """Components are numbers and functions, of which each acts along its axis."""
    space, skin = curved(name, model)
    normal = [lambda x, n, t, k=k: -3 * t * n[:, k] for k in range(space.dim)]
    got = acting(space, Traction(group="skin", **along("t", normal)), 0.5)
    np.testing.assert_allclose(got, pressed(space, skin, 1.5).force(1.0, None), atol=1e-13)
    parts = [lambda x, n, t: 2 * x[:, 1], 1.5, lambda x, n, t: t * x[:, 0]][: space.dim]
    whole = acting(space, Traction(group="skin", **along("t", parts)), 3.0)
    of_each = [acting(space, Traction(group="skin", **{f"t{a}": v}), 3.0) for a, v in zip("xyz", parts, strict=False)]
    np.testing.assert_allclose(sum(of_each), whole, atol=1e-13 * np.abs(whole).max())
    assert all(not f.reshape(-1, space.dim)[:, np.arange(space.dim) != k].any() for k, f in enumerate(of_each))


# ---- loads in bodies and at nodes


@EVERY
def test_the_work_of_a_body_force_of_which_weight_is_one(name, model):
    space, _ = curved(name, model)
    v = np.random.default_rng(0).normal(size=space.n_dof)
    (w,), (u,) = weights(space, 20), displacement(space, v, 20)
    f = acting(space, BodyForce(**along("f", [lambda x, t: np.exp(t) + 0 * x[:, 0], 2.0, -1.0][: space.dim])))
    exact = (w * (u @ np.array([np.e, 2.0, -1.0])[: space.dim])).sum()
    # r N det J of TRIA7 has degree 10 with the bubble in all three; the rule of plane quadratic cells has it
    assert f @ v == pytest.approx(exact, rel=1e-12)
    weight = acting(space, Gravity(**along("g", (np.e / 7, 2 / 7, -1 / 7)[: space.dim])))
    np.testing.assert_allclose(weight, f, rtol=0, atol=1e-13 * np.abs(f).max())


@EVERY
def test_a_cell_numbered_inside_out_has_the_loads_of_its_mirror(name, model):
    space, skin = curved(name, model)
    mesh = Mesh.create(space.mesh.points * [1, -1, 1], space.mesh.blocks, space_dim=space.mesh.space_dim)
    mirror = Space.of(mesh, model, thickness=space.thickness if model == "plane_stress" else None)
    flip = np.tile([1.0, -1.0, 1.0][: space.dim], mesh.n_nodes)
    for load in (
        lambda s: pressed(s, skin, 3.0).force(1.0, None),
        lambda s: acting(s, Gravity(gx=2.0)),
        lambda s: thermal_force(s, Materials.of(s, LAW), 50.0),
    ):
        f = load(space)
        np.testing.assert_allclose(load(mirror), flip * f, rtol=0, atol=1e-13 * np.abs(f).max())


# ---- warmth

WOOD = Orthotropic(
    (11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06), axes=((2.0, 1.0), (0.0, 1.0)), expansion=(1e-3, 4e-3, 2e-3)
)
Q = rotation(np.random.default_rng(1))
TURNED = Orthotropic(*(WOOD.young, WOOD.poisson, WOOD.shear), axes=(tuple(Q[0]), tuple(Q[1])), expansion=WOOD.expansion)


def mixed(order, model):
    return distorted((mixture if model == "3d" else plane_mixture)(order), 0.06 if order == "1" else 0.03, seed=4)


def check_warm(space, law, temperature, u, stress=0.0, t=0.0):
    """Assert that a displacement (n, dim) balances the warmth, and leaves this stress."""
    materials, u = Materials.of(space, law), u[:, : space.dim].ravel()
    f = thermal_force(space, materials, temperature, t)
    np.testing.assert_allclose(assemble.assemble_stiffness(space, materials) @ u, f, atol=1e-11 * np.abs(f).max())
    at = temperature if t == 0 else lambda x, _: temperature(x, t)
    for s in assemble.stress(space, materials, u, temperature=at):
        np.testing.assert_allclose(s, np.broadcast_to(stress, s.shape), atol=1e-10)


@pytest.mark.parametrize("order", ["1", "2", "2-full"])
@pytest.mark.parametrize(("model", "law"), [("3d", LAW), ("plane_stress", LAW), ("axisymmetric", LAW), ("3d", TURNED),
                                            ("plane_stress", WOOD)])  # fmt: skip
def test_a_free_body_expands_without_stress(order, model, law):
    space = Space.of(mixed(order, model), model)
    strain = np.zeros(6)
    strain[: space.model.n_stress] = 50.0 * law.thermal_strain()[: space.model.n_stress]
    xx, yy, zz, xy, yz, xz = strain * [1, 1, 1, 0.5, 0.5, 0.5]
    u = space.mesh.points @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    check_warm(space, law, law.reference_temperature + 50.0, u)


def test_plane_strain_keeps_the_stress_across_it():
    space = Space.of(mixed("1", "plane_strain"), "plane_strain")
    u = (1 + LAW.poisson) * LAW.expansion * 100 * space.mesh.points
    across = [0, 0, -LAW.young * LAW.expansion * 100, 0]
    check_warm(space, LAW, lambda x, t: 20 + 50 * t + 0 * x[:, 0], u, across, t=2.0)


def test_a_linear_temperature_leaves_quadratic_cells_without_stress():
    """u_i = alpha (a.x x_i - a_i x.x / 2) where the temperature rises by a.x."""
    space, a = Space.of(mixture("2"), "3d"), np.array([3.0, 0.0, -2.0])
    x = space.mesh.points
    u = LAW.expansion * ((x @ a)[:, None] * x - a * (x * x).sum(axis=1)[:, None] / 2)
    check_warm(space, LAW, lambda x, t: 20 + x @ a, u)


def test_a_temperature_of_some_cells_the_later_over_the_earlier():
    space = Space.of(plane_mixture(), "plane_stress")
    materials = Materials.of(space, LAW)
    given = [(30.0, None), (70.0, np.array([1, 5])), (120.0, np.array([5]))]
    still = np.zeros(space.n_dof)
    expected = np.where(np.arange(space.mesh.n_cells) == 1, 50.0, 10.0)
    expected[5] = 100.0
    factor = LAW.young / (1 - LAW.poisson) * LAW.expansion
    stresses = assemble.stress(space, materials, still, temperature=given)
    for block, s in zip(space.blocks, stresses, strict=True):
        np.testing.assert_allclose(s[..., 0], -factor * expected[block.cell][:, None] + 0 * s[..., 0], rtol=1e-13)
    only = [(70.0, np.array([1, 5]))]
    for block, s in zip(space.blocks, assemble.stress(space, materials, still, temperature=only), strict=True):
        np.testing.assert_array_equal(s[..., 0] != 0, np.isin(block.cell, [1, 5])[:, None] & (s[..., 3] == 0))


# ---- what is refused


def two_triangles():
    """A square of two triangles, with a skin between them."""
    cells = [("TRIA3", [[0, 1, 2], [0, 2, 3]]), ("SEG2", [[0, 2]])]
    return Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], cells, cell_number=[4, 5, 6])


def bare():
    """A triangle, and a skin without a body."""
    points = [[0, 0], [1, 0], [0, 1], [5, 0], [6, 0]]
    groups = {"cell_groups": {"loose": [1]}, "node_groups": {"two": [0, 3]}}
    return Mesh.create(points, [("TRIA3", [[0, 1, 2]]), ("SEG2", [[3, 4]])], node_number=[1, 2, 3, 40, 50], **groups)


@pytest.mark.parametrize(
    ("mesh", "load", "error", "words"),
    [
        (square_with_skin, lambda s: pressed(s, [0], 1.0), DataError, "cells 1 have another"),
        (square_with_skin, lambda s: pressed(s, np.array([], int), 1.0), DataError, "group is empty"),
        (square_with_skin, lambda s: pressed(s, [1], lambda x, t: x[:, 0] + np.nan).force(1.0, None), EvaluationError,
         "is nan"),
        (square_with_skin, lambda s: pressed(s, [1], lambda x, t: x).force(1.0, None), EvaluationError,
         r"\(3, 2\) for 3 points"),
        (square_with_skin, lambda s: pressed(s, [1], lambda x, t: np.log(x[:, 0] - 1.55)).force(1.0, None),
         EvaluationError, "is nan"),
        (square_with_skin, lambda s: acting(s, Traction(group="skin", tx=lambda x, n, t: n)), EvaluationError,
         r"\(12, 2\) for 12 points"),
        (square_with_skin, lambda s: acting(s, Pressure(group="body", value=1.0)), CaseError, "cells 1 have another"),
        (square_with_skin, lambda s: load_of(s, Materials.of(s, Elastic(1.0, 0.0)), Gravity(gy=1.0), finite=False),
         CaseError, "needs a density"),
        (two_triangles, lambda s: pressed(s, [2], 1.0), DataError, "exactly one cell"),
        (bare, lambda s: acting(s, Traction(group="loose", tx=1.0)), CaseError, "cells 2 have"),
        (bare, lambda s: acting(s, Force(group="two", fx=1.0)), CaseError, "at nodes 40"),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_a_wrong_load_is_refused(mesh, load, error, words):
    with pytest.raises(error, match=words):
        load(Space.of(mesh(), "plane_strain"))


# ---- springs between two nodes

#: places of the nodes between which springs are, of a body each
APART = {"a": np.array([0, 0, 0.0]), "b": np.array([2.0, 0.5, 1.0]), "c": np.array([3.5, -1.0, 2.5])}


def blocks(dim=3, **places):
    """Bodies a, b, c apart; the node `eye_a` is the first one of a, at its place, and so on."""
    one, axes = (box(1), [1, 1, 1]) if dim == 3 else (rectangle(1), [1, 1, 0])
    one = one.only("body")
    mesh = join(*(one.renamed(body=k).moved(np.array(x) * axes + [5, 0, 0]) for k, x in (APART | places).items()))
    n = one.n_nodes
    nodes = {f"eye_{name}": [k * n] for k, name in enumerate("abc")} | {"two": [0, 1]}
    return replace(mesh, node_groups={name: np.array(own) for name, own in nodes.items()})


def problem_of(*records, model="3d", kinematics="small", mesh=None, **keys):
    law = "elastic" if kinematics == "small" else "neo_hookean"
    material = Material(law=law, young=1000.0, poisson=0.3, density=2.0)
    mesh = blocks(3 if model == "3d" else 2) if mesh is None else mesh
    return Problem.of(case_of(mesh, material, *records, model=model, kinematics=kinematics, **keys))


def spring(one, other=None, **values):
    return Spring(group=f"eye_{one}", to=None if other is None else f"eye_{other}", **values)


def moved(problem):
    """(the last state, the displacement (n, dim), the energy)."""
    state = list(march(problem))[-1]
    return state, state.u.reshape(-1, problem.space.dim), problem.kinematics.energy(state.u, 1.0)


FIXED = Rigid(group="a"), Rigid(group="c")


def test_full_circle_of_a_ring():
    """In axisymmetry a stiffness is that of the full circle, as a force is."""
    problem = problem_of(*FIXED, Rigid(group="b", fy=6.0), spring("a", "b", ky=3.0), model="axisymmetric")
    np.testing.assert_allclose(moved(problem)[1][4], [0.0, 2.0], atol=1e-12)


def test_nodes_at_one_place_by_components():
    """Two bodies that share no node, whose corners are at one place: a spring of all components joins them."""
    mesh, records = blocks(b=APART["a"]), (*FIXED, Rigid(group="b", fx=1.0, fy=1.0, fz=1.0))
    problem = problem_of(*records, spring("b", "a", kx=1.0, ky=2.0, kz=4.0), mesh=mesh)
    np.testing.assert_allclose(moved(problem)[1][8], [1.0, 0.5, 0.25], rtol=1e-9)
    with pytest.raises(CaseError, match="nodes 9 and 1"):
        _ = problem_of(*records, spring("b", "a", k=1.0), mesh=mesh).springs


def test_finite_kinematics_turn_the_line():
    """The force on a body that is moved far is k (l - L) along the line where it then is; so is the energy."""
    away, d = np.array([0.5, 3.0, -2.0]), APART["b"] - APART["a"]
    records = *FIXED, Rigid(group="b", ux=0.5, uy=3.0, uz=-2.0), spring("a", "b", k=7.0), Steps(count=2)
    state, _, energy = moved(problem_of(*records, kinematics="finite"))
    longer = np.linalg.norm(d + away) - np.linalg.norm(d)
    force = 7.0 * longer * (d + away) / np.linalg.norm(d + away)
    np.testing.assert_allclose(state.reaction.reshape(-1, 3)[8:16].sum(axis=0), force, rtol=1e-9)
    assert energy == pytest.approx(3.5 * longer**2, rel=1e-9)


def test_two_bars_under_a_force_across_them():
    """Two springs between walls, pulled far aside at their middle: 2 k (l - L) h / l = f, which K alone cannot give."""
    mesh = blocks(2, a=[-2.0, 0.0, 0.0], b=[0.0, 0.25, 0.0], c=[2.0, 0.0, 0.0])
    records = *FIXED, Rigid(group="b", fx=0.0, fy=9.0), spring("b", "a", k=7.0), spring("c", "b", k=7.0)
    state, u, _ = moved(problem_of(*records, model="plane_strain", kinematics="finite", mesh=mesh))
    x, y = u[4]
    h, L = 0.25 + y, np.hypot(2, 0.25)
    assert abs(x) < 1e-9 and y > 0.8
    assert 2 * 7.0 * (np.hypot(2, h) - L) * h / np.hypot(2, h) == pytest.approx(9.0, rel=1e-8)
    assert state.iterations < 12


def lines(model):
    space = Space.of(mixture("1") if model == "3d" else plane_mixture("1"), model, 0.4 if "stress" in model else None)
    return space, LineSprings(space, np.array([[0, 5], [3, 9], [5, 7]]), np.array([3.0, 20.0, 7.0]))


@EACH_MODEL
def test_force_energy_and_tangent_of_lines(model):
    space, line_springs = lines(model)
    rng = np.random.default_rng(3)
    u, v = 0.5 * rng.normal(size=space.n_dof), rng.normal(size=space.n_dof)

    def along(of):
        return by_differences(lambda s: np.atleast_1d(of(u + s[0] * v)), np.zeros(1), 1e-4)[:, 0]

    K, slope = line_springs.tangent(u), along(line_springs.internal_force)
    np.testing.assert_allclose(K @ v, slope, rtol=0, atol=1e-9 * np.abs(slope).max())
    assert abs(K - K.T).max() < 1e-14 * abs(K).max()
    assert line_springs.internal_force(u) @ v == pytest.approx(along(line_springs.energy)[0], rel=1e-9)
    assert np.abs(line_springs.internal_force(u).reshape(-1, space.dim).sum(axis=0)).max() < 1e-12


def test_a_rigid_rotation_leaves_no_force_and_ends_that_meet_are_refused():
    space, line_springs = lines("3d")
    x = space.mesh.points
    assert np.abs(line_springs.internal_force((x @ Q.T - x).ravel())).max() < 1e-13
    meet = np.zeros_like(x)
    meet[5] = x[0] - x[5]
    for of in (line_springs.internal_force, line_springs.tangent, line_springs.energy):
        with pytest.raises(InadmissibleError, match="nodes 1, 6, meet"):
            of(meet.ravel())


def test_a_spring_on_a_line_leaves_all_free_but_the_distance():
    """The bodies b and c on one spring between them, along x but for round-off."""
    aside = APART["b"] + [3.0, 0.0, 0.0]
    mesh = blocks(c=[aside[0], np.nextafter(aside[1], 1), aside[2]])
    problem = problem_of(Rigid(group="a"), Rigid(group="b"), spring("b", "c", k=2.0), mesh=mesh)
    K = problem.springs
    free = free_motions(problem.space, problem.constraints, K)
    assert len(free) == 5, [describe(motion) for motion in free]
    for motion in free:
        np.testing.assert_allclose(K @ motion.field, 0, atol=1e-12)


def test_several_processes_refuse_springs_between_nodes():
    case = problem_of(*(Rigid(group=name) for name in "abc"), spring("a", "b", k=1.0)).case
    with pytest.raises(RequestError, match="one process only"):
        _check_shared(case, Share())


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (Spring(group="two", to="eye_b", kx=1.0), "'two' has 2 nodes"),
        (Spring(group="eye_b", to="two", k=1.0), "'two' has 2 nodes"),
        (Spring(at=[5, 0, 0], to="eye_a", kx=1.0), "ends are node 1"),
        (Spring(group="eye_a", to="eye_q", kx=1.0), "group named 'eye_q'"),
    ],
)
def test_springs_that_are_refused(given, words):
    with pytest.raises(CaseError, match=words):
        _ = problem_of(*(Rigid(group=name) for name in "abc"), given).springs
