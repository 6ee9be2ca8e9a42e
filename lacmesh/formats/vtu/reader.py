"""Reading VTU: pieces, cells of every type that lacmesh has, arrays (`arrays.py` describes their meaning)."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshWarning, ReadError, some
from lacmesh.formats import notes
from lacmesh.formats.arrays import assembled, merged
from lacmesh.formats.vtu.types import LAGRANGE_HEXAHEDRON, NOT_READ, OF_NUMBER, lagrange_8_to_9
from lacmesh.formats.vtu.writer import NOTES
from lacmesh.formats.vtu.xml import Document, XmlElement, opened
from lacmesh.mesh import Floats, Ints, Mesh


class VtkCells(NamedTuple):
    """Cells as VTK lists them: nodes one cell after the other, where each cell ends, VTK's numbers of the types."""

    connectivity: Ints
    ends: Ints
    types: Ints


#: points (n, 3), cells, arrays on cells, arrays on nodes
_Piece = tuple[Floats, VtkCells, dict[str, NDArray], dict[str, NDArray]]


def read(path: Path) -> Mesh:
    """Read the mesh of a VTU file. Raises ReadError; what is left out is named in one LacmeshWarning."""
    said: list[str] = []
    document = opened(path)
    grid = document.root.find("UnstructuredGrid")
    if grid is None:
        raise document.error("has no <UnstructuredGrid>")
    pieces = [_piece(document, element, said) for element in grid.findall("Piece")]
    if not pieces:
        raise document.error("has no <Piece>, so it holds no mesh")
    mesh = _mesh(document, grid, pieces, said)
    if said:
        warnings.warn(f"{path}: " + "; ".join(dict.fromkeys(said)), LacmeshWarning, stacklevel=3)
    return mesh


def _piece(document: Document, element: XmlElement, said: list[str]) -> _Piece:
    n, k = document.count(element, "NumberOfPoints"), document.count(element, "NumberOfCells")
    place = element.find("Points/DataArray")
    points = document.array(place, 3 * n) if place is not None else np.empty(0)
    if len(points) != 3 * n or points.dtype.kind != "f":
        raise document.error(f"holds {len(points)} coordinates of type {points.dtype} for {n} points", "<Points>")
    if not np.isfinite(points).all():
        bad = some(np.flatnonzero(~np.isfinite(points.reshape(n, 3)).all(axis=1)))
        raise document.error(f"the coordinates of points {bad} (from 0) are not finite numbers", "<Points>")
    cells = _cells(document, element, n, k)
    data, node_data = (_data(document, element, f"{on}Data", size, said) for on, size in (("Cell", k), ("Point", n)))
    return points.reshape(n, 3).astype(np.float64, copy=False), cells, data, node_data


def _cells(document: Document, element: XmlElement, n_points: int, k: int) -> VtkCells:
    arrays = {array.get("Name"): array for array in element.findall("Cells/DataArray")}
    read: dict[str, Ints] = {}
    for name in ("offsets", "types", "connectivity"):
        if name in arrays:
            most = k + 1 if name != "connectivity" else _last(read.get("offsets"))
            read[name] = document.array(arrays[name], most)
            if read[name].dtype.kind not in "iu":
                raise document.error(f"{name} should be integers", "<Cells>")
    none = np.empty(0, np.int64)
    cells = VtkCells(*(read.get(name, none) for name in ("connectivity", "offsets", "types")))
    if len(cells.ends) == len(cells.types) + 1 and len(cells.ends) and cells.ends[0] == 0:
        cells = cells._replace(ends=cells.ends[1:])
    if len(cells.ends) != k or len(cells.types) != k:
        raise document.error(f"holds {len(cells.types)} types and {len(cells.ends)} offsets for {k} cells", "<Cells>")
    ends, nodes = cells.ends.astype(np.int64), cells.connectivity
    if k and ((np.diff(ends) < 0).any() or ends[0] < 0 or ends[-1] != len(nodes)):
        raise document.error(f"the offsets do not fit the {len(nodes)} nodes of connectivity", "<Cells>")
    if len(nodes) and (nodes.min() < 0 or nodes.max() >= n_points):
        raise stray_node(document, cells._replace(ends=ends), n_points, "<Cells>")
    return cells._replace(ends=ends, connectivity=nodes.astype(np.int64, copy=False))


def _last(ends: Ints | None) -> int:
    """End of the last cell in the connectivity; 0 if there is none."""
    return max(int(ends[-1]), 0) if ends is not None and len(ends) else 0


def stray_node(source: Any, cells: VtkCells, n_points: int, place: str) -> ReadError:
    """The error for a cell that has a point which is not there; VTK and XDMF count both from 0."""
    nodes = cells.connectivity
    at = int(((nodes < 0) | (nodes >= n_points)).argmax())
    cell = int(np.searchsorted(cells.ends, at, side="right"))
    error: ReadError = source.error(f"cell {cell} (from 0) has point {nodes[at]}, and there are {n_points}", place)
    return error


def _data(document: Document, element: XmlElement, section: str, size: int, said: list[str]) -> dict[str, NDArray]:
    arrays: dict[str, NDArray] = {}
    for array in element.findall(f"{section}/"):
        name = array.get("Name", "")
        if array.get("type") == "String":
            said.append(f"{section} {name!r} are strings, they are left out")
            continue
        width = document.count(array, "NumberOfComponents", 1)
        values = document.array(array, size * width)
        if width < 1 or len(values) != size * width:
            raise document.error(f"{name!r} has {len(values)} values for {size} times {width}", f"<{section}>")
        arrays[name] = values.reshape(size, width) if width > 1 else values
    return arrays


def _mesh(document: Document, grid: XmlElement, pieces: list[_Piece], said: list[str]) -> Mesh:
    points, cells_of, cell_data, node_data = zip(*pieces, strict=True)
    n_nodes = sum(map(len, points))
    if sum(len(p) > 0 for p in points) > 1:
        said.append(f"{len(pieces)} pieces are put together; nodes that several have stay apart")
    fields, noted = _notes(document, grid, n_nodes, said)
    cells = joined(cells_of, np.cumsum([0, *map(len, points)]))
    blocks, place = blocks_of(document, cells, _is_old(document))
    cell = merged(zip(cell_data, (len(c.types) for c in cells_of), strict=True), said, "cell")
    node = merged(zip(node_data, map(len, points), strict=True), said, "node")
    return assembled(np.concatenate(points), blocks, place, (cell, node), fields, noted, said)


def joined(parts: Sequence[VtkCells], first: Sequence[int] | Ints) -> VtkCells:
    """Join cells of several parts of a mesh; `first`: the index of each part's first point in the whole."""
    starts = np.cumsum([0, *(len(p.connectivity) for p in parts)])
    return VtkCells(
        np.concatenate([p.connectivity + a for p, a in zip(parts, first, strict=False)]),
        np.concatenate([p.ends + a for p, a in zip(parts, starts, strict=False)]),
        np.concatenate([p.types for p in parts]),
    )


def _is_old(document: Document) -> bool:
    """True if the file orders the nodes of Lagrange hexahedra as VTK 8 did."""
    parts = document.root.get("version", "0.1").split(".")
    return [int(p) for p in parts if p.isdigit()] < [2, 1]


def blocks_of(source: Any, cells: VtkCells, old: bool) -> tuple[dict[str, Ints], Ints]:
    """Nodes by type, in lacmesh's order, and the position (n_cells,) of each cell; `source.error` makes the error."""
    width = np.diff(cells.ends, prepend=0)
    code = cells.types.astype(np.int64) << 32 | width
    parts: dict[str, list[tuple[Ints, Ints]]] = {}
    found_codes, first = np.unique(code, return_index=True)
    for value in found_codes[np.argsort(first)]:  # types in the order in which they first appear
        number, n = int(value >> 32), int(value & 0xFFFFFFFF)
        cell = OF_NUMBER.get((number, n))
        if cell is None:
            what = NOT_READ.get(number, "cells that lacmesh does not know")
            raise source.error(f"{what} (VTK's type {number}, {n} nodes) are not read", "<Cells>")
        here = np.flatnonzero(code == value)
        if len(here) == len(code):
            rows = cells.connectivity.reshape(-1, n)
        else:
            rows = cells.connectivity[(cells.ends[here] - n)[:, None] + np.arange(n)]
        if old and number == LAGRANGE_HEXAHEDRON and n > 8:
            rows = rows[:, lagrange_8_to_9(n)]
        nodes = np.empty_like(rows)
        nodes[:, cell.nodes] = rows
        parts.setdefault(cell.type, []).append((here, nodes))
    blocks, places = {}, [np.empty(0, np.int64)]
    for name, pieces in parts.items():
        here = np.concatenate([h for h, _ in pieces])
        order = np.argsort(here, kind="stable") if len(pieces) > 1 else slice(None)
        blocks[name] = np.concatenate([n for _, n in pieces])[order]
        places.append(here[order])
    return blocks, np.concatenate(places)


def _notes(
    document: Document, grid: XmlElement, n_nodes: int, said: list[str]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Mesh fields from the notes in FieldData, and the notes themselves."""
    arrays = {array.get("Name", ""): array for array in grid.findall("FieldData/")}
    others = [name for name in arrays if name != NOTES]
    if others:
        said.append(f"FieldData {', '.join(map(repr, others[:8]))} are left out")
    return notes.from_json(document.text(arrays[NOTES]), n_nodes, said) if NOTES in arrays else ({}, {})
