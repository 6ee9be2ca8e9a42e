"""Make data/two_blocks.msh: a quarter of a tapered foot (HEXA8) standing on a quarter of a block (TETRA4).

    python data/make_two_blocks.py [file]

The planes x = 0 and y = 0 are planes of symmetry; the bodies touch on z = 0, where their meshes do not match and share
no node. The unit of length is the half-width of the foot at the contact. Groups of faces are oriented outward.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import gmsh
import numpy as np

WIDE, HIGH, CELLS, LAYERS = 1.0, 0.9, 6, 4  # the foot: half-width, height, cells each way, cells in height
ROUND, TAPER = 0.2, 0.3  # how much its outline is rounded, and how much narrower it is on top
SIDE, DEPTH = 1.6, 0.7  # the block
FINE, COARSE = 0.16, 0.4  # size of its tetrahedra under the foot and far from it


def main(path: Path) -> None:
    """Mesh both bodies and write them to `path`: msh 4.1, ASCII so that one can read it."""
    gmsh.initialize(["", "-v", "2"])
    try:
        gmsh.model.add("two_blocks")
        lower = add_block()
        gmsh.model.mesh.generate(3)
        upper = add_foot()
        for name in ("slave", "master", "bottom", "top", "symmetry_x", "symmetry_y"):
            gmsh.model.addPhysicalGroup(2, [*lower.pop(name, []), *upper.pop(name, [])], name=name)
        gmsh.model.addPhysicalGroup(3, upper["volume"], name="upper")
        gmsh.model.addPhysicalGroup(3, lower["volume"], name="lower")
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def add_block() -> dict[str, list[int]]:
    """The geometry of the block, small cells asked for near the foot: its entities by group."""
    geo = gmsh.model.geo
    corners = [(0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE)]
    low = [geo.addPoint(x, y, -DEPTH, COARSE) for x, y in corners]
    high = [geo.addPoint(x, y, 0, COARSE if x and y else FINE) for x, y in corners]
    rims = [[geo.addLine(level[k], level[(k + 1) % 4]) for k in range(4)] for level in (low, high)]
    posts = [geo.addLine(a, b) for a, b in zip(low, high, strict=True)]
    walls = [[rims[0][k], posts[(k + 1) % 4], -rims[1][k], -posts[k]] for k in range(4)]
    loops = [[-a for a in reversed(rims[0])], rims[1], *walls]  # each turns right-handed about the way out
    faces = [geo.addPlaneSurface([geo.addCurveLoop(loop)]) for loop in loops]
    volume = geo.addVolume([geo.addSurfaceLoop(faces)])
    geo.synchronize()
    names = {"bottom": 0, "master": 1, "symmetry_y": 2, "symmetry_x": 5}
    return {"volume": [volume], **{name: [faces[k]] for name, k in names.items()}}


def foot_points() -> np.ndarray:
    """(CELLS + 1, CELLS + 1, LAYERS + 1, 3): a grid whose outline is rounded, and which narrows upward."""
    plane, height = np.linspace(0, 1, CELLS + 1), np.linspace(0, 1, LAYERS + 1)
    u, v, w = np.meshgrid(plane, plane, height, indexing="ij")
    wide = WIDE * (1 - TAPER * w)
    return np.stack([wide * u * (1 - ROUND * v**2), wide * v * (1 - ROUND * u**2), HIGH * w], axis=-1)


def add_foot() -> dict[str, list[int]]:
    """The hexahedra of the foot and the quadrangles on its sides, as discrete entities: these by group."""
    points = foot_points()
    first = int(gmsh.model.mesh.getMaxNodeTag()) + 1
    tag = first + np.arange(points[..., 0].size).reshape(points.shape[:3])
    sides = {  # seen from outside, so that their quadrangles turn outward
        "slave": tag[:, :, 0].T,
        "top": tag[:, :, -1],
        "symmetry_x": tag[0].T,
        "symmetry_y": tag[:, 0],
    }
    faces = {name: [gmsh.model.addDiscreteEntity(2)] for name in sides}
    volume = gmsh.model.addDiscreteEntity(3, boundary=[face for (face,) in faces.values()])
    gmsh.model.mesh.addNodes(3, volume, tag.ravel(), points.ravel())
    for name, (face,) in faces.items():
        gmsh.model.mesh.addElementsByType(face, 3, [], quadrangles(sides[name]).ravel())
    floors = [quadrangles(tag[:, :, k]) for k in range(LAYERS + 1)]
    hexahedra = np.concatenate([np.hstack(pair) for pair in pairwise(floors)])
    gmsh.model.mesh.addElementsByType(volume, 5, [], hexahedra.ravel())
    return {"volume": [volume], **faces}


def quadrangles(grid: np.ndarray) -> np.ndarray:
    """(n, 4): the quadrangles of a grid of nodes, turning from its first axis to its second."""
    corners = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.stack([c.ravel() for c in corners], axis=1)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("two_blocks.msh"))
