"""gmsh's current model as a mesh, cut in place, or made from a mesh (`model`); CAD files listed and meshed (`cad`).

gmsh must be initialised by the caller (`gmsh.initialize()`) for the current model, and is never finalised here. Data
of a mesh that gmsh's model has no place for are kept in its attribute `LacMesh`, which gmsh writes into msh 4.1 files
as the section that lacmesh reads; fields, the records of a cut among them, are views.
"""

from lacmesh.gmsh.cad import EntitySelection, check_source, list_cad, mesh_cad, parse_group
from lacmesh.gmsh.geometry import SUFFIXES, CadShape
from lacmesh.gmsh.model import cut_model, from_mesh, to_mesh

__all__ = [
    "SUFFIXES",
    "CadShape",
    "EntitySelection",
    "check_source",
    "cut_model",
    "from_mesh",
    "list_cad",
    "mesh_cad",
    "parse_group",
    "to_mesh",
]
