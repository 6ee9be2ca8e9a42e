"""Friction of blocks: exact patches, pads that stick and slide, the ledger of work, files, and what is said of it."""

from __future__ import annotations

import csv
import itertools
import json
import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lacsolver as ls
from lacmesh import read
from lacmesh.errors import LacmeshWarning
from lacmesh.generate import rectangle
from lacmesh.generate import stack as stacked
from lacsolver.case import BodyForce, CaseError, Dynamics, Gravity, Initial, Material, Rigid, Spring, Steps
from lacsolver.equilibrium.alternating import alternating
from lacsolver.equilibrium.motion import ENERGIES
from lacsolver.equilibrium.search import Outcome
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import create_output, read_state
from lacsolver.output.tables import CONTACT_COLUMNS, contact_columns
from lacsolver.problem.problem import Problem
from lacsolver.saddle.contact_system import contact_system
from lacsolver.validation import validate
from tests.lacsolver.contact_cases import load, nodes_of, total
from tests.lacsolver.patch_meshes import stack
from tests.problems import ELASTIC, case_of, contact, fix, move
from tests.samples import each_option
from verification.families import friction_blocks, friction_moving
from verification.meshes.blocks import block, joined
from verification.meshes.friction import ring_on_hub

# few steps leave over much of the energy that friction takes, as they should say
pytestmark = pytest.mark.filterwarnings("ignore:steps are too long for the energy")
MU = 0.3
RUBBER = Material(law="neo_hookean", young=1000.0, poisson=0.3)
GROUND = fix("bottom", "xy")


def rubs(**keys):
    """Contact `joint` with friction."""
    return contact(**{"name": "joint", "friction": MU} | keys)


def plane(mesh, *records, **keys):
    """A case in plane strain."""
    law = () if any(isinstance(one, Material) for one in records) else (ELASTIC,)
    return case_of(mesh, *law, *records, model="plane_strain", **keys)


def block_on_block(lower, upper, gap=0.0):
    """Two rectangles of QUAD4, each given by its left and right end, its height, and its numbers of cells."""
    parts = [rectangle((nx, ny), (b - a, high), corner=(a, 0)) for a, b, high, nx, ny in (lower, upper)]
    return stacked(*parts, gap=gap)


@cache
def rubbed(model, geometry="reference", count=4):
    """Blocks pressed and moved to and fro, so that some macro-elements stick and some slide."""
    dim, kinds = (3, ("HEXA8", "TETRA4")) if model == "3d" else (2, ("QUAD4", "TRIA3"))
    down = {"uy": "-0.03 * t"} if dim == 2 else {"uy": "0.01 * t", "uz": "-0.03 * t"}
    return case_of(
        stack(*kinds, dim, counts=(3, 2)), ELASTIC, rubs(friction=0.4, geometry=geometry), fix("bottom", "xyz"[:dim]),
        move("top", ux="0.03 * sin(4 * t)", **down), Steps(count=count), model=model,
    )  # fmt: skip


WAYS = [("plane_strain", "reference"), ("plane_strain", "current"), ("3d", "reference"), ("3d", "current")]


@cache
def joint(model, geometry="reference"):
    """The contact of these blocks in the end."""
    return ls.solve(rubbed(model, geometry)).contact["joint"]


# ---- problems of the verification at a small size


def meets_its_figures(outcome):
    return not outcome.failure and all(result.passed for result in outcome.results)


PATCHES = [
    *((2, *pair) for pair in (("TRIA3", "QUAD4"), ("QUAD4", "TRIA3"), ("QUAD8", "TRIA6"), ("QUAD9", "QUAD8"))),
    *((3, *pair) for pair in (("TETRA4", "HEXA8"), ("HEXA8", "TETRA4"), ("TETRA10", "HEXA20"), ("HEXA20", "TETRA10"))),
]


@pytest.mark.rows("(2, 'QUAD4', 'TRIA3')-True", "(3, 'TETRA4', 'HEXA8')-False")
@pytest.mark.parametrize(("pair", "slides"), each_option(itertools.product(PATCHES, (False, True))), ids=str)
def test_patch(pair, slides):
    """Two blocks that do not match, tilted, under pressure and shear, sticking or sliding, are exact; either role."""
    dim, *kinds = pair
    given = friction_blocks.Sheared((tuple(kinds),), dim, slides, tilted=True, skew=0.15)
    assert meets_its_figures(friction_blocks.solve_sheared(given, levels=1))


@pytest.mark.rows("False")
@pytest.mark.parametrize("below", [True, False])
def test_a_block_is_pulled_over_another(below):
    """1.2 of its length in 4 steps, either role: no step is halved, and T = mu N to round-off."""
    assert meets_its_figures(friction_moving.solve_dragged("QUAD4", below, levels=1))


def test_sticking_does_not_drift():
    """Three cycles of shear, all sticking: the bodies come back to round-off."""
    assert meets_its_figures(friction_moving.solve_cycled(("QUAD4", "TRIA3"), 2, 3, 4, levels=1))


# ---- sliding


@pytest.mark.parametrize("poisson", [0.0, 0.3])
@pytest.mark.parametrize(
    ("slave", "master", "d", "counts"),
    [("QUAD4", "QUAD4", 2, (1, 1)), ("HEXA8", "HEXA8", 3, (2, 1)), ("TRIA6", "QUAD8", 2, (4, 3))],
)
def test_a_body_that_friction_alone_holds_aside_is_pressed_straight_down(slave, master, d, counts, poisson):
    """Nothing pushes it aside: the forces that friction carries along that motion are round-off."""
    up, model = {2: ("y", "plane_strain"), 3: ("z", "3d")}[d]
    records = Material(young=1e3, poisson=poisson), rubs(), fix("bottom", "xyz"[:d]), move("top", **{f"u{up}": -0.01})
    case = case_of(stack(slave, master, d, counts=counts), *records, model=model)
    pressure = ls.solve(case).contact["joint"].pressure
    if poisson == 0:
        np.testing.assert_allclose(pressure, 5.0, rtol=1e-12)
    else:
        assert pressure.min() > 0 and abs(pressure.mean() - 5.4) < 0.4


@pytest.mark.slow
def test_a_thrown_block_stops():
    """It slides v^2 / (2 mu g), then sticks, and friction takes its energy, which the account has in every step."""
    speed, g = 2.0, 10.0
    records = Initial(groups=["upper"], vx=speed), Gravity(gy=-g), Dynamics(scheme="hht"), Steps(end=1.0, count=100)
    mesh = block_on_block((0, 4, 0.25, 16, 1), (0.4, 1.4, 0.5, 6, 3))
    case = plane(mesh, Material(young=1e5, poisson=0.0, density=1.0), rubs(), GROUND, *records)
    *_, state = march(Problem.of(case))
    (zone,), motion, top = state.zones, state.step.motion, mesh.points[:, 1] > 0.74
    assert state.u.reshape(-1, 2)[: len(top)][top, 0].mean() == pytest.approx(speed**2 / (2 * MU * g), rel=0.005)
    assert (zone.status == 1).all() and zone.friction.energy[1] == pytest.approx(0.5 * 0.5 * speed**2, rel=0.02)
    energies = dict(zip(ENERGIES, motion.energies, strict=True))
    assert abs(motion.account) < 1e-10 * np.abs(motion.energies).max() and state.step.work is None
    assert energies["friction"] == pytest.approx(zone.friction.energy[1], rel=1e-6)
    assert abs(energies["contact"]) < 0.05 * energies["friction"]


PULSE = load("top", [[0, 0], [1, 6.8], [2, 0], [3, 0], [4, 6.8]]), Steps(times=[1.0, 2.0, 3.0, 4.0])


@pytest.mark.rows("HEXA8-0.3-reference")
@pytest.mark.parametrize(
    ("cell", "poisson", "geometry"),
    [("TETRA4", 0.3, "current"), ("TETRA4", 0.0, "current"), ("HEXA8", 0.3, "reference")],
)
def test_a_block_held_by_friction_alone_stays_where_it_is_without_a_load(cell, poisson, geometry, recwarn):
    """All sticks, so that nothing is lost: pressed again it is as before, without a warning of small displacements."""
    records = Material(young=1000.0, poisson=poisson), rubs(friction=0.5, geometry=geometry), fix("bottom", "xyz")
    case = case_of(stack(cell, cell, 3, counts=(2, 1)), *records, *PULSE, model="3d")
    first, *unloaded, last = march(Problem.of(case))
    size = np.abs(first.u).max()
    assert (last.zones[0].status == 1).all() and not any(state.halvings for state in (first, *unloaded, last))
    for state in unloaded:
        np.testing.assert_allclose(state.u, 0, atol=1e-9 * size)
    np.testing.assert_allclose(last.u, first.u, atol=1e-6 * size)
    assert not [one for one in recwarn if "the largest displacement is" in str(one.message)]


@pytest.mark.rows("small")
@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_block_that_slips_as_it_is_pressed_stays_in_the_middle_without_a_load(kinematics):
    """It slides outwards and back by the same on all sides, as the model has two planes of symmetry."""
    boxes = ((0, 0, 0), (2, 2, 0.5)), ((0.5, 0.5, 0.5), (1.5, 1.5, 1.5))
    names = {"z0": "base", "z1": "master"}, {"z0": "slave", "z1": "top", "": "block"}
    mesh = joined([(block("HEXA8", (2, 2, 1), *box), own) for box, own in zip(boxes, names, strict=True)])
    law = ELASTIC if kinematics == "small" else RUBBER
    problem = Problem.of(
        case_of(mesh, law, rubs(friction=0.1), fix("base", "xyz"), *PULSE, model="3d", kinematics=kinematics)
    )
    for state in march(problem):
        moved = state.u.reshape(-1, 3)[nodes_of(problem, "block")]
        np.testing.assert_allclose(moved.mean(axis=0)[:2], 0, atol=1e-5 * 6.8e-3)


# ---- a pad that nothing but friction holds


def pad(part, **options):
    """A pad under its weight, that a part of mu N pushes along a plane; nothing else holds it."""
    mesh, weight = block_on_block((0, 4, 1, 12, 3), (1.0, 2.0, 0.5, 5, 3)), {"fx": MU * part * 2.0, "fy": -2.0}
    steps = Steps(**{"count": 1} | options.pop("steps", {}))
    return plane(mesh, rubs(**options), GROUND, BodyForce(groups=["upper"], **weight), steps)


def test_a_pad_sticks_below_the_bound():
    zone = ls.solve(pad(0.99)).contact["joint"]
    assert (zone.shear[:, 0] @ zone.area) / total(zone) == pytest.approx(0.99 * MU, rel=1e-9)
    assert (zone.status == 1).any()


def pushed_in_space(fx, fy):
    records = rubs(), fix("bottom", "xyz"), BodyForce(groups=["upper"], fx=MU * fx, fy=MU * fy, fz=-1.0)
    return case_of(
        stack("HEXA8", "HEXA8", 3, counts=(3, 2)), ELASTIC, *records, Steps(count=1, max_halvings=2), model="3d"
    )


@pytest.mark.rows("<lambda>-1.5")
@pytest.mark.parametrize(
    ("made", "asked"),
    [
        (lambda: pad(1.01, steps={"max_halvings": 0}), 1.01),
        (lambda: pushed_in_space(1.01, 0.0), 1.01),
        (lambda: pushed_in_space(0.9, 1.2), 1.5),
    ],
)
def test_a_block_slides_away_above_the_bound(made, asked):
    """The loop stops where the block is so far away that round-off hides what friction does not carry."""
    with pytest.raises(NotConvergedError, match=r"'upper' slides along x: friction of 'joint' carries 0.300") as caught:
        ls.solve(made())
    found = float(str(caught.value).split(" is needed")[0].split()[-1])
    assert found == pytest.approx(MU * asked, abs=6e-4)  # the digits that are printed


def test_a_pad_that_leaves_its_master_is_no_equilibrium():
    with pytest.raises(NotConvergedError, match="'upper' moves along x, and no contact stops it"):
        ls.solve(pad(1.1, geometry="current", steps={"max_halvings": 1}))


def test_validate_says_what_friction_alone_resists():
    held = validate(pad(0.5)).held
    assert "'upper' moves along x, which friction alone resists" in held and "'upper' moves along x" not in held
    assert "'upper' moves along y" in held


# ---- the ledger of work, against works that are summed from reactions, gaps and slips of the states


def states_of(case):
    """Return the problem, its states, and the sum over steps of mean forces times displacements of what is given."""
    problem = Problem.of(case)
    states = list(march(problem))

    def work(force):
        u = [np.zeros_like(states[0].u), *(state.u for state in states)]
        f = [np.zeros_like(u[0]), *map(force, states)]
        return sum(0.5 * (a + b) @ (y - x) for a, b, x, y in zip(f, f[1:], u, u[1:], strict=False))

    return problem, states, work


@pytest.mark.rows("('plane_strain', 'reference')", "('plane_strain', 'current')")
@pytest.mark.parametrize("way", WAYS[:3], ids=str)
def test_the_parts_are_those_of_the_states(way):
    problem, states, work = states_of(rubbed(*way))
    own, u = states[-1].step.work, states[-1].u
    assert own.external == pytest.approx(work(lambda state: state.reaction), rel=1e-9)
    K = problem.kinematics.tangent(np.zeros_like(u), 1.0)
    assert own.strain == pytest.approx(0.5 * u @ (K @ u), rel=1e-9)
    assert own.dissipation == pytest.approx(states[-1].zones[0].friction.energy[1], rel=1e-8) and own.dissipation > 0
    (pair,) = problem.joints
    pressing = work(lambda state: pair.integrate(problem.space, state.u, state.time).B.T @ state.zones[0].pressure)
    assert own.pressures == pytest.approx(pressing, rel=1e-9, abs=1e-12)
    rubbing = work(lambda state: -state.zones[0].force.ravel()) - own.pressures  # of friction, by mean forces
    assert own.left == pytest.approx(rubbing - own.dissipation, rel=1e-6)
    assert own.external == pytest.approx(own.strain + own.dissipation + own.pressures + own.left, rel=1e-12)


@pytest.mark.rows("finite")
@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_springs_between_the_bodies_store_their_part(kinematics):
    """Springs between a node of each body, along a line and by axes: supports do as much more work as these store."""
    case = rubbed("plane_strain", "current")
    low, high = (case.mesh.nodes_on(case.mesh.cells_of(group))[-1:] for group in ("bottom", "top"))
    mesh = replace(case.mesh, node_groups={"low": low, "high": high})
    case = replace(case, mesh=mesh)
    if kinematics == "finite":
        case = replace(case, kinematics="finite", material=(RUBBER,))
    springs = (Spring(group="low", to="high", k=30.0), Spring(group="low", to="high", kx=20.0))
    (_, alone, _), (_, states, work) = (states_of(replace(case, spring=s)) for s in ((), springs))
    own, before = states[-1].step.work, alone[-1].step.work
    d, u = np.subtract(*mesh.points[[high[0], low[0]], :2]), states[-1].u.reshape(-1, 2)
    du = u[high[0]] - u[low[0]]
    longer = np.linalg.norm(d + du) - np.linalg.norm(d) if kinematics == "finite" else du @ d / np.linalg.norm(d)
    stored = 15.0 * longer**2 + 10.0 * du[0] ** 2
    assert own.external == pytest.approx(work(lambda state: state.reaction), rel=1e-9)
    assert own.strain - before.strain == pytest.approx(stored, rel=1e-8) and stored > 1e-3 * before.strain
    assert own.external - before.external == pytest.approx(stored, rel=1e-2)  # of mean forces


def test_what_is_left_falls_with_the_steps():
    left = [states_of(rubbed("plane_strain", count=n))[1][-1].step.work.left for n in (8, 32)]
    assert 3.5 < left[0] / left[1] < 4.5


@pytest.mark.slow
def test_too_long_steps_are_warned_of_once_at_the_end(tmp_path):
    """In four steps the ledger leaves over half."""
    for count, warned in ((4, 1), (128, 0)):
        case = replace(rubbed("plane_strain", count=count), output=ls.Output(every=count))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            results = ls.run(case, tmp_path / str(count))
        words = [str(one.message) for one in caught if "too long" in str(one.message)]
        work = results.steps[-1].work
        assert len(words) == warned == (abs(work.left) > 0.05 * work.dissipation)
        if words:
            assert f"is off by {work.left:.4g} ({abs(work.left) / work.dissipation:.0%})" in words[0]
            assert words[0] in results.message


# ---- files


@pytest.mark.rows("3d-current")
@pytest.mark.parametrize(("model", "geometry"), each_option(WAYS))
def test_a_run_is_read_as_it_was_and_goes_on(tmp_path, model, geometry):
    case, last = rubbed(model, geometry), joint(model, geometry)
    whole = ls.run(case, tmp_path / "a")
    zone = ls.read_results(tmp_path / "a").solution(-1).contact["joint"]
    for name in ("shear", "slip", "path", "use", "dissipation", "shear_vector", "slip_vector", "shear_recovered"):
        np.testing.assert_array_equal(getattr(zone, name), getattr(last, name))
    np.testing.assert_allclose(zone.friction.resultant, last.friction.resultant, rtol=1e-9, atol=1e-12)
    assert (last.path > 0).any()
    results = json.loads((tmp_path / "a" / "results.json").read_text())
    figures = results["contact"]["joint"]
    assert figures["sticking"] + figures["sliding"] == figures["active"] and figures["dissipation"][1] > 0
    assert figures["friction"] == last.friction.resultant.tolist()
    assert results["steps"][-1]["work"] == whole.steps[-1].work._asdict()
    with (tmp_path / "a" / "contact_joint.csv").open(newline="") as file:
        columns = next(csv.reader(file))
    assert tuple(columns) == contact_columns(last) and len(columns) > len(CONTACT_COLUMNS)
    skin = read(tmp_path / "a" / "fields" / "contact_joint_0004.vtu")
    assert skin.cell_data["shear"].shape[1] == skin.node_data["shear_recovered"].shape[1] == 3
    state = read_state(tmp_path / "a", case, 0.5)
    assert state.step.work == whole.steps[1].work
    ls.run(case, create_output(tmp_path / "b"), start=state)
    rows = [(tmp_path / run / "history.csv").read_text().splitlines() for run in "ab"]
    assert rows[0][0] == rows[1][0] and rows[0][-1] == rows[1][-1]
    assert "contact.joint.dissipation" in rows[0][0] and "work.left" in rows[0][0]


# ---- what is said


def told(case, folder, words):
    """The warnings of a run that have these words."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LacmeshWarning)
        ls.run(case, folder)
    return [str(one.message) for one in caught if words in str(one.message)]


@pytest.mark.parametrize(("gap", "warned"), [(0.01, 1), (0.0, 0)])
def test_bodies_that_meet_and_slide_in_one_step(tmp_path, gap, warned):
    """Unlike bodies pressed together over a gap: said in one step, with the count, and not where they touch before."""
    mesh = block_on_block((0, 3, 1, 12, 3), (1.0, 2.0, 1, 5, 4), gap)
    laws = Material(groups=["upper"], young=1.0, poisson=0.4), Material(groups=["lower"], young=100.0, poisson=0.3)
    case = plane(mesh, *laws, rubs(friction=0.1), GROUND, move("top", ux=0, uy=f"-{0.05 + gap} * t"), Steps(count=1))
    assert len(told(case, tmp_path / "out", "friction of 'joint' depends on the load path: ")) == warned


@pytest.mark.rows("6.283185307179586-1")
@pytest.mark.parametrize(("angle", "count"), [(0.4, 0), (1.0, 1), (2 * np.pi, 1)])
def test_a_hub_that_turns_far_in_a_step_is_warned_of(tmp_path, angle, count):
    """Slip is the chord of the way: 4 % short at half a radian; a step that turns by more than a quarter is halved."""
    mesh = ring_on_hub("QUAD4", 12)
    mesh = replace(mesh, node_groups={"outer": np.flatnonzero(np.linalg.norm(mesh.points, axis=1) > 1.49)})
    hub = Rigid(group="master", centre=[0.0, 0.0], rotation=[[0.0, 0.0], [1.0, 0.0], [2.0, angle]])
    case = plane(
        mesh, RUBBER, rubs(clearance=-0.01), fix("outer", "xy"), Steps(times=[1.0, 2.0]), hub, kinematics="finite"
    )
    words = told(case, tmp_path / "hub", "straight lines")
    turned = min(angle, np.pi / 2)
    assert len(words) == count and all(f"'master' turns by {turned:.3g} radians" in one for one in words)


def test_a_slip_that_is_prescribed_everywhere_is_refused():
    held = fix("lower", "x"), move("upper", ux="0.01 * t"), fix("bottom", "y"), move("top", uy="-0.03 * t")
    with pytest.raises(CaseError, match=r"3 macro-elements slip at time 0.25"):
        ls.solve(replace(rubbed("plane_strain"), displacement=held))


@pytest.mark.parametrize(("sticks", "says"), [([1, 0, 1, 0], "stick and slide in turn"), ([1, 1, 0, 0], "")])
def test_what_cycles_is_named_with_its_place(sticks, says):
    """The first macro-element, in the last iterations of a search on skins that are paired once."""
    problem = Problem.of(rubbed("plane_strain"))
    u, (pair,) = np.zeros(problem.space.n_dof), problem.joints
    face = pair.integrate(problem.space, u, 1.0)
    system = contact_system(problem, [face], u)
    every = np.arange(len(system.G))
    recent = tuple((system.rows.w, every != (-1 if still else len(face.w))) for still in sticks)
    what, advice = alternating(Outcome(False, None, system, (), 0, 0, recent), problem.space)
    assert says in what and bool(what) == bool(says) and not advice
    assert not says or (what.startswith("1 of ") and f"({face.centre[0][0]:g}" in what)


# ---- friction on undeformed skins is inexact where a gap that opens at an angle closes

RADIUS, TILT = 5.0, 0.09  # the gap of the first macro-element is below a twentieth of its size
RISES = {
    "flat": lambda x: 0 * x, "apart": lambda x: 0.01 + 0 * x, "tilted": lambda x: TILT * (x + 0.5),
    "round": lambda x: RADIUS - np.sqrt(RADIUS**2 - x**2),
}  # fmt: skip


def said_of_the_angle(tmp_path, shape, **options):
    """Return what `validate` and `run` say of a block over a flat one, pressed on it."""
    mesh = block_on_block((0, 3, 1, 24, 2), (1.0, 2.0, 1, 12, 2))
    points, upper = mesh.points.copy(), mesh.nodes_on(mesh.cells_of("upper"))
    points[upper, 1] += RISES[shape](points[upper, 0] - 1.5)
    down, mesh = move("top", ux="0.01 * t", uy="-0.02 * t"), replace(mesh, points=points)
    case = plane(mesh, Material(young=1.0, poisson=0.3), rubs(**options), GROUND, down, Steps(count=1))
    before = [said for zone in validate(case).zones for said in zone.told if "at an angle" in said]
    return before, told(case, tmp_path / f"{len([*tmp_path.iterdir()])}", "at an angle")


@pytest.mark.rows("round-options2-counts2")
@pytest.mark.parametrize(
    ("shape", "options", "counts"),
    [
        ("round", {}, [1, 1]),
        ("tilted", {}, [1, 0]),
        ("round", {"friction": 0.0, "cohesion": 1e-4}, [0, 1]),  # cohesion is judged at the pressure
        ("round", {"friction": 0.0, "cohesion": 1.0}, [0, 0]),
        ("flat", {}, [0, 0]),
        ("apart", {}, [0, 0]),
        ("flat", {"clearance": "(x - 1.5)**2 / 10"}, [0, 0]),
        ("round", {"geometry": "current"}, [0, 0]),
        ("round", {"friction": 1.5}, [0, 0]),
        ("round", {"friction": 0.0}, [0, 0]),
        ("round", {"friction": float("inf")}, [0, 0]),
    ],
)
def test_skins_that_close_at_an_angle_are_warned_of(tmp_path, shape, options, counts):
    """Not so parallel ones, a gap that is a clearance, deformed skins; friction that is large beside the angle.

    The outermost macro-element of a round skin is at 5.5 degrees, of 17.2 that friction may take; in the end less has
    closed.
    """
    said = said_of_the_angle(tmp_path, shape, **options)
    assert [len(each) for each in said] == counts
    angle = {"round": np.arcsin((0.5 - 1 / 24) / RADIUS), "tilted": np.arctan(TILT)}.get(shape)
    if counts[0]:
        before = said[0][0]
        assert float(before.split(" degrees")[0].split()[-1]) == pytest.approx(np.degrees(angle), abs=0.05)
        assert share_in(before) == pytest.approx(100 * angle / MU, abs=0.5)
        assert shape == "tilted" or 5 < share_in(said[1][0]) < share_in(before)


def share_in(message):
    """The percentage that a message has."""
    return float(message.split(" %")[0].split()[-1])
