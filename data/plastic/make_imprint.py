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
from lacmesh import Mesh

RADIUS, SIZE, FINE, H, GROWTH = 5.0, 8.0, 1.0, 0.05, 1.2


def main(path: Path) -> None:
    """Write the plate and the ball to `path`."""
    line = spaced()
    x, y = np.meshgrid(line, -line[::-1])
    number = np.arange(x.size).reshape(x.shape)
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1).reshape(-1, 4)
    angle = np.linspace(0, 0.4, 41)
    ball = RADIUS * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
    lines = {"top": number[-1, ::-1], "bottom": number[0], "ball": x.size + np.arange(len(ball))}
    points = np.concatenate([np.column_stack([x.ravel(), y.ravel()]), ball])
    faces = [np.column_stack([nodes[:-1], nodes[1:]]) for nodes in lines.values()]
    ends = len(cells) + np.cumsum([0, *map(len, faces)])
    groups = {"plate": np.arange(len(cells))}
    groups |= {name: np.arange(a, b) for name, a, b in zip(lines, ends, ends[1:], strict=False)}
    groups["pole"] = np.array([ends[-1]])
    blocks = [("QUAD4", cells), ("SEG2", np.concatenate(faces)), ("POI1", number[-1:, :1])]
    lacmesh.write(path, Mesh.create(np.pad(points, ((0, 0), (0, 1))), blocks, cell_groups=groups, space_dim=2))


def spaced() -> np.ndarray:
    """Places from 0 to SIZE: steps H up to FINE, then growing ones, scaled to end there."""
    near = np.linspace(0, FINE, round(FINE / H) + 1)
    count = int(np.ceil(np.log1p((SIZE - FINE) * (GROWTH - 1) / (H * GROWTH)) / np.log(GROWTH)))
    steps = H * GROWTH ** np.arange(1, count + 1)
    return np.concatenate([near, FINE + np.cumsum(steps) * (SIZE - FINE) / steps.sum()])


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("imprint.msh"))
