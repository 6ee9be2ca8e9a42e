"""MED (Salome, code_aster), versions 2.3 to 4.2 read, 4.1.1 written, on h5py.

Why our own, measured on the 1778 MED files of code_aster's tests: meshio inverts 3D cells and loses groups, gmsh
loses node groups and orphan nodes, medcoupling aborts the process on a third of damaged files and has no wheel for
macOS and aarch64. Version 4.1.1 is the newest that gmsh reads.

A mesh keeps its name, points, 2 or 3 coordinates, numbers, groups of nodes and cells (empty and overlapping ones too)
and data; descriptions, units and the names of components are dropped silently. MED stores cells by type, and
arrays component by component: all first nodes of the cells, then all second nodes.
"""

from __future__ import annotations

import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from lacmesh.errors import LacmeshWarning, ReadError, RequestError, WriteError, did_you_mean, some
from lacmesh.formats.med import families, fields, notes
from lacmesh.formats.med.hdf5 import (
    Branch,
    Name,
    add_array,
    add_group,
    compact,
    created,
    encoded,
    opened,
    text,
)
from lacmesh.formats.med.types import MED_TYPES, NOT_READ, MedType
from lacmesh.formats.notes import zone_names
from lacmesh.mesh import Floats, Ints, Mesh

_OF_NAME = {kind.name: kind for kind in MED_TYPES}
_OF_TYPE = {kind.type: kind for kind in MED_TYPES}
#: Where a file may keep cells: as cells, or in old files as faces and edges (the first that has a type counts).
_ENTITIES = ("MAI", "FAC", "ARE")
#: Parts of a file, or of a mesh, that no Mesh holds.
_NOT_CARRIED = {
    "EQS": "equivalences",
    "JNT": "joints",
    "NUM_DATA": "parameters",
    "LIENS": "links to other files",
    "STR": "structure elements",
    "INTERP": "interpolation functions",
}


def read(path: Path, mesh: str | None = None) -> Mesh:
    """Read the mesh of a MED file, or the one named `mesh` if it has several.

    Raises ReadError for a file that is damaged or holds what a Mesh cannot (polygons, grids); RequestError for the
    choice of the mesh. What is left out is named in one LacmeshWarning.
    """
    said: list[str] = []
    with opened(path) as root:
        _check_version(root)
        chosen = _read_mesh(root, _chosen(root, mesh), said)
    _say(path, said)
    return chosen


def _say(path: Path | None, said: list[str]) -> None:
    if said:
        where = f"{path}: " if path else "MED: "
        warnings.warn(where + "; ".join(said), LacmeshWarning, stacklevel=3)


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


class _Cells(NamedTuple):
    """All cells of one type in the file: nodes (k, n) from 0, numbers and families (k,) where the file has them."""

    kind: MedType
    support: str
    nodes: Ints
    number: Ints | None
    family: Ints


def _read_mesh(root: Branch, name: Name, said: list[str]) -> Mesh:
    home = root.branch("ENS_MAA").branch(name)
    if home.integer("TYP", 0) != 0:
        raise home.error("is a structured grid, which is not read; turn it into cells (MEDCoupling: buildUnstructured)")
    step = _step(home, said)
    points, space_dim = _read_points(home, step)
    nodes = step.branch("NOE")
    cells = _read_cells(step, len(points), said)
    of_cells, of_nodes = families.read(root, home, name, said)
    cell_family = np.concatenate([np.empty(0, np.int64), *(c.family for c in cells)])
    cell_groups = families.members(cell_family, of_cells, "cells", said)
    node_groups = families.members(_family(nodes, len(points)), of_nodes, "nodes", said)
    bounds = np.cumsum([0, *(len(c.nodes) for c in cells)])
    supports = {c.support: np.arange(lo, hi) for c, (lo, hi) in zip(cells, pairwise(bounds), strict=True)}
    supports["NOE"] = np.arange(len(points))
    data = fields.read(root, name, supports, {"NOE": len(points), "MAI": int(bounds[-1])}, said)
    noted = notes.read(root, text(name), len(points), said)
    if "group_tags" in noted:  # another program may have taken groups away
        noted["group_tags"] = {name: tags for name, tags in noted["group_tags"].items() if name in cell_groups}
    if not noted.get("zones"):
        noted["zones"] = zone_names(data.cell_data, cell_groups)
    _say_not_carried(root, home, step, said)
    return Mesh.create(
        points,
        [(c.kind.type, c.nodes) for c in cells],
        space_dim=space_dim,
        node_number=_distinct(_number(nodes, len(points)), np.arange(1, len(points) + 1), "nodes", said),
        cell_number=_cell_numbers(cells, said),
        cell_groups=cell_groups,
        node_groups=node_groups,
        name=text(name),
        **data._asdict(),
        **noted,
    )


def _step(home: Branch, said: list[str]) -> Branch:
    """Group that holds nodes and cells: the mesh's step without a number, else its first; in MED 2.3 the mesh."""
    if any(home.has(place) for place in ("NOE", *_ENTITIES)):
        return home
    steps = [step for _, step in home.branches() if step.has_attribute("NDT")]
    if not steps:
        raise home.error("has neither nodes nor steps")
    timeless = [step for step in steps if (step.integer("NDT"), step.integer("NOR", -1)) == (-1, -1)]
    if len(steps) > 1:
        said.append(f"only one of the {len(steps)} steps of the mesh is read")
    return (timeless or steps)[0]


def _read_points(home: Branch, step: Branch) -> tuple[Floats, int]:
    """Points (n, 3), and the number of coordinates in the file (2 if it has one)."""
    nodes = step.branch("NOE")
    values = nodes.reals("COO")
    counted = nodes.has_attribute("NBR", of="COO")
    n = nodes.integer("NBR", of="COO") if counted else -1
    dim = home.integer("ESP", len(values) // n if n > 0 else home.integer("DIM"))
    if not counted and 1 <= dim <= 3:
        n = len(values) // dim
    if not 1 <= dim <= 3 or len(values) != n * dim:
        raise nodes.error(f"holds {len(values)} values for {n} nodes in {dim} dimensions", "COO")
    if home.integer("REP", nodes.integer("REP", 0, of="COO")) != 0:
        raise nodes.error("is cylindrical or spherical; only Cartesian coordinates are read", "COO")
    points = np.zeros((n, 3))
    points[:, :dim] = values.reshape(dim, n).T
    finite = np.isfinite(points)
    if not finite.all():
        bad = np.flatnonzero(~finite.all(axis=1))
        number = _number(nodes, n)
        names = some(bad + 1 if number is None else number[bad])
        raise nodes.error(f"the coordinates of nodes {names} are not finite numbers", "COO")
    return points, max(dim, 2)


def _read_cells(step: Branch, n_nodes: int, said: list[str]) -> list[_Cells]:
    """The cells of each type, in the order of the file where it has one, else in libmed's."""
    cells_of: dict[str, _Cells] = {}
    named = step.branch("NOE").has("NOM")
    for entity in _ENTITIES:
        for link in _in_order(step.branch(entity)) if step.has(entity) else ():
            name = text(link)
            part = step.branch(entity).branch(link)
            named = named or part.has("NOM")
            if name in cells_of:
                said.append(f"{entity}/{name} is left out, {cells_of[name].support} has such cells too")
            elif (cells := _read_type(part, entity, name, n_nodes)) is not None:
                cells_of[name] = cells
    if named:
        said.append("names of single nodes and cells are left out")
    return list(cells_of.values())


def _in_order(inside: Branch) -> list[Name]:
    order = {kind.name: k for k, kind in enumerate(MED_TYPES)}
    names = inside.names()
    return names if inside.ordered else sorted(names, key=lambda n: order.get(text(n), len(order)))


def _read_type(part: Branch, entity: str, name: str, n_nodes: int) -> _Cells | None:
    """The cells of one type; None where there are none."""
    if name not in _OF_NAME:
        raise part.error(f"{NOT_READ.get(name, f'cells of type {name}')} are not read")
    kind = _OF_NAME[name]
    width = len(kind.nodes)
    if not part.has("NOD"):
        if part.has("DES"):
            raise part.error("gives cells by their faces (descending connectivity), which is not read")
        return None
    values = part.integers("NOD")
    n = part.integer("NBR", len(values) // width, of="NOD")
    if n < 0 or len(values) != n * width:
        raise part.error(f"holds {len(values)} values for {n} cells of {width} nodes", "NOD")
    if n == 0:
        return None
    if values.min() < 1 or values.max() > n_nodes:
        raise _stray_node(part, kind, values, n_nodes)
    nodes = np.empty((n, width), np.int64)
    nodes[:, kind.nodes] = values.reshape(width, n).T
    nodes -= 1
    return _Cells(kind, f"{entity}.{name}", nodes, _number(part, n), _family(part, n))


def _stray_node(part: Branch, kind: MedType, values: Ints, n_nodes: int) -> ReadError:
    """The error for a cell one of whose nodes, counted from 1, is not there."""
    n = len(values) // len(kind.nodes)
    place = int(((values < 1) | (values > n_nodes)).argmax())
    number = _number(part, n)
    cell = place % n + 1 if number is None else number[place % n]
    return part.error(f"the {kind.type} {cell} has node {values[place]}, and there are {n_nodes} nodes", "NOD")


def _number(part: Branch, size: int) -> Ints | None:
    return part.integers("NUM", size).astype(np.int64) if part.has("NUM") else None


def _family(part: Branch, size: int) -> Ints:
    return part.integers("FAM", size).astype(np.int64) if part.has("FAM") else np.zeros(size, np.int64)


def _cell_numbers(cells: list[_Cells], said: list[str]) -> Ints:
    """Cell numbers (n_cells,): the file's, or counted in libmed's order of types for a type that has none."""
    first: dict[str, int] = {}
    for c in sorted(cells, key=lambda c: c.kind.bit):
        first[c.support] = 1 + sum(len(other.nodes) for other in cells if other.support in first)
    counted = [first[c.support] + np.arange(len(c.nodes)) for c in cells]
    given = [by_count if c.number is None else c.number for c, by_count in zip(cells, counted, strict=True)]
    none = np.empty(0, np.int64)
    return _distinct(np.concatenate([none, *given]), np.concatenate([none, *counted]), "cells", said)


def _distinct(number: Ints | None, counted: Ints, what: str, said: list[str]) -> Ints:
    """The file's numbers if they are distinct, else `counted`."""
    if number is None:
        return counted
    if (np.diff(number) > 0).all():
        return number
    ordered = np.sort(number)
    again = ordered[1:][ordered[1:] == ordered[:-1]]
    if not len(again):
        return number
    said.append(f"{what} are numbered from 1, the file gives several the number {again[0]}")
    return counted


def _say_not_carried(root: Branch, home: Branch, step: Branch, said: list[str]) -> None:
    for name, what in _NOT_CARRIED.items():
        if any(place.has(name) and place.branch(name).names() for place in (root, home, step)):
            said.append(f"{what} are left out")


def write(path: Path, mesh: Mesh) -> None:
    """Write a mesh as MED 4.1.1, replacing what `path` holds.

    Cells go by type, within a type as in `mesh.file_order`. Raises WriteError for cells or names that MED cannot hold;
    what is changed or left out is named in one LacmeshWarning.
    """
    said: list[str] = []
    _check(path, mesh)
    name = fields.title(path, mesh.name or "mesh", "mesh", said)
    cells = _in_file_order(mesh)
    cell_family, cell_families = families.derive(mesh.cell_groups, mesh.cell_dim)
    node_family, node_families = families.derive(mesh.node_groups, np.zeros(mesh.n_nodes, np.int8))
    with created(path) as root:
        add_group(root, "INFOS_GENERALES", MAJ=4, MIN=1, REL=1)
        step = _write_home(root, mesh, name)
        _write_nodes(step, mesh, node_family)
        _write_cells(step, mesh, cells, -cell_family)
        home = add_group(add_group(root, "FAS"), name)
        add_group(home, "FAMILLE_ZERO", NUM=0)
        families.write(home, "ELEME", cell_families, -1)
        families.write(home, "NOEUD", node_families, 1)
        fields.write(root, mesh, name, cells, said)
        notes.write(root, mesh, name)
    _say(None, said)  # `path` may stand for another file (`formats.write`)


def _check(path: Path, mesh: Mesh) -> None:
    for cell_type, n in mesh.cells_by_type.items():
        if cell_type not in _OF_TYPE:
            what = "write them as PYRAM13" if cell_type == "PYRAM14" else "lower their order"
            raise WriteError(
                path, f"MED has no cells of type {cell_type}, the mesh has {n}; {what}, or write a .msh file"
            )
    for name in (*mesh.cell_groups, *mesh.node_groups):
        if len(encoded(name)) > families.NAME_SIZE:
            raise WriteError(path, f"a group's name has {families.NAME_SIZE} bytes at most in MED; shorten {name!r}")
        if text(name) != name or not name:
            raise WriteError(
                path, f"MED cannot hold the group name {name!r} (empty, a blank at the end or NUL); rename it"
            )


def _in_file_order(mesh: Mesh) -> list[tuple[MedType, Ints]]:
    """The types present, with the indices of their cells as they go to the file."""
    order = np.arange(mesh.n_cells) if mesh.file_order is None else np.asarray(mesh.file_order)
    cells = []
    for block, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True):
        if len(block.nodes):
            here = order[lo:hi] if mesh.file_order is None else order[(order >= lo) & (order < hi)]
            cells.append((_OF_TYPE[block.type], here))
    return cells


def _write_home(root: h5py.Group, mesh: Mesh, name: str) -> h5py.Group:
    """The group of the mesh, and in it that of its only step."""
    esp = _coordinates(mesh)
    dim = mesh.dim if mesh.n_cells else esp
    blank = " " * (16 * esp)
    home = add_group(
        add_group(root, "ENS_MAA"),
        name,
        **{"DIM": dim, "ESP": esp, "REP": 0, "SRT": 0, "TYP": 0, "NXI": -1, "NXT": -1},
        **{"DES": "", "NOM": blank, "UNI": blank, "UNT": ""},
    )
    step: dict[str, Any] = {"CGT": 1, "NDT": -1, "NOR": -1, "NXI": -1, "NXT": -1, "PDT": 0.0, "PVI": -1, "PVT": -1}
    return add_group(home, f"{-1:020d}{-1:020d}", **step)


def _coordinates(mesh: Mesh) -> int:
    return 2 if mesh.space_dim == 2 and mesh.dim < 3 and not np.any(mesh.points[:, 2]) else 3


def _write_nodes(step: h5py.Group, mesh: Mesh, family: Ints) -> None:
    n = mesh.n_nodes
    nodes = add_group(step, "NOE", CGT=1, CGS=1, PFL=fields.NO_PROFILE)
    add_array(nodes, "COO", mesh.points[:, : _coordinates(mesh)].T.astype(float).reshape(-1), CGT=1, NBR=n)
    add_array(nodes, "FAM", family, CGT=1, NBR=n)
    add_array(nodes, "NUM", compact(mesh.node_number), CGT=1, NBR=n)


def _write_cells(step: h5py.Group, mesh: Mesh, cells: list[tuple[MedType, Ints]], family: Ints) -> None:
    if not cells:
        return
    home = add_group(step, "MAI", CGT=1)
    firsts = {b.type: lo for b, (lo, _) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True)}
    for kind, here in cells:
        n = len(here)
        nodes = mesh.block(kind.type)
        if mesh.file_order is not None:
            nodes = nodes[here - firsts[kind.type]]
        values = np.empty((len(kind.nodes), n), np.int32 if mesh.n_nodes < 2**31 else np.int64)
        values[:] = nodes.T[list(kind.nodes)]
        values += 1
        part = add_group(home, kind.name, CGT=1, CGS=1, GEO=kind.geo, PFL=fields.NO_PROFILE)
        add_array(part, "NOD", values.reshape(-1), CGT=1, NBR=n)
        add_array(part, "FAM", family[here], CGT=1, NBR=n)
        add_array(part, "NUM", compact(mesh.cell_number[here]), CGT=1, NBR=n)
