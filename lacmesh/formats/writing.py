"""Parts of several writers: cells in the order of a file, labels for names, and what a format has no place for."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Container, Iterable, Iterator
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


# ---- labels for names that a text format cannot hold: distinct, and as close to the names as possible


def labels(
    names: Iterable[str], allowed: str, limit: int, reserved: Iterable[str] = (), first: str = "A-Za-z"
) -> dict[str, str]:
    """Label for each name, distinct regardless of case; a name that is allowed is its own label.

    `allowed`: characters allowed after the `first` one, written as in the brackets of a regular expression.

    >>> labels(["rive gauche", "Rive_gauche", "été", "2nd"], "A-Za-z0-9_", 24)
    {'rive gauche': 'rive_gauche_2', 'Rive_gauche': 'Rive_gauche', 'été': 'ete', '2nd': 'G_2nd'}
    """
    names = list(names)
    taken = {word.upper() for word in reserved}
    chosen = {}
    plain = {}
    for name in names:
        letters = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
        label = re.sub(rf"[^{allowed}]", "_", letters)
        plain[name] = (label if re.match(rf"[{first}]", label) else f"G_{label}")[:limit]
    for name in sorted(names, key=lambda name: plain[name] != name):  # names that fit come first
        label, k = plain[name], 1
        while label.upper() in taken:
            k += 1
            end = f"_{k}"
            label = plain[name][: limit - len(end)] + end
        taken.add(label.upper())
        chosen[name] = label
    return {name: chosen[name] for name in names}


def changes(chosen: dict[str, str]) -> str:
    """Text that lists the labels that differ from their names, for a warning; empty if none does.

    >>> changes({"a": "a", "b c": "b_c"})
    "'b c' is b_c"
    """
    return ", ".join(f"{name!r} is {label}" for name, label in chosen.items() if name != label)
