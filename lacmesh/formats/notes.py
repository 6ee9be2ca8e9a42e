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
from collections.abc import Iterable, Iterator, Mapping, Sized
from dataclasses import replace
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD, Cut, with_records
from lacmesh.errors import CutError
from lacmesh.formats.ids import Index, repeated
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
from lacmesh.topology.skin import label_rows

#: Of the notes of every format.
VERSION = 2


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

# ---- one note for every format: what it has no place for, as one JSON object of plain arrays, by numbers of the file

#: what a damaged note may raise while it is read
DAMAGED = (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, OverflowError)
#: slave faces of a macro-element at most
_MOST_CHILDREN = 5


class UnfitError(Exception):
    """Records that do not belong to a mesh; the text is the reason, for a warning."""


def dump(
    mesh: Mesh,
    *names: str,
    faces: Ints | None = None,
    node_number: Ints | None = None,
    cell_number: Ints | None = None,
    **more: Any,
) -> str:
    """Text of a note, JSON in ASCII without a dollar sign: what a format has no place for; "" if there is nothing.

    `names`: of what is noted, among name, space_dim, zones, group_tags, steps, model and records (of a cut). `more`:
    plain values of the format's own. `node_number`, `cell_number`: those in the file, by default the mesh's. `faces`
    (k,): cells to which the file gives no numbers: the note of a cut has these.
    """
    nodes = numbered(mesh.node_number) if node_number is None else node_number
    cells = numbered(mesh.cell_number) if cell_number is None else cell_number
    derived = Mesh.create(mesh.points, [(b.type, b.nodes[:1]) for b in mesh.blocks]).space_dim
    boundary, periodic = ({}, ()) if mesh.model is None else (mesh.model.boundary, mesh.model.periodic)
    links = [[*p.slave, *p.master, [*p.affine], nodes[p.nodes].ravel().tolist()] for p in periodic]
    note = {
        "name": None if mesh.name == "mesh" else mesh.name,
        "space_dim": None if mesh.space_dim == derived else mesh.space_dim,
        "zones": mesh.zones,
        "group_tags": mesh.group_tags,
        "steps": {key: list(vars(step).values()) for key, step in mesh.steps.items()},
        "model": {"boundary": [[*tag, bounds] for tag, bounds in boundary.items()], "periodic": links},
        "records": _records(mesh, nodes, cells, faces) if "records" in names else None,
    }
    note = {key: note[key] for key in names} | more
    if not boundary and not periodic:
        note.pop("model", None)
    note = {
        key: value
        for key, value in note.items()
        if not (value is None or (isinstance(value, Sized) and not len(value)))
    }
    text = json.dumps({"version": VERSION, **note}, separators=(",\n", ":"), default=_plain)
    return text.replace("$", "\\u0024") if note else ""


def in_lines(text: str, width: int = 160) -> list[str]:
    """Split a note into lines, most of them of `width` letters at most; joined, they are the note again.

    >>> in_lines(dump(Mesh.create([[0, 0]], [], name="block", zones=("a", "b")), "zones", "name"), 20)
    ['{"version":1,', '"zones":["a","b"],', '"name":"block"}']
    """
    lines = [""]
    for part in text.split("\n"):
        if lines[-1] and len(lines[-1]) + len(part) > width:
            lines.append("")
        lines[-1] += part
    return lines


def parse(text: str | bytes) -> dict[str, Any]:
    """Return the note in a text, {} if a newer lacmesh wrote it. Raises ValueError if it is damaged."""
    try:
        note: dict[str, Any] = json.loads(text)
        if note.get("version", 1) < VERSION:
            note.pop("model", None)  # whose nodes were given by index
        return note if note.get("version", 1) <= VERSION else {}
    except DAMAGED as error:
        raise ValueError(str(error)) from error


def load(mesh: Mesh, note: Mapping[str, Any], warnings: list[str]) -> Mesh:
    """Return a mesh with what its note says; what does not fit is left out, with a clause in `warnings`.

    Groups and data that the mesh lacks, since another program took them out, are passed without a word.
    """
    try:
        mesh = replace(mesh, **_noted_fields(mesh, note))
    except DAMAGED:
        warnings.append("lacmesh's own note is damaged and left out")
        return mesh
    if "records" not in note:
        return mesh
    try:
        return _with_records(mesh, note["records"])
    except UnfitError as error:
        warnings.append(f"the records of the cut are left out: {error}")
    except (*DAMAGED, CutError):
        warnings.append("the records of the cut are left out: they are damaged")
    return replace(mesh, zones=())


def numbered(number: Ints) -> Ints:
    """The numbers of nodes or cells; 1, 2 ... if they are not positive and distinct."""
    return number if number.min(initial=1) > 0 and repeated(number) is None else np.arange(1, len(number) + 1)


def integers(values: Any, shape: tuple[int, ...] = (-1,)) -> Ints:
    """Return a list of integers of a note as an array. Raises ValueError for anything else in it."""
    array = np.array(values)
    if array.size and array.dtype != np.int64:
        raise ValueError("a list should hold integers only")
    return array.astype(np.int64).reshape(shape)


def _plain(value: Any) -> Any:
    """Value of a note that JSON does not know: an array or a number of numpy."""
    return value.tolist()


def _noted_fields(mesh: Mesh, note: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a mesh in its note. Raises one of DAMAGED."""
    fields: dict[str, Any] = {}
    if "name" in note:
        fields["name"] = str(note["name"])
    if "space_dim" in note:
        fields["space_dim"] = (1, 2, 3)[(1, 2, 3).index(note["space_dim"])]
    if "zones" in note:
        fields["zones"] = tuple(map(str, note["zones"]))
    if "group_tags" in note:
        tags = {name: [tuple(integers(tag).tolist()) for tag in tags] for name, tags in note["group_tags"].items()}
        if any(len(tag) != 2 for own in tags.values() for tag in own):
            raise ValueError("a tag is a dimension and a number")
        fields["group_tags"] = {name: tuple(own) for name, own in tags.items() if name in mesh.cell_groups}
    if "steps" in note:
        steps = {key: Step(str(f), int(n), int(order), float(t)) for key, (f, n, order, t) in note["steps"].items()}
        known = {*mesh.cell_data, *mesh.node_data}
        fields["steps"] = {key: step for key, step in steps.items() if key in known}
    if "model" in note:
        fields["model"] = Model(boundary_of(note["model"]["boundary"]), tuple(_links(mesh, note["model"]["periodic"])))
    return fields


def boundary_of(rows: Iterable[Any]) -> dict[Tag, tuple[int, ...]]:
    """Boundary of entities in a note: rows of dimension, tag and signed tags. Raises one of DAMAGED."""
    return {(int(dim), int(tag)): tuple(integers(signed).tolist()) for dim, tag, signed in rows}


def _links(mesh: Mesh, rows: Iterable[Any]) -> Iterator[Periodic]:
    index = Index(numbered(mesh.node_number))
    for *tags, affine, number in rows:
        slave, slave_tag, master, master_tag = integers(tags).tolist()
        pairs = index.places(integers(number, (-1, 2)))
        there = pairs[(pairs >= 0).all(axis=1)]
        yield Periodic((slave, slave_tag), (master, master_tag), tuple(map(float, affine)), there)


def _records(mesh: Mesh, nodes: Ints, cells: Ints, faces: Ints | None) -> dict[str, Any] | None:
    """The records of a cut by numbers; None of a mesh that has none, or other data of these names."""
    try:
        cut = Cut(mesh)
    except CutError:
        return None
    if any(
        values.ndim > 1 or values.dtype.kind not in "iu" for values in (*cut.cell_records.values(), cut.macro_of_node)
    ):
        return None
    has = np.flatnonzero(np.any([values >= 0 for values in cut.cell_records.values()], axis=0))
    inner = np.flatnonzero(cut.macro_of_node >= 0)
    return {
        "nodes": mesh.n_nodes,
        "bodies": int((mesh.cell_dim == mesh.dim).sum()),
        "digest": _digest(mesh, has, nodes, cells),
        "faces": {
            kind: {"number": cells[own], "nodes": nodes[rows].ravel()}
            for kind, own, rows in (mesh.select(faces) if faces is not None else ())
        },
        "cells": {"number": cells[has], **{name: values[has] for name, values in cut.cell_records.items()}},
        "internal": {"number": nodes[inner], NODE_RECORD: cut.macro_of_node[inner]},
    }


def _with_records(mesh: Mesh, note: Mapping[str, Any]) -> Mesh:
    """The mesh with the records of a cut. Raises UnfitError, CutError, one of DAMAGED."""
    bodies = int((mesh.cell_dim == mesh.dim).sum())
    if (note["nodes"], note["bodies"]) != (mesh.n_nodes, bodies):
        raise UnfitError(
            f"they are of {note['nodes']} nodes and {note['bodies']} cells of bodies, and the file has "
            f"{mesh.n_nodes} and {bodies}"
        )
    mesh = _with_numbers(mesh, note["faces"])
    columns = {key: integers(values) for key, values in note["cells"].items()}
    inner = {key: integers(values) for key, values in note["internal"].items()}
    at = Index(mesh.cell_number).places(columns["number"])
    at_node = Index(mesh.node_number).places(inner["number"])
    if (at < 0).any() or (at_node < 0).any() or note["digest"] != _digest(mesh, at, mesh.node_number, mesh.cell_number):
        raise UnfitError("they are of other cells than those of the file")
    data: dict[str, Ints] = {}
    for name in CELL_RECORDS:
        narrow = columns[name].max(initial=-1) < 2**31
        data[name] = np.full(mesh.n_cells, -1, np.int32 if narrow else np.int64)
        data[name][at] = columns[name]
    internal = np.full(mesh.n_nodes, -1, np.int32)
    internal[at_node] = inner[NODE_RECORD]
    whole = with_records(mesh, data, internal, mesh.zones)
    cut = Cut(whole)
    child = cut.child_kind[cut.macro_of_face >= 0]
    if min(map(len, cut.faces_of_macro)) < 1 or child.min() < 1 or child.max() > _MOST_CHILDREN:
        raise ValueError("records that no cut leaves")
    return whole


def _with_numbers(mesh: Mesh, faces: Mapping[str, Any]) -> Mesh:
    """The mesh with the numbers that its note has of some cells, by their nodes. Raises UnfitError."""
    number = mesh.cell_number.astype(np.int64)
    index = Index(numbered(mesh.node_number))
    for kind, listed in faces.items():
        theirs = index.places(integers(listed["nodes"], (-1, ALL_CELLS[kind].n_nodes)))
        own = np.flatnonzero(np.repeat([b.type == kind for b in mesh.blocks], np.diff(mesh.offsets)))
        rows = np.sort(np.concatenate([theirs, mesh.block(kind)]), axis=1)
        label, _ = label_rows(rows)
        keys = _distinct_keys(label[: len(theirs)]), _distinct_keys(label[len(theirs) :])
        _, a, b = np.intersect1d(*keys, assume_unique=True, return_indices=True)
        number[own[b]] = integers(listed["number"])[a]
    if repeated(number) is not None:
        raise UnfitError("the file gives their numbers to other cells")
    return replace(mesh, cell_number=number)


def _distinct_keys(label: Ints) -> Ints:
    """Distinct integers of labels (k,): of equal labels the first, second ... get the same in all calls."""
    order = np.argsort(label, kind="stable")
    begin = np.flatnonzero(np.diff(label[order], prepend=-1))
    place = np.arange(len(label)) - np.repeat(begin, np.diff(np.append(begin, len(label))))
    keys = np.empty(len(label), np.int64)
    keys[order] = label[order].astype(np.int64) << 32 | place
    return keys


def _digest(mesh: Mesh, cells: Ints, node_number: Ints, cell_number: Ints) -> int:
    """Checksum of the nodes, by number and in any order, of some cells, in the order of their numbers."""
    digest = 0
    for kind, _, rows in sorted(mesh.select(cells[np.argsort(cell_number[cells])]), key=lambda part: part[0]):
        digest = crc32(np.sort(node_number[rows], axis=1).astype("<i8").tobytes(), crc32(kind.encode(), digest))
    return digest
