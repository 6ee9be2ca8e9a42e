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
from typing import Any

import h5py
import numpy as np

from lacmesh.errors import LacmeshWarning, WriteError
from lacmesh.formats.med import families, fields, notes, reader
from lacmesh.formats.med.hdf5 import add_array, add_group, compact, created, encoded, text
from lacmesh.formats.med.types import MED_TYPES, MedType
from lacmesh.formats.table import DEFAULT, WriteOptions
from lacmesh.formats.writing import blocks_in_order, check_types, is_plane
from lacmesh.mesh import Ints, Mesh

_OF_TYPE = {kind.type: kind for kind in MED_TYPES}


def read(path: Path, mesh: str | None = None) -> Mesh:
    """Read the mesh of a MED file, or the one named `mesh` if it has several.

    Raises ReadError for a file that is damaged or holds what a Mesh cannot (polygons, grids); RequestError for the
    choice of the mesh. What is left out is named in one LacmeshWarning.
    """
    content = reader.slice_of(path, mesh=mesh)
    for message in content.said:
        warnings.warn(message, LacmeshWarning, stacklevel=2)
    return reader.with_zones(content).mesh()


def write(path: Path, mesh: Mesh, options: WriteOptions = DEFAULT) -> None:
    """Write a mesh as MED 4.1.1, replacing what `path` holds.

    Cells go by type, within a type as in `mesh.file_order`. Raises WriteError for cells or names that MED cannot hold;
    what is changed or left out is named in one LacmeshWarning.
    """
    said: list[str] = []
    _check(path, mesh)
    name = fields.title(path, mesh.name or "mesh", "mesh", said)
    cells = [(_OF_TYPE[block.type], here) for block, _, here in blocks_in_order(mesh)]
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
    if said:  # `path` may stand for another file (`formats.write`)
        warnings.warn("MED: " + "; ".join(said), LacmeshWarning, stacklevel=2)


def _check(path: Path, mesh: Mesh) -> None:
    check_types(path, mesh, _OF_TYPE, "MED")
    for name in (*mesh.cell_groups, *mesh.node_groups):
        if len(encoded(name)) > families.NAME_SIZE:
            raise WriteError(path, f"a group's name has {families.NAME_SIZE} bytes at most in MED; shorten {name!r}")
        if text(name) != name or not name:
            raise WriteError(
                path, f"MED cannot hold the group name {name!r} (empty, a blank at the end or NUL); rename it"
            )


def _write_home(root: h5py.Group, mesh: Mesh, name: str) -> h5py.Group:
    """The group of the mesh, and in it that of its only step."""
    esp = 2 if is_plane(mesh) else 3
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


def _write_nodes(step: h5py.Group, mesh: Mesh, family: Ints) -> None:
    n = mesh.n_nodes
    nodes = add_group(step, "NOE", CGT=1, CGS=1, PFL=fields.NO_PROFILE)
    add_array(nodes, "COO", mesh.points[:, : 2 if is_plane(mesh) else 3].T.astype(float).reshape(-1), CGT=1, NBR=n)
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
