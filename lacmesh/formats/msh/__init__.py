"""msh, gmsh's format: versions 4.1 and 2.2, ASCII and binary.

Reader and writer are our own, since all others lose something (measured with gmsh 4.15 and meshio 5.3): gmsh writes a
cell of k groups k times in msh 2.2 and keeps such copies when it reads, and with Mesh.SaveAll it loses all groups;
meshio loses numbers and second memberships, and fails on entities without a group; both accept truncated files, and
meshio wraps node 0 to the last one. What msh cannot hold (node groups, overlaps in 2.2, zones, TRIA7 ...) goes into a
section of our own, which gmsh skips; see `reader.NOTE`.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import LacmeshWarning, RequestError, WriteError
from lacmesh.formats.entities import Assignment, assign
from lacmesh.formats.msh import version2, version4
from lacmesh.formats.msh.fields import SECTIONS, field_rows
from lacmesh.formats.msh.reader import LARGEST_TAG, LAYOUTS, NOTE, read_format
from lacmesh.formats.msh.streams import MshSource, Output, safe_names, unnamed
from lacmesh.formats.notes import dump, in_lines
from lacmesh.formats.orders import numbers_within
from lacmesh.mesh import Ints, Mesh, Tag


def read(path: Path) -> Mesh:
    """Read the mesh in a msh file of version 2.0, 2.1, 2.2 or 4.1, ASCII or binary. Raises ReadError.

    Warns of content that a mesh has no place for, of unknown sections, and of whatever looks wrong.
    """
    source = MshSource(path)
    read_format(source)
    return (version4.Reader4 if source.version == "4.1" else version2.Reader2)(source).mesh()


def header(path: Path, head: bytes) -> tuple[str, bool]:
    """The layout ("4.1" or "2.2") of a msh file, and whether it is binary; `head`: its first bytes.

    Raises ReadError for a version that is not read.
    """
    source = MshSource(path, head if b"$EndMeshFormat" in head else b"")
    read_format(source)
    return LAYOUTS[source.version], source.binary


def write(path: Path, mesh: Mesh, *, msh: str = "4.1", binary: bool = True) -> None:
    """Write a mesh as msh 4.1 or 2.2, binary or ASCII, replacing any content.

    Raises WriteError for numbers that the format cannot hold, RequestError for another version. Warns of what only
    lacmesh reads again (TRIA7) or what changes (partitions in 4.1, numbers that are not distinct).
    """
    if msh not in ("4.1", "2.2"):
        raise RequestError(f"msh version {msh!r} is not written; choose 4.1 or 2.2")
    entities = assign(mesh)
    clauses: list[str] = []
    nodes = numbers_within(mesh.node_number, 1, 2**63 - 1, "nodes", clauses)
    cells = numbers_within(mesh.cell_number, 1, 2**63 - 1, "cells", clauses)
    partition = _partition(mesh) if msh == "2.2" else None
    cell_data = {k: v for k, v in mesh.cell_data.items() if k != "entity" and (k != "partition" or partition is None)}
    node_data = {k: v for k, v in mesh.node_data.items() if k != "entity"}
    for what, numbers, data in (("node", nodes, node_data), ("cell", cells, cell_data)):
        if len(numbers) and numbers.max() > LARGEST_TAG and (data or msh == "2.2"):
            where = "msh 2.2 has no numbers" if msh == "2.2" else "fields in msh have no numbers"
            raise WriteError(path, f"{where} above {LARGEST_TAG}, and a {what} has {numbers.max()}")
    if msh == "4.1" and "partition" in cell_data:
        clauses.append("msh 4.1 gets partitions as element data, which only lacmesh reads as partitions")
    names, note = _names(mesh, entities)
    note |= _by_number(mesh, entities, nodes, cells, msh)
    clauses += [
        f"msh has no {kind['type']}: {len(kind['number'])} cells are kept in a section that only lacmesh reads"
        for kind in note["extra_cells"]
    ]
    further = [name for name in note["cell_groups"] if _nameless(name, entities.group_tags[name])]
    note["groups"] |= {name: entities.group_tags[name] for name in further}
    with path.open("wb") as file:
        out = Output(file, binary)
        out.text(f"$MeshFormat\n{msh} {int(binary)} 8\n")
        if binary:
            out.array(np.array([1], "<i4"))
        out.end("MeshFormat")
        if names:
            lines = "".join(f'{dim} {tag} "{name}"\n' for (dim, tag), name in names)
            out.text(f"$PhysicalNames\n{len(names)}\n{lines}$EndPhysicalNames\n")
        if msh == "4.1":
            version4.write_sections(out, mesh, entities, nodes, cells)
        else:
            version2.write_sections(out, mesh, entities, nodes, cells, partition)
        note["fields"] = []
        for (section, on), numbers, data in zip(SECTIONS.items(), (nodes, cells), (node_data, cell_data), strict=True):
            for head, there, values, field in field_rows(path, on, data, mesh.steps):
                shape = f"3\n{head.step}\n{values.shape[1]}\n{len(there)}"
                out.text(f'${section}\n1\n"{head.name}"\n1\n{head.time!r}\n{shape}\n')
                out.rows(("<i4", "<f8"), numbers[there], values)
                out.end(section)
                note["fields"] += [field] if field else []
        note = {key: value for key, value in note.items() if len(value)}
        if dump(mesh, "name", "space_dim", "zones", **note):
            text = dump(mesh, "name", "space_dim", "zones", nodes=mesh.n_nodes, cells=mesh.n_cells, **note)
            out.text("\n".join([f"${NOTE}", *in_lines(text), f"$End{NOTE}\n"]))
    if clauses:
        warnings.warn(LacmeshWarning("; ".join(clauses)), stacklevel=3)


def _partition(mesh: Mesh) -> Ints | None:
    """Partition of each cell, -1 for none, if msh 2.2 can hold all of them as tags; else None."""
    values = mesh.cell_data.get("partition")
    if values is None or values.ndim != 1 or values.dtype.kind not in "iu":
        return None
    tagged = values > 0
    fits = tagged.any() and values.max() <= LARGEST_TAG and (tagged | (values == -1)).all()
    return values.astype(np.int64) if fits and not (tagged & _lacking(mesh)).any() else None


def _names(mesh: Mesh, entities: Assignment) -> tuple[list[tuple[Tag, str]], dict[str, Any]]:
    """Tags and names of the physical groups, and a note of altered names, and groups that no other section shows."""
    names, noted = [], {}
    safe = safe_names(mesh.cell_groups)
    for name, cells in mesh.cell_groups.items():
        tags = entities.group_tags[name]
        if not _nameless(name, tags):
            names += [(tag, safe[name]) for tag in tags]
        if safe[name] != name or not tags or (_nameless(name, tags) and not len(cells)):
            noted[name] = tags
    return names, {"groups": noted}


def _nameless(name: str, tags: tuple[Tag, ...]) -> bool:
    """True if a group has no name in msh: its key is only its tag."""
    return len(tags) == 1 and name == unnamed(tags[0])


def _by_number(mesh: Mesh, entities: Assignment, nodes: Ints, cells: Ints, version: str) -> dict[str, Any]:
    """Note of what the sections of a msh file cannot hold of the mesh itself.

    In `cell_groups` are members that the elements' tags do not give: further groups in msh 2.2, cells that msh lacks.
    """
    note: dict[str, Any] = {"node_groups": {name: nodes[members] for name, members in mesh.node_groups.items()}}
    tags = np.array([(e.dim, e.tag) for e in entities.entities], np.int64).reshape(-1, 2)
    place, note["extra_cells"] = mesh.places_in_file(np.arange(mesh.n_cells)), []
    for (kind, rows), a, b in zip(mesh.blocks, mesh.offsets, mesh.offsets[1:], strict=False):
        if ALL_CELLS[kind].msh is None and len(rows):
            extra = {"type": kind, "number": cells[a:b], "nodes": nodes[rows].ravel()}
            note["extra_cells"].append(extra | {"entity": tags[entities.cell[a:b]].ravel(), "at": place[a:b]})
    lacking, first, note["cell_groups"] = _lacking(mesh), version2.first_group(entities), {}
    for name, members in mesh.cell_groups.items() if version == "2.2" or lacking.any() else ():
        missing = lacking[members]
        if version == "2.2":
            tag_of_dim = np.zeros(4, np.int64)
            for dim, tag in reversed(entities.group_tags[name]):
                tag_of_dim[dim] = tag
            missing = missing | (first[entities.cell[members]] != tag_of_dim[mesh.cell_dim[members]])
        if missing.any():
            note["cell_groups"][name] = cells[members[missing]]
    if version == "2.2":
        note["boundary"] = [[*tag, bounds] for tag, bounds in entities.boundary.items()]
    if version == "2.2" and "entity" in mesh.node_data and mesh.n_nodes:  # in runs of nodes on one entity
        begin = np.flatnonzero(np.append(True, np.diff(entities.node) != 0))
        runs = np.diff(np.append(begin, mesh.n_nodes))
        note["node_entity"] = np.column_stack([tags[entities.node[begin]], runs]).ravel()
    return note


def _lacking(mesh: Mesh) -> NDArray[np.bool_]:
    """True for each cell (n_cells,) of a type that msh lacks."""
    return np.repeat(np.array([ALL_CELLS[b.type].msh is None for b in mesh.blocks], bool), np.diff(mesh.offsets))
