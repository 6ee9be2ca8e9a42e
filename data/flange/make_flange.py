"""Mesh one bolt's sector of a flange joint with gmsh: two flanges of a pipe and a bolt, one eighth of the ring, in mm.

    python data/flange/make_flange.py [flange.msh] [size]

`size`: length of the cells away from bolt and hole. Each flange has a raised face of 1 mm; the gasket between them is
no body, but a contact. The bolt, in the middle of the sector, is two volumes that have a disc in common, half way: the
section at which it is tightened. The mesh of one side of the sector is that of the other, turned about the axis z.
Groups: the volumes `upper`, `lower`, `bolt`; the faces `side_a` and `side_b` (of the sector), `face_upper` and
`face_lower` (raised faces), `top` and `bottom` (on which head and nut sit), `head` and `nut` (their undersides), `end`
and `foot` (of the pipe), and the section `shank`.
"""

from __future__ import annotations

import sys
from math import atan2, cos, pi, sin

import gmsh

#: radii of the bore, the pipe, the raised face, the bolt circle, the flange; thickness of this; length of the pipe
BORE, PIPE, FACE, CIRCLE, RIM, THICK, LENGTH = 30.0, 38.0, 48.0, 60.0, 80.0, 16.0, 50.0
#: radii of shank, hole and head; height of this; height of the raised faces
SHANK, HOLE, HEAD, HEIGHT, RAISED = 6.0, 7.0, 11.0, 8.0, 1.0
#: number of bolts, each of which has a sector
BOLTS = 8


def flange(up: int) -> int:
    """The sector of a flange with its pipe and a hole, above z = 0 (`up` = 1) or below it (-1)."""
    occ, half = gmsh.model.occ, pi / BOLTS
    outline = [
        (BORE, 0), (FACE, 0), (FACE, RAISED), (RIM, RAISED),
        (RIM, THICK), (PIPE, THICK), (PIPE, LENGTH), (BORE, LENGTH),
    ]  # fmt: skip
    points = [occ.addPoint(r * cos(half), -r * sin(half), up * z) for r, z in outline]
    lines = [occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
    section = occ.addPlaneSurface([occ.addCurveLoop(lines)])
    turned = occ.revolve([(2, section)], 0, 0, 0, 0, 0, 1, 2 * half)
    body = [(dim, tag) for dim, tag in turned if dim == 3]
    hole = [(3, occ.addCylinder(CIRCLE, 0, -THICK - 1, 0, 0, 2 * THICK + 2, HOLE))]
    return occ.cut(body, hole)[0][0][1]


def bolt() -> tuple[int, int]:
    """The lower and the upper half of the bolt, which have the disc z = 0 in common."""
    occ, halves = gmsh.model.occ, []
    for up in (-1, 1):
        shank = occ.addCylinder(CIRCLE, 0, 0, 0, 0, up * THICK, SHANK)
        head = occ.addCylinder(CIRCLE, 0, up * THICK, 0, 0, up * HEIGHT, HEAD)
        halves.append(occ.fuse([(3, shank)], [(3, head)])[0][0])
    _, (low, high) = occ.fragment(halves[:1], halves[1:])
    return low[0][1], high[0][1]


def name_of(side: str, centre: tuple[float, float, float], flat: bool, volumes: int) -> str:
    """The name of a face of the flange at one `side` of z = 0, or of the bolt (""), by where its centre is."""
    x, y, z = centre
    if side and abs(abs(atan2(y, x)) - pi / BOLTS) < 1e-6:
        return "side_a" if y < 0 else "side_b"
    if side and flat:
        levels = {0.0: f"face_{side}", THICK: {"upper": "top", "lower": "bottom"}[side],
                  LENGTH: {"upper": "end", "lower": "foot"}[side]}  # fmt: skip
        return next((name for level, name in levels.items() if abs(abs(z) - level) < 1e-3), "")
    if flat and volumes == 2:
        return "shank"
    return ("head" if z > 0 else "nut") if flat and abs(abs(z) - THICK) < 1e-3 else ""


def name_groups(upper: int, lower: int, halves: tuple[int, int]) -> dict[str, list[int]]:
    """Name the volumes and the faces; return the faces of each name."""
    model, groups = gmsh.model, {}
    for dim, tag in model.getEntities(2):
        low, high = model.getBoundingBox(dim, tag)[:3], model.getBoundingBox(dim, tag)[3:]
        own = set(model.getAdjacencies(2, tag)[0].tolist())
        side = "upper" if upper in own else "lower" if lower in own else ""
        name = name_of(side, model.occ.getCenterOfMass(dim, tag), high[2] - low[2] < 1e-3, len(own))
        if name:
            groups.setdefault(name, []).append(tag)
    for name, tags in groups.items():
        model.addPhysicalGroup(2, tags, name=name)
    for name, tags in (("upper", [upper]), ("lower", [lower]), ("bolt", [*halves])):
        model.addPhysicalGroup(3, tags, name=name)
    return groups


def repeat_sides(groups: dict[str, list[int]]) -> None:
    """Mesh `side_b` as `side_a` is, turned by the angle of the sector."""
    c, s = cos(2 * pi / BOLTS), sin(2 * pi / BOLTS)
    turn = [c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    height = {tag: gmsh.model.occ.getCenterOfMass(2, tag)[2] for name in ("side_a", "side_b") for tag in groups[name]}
    first, second = (sorted(groups[name], key=height.__getitem__) for name in ("side_a", "side_b"))
    gmsh.model.mesh.setPeriodic(2, second, first, turn)


def forget_links() -> None:
    """Take the links between the sides out of the model: the case says which sides belong together."""
    same = [1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    for dim in (2, 1):
        for _, tag in gmsh.model.getEntities(dim):
            gmsh.model.mesh.setPeriodic(dim, [tag], [tag], same)


def main(path: str = "data/flange/flange.msh", size: float = 10.0) -> None:
    """Make the mesh and write it."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("flange")
    upper, lower = flange(1), flange(-1)
    halves = bolt()
    gmsh.model.occ.synchronize()
    repeat_sides(name_groups(upper, lower, halves))
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size / 4)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 10)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.option.setNumber("Mesh.HighOrderOptimize", 1)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.model.mesh.generate(3)
    forget_links()
    gmsh.write(path)
    gmsh.finalize()


if __name__ == "__main__":
    given = sys.argv[1:]
    main(given[0] if given else "data/flange/flange.msh", float(given[1]) if len(given) > 1 else 10.0)
