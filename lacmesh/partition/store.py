"""The parts of a mesh in a file: a folder with one HDF5 file, of which a process reads a few contiguous ranges of rows.

The file holds the pieces of a mesh (`pieces`), one after the other; a node or cell that several pieces have is written
in each. What is on the nodes is in the group `node`, what is on the cells in `cell`:

    header, notes   JSON: sizes, names and types; the notes that other formats have too (`formats.notes`)
    owned           number of nodes that each rank owns
    start           (n_pieces + 1, columns): rows before each piece: of `index`, of each type of cells, of each group
    index           indices in the whole mesh, ascending in each piece; the rows of the next ones are theirs
    number, points, owner, body, place (in the order of the file), data0, data1 ...
    type0 ...       nodes of the cells of each type, by their indices in the whole mesh
    group0 ...      members of each group, by their indices in the whole mesh
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import GroupNotFoundError, LacmeshWarning, ReadError, RequestError, WriteError, writing
from lacmesh.formats.med.hdf5 import Branch, created, opened
from lacmesh.formats.notes import from_json, to_json
from lacmesh.formats.output import check_place, replacing
from lacmesh.mesh import Ints, Mesh, mask_of, positions
from lacmesh.partition.parts import Part, WholeMesh, bodies_of, periodic_left, skin_name, whole_of
from lacmesh.partition.pieces import PieceIndices, pieces_of

if TYPE_CHECKING:
    import h5py

#: of the file's layout; 2: skins have all cells that touch them
VERSION = 2
#: the name of the file in the folder
FILE = "parts.h5"


def write_parts(folder: str | os.PathLike[str], mesh: Mesh, owner: Ints, *, force: bool = False) -> None:
    """Write the parts of a mesh into a folder, which is made if it is not there; `force` replaces those there.

    `owner` (n_nodes,): the rank that owns each node, as by `distribute_nodes`. Data that are no numbers are left out,
    with a LacmeshWarning. Raises RequestError for parts that would be lost, WriteError.
    """
    folder = Path(folder)
    check_folder(folder, force=force)
    pieces = pieces_of(mesh, owner)
    with _made(folder), replacing(folder / FILE) as (beside,), created(beside) as file:
        _write(file, mesh, owner, *pieces)


def check_folder(folder: Path, *, force: bool) -> None:
    """Check early that parts can be written into a folder. Raises RequestError, WriteError."""
    if folder.is_dir():
        check_place(folder / FILE, force=force)
    else:
        check_place(folder, force=True)  # a folder is made as a file is
        if folder.exists():
            raise WriteError(folder, "is a file; name a folder")


@contextmanager
def _made(folder: Path) -> Iterator[None]:
    """Make a folder if it is not there, and remove it again if nothing comes of it."""
    with writing(folder, "cannot be made"):
        there = folder.is_dir()
        folder.mkdir(exist_ok=True)
    try:
        yield
    except BaseException:
        if not there:
            with suppress(OSError):
                folder.rmdir()
        raise


def _write(
    file: h5py.Group, mesh: Mesh, owner: Ints, skins: Sequence[str], node: PieceIndices, cell: PieceIndices
) -> None:
    """Write the pieces of a mesh into an open file."""
    body, n_ranks = bodies_of(mesh), int(owner.max(initial=0)) + 1
    data = {"node": _numeric(mesh.node_data), "cell": _numeric(mesh.cell_data)}
    whole = vars(whole_of(mesh, body))
    header = {
        "version": VERSION,
        "ranks": n_ranks,
        "skins": skins,
        "whole": {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in whole.items()},
        "plane": mesh.plane,
        "groups": {"node": list(mesh.node_groups), "cell": list(mesh.cell_groups)},
        "data": {on: list(values) for on, values in data.items()},
        "ordered": mesh.file_order is not None,
    }
    for name, text in (("header", json.dumps(header)), ("notes", to_json(mesh, {}))):
        file[name] = np.frombuffer(text.encode(), np.uint8)
    file["owned"] = np.bincount(owner, minlength=n_ranks)
    on_nodes = {"number": mesh.node_number, "points": mesh.points, "owner": owner, "body": body}
    _write_rows(file.create_group("node"), node, on_nodes, data["node"], (), mesh.node_groups)
    on_cells = {"number": mesh.cell_number}
    if mesh.file_order is not None:
        on_cells["place"] = np.argsort(mesh.file_order)
    types = [(block.nodes, int(start)) for block, start in zip(mesh.blocks, mesh.offsets, strict=False)]
    _write_rows(file.create_group("cell"), cell, on_cells, data["cell"], types, mesh.cell_groups)


def _numeric(data: Any) -> dict[str, NDArray]:
    """Return the data that are numbers; warn of others."""
    left = [name for name, values in data.items() if values.dtype.kind not in "biufc"]
    if left:
        warnings.warn(LacmeshWarning(f"data that are no numbers are left out: {', '.join(left)}"), stacklevel=2)
    return {name: values for name, values in data.items() if name not in left}


def _write_rows(
    group: h5py.Group,
    members: PieceIndices,
    columns: dict[str, NDArray],
    data: dict[str, NDArray],
    types: Sequence[tuple[Ints, int]],
    groups: Any,
) -> None:
    """Write what is on the nodes, or on the cells. `types`: the nodes of the cells of each, and the first's index."""
    size = len(next(iter(columns.values())))
    index: Ints = members.index.astype(np.int32 if size <= np.iinfo(np.int32).max else np.int64)
    starts = [members.start]
    group["index"] = index
    columns |= {f"data{k}": values for k, values in enumerate(data.values())}
    for name, values in columns.items():
        group[name] = values[index]
    for k, (nodes, first) in enumerate(types):
        mine = (index >= first) & (index < first + len(nodes))
        group[f"type{k}"] = nodes[index[mine] - first]
        starts.append(members.count(mine))
    for k, ids in enumerate(groups.values()):
        inside = mask_of(size, ids)
        mine = inside[index]
        group[f"group{k}"] = index[mine]
        starts.append(members.count(mine))
    group["start"] = np.stack(starts, axis=1).astype(np.int64)


# ---- reading


@dataclass(frozen=True)
class _Store:
    """An open file of parts: its root, its `header`, the `whole` mesh, and the fields of a mesh in its `notes`."""

    root: Branch
    header: dict[str, Any]
    whole: WholeMesh
    notes: dict[str, Any]

    @classmethod
    def of(cls, root: Branch) -> _Store:
        """Read the header. Raises ReadError."""
        header = json.loads(root.raw("header"))
        if header["version"] != VERSION:
            raise root.error(f"has version {header['version']}, expected {VERSION}; partition the mesh again")
        figures = header["whole"]
        types = tuple((str(kind), int(count)) for kind, count in figures["types"])
        boxes = {name: np.array(figures[name], float) for name in ("used", "box")}
        whole = WholeMesh(**{**figures, **boxes, "types": types})
        said: list[str] = []
        notes, _ = from_json(root.raw("notes").decode("ascii", "replace"), whole.n_nodes, said)
        if said:
            raise root.error("are damaged; partition the mesh again", "notes")
        return cls(root, header, whole, notes)

    def skins(self, everywhere: Sequence[str]) -> list[str]:
        """Return the names of some groups of skin faces. Raises GroupNotFoundError, RequestError."""
        groups = {name: np.empty(0, np.int64) for name in self.header["groups"]["cell"]}
        tagged = Mesh.create(np.empty((0, 3)), [], cell_groups=groups, group_tags=self.notes.get("group_tags", {}))
        names = [skin_name(tagged, name) for name in everywhere]
        for name in names:
            if name not in self.header["skins"]:
                raise GroupNotFoundError(name, self.header["skins"], "group of skin faces")
        return names


@dataclass(frozen=True)
class _Rows:
    """The rows of some pieces, on nodes or on cells, joined: `index` (k,), ascending; each node or cell once.

    `start` (p, 2, columns): the first row of each piece, and the one after its last, as in the file. `read` (r,): the
    indices in these rows, `first` (k,): a row for each of `index`.
    """

    branch: Branch
    start: Ints
    read: Ints
    index: Ints
    first: Ints

    @classmethod
    def of(cls, branch: Branch, pieces: Sequence[int]) -> _Rows:
        """Find the rows of some pieces."""
        start = np.stack([branch.rows("start", piece, piece + 2) for piece in pieces])
        read = _read(branch, "index", start[:, :, 0])
        return cls(branch, start, read, *np.unique(read, return_index=True))

    def values(self, name: str) -> NDArray:
        """Return the values of a dataset, (k, ...)."""
        return _read(self.branch, name, self.start[:, :, 0])[self.first]

    def group(self, number: int, column: int) -> Ints:
        """Return the positions in `index` of the members of a group, whose rows are in a column of `start`."""
        return positions(self.index, np.unique(_read(self.branch, f"group{number}", self.start[:, :, column])))

    def nodes(self, number: int, first: int, last: int) -> Ints:
        """Return the nodes of the cells of a type, whose indices are from `first` on and below `last`."""
        ours = self.read[(self.read >= first) & (self.read < last)]
        unique = np.unique(ours, return_index=True)[1]
        return _read(self.branch, f"type{number}", self.start[:, :, 1 + number])[unique]


def _read(branch: Branch, name: str, ranges: Ints) -> NDArray:
    """Return the rows of a dataset in some ranges (p, 2), one after the other."""
    return np.concatenate([branch.rows(name, int(start), int(stop)) for start, stop in ranges])


def read_part(folder: str | os.PathLike[str], rank: int, *, everywhere: Sequence[str] = ()) -> Part:
    """Read the part of process `rank` from a folder; the result is that of `part_of` on the whole mesh.

    `everywhere`: groups of skin faces that are in every part, as for `part_of`; any group may be named. Raises
    RequestError for a rank that the folder has no part of, GroupNotFoundError, ReadError.
    """
    with _open(folder) as store:
        ranks = store.header["ranks"]
        if not 0 <= rank < ranks:
            raise RequestError(f"{folder} has {ranks} parts, and no rank {rank}; partition the mesh again")
        skins = store.skins(everywhere)
        pieces = [rank, *(ranks + store.header["skins"].index(name) for name in skins)]
        node = _Rows.of(store.root.branch("node"), pieces)
        cell = _Rows.of(store.root.branch("cell"), pieces)
        return Part(
            mesh=_mesh_of(store, node, cell),
            rank=rank,
            n_ranks=ranks,
            node=node.index,
            owner=node.values("owner"),
            cell=cell.index,
            body=node.values("body"),
            whole=store.whole,
            everywhere=tuple(skins),
        )


def describe_parts(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the contents of a folder of parts as plain data: sizes of the mesh and of its parts, groups of faces.

    `parts`: for each rank the number of its `own_nodes`, of its `nodes` and of its `cells`. `copies`: the mean number
    of copies of a node. Raises ReadError.
    """
    with _open(folder) as store:
        n, whole = store.header["ranks"], store.whole
        size = {on: np.diff(store.root.branch(on).rows("start", 0, n + 1)[:, 0]) for on in ("node", "cell")}
        owned = store.root.integers("owned", n)
        columns = {"own_nodes": owned, "nodes": size["node"], "cells": size["cell"]}
        return {
            "nodes": whole.n_nodes,
            "cells": whole.n_cells,
            "bodies": whole.n_bodies,
            "skins": store.header["skins"],
            "copies": float(size["node"].sum() / max(whole.n_nodes, 1)),
            "parts": {name: values.tolist() for name, values in columns.items()},
        }


@contextmanager
def _open(folder: str | os.PathLike[str]) -> Iterator[_Store]:
    """Open the file of a folder of parts. Raises ReadError."""
    folder = Path(folder)
    if not (folder / FILE).is_file():
        raise ReadError(folder, "is no folder of parts; lacmesh partition makes one")
    with opened(folder / FILE) as root:
        try:
            yield _Store.of(root)
        except (ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError) as error:
            raise root.error(f"is damaged ({error}); partition the mesh again") from error


def _mesh_of(store: _Store, node: _Rows, cell: _Rows) -> Mesh:
    """Return the mesh of the rows of some pieces."""
    header, notes = store.header, dict(store.notes)
    blocks = []
    for k, (kind, _) in enumerate(store.whole.types):
        of_whole = cell.nodes(k, *store.whole.offsets[k : k + 2].tolist())
        nodes = positions(node.index, of_whole)
        if kind not in ALL_CELLS or nodes.ndim != 2 or (nodes < 0).any():
            raise cell.branch.error("has nodes that are not in the part; partition the mesh again", f"type{k}")
        blocks.append((kind, nodes.astype(of_whole.dtype)))
    if notes.get("model") is not None:
        notes["model"] = periodic_left(notes["model"], node.index)
    groups = header["groups"]
    return Mesh.create(
        node.values("points"),
        blocks,
        plane=header["plane"],
        node_number=node.values("number"),
        cell_number=cell.values("number"),
        file_order=np.argsort(cell.values("place")) if header["ordered"] else None,
        node_groups={name: node.group(k, 1 + k) for k, name in enumerate(groups["node"])},
        cell_groups={name: cell.group(k, 1 + len(blocks) + k) for k, name in enumerate(groups["cell"])},
        node_data={name: node.values(f"data{k}") for k, name in enumerate(header["data"]["node"])},
        cell_data={name: cell.values(f"data{k}") for k, name in enumerate(header["data"]["cell"])},
        **notes,
    )
