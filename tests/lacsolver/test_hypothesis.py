"""Slaves whose pressures nothing determines: pairs that are refused or warned of, and macro-elements covered by little.

Pressures that alternate are told. Of slivers an overlap is allowed that grows as the covered part vanishes."""

import re
import warnings
from collections import Counter
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

import lacmesh
from lacmesh.generate import box, rectangle, stack
from lacsolver.case import CaseError, Contact, Displacement, Material, Rigid, Tie, parse_case
from lacsolver.contact.sliver import allowed_overlap
from lacsolver.doubts.neighbours import Neighbours, alternating
from lacsolver.doubts.rules import Doubts
from lacsolver.doubts.run import Run
from lacsolver.equilibrium.alternating import alternating as what_alternates
from lacsolver.equilibrium.search import Outcome
from lacsolver.equilibrium.state import CONTACT
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import create_output
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from lacsolver.saddle.contact_system import contact_system
from lacsolver.validation import validate
from tests.problems import case_of, fix
from verification.families.punches import text
from verification.meshes.punches import FACE, Punch
from verification.meshes.punches import punched as punched_block


def problem_of(case):
    return Problem.of(case, case.mesh)


def zone_of(case):
    """The contact of the last state."""
    *_, state = march(problem_of(case))
    return state.zones[0]


#: what moves the slave
RIGID, PRESSED, TOP = (
    partial(Rigid, group="upper"), partial(Displacement, group="upper"), partial(Displacement, group="top")
)  # fmt: skip


@cache
def mesh(dim=3, n_slave=4, n_master=2, lift=0.0):
    """Two blocks, the slave above."""
    shape = box if dim == 3 else rectangle
    lower = shape(n_master).renamed(**dict(zip(("left", "front"), LOW[: dim - 1], strict=False)))
    return stack(lower, shape(n_slave), gap=lift)


LOW = ("low left", "low front")


def case(
    dim=3, roles=("slave", "master"), body=RIGID, *more, stiff=1.0, kinematics="small", joint=Contact, of=None, **keys
):  # fmt: skip
    """Two blocks, the upper one pressed down by 0.01."""
    up, sides = "xyz"[dim - 1], zip(LOW, "xyz"[: dim - 1], strict=False)
    moved = {f"u{a}": -0.01 if a == up else 0.0 for a in "xyz"[:dim]}
    law = {"law": "neo_hookean"} if kinematics == "finite" else {}
    laws = [Material(groups=[g], young=young, poisson=0.3, **law) for g, young in (("lower", 1.0), ("upper", stiff))]
    held = fix("bottom", up), *(fix(side, a) for side, a in sides), body(**moved), *more
    pair = joint(name="c", slave=roles[0], master=roles[1], **keys)
    model = "3d" if dim == 3 else "plane_strain"
    return case_of(mesh(dim) if of is None else of, *laws, pair, *held, model=model, kinematics=kinematics)


@pytest.mark.parametrize("body, why", [(RIGID, "'upper' moves them"), (PRESSED, "displacement is prescr")], ids=str)
@pytest.mark.parametrize("dim, count, nodes", [(3, 16, 9), (2, 8, 3)])
def test_a_slave_without_displacements_of_its_own_is_refused(body, why, dim, count, nodes):
    """With the roles exchanged it is exact: a pressure of 0.01 E, in plane strain E / (1 - nu^2)."""
    of = mesh(dim, 4 if dim == 3 else 8, 2)
    wrong = case(dim, body=body, of=of)
    with pytest.raises(CaseError, match=f"{count} of {count} macro-elements.*{why}") as told:
        Doubts(problem_of(wrong)).ask("undeformed")
    assert f"only {nodes} free nodes" in str(told.value) and "exchange slave and master" in str(told.value)
    (problem,) = validate(wrong, of).problems
    assert problem.message == str(told.value)
    exact = 0.01 if dim == 3 else 0.01 / (1 - 0.3**2)
    np.testing.assert_allclose(zone_of(case(dim, ("master", "slave"), body, of=of)).pressure, exact, rtol=1e-9)


def test_slaves_that_are_right():
    """Few faces over many nodes, four pressures and 25 nodes; a contact as soft as the block; held at its sides."""
    few, soft = case(of=mesh(3, 2, 4)), case(stiffness=1.0)
    np.testing.assert_allclose(zone_of(few).pressure, 0.01, rtol=1e-9)
    np.testing.assert_allclose(zone_of(soft).pressure, 0.005, rtol=1e-9)
    sides = fix("left", "x"), fix("front", "y")
    assert (zone_of(case(3, ("slave", "master"), TOP, *sides)).pressure > 0).all()


@pytest.mark.parametrize(
    "wrong", [{"joint": Tie}, {"of": mesh(lift=5.0), "kinematics": "finite"}], ids=["tie", "later"]
)
def test_a_tie_and_a_slave_that_meets_its_master_later_are_judged_as_well(wrong):
    with pytest.raises(CaseError, match="16 of 16"):
        Doubts(problem_of(case(**wrong))).ask("undeformed")


def punched(stiff, n_slave, roles=("slave", "master")):
    """A punch of a parabola."""
    keys = {"surface": "faces", "clearance": "0.02 * x**2", "stiff": stiff, "of": mesh(2, n_slave, 13)}
    return case(2, roles, TOP, **keys)


@pytest.mark.parametrize("stiff, n_slave, said", [(10.0, 30, True), (1.0, 30, False), (10.0, 13, False)])
def test_a_slave_stiffer_and_finer_than_its_master_is_named_as_the_cause(stiff, n_slave, said):
    problem = problem_of(punched(stiff, n_slave))
    *_, state = march(problem)
    doubts = list(alternating(Run(problem, problem.joints, last=state)))
    assert ["has finer faces" in one.text for one in doubts] == [True] * said


def test_pressures_that_alternate_are_told_with_their_cause(tmp_path):
    """Twenty times as stiff, 30 faces over 13: peaks of twice the pressure; nothing is told with roles exchanged."""
    with pytest.warns(lacmesh.LacmeshWarning) as told:
        results = run(punched(20.0, 30), create_output(tmp_path / "out"))
    assert any("alternate" in str(one.message) and "exchange slave and master" in str(one.message) for one in told)
    assert "alternate" in results.message
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = run(punched(20.0, 30, ("master", "slave")), create_output(tmp_path / "other"))
    peaks = [one.steps[-1].contact["c"].pressure_max for one in (results, again)]
    assert peaks[0] > 1.7 * peaks[1] and again.message == ""


def test_the_roughness_of_a_checkerboard_is_one_and_of_what_falls_evenly_none():
    problem = problem_of(case(2, ("master", "slave"), of=mesh(2, 8, 20)))
    zone = problem.joints[0].zone
    corners = zone.slave.x[zone.slave.faces.nodes[:, :2], 0].mean(axis=1)
    order = np.argsort(np.argsort([corners[zone.macro == k].mean() for k in range(zone.n_macros)]))
    near = Neighbours(zone)
    assert near.roughness((order % 2).astype(float)) == 1.0
    assert near.roughness(5.0 + order) == pytest.approx(0.0, abs=1e-15)
    assert list(alternating(Run(problem, problem.joints, last=[*march(problem)][-1]))) == []


@pytest.mark.parametrize(("joint", "count"), [(Contact, 1), (Tie, 0)])
def test_pressures_that_alternate_inside_are_told_of_contact_alone(joint, count):
    problem = problem_of(case(2, ("master", "slave"), joint=joint, of=mesh(2, 8, 20)))
    *_, state = march(problem)
    (zone,) = state.zones
    rough = replace(zone, pressure=np.arange(len(zone.pressure)) % 2 + 0.5, status=np.full(len(zone.status), CONTACT))
    doubts = list(alternating(Run(problem, problem.joints, last=replace(state, zones=(rough,)))))
    assert ["inside the contact area" in one.text for one in doubts] == [True] * count


# ---- slivers

#: a punch from one node of the block to another, two faces wide
ALIGNED = Punch((3 * FACE,), 2 * FACE, 4, 0.2, 0.3)


def punch_of(punch, steps=1, more="", end=""):
    joint = text("top", punch, steps).replace("[[contact]]", f"[[contact]]\n{more}")
    return Problem.of(parse_case(joint + end), punched_block(punch))


def over(covered, dim=2, more=""):
    """A problem whose punch covers such a part of the macro-element before it, its pair and interface, undeformed."""
    problem = punch_of(Punch((3 * FACE - covered * FACE,) * (dim - 1), 2 * FACE, 2, 0.2, 0.3), more=more)
    (pair,) = problem.joints
    return problem, pair, pair.integrate(problem.space, np.zeros(problem.space.n_dof), 1.0)


@pytest.mark.parametrize("steps", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_a_corner_on_a_node_has_one_answer_in_any_number_of_steps(steps):
    (once,), states = march(punch_of(ALIGNED)), list(march(punch_of(ALIGNED, steps)))
    assert np.abs(states[-1].u - once.u).max() < 1e-9 * np.abs(once.u).max()
    assert sum(state.iterations for state in states) <= 4 * steps


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("measure", ["reference", "current"])
def test_the_derivative_of_what_is_allowed(dim, measure):
    """Gaps of slivers, against central differences, with a punch that turns and a block that stretches."""
    problem, *_ = over(0.02, dim, f'measure = "{measure}"')
    rng, h = np.random.default_rng(0), 1e-7
    u, v = 2e-3 * rng.uniform(-1, 1, problem.space.n_dof), rng.uniform(-1, 1, problem.space.n_dof)

    def system(u):
        return contact_system(problem, [pair.integrate(problem.space, u, 1.0) for pair in problem.joints], u)

    here, before, after = system(u), system(u - h * v), system(u + h * v)
    few = here.above_threshold & (here.groups[0].face.coverage < 0.04)
    assert few.any() and allowed_overlap(here.groups[0].face, problem.joints[0].pairing)[0][few].min() > 0
    off = here.rows.D @ v + (after.G - before.G) / (2 * h)
    assert np.abs(off[few]).max() < 1e-6 * np.abs(here.rows.D[few] @ v).max()


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("covered", [0.01, 0.04, 0.06, 0.5])
def test_a_twentieth_is_covered_or_an_overlap_is_allowed(dim, covered):
    """0.1 h (1 - r)^2 / r where r, the covered part over a twentieth, is below 1, and nothing elsewhere."""
    _, pair, face = over(covered, dim)
    r = np.minimum(np.where(face.w > 0, face.coverage / 0.05, 1.0), 1.0)
    assert r.min() <= covered / 0.05 + 1e-9 and (r.min() < 1) == (covered < 0.05 or (dim == 3 and covered**2 < 0.05))
    expected = np.where(face.w > 0, 0.1 * face.length * (1 - r) ** 2 / r * face.w, 0.0)
    np.testing.assert_allclose(allowed_overlap(face, pair.pairing)[0], expected, rtol=1e-9, atol=1e-16)


def test_a_search_that_goes_to_and_fro_ends_soon_and_says_where():
    """A block that is squeezed out sideways, until a few faces of it carry all of the punch."""
    told = []
    deep = replace(ALIGNED, depth=1.5)  # at which all processors end alike: other searches without an end are chaotic
    with pytest.raises(NotConvergedError) as error:
        list(march(punch_of(deep, 5, end="\nmax_halvings = 0"), progress=told.append))
    assert max(Counter(each.time for each in told).values()) < 40
    message = str(error.value)
    assert "of the macro-elements of contact 'top'" in message and "exchange slave and master" in message, message
    assert 'normals = "smoothed"' in message and 'geometry = "reference"' in message


@pytest.mark.parametrize(
    "covered, active, says, tries",
    [
        ([0, 1, 0, 1], [0, 1, 0, 1], "1 of the .* pair and unpair in turn, as the one at .* between 0 and 0.8", True),
        ([1, 0.5, 1, 1], [1, 1, 1, 1], "now more, now less, as the one at .* between 0.4 and 0.8", True),
        ([1, 1, 1, 1], [0, 1, 0, 1], "close and open in turn", False),
        ([0, 0.5, 1, 1], [0, 1, 1, 1], None, False),
    ],
)
def test_what_alternates_is_told(covered, active, says, tries):
    """One macro-element, covered by 0.8 times these parts in the last iterations."""
    problem, _, face = over(0.8)
    contact = contact_system(problem, [face], np.zeros(problem.space.n_dof))
    recent = [(own * face.w, np.full(len(face.w), bool(on))) for own, on in zip(covered, active, strict=True)]
    chosen = np.arange(len(face.w)) == np.flatnonzero((face.coverage > 0.5) & (face.coverage < 0.9))[0]
    recent = [(np.where(chosen, w, face.w), chosen & on) for w, on in recent]
    what, advice = what_alternates(Outcome(False, None, contact, (), 0, 0, tuple(recent)), problem.space)
    assert (re.search(says, what) is not None) if says else what == ""
    assert ("exchange slave and master" in advice) == tries
