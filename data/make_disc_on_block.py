"""Make data/disc_on_block.msh: a quarter of a disc (TRIA3) that touches a block (QUAD4) at one point, in the plane.

    python data/make_disc_on_block.py [file]

The line x = 0 is one of symmetry. The unit of length is the disc's radius. Where the bodies will touch is not known
beforehand: the slave group is the whole arc. The cells of both bodies grow away from the first contact.
"""

from __future__ import annotations

import sys
from pathlib import Path

import gmsh

SIDE, DEPTH = 1.5, 1.0  # the block
ALONG, DOWN, GROWTH = 20, 10, 1.15  # its cells, and how much larger each is than the one before
FINE, COARSE = 0.05, 0.15  # size of the disc's triangles at the contact and far from it


def main(path: Path) -> None:
    """Mesh both bodies and write them to `path`, ASCII msh 4.1."""
    gmsh.initialize(["", "-v", "2"])
    try:
        gmsh.model.add("disc_on_block")
        disc, block = add_disc(), add_block()
        gmsh.model.geo.synchronize()
        for name in ("slave", "master", "symmetry_x", "top", "bottom"):
            lines = [sides[name] for sides in (disc, block) if name in sides]
            gmsh.model.addPhysicalGroup(1, lines, name=name)
        gmsh.model.addPhysicalGroup(2, [disc["surface"]], name="disc")
        gmsh.model.addPhysicalGroup(2, [block["surface"]], name="block")
        gmsh.model.mesh.generate(2)
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def add_disc() -> dict[str, int]:
    """The quarter of the disc above the contact, its sides by group."""
    geo = gmsh.model.geo
    low, centre, right = (geo.addPoint(x, y, 0, h) for x, y, h in ((0, 0, FINE), (0, 1, COARSE), (1, 1, COARSE)))
    sides = {
        "slave": geo.addCircleArc(low, centre, right),
        "top": geo.addLine(right, centre),
        "symmetry_x": geo.addLine(centre, low),
    }
    return {**sides, "surface": geo.addPlaneSurface([geo.addCurveLoop(list(sides.values()))])}


def add_block() -> dict[str, int]:
    """The block under the disc, in rows and columns that grow away from the contact."""
    geo = gmsh.model.geo
    a, b, c, d = (geo.addPoint(x, y, 0) for x, y in ((0, -DEPTH), (SIDE, -DEPTH), (SIDE, 0), (0, 0)))
    sides = {
        "bottom": geo.addLine(a, b),
        "right": geo.addLine(b, c),
        "master": geo.addLine(c, d),
        "symmetry_x": geo.addLine(d, a),
    }
    growth = {"bottom": GROWTH, "right": 1 / GROWTH, "master": 1 / GROWTH, "symmetry_x": GROWTH}
    for name, cells in (("bottom", ALONG), ("right", DOWN), ("master", ALONG), ("symmetry_x", DOWN)):
        geo.mesh.setTransfiniteCurve(sides[name], cells + 1, "Progression", growth[name])
    surface = geo.addPlaneSurface([geo.addCurveLoop(list(sides.values()))])
    geo.mesh.setTransfiniteSurface(surface)
    geo.mesh.setRecombine(2, surface)
    return {**sides, "surface": surface}


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("disc_on_block.msh"))
