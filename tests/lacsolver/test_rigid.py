"""Rigid bodies, prescribed and loaded, by small and finite rotations, and the reactions of all that holds a body."""

import numpy as np
import pytest
from scipy.linalg import expm

from lacmesh import Mesh
from lacmesh.errors import RequestError
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.case import CaseError, Displacement, Material, Rigid
from lacsolver.constraints import Constraints, constraints_of, rotation
from lacsolver.space.space import MODELS, Space
from tests.lacsolver.bodies import cube, square
from tests.lacsolver.held import box, case, check_map, held, moved, nodes_in, with_sides
from tests.lacsolver.test_finite import by_differences
from tests.problems import case_of

CENTRE = (0.3, -0.2, 0.7)
EACH_MODEL = pytest.mark.parametrize("model", MODELS)


def rigid_box(model, plane="QUAD4"):
    """A box, and the nodes of its side y1, which is rigid."""
    mesh = with_sides(cube("HEXA8", 2) if model == "3d" else square(plane, 2))
    return mesh, nodes_in(mesh, "y1")


# ---- small kinematics


@pytest.mark.parametrize("model", ["plane_strain", "plane_stress"])
def test_a_rigid_motion_in_a_plane_about_the_mean_of_the_nodes(model):
    mesh, nodes = rigid_box(model)
    space, constraints = held(mesh, model, rigid=[Rigid(group="y1", fx=3.0, uy=0.1, moment=5.0)])
    assert constraints.n_q == space.n_dof - 6 + 2
    assert not constraints.is_selection
    q = np.zeros(constraints.n_q)
    far = np.linalg.norm(mesh.points[nodes, :2] - [1.5, 1.0], axis=1).max()  # a turn's unknown is what it moves there
    q[-2:] = 0.4, 0.2 * far
    u = constraints.displacement(q, 1.0).reshape(-1, 2)
    r = mesh.points[nodes, :2] - [1.5, 1.0]
    np.testing.assert_allclose(u[nodes], [0.4, 0.1] + 0.2 * np.stack([-r[:, 1], r[:, 0]], axis=1), atol=1e-15)
    np.testing.assert_allclose(constraints.rigid_motion(q, 1.0)["y1"], [0.4, 0.1, 0.2], atol=1e-15)
    np.testing.assert_allclose(constraints.force(0.5), [0] * (constraints.n_q - 2) + [1.5, 2.5 / far])
    with pytest.raises(ValueError, match="multiply with T"):
        _ = constraints.free
    check_map(space, constraints)


def test_a_bare_skin_is_rigid():
    points = [[0, 0], [1, 0], [0, 1], [2, 0], [2, 1], [2, 0.5]]
    mesh = Mesh.create(points, [("TRIA3", [[0, 1, 2]]), ("SEG3", [[3, 4, 5]])], cell_groups={"die": [1]})
    space, constraints = held(mesh, "plane_strain", rigid=[Rigid(group="die", ux=-0.5, fy=1.0)])
    assert constraints.n_q == 7
    assert constraints.u0(1.0).reshape(-1, 2)[3:].tolist() == [[-0.5, 0]] * 3
    assert constraints.T.toarray()[6:, -1].tolist() == [0, 1] * 3
    check_map(space, constraints)


# ---- what is refused

BESIDE = '[[displacement]]\ngroup = "y0"\nuy = [[0, 1]]\n[[rigid]]\ngroup = "x0"\n'


@pytest.mark.parametrize(("sections", "lines"), [(2 * '[[rigid]]\ngroup = "{}"\n', (6, 8)), (BESIDE, (6, 9))])
def test_a_node_that_two_records_move_is_refused_with_both_lines(sections, lines):
    """Node 1 is in both; a displacement that agrees with the motion of the body is taken."""
    space = Space.of(box("QUAD4", "plane_strain"), "plane_strain")
    with pytest.raises(CaseError) as caught:
        constraints_of(space, case(sections.format("x0", "y0"), "plane_strain"))
    first, second = (f"(press.toml, line {line})" for line in lines)
    assert first in str(caught.value) and second in str(caught.value)
    constraints_of(space, case(BESIDE.replace("[[0, 1]]", "0"), "plane_strain"))


def test_a_rotation_that_moves_no_node():
    mesh = with_sides(cube("HEXA8", 2), node_groups={"line": [0, 1, 2], "dot": [0], "three": [0, 1, 5]})
    for group, words in (("line", "on one line"), ("dot", "one point")):
        with pytest.raises(CaseError, match=words):
            held(mesh, rigid=[Rigid(group=group, fx=1.0, fy=1.0, fz=1.0, moment=(0, 0, 0))])
        held(mesh, rigid=[Rigid(group=group, fx=1.0, fy=1.0, fz=1.0)])
    held(mesh, rigid=[Rigid(group="three", fx=1.0, moment=(0, 0, 0))])
    held(mesh, rigid=[Rigid(group="dot", centre=(5, 5, 5), rotation=(0, 0, "t"))])


def test_every_group_that_is_missing_is_told_at_once():
    with pytest.raises(CaseError) as caught:
        held(box("HEXA8", "3d"), rigid=[Rigid(group="die", ux=0.0), Rigid(group="x9", uy=0.0)])
    assert len(caught.value.problems) == 2


# ---- reactions


def test_reactions_are_shared_out_without_loss():
    """Two groups hold one edge alike: the earlier one carries it; the others have what is along their directions."""
    mesh = moved(box("HEXA8", "3d"), [[1, 0.5, 0], [0, 1, 0], [0, 0.2, 1]])
    given = [
        Displacement(group="x0", un=0),
        Displacement(group="z0", uz=0.0, ux=0.0),
        Displacement(group="y0", uy=0, uz=0),
        Displacement(at=tuple(mesh.points[26]), ux=0, uy=0, uz=0),
        Displacement(group="y0", kind="cell", ux=0),
    ]
    _, constraints = held(mesh, displacement=given)
    f = np.random.default_rng(0).normal(size=(27, 3))
    r = (constraints.local.D.T @ (constraints.local.P.T @ f.ravel())).reshape(-1, 3)  # what conditions can carry
    got = constraints.reactions(r.ravel())
    assert list(got) == ["x0", "z0", "y0", "at [1.5, 1, 1.2]"]
    np.testing.assert_allclose(sum(got.values()), r.sum(axis=0), atol=1e-13)
    np.testing.assert_allclose(got["at [1.5, 1, 1.2]"], f[26], atol=1e-13)
    n = constraints.local.direction[0]
    np.testing.assert_allclose(np.cross(got["x0"], n), 0, atol=1e-13)
    assert np.abs(got["x0"]).max() > 0.1


def test_the_earlier_of_two_equal_conditions_carries_the_force():
    mesh = box("QUAD4", "plane_strain")
    for order in (("x0", "y0"), ("y0", "x0")):
        _, constraints = held(mesh, "plane_strain", displacement=[Displacement(group=g, ux=0) for g in order])
        r = np.zeros(18)
        r[0] = 1.0  # the node that both have
        got = constraints.reactions(r)
        assert got[order[0]].tolist() == [1, 0] and got[order[1]].tolist() == [0, 0]
    with pytest.raises(RequestError, match="named 'x9'"):
        constraints.reaction("x9", r)


# ---- finite rotations

#: rotation vectors near and far from 0, where series and closed forms take turns
VECTORS = [
    (0, 0, 0),
    (1e-9, 0, 0),
    (0.1, -0.2, 0.05),
    (0.5, 0.5, 0.7),
    (0.6, -0.5, 0.63),
    (2.0, 1.0, -1.5),
    (0, 5.5, 0),
]
LOADED = {
    "3d": {"fx": 1.0, "uy": "0.1 * t", "fz": 2.0, "moment": [0.3, -1.0, 2.0], "centre": CENTRE},
    "plane_strain": {"fx": 1.0, "fy": -2.0, "moment": 0.3, "centre": CENTRE[:2]},
    "plane_stress": {"fx": 1.0, "uy": 0.2, "moment": 0.3},
    "axisymmetric": {"fy": 3.0},
}


def cross(v):
    return np.cross(v, np.eye(3)).T


def turning(model, *more, kinematics="finite", **keys):
    """The space of a box whose side y1 is rigid, its constraints, and the nodes of the side."""
    law = "neo_hookean" if kinematics == "finite" else "elastic"
    mesh, nodes = rigid_box(model, "QUAD8")
    material = Material(young=1.0, poisson=0.3, law=law)
    space = Space.of(mesh, model)
    record = case_of("a.msh", material, Rigid(group="y1", **keys), *more, model=model, kinematics=kinematics)
    return space, Constraints.of(space, record), nodes


@pytest.mark.parametrize("theta", VECTORS)
def test_a_turn_is_the_exponential_of_its_cross_matrix_and_its_derivatives_are_differences(theta):
    theta = np.array(theta, float)
    np.testing.assert_allclose(rotation.turn(theta), expm(cross(theta)) - np.eye(3), atol=1e-14)
    R = np.eye(3) + rotation.turn(theta)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    M, m = np.random.default_rng(0).normal(size=(3, 3)), np.array([0.3, -1.0, 2.0])
    dR = rotation.turn_derivative(theta)
    pairs = [
        (dR.reshape(3, 9).T, lambda a: rotation.turn(a).ravel()),
        (rotation.turn_curvature(theta, M), lambda a: np.einsum("jsi,si->j", rotation.turn_derivative(a), M)),
        (rotation.conjugate_derivative(theta, m), lambda a: rotation.conjugate(a, m)),
    ]
    for found, of in pairs:
        np.testing.assert_allclose(found, by_differences(of, theta, 1e-3), atol=1e-11)
    spin = [(D @ R.T)[[2, 0, 1], [1, 2, 0]] for D in dR]  # dR R^T is the cross matrix of the spin
    np.testing.assert_allclose(rotation.conjugate(theta, m), np.array(spin) @ m, atol=1e-14)


def test_a_half_turn_prescribed_in_space_keeps_the_body_as_it_is():
    motion = {"ux": 0.1, "uz": "t", "rotation": [0, "2 * pi * t", 0]}
    space, constraints, nodes = turning("3d", centre=CENTRE, **motion)
    x = space.mesh.points[nodes] - CENTRE
    for t, Q in ((0.5, np.diag([-1.0, 1, -1])), (0.25, np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])), (3, np.eye(3))):
        u = constraints.u0(t).reshape(-1, 3)[nodes]
        np.testing.assert_allclose(u, x @ Q.T - x + [0.1 * min(t, 1), 0, t], atol=1e-14)
    assert constraints.is_selection
    q = np.zeros(constraints.n_q)
    assert constraints.tangent(q, 0.5) is constraints.T
    assert constraints.turning(q, 0.5, np.ones(space.n_dof)) is None


@pytest.mark.rows("0.1-plane_strain", "1.0-axisymmetric")
@EACH_MODEL
@pytest.mark.parametrize("size", [0.0, 0.1, 1.0])
def test_the_map_of_a_loaded_body_and_its_derivatives(model, size):
    space, constraints, nodes = turning(model, Displacement(group="y0", uy="0.2 * t"), **LOADED[model])
    rng = np.random.default_rng(1)
    q = 0.1 * rng.normal(size=constraints.n_q)
    (body,) = constraints.rigid
    turns = body.columns[space.dim :]
    q[turns] = size * np.array([1.5, -2.0, 1.1])[: len(turns)]
    u = constraints.displacement(q, 1.0)
    m = constraints.rigid_motion(q, 1.0)["y1"]
    theta = {"3d": m[3:], "axisymmetric": np.zeros(3)}.get(model, np.array([0, 0, *m[2:]]))
    x = space.mesh.points[nodes] - body.centre
    expected = np.pad(m[: space.dim], (0, 3 - space.dim)) + x @ expm(cross(theta)).T - x
    np.testing.assert_allclose(u.reshape(-1, space.dim)[nodes], expected[:, : space.dim], atol=1e-14)
    T = constraints.tangent(q, 1.0).toarray()
    np.testing.assert_allclose(T, by_differences(lambda a: constraints.displacement(a, 1.0), q, 1e-3), atol=1e-10)
    forces = rng.normal(size=space.n_dof)
    bent = constraints.turning(q, 1.0, forces)
    expected = by_differences(lambda a: constraints.tangent(a, 1.0).T @ forces - constraints.force(1.0, a), q, 1e-3)
    np.testing.assert_allclose(0 if bent is None else bent.toarray(), expected, atol=1e-10)
    assert (bent is None) == (model == "axisymmetric")
    assert bent is None or np.abs(expected).max() > 0.1


@pytest.mark.parametrize("model", [model for model in MODELS if model != "axisymmetric"])
def test_work_of_the_resultant_is_work_of_the_forces(model):
    """Forces that are moments' reactions: T^T r = force(q) exactly when their moment is the load."""
    space, constraints, nodes = turning(model, **LOADED[model])
    (body,) = constraints.rigid
    q = np.zeros(constraints.n_q)
    q[body.columns[body.free]] = [0.3, 0.2, 1.0, -0.7, 0.8][: body.free.sum()]
    motions = constraints.rigid_motion(q, 1.0)
    u = constraints.displacement(q, 1.0).reshape(-1, space.dim)[nodes]
    r = np.random.default_rng(0).normal(size=(len(nodes), space.dim))
    forces = np.zeros((space.mesh.n_nodes, space.dim))
    forces[nodes] = r
    where = space.mesh.points[nodes, : space.dim] + u - body.centre[: space.dim] - motions["y1"][: space.dim]
    moment = np.cross(where, r) if space.dim == 3 else where[:, 0] * r[:, 1] - where[:, 1] * r[:, 0]
    got = constraints.rigid_reactions(forces.ravel(), motions)["y1"]
    np.testing.assert_allclose(got[: space.dim], r.sum(axis=0), atol=1e-13)
    np.testing.assert_allclose(got[space.dim :], np.atleast_1d(moment.sum(axis=0)), atol=1e-13)
    work = constraints.tangent(q, 1.0).T @ forces.ravel()
    expected = rotation.conjugate(motions["y1"][3:], got[3:]) if space.dim == 3 else got[2:]
    np.testing.assert_allclose(work[body.columns[space.dim :]], expected * body.unit[space.dim :], atol=1e-12)


def test_a_free_rotation_in_space_stops_short_of_a_full_turn():
    _, constraints, _ = turning("3d", moment=[1.0, 0, 0])
    q = np.zeros(constraints.n_q)
    q[-3:] = [0, 6.1, 0]
    with pytest.raises(InadmissibleError, match="nearly a full turn"):
        constraints.displacement(q, 1.0)
    _, plane, _ = turning("plane_strain", moment=1.0)
    q = np.zeros(plane.n_q)
    q[-1] = 2 * np.pi
    np.testing.assert_allclose(plane.displacement(q, 1.0), 0, atol=1e-14)
