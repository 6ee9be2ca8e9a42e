"""Digest of everything that the solution of a case depends on, so that a restart can check that the case is the same.

A restart needs the same mesh, bodies, conditions and loads. [solver], [output], [[probe]] and the length of steps may
differ. A plain number of a load enters together with the time at which it is reached, a Python function by its name. A
mesh enters as it is in memory, whatever file it came from: its points, its cells, the records of its cut, and the
groups that the case names outside [[probe]]. Processes that have parts of a mesh make its digest together, which is the
one that a process with the whole mesh makes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from lacmesh.errors import GroupNotFoundError
from lacsolver.case.case import Case, drafted
from lacsolver.case.formula import Formula
from lacsolver.case.groups import named_groups
from lacsolver.case.row_sums import ROWS, row_sums
from lacsolver.case.value import Value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lacmesh.mesh import Ints, Mesh

#: sections that a solution does not depend on
FREE = ("steps", "solver", "output", "probe")
#: how the digest of a mesh begins; that of an older version, which processes with parts could not make, does not
_ROWS = "rows:"


class MeshPart(Protocol):
    """Interface of the part of a mesh that one of several processes has.

    Each node is one process's own, and this process has all cells whose first node it is.
    """

    @property
    def own(self) -> NDArray[np.bool_]:
        """Mask (n_nodes,) of own nodes."""

    @property
    def node(self) -> Ints:
        """Index (n_nodes,) in the whole mesh of each node."""

    @property
    def cell(self) -> Ints:
        """Index (n_cells,) in the whole mesh of each cell."""

    def total(self, x: NDArray) -> NDArray:
        """Return the sum of an array over all processes."""


def fingerprint(case: Case, mesh: Mesh, part: MeshPart | None = None) -> dict[str, str]:
    """Return a digest of each part of a case, by the part's name (`model`, `pressure` ...), and one of its `mesh`.

    `part`: where the mesh is a part, which part of the whole it is; all processes call this, and get the same.
    """
    top = drafted(case, ()).values
    parts: dict[str, Any] = {name: value for name, value in top.items() if name != "mesh"}
    for path, record in case.records():
        if path[0] not in FREE:
            parts.setdefault(str(path[0]), []).append(drafted(record, path).values)
    told = {name: _digest(json.dumps(_plain(held), sort_keys=True).encode()) for name, held in parts.items()}
    return {"mesh": _mesh_digest(case, mesh, part), **told}


def fingerprint_as(before: Mapping[str, str], prints: Mapping[str, str], case: Case, mesh: Mesh) -> Mapping[str, str]:
    """Return the fingerprint `prints` of a case with the digest of its mesh made as in the fingerprint `before`.

    The older digest is that of the mesh, or the part of a mesh, that a process has.
    """
    if before.get("mesh", "").startswith(_ROWS):
        return prints
    return {**prints, "mesh": _older_mesh_digest(case, mesh)}


def digest(case: Case, mesh: Mesh) -> str:
    """Return one digest of a whole case and its mesh."""
    return _digest(json.dumps(fingerprint(case, mesh), sort_keys=True).encode())


def changed(before: Mapping[str, str], now: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of the parts in which two fingerprints differ, () if the case is the same."""
    return tuple(name for name in dict.fromkeys([*before, *now]) if before.get(name) != now.get(name))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def _mesh_digest(case: Case, mesh: Mesh, part: MeshPart | None) -> str:
    sums = np.zeros(2, np.uint64)
    for name, index, values in _rows(case, mesh, part):
        sums += row_sums(name, index, values)
    if part is not None:
        sums = part.total(sums)
    return _ROWS + _digest(f"{list(mesh.zones)} {sums.tolist()}".encode())


def _rows(case: Case, mesh: Mesh, part: MeshPart | None) -> Iterator[tuple[str, Ints, NDArray]]:
    """Yield rows of the arrays that a solution depends on: the array's name, their indices in the whole mesh, values.

    They come in pieces, so that no array is copied as a whole. A process has the rows of its own nodes, and of the
    cells whose first nodes are its own.
    """

    def indices(rows: Ints, of_part: Ints | None) -> Ints:
        return rows if of_part is None else of_part[rows]

    node, cell, own = (None, None, None) if part is None else (part.node, part.cell, part.own)
    for rows in _pieces(own, mesh.n_nodes):
        yield "points", indices(rows, node), mesh.points[rows]
    ours = []
    for block, first in zip(mesh.blocks, mesh.offsets, strict=False):
        mine = None if own is None else own[block.nodes[:, 0]]
        ours.append(mine)
        for rows in _pieces(mine, len(block.nodes)):
            yield f"cells {block.type}", indices(first + rows, cell), indices(block.nodes[rows], node)
    of_cells = None if own is None else np.concatenate([np.empty(0, bool), *ours])
    for name in ("lac_macro", "lac_zone"):
        for rows in _pieces(of_cells, mesh.n_cells) if name in mesh.cell_data else ():
            yield f"record {name}", indices(rows, cell), mesh.cell_data[name][rows, None]
    for name, members in _groups(case, mesh):
        mine, whole = (own, node) if name.startswith("node group") else (of_cells, cell)
        counted = members if mine is None else members[mine[members]]
        yield name, indices(counted, whole), np.empty((len(counted), 0), np.int64)


def _pieces(mine: NDArray[np.bool_] | None, n: int) -> Iterator[Ints]:
    """Yield the rows of a mask (n,), or all n, in pieces."""
    for start in range(0, n, ROWS):
        rows = np.arange(start, min(start + ROWS, n))
        yield rows if mine is None else rows[mine[rows]]


def _groups(case: Case, mesh: Mesh) -> Iterator[tuple[str, Ints]]:
    """Yield the members of the groups that the case names outside [[probe]], with a name for each."""
    used = (record for path, record in case.records() if path[0] not in FREE)
    for name in sorted({group for record in used for _, group in named_groups(record)}):
        with suppress(GroupNotFoundError):  # then it is one of nodes
            yield f"cell group {name}", mesh.cells_of(name)
        if name in mesh.node_groups:
            yield f"node group {name}", mesh.node_groups[name]


def _older_mesh_digest(case: Case, mesh: Mesh) -> str:
    """Return the digest of a mesh as versions before `_ROWS` made it, of whole arrays."""
    made = hashlib.sha256(f"zones {mesh.zones}".encode())
    arrays = [("points", mesh.points + 0.0), *((f"cells {block.type}", block.nodes) for block in mesh.blocks)]
    records = (name for name in ("lac_macro", "lac_zone") if name in mesh.cell_data)
    arrays += [(f"record {name}", mesh.cell_data[name]) for name in records]
    for name, values in (*arrays, *_groups(case, mesh)):
        made.update(f"{name} {values.shape}".encode())
        made.update(values.astype("float64" if name == "points" else "int64").tobytes())
    return made.hexdigest()[:32]


def _plain(part: Any) -> Any:
    """Return the part in types that JSON has."""
    if isinstance(part, Value):
        ramp = part.ramp_end if part.source != 0 else None
        return [_plain(part.source), ramp]
    if isinstance(part, Formula):
        return part.text
    if isinstance(part, Mapping):
        return {name: _plain(item) for name, item in part.items()}
    if isinstance(part, (list, tuple)):
        return [_plain(item) for item in part]
    if callable(part):
        return f"function {getattr(part, '__module__', '')}.{getattr(part, '__qualname__', type(part).__name__)}"
    return part
