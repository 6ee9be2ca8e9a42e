"""The note of a file: what its format has no place for, as one JSON object of plain arrays, in ASCII.

Every format keeps it where it can: VTU, XDMF, meshio and MED in a place for texts, msh in a section of its own, .inp
and .mail in comments. Nodes and cells are named by their numbers in the file.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sized
from dataclasses import replace
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD, Cut, with_records, without_records
from lacmesh.errors import CutError
from lacmesh.indices import Index, numbered, repeated
from lacmesh.mesh import Ints, Mesh, Model, Periodic, Step, Tag

#: of the notes of every format; in version 1 the nodes of periodic links were given by index
VERSION = 2
#: what a damaged note may raise while it is read
DAMAGED = (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError, OverflowError)


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
        "model": {"boundary": [[*t, b] for t, b in boundary.items()], "periodic": links} if boundary or links else None,
        "records": _records(mesh, nodes, cells, faces) if "records" in names else None,
    }
    note = {key: note[key] for key in names} | more
    note = {
        key: value
        for key, value in note.items()
        if not (value is None or (isinstance(value, Sized) and not len(value)))
    }
    text = json.dumps({"version": VERSION, **note}, separators=(",\n", ":"), default=lambda value: value.tolist())
    return text.replace("$", "\\u0024") if note else ""


def in_lines(text: str, width: int = 160) -> list[str]:
    """Split a note into lines, most of them of `width` letters at most; joined, they are the note again.

    >>> in_lines(dump(Mesh.create([[0, 0]], [], name="block", zones=("a", "b")), "zones", "name"), 20)
    ['{"version":2,', '"zones":["a","b"],', '"name":"block"}']
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
        mesh = replace(mesh, **noted_fields(mesh, note))
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


def integers(values: Any, shape: tuple[int, ...] = (-1,)) -> Ints:
    """Return a list of integers of a note as an array. Raises ValueError for anything else in it."""
    array = np.array(values)
    if array.size and array.dtype != np.int64:
        raise ValueError("a list should hold integers only")
    return array.astype(np.int64).reshape(shape)


def text_of(value: Any) -> str:
    """Return a text of a note. Raises TypeError for anything else."""
    if not isinstance(value, str):
        raise TypeError(f"{str(value)[:40]!r} should be text")
    return value


def noted_fields(mesh: Mesh, note: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a mesh in its note. Raises one of DAMAGED."""
    fields: dict[str, Any] = {}
    if "name" in note:
        fields["name"] = text_of(note["name"])
    if "space_dim" in note:
        (fields["space_dim"],) = integers([note["space_dim"]]).tolist()
        if fields["space_dim"] not in (1, 2, 3):
            raise ValueError("space_dim is not 1, 2 or 3")
    if "zones" in note:
        fields["zones"] = tuple(map(text_of, [*note["zones"]]))
    if "group_tags" in note:
        tags = {name: [tuple(integers(tag).tolist()) for tag in tags] for name, tags in note["group_tags"].items()}
        if any(len(tag) != 2 for pairs in tags.values() for tag in pairs):
            raise ValueError("a tag is a dimension and a number")
        fields["group_tags"] = {name: tuple(pairs) for name, pairs in tags.items() if name in mesh.cell_groups}
    if "steps" in note:
        steps = {}
        for key, (name, number, order, time) in note["steps"].items():
            number, order = integers([number, order]).tolist()
            steps[key] = Step(text_of(name), number, order, float(time))
        known = {*mesh.cell_data, *mesh.node_data}
        fields["steps"] = {key: step for key, step in steps.items() if key in known}
    if "model" in note:
        index, links = Index(numbered(mesh.node_number)), []
        for *sides, affine, number in note["model"]["periodic"]:
            slave, slave_tag, master, master_tag = integers(sides).tolist()
            pairs = index.places(integers(number, (-1, 2)))
            there = pairs[(pairs >= 0).all(axis=1)]
            links.append(Periodic((slave, slave_tag), (master, master_tag), tuple(map(float, affine)), there))
        fields["model"] = Model(boundary_of(note["model"]["boundary"]), tuple(links))
    return fields


def boundary_of(rows: Iterable[Any]) -> dict[Tag, tuple[int, ...]]:
    """Boundary of entities in a note: rows of dimension, tag and signed tags. Raises one of DAMAGED."""
    return {tuple(integers([dim, tag]).tolist()): tuple(integers(signed, (-1,)).tolist()) for dim, tag, signed in rows}


def _records(mesh: Mesh, nodes: Ints, cells: Ints, faces: Ints | None) -> dict[str, Any] | None:
    """The records of a cut by numbers; None of a mesh that has none, or other data of these names."""
    try:
        cut = Cut(mesh)
    except CutError:
        return None
    records = {name: mesh.cell_data[name] for name in CELL_RECORDS if name in mesh.cell_data}
    if any(values.ndim > 1 or values.dtype.kind not in "iu" for values in (*records.values(), cut.macro_of_node)):
        return None
    has = np.flatnonzero(np.any([values >= 0 for values in records.values()], axis=0))
    inner = np.flatnonzero(cut.macro_of_node >= 0)
    columns = {"number": cells[has], **{name: values[has] for name, values in records.items()}}
    internal = {"number": nodes[inner], NODE_RECORD: cut.macro_of_node[inner]}
    return {
        "nodes": mesh.n_nodes,
        "bodies": int((mesh.cell_dim == mesh.dim).sum()),
        "digest": _digest(mesh, has, nodes, cells, columns, internal),
        "faces": {
            kind: {"number": cells[rows_of], "nodes": nodes[rows].ravel()}
            for kind, rows_of, rows in (mesh.select(faces) if faces is not None else ())
        },
        "cells": columns,
        "internal": internal,
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
    columns = {name: integers(note["cells"][name]) for name in ("number", *CELL_RECORDS) if name in note["cells"]}
    inner = {name: integers(note["internal"][name]) for name in ("number", NODE_RECORD)}
    at, at_node = Index(mesh.cell_number).places(columns["number"]), Index(mesh.node_number).places(inner["number"])
    known = (at >= 0).all() and (at_node >= 0).all()
    if not known or note["digest"] != _digest(mesh, at, mesh.node_number, mesh.cell_number, columns, inner):
        raise UnfitError("they are of other cells than those of the file, or were changed")
    data: dict[str, Ints] = {}
    for name in columns.keys() - {"number"}:
        narrow = columns[name].max(initial=-1) < 2**31
        data[name] = np.full(mesh.n_cells, -1, np.int32 if narrow else np.int64)
        data[name][at] = columns[name]
    internal = np.full(mesh.n_nodes, -1, np.int32)
    internal[at_node] = inner[NODE_RECORD]
    whole = with_records(mesh, data, internal, mesh.zones)
    cut = Cut(whole)
    macro, child = (values[cut.macro_of_face >= 0] for values in (cut.macro_of_face, cut.child_kind))
    size = np.bincount(macro) if cut.n_macros <= len(macro) else np.zeros(1, np.int64)
    if not size.all() or child.min() < 1 or (child > size[macro]).any() or internal.max() >= cut.n_macros:
        raise ValueError("records that no cut leaves")
    return whole


def _with_numbers(mesh: Mesh, faces: Mapping[str, Any]) -> Mesh:
    """The mesh with the numbers that its note has of some cells, by their nodes. Raises UnfitError."""
    number = mesh.cell_number.astype(np.int64)
    index = Index(numbered(mesh.node_number))
    for kind, listed in faces.items():
        theirs = index.places(integers(listed["nodes"], (-1, ALL_CELLS[kind].n_nodes)))
        cells = np.flatnonzero(np.repeat([b.type == kind for b in mesh.blocks], np.diff(mesh.offsets)))
        on: dict[tuple[int, ...], list[int]] = {}  # cells on the same nodes
        for cell, row in zip(cells.tolist(), np.sort(mesh.block(kind), axis=1).tolist(), strict=True):
            on.setdefault(tuple(row), []).append(cell)
        numbers = integers(listed["number"]).tolist()
        for row, own in zip(np.sort(theirs, axis=1).tolist(), numbers, strict=True):
            if there := on.get(tuple(row)):
                number[there.pop(0)] = own
    if repeated(number) is not None:
        raise UnfitError("the file gives their numbers to other cells")
    return replace(mesh, cell_number=number)


def _digest(mesh: Mesh, cells: Ints, node_number: Ints, cell_number: Ints, *columns: Mapping[str, Ints]) -> int:
    """Checksum of records, and of the cells that have them: nodes by number, in any order; by the cells' numbers."""
    digest = crc32("\n".join(mesh.zones).encode(errors="surrogateescape"))
    for values in (values for table in columns for values in table.values()):
        digest = crc32(values.astype("<i8").tobytes(), digest)
    for kind, _, rows in sorted(mesh.select(cells[np.argsort(cell_number[cells])]), key=lambda part: part[0]):
        digest = crc32(np.sort(node_number[rows], axis=1).astype("<i8").tobytes(), crc32(kind.encode(), digest))
    return digest


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


def left_out(mesh: Mesh) -> list[str]:
    """Clauses that name what a format of nodes, cells and groups loses of a mesh; records of a cut go into a note."""
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
    clauses = [f"fields are left out: {', '.join(fields)}"] if fields else []
    clauses += [f"the zones of the cut are left out: {', '.join(mesh.zones)}"] if mesh.zones else []
    of_gmsh = [what for what, there in has.items() if there]
    return clauses + ([f"what only gmsh knows is left out: {', '.join(of_gmsh)}"] if of_gmsh else [])
