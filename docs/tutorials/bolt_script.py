"""A plate that is bolted to a base, from the geometry to the mesh: `python bolt_script.py` writes bolt.msh."""

from math import pi

import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.add("bolt")
occ = gmsh.model.occ


def quarter(z, height, radius):
    """A quarter of a cylinder about the axis z: x > 0, y > 0."""
    return (3, occ.addCylinder(0, 0, z, 0, 0, height, radius, angle=pi / 2))


def block(z, height):
    """A quarter of a square plate."""
    return (3, occ.addBox(0, 0, z, 20, 20, height))


# A quarter of the joint, in mm. The shank is one with the base, into which it is screwed; the hole is wider than it.
base = occ.fuse([block(-10, 10)], [quarter(0, 4, 4)])[0]
head = occ.fuse([quarter(4, 4, 4)], [quarter(8, 5, 8)])[0]
((_, plate),), _ = occ.cut([block(0, 8)], [quarter(-1, 10, 5)])

# Base and head get one disc between them, in place of one each: the section at which the bolt is tightened.
_, ((base,), (head,)) = occ.fragment(base, head)
occ.synchronize()


# Groups: the volumes, and the faces whose middle lies at a level.
def faces_at(axis, level, volume):
    """Tags of the faces of a volume that lie in a plane across an axis."""
    around = [tag for _, tag in gmsh.model.getBoundary([volume], oriented=False)]
    boxes = {tag: gmsh.model.getBoundingBox(2, tag) for tag in around}
    return [tag for tag in around if max(abs(boxes[tag][axis] - level), abs(boxes[tag][axis + 3] - level)) < 1e-3]


plate = (3, plate)
groups = {
    "head": faces_at(2, 8, head),
    "seat": faces_at(2, 8, plate),
    "underside": faces_at(2, 0, plate),
    "base_top": faces_at(2, 0, base),
    "section": faces_at(2, 4, base),
    "floor": faces_at(2, -10, base),
    "edge": faces_at(0, 20, plate),
    "symmetry_x": [tag for volume in (base, head, plate) for tag in faces_at(0, 0, volume)],
    "symmetry_y": [tag for volume in (base, head, plate) for tag in faces_at(1, 0, volume)],
}
for name, tags in groups.items():
    gmsh.model.addPhysicalGroup(2, tags, name=name)
gmsh.model.addPhysicalGroup(3, [base[1], head[1]], name="bolt_and_base")
gmsh.model.addPhysicalGroup(3, [plate[1]], name="plate")

# Quadratic tetrahedra, finer at the head.
gmsh.option.setNumber("Mesh.MeshSizeMax", 4)
gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 16)
gmsh.option.setNumber("Mesh.ElementOrder", 2)
gmsh.model.mesh.generate(3)
gmsh.write("bolt.msh")
gmsh.finalize()
