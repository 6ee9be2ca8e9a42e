"""Our own notes in a MED file: what a mesh has and MED has not, as JSON in the group LACMESH at the root.

libmed, medcoupling and gmsh leave that group alone (and drop it when they write). The notes are the names of a cut's
zones, msh's tags of the groups, and msh's model; where they are gone, the zones' names are derived from the groups.
"""

from __future__ import annotations

import json
from typing import Any

import h5py
import numpy as np

from lacmesh.formats.med.hdf5 import Branch, add_array, add_group
from lacmesh.mesh import Mesh, Model, Periodic, Tag

HOME, PLACE = "LACMESH", "notes"


def write(root: h5py.Group, mesh: Mesh, name: str) -> None:
    """Write the notes of a mesh that is called `name` in the file, where there is anything to note."""
    notes: dict[str, Any] = {}
    if mesh.zones:
        notes["zones"] = list(mesh.zones)
    if mesh.group_tags:
        notes["group_tags"] = {group: [list(tag) for tag in tags] for group, tags in mesh.group_tags.items()}
    if mesh.model is not None:
        notes["model"] = _plain(mesh.model)
    if notes:
        content = json.dumps({"mesh": name, **notes}).encode()
        add_array(add_group(root, HOME), PLACE, np.frombuffer(content, np.uint8))


def _plain(model: Model) -> dict[str, Any]:
    return {
        "boundary": [[*map(int, tag), *map(int, entities)] for tag, entities in model.boundary.items()],
        "periodic": [
            {
                "slave": [int(n) for n in p.slave],
                "master": [int(n) for n in p.master],
                "affine": [float(a) for a in p.affine],
                "nodes": np.asarray(p.nodes).tolist(),
            }
            for p in model.periodic
        ],
    }


def read(root: Branch, name: str, n_nodes: int, said: list[str]) -> dict[str, Any]:
    """The fields `zones`, `group_tags` and `model` of the mesh `name`, as far as the file has them."""
    if not root.has(HOME):
        return {}
    raw = root.branch(HOME).raw(PLACE)
    try:
        notes = json.loads(raw)
        return _fields(notes, n_nodes) if notes["mesh"] == name else {}
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, OverflowError):
        said.append("lacmesh's own notes (group LACMESH) are damaged and left out")
        return {}


def _fields(notes: dict[str, Any], n_nodes: int) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    if "zones" in notes:
        fields["zones"] = tuple(str(zone) for zone in notes["zones"])
    if "group_tags" in notes:
        fields["group_tags"] = {str(g): tuple(_tag(t) for t in tags) for g, tags in notes["group_tags"].items()}
    if "model" in notes:
        boundary = {_tag(b[:2]): tuple(int(e) for e in b[2:]) for b in notes["model"]["boundary"]}
        periodic = tuple(_periodic(p, n_nodes) for p in notes["model"]["periodic"])
        fields["model"] = Model(boundary, periodic)
    return fields


def _tag(pair: Any) -> Tag:
    dim, tag = pair
    return int(dim), int(tag)


def _periodic(noted: dict[str, Any], n_nodes: int) -> Periodic:
    nodes = np.array(noted["nodes"], dtype=np.int64).reshape(-1, 2)
    if nodes.size and (nodes.min() < 0 or nodes.max() >= n_nodes):
        raise ValueError("a periodic node outside the mesh")
    return Periodic(_tag(noted["slave"]), _tag(noted["master"]), tuple(float(a) for a in noted["affine"]), nodes)
