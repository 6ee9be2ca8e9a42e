"""Damaged decks are imported, or refused in sentences that name a place; none ends in another exception."""

import random

import pytest

from lacmesh.errors import LacmeshError
from lacsolver import CaseError, parse_case
from tests.formats.decks import two
from tests.fuzz.mutate import mutated
from tests.lacsolver.deck_texts import Block, held, imported, section, step
from tests.lacsolver.test_import import ABAQUS, CONTACT, ORTHOTROPIC, on_each_other, two_blocks
from tests.samples import samples

COLUMN = Block(cells=(1, 1, 2))
BELOW, ABOVE = two_blocks()
LINEAR = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000.\n*CLEARANCE, SLAVE=UPPER, MASTER=LOWER, VALUE=0.02\n"
#: decks with all cards that are read, where damage is to be done from their first material on
DECKS = [
    on_each_other(
        BELOW,
        ABOVE,
        "*DENSITY\n1.\n*EXPANSION\n1e-4\n" + CONTACT + LINEAR,
        "*DLOAD\nC_EZ1, P2, 20.\nB, GRAV, 1., 0., 0., -1.\n*CLOAD\nC_Z1, 1, 2.\n*NODE PRINT, NSET=B_Z1\nU\n",
    ),
    COLUMN.text()
    + "*NODE\n900, 0.5, 1., 3.\n901, 0.5, 1., 3.\n*SURFACE, NAME=SIDE\nB_EX1, S4\n"
    + "*ELEMENT, TYPE=SPRING1, ELSET=SP\n77, 1\n"
    + section(more="*EXPANSION, ZERO=1.\n1e-4\n")
    + "*BOUNDARY\nB_Z0, 1, 3\n*RIGID BODY, NSET=B_Z1, REF NODE=900, ROT NODE=901\n*BOUNDARY\n900, 1, 3\n901, 1, 3\n"
    + "*AMPLITUDE, NAME=A\n0., 0., 0.5, 1., 1., 0.5\n*SPRING, ELSET=SP\n3\n5.\n"
    + "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nB_N, 3.\n"
    + step("*BOUNDARY, AMPLITUDE=A\n901, 3, 3, 0.001\n*TEMPERATURE\nB_N, 5.\n")
    + step("*BOUNDARY\n901, 3, 3, 0.002\n*DSLOAD, OP=NEW\nSIDE, P, 1.\n", static="0.1, 1.\n"),
    ABAQUS.format(mesh=BELOW.text() + ABOVE.text()),
    COLUMN.text() + ORTHOTROPIC + "*ORIENTATION, NAME=O\n0., 0., 1., 0., 1., 0.\n"
    "*SOLID SECTION, ELSET=B, MATERIAL=W, ORIENTATION=O\n" + held() + step("*DLOAD\nB_EZ1, P2, 20.\n"),
    two(),
    COLUMN.text()
    + "*NODE\n900, 0.5, 1., 3.\n*ELEMENT, TYPE=MASS, ELSET=M\n77, 900\n*ELEMENT, TYPE=ROTARYI, ELSET=R\n78, 900\n"
    + section(more="*DENSITY\n1.\n*DAMPING, ALPHA=0.1, BETA=0.01\n")
    + "*RIGID BODY, NSET=B_Z1, REF NODE=900\n*MASS, ELSET=M\n5.\n*ROTARY INERTIA, ELSET=R\n1., 1., 1.\n"
    + "*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 3, 2.\n900, 3, 2.\n*STEP\n*DYNAMIC, DIRECT, ALPHA=-0.1\n"
    + "0.1, 1.\n*CLOAD\n900, 3, 8.\n*END STEP\n*STEP\n*DYNAMIC, ALPHA=-0.1\n0.1, 1., , 0.5\n*END STEP\n",
]


def damaged(number):
    """The deck of a number, damaged where its mesh ends."""
    rng = random.Random(number)
    text = rng.choice(DECKS)
    mesh, first, rest = text.partition("*MATERIAL" if "*MATERIAL" in text else "*Material")
    others = [deck[-400:].encode() for deck in DECKS]
    return mesh + mutated(rng, (first + rest).encode(), others, True).decode(
        errors="surrogateescape"
    ), rng.random() < 0.3


@pytest.mark.fuzz
@pytest.mark.parametrize("number", range(samples(40, 4000)))
def test_a_damaged_deck(tmp_path, number):
    text, lenient = damaged(number)
    try:
        made = imported(tmp_path, text, lenient=lenient)
    except CaseError as error:
        assert all("model.inp" in line and line.count(": ") for line in str(error).splitlines())
    except LacmeshError as error:
        assert "model.inp" in str(error)
    else:
        assert parse_case(made.text, tmp_path / "case.toml").material == made.case.material


@pytest.mark.parametrize("deck", DECKS)
def test_the_decks_are_taken_as_they_are(tmp_path, deck):
    assert all(finding.level != "error" for finding in imported(tmp_path, deck).findings)
