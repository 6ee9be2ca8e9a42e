"""Bodies that contact alone holds: sets of contact that change on the way to the answer, and motions that stay free.

The cases in `hard/` are small: a chain of blocks and blocks on soft springs, which contact stacks on one another, and a
block that stands on the top of a hump, on one macro-element.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array

import lacsolver.equilibrium.attempt
from benchmarks.common import blocks
from benchmarks.contact import pressed as pressed_blocks
from lacmesh.errors import DataError, LacmeshWarning
from lacsolver.case import BodyForce, Displacement, Force, Gravity, Material, Rigid, Spring, Steps, parse_case
from lacsolver.equilibrium.attempt import first_iterate
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.state import CONTACT, OPEN
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.problem.problem import Problem
from lacsolver.problem.rigid_modes import describe, free_motions, still_free
from lacsolver.saddle.coarse_start import coarse_start
from lacsolver.saddle.tolerances import ConvergenceTolerance
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PLANE_MODELS, cube
from tests.lacsolver.contact_cases import (
    POISSON,
    YOUNG,
    by_node,
    checked,
    load,
    nodes_of,
    only,
    resultant,
    solve,
    total,
)
from tests.lacsolver.held import held, joined, moved, nodes_in, two, with_sides
from tests.lacsolver.patch_meshes import placed, stack, three_blocks
from tests.problems import ELASTIC, case_of, contact, fix, move
from tests.samples import each_option
from verification.meshes.stacks import tilt

HARD = Path(__file__).parent / "hard"
INITIAL = pytest.mark.parametrize("initial", ["gap", "all", "none"])
GROUND = fix("bottom", "xyz")


def at(place, axes):
    """No displacement of the node at a place along some axes."""
    return Displacement(at=list(place), **{f"u{axis}": 0.0 for axis in axes})


#: what keeps the upper block from sliding and turning about the height, and nothing more
UPRIGHT = at([0.0, 0.0, 2.0], "xy"), at([1.0, 0.0, 2.0], "y")
#: three squares of side 1/4 at heights of their own; the rest is far below
FEET = {(0.125, 0.125): 0.0, (0.875, 0.375): 1e-3, (0.375, 0.875): 2e-3}
CLEARANCE = (
    "0 if x < 0.25 and y < 0.25 else 1e-3 if x > 0.75 and 0.25 < y < 0.5 "
    "else 2e-3 if 0.25 < x < 0.5 and y > 0.75 else 0.1"
)


def on_three_feet(initial, weight, *more):
    mesh = stack("HEXA8", "TETRA4", 3, counts=(4, 3), even=True)
    joint = contact(initial=initial, clearance=CLEARANCE)
    return only(mesh, joint, GROUND, *UPRIGHT, BodyForce(groups=["upper"], fz=-weight), *more)


@INITIAL
@pytest.mark.parametrize("force", [1e-2, 1e-5])
def test_a_body_settles_on_three_feet(initial, force):
    """It falls, tilts, and comes to rest; each foot bears what statics says, and it stands as a rigid body does."""
    problem, state = on_three_feet(initial, force)
    (zone,) = state.zones
    on, feet = zone.status == CONTACT, np.array(list(FEET))
    forces = (zone.pressure * zone.area)[on]
    found = {tuple(np.round(c[:2], 9)): p for c, p in zip(zone.centre[on], forces, strict=True)}
    share = np.linalg.solve(np.vstack([feet.T, np.ones(3)]), [0.5, 0.5, 1.0])
    assert found == pytest.approx({foot: force * s for foot, s in zip(FEET, share, strict=True)}, rel=1e-9)
    assert resultant(zone, problem)[2] == pytest.approx(-force, rel=1e-10)
    plane = np.linalg.solve(np.column_stack([feet, np.ones(3)]), [-g for g in FEET.values()])
    for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)):
        node = np.abs(problem.space.mesh.points - [x, y, 2]).max(axis=1).argmin()
        assert by_node(problem, state)[node, 2] == pytest.approx(plane @ [x, y, 1], abs=1e-3 * force / 1e-2)


@INITIAL
def test_a_body_that_would_tip_over_is_said_to(initial):
    """Its load stands outside of its feet: there is no equilibrium, and no wrong answer."""
    with pytest.raises(NotConvergedError, match="no equilibrium"):
        on_three_feet(initial, 1e-2, Force(at=[0.0, 1.0, 2.0], fz=-0.1), Steps(max_halvings=1))


@pytest.mark.parametrize(
    "records, error, words",
    [
        ((*UPRIGHT, load("top", -1.0)), NotConvergedError, "'upper' moves along z, and no contact stops it"),
        ((load("top", 1.0),), DataError, "'upper' moves along"),
    ],
)
def test_a_body_that_contact_cannot_hold_is_said_to(records, error, words):
    with pytest.raises(error, match=words):
        only(stack("HEXA8", "TETRA4", 3), contact(), GROUND, *records, Steps(max_halvings=1))


@INITIAL
def test_three_blocks_stand_on_one_another_by_contact_alone(initial):
    """Two bodies that nothing else holds along the height, both free to tilt."""
    mesh, upright = three_blocks(), []
    joints = [contact(name=f"zone{k}", slave=f"slave{k}", master=f"master{k}", initial=initial) for k in (1, 2)]
    for k in (1, 2):
        left, right = (
            next(p for p in mesh.points.tolist() if p[:2] == [x, 0.0] and k + 0.1 < p[2] < k + 0.9) for x in (0.0, 1.0)
        )
        upright += [at(left, "xy"), at(right, "y")]
    _, state = only(mesh, *joints, *upright, GROUND, load("top", "1 + x - y / 2"))
    for zone in state.zones:
        assert total(zone) == pytest.approx(1.25, rel=1e-10)
        middle = (zone.pressure * zone.area) @ zone.centre[:, :2] / 1.25
        np.testing.assert_allclose(middle, [(1 / 2 + 1 / 3 - 1 / 8) / 1.25, (1 / 2 + 1 / 4 - 1 / 6) / 1.25], rtol=1e-9)


# ---- a beam 10 long and 1/2 high on a foundation as long and as high

HEAVY = {"material": Material(young=YOUNG, poisson=POISSON, density=0.002), "model": "plane_strain"}
LAID = fix("bottom", "xy"), Gravity(gy="-9.81")


def beam(slave="QUAD4", master="QUAD8"):
    mesh = placed(stack(slave, master, 2, counts=(20, 16), even=True), size=(10.0, 0.5, 1.0))
    node = np.flatnonzero(np.abs(mesh.points - [10.0, 1.0, 0.0]).max(axis=1) < 1e-9)
    return replace(mesh, node_groups={"end": node})


@pytest.mark.rows("TRIA6-QUAD4")
@pytest.mark.parametrize("slave, master", [("QUAD4", "QUAD8"), ("TRIA6", "QUAD4")])
def test_a_beam_on_a_foundation_lifts_its_ends(slave, master):
    """Pressed in the middle by a hundred times its weight: contact shrinks to the middle, by several sets.

    The status at the start does not change the answer.
    """
    press, found = (*LAID, at([5.0, 1.0], "x"), Force(at=[5.0, 1.0], fy=-5.0)), []
    for initial in ("gap", "all", "none"):
        _, state = only(beam(slave, master), contact(initial=initial), *press, **HEAVY)
        (zone,) = state.zones
        order = np.argsort(zone.centre[:, 0])
        closed, p = zone.status[order] == CONTACT, zone.pressure[order]
        assert closed[len(closed) // 2] and (zone.status[order][~closed] == OPEN).all()
        assert 2 <= closed.sum() <= len(closed) / 3 and zone.gap.max() > 1e-3
        np.testing.assert_allclose(p, p[::-1], atol=1e-8 * p.max())
        assert total(zone) == pytest.approx(5.0 + 10 * 0.5 * 0.002 * 9.81, rel=1e-10)
        assert state.iterations >= 4
        found.append(state)
    for state in found[1:]:
        np.testing.assert_allclose(state.u, found[0].u, atol=1e-10 * np.abs(found[0].u).max())
        np.testing.assert_allclose(state.zones[0].pressure, found[0].zones[0].pressure, atol=1e-9)


def test_a_beam_is_lifted_at_one_end_and_laid_down_again():
    """Its own weight keeps the rest of it on the foundation: contact goes from one end, and comes back."""
    lifted = move("end", uy=[[0, 0], [1, 0.1], [2, 0]]), at([0.0, 1.0], "x"), Steps(end=2.0, count=8)
    _, states = solve(beam(), contact(), *LAID, *lifted, **HEAVY)
    counts = []
    for state in states:
        (zone,) = state.zones
        closed = zone.status[np.argsort(zone.centre[:, 0])] == CONTACT
        assert (np.diff(closed.astype(int)) == 1).sum() <= 1, "one stretch"
        counts.append(closed.sum())
    assert counts[:4] == sorted(counts[:4], reverse=True) and counts[3:] == sorted(counts[3:])
    assert counts[3] < counts[0] < counts[7] == len(closed)
    for up, down in ((0, 6), (1, 5), (2, 4)):
        np.testing.assert_allclose(states[up].u, states[down].u, atol=1e-11)


# ---- models that are hard to solve though they have an answer


def states_of(name, change=lambda text: text):
    """(problem, states) of a case in `hard/`, each state checked.

    The gap is that between faces, as the cases were found with: where it is linear it is closed to rounding at once.
    """
    path = HARD / f"{name}.toml"
    text = path.read_text(encoding="utf-8").replace("[[contact]]", '[[contact]]\nsurface = "faces"')
    return checked(Problem.of(parse_case(change(text), path)))


@pytest.mark.parametrize("stiffness", ["1e-3", "1e-6", "1e-9"])
def test_a_chain_of_blocks_on_soft_springs(stiffness):
    """The step that leaves blocks loose is not taken: all is closed within a few sets, however soft the springs are."""
    _, (state,) = states_of("chain", lambda text: text.replace("= 1e-3", f"= {stiffness}"))
    assert state.iterations <= 5 and state.halvings == 0
    for zone in state.zones:
        assert (zone.status == CONTACT).all()
        assert zone.pressure @ (zone.area * zone.coverage) == pytest.approx(1.7072, rel=1e-9)


@pytest.mark.parametrize(("number", "tolerance"), each_option(itertools.product((1, 2, 3), ("1e-6", "1e-10", "1e-14"))))
def test_blocks_on_soft_springs(number, tolerance):
    """Gaps close to rounding, whatever the tolerance: the noise of forces in balance does not move soft bodies."""
    _, states = states_of(f"soft_springs_{number}", lambda text: f"{text}\n[solver]\ntolerance = {tolerance}\n")
    assert sum(state.halvings for state in states) == 0
    assert max(state.iterations for state in states) <= 12


ROCKING = ("small_all", "small_v0.0005", "finite_all", "finite_count")


@pytest.mark.rows("small_v0.0005-slave")
@pytest.mark.parametrize(("case", "normals"), [*((case, "slave") for case in ROCKING), ("finite_count", "facet")])
def test_a_block_that_rocks_on_one_macro_element(case, normals):
    """The contact force, which turns with its skin, rights the block: no second macro-element has to hold it.

    The master's direction keeps a block upright that starts so.
    """
    _, states = states_of(
        f"rocking_{case}", lambda text: text.replace("[[contact]]", f'[[contact]]\nnormals = "{normals}"')
    )
    assert all(state.halvings == 0 and state.iterations <= 20 for state in states)
    assert all((state.zones[0].status == CONTACT).sum() == 1 for state in states)


#: of the hump's facets: their length, and the difference of the mean gaps of the middle one and the next
FACET, NEXT_GAP = 1.3 / 7, 0.00086217 - 0.00017245


@pytest.mark.rows("small_v0.0005-0.0001-2000.0", "finite_all-0.02-2e4")
@pytest.mark.parametrize(
    ("case", "eccentricity", "young"),
    [
        *itertools.product(("small_all", "small_v0.0005"), (1e-4, 0.02, -0.02), ("2000.0",)),
        *itertools.product(("finite_all",), (0.0, 0.02, -0.02), ("2000.0",)),
        ("small_all", -1e-5, "2000.0"),  # it tilts over the other side
        ("finite_all", 0.02, "2e4"),
    ],
)
def test_a_block_that_tilts_until_the_next_macro_element_holds_it(case, eccentricity, young):
    """A force in the master's direction does not right the block: it tilts onto the next facet, which takes the moment.

    Statics: the force on that facet, of all, is the arm of the load over the length of a facet: its eccentricity, and
    with finite rotations the motion of the foot under the head.
    """

    def change(text):
        value = re.search(r"value = (.*)", text)[1]
        pressed = f'"{value} * (1 + {eccentricity} / 0.65 ** 2 * 3 * (x - 0.95))"'
        text = text.replace(f"value = {value}", f"value = {pressed}").replace("2000.0", young)
        return text + "\n[solver]\ntolerance = 1e-9\n"

    problem, states = states_of(f"rocking_{case}", change)
    assert all(state.halvings == 0 and state.iterations <= 20 for state in states)
    zone = states[-1].zones[0]
    assert set(np.flatnonzero(zone.status == CONTACT)) ^ {3} in ({2}, {4})
    u, x = by_node(problem, states[-1]), problem.space.mesh.points
    slave = problem.joints[0].zone.slave.faces.distinct_nodes
    assert abs(np.polyfit(x[slave, 0], u[slave, 1], 1)[0]) == pytest.approx(NEXT_GAP / FACET, rel=0.01)
    arm = eccentricity - (u[slave, 0].mean() - u[nodes_of(problem, "up.y1"), 0].mean()) * ("finite" in case)
    force = zone.pressure * zone.area
    assert force @ (np.arange(7) - 3) / force.sum() == pytest.approx(arm / FACET, rel=0.02, abs=1e-4)


def pressures(mesh, size, geometry="reference"):
    """The pressures under a load that is not uniform, of it; springs alone hold the upper block upright."""
    upright = Spring(group="upper", kx=1.0, ky=1.0, kz=1.0), load("top", f"{size} * (1 + x ** 2)")
    case = case_of(mesh, ELASTIC, contact(geometry=geometry), GROUND, *upright, model="3d")
    (state,) = march(Problem.of(case))
    return state.zones[0].pressure / size


@pytest.mark.parametrize("size", [1e-9, 1e-15, 1e-20, 1e-60])
def test_pressures_go_with_the_load(size):
    mesh = stack("HEXA8", "TETRA4", 3)
    usual = pressures(mesh, 1.0)
    assert usual.max() > 1
    np.testing.assert_allclose(pressures(mesh, size), usual, rtol=1e-9)


@pytest.mark.parametrize("geometry, turn", [("current", None), ("reference", tilt(3))])
def test_displacements_below_the_rounding_of_gaps_are_warned_of(geometry, turn):
    mesh = placed(stack("HEXA8", "TETRA4", 3), turn)
    with pytest.warns(LacmeshWarning, match="the largest displacement is .* pressures may be wrong by [0-9]+%") as told:
        pressures(mesh, 1e-13, geometry)
    assert ("reference" in str(told[0].message)) == (geometry == "current")


# ---- motions that nothing but contact and ties constrains, and those left free


def normal_rows(mesh, model="3d"):
    """B of two flat faces that meet node to node: the normal displacement of each slave node against its master."""
    space, (low, high) = Space.of(mesh, model), (mesh.node_groups[name] for name in ("low", "high"))
    rows, s = np.zeros((len(low), space.n_dof)), space.dim - 1
    rows[np.arange(len(low)), space.dim * low + s] = 0.1
    rows[np.arange(len(low)), space.dim * high + s] = -0.1
    return csr_array(rows)


def left_free(mesh, rows=None, model="3d", **records):
    """Motions that are free but for contact, and those that contact rows leave."""
    motions = free_motions(*held(mesh, model, **records))
    return motions, still_free(normal_rows(mesh, model) if rows is None else csr_array(rows), motions)


def names(motions):
    return [describe(motion) for motion in motions]


CLAMP = Displacement(group="z0", ux=0, uy=0, uz=0)


@pytest.mark.parametrize("gap", [0.0, 0.5])
def test_a_block_on_another_may_slide(gap):
    """So it may on a rigid one; small areas do not hold it less."""
    mesh = two(gap=gap)
    slides = [
        "'b' moves along x",
        "'b' moves along y",
        f"'b' turns about an axis along z through (0.5, 0.5, {1.5 + gap:g})",
    ]
    motions, left = left_free(mesh, displacement=[CLAMP])
    assert names(left) == slides
    for motion in left:
        np.testing.assert_allclose(normal_rows(mesh) @ motion.field, 0, atol=1e-14)
    assert len(still_free(1e-12 * normal_rows(mesh), motions)) == 3
    _, left = left_free(mesh, rigid=[Rigid(group="a")])
    assert names(left) == slides and set(left[0].nodes) == set(nodes_in(mesh, "b"))


@pytest.mark.parametrize("model", PLANE_MODELS)
def test_a_block_on_another_in_a_plane(model):
    _, left = left_free(two(model), model=model, displacement=[Displacement(group="y0", ux=0, uy=0)])
    assert names(left) == ([] if model == "axisymmetric" else ["'b' moves along x"])


def test_two_floating_bodies_in_contact():
    """Together they have the six motions of one body, and slide on one another: nine."""
    mesh = two(gap=0.0)
    motions, left = left_free(mesh)
    turning = [f"'a' and 'b' turn about an axis along {axis} through (0.5, 0.5, 0.5)" for axis in "xy"]
    slides = [
        f"'{name}' {way}"
        for name, z in (("a", 0.5), ("b", 1.5))
        for way in ("moves along x", "moves along y", f"turns about an axis along z through (0.5, 0.5, {z})")
    ]
    assert len(motions) == 12 and names(left) == [*slides, "'a' and 'b' move along z", *turning]
    R = np.array([motion.field for motion in left]).T
    assert np.linalg.matrix_rank(R) == 9
    np.testing.assert_allclose(normal_rows(mesh) @ R, 0, atol=1e-13)


def test_bodies_that_contact_does_not_couple_are_named_apart():
    """A row holds one of them, or couples them with one sign: one goes forth as the other goes back, twice as far."""
    mesh = with_sides(joined(cube("HEXA8", 1), moved(cube("HEXA8", 1), shift=(9, 0, 0))))
    rows = np.zeros((2, 48))
    rows[0, 0] = 1.0
    motions, left = left_free(mesh, rows, displacement=[Displacement(group="z0", uy=0, uz=0)])
    assert names(motions) == ["'a' moves along x", "'b' moves along x"] and names(left) == ["'b' moves along x"]
    assert still_free(csr_array((0, 48)), motions)[0].field.tolist() == motions[0].field.tolist()
    assert still_free(csr_array(rows), ()) == ()
    rows[0, [0, 24]] = 2.0, 1.0
    (motion,) = still_free(csr_array(rows[:1]), motions)
    assert describe(motion) == "'a' moves along x while 'b' moves along -x"
    np.testing.assert_allclose(rows @ motion.field, 0, atol=1e-14)
    assert np.abs(motion.field).max() == 1.0


# ---- the first active set, from the first coarser level

TOLERANCE = ConvergenceTolerance(1e-10, 50, 0.0)


@pytest.fixture(scope="module")
def hertz():
    """A block with a clearance of r^2 / 2R over another one, before its step: the problem, and the step."""
    problem = pressed_blocks(blocks(14, 11, 7), "multigrid")
    return problem, LoadStep(ReducedProblem(problem), 1.0)


def test_the_first_set_is_near_the_last_and_the_state_is_the_same(hertz, monkeypatch):
    problem, step = hertz
    start = first_iterate(step)
    assert not start.active.any()
    near = coarse_start(step.reference, step.f, step.contact(start.q), start, TOLERANCE)
    *_, state = march(problem)
    closed = state.zones[0].status == 1
    assert (near.active != closed).sum() < 0.35 * closed.sum()
    assert np.linalg.norm(near.q - state.step.iterate.q) < 0.2 * np.linalg.norm(state.step.iterate.q)
    monkeypatch.setattr(lacsolver.equilibrium.attempt, "coarse_start", lambda K, f, contact, start, tolerance: start)
    *_, other = march(problem)
    assert np.array_equal(other.zones[0].status, state.zones[0].status)
    p = state.zones[0].pressure
    np.testing.assert_allclose(other.zones[0].pressure, p, atol=1e-8 * p.max())
    assert state.iterations <= other.iterations
