"""Mesh two flanges of a pipe and the bolts that hold them together, with gmsh: half of the joint, y > 0, in mm.

    python data/flange/make_flange.py [flange.msh] [size]

`size`: length of the cells away from bolts and holes. Each flange has a raised face of 1 mm; the gasket between them is
no body, but a contact with a stiffness. Each bolt is two volumes that have a disc in common, half way: the section at
which it is tightened. Groups: the volumes `upper`, `lower`, `bolts`; the faces `face_upper`, `face_lower` (raised
faces), `top`, `bottom` (on which heads and nuts sit), `heads`, `nuts` (their undersides), `end` and `foot` (of the
pipe), `symmetry`, and the sections `bolt_1` and `bolt_2`.
"""

from __future__ import annotations

import sys
from math import cos, hypot, pi, sin

import gmsh

#: radii of the bore, the pipe, the raised face, the bolt circle, the flange; thickness of this; length of the pipe
BORE, PIPE, FACE, CIRCLE, RIM, THICK, LENGTH = 30.0, 38.0, 46.0, 60.0, 80.0, 16.0, 50.0
#: radii of shanks, holes and heads; height of these; height of the raised faces
SHANK, HOLE, HEAD, HEIGHT, RAISED = 6.0, 7.0, 11.0, 8.0, 1.0
#: places of the bolts of half the joint, which has four
PLACES = [(CIRCLE * cos(a), CIRCLE * sin(a)) for a in (pi / 4, 3 * pi / 4)]


def flange(up: int) -> int:
    """A flange with its pipe, and holes for the bolts, above z = 0 (`up` = 1) or below it (-1)."""
    occ = gmsh.model.occ
    outline = [
        (BORE, 0),
        (FACE, 0),
        (FACE, RAISED),
        (RIM, RAISED),
        (RIM, THICK),
        (PIPE, THICK),
        (PIPE, LENGTH),
        (BORE, LENGTH),
    ]
    points = [occ.addPoint(r, 0, up * z) for r, z in outline]
    lines = [occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    section = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    turned = occ.revolve([(2, section)], 0, 0, 0, 0, 0, 1, pi)
    body = [(dim, tag) for dim, tag in turned if dim == 3]
    holes = [(3, occ.addCylinder(x, y, -THICK - 1, 0, 0, 2 * THICK + 2, HOLE)) for x, y in PLACES]
    return occ.cut(body, holes)[0][0][1]


def bolt(x: float, y: float) -> tuple[int, int]:
    """The lower and the upper half of a bolt, which have the disc z = 0 in common."""
    occ, halves = gmsh.model.occ, []
    for up in (-1, 1):
        shank = occ.addCylinder(x, y, 0, 0, 0, up * THICK, SHANK)
        head = occ.addCylinder(x, y, up * THICK, 0, 0, up * HEIGHT, HEAD)
        halves.append(occ.fuse([(3, shank)], [(3, head)])[0][0])
    _, (low, high) = occ.fragment(halves[:1], halves[1:])
    return low[0][1], high[0][1]


def name_groups(upper: int, lower: int, bolts: list[tuple[int, int]]) -> None:
    """Name the volumes, and the faces by where their centres are."""
    model = gmsh.model
    groups: dict[str, list[int]] = {}
    for dim, tag in model.getEntities(2):
        x, y, z = model.occ.getCenterOfMass(dim, tag)
        low, high = model.getBoundingBox(dim, tag)[:3], model.getBoundingBox(dim, tag)[3:]
        flat, own = high[2] - low[2] < 1e-3, set(model.getAdjacencies(2, tag)[0].tolist())
        side = "upper" if upper in own else "lower" if lower in own else ""
        name = ""
        if side and high[1] < 1e-3:
            name = "symmetry"
        elif side and flat:
            levels = {
                0.0: f"face_{side}",
                THICK: "top" if side == "upper" else "bottom",
                LENGTH: "end" if side == "upper" else "foot",
            }
            name = next((name for level, name in levels.items() if abs(abs(z) - level) < 1e-3), "")
        elif flat and len(own) == 2:
            name = f"bolt_{1 + min(range(len(PLACES)), key=lambda k: hypot(x - PLACES[k][0], y - PLACES[k][1]))}"
        elif flat and abs(abs(z) - THICK) < 1e-3:
            name = "heads" if z > 0 else "nuts"
        if name:
            groups.setdefault(name, []).append(tag)
    for name, tags in groups.items():
        model.addPhysicalGroup(2, tags, name=name)
    for name, tags in (("upper", [upper]), ("lower", [lower]), ("bolts", [tag for pair in bolts for tag in pair])):
        model.addPhysicalGroup(3, tags, name=name)


def main(path: str = "data/flange/flange.msh", size: float = 16.0) -> None:
    """Make the mesh and write it."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("flange")
    upper, lower = flange(1), flange(-1)
    bolts = [bolt(x, y) for x, y in PLACES]
    gmsh.model.occ.synchronize()
    name_groups(upper, lower, bolts)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size / 4)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 8)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.HighOrderOptimize", 1)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.model.mesh.generate(3)
    gmsh.write(path)
    gmsh.finalize()


if __name__ == "__main__":
    given = sys.argv[1:]
    main(given[0] if given else "data/flange/flange.msh", float(given[1]) if len(given) > 1 else 16.0)
