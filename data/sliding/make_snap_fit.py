"""Make snap_fit.msh: a cantilever with a hook at its end before a rigid ledge, in the plane; lengths in mm.

    python data/sliding/make_snap_fit.py [file]

The beam is 30 long and 2 thick; the hook reaches 3 below it, with a slope of 30 degrees in front, a back of 60 degrees
and a rounded crest between. The ledge is a bare skin with rounded corners, whose top lies 0.5 below the beam. (At a
sharp edge one macro-element would leave the ledge all at once, with a jump of the force.)
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from solids import Body, Skin, body, skin, write

BEAM, THICK, DEPTH, TIP = 30.0, 2.0, 3.0, 0.4  # TIP: how far below the beam the slope ends
FRONT, BACK = np.tan(np.radians(30.0)), np.tan(np.radians(60.0))  # slopes
BEFORE, BEHIND = 2.5, 1.2  # how long the crest is, as parabolas, on the side of the slope and of the back
COLUMNS, ROWS = (60, 4, 6, 8, 8), 4  # cells along beam, back, crest behind, crest before, slope; and through
LEDGE, TOP, FLOOR, ROUND = (38.5, 43.5), -0.5, -6.0, 1.0  # the ledge: from where to where, its top, its foot, corners


def main(path: Path) -> None:
    """Write hook and ledge to `path`."""
    hook = cantilever()
    write(
        path,
        {"hook": hook},
        {
            "slave": ("hook", skin(hook, lambda x, y: (x > BEAM - 3 - 1e-9) & np.isclose(y, underside(x)))),
            "base": ("hook", skin(hook, lambda x, y: np.isclose(x, 0))),
        },
        bare={"ledge": ledge()},
        at={"tip": ("hook", (knees()[-1], -TIP))},
    )


def knees() -> np.ndarray:
    """(6,): where the underside changes along x: base, back, crest behind, its lowest point, slope, tip."""
    back, front = DEPTH - BACK * BEHIND / 2, DEPTH - FRONT * BEFORE / 2  # how deep the crest begins and ends
    return np.cumsum([0.0, BEAM, back / BACK, BEHIND, BEFORE, (front - TIP) / FRONT])


def underside(x: np.ndarray) -> np.ndarray:
    """The lower side of beam and hook."""
    _, beam, back, low, front, tip = knees()
    crest = np.where(x < low, BACK / (2 * BEHIND), FRONT / (2 * BEFORE)) * (x - low) ** 2 - DEPTH
    sides = np.where(x < low, -BACK * (x - beam), FRONT * (x - tip) - TIP)
    return np.where(x <= beam, 0.0, np.where((x > back) & (x < front), crest, sides))


def cantilever() -> Body:
    """Beam and hook: columns of cells from the underside up."""
    spans = zip(knees()[:-1], knees()[1:], COLUMNS, strict=True)
    x = np.unique(np.concatenate([np.linspace(a, b, n + 1) for a, b, n in spans]).round(12))
    w = np.linspace(0.0, 1.0, ROWS + 1)
    y = underside(x)[:, None] * (1 - w) + THICK * w
    return body(np.stack([np.broadcast_to(x[:, None], y.shape), y], axis=-1))


def ledge() -> Skin:
    """From the right foot up, over the top and down again: its outside lies on the right."""
    turn = np.linspace(0.0, np.pi / 2, 13)
    arc = ROUND * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    right = arc + np.array([LEDGE[1] - ROUND, TOP - ROUND])
    left = arc[::-1] * [-1, 1] + np.array([LEDGE[0] + ROUND, TOP - ROUND])
    flat = np.linspace(right[-1], left[0], 8)[1:-1]
    feet = [[[LEDGE[1], y]] for y in (FLOOR, FLOOR / 2)], [[[LEDGE[0], y]] for y in (FLOOR / 2, FLOOR)]
    points = np.concatenate([*feet[0], right, flat, left, *feet[1]])
    node = np.arange(len(points))
    return Skin(points, np.stack([node[:-1], node[1:]], axis=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("snap_fit.msh"))
