"""Generalised gradient of the shape functions at integration points, used by strain, force and stiffness.

L (rows, n): L_ia = dN_a/dX_i for i < dim, and in axisymmetry L_2a = N_a / r. W: weight of the point, with |det J| and
the thickness or 2 pi r. A plane cell is mapped as a solid whose third axis maps to itself, so that one kernel serves
both dimensions and every type of cell; the number of nodes is taken from the arrays.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient, shape
from lacsolver.space.rules import cell_rule
from lacsolver.space.space import Space

#: entries of L in one piece of cells, so that part of it stays in the cache
_PIECE = 1 << 18


class ShapeTable(NamedTuple):
    """Shape functions N (q, n), gradients (q, 3, n), weights w (q,) of a cell type at the points of a rule.

    The rows of the gradients beyond the dimension of the cell are 0.
    """

    N: NDArray[np.floating]
    gradient: NDArray[np.floating]
    w: NDArray[np.floating]


@cache
def table(name: str, axisymmetric: bool = False, degree: int | None = None) -> ShapeTable:
    """Return the table of a cell type for the rule of its stiffness, or for a quadrature rule of some degree.

    Rules of a given degree are those of `lacmesh.reference.quadrature`.
    """
    X, w = cell_rule(name, axisymmetric) if degree is None else rule(CELLS[name].family, degree)
    dN = gradient(name, X).transpose(0, 2, 1)
    padded = np.zeros((len(w), 3, dN.shape[2]))
    padded[:, : dN.shape[1]] = dN
    return ShapeTable(np.ascontiguousarray(shape(name, X)), padded, w)


class KernelSpace(NamedTuple):
    """The properties of a space that kernels use."""

    dim: int
    rows: int
    axisymmetric: bool
    thickness: float


def kind(space: Space) -> KernelSpace:
    """Return the properties of a space that kernels use."""
    return KernelSpace(space.dim, space.model.rows, space.model.axisymmetric, space.thickness)


class Piece(NamedTuple):
    """Some `cells` of a block, with their `nodes` (c, n), N (q, n), L (c, q, rows, n) and W (c, q)."""

    block: int
    cells: slice
    nodes: Ints
    N: NDArray[np.floating]
    L: NDArray[np.floating]
    W: NDArray[np.floating]


def spans(space: Space, degree: int | None = None) -> Iterator[tuple[int, slice]]:
    """Yield (block, slice of its cells), in pieces of limited size, so that memory does not grow with the mesh."""
    for number in range(len(space.blocks)):
        yield from ((number, cells) for cells in block_spans(space, number, degree))


def block_spans(space: Space, number: int, degree: int | None = None) -> Iterator[slice]:
    """Yield slices of the cells of one block, in pieces of limited size."""
    block = space.blocks[number]
    made = table(block.type, space.model.axisymmetric, degree)
    size = max(1, _PIECE // (made.N.size * space.model.rows))
    for first in range(0, len(block.nodes), size):
        yield slice(first, min(first + size, len(block.nodes)))


def piece(space: Space, block: int, cells: slice, degree: int | None = None) -> Piece:
    """Return a piece: L and W of some cells of a block."""
    name, nodes, _ = space.blocks[block]
    made = table(name, space.model.axisymmetric, degree)
    L = np.empty((cells.stop - cells.start, len(made.w), space.model.rows, made.N.shape[1]))
    W = np.empty(L.shape[:2])
    gradients(nodes[cells], space.local.points, made, kind(space), L, W)
    return Piece(block, cells, nodes[cells], made.N, L, W)


@kernel
def gradients(nodes: Any, x: Any, table: Any, kind: Any, L: Any, W: Any) -> None:
    """Fill L (c, q, rows, n) and W (c, q) for cells of nodes (c, n)."""
    for e in range(len(nodes)):
        at_points(nodes, e, x, table, kind, L[e], W[e])


@kernel
def at_points(nodes: Any, e: int, x: Any, table: Any, kind: Any, L: Any, W: Any) -> None:
    """Fill L (q, rows, n) and W (q) for cell e of nodes (c, n)."""
    N, dN, w = table
    dim, _, axisymmetric, thickness = kind
    n = nodes.shape[1]
    for q in range(len(w)):
        a00 = a01 = a02 = a10 = a11 = a12 = a20 = a21 = a22 = r = 0.0  # J, and the radius
        for a in range(n):
            p = nodes[e, a]
            x0, x1, x2 = x[p, 0], x[p, 1], x[p, 2]
            d0, d1, d2 = dN[q, 0, a], dN[q, 1, a], dN[q, 2, a]
            a00 += x0 * d0
            a01 += x0 * d1
            a02 += x0 * d2
            a10 += x1 * d0
            a11 += x1 * d1
            a12 += x1 * d2
            a20 += x2 * d0
            a21 += x2 * d1
            a22 += x2 * d2
            r += x0 * N[q, a]
        if dim == 2:
            a20, a21, a22 = 0.0, 0.0, 1.0
        c00, c01, c02 = a11 * a22 - a12 * a21, a12 * a20 - a10 * a22, a10 * a21 - a11 * a20
        det = a00 * c00 + a01 * c01 + a02 * c02
        s = 1.0 / det
        b00, b10, b20 = c00 * s, c01 * s, c02 * s  # the inverse of J
        b01, b11, b21 = (a02 * a21 - a01 * a22) * s, (a00 * a22 - a02 * a20) * s, (a01 * a20 - a00 * a21) * s
        b02, b12, b22 = (a01 * a12 - a02 * a11) * s, (a02 * a10 - a00 * a12) * s, (a00 * a11 - a01 * a10) * s
        for a in range(n):
            d0, d1, d2 = dN[q, 0, a], dN[q, 1, a], dN[q, 2, a]
            L[q, 0, a] = d0 * b00 + d1 * b10 + d2 * b20
            L[q, 1, a] = d0 * b01 + d1 * b11 + d2 * b21
            if dim == 3:
                L[q, 2, a] = d0 * b02 + d1 * b12 + d2 * b22
            elif axisymmetric:
                L[q, 2, a] = N[q, a] / r
        W[q] = w[q] * abs(det) * (2.0 * np.pi * r if axisymmetric else thickness)


def coordinates(space: Space, part: Piece) -> NDArray[np.floating]:
    """Return the coordinates of the integration points of a piece, (c, q, 3)."""
    return np.einsum("qn,cns->cqs", part.N, space.mesh.points[part.nodes], optimize=True)


def nodal(values: Floats, part: Piece, dim: int) -> NDArray[np.floating]:
    """Return a vector of unknowns (n_dof,) at the nodes of a piece's cells, (c, n, dim)."""
    return values.reshape(-1, dim)[part.nodes]
