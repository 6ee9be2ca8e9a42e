"""Notes of lacmesh in a MED file: data of a mesh that MED has no place for, as JSON in the root group LACMESH.

libmed, medcoupling and gmsh leave that group alone (and drop it when they write). The notes are the names of a cut's
zones, msh's tags of the groups, and msh's model; where they are gone, the zones' names are derived from the groups.
"""

from __future__ import annotations

import json
from typing import Any

import h5py
import numpy as np

from lacmesh.formats.med.hdf5 import Branch, add_array, add_group
from lacmesh.formats.notes import DAMAGE, common_fields, plain_model
from lacmesh.mesh import Mesh

HOME, PLACE = "LACMESH", "notes"


def write(root: h5py.Group, mesh: Mesh, name: str) -> None:
    """Write the notes of a mesh that is called `name` in the file, if there is anything to note."""
    notes: dict[str, Any] = {}
    if mesh.zones:
        notes["zones"] = list(mesh.zones)
    if mesh.group_tags:
        notes["group_tags"] = {group: [list(tag) for tag in tags] for group, tags in mesh.group_tags.items()}
    if mesh.model is not None:
        notes["model"] = plain_model(mesh.model)
    if notes:
        content = json.dumps({"mesh": name, **notes}).encode()
        add_array(add_group(root, HOME), PLACE, np.frombuffer(content, np.uint8))


def read(root: Branch, name: str, n_nodes: int, said: list[str]) -> dict[str, Any]:
    """Read the fields `zones`, `group_tags` and `model` of the mesh `name`, as far as the file has them."""
    if not root.has(HOME):
        return {}
    raw = root.branch(HOME).raw(PLACE)
    try:
        notes = json.loads(raw)
        return common_fields(notes, n_nodes) if notes["mesh"] == name else {}
    except DAMAGE:
        said.append("lacmesh's own notes (group LACMESH) are damaged and left out")
        return {}
