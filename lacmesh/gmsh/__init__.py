"""gmsh's current model as a mesh, cut in place, or made from a mesh (`model`); CAD files listed and meshed (`cad`).

gmsh must be initialised by the caller (`gmsh.initialize()`) for the current model, and is never finalised here. Data
of a mesh that gmsh's model has no place for are kept in its attribute `LacMesh`, which gmsh writes into msh 4.1 files
as the section that lacmesh reads; fields, the records of a cut among them, are views.
"""

from lacmesh.gmsh.cad import EntitySelection as EntitySelection
from lacmesh.gmsh.cad import check_source as check_source
from lacmesh.gmsh.cad import list_cad as list_cad
from lacmesh.gmsh.cad import mesh_cad as mesh_cad
from lacmesh.gmsh.cad import parse_group as parse_group
from lacmesh.gmsh.geometry import SUFFIXES as SUFFIXES
from lacmesh.gmsh.geometry import CadShape as CadShape
from lacmesh.gmsh.model import cut_model as cut_model
from lacmesh.gmsh.model import from_mesh as from_mesh
from lacmesh.gmsh.model import to_mesh as to_mesh
