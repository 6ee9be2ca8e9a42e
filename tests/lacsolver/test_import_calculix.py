"""Decks solved by lacsolver and by CalculiX: decks of CalculiX's own tests with its .dat, and decks of our own."""

import itertools
import json
import re
import shutil

import numpy as np
import pytest

from lacsolver import CaseError
from lacsolver.cli import main
from lacsolver.results.figures import step_figures
from tests.formats.decks import E, K, P, pressed, tables
from tests.formats.decks import solved as run_calculix
from tests.lacsolver.deck_texts import Block, imported, listed, solved
from tests.lacsolver.test_import import hanging, softly
from tests.samples import each_option, samples

PROGRAM = shutil.which("ccx")
pytestmark = pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
#: Decks of CalculiX's own tests that lacsolver takes; all others name the card that it has no place for.
TAKEN = {
    *("achtelp", "axial", "beamcontact", "beamd", "beamp", "beamptied5", "contact13", "contact5", "cubes", "dloadlinI"),
    *("friction1", "plate", "ring1"),
}
REFUSED = {
    "aniso": "ELASTIC",
    "ball": "SHELL SECTION",
    "beam_sens_freq_coord1": "SENSITIVITY",
    "bolt": "ELEMENT",
    "contact1": "CONTACT PAIR",
    "contact12": "DYNAMIC",
    "contact3": "CONTACT PAIR",
    "lin_stat_cooks_beam_128": "USER ELEMENT",
    "load1": "SHELL SECTION",
    "swing": "BEAM SECTION",
}
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
    text = whole((shared / "reference" / "decks" / f"{name}.inp").read_text())
    found = solved(tmp_path, text)
    assert error(found, run_calculix(tmp_path / "model.inp", PROGRAM)) < rel


@pytest.mark.shared
@pytest.mark.calculix
@pytest.mark.parametrize(
    ("name", "slope", "rel"),
    [
        ("beamptied5", "1.E5", 1e-2),
        ("friction1", "1.E7", 2e-2),  # 6 % with its own slope of 47000, on which the nodes of CalculiX's slave slip
        ("cubes", "1.E5", 5e-2),  # one face on one, which is one pressure here and a dozen springs there
        ("contact5", "1.E5", 8e-2),
    ],
)
def test_decks_with_friction(shared, tmp_path, name, slope, rel):
    """Friction of CalculiX's tests, with elements that are integrated in full in both programs."""
    text = whole((shared / "reference" / "decks" / f"{name}.inp").read_text())
    text = re.sub(r"(?i)(\*FRICTION\n[^,]*,).*", rf"\g<1>{slope}", text)
    text = re.split(r"(?i)\*END STEP", text)[0] + "*NODE PRINT, NSET=PRINTED\nU\n*END STEP\n"
    made = imported(tmp_path, text.replace("PRINTED", "NALL"))
    mesh = made.mesh
    nodes = np.concatenate([part.ravel() for _, _, part in mesh.select(np.arange(mesh.n_cells))])
    used = mesh.node_number[np.unique(nodes)]
    text = text.replace("*STEP", "*NSET, NSET=PRINTED\n" + "\n".join(listed(used.tolist())) + "\n*STEP", 1)
    found = solved(tmp_path, text)
    assert error(found, run_calculix(tmp_path / "model.inp", PROGRAM)) < rel


@pytest.mark.fuzz
@pytest.mark.parametrize("name", samples(["C3D8", "C3D10", "CPE4", "CAX4"], OWN))
def test_pressed_blocks(tmp_path, name):
    """Two blocks of any elements under a pressure: the contact has it everywhere, and its overlap is P / K."""
    found = solved(tmp_path, pressed(name))
    mesh = found.problem.space.mesh
    assert np.allclose(found.zone.pressure, P, rtol=1e-8)
    top = mesh.node_number[mesh.node_groups["top"]]
    assert np.allclose(found.u(top)[:, found.problem.space.dim - 1], -P * (2 / E + 1 / K), rtol=1e-8)


def bent(element, options="", friction="", push=""):
    """Two blocks that do not match, the upper one bent by a pressure along one edge besides that on its top."""
    low = Block("B", cells=(3, 3, 3), element=element)
    high = Block("C", (0, 0, 1), (1, 1, 2), (4, 4, 4), element, first=10000)
    edge = (high.index[:, 0] == 0) & (high.index[:, 2] == 3)
    text = low.text() + high.text() + "*ELSET, ELSET=C_EX0Z1\n" + "\n".join(listed(high.element_numbers[edge].tolist()))
    text += "\n*SURFACE, NAME=U\nC_EZ0, S1\n*SURFACE, NAME=L\nB_EZ1, S2\n"
    text += "*MATERIAL, NAME=EL\n*ELASTIC\n1000., 0.3\n"
    text += "*SOLID SECTION, ELSET=B, MATERIAL=EL\n*SOLID SECTION, ELSET=C, MATERIAL=EL\n"
    text += "*BOUNDARY\nB_Z0, 1, 3\nC_Z1, 1, 2\n*SURFACE INTERACTION, NAME=SI\n"
    text += f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1e6\n{friction}"
    text += "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nU, L\n"
    loads = "*DLOAD\nC_EZ1, P2, 20.\nC_EX0Z1, P2, 20.\n" + push
    return text + f"*STEP{options}\n*STATIC\n1., 1.\n{loads}*NODE PRINT, NSET=C_N\nU\n*END STEP\n"


@pytest.mark.calculix
@pytest.mark.fuzz
@pytest.mark.parametrize(("element", "rel"), samples([("C3D8", 6e-3)], [("C3D8", 6e-3), ("C3D20", 6e-3)]))
def test_contact_that_is_not_uniform(tmp_path, element, rel):
    """CalculiX's penalty and lacsolver's pressures give the same displacements, to 0.5 % with four faces along it."""
    found = solved(tmp_path, bent(element))
    assert np.ptp(found.zone.pressure) > 5
    assert error(found, run_calculix(tmp_path / "model.inp", PROGRAM)) < rel


METALS = {
    "perfect": "*PLASTIC\n2., 0.\n",
    "isotropic": "*PLASTIC, HARDENING=ISOTROPIC\n2., 0.\n2.5, 0.01\n4., 0.5\n",
    "kinematic": "*PLASTIC, HARDENING=KINEMATIC\n2., 0.\n4., 0.04\n",
}


@pytest.mark.calculix
@pytest.mark.parametrize("metal", [pytest.param("perfect", marks=pytest.mark.slow), "isotropic", "kinematic"])
def test_a_bent_metal_that_yields(tmp_path, metal):
    """A block of C3D20 with a pressure on a part of its top, small strains; then the load is taken away in part."""
    column = Block(high=(1, 1, 2), cells=(2, 2, 3), element="C3D20")
    text = column.text() + "*ELSET, ELSET=PART\n"
    edge = (column.index[:, 0] == 0) & (column.index[:, 2] == 2)
    text += "\n".join(listed(column.element_numbers[edge].tolist()))
    text += f"\n*MATERIAL, NAME=EL\n*ELASTIC\n1000., 0.3\n{METALS[metal]}*SOLID SECTION, ELSET=B, MATERIAL=EL\n"
    text += "*BOUNDARY\nB_Z0, 1, 3\n"
    for load in ({"isotropic": 2.4, "kinematic": 1.9}.get(metal, 1.7), 0.5):
        text += f"*STEP, INC=100\n*STATIC, DIRECT\n0.1, 1.\n*DLOAD\nPART, P2, {load}\n"
        text += "*NODE PRINT, NSET=B_N\nU\n*END STEP\n"
    found = solved(tmp_path, text)
    assert found.made.case.material[0].law == "plastic"
    assert max(h[..., 0].max() for h in found.states[-1].step.histories.materials) > 1e-4
    # CalculiX stops where residual forces are below half a percent of the mean force
    assert error(found, run_calculix(tmp_path / "model.inp", PROGRAM)) < 2e-3


@pytest.mark.calculix
@pytest.mark.parametrize(("coefficient", "status"), [(5.0, {1}), (0.1, {2})])
def test_friction_that_is_not_uniform(tmp_path, coefficient, status):
    """A block on another one that is bent and pushed, which sticks or slides: as with springs of CalculiX, to 1 %."""
    friction = f"*FRICTION\n{coefficient}, 1e6\n"
    found = solved(tmp_path, bent("C3D8", friction=friction, push="*BOUNDARY\nC_Z1, 1, 1, 0.1\n"))
    assert set(found.zone.status.tolist()) == status
    assert error(found, run_calculix(tmp_path / "model.inp", PROGRAM)) < 1e-2


@pytest.mark.calculix
@pytest.mark.parametrize("kind", ["pressure", "force", "steps"])
def test_bent_column_with_nlgeom(tmp_path, kind):
    """Large rotations: pressures that follow, forces that do not, two steps; C3D20 in both programs."""
    column = Block(high=(1, 1, 6), cells=(1, 1, 6), element="C3D20")
    loads = {
        "pressure": ["*DLOAD\nB_EX1, P4, 1.5\n"],
        "force": ["*CLOAD\nB_Z1, 1, 0.5\nB_Z1, 2, 0.2\n"],
        "steps": ["*CLOAD\nB_Z1, 1, 0.5\n*DLOAD\nB_EX1, P4, 0.5\n", "*CLOAD\nB_Z1, 1, -0.2\n"],
    }[kind]
    text = column.text() + "*MATERIAL, NAME=EL\n*ELASTIC\n1000., 0.3\n*SOLID SECTION, ELSET=B, MATERIAL=EL\n"
    text += "*BOUNDARY\nB_Z0, 1, 3\n"
    for load in loads:
        text += f"*STEP, NLGEOM\n*STATIC\n0.5, 1.\n{load}*NODE PRINT, NSET=B_N\nU\n*END STEP\n"
    found = solved(tmp_path, text)
    assert np.abs(found.u(column.at(2, 6))[:, 0]).max() > 0.5
    assert error(found, run_calculix(tmp_path / "model.inp", PROGRAM)) < 1e-3


@pytest.mark.calculix
@pytest.mark.parametrize("kind, options", each_option(itertools.product(("SPRING2", "SPRINGA"), ("", ", NLGEOM"))))
def test_springs_between_nodes(tmp_path, kind, options):
    """By components, and along lines, which turn with NLGEOM: the block falls by a tenth of the springs' length."""
    spring = {"SPRING2": "3, 3\n25.\n", "SPRINGA": "\n25.\n"}[kind]
    deck, _, above = hanging(kind, spring, options)
    tight = "*STATIC\n*CONTROLS, PARAMETERS=FIELD\n1e-8, 1e-8\n"  # CalculiX stops at 5e-3 of the forces else
    found = solved(tmp_path, deck.replace("*STATIC\n", tight))
    assert found.u(above.at(2, 2))[:, 2].max() < -0.1
    assert error(found, run_calculix(tmp_path / "model.inp", PROGRAM)) < 1e-4


@pytest.mark.calculix
def test_pressure_per_overlap_that_a_step_changes(tmp_path):
    """The top of a block on linear contact rises as a step makes the contact stiffer."""
    deck, above = softly()
    found = solved(tmp_path, deck)
    printed = [rows for _, rows in tables(run_calculix(tmp_path / "model.inp", PROGRAM))]
    ends = [k for k, state in enumerate(found.states) if abs(state.time - round(state.time)) < 1e-9]
    assert len(printed) == len(ends) == 3
    tops = [found.u(above.at(2, 2), k)[:, 2].mean() for k in ends]
    theirs = [rows[np.isin(rows[:, 0], above.at(2, 2)), 3].mean() for rows in printed]
    assert np.allclose(tops, theirs, rtol=1e-3)
    assert tops[1] - tops[0] == pytest.approx(20 / 5000 - 20 / 8000, rel=1e-6)


@pytest.mark.calculix
def test_loads_and_supports_over_steps(tmp_path):
    """Cards of several steps mean what they do in CalculiX: lines that add or replace, amplitudes, forces that stay."""
    column = Block(high=(1, 1, 2), cells=(1, 1, 2))
    text = column.text() + "*MATERIAL, NAME=EL\n*ELASTIC\n1000., 0.3\n*DENSITY\n2.\n*EXPANSION\n1e-4\n"
    text += "*SOLID SECTION, ELSET=B, MATERIAL=EL\n*AMPLITUDE, NAME=A\n0., 0., 0.5, 1., 1., 0.25\n"
    text += "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nB_N, 10.\n*BOUNDARY\nB_Z0, 1, 3\n"
    node = column.at(2, 2)[0]
    steps = [
        f"*CLOAD\nB_Z1, 1, 1.\n{node}, 1, 2.\n*DLOAD\nB, GRAV, 5., 0., 0., -1.\nB_EZ1, P2, 3.\nB_EZ1, P2, 1.\n",
        f"*CLOAD\n{node}, 1, 1.5\n*TEMPERATURE\nB_N, 60.\n",
        "*CLOAD, AMPLITUDE=A\nB_Z1, 2, 4.\n*BOUNDARY\nB_Z0, 1, 1, 0.01\n",
    ]
    for loads in steps:
        text += f"*STEP\n*STATIC\n1., 1.\n{loads}*NODE PRINT, NSET=B_N\nU\n*END STEP\n"
    found = solved(tmp_path, text)
    printed = [rows for _, rows in tables(run_calculix(tmp_path / "model.inp", PROGRAM))]
    for k, rows in enumerate(printed):
        assert np.allclose(found.u(rows[:, 0].astype(int), k), rows[:, 1:], atol=2e-6 * np.abs(rows[:, 1:]).max())
    assert len(printed) == 3


@pytest.mark.calculix
def test_natural_frequencies(tmp_path, monkeypatch):
    """A step of *FREQUENCY leaves a case of which `lacsolver modes` finds the frequencies that CalculiX has."""
    column = Block(high=(1, 2, 6), cells=(1, 1, 4), element="C3D20")
    text = (
        column.text() + "*MATERIAL, NAME=EL\n*ELASTIC\n1000., 0.3\n*DENSITY\n2.\n*SOLID SECTION, ELSET=B, MATERIAL=EL\n"
    )
    (tmp_path / "model.inp").write_text(text + "*BOUNDARY\nB_Z0, 1, 3\n*STEP\n*FREQUENCY\n4\n*END STEP\n")
    monkeypatch.chdir(tmp_path)
    assert main(["import", "model.inp", "-q"]) == 0
    assert main(["modes", "model.toml", "-k", "4", "-o", "modes", "-q"]) == 0
    found = json.loads((tmp_path / "modes" / "modes.json").read_text())["frequencies"]
    printed = run_calculix(tmp_path / "model.inp", PROGRAM).partition("P A R T I C I P A T I O N")[0]
    rows = re.findall(r"^ +\d+ +\S+ +\S+ +(\d\S+) +\S+ *$", printed, re.MULTILINE)
    assert len(rows) == 4
    assert np.allclose(found, [float(row) for row in rows], rtol=1e-5)


@pytest.mark.calculix
def test_reactions(tmp_path):
    """The reaction of a support has the sign and the size of CalculiX's RF."""
    column = Block(high=(1, 1, 2), cells=(1, 1, 2))
    text = column.text() + "*MATERIAL, NAME=EL\n*ELASTIC\n1000., 0.3\n*SOLID SECTION, ELSET=B, MATERIAL=EL\n"
    text += "*BOUNDARY\nB_Z0, 1, 3\n*STEP\n*STATIC\n*CLOAD\nB_Z1, 1, 1.\nB_Z1, 3, -3.\n"
    found = solved(tmp_path, text + "*NODE PRINT, NSET=B_Z0, TOTALS=ONLY\nRF\n*END STEP\n")
    (_, rows) = tables(run_calculix(tmp_path / "model.inp", PROGRAM))[-1]
    reactions = step_figures(found.problem, found.states[-1]).reactions
    assert np.allclose(reactions["B_Z0"], rows[-1], atol=1e-5)


@pytest.mark.calculix
def test_a_support_that_begins_late_drags_as_calculix_does(tmp_path):
    """Pressed by 0.01, then dragged by 0.005, with friction: forces differ by the meshes alone.

    CalculiX has 23,024, 21,911, 21,380 along z for 4, 16, 64 faces, lacsolver 22,026, 21,741, 21,310 (with a stick
    slope of 1e7, which hardly slips).
    """
    low = Block("B", high=(12, 12, 4), cells=(6, 6, 4))
    high = Block("C", (2, 2, 4), (10, 10, 8), (4, 4, 4), first=10000)
    text = low.text() + high.text() + "*SURFACE, NAME=U\nC_EZ0, S1\n*SURFACE, NAME=L\nB_EZ1, S2\n"
    text += "*MATERIAL, NAME=EL\n*ELASTIC\n210000., 0.3\n"
    text += (
        "*SOLID SECTION, ELSET=B, MATERIAL=EL\n*SOLID SECTION, ELSET=C, MATERIAL=EL\n*SURFACE INTERACTION, NAME=SI\n"
    )
    text += "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1e6\n*FRICTION\n0.3, 1e7\n"
    text += "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nU, L\n*BOUNDARY\nB_Z0, 1, 3\nC_Z1, 2, 2\n"
    for line in ("3, 3, -0.01", "1, 1, 0.005"):
        text += (
            f"*STEP\n*STATIC\n0.5, 1.\n*BOUNDARY\nC_Z1, {line}\n*NODE PRINT, NSET=B_Z0, TOTALS=ONLY\nRF\n*END STEP\n"
        )
    found = solved(tmp_path, text)
    (_, rows) = tables(run_calculix(tmp_path / "model.inp", PROGRAM))[-1]
    mine = step_figures(found.problem, found.states[-1]).reactions["B_Z0"]
    np.testing.assert_allclose(mine, rows[-1], atol=0.01 * np.abs(rows[-1]).max())
