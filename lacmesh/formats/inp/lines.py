"""Lines of an .inp file made of arrays: nodes, elements, members of sets, faces of surfaces."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.formats.inp.roles import Roles
from lacmesh.formats.inp.types import FACETS, NODES
from lacmesh.formats.text import int_rows, joined, reals
from lacmesh.formats.writing import is_plane
from lacmesh.mesh import Ints, Mesh

_ROWS = 1 << 14
_PER_LINE = 16
#: Characters of a real number in both programs.
_REAL = 20


def write_nodes(file: BinaryIO, mesh: Mesh, number: Ints, begin: int = 0, end: int | None = None) -> None:
    """Write the lines of nodes `begin` to `end`; coordinates have 20 characters at most, as both programs read."""
    dim = 2 if is_plane(mesh) else 3
    end = mesh.n_nodes if end is None else end
    for a in range(begin, end, _ROWS):
        part = slice(a, min(end, a + _ROWS))
        columns = [list(map(str, number[part].tolist()))]
        columns += [reals(mesh.points[part, axis], _REAL) for axis in range(dim)]
        file.write(joined(columns, ", ").encode())


def write_rows(file: BinaryIO, kind: str, nodes: Ints, rows: Ints, node: Ints, number: Ints) -> None:
    """Write the number and the nodes of each element, at most 16 numbers on a line."""
    places = list(NODES.get(kind, range(nodes.shape[1])))
    leads = [b"\n"] + [b",\n" if k % _PER_LINE == 0 else b", " for k in range(1, len(places) + 1)]
    for a in range(0, len(rows), _ROWS):
        part = rows[a : a + _ROWS]
        table = np.empty((len(part), 1 + len(places)), np.int64)
        table[:, 0] = number[a : a + _ROWS]
        table[:, 1:] = node[nodes[part][:, places]]
        file.write(int_rows(table, leads))


def write_set(file: BinaryIO, head: str, numbers: Ints) -> None:
    """Write the keyword line of a set, and its members in lines of 16."""
    file.write(head.encode(errors="surrogateescape"))
    whole = len(numbers) // _PER_LINE * _PER_LINE
    for rows in (numbers[:whole].reshape(-1, _PER_LINE), numbers[whole:].reshape(1, -1)):
        if rows.size:
            file.write(int_rows(rows, [b"\n", *[b", "] * (rows.shape[1] - 1)]))
    file.write(b"\n")


def write_faces(file: BinaryIO, mesh: Mesh, roles: Roles, target: str, cell: Ints, skin: Ints) -> None:
    """Write the faces of skin cells, each once: the number of an element (`cell`, by index) and the face's label."""
    at = np.unique(roles.parent[skin] * 8 + roles.facet[skin])
    parent, facet = at // 8, at % 8
    block = np.searchsorted(mesh.offsets, parent, side="right") - 1
    shells = mesh.dim == 2 and not is_plane(mesh)  # Abaqus counts their edges from E1, CalculiX from S3
    letter = "E" if shells and target == "abaqus" else "S"
    number = np.full(len(at), 3 if shells and target == "calculix" else 1)
    for b in np.unique(block).tolist():
        place = np.argsort(FACETS[CELLS[mesh.blocks[b].type].family])  # our facet -> its place among S1, S2 ...
        number[block == b] += place[facet[block == b]]
    file.write(int_rows(np.stack([cell[parent], number], axis=1), [b"\n", f", {letter}".encode()]))
    file.write(b"\n")
