"""A roller on a block, from the geometry to the cut mesh: `python gmsh_script.py [--show]`."""

import sys

import gmsh

import lacmesh
from lacmesh.gmsh import cut_model

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.add("roller")

# Two bodies that touch along a line. They are not joined, so each gets a mesh of its own.
occ = gmsh.model.occ
block = occ.addBox(0, 0, -4, 14, 12, 4)
cylinder = occ.addCylinder(0, 2, 10, 0, 8, 0, 10)
((_, roller),), _ = occ.intersect([(3, cylinder)], [(3, occ.addBox(0, 0, 0, 20, 20, 10))])
occ.synchronize()


# Groups: the faces that lie in a box, and the round face.
def faces_in(x0, y0, z0, x1, y1, z1):
    """Tags of the faces in a box, with a little room."""
    found = gmsh.model.getEntitiesInBoundingBox(x0 - 1e-3, y0 - 1e-3, z0 - 1e-3, x1 + 1e-3, y1 + 1e-3, z1 + 1e-3, 2)
    return [tag for _, tag in found]


gmsh.model.addPhysicalGroup(2, faces_in(0, 0, 0, 14, 12, 0), name="contact")
gmsh.model.addPhysicalGroup(2, faces_in(0, 0, -4, 14, 12, -4), name="bottom")
gmsh.model.addPhysicalGroup(2, faces_in(0, 0, -4, 0, 12, 10), name="symmetry")
gmsh.model.addPhysicalGroup(2, faces_in(0, 0, 10, 14, 12, 10), name="top")
round_faces = [tag for _, tag in gmsh.model.getEntities(2) if gmsh.model.getType(2, tag) == "Cylinder"]
gmsh.model.addPhysicalGroup(2, round_faces, name="roller_face")
gmsh.model.addPhysicalGroup(3, [block], name="block")
gmsh.model.addPhysicalGroup(3, [roller], name="roller")

# The block of hexahedra that grow away from the contact, the roller of tetrahedra that do.
sides = gmsh.model.getBoundary([(3, block)], oriented=False)
for _, edge in gmsh.model.getBoundary(sides, combined=False, oriented=False):
    x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(1, edge)
    cells, growth = (10, 1.06) if x1 - x0 > 1 else (8, 1) if y1 - y0 > 1 else (4, 1)
    gmsh.model.mesh.setTransfiniteCurve(edge, cells + 1, "Progression", growth)
for _, side in sides:
    gmsh.model.mesh.setTransfiniteSurface(side)
    gmsh.model.mesh.setRecombine(2, side)
gmsh.model.mesh.setTransfiniteVolume(block)
for point in gmsh.model.getBoundary([(3, roller)], recursive=True):
    height = gmsh.model.getValue(*point, [])[2]
    gmsh.model.mesh.setSize([point], 0.8 if height < 1 else 1.5)
gmsh.model.mesh.generate(3)

# The cut, in gmsh's model: the upper face of the block is the slave.
cut = cut_model("contact", hexa="hexa")
print(cut.n_macros, "macro-elements;", cut.mesh.cells_by_type["HEXA8"], "HEXA8")

# Files: by gmsh, as any model; by lacmesh, with the records of the cut.
gmsh.write("roller.msh")
lacmesh.write("roller.med", cut.mesh)
if "--show" in sys.argv:
    gmsh.fltk.run()
gmsh.finalize()
