"""Make data/press_fit.msh: a quarter of a hub that is pressed upon a hollow shaft, all of linear tetrahedra.

    python data/make_press_fit.py [file]

The shaft's outside and the hub's bore are one cylinder, r = 20; press_fit.toml presses them into one another by a
negative clearance. The planes x = 0 and y = 0 are those of symmetry; both bodies are as long, so that with their ends
held along z the pressure is the same everywhere. Millimetres.
"""

from __future__ import annotations

import sys
from math import pi
from pathlib import Path

import gmsh

INSIDE, FIT, OUTSIDE, LONG = 10.0, 20.0, 35.0, 10.0  # radii of shaft, fit and hub, and length
SHAFT, HUB = 2.4, 3.1  # sizes of cells


def main(path: Path) -> None:
    """Mesh both bodies and write them to `path`, ASCII msh 4.1."""
    gmsh.initialize(["", "-v", "2"])
    try:
        gmsh.model.add("press_fit")
        shaft, hub = add_ring(INSIDE, FIT), add_ring(FIT, OUTSIDE)
        gmsh.model.occ.synchronize()
        group("slave", faces_of(shaft, radius=FIT))
        group("master", faces_of(hub, radius=FIT))
        for name, axis in (("symmetry_x", 0), ("symmetry_y", 1)):
            group(name, faces_of(shaft, zero=axis) + faces_of(hub, zero=axis))
        group("ends", [f for body in (shaft, hub) for z in (0.0, LONG) for f in faces_of(body, height=z)])
        for name, body, size in (("shaft", shaft, SHAFT), ("hub", hub, HUB)):
            gmsh.model.addPhysicalGroup(3, [body], name=name)
            points = gmsh.model.getBoundary([(3, body)], recursive=True)
            gmsh.model.mesh.setSize(points, size)
            gmsh.model.mesh.setOutwardOrientation(body)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        gmsh.model.mesh.generate(3)
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def add_ring(inside: float, outside: float) -> int:
    """A quarter of a ring from z = 0 up, in x > 0 and y > 0."""
    occ = gmsh.model.occ
    solid = occ.addCylinder(0, 0, 0, 0, 0, LONG, outside, angle=pi / 2)
    hole = occ.addCylinder(0, 0, 0, 0, 0, LONG, inside, angle=pi / 2)
    ((_, ring),), _ = occ.cut([(3, solid)], [(3, hole)])
    return int(ring)


def faces_of(
    body: int, *, radius: float | None = None, zero: int | None = None, height: float | None = None
) -> list[int]:
    """The faces of a body that lie on a cylinder about z, in a plane of symmetry (its axis), or at a height."""
    found = []
    for _, tag in gmsh.model.getBoundary([(3, body)], oriented=False):
        x0, y0, z0, x1, y1, z1 = gmsh.model.getBoundingBox(2, tag)
        if radius is not None:
            is_one = gmsh.model.getType(2, tag) == "Cylinder" and abs(max(x1, y1) - radius) < 1e-3
        elif zero is not None:
            is_one = abs((x0, y0)[zero]) < 1e-3 and abs((x1, y1)[zero]) < 1e-3
        else:
            is_one = abs(z0 - height) < 1e-3 and abs(z1 - height) < 1e-3
        if is_one:
            found.append(tag)
    return found


def group(name: str, tags: list[int]) -> None:
    """Name some faces."""
    gmsh.model.addPhysicalGroup(2, tags, name=name)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_name("press_fit.msh"))
