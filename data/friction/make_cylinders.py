"""Make cylinders.msh: two blocks that touch along y = 0, whose clearance x^2 / 8 makes cylinders of radius 8 of them.

    python data/friction/make_cylinders.py [file]

Each is 16 wide and 8 high, of QUAD4, with cells of 0.04 (above) and 0.05 (below) near the line of contact, which is
1.36 wide under the load of cylinders.toml. Skins turn outward.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh.generate import rectangle

HALF, HIGH, NEAR = 8.0, 8.0, 1.0
FINE = {"upper": 0.04, "lower": 0.05}


def main(path: Path) -> None:
    """Write both blocks to `path`."""
    x, y = {}, {}
    for name, fine in FINE.items():
        aside = lines(fine, HALF)
        x[name], y[name] = np.concatenate([-aside[:0:-1], aside]), lines(fine, HIGH)
    upper = rectangle((x["upper"], y["upper"])).renamed(body="upper", bottom="slave").only("upper", "slave", "top")
    lower = rectangle((x["lower"], -y["lower"][::-1])).renamed(body="lower", top="master")
    lacmesh.write(path, lacmesh.join(upper, lower.only("lower", "master", "bottom")))


def lines(fine: float, end: float) -> np.ndarray:
    """Lines from 0 to `end`: even ones up to NEAR, then growing by a quarter each."""
    near = np.linspace(0, NEAR, round(NEAR / fine) + 1)
    growing = NEAR + fine * np.cumsum(1.25 ** np.arange(1, 40))
    out = growing[growing < 0.9 * end]
    return np.concatenate([near, out, [end]])


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("cylinders.msh"))
