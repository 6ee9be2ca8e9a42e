"""Fields of a mesh as gmsh's views of data on nodes and elements, and back.

A view does not say which model it belongs to. Ours are marked (`View.Attributes`) with the model's name and a checksum
of the slave faces, so that they are not taken for those of another model or of a mesh made anew. Views of others belong
to the model that was read from the same file, or to the only model that has a mesh.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshWarning
from lacmesh.formats.msh.content import Content
from lacmesh.formats.msh.fields import RESERVED, Head, Rows, keys, to_rows
from lacmesh.formats.notes import FieldNote
from lacmesh.mesh import Ints, Mesh, concatenated

_TYPES = {"NodeData": "node", "ElementData": "cell"}
_MARK = "lacmesh"
#: mark of views of results (`results`): they belong to no model, and so are no fields of its mesh
RESULT_MARK = f"{_MARK}:results:"
#: The record whose colours tell macro-elements apart: the one view of ours that is shown.
_SHOWN = "lac_macro"


@dataclass(frozen=True)
class Held:
    """One step of a gmsh view, with its values; `key`: the array of the mesh that it becomes; `ours`: lacmesh made it.

    `stale`: lacmesh made it for another mesh than the model has now.
    """

    view: int
    ours: bool
    rows: Rows
    key: str = ""
    stale: bool = False


def read_views(gmsh: Any, model: str, content: Content) -> list[Held]:
    """Read the views that belong to the current model, called `model`; warns of records of a cut that do not fit it."""
    known = {"node": content.node_number, "cell": concatenated(p.number for p in content.pieces)}
    candidates = list(_candidates(gmsh, model))
    ours = [h for h in candidates if h.ours]
    stale = bool(ours) and not (all(_inside(h, known) for h in ours) and _fits(gmsh, content, ours))
    if stale:
        names = ", ".join(dict.fromkeys(h.rows.head.name for h in ours))
        message = f"gmsh's views {names} were made for an earlier mesh of the model {model!r}: left out"
        warnings.warn(LacmeshWarning(message), stacklevel=4)
    good = [h for h in candidates if not (stale if h.ours else not _inside(h, known))]
    named = keys([h.rows.head for h in good])
    kept = [replace(h, key=key) for h, (key, _) in zip(good, named, strict=True)]
    return kept + [replace(h, stale=True) for h in ours if stale]


def _inside(view: Held, known: Mapping[str, Ints]) -> bool:
    """True if all values of a view belong to existing nodes or cells."""
    return bool(np.isin(view.rows.number, known[view.rows.head.on]).all())


def write_views(
    gmsh: Any, model: str, mesh: Mesh, earlier: Iterable[Held], left_out: Iterable[str] = ()
) -> dict[tuple[str, str, int], FieldNote]:
    """Write the fields of the current model's mesh into views; return notes on what views cannot hold of them.

    `earlier`: the views that were there: ours are made again, others get values for the mesh's new nodes and cells.
    `left_out`: keys of fields that get no view.
    """
    others = {(h.rows.head.on, h.key): h for h in earlier if not h.ours}
    for old in {h.view for h in earlier if h.ours}:
        gmsh.view.remove(old)
    faces = np.flatnonzero(mesh.cell_data.get(_SHOWN, np.empty(0)) >= 0)
    mark = f"{_MARK}:{_digest((mesh.cell_number[c], mesh.node_number[n]) for _, c, n in mesh.select(faces))}:{model}"
    notes: dict[tuple[str, str, int], FieldNote] = {}
    views: dict[tuple[str, str], int] = {}
    for kind, on in _TYPES.items():
        number = mesh.node_number if on == "node" else mesh.cell_number
        for key, head, there, values in to_rows(Path(model), on, _fields(mesh, on, left_out), mesh.steps, notes):
            if not len(there):  # gmsh has no view without values
                continue
            other = others.get((on, key))
            if other is None:
                view = views.get((on, head.name)) or _add_view(gmsh, head, mark)
                views[on, head.name] = view
                step, time = head.step, head.time
            else:
                view, step, time = other.view, other.rows.head.step, other.rows.head.time
            gmsh.view.addHomogeneousModelData(
                view, step, model, kind, number[there], values.ravel(), time, values.shape[1]
            )
    return notes


def _fields(mesh: Mesh, on: str, left_out: Iterable[str]) -> dict[str, NDArray]:
    data = mesh.node_data if on == "node" else mesh.cell_data
    return {key: values for key, values in data.items() if key not in {*RESERVED, "partition", *left_out}}


def _add_view(gmsh: Any, head: Head, mark: str) -> int:
    view: int = gmsh.view.add(head.name)
    gmsh.view.option.setString(view, "Attributes", mark)
    gmsh.view.option.setNumber(view, "Visible", head.name == _SHOWN)
    if head.name == _SHOWN:
        gmsh.view.option.setNumber(view, "ShowElement", 1)
    return view


def _candidates(gmsh: Any, model: str) -> Iterator[Held]:
    """The steps of all views of data on nodes and elements that may belong to the current model."""
    for view in gmsh.view.getTags().tolist():
        mark = gmsh.view.option.getString(view, "Attributes").split(":", 2)
        ours = mark[0] == _MARK
        if mark[2:] == [model] if ours else _belongs(gmsh, view):
            for rows in _steps(gmsh, view):
                yield Held(view, ours, rows)


def _belongs(gmsh: Any, view: int) -> bool:
    file = gmsh.model.getFileName()
    return (file and gmsh.view.option.getString(view, "FileName") == file) or _only_model(gmsh)


def _only_model(gmsh: Any) -> bool:
    """True if no other model has a mesh."""
    here = gmsh.model.getCurrent()
    try:
        for name in gmsh.model.list():
            if name != here:
                gmsh.model.setCurrent(name)
                if gmsh.model.mesh.getMaxNodeTag():
                    return False
        return True
    finally:
        gmsh.model.setCurrent(here)


def _steps(gmsh: Any, view: int) -> Iterator[Rows]:
    name = gmsh.view.option.getString(view, "Name")
    for step in range(int(gmsh.view.option.getNumber(view, "NbTimeStep"))):
        try:
            kind, number, values, time, width = gmsh.view.getHomogeneousModelData(view, step)
        except Exception:  # gmsh's own class: a view that is a list of shapes, without a mesh
            return
        if kind in _TYPES and len(number):
            head = Head(_TYPES[kind], name, step, float(time))
            yield Rows(head, 0, number.astype(np.int64), values.reshape(len(number), width))


def _fits(gmsh: Any, content: Content, ours: list[Held]) -> bool:
    """True if lacmesh's views were made for the cells that the model has."""
    faces = concatenated(h.rows.number for h in ours if h.rows.head.name == _SHOWN)
    here = ((p.number, p.nodes, np.isin(p.number, faces)) for p in content.pieces)
    digest = _digest((number[rows], nodes[rows]) for number, nodes, rows in here)
    return all(gmsh.view.option.getString(h.view, "Attributes").split(":")[1] == digest for h in ours)


def _digest(cells: Iterable[tuple[Ints, Ints]]) -> str:
    """A checksum of cells, their numbers (m,) and nodes (m, n) by number, whatever their order."""
    total = np.zeros(1, np.uint64)
    for number, nodes in cells:
        rows = np.column_stack([number, nodes]).astype(np.uint64)
        factors = np.arange(1, rows.shape[1] + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        mixed = rows @ factors
        mixed = (mixed ^ (mixed >> np.uint64(31))) * np.uint64(0xBF58476D1CE4E5B9)
        total += (mixed ^ (mixed >> np.uint64(29))).sum(dtype=np.uint64)
    return f"{int(total[0]):016x}"
