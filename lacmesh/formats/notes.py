"""Notes: data of a mesh that a format has no place for, as JSON in its files; one description of all of them.

A table lists the notes of a kind of file: the name of each, and how its value becomes JSON and is checked when it is
read. A format only stores and fetches the text:

    ARRAY_NOTES     VTU, XDMF, objects of pyvista and meshio: what named arrays on cells and nodes do not hold
    MED_NOTES       MED: the root group LACMESH (`med/notes.py`)
    MSH_NOTES       msh, and gmsh's model: the section $LacMesh (`msh/notes.py`)
    CUT_NOTES       formats without fields: the records of a cut, in the sidecar (`sidecar.py`)

In the first two, nodes and cells are given by their index, in the others by their numbers in the file.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.note_types import (
    DAMAGE,
    FLAG,
    INTEGER,
    INTEGERS,
    PAIRS,
    REAL,
    TEXT,
    NoteTable,
    columns,
    from_plain,
    mapping_of,
    named,
    object_of,
    optional,
    record_of,
    to_plain,
    tuple_of,
)
from lacmesh.mesh import Ints, Mesh, Model, Periodic, Step, Tag

#: Of the notes of every format.
VERSION = 1


class FieldNote(NamedTuple):
    """Properties of a field that a section of msh cannot hold: its key in the mesh, true name and step, shape, type."""

    key: str
    name: str
    number: int
    order: int
    shape: tuple[int, ...] | None
    integer: bool


class CellsNote(NamedTuple):
    """Cells of a type that msh lacks: numbers (k,), nodes (k, n) by number, entities (k, 2), places in the file."""

    type: str
    number: Ints
    nodes: Ints
    entity: Ints
    at: Ints


def to_json(mesh: Mesh, more: Mapping[str, Any]) -> str:
    """JSON text of the ARRAY_NOTES of a mesh; `more`: those that belong to its arrays."""
    return json.dumps({"version": VERSION, **to_plain({**_of_mesh(mesh), **more}, ARRAY_NOTES)}, ensure_ascii=True)


def from_json(text: str, n_nodes: int, said: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Mesh fields in the ARRAY_NOTES, and these notes; both empty, with a message in `said`, if they are damaged."""
    try:
        data = json.loads(text)
        if data["version"] > VERSION:
            said.append("the notes of a newer lacmesh are left out")
            return {}, {}
        notes = from_plain(data, ARRAY_NOTES)
        return {"name": "mesh", **mesh_fields(notes, n_nodes)}, notes
    except DAMAGE:
        said.append("lacmesh's own notes are damaged and left out")
        return {}, {}


def mesh_fields(notes: Mapping[str, Any], n_nodes: int) -> dict[str, Any]:
    """The notes that are fields of a mesh. Raises ValueError for a periodic link of nodes that the mesh lacks."""
    fields = {key: value for key, value in notes.items() if key in _MESH_NOTES}
    for link in fields["model"].periodic if "model" in fields else ():
        if link.nodes.size and (link.nodes.min() < 0 or link.nodes.max() >= n_nodes):
            raise ValueError("a periodic node outside the mesh")
    return fields


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


def _of_mesh(mesh: Mesh) -> dict[str, Any]:
    return {key: getattr(mesh, key) for key in _MESH_NOTES}


def _space_dim(dim: int) -> int:
    if dim not in (1, 2, 3):
        raise ValueError("space_dim is not 1, 2 or 3")
    return dim


def _bounded(row: tuple[int, ...]) -> tuple[Tag, tuple[int, ...]]:
    """Entity and its signed boundary, which follow one another in a row."""
    dim, tag, *signed = row
    return (dim, tag), tuple(signed)


def _cells_note(parts: dict[str, Any]) -> CellsNote:
    if parts["type"] not in ALL_CELLS:
        raise ValueError(f"there is no cell type {parts['type']!r}")
    parts["nodes"] = parts["nodes"].reshape(-1, ALL_CELLS[parts["type"]].n_nodes)
    return CellsNote(**parts)


def _plain_fields(notes: Mapping[tuple[str, str, int], FieldNote]) -> list[dict[str, Any]]:
    return [{"on": on, "field": name, "step": step, **note._asdict()} for (on, name, step), note in notes.items()]


def _field_notes(entries: tuple[dict[str, Any], ...]) -> dict[tuple[str, str, int], FieldNote]:
    return {(e.pop("on"), e.pop("field"), e.pop("step")): FieldNote(**e) for e in entries}


_TAG = record_of(INTEGER, INTEGER)
_TAGS = tuple_of(_TAG)
_STEP = record_of(TEXT, INTEGER, INTEGER, REAL).through(lambda step: vars(step).values(), lambda row: Step(*row))
_PERIODIC = object_of(slave=_TAG, master=_TAG, affine=tuple_of(REAL), nodes=PAIRS)
_MODEL = object_of(
    boundary=tuple_of(tuple_of(INTEGER)).through(
        lambda boundary: [(*tag, *signed) for tag, signed in boundary.items()],
        lambda rows: dict(map(_bounded, rows)),
    ),
    periodic=tuple_of(_PERIODIC.through(vars, lambda parts: Periodic(**parts))),
)
_ROWS_OF_3 = INTEGERS.through(np.asarray, lambda values: values.reshape(-1, 3))
_PAIRS_IN_A_ROW = INTEGERS.through(np.asarray, lambda values: values.reshape(-1, 2))
_CELLS = object_of(type=TEXT, number=INTEGERS, nodes=INTEGERS, entity=_PAIRS_IN_A_ROW, at=INTEGERS)
_FIELD = object_of(
    on=TEXT,
    field=TEXT,
    step=INTEGER,
    key=TEXT,
    name=TEXT,
    number=INTEGER,
    order=INTEGER,
    shape=optional(tuple_of(INTEGER)),
    integer=FLAG,
)

#: Notes that are fields of a mesh, in formats where all else is in arrays.
_MESH_NOTES: NoteTable = {
    "name": TEXT,
    "space_dim": INTEGER.through(int, _space_dim),
    "zones": tuple_of(TEXT),
    "group_tags": mapping_of(_TAGS),
    "steps": mapping_of(_STEP),
    "model": _MODEL.through(vars, lambda parts: Model(**parts)),
}
ARRAY_NOTES: NoteTable = {
    **_MESH_NOTES,
    #: on "cell" or "node": the true names of arrays, and the shape of their rows if these have several dimensions
    "names": mapping_of(mapping_of(TEXT)),
    "shapes": mapping_of(mapping_of(tuple_of(INTEGER))),
    #: of XDMF: arrays that the writer added, and those of all groups
    "own": tuple_of(TEXT),
    "groups": tuple_of(TEXT),
    #: of meshio's objects
    "file_order": INTEGERS,
}
MED_NOTES: NoteTable = {"mesh": TEXT, **{key: _MESH_NOTES[key] for key in ("zones", "group_tags", "model")}}
MSH_NOTES: NoteTable = {
    #: how many the mesh has for which the numbers are meant
    "nodes": INTEGER,
    "cells": INTEGER,
    **{key: _MESH_NOTES[key] for key in ("name", "space_dim", "zones")},
    "groups": named("tags", _TAGS),
    "node_groups": named("nodes", INTEGERS),
    "cell_groups": named("cells", INTEGERS),
    "extra_cells": tuple_of(_CELLS.through(CellsNote._asdict, _cells_note)),
    "node_entity": _ROWS_OF_3,
    "boundary": tuple_of(record_of(INTEGER, INTEGER, tuple_of(INTEGER))).through(
        lambda boundary: [(*tag, signed) for tag, signed in boundary.items()],
        lambda rows: {(dim, tag): signed for dim, tag, signed in rows},
    ),
    "fields": tuple_of(_FIELD).through(_plain_fields, _field_notes),
}
CUT_NOTES: NoteTable = {
    "nodes": INTEGER,
    "cells": mapping_of(INTEGER),
    "digest": TEXT,
    "zones": tuple_of(TEXT),
    #: slave faces and children by number: macro-element, zone, place among the children of a face, parent's number
    "children": columns("cell", "macro", "zone", "child", "parent"),
    "internal": columns("node", "macro"),
}
