"""Rigid bodies under finite rotations: exact, with exact derivatives; small kinematics stay linear."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from lacsolver.bodies.finite import InadmissibleError
from lacsolver.case import parse_case
from lacsolver.constraints import Constraints, rotation
from lacsolver.space.space import Space
from tests.lacsolver.bodies import cube, square
from tests.lacsolver.held import TEXT, nodes_in, with_sides
from tests.lacsolver.test_finite import by_differences

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
MODELS = ["3d", "plane_strain", "plane_stress", "axisymmetric"]


def cross(v):
    return np.cross(v, np.eye(3)).T


def constraints_of(model, sections, kinematics="finite"):
    law = 'law = "neo_hookean"\n' if kinematics == "finite" else ""
    text = TEXT.format(model=model).replace("[[material]]\n", f'kinematics = "{kinematics}"\n[[material]]\n{law}')
    mesh = with_sides(cube("HEXA8", 2) if model == "3d" else square("QUAD8", 2))
    space = Space.of(mesh, model)
    return space, Constraints.of(space, parse_case(text + sections, "press.toml")), nodes_in(mesh, "y1")


@pytest.mark.parametrize("theta", VECTORS)
def test_a_turn_is_the_exponential_of_its_cross_matrix(theta):
    theta = np.array(theta, float)
    np.testing.assert_allclose(rotation.turn(theta), expm(cross(theta)) - np.eye(3), atol=1e-14)
    R = np.eye(3) + rotation.turn(theta)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)


@pytest.mark.parametrize("theta", VECTORS)
def test_derivatives_of_a_turn(theta):
    theta = np.array(theta, float)
    M, m = np.random.default_rng(0).normal(size=(3, 3)), np.array([0.3, -1.0, 2.0])
    dR = rotation.turn_derivative(theta)
    expected = by_differences(lambda a: rotation.turn(a).ravel(), theta, 1e-3)
    np.testing.assert_allclose(dR.reshape(3, 9).T, expected, atol=1e-11)
    expected = by_differences(lambda a: np.einsum("jsi,si->j", rotation.turn_derivative(a), M), theta, 1e-3)
    np.testing.assert_allclose(rotation.turn_curvature(theta, M), expected, atol=1e-11)
    expected = by_differences(lambda a: rotation.conjugate(a, m), theta, 1e-3)
    np.testing.assert_allclose(rotation.conjugate_derivative(theta, m), expected, atol=1e-11)
    R = np.eye(3) + rotation.turn(theta)
    spin = [(D @ R.T)[[2, 0, 1], [1, 2, 0]] for D in dR]  # dR R^T is the cross matrix of the spin
    np.testing.assert_allclose(rotation.conjugate(theta, m), np.array(spin) @ m, atol=1e-14)


def test_a_half_turn_prescribed_in_space_keeps_the_body_as_it_is():
    sections = (
        '[[rigid]]\ngroup = "y1"\ncentre = [0.3, -0.2, 0.7]\nux = 0.1\nuz = "t"\nrotation = [0, "2 * pi * t", 0]\n'
    )
    space, constraints, nodes = constraints_of("3d", sections)
    x = space.mesh.points[nodes] - [0.3, -0.2, 0.7]
    for t, Q in ((0.5, np.diag([-1.0, 1, -1])), (0.25, np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])), (3, np.eye(3))):
        u = constraints.u0(t).reshape(-1, 3)[nodes]
        np.testing.assert_allclose(u, x @ Q.T - x + [0.1 * min(t, 1), 0, t], atol=1e-14)
    assert constraints.is_selection
    q = np.zeros(constraints.n_q)
    assert constraints.tangent(q, 0.5) is constraints.T
    assert constraints.turning(q, 0.5, np.ones(space.n_dof)) is None


LOADED = {
    "3d": 'fx = 1.0\nuy = "0.1 * t"\nfz = 2.0\nmoment = [0.3, -1.0, 2.0]\ncentre = [0.3, -0.2, 0.7]\n',
    "plane_strain": "fx = 1.0\nfy = -2.0\nmoment = 0.3\ncentre = [0.3, -0.2]\n",
    "plane_stress": "fx = 1.0\nuy = 0.2\nmoment = 0.3\n",
    "axisymmetric": "fy = 3.0\n",
}


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("size", [0.0, 0.1, 1.0])
def test_the_map_of_a_loaded_body_and_its_derivatives(model, size):
    sections = f'[[rigid]]\ngroup = "y1"\n{LOADED[model]}[[displacement]]\ngroup = "y0"\nuy = "0.2 * t"\n'
    space, constraints, nodes = constraints_of(model, sections)
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
    expected = by_differences(lambda a: constraints.displacement(a, 1.0), q, 1e-3)
    np.testing.assert_allclose(T, expected, atol=1e-10)
    forces = rng.normal(size=space.n_dof)
    bent = constraints.turning(q, 1.0, forces)
    expected = by_differences(lambda a: constraints.tangent(a, 1.0).T @ forces - constraints.force(1.0, a), q, 1e-3)
    np.testing.assert_allclose(0 if bent is None else bent.toarray(), expected, atol=1e-10)
    assert (bent is None) == (model == "axisymmetric")
    assert constraints.turning(q, 1.0, forces) is None or np.abs(expected).max() > 0.1


@pytest.mark.parametrize("model", MODELS[:3])
def test_at_rest_the_map_is_that_of_small_kinematics(model):
    sections = f'[[rigid]]\ngroup = "y1"\n{LOADED[model]}'
    _, small, _ = constraints_of(model, sections, "small")
    _, finite, _ = constraints_of(model, sections)
    q = np.zeros(small.n_q)
    assert abs(finite.T - small.T).max() < 1e-15
    assert abs(finite.tangent(q, 0.0) - small.T).max() < 1e-15
    np.testing.assert_allclose(finite.force(1.0, q), small.force(1.0), rtol=1e-14)
    q = np.random.default_rng(0).normal(size=small.n_q)
    assert small.tangent(q, 1.0) is small.T
    assert small.turning(q, 1.0, np.ones(small.T.shape[0])) is None
    np.testing.assert_array_equal(small.displacement(q, 1.0), small.T @ q + small.u0(1.0))
    np.testing.assert_array_equal(small.force(1.0, q), small.force(1.0))


@pytest.mark.parametrize("model", MODELS[:3])
def test_work_of_the_resultant_is_work_of_the_forces(model):
    """Forces that are moments' reactions: T^T r = force(q) exactly when their moment is the load."""
    sections = f'[[rigid]]\ngroup = "y1"\n{LOADED[model]}'
    space, constraints, nodes = constraints_of(model, sections)
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
    theta = motions["y1"][space.dim :] if space.dim == 3 else np.array([0, 0, *motions["y1"][2:]])
    m = got[space.dim :] if space.dim == 3 else np.array([0, 0, *got[2:]])
    expected = rotation.conjugate(theta, m) if space.dim == 3 else m[2:]
    np.testing.assert_allclose(work[body.columns[space.dim :]], expected * body.unit[space.dim :], atol=1e-12)


def test_a_free_rotation_in_space_stops_short_of_a_full_turn():
    sections = '[[rigid]]\ngroup = "y1"\nmoment = [1.0, 0, 0]\n'
    _, constraints, _ = constraints_of("3d", sections)
    q = np.zeros(constraints.n_q)
    q[-3:] = [0, 6.1, 0]
    with pytest.raises(InadmissibleError, match=r"rigid 'y1' .*nearly a full turn.*smaller steps"):
        constraints.displacement(q, 1.0)
    _, plane, _ = constraints_of("plane_strain", '[[rigid]]\ngroup = "y1"\nmoment = 1.0\n')
    q = np.zeros(plane.n_q)
    q[-1] = 2 * np.pi
    np.testing.assert_allclose(plane.displacement(q, 1.0), 0, atol=1e-14)
