"""CAD models meshed by gmsh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh.gmsh import to_mesh


def plate(size, quads=False):
    """The skin of a plate of 40 x 40 x 10 with a bore of radius 8, whose upper edge is rounded with radius 3."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        body, _ = occ.cut([(3, occ.addBox(-20, -20, 0, 40, 40, 10))], [(3, occ.addCylinder(0, 0, -1, 0, 0, 12, 8))])
        occ.synchronize()
        boxes = {tag: gmsh.model.getBoundingBox(1, tag) for _, tag in gmsh.model.getEntities(1)}
        edge = [tag for tag, box in boxes.items() if abs(box[3] - 8) < 0.1 and box[2] > 9]
        occ.fillet([body[0][1]], edge, [3.0])
        occ.synchronize()
        for name in ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax"):
            gmsh.option.setNumber(name, size)
        gmsh.option.setNumber("Mesh.RecombineAll", int(quads))
        gmsh.model.mesh.generate(2)
        mesh = to_mesh()
    finally:
        gmsh.finalize()
    return replace(mesh, cell_groups={"skin": np.flatnonzero(mesh.cell_dim == 2)})
