"""Make punch.inp, a deck for CalculiX: one half of a crowned punch is pressed on a block, in plane strain. MIT licence.

python data/make_punch.py [file]

The punch is 1 wide and its underside a parabola of radius 20; its upper side moves down by 0.01. Units: N, mm, MPa.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

import lacmesh

RADIUS = 20.0
HEAD = "** One half of a crowned punch is pressed on a block, in plane strain; made by data/make_punch.py.\n"
CARDS = """\
** what the bodies are
*MATERIAL, NAME=steel
*ELASTIC
210000., 0.3
*SOLID SECTION, ELSET=punch, MATERIAL=steel
1.
*SOLID SECTION, ELSET=block, MATERIAL=steel
1.
** where they touch
*SURFACE INTERACTION, NAME=touch
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
1.e7, 1.
*CONTACT PAIR, INTERACTION=touch, TYPE=SURFACE TO SURFACE
slave, master
** where they are held
*BOUNDARY
symmetry, 1, 1
bottom, 1, 2
top, 1, 1
** the load
*STEP
*STATIC
1., 1.
*BOUNDARY
top, 2, 2, -0.01
*NODE PRINT, NSET=bottom, TOTALS=ONLY
RF
*CONTACT PRINT
CSTR
*NODE FILE
U
*END STEP
"""


def grid(x: NDArray[np.floating], y: NDArray[np.floating], first: int) -> tuple[NDArray[np.floating], dict]:
    """Points of a grid of lines x (m,) and y (n,); its cells, and its sides as cells, with nodes from `first` on."""
    node = first + np.arange(len(x) * len(y)).reshape(len(y), len(x))
    cells = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1).reshape(-1, 4)
    sides = {"lower": node[0], "upper": node[-1, ::-1], "left": node[::-1, 0]}
    lines = {name: np.stack([row[:-1], row[1:]], axis=1) for name, row in sides.items()}
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), {"cells": cells, **lines}


def make_mesh() -> lacmesh.Mesh:
    """Mesh of both bodies, with groups of their sides; slave is the underside of the punch."""
    punch, of_punch = grid(np.linspace(0, 1, 17), np.linspace(0, 1, 9) ** 1.3, 0)
    punch[:, 1] += (1 - punch[:, 1]) * punch[:, 0] ** 2 / (2 * RADIUS)
    across = np.concatenate([np.linspace(0, 1.2, 15), np.linspace(1.2, 3, 8)[1:]])
    block, of_block = grid(across, -2 * np.linspace(1, 0, 11) ** 1.5, len(punch))
    sides = {
        "slave": of_punch["lower"],
        "master": of_block["upper"],
        "top": of_punch["upper"],
        "bottom": of_block["lower"],
        "symmetry": np.concatenate([of_punch["left"], of_block["left"]]),
    }
    cells = np.concatenate([of_punch["cells"], of_block["cells"]])
    ends = np.cumsum([len(of_punch["cells"]), len(of_block["cells"]), *map(len, sides.values())])
    groups = {name: np.arange(a, b) for name, a, b in zip(("block", *sides), ends[:-1], ends[1:], strict=True)}
    groups["punch"] = np.arange(ends[0])
    blocks = [("QUAD4", cells), ("SEG2", np.concatenate(list(sides.values())))]
    points = np.concatenate([punch, block]).round(12)  # powers differ in the last bit from processor to processor
    return lacmesh.Mesh.create(points, blocks, cell_groups=groups)


def make() -> str:
    """Text of the deck."""
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
        lacmesh.write(f"{folder}/mesh.inp", make_mesh(), plane="CPE")
        return HEAD + Path(folder, "mesh.inp").read_text() + CARDS


if __name__ == "__main__":
    (Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("punch.inp")).write_text(make())
