"""Rigid bodies, prescribed and loaded, and the reactions of all that holds a body."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from lacmesh import Mesh
from lacmesh.errors import RequestError
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.case import CaseError, Displacement, Rigid
from lacsolver.constraints import Constraints, constraints_of
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PLANE_MODELS, cube, square
from tests.lacsolver.held import (
    box,
    case,
    check_map,
    held,
    moved,
    nodes_in,
    with_sides,
)

POISSON = 0.3
BOXES = [("HEXA8", "3d"), ("TETRA10", "3d"), ("HEXA27", "3d"), ("PENTA15", "3d"), ("PYRAM5", "3d")]
BOXES += [(name, model) for name in ("TRIA3", "QUAD8") for model in PLANE_MODELS]


# rigid bodies


def rigid_box(model):
    """A distorted box, its side y1 rigid."""
    mesh = with_sides(cube("HEXA8", 2) if model == "3d" else square("QUAD4", 2))
    return mesh, nodes_in(mesh, "y1")


def test_a_prescribed_rigid_motion_in_space():
    mesh, nodes = rigid_box("3d")
    centre = (0.3, -0.2, 0.7)
    rigid = Rigid(group="y1", centre=centre, ux=0.1, uz="t", rotation=(0.2, "0.1 * t", 0.0))
    space, constraints = held(mesh, rigid=[rigid])
    U, theta = np.array([0.05, 0, 0.5]), np.array([0.1, 0.05, 0])
    u = constraints.u0(0.5).reshape(-1, 3)
    np.testing.assert_allclose(u[nodes], U + np.cross(theta, mesh.points[nodes] - centre), atol=1e-15)
    assert constraints.is_selection
    assert constraints.n_q == 81 - 27
    np.testing.assert_allclose(constraints.rigid_motion(np.zeros(54), 0.5)["y1"], [*U, *theta], atol=1e-15)
    assert not constraints.force(1.0).any()
    check_map(space, constraints)


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


def test_an_axisymmetric_rigid_body_moves_along_the_axis():
    mesh, nodes = rigid_box("axisymmetric")
    space, constraints = held(mesh, "axisymmetric", rigid=[Rigid(group="y1", fy=2.0)])
    assert constraints.n_q == space.n_dof - 6 + 1
    q = np.zeros(constraints.n_q)
    q[-1] = 0.5
    u = constraints.displacement(q, 1.0).reshape(-1, 2)
    assert u[nodes].tolist() == [[0, 0.5]] * 3
    assert constraints.rigid_motion(q, 1.0)["y1"].tolist() == [0, 0.5]
    assert constraints.force(1.0)[-1] == 2.0
    _, pushed = held(mesh, "axisymmetric", rigid=[Rigid(group="y1", uy=0.25)])
    assert pushed.u0(1.0).reshape(-1, 2)[nodes].tolist() == [[0, 0.25]] * 3


def test_what_is_neither_prescribed_nor_loaded_is_held():
    mesh, nodes = rigid_box("3d")
    _, constraints = held(mesh, rigid=[Rigid(group="y1", fy=1.0)])
    q = np.zeros(constraints.n_q)
    q[-1] = 1.0
    u = constraints.displacement(q, 1.0).reshape(-1, 3)
    assert (u[nodes] == [0, 1, 0]).all()


@pytest.mark.parametrize("model", ["3d", *PLANE_MODELS])
def test_a_loaded_rigid_side_in_equilibrium(model):
    """T^T r is the load on the free motions; the held side's reactions balance it, with its moment."""
    mesh, _ = rigid_box(model)
    plane = model != "axisymmetric"
    motion = {"3d": {"fx": 1.0, "fy": -2.0, "uz": 0.01, "moment": (0.3, 0.2, 0.1)}, "axisymmetric": {"fy": -2.0}}
    rigid = Rigid(group="y1", **motion.get(model, {"fx": 1.0, "fy": -2.0, "moment": 0.3}))
    bottom = Displacement(group="y0", **({"ux": 0} if plane else {}), uy=0, **({"uz": 0} if model == "3d" else {}))
    space, constraints = held(mesh, model, displacement=[bottom], rigid=[rigid])
    K = assemble_stiffness(space, Materials.of(space, Elastic(young=7.0, poisson=POISSON)))
    T, u0 = constraints.T, constraints.u0(1.0)
    q = spsolve((T.T @ K @ T).tocsc(), constraints.force(1.0) - T.T @ (K @ u0))
    r = K @ constraints.displacement(q, 1.0)
    np.testing.assert_allclose(T.T @ r, constraints.force(1.0), atol=1e-12)
    top, bottom = constraints.rigid_reactions(r)["y1"], constraints.reaction("y0", r)
    np.testing.assert_allclose(top[0 if plane else 1 : 2], [1.0, -2.0][0 if plane else 1 :], atol=1e-12)
    if plane:
        np.testing.assert_allclose(top[: space.dim], -bottom, atol=1e-12)
        np.testing.assert_allclose(top[space.dim :], {"3d": [0.3, 0.2, 0.1]}.get(model, [0.3]), atol=1e-12)
    assert bottom[1] == pytest.approx(2.0, abs=1e-12)
    assert constraints.reaction("y1", r).tolist() == top[: space.dim].tolist()


def test_a_bare_skin_is_rigid():
    mesh = Mesh.create(
        [[0, 0], [1, 0], [0, 1], [2, 0], [2, 1], [2, 0.5]],
        [("TRIA3", [[0, 1, 2]]), ("SEG3", [[3, 4, 5]])],
        cell_groups={"die": [1]},
    )
    space, constraints = held(mesh, "plane_strain", rigid=[Rigid(group="die", ux=-0.5, fy=1.0)])
    assert constraints.n_q == 7
    assert constraints.u0(1.0).reshape(-1, 2)[3:].tolist() == [[-0.5, 0]] * 3
    assert constraints.T.toarray()[6:, -1].tolist() == [0, 1] * 3
    check_map(space, constraints)


def test_two_rigid_bodies_number_their_motions_one_after_the_other():
    mesh = box("QUAD4", "plane_strain")
    rigid = [Rigid(group="x0", fx=1.0, moment=2.0), Rigid(group="x1", fy=3.0)]
    _, constraints = held(mesh, "plane_strain", rigid=rigid)
    assert constraints.n_q == 2 * 3 + 3
    turn = constraints.rigid[0].unit[-1]
    assert constraints.force(1.0)[-3:].tolist() == [1, 2 * turn, 3]
    q = np.arange(9.0)
    motions = constraints.rigid_motion(q, 1.0)
    assert {name: m.tolist() for name, m in motions.items()} == {"x0": [6, 0, 7 * turn], "x1": [0, 8, 0]}


def test_a_node_in_two_rigid_bodies():
    sections = '[[rigid]]\ngroup = "x0"\n[[rigid]]\ngroup = "y0"\n'
    with pytest.raises(CaseError) as caught:
        Constraints.of(Space.of(box("QUAD4", "plane_strain"), "plane_strain"), case(sections, "plane_strain"))
    assert str(caught.value) == (
        "nodes 1 are in rigid 'x0' (press.toml, line 6) and in rigid 'y0' (press.toml, line 8); a node moves with one "
        "rigid body, so join the groups or take them apart"
    )


def test_a_displacement_on_a_node_of_a_rigid_body():
    """A displacement that agrees with the motion of the body is taken (test_shared_supports.py), no other."""
    sections = '[[displacement]]\ngroup = "y0"\nuy = {}\n[[rigid]]\ngroup = "x0"\n'
    space = Space.of(box("QUAD4", "plane_strain"), "plane_strain")
    constraints_of(space, case(sections.format(0), "plane_strain"))
    with pytest.raises(CaseError) as caught:
        constraints_of(space, case(sections.format("[[0, 1]]"), "plane_strain"))
    assert str(caught.value) == (
        "displacement 'y0' (press.toml, line 6) at node 1 of rigid 'x0' (press.toml, line 9) contradicts what its "
        "terms are prescribed to: it is off by 1 at t = 0.618; leave one out, or make them agree"
    )


def test_a_rotation_that_moves_no_node():
    mesh = with_sides(cube("HEXA8", 2), node_groups={"line": [0, 1, 2], "dot": [0], "three": [0, 1, 5]})
    for group, message in (("line", "'line' are on one line"), ("dot", "'dot' are one point")):
        with pytest.raises(CaseError, match=f"rigid: the nodes of {message}.*leave moment out"):
            held(mesh, rigid=[Rigid(group=group, fx=1.0, fy=1.0, fz=1.0, moment=(0, 0, 0))])
        held(mesh, rigid=[Rigid(group=group, fx=1.0, fy=1.0, fz=1.0)])
    held(mesh, rigid=[Rigid(group="three", fx=1.0, moment=(0, 0, 0))])
    held(mesh, rigid=[Rigid(group="dot", centre=(5, 5, 5), rotation=(0, 0, "t"))])


def test_every_group_that_is_missing_is_told_at_once():
    with pytest.raises(CaseError) as caught:
        held(box("HEXA8", "3d"), rigid=[Rigid(group="die", ux=0.0), Rigid(group="x9", uy=0.0)])
    assert len(caught.value.problems) == 2
    assert "no group named 'x9'; there are: body, x0" in str(caught.value)


# reactions


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
        assert got[order[0]].tolist() == [1, 0]
        assert got[order[1]].tolist() == [0, 0]


def test_a_reaction_of_an_unknown_name():
    space, constraints = held(
        box("QUAD4", "plane_strain"), "plane_strain", displacement=[Displacement(group="x0", ux=0)]
    )
    with pytest.raises(RequestError, match="no displacement or rigid body named 'x9'; there are: x0"):
        constraints.reaction("x9", np.zeros(space.n_dof))
