"""Notes of lacmesh in a MED file: data of a mesh that MED has no place for, as JSON in the root group LACMESH.

libmed, medcoupling and gmsh leave that group alone (and drop it when they write). The notes (`formats.notes.MED_NOTES`)
are the names of a cut's zones, msh's tags of the groups, and msh's model; where they are gone, the zones' names are
derived from the groups.
"""

from __future__ import annotations

import json
from typing import Any

import h5py
import numpy as np

from lacmesh.formats.med.hdf5 import Branch, add_array, add_group
from lacmesh.formats.note_types import DAMAGE, from_plain, to_plain
from lacmesh.formats.notes import MED_NOTES, mesh_fields
from lacmesh.mesh import Mesh

HOME, PLACE = "LACMESH", "notes"


def write(root: h5py.Group, mesh: Mesh, name: str) -> None:
    """Write the notes of a mesh that is called `name` in the file, if there is anything to note."""
    notes = {"mesh": name, "zones": mesh.zones, "group_tags": mesh.group_tags, "model": mesh.model}
    plain = to_plain(notes, MED_NOTES)
    if len(plain) > 1:
        content = json.dumps(plain).encode()
        add_array(add_group(root, HOME), PLACE, np.frombuffer(content, np.uint8))


def read(root: Branch, name: str, n_nodes: int, said: list[str]) -> dict[str, Any]:
    """Read the fields `zones`, `group_tags` and `model` of the mesh `name`, as far as the file has them."""
    if not root.has(HOME):
        return {}
    raw = root.branch(HOME).raw(PLACE)
    try:
        notes = from_plain(json.loads(raw), MED_NOTES)
        return mesh_fields(notes, n_nodes) if notes["mesh"] == name else {}
    except DAMAGE:
        said.append("lacmesh's own notes (group LACMESH) are damaged and left out")
        return {}
