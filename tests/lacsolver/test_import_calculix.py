"""Decks solved by lacsolver and by CalculiX: decks of CalculiX's own tests with its .dat, and decks of our own."""

import json
import re
import shutil
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from lacmesh.cli import main as lacmesh_main
from lacsolver import CaseError
from lacsolver.cli import main
from tests.formats.decks import E, K, P, pressed, tables
from tests.formats.decks import solved as run_calculix
from tests.lacsolver.deck_texts import (
    PRESSED,
    SLID,
    Block,
    bar_on_wall,
    bodies,
    die_on_block,
    held,
    imported,
    law,
    listed,
    moving,
    printed,
    solved,
)
from tests.samples import samples
from tests.viewing import DATA

PROGRAM = shutil.which("ccx")
pytestmark = pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
#: Decks of CalculiX's own tests that lacsolver takes; all others name the card that it has no place for.
TAKEN = {
    *("achtelp", "axial", "beamcontact", "beamd", "beamp", "beamptied5", "contact13", "contact5", "cubes", "dloadlinI"),
    *("friction1", "plate", "ring1"),
}
REFUSED = {
    "aniso": "ELASTIC", "ball": "SHELL SECTION", "beam_sens_freq_coord1": "SENSITIVITY", "bolt": "ELEMENT",
    "contact1": "CONTACT PAIR", "contact12": "DYNAMIC", "contact3": "CONTACT PAIR", "load1": "SHELL SECTION",
    "lin_stat_cooks_beam_128": "USER ELEMENT", "swing": "BEAM SECTION",
}  # fmt: skip
#: elements of decks of our own
OWN = ["C3D8", "C3D8I", "C3D20", "C3D20R", "C3D4", "C3D10", "CPE4", "CPS4R", "CPE3", "CAX4"]
#: a spring of no weight to turn the plate, whose contact is one face on one face
HELD = "*ELEMENT, TYPE=SPRING1, ELSET=WEAK\n901, 2\n902, 3\n*SPRING, ELSET=WEAK\n1\n1.\n*BOUNDARY\n"


def error(solution, text):
    """Largest difference of the last displacements in a .dat, relative to the largest of them."""
    rows = [rows for head, rows in tables(text) if head.startswith("displacements")][-1]
    mine = solution.u(rows[:, 0].astype(int))
    return np.abs(mine - rows[:, 1 : 1 + mine.shape[1]]).max() / np.abs(rows[:, 1:]).max()


def whole(text):
    """The deck with elements that are integrated in full, as lacsolver's are."""
    return re.sub(r"(?i)(TYPE\s*=\s*C\w*?\d)R\b", r"\1", text)


def both(folder, text):
    """A deck that is imported and solved, and what CalculiX prints of it."""
    return solved(folder, text), run_calculix(folder / "model.inp", PROGRAM)


def steps(kind, *loads, options="", line="1., 1."):
    """Steps with the displacements of a set of nodes printed."""
    prints = f"*NODE PRINT, NSET={kind}\nU\n"
    return "".join(f"*STEP{options}\n*STATIC{line}\n{load}{prints}*END STEP\n" for load in loads)


# ---- decks of CalculiX's own tests


@pytest.mark.shared
def test_every_deck_is_taken_or_names_a_card(shared, tmp_path):
    decks = sorted((shared / "reference" / "decks").glob("*.inp"))
    assert {deck.stem for deck in decks} >= TAKEN | REFUSED.keys()
    for deck in decks:
        try:
            imported(tmp_path, deck.read_text())
            assert deck.stem not in REFUSED
        except CaseError as refused:
            assert deck.stem not in TAKEN, str(refused)
            cards = re.findall(r"\*([A-Z -]+)(?:: | \(model\.inp, line \d+\))", str(refused))
            assert str(refused).count("model.inp, line ") == len(str(refused).splitlines()) == len(cards)
            assert REFUSED.get(deck.stem, cards[0]) in cards


@pytest.mark.shared
@pytest.mark.parametrize(
    ("name", "edit", "rel"),
    [
        ("ring1", str, 3e-4),  # thermal contact of two rings; CalculiX's are wedges of two degrees
        ("contact13", str, 4e-2),  # two elements that overlap, contact in the second step: one face on one
        ("beamd", str, 4e-3),  # C3D20R, of which lacsolver integrates in full
        ("plate", lambda text: text.replace("*BOUNDARY\n", HELD, 1), 3e-2),  # one face on one: one pressure
    ],
)
def test_the_results_of_calculix(shared, tmp_path, name, edit, rel):
    folder = shared / "reference" / "decks"
    found = solved(tmp_path, edit((folder / f"{name}.inp").read_text()))
    assert error(found, (folder / f"{name}.dat.ref").read_text()) < rel


@pytest.mark.shared
@pytest.mark.calculix
@pytest.mark.parametrize(("name", "rel"), [("achtelp", 1e-6), ("beamd", 1e-6), ("axial", 3e-4)])
def test_full_integration_gives_the_digits_of_calculix(shared, tmp_path, name, rel):
    """The .dat has seven digits; an axisymmetric body of CalculiX is a wedge of two degrees."""
    assert error(*both(tmp_path, whole((shared / "reference" / "decks" / f"{name}.inp").read_text()))) < rel


@pytest.mark.fuzz
@pytest.mark.parametrize("name", samples(["C3D8", "C3D10", "CPE4", "CAX4"], OWN))
def test_pressed_blocks(tmp_path, name):
    """Two blocks of any elements under a pressure: the contact has it everywhere, and its overlap is P / K."""
    found = solved(tmp_path, pressed(name))
    mesh = found.problem.space.mesh
    assert np.allclose(found.zone.pressure, P, rtol=1e-8)
    top = mesh.node_number[mesh.node_groups["top"]]
    assert np.allclose(found.u(top)[:, found.problem.space.dim - 1], -P * (2 / E + 1 / K), rtol=1e-8)


# ---- decks of our own


def bent(element, friction="", push=""):
    """Two blocks that do not match, the upper one bent by a pressure along one edge besides that on its top."""
    low = Block("B", cells=(3, 3, 3), element=element)
    high = Block("C", (0, 0, 1), (1, 1, 2), (4, 4, 4), element, first=10000)
    edge = (high.index[:, 0] == 0) & (high.index[:, 2] == 3)
    text = bodies(low, high) + "*ELSET, ELSET=EDGE\n" + "\n".join(listed(high.element_numbers[edge].tolist()))
    text += "\n*SURFACE, NAME=U\nC_EZ0, S1\n*SURFACE, NAME=L\nB_EZ1, S2\n*BOUNDARY\nB_Z0, 1, 3\nC_Z1, 1, 2\n"
    text += f"*SURFACE INTERACTION, NAME=SI\n{law(1e6)}{friction}"
    text += "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nU, L\n"
    return text + steps("C_N", "*DLOAD\nC_EZ1, P2, 20.\nEDGE, P2, 20.\n" + push, line="\n1., 1.")


@pytest.mark.calculix
@pytest.mark.fuzz
@pytest.mark.parametrize("element", samples(["C3D8"], ["C3D8", "C3D20"]))
def test_contact_that_is_not_uniform(tmp_path, element):
    """CalculiX's penalty and lacsolver's pressures give the same displacements, to 0.5 % with four faces along it."""
    found, theirs = both(tmp_path, bent(element))
    assert np.ptp(found.zone.pressure) > 5
    assert error(found, theirs) < 6e-3


@pytest.mark.rows("5.0-status0")
@pytest.mark.calculix
@pytest.mark.parametrize(("coefficient", "status"), [(5.0, {1}), (0.1, {2})])
def test_friction_that_is_not_uniform(tmp_path, coefficient, status):
    """A block on another one that is bent and pushed, which sticks or slides: as with springs of CalculiX, to 1 %."""
    push = "*BOUNDARY\nC_Z1, 1, 1, 0.1\n"
    found, theirs = both(tmp_path, bent("C3D8", f"*FRICTION\n{coefficient}, 1e6\n", push))
    assert set(found.zone.status.tolist()) == status
    assert error(found, theirs) < 1e-2


METALS = {
    "perfect": ("*PLASTIC\n2., 0.\n", 1.7),
    "isotropic": ("*PLASTIC, HARDENING=ISOTROPIC\n2., 0.\n2.5, 0.01\n4., 0.5\n", 2.4),
    "kinematic": ("*PLASTIC, HARDENING=KINEMATIC\n2., 0.\n4., 0.04\n", 1.9),
}


@pytest.mark.calculix
@pytest.mark.parametrize("metal", [pytest.param("perfect", marks=pytest.mark.slow), "isotropic", "kinematic"])
def test_a_bent_metal_that_yields(tmp_path, metal):
    """A block of C3D20 with a pressure on a part of its top, small strains; then the load is taken away in part."""
    column, (card, load) = Block(high=(1, 1, 2), cells=(2, 2, 3), element="C3D20"), METALS[metal]
    part = column.element_numbers[(column.index[:, 0] == 0) & (column.index[:, 2] == 2)]
    text = bodies(column, more=card) + "*ELSET, ELSET=PART\n" + "\n".join(listed(part.tolist()))
    loads = (f"*DLOAD\nPART, P2, {size}\n" for size in (load, 0.5))
    text += "\n*BOUNDARY\nB_Z0, 1, 3\n" + steps("B_N", *loads, options=", INC=100", line=", DIRECT\n0.1, 1.")
    found, theirs = both(tmp_path, text)
    assert found.made.case.material[0].law == "plastic"
    assert max(h[..., 0].max() for h in found.states[-1].step.histories.materials) > 1e-4
    # CalculiX stops where residual forces are below half a percent of the mean force
    assert error(found, theirs) < 2e-3


@pytest.mark.rows("force")
@pytest.mark.calculix
@pytest.mark.parametrize(
    "loads",
    [
        ["*DLOAD\nB_EX1, P4, 1.5\n"],
        ["*CLOAD\nB_Z1, 1, 0.5\nB_Z1, 2, 0.2\n"],
        ["*CLOAD\nB_Z1, 1, 0.5\n*DLOAD\nB_EX1, P4, 0.5\n", "*CLOAD\nB_Z1, 1, -0.2\n"],
    ],
    ids=["pressure", "force", "steps"],
)
def test_bent_column_with_nlgeom(tmp_path, loads):
    """Large rotations: pressures that follow, forces that do not, two steps; C3D20 in both programs."""
    column = Block(high=(1, 1, 6), cells=(1, 1, 6), element="C3D20")
    text = bodies(column) + "*BOUNDARY\nB_Z0, 1, 3\n"
    found, theirs = both(tmp_path, text + steps("B_N", *loads, options=", NLGEOM", line="\n0.5, 1."))
    assert np.abs(found.u(column.at(2, 6))[:, 0]).max() > 0.5
    assert error(found, theirs) < 1e-3


@pytest.mark.calculix
def test_loads_and_supports_over_steps(tmp_path):
    """Cards of several steps mean what they do in CalculiX: lines that add or replace, amplitudes, forces that stay."""
    column = Block(high=(1, 1, 2), cells=(1, 1, 2))
    text = bodies(column, more="*DENSITY\n2.\n*EXPANSION\n1e-4\n")
    text += "*AMPLITUDE, NAME=A\n0., 0., 0.5, 1., 1., 0.25\n"
    text += "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nB_N, 10.\n*BOUNDARY\nB_Z0, 1, 3\n"
    node = column.at(2, 2)[0]
    loads = [
        f"*CLOAD\nB_Z1, 1, 1.\n{node}, 1, 2.\n*DLOAD\nB, GRAV, 5., 0., 0., -1.\nB_EZ1, P2, 3.\nB_EZ1, P2, 1.\n",
        f"*CLOAD\n{node}, 1, 1.5\n*TEMPERATURE\nB_N, 60.\n",
        "*CLOAD, AMPLITUDE=A\nB_Z1, 2, 4.\n*BOUNDARY\nB_Z0, 1, 1, 0.01\n",
    ]
    found, report = both(tmp_path, text + steps("B_N", *loads, line="\n1., 1."))
    theirs = [rows for _, rows in tables(report)]
    assert len(theirs) == 3
    for k, rows in enumerate(theirs):
        assert np.allclose(found.u(rows[:, 0].astype(int), k), rows[:, 1:], atol=2e-6 * np.abs(rows[:, 1:]).max())


# ---- motion

PUSH = "*DLOAD\nB, P2, 10.\n"
STATIC = "*STEP\n*STATIC\n1., 1.\n*DLOAD\nB, P2, 4.\n*EL FILE\nENER\n*END STEP\n"


@pytest.mark.rows("damping of the material", "a static step before")
@pytest.mark.calculix
@pytest.mark.parametrize(
    ("more", "before", "options", "procedure", "rel"),
    [
        ("", "", "", "", 2e-4),
        ("", "", ", AMPLITUDE=RAMP", "", 2e-4),
        ("*DAMPING, ALPHA=2., BETA=0.01\n", "", "", "", 2e-4),
        ("", "", "", ", ALPHA=-0.3", 2e-4),
        ("", STATIC, "", "", 1e-3),
    ],
    ids=["at once", "ramped", "damping of the material", "damping of the scheme", "a static step before"],
)
def test_linear_motion(tmp_path, more, before, options, procedure, rel):
    """One element, ten steps: the same displacements but for the acceleration at the start, which CalculiX iterates."""
    text = bodies(Block(), nu=0.0, more="*DENSITY\n100.\n" + more) + held() + before
    found, report = both(tmp_path, text + moving(PUSH, options, ", DIRECT" + procedure))
    times, rows = printed(report, "displacements")
    at = {round(state.time, 9): k for k, state in enumerate(found.states)}
    mine = np.array([found.u(part[:, 0].astype(int), at[round(t, 9)]) for t, part in zip(times, rows, strict=True)])
    theirs = np.array(rows)[:, :, 1:]
    assert len(times) == 10 and np.abs(theirs).max() > 0.01
    assert np.abs(mine - theirs).max() < rel * np.abs(theirs).max()


@pytest.mark.slow
@pytest.mark.calculix
def test_a_bar_hits_a_wall(tmp_path):
    """The free end moves as in CalculiX, and the wall takes the impulse 2 m v in both."""
    found, report = both(tmp_path, bar_on_wall(16, 80))
    times, rows = printed(report, "displacements")
    end = rows[0][:, 0][-4:].astype(int)
    mine = [found.u(end, k)[:, 2].mean() for k in range(len(found.states))]
    theirs = np.array([part[-4:, 3].mean() for part in rows])
    mine = np.interp(times, [state.time for state in found.states], mine)
    assert np.abs(mine - theirs).max() < 0.03 * np.ptp(theirs)
    _, forces = printed(report, "total force")
    pushes = np.array([part[0, 2] for part in forces])
    assert np.diff(times) @ (pushes[1:] + pushes[:-1]) / 2 == pytest.approx(8.0, rel=2e-2)
    assert abs(found.states[-1].step.motion.impulse[0, 2]) == pytest.approx(8.0, rel=1e-2)  # on the slave, either side
    assert not found.zone.pressure.any()


# ---- a contact that slides, as a user runs it: like `contact2` of CalculiX's own tests, 1,572 unknowns


@pytest.fixture(scope="module")
def dragged(tmp_path_factory):
    """The folder of the deck of a die; times of a run of its case, and the support's reactions (steps, 3)."""
    folder, count = tmp_path_factory.mktemp("die"), PRESSED[0] + SLID[0]
    (folder / "die.inp").write_text(die_on_block())
    with chdir(folder), redirect_stdout(StringIO()) as told:
        assert main(["import", "die.inp"]) == 0
        assert main(["run", "die.toml", "-o", "out"]) == 0
    lines = told.getvalue().splitlines()
    head = next(k for k, line in enumerate(lines) if line.split()[:3] == ["step", "time", "iterations"])
    assert [int(line.split()[0]) for line in lines[head + 1 : head + 1 + count]] == list(range(1, count + 1))
    steps = json.loads((folder / "out" / "results.json").read_text())["steps"]
    assert sum(step["iterations"] for step in steps) <= 41
    return folder, np.array([step["time"] for step in steps]), np.array([step["reactions"]["W_Z0"] for step in steps])


@pytest.mark.slow
def test_a_foot_ends_in_the_middle(dragged):
    """Without friction the block pushes straight up, but for its slope and its faces: 1 %; in the middle exactly."""
    _, _, force = dragged
    assert (np.abs(force[:, :2]) < 0.01 * force[:, 2:]).all() and np.abs(force[-1, :2]).max() < 1e-6 * force[-1, 2]
    assert (np.diff(force[: PRESSED[0], 2]) > 20).all()


@pytest.mark.slow
@pytest.mark.calculix
def test_the_forces_of_a_foot_are_those_of_calculix(dragged):
    """Six of 14 faces touch, each with one pressure: the two agree as far as that allows.

    CalculiX takes the place of the contact from the start of an increment: its force leans by a tenth, not so here.
    """
    folder, times, force = dragged
    at, rows = printed(run_calculix(folder / "die.inp", PROGRAM), "total force")
    np.testing.assert_allclose(at, times, rtol=1e-6)
    off = force[:, 2] / np.array([row[0] for row in rows])[:, 2] - 1
    assert np.abs(off).max() < 0.1 and np.abs(off).mean() < 0.04


@pytest.mark.calculix
def test_the_punch_has_the_same_forces_in_both_programs_and_its_cut_deck_too(tmp_path):
    """data/punch.inp: by CalculiX as it is and with its slave cut, and imported; one pressure for each face here."""
    shutil.copy(DATA / "punch.inp", tmp_path)
    with chdir(tmp_path), redirect_stdout(StringIO()):
        assert lacmesh_main(["cut", "punch.inp", "--slave", "slave", "-o", "cut.inp"]) == 0
        assert main(["import", "punch.inp", "-o", "punch.toml"]) == 0
        assert main(["run", "punch.toml", "-o", "punch"]) == 0
        steps = json.loads(Path("punch/results.json").read_text())["steps"]
        table = np.genfromtxt("punch/contact_slave.csv", delimiter=",", names=True)
    forces, pressures = [], []
    for name in ("punch", "cut"):
        text = run_calculix(tmp_path / f"{name}.inp", PROGRAM)
        forces.append(float(text.split("total force")[1].split("\n")[2].split()[1]))
        rows = np.array([line.split()[2] for line in re.findall(r"^ +\d+ +\d  +-?\d.*", text, re.MULTILINE)], float)
        pressures.append(rows.max())
    (before, after), lac = forces, steps[-1]["reactions"]["bottom"][1]
    assert after == pytest.approx(before, rel=1e-3) and lac == pytest.approx(before, rel=5e-3)
    (before, after), lac = pressures, table["pressure"].max()
    assert after == pytest.approx(before, rel=5e-2) and 0.9 * before < lac < before
