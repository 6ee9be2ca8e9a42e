"""Contact with rigid masters, bare skins that are moved or loaded; and of bodies that move and turn far."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.generate import line, rectangle
from lacsolver.case import BodyForce, Material, Rigid, Spring, Steps, Tie
from lacsolver.results.state import CONTACT, OPEN, UNPAIRED
from tests.lacsolver.contact_cases import (
    POISSON,
    SIDES,
    YOUNG,
    last,
    nodes_of,
    only,
    places,
    resultant,
    solve,
    stresses,
    total,
)
from tests.lacsolver.patch_meshes import block, joined, stack
from tests.problem_meshes import punch
from tests.problems import contact, fix, move
from tests.samples import each_option

FACES = ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9")
LOW = *SIDES, fix("bottom", "z")
NEO = Material(law="neo_hookean", young=YOUNG, poisson=POISSON)
FINITE = {"kinematics": "finite", "material": NEO}


def plate(face, right=1.1, n=2):
    """A bare skin in the plane z = 1 or the line y = 1, from -1/10 on, a little larger than the block; it faces down.

    `right`: where a line ends.
    """
    if face[:3] == "SEG":
        return line(n, (-0.1, 1.0), (right, 1.0), face)
    flat = rectangle(n, 1.2, face, corner=-0.1)
    x = flat.points
    points = np.column_stack([x[:, 1], x[:, 0], np.ones(len(x))])  # mirrored, so that it faces down
    blocks = [one for one in flat.blocks if one.type == face]
    return Mesh.create(points, blocks, cell_groups={"body": np.arange(len(blocks[0].nodes))}, space_dim=3)


def under_a_plate(kind, face, **options):
    """A block of height 1, its top the slave, under a plate."""
    dim = 2 if face.startswith("SEG") else 3
    up = "xyz"[dim - 1]
    names = {a: a for a in ("x0", "y0")[: dim - 1]} | {f"{up}0": "bottom", f"{up}1": "slave"}
    parts = (block(kind, dim, 3, f"{up}1"), names), (plate(face, **options), {"body": "master"})
    return joined([(mesh, np.zeros(3), own) for mesh, own in parts])


def rigid(**values):
    """The plate, its centre over the middle of the block."""
    return Rigid(group="master", centre=[0.5, 0.5, 1.0], **values)


def check_pressed(problem, state, p, rtol=1e-9, atol=1e-12):
    """The block is pressed evenly, and the plate has come down by what it is shorter."""
    (zone,) = state.zones
    np.testing.assert_allclose(zone.pressure, p, rtol=rtol)
    np.testing.assert_allclose(stresses(problem, state)[:, 2], -p, rtol=rtol)
    assert resultant(zone, problem)[2] == pytest.approx(-p, rel=rtol)
    np.testing.assert_allclose(state.rigid["master"], [0, 0, -p / YOUNG, 0, 0, 0], rtol=1e-9, atol=atol)


@pytest.mark.parametrize(("kind", "face"), each_option(itertools.product(("HEXA8", "TETRA10", "HEXA27"), FACES)))
def test_a_plate_that_is_moved_presses_evenly(kind, face):
    problem, state = only(under_a_plate(kind, face), contact(), *LOW, rigid(uz=-0.01))
    check_pressed(problem, state, 0.01 * YOUNG, rtol=1e-10, atol=1e-16)


@pytest.mark.parametrize("face", FACES)
def test_a_plate_that_is_loaded_presses_evenly(face):
    """Its height is found: only contact holds it. Springs hold one that is free to spin about its normal."""
    mesh = under_a_plate("HEXA8", face)
    problem, state = only(mesh, contact(), *LOW, rigid(fz=-7.0))
    check_pressed(problem, state, 7.0)
    if face in ("TRIA3", "QUAD4"):
        springs = Spring(group="master", kx=1.0, ky=1.0)
        problem, state = only(mesh, contact(), *LOW, rigid(fz=-10.0, moment=[0.0, 0.0, 0.0]), springs)
        check_pressed(problem, state, 10.0, atol=1e-11)


@pytest.mark.parametrize("moment", [0.0, 0.1, 0.3])
def test_a_rigid_block_with_a_moment_stands_under_its_load(moment):
    """The resultant of the pressures is off the middle by moment / force; with the largest one an edge lifts.

    Weak springs keep the block from turning about the height.
    """
    body = Rigid(group="upper", centre=[0.5, 0.5, 1.0], fz=-1.0, moment=[0.0, moment, 0.0])
    held = fix("bottom", "xyz"), Spring(group="top", kx=1e-7, ky=1e-7)
    problem, state = only(stack("HEXA8", "TETRA4", 3, counts=(5, 2)), contact(), *held, body)
    (zone,) = state.zones
    assert total(zone) == pytest.approx(1.0, rel=1e-9)
    np.testing.assert_allclose((zone.pressure * zone.area) @ zone.centre[:, :2], [0.5 + moment, 0.5], atol=1e-6)
    assert (zone.status == OPEN).any() == (moment > 0.2)
    turn = state.rigid["upper"][4]
    assert turn > 1e-6 if moment else abs(turn) < 1e-4
    assert resultant(zone, problem)[2] == pytest.approx(-1.0, rel=1e-9)


@pytest.mark.parametrize("face", ["SEG2", "SEG3"])
@pytest.mark.parametrize("model", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("how", ["uy", "fy"])
def test_a_line_presses_evenly(face, model, how):
    """About an axis it begins there."""
    mesh = under_a_plate("QUAD8" if face == "SEG2" else "TRIA3", face)
    if model == "axisymmetric":
        mesh = mesh.moved(lambda x: [np.maximum(x[0], 0.0), *x[1:]])
    E = YOUNG / (1 - POISSON**2) if model == "plane_strain" else YOUNG
    area = np.pi if model == "axisymmetric" else 1.0
    body = Rigid(group="master", **{how: -0.01 if how == "uy" else -0.01 * E * area})
    problem, state = only(mesh, contact(), fix("x0", "x"), fix("bottom", "y"), body, model=model)
    np.testing.assert_allclose(state.zones[0].pressure, 0.01 * E, rtol=1e-10)
    np.testing.assert_allclose(stresses(problem, state)[:, 1], -0.01 * E, rtol=1e-10)
    assert state.rigid["master"][1] == pytest.approx(-0.01, rel=1e-9)


# ---- finite kinematics

GROUND = {2: fix("bottom", "xy"), 3: fix("bottom", "xyz")}
KINDS = {2: ("QUAD8", "SEG2"), 3: ("HEXA8", "TRIA3")}
PLANE = {"model": "plane_strain", **FINITE}
MODEL = {2: PLANE, 3: FINITE}


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_a_plate_that_is_pressed_in_and_turned(dim, normals):
    """Prescribed: its reaction is what contact gives to it, and the block bears that."""
    turned = {f"u{'xyz'[dim - 1]}": -0.12, "ux": 0.05, "rotation": 0.12 if dim == 2 else [0.05, 0.12, 0.3]}
    records = contact(normals=normals, measure="current"), GROUND[dim], Rigid(group="master", **turned), Steps(count=3)
    problem, states = solve(under_a_plate(*KINDS[dim]), *records, **MODEL[dim])
    assert len(states) == 3
    for state in states:
        (zone,) = state.zones
        found = problem.constraints.reactions(state.reaction)["master"]
        np.testing.assert_allclose(found, resultant(zone, problem), atol=1e-9 * np.abs(found).max())
    assert (zone.status == CONTACT).any() and abs(found[dim - 1]) > 20


def moment_about(x, centre, force):
    arm = x - centre
    return float((arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum())


@pytest.mark.parametrize("moment", [0.0, 4.0, 8.0])
def test_a_plate_that_is_loaded_finds_its_place(moment):
    """Force and moment, free to turn and to sink: contact bears both, about the centre where it has come to."""
    body = Rigid(group="master", fy=-60.0, moment=moment)
    problem, state = last(under_a_plate("QUAD8", "SEG2"), contact(), GROUND[2], body, Steps(count=2), **PLANE)
    (zone,), (plate,) = state.zones, problem.constraints.rigid
    motion, nodes = state.rigid["master"], plate.nodes
    centre = np.asarray(plate.centre)[:2] + motion[:2]
    assert zone.force[nodes, 1].sum() == pytest.approx(60.0, rel=1e-9)
    found = moment_about(places(problem, state)[nodes], centre, zone.force[nodes])
    assert found == pytest.approx(-moment, abs=1e-8)
    assert motion[1] < -0.03 and (motion[2] > 0.02 if moment else abs(motion[2]) < 1e-3)


def test_a_plate_in_space_that_is_loaded_finds_its_place():
    """All rotations free, springs against drifting aside: what holds the plate is the force and the moment on it."""
    body = Rigid(group="master", fx=0.0, fy=0.0, fz=-60.0, moment=[4.0, 8.0, 0.0])
    records = GROUND[3], Spring(group="master", kx=5.0, ky=5.0), body, Steps(count=2)
    problem, state = last(under_a_plate("HEXA8", "TRIA3"), contact(), *records, **FINITE)
    found = problem.constraints.rigid_reactions(state.reaction, state.rigid)["master"]
    np.testing.assert_allclose(found, [0, 0, -60, 4, 8, 0], atol=1e-8)
    assert state.rigid["master"][4] > 0.1


def groove(turned, lift, n=3):
    """A unit block, its sides x0 and y0 in front of a groove's two rigid walls, turned and lifted."""
    c, s = np.cos(np.pi / 4 + turned), np.sin(np.pi / 4 + turned)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    body = block("QUAD4", 2, n, "y0", even=True).moved(lambda x: turn.T @ x + [[0], [lift], [0]])
    parts = (
        (body, {"y0": "slave1", "x0": "slave2", "body": "body"}),
        (line(4, (1.3, 1.3), (0.0, 0.0)), {"body": "right"}),
        (line(4, (0.0, 0.0), (-1.3, 1.3)), {"body": "left"}),
    )
    return joined([(mesh, np.zeros(3), names) for mesh, names in parts])


def walls(turn=None, **options):
    """Contact of both sides with a rigid wall each."""
    joints = (contact(slave=f"slave{k}", master=wall, **options) for k, wall in ((1, "right"), (2, "left")))
    return *joints, *(Rigid(group=wall, **(turn or {})) for wall in ("right", "left"))


def test_a_block_settles_in_a_groove():
    """Free to move and turn, from 3 degrees askew and lifted: it comes to lie symmetrically on both walls."""
    records = *walls(), BodyForce(fy=-20.0), Steps(count=2)
    problem, state = last(groove(0.05, 0.03), *records, **PLANE)
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


@pytest.mark.parametrize("slave, master, dim", [("QUAD8", "TRIA3", 2), ("HEXA8", "TETRA4", 3)])
def test_what_is_tied_turns_with_the_other_for_nothing(slave, master, dim):
    """A quarter of a turn of the lower block, prescribed: the upper one goes with it, free of stress."""
    angle = "pi / 2 * t" if dim == 2 else [0.0, "pi / 2 * t", 0.0]
    records = Tie(slave="slave", master="master"), Rigid(group="lower", ux="0.3 * t", rotation=angle), Steps(count=4)
    problem, state = last(stack(slave, master, dim), *records, **MODEL[dim])
    centre = np.asarray(problem.constraints.rigid[0].centre)[:dim]
    Q = np.array([[0.0, -1], [1, 0]]) if dim == 2 else np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    X = problem.space.mesh.points[:, :dim]
    wanted = (X - centre) @ Q.T + centre + np.eye(dim)[0] * 0.3
    np.testing.assert_allclose(places(problem, state), wanted, atol=1e-10)
    assert np.abs(stresses(problem, state)).max() <= 1e-8 * YOUNG


def test_bilateral_contact_turns_with_its_masters():
    """A block that two walls at a right angle hold both ways: they turn about one point, and it goes with them."""
    turn = {"centre": [0.0, 0.0], "rotation": "pi / 2 * t"}
    problem, state = last(groove(0.0, 0.0), *walls(turn, type="bilateral"), Steps(count=6), **PLANE)
    X = problem.space.mesh.points[:, :2]
    np.testing.assert_allclose(places(problem, state), X @ np.array([[0.0, 1], [-1, 0]]), atol=1e-9)
    assert np.abs(stresses(problem, state)).max() <= 1e-8 * YOUNG


@pytest.mark.parametrize("law", ["neo_hookean", "saint_venant_kirchhoff"])
def test_under_small_loads_finite_is_small(law):
    """Blocks of which one is a parabola, pressed: what differs goes with the square of the load."""
    apart = []
    for load in (2e-3, 2e-4):
        records = contact(geometry="current", surface="faces"), GROUND[2], move("top", ux=0.0, uy=-load)
        _, small = only(punch(), *records, model="plane_strain")
        material = Material(law=law, young=YOUNG, poisson=POISSON)
        _, finite = only(punch(), *records, model="plane_strain", kinematics="finite", material=material)
        apart.append(np.abs(finite.u - small.u).max() / load)
        assert (finite.zones[0].status == small.zones[0].status).all()
    assert apart[0] <= 0.05 and apart[1] <= apart[0] / 5


@pytest.mark.parametrize(("dim", "measure"), [(2, "reference"), (3, "current")])
def test_a_plate_goes_off_the_edge_and_comes_back(dim, measure):
    """Coverage falls to 0 macro-element by macro-element, which then press no more; back, all is as it was."""
    path = {f"u{'xyz'[dim - 1]}": [[0.0, 0.0], [1.0, -0.05]], "ux": [[0.0, 0.0], [1.0, 0.0], [6.0, 1.5], [11.0, 0.0]]}
    records = contact(measure=measure), GROUND[dim], Rigid(group="master", **path), Steps(end=11.0, count=11)
    _, states = solve(under_a_plate(*KINDS[dim]), *records, **MODEL[dim])
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
