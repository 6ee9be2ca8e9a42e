"""Decks with contact, ties and motion, with exact solutions: imported, solved, compared."""

import numpy as np
import pytest

from lacsolver.problem.initial import initial_motion
from lacsolver.validation import validate
from tests.lacsolver.deck_texts import (
    CONTACT,
    PAIR,
    Block,
    E,
    bodies,
    held,
    imported,
    law,
    moving,
    on_each_other,
    solved,
    step,
    two_blocks,
)

NU = 0.3
PRESS = "*DLOAD\nC_EZ1, P2, 20.\n"
BELOW, ABOVE = two_blocks()
TOP = ABOVE.at(2, 2)


def by_time(found):
    """The only zone of each state, by its time."""
    return {round(state.time, 6): state.zones[0] for state in found.states}


# ---- contact


@pytest.mark.parametrize("element", ["C3D8", "C3D20"])
@pytest.mark.parametrize(
    ("behaviour", "overlap"),
    [
        ("", 0.0),
        (law(5000), 20 / 5000),
        ("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n10., 0.003\n40., 0.006\n", 0.004),
        ("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL\n0.004, 20.\n", 0.0),
    ],
)
def test_patch_of_two_blocks(tmp_path, element, behaviour, overlap):
    """A uniform pressure goes through a contact of meshes that do not match; soft contact overlaps by p of its law."""
    below, above = two_blocks(element=element)
    found = solved(tmp_path, on_each_other(below, above, CONTACT + behaviour, PRESS))
    assert np.allclose(found.zone.pressure, 20, rtol=1e-9)
    assert np.allclose(found.u(above.at(2, 2))[:, 2], -20 / E * 2 - overlap, rtol=1e-9)
    assert np.allclose(found.u(above.at(0, 1))[:, 0], NU * 20 / E, rtol=1e-9)


def test_slave_of_nodes_and_a_clearance(tmp_path):
    """Nodes are taken as the faces on them, which a note says; a *CLEARANCE of 0.02 replaces the gap of 0.1."""
    between = "*SURFACE, NAME=NODES, TYPE=NODE\nC_Z0\n" + CONTACT.replace("UPPER, LOWER", "NODES, LOWER")
    found = solved(tmp_path, on_each_other(BELOW, ABOVE, between, PRESS))
    assert np.allclose(found.zone.pressure, 20, rtol=1e-9)
    assert any("taken as the 9 faces" in finding.message for finding in found.made.findings)
    between = CONTACT + "*CLEARANCE, SLAVE=UPPER, MASTER=LOWER, VALUE=0.02\n"
    text = on_each_other(*two_blocks(0.1), between, "*BOUNDARY\nC_Z1, 3, 3, -0.05\n", nu=0.0)
    assert np.allclose(solved(tmp_path, text).zone.pressure, (0.05 - 0.02) / 2 * E, rtol=1e-9)


@pytest.mark.parametrize("clearance", [0.0, 0.005])
@pytest.mark.parametrize("first", ["ADD", "REMOVE"])
def test_contact_that_is_removed_and_added(tmp_path, first, clearance):
    """Both blocks share the overlap in the steps that have the contact, less its clearance; the others have none."""
    between = CONTACT + f"*CLEARANCE, SLAVE=UPPER, MASTER=LOWER, VALUE={clearance}\n" * bool(clearance)
    change = "*MODEL CHANGE, TYPE=CONTACT PAIR, {}\nUPPER, LOWER\n"
    deck = on_each_other(BELOW, ABOVE, between, change.format(first) + "*BOUNDARY\nC_Z1, 3, 3, -0.02\n", nu=0.0)
    deck += step(change.format("ADD")) + step("") + step(change.format("REMOVE"))
    zones, size = by_time(solved(tmp_path, deck)), (0.02 - clearance) / 2 * E
    for time, has in ((1.0, first == "ADD"), (2.0, True), (3.0, True), (4.0, False)):
        np.testing.assert_allclose(zones[time].pressure, size * has, rtol=1e-9)


@pytest.mark.parametrize(
    ("cards", "friction", "limit"),
    [
        ("*FRICTION\n0.3, 1e5\n", 0.3, None),
        ("*FRICTION, TAUMAX=7.\n0.3\n", 0.3, 7.0),
        ("*FRICTION, ROUGH\n", np.inf, None),
        ("*FRICTION\n0.\n", 0.0, None),
    ],
)
def test_friction_of_a_deck(tmp_path, cards, friction, limit):
    (contact,) = imported(tmp_path, on_each_other(BELOW, ABOVE, CONTACT + cards, PRESS)).case.contact
    assert contact.friction.source == friction
    assert (contact.shear_limit and contact.shear_limit.source) == limit


def test_pressure_per_overlap_that_a_step_changes(tmp_path):
    """It is that of the model in the first step, and another one from the second step on."""
    deck = on_each_other(BELOW, ABOVE, CONTACT + law(5000), PRESS)
    found = solved(tmp_path, deck + step("*CHANGE SURFACE BEHAVIOR, INTERACTION=SI\n" + law(8000)) + step(""))
    for k, state in enumerate(found.states):
        stiffness = {1.0: 5000, 2.0: 8000, 3.0: 8000}.get(round(state.time, 9))
        if stiffness:
            assert np.allclose(found.u(TOP, k)[:, 2], -20 / E * 2 - 20 / stiffness, rtol=1e-9)
    assert imported(tmp_path, deck + step("")).case.contact[0].stiffness.source == 5000


def test_friction_that_steps_change(tmp_path):
    """A block that is pressed and pushed slides with the coefficient of each step."""
    below, above = Block("B", high=(2, 1, 1), cells=(4, 1, 2)), Block("C", (0, 0, 1), (2, 1, 2), (3, 2, 2), first=10000)
    deck = bodies(below, above, nu=0.0) + PAIR + "*BOUNDARY\nB_Z0, 1, 3\nB_Y0, 2\nC_Y0, 2\n" + CONTACT
    deck += "*FRICTION\n0.3\n" + step(PRESS + "*BOUNDARY\nC_X0, 1, 1, 0.1\n")
    for value in (0.1, 0.0):
        change = f"*CHANGE FRICTION, INTERACTION=SI\n*FRICTION\n{value}\n"
        deck += step(change + f"*BOUNDARY\nC_X0, 1, 1, {0.3 - value}\n")
    zones = by_time(solved(tmp_path, deck))
    for time, friction in ((1.0, 0.3), (2.0, 0.1), (3.0, 0.0)):
        zone = zones[time]
        force = (zone.traction * zone.area[:, None]).sum(axis=0)
        assert abs(force[2]) == pytest.approx(40, rel=1e-9)
        assert abs(force[0]) == pytest.approx(40 * friction, rel=1e-4, abs=1e-8)
        assert np.allclose(np.hypot(*zone.traction[:, :2].T), friction * zone.pressure, rtol=1e-8, atol=1e-8)


# ---- ties


def test_a_tie_without_a_tolerance_bridges_what_calculix_does(tmp_path):
    """2.5 % of an element: surfaces that are farther apart are not tied, and a warning tells."""
    made = imported(tmp_path, on_each_other(*two_blocks(0.02), "*TIE, NAME=T\nUPPER, LOWER\n", PRESS))
    (warning,) = [one.text for one in made.findings if one.level == "warning"]
    assert "it is not tied" in warning and not made.case.tie
    pull = PRESS.replace("20", "-20")
    found = solved(tmp_path, on_each_other(*two_blocks(0.005), "*TIE, NAME=T\nUPPER, LOWER\n", pull))
    (tie,) = found.made.case.tie
    assert tie.search_distance == pytest.approx(0.025 / 3) and found.zone.status.all()


TIED = CONTACT + "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n1e6\n*FRICTION\n0.5, 1e6\n"


@pytest.mark.parametrize("between", ["*TIE, NAME=T, POSITION TOLERANCE=0.1\nUPPER, LOWER\n", TIED], ids=["tie", "tied"])
def test_tie(tmp_path, between):
    found = solved(tmp_path, on_each_other(BELOW, ABOVE, between, PRESS.replace("20", "-20")))
    assert len(found.made.case.tie) == 1
    assert np.allclose(found.u(TOP)[:, 2], 20 / E * 2, rtol=1e-9)


# ---- decks of Abaqus


ABAQUS = """\
*Heading
*Part, name=Body
{mesh}*Solid Section, elset=B, material=Steel
,
*Solid Section, elset=C, material=Steel
,
*End Part
*Assembly, name=Assembly
*Instance, name=Body-1, part=Body
*End Instance
*Surface, type=ELEMENT, name=Upper
Body-1.C_EZ0, S1
*Surface, type=ELEMENT, name=Lower
Body-1.B_EZ1, S2
*Surface, type=ELEMENT, name=Press
Body-1.C_EZ1, S2
*Nset, nset=Held, instance=Body-1
B_Z0
*End Assembly
*Material, name=Steel
*Elastic
1000., 0.
*Surface Interaction, name=Touch
1.,
*Friction, slip tolerance=0.005
0.,
*Surface Behavior, pressure-overclosure=HARD
*Contact Pair, interaction=Touch, type=SURFACE TO SURFACE
Upper, Lower
*Boundary, type=DISPLACEMENT
Held, ENCASTRE
Body-1.C_X0, XSYMM
Body-1.C_Y0, YSYMM
*Step, name=Press, nlgeom=NO
*Static
1., 1., 1e-05, 1.
*Dsload
Press, P, 20.
*Restart, write, frequency=0
*Output, field, variable=PRESELECT
*End Step
"""


@pytest.mark.parametrize("quoted", [{}, {"Body-1": '"The body-1"', "Body\n": '"The body"\n'}])
def test_a_deck_as_abaqus_writes_it(tmp_path, quoted):
    """A part, its instance, an assembly; names with blanks in quotes; supports by their names; output that is noted."""
    text = ABAQUS.format(mesh=BELOW.text() + ABOVE.text())
    for name, own in quoted.items():
        text = text.replace(name, own)
    assert not quoted or ('"The body-1".B_EZ1' in text and 'part="The body"' in text)
    found = solved(tmp_path, text)
    assert np.allclose(found.zone.pressure, 20, rtol=1e-9)
    assert np.allclose(found.u(TOP)[:, 2], -20 / E * 2, rtol=1e-9)
    assert {finding.level for finding in found.made.findings} == {"note"}


# ---- slaves of one face: the import takes the other role where that surface has more faces, and says so

P = 10.0
PAIRED = f"*SURFACE INTERACTION, NAME=SI\n{law(1e6)}*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nU, L\n"


def pressed(element="C3D8", cells=(2, 2, 2), pair=PAIRED, more="", above=(1, 1, 1), lift=0.0):
    """A block of one brick, whose face is the slave, pressed on a finer one of the same width.

    `lift`: of its nodes, or of those at x = 0 alone where it is negative.
    """
    low = Block("B", cells=cells, element=element)
    high = Block("C", (0, 0, 1), (1, 1, 2), above, element, first=10000)
    foot = (high.points[:, 2] == 1) & ((lift > 0) | (high.points[:, 0] == 0))
    high.places = high.points + np.outer(foot, [0, 0, lift])
    edge = high.numbers[(high.points[:, 1] == 0) & (high.points[:, 2] == 1)]
    text = bodies(low, high) + "*SURFACE, NAME=U\nC_EZ0, S1\n*SURFACE, NAME=L\nB_EZ1, S2\n"
    text += f"{held()}*BOUNDARY\n{edge[0]}, 1, 2\n{edge[-1]}, 2\n"
    return text + pair + more + f"*STEP\n*STATIC\n1., 1.\n*DLOAD\nC_EZ1, P2, {P}\n*END STEP\n"


def of_few(made):
    """What the import says of slaves of few faces."""
    (one,) = [one for one in made.findings if "few faces" in one.text]
    return one


@pytest.mark.parametrize("element", ["C3D8", "C3D20"])
@pytest.mark.parametrize("cells", [(2, 2, 2), (3, 2, 1)])
def test_a_slave_of_one_face_is_the_master_of_the_finer_surface(tmp_path, element, cells):
    """A uniform pressure: the overlap of the linear contact is P / K, and the block does not turn."""
    found = solved(tmp_path, pressed(element, cells))
    (record,) = found.made.case.contact
    assert (record.slave, record.master) == ("L", "U")
    note = of_few(found.made)
    assert note.level == "note" and f"'L' has {cells[0] * cells[1]}" in note.text
    assert not validate(found.made.case, found.made.mesh).problems
    assert np.allclose(found.zone.pressure, P, rtol=1e-8)
    mesh = found.problem.space.mesh
    top = mesh.node_number[mesh.node_groups["C_Z1"]]
    assert np.allclose(found.u(top)[:, 2], -P * (2 / E + 1e-6), rtol=1e-7)


def test_a_tie_and_a_clearance_go_with_the_slave(tmp_path):
    made = imported(tmp_path, pressed(pair="*TIE, NAME=T\nU, L\n"))
    assert made.case.tie[0].slave == "L" and not validate(made.case, made.mesh).problems
    (record,) = imported(tmp_path, pressed(more="*CLEARANCE, MASTER=L, SLAVE=U, VALUE=0.001\n")).case.contact
    assert record.slave == "L" and record.clearance.at(0.0) == pytest.approx(0.001)


def test_a_slave_of_one_face_that_stays_the_slave(tmp_path):
    """Where its master has few faces as well, or is rigid."""
    rigid = "*NODE\n99999, 0., 0., 0.\n*RIGID BODY, ELSET=B, REF NODE=99999\n*BOUNDARY\n99999, 1, 6\n"
    for text, said in (
        (pressed(cells=(1, 1, 1)), "its master has few as well"),
        (pressed(more=rigid).replace(held(), ""), "its master is rigid"),
    ):
        made = imported(tmp_path, text)
        told = of_few(made)
        assert made.case.contact[0].slave == "U" and told.level == "warning" and said in told.text


@pytest.mark.parametrize(("adjust", "lift", "count"), [(0.02, 0.01, 9), (0.0, -0.01, 3)])
def test_the_nodes_of_a_slave_are_moved_onto_the_master(tmp_path, adjust, lift, count):
    """ADJUST closes a gap, and takes overlaps away: that of one edge alone at a distance of 0, which leaves gaps."""
    text = pressed(above=(2, 2, 2), lift=lift).replace("TYPE=SURFACE TO", f"ADJUST={adjust}, TYPE=SURFACE TO")
    found = solved(tmp_path, text)
    assert found.made.case.contact[0].adjust == adjust
    assert found.problem.adjusted["U"].count == count
    np.testing.assert_allclose(found.problem.adjusted["U"].largest, 0.01, rtol=1e-9)
    np.testing.assert_allclose(found.zone.pressure, P, rtol=1e-3)


# ---- motion

CUBE = Block()
PUSH = "*DLOAD\nB, P2, 10.\n"


def test_adjust_by_a_set_moves_all_nodes_of_the_slave(tmp_path):
    """A set with all nodes of the slave is a distance larger than the model, which no node is beyond."""
    text = on_each_other(*two_blocks(), CONTACT.replace("*CONTACT PAIR", "*CONTACT PAIR, ADJUST=C_Z0"), "")
    made = imported(tmp_path, text)
    assert made.case.contact[0].adjust > np.ptp(made.mesh.points, axis=0).max()


def test_damping_of_contact_is_of_steps_in_motion(tmp_path):
    """The coefficient of *CONTACT DAMPING in *DYNAMIC; a note without it."""
    text = pressed(above=(2, 2, 2)).replace("*CONTACT PAIR", "*CONTACT DAMPING\n0.5\n*CONTACT PAIR")
    made = imported(tmp_path, text)
    assert made.case.contact[0].damping == 0
    assert any("no effect without *DYNAMIC" in one.text for one in made.findings)
    text = text.replace("*STATIC\n1., 1.", "*DYNAMIC\n0.1, 1.").replace("*ELASTIC", "*DENSITY\n1.\n*ELASTIC")
    assert imported(tmp_path, text).case.contact[0].damping == 0.5


def test_velocities_of_a_body_that_turns(tmp_path):
    """A body's velocities are those of the deck's nodes; another body, which rests, has none."""
    other = Block("C", (3, 0, 0), (4, 1, 1), first=100)
    turn = np.array([1.0, 2.0, 3.0]) + np.cross([0.3, -0.2, 0.5], CUBE.points)
    lines = "".join(f"{k + 1}, {c + 1}, {v[c]!r}\n" for k, v in enumerate(turn.tolist()) for c in range(3))
    text = bodies(CUBE, other, nu=0.0, more="*DENSITY\n100.\n") + "*INITIAL CONDITIONS, TYPE=VELOCITY\n" + lines
    found = solved(tmp_path, text + moving(""))
    assert found.made.case.initial[0].groups == ("B",)
    given = initial_motion(found.problem.space, found.made.case, 0.0)[1].values
    assert np.allclose(given[:8], turn, atol=1e-13)
    assert not given[8:].any()


POINT = "*NODE\n900, 0.5, 0.5, 0.5\n901, 0.5, 0.5, 0.5\n*RIGID BODY, ELSET=B, REF NODE=900\n"
MASS = POINT + "*ELEMENT, TYPE=MASS, ELSET=M\n903, 900\n*MASS, ELSET=M\n6.\n"
INERTIA = MASS + "*ELEMENT, TYPE=ROTARYI, ELSET=R\n902, 900\n*ROTARY INERTIA, ELSET=R\n1., 2., 2.5\n"
INERTIA += "*BOUNDARY\n900, 1, 3\n"
ROTATION = MASS.replace("REF NODE=900", "REF NODE=900, ROT NODE=901") + "*BOUNDARY\n901, 1, 3\n"


@pytest.mark.parametrize(
    ("model", "loads", "keys", "moved"),
    [
        (ROTATION, "*CLOAD\n900, 3, 4.\n", {"mass": 6.0}, lambda arm: np.tile([0, 0, 4 / (2 * 8.0)], (8, 1))),
        (
            MASS + "*INITIAL CONDITIONS, TYPE=VELOCITY\n900, 3, 2.\n", "", {"mass": 6.0},
            lambda arm: np.tile([0, 0, 2.0], (8, 1)),
        ),
        (
            INERTIA, "*CLOAD\n900, 6, 0.004\n", {"inertia": (1.0, 2.0, 2.5)},
            lambda arm: np.cross([0, 0, 0.004 / (2 * (2.5 + 2 / 6))], arm),
        ),
    ],
    ids=["force", "velocity", "moment"],
)  # fmt: skip
def test_a_rigid_body_in_motion(tmp_path, model, loads, keys, moved):
    """It moves by F t^2 / 2 m, v t, M t^2 / 2 I, with the mass of its elements and what its reference node adds."""
    text = bodies(CUBE, nu=0.0, more="*DENSITY\n2.\n") + model
    found = solved(tmp_path, text + moving(loads, procedure=", DIRECT, ALPHA=0.", prints=""))
    assert all(getattr(found.made.case.rigid[0], name) == value for name, value in keys.items())
    np.testing.assert_allclose(found.u(CUBE.numbers), moved(CUBE.points - 0.5), rtol=3e-8, atol=1e-12)


def test_steps_and_notes(tmp_path):
    """Without DIRECT the steps are those of the largest increment; natural modes and lone velocities are notes."""
    body = bodies(CUBE, nu=0.0, more="*DENSITY\n100.\n*DAMPING, ALPHA=1.\n") + held()
    steps = moving(PUSH, procedure="", line="0.01, 1., , 0.05") + "*STEP\n*FREQUENCY\n2\n*END STEP\n"
    made = imported(tmp_path, body + steps)
    assert len(made.case.steps.planned) == 20
    assert any("20 equal increments" in finding.message for finding in made.findings)
    made = imported(tmp_path, body + "*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 1, 1.\n" + step(PUSH))
    assert made.case.dynamics is None
    assert sum("without a step of *DYNAMIC" in finding.message for finding in made.findings) == 2
