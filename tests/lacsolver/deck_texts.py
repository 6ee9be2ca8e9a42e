"""Decks of our own, made of blocks, and what lacsolver computes of them: displacements and pressures by number."""

import warnings
from dataclasses import dataclass

import numpy as np

from lacmesh.errors import LacmeshWarning
from lacsolver.decks import import_deck
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem

#: corners of a brick, then the edges of a C3D20 as pairs of corners, in the deck's order
_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
ELASTIC = "*MATERIAL, NAME=EL\n*ELASTIC\n1000., {nu}\n"


@dataclass
class Block:
    """A box of equal bricks: numbers of nodes and elements from `first` on, sets named after `name`."""

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
        self.points = low + distinct / (2 * n) * (high - low)
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
        lines += [f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in zip(self.numbers, self.points.tolist(), strict=True)]
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
