"""The cells of msh: gmsh's number of each type."""

from __future__ import annotations

from lacmesh.cells import ALL_CELLS

#: gmsh's number of a type -> our name
TYPE_NAMES = {cell.msh: name for name, cell in ALL_CELLS.items() if cell.msh is not None}
#: What to say of a type that has no name.
UNKNOWN_TYPE = "there are elements of type {} of gmsh, which lacmesh does not know; take them out of the mesh"
