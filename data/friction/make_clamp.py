"""Make clamp.msh: two plates that overlap, to be pressed together by the heads of a bolt; millimetres.

    python data/friction/make_clamp.py [file]

The lower plate goes from x = 0 to 60, the upper one from 20 to 80; each is 5 thick, of QUAD8, and they meet on y = 5.
The heads press on 32 < x < 48. Cells of the plates do not match. Skins turn outward.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh.generate import rectangle

THICK, LONG, OVERLAP, HEAD = 5.0, 60.0, 20.0, (32.0, 48.0)
NEAR = 1e-9
CELLS = {"lower": (60, 4), "upper": (75, 5)}  # along and across a plate


def main(path: Path) -> None:
    """Write both plates to `path`."""
    lower = rectangle(CELLS["lower"], (LONG, THICK))
    lower = lower.renamed(body="lower", left="held", right="", bottom="", top="")
    lower = lower.with_groups(master=on(THICK, OVERLAP, LONG), nut=on(0.0, *HEAD))
    upper = rectangle(CELLS["upper"], (LONG, THICK), corner=(OVERLAP, THICK))
    upper = upper.renamed(body="upper", right="pulled", left="", bottom="", top="")
    upper = upper.with_groups(slave=on(THICK, OVERLAP, LONG), head=on(2 * THICK, *HEAD))
    both = lacmesh.join(lower.only("lower", "master", "nut", "held"), upper.only("upper", "slave", "head", "pulled"))
    lacmesh.write(path, lacmesh.raise_order(both, "2"))


def on(y: float, left: float, right: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return a condition on points: at the height y, between two places along x."""
    return lambda x: (abs(x[1] - y) < NEAR) & (x[0] > left - NEAR) & (x[0] < right + NEAR)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("clamp.msh"))
