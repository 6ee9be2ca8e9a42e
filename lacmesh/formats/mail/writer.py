"""Writing .mail: one sub-file for the nodes, one for each type of cells, one for each group."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import BinaryIO

import numpy as np

from lacmesh.errors import LacmeshWarning, WriteError
from lacmesh.formats.ids import repeated
from lacmesh.formats.labels import changes, labels
from lacmesh.formats.mail.types import NODES
from lacmesh.formats.table import DEFAULT, WriteOptions
from lacmesh.formats.text import int_rows, reals
from lacmesh.formats.writing import blocks_in_order, check_types, is_plane, left_out
from lacmesh.mesh import Floats, Ints, Mesh

#: code_aster's limits: characters of a group's name, and of a node's or cell's (a letter and seven digits).
GROUP_NAME, _LARGEST = 24, 9_999_999
_LINE, _PER_LINE = 80, 8
_ROWS = 1 << 14


def write(path: Path, mesh: Mesh, options: WriteOptions = DEFAULT) -> None:
    """Write a mesh as a .mail file, replacing any content.

    Nodes are N and their number, cells M and theirs. Cells go by type, within a type as in `mesh.file_order`. Raises
    WriteError for cells that code_aster has not; one LacmeshWarning names what is changed or left out.
    """
    check_types(path, mesh, NODES, "code_aster")
    said = left_out(mesh)
    node, cell = _numbers(path, mesh.node_number, "nodes", said), _numbers(path, mesh.cell_number, "cells", said)
    with path.open("wb") as file:
        _write_title(file, mesh.name)
        _write_nodes(file, mesh, node)
        _write_cells(file, mesh, node, cell)
        for keyword, letter, groups, number in (
            ("GROUP_NO", "N", mesh.node_groups, node),
            ("GROUP_MA", "M", mesh.cell_groups, cell),
        ):
            chosen = labels(groups, "A-Za-z0-9_", GROUP_NAME, ["FIN", "FINSF"])
            if changed := changes(chosen):
                said.append(f"names of {keyword} have {GROUP_NAME} letters, digits and _ at most: {changed}")
            for name, members in groups.items():
                _write_group(file, f"{keyword}\n{chosen[name]}", letter.encode(), number[members])
        file.write(b"FIN\n")
    if said:
        warnings.warn(LacmeshWarning(".mail: " + "; ".join(said)), stacklevel=2)


def _numbers(path: Path, numbers: Ints, what: str, said: list[str]) -> Ints:
    """The mesh's numbers; 1, 2 ... where they are not distinct, or too large for code_aster's names."""
    if len(numbers) > _LARGEST:
        raise WriteError(path, f"code_aster's names number {_LARGEST} {what} at most; write a .med file")
    numbers = np.asarray(numbers, np.int64)
    if len(numbers) and (numbers.min() < 0 or numbers.max() > _LARGEST or repeated(numbers) is not None):
        said.append(f"the numbers of {what} are not distinct or above {_LARGEST}: they are 1, 2 ... in the file")
        return np.arange(1, len(numbers) + 1)
    return numbers


def _write_title(file: BinaryIO, name: str) -> None:
    line = " ".join(name.split())
    if line and name != "mesh" and len(line.encode()) <= _LINE and not line.startswith("FIN"):
        file.write(f"TITRE\n{line}\nFINSF\n".encode())


def _write_nodes(file: BinaryIO, mesh: Mesh, number: Ints) -> None:
    dim = 2 if is_plane(mesh) else 3
    file.write(f"COOR_{dim}D\n".encode())
    for a in range(0, mesh.n_nodes, _ROWS):
        part = slice(a, a + _ROWS)
        file.write(_node_lines(number[part], mesh.points[part, :dim]).encode())
    file.write(b"FINSF\n")


def _node_lines(number: Ints, points: Floats) -> str:
    columns = [reals(points[:, axis]) for axis in range(points.shape[1])]
    lines = [f"N{n} {' '.join(row)}\n" for n, *row in zip(number.tolist(), *columns, strict=True)]
    if max(map(len, lines)) > _LINE + 1:  # three digits in an exponent: the last coordinate on a line of its own
        lines = [line if len(line) <= _LINE + 1 else "\n".join(line.rsplit(" ", 1)) for line in lines]
    return "".join(lines)


def _write_cells(file: BinaryIO, mesh: Mesh, node: Ints, cell: Ints) -> None:
    for block, lo, here in blocks_in_order(mesh):
        places = list(NODES[block.type])
        leads = [b"\nM", *(b"\nN" if k % _PER_LINE == 0 else b" N" for k in range(1, len(places) + 1))]
        file.write(block.type.encode())
        for a in range(0, len(here), _ROWS):
            some = here[a : a + _ROWS]
            rows = np.empty((len(some), 1 + len(places)), np.int64)
            rows[:, 0] = cell[some]
            rows[:, 1:] = node[block.nodes[some - lo][:, places]]
            file.write(int_rows(rows, leads))
        file.write(b"\nFINSF\n")


def _write_group(file: BinaryIO, head: str, letter: bytes, numbers: Ints) -> None:
    """Write the head of a group, its members in lines, and its end."""
    file.write(head.encode())
    whole = len(numbers) // _PER_LINE * _PER_LINE
    for rows in (numbers[:whole].reshape(-1, _PER_LINE), numbers[whole:].reshape(1, -1)):
        if rows.size:
            file.write(int_rows(rows, [b"\n" + letter, *[b" " + letter] * (rows.shape[1] - 1)]))
    file.write(b"\nFINSF\n")
