"""Integration points of cells, piece by piece, with the generalised gradient of the shape functions there.

L (rows, n): L_ia = dN_a/dX_i for i < dim, and in axisymmetry L_2a = N_a / r. W: weight of the point, with |det J| and
the thickness or 2 pi r. A plane cell is mapped as a solid whose third axis maps to itself, so that one kernel serves
both dimensions and every type of cell; the number of nodes is taken from the arrays.

All that is summed or evaluated over cells goes through their pieces: `mapped` and `gathered` for fields, and `assembly`
for forces and stiffness.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient, shape
from lacmesh.threads import worthwhile
from lacsolver.space.rules import cell_rule
from lacsolver.space.space import Space

T = TypeVar("T")
#: an array (cells, points, ...) for each block of a space
Field = tuple[NDArray[np.floating], ...]
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


def kind(space: Space) -> KernelSpace:
    """Return the properties of a space that kernels use."""
    return KernelSpace(space.dim, space.model.rows, space.model.axisymmetric)


def depth_of(space: Space, cells: Ints) -> NDArray[np.floating]:
    """Return the thickness (k,) of some cells, indices in the mesh; 1 in space and where axisymmetric."""
    return np.full(len(cells), space.thick(cells))


class Piece(NamedTuple):
    """Some cells of a block, of one law: rows of the block, nodes (c, n), N (q, n), L (c, q, rows, n) and W (c, q).

    `law` is -1 where pieces are not asked for law by law.
    """

    block: int
    law: int
    cells: Ints
    nodes: Ints
    N: NDArray[np.floating]
    L: NDArray[np.floating]
    W: NDArray[np.floating]


#: block, law and rows of the cells of a piece
Span = tuple[int, int, Ints]


def spans(
    space: Space,
    laws: Sequence[Ints] | None = None,
    degree: int | None = None,
    select: Callable[[Ints], Ints] | None = None,
) -> Iterator[Span]:
    """Yield the cells in pieces of limited size, so that memory does not grow with the mesh: by blocks and laws.

    `laws`: law (k,) of each cell of a block, None to take all together. `select`: rows of the cells that are wanted,
    ascending, from the nodes (k, n) of a block. For a block without cells an empty piece is yielded.
    """
    for number, (_, nodes, _) in enumerate(space.blocks):
        wanted = np.arange(len(nodes)) if select is None else select(nodes)
        for law, cells in [(-1, wanted)] if laws is None else _by_law(laws[number], wanted):
            yield from ((number, law, some) for some in parts_of(space, number, cells, degree))


def parts_of(space: Space, block: int, cells: Ints, degree: int | None = None) -> Iterator[Ints]:
    """Yield some cells of a block in parts of limited size; one without cells if there are none."""
    size = max(
        1, _PIECE // (table(space.blocks[block].type, space.model.axisymmetric, degree).N.size * space.model.rows)
    )
    yield from (cells[first : first + size] for first in range(0, max(len(cells), 1), size))


def _by_law(law: Ints, cells: Ints) -> list[tuple[int, Ints]]:
    """Return each law that some cells have, and those that have it; law 0 with none if there is no cell."""
    if not law.any():
        return [(0, cells)]
    present = np.flatnonzero(np.bincount(law[cells], minlength=1)).tolist() or [0]
    return [(k, cells if len(present) == 1 else cells[law[cells] == k]) for k in present]


def piece(space: Space, span: Span, degree: int | None = None) -> Piece:
    """Return a piece with its gradients and weights."""
    block, law, cells = span
    name, every, cell_of = space.blocks[block]
    nodes, shapes = every[cells], table(name, space.model.axisymmetric, degree)
    L = np.empty((len(cells), len(shapes.w), space.model.rows, shapes.N.shape[1]))
    W = np.empty(L.shape[:2])
    gradients(nodes, space.local.points, shapes, kind(space), depth_of(space, cell_of[cells]), L, W)
    return Piece(block, law, cells, nodes, shapes.N, L, W)


def mapped(
    space: Space,
    make: Callable[[Piece], T],
    *,
    laws: Sequence[Ints] | None = None,
    degree: int | None = None,
    threads: int = 1,
) -> Iterator[T]:
    """Yield the result of `make` for every piece of the space, in order; `laws` as in `spans`."""
    if threads < 1:
        raise ValueError(f"threads is 1 or more, not {threads}")

    def run(span: Span) -> T:
        return make(piece(space, span, degree))

    if worthwhile(threads, space.mesh.n_cells) == 1:
        yield from map(run, spans(space, laws, degree))
        return
    with ThreadPoolExecutor(threads) as pool:
        yield from pool.map(run, spans(space, laws, degree))


def gathered(
    space: Space,
    make: Callable[[Piece], NDArray[np.floating]],
    *,
    laws: Sequence[Ints] | None = None,
    degree: int | None = None,
    threads: int = 1,
) -> Field:
    """Return the arrays (c, ...) that `make` gives for the pieces, put together block by block."""
    out: dict[int, NDArray[np.floating]] = {}

    def values_of(part: Piece) -> tuple[int, Ints, NDArray[np.floating]]:
        return part.block, part.cells, make(part)

    for block, cells, values in mapped(space, values_of, laws=laws, degree=degree, threads=threads):
        if block not in out:
            out[block] = np.empty((len(space.blocks[block].nodes), *values.shape[1:]))
        out[block][cells] = values
    return tuple(out[number] for number in range(len(space.blocks)))


@kernel
def gradients(nodes: Any, x: Any, table: Any, kind: Any, depth: Any, L: Any, W: Any) -> None:
    """Fill L (c, q, rows, n) and W (c, q) for cells of nodes (c, n) and thickness `depth` (c,)."""
    for e in range(len(nodes)):
        at_points(nodes, e, x, table, kind, depth[e], L[e], W[e])


@kernel
def at_points(nodes: Any, e: int, x: Any, table: Any, kind: Any, depth: float, L: Any, W: Any) -> None:
    """Fill L (q, rows, n) and W (q) for cell e of nodes (c, n), `depth` thick."""
    N, dN, w = table
    dim, _, axisymmetric = kind
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
        W[q] = w[q] * abs(det) * (2.0 * np.pi * r if axisymmetric else depth)


@kernel
def fill_gradient(nodes: Any, L: Any, u: Any, kind: Any, H: Any) -> None:
    """Fill H (c, q, 3, 3) with du_s/dX_i of cells of nodes (c, n) at u (n_nodes, dim); L (c, q, rows, n)."""
    H[:] = 0.0
    for e in range(len(nodes)):
        for q in range(L.shape[1]):
            for a in range(nodes.shape[1]):
                p = nodes[e, a]
                for s in range(kind.dim):
                    for i in range(kind.dim):
                        H[e, q, s, i] += u[p, s] * L[e, q, i, a]
                if kind.axisymmetric:
                    H[e, q, 2, 2] += u[p, 0] * L[e, q, 2, a]


def coordinates(space: Space, part: Piece) -> NDArray[np.floating]:
    """Return the coordinates of the integration points of a piece, (c, q, 3)."""
    return np.einsum("qn,cns->cqs", part.N, space.mesh.points[part.nodes], optimize=True)


def points(space: Space, degree: int | None = None) -> Field:
    """Return the coordinates of the integration points, (cells, points, 3)."""
    return gathered(space, lambda part: coordinates(space, part), degree=degree)


def weights(space: Space, degree: int | None = None) -> Field:
    """Return the weights of the integration points, thickness or 2 pi r included, (cells, points)."""
    return gathered(space, lambda part: part.W, degree=degree)


def checked(space: Space, u: Floats) -> NDArray[np.floating]:
    """Return u as an array. Raises ValueError if its shape is not (n_dof,)."""
    u = np.asarray(u, dtype=float)
    if u.shape != (space.n_dof,):
        raise ValueError(f"a displacement must be ({space.n_dof},), not {u.shape}")
    return u
