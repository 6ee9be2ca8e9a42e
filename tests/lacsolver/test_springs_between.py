"""Springs between two nodes: by components and along their line, in small and finite kinematics."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.errors import RequestError
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.bodies.line_springs import LineSprings
from lacsolver.case import CaseError, parse_case
from lacsolver.distributed.share import Share
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem, _check_shared
from lacsolver.problem.rigid_modes import describe, free_motions
from lacsolver.space.space import MODELS, Space
from tests.lacsolver.bodies import cube, mixture, plane_mixture, square
from tests.lacsolver.held import joined
from tests.lacsolver.moving import steps, thrown, unbalanced

#: places of the nodes between which springs are, of a body each
APART = {"a": (0, 0, 0), "b": (2.0, 0.5, 1.0), "c": (3.5, -1.0, 2.5)}


def blocks(model="3d"):
    """Bodies a, b, c apart; the node `eye_a` is the first one of a, at its place, and so on."""
    dim = 3 if model == "3d" else 2
    kind, one = ("HEXA8", cube) if dim == 3 else ("QUAD4", square)
    parts = []
    for place in APART.values():
        mesh = one(kind, 1)
        points = mesh.points - mesh.points[0] + np.array([*place[:dim], *[0.0] * (3 - dim)]) + [5.0, 0, 0]
        parts.append(Mesh.create(points, mesh.blocks, space_dim=dim))
    mesh = joined(*parts)
    n = parts[0].n_nodes
    nodes = {f"eye_{name}": [k * n] for k, name in enumerate(APART)} | {"two": [0, 1], "twin": [n + 1]}
    return Mesh.create(mesh.points, mesh.blocks, cell_groups=mesh.cell_groups, node_groups=nodes, space_dim=dim)


def problem_of(sections, model="3d", kinematics="small", mesh=None):
    law = "elastic" if kinematics == "small" else "neo_hookean"
    head = f'mesh = "blocks.msh"\nmodel = "{model}"\nkinematics = "{kinematics}"\n'
    material = f'[[material]]\nlaw = "{law}"\nyoung = 1000.0\npoisson = 0.3\ndensity = 2.0\n'
    return Problem.of(parse_case(head + material + sections), blocks(model) if mesh is None else mesh)


def rigid(name, **values):
    return f'[[rigid]]\ngroup = "{name}"\n' + "".join(f"{k} = {v!r}\n" for k, v in values.items())


def spring(one, other=None, **values):
    to = "" if other is None else f'to = "eye_{other}"\n'
    return f'[[spring]]\ngroup = "eye_{one}"\n{to}' + "".join(f"{k} = {v!r}\n" for k, v in values.items())


def energy(problem, u):
    return problem.kinematics.energy(u, 1.0)


def moved(problem):
    """(the last state, the displacement (n, dim))."""
    state = list(march(problem))[-1]
    return state, state.u.reshape(-1, problem.space.dim)


def line(one, other, dim=3):
    d = (np.array(APART[other]) - APART[one])[:dim]
    return d / np.linalg.norm(d)


# ---- by components


@pytest.mark.parametrize("kinematics", ["small", "finite"])
@pytest.mark.parametrize("model", ["3d", "plane_strain", "plane_stress"])
def test_two_springs_in_series(model, kinematics):
    """A body on a spring to the ground, and another one on a spring to it: each spring has the force behind it."""
    axes = "xyz"[: 3 if model == "3d" else 2]
    k, f = {"x": (2.0, 5.0), "y": (3.0, 7.0), "z": (4.0, 11.0)}, {"x": (0.1, 0.4), "y": (-0.2, 0.3), "z": (0.5, 0.6)}
    first = {f"k{a}": k[a][0] for a in axes}
    second = {f"k{a}": k[a][1] for a in axes}
    text = rigid("a", **{f"f{a}": f[a][0] for a in axes}) + rigid("b", **{f"f{a}": f[a][1] for a in axes}) + rigid("c")
    thickness = "thickness = 0.3\n" if model == "plane_stress" else ""
    head = f'mesh = "m.msh"\nmodel = "{model}"\nkinematics = "{kinematics}"\n{thickness}'
    law = "elastic" if kinematics == "small" else "neo_hookean"
    material = f'[[material]]\nlaw = "{law}"\nyoung = 1000.0\npoisson = 0.3\n'
    case = parse_case(head + material + text + spring("a", **first) + spring("b", "a", **second))
    problem = Problem.of(case, blocks(model))
    state, u = moved(problem)
    one = np.array([sum(f[a]) / k[a][0] for a in axes])
    two = one + [f[a][1] / k[a][1] for a in axes]
    nodes = problem.space.mesh.node_groups
    np.testing.assert_allclose(u[nodes["eye_a"][0]], one, rtol=1e-9)
    np.testing.assert_allclose(u[nodes["eye_b"][0]], two, rtol=1e-9)
    work = sum(0.5 * (f[a][0] * one[i] + f[a][1] * two[i]) for i, a in enumerate(axes))
    assert energy(problem, state.u) == pytest.approx(work, rel=1e-9)


def test_axes_of_a_spring_between_nodes():
    """Along (3, 4) / 5 and across it, whatever the place of its ends."""
    axes = "axes = { x = [3.0, 4.0, 0.0], xy = [0.0, 1.0, 0.0] }\n"
    text = rigid("a") + rigid("c") + rigid("b", fx=1.0, fy=0.0, fz=0.5)
    problem = problem_of(text + spring("a", "b", kx=2.0, ky=3.0, kz=5.0) + axes)
    d, e = np.array([0.6, 0.8, 0.0]), np.array([-0.8, 0.6, 0.0])
    K = 2.0 * np.outer(d, d) + 3.0 * np.outer(e, e) + np.diag([0, 0, 5.0])
    u = moved(problem)[1][problem.space.mesh.node_groups["eye_b"][0]]
    np.testing.assert_allclose(u, np.linalg.solve(K, [1.0, 0.0, 0.5]), rtol=1e-9)


def test_full_circle_of_a_ring():
    """In axisymmetry a stiffness is that of the full circle, as a force is."""
    mesh = blocks("axisymmetric")
    text = rigid("a") + rigid("c") + rigid("b", fy=6.0) + spring("a", "b", ky=3.0)
    problem = problem_of(text, "axisymmetric", mesh=mesh)
    np.testing.assert_allclose(moved(problem)[1][mesh.node_groups["eye_b"][0]], [0.0, 2.0], atol=1e-12)


def test_nodes_at_one_place_by_components():
    """Two bodies that share no node, whose corners are at one place: a spring of all components joins them."""
    mesh = blocks()
    points = mesh.points.copy()
    eyes = [mesh.node_groups[f"eye_{name}"][0] for name in "ab"]
    points[8:16] += points[eyes[0]] - points[eyes[1]]
    mesh = Mesh.create(points, mesh.blocks, cell_groups=mesh.cell_groups, node_groups=mesh.node_groups, space_dim=3)
    held = rigid("a") + rigid("c") + rigid("b", fx=1.0, fy=1.0, fz=1.0)
    problem = problem_of(held + spring("b", "a", kx=1.0, ky=2.0, kz=4.0), mesh=mesh)
    np.testing.assert_allclose(moved(problem)[1][eyes[1]], [1.0, 0.5, 0.25], rtol=1e-9)
    with pytest.raises(CaseError, match="nodes 9 and 1 are at one place, with no line between them; give kx, ky, kz"):
        _ = problem_of(held + spring("b", "a", k=1.0), mesh=mesh).springs


# ---- along the line


def test_small_strains_keep_the_undeformed_line():
    text = rigid("a") + rigid("c") + rigid("b", fx=1.0, fy=2.0, fz=-0.5)
    problem = problem_of(text + spring("b", "a", k=7.0) + spring("b", "c", k=5.0) + spring("b", kx=1.0, ky=1.0, kz=1.0))
    p, q = line("a", "b"), line("b", "c")
    K = 7.0 * np.outer(p, p) + 5.0 * np.outer(q, q) + np.eye(3)
    state, u = moved(problem)
    wanted = np.linalg.solve(K, [1.0, 2.0, -0.5])
    np.testing.assert_allclose(u[problem.space.mesh.node_groups["eye_b"][0]], wanted, rtol=1e-9)
    assert energy(problem, state.u) == pytest.approx(0.5 * wanted @ [1.0, 2.0, -0.5], rel=1e-9)


def test_finite_kinematics_turn_the_line():
    """The force on a body that is moved far is k (l - L) along the line where it then is; so is the energy."""
    away = np.array([0.5, 3.0, -2.0])
    text = rigid("a") + rigid("c") + rigid("b", ux=0.5, uy=3.0, uz=-2.0) + spring("a", "b", k=7.0)
    problem = problem_of(text + steps(1.0, 2), kinematics="finite")
    state, _ = moved(problem)
    d = np.array(APART["b"]) - APART["a"]
    longer = np.linalg.norm(d + away) - np.linalg.norm(d)
    force = 7.0 * longer * (d + away) / np.linalg.norm(d + away)
    on_b = state.reaction.reshape(-1, 3)[8:16].sum(axis=0)
    np.testing.assert_allclose(on_b, force, rtol=1e-9)
    assert energy(problem, state.u) == pytest.approx(3.5 * longer**2, rel=1e-9)


def test_two_bars_under_a_force_across_them():
    """Two springs between walls, pulled far aside at their middle: 2 k (l - L) h / l = f, which K alone cannot give."""
    mesh = blocks("plane_strain")
    points = mesh.points.copy()
    for name, k in zip("abc", (0, 4, 8), strict=True):
        points[k : k + 4] += [{"a": -2.0, "b": 0.0, "c": 2.0}[name], {"b": 0.25}.get(name, 0.0), 0] - points[k]
    mesh = Mesh.create(points, mesh.blocks, cell_groups=mesh.cell_groups, node_groups=mesh.node_groups, space_dim=2)
    text = rigid("a") + rigid("c") + rigid("b", fx=0.0, fy=9.0) + spring("b", "a", k=7.0) + spring("c", "b", k=7.0)
    problem = problem_of(text, "plane_strain", "finite", mesh)
    state, u = moved(problem)
    x, y = u[mesh.node_groups["eye_b"][0]]
    h, L = 0.25 + y, np.hypot(2, 0.25)
    assert abs(x) < 1e-9 and y > 0.8
    assert 2 * 7.0 * (np.hypot(2, h) - L) * h / np.hypot(2, h) == pytest.approx(9.0, rel=1e-8)
    assert state.iterations < 12


@pytest.mark.parametrize("model", MODELS)
def test_force_energy_and_tangent_of_lines(model):
    space, line_springs = lines(model)
    rng = np.random.default_rng(3)
    u, v = 0.5 * rng.normal(size=space.n_dof), rng.normal(size=space.n_dof)

    def along(of):
        h = 1e-4
        return (8 * (of(u + h * v) - of(u - h * v)) - (of(u + 2 * h * v) - of(u - 2 * h * v))) / (12 * h)

    K, slope = line_springs.tangent(u), along(line_springs.internal_force)
    np.testing.assert_allclose(K @ v, slope, rtol=0, atol=1e-9 * np.abs(slope).max())
    assert abs(K - K.T).max() < 1e-14 * abs(K).max()
    assert line_springs.internal_force(u) @ v == pytest.approx(along(line_springs.energy), rel=1e-9)
    assert np.abs(line_springs.internal_force(u).reshape(-1, space.dim).sum(axis=0)).max() < 1e-12


def lines(model):
    space = Space.of(mixture("1") if model == "3d" else plane_mixture("1"), model, 0.4 if "stress" in model else None)
    return space, LineSprings(space, np.array([[0, 5], [3, 9], [5, 7]]), np.array([3.0, 20.0, 7.0]))


def test_a_rigid_rotation_leaves_no_force_and_ends_that_meet_are_refused():
    space, line_springs = lines("3d")
    axis = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn = axis * np.sign(np.linalg.det(axis))
    x = space.mesh.points
    assert np.abs(line_springs.internal_force((x @ turn.T - x).ravel())).max() < 1e-13
    meet = np.zeros_like(x)
    meet[5] = x[0] - x[5]
    for of in (line_springs.internal_force, line_springs.tangent, line_springs.energy):
        with pytest.raises(InadmissibleError, match="the ends of a spring, nodes 1, 6, meet"):
            of(meet.ravel())


# ---- what it holds, what it stores


def test_what_a_spring_on_a_line_leaves_free():
    """The bodies b and c on one spring between them, along x but for round-off: all goes but their distance."""
    mesh = blocks()
    points = mesh.points.copy()
    eyes = [mesh.node_groups[f"eye_{name}"][0] for name in "bc"]
    points[16:24] += points[eyes[0]] - points[eyes[1]] + [3.0, 1e-16, 0.0]
    points[eyes[1], 1] = np.nextafter(points[eyes[0], 1], 1)
    mesh = Mesh.create(points, mesh.blocks, cell_groups=mesh.cell_groups, node_groups=mesh.node_groups, space_dim=3)
    problem = problem_of(rigid("a") + rigid("b") + spring("b", "c", k=2.0), mesh=mesh)
    K = problem.springs
    free = free_motions(problem.space, problem.constraints, K)
    assert len(free) == 5, [describe(motion) for motion in free]
    for motion in free:
        np.testing.assert_allclose(K @ motion.field, 0, atol=1e-12)


def test_bodies_that_a_spring_joins_keep_their_momentum_and_energy():
    """Two bodies that fly and turn about one another on a spring: what it stores is in the account of energy."""
    text = rigid("a") + spring("b", "c", k=30.0) + "[dynamics]\nalpha = 0.0\n"
    text += thrown("b", vx=0.4, vy=-0.3) + thrown("c", vy=0.5, vz=0.2) + steps(0.4, 8)
    problem = problem_of(text, kinematics="finite")
    states = [state for state in march(problem) if state.step.motion is not None]
    motions = [state.step.motion for state in states]
    assert unbalanced(motions) < 1e-9
    stored = np.array([LineSprings(problem.space, np.array([[8, 16]]), np.array([30.0])).energy(s.u) for s in states])
    assert stored.max() > 1e-2
    np.testing.assert_allclose(motions[-1].linear, motions[0].linear, atol=1e-9)


# ---- mistakes that only the mesh shows

MISTAKES = {
    "several nodes": ('[[spring]]\ngroup = "two"\nto = "eye_b"\nkx = 1.0\n', "the group 'two' has 2 nodes"),
    "several at the other end": ('[[spring]]\ngroup = "eye_b"\nto = "two"\nk = 1.0\n', "the group 'two' has 2 nodes"),
    "one node": ('[[spring]]\nat = [5, 0, 0]\nto = "eye_a"\nkx = 1.0\n', "both its ends are node 1; name another one"),
    "no group": ('[[spring]]\ngroup = "eye_a"\nto = "eye_q"\nkx = 1.0\n', "spring.to: no group named 'eye_q'; did you"),
}


def test_several_processes_refuse_springs_between_nodes():
    case = problem_of(rigid("a") + rigid("b") + rigid("c") + spring("a", "b", k=1.0)).case
    with pytest.raises(RequestError, match=r"a \[\[spring\]\] between two nodes .* by one process only"):
        _check_shared(case, Share())


@pytest.mark.parametrize("name", MISTAKES)
def test_what_is_refused(name):
    text, words = MISTAKES[name]
    with pytest.raises(CaseError, match=words):
        _ = problem_of(rigid("a") + rigid("b") + rigid("c") + text).springs
