"""Decks of impacts, and what CalculiX prints of them: a bar that hits a wall, a ball that hits a block."""

import re

import numpy as np

from tests.formats.decks import tables
from tests.lacsolver.deck_texts import Block

E = 1000.0
#: print the displacements of the body that flies, and the force at the supports of the other one
PRINTS = "*NODE PRINT, NSET=B_N\nU\n*NODE PRINT, NSET=SUPPORT, TOTALS=ONLY\nRF\n"


def moving(loads, options="", procedure=", DIRECT", line="0.1, 1.", prints="*NODE PRINT, NSET=B_Z1\nU\n"):
    """A step of *DYNAMIC."""
    return f"*STEP{options}, INC=10000\n*DYNAMIC{procedure}\n{line}\n{loads}{prints}*END STEP\n"


def printed(text, what):
    """Times, and the rows of each table of a .dat that begins so."""
    found = [(float(head.split()[-1]), rows) for head, rows in tables(text) if head.startswith(what)]
    return np.array([t for t, _ in found]), [rows for _, rows in found]


def _impact(bodies, poisson, held, stiffness, velocity, dt, count, options=""):
    """Two bodies B and W: the face z = 0 of B, which flies with -`velocity`, is the slave of the face z = 1 of W."""
    text = bodies + "*SURFACE, NAME=U\nB_EZ0, S1\n*SURFACE, NAME=L\nW_EZ1, S2\n"
    text += f"*MATERIAL, NAME=EL\n*ELASTIC\n{E}, {poisson}\n*DENSITY\n1.\n"
    text += "*SOLID SECTION, ELSET=B, MATERIAL=EL\n*SOLID SECTION, ELSET=W, MATERIAL=EL\n"
    text += f"*BOUNDARY\nSUPPORT, 1, 3\n{held}*SURFACE INTERACTION, NAME=SI\n"
    text += f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{stiffness}\n"
    text += "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nU, L\n"
    text += f"*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 3, {-velocity}\n"
    return text + moving("", options, line=f"{dt:.9f}, {count * dt:.9f}", prints=PRINTS)


def bar_on_wall(cells, count, length=4.0, gap=0.004, options=""):
    """A bar of section 1, its sides held, with increments of half a cell's wave time; exact impulse: 2 m v = 8."""
    wall = Block("W", (-0.5, -0.5, -1), (1.5, 1.5, 0), (2, 2, 1), first=10000)
    bar = Block("B", (0, 0, gap), (1, 1, length + gap), (1, 1, cells))
    bodies = wall.text() + bar.text() + "*NSET, NSET=SUPPORT\nW_N\n"
    sides = "B_X0, 1\nB_Y0, 2\nB_X1, 1\nB_Y1, 2\n"
    return _impact(bodies, 0.0, sides, 1e4, 1.0, 0.5 * length / cells / np.sqrt(E), count, options)


def ball_on_block(cells, count, gap=0.004):
    """A ball of radius 1, a cube of bricks blown up, which hits a block that is held at its base."""
    block = Block("W", (-1.2, -1.2, -1), (1.2, 1.2, 0), (3 * cells // 2, 3 * cells // 2, cells // 2), first=10000)
    ball = Block("B", (-1, -1, -1), (1, 1, 1), (cells,) * 3)
    sides = re.sub(r"\*NODE.*?(?=\*ELEMENT)", "", ball.text(), flags=re.DOTALL)
    x, y, z = (ball.points**2).T / 2
    blown = np.sqrt(np.stack([1 - y - z + 4 * y * z / 3, 1 - x - z + 4 * x * z / 3, 1 - x - y + 4 * x * y / 3], axis=1))
    ball.points = ball.points * blown + [0, 0, 1 + gap]
    nodes = ball.text().partition("*ELEMENT")[0]
    bodies = block.text() + nodes + sides + "*NSET, NSET=SUPPORT\nW_Z0\n"
    return _impact(bodies, 0.3, "", 1e5, 2.0, 0.002, count, ", NLGEOM")


#: times of the steps of `die_on_block`, and where they end: pressed in, then moved to the middle of the block
PRESSED, SLID = (3, 0.15), (5, 0.5)


def die_on_block():
    """A die with a round foot of 14 faces, its slave, is pressed into a block and slid over it: NLGEOM, two steps."""
    block = Block("W", (0, 0, -1), (4, 1, 0), (12, 4, 6), first=10000)
    die = Block("B", (0.8, 0.1, 0), (2.2, 0.9, 0.8), (7, 2, 5))
    x, z = die.points[:, 0] - 1.5, die.points[:, 2]
    die.points[:, 2] = z + (1 - np.sqrt(1 - x**2)) * (1 - z / 0.8)
    text = block.text() + die.text() + "*SURFACE, NAME=FOOT\nB_EZ0, S1\n*SURFACE, NAME=GROUND\nW_EZ1, S2\n"
    for name, young in (("B", 3 * E), ("W", E)):
        text += f"*MATERIAL, NAME=M{name}\n*ELASTIC\n{young}, 0.3\n*SOLID SECTION, ELSET={name}, MATERIAL=M{name}\n"
    text += "*SURFACE INTERACTION, NAME=SI\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1e5\n"
    text += "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nFOOT, GROUND\n*BOUNDARY\nW_Z0, 1, 3\n"
    for (count, _), along in ((PRESSED, 0.0), (SLID, SLID[1])):
        text += f"*STEP, NLGEOM\n*STATIC, DIRECT\n{1 / count}, 1.\n*BOUNDARY\n"
        text += f"B_Z1, 1, 1, {along}\nB_Z1, 2, 2\nB_Z1, 3, 3, {-PRESSED[1]}\n"
        text += "*NODE PRINT, NSET=W_Z0, TOTALS=ONLY\nRF\n*END STEP\n"
    return text
