"""What a format without fields loses of a mesh."""

from __future__ import annotations

from lacmesh.mesh import Mesh


def left_out(mesh: Mesh) -> list[str]:
    """Sentences on what a format of nodes, cells and groups alone has no place for; none where nothing is lost."""
    said = []
    data = [*(f"cell data {n}" for n in mesh.cell_data), *(f"node data {n}" for n in mesh.node_data)]
    if data:
        said.append(f"fields are left out: {', '.join(data)}")
    if mesh.zones:
        said.append(f"the zones of the cut are left out: {', '.join(mesh.zones)}")
    if mesh.group_tags or mesh.model is not None:
        said.append("msh's tags of groups, and its model, are left out")
    return said
