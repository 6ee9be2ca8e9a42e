"""Make data/pin_in_lug.step: half of a lug on a foot, and half of the pin in its bore, as two solids. Millimetres.

    python data/make_pin_in_lug.py [file]

The plane x = 0 is one of symmetry. The pin is a little thinner than the bore and lies at its bottom, where the two
touch along a line before any load.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import gmsh

FOOT, THICK = (72.0, 32.0), 8.0  # along x and y, and high
EYE, BORE, HIGH, WIDE = 20.0, 12.0, 32.0, 20.0  # radii of the eye, height of the bore, width along y
PIN, LONG, CHAMFER = 11.8, 30.0, 1.0
BOLT, APART = 3.5, 60.0  # radius of the bolts' holes in the foot, and how far apart they are
FILLET = 4.0  # where the eye meets the foot


def main(path: Path) -> None:
    """Build both bodies and write them to `path`."""
    gmsh.initialize(["", "-v", "2"], interruptible=False)
    try:
        gmsh.model.add("pin_in_lug")
        add_lug()
        add_pin()
        halve()
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    path.write_text(without_date(path.read_text(encoding="utf-8")), encoding="utf-8")


def add_lug() -> None:
    """The foot with its holes, the eye on it, and the bore through the eye, along y."""
    occ = gmsh.model.occ
    long, deep = FOOT
    foot = occ.addBox(-long / 2, -deep / 2, 0, long, deep, THICK)
    web = occ.addBox(-EYE, -WIDE / 2, THICK / 2, 2 * EYE, WIDE, HIGH - THICK / 2)
    eye = occ.addCylinder(0, -WIDE / 2, HIGH, 0, WIDE, 0, EYE)
    ((_, lug),), _ = occ.fuse([(3, foot)], [(3, web), (3, eye)])
    bore = occ.addCylinder(0, -deep, HIGH, 0, 2 * deep, 0, BORE)
    bolts = [occ.addCylinder(x, 0, -1, 0, 0, THICK + 2, BOLT) for x in (-APART / 2, APART / 2)]
    ((_, lug),), _ = occ.cut([(3, lug)], [(3, bore), *((3, b) for b in bolts)])
    occ.fillet([lug], edges_at_the_foot(lug), [FILLET])


def edges_at_the_foot(lug: int) -> list[int]:
    """The edges along y at which the eye's plate meets the top of the foot."""
    gmsh.model.occ.synchronize()
    found = []
    for _, tag in gmsh.model.getBoundary([(3, lug)], combined=False, oriented=False, recursive=False):
        for _, edge in gmsh.model.getBoundary([(2, tag)], oriented=False):
            x0, _, z0, x1, _, z1 = gmsh.model.getBoundingBox(1, edge)
            at_foot = max(abs(z0 - THICK), abs(z1 - THICK)) < 1e-3
            if at_foot and abs(x1 - x0) < 1e-3 and abs(abs(x0) - EYE) < 1e-3:
                found.append(edge)
    return sorted(set(found))


def add_pin() -> None:
    """The pin with chamfered ends, at the bottom of the bore."""
    occ = gmsh.model.occ
    height = HIGH - (BORE - PIN)
    ends = [(-LONG / 2, PIN - CHAMFER, PIN), (LONG / 2 - CHAMFER, PIN, PIN - CHAMFER)]
    parts = [(3, occ.addCone(0, y, height, 0, CHAMFER, 0, r0, r1)) for y, r0, r1 in ends]
    occ.fuse([(3, occ.addCylinder(0, CHAMFER - LONG / 2, height, 0, LONG - 2 * CHAMFER, 0, PIN))], parts)


def halve() -> None:
    """Keep what lies at x > 0 of both bodies."""
    occ = gmsh.model.occ
    for body in occ.getEntities(3):  # one by one: together they would be joined where they touch
        occ.intersect([body], [(3, occ.addBox(0, -100, -100, 200, 200, 200))])


def without_date(text: str) -> str:
    """A STEP file whose header names neither the day nor the machine, so that it can be made again."""
    return re.sub(r"FILE_NAME\(.*?\);", "FILE_NAME('pin_in_lug.step','',(''),(''),'','','');", text, flags=re.DOTALL)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("pin_in_lug.step"))
