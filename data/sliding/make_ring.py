"""Make ring.msh: half a ring of two layers over a block, in the plane; lengths in mm.

    python data/sliding/make_ring.py [file]

The ring, of radii 90 and 100, opens upward; its lowest point is 20 above the middle of the block's top; the block is
250 by 50. 30 segments on either side of the contact.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from solids import Body, body, brick, skin, write

INNER, OUTER, AROUND, THROUGH = 90.0, 100.0, 30, 4  # the ring: radii, cells around, cells through both layers
WIDE, HIGH, ACROSS, DOWN = 250.0, 50.0, 30, 6  # the block, and its cells
PB = (200 / 3, 0.0)  # a node of its top where one of the two later contacts is
GAP = 20.0


def main(path: Path) -> None:
    """Write both bodies to `path`."""
    ring, block = half_ring(), brick(np.linspace(-WIDE / 2, WIDE / 2, ACROSS + 1), np.linspace(-HIGH, 0, DOWN + 1))
    middle = np.hypot(*(ring.points[ring.cells].mean(axis=1) - [0.0, GAP + OUTER]).T)
    layer = middle < (INNER + OUTER) / 2
    write(
        path,
        {"ring": ring, "block": block},
        {
            "slave": ("block", skin(block, lambda x, y: np.isclose(y, 0))),
            "master": ("ring", skin(ring, lambda x, y: np.isclose(np.hypot(x, y - GAP - OUTER), OUTER))),
            "ends": ("ring", skin(ring, lambda x, y: np.isclose(y, GAP + OUTER))),
            "bottom": ("block", skin(block, lambda x, y: np.isclose(y, -HIGH))),
        },
        {"inner": ("ring", np.flatnonzero(layer)), "outer": ("ring", np.flatnonzero(~layer))},
        at={"PA": ("block", (0.0, 0.0)), "PB": ("block", PB)},
    )


def half_ring() -> Body:
    """The lower half of the ring, its first row of cells outside."""
    angle = np.linspace(-np.pi, 0, AROUND + 1)[:, None]
    radius = np.linspace(OUTER, INNER, THROUGH + 1)
    return body(np.stack([radius * np.cos(angle), GAP + OUTER + radius * np.sin(angle)], axis=-1))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("ring.msh"))
