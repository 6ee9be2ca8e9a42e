"""Decks of our own with exact solutions: imported, solved, compared. Those with contact are in test_import_contact."""

import numpy as np
import pytest
from scipy.optimize import brentq

import lacmesh
from lacsolver.results.figures import step_figures
from tests.lacsolver.deck_texts import (
    COLUMN,
    ELASTIC,
    Block,
    E,
    bodies,
    column,
    hanging,
    held,
    imported,
    section,
    solved,
    step,
)
from tests.lacsolver.sectors import sector

NU = 0.3
TOP = COLUMN.at(2, 3).tolist()
MIDDLE = [n for n in TOP if COLUMN.points[n - 1, 1] == 1]
CLAMPED = "*BOUNDARY\nB_Z0, 1, 3\n"
#: a node that belongs to no element
REFERENCE = "*NODE\n999, 0.5, 1., 4.\n"


def pulled(nodes, size=20.0):
    return "*CLOAD\n" + "".join(f"{n}, 3, {size / len(nodes)}\n" for n in nodes)


# ---- loads


def stretched(strain, poisson=0.0):
    """Displacements (3,) of places (k, 3) of the column, which is stretched evenly."""
    return lambda x: strain * x * [-poisson, -poisson, 1.0]


def weight(x, height=3.0, force=20.0, low=0.0):
    """Displacements along z by a force for each volume of a column of some height from `low` on."""
    under, own = np.minimum(x[:, 2], low), np.maximum(x[:, 2] - low, 0)
    return force / E * ((height - low) * (under + own) - own**2 / 2)


def along(axis, values):
    return np.eye(3)[axis] * values[:, None]


EACH = "*CLOAD\n" + "".join(f"{n}, 3, {-5.0 if n in MIDDLE else -2.5}\n" for n in TOP)
GRAVITY = "*DLOAD\nB, GRAV, 10., 0., 0., 5.\n"
AGAIN = GRAVITY + "*END STEP\n*STEP\n*STATIC\n*DLOAD\nB, GRAV, 4., 0., 0., 2.\nB, GRAV, 3., 1., 0., 0.\n"
#: cards of the material, of the step, Poisson's ratio, displacements of places
COLUMNS = {
    "pressure on elements": ("", "*DLOAD\nB_EZ1, P2, 20.\n", NU, stretched(-20 / E, NU)),
    "pressure on a surface": ("", "*DSLOAD\nTOP, P, 20.\n", NU, stretched(-20 / E, NU)),
    "loads of one step add": ("", 2 * "*DLOAD\nB_EZ1, P2, 5.\n" + 2 * EACH, NU, stretched(-30 / E, NU)),
    "expansion": (
        "*EXPANSION, ZERO=0.\n1e-4\n", "*TEMPERATURE\nB_N, 120.\n", NU, stretched(1e-2, -1.0),
    ),
    "gravity": ("*DENSITY\n2.\n", GRAVITY, 0.0, lambda x: along(2, weight(x))),
    "gravity of a part": (
        "*DENSITY\n2.\n", "*DLOAD\nB_EZ1, GRAV, 10., 0., 0., 1.\n", 0.0, lambda x: along(2, weight(x, low=1.5)),
    ),
    "gravity of two steps, replaced along its direction": (
        "*DENSITY\n2.\n", AGAIN, 0.0,
        lambda x: along(2, weight(x, force=8.0)) + along(0, weight(x[:, [1, 2, 0]], 1.0, 6.0)),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", COLUMNS)
def test_a_column(tmp_path, name):
    """Loads as in CalculiX: those that a step lists twice for one place add."""
    more, loads, nu, exact = COLUMNS[name]
    warm = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nB_N, 20.\n" if "EXPANSION" in more else ""
    found = solved(tmp_path, column(more, loads, nu=nu).replace("*STEP", warm + "*STEP", 1))
    np.testing.assert_allclose(found.u(COLUMN.numbers), exact(COLUMN.points), atol=1e-12)
    assert [one.group for one in found.made.case.pressure] in ([], ["TOP"], ["B_EZ1_P2"])
    assert (found.made.case.gravity is not None) == (name == "gravity")
    assert found.made.case.material[0].reference_temperature == (20.0 if warm else 0.0)


def test_pressure_follows_with_nlgeom(tmp_path):
    """Without a lateral strain (nu = 0) the stretch solves lambda (lambda^2 - 1) / 2 E = -p."""
    found = solved(tmp_path, column("", "*DLOAD\nB_EZ1, P2, 100.\n", options=", NLGEOM"))
    stretch = max(np.roots([E / 2, 0, -E / 2, 100.0]).real)
    assert found.made.case.kinematics == "finite"
    assert found.made.case.pressure[0].follower
    assert np.allclose(found.u(COLUMN.at(2, 3))[:, 2], 3 * (stretch - 1), rtol=1e-9)


def test_temperatures_of_two_parts(tmp_path):
    """Two blocks on their own, with initial temperatures of their own: two materials, two temperatures."""
    other = Block("C", (5, 0, 0), (6, 1, 1), first=100)
    deck = bodies(Block(), other, more="*EXPANSION\n1e-4\n")
    deck += "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nB_N, 20.\nC_N, 50.\n"
    deck += held("B") + "*BOUNDARY\nC_X0, 1\nC_Y0, 2\nC_Z0, 3\n" + step("*TEMPERATURE\nB_N, 120.\nC_N, 70.\n")
    found = solved(tmp_path, deck)
    assert np.allclose(found.u(Block().at(0, 1))[:, 0], 1e-4 * 100)
    assert np.allclose(found.u(other.at(0, 6))[:, 0], 1e-4 * 20)


def test_centrifugal_load(tmp_path):
    """A bar that turns about its face z = 0: u = rho omega^2 (L^2 z / 2 - z^3 / 6) / E, exact at nodes."""
    bar = Block(high=(1, 1, 3), cells=(1, 1, 6), element="C3D20")
    text = column("*DENSITY\n2.\n", "*DLOAD\nB, CENTRIF, 5., 0., 0.5, 0., 0., 1., 0.\n", nu=0.0, block=bar)
    found = solved(tmp_path, text)
    assert np.allclose(found.u(bar.at(2, 3))[:, 2].mean(), 2 * 5 * (3**3 / 2 - 3**3 / 6) / E, rtol=1e-6)


# ---- steps


AMPLITUDE = "*AMPLITUDE, NAME=A\n0., 0., 0.5, 1., 1., 0.5\n"
FIXED = step("*BOUNDARY, FIXED\nB_Z1, 3, 3\n*DLOAD\nB_EZ1, P2, 50.\n")
#: cards behind the supports of the column, and where its top is by time
TOPS = {
    "a table, held, then along a ramp": (
        AMPLITUDE + step("*BOUNDARY, AMPLITUDE=A\nB_Z1, 3, 3, 0.2\n", static="0.25, 1., , 0.25\n")
        + step("*BOUNDARY\nB_Z1, 3, 3, 0.1\n", static="1., 2.\n")
        + step("*BOUNDARY\nB_Z1, 3, 3, -0.3\n", static="0.5, 1.\n"),
        {0.25: 0.1, 0.5: 0.2, 0.75: 0.15, 1.0: 0.1, 2.0: 0.1, 3.0: 0.1, 3.5: -0.1, 4.0: -0.3},
    ),
    "a load at once": (
        step("*DLOAD\nB_EZ1, P2, 4.\n", static="0.5, 1.\n")
        + step("*DLOAD\nB_EZ1, P2, -8.\n", ", AMPLITUDE=STEP", "0.5, 1.\n"),
        {0.5: -2 * 3 / E, 1.0: -4 * 3 / E, 1.5: 8 * 3 / E, 2.0: 8 * 3 / E},
    ),
    "a load that a step removes": (  # it goes to 0 over that step, as in CalculiX
        step("*DLOAD\nB_EZ1, P2, 4.\n")
        + step("*DLOAD, OP=NEW\n", static="0.5, 1.\n")
        + step("*DLOAD\nB_EZ1, P2, 2.\n"),
        {1.0: -4 * 3 / E, 1.5: -2 * 3 / E, 2.0: 0.0, 3.0: -2 * 3 / E},
    ),
    "an amplitude that begins late": (
        "*AMPLITUDE, NAME=L\n0., 0., 1., 8.\n"
        + step("*DLOAD, AMPLITUDE=L, TIME DELAY=0.5\nB_EZ1, P2, 1.\n", static="0.25, 1.\n"),
        {0.25: 0.0, 0.5: 0.0, 0.75: -2 * 3 / E, 1.0: -4 * 3 / E},
    ),
    "fixed under a pressure": (step("*DLOAD\nB_EZ1, P2, 30.\n") + 2 * FIXED, {1.0: -0.09, 2.0: -0.09, 3.0: -0.09}),
    "fixed": (step("*BOUNDARY\nB_Z1, 3, 3, -0.06\n") + 2 * FIXED, {1.0: -0.06, 2.0: -0.06, 3.0: -0.06}),
    "a displacement among the model's data": (
        "*BOUNDARY\nB_Z1, 3, 3, -0.01\n" + step("", static="0.5, 1.\n"), {0.5: -0.005, 1.0: -0.01},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TOPS)
def test_the_top_of_a_column_over_steps(tmp_path, name):
    """A displacement grows over its step, those of the model's data over the first; fixed nodes stay whatever comes."""
    cards, ways = TOPS[name]
    found = solved(tmp_path, bodies(COLUMN, nu=0.0) + held() + cards)
    by_time = {round(state.time, 9): found.u(TOP, k)[:, 2] for k, state in enumerate(found.states)}
    assert set(by_time) == set(ways)
    for time, way in ways.items():
        np.testing.assert_allclose(by_time[time], way, atol=1e-12)
    told = [one.level for one in found.made.findings if "among the model's data" in one.message]
    assert told == ["note"] * ("data" in name)


def test_a_moment_and_a_force_that_a_step_removes(tmp_path):
    """OP=NEW removes forces and moments at reference nodes too, and another direction does not keep them."""
    steps = step("*CLOAD\n999, 3, 4.\n999, 4, 2.\n") + step("*CLOAD, OP=NEW\n999, 1, 1.\n")
    rigid = "*NODE\n999, 0, 0, 9\n*RIGID BODY, NSET=B_Z1, REF NODE=999\n"
    made = imported(tmp_path, bodies(COLUMN) + rigid + held() + steps)
    (body,) = made.case.rigid
    assert [body.fz.at(t) for t in (1.0, 1.5, 2.0)] == [4, 2, 0] and [body.fx.at(t) for t in (1.0, 2.0)] == [0, 1]
    assert [body.moment[0].at(t) for t in (1.0, 1.5, 2.0)] == [2, 1, 0]


def test_a_load_beside_the_centre_of_its_weights_is_warned_of(tmp_path):
    """CalculiX lets it act at the centre, Abaqus and lacsolver at the node; a node at the centre has no warning."""
    for x, count in ((0.5, 0), (0.9, 1)):
        node = f"*NODE\n999, {x}, 1., 3.\n*ELEMENT, TYPE=DCOUP3D, ELSET=D\n77, 999\n"
        coupled = f"{node}*DISTRIBUTING COUPLING, ELSET=D\nB_Z1, 1.\n*SOLID SECTION, ELSET=D, MATERIAL=EL\n"
        made = imported(tmp_path, bodies(COLUMN) + coupled + held() + step("*CLOAD\n999, 3, 4.\n"))
        assert sum("centre of the weights" in one.message for one in made.findings) == count
        assert sum("have no material" in one.message for one in made.findings) == 1
        assert made.case.coupling[0].at == (x, 1, 3)


def test_constants_that_are_equal_at_all_temperatures(tmp_path):
    text = bodies(COLUMN).replace("*ELASTIC\n1000., 0.3", "*ELASTIC\n1000., 0.3, 0.\n1000., 0.3, 500.")
    assert imported(tmp_path, text + held() + step("")).case.material[0].young == 1000


@pytest.mark.parametrize(
    "card, hardening, slope",
    [
        ("\n2., 0.\n3., 0.02\n", ((2.0, 0.0), (3.0, 0.02)), 0.0),
        (", HARDENING=KINEMATIC\n2., 0.\n3., 0.02\n", ((2.0, 0.0),), 50.0),
        (", HARDENING=KINEMATIC\n2., 0.\n3., 0.02\n5., 0.06\n", ((2.0, 0.0),), 50.0),
    ],
)
def test_metals_that_yield(tmp_path, card, hardening, slope):
    """Kinematic hardening is linear: lines beyond the second one may have no other slope."""
    (metal,) = imported(tmp_path, bodies(COLUMN, more=f"*PLASTIC{card}") + held() + step("")).case.material
    assert (metal.law, metal.hardening) == ("plastic", hardening) and metal.kinematic == pytest.approx(slope)


def test_modes_with_nodal_diameters_are_warned_of(tmp_path):
    modes = "*STEP, PERTURBATION\n*FREQUENCY\n3\n*SELECT CYCLIC SYMMETRY MODES, NMIN=0, NMAX=2\n*END STEP\n"
    made = imported(tmp_path, bodies(COLUMN) + held() + step("*DLOAD\nB_EZ1, P2, 4.\n") + modes)
    told = {finding.card: finding.level for finding in made.findings}
    assert told["SELECT CYCLIC SYMMETRY MODES"] == "warning" and told["FREQUENCY"] == "note"
    assert made.case.steps.last == 1


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
    text = column("", "*DLOAD\nB_EZ1, P2, 30.\n" + second, nu=NU)
    found = solved(tmp_path, text.replace("*STEP\n", cards + "*STEP\n", 1))
    late = found.made.case.displacement[-1]
    assert late.begin == 1.0
    assert [one.time for one in found.states] == [1.0, 1.5, 2.0]
    for k, way in enumerate([-0.09, *ways]):
        u = stretched(way / 3, NU)(COLUMN.points)
        np.testing.assert_allclose(found.u(COLUMN.numbers, k), u, rtol=1e-6, atol=1e-10)


def test_nlgeom_stays(tmp_path):
    """A step without NLGEOM after one with it is one of finite displacements too, in both programs."""
    deck = bodies(COLUMN) + held() + step("*CLOAD\nB_Z1, 3, 4.\n", ", NLGEOM")
    made = imported(tmp_path, deck + step("*CLOAD\nB_Z1, 3, 1.\n") + "*STEP, PERTURBATION\n*FREQUENCY\n3\n*END STEP\n")
    assert made.case.kinematics == "finite"
    assert made.case.steps.last == 2.0
    assert any("lacsolver modes CASE.toml -k 3, with --state DIR" in finding.message for finding in made.findings)
    alone = imported(tmp_path, bodies(COLUMN, more="*DENSITY\n2.\n") + held() + "*STEP\n*FREQUENCY\n4\n*END STEP\n")
    assert any("lacsolver modes CASE.toml -k 4" in finding.message for finding in alone.findings)


# ---- springs, rigid bodies, bolts


def test_springs_to_the_ground(tmp_path):
    """A block held by springs at its four lower nodes alone: they share its load."""
    block = Block()
    deck = bodies(block, nu=0.0) + "*BOUNDARY\nB_X0, 1\nB_Y0, 2\n"
    deck += "*ELEMENT, TYPE=SPRING1, ELSET=SP\n" + "".join(f"{50 + k}, {n}\n" for k, n in enumerate(block.at(2, 0)))
    deck += "*SPRING, ELSET=SP\n3\n25.\n" + step("*DLOAD\nB, P2, 10.\n")
    found = solved(tmp_path, deck)
    assert np.allclose(found.u(block.at(2, 0))[:, 2], -10 / 100)
    assert np.allclose(found.u(block.at(2, 1))[:, 2], -10 / 100 - 10 / E)


@pytest.mark.parametrize(
    ("kind", "line", "sideways", "stiffness"),
    [("SPRING2", "3, 3\n25.\n", "", 100.0), ("SPRINGA", "\n25.\n", "B_N, 1, 2\n", 100 / 1.5)],
)
def test_springs_between_nodes(tmp_path, kind, line, sideways, stiffness):
    """A column, four springs and a block in series: along z, or along lines with k n^2, n = 1 / sqrt(1.5)."""
    deck, below, above = hanging(kind, line)
    found = solved(tmp_path, deck.replace("C_N, 1, 2\n", "C_N, 1, 2\n" + sideways))
    assert [spring.k for spring in found.made.case.spring] == [25.0 if sideways else None] * 4
    ways = [found.u(nodes)[:, 2] for nodes in (below.at(2, 1), above.at(2, 2), above.at(2, 3))]
    exact = 12 / E + np.array([0.0, 12 / stiffness, 12 / stiffness + 12 / E])
    np.testing.assert_allclose(ways, -np.outer(exact, np.ones(4)), rtol=1e-9)


#: a rigid face that its reference node moves, and that turns with another node
TURNED = "*NODE\n901, 0.5, 1., 4.\n*RIGID BODY, NSET=B_Z1, REF NODE=999, ROT NODE=901\n*BOUNDARY\n"


def test_rigid_body_turns_about_its_rotation_node(tmp_path):
    cards = REFERENCE + TURNED + "999, 1, 3\n901, 1, 2\n"
    found = solved(tmp_path, column(cards, "*BOUNDARY\n901, 3, 3, 0.001\n", supports=CLAMPED))
    arm = COLUMN.points[np.array(TOP) - 1] - [0.5, 1, 3]
    np.testing.assert_allclose(found.u(TOP), 0.001 * np.cross([0, 0, 1], arm), atol=1e-12)


BOLT = "*SURFACE, NAME=MIDDLE\n2, S2\n*NODE\n9999, 5., 5., 5.\n*PRE-TENSION SECTION, SURFACE=MIDDLE, NODE=9999\n"
LOCKED = step("*CLOAD\n9999, 1, 10.\n") + step("*BOUNDARY, FIXED\n9999, 1\n*CLOAD\n9999, 1, 30.\n")


@pytest.mark.parametrize(
    ("normal", "steps", "lock", "shortenings"),
    [
        ("", LOCKED, 1.0, [0.04, 0.04]),
        ("0., 0., 2.\n", LOCKED, 1.0, [0.04, 0.04]),
        ("", step("*BOUNDARY\n9999, 1, 1, 0.02\n"), None, [0.02]),
    ],
    ids=["locked", "normal", "shortened"],
)
def test_a_bolt(tmp_path, normal, steps, lock, shortenings):
    """A column 4 high, cut across: its force is E A s / 4, and a shortening that is locked stays whatever the force."""
    shank = Block(high=(1, 1, 4), cells=(1, 1, 4))
    ends = "*BOUNDARY\nB_Z0, 1, 3\nB_Z1, 1, 3\n"
    found = solved(tmp_path, bodies(shank, nu=0.0) + BOLT + normal + ends + steps)
    (record,) = found.made.case.pretension
    assert record.lock == lock and (record.normal is None) == (not normal)
    bolts = [step_figures(found.problem, state).pretension["MIDDLE"] for state in found.states]
    np.testing.assert_allclose([bolt.shortening for bolt in bolts], shortenings, rtol=1e-10)
    np.testing.assert_allclose([bolt.force for bolt in bolts], np.multiply(E / 4, shortenings), rtol=1e-10)


# ---- equations, local axes, couplings, sectors

EVEN = 20 / (E * 2)
LEVEL = "*EQUATION\n" + "".join(f"2\n{n}, 3, 1., {TOP[0]}, 3, -1.\n" for n in TOP[1:])
BESIDE = REFERENCE + "*EQUATION\n" + "".join(f"2\n{n}, 3, 2., 999, 1, -4.\n" for n in TOP)
PLANE = "*MPC\nPLANE, " + ", ".join(map(str, [TOP[0], TOP[1], TOP[-1], *TOP[2:-1]])) + "\n"
#: local 1 is y, 2 is -x, 3 is z
LOCAL = "*TRANSFORM, NSET=B_N\n0., 1., 0., -1., 0., 0.\n"
COUPLED = REFERENCE + "*COUPLING, REF NODE=999, SURFACE=TOP, CONSTRAINT NAME=C1\n"
SHARES = "*DISTRIBUTING COUPLING, ELSET=D\n" + "".join(f"{n}, {1.0 if n in MIDDLE else 0.5}\n" for n in TOP)
#: cards of the model and of the step, supports, what a record of the case has
JOINTS = {
    "equations": (LEVEL, pulled(MIDDLE), held(), lambda case: len(case.equation) == len(TOP) - 1),
    "a node beside the bodies": (BESIDE, f"*BOUNDARY\n999, 1, 1, {1.5 * EVEN!r}\n", held(), lambda case: case.equation),
    "a plane": (PLANE, pulled(MIDDLE), held(), lambda case: case.equation),
    "supports along local axes": (
        LOCAL, "*DLOAD\nB_EZ1, P2, -10.\n", "*BOUNDARY\nB_Z0, 3\nB_X0, 2\nB_Y0, 1\n", lambda case: True,
    ),
    "a rigid body": (
        REFERENCE + "*RIGID BODY, NSET=B_Z1, REF NODE=999\n*BOUNDARY\n999, 1, 2\n999, 4, 6\n", pulled([999]), CLAMPED,
        lambda case: case.rigid[0].centre == (0.5, 1.0, 4.0),
    ),
    "a rigid coupling": (
        COUPLED + "*KINEMATIC\n1, 3\n", pulled([999]), CLAMPED, lambda case: case.coupling[0].kind == "rigid",
    ),
    "a rigid coupling along z": (
        COUPLED + "*KINEMATIC\n3, 3\n", pulled([999]), CLAMPED, lambda case: case.coupling[0].components == ("uz",),
    ),
    "a distributing coupling": (
        COUPLED + "*DISTRIBUTING\n1, 6\n", pulled([999]), CLAMPED, lambda case: case.coupling[0].kind == "distributing",
    ),
    "weights": (
        REFERENCE + "*ELEMENT, TYPE=DCOUP3D, ELSET=D\n777, 999\n" + SHARES, pulled([999]), held(),
        lambda case: case.coupling,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", JOINTS)
def test_joints_that_stretch_a_column_evenly(tmp_path, name):
    more, loads, supports, told = JOINTS[name]
    found = solved(tmp_path, column(more, loads, supports=supports))
    np.testing.assert_allclose(found.u(COLUMN.numbers), EVEN * COLUMN.points * [0, 0, 1], atol=1e-12)
    assert told(found.made.case)


def test_an_equation_of_many_terms_runs_over_lines(tmp_path):
    terms = [f"{n}, 3, {1 / len(TOP)!r}" for n in TOP]
    lines = ", ".join(terms[:4]) + ",\n" + ", ".join(terms[4:]) + ", 999, 2, -1.\n"
    text = column(f"{REFERENCE}*EQUATION\n{len(TOP) + 1}\n{lines}", "*BOUNDARY\n999, 2, 2, 0.1\n", nu=NU)
    assert solved(tmp_path, text).u(TOP)[:, 2].mean() == pytest.approx(0.1, rel=1e-12)


def test_a_line_and_a_mean_rotation(tmp_path):
    edge = [n for n in TOP if COLUMN.points[n - 1, 0] == 0]
    line = f"*MPC\nSTRAIGHT, {edge[0]}, {edge[2]}, {edge[1]}\n"
    bent = solved(tmp_path, column(line, pulled([edge[1]]), nu=NU)).u(edge)
    np.testing.assert_allclose(bent[1, [0, 2]], bent[[0, 2]][:, [0, 2]].mean(axis=0), atol=1e-12)
    turned = "*NODE\n998, 0., 0., 2.\n*MPC\nMEANROT, " + ", ".join(f"{n},{n},{n}" for n in TOP[:2]) + ",\n"
    turned += ", ".join(f"{n},{n},{n}" for n in TOP[2:]) + ", 998\n"
    found = solved(tmp_path, column(turned, "*BOUNDARY\n998, 1, 1, 1e-3\n", supports=CLAMPED))
    u, x = found.u(TOP), COLUMN.points[np.array(TOP) - 1] - [0.5, 1, 0]
    angle = (x[:, 0] * u[:, 1] - x[:, 1] * u[:, 0]) / (x[:, :2] ** 2).sum(axis=1)
    assert angle.mean() == pytest.approx(1e-3, rel=1e-10)


def test_forces_and_equations_along_local_axes(tmp_path):
    side = "*CLOAD\n" + "".join(f"{n}, 1, 1.\n" for n in TOP)
    turned = solved(tmp_path, column(LOCAL, side, supports=CLAMPED))
    plain = solved(tmp_path, column("", side.replace(", 1, 1.", ", 2, 1."), supports=CLAMPED))
    np.testing.assert_allclose(turned.u(COLUMN.numbers), plain.u(COLUMN.numbers), atol=1e-13)
    axes = f"{REFERENCE}*NSET, NSET=ONE\n{TOP[-1]}\n*TRANSFORM, NSET=ONE\n1., 1., , 0., 1.\n"  # what is left out is 0
    text = column(f"{axes}*EQUATION\n2\n{TOP[-1]}, 1, 1., 999, 1, -1.\n", "*BOUNDARY\n999, 1, 1, 0.01\n")
    u = solved(tmp_path, text).u([TOP[-1]])[0]
    assert (u[0] + u[1]) / np.sqrt(2) == pytest.approx(0.01, rel=1e-12)


def test_cylindrical_axes_hold_a_sector(tmp_path):
    """A wedge whose sides slide along the radius: supports across are local 2."""
    block = Block(low=(1, 0, 0), high=(2, 1, 1), cells=(2, 2, 1))
    r, angle, z = block.points.T * [[1], [np.pi / 3], [1]]
    block.places = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)
    text = bodies(block, nu=0.0) + "*TRANSFORM, NSET=B_N, TYPE=C\n0., 0., 0., 0., 0., 1.\n"
    text += "*BOUNDARY\nB_Z0, 3\nB_Y0, 2\nB_Y1, 2\n" + step("*BOUNDARY\nB_X0, 1, 1, 0.01\n")
    u = solved(tmp_path, text).u(block.numbers)
    across = (-block.places[:, 1] * u[:, 0] + block.places[:, 0] * u[:, 1]) / r
    np.testing.assert_allclose(across[(angle == 0) | (angle == angle.max())], 0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(u[r == 1], axis=1), 0.01, rtol=1e-9)


def test_a_rotation_about_one_axis(tmp_path):
    """Prescribed about y, free about x under a moment and about z; with NLGEOM a rigid coupling takes it too."""
    loads = "*BOUNDARY\n999, 1, 3\n999, 5, 5, 0.01\n*CLOAD\n999, 4, 3.\n"
    for head in (COUPLED + "*KINEMATIC\n", REFERENCE + "*RIGID BODY, NSET=B_Z1, REF NODE=999\n"):
        for options in ("", ", NLGEOM"):
            case = imported(tmp_path, column(head, loads, options=options)).case
            (one,) = (*case.coupling, *case.rigid)
            assert (one.rotation[0], one.rotation[1].source, one.rotation[2]) == ("free", 0.01, "free")
            assert [value.source for value in one.moment] == [3.0, 0.0, 0.0]
    partly = COUPLED + "*KINEMATIC\n1\n3\n"
    assert imported(tmp_path, column(partly, loads)).case.coupling[0].components == ("ux", "uz")
    fixed = "*BOUNDARY\n999, 1, 3\n999, 5, 5, 0.01\n999, 4\n999, 6\n"
    assert imported(tmp_path, column(partly, fixed, options=", NLGEOM")).case.kinematics == "finite"


def test_a_sector(tmp_path):
    """A sixth of a ring grows evenly; its sides are surfaces of nodes."""
    mesh = sector("HEXA8", (2, 2, 1), 6)
    groups = {f"S{name}": mesh.nodes_on(mesh.cells_of(name)) for name in ("a", "b")} | {"ALL": np.arange(mesh.n_nodes)}
    block = mesh.block("HEXA8")
    body = lacmesh.Mesh.create(
        mesh.points, [("HEXA8", block)], cell_groups={"B": np.arange(len(block))}, node_groups=groups
    )
    lacmesh.write(tmp_path / "mesh.inp", body)
    text = (tmp_path / "mesh.inp").read_text() + section()
    text += "".join(f"*SURFACE, NAME=SIDE_{name}, TYPE=NODE\nS{name}\n" for name in ("a", "b"))
    text += "*TIE, NAME=T1, CYCLIC SYMMETRY\nSIDE_a, SIDE_b\n*BOUNDARY\nALL, 3\n"
    text += "*CYCLIC SYMMETRY MODEL, N=6, TIE=T1\n0., 0., -1., 0., 0., 1.\n"
    x, number = mesh.points, mesh.node_number
    r = np.linalg.norm(x[:, :2], axis=1)
    edge = np.flatnonzero((r < 1.001) | (r > 1.999))
    grown = "".join(f"{number[k]}, {c + 1}, {c + 1}, {0.01 * float(x[k, c])!r}\n" for k in edge for c in (0, 1))
    found = solved(tmp_path, text + step("*BOUNDARY\n" + grown))
    np.testing.assert_allclose(found.u(number), 0.01 * x * [1, 1, 0], atol=1e-12)
    assert found.made.case.cyclic[0].sectors == 6


# ---- materials
ORTHOTROPIC = (
    "*MATERIAL, NAME=W\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1000., 500., 200., 0.3, 0.2, 0.1, 150., 120.,\n90.\n"
)


def test_orthotropic_material_in_turned_axes(tmp_path):
    """Axis 1 along z: a column under p shortens by p / E1, and widens along y (axis 2) by nu12 p / E1."""
    deck = COLUMN.text() + ORTHOTROPIC + "*ORIENTATION, NAME=O\n0., 0., 1., 0., 1., 0.\n"
    deck += "*SOLID SECTION, ELSET=B, MATERIAL=W, ORIENTATION=O\n" + held() + step("*DLOAD\nB_EZ1, P2, 20.\n")
    u, X = solved(tmp_path, deck).u(COLUMN.numbers), COLUMN.points
    np.testing.assert_allclose(u, 20 / 1000 * X * [0.2, 0.3, -1], atol=1e-12)


@pytest.mark.parametrize("kind", ["ORTHO", "ANISO"])
def test_stiffness_and_engineering_constants_agree(tmp_path, kind):
    S = np.array([[1 / 1000, -0.3 / 1000, -0.2 / 1000], [0, 1 / 500, -0.15 / 500], [0, 0, 1 / 200]])
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
    assert np.allclose(material.poisson, (0.3, 0.2, 0.15), rtol=1e-12)
    assert material.shear == shear


def test_neo_hookean(tmp_path):
    """C10 and D1 give the shear and the bulk modulus; a column has the stretches of the law with these."""
    deck = column("", "*BOUNDARY\nB_Z1, 3, 3, 0.9\n", options=", NLGEOM", nu=NU).replace(
        "*ELASTIC\n1000., 0.3\n", "*HYPERELASTIC, NEO HOOKE\n40., 0.01\n"
    )
    found = solved(tmp_path, deck)
    mu, axial = 80.0, 1.3
    lame = 200.0 - 2 * mu / 3
    # no stress across: mu (b - 1) + lame ln J = 0, with b = across^2 and J = axial b
    across = np.sqrt(brentq(lambda b: mu * (b - 1) + lame * np.log(axial * b), 0.1, 1.0, xtol=1e-14))
    assert np.allclose(found.u(COLUMN.at(0, 1))[:, 0], across - 1, rtol=1e-7)


# ---- plane models

#: a plate or a ring of four elements' sides 1 and 2, and its supports
PLATE = "*NODE\n1, 1, 0\n2, 2, 0\n3, 2, 2\n4, 1, 2\n*ELEMENT, TYPE={element}, ELSET=B\n1, 1, 2, 3, 4\n"
PLATE += ELASTIC.format(nu=0.0) + "*SOLID SECTION, ELSET=B, MATERIAL=EL\n4.\n*BOUNDARY\n1, 2\n2, 2\n{more}"


@pytest.mark.parametrize(
    ("element", "model", "more", "area", "shares"),
    [
        ("CPE4", "plane_strain", "1, 1, 3\n", 4.0, (0.5, 0.5)),
        ("CPS4", "plane_stress", "1, 1\n", 4.0, (0.5, 0.5)),
        ("CAX4", "axisymmetric", "", np.pi * 3, (4 / 9, 5 / 9)),
    ],
)
def test_plane_models(tmp_path, element, model, more, area, shares):
    """Forces are those of the whole thickness, or of the full circle of a ring."""
    load = step(f"*CLOAD\n4, 2, {12 * shares[0]!r}\n3, 2, {12 * shares[1]!r}\n")
    found = solved(tmp_path, PLATE.format(element=element, more=more) + load)
    assert found.made.case.model == model
    np.testing.assert_allclose(found.u([3, 4])[:, 1], 12 / area / E * 2, rtol=1e-9)


@pytest.mark.parametrize("element", ["CPS4", "CPE4"])
def test_sections_of_several_thicknesses(tmp_path, element):
    """Two plates one over the other, 4 and 2 thick: 12 / (E A) h of each; a third one shares the second's section."""
    corners = [(0, 0), (1, 0), (0, 1), (1, 1)]
    places = [(x + dx, y + dy) for dx, dy in ((0, 0), (0, 1), (3, 0)) for x, y in corners]
    deck = "*NODE\n" + "".join(f"{k}, {x}, {y}\n" for k, (x, y) in enumerate(places, 1))
    for k, (name, thick) in enumerate((("LOW", 4), ("UP", 2), ("BESIDE", 2))):
        a, b, c, d = (4 * k + j for j in (1, 2, 4, 3))
        deck += f"*ELEMENT, TYPE={element}, ELSET={name}\n{k + 1}, {a}, {b}, {c}, {d}\n"
        deck += f"*SOLID SECTION, ELSET={name}, MATERIAL=EL\n{thick}\n"
    deck += ELASTIC.format(nu=0.0) + "*SURFACE, NAME=S\nUP, S1\n*SURFACE, NAME=M\nLOW, S3\n"
    deck += "*TIE, NAME=T, POSITION TOLERANCE=0.1\nS, M\n*BOUNDARY\n1, 1, 2\n2, 1, 2\n9, 1, 2\n10, 1, 2\n5, 1\n7, 1\n"
    found = solved(tmp_path, deck + step("*CLOAD\n7, 2, 6.\n8, 2, 6.\n12, 2, 1.\n11, 2, 1.\n"))
    assert found.made.case.thickness == {"LOW": 4.0, "thick": 2.0}
    for nodes, length in (([3, 4], 12 / 4), ([7, 8], 12 / 4 + 12 / 2), ([11, 12], 2 / 2)):
        np.testing.assert_allclose(found.u(nodes)[:, 1], length / E, rtol=1e-9)
