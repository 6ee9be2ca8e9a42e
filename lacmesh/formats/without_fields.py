"""What a format of nodes, cells and groups alone has no place for."""

from __future__ import annotations

from lacmesh.mesh import Mesh


def left_out(mesh: Mesh) -> list[str]:
    """Clauses that name what of a mesh such a format loses; none where nothing is."""
    said = []
    data = [*(f"cell data {n}" for n in mesh.cell_data), *(f"node data {n}" for n in mesh.node_data)]
    if data:
        said.append(f"fields are left out: {', '.join(data)}")
    if mesh.zones:
        said.append(f"the zones of the cut are left out: {', '.join(mesh.zones)}")
    if mesh.group_tags or mesh.model is not None:
        said.append("msh's tags of groups, and its model, are left out")
    return said
