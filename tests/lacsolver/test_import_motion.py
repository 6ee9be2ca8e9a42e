"""Decks with *DYNAMIC: imported, solved, compared with exact solutions and with CalculiX."""

import shutil

import numpy as np
import pytest

from lacsolver import CaseError
from lacsolver.problem.initial import initial_motion
from tests.formats.decks import solved as run_calculix
from tests.lacsolver.deck_texts import Block, imported, solved
from tests.lacsolver.moving_decks import bar_on_wall, moving, printed

PROGRAM = shutil.which("ccx")
pytestmark = pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
E, DENSITY = 1000.0, 100.0
BLOCK = Block()
HELD = "*BOUNDARY\nB_X0, 1\nB_Y0, 2\nB_Z0, 3\n"
PUSH = "*DLOAD\nB, P2, 10.\n"


def material(more="", density=DENSITY):
    law = f"*MATERIAL, NAME=EL\n*ELASTIC\n{E}, 0.\n*DENSITY\n{density}\n{more}"
    return law + "*SOLID SECTION, ELSET=B, MATERIAL=EL\n"


#: name -> cards of the material, options of the step and of the procedure, cards in front of the steps
LINEAR = {
    "loads act in full at once": ("", "", ", DIRECT", HELD),
    "loads that are ramped": ("", ", AMPLITUDE=RAMP", ", DIRECT", HELD),
    "damping of the material": ("*DAMPING, ALPHA=2., BETA=0.01\n", "", ", DIRECT", HELD),
    "damping of the scheme": ("", "", ", DIRECT, ALPHA=-0.3", HELD),
    "a static step before": (
        "", "", ", DIRECT", HELD + "*STEP\n*STATIC\n1., 1.\n*DLOAD\nB, P2, 4.\n*EL FILE\nENER\n*END STEP\n",
    ),
}  # fmt: skip


@pytest.mark.calculix
@pytest.mark.parametrize("name", LINEAR)
def test_linear_motion(tmp_path, name):
    """One element, ten steps: the same displacements but for the acceleration at the start, which CalculiX iterates."""
    more, options, procedure, before = LINEAR[name]
    text = BLOCK.text() + material(more) + before + moving(PUSH, options, procedure)
    found = solved(tmp_path, text)
    times, rows = printed(run_calculix(tmp_path / "model.inp", PROGRAM), "displacements")
    at = {round(state.time, 9): k for k, state in enumerate(found.states)}
    mine = np.array([found.u(part[:, 0].astype(int), at[round(t, 9)]) for t, part in zip(times, rows, strict=True)])
    exact = np.array(rows)[:, :, 1:]
    assert len(times) == 10
    assert np.abs(exact).max() > 0.01
    assert np.abs(mine - exact).max() < (1e-3 if "static" in name else 2e-4) * np.abs(exact).max()


@pytest.mark.calculix
def test_a_bar_hits_a_wall(tmp_path):
    """The free end moves as in CalculiX, and the wall takes the impulse 2 m v in both."""
    found = solved(tmp_path, bar_on_wall(16, 80))
    report = run_calculix(tmp_path / "model.inp", PROGRAM)
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


def test_velocities_of_a_body_that_turns(tmp_path):
    """A body's velocities are those of the deck's nodes; another body, which rests, has none."""
    other = Block("C", (3, 0, 0), (4, 1, 1), first=100)
    turn = np.array([1.0, 2.0, 3.0]) + np.cross([0.3, -0.2, 0.5], BLOCK.points)
    lines = [f"{n}, {c + 1}, {value!r}" for n, v in zip(BLOCK.numbers, turn.tolist(), strict=True)
             for c, value in enumerate(v)]  # fmt: skip
    text = BLOCK.text() + other.text() + material() + "*SOLID SECTION, ELSET=C, MATERIAL=EL\n"
    text += "*INITIAL CONDITIONS, TYPE=VELOCITY\n" + "\n".join(lines) + "\n" + moving("")
    found = solved(tmp_path, text)
    assert found.made.case.initial[0].groups == ("B",)
    given = initial_motion(found.problem.space, found.made.case, 0.0)[1].values
    assert np.allclose(given[:8], turn, atol=1e-13)
    assert not given[8:].any()


def rigid(model, loads, more=""):
    text = BLOCK.text() + "*NODE\n900, 0.5, 0.5, 0.5\n*ELEMENT, TYPE=MASS, ELSET=M\n901, 900\n*MASS, ELSET=M\n6.\n"
    text += material(density=2.0) + "*RIGID BODY, ELSET=B, REF NODE=900\n" + model
    return text + moving(loads, procedure=", DIRECT, ALPHA=0.", prints=more)


@pytest.mark.calculix
def test_mass_of_a_rigid_body(tmp_path):
    """A rigid body moves by F t^2 / 2 m, with the mass of its elements and that at its reference node."""
    turning = "*NODE\n901, 0.5, 0.5, 0.5\n*RIGID BODY, ELSET=B, REF NODE=900, ROT NODE=901\n"
    text = rigid("*BOUNDARY\n901, 1, 3\n", "*CLOAD\n900, 3, 4.\n", "*NODE PRINT, NSET=B_N\nU\n")
    found = solved(tmp_path, text.replace("*RIGID BODY, ELSET=B, REF NODE=900\n", turning))
    assert found.made.case.rigid[0].mass == 6.0
    assert np.allclose(found.u(BLOCK.numbers)[:, 2], 4 / (2 * 8.0), rtol=1e-9)
    _, rows = printed(run_calculix(tmp_path / "model.inp", PROGRAM), "displacements")
    assert np.allclose(rows[-1][:, 3], 4 / (2 * 8.0), rtol=1e-6)


@pytest.mark.calculix
def test_a_rigid_body_that_flies(tmp_path):
    """It has the velocity of its reference node, which is no node of an element."""
    text = rigid("*INITIAL CONDITIONS, TYPE=VELOCITY\n900, 3, 2.\n", "", "*NODE PRINT, NSET=B_N\nU\n")
    found = solved(tmp_path, text)
    assert np.allclose(found.u(BLOCK.numbers), [0, 0, 2.0], atol=1e-12)
    _, rows = printed(run_calculix(tmp_path / "model.inp", PROGRAM), "displacements")
    assert np.allclose(rows[-1][:, 3], 2.0, rtol=1e-6)


def test_inertia_of_a_rigid_body(tmp_path):
    """It turns by M t^2 / 2 I about z, with the inertia of its cube, m a^2 / 6, and that at its reference node."""
    more = "*ELEMENT, TYPE=ROTARYI, ELSET=R\n902, 900\n*ROTARY INERTIA, ELSET=R\n1., 2., 2.5\n*BOUNDARY\n900, 1, 3\n"
    found = solved(tmp_path, rigid(more, "*CLOAD\n900, 6, 0.004\n"))
    assert found.made.case.rigid[0].inertia == (1.0, 2.0, 2.5)
    angle = 0.004 / (2 * (2.5 + 2 / 6))
    arm = BLOCK.points - 0.5
    assert np.allclose(found.u(BLOCK.numbers)[:, 0], -angle * arm[:, 1], rtol=1e-6, atol=1e-12)


def test_steps_and_notes(tmp_path):
    """Without DIRECT the steps are those of the largest increment; natural modes and lone velocities are notes."""
    text = BLOCK.text() + material() + HELD + moving(PUSH, procedure="", line="0.01, 1., , 0.05")
    made = imported(tmp_path, text + "*STEP\n*FREQUENCY\n2\n*END STEP\n")
    assert len(made.case.steps.planned) == 20
    assert [finding.message for finding in made.findings if "20 equal increments" in finding.message]
    static = BLOCK.text() + material("*DAMPING, ALPHA=1.\n") + HELD + "*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 1, 1.\n"
    made = imported(tmp_path, static + "*STEP\n*STATIC\n" + PUSH + "*END STEP\n")
    assert made.case.dynamics is None
    assert sum("without a step of *DYNAMIC" in finding.message for finding in made.findings) == 2


def test_several_dampings(tmp_path):
    with pytest.raises(CaseError, match=r"\*DYNAMIC: materials EL, SOFT have several dampings"):
        other = Block("C", (3, 0, 0), (4, 1, 1), first=100).text()
        soft = "*MATERIAL, NAME=SOFT\n*ELASTIC\n1., 0.\n*DENSITY\n1.\n*DAMPING, ALPHA=1.\n"
        soft += "*SOLID SECTION, ELSET=C, MATERIAL=SOFT\n"
        imported(tmp_path, BLOCK.text() + other + material() + soft + HELD + moving(PUSH))
