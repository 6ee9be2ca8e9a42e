"""Reading msh: the version, then section by section; at the end cells get their groups, and our note what msh lacks."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.msh import fields
from lacmesh.formats.msh.streams import MshSource, physical_names, unnamed
from lacmesh.formats.notes import DAMAGED, boundary_of, integers, noted_fields, parse
from lacmesh.indices import Index
from lacmesh.mesh import Ints, Mesh, Tag, places_of

#: Versions that we read -> the layout they have.
LAYOUTS = {"2": "2.2", "2.0": "2.2", "2.1": "2.2", "2.2": "2.2", "4.1": "4.1"}
#: The section of our note: JSON text without a `$`, also in a binary file. gmsh passes it, and keeps it when it saves.
NOTE = "LacMesh"
#: Fields of a mesh in it.
_FIELDS = ("name", "space_dim", "zones")
#: gmsh's number of a type -> our name
TYPE_NAMES = {cell.msh: name for name, cell in ALL_CELLS.items() if cell.msh is not None}
#: What to say of a type that has no name.
UNKNOWN_TYPE = "there are elements of type {} of gmsh, which lacmesh does not know; take them out of the mesh"
LARGEST_TAG = 2**31 - 1
#: Sections that a mesh has no place for, and one of an older tool, which is passed without a word.
_DROPPED = ("GhostElements", "ElementNodeData", "InterpolationScheme", "Parametrizations")
_PASSED = ("Comments", "LacNodeGroups")
_SAVE_AS = "open it in gmsh and save it as msh 4.1"


@dataclass
class Elements:
    """Elements of one type: `number` (m,), `nodes` (m, n of the type) by number.

    `entity` (2,) or (m, 2), -1 where it is unknown; `partition`: one, or one for each, -1 for none; `groups`: physical
    groups that all are in; `physical` (m,): tags of physical groups of the cells' dimension, 0 for none; `at` (m,):
    positions in the file, None of those that stand behind the last.
    """

    type: str
    number: Ints
    nodes: Ints
    entity: Any
    partition: int | Ints = -1
    groups: tuple[Tag, ...] = ()
    physical: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    at: Ints | None = None


class MshReader:
    """Reads the sections of one file; `read_section` reads those that differ between versions.

    These give `elements`, and `links` and `boundary`, as in a note. `members`: numbers of cells in physical groups that
    single elements name. `dropped`: what a mesh has no place for. `repeats` (2, m): elements of msh 2.2 that repeat a
    cell for a further group: their number and the cell's. `n_partitions`: parts of the whole mesh, 0 where the file
    says none.
    """

    def __init__(self, source: MshSource) -> None:
        self.source, self.out = source, MeshBuilder(source.path)
        self.elements: list[Elements] = []
        self.links: list[tuple[Any, ...]] = []
        self.boundary: list[tuple[Any, ...]] = []
        self.members: list[tuple[Tag, Ints]] = []
        self.repeats: Ints = np.empty((2, 0), np.int64)
        self.n_partitions = 0
        self.dropped: dict[str, None] = {}
        self._names: list[tuple[int | None, int, str]] = []
        self._unknown: dict[str, None] = {}
        self._rows: list[fields.Rows] = []
        self._note: dict[str, Any] = {}
        self._starts: dict[str, int] = {}

    def read_section(self, name: str) -> bool:
        """Read the section that starts here, if it is one of those that differ between versions. Raises ReadError."""
        raise NotImplementedError

    def complete(self) -> None:
        """Complete what the sections have given, once all are read. Raises ReadError."""

    def mesh(self) -> Mesh:
        """Read all sections and return the mesh. Raises ReadError."""
        source, out = self.source, self.out
        while (name := source.section()) is not None:
            if name in self._starts and name in ("PhysicalNames", "Entities", "Nodes", "Elements"):
                raise source.error(f"there is a second section ${name}")
            if name == "Elements" and "Nodes" not in self._starts:
                raise source.error("the section $Elements stands before $Nodes")
            self._starts[name] = source.section_start
            if not self.read_section(name):
                self._read(name)
        if "Nodes" not in self._starts:
            raise source.error("the file has no section $Nodes", source.size)
        self.complete()
        self._warn()
        self._fit_note()
        note, group_tags = self._note, self._add_groups()
        for on in ("cell", "node"):
            for name, number in note.get(f"{on}_groups", {}).items():
                out.group(on, name, number)
        if "node_entity" in note and source.version != "4.1":
            dim, tag, count = note["node_entity"].T
            if (count < 0).any() or count.sum() != out.size("node") or (np.abs([dim, tag]) > LARGEST_TAG).any():
                raise source.error(f"the entities of nodes in the section ${NOTE} do not fit the nodes")
            entity = np.repeat(np.stack([dim, tag], axis=1).astype(np.int32), count, axis=0)
            out.values("node", "entity", None, entity)
        of_cell = Index(self.repeats[0])
        for k, rows in enumerate(self._rows):  # values of an element that was merged into a cell are the cell's
            if rows.head.on == "cell" and self.repeats.size:
                place = of_cell.places(rows.number)
                self._rows[k] = rows._replace(number=np.where(place < 0, rows.number, self.repeats[1][place]))
        steps = fields.add_to(out, source, self._rows, note.get("fields", ()))
        out.note = {key: note[key] for key in _FIELDS if key in note}
        if (boundary := self.boundary or note.get("boundary", [])) or self.links:
            out.note["model"] = {"boundary": boundary, "periodic": self.links}
        return out.mesh(group_tags=group_tags, steps=steps)

    def error(self, section: str) -> Any:
        """Return the function that makes the error of a message about a section."""
        return lambda message: self.source.error(message, self._starts[section])

    def check_tag(self, dim: int, tag: int) -> Tag:
        """Return an entity's dimension and tag. Raises ReadError."""
        if not 0 <= dim <= 3 or not -LARGEST_TAG <= tag <= LARGEST_TAG:
            raise self.source.here(f"there cannot be an entity {tag} of dimension {dim}")
        return int(dim), int(tag)

    def _read(self, name: str) -> None:
        """Read a section that is the same in all versions, or pass it."""
        source = self.source
        if name == "MeshFormat":
            before = source.version, source.binary, source.order
            _read_version(source)
            if before != (source.version, source.binary, source.order):
                raise source.error("a second $MeshFormat that differs from the first stands here")
        elif name == "PhysicalNames":
            self._names = physical_names(source)
        elif name in fields.SECTIONS:
            self._rows.append(fields.read_rows(source, name))
        elif name == NOTE:
            self._note = _read_note(source)
            if not self._note:
                self._unknown[f"${name} of a newer lacmesh"] = None
        else:
            source.body(name)
            if name in _DROPPED:
                self.dropped[f"${name}"] = None
            elif name not in _PASSED:
                self._unknown[f"${name}"] = None

    def _warn(self) -> None:
        """Note what is left out, and what looks as if the file were not whole."""
        warnings = self.out.warnings
        if self.dropped:
            warnings.append(f"what a mesh has no place for is left out: {', '.join(self.dropped)}")
        if self._unknown:
            warnings.append(f"unknown sections: {', '.join(self._unknown)}")
        there = {int(p) for e in self.elements for p in np.unique(e.partition)}
        parts, n = sorted(there - {-1}), self.n_partitions
        # msh 2.2 does not give the number of parts, and a whole mesh has cells of several, or of none
        if 0 < len(parts) < n or (len(parts) == 1 and not n and -1 not in there):
            what = f"partition {parts[0]}" if len(parts) == 1 else f"{len(parts)} partitions"
            what += (f" of {n}" if n else "") + (" alone" if len(parts) == 1 else "")
            warnings.append(
                f"it has {what}, a part of a mesh that gmsh divided; save the whole mesh: "
                "Mesh.PartitionSplitMeshFiles = 0"
            )
        if self._names and self.elements and self.source.version != "4.1" and not self.members:
            warnings.append(
                "no cell is in any of its groups, as gmsh saves msh 2.2 with Mesh.SaveAll = 1; save as msh 4.1"
            )
        if "Elements" not in self._starts:
            warnings.append("the file has no section $Elements, so no cells")

    def _fit_note(self) -> None:
        """Add the cells of our note; drop what it has by number, with a warning, if it is of another mesh."""
        note, source = self._note, self.source
        extra = note.get("extra_cells", [])
        n = sum(len(e.number) for e in self.elements)
        counts = self.out.size("node"), n + sum(len(e.number) for e in extra)
        of_numbers = ("node_groups", "cell_groups", "extra_cells", "node_entity")
        by_number = [key for key in of_numbers if len(note.get(key, ()))]
        if by_number and (note["nodes"], note["cells"]) != counts:
            self.out.warnings.append(
                f"the section ${NOTE} was written for {note['nodes']} nodes and {note['cells']} cells, and the file "
                f"now has {counts[0]} and {counts[1]}: its node groups and further cells are left out"
            )
            for key in by_number:
                del note[key]
        elif extra:
            places = np.concatenate([e.at for e in extra])
            fits = all(len(e.number) == len(e.nodes) == len(e.entity) == len(e.at) for e in extra)
            if not fits or len(np.unique(places)) < len(places) or places.min() < 0 or places.max() >= counts[1]:
                raise source.error(f"the cells of the section ${NOTE} do not fit together")
            if any((np.abs(e.entity) > LARGEST_TAG).any() for e in extra):
                raise source.error(f"the cells of the section ${NOTE} have an entity beyond all limits")
            free = np.flatnonzero(places_of(places, counts[1]) < 0)
            for e in self.elements:
                e.at = None if e.at is None else free[e.at]
            self.elements += extra

    def _add_groups(self) -> dict[str, tuple[Tag, ...]]:
        """Add all groups and the cells with theirs; return the tags of each group. One without a name has its tag's."""
        out, there = self.out, {tag for e in self.elements for tag in e.groups} | {tag for tag, _ in self.members}
        named: dict[Tag, str] = {}
        for dim, tag, name in self._names:
            for d in (dim,) if dim is not None else sorted({d for d, t in there if t == tag}):
                if named.setdefault((d, tag), name) != name:
                    names = f"{named[d, tag]!r} and {name!r}"
                    out.warnings.append(f"the physical group {d}:{tag} has two names, {names}: the first is kept")
        noted: dict[str, tuple[Tag, ...]] = self._note.get("groups", {})
        for name, tags in noted.items():
            named.update(dict.fromkeys(tags, name))
        used, group_tags = {*named.values(), *noted}, dict[str, tuple[Tag, ...]]()
        for name in [*named.values(), *noted]:
            out.group("cell", name)
        for key in sorted(there - named.keys()):
            name = unnamed(key)
            while name in used:
                name += "'"
            used.add(name)
            named[key] = name
        for key, name in named.items():
            group_tags[name] = (*group_tags.get(name, ()), key)
            out.group("cell", name)
        with_entity = any((np.asarray(e.entity) > 0).any() for e in self.elements)
        with_partition = any(not isinstance(e.partition, int) or e.partition >= 0 for e in self.elements)
        for e in self.elements:
            n, data = len(e.number), dict[str, Any]()
            if with_entity:
                data["entity"] = np.broadcast_to(np.asarray(e.entity, np.int32), (n, 2))
            if with_partition:
                data["partition"] = np.broadcast_to(np.asarray(e.partition, np.int32), n)
            groups = [named[tag] for tag in e.groups]
            out.cells(e.type, e.number, e.nodes, groups=groups, at=e.at, error=self.error("Elements"), **data)
        for key, number in self.members:
            out.group("cell", named[key], number)
        return group_tags


def _read_note(source: MshSource) -> dict[str, Any]:
    """The note in the section that starts here, {} of a newer lacmesh. Raises ReadError where it makes no sense."""
    try:
        note = parse(source.body(NOTE))
        if not note:
            return note
        integers([note["nodes"], note["cells"]])
        noted_fields(Mesh.create(np.empty((0, 3)), []), {key: note[key] for key in _FIELDS if key in note})
        for key, of, *shape in (("groups", "tags", 2), ("node_groups", "nodes"), ("cell_groups", "cells")):
            listed = note.get(key, {})
            if isinstance(listed, list):  # of version 1
                listed = {entry["name"]: entry[of] for entry in listed}
            note[key] = {name: integers(values, (-1, *map(int, shape))) for name, values in listed.items()}
        note["groups"] = {name: tuple(map(tuple, tags.tolist())) for name, tags in note["groups"].items()}
        note["extra_cells"] = [
            Elements(
                e["type"],
                integers(e["number"]),
                integers(e["nodes"], (-1, ALL_CELLS[e["type"]].n_nodes)),
                integers(e["entity"], (-1, 2)),
                at=integers(e["at"]),
            )
            for e in note.get("extra_cells", ())
            if len(e["number"])
        ]
        if "node_entity" in note:
            note["node_entity"] = integers(note["node_entity"], (-1, 3))
        boundary_of(note.get("boundary", ()))
        for field in note.get("fields", ()):
            integers([field["step"], field["number"], field["order"], *(field["shape"] or ())])
            {field["on"], field["field"], field["name"], field["key"], field["integer"]}
        return note
    except DAMAGED as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        message = f"the section ${NOTE} is damaged ({what[:80]}); without it the rest can be read"
        raise source.error(message) from None


def read_format(source: MshSource) -> None:
    """Pass $MeshFormat (and comments before it); the source then knows its version and byte order. Raises ReadError."""
    name = source.section()
    while name == "Comments":
        source.body(name)
        name = source.section()
    if name in ("NOD", "NOE"):
        raise source.error(f"this is msh version 1; {_SAVE_AS}")
    if name != "MeshFormat":
        raise source.error("a msh file should begin with $MeshFormat", source.section_start)
    _read_version(source)


def _read_version(source: MshSource) -> None:
    at = source.position
    match = re.fullmatch(rb"\s*(\d+(?:\.\d+)?)\s+([01])\s+(\d{1,4})\s*", source.line())
    if match is None:
        raise source.error("$MeshFormat should hold a version, 0 or 1, and a size", at)
    version = match[1].decode()
    if version not in LAYOUTS:
        raise source.error(f"msh version {version} is not read (2.0 to 2.2 and 4.1 are); {_SAVE_AS}", at)
    if int(match[3]) != 8:
        raise source.error(f"numbers of {int(match[3])} bytes are not read, only of 8; {_SAVE_AS}", at)
    source.version = "2.0" if version == "2" else version
    if match[2] == b"1":
        source.binary = True
        mark = source.records(4, 1).tobytes()
        if mark not in (b"\1\0\0\0", b"\0\0\0\1"):
            raise source.error("the file says that it is binary, but its byte order mark is missing", at)
        source.order = "<" if mark == b"\1\0\0\0" else ">"
    source.end("MeshFormat")
