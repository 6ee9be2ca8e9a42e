"""Parts of several writers: the cells of a mesh in the order of a file, and what a format has no place for."""

from __future__ import annotations

from collections.abc import Container, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from lacmesh.cutting.records import without_records
from lacmesh.errors import WriteError
from lacmesh.mesh import Block, Ints, Mesh


def file_order(mesh: Mesh) -> Ints:
    """Indices of the cells (n_cells,) in the order of the file."""
    return np.arange(mesh.n_cells) if mesh.file_order is None else np.asarray(mesh.file_order)


def blocks_in_order(mesh: Mesh) -> Iterator[tuple[Block, int, Ints]]:
    """Yield each block that has cells, the index of its first cell, and the indices of all in the order of the file."""
    order = file_order(mesh)
    for block, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets.tolist()), strict=True):
        if lo < hi:
            yield block, lo, order[lo:hi] if mesh.file_order is None else order[(order >= lo) & (order < hi)]


def is_plane(mesh: Mesh) -> bool:
    """True if two coordinates say all of a mesh: it is of two dimensions, has no solids, and z is 0."""
    return mesh.space_dim == 2 and mesh.dim < 3 and not np.any(mesh.points[:, 2])


def check_types(path: Path, mesh: Mesh, known: Container[str], whose: str) -> None:
    """Raise WriteError where the mesh has cells of a type that is none of the `known` ones of a program or format."""
    for cell_type, n in mesh.cells_by_type.items():
        if cell_type not in known:
            what = "write them as PYRAM13" if cell_type == "PYRAM14" else "lower their order"
            message = f"{whose} has no cells of type {cell_type}, the mesh has {n}; {what}, or write a .msh file"
            raise WriteError(path, message)


def left_out(mesh: Mesh) -> list[str]:
    """Clauses that name what such a format loses of a mesh, none if nothing; records of a cut go into a note."""
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
