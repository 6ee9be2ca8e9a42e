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
from lacmesh import Mesh

HALF, HIGH, NEAR = 8.0, 8.0, 1.0
FINE = {"upper": 0.04, "lower": 0.05}


def main(path: Path) -> None:
    """Write both blocks to `path`."""
    points, quads, skins = [], {}, {}
    first = 0
    for name, side in (("upper", 1), ("lower", -1)):
        aside = lines(FINE[name], HALF)
        x, y = np.concatenate([-aside[:0:-1], aside]), side * lines(FINE[name], HIGH)[::side]
        points.append(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2))
        node = first + np.arange(len(x) * len(y)).reshape(len(x), len(y))
        corners = node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]
        quads[name] = np.stack([c.ravel() for c in corners], axis=1)
        low, high = np.stack([node[:-1, 0], node[1:, 0]], axis=1), np.stack([node[1:, -1], node[:-1, -1]], axis=1)
        skins |= {"slave": low, "top": high} if side > 0 else {"bottom": low, "master": high}
        first += node.size
    groups, at = {}, 0
    for name, cells in {**quads, **skins}.items():
        groups[name] = at + np.arange(len(cells))
        at += len(cells)
    blocks = [("QUAD4", np.concatenate(list(quads.values()))), ("SEG2", np.concatenate(list(skins.values())))]
    flat = np.pad(np.concatenate(points), ((0, 0), (0, 1)))
    lacmesh.write(path, Mesh.create(flat, blocks, cell_groups=groups, space_dim=2))


def lines(fine: float, end: float) -> np.ndarray:
    """Lines from 0 to `end`: even ones up to NEAR, then growing by a quarter each."""
    near = np.linspace(0, NEAR, round(NEAR / fine) + 1)
    growing = NEAR + fine * np.cumsum(1.25 ** np.arange(1, 40))
    out = growing[growing < 0.9 * end]
    return np.concatenate([near, out, [end]])


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("cylinders.msh"))
