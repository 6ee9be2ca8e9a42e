"""Skins that would go through their master in one step: found, computed in smaller steps, or an error; what only flies
past is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.generate.parts import assembled
from lacsolver.case import CaseError, parse_case
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.problem.passing import passing
from lacsolver.problem.problem import Problem
from verification.meshes.blocks import block, joined

#: of the plate, and of the gap above it
THICK, GAP = 0.2, 0.5


def box(dim, low, high, names):
    """A box of QUAD4 or HEXA8 a quarter wide, with a group for its cells and some of its sides."""
    kind = {2: "QUAD4", 3: "HEXA8"}[dim]
    low, high = ((a,) * (dim - 1) + (b,) for a, b in (low, high))
    counts = [max(1, round((b - a) / 0.25)) for a, b in zip(low, high, strict=True)]
    made = block(kind, counts, low, high)
    up = "xyz"[dim - 1]
    return made, {"": names["body"], f"{up}0": names.get("low", ""), f"{up}1": names.get("high", "")}


def block_over_plate(dim, wall=False, name="slave", other="master"):
    """A block of side 1/2, its lower side `slave`, over a plate 2 wide and 0.2 thick, or over a skin with no body."""
    block = box(dim, (-0.25, GAP), (0.25, GAP + 0.5), {"body": "block", "low": name, "high": "top"})
    if not wall:
        plate = box(dim, (-1, -THICK), (1, 0), {"body": "plate", "low": "under", "high": other})
        return joined([block, plate])
    kind, corners = ("SEG2", [[1, 0], [-1, 0]]) if dim == 2 else ("QUAD4", [[-1, -1], [1, -1], [1, 1], [-1, 1]])
    x = np.zeros((len(corners), 3))
    x[:, : dim - 1] = np.array(corners)[:, : dim - 1]
    skin = assembled(x, {(kind, other): np.arange(len(x))[None]}, dim)
    return joined([block, (skin, {other: other})])


def case(dim, more="", contact="", slave="slave", master="master", kinematics="small"):
    law = 'law = "neo_hookean"\n' if kinematics == "finite" else ""
    return parse_case(
        f'mesh = "m.msh"\nmodel = "{ {2: "plane_strain", 3: "3d"}[dim] }"\nkinematics = "{kinematics}"\n'
        f"[[material]]\n{law}young = 1000.0\npoisson = 0.3\ndensity = 1.0\n"
        f'[[contact]]\nname = "c"\nslave = "{slave}"\nmaster = "{master}"\ngeometry = "current"\n{contact}\n{more}'
    )


def passes(problem, first, last, nodes="block"):
    """Return what `passing` finds as the block moves by `first` at the start of a step, and by `last` at its end."""
    space, (joint,) = problem.space, problem.joints
    u0, u1 = np.zeros((2, space.mesh.n_nodes, space.dim))
    mesh = space.mesh
    at = np.unique(np.concatenate([found.ravel() for _, _, found in mesh.select(mesh.cells_of(nodes))]))
    u0[at], u1[at] = first, last
    face = joint.integrate(space, u1.ravel(), 1.0)
    return passing(joint, face, space.places(u0.ravel()), 1.0, space)


WALL = '[[rigid]]\ngroup = "master"\n'


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("wall", [False, True])
@pytest.mark.parametrize("swapped", [False, True])
def test_what_passes_a_skin_and_what_does_not(dim, wall, swapped):
    """Found from any height and any side; not found where it only approaches, flies past, over or away, or slides."""
    if wall and swapped:
        return  # a skin with no body is no slave
    pair = {"slave": "master", "master": "slave"} if swapped else {}
    made = case(dim, "" if not wall else WALL, "search_distance = 0.3", **pair)
    problem = Problem.of(made, block_over_plate(dim, wall))

    def by(first, last):
        return passes(problem, (first[0], *[0.0] * (dim - 2), first[1]), (last[0], *[0.0] * (dim - 2), last[1]))

    # as deep as a corner is: the whole thickness, or the depth that is looked to
    assert by((0, 0), (0, -3)).depth.max() == pytest.approx(2.5)
    assert by((0, 0), (0, -GAP - 0.31)) is not None
    assert by((0, 0), (0.6, -2)) is not None
    assert by((-20, 20), (20, -21)) is not None  # from afar, at an angle
    assert by((0, -GAP - 0.01), (0, -2)) is not None  # it pressed before
    assert by((0, 0), (0, -GAP + 0.01)) is None  # it stays apart
    assert by((0, 0), (0, -GAP - 0.05)) is None  # the pairing sees that
    assert by((0, 0), (0, 3)) is None
    assert by((3, 0), (3, -3)) is None  # beside the plate
    assert by((-5, 1), (5, -0.4)) is None  # over it
    assert by((0, -GAP), (9, -GAP)) is None
    assert by((0, -GAP), (9, -GAP - 1)) is not None  # at first over the plate
    assert by((0, -3), (0, -5)) is None  # it was below, and goes on
    assert by((0, -3), (0, 0)) is None  # from behind


def test_bodies_that_move_together_pass_nothing():
    """Only the motion of one skin as the other one sees it counts."""
    problem = Problem.of(case(2), block_over_plate(2))
    space, (joint,) = problem.space, problem.joints
    for far in (1.0, 1e3):
        u = np.tile([far, -far], space.mesh.n_nodes)
        assert passing(joint, joint.integrate(space, u, 1.0), space.places(0 * u), 1.0, space) is None
        u[1::2] -= 3 * (space.mesh.points[:, 1] > GAP / 2)
        assert passing(
            joint, joint.integrate(space, u, 1.0), space.places(0 * u), 1.0, space
        ).depth.max() == pytest.approx(2.5)


def test_a_small_body_passes_between_the_nodes_of_a_large_face():
    """Corners, edges and centres of both skins are looked at."""
    block = box(2, (-0.05, GAP), (0.05, GAP + 0.1), {"body": "block", "low": "slave"})
    face = assembled(np.array([[10.3, 0, 0], [-9.0, 0, 0]]), {("SEG2", "master"): np.array([[0, 1]])}, 2)
    mesh = joined([block, (face, {"master": "master"})])
    problem = Problem.of(case(2, WALL, "search_distance = 0.1"), mesh)
    assert passes(problem, (0.0, 0.0), (0.0, -1.0)) is not None
    big = box(2, (-4, -THICK), (4, 0), {"body": "plate", "high": "slave"})
    one = Mesh.create([[0.31, GAP], [0.39, GAP], [0.35, GAP + 0.1]], [("TRIA3", [[0, 1, 2]]), ("SEG2", [[0, 1]])],
                      cell_groups={"block": [0], "master": [1]}, space_dim=2)  # fmt: skip
    problem = Problem.of(
        case(2, "", "search_distance = 0.1"), joined([(one, {"block": "block", "master": "master"}), big])
    )
    assert passes(problem, (0.0, 0.0), (0.0, -1.0)) is not None


def test_a_clearance_moves_the_skins_apart():
    """Contact that a large clearance takes away may be passed; with a small one the depth is what is left."""
    mesh = block_over_plate(2)
    assert passes(Problem.of(case(2, "", "clearance = 100.0"), mesh), (0, 0), (0, -3)) is None
    found = passes(Problem.of(case(2, "", 'clearance = "0.4 * t"'), mesh), (0, 0), (0, -3))
    assert found.depth.max() == pytest.approx(2.1)


HELD = '[[displacement]]\ngroup = "under"\n' + "".join(f"u{a} = 0.0\n" for a in "xy")


def pushed(down, steps):
    """A block whose top moves down by a distance, with the plate held."""
    return f'{HELD}[[displacement]]\ngroup = "top"\nux = 0.0\nuy = {-down}\n{steps}'


@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_block_that_is_pushed_through_is_an_error_that_says_so(kinematics):
    """Statics: one step takes it to the other side of the plate, where it finds no master."""
    steps = "[steps]\nend = 1.0\ncount = 1\nmax_halvings = 0\n"
    made = case(2, pushed(10.0, steps), "search_distance = 0.3", kinematics=kinematics)
    with pytest.raises(NotConvergedError, match=r"'c': in the step to time 1 \d faces of slave 'slave' pass through"):
        list(march(Problem.of(made, block_over_plate(2))))


def test_a_block_that_is_pushed_far_is_stopped_in_smaller_steps():
    """One step, whose end is beyond the plate: the contact is found on the way, and holds to the end."""
    steps = "[steps]\nend = 1.0\ncount = 1\n"
    made = case(2, pushed(GAP + 0.35, steps), "search_distance = 0.2")
    *_, state = march(Problem.of(made, block_over_plate(2)))
    assert (state.zones[0].pressure > 100).all()
    fine = case(2, pushed(GAP + 0.35, "[steps]\nend = 1.0\ncount = 16\n"), "search_distance = 0.2")
    *_, other = march(Problem.of(fine, block_over_plate(2)))
    assert state.zones[0].pressure == pytest.approx(other.zones[0].pressure, rel=1e-6)


def test_a_rigid_body_that_is_moved_through_is_an_error():
    """All of both skins is prescribed, so that nothing can give way."""
    rigid = "".join(f'[[rigid]]\ngroup = "{g}"\n' for g in ("plate",))
    moved = '[[rigid]]\ngroup = "block"\nuy = -3.0\n[steps]\nend = 1.0\ncount = 1\n'
    with pytest.raises((CaseError, NotConvergedError)):
        list(march(Problem.of(case(2, rigid + moved), block_over_plate(2))))


@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.slow), 5])
def test_a_block_that_is_thrown_at_a_thin_plate_comes_back(count):
    """Any number of steps: the plate stops it, and gives it nearly the same impulse, that of 200 steps: 4.72."""
    motion = f'[[initial]]\ngroups = ["block"]\nvy = -10.0\n[dynamics]\n[steps]\nend = 0.2\ncount = {count}\n'
    sides = "".join(f'[[displacement]]\ngroup = "{g}"\nux = 0.0\n' for g in ("slave", "top"))
    made = case(2, '[[rigid]]\ngroup = "plate"\n' + sides + motion, "search_distance = 0.3")
    *_, state = march(Problem.of(made, block_over_plate(2)))
    assert state.step.motion.impulse[0, 1] == pytest.approx(4.72, rel=0.03)
    assert state.step.motion.energies[:2].sum() == pytest.approx(12.5, rel=0.06)


def test_what_lies_between_two_plates_of_one_master_has_passed_the_first():
    """The second plate is in front of it, and open: the pairing sees nothing of the first one."""
    block = box(2, (-0.25, GAP), (0.25, GAP + 0.5), {"body": "block", "low": "slave"})
    plates = [box(2, (-1, y - 0.1), (1, y), {"body": "plates", "high": "master"}) for y in (0.0, -1.0)]
    problem = Problem.of(case(2, "", "search_distance = 0.4"), joined([block, *plates]))
    assert passes(problem, (0, 0), (0, -GAP - 0.7)) is not None
    assert passes(problem, (0, -GAP - 0.6), (0, -GAP - 0.9)) is None


def test_a_ball_that_is_thrown_through_a_wall_in_axisymmetry():
    """The radius counts as a coordinate: a ring falls past the edge of a plate, a smaller one through it."""

    def at(radius):
        ring = block("QUAD4", (2, 2), (radius, GAP), (radius + 0.5, 1))
        plate = block("QUAD4", (4, 1), (0.5, -THICK), (1.5, 0))
        mesh = joined([(ring, {"": "block", "y0": "slave"}), (plate, {"": "plate", "y1": "master"})])
        made = case(2, "", "search_distance = 0.3")
        return Problem.of(replace(made, model="axisymmetric"), mesh)

    assert passes(at(1.0), (0, 0), (0, -3)) is not None
    assert passes(at(1.6), (0, 0), (0, -3)) is None
