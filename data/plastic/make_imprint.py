"""Make imprint.msh: a plate of QUAD4 below a rigid ball of radius 5, axisymmetric about x = 0.

    python data/plastic/make_imprint.py [file]

Lines of the mesh are 0.05 apart where the ball will touch, and wider and wider beyond. The ball is a bare arc of lines
that faces down. Millimetres.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh.generate import line, rectangle

RADIUS, SIZE, FINE, H, GROWTH = 5.0, 8.0, 1.0, 0.05, 1.2


def main(path: Path) -> None:
    """Write the plate and the ball to `path`."""
    lines = spaced()
    plate = rectangle((lines, -lines[::-1])).renamed(body="plate")
    plate = plate.with_groups("nodes", pole=lambda x: (x[0] == 0) & (x[1] == 0)).only("plate", "top", "bottom")
    angle = np.radians(90) - np.linspace(0, 0.4, 41)
    ball = [RADIUS * np.cos(angle), RADIUS * (1 - np.sin(angle))]
    arc = line(40, (0, 0), (1, 0)).moved(lambda x: ball).renamed(body="ball")
    lacmesh.write(path, lacmesh.join(plate, arc))


def spaced() -> np.ndarray:
    """Places from 0 to SIZE: steps H up to FINE, then growing ones, scaled to end there."""
    near = np.linspace(0, FINE, round(FINE / H) + 1)
    count = int(np.ceil(np.log1p((SIZE - FINE) * (GROWTH - 1) / (H * GROWTH)) / np.log(GROWTH)))
    steps = H * GROWTH ** np.arange(1, count + 1)
    return np.concatenate([near, FINE + np.cumsum(steps) * (SIZE - FINE) / steps.sum()])


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("imprint.msh"))
