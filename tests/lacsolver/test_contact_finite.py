"""Contact of bodies that move and turn far: rigid masters, free bodies, ties, edges; always in balance."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacsolver.results.state import CONTACT, UNPAIRED
from tests.lacsolver.contact_cases import JOINT, SLIDING, held, nodes_of, resultant
from tests.lacsolver.contact_cases import solve as solve_small
from tests.lacsolver.finite_cases import YOUNG, last, places, solve
from tests.lacsolver.patch_meshes import block, joined, stack, three_blocks
from tests.lacsolver.test_contact_rigid import under_a_plate
from tests.problem_meshes import punch

GROUND = {2: held("bottom", ux=0.0, uy=0.0), 3: held("bottom", ux=0.0, uy=0.0, uz=0.0)}
KINDS = {2: ("QUAD8", "SEG2"), 3: ("HEXA8", "TRIA3")}
MODEL = {2: "plane_strain", 3: "3d"}
STEPS = "[steps]\ncount = {}\n"


# ---- rigid masters


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_a_plate_that_is_pressed_in_and_turned(dim, normals):
    """Prescribed: its reaction is what contact gives to it, and the block bears that."""
    turn = "rotation = 0.12\n" if dim == 2 else "rotation = [0.05, 0.12, 0.3]\n"
    body = f'[[rigid]]\ngroup = "master"\nu{"xyz"[dim - 1]} = -0.12\nux = 0.05\n{turn}'
    contact = JOINT + f'normals = "{normals}"\nmeasure = "current"\n'
    problem, states = solve(
        under_a_plate(*KINDS[dim]), contact + GROUND[dim] + body + STEPS.format(3), model=MODEL[dim]
    )
    assert len(states) == 3
    for state in states:
        (zone,) = state.zones
        found = problem.constraints.reactions(state.reaction)["master"]
        np.testing.assert_allclose(found, resultant(zone, problem), atol=1e-9 * np.abs(found).max())
    assert (zone.status == CONTACT).any() and abs(found[dim - 1]) > 20


# ---- loaded, and free to turn


def moment_about(x, centre, force):
    moment_arm = x - centre
    return float((moment_arm[:, 0] * force[:, 1] - moment_arm[:, 1] * force[:, 0]).sum())


@pytest.mark.parametrize("moment", [0.0, 4.0, 8.0])
def test_a_plate_that_is_loaded_finds_its_place(moment):
    """Force and moment, free to turn and to sink: contact bears both, about the centre where it has come to."""
    body = f'[[rigid]]\ngroup = "master"\nfy = -60.0\nmoment = {moment}\n'
    mesh = under_a_plate("QUAD8", "SEG2")
    problem, states = solve(mesh, JOINT + GROUND[2] + body + STEPS.format(2), model="plane_strain")
    state = states[-1]
    (zone,), (rigid,) = state.zones, problem.constraints.rigid
    motion, nodes = state.rigid["master"], rigid.nodes
    centre = np.asarray(rigid.centre)[:2] + motion[:2]
    assert zone.force[nodes, 1].sum() == pytest.approx(60.0, rel=1e-9)
    found = moment_about(places(problem, state)[nodes], centre, zone.force[nodes])
    assert found == pytest.approx(-moment, abs=1e-8)
    assert motion[1] < -0.03 and (motion[2] > 0.02 if moment else abs(motion[2]) < 1e-3)


def test_a_plate_in_space_that_is_loaded_finds_its_place():
    """All rotations free, springs against drifting aside: what holds the plate is the force and the moment on it."""
    body = '[[rigid]]\ngroup = "master"\nfx = 0.0\nfy = 0.0\nfz = -60.0\nmoment = [4.0, 8.0, 0.0]\n'
    springs = '[[spring]]\ngroup = "master"\nkx = 5.0\nky = 5.0\n'
    problem, states = solve(under_a_plate("HEXA8", "TRIA3"), JOINT + GROUND[3] + springs + body + STEPS.format(2))
    found = problem.constraints.rigid_reactions(states[-1].reaction, states[-1].rigid)["master"]
    np.testing.assert_allclose(found, [0, 0, -60, 4, 8, 0], atol=1e-8)
    assert states[-1].rigid["master"][4] > 0.1


# ---- bodies that contact alone holds


def groove(turned, lift, n=3):
    """A unit block, its sides x0 and y0 in front of a groove's two rigid walls, turned and lifted."""
    body = block("QUAD4", 2, n, "y0", even=True)
    c, s = np.cos(np.pi / 4 + turned), np.sin(np.pi / 4 + turned)
    points = body.points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [0, lift, 0]
    body = Mesh.create(points, body.blocks, cell_groups=body.cell_groups, space_dim=2)
    t = np.linspace(0, 1.3, 5)
    right, left = np.stack([t, t, 0 * t], axis=1), np.stack([-t, t, 0 * t], axis=1)
    nodes = np.stack([np.arange(4), np.arange(1, 5)], axis=1)
    cells = np.concatenate([nodes[:, ::-1], 5 + nodes])
    walls = Mesh.create(
        np.concatenate([right, left]),
        [("SEG2", cells)],
        cell_groups={"right": np.arange(4), "left": np.arange(4, 8)},
        space_dim=2,
    )
    return joined([
        (body, np.zeros(3), {"y0": "slave1", "x0": "slave2", "body": "body"}),
        (walls, np.zeros(3), {"right": "right", "left": "left"}),
    ])  # fmt: skip


TWO = "".join(
    f'[[contact]]\nslave = "slave{k}"\nmaster = "{w}"\n{{0}}[[rigid]]\ngroup = "{w}"\n{{{k}}}'
    for k, w in ((1, "right"), (2, "left"))
)


def test_a_block_settles_in_a_groove():
    """Free to move and turn, from 3 degrees askew and lifted: it comes to lie symmetrically on both walls."""
    weight = "[[body_force]]\nfy = -20.0\n"
    problem, states = solve(groove(0.05, 0.03), TWO.format("", "", "") + weight + STEPS.format(2), model="plane_strain")
    state = states[-1]
    one, two = (resultant(zone, problem) for zone in state.zones)
    np.testing.assert_allclose(one + two, [0, 20.0], atol=1e-8)
    np.testing.assert_allclose(one * [-1, 1], two, rtol=1e-3)  # the cut of the corner's cell is not symmetric
    x, nodes = places(problem, state), nodes_of(problem, "body")
    acting = problem.load(1.0).reshape(-1, 2) + sum(zone.force for zone in state.zones)
    np.testing.assert_allclose(acting[nodes].sum(axis=0), 0, atol=1e-8)
    assert abs(moment_about(x[nodes], np.zeros(2), acting[nodes])) <= 1e-8
    tip = problem.space.mesh.points[:, 1].argmax()
    assert abs(x[tip, 0]) <= 1e-3 < 0.07 < abs(problem.space.mesh.points[tip, 0])
    assert all((zone.status == CONTACT).any() for zone in state.zones)


# ---- ties and bilateral contact turn with their bodies


@pytest.mark.parametrize("slave, master, dim", [("QUAD8", "TRIA3", 2), ("HEXA8", "TETRA4", 3)])
def test_what_is_tied_turns_with_the_other_for_nothing(slave, master, dim):
    """A quarter of a turn of the lower block, prescribed: the upper one goes with it, free of stress."""
    angle = '"pi / 2 * t"' if dim == 2 else '[0.0, "pi / 2 * t", 0.0]'
    body = f'[[rigid]]\ngroup = "lower"\nux = "0.3 * t"\nrotation = {angle}\n'
    tie = '[[tie]]\nslave = "slave"\nmaster = "master"\n'
    problem, states = solve(stack(slave, master, dim), tie + body + STEPS.format(4), model=MODEL[dim])
    state, d = states[-1], dim
    centre = np.asarray(problem.constraints.rigid[0].centre)[:d]
    Q = np.array([[0.0, -1], [1, 0]]) if dim == 2 else np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    X = problem.space.mesh.points[:, :d]
    wanted = (X - centre) @ Q.T + centre + np.eye(d)[0] * 0.3
    np.testing.assert_allclose(places(problem, state), wanted, atol=1e-10)
    assert max(np.abs(s).max() for s in problem.kinematics.stress(state.u, 1.0)) <= 1e-8 * YOUNG


def test_bilateral_contact_turns_with_its_masters():
    """A block that two walls at a right angle hold both ways: they turn about one point, and it goes with them."""
    turn = 'centre = [0.0, 0.0]\nrotation = "pi / 2 * t"\n'
    options = 'type = "bilateral"\n'
    problem, states = solve(groove(0.0, 0.0), TWO.format(options, turn, turn) + STEPS.format(6), model="plane_strain")
    X = problem.space.mesh.points[:, :2]
    np.testing.assert_allclose(places(problem, states[-1]), X @ np.array([[0.0, 1], [-1, 0]]), atol=1e-9)
    assert max(np.abs(s).max() for s in problem.kinematics.stress(states[-1].u, 1.0)) <= 1e-8 * YOUNG


# ---- limits


@pytest.mark.parametrize("law", ["neo_hookean", "saint_venant_kirchhoff"])
def test_under_small_loads_finite_is_small(law):
    """Blocks of which one is a parabola, pressed: what differs goes with the square of the load."""
    apart = []
    for load in (2e-3, 2e-4):
        sections = GROUND[2] + held("top", ux=0.0, uy=-load)
        contact = JOINT + 'geometry = "current"\nsurface = "faces"\n'
        small = solve_small(punch(), contact + sections, "plane_strain")[1][-1]
        finite = last(punch(), contact + sections, model="plane_strain", law=law)[1]
        apart.append(np.abs(finite.u - small.u).max() / load)
        assert (finite.zones[0].status == small.zones[0].status).all()
    assert apart[0] <= 0.05 and apart[1] <= apart[0] / 5


def test_several_zones():
    """Three blocks on one another, pressed by a tenth: forces pass through both zones and are alike."""
    zones = "".join(f'[[contact]]\nslave = "slave{k}"\nmaster = "master{k}"\n' for k in (1, 2))
    sections = zones + SLIDING + held("bottom", uz=0.0) + held("top", uz=-0.3) + STEPS.format(2)
    problem, state = last(three_blocks(("HEXA8", "TETRA4", "PENTA6 quadrangle")), sections)
    one, two = state.zones
    assert one.pressure.min() > 80
    np.testing.assert_allclose(two.pressure, one.pressure[0], rtol=1e-7)
    np.testing.assert_allclose(resultant(one, problem), resultant(two, problem), atol=1e-6)


# ---- off the edge and back on


@pytest.mark.parametrize(("dim", "measure"), [(2, "reference"), (3, "current")])
def test_a_plate_goes_off_the_edge_and_comes_back(dim, measure):
    """Coverage falls to 0 macro-element by macro-element, which then press no more; back, all is as it was."""
    up = "xyz"[dim - 1]
    path = [[0.0, 0.0], [1.0, 0.0], [6.0, 1.5], [11.0, 0.0]]
    body = f'[[rigid]]\ngroup = "master"\nu{up} = [[0.0, 0.0], [1.0, -0.05]]\nux = {path}\n'
    contact = JOINT + f'measure = "{measure}"\n'
    steps = "[steps]\nend = 11.0\ncount = 11\n"
    _, states = solve(under_a_plate(*KINDS[dim]), contact + GROUND[dim] + body + steps, model=MODEL[dim])
    at = {round(state.time, 6): state for state in states}
    before, away, after = (at[t] for t in (1.0, 6.0, 11.0))
    (first,), (gone,), (again,) = before.zones, away.zones, after.zones
    assert first.pressure.min() > 0 and first.coverage.min() > 1 - 1e-12
    assert (gone.status == UNPAIRED).all() and gone.coverage.max() == 0 and (gone.pressure == 0).all()
    assert np.abs(away.u).max() >= 1.5 and np.abs(away.reaction).max() <= 1e-9 * np.abs(before.reaction).max()
    partly = [state.zones[0].coverage for state in states]
    assert any(((c > 0) & (c < 1)).any() for c in partly)
    np.testing.assert_allclose(again.pressure, first.pressure, rtol=1e-8)
    np.testing.assert_allclose(after.u, before.u, atol=1e-10)
