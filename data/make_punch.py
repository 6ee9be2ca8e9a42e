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

import lacmesh
from lacmesh.generate import rectangle

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


def make_mesh() -> lacmesh.Mesh:
    """Mesh of both bodies, with groups of their sides; slave is the underside of the punch."""
    punch = rectangle((16, np.linspace(0, 1, 9) ** 1.3)).moved(
        lambda x: [x[0], x[1] + (1 - x[1]) * x[0] ** 2 / (2 * RADIUS)]
    )
    across = np.concatenate([np.linspace(0, 1.2, 15), np.linspace(1.2, 3, 8)[1:]])
    block = rectangle((across, -2 * np.linspace(1, 0, 11) ** 1.5))
    mesh = lacmesh.join(
        punch.renamed(body="punch", bottom="slave", left="symmetry"),
        block.renamed(body="block", top="master", left="symmetry"),
    ).only("punch", "block", "slave", "master", "top", "bottom", "symmetry")
    return mesh.moved(lambda x: x.round(12))  # powers differ in the last bit from processor to processor


def make() -> str:
    """Text of the deck."""
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
        lacmesh.write(f"{folder}/mesh.inp", make_mesh(), plane="CPE")
        return HEAD + Path(folder, "mesh.inp").read_text() + CARDS


if __name__ == "__main__":
    (Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).with_name("punch.inp")).write_text(make())
