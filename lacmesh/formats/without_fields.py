"""Content of a mesh that a format of nodes, cells and groups alone has no place for."""

from __future__ import annotations

from lacmesh.formats.sidecar import without_records
from lacmesh.mesh import Mesh


def left_out(mesh: Mesh) -> list[str]:
    """Clauses that name what such a format loses of a mesh, none if nothing; cut records go to the sidecar."""
    mesh = without_records(mesh)
    fields = [
        *(f"cell data {name}" for name in mesh.cell_data if name != "entity"),
        *(f"node data {name}" for name in mesh.node_data if name != "entity"),
    ]
    has = {
        "entities": mesh.model is not None or "entity" in mesh.cell_data or "entity" in mesh.node_data,
        "tags of groups": bool(mesh.group_tags),
        "periodic links": mesh.model is not None and bool(mesh.model.periodic),
    }
    said = [f"fields are left out: {', '.join(fields)}"] if fields else []
    said += [f"the zones of the cut are left out: {', '.join(mesh.zones)}"] if mesh.zones else []
    of_gmsh = [what for what, there in has.items() if there]
    return said + ([f"what only gmsh knows is left out: {', '.join(of_gmsh)}"] if of_gmsh else [])
