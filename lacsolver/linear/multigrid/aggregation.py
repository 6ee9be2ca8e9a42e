"""Hierarchy of smoothed aggregation (PyAMG) on nodal blocks, with the rigid-body modes.

Vanek, Mandel, Brezina (1996); the rigid-body modes are the near-null space. Memory is at its largest here, so that
temporary arrays have the size of a part of a matrix where they can.

Of a matrix that several processes share, each aggregates its own nodes, and makes the rows of its own aggregates on the
coarser level from those of its own nodes and what others send (`halo`). A level with few nodes is whole on each
process, and so are those below it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.multigrid.cycle import NO_HALO, Cycle, Halo, Level, Team, jacobi, transposed
from lacsolver.linear.multigrid.halo import SharedHalo

#: couplings weaker than this, relative to the diagonals, do not join nodes; 0.03 took least time on HEXA8 and TETRA10
_STRENGTH = 0.03
#: most nodes (of six unknowns) of the coarsest level, which is solved by a dense inverse
_COARSEST = 60
_LEVELS = 12
#: most nodes of a level that is whole on each process, and most for each of many processes
_WHOLE, _FEW = 100, 8
#: damping of the smoothing of prolongations, times the largest eigenvalue of D^-1 K
_SMOOTHING = 4 / 3
#: number of blocks, and of rows of blocks, that are multiplied at once
_PIECE, _ROWS = 1 << 17, 1 << 16


class _Rows(NamedTuple):
    """Own rows K of a level, with the `halo` of its columns; modes (own unknowns, r) of its near-null space."""

    K: bsr_array
    modes: Floats
    halo: Halo
    team: Team

    @property
    def n_nodes(self) -> int:
        """Number of nodes on all processes."""
        return int(self.team.comm.total(np.array(self.K.shape[0] // self.K.blocksize[0])))

    def whole(self) -> _Rows:
        """Return the rows of all processes."""
        assert isinstance(self.halo, SharedHalo)
        return _Rows(*self.halo.whole(self.K, self.modes), NO_HALO, Team(1))

    def mean_diagonal(self) -> float:
        """Return the mean entry of the diagonal; 1 for a matrix without rows."""
        total, count = self.team.comm.total(np.array([self.K.diagonal().sum(), self.K.shape[0]]))
        return float(total / count) if count else 1.0


def aggregated(K: bsr_array, modes: Floats, team: Team, halo: Halo = NO_HALO, near: csr_array | None = None) -> Cycle:
    """Return the V-cycle of K: aggregates of nodes with orthonormal modes, smoothed by one step of block Jacobi.

    `near` (own nodes, own nodes): nonzero for those that may be in one aggregate, all that K couples if None. Nodes
    that equations couple, as those at both sides of a sector, do not have the same modes.

    Of several processes each gives the rows K of its own nodes, with columns of `halo`, and the modes at its own nodes.
    """
    rows, levels = _Rows(K, modes, halo, team), list[Level]()
    unit = 1 / rows.mean_diagonal()
    while len(levels) < _LEVELS and (rows.halo is not NO_HALO or rows.n_nodes > _COARSEST):
        level, rows = _coarsened(rows, unit, None if levels else near)
        levels.append(level)
    return Cycle(levels, rows.K.toarray() * unit, unit, team)


def _coarsened(rows: _Rows, unit: float, near_nodes: csr_array | None) -> tuple[Level, _Rows]:
    """Return a level, and the rows of the next coarser one, which has fewer nodes."""
    K, modes, halo, team = rows
    inverse, largest = jacobi(K, team, halo)
    tentative, modes = _tentative(K, modes, near_nodes)
    near, coarse = halo.with_ghosts(tentative, halo.of_columns(tentative))
    P = _smoothed(K, tentative, near, inverse, _SMOOTHING / largest)
    del tentative, near  # memory is at its largest here
    all_P, wide = halo.with_ghosts(P, coarse)
    coarse_K, wide = coarse.add_rows(_galerkin(K, P, all_P), wide)
    coarse_rows, below = _Rows(coarse_K, modes, wide, team), coarse
    if isinstance(coarse, SharedHalo) and coarse_rows.n_nodes <= max(_WHOLE, _FEW * team.comm.size):
        P, below, coarse_rows = coarse.whole_columns(P), coarse.everywhere, coarse_rows.whole()
    return Level.of(K, P, inverse / largest, unit, team, (halo, below)), coarse_rows


def _tentative(K: bsr_array, modes: Floats, near: csr_array | None) -> tuple[bsr_array, Floats]:
    """Aggregate coupled own nodes by PyAMG; return (P, coarse modes) with P (coarse modes) = modes.

    `near`: as of `aggregated`.
    """
    from pyamg.aggregation import fit_candidates, standard_aggregation
    from pyamg.strength import symmetric_strength_of_connection

    norms = np.sqrt(np.einsum("kij,kij->k", K.data, K.data))  # PyAMG would copy all entries for them
    n = len(K.indptr) - 1
    nodes = csr_array((norms, K.indices, K.indptr), shape=(n, K.shape[1] // K.blocksize[1]))[:, :n]
    nodes = nodes if near is None else csr_array(nodes.multiply(near))
    aggregates, _ = standard_aggregation(symmetric_strength_of_connection(csr_array(nodes), theta=_STRENGTH))
    if not aggregates.nnz:  # one aggregate without nodes, of which PyAMG would leave the modes undefined
        r = modes.shape[1]
        return bsr_array((len(modes), r), blocksize=(K.blocksize[0], r)), np.zeros((r, r))
    P, coarse = fit_candidates(aggregates, modes)
    return bsr_array(P), coarse


def _smoothed(K: bsr_array, P: bsr_array, near: bsr_array, inverse: Floats, factor: float) -> bsr_array:
    """Return the smoothed prolongation P - factor D^-1 K P in single precision, in which the cycle has it.

    P has rows for own nodes, `near` also those of the other nodes that K touches.
    """
    product = K @ near
    row = np.repeat(np.arange(len(inverse), dtype=product.indices.dtype), np.diff(product.indptr))
    for first in range(0, len(row), _PIECE):
        piece = slice(first, first + _PIECE)
        product.data[piece] = -factor * (inverse[row[piece]] @ product.data[piece])
    _add(product, row, P)
    return bsr_array((product.data.astype(np.float32), product.indices, product.indptr), shape=product.shape)


def _add(A: bsr_array, row: Ints, P: bsr_array) -> None:
    """Add P, with a block in each block row or none, to A in place, which has these blocks; `row`: those of A's."""
    own = np.full(len(A.indptr) - 1, -1, P.indices.dtype)
    own[np.diff(P.indptr) > 0] = P.indices
    at = np.flatnonzero(A.indices == own[row])
    A.data[at] += P.data[P.indptr[row[at]]]


def _galerkin(K: bsr_array, P: bsr_array, all_P: bsr_array) -> bsr_array:
    """Return P^T K P, summed over parts of the own rows of K: K P has several times the blocks of P.

    P has rows for own nodes, `all_P` also those of the other nodes that K touches.
    """
    n = len(K.indptr) - 1
    parts = (transposed(_rows(P, k, k + _ROWS)) @ (_rows(K, k, k + _ROWS) @ all_P) for k in range(0, max(n, 1), _ROWS))
    return bsr_array(sum(parts, next(parts)))


def _rows(A: bsr_array, first: int, last: int) -> bsr_array:
    """Return block rows first to last of A, without a copy of their blocks."""
    indptr, b = A.indptr[first : last + 1], A.blocksize[0]
    own = slice(indptr[0], indptr[-1])
    return bsr_array((A.data[own], A.indices[own], indptr - indptr[0]), shape=(b * (len(indptr) - 1), A.shape[1]))
