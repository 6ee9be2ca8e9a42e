"""Make bar_on_wall.msh: a bar of 4 by 16 QUAD4 above a rigid wall, in the plane.

    python data/impact/make_bar.py [file]

The bar is 1 high and 1/4 wide, 0.01 above the wall, a bare line that faces up.
"""

from __future__ import annotations

import sys
from pathlib import Path

import lacmesh
from lacmesh.generate import line, rectangle

HIGH, WIDE, GAP = 1.0, 0.25, 0.01
UP, ACROSS = 16, 4


def main(path: Path) -> None:
    """Write the bar and the wall to `path`."""
    bar = rectangle((ACROSS, UP), (WIDE, HIGH), corner=(0, GAP)).renamed(body="bar", bottom="slave")
    wall = line(1, (2 * WIDE, 0), (-WIDE, 0)).renamed(body="wall")
    lacmesh.write(path, lacmesh.join(bar, wall))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("bar_on_wall.msh"))
