"""A mesh of one's own: a quarter of a cylinder on half of a block, plane, made with gmsh. See own_mesh.md."""

import itertools

import gmsh

RADIUS, WIDTH, DEPTH = 10.0, 20.0, 20.0  # mm
FINE, COARSE = 0.03, 2.0  # edges at the contact and far from it

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.add("cylinder")
geo = gmsh.model.geo

# The quarter of the cylinder: its lowest point, its centre, and the end of the arc.
low, centre, right = (geo.addPoint(x, y, 0) for x, y in ((0, 0), (0, RADIUS), (RADIUS, RADIUS)))
arc, top, axis = geo.addCircleArc(low, centre, right), geo.addLine(right, centre), geo.addLine(centre, low)
cylinder = geo.addPlaneSurface([geo.addCurveLoop([arc, top, axis])])

# The block under it, with points of its own: the bodies share no node.
corners = [geo.addPoint(x, y, 0) for x, y in ((0, -DEPTH), (WIDTH, -DEPTH), (WIDTH, 0), (0, 0))]
bottom, side, upper, middle = (geo.addLine(a, b) for a, b in itertools.pairwise([*corners, corners[0]]))
block = geo.addPlaneSurface([geo.addCurveLoop([bottom, side, upper, middle])])
geo.synchronize()

# Groups: the lines and the bodies that the case names.
for name, lines in (("arc", [arc]), ("upper", [upper]), ("top", [top]), ("bottom", [bottom]), ("axis", [axis, middle])):
    gmsh.model.addPhysicalGroup(1, lines, name=name)
for name, surface in (("cylinder", cylinder), ("block", block)):
    gmsh.model.addPhysicalGroup(2, [surface], name=name)

# Edges of size FINE up to 0.6 mm from the first contact, growing to COARSE at 10 mm.
field = gmsh.model.mesh.field
field.add("Distance", 1)
field.setNumbers(1, "PointsList", [low, corners[3]])
field.add("Threshold", 2)
for option, value in (("InField", 1), ("SizeMin", FINE), ("SizeMax", COARSE), ("DistMin", 0.6), ("DistMax", 10.0)):
    field.setNumber(2, option, value)
field.setAsBackgroundMesh(2)
for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
    gmsh.option.setNumber(f"Mesh.{option}", 0)
gmsh.model.mesh.generate(2)
gmsh.write("cylinder.msh")
gmsh.finalize()
