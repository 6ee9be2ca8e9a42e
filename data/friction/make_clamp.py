"""Make clamp.msh: two plates that overlap, to be pressed together by the heads of a bolt; millimetres.

    python data/friction/make_clamp.py [file]

The lower plate goes from x = 0 to 60, the upper one from 20 to 80; each is 5 thick, of QUAD8, and they meet on y = 5.
The heads press on 32 < x < 48. Cells of the plates do not match. Skins turn outward.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh import Mesh

THICK, LONG, OVERLAP, HEAD = 5.0, 60.0, 20.0, (32.0, 48.0)
CELLS = {"lower": (60, 4), "upper": (75, 5)}  # along and across a plate


def main(path: Path) -> None:
    """Write both plates to `path`."""
    points, quads, skins = [], {}, {}
    first = 0
    for name, shift in (("lower", 0.0), ("upper", OVERLAP)):
        nx, ny = CELLS[name]
        x = shift + np.linspace(0, LONG, nx + 1)
        y = np.linspace(0, THICK, ny + 1) + (THICK if name == "upper" else 0.0)
        points.append(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2))
        node = first + np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
        corners = node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]
        quads[name] = np.stack([c.ravel() for c in corners], axis=1)
        low, high = np.stack([node[:-1, 0], node[1:, 0]], axis=1), np.stack([node[1:, -1], node[:-1, -1]], axis=1)
        under = np.flatnonzero((x[:-1] > HEAD[0] - 1e-9) & (x[1:] < HEAD[1] + 1e-9))
        if name == "lower":
            over = np.flatnonzero(x[:-1] > OVERLAP - 1e-9)
            skins |= {"master": high[over], "nut": low[under], "held": np.stack([node[0, 1:], node[0, :-1]], axis=1)}
        else:
            over = np.flatnonzero(x[1:] < LONG + 1e-9)
            skins |= {
                "slave": low[over],
                "head": high[under],
                "pulled": np.stack([node[-1, :-1], node[-1, 1:]], axis=1),
            }
        first += node.size
    blocks = [("QUAD4", np.concatenate(list(quads.values()))), ("SEG2", np.concatenate(list(skins.values())))]
    groups, at = {}, 0
    for name, cells in {**quads, **skins}.items():
        groups[name] = at + np.arange(len(cells))
        at += len(cells)
    flat = np.pad(np.concatenate(points), ((0, 0), (0, 1)))
    lacmesh.write(path, lacmesh.raise_order(Mesh.create(flat, blocks, cell_groups=groups, space_dim=2), "2"))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("clamp.msh"))
