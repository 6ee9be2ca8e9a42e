"""Make ball.msh: a ball between two rigid plates, half its section; the y axis is its axis, lengths in mm.

    python data/sliding/make_ball.py [file]

The radius is 10. The plates are bare skins of segments, which touch the ball at its poles; the upper half of its skin
is the slave of the upper plate, the lower half that of the lower.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from solids import Skin, half_disc, skin, write

RADIUS, N, ROWS = 10.0, 12, 7  # 4 N segments on half its circumference
PLATE = 16.0  # radius of the plates


def main(path: Path, n: int = N, rows: int = ROWS) -> None:
    """Write ball and plates to `path`."""
    ball = half_disc(RADIUS, n, rows)
    write(
        path,
        {"ball": ball},
        {
            "upper": ("ball", skin(ball, lambda x, y: np.isclose(np.hypot(x, y), RADIUS) & (y > -1e-9))),
            "lower": ("ball", skin(ball, lambda x, y: np.isclose(np.hypot(x, y), RADIUS) & (y < 1e-9))),
            "axis": ("ball", skin(ball, lambda x, y: np.isclose(x, 0))),
        },
        bare={"top_plate": plate(RADIUS, [0.0, PLATE]), "bottom_plate": plate(-RADIUS, [PLATE, 0.0])},
    )


def plate(y: float, ends: list[float]) -> Skin:
    """A plate at a height, from one end to the other; its outside, where the ball is, lies on the right."""
    x = np.linspace(*ends, 9)
    node = np.arange(len(x))
    return Skin(np.stack([x, np.full_like(x, y)], axis=1), np.stack([node[:-1], node[1:]], axis=1))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("ball.msh"))
