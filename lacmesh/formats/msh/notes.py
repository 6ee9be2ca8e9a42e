"""The section `$LacMesh` of a msh file: what the format cannot hold, as JSON text of version 1.

It is written only where something is needed, in ASCII (also in a binary file) and without a `$`, so that gmsh, which
looks for the next line that starts with one, passes it. Nodes and cells are named by their numbers. gmsh keeps such a
section when it saves a file as msh 4.1: `nodes` and `cells` say which mesh the numbers were meant for.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.msh.scan import MshBytes
from lacmesh.mesh import Ints, Tag

SECTION = "LacMesh"
VERSION = 1
#: Sections of older tools, passed without a word.
FORMER = ("LacNodeGroups",)
_LINE = 160


class FieldNote(NamedTuple):
    """Properties of a field that its section cannot hold: its key in the mesh, true name and step, shape and type."""

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


@dataclass
class Notes:
    """The content of the section; `nodes`, `cells` count those of the mesh it belongs to.

    `groups`: names (and tags) of groups that $PhysicalNames cannot hold; `node_groups`, `cell_groups`: members by
    number, for cell groups those that the elements' tags do not give; `node_entity` (r, 3): dimension, tag and how many
    nodes of $Nodes in a row have it; `boundary`: entities and their signed boundary; `fields`: (on "node" or "cell",
    name in the file, step in the file) -> what is to be added.
    """

    nodes: int = 0
    cells: int = 0
    name: str | None = None
    space_dim: int | None = None
    zones: tuple[str, ...] = ()
    groups: dict[str, tuple[Tag, ...]] = field(default_factory=dict)
    node_groups: dict[str, Ints] = field(default_factory=dict)
    cell_groups: dict[str, Ints] = field(default_factory=dict)
    extra_cells: list[CellsNote] = field(default_factory=list)
    node_entity: Ints | None = None
    boundary: dict[Tag, tuple[int, ...]] = field(default_factory=dict)
    fields: dict[tuple[str, str, int], FieldNote] = field(default_factory=dict)


def to_text(notes: Notes) -> str:
    """The lines of the section, or "" where there is nothing to say."""
    said = {
        "name": notes.name,
        "space_dim": notes.space_dim,
        "zones": list(notes.zones),
        "groups": [{"name": name, "tags": tags} for name, tags in notes.groups.items()],
        "node_groups": [{"name": name, "nodes": n.tolist()} for name, n in notes.node_groups.items()],
        "cell_groups": [{"name": name, "cells": n.tolist()} for name, n in notes.cell_groups.items()],
        "extra_cells": [
            {"type": c.type, **{k: v.ravel().tolist() for k, v in c._asdict().items() if k != "type"}}
            for c in notes.extra_cells
        ],
        "node_entity": None if notes.node_entity is None else notes.node_entity.ravel().tolist(),
        "boundary": [[*tag, list(signed)] for tag, signed in notes.boundary.items()],
        "fields": [
            {"on": on, "field": name, "step": step, **note._asdict()} for (on, name, step), note in notes.fields.items()
        ],
    }
    said = {key: value for key, value in said.items() if value not in (None, [])}
    if not said:
        return ""
    head = {"version": VERSION, "nodes": notes.nodes, "cells": notes.cells}
    text = json.dumps({**head, **said}, separators=(",\n", ":")).replace("$", "\\u0024")
    return f"${SECTION}\n{_filled(text)}\n$End{SECTION}\n"


def _filled(text: str) -> str:
    """Join lines as long as they stay short."""
    lines: list[str] = []
    room = 0
    for line in text.split("\n"):
        if len(line) <= room:
            lines[-1] += line
            room -= len(line)
        else:
            lines.append(line)
            room = _LINE - len(line)
    return "\n".join(lines)


def from_text(text: bytes, source: MshBytes) -> Notes | None:
    """The content of a section; None where a newer lacmesh wrote it. Raises ReadError where it makes no sense."""
    try:
        said = json.loads(text.decode())
        if not isinstance(said, dict):
            raise ValueError("it should be an object")
        if _integer(said["version"]) > VERSION:
            return None
        return _notes(said)
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise source.error(
            f"the section ${SECTION} is damaged ({what[:80]}); without it the rest can be read"
        ) from None


def _notes(said: dict[str, Any]) -> Notes:
    notes = Notes(nodes=_integer(said["nodes"]), cells=_integer(said["cells"]))
    if "name" in said:
        notes.name = _string(said["name"])
    if "space_dim" in said:
        notes.space_dim = _integer(said["space_dim"])
        if notes.space_dim not in (1, 2, 3):
            raise ValueError("space_dim is not 1, 2 or 3")
    notes.zones = tuple(_string(z) for z in _list(said.get("zones", [])))
    notes.groups = _by_name(said, "groups", lambda g: tuple(_tag(t) for t in _list(g["tags"])))
    notes.node_groups = _by_name(said, "node_groups", lambda g: _integers(g["nodes"]))
    notes.cell_groups = _by_name(said, "cell_groups", lambda g: _integers(g["cells"]))
    notes.extra_cells = [_cells(c) for c in _list(said.get("extra_cells", []))]
    if "node_entity" in said:
        notes.node_entity = _integers(said["node_entity"]).reshape(-1, 3)
    for dim, tag, signed in _list(said.get("boundary", [])):
        notes.boundary[_tag([dim, tag])] = tuple(_integer(s) for s in _list(signed))
    for f in _list(said.get("fields", [])):
        shape = None if f["shape"] is None else tuple(_integer(n) for n in _list(f["shape"]))
        key, name, number, order = _string(f["key"]), _string(f["name"]), _integer(f["number"]), _integer(f["order"])
        note = FieldNote(key, name, number, order, shape, bool(f["integer"]))
        notes.fields[_string(f["on"]), _string(f["field"]), _integer(f["step"])] = note
    return notes


def _by_name(said: dict[str, Any], key: str, value: Callable[[Any], Any]) -> dict[str, Any]:
    return {_string(entry["name"]): value(entry) for entry in _list(said.get(key, []))}


def _cells(said: Any) -> CellsNote:
    kind = _string(said["type"])
    if kind not in ALL_CELLS:
        raise ValueError(f"there is no cell type {kind!r}")
    return CellsNote(
        kind,
        _integers(said["number"]),
        _integers(said["nodes"]).reshape(-1, ALL_CELLS[kind].n_nodes),
        _integers(said["entity"]).reshape(-1, 2),
        _integers(said["at"]),
    )


def _tag(said: Any) -> Tag:
    dim, tag = (_integer(n) for n in _list(said))
    return dim, tag


def _list(said: Any) -> list[Any]:
    if not isinstance(said, list):
        raise TypeError(f"{str(said)[:40]!r} should be a list")
    return said


def _string(said: Any) -> str:
    if not isinstance(said, str):
        raise TypeError(f"{str(said)[:40]!r} should be text")
    return said


def _integer(said: Any) -> int:
    if not isinstance(said, int) or not -(2**63) <= said < 2**63:
        raise TypeError(f"{str(said)[:40]!r} should be an integer")
    return said


def _integers(said: Any) -> Ints:
    array = np.array(_list(said))
    if array.ndim != 1 or (array.size and array.dtype != np.int64):
        raise TypeError("a list should hold integers only")
    return array.astype(np.int64)
