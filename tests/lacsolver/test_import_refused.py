"""Cards that `lacsolver import` refuses: an error for each, with file, line, card, and what to try."""

import re
from pathlib import Path

import pytest

from lacsolver import CaseError
from lacsolver.decks.table import LACKS, NOTES, PROCEDURES, READ
from tests.lacsolver.deck_texts import Block, held, imported, section, step

LOAD = "*DLOAD\nB_EZ1, P2, 20.\n"
SURFACES = "*SURFACE, NAME=TOP\nB_EZ1, S2\n*SURFACE, NAME=LOW\nB_EZ0, S1\n"
DYNAMIC = "*DYNAMIC\n0.1, 1.\n"
ROOT = Path(__file__).resolve().parents[2]
#: name -> cards of the model, cards of the step, the card that the error names, words of its message
REFUSED = {
    "shell": ("*ELEMENT, TYPE=S4, ELSET=SH\n77, 1, 2, 3, 4\n", "", "ELEMENT", "none of type S4"),
    **{
        f"spring between nodes, {what}": (
            f"*NODE\n99, 0, 0, 9.\n*ELEMENT, TYPE={kind}, ELSET=P\n77, 1, {node}\n*SPRING, ELSET=P{option}\n{rows}", "",
            "SPRING", words,
        )
        for what, kind, node, option, rows, words in (
            ("two directions", "SPRING2", 2, "", "1, 2\n5.\n", "one direction, 1 to 3, at both"),
            ("a rotation", "SPRING2", 2, "", "4, 4\n5.\n", "one direction, 1 to 3, at both"),
            ("no direction", "SPRING2", 2, "", "\n5.\n", "a line with its two directions"),
            ("a direction of a line", "SPRINGA", 2, "", "1, 1\n5.\n", "a SPRINGA a blank line"),
            ("temperatures", "SPRINGA", 2, "", "\n5., , 20.\n6., , 30.\n", "at one temperature"),
            ("no stiffness", "SPRINGA", 2, "", "\n0.\n", "the stiffness should be positive, not 0"),
            ("a table", "SPRINGA", 2, ", NONLINEAR", "\n0., 0.\n5., 1.\n", "the option NONLINEAR is not taken"),
            ("a loose node", "SPRING2", 99, "", "1, 1\n5.\n", "99 belong to no solid element, and carry no spring"),
        )
    },
    "young": ("*MATERIAL, NAME=M\n*ELASTIC\nsoft, 0.3\n", "", "ELASTIC", "modulus should be a number, not 'soft'"),
    "infinite": ("*MATERIAL, NAME=M\n*ELASTIC\n1e999, 0.3\n", "", "ELASTIC", "should be a finite number"),
    "two temperatures": ("*MATERIAL, NAME=M\n*ELASTIC\n1., .3, 0.\n2., .3, 9.\n", "", "ELASTIC", "give one line"),
    "no line": ("*MATERIAL, NAME=M\n*ELASTIC\n", "", "ELASTIC", "should be followed by a line"),
    "elastic twice": ("*MATERIAL, NAME=M\n*ELASTIC\n1., .3\n*ELASTIC\n1., .3\n", "", "ELASTIC", "keep one"),
    "anisotropic": (
        "*MATERIAL, NAME=M\n*ELASTIC, TYPE=ANISO\n1,2,3,4,5,6,7,8\n9,1,2,3,4,5,6,7\n8,9,1,2,3\n",
        "", "ELASTIC", "three axes of symmetry",
    ),
    "few constants": ("*MATERIAL, NAME=M\n*ELASTIC, TYPE=ORTHO\n1,2,3\n", "", "ELASTIC", "9 constants"),
    "singular": (
        "*MATERIAL, NAME=M\n*ELASTIC, TYPE=ORTHO\n1,1,1,1,1,1,1,1\n1\n", "", "ELASTIC", "not positive definite",
    ),
    "kind of elasticity": ("*MATERIAL, NAME=M\n*ELASTIC, TYPE=TRACTION\n1.\n", "", "ELASTIC", "TRACTION is not taken"),
    "material twice": ("*MATERIAL, NAME=EL\n", "", "MATERIAL", "two materials named"),
    "mooney": ("*MATERIAL, NAME=M\n*HYPERELASTIC, MOONEY-RIVLIN\n1.,1.,1.\n", "", "HYPERELASTIC", "MOONEY-RIVLIN"),
    "incompressible": ("*MATERIAL, NAME=M\n*HYPERELASTIC, NEO HOOKE\n1., 0.\n", "", "HYPERELASTIC", "be positive"),
    "creep": ("*MATERIAL, NAME=M\n*CREEP\n1., 0.\n", "", "CREEP", "has elastic materials"),
    "cylindrical axes": (
        "*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0,0,0,0,0,1\n", "", "ORIENTATION", "only rectangular",
    ),
    "set of a section": ("*SOLID SECTION, ELSET=BB, MATERIAL=EL\n", "", "SOLID SECTION", "set of elements named 'BB'"),
    "material of a section": ("*SOLID SECTION, ELSET=B, MATERIAL=EK\n", "", "SOLID SECTION", "no *MATERIAL named 'EK'"),
    "thickness": ("*SOLID SECTION, ELSET=B, MATERIAL=EL\n-1.\n", "", "SOLID SECTION", "should be positive"),
    "amplitude": ("*AMPLITUDE, NAME=A, DEFINITION=PERIODIC\n1,2\n", "", "AMPLITUDE", "DEFINITION=TABULAR"),
    "times": ("*AMPLITUDE, NAME=A\n0., 1., 0., 2.\n", "", "AMPLITUDE", "times should increase"),
    "initial stress": ("*INITIAL CONDITIONS, TYPE=STRESS\n1,1,1.\n", "", "INITIAL CONDITIONS", "and VELOCITY are"),
    "velocity of a rotation": (
        "*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 4, 2.\n", "", "INITIAL CONDITIONS", "should be 1 to 3",
    ),
    "velocity of held nodes": (
        "*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 3, 2.\n", DYNAMIC, "BOUNDARY", "in which they are held",
    ),
    "velocity of a part": (
        "*INITIAL CONDITIONS, TYPE=VELOCITY\n8, 3, 2.\n", DYNAMIC, "INITIAL CONDITIONS", "not linear in its",
    ),
    "loose velocity": (
        "*NODE\n99, 0, 0, 9.\n*INITIAL CONDITIONS, TYPE=VELOCITY\n99, 3, 2.\n", DYNAMIC,
        "INITIAL CONDITIONS", "belong to no solid element",
    ),
    "velocity of a rigid body": (
        "*NODE\n99, 0, 0, 0\n*RIGID BODY, ELSET=B, REF NODE=99\n*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 1, 2.\n",
        DYNAMIC, "INITIAL CONDITIONS", "give the velocity to that node",
    ),
    "velocity before a static step": (
        "*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 1, 2.\n", f"*END STEP\n*STEP\n{DYNAMIC}",
        "INITIAL CONDITIONS", "in the static step before",
    ),
    "mass of a node": ("*ELEMENT, TYPE=MASS, ELSET=M\n77, 1\n*MASS, ELSET=M\n5.\n", "", "MASS", "no reference node"),
    "no mass": (
        "*NODE\n99, 0, 0, 0\n*RIGID BODY, NSET=B_Z1, REF NODE=99\n*ELEMENT, TYPE=MASS, ELSET=M\n77, 99\n"
        "*MASS, ELSET=M\n-5.\n", "", "MASS", "should be positive",
    ),
    "product of inertia": (
        "*ELEMENT, TYPE=ROTARYI, ELSET=M\n77, 1\n*ROTARY INERTIA, ELSET=M\n1., 1., 1., 0.5\n",
        "", "ROTARY INERTIA", "products of inertia",
    ),
    "masses of springs": ("*MASS, ELSET=B\n5.\n", "", "MASS", "no elements of one node"),
    "exponential": (
        "*SURFACE INTERACTION, NAME=S\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=EXPONENTIAL\n1e-4, 0.\n",
        "", "SURFACE BEHAVIOR", "should be positive",
    ),
    "table of pressures": (
        "*SURFACE INTERACTION, NAME=S\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n1., 0.\n2., 1.\n",
        "", "SURFACE BEHAVIOR", "begin where the pressure does, at 0",
    ),
    "table that falls": (
        "*SURFACE INTERACTION, NAME=S\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n2., 0.\n",
        "", "SURFACE BEHAVIOR", "pressure and overlap both grow",
    ),
    "plastic alone": ("*MATERIAL, NAME=M\n*PLASTIC\n1., 0.\n", "", "PLASTIC", "follow an isotropic"),
    "combined": (
        "*MATERIAL, NAME=M\n*ELASTIC\n1., 0.\n*PLASTIC, HARDENING=COMBINED\n1., 0.\n", "", "PLASTIC", "not COMBINED",
    ),
    "softening": (
        "*MATERIAL, NAME=M\n*ELASTIC\n1., 0.\n*PLASTIC\n2., 0.\n1., 0.1\n", "", "PLASTIC", "a metal that softens is",
    ),
    "kinematic table": (
        "*MATERIAL, NAME=M\n*ELASTIC\n1., 0.\n*PLASTIC, HARDENING=KINEMATIC\n2., 0.\n3., 0.1\n3.5, 0.2\n",
        "", "PLASTIC", "is linear",
    ),
    "hot metal": (
        "*MATERIAL, NAME=M\n*ELASTIC\n1., 0.\n*PLASTIC\n2., 0., 20.\n1.5, 0., 100.\n", "", "PLASTIC", "depend on temp",
    ),
    "stiffness": (
        "*SURFACE INTERACTION, NAME=S\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n0.\n",
        "", "SURFACE BEHAVIOR", "should be positive",
    ),
    "friction below 0": ("*SURFACE INTERACTION, NAME=S\n*FRICTION\n-0.2\n", "", "FRICTION", "should not be negative"),
    "friction of the slip rate": (
        "*SURFACE INTERACTION, NAME=S\n*FRICTION\n0.2, 0.\n0.1, 1.\n", "", "FRICTION", "give one line",
    ),
    "friction without a limit": (
        "*SURFACE INTERACTION, NAME=S\n*FRICTION, TAUMAX=0.\n0.2\n", "", "FRICTION", "TAUMAX should be positive",
    ),
    "friction in a step": ("*SURFACE INTERACTION, NAME=S\n", "*FRICTION\n0.2\n", "FRICTION", "after *CHANGE FRICTION"),
    "behaviour in a step": (
        "*SURFACE INTERACTION, NAME=S\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5.\n",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n9.\n", "SURFACE BEHAVIOR", "after *CHANGE SURFACE BEHAVIOR",
    ),
    **{
        f"behaviour of another kind, {kind}, {now}": (
            f"*SURFACE INTERACTION, NAME=S\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE={kind}\n",
            f"*CHANGE SURFACE BEHAVIOR, INTERACTION=S\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE={now}\n",
            "SURFACE BEHAVIOR", "say LINEAR in the model and in the step",
        )
        for kind, now in (
            ("HARD", "LINEAR\n5."), ("LINEAR\n5.", "HARD"), ("TIED\n5.", "LINEAR\n5."),
            ("TABULAR\n0., 0.\n5., 1.", "LINEAR\n5."), ("LINEAR\n5.", "EXPONENTIAL\n1., 1."),
        )
    },
    "behaviour of no interaction": (
        "", "*CHANGE SURFACE BEHAVIOR, INTERACTION=S\n", "CHANGE SURFACE BEHAVIOR", "SURFACE INTERACTION",
    ),
    "change of no interaction": ("", "*CHANGE FRICTION, INTERACTION=S\n", "CHANGE FRICTION", "SURFACE INTERACTION"),
    "rough in one step": (
        SURFACES + "*SURFACE INTERACTION, NAME=S\n*FRICTION\n0.2\n*CONTACT PAIR, INTERACTION=S\nTOP, LOW\n",
        "*STATIC\n*END STEP\n*STEP\n*CHANGE FRICTION, INTERACTION=S\n*FRICTION, ROUGH\n",
        "SURFACE INTERACTION", "ROUGH in some steps",
    ),
    "pair": (SURFACES + "*CONTACT PAIR, INTERACTION=S\nTOP, LOV\n", "", "CONTACT PAIR", "did you mean"),
    "one surface": (SURFACES + "*CONTACT PAIR, INTERACTION=S\nTOP\n", "", "CONTACT PAIR", "a master surface"),
    "velocity of a support": ("", "*BOUNDARY, TYPE=VELOCITY\nB_Z1, 3, 3, 0.1\n", "BOUNDARY", "not TYPE=VELOCITY"),
    "critical damping": (
        "*SURFACE INTERACTION, NAME=S\n*CONTACT DAMPING, DEFINITION=CRITICAL DAMPING FRACTION\n0.1\n",
        "", "CONTACT DAMPING", "is a DAMPING COEFFICIENT",
    ),
    "damping along the surface": (
        "*SURFACE INTERACTION, NAME=S\n*CONTACT DAMPING, TANGENT FRACTION=0.5\n0.1\n",
        "", "CONTACT DAMPING", "along the normal only",
    ),
    "damping below 0": (
        "*SURFACE INTERACTION, NAME=S\n*CONTACT DAMPING\n-0.1\n", "", "CONTACT DAMPING", "should not be negative",
    ),
    "damping of hard contact": (
        SURFACES + "*SURFACE INTERACTION, NAME=S\n*CONTACT DAMPING\n0.1\n*CONTACT PAIR, INTERACTION=S\nTOP, LOW\n",
        DYNAMIC, "CONTACT DAMPING", "hard contact is rigid",
    ),
    "adjusted set": (
        SURFACES + "*CONTACT PAIR, INTERACTION=S, ADJUST=B_Z1\nTOP, LOW\n", "", "CONTACT PAIR", "those within a dist",
    ),
    "adjust by less than nothing": (
        SURFACES + "*CONTACT PAIR, INTERACTION=S, ADJUST=-1.\nTOP, LOW\n", "", "CONTACT PAIR", "should not be negative",
    ),
    "interaction": (SURFACES + "*CONTACT PAIR, INTERACTION=S\nTOP, LOW\n", "", "CONTACT PAIR", "SURFACE INTERACTION"),
    "slave of a node": (
        SURFACES + "*SURFACE, NAME=ONE, TYPE=NODE\n1\n*CONTACT PAIR, INTERACTION=S\nONE, LOW\n",
        "", "CONTACT PAIR", "no face of the bodies has all its nodes",
    ),
    "clearance": (SURFACES + "*CLEARANCE, SLAVE=TOP, MASTER=LOW, VALUE=0.1\n", "", "CLEARANCE", "no *CONTACT PAIR"),
    "two nodes": ("*RIGID BODY, NSET=B_Z1\n", "", "RIGID BODY", "REFNODE"),
    "spring": (
        "*ELEMENT, TYPE=SPRING1, ELSET=SP\n77, 1\n*SPRING, ELSET=SP\n3\n-1.\n", "", "SPRING", "stiffness positive",
    ),
    "equation": ("*EQUATION\n2\n1,1,1.,2,6,-1.\n", "", "EQUATION", "directions of an equation"),
    "transform": ("*TRANSFORM, NSET=B_N\n1,0,0,2,0,0\n", "", "TRANSFORM", "on one line with the origin"),
    "unknown": ("*WORMHOLE\n", "", "WORMHOLE", "does not know this card"),
    "option": ("*BOUNDARY, USER\nB_Z0, 3\n", "", "BOUNDARY", "the option USER is not taken"),
    "direction": ("*BOUNDARY\nB_Z0, 7\n", "", "BOUNDARY", "directions should be 1 to 3"),
    "temperature as a support": ("*BOUNDARY\nB_Z0, 11\n", "", "BOUNDARY", "directions should be 1 to 3"),
    "no node": ("*BOUNDARY\n4711, 3\n", "", "BOUNDARY", "there is no node 4711"),
    "no set": ("*BOUNDARY\nB_Z9, 3\n", "", "BOUNDARY", "no set of nodes named 'B_Z9'"),
    "load outside": ("*CLOAD\n1, 1, 1.\n", "", "CLOAD", "between *STEP and *END STEP"),
    "moment": ("", "*CLOAD\n1, 4, 1.\n", "CLOAD", "only the reference node of a *RIGID BODY or a *COUPLING turns"),
    "loose force": ("*NODE\n99, 0, 0, 9.\n", "*CLOAD\n99, 1, 1.\n", "CLOAD", "no solid element, and carry no force"),
    "face": ("", "*DLOAD\nB, P7, 1.\n", "DLOAD", "a HEXA8 has the faces 1 to 6"),
    "kind of load": ("", "*DLOAD\nB, BX, 1.\n", "DLOAD", "not BX"),
    "direction of gravity": ("", "*DLOAD\nB, GRAV, 1.\n", "DLOAD", "should not be 0"),
    "gravity without density": ("", "*DLOAD\nB, GRAV, 1., 0., 0., -1.\n", "DLOAD", "give their material a *DENSITY"),
    "surface load": (SURFACES, "*DSLOAD\nTOP, HP, 1.\n", "DSLOAD", "not HP"),
    "amplitude of a load": ("", "*CLOAD, AMPLITUDE=A\n1, 1, 1.\n", "CLOAD", "no *AMPLITUDE named 'A'"),
    "two amplitudes": (
        "*AMPLITUDE, NAME=A\n0,0,1,1\n", "*CLOAD, AMPLITUDE=A\n1, 1, 1.\n*CLOAD\n1, 1, 1.\n", "CLOAD", "same amplitude",
    ),
    "removed load": ("", "*CLOAD\n1, 1, 1.\n*END STEP\n*STEP\n*STATIC\n*CLOAD, OP=NEW\n2, 1, 1.\n", "CLOAD", "OP=NEW"),
    "removed support": ("", "*BOUNDARY, OP=NEW\n1, 1, 1\n", "BOUNDARY", "OP=NEW"),
    "late motion of a rigid body": (
        "*NODE\n99, 0.5, 0.5, 2.\n*RIGID BODY, NSET=B_Z1, REF NODE=99\n*BOUNDARY\n99, 1, 3\n",
        "*END STEP\n*STEP\n*STATIC\n*BOUNDARY\n99, 4, 6\n", "BOUNDARY", "begins after the first step",
    ),
    "fixed and moved": (
        "", "*END STEP\n*STEP\n*STATIC\n*BOUNDARY, FIXED\nB_Z1, 1\n*BOUNDARY\nB_Z1, 1, 1, 0.1\n",
        "BOUNDARY", "FIXED holds nodes that this step or a later one moves",
    ),
    "late support in motion": (
        "", "*END STEP\n*STEP\n*DYNAMIC\n0.1, 1.\n*BOUNDARY\nB_Z1, 1\n", "BOUNDARY", "begins in a step of *DYNAMIC",
    ),
    "amplitude over a step": (
        "*AMPLITUDE, NAME=A\n0,0,1,1\n", "*CLOAD, AMPLITUDE=A\n1,1,1.\n*END STEP\n*STEP\n*STATIC\n",
        "CLOAD", "repeated",
    ),
    "modal dynamics": ("", "*MODAL DYNAMIC\n", "MODAL DYNAMIC", "implicit ones with inertia"),
    "explicit": ("", "*DYNAMIC, EXPLICIT\n", "DYNAMIC", "this step is EXPLICIT"),
    "alpha": ("", "*DYNAMIC, ALPHA=-0.5\n", "DYNAMIC", "ALPHA should be from -1/3 to 0"),
    "two alphas": (
        "", "*DYNAMIC\n*END STEP\n*STEP\n*DYNAMIC, ALPHA=0.\n", "DYNAMIC", "one ALPHA for all steps",
    ),
    "no density": ("", "*DYNAMIC\n", "MATERIAL", "has no *DENSITY"),
    "static at last": ("", "*DYNAMIC\n*END STEP\n*STEP\n*STATIC\n", "STATIC", "after a dynamic one"),
    "too many increments": ("", "*DYNAMIC\n1e-9, 1.\n", "DYNAMIC", "too long for the case"),
    "loads of a frequency step": ("", LOAD + "*FREQUENCY\n3\n", "END STEP", "give supports in the model"),
    "no modes": ("", "*FREQUENCY\n0\n", "FREQUENCY", "should be positive"),
    "perturbation": ("", "*END STEP\n*STEP, PERTURBATION\n*STATIC\n", "END STEP", "with *FREQUENCY alone"),
    "period": ("", "*STATIC\n1., -1.\n", "STATIC", "should be positive"),
    "elements removed": ("", "*MODEL CHANGE, TYPE=ELEMENT, REMOVE\nB\n", "MODEL CHANGE", "in all steps"),
    "no pair to remove": ("", "*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nA, B\n", "MODEL CHANGE", "no *CONTACT PAIR"),
    "neither added nor removed": ("", "*MODEL CHANGE, TYPE=CONTACT PAIR\nA, B\n", "MODEL CHANGE", "ADD or REMOVE"),
    "one surface to remove": ("", "*MODEL CHANGE, TYPE=CONTACT PAIR, ADD\nA\n", "MODEL CHANGE", "a master surface"),
    "a step in a step": ("", "*STEP\n*STATIC\n", "STEP", "has no *END STEP before it"),
    "a parameter twice": ("*BOUNDARY, OP=NEW, OP=MOD\nB_X0, 1\n", "", "BOUNDARY", "OP is both NEW and MOD"),
    "nlgeom later": ("", "*END STEP\n*STEP, NLGEOM\n*STATIC\n", "STEP", "in all of them or in none"),
    "temperature of half an element": (
        "", "*TEMPERATURE\n1, 100.\n", "TEMPERATURE", "have several temperatures",
    ),
}  # fmt: skip
BLOCK = Block()


def deck(model, loads, more=""):
    """A deck of a block; a step whose cards have a procedure is not *STATIC."""
    text = BLOCK.text() + section(more="*EXPANSION\n1e-5\n" + more) + held() + model + step(loads)
    return re.sub(r"\*STATIC\n(?=(?:(?!\*STEP|\*END).*\n)*\*(?:STATIC|DYNAMIC|FREQUENCY))", "", text)


@pytest.mark.parametrize("name", REFUSED)
def test_refused(tmp_path, name):
    model, loads, card, words = REFUSED[name]
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


def test_every_mistake_at_once(tmp_path):
    with pytest.raises(CaseError) as caught:
        imported(tmp_path, deck("*SUBMODEL, TYPE=NODE\n*BOUNDARY\n4711, 3\n", "*DYNAMIC, EXPLICIT\n"))
    assert len(caught.value.problems) == 3


SOLID = BLOCK.text() + section()
TILTED = (
    Block("C", (0, 0, 1), (1, 1, 2), (2, 2, 1), first=100).text().replace("101, 0.0, 0.0, 1.0", "101, 0.0, 0.0, 1.1")
)
UNEVEN = (
    BLOCK.text() + TILTED + section() + "*SOLID SECTION, ELSET=C, MATERIAL=EL\n" + held()
    + held("C").replace("C_Z0, 3\n", "")
    + "*SURFACE, NAME=U\nC_EZ0, S1\n*SURFACE, NAME=L\nB_EZ1, S2\n*SURFACE INTERACTION, NAME=S\n"
    + "*CONTACT PAIR, INTERACTION=S\nU, L\n*CLEARANCE, SLAVE=U, MASTER=L, VALUE=0.\n"
    + step("*BOUNDARY\nC_Z1, 3, 3, -0.1\n")
)  # fmt: skip
PLANE = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n*ELEMENT, TYPE=CPE4, ELSET=B\n1, 1, 2, 3, 4\n" + section()
INSTANCES = (
    f"*PART, NAME=P\n{BLOCK.text()}*SOLID SECTION, ELSET=B, MATERIAL=EL\n*END PART\n*ASSEMBLY, NAME=A\n"
    + "*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n*INSTANCE, NAME=J, PART=P\n3., 0., 0.\n*END INSTANCE\n*END ASSEMBLY\n"
    + "*MATERIAL, NAME=EL\n*ELASTIC\n1., 0.\n"
)
ORTHOTROPIC = "*ELASTIC, TYPE=ENGINEERING CONSTANTS\n1,1,1,.3,.3,.3,1,1\n1"
#: what is wrong with a deck as a whole -> the deck, and what is said
WHOLE = {
    "two procedures of a step": (
        SOLID + held() + step("*DYNAMIC\n" + LOAD),
        r"\*DYNAMIC: this step is \*STATIC already \(line \d+\); keep one",
    ),
    "an end in a step, where loads may be missing": (
        deck("", LOAD).replace("*END STEP\n", ""), r"\*STEP: this step has no \*END STEP; end it",
    ),
    "no steps": (SOLID + held(), r"there is no \*STEP"),
    "no section": (BLOCK.text() + held() + step(LOAD), r"\*ELEMENT: elements 1 have no \*SOLID SECTION"),
    "no law": (
        SOLID.replace("*ELASTIC\n1000., 0.3", "*DENSITY\n1.") + held() + step(LOAD), r"material EL has no \*ELASTIC",
    ),
    "a law of finite displacements": (
        deck("", LOAD).replace("*ELASTIC\n1000., 0.3", "*HYPERELASTIC, NEO HOOKE\n1., 1."), "say NLGEOM",
    ),
    "a law of small displacements": (
        deck("", LOAD).replace("*ELASTIC\n1000., 0.3", ORTHOTROPIC).replace("*STEP", "*STEP, NLGEOM"),
        "leave out NLGEOM",
    ),
    "a value that a case refuses, told with the line of the deck": (
        deck("", LOAD).replace("1000., 0.3", "1000., 0.5"), r"^\*MATERIAL \(model.inp, line \d+\): .*poisson is 0.5",
    ),
    "a clearance in place of an uneven gap": (
        UNEVEN, r"\*CLEARANCE: the gap in the mesh is from .* to .*: .*move the nodes",
    ),
    "a pressure between elements": (
        Block(high=(1, 1, 2), cells=(1, 1, 2)).text() + section() + held() + step("*DLOAD\nB, P2, 1.\n"),
        r"\*DLOAD: these faces of elements 1 lie between two elements",
    ),
    "a force out of the plane": (
        PLANE + "*BOUNDARY\n1, 1, 2\n2, 2\n" + step("*CLOAD\n3, 3, 1.\n"),
        r"\*CLOAD: a force has the directions 1 and 2",
    ),
    "numbers where there are instances": (
        INSTANCES + "*BOUNDARY\n1, 1, 3\n" + step(LOAD),
        r"\*BOUNDARY: there are 2 instances of parts, .*; name a set",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WHOLE)
def test_a_deck_that_is_wrong_as_a_whole(tmp_path, what):
    text, said = WHOLE[what]
    with pytest.raises(CaseError, match=said):
        imported(tmp_path, text)


def test_radial_gravity(tmp_path):
    deck = "*NODE\n1, 1, 0\n2, 2, 0\n3, 2, 1\n4, 1, 1\n*ELEMENT, TYPE=CAX4, ELSET=B\n1, 1, 2, 3, 4\n"
    deck += section(more="*DENSITY\n1.\n") + "*BOUNDARY\n1, 2\n2, 2\n"
    made = imported(tmp_path, deck + step("*DLOAD\nB, GRAV, 2., 0., -1., 0.\n"))
    assert made.case.gravity.gy.at(1.0) == -2
    with pytest.raises(CaseError, match=r"\*DLOAD: gravity along the radius"):
        imported(tmp_path, deck + step("*DLOAD\nB, GRAV, 2., 1., 0., 0.\n"))


def test_lenient_leaves_out_what_lacsolver_lacks(tmp_path):
    """Cards without a place are left out with a warning; mistakes stay errors."""
    text = deck("*SUBMODEL, TYPE=NODE\n*WORMHOLE\n", LOAD)
    made = imported(tmp_path, text, lenient=True)
    warned = {finding.card: finding.message for finding in made.findings if finding.level == "warning"}
    assert set(warned) == {"SUBMODEL", "WORMHOLE"}
    assert all(message.startswith("left out: ") for message in warned.values())
    with pytest.raises(CaseError, match=r"\*VISCO"):  # without it the step would be another one
        imported(tmp_path, text.replace("*STATIC", "*VISCO"), lenient=True)
    with pytest.raises(CaseError, match="there is no node 4711"):
        imported(tmp_path, text.replace("*WORMHOLE", "*BOUNDARY\n4711, 1"), lenient=True)


def test_lenient_takes_something_else(tmp_path):
    """An explicit step is computed implicitly: a warning says so."""
    text = deck(SURFACES, "*DYNAMIC, EXPLICIT\n0.1, 1.\n" + LOAD, "*DENSITY\n1.\n")
    made = imported(tmp_path, text, lenient=True)
    told = {finding.card: finding.message for finding in made.findings if finding.level == "warning"}
    assert told["DYNAMIC"].endswith("the step is implicit")
    assert made.case.dynamics.alpha == 0.05


def test_the_table_has_each_card_once():
    assert not READ.keys() & NOTES.keys()
    assert not READ.keys() & LACKS.keys()
    assert not NOTES.keys() & LACKS.keys()
    assert not PROCEDURES.keys() & (READ.keys() | NOTES.keys() | LACKS.keys())


def test_the_page_has_every_card_that_is_read():
    page = " ".join((ROOT / "docs" / "import.md").read_text().split())
    named = {"".join(name.split()) for name in re.findall(r"\*([A-Z][A-Z -]*[A-Z])", page)}
    assert READ.keys() <= named
    assert named <= READ.keys() | LACKS.keys() | NOTES.keys() | PROCEDURES.keys() | {"NODE", "NSET", "ELSET"}


def test_every_card_of_the_table_is_refused_or_noted(tmp_path):
    """Each card that lacsolver lacks is an error of its own line; each that does not matter is a note."""
    with pytest.raises(CaseError) as caught:
        imported(tmp_path, deck("", "".join(f"*{key}\n" for key in sorted(LACKS | PROCEDURES))))
    assert re.findall(r"line \d+: \*([^:]+): ", str(caught.value)) == sorted(LACKS | PROCEDURES)
    made = imported(tmp_path, deck("", LOAD + "".join(f"*{key}\n" for key in sorted(NOTES))))
    assert [finding.card for finding in made.findings] == sorted(NOTES)
