"""Cards that `lacsolver import` refuses: an error for each, with file, line, card; damaged decks; the command."""

import json
import random
import re

import numpy as np
import pytest

from lacmesh import Mesh, write
from lacmesh.errors import LacmeshError
from lacsolver import CaseError, parse_case
from lacsolver.cli import main
from lacsolver.decks.table import HANDLERS, LACKS, NOTES, PROCEDURES
from tests import REPOSITORY
from tests.formats.decks import two
from tests.fuzz.mutate import mutated
from tests.lacsolver.deck_texts import (
    COLUMN,
    CONTACT,
    PAIR,
    TOP_SURFACE,
    Block,
    bodies,
    column,
    held,
    imported,
    law,
    moving,
    on_each_other,
    section,
    step,
    two_blocks,
)
from tests.lacsolver.test_import import JOINTS, LOCAL, ORTHOTROPIC, REFERENCE, TURNED
from tests.lacsolver.test_import_contact import ABAQUS, INERTIA
from tests.samples import samples

LOAD = "*DLOAD\nB_EZ1, P2, 20.\n"
SURFACES = TOP_SURFACE + "*SURFACE, NAME=LOW\nB_EZ0, S1\n"
DYNAMIC = "*DYNAMIC\n0.1, 1.\n"
BOLT = "*SURFACE, NAME=MID\n1, S2\n*NODE\n99, 5., 5., 5.\n*PRE-TENSION SECTION, SURFACE=MID, NODE={}\n"
#: begins a material of a name of its own
M = "*MATERIAL, NAME=M\n"
ELASTIC = M + "*ELASTIC\n1., 0.\n"
SI = "*SURFACE INTERACTION, NAME=S\n"
SURFACE = "SURFACE BEHAVIOR"
BEHAVE = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE="
BEHAVIOR = SI + BEHAVE
NEXT = "*END STEP\n*STEP\n"
VELOCITY = "*INITIAL CONDITIONS, TYPE=VELOCITY\n"
#: a node that belongs to no element
POINT = "*NODE\n99, 0, 0, 9.\n"
BODY = POINT + "*RIGID BODY, ELSET=B, REF NODE=99\n"
TOUCH = "*CONTACT PAIR, INTERACTION=S\nTOP, LOW\n"
ROUGH = "*CHANGE FRICTION, INTERACTION=S\n*FRICTION, ROUGH\n"
#: cards of the model, cards of the step, the card that the error names, words of its message
REFUSED = [
    ("*ELEMENT, TYPE=S4, ELSET=SH\n77, 1, 2, 3, 4\n", "", "ELEMENT", "none of type S4"),
    (M + "*ELASTIC\nsoft, 0.3\n", "", "ELASTIC", "modulus should be a number, not 'soft'"),
    (M + "*ELASTIC\n1e999, 0.3\n", "", "ELASTIC", "should be a finite number"),
    (M + "*ELASTIC\n1., .3, 0.\n2., .3, 9.\n", "", "ELASTIC", "give one line"),
    (M + "*ELASTIC\n", "", "ELASTIC", "should be followed by a line"),
    (M + "*ELASTIC\n1., .3\n*ELASTIC\n1., .3\n", "", "ELASTIC", "keep one"),
    (M + "*ELASTIC, TYPE=ANISO\n1,2,3,4,5,6,7,8\n9,1,2,3,4,5,6,7\n8,9,1,2,3\n", "", "ELASTIC", "axes of symmetry"),
    (M + "*ELASTIC, TYPE=ORTHO\n1,2,3\n", "", "ELASTIC", "9 constants"),
    (M + "*ELASTIC, TYPE=ORTHO\n1,1,1,1,1,1,1,1\n1\n", "", "ELASTIC", "not positive definite"),
    (M + "*ELASTIC, TYPE=TRACTION\n1.\n", "", "ELASTIC", "TRACTION is not supported"),
    ("*MATERIAL, NAME=EL\n", "", "MATERIAL", "two materials named"),
    (M + "*HYPERELASTIC, MOONEY-RIVLIN\n1.,1.,1.\n", "", "HYPERELASTIC", "MOONEY-RIVLIN"),
    (M + "*HYPERELASTIC, NEO HOOKE\n1., 0.\n", "", "HYPERELASTIC", "be positive"),
    (M + "*CREEP\n1., 0.\n", "", "CREEP", "has elastic materials"),
    ("*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0,0,0,0,0,1\n", "", "ORIENTATION", "only rectangular"),
    ("*SOLID SECTION, ELSET=BB, MATERIAL=EL\n", "", "SOLID SECTION", "set of elements named 'BB'"),
    ("*SOLID SECTION, ELSET=B, MATERIAL=EK\n", "", "SOLID SECTION", "no *MATERIAL named 'EK'"),
    ("*SOLID SECTION, ELSET=B, MATERIAL=EL\n-1.\n", "", "SOLID SECTION", "should be positive"),
    ("*AMPLITUDE, NAME=A, DEFINITION=PERIODIC\n1,2\n", "", "AMPLITUDE", "DEFINITION=TABULAR"),
    ("*AMPLITUDE, NAME=A\n0., 1., 0., 2.\n", "", "AMPLITUDE", "times should increase"),
    ("*INITIAL CONDITIONS, TYPE=STRESS\n1,1,1.\n", "", "INITIAL CONDITIONS", "and VELOCITY are"),
    (VELOCITY + "B_N, 4, 2.\n", "", "INITIAL CONDITIONS", "should be 1 to 3"),
    (VELOCITY + "B_N, 3, 2.\n", DYNAMIC, "BOUNDARY", "in which they are constrained"),
    (VELOCITY + "8, 3, 2.\n", DYNAMIC, "INITIAL CONDITIONS", "not linear in its"),
    (VELOCITY + "99, 3, 2.\n" + POINT, DYNAMIC, "INITIAL CONDITIONS", "no solid element"),
    (BODY + VELOCITY + "B_N, 1, 2.\n", DYNAMIC, "INITIAL CONDITIONS", "to that node"),
    (VELOCITY + "B_N, 1, 2.\n", NEXT + DYNAMIC, "INITIAL CONDITIONS", "static step before"),
    ("*ELEMENT, TYPE=MASS, ELSET=M\n77, 1\n*MASS, ELSET=M\n5.\n", "", "MASS", "no reference node"),
    (BODY + "*ELEMENT, TYPE=MASS, ELSET=M\n77, 99\n*MASS, ELSET=M\n-5.\n", "", "MASS", "should be positive"),
    ("*ELEMENT, TYPE=ROTARYI, ELSET=M\n77, 1\n*ROTARY INERTIA, ELSET=M\n1, 1, 1, 1\n", "", "ROTARY INERTIA", "product"),
    ("*MASS, ELSET=B\n5.\n", "", "MASS", "no elements of one node"),
    (BEHAVIOR + "EXPONENTIAL\n1e-4, 0.\n", "", "SURFACE BEHAVIOR", "should be positive"),
    (BEHAVIOR + "TABULAR\n1., 0.\n2., 1.\n", "", "SURFACE BEHAVIOR", "the first pressure must be 0"),
    (BEHAVIOR + "TABULAR\n0., 0.\n2., 0.\n", "", "SURFACE BEHAVIOR", "pressure and overlap must both increase"),
    (M + "*PLASTIC\n1., 0.\n", "", "PLASTIC", "follow an isotropic"),
    (ELASTIC + "*PLASTIC, HARDENING=COMBINED\n1., 0.\n", "", "PLASTIC", "not COMBINED"),
    (ELASTIC + "*PLASTIC\n2., 0.\n1., 0.1\n", "", "PLASTIC", "a metal that softens is"),
    (ELASTIC + "*PLASTIC, HARDENING=KINEMATIC\n2., 0.\n3., 0.1\n3.5, 0.2\n", "", "PLASTIC", "is linear"),
    (ELASTIC + "*PLASTIC\n2., 0., 20.\n1.5, 0., 100.\n", "", "PLASTIC", "depend on temp"),
    (BEHAVIOR + "LINEAR\n0.\n", "", "SURFACE BEHAVIOR", "should be positive"),
    (SI + "*FRICTION\n-0.2\n", "", "FRICTION", "should not be negative"),
    (SI + "*FRICTION\n0.2, 0.\n0.1, 1.\n", "", "FRICTION", "give one line"),
    (SI + "*FRICTION, TAUMAX=0.\n0.2\n", "", "FRICTION", "TAUMAX should be positive"),
    (SI, "*FRICTION\n0.2\n", "FRICTION", "after *CHANGE FRICTION"),
    (BEHAVIOR + "LINEAR\n5.\n", BEHAVE + "LINEAR\n9.\n", "SURFACE BEHAVIOR", "*CHANGE SURFACE BEHAVIOR"),
    ("", "*CHANGE SURFACE BEHAVIOR, INTERACTION=S\n", "CHANGE SURFACE BEHAVIOR", "SURFACE INTERACTION"),
    ("", "*CHANGE FRICTION, INTERACTION=S\n", "CHANGE FRICTION", "SURFACE INTERACTION"),
    (SURFACES + SI + "*FRICTION\n0.2\n" + TOUCH, "*STATIC\n" + NEXT + ROUGH, "SURFACE INTERACTION", "in some steps"),
    (SURFACES + "*CONTACT PAIR, INTERACTION=S\nTOP, LOV\n", "", "CONTACT PAIR", "did you mean"),
    (SURFACES + "*CONTACT PAIR, INTERACTION=S\nTOP\n", "", "CONTACT PAIR", "a master surface"),
    ("", "*BOUNDARY, TYPE=VELOCITY\nB_Z1, 3, 3, 0.1\n", "BOUNDARY", "not TYPE=VELOCITY"),
    (SI + "*CONTACT DAMPING, DEFINITION=CRITICAL DAMPING FRACTION\n0.1\n", "", "CONTACT DAMPING", "COEFFICIENT"),
    (SI + "*CONTACT DAMPING, TANGENT FRACTION=0.5\n0.1\n", "", "CONTACT DAMPING", "along the normal only"),
    (SI + "*CONTACT DAMPING\n-0.1\n", "", "CONTACT DAMPING", "should be one coefficient that is not negative"),
    (SURFACES + SI + "*CONTACT DAMPING\n0.1\n" + TOUCH, DYNAMIC, "CONTACT DAMPING", "contact is rigid"),
    (SURFACES + "*CONTACT PAIR, INTERACTION=S, ADJUST=B_X1\nTOP, LOW\n", "", "CONTACT PAIR", "all nodes within a dist"),
    (SURFACES + "*CONTACT PAIR, INTERACTION=S, ADJUST=-1.\nTOP, LOW\n", "", "CONTACT PAIR", "should not be negative"),
    (SURFACES + "*CONTACT PAIR, INTERACTION=S\nTOP, LOW\n", "", "CONTACT PAIR", "SURFACE INTERACTION"),
    (SURFACES + "*SURFACE, NAME=N, TYPE=NODE\n1\n*CONTACT PAIR, INTERACTION=S\nN, LOW\n", "", "CONTACT PAIR", "nodes"),
    (SURFACES + "*CLEARANCE, SLAVE=TOP, MASTER=LOW, VALUE=0.1\n", "", "CLEARANCE", "no *CONTACT PAIR"),
    ("*RIGID BODY, NSET=B_Z1\n", "", "RIGID BODY", "REFNODE"),
    ("*ELEMENT, TYPE=SPRING1, ELSET=SP\n77, 1\n*SPRING, ELSET=SP\n3\n-1.\n", "", "SPRING", "stiffness positive"),
    ("*WORMHOLE\n", "", "WORMHOLE", "does not know this card"),
    ("*BOUNDARY, USER\nB_Z0, 3\n", "", "BOUNDARY", "the option USER is not supported"),
    ("*BOUNDARY\nB_Z0, 11\n", "", "BOUNDARY", "directions should be 1 to 3"),
    ("*BOUNDARY\n4711, 3\n", "", "BOUNDARY", "there is no node 4711"),
    ("*BOUNDARY\nB_Z9, 3\n", "", "BOUNDARY", "no set of nodes named 'B_Z9'"),
    ("*CLOAD\n1, 1, 1.\n", "", "CLOAD", "between *STEP and *END STEP"),
    ("", "*CLOAD\n1, 4, 1.\n", "CLOAD", "only the reference node of a *RIGID BODY or a *COUPLING has rotations"),
    (POINT, "*CLOAD\n99, 1, 1.\n", "CLOAD", "no solid element, and carry no force"),
    ("", "*DLOAD\nB, P7, 1.\n", "DLOAD", "a HEXA8 has the faces 1 to 6"),
    ("", "*DLOAD\nB, BX, 1.\n", "DLOAD", "not BX"),
    ("", "*DLOAD\nB, GRAV, 1.\n", "DLOAD", "should not be 0"),
    ("", "*DLOAD\nB, GRAV, 1., 0., 0., -1.\n", "DLOAD", "give their material a *DENSITY"),
    (SURFACES, "*DSLOAD\nTOP, HP, 1.\n", "DSLOAD", "not HP"),
    ("", "*CLOAD, AMPLITUDE=A\n1, 1, 1.\n", "CLOAD", "no *AMPLITUDE named 'A'"),
    ("*AMPLITUDE, NAME=A\n0,0,1,1\n", "*CLOAD, AMPLITUDE=A\n1, 1, 1.\n*CLOAD\n1, 1, 1.\n", "CLOAD", "same amplitude"),
    ("", f"*TEMPERATURE\nB_N, 5.\n{NEXT}*STATIC\n*TEMPERATURE, OP=NEW\n1, 3.\n", "TEMPERATURE", "OP=NEW"),
    ("", "*BOUNDARY, OP=NEW\n1, 1, 1\n", "BOUNDARY", "OP=NEW"),
    (BODY + "*BOUNDARY\n99, 1, 3\n", NEXT + "*STATIC\n*BOUNDARY\n99, 4, 6\n", "BOUNDARY", "the first step"),
    ("", NEXT + "*STATIC\n*BOUNDARY, FIXED\nB_Z1, 1\n*BOUNDARY\nB_Z1, 1, 1, 0.1\n", "BOUNDARY", "or a later step, an"),
    ("", NEXT + "*DYNAMIC\n0.1, 1.\n*BOUNDARY\nB_Z1, 1\n", "BOUNDARY", "begins in a step of *DYNAMIC"),
    ("*AMPLITUDE, NAME=A\n0,0,1,1\n", "*CLOAD, AMPLITUDE=A\n1,1,1.\n*END STEP\n*STEP\n*STATIC\n", "CLOAD", "repeated"),
    ("", "*MODAL DYNAMIC\n", "MODAL DYNAMIC", "implicit ones with inertia"),
    ("", "*DYNAMIC, EXPLICIT\n", "DYNAMIC", "this step is EXPLICIT"),
    ("", "*DYNAMIC, ALPHA=-0.5\n", "DYNAMIC", "ALPHA should be from -1/3 to 0"),
    ("", "*DYNAMIC\n*END STEP\n*STEP\n*DYNAMIC, ALPHA=0.\n", "DYNAMIC", "one ALPHA for all steps"),
    ("", "*DYNAMIC\n", "MATERIAL", "has no *DENSITY"),
    ("", "*DYNAMIC\n*END STEP\n*STEP\n*STATIC\n", "STATIC", "after a dynamic one"),
    ("", "*DYNAMIC\n1e-9, 1.\n", "DYNAMIC", "too long for the case"),
    ("", LOAD + "*FREQUENCY\n3\n", "END STEP", "give supports in the model"),
    ("", "*FREQUENCY\n0\n", "FREQUENCY", "should be positive"),
    ("", "*END STEP\n*STEP, PERTURBATION\n*STATIC\n", "END STEP", "with *FREQUENCY alone"),
    ("", "*STATIC\n1., -1.\n", "STATIC", "should be positive"),
    ("", "*MODEL CHANGE, TYPE=ELEMENT, REMOVE\nB\n", "MODEL CHANGE", "in all steps"),
    ("", "*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nA, B\n", "MODEL CHANGE", "no *CONTACT PAIR"),
    ("", "*MODEL CHANGE, TYPE=CONTACT PAIR\nA, B\n", "MODEL CHANGE", "ADD or REMOVE"),
    ("", "*MODEL CHANGE, TYPE=CONTACT PAIR, ADD\nA\n", "MODEL CHANGE", "a master surface"),
    ("", "*STEP\n*STATIC\n", "STEP", "has no *END STEP before it"),
    ("*BOUNDARY, OP=NEW, OP=MOD\nB_X0, 1\n", "", "BOUNDARY", "OP is both NEW and MOD"),
    ("", "*END STEP\n*STEP, NLGEOM\n*STATIC\n", "STEP", "in all of them or in none"),
    ("", "*TEMPERATURE\n1, 100.\n", "TEMPERATURE", "have several temperatures"),
    ("*EQUATION\n2\n1, 4, 1., 2, 1, -1.\n", "", "EQUATION", "directions of an equation should be 1 to 3"),
    ("*EQUATION\n3\n1, 1, 1., 2, 1, -1.\n", "", "EQUATION", "it should have 3 terms, and has 2"),
    ("*EQUATION\n2\nB_N, 1, 1., 2, 1, -1.\n", "", "EQUATION", "a term of an equation should be at one node"),
    ("*MPC\nBEAM, 1, 2\n", "", "MPC", "and not BEAM"),
    ("*MPC\nPLANE, 1, 1, 2, 3\n", "", "MPC", "are on one line, and define no plane"),
    ("*TRANSFORM, NSET=B_N\n1, 0, 0, 2, 0, 0\n", "", "TRANSFORM", "on one line with the origin"),
    ("*TRANSFORM, NSET=B_N, TYPE=C\n0, 0, 1, 0, 0, 1\n", "", "TRANSFORM", "points of the axis are the same"),
    (SURFACES + "*COUPLING, REF NODE=1, SURFACE=TOP\n", "", "COUPLING", "followed by *KINEMATIC or *DISTRIBUTING"),
    ("*KINEMATIC\n1, 3\n", "", "KINEMATIC", "it belongs after *COUPLING"),
    ("*CYCLIC SYMMETRY MODEL, N=4\n0, 0, 0, 0, 0, 1\n", "", "CYCLIC SYMMETRY MODEL", "should follow *TIE"),
    (
        SURFACES + "*TIE, NAME=T, CYCLIC SYMMETRY\nTOP, LOW\n*CYCLIC SYMMETRY MODEL, N=4\n1, 0, 0, 1, 0, 0\n", "",
        "CYCLIC SYMMETRY MODEL", "points of the axis are the same",
    ),
    ("*SELECT CYCLIC SYMMETRY MODES, NMIN=0, NMAX=2\n", "", "SELECT CYCLIC SYMMETRY MODES", "nodal diameters"),
    ("*NODE\n99, 0, 0, 9\n*EQUATION\n2\n1, 1, 1., 99, 1, -1.\n", "", "EQUATION", "no solid element, and is free"),
    ("*PRE-TENSION SECTION, ELEMENT=2, NODE=99\n", "", "PRE-TENSION SECTION", "a bolt that is a beam"),
    (BOLT.format(1), "*CLOAD\n1, 1, 1.\n", "PRE-TENSION SECTION", "a node of its own"),
    (BOLT.format(99), "*CLOAD\nB_Z1, 3, 1.\n", "PRE-TENSION SECTION", "node 99 has no"),
    ("", "*BOUNDARY, FIXED\nB_Z1, 3\n", "BOUNDARY", "is taken from the second step on"),
    ("", NEXT + "*STATIC\n*BOUNDARY, FIXED\nB_Z1, 3, 4\n", "BOUNDARY", "of solid elements in directions 1 to 3"),
    *(
        (f"{POINT}*ELEMENT, TYPE={kind}, ELSET=P\n77, 1, {node}\n*SPRING, ELSET=P{rows}", "", "SPRING", words)
        for kind, node, rows, words in (
            ("SPRING2", 2, "\n1, 2\n5.\n", "one direction, 1 to 3, at both"),
            ("SPRING2", 2, "\n4, 4\n5.\n", "one direction, 1 to 3, at both"),
            ("SPRING2", 2, "\n\n5.\n", "a line with its two directions"),
            ("SPRINGA", 2, "\n1, 1\n5.\n", "a SPRINGA a blank line"),
            ("SPRINGA", 2, "\n\n5., , 20.\n6., , 30.\n", "at one temperature"),
            ("SPRINGA", 2, "\n\n0.\n", "the stiffness should be positive, not 0"),
            ("SPRINGA", 2, ", NONLINEAR\n\n0., 0.\n5., 1.\n", "the option NONLINEAR is not supported"),
            ("SPRING2", 99, "\n1, 1\n5.\n", "99 belong to no solid element, and carry no spring"),
        )
    ),
    *(
        (f"{BEHAVIOR}{kind}\n", f"*CHANGE {SURFACE}, INTERACTION=S\n{BEHAVE}{now}\n", SURFACE, "say LINEAR")
        for kind, now in (
            ("HARD", "LINEAR\n5."), ("LINEAR\n5.", "HARD"), ("TIED\n5.", "LINEAR\n5."),
            ("TABULAR\n0., 0.\n5., 1.", "LINEAR\n5."), ("LINEAR\n5.", "EXPONENTIAL\n1., 1."),
        )
    ),
]  # fmt: skip


BLOCK = Block()
PROCEDURE = r"\*STATIC\n(?=(?:(?!\*STEP|\*END).*\n)*\*(?:STATIC|DYNAMIC|FREQUENCY))"


def deck(model, loads, more=""):
    """A deck of a block; a step whose cards have a procedure is not *STATIC."""
    text = bodies(BLOCK, more="*EXPANSION\n1e-5\n" + more) + held() + model + step(loads)
    return re.sub(PROCEDURE, "", text)


@pytest.mark.parametrize(("model", "loads", "card", "words"), REFUSED)
def test_refused(tmp_path, model, loads, card, words):
    text = deck(model, loads)
    with pytest.raises(CaseError) as caught:
        imported(tmp_path, text)
    lines = text.splitlines()
    told = [line for line in str(caught.value).splitlines() if words in line]
    assert len(told) >= 1, str(caught.value)
    at = re.match(r".*model\.inp, line (\d+): \*([A-Z -]+): ", told[0])
    assert at
    assert at[2] == card
    begun = [k for k, line in enumerate(lines[: int(at[1])]) if line.startswith("*")]
    assert lines[begun[-1]].upper().startswith(f"*{card}")


@pytest.mark.parametrize(
    ("model", "loads", "words", "wrong"),
    [
        ("", NEXT + "*DYNAMIC\n0.1, 1.\n*BOUNDARY\nB_Z1, 3\nB_Z1, 1\n", "this support begins", ["B_Z1, 3", "B_Z1, 1"]),
        (M + "*ELASTIC\n1., 0.\n*PLASTIC\n2., 0.\n3., 1.\n4., 2., 500.\n", "", "values that depend", ["4., 2., 500."]),
    ],
)
def test_what_is_refused_is_told_with_its_line(tmp_path, model, loads, words, wrong):
    """A support not with one of other nodes in the same direction, or of its nodes in another one."""
    text = deck(model, loads)
    with pytest.raises(CaseError, match=words) as caught:
        imported(tmp_path, text)
    told = re.findall(rf"line (\d+): \*[A-Z]+: {words}", str(caught.value))
    assert [text.splitlines()[int(line) - 1] for line in told] == wrong


GOOD = deck("", LOAD)
SMALL = Block(cells=(1, 1, 2))
TILTED = Block("C", (0, 0, 1), (1, 1, 2), (2, 2, 1), first=100)
TILTED.places = TILTED.points + np.outer(np.arange(len(TILTED.points)) == 0, [0, 0, 0.1])
UNEVEN = bodies(BLOCK, TILTED) + held() + "*BOUNDARY\nC_X0, 1\nC_Y0, 2\n" + PAIR + CONTACT
UNEVEN += "*CLEARANCE, SLAVE=UPPER, MASTER=LOWER, VALUE=0.\n" + step("*BOUNDARY\nC_Z1, 3, 3, -0.1\n")
OTHER = Block("C", (3, 0, 0), (4, 1, 1), first=100).text() + "*MATERIAL, NAME=SOFT\n*ELASTIC\n1., 0.\n*DENSITY\n1.\n"
OTHER += "*DAMPING, ALPHA=1.\n*SOLID SECTION, ELSET=C, MATERIAL=SOFT\n"
PLANE = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n*ELEMENT, TYPE=CPE4, ELSET=B\n1, 1, 2, 3, 4\n" + section()
RING = PLANE.replace("CPE4", "CAX4").replace("*SOLID", "*DENSITY\n1.\n*SOLID") + "*BOUNDARY\n1, 2\n2, 2\n"
RING += step("*DLOAD\nB, GRAV, 2., 1., 0., 0.\n")
INSTANCES = f"*PART, NAME=P\n{BLOCK.text()}*SOLID SECTION, ELSET=B, MATERIAL=EL\n*END PART\n*ASSEMBLY, NAME=A\n"
INSTANCES += (
    "*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n*INSTANCE, NAME=J, PART=P\n3., 0., 0.\n*END INSTANCE\n*END ASSEMBLY\n"
)
INSTANCES += "*MATERIAL, NAME=EL\n*ELASTIC\n1., 0.\n*BOUNDARY\n1, 1, 3\n" + step(LOAD)
WOOD = "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1,1,1,.3,.3,.3,1,1\n1"
TURN = TOP_SURFACE + POINT + "*COUPLING, REF NODE=99, SURFACE=TOP\n*{}\n*BOUNDARY\n99, 4\n"


def instead(old, new, text=GOOD):
    assert old in text
    return text.replace(old, new)


#: a deck that is wrong as a whole, and what is said
WHOLE = [
    (bodies(BLOCK) + held() + step("*DYNAMIC\n" + LOAD), r"\*DYNAMIC: this step is \*STATIC already \(line \d+\)"),
    (instead("*END STEP\n", ""), r"\*STEP: this step has no \*END STEP"),
    (bodies(BLOCK) + held(), r"there is no \*STEP"),
    (BLOCK.text() + held() + step(LOAD), r"\*ELEMENT: elements 1 have no \*SOLID SECTION"),
    (instead("*ELASTIC\n1000., 0.3", "*DENSITY\n1."), r"material EL has no \*ELASTIC"),
    (instead("*ELASTIC\n1000., 0.3", "*HYPERELASTIC, NEO HOOKE\n1., 1."), "finite displacements only; add NLGEOM"),
    (
        instead("*ELASTIC\n1000., 0.3", WOOD).replace("*STEP", "*STEP, NLGEOM"),
        "small displacements only; remove NLGEOM",
    ),
    (instead("1000., 0.3", "1000., 0.5"), r"^\*MATERIAL \(model.inp, line \d+\): .*poisson is 0.5"),
    (UNEVEN, r"\*CLEARANCE: the gap in the mesh is from .* to "),
    (
        bodies(SMALL) + held() + step("*DLOAD\nB, P2, 1.\n"),
        r"\*DLOAD: these faces of elements 1 lie between two elements",
    ),
    (deck(OTHER, DYNAMIC + LOAD, "*DENSITY\n1.\n"), r"\*DYNAMIC: materials EL, SOFT have several dampings"),
    (PLANE + "*BOUNDARY\n1, 1, 2\n2, 2\n" + step("*CLOAD\n3, 3, 1.\n"), r"\*CLOAD: a force has the directions 1 and 2"),
    *(
        (
            f"{PLANE}*NSET, NSET=ALL\n1, 2, 3, 4\n*TRANSFORM, NSET=ALL\n{points}\n*BOUNDARY\n1, 2\n" + step(""),
            r"\*BOUNDARY: the points of a \*TRANSFORM in a plane should have z = 0",
        )
        for points in ("1, 0, 1, 0, 1, 0", "1, 0, 0, 0, 1, 1")
    ),
    (RING, r"\*DLOAD: gravity along the radius"),
    (INSTANCES, r"\*BOUNDARY: there are 2 instances of parts"),
    *(
        (deck(TURN.format(kind), LOAD).replace("*STEP", "*STEP, NLGEOM"), rf"line \d+: \*COUPLING: .*{words}")
        for kind, words in (
            ("DISTRIBUTING\n1, 6", "about all axes or about none"),
            ("KINEMATIC\n1\n3", "as its rotations are prescribed"),
        )
    ),
]


@pytest.mark.parametrize(("text", "said"), WHOLE, ids=range(len(WHOLE)))
def test_a_deck_that_is_wrong_as_a_whole(tmp_path, text, said):
    with pytest.raises(CaseError, match=said):
        imported(tmp_path, text)


def test_lenient_leaves_out_what_lacsolver_lacks(tmp_path):
    """Cards without a place are left out with a warning, and an explicit step is implicit; mistakes stay errors."""
    text = deck("*SUBMODEL, TYPE=NODE\n*WORMHOLE\n", "*DYNAMIC, EXPLICIT\n0.1, 1.\n" + LOAD, "*DENSITY\n1.\n")
    made = imported(tmp_path, text, lenient=True)
    warned = {finding.card: finding.message for finding in made.findings if finding.level == "warning"}
    assert set(warned) == {"SUBMODEL", "WORMHOLE", "DYNAMIC"} and made.case.dynamics.alpha == 0.05
    assert warned["WORMHOLE"].startswith("left out: ") and warned["DYNAMIC"].endswith("the step is implicit")
    # without its procedure the step would be another one
    for old, new, words in (("*DYNAMIC", "*VISCO", r"\*VISCO"), ("*WORMHOLE", "*BOUNDARY\n4711, 1", "no node 4711")):
        with pytest.raises(CaseError, match=words):
            imported(tmp_path, text.replace(old, new), lenient=True)


def test_a_partial_import_leaves_out_what_is_not_taken(tmp_path):
    """Lines, cards and steps that are refused are left out with a warning of their line; the rest is a case."""
    loads = LOAD + "B, BX, 1.\n*CLOAD\n4711, 3, 1.\nB_Z1, 1, 2.\n" + NEXT + "*VISCO\n1., 1.\n*CLOAD\nB_Z1, 1, 3.\n"
    shells = "*ELEMENT, TYPE=S4, ELSET=SH\n77, 1, 2, 3, 4\n*SHELL SECTION, ELSET=SH, MATERIAL=EL\n1.\n"
    text = deck(shells + "*SUBMODEL, TYPE=NODE\n*BOUNDARY\nB_Z0, 11\n", loads)
    with pytest.raises(CaseError):
        imported(tmp_path, text, lenient=True)
    made = imported(tmp_path, text, partial=True)
    lines = text.splitlines()
    left = [finding for finding in made.findings if finding.message.startswith("left out: ")]
    assert [finding.level for finding in left] == ["warning"] * 7
    assert [lines[finding.line - 1].split(",")[0] for finding in left] == [
        "*ELEMENT", "*SHELL SECTION", "*SUBMODEL", "B_Z0", "B", "4711", "*VISCO",
    ]  # fmt: skip
    assert made.case.steps.last == 1 and [load.group for load in made.case.force] == ["B_Z1"]
    assert made.case.force[0].fx.at(1.0) == 2 and len(made.case.pressure) == 1
    with pytest.raises(CaseError, match=r"have no \*SOLID SECTION"):  # without which there is no case
        imported(tmp_path, text.replace("*SOLID SECTION", "*SOLID SEKTION"), partial=True)


def test_the_table_and_the_page_have_each_card_once():
    page = " ".join((REPOSITORY / "docs" / "import.md").read_text().split())
    named = {"".join(name.split()) for name in re.findall(r"\*([A-Z][A-Z -]*[A-Z])", page)}
    every = [*HANDLERS, *NOTES, *LACKS, *PROCEDURES]
    assert len(every) == len(set(every))
    assert HANDLERS.keys() <= named <= {*every, "NODE", "NSET", "ELSET"}


def test_every_card_of_the_table_is_refused_or_noted(tmp_path):
    """Each card that lacsolver lacks is an error of its own line; each that does not matter is a note."""
    with pytest.raises(CaseError) as caught:
        imported(tmp_path, deck("", "".join(f"*{key}\n" for key in sorted(LACKS | PROCEDURES))))
    assert re.findall(r"line \d+: \*([^:]+): ", str(caught.value)) == sorted(LACKS | PROCEDURES)
    made = imported(tmp_path, deck("", LOAD + "".join(f"*{key}\n" for key in sorted(NOTES))))
    assert [finding.card for finding in made.findings] == sorted(NOTES)


# ---- damaged decks are imported, or refused in sentences that name a place; none ends in another exception

WOOD_AXES = "*ORIENTATION, NAME=O\n0., 0., 1., 0., 1., 0.\n*SOLID SECTION, ELSET=B, MATERIAL=W, ORIENTATION=O\n"
SPRING = "*ELEMENT, TYPE=SPRING1, ELSET=SP\n77, 1\n*SPRING, ELSET=SP\n3\n5.\n*AMPLITUDE, NAME=A\n0., 0., 1., 0.5\n"
MODEL = (
    SPRING + REFERENCE + TURNED + "B_Z0, 1, 3\n999, 1, 3\n901, 1, 3\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nB_N, 3.\n"
)
STEPS = step("*BOUNDARY, AMPLITUDE=A\n901, 3, 3, 0.001\n*TEMPERATURE\nB_N, 5.\n")
STEPS += step("*BOUNDARY\n901, 3, 3, 0.002\n*DSLOAD, OP=NEW\nSIDE, P, 1.\n", static="0.1, 1.\n")
LINEAR = CONTACT + law(5000) + "*CLEARANCE, SLAVE=UPPER, MASTER=LOWER, VALUE=0.02\n"
LOADS = "*DLOAD\nC_EZ1, P2, 20.\nB, GRAV, 1., 0., 0., -1.\n*CLOAD\nC_Z1, 1, 2.\n*NODE PRINT, NSET=B_Z1\nU\n"
DAMPED = "*DENSITY\n1.\n*DAMPING, ALPHA=0.1, BETA=0.01\n"
MOVED = "*CLOAD\n900, 3, 8.\n*END STEP\n*STEP\n*DYNAMIC, ALPHA=-0.1\n0.1, 1., , 0.5\n"
#: decks with all cards that are read, where damage is to be done from their first material on
DECKS = [
    on_each_other(*two_blocks(), LINEAR, LOADS, more="*DENSITY\n1.\n*EXPANSION\n1e-4\n"),
    SMALL.text() + "*SURFACE, NAME=SIDE\nB_EX1, S4\n" + section(more="*EXPANSION, ZERO=1.\n1e-4\n") + MODEL + STEPS,
    ABAQUS.format(mesh="".join(block.text() for block in two_blocks())),
    SMALL.text() + ORTHOTROPIC + LOCAL + WOOD_AXES + held() + step(LOAD),
    two(),
    bodies(SMALL, more=DAMPED)
    + INERTIA
    + VELOCITY
    + "B_N, 3, 2.\n900, 3, 2.\n"
    + moving(MOVED, procedure=", ALPHA=-0.1"),
    *(column(more, loads, supports=supports) for more, loads, supports, _ in JOINTS.values()),
]


def damaged(number):
    """The deck of a number, damaged where its mesh ends."""
    rng = random.Random(number)
    text = rng.choice(DECKS)
    mesh, first, rest = text.partition("*MATERIAL" if "*MATERIAL" in text else "*Material")
    others = [deck[-400:].encode() for deck in DECKS]
    content = mutated(rng, (first + rest).encode(), others, True)
    return mesh + content.decode(errors="surrogateescape"), rng.random() < 0.3


@pytest.mark.fuzz
@pytest.mark.parametrize("number", sorted({*range(samples(40, 4000)), 1462, 1507}))
def test_a_damaged_deck(tmp_path, number):
    text, lenient = damaged(number)
    try:
        made = imported(tmp_path, text, lenient=lenient, partial=lenient and number % 2 == 0)
    except CaseError as error:
        assert all("model.inp" in line and line.count(": ") for line in str(error).splitlines())
    except LacmeshError as error:
        assert "model.inp" in str(error)
    else:
        assert parse_case(made.text, tmp_path / "case.toml").material == made.case.material


@pytest.mark.parametrize("deck", DECKS)
def test_the_decks_are_taken_as_they_are(tmp_path, deck):
    assert all(finding.level != "error" for finding in imported(tmp_path, deck).findings)


# ---- the command

TEXT = column("", "*DLOAD\nB_EZ1, P2, 20.\n*NODE PRINT, NSET=B_Z1\nU\n*EL PRINT, ELSET=B\nS\n")
VISCO = f"column.inp, line {TEXT.splitlines().index('*STATIC') + 1}: *VISCO: lacsolver computes static steps"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "column.inp").write_text(TEXT)
    return tmp_path


def test_import_validate_run(folder, capsys):
    """Two commands to an answer: the probes of *NODE PRINT have the exact displacements."""
    assert main(["import", "column.inp"]) == 0
    out, err = capsys.readouterr()
    assert "next: lacsolver validate column.toml" in out and (folder / "column.med").is_file()
    text = (folder / "column.toml").read_text()
    assert f"# *DLOAD (column.inp, line {TEXT.splitlines().index('*DLOAD') + 1})\n[[pressure]]" in text
    assert 'mesh = "column.med"' in text
    assert err.count("lacsolver: note: column.inp, line ") == 2
    assert main(["validate", "column.toml"]) == 0
    assert main(["run", "column.toml", "-o", "out"]) == 0
    figures = json.loads((folder / "out" / "results.json").read_text())["steps"][-1]
    assert set(figures["probes"]) == {f"node {n}" for n in COLUMN.at(2, 3)}
    for u in figures["probes"].values():
        assert u == pytest.approx([0, 0, -20 / 1000 * 3])
    assert figures["reactions"]["B_Z0"] == pytest.approx([0, 0, 40])


#: a change of the deck, what the command is asked for, its status, part of the message
REQUESTS = [
    (("*STATIC", "*VISCO"), ["column.inp"], 1, f"lacsolver: error: {VISCO}"),
    (("*STEP", "*SUBMODEL, TYPE=NODE\n*STEP"), ["column.inp"], 1, "*SUBMODEL"),
    (("*STEP", "*SUBMODEL, TYPE=NODE\n*STEP"), ["column.inp", "--lenient"], 0, "lacsolver: warning: column.inp, line "),
    (("*STATIC", "*BUCKLE"), ["column.inp", "--lenient"], 1, "*BUCKLE"),
    (("*DLOAD", "*DFLUX\n*STATIC\n*DLOAD"), ["column.inp", "--partial"], 0, "*STATIC: left out: this step is *STATIC"),
    (("", ""), ["column.inp", "-o", "kept.toml"], 2, "kept.med"),
    (("", ""), ["column.inp", "-o", "kept.toml", "--force"], 0, ""),
    (("", ""), ["nowhere.inp"], 3, "cannot be read"),
    (("", ""), ["mesh.msh"], 3, "is no deck of CalculiX or Abaqus"),
    (("", ""), ["column.inp", "-o", "case.inp"], 2, "a case file is called .toml"),
]


@pytest.mark.parametrize(("change", "arguments", "status", "words"), REQUESTS)
def test_requests(folder, capsys, change, arguments, status, words):
    """A deck that is refused leaves nothing, and files that are there are kept without --force."""
    write(folder / "mesh.msh", Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]])]))
    (folder / "kept.med").write_text("mine")
    (folder / "column.inp").write_text(TEXT.replace(*change, 1))
    assert main(["import", *arguments]) == status
    told = capsys.readouterr().err
    assert words in told and (not status or len(told.splitlines()) == 1)
    assert ((folder / "kept.med").read_bytes() == b"mine") == ("--force" not in arguments)
    assert not status or {path.name for path in folder.iterdir()} == {"column.inp", "kept.med", "mesh.msh"}
