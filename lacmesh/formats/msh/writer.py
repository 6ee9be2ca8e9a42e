"""Writing msh, section by section; what the format cannot hold goes into our notes."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import LacmeshWarning, RequestError, WriteError
from lacmesh.formats.entities import Assignment, assign
from lacmesh.formats.ids import repeated
from lacmesh.formats.msh import version2, version4
from lacmesh.formats.msh.fields import SECTIONS, field_rows
from lacmesh.formats.msh.reader import LARGEST_TAG, NOTE
from lacmesh.formats.msh.streams import Output, safe_names, unnamed
from lacmesh.formats.notes import dump, in_lines
from lacmesh.mesh import Ints, Mesh, Tag


def write(path: Path, mesh: Mesh, *, msh: str = "4.1", binary: bool = True) -> None:
    """Write a mesh as msh 4.1 or 2.2, binary or ASCII, replacing any content.

    Raises WriteError for numbers that the format cannot hold, RequestError for another version. Warns of what only
    lacmesh reads again (TRIA7) or what changes (partitions in 4.1, numbers that are not distinct).
    """
    if msh not in ("4.1", "2.2"):
        raise RequestError(f"msh version {msh!r} is not written; choose 4.1 or 2.2")
    entities = assign(mesh)
    nodes, cells = positive_numbers(mesh.node_number, "nodes"), positive_numbers(mesh.cell_number, "cells")
    partition = _partition(mesh) if msh == "2.2" else None
    cell_data = {k: v for k, v in mesh.cell_data.items() if k != "entity" and (k != "partition" or partition is None)}
    node_data = {k: v for k, v in mesh.node_data.items() if k != "entity"}
    _check_limits(path, msh, nodes, cells, bool(node_data), bool(cell_data))
    if msh == "4.1" and "partition" in cell_data:
        _warn("msh 4.1 gets partitions as element data, which only lacmesh reads as partitions")
    names, note = names_of(mesh, entities)
    note["fields"] = []
    with path.open("wb") as file:
        out = Output(file, binary)
        out.text(f"$MeshFormat\n{msh} {int(binary)} 8\n")
        if binary:
            out.array(np.array([1], "<i4"))
        out.end("MeshFormat")
        _write_names(out, names)
        if msh == "4.1":
            version4.write_sections(out, mesh, entities, nodes, cells)
        else:
            version2.write_sections(out, mesh, entities, nodes, cells, partition)
        for section, on, numbers, data in zip(
            SECTIONS, SECTIONS.values(), (nodes, cells), (node_data, cell_data), strict=True
        ):
            for head, there, values, field in field_rows(path, on, data, mesh.steps):
                shape = f"3\n{head.step}\n{values.shape[1]}\n{len(there)}"
                out.text(f'${section}\n1\n"{head.name}"\n1\n{head.time!r}\n{shape}\n')
                out.numbered_rows(numbers[there], values)
                out.end(section)
                note["fields"] += [field] if field else []
        note |= _by_number(mesh, entities, nodes, cells, msh)
        further = [name for name in note.get("cell_groups", ()) if _nameless(name, entities.group_tags[name])]
        note["groups"] |= {name: entities.group_tags[name] for name in further}
        note = {key: value for key, value in note.items() if len(value)}
        text = dump(mesh, "name", "space_dim", "zones", **note)
        if text:
            text = dump(mesh, "name", "space_dim", "zones", nodes=mesh.n_nodes, cells=mesh.n_cells, **note)
            out.text("\n".join([f"${NOTE}", *in_lines(text), f"$End{NOTE}\n"]))


def _warn(message: str) -> None:
    warnings.warn(LacmeshWarning(message), stacklevel=4)


def positive_numbers(numbers: Ints, what: str, where: str = "in the file") -> Ints:
    """The mesh's numbers; 1, 2 ... where they are not positive and distinct, as msh and gmsh want them."""
    numbers = np.asarray(numbers, np.int64)
    if len(numbers) and (numbers.min() < 1 or repeated(numbers) is not None):
        _warn(f"the numbers of {what} are not positive and distinct: they are 1, 2 ... {where}")
        return np.arange(1, len(numbers) + 1)
    return numbers


def _check_limits(path: Path, version: str, nodes: Ints, cells: Ints, on_nodes: bool, on_cells: bool) -> None:
    for what, numbers, data in (("node", nodes, on_nodes), ("cell", cells, on_cells)):
        if len(numbers) and numbers.max() > LARGEST_TAG and (data or version == "2.2"):
            where = "msh 2.2 has no numbers" if version == "2.2" else "fields in msh have no numbers"
            raise WriteError(path, f"{where} above {LARGEST_TAG}, and a {what} has {numbers.max()}")


def _partition(mesh: Mesh) -> Ints | None:
    """Partition of each cell, -1 for none, if msh 2.2 can hold all of them as tags; else None."""
    values = mesh.cell_data.get("partition")
    if values is None or values.ndim != 1 or values.dtype.kind not in "iu":
        return None
    lacking = np.repeat([ALL_CELLS[b.type].msh is None for b in mesh.blocks], np.diff(mesh.offsets))
    tagged = values > 0
    if not tagged.any() or (~tagged & (values != -1)).any() or (tagged & lacking).any() or values.max() > LARGEST_TAG:
        return None
    return values.astype(np.int64)


def names_of(mesh: Mesh, entities: Assignment) -> tuple[list[tuple[Tag, str]], dict[str, Any]]:
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


def _write_names(out: Output, names: list[tuple[Tag, str]]) -> None:
    if names:
        lines = "".join(f'{dim} {tag} "{name}"\n' for (dim, tag), name in names)
        out.text(f"$PhysicalNames\n{len(names)}\n{lines}$EndPhysicalNames\n")


def _nameless(name: str, tags: tuple[Tag, ...]) -> bool:
    """True if a group has no name in msh: its key is only its tag."""
    return len(tags) == 1 and name == unnamed(tags[0])


def _by_number(mesh: Mesh, entities: Assignment, nodes: Ints, cells: Ints, version: str) -> dict[str, Any]:
    """Note of what the sections of a msh file cannot hold of the mesh itself."""
    note: dict[str, Any] = {"node_groups": {name: nodes[members] for name, members in mesh.node_groups.items()}}
    lacking = np.repeat(np.array([ALL_CELLS[b.type].msh is None for b in mesh.blocks], bool), np.diff(mesh.offsets))
    if lacking.any():
        note["extra_cells"] = _extra_cells(mesh, entities, nodes, cells)
    if version == "2.2" or lacking.any():
        note["cell_groups"] = _further_members(mesh, entities, cells, lacking, version)
    if version == "2.2":
        note["boundary"] = [[*tag, bounds] for tag, bounds in entities.boundary.items()]
        if "entity" in mesh.node_data:
            note["node_entity"] = _entity_runs(entities).ravel()
    return note


def _extra_cells(mesh: Mesh, entities: Assignment, nodes: Ints, cells: Ints) -> list[dict[str, Any]]:
    """The cells of types that msh lacks."""
    place = mesh.places_in_file(np.arange(mesh.n_cells))
    tags = np.array([(e.dim, e.tag) for e in entities.entities], np.int64)
    extra = []
    for k, (cell_type, rows) in enumerate(mesh.blocks):
        if ALL_CELLS[cell_type].msh is None and len(rows):
            here = slice(int(mesh.offsets[k]), int(mesh.offsets[k + 1]))
            entity = tags[entities.cell[here]].ravel()
            extra.append(
                {
                    "type": cell_type,
                    "number": cells[here],
                    "nodes": nodes[rows].ravel(),
                    "entity": entity,
                    "at": place[here],
                }
            )
            _warn(f"msh has no {cell_type}: {len(rows)} cells are kept in a section that only lacmesh reads")
    return extra


def _further_members(
    mesh: Mesh, entities: Assignment, cells: Ints, lacking: NDArray[np.bool_], version: str
) -> dict[str, Ints]:
    """Members of groups that the elements' tags do not hold: further groups in msh 2.2, cells that msh lacks."""
    first = version2.first_group(entities)
    further: dict[str, Ints] = {}
    for name, members in mesh.cell_groups.items():
        missing = lacking[members]
        if version == "2.2":
            own = np.zeros(4, np.int64)
            for dim, tag in reversed(entities.group_tags[name]):
                own[dim] = tag
            missing = missing | (first[entities.cell[members]] != own[mesh.cell_dim[members]])
        if missing.any():
            further[name] = cells[members[missing]]
    return further


def _entity_runs(entities: Assignment) -> Ints:
    """Runs of consecutive nodes on one entity, (r, 3): its dimension, its tag, and the number of nodes."""
    row = entities.node
    begin = np.flatnonzero(np.append(True, row[1:] != row[:-1])) if len(row) else np.empty(0, np.int64)
    tags = np.array([(e.dim, e.tag) for e in entities.entities], np.int64).reshape(-1, 2)
    return np.column_stack([tags[row[begin]], np.diff(np.append(begin, len(row)))])
