"""Make bar_on_wall.msh: a bar of 4 by 16 QUAD4 above a rigid wall, in the plane.

    python data/impact/make_bar.py [file]

The bar is 1 high and 1/4 wide, 0.01 above the wall, a bare line that faces up.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh import Mesh

HIGH, WIDE, GAP = 1.0, 0.25, 0.01
UP, ACROSS = 16, 4


def main(path: Path) -> None:
    """Write the bar and the wall to `path`."""
    x, y = np.meshgrid(np.linspace(0, WIDE, ACROSS + 1), np.linspace(GAP, GAP + HIGH, UP + 1))
    number = np.arange(x.size).reshape(x.shape)
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    lines = {
        "slave": number[0],
        "right": number[:, -1],
        "top": number[-1, ::-1],
        "left": number[::-1, 0],
        "wall": x.size + np.array([0, 1]),
    }
    points = np.concatenate([np.column_stack([x.ravel(), y.ravel()]), [[2 * WIDE, 0.0], [-WIDE, 0.0]]])
    faces = [np.column_stack([line[:-1], line[1:]]) for line in lines.values()]
    ends = len(cells) + np.cumsum([0, *map(len, faces)])
    groups = {"bar": np.arange(len(cells))}
    groups |= {name: np.arange(a, b) for name, a, b in zip(lines, ends, ends[1:], strict=False)}
    blocks = [("QUAD4", cells), ("SEG2", np.concatenate(faces))]
    lacmesh.write(path, Mesh.create(np.pad(points, ((0, 0), (0, 1))), blocks, cell_groups=groups, space_dim=2))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("bar_on_wall.msh"))
