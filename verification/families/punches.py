"""Flat rigid punches with sharp corners on a soft block: each solved in any number of steps, with one answer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacsolver import NotConvergedError
from verification.meshes.punches import ABOVE, Punch, punched, random_punch
from verification.records import Family, Result, at_most, problem, row
from verification.solving import Solved, balanced, case_text, contact, entry, fixed, material, model_of, solve

#: displacements that differ by more of the largest are those of another equilibrium
OTHER = 1e-4
_TWO = (
    "finite kinematics have several equilibria, and steps decide which is found: of the 200, in punch 106 of the block "
    "an edge of the punch stops at a node of the block, where the normal jumps; in punch 141, in one step, it folds"
)
_ONE = "statics without friction and with an elastic law: steps do not matter"


@problem
def solve_case(dim: int, slave: str, first: int = 0, two: int = 0, *, levels: int) -> Iterator[Result]:
    """Press in so many punches of a dimension: number `first`, `first` + 1, ...; each in one step, and in 2 to 20.

    `slave`: `top` of the block or the `face` of the punch. `two`: number of punches known for two equilibria.
    """
    solutions: list[Solved] = []
    lost, apart = 0, [0.0]
    for number in range(first, first + levels):
        punch, own = random_punch(dim, number), list[Solved]()
        for steps in (1, 2 + number % 19):
            try:
                own.append(solve(text(slave, punch, steps), punched(punch)))
            except NotConvergedError:
                lost += 1
        apart += [float(np.abs(own[0].u - each.u).max() / np.abs(own[0].u).max()) for each in own[1:]]
        solutions += own
    off = max(d for d in apart if d <= OTHER)
    yield at_most("runs that end without an equilibrium", lost, 0, source=_ONE)
    yield at_most("largest difference of displacements between numbers of steps, over the largest", off, 1e-8,
                  source=_ONE, reason="Newton's method ends at 1e-10 of forces and gaps")  # fmt: skip
    yield at_most("punches with two equilibria", sum(d > OTHER for d in apart), two, source=_ONE, reason=_TWO)
    yield from balanced(solutions)


def text(slave: str, punch: Punch, steps: int) -> str:
    """The case of a punch that is pressed in by so many steps, as TOML."""
    axes = "xyz"[: punch.dim]
    master = {"top": "face", "face": "top"}[slave]
    motion = {f"u{axis}": 0.0 for axis in axes[:-1]} | {f"u{axes[-1]}": -punch.depth - ABOVE}
    return case_text(
        model_of(punch.dim), material(1000.0, punch.poisson, law="neo_hookean"), contact(slave, master),
        fixed("bottom", axes), entry("rigid", group="punch", **motion), entry("steps", count=steps),
        kinematics="finite",
    )  # fmt: skip


TEXT = """
A flat rigid punch with sharp corners is pressed into a neo-Hookean block, up to half the size of its faces. Place,
width and depth are random, and so are Poisson's ratio and the faces of the punch: 200 punches in all, of which three in
ten begin at a node of the block. Each is pressed in by one step, and by two to twenty, one number after the other.

A corner of the punch moves sideways over faces of the block, and covers or bares the edge of a macro-element: its rows
come and go with the iterations. Every run must find its equilibrium, and a punch the same one in any number of steps,
but for two of the 200 that have two equilibria.
"""

FAMILY = Family(
    "punches",
    "Punches with sharp corners",
    TEXT,
    tuple(
        row(
            "punches", name, f"punches on a block {'in the plane' if dim == 2 else 'in space'}, "
            f"{'the block' if slave == 'top' else 'the punch'} as slave",
            solve_case, dim, slave, first, two, quick=quick, full=full, seconds=seconds,
        )
        for name, dim, slave, first, two, quick, full, seconds in (
            ("plane_block_1", 2, "top", 0, 0, 3, 40, 60.0),
            ("plane_block_2", 2, "top", 40, 0, 0, 40, 60.0),
            ("plane_block_3", 2, "top", 80, 1, 0, 40, 60.0),
            ("plane_punch", 2, "face", 120, 1, 0, 30, 40.0),
            ("space_block", 3, "top", 0, 0, 0, 40, 90.0),
            ("space_punch", 3, "face", 40, 0, 0, 10, 40.0),
        )
    ),
)  # fmt: skip
