"""Notes as JSON text on what most formats have no place for: a mesh's name, zones, group tags, steps, geometry model.

A format that keeps text can keep them. The names and shapes of its arrays are added to them (`arrays.py`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints, Mesh, Model, Periodic, Step, Tag

VERSION = 1
#: What a damaged text may raise while it is read.
DAMAGE = (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, OverflowError)


def to_json(mesh: Mesh, **rest: Any) -> str:
    """Notes of a mesh, the names of its zones included, and the entries `rest`, as JSON text."""
    notes: dict[str, Any] = {"version": VERSION, "name": mesh.name, "space_dim": mesh.space_dim}
    if mesh.zones:
        notes["zones"] = list(mesh.zones)
    if mesh.group_tags:
        notes["group_tags"] = {group: [list(map(int, t)) for t in tags] for group, tags in mesh.group_tags.items()}
    if mesh.steps:
        notes["steps"] = {key: [s.field, s.number, s.order, s.time] for key, s in mesh.steps.items()}
    if mesh.model is not None:
        notes["model"] = plain_model(mesh.model)
    notes |= {key: value for key, value in rest.items() if value}
    return json.dumps(notes, ensure_ascii=True)


def from_json(text: str, n_nodes: int, said: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Mesh fields in the notes, and the notes themselves; both empty, with a message in `said`, if they are damaged."""
    try:
        notes = json.loads(text)
        if notes["version"] > VERSION:
            said.append("the notes of a newer lacmesh are left out")
            return {}, {}
        return _fields(notes, n_nodes), notes
    except DAMAGE:
        said.append("lacmesh's own notes are damaged and left out")
        return {}, {}


def zone_names(cell_data: Mapping[str, NDArray], cell_groups: Mapping[str, Ints]) -> tuple[str, ...]:
    """Names of the zones of a cut: of the smallest group whose slave faces are the zone's, else zone1, zone2, ..."""
    zone, macro = (cell_data.get(name) for name in ("lac_zone", "lac_macro"))
    if zone is None or macro is None or zone.ndim != 1 or macro.ndim != 1:
        return ()
    cut = np.flatnonzero((macro >= 0) & (zone >= 0))
    cells = {int(z): cut[zone[cut] == z] for z in np.unique(zone[cut])}
    if max(cells, default=-1) >= len(cut):
        return ()
    names = {}
    for name, members in sorted(cell_groups.items(), key=lambda g: (len(g[1]), g[0]), reverse=True):
        inside = members[macro[members] >= 0]
        first = int(zone[inside[0]]) if len(inside) else -1
        if first in cells and np.array_equal(inside, cells[first]):
            names[first] = name
    return tuple(names.get(k, f"zone{k + 1}") for k in range(max(cells, default=-1) + 1))


def fitting(mesh: Mesh) -> Mesh:
    """The mesh without tags of groups that it does not have, as noted before another program removed them."""
    if all(name in mesh.cell_groups for name in mesh.group_tags):
        return mesh
    return replace(mesh, group_tags={name: t for name, t in mesh.group_tags.items() if name in mesh.cell_groups})


def plain_model(model: Model) -> dict[str, Any]:
    """Geometry model of msh as plain JSON data."""
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


def _fields(notes: dict[str, Any], n_nodes: int) -> dict[str, Any]:
    fields: dict[str, Any] = {"name": str(notes.get("name", "mesh"))}
    if notes.get("space_dim") in (1, 2, 3):
        fields["space_dim"] = int(notes["space_dim"])
    fields |= common_fields(notes, n_nodes)
    if "steps" in notes:
        fields["steps"] = {
            str(key): Step(str(name), int(number), int(order), float(time))
            for key, (name, number, order, time) in notes["steps"].items()
        }
    return fields


def common_fields(notes: Mapping[str, Any], n_nodes: int) -> dict[str, Any]:
    """The fields `zones`, `group_tags` and `model` of a mesh, as far as notes have them. Raises one of DAMAGE."""
    fields: dict[str, Any] = {}
    if "zones" in notes:
        fields["zones"] = tuple(str(zone) for zone in notes["zones"])
    if "group_tags" in notes:
        fields["group_tags"] = {str(g): tuple(_tag(t) for t in tags) for g, tags in notes["group_tags"].items()}
    if "model" in notes:
        boundary = {_tag(b[:2]): tuple(int(e) for e in b[2:]) for b in notes["model"]["boundary"]}
        fields["model"] = Model(boundary, tuple(_periodic(p, n_nodes) for p in notes["model"]["periodic"]))
    return fields


def _tag(pair: Any) -> Tag:
    dim, tag = pair
    return int(dim), int(tag)


def _periodic(noted: dict[str, Any], n_nodes: int) -> Periodic:
    nodes = np.array(noted["nodes"], dtype=np.int64).reshape(-1, 2)
    if nodes.size and (nodes.min() < 0 or nodes.max() >= n_nodes):
        raise ValueError("a periodic node outside the mesh")
    return Periodic(_tag(noted["slave"]), _tag(noted["master"]), tuple(float(a) for a in noted["affine"]), nodes)
