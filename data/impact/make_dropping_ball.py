"""Make dropping_ball.msh: half the section of a ball, for axisymmetry, above a floor; lengths in metres.

    python data/impact/make_dropping_ball.py [file]

The ball's radius is 50 mm, its lowest point 3 mm above the floor, a bare line that faces up. 20 segments from pole to
pole, of which the lower half is the slave.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh import Mesh

RADIUS, GAP, FLOOR = 0.05, 0.003, 0.06
QUARTER, SHELLS, CORE = 6, 4, 0.5  # cells along half a side of the core, around it, and the core's size


def main(path: Path) -> None:
    """Write the ball and the floor to `path`."""
    points, cells, rim = half_disc()
    points = RADIUS * points + [0.0, GAP + RADIUS]
    floor = len(points) + np.array([[0, 1]])
    points = np.concatenate([points, [[FLOOR, 0.0], [0.0, 0.0]]])
    slave = np.column_stack([rim[: 2 * QUARTER], rim[1 : 2 * QUARTER + 1]])
    blocks = [("QUAD4", cells), ("SEG2", np.concatenate([slave, floor]))]
    first = len(cells)
    groups = {
        "ball": np.arange(first),
        "slave": first + np.arange(len(slave)),
        "floor": first + len(slave) + np.arange(1),
    }
    lacmesh.write(path, Mesh.create(np.pad(points, ((0, 0), (0, 1))), blocks, cell_groups=groups, space_dim=2))


def half_disc() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (n, 2) of the half x >= 0 of a unit disc, its quadrangles, and the nodes of its arc from below.

    A core of 2 QUARTER rows, whose sides are bent outward, and SHELLS around it.
    """
    n = QUARTER
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(-1, 1, 2 * n + 1), indexing="ij")
    bend = 0.8 + 0.2 / np.hypot(u, v).clip(1.0)
    core = CORE * np.stack([u, v], axis=-1) * bend[..., None]
    number = np.arange(u.size).reshape(u.shape)
    side = np.concatenate([number[:, 0], number[-1, 1:], number[-2::-1, -1]])
    angle = np.linspace(-np.pi / 2, np.pi / 2, 4 * n + 1)
    inner, outer = core.reshape(-1, 2)[side], np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    parts, rows = [core.reshape(-1, 2)], [side]
    for w in np.arange(1, SHELLS + 1) / SHELLS:
        rows.append(len(np.concatenate(parts)) + np.arange(len(side)))
        parts.append((1 - w) * inner + w * outer)
    grid = np.stack(rows)
    cells = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    around = [grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]]
    quads = [np.stack([c.ravel() for c in corners], axis=1) for corners in (cells, around)]
    points = np.concatenate(parts)
    points[np.abs(points[:, 0]) < 1e-12, 0] = 0.0
    return points, np.concatenate(quads), rows[-1]


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("dropping_ball.msh"))
