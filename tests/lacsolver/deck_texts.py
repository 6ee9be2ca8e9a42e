"""Decks of our own, made of blocks, and what lacsolver computes of them: displacements and pressures by number."""

import warnings
from dataclasses import dataclass

import numpy as np

from lacmesh.errors import LacmeshWarning
from lacsolver.decks import import_deck
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem

E = 1000.0
#: corners of a brick, then the edges of a C3D20 as pairs of corners, in the deck's order
_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
ELASTIC = "*MATERIAL, NAME=EL\n*ELASTIC\n1000., {nu}\n"


@dataclass
class Block:
    """A box of equal bricks: numbers of nodes and elements from `first` on, sets named after `name`.

    `points`: nodes of the box, which its sets are made by; `places`: where they are written, which a test may move.
    """

    name: str = "B"
    low: tuple = (0, 0, 0)
    high: tuple = (1, 1, 1)
    cells: tuple = (1, 1, 1)
    element: str = "C3D8"
    first: int = 0

    def __post_init__(self):
        n = np.array(self.cells)
        index = np.stack(np.meshgrid(*(np.arange(k) for k in n), indexing="ij"), axis=-1).reshape(-1, 3)
        local = _CORNERS * 2
        if self.element.startswith("C3D20"):
            local = np.concatenate([local, [_CORNERS[a] + _CORNERS[b] for a, b in _EDGES]])
        grid = (2 * index[:, None] + local).reshape(-1, 3)
        distinct, which = np.unique(grid, axis=0, return_inverse=True)
        low, high = np.array(self.low, float), np.array(self.high, float)
        self.points = self.places = low + distinct / (2 * n) * (high - low)
        self.numbers = self.first + 1 + np.arange(len(distinct))
        self.elements = self.numbers[which.reshape(len(index), -1)]
        self.element_numbers = self.first + 1 + np.arange(len(index))
        self.index = index

    def at(self, axis, value):
        """Numbers of the nodes with one coordinate."""
        return self.numbers[np.abs(self.points[:, axis] - value) < 1e-9]

    def text(self):
        """The nodes, the elements, and a set of nodes and one of elements on each side: B_X0, B_X1, ..."""
        name = self.name
        lines = [f"*NODE, NSET={name}_N"]
        lines += [f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in zip(self.numbers, self.places.tolist(), strict=True)]
        lines.append(f"*ELEMENT, TYPE={self.element}, ELSET={name}")
        for k, nodes in zip(self.element_numbers, self.elements.tolist(), strict=True):
            lines += listed([k, *nodes])
        for axis, letter in enumerate("XYZ"):
            for end, value in enumerate((self.low[axis], self.high[axis])):
                there = self.index[:, axis] == (0, self.cells[axis] - 1)[end]
                lines += [f"*NSET, NSET={name}_{letter}{end}", *listed(self.at(axis, value).tolist())]
                lines += [f"*ELSET, ELSET={name}_E{letter}{end}", *listed(self.element_numbers[there].tolist())]
        return "\n".join(lines) + "\n"


def listed(numbers):
    """Lines of ten numbers, all but the last ended by a comma."""
    rows = [", ".join(map(str, numbers[k : k + 10])) for k in range(0, len(numbers), 10)]
    return [row + "," for row in rows[:-1]] + rows[-1:]


def held(name="B"):
    """Supports of a block that leave it free to widen and to shorten from its face z = 0."""
    return f"*BOUNDARY\n{name}_Z0, 3\n{name}_X0, 1\n{name}_Y0, 2\n"


def section(name="B", nu=0.3, more=""):
    """An elastic material of 1000, and its section."""
    return ELASTIC.format(nu=nu) + more + f"*SOLID SECTION, ELSET={name}, MATERIAL=EL\n"


def bodies(*blocks, nu=0.3, more=""):
    """Blocks of one elastic material; `more`: its other cards."""
    first, *others = (block.name for block in blocks)
    rest = "".join(f"*SOLID SECTION, ELSET={name}, MATERIAL=EL\n" for name in others)
    return "".join(block.text() for block in blocks) + section(first, nu, more) + rest


def step(loads, options="", static=""):
    """A static step."""
    return f"*STEP{options}\n*STATIC\n{static}{loads}*END STEP\n"


@dataclass
class Solution:
    """A solved deck: what was imported, the problem, its states; `u`: displacements (k, dim) of nodes by number."""

    made: object
    problem: object
    states: list

    def u(self, numbers, state=-1):
        mesh, dim = self.problem.space.mesh, self.problem.space.dim
        place = {int(n): k for k, n in enumerate(mesh.node_number)}
        rows = self.states[state].u.reshape(-1, dim)
        return rows[[place[int(n)] for n in np.atleast_1d(numbers)]]

    @property
    def zone(self):
        (zone,) = self.states[-1].zones
        return zone


def imported(folder, text, name="model.inp", **options):
    """Write a deck and import it; notes are left out."""
    path = folder / name
    path.write_text(text, errors="surrogateescape")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        return import_deck(path, folder / "case.toml", **options)


def solved(folder, text, **options):
    """Import a deck and solve it."""
    made = imported(folder, text, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        problem = Problem.of(made.case, made.mesh)
        return Solution(made, problem, list(march(problem)))


#: a column, for loads along z
COLUMN = Block(high=(1, 2, 3), cells=(1, 2, 2))
TOP_SURFACE = "*SURFACE, NAME=TOP\nB_EZ1, S2\n"


def column(more, loads, *, nu=0.0, block=COLUMN, options="", supports=""):
    """A deck of a column on rollers; `more`: cards of its material, `supports`: others."""
    return block.text() + TOP_SURFACE + section(nu=nu, more=more) + (supports or held()) + step(loads, options)


def hanging(kind, spring, options=""):
    """A block on another one's springs between their corners, the upper one held sideways, and a force down on it."""
    below, above = Block("B"), Block("C", (0.5, 0.5, 2), (1.5, 1.5, 3), first=100)
    deck = bodies(below, above, nu=0.0)
    pairs = zip(below.at(2, 1), above.at(2, 2), strict=True)
    deck += f"*ELEMENT, TYPE={kind}, ELSET=SP\n" + "".join(f"{900 + k}, {a}, {b}\n" for k, (a, b) in enumerate(pairs))
    deck += f"*SPRING, ELSET=SP\n{spring}*BOUNDARY\nB_Z0, 1, 3\nC_N, 1, 2\n"
    return deck + step("*CLOAD\nC_Z1, 3, -3.\n*NODE PRINT, NSET=C_N\nU\n", options), below, above


# ---- two blocks in contact

#: surfaces of the blocks of `two_blocks` that meet
PAIR = "*SURFACE, NAME=LOWER\nB_EZ1, S2\n*SURFACE, NAME=UPPER\nC_EZ0, S1\n"
CONTACT = "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nUPPER, LOWER\n*SURFACE INTERACTION, NAME=SI\n"


def law(stiffness):
    """Linear contact."""
    return f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n{stiffness}\n"


def two_blocks(upper=0.0, lower=(2, 2, 1), cells=(3, 3, 1), element="C3D8"):
    """Two blocks of meshes that do not match, one on the other, with a gap `upper`."""
    below = Block("B", cells=lower, element=element)
    above = Block("C", (0, 0, 1 + upper), (1, 1, 2 + upper), cells, element, first=1000)
    return below, above


def on_each_other(below, above, between, loads, *, options="", nu=0.3, static="", more=""):
    """A deck of two blocks with what is `between` them; `more`: cards of their material."""
    text = bodies(below, above, nu=nu, more=more) + PAIR + held("B") + "*BOUNDARY\nC_X0, 1\nC_Y0, 2\n"
    return text + between + step(loads, options, static)


# ---- bodies that hit each other

#: print the displacements of the body that flies, and the force at the supports of the other one
PRINTS = "*NODE PRINT, NSET=B_N\nU\n*NODE PRINT, NSET=SUPPORT, TOTALS=ONLY\nRF\n"
FOOT = "*SURFACE, NAME=U\nB_EZ0, S1\n*SURFACE, NAME=L\nW_EZ1, S2\n"


def moving(loads, options="", procedure=", DIRECT", line="0.1, 1.", prints="*NODE PRINT, NSET=B_Z1\nU\n"):
    """A step of *DYNAMIC."""
    return f"*STEP{options}, INC=10000\n*DYNAMIC{procedure}\n{line}\n{loads}{prints}*END STEP\n"


def printed(text, what):
    """Times, and the rows of each table of a .dat of CalculiX that begins so."""
    from tests.formats.decks import tables  # which takes its blocks from here

    found = [(float(head.split()[-1]), rows) for head, rows in tables(text) if head.startswith(what)]
    return np.array([t for t, _ in found]), [rows for _, rows in found]


def impact(wall, body, support, poisson, held, stiffness, velocity, dt, count, options=""):
    """Two bodies W and B: the face z = 0 of B, which flies with -`velocity`, is the slave of the face z = 1 of W."""
    text = bodies(body, wall, nu=poisson, more="*DENSITY\n1.\n") + FOOT + f"*NSET, NSET=SUPPORT\n{support}\n"
    text += f"*BOUNDARY\nSUPPORT, 1, 3\n{held}*SURFACE INTERACTION, NAME=SI\n{law(stiffness)}"
    text += "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nU, L\n"
    text += f"*INITIAL CONDITIONS, TYPE=VELOCITY\nB_N, 3, {-velocity}\n"
    return text + moving("", options, line=f"{dt:.9f}, {count * dt:.9f}", prints=PRINTS)


def bar_on_wall(cells, count, length=4.0, gap=0.004, options=""):
    """A bar of section 1, its sides held, with increments of half a cell's wave time; exact impulse: 2 m v = 8."""
    wall = Block("W", (-0.5, -0.5, -1), (1.5, 1.5, 0), (2, 2, 1), first=10000)
    bar = Block("B", (0, 0, gap), (1, 1, length + gap), (1, 1, cells))
    sides = "B_X0, 1\nB_Y0, 2\nB_X1, 1\nB_Y1, 2\n"
    return impact(wall, bar, "W_N", 0.0, sides, 1e4, 1.0, 0.5 * length / cells / np.sqrt(E), count, options)


#: times of the steps of `die_on_block`, and where they end: pressed in, then moved to the middle of the block
PRESSED, SLID = (3, 0.15), (5, 0.5)


def die_on_block():
    """A die with a round foot of 14 faces, its slave, is pressed into a block and slid over it: NLGEOM, two steps."""
    block = Block("W", (0, 0, -1), (4, 1, 0), (12, 4, 6), first=10000)
    die = Block("B", (0.8, 0.1, 0), (2.2, 0.9, 0.8), (7, 2, 5))
    x, z = die.points[:, 0] - 1.5, die.points[:, 2]
    die.points[:, 2] = z + (1 - np.sqrt(1 - x**2)) * (1 - z / 0.8)
    text = block.text() + die.text() + FOOT
    for name, young in (("B", 3 * E), ("W", E)):
        text += f"*MATERIAL, NAME=M{name}\n*ELASTIC\n{young}, 0.3\n*SOLID SECTION, ELSET={name}, MATERIAL=M{name}\n"
    text += f"*SURFACE INTERACTION, NAME=SI\n{law(1e5)}"
    text += "*CONTACT PAIR, INTERACTION=SI, TYPE=SURFACE TO SURFACE\nU, L\n*BOUNDARY\nW_Z0, 1, 3\n"
    for (count, _), along in ((PRESSED, 0.0), (SLID, SLID[1])):
        loads = f"*BOUNDARY\nB_Z1, 1, 1, {along}\nB_Z1, 2, 2\nB_Z1, 3, 3, {-PRESSED[1]}\n"
        loads += "*NODE PRINT, NSET=W_Z0, TOTALS=ONLY\nRF\n"
        text += f"*STEP, NLGEOM\n*STATIC, DIRECT\n{1 / count}, 1.\n{loads}*END STEP\n"
    return text
