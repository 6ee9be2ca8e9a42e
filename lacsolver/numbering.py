"""Contact matrices on the unknowns of another program: its order of nodes and components, its eliminated unknowns.

    B' v' = B v    for v = P v' + u0,    so that B' = B P and G' = G - B u0

v' are the program's unknowns (n), v the displacements of the cut mesh, d n_nodes, component k of node i at d i + k. P
picks for each displacement the unknown that it is; u0 holds the displacements that the program has eliminated.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints, Mesh

#: a node of a cell is found where it lies, to this part of the cell's size
_NEAR = 1e-6


def unknown_of_each(
    mesh: Mesh, d: int, in_contact: Ints, *, unknowns: str | Any, nodes: Any, points: Any, n: int | None
) -> Ints:
    """Return the unknown (n_nodes, d) of each displacement of a mesh, -1 where there is none.

    Arguments as of `ContactMatrices.renumber`; `in_contact`: nodes that must have a number. Raises RequestError.
    """
    number = _numbers(mesh, nodes, points, d)
    _check_nodes(number, in_contact, mesh)
    columns = _columns(unknowns, number, d)
    _check_columns(columns, n)
    return columns


def _numbers(mesh: Mesh, nodes: Any, points: Any, d: int) -> Ints:
    """Return the program's number (n_nodes,) of each node of the mesh, -1 for one that it does not have."""
    if nodes is None:
        return np.arange(mesh.n_nodes)
    if isinstance(nodes, Mapping):
        if points is None:
            raise RequestError("the cells of the other program need the coordinates of its nodes: give points=")
        return _numbers_of_cells(mesh, nodes, np.asarray(points, float), d)
    number = np.asarray(nodes)
    if number.shape != (mesh.n_nodes,):
        raise RequestError(f"nodes has the shape {number.shape}; the cut mesh has {mesh.n_nodes} nodes")
    return number.astype(np.int64)


def _numbers_of_cells(mesh: Mesh, cells_of: Mapping[str, Any], points: Floats, d: int) -> Ints:
    """Return the program's number of each node that its cells have: in each cell the one that lies there."""
    number = np.full(mesh.n_nodes, -1)
    for name, cells in cells_of.items():
        ours, theirs = mesh.block(name), np.asarray(cells)
        if ours.shape != theirs.shape:
            raise RequestError(f"{name}: {theirs.shape} nodes of cells are given, and the cut mesh has {ours.shape}")
        x, y = mesh.points[ours][:, :, :d], points[theirs][:, :, :d]
        apart = np.linalg.norm(x[:, :, None] - y[:, None], axis=3)
        nearest = apart.argmin(axis=2)
        size = np.ptp(x, axis=1).max(axis=1)
        off = apart.min(axis=2).max(axis=1) > _NEAR * size
        if off.any():
            cell = int(np.flatnonzero(off)[0])
            raise RequestError(
                f"{name}: cell {cell} of the other program lies elsewhere; are cells in the mesh's order?"
            )
        number[ours] = np.take_along_axis(theirs, nearest, axis=1)
    return number


def _columns(unknowns: str | Any, number: Ints, d: int) -> Ints:
    """Return the unknown (n_nodes, d) of each displacement, -1 where there is none."""
    N = int(number.max(initial=-1)) + 1
    if isinstance(unknowns, str):
        layouts = {"nodes": np.arange(d * N).reshape(N, d), "components": np.arange(d * N).reshape(d, N).T}
        if unknowns not in layouts:
            raise RequestError(f"unknowns = {unknowns!r}: nodes, components, or an array of the unknown of each node")
        table = layouts[unknowns]
    else:
        table = np.asarray(unknowns)
    if table.ndim != 2 or table.shape[1] != d or len(table) < N:
        raise RequestError(f"unknowns has the shape {table.shape}; ({N}, {d}) is needed, a row for each node")
    return np.where(number[:, None] < 0, -1, table[number])


def _check_nodes(number: Ints, in_contact: Ints, mesh: Mesh) -> None:
    """Raise RequestError for a node in contact that the program does not have."""
    absent = in_contact[number[in_contact] < 0]
    if len(absent):
        first = f"node {mesh.node_number[absent[0]]} of the cut mesh"
        message = f"{len(absent)} nodes in contact, {first} among them, are nodes of no cell of the other program"
        raise RequestError(f"{message}; give it the cut mesh, and all its cells here")


def _check_columns(columns: Ints, n: int | None) -> None:
    """Raise RequestError for unknowns that two displacements share, or that are out of range."""
    values, counts = np.unique(columns[columns >= 0], return_counts=True)
    if (counts > 1).any():
        raise RequestError(f"unknown {values[counts > 1][0]} is that of {counts.max()} displacements of the cut mesh")
    if n is not None and len(values) and values[-1] >= n:
        raise RequestError(f"there are {n} unknowns, and {values[-1]} is named; they are counted from 0")


def selection(columns: Ints, n: int | None) -> csr_array:
    """Return P (d n_nodes, n): 1 at the unknown that a displacement is."""
    flat = columns.ravel()
    rows = np.flatnonzero(flat >= 0)
    size = int(flat.max(initial=-1)) + 1 if n is None else n
    ones: NDArray = np.ones(len(rows))
    return csr_array((ones, (rows, flat[rows])), shape=(len(flat), size))
