"""Sidecar of a mesh file without fields: the records of its cut in JSON, `part.inp.lac.json` beside `part.inp`.

It names cells and nodes by the numbers that they have when the mesh file is read: writers renumber, and faces of
*SURFACEs get their numbers from the reader. The mesh file is therefore read back before its records are written. A
digest of the records and of the cells that have them ties the sidecar to its mesh file; if it does not match, the
records are left out.
"""

from __future__ import annotations

import json
import re
import warnings
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting import records
from lacmesh.cutting.records import CELL_RECORDS, Cut, is_cut
from lacmesh.errors import CutError, LacmeshWarning
from lacmesh.formats.ids import Index
from lacmesh.formats.note_types import DAMAGE, INTEGER, from_plain, to_plain
from lacmesh.formats.notes import CUT_NOTES, VERSION
from lacmesh.formats.round_trip import match
from lacmesh.mesh import Ints, Mesh, distinct
from lacmesh.topology.skin import label_rows

SUFFIX = ".lac.json"
_WHAT = "records of a cut"
_OURS = re.compile(rb'\s*\{\s*"lacmesh"\s*:\s*"records of a cut"')
#: the columns of `children`, after the cells' numbers, that hold the CELL_RECORDS
_COLUMNS = ("macro", "zone", "child", "parent")
#: slave faces of a macro-element at most
_MAX_CHILD = 5
#: more bytes than a whole file's, and a cell's or node's, records can have
_ROOM, _ROOM_EACH = 1 << 20, 100


class UnfitError(Exception):
    """Records that do not belong to a mesh file; the text is the reason, for a warning."""


def place_of(path: Path) -> Path:
    """Path of the sidecar that holds the cut records of a mesh file."""
    return path.with_name(path.name + SUFFIX)


def is_ours(path: Path) -> bool:
    """True if a file begins as a sidecar of lacmesh does; False if it cannot be read."""
    try:
        with path.open("rb") as file:
            return _OURS.match(file.read(256)) is not None
    except OSError:
        return False


def cut_of(mesh: Mesh) -> Cut | None:
    """The cut that a mesh carries; None where it carries none, or where its records are other data of these names."""
    if not is_cut(mesh):
        return None
    try:
        cut = Cut(mesh)
    except CutError:
        return None
    values = (*cut.cell_records.values(), cut.macro_of_node)
    return cut if all(v.ndim == 1 and v.dtype.kind in "iu" for v in values) else None


def without_records(mesh: Mesh) -> Mesh:
    """The mesh without its cut records, which formats of nodes, cells and groups alone leave to the sidecar."""
    return mesh if cut_of(mesh) is None else records.without_records(mesh)


def to_json(mesh: Mesh, back: Mesh) -> str | None:
    """Sidecar text: the cut records of `mesh` in the numbering of its file; `back` is that file read again.

    None if `back` has the records already. Raises UnfitError.
    """
    there, has_already = transferred(mesh, back), cut_of(back)
    if has_already is not None and _same(there, has_already):
        return None
    has = np.flatnonzero(np.any([values >= 0 for values in there.cell_records.values()], axis=0))
    nodes = np.flatnonzero(there.macro_of_node >= 0)
    if not (distinct(back.cell_number) and distinct(back.node_number)):
        raise UnfitError("numbers stand twice in the file")
    children: dict[str, Ints] = {"cell": back.cell_number[has]}
    children |= {column: there.cell_records[name][has] for column, name in zip(_COLUMNS, CELL_RECORDS, strict=True)}
    internal = {"node": back.node_number[nodes], "macro": there.macro_of_node[nodes]}
    try:
        _check_values(children, internal, len(there.zones))
    except ValueError as error:
        raise UnfitError(f"there are {error}") from error
    notes = {
        "nodes": back.n_nodes,
        "cells": back.cells_by_type,
        "digest": _digest(back, has, there.zones, children, internal),
        "zones": there.zones,
        "children": children,
        "internal": internal,
    }
    parts = {"lacmesh": _WHAT, "version": VERSION, **to_plain(notes, CUT_NOTES)}
    return "{\n" + ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in parts.items()) + "\n}\n"


def with_sidecar_records(path: Path, mesh: Mesh) -> Mesh:
    """Add the records in the sidecar of `path` to its mesh; if they do not belong to it, warn and leave them out."""
    side = place_of(path)
    try:
        if not side.exists():
            return mesh
        return _fitting(_loaded(side, mesh), path, mesh).mesh
    except UnfitError as unfit:
        why = str(unfit)
    except OSError as error:
        why = f"it cannot be read ({error.strerror or error})"
    except DAMAGE:
        why = "it is damaged"
    message = f"{side}: the records of a cut are left out: {why}; write the mesh again, or take this file away"
    warnings.warn(LacmeshWarning(message), stacklevel=3)
    return mesh


def _cut(mesh: Mesh, cells: dict[str, Ints], internal: Ints, zones: tuple[str, ...]) -> Cut:
    """The mesh with these records. Raises UnfitError."""
    try:
        return Cut(records.with_records(mesh, cells, internal, zones))
    except CutError as error:
        raise UnfitError("they are not those of a cut") from error


def _same(a: Cut, b: Cut) -> bool:
    pairs = zip((*a.cell_records.values(), a.macro_of_node), (*b.cell_records.values(), b.macro_of_node), strict=True)
    return a.zones == b.zones and all(np.array_equal(x, y) for x, y in pairs)


def transferred(mesh: Mesh, back: Mesh) -> Cut:
    """The cut that `mesh` carries in `back`, the same mesh read from a file. Raises UnfitError.

    Cells may differ in order, in the order of their nodes, and in number. Cells may be missing, and their parents'
    numbers with them, but all slave faces and internal nodes must be there.
    """
    cut = Cut(mesh)
    node = _nodes(mesh, back)
    cell = _cells(cut, back, node)
    for to, owner, what in ((cell, cut.macro_of_face, "slave faces"), (node, cut.macro_of_node, "internal nodes")):
        if lost := int((to[owner >= 0] < 0).sum()):
            raise UnfitError(f"{lost} of its {what} are not in the file")
    values = {**cut.cell_records, "lac_parent": _parents(mesh, back, cell, cut.parent_of_cell)}
    there = np.flatnonzero(cell >= 0)
    cells = {name: _placed(own, there, cell, back.n_cells) for name, own in values.items()}
    owners = np.flatnonzero(cut.macro_of_node >= 0)
    return _cut(back, cells, _placed(cut.macro_of_node, owners, node, back.n_nodes), cut.zones)


def _placed(values: Ints, rows: Ints, to: Ints, size: int) -> Ints:
    """Array (size,) that has `values[rows]` at `to[rows]` and -1 elsewhere."""
    placed = np.full(size, -1, values.dtype)
    placed[to[rows]] = values[rows]
    return placed


def _nodes(mesh: Mesh, back: Mesh) -> Ints:
    """Index in `back` of each node of `mesh`, (n_nodes,), -1 if it is missing. Raises UnfitError."""
    size = float(np.ptp(mesh.points, axis=0).max(initial=0.0))
    if back.n_nodes == mesh.n_nodes and np.abs(back.points - mesh.points).max(initial=0.0) <= 1e-5 * size:
        return np.arange(mesh.n_nodes)
    if distinct(back.node_number) and back.node_number.min(initial=1) > 0:  # a deck's new nodes follow its first card
        there = Index(back.node_number).places(np.asarray(mesh.node_number, np.int64))
        if (there >= 0).all() and np.abs(back.points[there] - mesh.points).max(initial=0.0) <= 1e-5 * size:
            return there
    indices = match(mesh, back)
    if isinstance(indices, str):
        raise UnfitError(f"the file has {indices}")
    return indices.node


def _cells(cut: Cut, back: Mesh, node: Ints) -> Ints:
    """Index in `back` of each cell of a cut, (n_cells,), -1 if missing; cells are matched by their sets of nodes.

    Of cells on the same nodes the first matches the first; if the file has fewer, slave faces take precedence.
    """
    mesh, macro = cut.mesh, cut.macro_of_face
    to = np.full(mesh.n_cells, -1)
    theirs = {cell_type: (cells, rows) for cell_type, cells, rows in back.select(np.arange(back.n_cells))}
    for cell_type, cells, rows in mesh.select(np.arange(mesh.n_cells)):
        if cell_type not in theirs:
            continue
        others, their_nodes = theirs[cell_type]
        label, n = label_rows(np.sort(np.concatenate([node[rows], their_nodes]), axis=1))
        mine, its = label[: len(cells)], label[len(cells) :]
        merged = np.bincount(mine, minlength=n) != np.bincount(its, minlength=n)
        first, second = mesh.cell_number[cells], back.cell_number[others]
        if not np.array_equal(np.sort(first), np.sort(second)):  # numbered anew, in the order of the cells
            first, second = cells, others
        keys = (
            _distinct_keys(mine, np.lexsort((first, merged[mine] & (macro[cells] < 0), mine)), len(label)),
            _distinct_keys(its, np.lexsort((second, its)), len(label)),
        )
        _, a, b = np.intersect1d(*keys, assume_unique=True, return_indices=True)
        to[cells[a]] = others[b]
    return to


def _distinct_keys(labels: Ints, order: Ints, size: int) -> Ints:
    """Distinct integer for each entry, from its label and its rank among equal labels; `order` sorts the labels."""
    ordered = labels[order]
    begin = np.flatnonzero(np.diff(ordered, prepend=-1))
    place = np.arange(len(labels)) - np.repeat(begin, np.diff(np.append(begin, len(labels))))
    keys = np.empty(len(labels), np.int64)
    keys[order] = ordered * size + place
    return keys


def _parents(mesh: Mesh, back: Mesh, cell: Ints, parent: Ints) -> Ints:
    """Convert parents' numbers to the file's numbering: the first child has its parent's number in both.

    A number that no cell of the mesh has is kept, unless the file gave it to a cell; then it becomes -1.
    """
    numbers = parent.astype(np.int64)
    children = np.flatnonzero(numbers >= 0)
    first = Index(mesh.cell_number, table=False).places(numbers[children])
    known = (first >= 0) & (cell[first] >= 0)
    taken = ~known & np.isin(numbers[children], back.cell_number)
    numbers[children[taken]] = -1
    numbers[children[known]] = back.cell_number[cell[first[known]]]
    return numbers


def _digest(mesh: Mesh, cells: Ints, zones: tuple[str, ...], *columns: dict[str, Ints]) -> str:
    """SHA-256 digest of the records, and of the cells that have them: types, numbers, nodes by number."""
    digest = sha256(json.dumps(zones).encode())
    for values in (values for column in columns for values in column.values()):
        _feed(digest, values)
    for cell_type, chosen, rows in sorted(
        mesh.select(cells), key=lambda part: part[0]
    ):  # wherever the file lists a type
        digest.update(cell_type.encode())
        _feed(digest, mesh.cell_number[chosen])
        _feed(digest, mesh.node_number[rows])
    return digest.hexdigest()


def _feed(digest: Any, values: NDArray) -> None:
    digest.update(f"{values.shape}".encode())
    digest.update(np.ascontiguousarray(values, "<i8").tobytes())


def _loaded(side: Path, mesh: Mesh) -> dict[str, Any]:
    """Load the sidecar after checks of its size, its origin and its version. Raises UnfitError, OSError, DAMAGE."""
    if not side.is_file():
        raise UnfitError("it is no regular file")
    if side.stat().st_size > _ROOM + _ROOM_EACH * (mesh.n_cells + mesh.n_nodes):
        raise UnfitError("it is larger than the records of this mesh can be")
    if not is_ours(side):
        raise UnfitError("lacmesh did not write it, or it is damaged")
    notes = json.loads(side.read_bytes().decode())
    version = INTEGER.value(notes["version"])
    if version < 1:
        raise ValueError("no version")
    if version > VERSION:
        raise UnfitError("a newer lacmesh wrote it")
    return from_plain(notes, CUT_NOTES)


def _fitting(notes: dict[str, Any], path: Path, mesh: Mesh) -> Cut:
    """The mesh with the records of a loaded sidecar, checked to belong to it. Raises UnfitError, DAMAGE."""
    nodes, cells, zones = notes["nodes"], notes["cells"], notes["zones"]
    children, internal = notes["children"], notes["internal"]
    if (nodes, cells) != (mesh.n_nodes, mesh.cells_by_type):
        raise UnfitError(f"they are of {nodes} nodes and {sum(cells.values())} cells, {_counts(path, mesh, cells)}")
    at_cell = _places(children["cell"], mesh.cell_number)
    at_node = _places(internal["node"], mesh.node_number)
    if notes["digest"] != _digest(mesh, at_cell, zones, children, internal):
        raise UnfitError(f"they are of other cells than those of {path.name}, or were changed")
    _check_values(children, internal, len(zones))
    cell: dict[str, Ints] = {}
    for column, name in zip(_COLUMNS, CELL_RECORDS, strict=True):
        narrow = children[column].max(initial=-1) <= np.iinfo(np.int32).max
        cell[name] = np.full(mesh.n_cells, -1, np.int32 if narrow else np.int64)
        cell[name][at_cell] = children[column]
    owner = np.full(mesh.n_nodes, -1, np.int32)
    owner[at_node] = internal["macro"]
    return _cut(mesh, cell, owner, zones)


def _counts(path: Path, mesh: Mesh, cells: dict[str, int]) -> str:
    """Clause with the node and cell counts of a mesh; it says that types differ if the numbers of cells agree."""
    same = ", of other types" if sum(cells.values()) == mesh.n_cells else ""
    return f"{path.name} has {mesh.n_nodes} and {mesh.n_cells}{same}"


def _places(numbers: Ints, known: Ints) -> Ints:
    """Indices of the cells or nodes with these numbers. Raises UnfitError for an unknown or repeated number."""
    at = Index(known, table=False).places(numbers)
    if (at < 0).any() or not distinct(numbers) or not distinct(known):
        raise UnfitError("they name cells or nodes that the file has not, or twice")
    return at


def _check_values(children: dict[str, Ints], internal: dict[str, Ints], n_zones: int) -> None:
    """Raise ValueError for record values that no cut can have."""
    face = children["macro"] >= 0
    n = int(children["macro"].max(initial=-1)) + 1
    zone, child = children["zone"], children["child"]
    right = (
        0 < n <= int(face.sum())
        and bool(np.bincount(children["macro"][face], minlength=n).all())
        and bool(((zone[face] >= 0) & (zone[face] < n_zones)).all())
        and bool(((child[face] >= 1) & (child[face] <= _MAX_CHILD)).all())
        and bool((zone[~face] < 0).all() and (child[~face] < 0).all())
        and bool(((internal["macro"] >= 0) & (internal["macro"] < n)).all())
    )
    if not right:
        raise ValueError("records that no cut leaves")
