"""Make ironing_2d.msh and ironing_3d.msh: a half-cylinder over a block of rubber; lengths in mm.

    python data/sliding/make_ironing.py [folder]

In the plane: a die of radius 1.5 over a block of 9 by 3. In space: one half of a die of radius 1 over one half of a
block, y = 0 the plane of symmetry; the die is 1.8 long and its radius 6 % less at its ends, so that no edge cuts in.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from solids import Body, brick, half_disc, quarter_turns, skin, write

GAP = 0.05  # between die and block at the start
RADIUS, START, LONG, HIGH = 1.5, -2.25, 9.0, 3.0  # in the plane: the die, where it starts, the block
RADIUS_3D, HALF, CROWN, START_3D = 1.0, 0.9, 0.06, -1.5  # in space: radius, half length, what is less at the end, start
LONG_3D, DEEP_3D, HIGH_3D = 6.0, 1.5, 1.5  # half of the block


def main(folder: Path) -> None:
    """Write both meshes into `folder`."""
    make_plane(folder / "ironing_2d.msh")
    make_space(folder / "ironing_3d.msh")


def make_plane(path: Path, across: int = 60) -> None:
    """The plane mesh; `across`: segments on the block's top."""
    block = brick(np.linspace(-LONG / 2, LONG / 2, across + 1), np.linspace(-HIGH, 0, across // 4))
    die = half_disc(RADIUS, across // 8, across // 20)
    die = Body(quarter_turns(die.points, -1) + np.array([START, RADIUS + GAP]), die.cells)
    flat = RADIUS + GAP
    write(
        path,
        {"block": block, "die": die},
        {
            "slave": ("block", skin(block, lambda x, y: np.isclose(y, 0))),
            "master": ("die", skin(die, lambda x, y: np.isclose(np.hypot(x - START, y - flat), RADIUS))),
            "top": ("die", skin(die, lambda x, y: np.isclose(y, flat))),
            "bottom": ("block", skin(block, lambda x, y: np.isclose(y, -HIGH))),
        },
    )


def make_space(path: Path) -> None:
    """The mesh in space."""
    axes = (np.linspace(*span) for span in ((-LONG_3D / 2, LONG_3D / 2, 25), (0, DEEP_3D, 7), (-HIGH_3D, 0, 6)))
    block, die = brick(*axes), half_cylinder()
    flat = RADIUS_3D + GAP
    write(
        path,
        {"block": block, "die": die},
        {
            "master": ("block", skin(block, lambda x, y, z: np.isclose(z, 0))),
            "slave": ("die", skin(die, lambda x, y, z: np.isclose(np.hypot(x - START_3D, z - flat), shrunk(y)))),
            "top": ("die", skin(die, lambda x, y, z: np.isclose(z, flat))),
            "bottom": ("block", skin(block, lambda x, y, z: np.isclose(z, -HIGH_3D))),
            "symmetry_block": ("block", skin(block, lambda x, y, z: np.isclose(y, 0))),
            "symmetry_die": ("die", skin(die, lambda x, y, z: np.isclose(y, 0))),
        },
    )


def shrunk(y: np.ndarray) -> np.ndarray:
    """The radius of the die along its axis."""
    return RADIUS_3D * (1 - CROWN * (y / HALF) ** 2)


def half_cylinder() -> Body:
    """The die: half a disc swept along y, smaller and smaller."""
    disc = half_disc(1.0, 4, 2)
    x, z = quarter_turns(disc.points, -1).T
    floors = [
        np.stack([START_3D + shrunk(y) * x, np.full_like(x, y), RADIUS_3D + GAP + shrunk(y) * z], axis=1)
        for y in np.linspace(HALF, 0, 5)  # x, z turn left seen along y: from the far end to the near
    ]
    cells = [disc.cells + k * len(x) for k in range(len(floors))]
    return Body(np.concatenate(floors), np.concatenate([np.hstack(p) for p in pairwise(cells)]))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
