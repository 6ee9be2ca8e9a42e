"""Skins that would go through their master in one step: found, computed in smaller steps, or an error.

Skins that only fly past are left alone.
"""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import join
from lacmesh.generate import box, line, rectangle
from lacmesh.generate.parts import assembled
from lacsolver.case import CaseError, Dynamics, Initial, Material, Rigid, Steps
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.problem.passing import passing
from lacsolver.problem.problem import Problem
from tests.problems import case_of, contact, fix, move

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
    for first, last in (
        ((0, 0), (0, -GAP - 0.31)),
        ((0, 0), (0.6, -2)),
        ((-20, 20), (20, -21)),  # from afar, at an angle
        ((0, -GAP - 0.01), (0, -2)),  # it pressed before
        ((0, -GAP), (9, -GAP - 1)),  # at first over the plate
    ):
        assert by(first, last) is not None, (first, last)
    for first, last in (
        ((0, 0), (0, -GAP + 0.01)),  # it stays apart
        ((0, 0), (0, -GAP - 0.05)),  # the pairing sees that
        ((0, 0), (0, 3)),
        ((3, 0), (3, -3)),  # beside the plate
        ((-5, 1), (5, -0.4)),  # over it
        ((0, -GAP), (9, -GAP)),
        ((0, -3), (0, -5)),  # it was below, and goes on
        ((0, -3), (0, 0)),  # from behind
    ):
        assert by(first, last) is None, (first, last)


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


def test_a_block_that_is_pushed_far_is_stopped_in_smaller_steps():
    """One step, whose end is beyond the plate: the contact is found on the way, and holds to the end."""
    one, fine = (pushed(GAP + 0.35, search_distance=0.2, count=count)[-1].zones[0].pressure for count in (1, 16))
    assert (one > 100).all() and one == pytest.approx(fine, rel=1e-6)


def test_a_rigid_body_that_is_moved_through_is_an_error():
    """All of both skins is prescribed, so that nothing can give way."""
    with pytest.raises((CaseError, NotConvergedError)):
        list(march(problem_of(block_over_plate(), Rigid(group="plate"), Rigid(group="block", uy=-3.0))))


@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.slow), 5])
def test_a_block_that_is_thrown_at_a_thin_plate_comes_back(count):
    """Any number of steps: the plate stops it, and gives it nearly the same impulse, that of 200 steps: 4.72."""
    held = Rigid(group="plate"), fix("slave", "x"), fix("lid", "x")
    thrown = Initial(groups=["block"], vy=-10.0), Dynamics(), Steps(end=0.2, count=count)
    *_, state = march(problem_of(block_over_plate(), *held, *thrown))
    assert state.step.motion.impulse[0, 1] == pytest.approx(4.72, rel=0.03)
    assert state.step.motion.energies[:2].sum() == pytest.approx(12.5, rel=0.06)
