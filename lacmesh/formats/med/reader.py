"""MED read: the mesh of a file, or a slice of it, which has some rows of each array, so that nobody holds the whole.

Slice k of n has as many consecutive nodes, and cells of each type, as any other; their nodes are indices in the whole.
Families, groups, names and sizes are those of the whole file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lacmesh.communicator import SERIAL, Communicator
from lacmesh.errors import ReadError, RequestError, did_you_mean, some
from lacmesh.formats.med import families, fields, notes
from lacmesh.formats.med.hdf5 import Branch, Name, opened, text
from lacmesh.formats.med.types import MED_TYPES, NOT_READ, MedType
from lacmesh.formats.notes import zone_names
from lacmesh.formats.slices import CellRows, MeshSlice, RowRange, Slice, repeated
from lacmesh.mesh import Floats, Ints, concatenated

#: Parts of a file that no Mesh holds.
_NOT_CARRIED = {
    "EQS": "equivalences",
    "JNT": "joints",
    "NUM_DATA": "parameters",
    "LIENS": "links to other files",
    "STR": "structure elements",
    "INTERP": "interpolation functions",
}


@dataclass(frozen=True)
class MedSlice:
    """Rows of a file: the nodes in `rows`, with points (k, 3), numbers if there are any, and families (k,).

    `cell_families`, `node_families`: the groups of each family of the file. `noted`: further fields of the mesh.
    `said`: what is left out.
    """

    name: str
    rows: RowRange
    points: Floats
    space_dim: int
    node_number: Ints | None
    node_family: Ints
    cells: tuple[Cells, ...]
    cell_families: families.Families
    node_families: families.Families
    data: fields.Data
    noted: dict[str, Any]
    said: tuple[str, ...]

    @property
    def cell_family(self) -> Ints:
        """(k,): the family of each cell."""
        return concatenated(c.family for c in self.cells)

    def numbers(self, comm: Communicator, said: list[str]) -> tuple[Ints, Ints]:
        """Return the numbers of the nodes and of the cells: the file's if they are distinct, else they are counted.

        Types without numbers are counted in libmed's order.
        """
        counted = np.arange(self.rows.start, self.rows.stop) + 1
        nodes = _distinct(self.node_number, counted, "nodes", comm, said)
        first: dict[str, int] = {}
        for c in sorted(self.cells, key=lambda c: c.kind.bit):
            first[c.support] = 1 + sum(other.rows.size for other in self.cells if other.support in first)
        by_count = [first[c.support] + np.arange(c.rows.start, c.rows.stop) for c in self.cells]
        given = [by if c.number is None else c.number for c, by in zip(self.cells, by_count, strict=True)]
        all_cells = concatenated(given), concatenated(by_count)
        return nodes, _distinct(*all_cells, "cells", comm, said)


def slice_of(path: Path, comm: Communicator = SERIAL, mesh: str | None = None) -> MeshSlice:
    """Return the slice that this process reads of the mesh of a file, or of the one of that name.

    Raises ReadError, RequestError.
    """
    content = comm.on_each(lambda: read_slice(path, Slice(comm.rank, comm.size), mesh))
    said = list(content.said)
    for what, used, defined in (
        ("cells", content.cell_family, content.cell_families),
        ("nodes", content.node_family, content.node_families),
    ):
        said += families.undefined(np.unique(comm.gather(np.unique(used))), defined, what)
    node_number, cell_number = content.numbers(comm, said)
    return MeshSlice(
        rows=content.rows,
        points=content.points,
        space_dim=content.space_dim,
        node_number=node_number,
        cells=tuple(CellRows(c.kind.type, c.rows, c.nodes) for c in content.cells),
        cell_number=cell_number,
        cell_place=None,
        cell_groups=families.members(content.cell_family, content.cell_families),
        node_groups=families.members(content.node_family, content.node_families),
        cell_data=content.data.cell_data,
        node_data=content.data.node_data,
        noted={"name": content.name, "steps": content.data.steps, **content.noted},
        said=(f"{path}: {'; '.join(said)}",) if said else (),
    )


def with_zones(content: MeshSlice) -> MeshSlice:
    """Return a whole mesh with names for the zones of a cut that is recorded without them."""
    if content.noted.get("zones"):
        return content
    return replace(content, noted={**content.noted, "zones": zone_names(content.cell_data, content.cell_groups)})


def read_slice(path: Path, piece: Slice, mesh: str | None = None) -> MedSlice:
    """Read a slice of the mesh of a file, or of the one of that name, by itself. Raises ReadError, RequestError."""
    with opened(path) as root:
        _check_version(root)
        return _read_slice(root, _chosen(root, mesh), piece)


def _read_slice(root: Branch, name: Name, piece: Slice) -> MedSlice:
    said: list[str] = []
    home = root.branch("ENS_MAA").branch(name)
    if home.integer("TYP", 0) != 0:
        raise home.error("is a structured grid, which is not read; turn it into cells (MEDCoupling: buildUnstructured)")
    step = _step(home, said)
    points, space_dim, rows = read_points(home, step, piece)
    nodes = step.branch("NOE")
    cells = read_cells(step, rows.size, piece, said)
    of_cells, of_nodes = families.read(root, home, name, said)
    starts = np.cumsum([0, *(len(c.nodes) for c in cells)]).tolist()
    supports = {c.support: fields.Support(c.rows, start) for c, start in zip(cells, starts, strict=False)}
    supports["NOE"] = fields.Support(rows, 0)
    data = fields.read(root, name, supports, {"NOE": rows.n, "MAI": starts[-1]}, said)
    noted = notes.read(root, text(name), rows.size, said)
    if "group_tags" in noted:  # another program may have taken groups away
        there = {group for names in of_cells.values() for group in names}
        noted["group_tags"] = {group: tags for group, tags in noted["group_tags"].items() if group in there}
    _say_not_carried(root, home, step, said)
    return MedSlice(
        name=text(name),
        rows=rows,
        points=points,
        space_dim=space_dim,
        node_number=number_in(nodes, rows),
        node_family=family_in(nodes, rows),
        cells=tuple(cells),
        cell_families=of_cells,
        node_families=of_nodes,
        data=data,
        noted=noted,
        said=tuple(said),
    )


def _check_version(root: Branch) -> None:
    if not root.has("INFOS_GENERALES"):
        raise ReadError(root.path, "is an HDF5 file, but not MED (it has no INFOS_GENERALES)")
    infos = root.branch("INFOS_GENERALES")
    version = infos.integer("MAJ"), infos.integer("MIN", 0)
    if not (2, 2) <= version < (5, 0):
        raise infos.error(f"MED version {version[0]}.{version[1]} is not read; versions 2.2 to 4.2 are")


def _chosen(root: Branch, wanted: str | None) -> Name:
    """The link to the mesh of that name, or to the only one."""
    links = {text(name): name for name in root.branch("ENS_MAA").names()} if root.has("ENS_MAA") else {}
    if not links:
        raise ReadError(root.path, "holds no mesh")
    if wanted is None and len(links) > 1:
        raise RequestError(f"{root.path} holds {len(links)} meshes, say which: {', '.join(sorted(links))}")
    if wanted is not None and wanted not in links:
        raise RequestError(f"{root.path} holds no mesh named {wanted!r}{did_you_mean(wanted, links)}")
    return links[wanted] if wanted is not None else next(iter(links.values()))


def _step(home: Branch, said: list[str]) -> Branch:
    """Group that holds nodes and cells: the mesh's step without a number, else its first; in MED 2.3 the mesh."""
    if any(home.has(place) for place in ("NOE", *ENTITIES)):
        return home
    steps = [step for _, step in home.branches() if step.has_attribute("NDT")]
    if not steps:
        raise home.error("has neither nodes nor steps")
    timeless = [step for step in steps if (step.integer("NDT"), step.integer("NOR", -1)) == (-1, -1)]
    if len(steps) > 1:
        said.append(f"only one of the {len(steps)} steps of the mesh is read")
    return (timeless or steps)[0]


def _distinct(number: Ints | None, counted: Ints, what: str, comm: Communicator, said: list[str]) -> Ints:
    """The file's numbers if they are distinct, else `counted`."""
    if number is None:
        return counted
    again = repeated(number, comm)
    if again is None:
        return number
    said.append(f"{what} are numbered from 1, the file gives several the number {again}")
    return counted


def _say_not_carried(root: Branch, home: Branch, step: Branch, said: list[str]) -> None:
    for name, what in _NOT_CARRIED.items():
        if any(place.has(name) and place.branch(name).names() for place in (root, home, step)):
            said.append(f"{what} are left out")


# ---- points and cells of a MED file, or of a slice of it: some rows of each of its arrays


_OF_NAME = {kind.name: kind for kind in MED_TYPES}
#: Where a file may keep cells: as cells, or in old files as faces and edges (the first that has a type counts).
ENTITIES = ("MAI", "FAC", "ARE")


class Cells(NamedTuple):
    """Cells of one type, those in `rows` of all in the file: nodes (k, n) from 0, and families (k,).

    `number` (k,): those in the file, None if it has none.
    """

    kind: MedType
    support: str
    rows: RowRange
    nodes: Ints
    number: Ints | None
    family: Ints


def read_points(home: Branch, step: Branch, piece: Slice) -> tuple[Floats, int, RowRange]:
    """Points (k, 3), the number of coordinates in the file (2 if it has one), and the rows that these points are."""
    nodes = step.branch("NOE")
    size = nodes.count("COO", "f")
    counted = nodes.has_attribute("NBR", of="COO")
    n = nodes.integer("NBR", of="COO") if counted else -1
    dim = home.integer("ESP", size // n if n > 0 else home.integer("DIM"))
    if not counted and 1 <= dim <= 3:
        n = size // dim
    if not 1 <= dim <= 3 or size != n * dim:
        raise nodes.error(f"holds {size} values for {n} nodes in {dim} dimensions", "COO")
    if home.integer("REP", nodes.integer("REP", 0, of="COO")) != 0:
        raise nodes.error("is cylindrical or spherical; only Cartesian coordinates are read", "COO")
    rows = piece.rows(n)
    points = np.zeros((rows.n, 3))
    points[:, :dim] = nodes.reals("COO", size, rows).reshape(dim, -1).T
    finite = np.isfinite(points)
    if not finite.all():
        bad = np.flatnonzero(~finite.all(axis=1))
        number = number_in(nodes, rows)
        names = some(rows.start + bad + 1 if number is None else number[bad])
        raise nodes.error(f"the coordinates of nodes {names} are not finite numbers", "COO")
    return points, max(dim, 2), rows


def read_cells(step: Branch, n_nodes: int, piece: Slice, said: list[str]) -> list[Cells]:
    """The cells of each type that a slice has, in the order of the file where it has one, else in libmed's."""
    cells_of: dict[str, Cells] = {}
    named = step.branch("NOE").has("NOM")
    for entity in ENTITIES:
        for link in _in_order(step.branch(entity)) if step.has(entity) else ():
            name = text(link)
            part = step.branch(entity).branch(link)
            named = named or part.has("NOM")
            if name in cells_of:
                said.append(f"{entity}/{name} is left out, {cells_of[name].support} has such cells too")
            elif (cells := _read_type(part, entity, name, n_nodes, piece)) is not None:
                cells_of[name] = cells
    if named:
        said.append("names of single nodes and cells are left out")
    return list(cells_of.values())


def _in_order(inside: Branch) -> list[Name]:
    order = {kind.name: k for k, kind in enumerate(MED_TYPES)}
    names = inside.names()
    return names if inside.ordered else sorted(names, key=lambda n: order.get(text(n), len(order)))


def _read_type(part: Branch, entity: str, name: str, n_nodes: int, piece: Slice) -> Cells | None:
    """The cells of one type; None where there are none."""
    if name not in _OF_NAME:
        raise part.error(f"{NOT_READ.get(name, f'cells of type {name}')} are not read")
    kind = _OF_NAME[name]
    width = len(kind.nodes)
    if not part.has("NOD"):
        if part.has("DES"):
            raise part.error("gives cells by their faces (descending connectivity), which is not read")
        return None
    size = part.count("NOD", "iu")
    n = part.integer("NBR", size // width, of="NOD")
    if n < 0 or size != n * width:
        raise part.error(f"holds {size} values for {n} cells of {width} nodes", "NOD")
    if n == 0:
        return None
    rows = piece.rows(n)
    values = part.integers("NOD", size, rows)
    if values.min(initial=1) < 1 or values.max(initial=1) > n_nodes:
        raise _stray_node(part, kind, values, n_nodes, rows)
    nodes = np.empty((rows.n, width), np.int64)
    nodes[:, kind.nodes] = values.reshape(width, -1).T
    nodes -= 1
    return Cells(kind, f"{entity}.{name}", rows, nodes, number_in(part, rows), family_in(part, rows))


def _stray_node(part: Branch, kind: MedType, values: Ints, n_nodes: int, rows: RowRange) -> ReadError:
    """The error for a cell one of whose nodes, counted from 1, is not there."""
    place = int(((values < 1) | (values > n_nodes)).argmax())
    number = number_in(part, rows)
    cell = rows.start + place % rows.n + 1 if number is None else number[place % rows.n]
    return part.error(f"the {kind.type} {cell} has node {values[place]}, and there are {n_nodes} nodes", "NOD")


def number_in(part: Branch, rows: RowRange) -> Ints | None:
    """Numbers of some nodes, or cells of a type; None if the file has none."""
    return part.integers("NUM", rows.size, rows).astype(np.int64) if part.has("NUM") else None


def family_in(part: Branch, rows: RowRange) -> Ints:
    """Families of some nodes, or cells of a type; 0 if the file has none."""
    return part.integers("FAM", rows.size, rows).astype(np.int64) if part.has("FAM") else np.zeros(rows.n, np.int64)
