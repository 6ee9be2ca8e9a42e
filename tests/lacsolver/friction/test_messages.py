"""Messages about friction: what it alone resists, what slides away, and that it depends on the steps."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import lacsolver as ls
from lacmesh.errors import LacmeshWarning
from lacsolver.case import BodyForce, Case, CaseError, Contact, Displacement, Material, Rigid, Steps
from lacsolver.equilibrium.alternating import alternating
from lacsolver.equilibrium.search import Outcome
from lacsolver.equilibrium.stepping import NotConvergedError
from lacsolver.problem.problem import Problem
from lacsolver.saddle.contact_system import contact_system
from lacsolver.validation import validate
from tests.lacsolver.friction.test_output import rubbed
from tests.lacsolver.friction.test_sliding import block_on_block
from tests.lacsolver.patch_meshes import stack
from verification.meshes.friction import ring_on_hub

MU = 0.3


def pad(part, **options):
    """A pad under its weight, that a part of mu N pushes along a plane; nothing else holds it."""
    mesh = block_on_block(((0, 4), (0, 1), 12, 3), ((1.0, 2.0), (1, 1.5), 5, 3))
    return Case(
        model="plane_strain", mesh=mesh, material=[Material(young=1000.0, poisson=0.3)],
        contact=[Contact(name="joint", slave="above", master="below", friction=MU)],
        displacement=[Displacement(group="bottom", ux=0, uy=0)],
        body_force=[BodyForce(groups=["upper"], fx=MU * part * 2.0, fy=-2.0)], steps=Steps(end=1.0, count=1), **options,
    )  # fmt: skip


def test_a_pad_sticks_below_the_bound():
    case = pad(0.99)
    zone = ls.solve(case).contact["joint"]
    assert (zone.shear[:, 0] @ zone.area) / (zone.pressure @ zone.area) == pytest.approx(0.99 * MU, rel=1e-9)
    assert (zone.status == 1).any()


def test_a_pad_slides_away_above_it():
    words = r"'upper' slides along x: friction of 'joint' carries 0.300 of its pressure, and 0.303 is asked; hold it"
    with pytest.raises(NotConvergedError, match=words):
        ls.solve(replace(pad(1.01), steps=Steps(end=1.0, count=1, max_halvings=0)))


@pytest.mark.parametrize(("along", "part"), [((1.0, 0.0), 1.01), ((0.6, 0.8), 1.5)])
def test_a_block_slides_away_in_space(along, part):
    """The loop stops where the block is so far away that round-off hides what friction does not carry."""
    mesh = stack("HEXA8", "HEXA8", 3, counts=(3, 2))
    fx, fy = MU * part * np.array(along)
    case = Case(
        model="3d", material=[Material(young=1000.0, poisson=0.3)], steps=Steps(end=1.0, count=1, max_halvings=2),
        contact=[Contact(name="joint", slave="slave", master="master", friction=MU)],
        displacement=[Displacement(group="bottom", ux=0, uy=0, uz=0)],
        body_force=[BodyForce(groups=["upper"], fx=fx, fy=fy, fz=-1.0)],
    )  # fmt: skip
    with pytest.raises(NotConvergedError, match=r"'upper' slides along x: friction of 'joint' carries 0.300") as caught:
        ls.solve(case, mesh)
    asked = float(str(caught.value).split(" is asked")[0].split()[-1])
    assert asked == pytest.approx(MU * part, abs=6e-4)  # the digits that are printed


def test_a_pad_that_leaves_its_master_is_no_equilibrium():
    case = pad(1.1)
    joint = replace(case.contact[0], geometry="current")
    with pytest.raises(NotConvergedError, match="'upper' moves along x, and no contact stops it"):
        ls.solve(replace(case, contact=[joint], steps=replace(case.steps, max_halvings=1)))


def test_validate_says_what_friction_alone_resists():
    held = validate(pad(0.5)).held
    assert "'upper' moves along x, which friction alone resists" in held and "'upper' moves along x" not in held
    assert "'upper' moves along y" in held


def test_bodies_that_meet_and_slide_in_one_step(tmp_path):
    """Unlike bodies pressed together over a gap: said in one step, with the count, and not where they touch before."""

    def told(gap, count):
        mesh = block_on_block(((0, 3), (0, 1), 12, 3), ((1.0, 2.0), (1 + gap, 2 + gap), 5, 4))
        case = Case(
            model="plane_strain", material=[Material(groups=["upper"], young=1.0, poisson=0.4),
                                            Material(groups=["lower"], young=100.0, poisson=0.3)],
            contact=[Contact(name="joint", slave="above", master="below", friction=0.1)],
            displacement=[
                Displacement(group="bottom", ux=0, uy=0), Displacement(group="top", ux=0, uy=f"-{0.05 + gap} * t"),
            ],
            steps=Steps(end=1.0, count=count),
        )  # fmt: skip
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", LacmeshWarning)
            ls.run(case, tmp_path / f"{gap}-{count}", mesh=mesh)
        return [str(one.message) for one in caught if "depends on the way" in str(one.message)]

    (message,) = told(0.01, 1)
    assert "friction of 'joint' depends on the way: " in message and "compare with twice as many steps" in message
    assert told(0.0, 1) == []


@pytest.mark.parametrize(("angle", "count"), [(0.4, 0), (1.0, 1), (2 * np.pi, 1)])
def test_a_hub_that_turns_far_in_a_step_is_warned_of(tmp_path, angle, count):
    """Slip is the chord of the way: 4 % short at half a radian; a step that turns by more than a quarter is halved."""
    mesh = ring_on_hub("QUAD4", 12)
    outer = np.flatnonzero(np.linalg.norm(mesh.points, axis=1) > 1.49)
    case = Case(
        model="plane_strain", kinematics="finite", material=[Material(law="neo_hookean", young=1000.0, poisson=0.3)],
        contact=[Contact(name="joint", slave="slave", master="master", friction=MU, clearance=-0.01)],
        displacement=[Displacement(group="outer", ux=0, uy=0)], steps=Steps(times=[1.0, 2.0]),
        rigid=[Rigid(group="master", centre=[0.0, 0.0], rotation=[[0.0, 0.0], [1.0, 0.0], [2.0, angle]])],
    )  # fmt: skip
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LacmeshWarning)
        ls.run(case, tmp_path / "hub", mesh=replace(mesh, node_groups={"outer": outer}))
    told = [str(one.message) for one in caught if "straight lines" in str(one.message)]
    turned = min(angle, np.pi / 2)
    assert len(told) == count and all(f"'master' turns by {turned:.3g} radians in the step" in one for one in told)


def test_a_slip_that_is_prescribed_everywhere_is_refused():
    case, mesh = rubbed("plane_strain", "small")
    held = [Displacement(group="lower", ux=0), Displacement(group="upper", ux="0.01 * t")]
    held += [Displacement(group="bottom", uy=0), Displacement(group="top", uy="-0.03 * t")]
    with pytest.raises(CaseError, match=r"3 macro-elements slip at time 0.25.*not available yet"):
        ls.solve(replace(case, displacement=held), mesh)


@pytest.mark.parametrize(
    ("closed", "sticks", "says"),
    [
        (
            [1, 1, 1, 1],
            [1, 0, 1, 0],
            "1 of the macro-elements of contact 'joint' stick and slide in turn, as the one at (",
        ),
        (
            [1, 0, 1, 0],
            [1, 0, 1, 0],
            "1 of the macro-elements of contact 'joint' close and open in turn, as the one at (",
        ),
        ([1, 1, 1, 1], [1, 1, 0, 0], ""),
    ],
)
def test_what_cycles_is_named_with_its_place(closed, sticks, says):
    """The first macro-element, in the last iterations of a search on skins that are paired once."""
    case, mesh = rubbed("plane_strain", "small")
    problem = Problem.of(case, mesh)
    u = np.zeros(problem.space.n_dof)
    (pair,) = problem.joints
    face = pair.integrate(problem.space, u, 1.0)
    contact = contact_system(problem, [face], u)
    rest = np.ones(len(contact.G), bool)
    recent = []
    for on, still in zip(closed, sticks, strict=True):
        active = rest.copy()
        active[[0, len(face.w)]] = on, still
        recent.append((contact.rows.w, active))
    what, advice = alternating(Outcome(False, None, contact, (), 0, 0, tuple(recent)), problem.space)
    assert what.startswith(says) and bool(what) == bool(says) and not advice
    assert not says or f"({face.centre[0][0]:g}" in what
