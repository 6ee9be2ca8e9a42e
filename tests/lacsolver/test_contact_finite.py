"""Contact with rigid masters, bare skins that are moved or loaded; and of bodies that move and turn far."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lacmesh import Mesh, join
from lacmesh.generate import box, line, rectangle
from lacmesh.generate.parts import assembled
from lacsolver.case import BodyForce, CaseError, Dynamics, Initial, Material, Rigid, Spring, Steps
from lacsolver.equilibrium.state import CONTACT, OPEN, UNPAIRED
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.problem.passing import passing
from lacsolver.problem.problem import Problem
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
from tests.problems import case_of, contact, fix, move
from tests.samples import each_option

FACES = ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9")
LOW = *SIDES, fix("bottom", "z")
NEO = Material(law="neo_hookean", young=YOUNG, poisson=POISSON)
FINITE = {"kinematics": "finite", "material": NEO}


def plate(face, n=2):
    """A bare skin in the plane z = 1 or the line y = 1, a tenth beyond the block on each side; it faces down."""
    if face[:3] == "SEG":
        return line(n, (-0.1, 1.0), (1.1, 1.0), face)
    flat = rectangle(n, 1.2, face, corner=-0.1)
    x = flat.points
    points = np.column_stack([x[:, 1], x[:, 0], np.ones(len(x))])  # mirrored, so that it faces down
    blocks = [one for one in flat.blocks if one.type == face]
    return Mesh.create(points, blocks, cell_groups={"body": np.arange(len(blocks[0].nodes))}, space_dim=3)


def under_a_plate(kind, face):
    """A block of height 1, its top the slave, under a plate."""
    dim = 2 if face.startswith("SEG") else 3
    up = "xyz"[dim - 1]
    names = {a: a for a in ("x0", "y0")[: dim - 1]} | {f"{up}0": "bottom", f"{up}1": "slave"}
    parts = (block(kind, dim, 3, f"{up}1"), names), (plate(face), {"body": "master"})
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


# ---- finite kinematics

GROUND = {2: fix("bottom", "xy"), 3: fix("bottom", "xyz")}
KINDS = {2: ("QUAD8", "SEG2"), 3: ("HEXA8", "TRIA3")}
PLANE = {"model": "plane_strain", **FINITE}
MODEL = {2: PLANE, 3: FINITE}


@pytest.mark.rows("facet-2")
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


@pytest.mark.rows("0.0")
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


@pytest.mark.slow
def test_bilateral_contact_turns_with_its_masters():
    """A block that two walls at a right angle hold both ways: they turn about one point, and it goes with them."""
    turn = {"centre": [0.0, 0.0], "rotation": "pi / 2 * t"}
    problem, state = last(groove(0.0, 0.0), *walls(turn, type="bilateral"), Steps(count=6), **PLANE)
    X = problem.space.mesh.points[:, :2]
    np.testing.assert_allclose(places(problem, state), X @ np.array([[0.0, 1], [-1, 0]]), atol=1e-9)
    assert np.abs(stresses(problem, state)).max() <= 1e-8 * YOUNG


@pytest.mark.rows("3-current")
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


# ---- skins that would go through their master in one step, and such that only fly past

#: of the plate, and of the gap above it
THICK, GAP = 0.2, 0.5
MODELS = {2: "plane_strain", 3: "3d"}


def part(low, high, names, dim=2):
    """A box of QUAD4 or HEXA8, cells a quarter wide, from a corner (x, height) to another, and its groups."""
    low, high = ((a,) * (dim - 1) + (b,) for a, b in (low, high))
    size = np.subtract(high, low)
    shape = rectangle if dim == 2 else box
    mesh = shape(tuple(max(1, round(length / 0.25)) for length in size), size, corner=low)
    return mesh.renamed(**names).only(*names.values())


BLOCK = {"body": "block", "bottom": "slave", "top": "lid"}


def block_over_plate(dim=2, wall=False):
    """A block of side 1/2, its lower side `slave`, over a plate 2 wide and 0.2 thick, or over a skin with no body."""
    block = part((-0.25, GAP), (0.25, GAP + 0.5), BLOCK, dim)
    if not wall:
        return join(block, part((-1, -THICK), (1, 0), {"body": "plate", "bottom": "under", "top": "master"}, dim))
    if dim == 2:
        return join(block, line(1, (1, 0), (-1, 0)).renamed(body="master"))
    x = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return join(block, assembled(x, {("QUAD4", "master"): np.arange(4)[None]}, 3))


def problem_of(mesh, *records, kinematics="small", model=None, **options):
    law = Material(
        young=1000.0, poisson=0.3, density=1.0, law="elastic" if kinematics == "small" else "neo_hookean"
    )  # fmt: skip
    joint = contact(**{"name": "c", "geometry": "current", "search_distance": 0.3} | options)
    return Problem.of(case_of(mesh, law, joint, *records, model=model or MODELS[mesh.space_dim], kinematics=kinematics))


def passes(problem, first, last):
    """Return what `passing` finds as the block moves by `first` at the start of a step, and by `last` at its end."""
    space, (joint,) = problem.space, problem.joints
    u = np.zeros((2, space.mesh.n_nodes, space.dim))
    u[:, space.mesh.nodes_on(space.mesh.cells_of("block"))] = np.array([first, last])[:, None]
    u0, u1 = u.reshape(2, -1)
    return passing(joint, joint.integrate(space, u1, 1.0), space.places(u0), 1.0, space)


WALL = Rigid(group="master")


@pytest.mark.rows("False-master-2", "True-slave-3")
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(("wall", "slave"), [(False, "slave"), (False, "master"), (True, "slave")])
def test_what_passes_a_skin_and_what_does_not(dim, wall, slave):
    """Found from any height and any side; not found where it only approaches, flies past, over or away, or slides."""
    master = {"slave": "master", "master": "slave"}[slave]
    problem = problem_of(block_over_plate(dim, wall), *([WALL] if wall else []), slave=slave, master=master)

    def by(first, last):
        return passes(problem, *((x, *[0.0] * (dim - 2), y) for x, y in (first, last)))

    # as deep as a corner is: the whole thickness, or the depth that is looked to
    assert by((0, 0), (0, -3)).depth.max() == pytest.approx(2.5)
    for begin, end in (
        ((0, 0), (0, -GAP - 0.31)),
        ((0, 0), (0.6, -2)),
        ((-20, 20), (20, -21)),  # from afar, at an angle
        ((0, -GAP - 0.01), (0, -2)),  # it pressed before
        ((0, -GAP), (9, -GAP - 1)),  # at first over the plate
    ):
        assert by(begin, end) is not None, (begin, end)
    for begin, end in (
        ((0, 0), (0, -GAP + 0.01)),  # it stays apart
        ((0, 0), (0, -GAP - 0.05)),  # the pairing sees that
        ((0, 0), (0, 3)),
        ((3, 0), (3, -3)),  # beside the plate
        ((-5, 1), (5, -0.4)),  # over it
        ((0, -GAP), (9, -GAP)),
        ((0, -3), (0, -5)),  # it was below, and goes on
        ((0, -3), (0, 0)),  # from behind
    ):
        assert by(begin, end) is None, (begin, end)


def test_bodies_that_move_together_pass_nothing():
    """Only the motion of one skin as the other one sees it counts."""
    problem = problem_of(block_over_plate())
    space, (joint,) = problem.space, problem.joints
    for far in (1.0, 1e3):
        u = np.tile([far, -far], space.mesh.n_nodes)
        assert passing(joint, joint.integrate(space, u, 1.0), space.places(0 * u), 1.0, space) is None
        u[1::2] -= 3 * (space.mesh.points[:, 1] > GAP / 2)
        found = passing(joint, joint.integrate(space, u, 1.0), space.places(0 * u), 1.0, space)
        assert found.depth.max() == pytest.approx(2.5)


def test_a_small_body_passes_between_the_nodes_of_a_large_face():
    """Corners, edges and centres of both skins are looked at."""
    block = part((-0.05, GAP), (0.05, GAP + 0.1), BLOCK)
    mesh = join(block, line(1, (10.3, 0), (-9.0, 0)).renamed(body="master"))
    assert passes(problem_of(mesh, WALL, search_distance=0.1), (0.0, 0.0), (0.0, -1.0)) is not None
    x, rows = np.array([[0.31, GAP, 0], [0.39, GAP, 0], [0.35, GAP + 0.1, 0]]), np.array([[0, 1, 2]])
    one = assembled(x, {("TRIA3", "block"): rows, ("SEG2", "master"): rows[:, :2]}, 2)
    mesh = join(one, part((-4, -THICK), (4, 0), {"body": "plate", "top": "slave"}))
    assert passes(problem_of(mesh, search_distance=0.1), (0.0, 0.0), (0.0, -1.0)) is not None


def test_a_clearance_moves_the_skins_apart():
    """Contact that a large clearance takes away may be passed; with a small one the depth is what is left."""
    assert passes(problem_of(block_over_plate(), clearance=100.0), (0, 0), (0, -3)) is None
    found = passes(problem_of(block_over_plate(), clearance="0.4 * t"), (0, 0), (0, -3))
    assert found.depth.max() == pytest.approx(2.1)


def test_what_lies_between_two_plates_of_one_master_has_passed_the_first():
    """The second plate is in front of it, and open: the pairing sees nothing of the first one."""
    plates = (part((-1, y - 0.1), (1, y), {"body": "plates", "top": "master"}) for y in (0.0, -1.0))
    problem = problem_of(join(part((-0.25, GAP), (0.25, GAP + 0.5), BLOCK), *plates), search_distance=0.4)
    assert passes(problem, (0, 0), (0, -GAP - 0.7)) is not None
    assert passes(problem, (0, -GAP - 0.6), (0, -GAP - 0.9)) is None


@pytest.mark.parametrize(("radius", "through"), [(1.0, True), (1.6, False)])
def test_a_ring_that_is_thrown_through_a_wall_in_axisymmetry(radius, through):
    """The radius counts as a coordinate: a ring falls past the edge of a plate, a smaller one through it."""
    plate = part((0.5, -THICK), (1.5, 0), {"body": "plate", "top": "master"})
    mesh = join(part((radius, GAP), (radius + 0.5, 1), BLOCK), plate)
    assert (passes(problem_of(mesh, model="axisymmetric"), (0, 0), (0, -3)) is not None) == through


def pushed(down, kinematics="small", search_distance=0.3, **steps):
    """The states of a block whose lid moves down by a distance, with the plate held."""
    records = fix("under", "xy"), move("lid", ux=0.0, uy=-down), Steps(**steps)
    problem = problem_of(block_over_plate(), *records, kinematics=kinematics, search_distance=search_distance)
    return list(march(problem))


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_block_that_is_pushed_through_is_an_error_that_says_so(kinematics):
    """Statics: one step takes it to the other side of the plate, where it finds no master."""
    with pytest.raises(NotConvergedError, match=r"\d faces of slave 'slave' pass through"):
        pushed(10.0, kinematics, max_halvings=0)


@pytest.mark.slow
def test_a_block_that_is_pushed_far_is_stopped_in_smaller_steps():
    """One step, whose end is beyond the plate: the contact is found on the way, and holds to the end."""
    one, fine = (pushed(GAP + 0.35, search_distance=0.2, count=count)[-1].zones[0].pressure for count in (1, 16))
    assert (one > 100).all() and one == pytest.approx(fine, rel=1e-6)


def test_a_rigid_body_that_is_moved_through_is_an_error():
    """All of both skins is prescribed, so that nothing can give way."""
    with pytest.raises((CaseError, NotConvergedError)):
        list(march(problem_of(block_over_plate(), Rigid(group="plate"), Rigid(group="block", uy=-3.0))))


@pytest.mark.rows("1")
@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.slow), 5])
def test_a_block_that_is_thrown_at_a_thin_plate_comes_back(count):
    """Any number of steps: the plate stops it, and gives it nearly the same impulse, that of 200 steps: 4.72."""
    held = Rigid(group="plate"), fix("slave", "x"), fix("lid", "x")
    thrown = Initial(groups=["block"], vy=-10.0), Dynamics(), Steps(end=0.2, count=count)
    *_, state = march(problem_of(block_over_plate(), *held, *thrown))
    assert state.step.motion.impulse[0, 1] == pytest.approx(4.72, rel=0.03)
    assert state.step.motion.energies[:2].sum() == pytest.approx(12.5, rel=0.06)
