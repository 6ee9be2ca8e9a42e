"""The parts of a mesh in a folder: one file of NumPy arrays (.npz), of which a process reads those of its own pieces.

A piece is the part of a rank without skins, or a skin with all cells that touch it; a node or cell that several pieces
have is in each of them. The file has `header`, JSON with sizes, names, types and notes (`formats.notes`), and for each
piece p, first those of the ranks, then those of the skins:

    p/node, p/cell                  indices in the whole mesh, ascending
    p/node_number, cell_number ...  a row for each node or cell: of numbers, data0, data1 ..., groups (a bit each);
                                    of nodes points, owner and body; of cells their place in the order of the file
    p/type0 ...                     nodes of the cells of each type, by their indices in the whole mesh
"""

from __future__ import annotations

import json
import os
import warnings
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import GroupNotFoundError, LacmeshWarning, ReadError, RequestError, WriteError, writing
from lacmesh.formats.notes import dump, load, parse
from lacmesh.formats.output import check_place, replacing
from lacmesh.mesh import Ints, Mesh, positions
from lacmesh.partition.parts import Part, bodies_of, cells_of_skin, figures_of, needed, skin_name

#: the name of the file in the folder, and the version of its layout
FILE, VERSION = "parts.npz", 3
#: what the note in the header has of a mesh; nodes are given by their indices, from 1 on
_NOTED = ("name", "zones", "group_tags", "steps", "model")
#: what a damaged file may raise
_DAMAGE = (ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError, EOFError, OSError, MemoryError)
_DAMAGE += (NotImplementedError, RuntimeError, zipfile.BadZipFile, zlib.error)  # type: ignore[assignment]


def write_parts(folder: str | os.PathLike[str], mesh: Mesh, owner: Ints, *, force: bool = False) -> None:
    """Write the parts of a mesh into a folder, which is made if it is not there; `force` replaces those there.

    `owner` (n_nodes,): the rank that owns each node, as by `distribute_nodes`. Data that are no numbers are left out,
    with a LacmeshWarning. Raises RequestError for parts that would be lost, WriteError.
    """
    folder = Path(folder)
    check_folder(folder, force=force)
    with writing(folder, "cannot be made"):
        folder.mkdir(exist_ok=True)
    try:
        with replacing(folder / FILE) as (beside,), zipfile.ZipFile(beside, "w") as file:
            for name, values in _arrays(mesh, owner):
                with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, values, allow_pickle=False)
    finally:
        with suppress(OSError):
            folder.rmdir()  # which only removes an empty one


def check_folder(folder: Path, *, force: bool) -> None:
    """Check early that parts can be written into a folder. Raises RequestError, WriteError."""
    there = folder.is_dir()
    check_place(folder / FILE if there else folder, force=force or not there)
    if folder.exists() and not there:
        raise WriteError(folder, "is a file; name a folder")


def _arrays(mesh: Mesh, owner: Ints) -> Iterator[tuple[str, NDArray]]:
    """Yield the names and arrays of the file; the header, which has the sizes of all pieces, is the last."""
    body, own_nodes = bodies_of(mesh), np.bincount(owner)
    skins = [name for name in mesh.cell_groups if mesh.group_dim(name) < mesh.dim]
    if not mesh.cell_groups:
        skins = [f"entity:{dim}:{tag}" for dim, tag in mesh.entities if dim < mesh.dim]
    data = {"node": mesh.node_data, "cell": mesh.cell_data}
    others = [name for values in data.values() for name in values if values[name].dtype.kind not in "biufc"]
    if others:
        warnings.warn(LacmeshWarning(f"data that are no numbers are left out: {', '.join(others)}"), stacklevel=2)
        data = {on: {k: v for k, v in values.items() if v.dtype.kind in "biufc"} for on, values in data.items()}
    columns: dict[str, dict[str, NDArray]] = {
        "node": {"points": mesh.points, "owner": owner, "body": body, "number": mesh.node_number},
        "cell": {"number": mesh.cell_number},
    }
    if mesh.file_order is not None:
        columns["cell"]["place"] = np.argsort(mesh.file_order)
    columns["node"]["groups"] = _membership(mesh.node_groups, mesh.n_nodes)
    columns["cell"]["groups"] = _membership(mesh.cell_groups, mesh.n_cells)
    for on, values in data.items():
        columns[on] |= {f"data{k}": column for k, column in enumerate(values.values())}
    sizes = []
    for piece, indices in enumerate(_pieces(mesh, owner, len(own_nodes), skins)):
        for (on, of_all), index in zip(columns.items(), indices, strict=True):
            yield f"{piece}/{on}", index
            for name, column in of_all.items():
                yield f"{piece}/{on}_{name}", column[index]
        cells = np.split(indices[1], np.searchsorted(indices[1], mesh.offsets[1:-1]))
        for k, block in enumerate(mesh.blocks):
            yield f"{piece}/type{k}", block.nodes[cells[k] - mesh.offsets[k]]
        sizes.append([len(index) for index in indices])
    header = {
        "version": VERSION,
        "figures": figures_of(mesh, body),
        "skins": skins,
        "own_nodes": own_nodes,
        "sizes": sizes,
        "space_dim": mesh.space_dim,
        "plane": mesh.plane,
        "groups": {"node": list(mesh.node_groups), "cell": list(mesh.cell_groups)},
        "data": {on: list(names) for on, names in data.items()},
        "note": dump(mesh, *_NOTED, node_number=np.arange(mesh.n_nodes) + 1),
    }
    yield "header", np.frombuffer(json.dumps(header, default=np.ndarray.tolist).encode(), np.uint8)


def _membership(groups: Mapping[str, Ints], size: int) -> NDArray[np.uint8]:
    """Return the groups of each node or cell, (size, k): a bit for each group, eight in a byte."""
    bits = np.zeros((size, (len(groups) + 7) // 8), np.uint8)
    for k, members in enumerate(groups.values()):
        bits[members, k // 8] |= 1 << k % 8
    return bits


def _pieces(mesh: Mesh, owner: Ints, n_ranks: int, skins: Sequence[str]) -> Iterator[tuple[Ints, Ints]]:
    """Yield the nodes and cells, ascending, that each rank needs, then those of each skin and around it."""
    for rank in range(n_ranks):
        yield needed(mesh, owner == rank)
    for name in skins:
        cells = np.flatnonzero(cells_of_skin(mesh, name))
        yield mesh.nodes_on(cells), cells


# ---- reading


class _Rows:
    """The rows of some pieces `on` nodes or cells, each once: `index` (k,) in the whole mesh, ascending."""

    def __init__(self, file: Mapping[str, NDArray], header: Mapping[str, Any], pieces: Sequence[int], on: str) -> None:
        self._file, self._header, self._pieces, self._on = file, header, pieces, on
        self._read = self._joined(on)
        self.index, self._first = np.unique(self._read, return_index=True)

    def _joined(self, name: str) -> NDArray:
        return np.concatenate([self._file[f"{piece}/{name}"] for piece in self._pieces])

    def column(self, name: str) -> NDArray:
        """Return the values (k, ...) of a column."""
        values = self._joined(f"{self._on}_{name}")
        if len(values) != len(self._read):
            raise ValueError(f"{self._on}_{name} has {len(values)} rows, expected {len(self._read)}")
        return values[self._first]

    def nodes(self, number: int, first: int, last: int) -> Ints:
        """Return the nodes of the cells of a type, whose indices are from `first` on and below `last`."""
        of_type = self._read[(self._read >= first) & (self._read < last)]
        return self._joined(f"type{number}")[np.unique(of_type, return_index=True)[1]]

    def fields(self) -> dict[str, Any]:
        """Return the numbers, groups and data of a mesh."""
        on, bits = self._on, self.column("groups")
        groups = enumerate(self._header["groups"][on])
        return {
            f"{on}_number": self.column("number"),
            f"{on}_groups": {name: np.flatnonzero(bits[:, k // 8] >> k % 8 & 1) for k, name in groups},
            f"{on}_data": {name: self.column(f"data{k}") for k, name in enumerate(self._header["data"][on])},
        }


def read_part(folder: str | os.PathLike[str], rank: int, *, everywhere: Sequence[str] = ()) -> Part:
    """Read the part of process `rank` from a folder; the result is that of `part_of` on the whole mesh.

    `everywhere`: groups of skin faces that are in every part, as for `part_of`; any group may be named. Raises
    RequestError for a rank that the folder has no part of, GroupNotFoundError, ReadError.
    """
    with _opened(folder) as (file, header):
        figures, n_ranks = header["figures"], len(header["own_nodes"])
        if not 0 <= rank < n_ranks:
            raise RequestError(f"{folder} has {n_ranks} parts, and no rank {rank}; partition the mesh again")
        note = parse(header["note"] or "{}")
        skins = _named_skins(header, note, everywhere)
        pieces = [rank, *(n_ranks + header["skins"].index(name) for name in skins)]
        node, cell = (_Rows(file, header, pieces, on) for on in ("node", "cell"))
        blocks, last = [], 0
        for k, (kind, count) in enumerate(figures["types"]):
            first, last = last, last + count
            nodes = cell.nodes(k, first, last)
            blocks.append((kind, positions(node.index, nodes).astype(nodes.dtype)))
        mesh = Mesh.create(
            node.column("points"),
            blocks,
            plane=header["plane"],
            space_dim=header["space_dim"],
            file_order=np.argsort(cell.column("place")) if f"{rank}/cell_place" in file else None,
            **node.fields() | {"node_number": node.index + 1},
            **cell.fields(),
        )
        warned: list[str] = []
        mesh = replace(load(mesh, note, warned), node_number=node.column("number"))
        if warned:
            raise ValueError(warned[0])
        figures |= {"types": tuple((kind, count) for kind, count in figures["types"])}
        figures |= {name: np.array(figures[name], float) for name in ("used", "box")}
        owner, body = node.column("owner"), node.column("body")
        return Part(mesh, rank, n_ranks, node.index, owner, cell.index, body, tuple(skins), **figures)


def _named_skins(header: Mapping[str, Any], note: Mapping[str, Any], specs: Sequence[str]) -> list[str]:
    """Return the names of some groups of skin faces. Raises GroupNotFoundError, RequestError."""
    groups = {name: np.empty(0, np.int64) for name in header["groups"]["cell"]}
    empty = load(Mesh.create(np.empty((0, 3)), [], cell_groups=groups), note, [])
    names = [skin_name(empty, spec) for spec in specs]
    for name in names:
        if name not in header["skins"]:
            raise GroupNotFoundError(name, header["skins"], "group of faces")
    return names


def describe_parts(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the contents of a folder of parts as plain data: sizes of the mesh and of its parts, groups of faces.

    `parts`: for each rank the number of its `own_nodes`, of its `nodes` and of its `cells`. `copies`: the mean number
    of copies of a node. Raises ReadError.
    """
    with _opened(folder) as (_, header):
        figures, own = header["figures"], header["own_nodes"]
        nodes, cells = (list(counts) for counts in zip(*header["sizes"][: len(own)], strict=True))
        return {
            "nodes": figures["n_nodes"],
            "cells": sum(count for _, count in figures["types"]),
            "bodies": figures["n_bodies"],
            "skins": header["skins"],
            "copies": sum(nodes) / max(figures["n_nodes"], 1),
            "parts": {"own_nodes": own, "nodes": nodes, "cells": cells},
        }


@contextmanager
def _opened(folder: str | os.PathLike[str]) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Open the file of a folder of parts, and read its header. Raises ReadError, also for damage inside the block."""
    path = Path(folder) / FILE
    if not path.is_file():
        raise ReadError(folder, "is no folder of parts; lacmesh partition makes one")
    try:
        with path.open("rb") as content, np.load(content, allow_pickle=False) as file:
            header = json.loads(file["header"].tobytes())
            if header["version"] != VERSION:
                raise ValueError(f"version {header['version']}, expected {VERSION}")
            yield file, header
    except _DAMAGE as error:
        raise ReadError(path, f"is damaged ({error}); partition the mesh again") from error
