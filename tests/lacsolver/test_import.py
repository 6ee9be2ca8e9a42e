"""Decks of our own with exact solutions: imported, solved, compared."""

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.lacsolver.deck_texts import ELASTIC, Block, held, imported, section, solved, step

E, NU = 1000.0, 0.3
COLUMN = Block(high=(1, 2, 3), cells=(1, 2, 2))
TOP_SURFACE = "*SURFACE, NAME=TOP\nB_EZ1, S2\n"


def column(more, loads, *, nu=NU, block=COLUMN, options=""):
    return block.text() + TOP_SURFACE + section(nu=nu, more=more) + held() + step(loads, options)


@pytest.mark.parametrize("loads", ["*DLOAD\nB_EZ1, P2, 20.\n", "*DSLOAD\nTOP, P, 20.\n"])
def test_column_under_pressure(tmp_path, loads):
    found = solved(tmp_path, column("", loads))
    X = COLUMN.points
    exact = 20 / E * np.stack([NU * X[:, 0], NU * X[:, 1], -X[:, 2]], axis=1)
    assert np.allclose(found.u(COLUMN.numbers), exact, atol=1e-12)
    assert found.made.case.pressure[0].group == ("TOP" if "DS" in loads else "B_EZ1_P2")


def test_loads_of_one_step_add(tmp_path):
    """Pressures and forces that a step lists twice for one place add, as in CalculiX."""
    top = COLUMN.at(2, 3)
    middle = COLUMN.points[COLUMN.numbers.searchsorted(top), 1] == 1
    forces = "*CLOAD\n" + "".join(f"{n}, 3, {-5.0 if m else -2.5}\n" for n, m in zip(top, middle, strict=True))
    found = solved(tmp_path, column("", "*DLOAD\nB_EZ1, P2, 5.\n*DLOAD\nB_EZ1, P2, 5.\n" + forces + forces))
    assert np.allclose(found.u(top)[:, 2], -(10 + 2 * 20 / 2) / E * 3, rtol=1e-12)


def test_pressure_follows_with_nlgeom(tmp_path):
    """Without a lateral strain (nu = 0) the stretch solves lambda (lambda^2 - 1) / 2 E = -p."""
    found = solved(tmp_path, column("", "*DLOAD\nB_EZ1, P2, 100.\n", nu=0.0, options=", NLGEOM"))
    stretch = max(np.roots([E / 2, 0, -E / 2, 100.0]).real)
    assert found.made.case.kinematics == "finite"
    assert found.made.case.pressure[0].follower
    assert np.allclose(found.u(COLUMN.at(2, 3))[:, 2], 3 * (stretch - 1), rtol=1e-9)


def test_thermal_expansion(tmp_path):
    more = "*EXPANSION, ZERO=0.\n1e-4\n"
    loads = "*TEMPERATURE\nB_N, 120.\n"
    text = column(more, loads).replace("*STEP", "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nB_N, 20.\n*STEP")
    found = solved(tmp_path, text)
    assert np.allclose(found.u(COLUMN.numbers), 1e-4 * 100 * COLUMN.points, atol=1e-13)
    assert found.made.case.material[0].reference_temperature == 20.0


def test_temperatures_of_two_parts(tmp_path):
    """Two blocks on their own, with initial temperatures of their own: two materials, two temperatures."""
    other = Block("C", (5, 0, 0), (6, 1, 1), first=100)
    deck = Block().text() + other.text() + ELASTIC.format(nu=NU) + "*EXPANSION\n1e-4\n"
    deck += "*SOLID SECTION, ELSET=B, MATERIAL=EL\n*SOLID SECTION, ELSET=C, MATERIAL=EL\n"
    deck += "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nB_N, 20.\nC_N, 50.\n"
    deck += held("B") + "*BOUNDARY\nC_X0, 1\nC_Y0, 2\nC_Z0, 3\n" + step("*TEMPERATURE\nB_N, 120.\nC_N, 70.\n")
    found = solved(tmp_path, deck)
    assert np.allclose(found.u(Block().at(0, 1))[:, 0], 1e-4 * 100)
    assert np.allclose(found.u(other.at(0, 6))[:, 0], 1e-4 * 20)


def test_gravity(tmp_path):
    """A column that hangs by its weight: w = rho g (z - z^2 / 2L) L / E at nodes, exact for nu = 0."""
    found = solved(tmp_path, column("*DENSITY\n2.\n", "*DLOAD\nB, GRAV, 10., 0., 0., 5.\n", nu=0.0))
    z = COLUMN.points[:, 2]
    assert np.allclose(found.u(COLUMN.numbers)[:, 2], 2 * 10 / E * (3 * z - z**2 / 2), atol=1e-12)
    assert found.made.case.gravity is not None


def test_gravity_of_a_part(tmp_path):
    """Gravity on the upper half alone: a body force of its density; the reaction is its weight."""
    found = solved(tmp_path, column("*DENSITY\n2.\n", "*DLOAD\nB_EZ1, GRAV, 10., 0., 0., -1.\n", nu=0.0))
    z = COLUMN.points[:, 2]
    below = np.minimum(z, 1.5)
    above = np.maximum(z - 1.5, 0)
    exact = -20 / E * (1.5 * below + 1.5 * above - above**2 / 2)
    assert np.allclose(found.u(COLUMN.numbers)[:, 2], exact, atol=1e-12)


def test_gravity_along_another_direction_adds_to_that_of_earlier_steps(tmp_path):
    """Gravity along the same direction is replaced, as in CalculiX: 10, then 4 along z, and 3 along x beside it."""
    more = "*DENSITY\n2.\n"
    then = step("*DLOAD\nB, GRAV, 4., 0., 0., 2.\nB, GRAV, 3., 1., 0., 0.\n")
    found = solved(tmp_path, column(more, "*DLOAD\nB, GRAV, 10., 0., 0., 1.\n", nu=0.0) + then)
    x, z = COLUMN.points[:, 0], COLUMN.points[:, 2]
    assert np.allclose(found.u(COLUMN.numbers)[:, 2], 2 * 4 / E * (3 * z - z**2 / 2), atol=1e-12)
    assert np.allclose(found.u(COLUMN.numbers)[:, 0], 2 * 3 / E * (x - x**2 / 2), atol=1e-12)


def test_centrifugal_load(tmp_path):
    """A bar that turns about its face z = 0: u = rho omega^2 (L^2 z / 2 - z^3 / 6) / E, exact at nodes."""
    bar = Block(high=(1, 1, 3), cells=(1, 1, 6), element="C3D20")
    text = column("*DENSITY\n2.\n", "*DLOAD\nB, CENTRIF, 5., 0., 0.5, 0., 0., 1., 0.\n", nu=0.0, block=bar)
    found = solved(tmp_path, text)
    assert np.allclose(found.u(bar.at(2, 3))[:, 2].mean(), 2 * 5 * (3**3 / 2 - 3**3 / 6) / E, rtol=1e-6)


def test_steps_and_amplitudes(tmp_path):
    """A displacement along a table in step 1, held in step 2, ramped in step 3; forces stay until they are changed."""
    deck = COLUMN.text() + section(nu=0.0) + held() + "*AMPLITUDE, NAME=A\n0., 0., 0.5, 1., 1., 0.5\n"
    deck += step("*BOUNDARY, AMPLITUDE=A\nB_Z1, 3, 3, 0.2\n", static="0.25, 1., , 0.25\n")
    deck += step("*BOUNDARY\nB_Z1, 3, 3, 0.1\n", static="1., 2.\n")
    deck += step("*BOUNDARY\nB_Z1, 3, 3, -0.3\n", static="0.5, 1.\n")
    found = solved(tmp_path, deck)
    by_time = {round(state.time, 9): found.u(COLUMN.at(2, 3), k)[:, 2] for k, state in enumerate(found.states)}
    expected = {0.25: 0.1, 0.5: 0.2, 0.75: 0.15, 1.0: 0.1, 2.0: 0.1, 3.0: 0.1, 3.5: -0.1, 4.0: -0.3}
    assert set(by_time) == set(expected)
    assert all(np.allclose(by_time[t], value, atol=1e-12) for t, value in expected.items())


def test_sets_that_overlap_over_steps(tmp_path):
    """Step 2 changes the force on one node of a set: it replaces that of step 1 there, and leaves the others."""
    top = COLUMN.at(2, 3).tolist()
    deck = COLUMN.text() + section(nu=0.0) + held()
    deck += step("*CLOAD\nB_Z1, 3, 4.\n") + step(f"*CLOAD\n{top[0]}, 3, 1.\n")
    made = imported(tmp_path, deck)
    end = {record.group: float(record.fz.at(2.0)) for record in made.case.force}
    middle = {record.group: float(record.fz.at(1.0)) for record in made.case.force}
    assert sorted(end.values()) == [1.0, 4.0]
    assert set(middle.values()) == {4.0}
    assert sum(len(made.mesh.node_groups[name]) for name in end) == len(top)


@pytest.mark.parametrize(
    "support, options, ways",
    [
        ("*BOUNDARY\nB_Z1, 3, 3, -0.06\n", "", [-0.075, -0.06]),
        ("*BOUNDARY\nB_Z1, 3\n", "", [-0.045, 0.0]),
        ("*BOUNDARY\nB_Z1, 3, 3, -0.06\n", ", AMPLITUDE=STEP", [-0.06, -0.06]),
        ("*AMPLITUDE, NAME=A\n0, 0, 1, 1\n*BOUNDARY, AMPLITUDE=A\nB_Z1, 3, 3, -0.06\n", "", [-0.03, -0.06]),
    ],
)
def test_a_support_that_begins_in_the_second_step(tmp_path, support, options, ways):
    """Nodes go from where the pressure has taken them, -30 / E * 3, to the value; an amplitude has it at once."""
    cards, _, line = support.rpartition("*BOUNDARY")
    second = "*END STEP\n*STEP" + options + "\n*STATIC\n0.5, 1.\n*BOUNDARY" + line
    text = column("", "*DLOAD\nB_EZ1, P2, 30.\n" + second)
    found = solved(tmp_path, text.replace("*STEP\n", cards + "*STEP\n", 1))
    late = found.made.case.displacement[-1]
    assert late.begin == 1.0
    assert [one.time for one in found.states] == [1.0, 1.5, 2.0]
    exact = np.array([-0.09, *ways])
    for k, way in enumerate(exact):
        X = COLUMN.points / 3
        u = way * np.stack([-NU * X[:, 0], -NU * X[:, 1], X[:, 2]], axis=1)
        np.testing.assert_allclose(found.u(COLUMN.numbers, k), u, rtol=1e-6, atol=1e-10)
    row = text.splitlines().index("*BOUNDARY" + line.splitlines()[0], text.splitlines().index("*END STEP"))
    assert f"line {row + 1 + cards.count(chr(10))})\n[[displacement]]\ngroup" in found.made.text


@pytest.mark.parametrize("earlier, way", [("", -0.09), ("*BOUNDARY\nB_Z1, 3, 3, -0.06\n", -0.06)])
def test_nodes_that_are_fixed_in_the_second_step(tmp_path, earlier, way):
    """BOUNDARY, FIXED: nodes stay where a pressure, or a displacement, has taken them, whatever comes then."""
    step = "*END STEP\n*STEP\n*STATIC\n1., 1.\n*BOUNDARY, FIXED\nB_Z1, 3, 3\n*DLOAD\nB_EZ1, P2, 50.\n"
    found = solved(tmp_path, column("", ("" if earlier else "*DLOAD\nB_EZ1, P2, 30.\n") + earlier + step + step))
    assert [record.begin for record in found.made.case.displacement if record.begin] == ([] if earlier else [1.0])
    top = COLUMN.at(2, 3)
    for k in range(3):
        np.testing.assert_allclose(found.u(top, k)[:, 2], way, rtol=1e-6)


def test_sudden_step(tmp_path):
    deck = COLUMN.text() + section(nu=0.0) + held()
    deck += step("*CLOAD\nB_Z1, 3, 4.\n") + step("*CLOAD\nB_Z1, 3, -8.\n", ", AMPLITUDE=STEP", "0.5, 1.\n")
    (force,) = imported(tmp_path, deck).case.force
    assert [force.fz.at(t) for t in (0.5, 1.0, 1.5, 2.0)] == [2.0, 4.0, -8.0, -8.0]


def test_nlgeom_stays(tmp_path):
    """A step without NLGEOM after one with it is one of finite displacements too, in both programs."""
    deck = COLUMN.text() + section(nu=0.0) + held() + step("*CLOAD\nB_Z1, 3, 4.\n", ", NLGEOM")
    made = imported(tmp_path, deck + step("*CLOAD\nB_Z1, 3, 1.\n") + "*STEP, PERTURBATION\n*FREQUENCY\n3\n*END STEP\n")
    assert made.case.kinematics == "finite"
    assert made.case.steps.last == 2.0
    assert any("lacsolver modes CASE.toml -k 3, with --state DIR" in finding.message for finding in made.findings)


def test_springs_to_the_ground(tmp_path):
    """A block held by springs at its four lower nodes alone: they share its load."""
    block = Block()
    deck = block.text() + section(nu=0.0) + "*BOUNDARY\nB_X0, 1\nB_Y0, 2\n"
    deck += "*ELEMENT, TYPE=SPRING1, ELSET=SP\n" + "".join(f"{50 + k}, {n}\n" for k, n in enumerate(block.at(2, 0)))
    deck += "*SPRING, ELSET=SP\n3\n25.\n" + step("*DLOAD\nB, P2, 10.\n")
    found = solved(tmp_path, deck)
    assert np.allclose(found.u(block.at(2, 0))[:, 2], -10 / 100)
    assert np.allclose(found.u(block.at(2, 1))[:, 2], -10 / 100 - 10 / E)


def hanging(kind, spring, options=""):
    """A block on another one's springs between their corners, the upper one held sideways, and a force down on it."""
    below, above = Block("B"), Block("C", (0.5, 0.5, 2), (1.5, 1.5, 3), first=100)
    deck = below.text() + above.text() + section("B", nu=0.0) + "*SOLID SECTION, ELSET=C, MATERIAL=EL\n"
    pairs = zip(below.at(2, 1), above.at(2, 2), strict=True)
    deck += f"*ELEMENT, TYPE={kind}, ELSET=SP\n" + "".join(f"{900 + k}, {a}, {b}\n" for k, (a, b) in enumerate(pairs))
    deck += f"*SPRING, ELSET=SP\n{spring}*BOUNDARY\nB_Z0, 1, 3\nC_N, 1, 2\n"
    return deck + step("*CLOAD\nC_Z1, 3, -3.\n*NODE PRINT, NSET=C_N\nU\n", options), below, above


def test_springs_between_nodes_by_components(tmp_path):
    """A column, four springs and a block in series, each with the force of 12."""
    deck, below, above = hanging("SPRING2", "3, 3\n25.\n")
    found = solved(tmp_path, deck)
    assert len(found.made.case.spring) == 4
    assert np.allclose(found.u(below.at(2, 1))[:, 2], -12 / E)
    assert np.allclose(found.u(above.at(2, 2))[:, 2], -12 / E - 12 / 100)
    assert np.allclose(found.u(above.at(2, 3))[:, 2], -12 / E - 12 / 100 - 12 / E)


def test_springs_along_the_lines_of_their_nodes(tmp_path):
    """Each has k n^2 along z, with n = 1 / sqrt(1.5) of its undeformed line."""
    deck, below, above = hanging("SPRINGA", "\n25.\n")
    found = solved(tmp_path, deck.replace("C_N, 1, 2\n", "C_N, 1, 2\nB_N, 1, 2\n"))
    assert [spring.k for spring in found.made.case.spring] == [25.0] * 4
    assert np.allclose(found.u(above.at(2, 2))[:, 2] - found.u(below.at(2, 1))[:, 2], -12 / (100 / 1.5))


PAIR = "*SURFACE, NAME=LOWER\nB_EZ1, S2\n*SURFACE, NAME=UPPER\nC_EZ0, S1\n"


def two_blocks(upper=0.0, lower=(2, 2, 1), cells=(3, 3, 1), element="C3D8"):
    """Two blocks of meshes that do not match, one on the other, with a gap `upper`."""
    below = Block("B", cells=lower, element=element)
    above = Block("C", (0, 0, 1 + upper), (1, 1, 2 + upper), cells, element, first=1000)
    return below, above


def on_each_other(below, above, between, loads, *, options="", nu=NU, static=""):
    deck = below.text() + above.text() + PAIR + section("B", nu=nu)
    deck += "*SOLID SECTION, ELSET=C, MATERIAL=EL\n" + held("B") + "*BOUNDARY\nC_X0, 1\nC_Y0, 2\n"
    return deck + between + step(loads, options, static)


CONTACT = "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nUPPER, LOWER\n*SURFACE INTERACTION, NAME=SI\n"


@pytest.mark.parametrize("element", ["C3D8", "C3D20"])
@pytest.mark.parametrize(
    "behaviour",
    [
        "",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000.\n",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n10., 0.003\n40., 0.006\n",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL\n0.004, 20.\n",
    ],
)
def test_patch_of_two_blocks(tmp_path, element, behaviour):
    """A uniform pressure goes through a contact of meshes that do not match; soft contact overlaps by p of its law."""
    below, above = two_blocks(element=element)
    found = solved(tmp_path, on_each_other(below, above, CONTACT + behaviour, "*DLOAD\nC_EZ1, P2, 20.\n"))
    overlap = 20 / 5000 if "LINEAR" in behaviour or "TABULAR" in behaviour else 0.0
    assert np.allclose(found.zone.pressure, 20, rtol=1e-9)
    assert np.allclose(found.u(above.at(2, 2))[:, 2], -20 / E * 2 - overlap, rtol=1e-9)
    assert np.allclose(found.u(above.at(0, 1))[:, 0], NU * 20 / E, rtol=1e-9)


def test_forces_and_springs_on_a_slave(tmp_path):
    """The cut of the slave adds nodes to sets that hold its faces; forces and springs stay on the nodes of the deck."""
    below, above = two_blocks()
    springs = "*ELEMENT, TYPE=SPRING1, ELSET=SP\n" + "".join(f"{5000 + n}, {n}\n" for n in above.at(2, 1))
    deck = on_each_other(below, above, CONTACT, "*CLOAD\nC_Z0, 3, -1.\nC_Z1, 3, -1.\n", nu=0.0)
    deck = deck.replace("*CONTACT PAIR", springs + "*SPRING, ELSET=SP\n3\n10.\n*CONTACT PAIR", 1)
    found = solved(tmp_path, deck)
    held_back = 10 * found.u(above.at(2, 1))[:, 2].sum()
    assert len(found.made.case.force) == 2
    mesh = found.problem.space.mesh
    assert len(mesh.node_groups["C_Z0"]) == 16 + 9
    assert found.zone.pressure.mean() == pytest.approx(2 * 16 + held_back)


def test_slave_of_nodes(tmp_path):
    """A surface of nodes is taken as the faces on its nodes, and a note says so."""
    below, above = two_blocks()
    deck = on_each_other(below, above, CONTACT.replace("UPPER, LOWER", "NODES, LOWER"), "*DLOAD\nC_EZ1, P2, 20.\n")
    deck = deck.replace("*CONTACT PAIR", "*SURFACE, NAME=NODES, TYPE=NODE\nC_Z0\n*CONTACT PAIR")
    found = solved(tmp_path, deck)
    assert np.allclose(found.zone.pressure, 20, rtol=1e-9)
    assert any("taken as the 9 faces" in finding.message for finding in found.made.findings)


def test_clearance_replaces_the_gap(tmp_path):
    """With 0.1 between the meshes and a *CLEARANCE of 0.02 the blocks touch after 0.02."""
    below, above = two_blocks(0.1)
    between = CONTACT + "*CLEARANCE, SLAVE=UPPER, MASTER=LOWER, VALUE=0.02\n"
    found = solved(tmp_path, on_each_other(below, above, between, "*BOUNDARY\nC_Z1, 3, 3, -0.05\n", nu=0.0))
    assert np.allclose(found.zone.pressure, (0.05 - 0.02) / 2 * E, rtol=1e-9)


def test_contact_with_nlgeom(tmp_path):
    """Contact of finite displacements: stretches of both blocks as in one column."""
    below, above = two_blocks()
    found = solved(tmp_path, on_each_other(below, above, CONTACT, "*BOUNDARY\nC_Z1, 3, 3, -0.4\n", nu=0.0,
                                           options=", NLGEOM", static="0.5, 1.\n"))  # fmt: skip
    stretch = 0.8
    assert np.allclose(found.zone.pressure, -E / 2 * stretch * (stretch**2 - 1), rtol=1e-8)


def test_contact_that_is_removed_and_added(tmp_path):
    """Without contact the upper block goes through the lower one; with it both share the overlap; then it is gone."""
    below, above = two_blocks()
    change = "*MODEL CHANGE, TYPE=CONTACT PAIR, {}\nUPPER, LOWER\n"
    deck = on_each_other(below, above, CONTACT, change.format("REMOVE") + "*BOUNDARY\nC_Z1, 3, 3, -0.02\n", nu=0.0)
    deck += step(change.format("ADD")) + step("") + step(change.format("REMOVE"))
    found = solved(tmp_path, deck)
    pressures = {round(state.time, 6): state.zones[0].pressure for state in found.states}
    assert not pressures[1.0].any() and not pressures[4.0].any()
    assert np.allclose(pressures[2.0], 0.02 / 2 * E, rtol=1e-9) and np.allclose(pressures[3.0], pressures[2.0])


@pytest.mark.parametrize("first", ["ADD", "REMOVE"])
def test_a_clearance_of_contact_that_is_removed(tmp_path, first):
    """The clearance counts in the steps that have the contact, whether the first has it or not."""
    below, above = two_blocks()
    change = "*MODEL CHANGE, TYPE=CONTACT PAIR, {}\nUPPER, LOWER\n"
    clearance = "*CLEARANCE, SLAVE=UPPER, MASTER=LOWER, VALUE=0.005\n"
    moved = change.format(first) + "*BOUNDARY\nC_Z1, 3, 3, -0.02\n"
    deck = on_each_other(below, above, CONTACT + clearance, moved, nu=0.0)
    deck += step(change.format("ADD")) + step(change.format("REMOVE"))
    found = solved(tmp_path, deck)
    pressures = {round(state.time, 6): state.zones[0].pressure for state in found.states}
    assert np.allclose(pressures[1.0], 0.015 / 2 * E if first == "ADD" else 0.0, rtol=1e-9)
    assert np.allclose(pressures[2.0], 0.015 / 2 * E, rtol=1e-9) and not pressures[3.0].any()


def test_a_tie_without_a_tolerance_bridges_what_calculix_does(tmp_path):
    """2.5 % of an element: surfaces that are farther apart are not tied, and a warning tells."""
    below, above = two_blocks(upper=0.02)
    made = imported(tmp_path, on_each_other(below, above, "*TIE, NAME=T\nUPPER, LOWER\n", "*DLOAD\nC_EZ1, P2, 1.\n"))
    (warning,) = [one.text for one in made.findings if one.level == "warning"]
    assert "it is not tied; give the tolerance" in warning and not made.case.tie
    below, above = two_blocks(upper=0.005)
    text = on_each_other(below, above, "*TIE, NAME=T\nUPPER, LOWER\n", "*DLOAD\nC_EZ1, P2, -20.\n")
    found = solved(tmp_path, text)
    (tie,) = found.made.case.tie
    assert tie.search_distance == pytest.approx(0.025 / 3) and found.zone.status.all()


@pytest.mark.parametrize(
    "between",
    [
        "*TIE, NAME=T, POSITION TOLERANCE=0.1\nUPPER, LOWER\n",
        CONTACT + "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n1e6\n*FRICTION\n0.5, 1e6\n",
    ],
)
def test_tie(tmp_path, between):
    below, above = two_blocks()
    found = solved(tmp_path, on_each_other(below, above, between, "*DLOAD\nC_EZ1, P2, -20.\n"))
    assert len(found.made.case.tie) == 1
    assert np.allclose(found.u(above.at(2, 2))[:, 2], 20 / E * 2, rtol=1e-9)


def test_rigid_body(tmp_path):
    """The upper face is rigid, pulled by its reference node, which is no node of an element."""
    deck = COLUMN.text() + "*NODE\n900, 0.5, 1., 3.\n" + section(nu=0.0) + "*BOUNDARY\nB_Z0, 3\nB_Z0, 1, 2\n"
    deck += "*RIGID BODY, NSET=B_Z1, REF NODE=900\n*BOUNDARY\n900, 1, 2\n900, 4, 6\n"
    found = solved(tmp_path, deck + step("*CLOAD\n900, 3, 8.\n"))
    (rigid,) = found.made.case.rigid
    assert rigid.centre == (0.5, 1.0, 3.0)
    assert np.allclose(found.u(COLUMN.at(2, 3))[:, 2], 8 / 2 / E * 3, rtol=1e-9)


def test_rigid_body_turns_about_its_rotation_node(tmp_path):
    """Twist of a rigid face by a rotation node of CalculiX: every node turns about the reference node."""
    deck = COLUMN.text() + "*NODE\n900, 0.5, 1., 3.\n901, 0.5, 1., 3.\n" + section() + "*BOUNDARY\nB_Z0, 1, 3\n"
    deck += "*RIGID BODY, NSET=B_Z1, REF NODE=900, ROT NODE=901\n*BOUNDARY\n900, 1, 3\n901, 1, 2\n"
    found = solved(tmp_path, deck + step("*BOUNDARY\n901, 3, 3, 0.001\n"))
    arm = COLUMN.points[COLUMN.numbers.searchsorted(COLUMN.at(2, 3))] - [0.5, 1, 3]
    exact = 0.001 * np.stack([-arm[:, 1], arm[:, 0], 0 * arm[:, 0]], axis=1)
    assert np.allclose(found.u(COLUMN.at(2, 3)), exact, atol=1e-12)


ORTHOTROPIC = (
    "*MATERIAL, NAME=W\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1000., 500., 200., 0.3, 0.2, 0.1, 150., 120.,\n90.\n"
)


def test_orthotropic_material_in_turned_axes(tmp_path):
    """Axis 1 along z: a column under p shortens by p / E1, and widens along y (axis 2) by nu12 p / E1."""
    deck = COLUMN.text() + ORTHOTROPIC + "*ORIENTATION, NAME=O\n0., 0., 1., 0., 1., 0.\n"
    deck += "*SOLID SECTION, ELSET=B, MATERIAL=W, ORIENTATION=O\n" + held() + step("*DLOAD\nB_EZ1, P2, 20.\n")
    u, X = solved(tmp_path, deck).u(COLUMN.numbers), COLUMN.points
    assert np.allclose(u[:, 2], -20 / 1000 * X[:, 2], atol=1e-12)
    assert np.allclose(u[:, 1], 0.3 * 20 / 1000 * X[:, 1], atol=1e-12)
    assert np.allclose(u[:, 0], 0.2 * 20 / 1000 * X[:, 0], atol=1e-12)


@pytest.mark.parametrize("kind", ["ORTHO", "ANISO"])
def test_stiffness_and_engineering_constants_agree(tmp_path, kind):
    S = np.array([[1 / 1000, -0.3 / 1000, -0.2 / 1000], [0, 1 / 500, -0.1 / 500], [0, 0, 1 / 200]])
    D = np.linalg.inv(S + np.triu(S, 1).T)
    d11, d12, d22, d13, d23, d33 = (D[k] for k in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))
    shear = (150.0, 120.0, 90.0)
    values = [d11, d12, d22, d13, d23, d33, *shear]
    if kind == "ANISO":
        values = [*values[:6], 0, 0, 0, 150.0, 0, 0, 0, 0, 120.0, 0, 0, 0, 0, 0, 90.0]
    lines = [", ".join(f"{float(v)!r}" for v in values[k : k + 8]) for k in range(0, len(values), 8)]
    deck = COLUMN.text() + f"*MATERIAL, NAME=W\n*ELASTIC, TYPE={kind}\n" + "\n".join(lines) + "\n"
    deck += "*SOLID SECTION, ELSET=B, MATERIAL=W\n" + held() + step("*DLOAD\nB_EZ1, P2, 20.\n")
    (material,) = imported(tmp_path, deck).case.material
    assert np.allclose(material.young, (1000, 500, 200), rtol=1e-12)
    assert np.allclose(material.poisson, (0.3, 0.2, 0.1), rtol=1e-12)
    assert material.shear == shear


def test_neo_hookean(tmp_path):
    """C10 and D1 give the shear and the bulk modulus; a column has the stretches of the law with these."""
    deck = column("", "*BOUNDARY\nB_Z1, 3, 3, 0.9\n", options=", NLGEOM").replace(
        "*ELASTIC\n1000., 0.3\n", "*HYPERELASTIC, NEO HOOKE\n40., 0.01\n"
    )
    found = solved(tmp_path, deck)
    mu, bulk = 80.0, 200.0
    lame = bulk - 2 * mu / 3
    axial = 1.3
    # no stress across: mu (b - 1) + lame ln J = 0, with b = across^2 and J = axial b
    across = np.sqrt(brentq(lambda b: mu * (b - 1) + lame * np.log(axial * b), 0.1, 1.0, xtol=1e-14))
    assert np.allclose(found.u(COLUMN.at(0, 1))[:, 0], across - 1, rtol=1e-7)


def test_plane_strain_of_a_thickness(tmp_path):
    """Forces are those of the whole thickness."""
    deck = "*NODE, NSET=N\n1, 0, 0\n2, 1, 0\n3, 1, 2\n4, 0, 2\n*ELEMENT, TYPE=CPE4, ELSET=B\n1, 1, 2, 3, 4\n"
    deck += "*MATERIAL, NAME=EL\n*ELASTIC\n1000., 0.\n*SOLID SECTION, ELSET=B, MATERIAL=EL\n4.\n"
    deck += "*BOUNDARY\n1, 1, 3\n2, 2\n" + step("*CLOAD\n3, 2, 6.\n4, 2, 6.\n")
    found = solved(tmp_path, deck)
    assert found.made.case.model == "plane_strain"
    assert found.made.case.force[0].fy.source == 6.0
    assert np.allclose(found.u([3, 4])[:, 1], 12 / 4 / E * 2)


@pytest.mark.parametrize("element", ["CPS4", "CPE4"])
def test_sections_of_several_thicknesses(tmp_path, element):
    """Two plates one over the other, 4 and 2 thick: 12 / (E A) h of each; a third one shares the second's section."""
    deck = "*NODE\n" + "".join(
        f"{1 + 2 * k + j}, {j + 3 * (k > 3)}, {k - (k > 1) - 3 * (k > 3)}\n" for k in range(6) for j in (0, 1)
    )
    deck += f"*ELEMENT, TYPE={element}, ELSET=LOW\n1, 1, 2, 4, 3\n"
    deck += (
        f"*ELEMENT, TYPE={element}, ELSET=UP\n2, 5, 6, 8, 7\n*ELEMENT, TYPE={element}, ELSET=BESIDE\n3, 9, 10, 12, 11\n"
    )
    deck += ELASTIC.format(nu=0.0) + "".join(
        f"*SOLID SECTION, ELSET={name}, MATERIAL=EL\n{thick}\n"
        for name, thick in (("LOW", 4), ("UP", 2), ("BESIDE", 2))
    )
    deck += "*SURFACE, NAME=S\nUP, S1\n*SURFACE, NAME=M\nLOW, S3\n*TIE, NAME=T, POSITION TOLERANCE=0.1\nS, M\n"
    deck += "*BOUNDARY\n1, 1, 2\n2, 1, 2\n9, 1, 2\n10, 1, 2\n5, 1\n7, 1\n" + step(
        "*CLOAD\n7, 2, 6.\n8, 2, 6.\n12, 2, 1.\n11, 2, 1.\n"
    )
    found = solved(tmp_path, deck)
    assert found.made.case.thickness == {"LOW": 4.0, "thick": 2.0}
    assert np.allclose(found.u([3, 4])[:, 1], 12 / 4 / E, rtol=1e-9)
    assert np.allclose(found.u([7, 8])[:, 1], 12 / 4 / E + 12 / 2 / E, rtol=1e-9)
    assert np.allclose(found.u([11, 12])[:, 1], 2 / 2 / E, rtol=1e-9)


@pytest.mark.parametrize(("element", "model"), [("CPS4", "plane_stress"), ("CAX4", "axisymmetric")])
def test_plane_models(tmp_path, element, model):
    """Plane stress of a thickness, and a ring: pulled by forces, those of the ring of its full circle."""
    deck = f"*NODE\n1, 1, 0\n2, 2, 0\n3, 2, 2\n4, 1, 2\n*ELEMENT, TYPE={element}, ELSET=B\n1, 1, 2, 3, 4\n"
    deck += "*MATERIAL, NAME=EL\n*ELASTIC\n1000., 0.\n*SOLID SECTION, ELSET=B, MATERIAL=EL\n4.\n"
    deck += "*BOUNDARY\n1, 2\n2, 2\n" + ("1, 1\n" if element == "CPS4" else "")
    area = 4.0 if element == "CPS4" else np.pi * (2**2 - 1)
    shares = (0.5, 0.5) if element == "CPS4" else (np.pi * 4 / 3 / area, np.pi * 5 / 3 / area)  # consistent forces
    load = step(f"*CLOAD\n4, 2, {12 * shares[0]!r}\n3, 2, {12 * shares[1]!r}\n")
    found = solved(tmp_path, deck + load)
    assert found.made.case.model == model
    assert np.allclose(found.u([3, 4])[:, 1], 12 / area / E * 2, rtol=1e-9)


def test_probes_and_notes(tmp_path):
    text = column("", "*DLOAD\nB_EZ1, P2, 20.\n*NODE PRINT, NSET=B_Z1\nU, RF\n*EL PRINT, ELSET=B\nS\n*NODE FILE\nU\n")
    found = solved(tmp_path, text)
    assert len(found.made.case.probe) == len(COLUMN.at(2, 3))
    levels = {finding.card: finding.level for finding in found.made.findings}
    assert levels == {"NODE PRINT": "note", "EL PRINT": "note", "NODE FILE": "note"}


def test_names_of_sides_and_supports(tmp_path):
    """Supports keep the names of their sets; a set of elements that has the name of a surface keeps its own."""
    deck = COLUMN.text() + "*SURFACE, NAME=B\nB_EZ1, S2\n" + section() + held() + step("*DSLOAD\nB, P, 20.\n")
    made = imported(tmp_path, deck)
    assert {record.group for record in made.case.displacement} == {"B_X0", "B_Y0", "B_Z0"}
    (pressure,) = made.case.pressure
    assert len(made.mesh.cell_groups[pressure.group]) == 2
    assert np.allclose(solved(tmp_path, deck).u(COLUMN.at(2, 3))[:, 2], -20 / E * 3)


ABAQUS = """\
*Heading
** Job name: press
*Preprint, echo=NO, model=NO
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
*Boundary
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
*Output, history
*Node Output
U,
*End Step
"""


def test_a_deck_as_abaqus_writes_it(tmp_path):
    """A part, its instance, an assembly; supports by their names; output that is noted."""
    below, above = two_blocks()
    found = solved(tmp_path, ABAQUS.format(mesh=below.text() + above.text()))
    assert np.allclose(found.zone.pressure, 20, rtol=1e-9)
    assert np.allclose(found.u(above.at(2, 2))[:, 2], -20 / E * 2, rtol=1e-9)
    assert {finding.level for finding in found.made.findings} == {"note"}


def test_names_in_quotes_are_those_of_parts_and_instances(tmp_path):
    """Abaqus quotes names with blanks; the deck is the same as with names of one word."""
    below, above = two_blocks()
    text = ABAQUS.format(mesh=below.text() + above.text())
    for name, quoted in (("Body-1", '"The body-1"'), ("Body\n", '"The body"\n')):
        text = text.replace(name, quoted)
    found = solved(tmp_path, text)
    assert '"The body-1".B_EZ1' in text and 'part="The body"' in text
    assert np.allclose(found.zone.pressure, 20, rtol=1e-9)


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
    below, above = two_blocks()
    made = imported(tmp_path, on_each_other(below, above, CONTACT + cards, "*DLOAD\nC_EZ1, P2, 20.\n"))
    (contact,) = made.case.contact
    assert contact.friction.source == friction
    assert (contact.shear_limit and contact.shear_limit.source) == limit


STIFFER = "*CHANGE SURFACE BEHAVIOR, INTERACTION=SI\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n8000.\n"


def softly(loads=("", STIFFER, "")):
    """Two blocks under a pressure of 20 on linear contact, which steps may change."""
    below, above = two_blocks()
    law = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000.\n"
    deck = on_each_other(below, above, CONTACT + law, f"{loads[0]}*DLOAD\nC_EZ1, P2, 20.\n*NODE PRINT, NSET=C_N\nU\n")
    return deck + "".join(step(f"{load}*NODE PRINT, NSET=C_N\nU\n") for load in loads[1:]), above


def test_pressure_per_overlap_that_a_step_changes(tmp_path):
    """It is that of the model in the first step, and another one from the second step on."""
    deck, above = softly()
    found = solved(tmp_path, deck)
    for time, stiffness in ((1.0, 5000), (2.0, 8000), (3.0, 8000)):
        (k,) = (k for k, state in enumerate(found.states) if abs(state.time - time) < 1e-9)
        assert np.allclose(found.u(above.at(2, 2), k)[:, 2], -20 / E * 2 - 20 / stiffness, rtol=1e-9)
    (contact,) = imported(tmp_path, softly(("", ""))[0]).case.contact
    assert contact.stiffness.source == 5000


def test_friction_that_steps_change(tmp_path):
    """A block that is pressed and pushed slides with the coefficient of each step."""
    below, above = Block("B", high=(2, 1, 1), cells=(4, 1, 2)), Block("C", (0, 0, 1), (2, 1, 2), (3, 2, 2), first=10000)
    deck = below.text() + above.text() + PAIR + section("B", nu=0.0) + "*SOLID SECTION, ELSET=C, MATERIAL=EL\n"
    deck += "*BOUNDARY\nB_Z0, 1, 3\nB_Y0, 2\nC_Y0, 2\n" + CONTACT + "*FRICTION\n0.3\n"
    deck += step("*DLOAD\nC_EZ1, P2, 20.\n*BOUNDARY\nC_X0, 1, 1, 0.1\n")
    for value in (0.1, 0.0):
        change = f"*CHANGE FRICTION, INTERACTION=SI\n*FRICTION\n{value}\n"
        deck += step(change + f"*BOUNDARY\nC_X0, 1, 1, {0.3 - value}\n")
    found = solved(tmp_path, deck)
    zones = {round(state.time, 6): state.zones[0] for state in found.states}
    for time, friction in ((1.0, 0.3), (2.0, 0.1), (3.0, 0.0)):
        force, along = (zones[time].traction * zones[time].area[:, None]).T, np.abs(zones[time].traction[:, :2])
        assert abs(force[2].sum()) == pytest.approx(40, rel=1e-9)
        assert abs(force[0].sum()) == pytest.approx(40 * friction, rel=1e-4, abs=1e-8)
        assert np.allclose(np.hypot(*along.T), friction * zones[time].pressure, rtol=1e-8, atol=1e-8)


def test_a_displacement_among_the_models_data(tmp_path):
    """It grows over the first step, as if it stood in that, and the supports at 0 hold from the start."""
    block = Block("B", high=(1, 1, 1), cells=(1, 1, 2), element="C3D8")
    model = block.text() + section() + held()
    moved = "*BOUNDARY\nB_Z1, 3, 3, -0.01\n"
    print_u = "*NODE PRINT, NSET=B_N\nU\n"
    before, inside = (
        solved(tmp_path, text)  #
        for text in (model + moved + step(print_u), model + step(moved + print_u))
    )
    np.testing.assert_array_equal(before.states[-1].u, inside.states[-1].u)
    assert before.u(block.at(2, 1))[:, 2] == pytest.approx(-0.01)
    (found,) = [one for one in before.made.findings if "among the model's data" in one.message]
    assert found.level == "note"
