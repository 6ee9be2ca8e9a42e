"""Hierarchy of smoothed aggregation (PyAMG) on nodal blocks, with the rigid-body modes.

Vanek, Mandel, Brezina (1996); the rigid-body modes are the near-null space. Memory is at its largest here, so that
temporary arrays have the size of a part of a matrix where they can.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.cycle import Cycle, Level, Team, jacobi

#: couplings weaker than this, relative to the diagonals, do not join nodes; 0.03 took least time on HEXA8 and TETRA10
_STRENGTH = 0.03
#: most nodes (of six unknowns) of the coarsest level, which is solved by a dense inverse
_COARSEST = 60
_LEVELS = 12
#: damping of the smoothing of prolongations, times the largest eigenvalue of D^-1 K
_SMOOTHING = 4 / 3
#: number of blocks, and of rows of blocks, that are multiplied at once
_PIECE, _ROWS = 1 << 17, 1 << 16


def aggregated(K: bsr_array, modes: Floats, team: Team) -> Cycle:
    """Return the V-cycle of K: aggregates of nodes with orthonormal modes, smoothed by one step of block Jacobi."""
    levels: list[Level] = []
    unit = 1 / float(K.diagonal().mean()) if K.shape[0] else 1.0
    while len(levels) < _LEVELS and K.shape[0] // K.blocksize[0] > _COARSEST:
        inverse, largest = jacobi(K, team)
        tentative, coarse_modes = _tentative(K, modes)
        if tentative.shape[1] >= K.shape[0]:
            break
        P = _smoothed(K, tentative, inverse, _SMOOTHING / largest)
        del tentative  # memory is at its largest in this loop
        coarse = _galerkin(K, P)
        levels.append(Level.of(K, _transposed(P), P, inverse / largest, unit))
        K, modes = coarse, coarse_modes
    return Cycle(levels, K.toarray() * unit, unit, team)


def _tentative(K: bsr_array, modes: Floats) -> tuple[bsr_array, Floats]:
    """Aggregate coupled nodes by PyAMG; return (P, coarse modes) with P (coarse modes) = modes."""
    from pyamg.aggregation import fit_candidates, standard_aggregation
    from pyamg.strength import symmetric_strength_of_connection

    norms = np.sqrt(np.einsum("kij,kij->k", K.data, K.data))  # PyAMG would copy all entries for them
    nodes = csr_array((norms, K.indices, K.indptr), shape=(len(K.indptr) - 1,) * 2)
    aggregates, _ = standard_aggregation(symmetric_strength_of_connection(nodes, theta=_STRENGTH))
    P, coarse = fit_candidates(aggregates, modes)
    return bsr_array(P), coarse


def _smoothed(K: bsr_array, P: bsr_array, inverse: Floats, factor: float) -> bsr_array:
    """Return the smoothed prolongation P - factor D^-1 K P in single precision, in which the cycle has it."""
    made = K @ P
    row = np.repeat(np.arange(len(inverse), dtype=made.indices.dtype), np.diff(made.indptr))
    for first in range(0, len(row), _PIECE):
        piece = slice(first, first + _PIECE)
        made.data[piece] = -factor * (inverse[row[piece]] @ made.data[piece])
    _add(made, row, P)
    return bsr_array((made.data.astype(np.float32), made.indices, made.indptr), shape=made.shape)


def _add(A: bsr_array, row: Ints, P: bsr_array) -> None:
    """Add P, with a block in each block row or none, to A in place, which has these blocks; `row`: those of A's."""
    own = np.full(len(A.indptr) - 1, -1, P.indices.dtype)
    own[np.diff(P.indptr) > 0] = P.indices
    at = np.flatnonzero(A.indices == own[row])
    A.data[at] += P.data[P.indptr[row[at]]]


def _galerkin(K: bsr_array, P: bsr_array) -> bsr_array:
    """Return P^T K P, summed over parts of the rows of K: K P has several times the blocks of P."""
    n = len(K.indptr) - 1
    parts = (_transposed(_rows(P, k, k + _ROWS)) @ (_rows(K, k, k + _ROWS) @ P) for k in range(0, n, _ROWS))
    return bsr_array(sum(parts, next(parts)))


def _rows(A: bsr_array, first: int, last: int) -> bsr_array:
    """Return block rows first to last of A, without a copy of their blocks."""
    indptr, b = A.indptr[first : last + 1], A.blocksize[0]
    own = slice(indptr[0], indptr[-1])
    return bsr_array((A.data[own], A.indices[own], indptr - indptr[0]), shape=(b * (len(indptr) - 1), A.shape[1]))


def _transposed(A: bsr_array) -> bsr_array:
    """Return the transpose of A as blocks."""
    return bsr_array(A.T.tobsr(A.blocksize[::-1]))
