"""Decks whose slave is one face: the import takes the other role where that surface has more faces, and says so."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from lacsolver.validation import validate
from tests.lacsolver.deck_texts import Block, imported, section, solved

E, P = 1000.0, 10.0


def pressed(element="C3D8", cells=(2, 2, 2), tie=False, more="", above=(1, 1, 1)):
    """A block of one brick, whose face is the slave, pressed on a finer one of the same width."""
    low = Block("B", cells=cells, element=element)
    high = Block("C", (0, 0, 1), (1, 1, 2), above, element, first=10000)
    text = low.text() + high.text() + section() + "*SOLID SECTION, ELSET=C, MATERIAL=EL\n"
    text += "*SURFACE, NAME=U\nC_EZ0, S1\n*SURFACE, NAME=L\nB_EZ1, S2\n"
    edge = high.numbers[(high.points[:, 1] == 0) & (high.points[:, 2] == 1)]
    text += f"*BOUNDARY\nB_Z0, 3\nB_X0, 1\nB_Y0, 2\n{edge[0]}, 1, 2\n{edge[-1]}, 2\n"
    if tie:
        text += "*TIE, NAME=T\nU, L\n"
    else:
        text += "*SURFACE INTERACTION, NAME=SI\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1e6\n"
        text += "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nU, L\n"
    return text + more + f"*STEP\n*STATIC\n1., 1.\n*DLOAD\nC_EZ1, P2, {P}\n*END STEP\n"


@pytest.mark.parametrize("element", ["C3D8", "C3D20"])
@pytest.mark.parametrize("cells", [(2, 2, 2), (3, 2, 1)])
def test_a_slave_of_one_face_is_the_master_of_the_finer_surface(tmp_path, element, cells):
    """A uniform pressure: the overlap of the linear contact is P / K, and the block does not turn."""
    found = solved(tmp_path, pressed(element, cells))
    (record,) = found.made.case.contact
    assert (record.slave, record.master) == ("L", "U")
    (note,) = [one for one in found.made.findings if "few faces" in one.text]
    assert note.level == "note" and f"'L' has {cells[0] * cells[1]}" in note.text
    assert np.allclose(found.zone.pressure, P, rtol=1e-8)
    mesh = found.problem.space.mesh
    top = mesh.node_number[mesh.node_groups["C_Z1"]]
    assert np.allclose(found.u(top)[:, 2], -P * (2 / E + 1e-6), rtol=1e-7)


def test_a_tie_of_one_face_as_well(tmp_path):
    made = imported(tmp_path, pressed(tie=True))
    assert made.case.tie[0].slave == "L" and not validate(made.case, made.mesh).problems


def test_both_of_one_face_is_said_at_the_import(tmp_path):
    made = imported(tmp_path, pressed(cells=(1, 1, 1)))
    (told,) = [one for one in made.findings if "few faces" in one.text]
    assert told.level == "warning" and "its master has few as well" in told.text and "'run' refuses" in told.text
    assert made.case.contact[0].slave == "U"


def test_a_clearance_goes_with_the_slave(tmp_path):
    text = pressed(more="*CLEARANCE, MASTER=L, SLAVE=U, VALUE=0.001\n")
    (record,) = imported(tmp_path, text).case.contact
    assert record.slave == "L" and record.clearance.at(0.0) == pytest.approx(0.001)


def test_a_rigid_master_stays_the_master(tmp_path):
    more = "*NODE\n99999, 0., 0., 0.\n*RIGID BODY, ELSET=B, REF NODE=99999\n*BOUNDARY\n99999, 1, 6\n"
    text = pressed().replace("B_Z0, 3\nB_X0, 1\nB_Y0, 2\n", "").replace("*STEP\n", more + "*STEP\n")
    made = imported(tmp_path, text)
    (told,) = [one for one in made.findings if "few faces" in one.text]
    assert made.case.contact[0].slave == "U" and "its master is rigid" in told.text


def test_with_the_slave_of_one_face_the_block_turns(tmp_path):
    """Roles as the deck has them leave one pressure, about which the block is free to turn."""
    made = imported(tmp_path, pressed())
    (record,) = made.case.contact
    before = replace(record, slave=record.master, master=record.slave, name="before")
    (problem,) = validate(replace(made.case, contact=[before]), made.mesh).problems
    assert "nothing holds a part of the model" in problem.message
    assert not validate(made.case, made.mesh).problems


def test_the_nodes_of_a_slave_are_moved_onto_the_master(tmp_path):
    """A gap of 0.01 that ADJUST closes: the block goes down by its own strain and the overlap, without the gap."""
    text = pressed(above=(2, 2, 2)).replace("TYPE=SURFACE TO SURFACE", "TYPE=SURFACE TO SURFACE, ADJUST=0.02")
    lines = [line.replace(", 1.0", ", 1.01") if line.endswith(", 1.0") and line[0] == "1" and "," in line and
             int(line.split(",")[0]) > 10000 else line for line in text.splitlines()]  # fmt: skip
    found = solved(tmp_path, "\n".join(lines) + "\n")
    assert found.made.case.contact[0].adjust == 0.02
    assert found.problem.adjusted["U"].count == 9
    np.testing.assert_allclose(found.problem.adjusted["U"].largest, 0.01, rtol=1e-9)
    np.testing.assert_allclose(found.zone.pressure, P, rtol=1e-3)


def test_adjust_of_0_takes_overlaps_away_and_leaves_gaps(tmp_path):
    """A slave of which one edge overlaps by 0.01 and the others touch: the overlapping nodes alone are moved."""
    text = pressed(above=(2, 2, 2)).replace("TYPE=SURFACE TO SURFACE", "TYPE=SURFACE TO SURFACE, ADJUST=0.0")
    text = re.sub(r"^(10\d{3}, \S+, 0\.0), 1\.0$", r"\1, 0.99", text, flags=re.MULTILINE)
    found = solved(tmp_path, text)
    assert found.made.case.contact[0].adjust == 0.0
    assert found.problem.adjusted["U"].count == 3
    np.testing.assert_allclose(found.problem.adjusted["U"].largest, 0.01, rtol=1e-9)
    np.testing.assert_allclose(found.zone.pressure, P, rtol=1e-3)


def test_damping_of_contact_is_of_steps_in_motion(tmp_path):
    """The coefficient of *CONTACT DAMPING in *DYNAMIC; a note without it."""
    text = pressed(above=(2, 2, 2)).replace("*CONTACT PAIR", "*CONTACT DAMPING\n0.5\n*CONTACT PAIR")
    made = imported(tmp_path, text)
    assert made.case.contact[0].damping == 0
    assert any("no effect without *DYNAMIC" in one.text for one in made.findings)
    text = text.replace("*STATIC\n1., 1.", "*DYNAMIC\n0.1, 1.").replace("*ELASTIC", "*DENSITY\n1.\n*ELASTIC")
    assert imported(tmp_path, text).case.contact[0].damping == 0.5


def test_what_is_of_heat_alone_is_a_note(tmp_path):
    """Constants of heat, and the type of a displacement, do not keep a static deck from being imported."""
    more = "*MATERIAL, NAME=HOT\n*ELASTIC\n1., 0.\n*CONDUCTIVITY\n50.\n*SPECIFIC HEAT\n446e6\n"
    more += "*PHYSICAL CONSTANTS, ABSOLUTE ZERO=0.\n*BOUNDARY, TYPE=DISPLACEMENT\nB_Z0, 3\n"
    made = imported(tmp_path, pressed(above=(2, 2, 2), more=more))
    notes = [one for one in made.findings if "without steps of heat" in one.text]
    assert [one.card for one in notes] == ["CONDUCTIVITY", "SPECIFIC HEAT", "PHYSICAL CONSTANTS"]
    assert {one.level for one in notes} == {"note"}
