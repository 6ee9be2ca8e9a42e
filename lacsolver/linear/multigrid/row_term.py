"""The term N^T N that a few rows N add to a matrix K: its products, and its part in the smoother of a V-cycle.

Of a level that several processes share, each has the columns of its own nodes, of all rows; sums over columns are those
of all processes.

The smoother is a polynomial in M^-1 K, with M block diagonal and v K v <= v M v for all v. With rows, M + N^T N takes
the place of M on the finest level. Its inverse is M^-1 and a correction on the unknowns of the rows (Woodbury), for
which a sparse matrix of the size of the rows is factorised. On coarser levels, where rows overlap and that matrix would
be dense, M + L takes its place, with L block diagonal and v N^T N v <= v L v.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, csr_array, eye_array
from scipy.sparse.linalg import SuperLU

from lacmesh.communicator import Communicator
from lacmesh.mesh import Floats, Ints
from lacsolver.linear.direct.superlu import factor_of


class RowTerm(NamedTuple):
    """The term N^T N of rows N (a, n), on the `unknowns` (s,) of the nodes that they touch, in single precision.

    `factor`, `N_M`: the factor of 1 + N M^-1 N^T, and N M^-1, where the smoother has the term itself; else None.
    """

    unknowns: Ints
    N: csr_array
    N_T: csr_array
    factor: SuperLU | None = None
    N_M: csr_array | None = None

    @staticmethod
    def of(N: bsr_array) -> RowTerm:
        """Return the term of rows of blocks (1, b)."""
        b = N.blocksize[1]
        nodes, at = np.unique(N.indices, return_inverse=True)
        own = _rows(N.data, at, N.indptr, len(nodes))
        return RowTerm((b * nodes[:, None] + np.arange(b)).ravel(), own, own.T.tocsr())

    @staticmethod
    def smoothed(N: bsr_array, inverse: Floats, comm: Communicator) -> RowTerm:
        """Return the term of rows of blocks (1, b) with its correction of M^-1, whose blocks are (n / b, b, b)."""
        term = RowTerm.of(N)
        nodes, at = np.unique(N.indices, return_inverse=True)
        N_M = _rows(N.data @ inverse[N.indices], at, N.indptr, len(nodes))
        products = comm.total_matrix(csr_array(N_M.astype(float) @ term.N_T))
        factor = factor_of(csc_array(eye_array(N.shape[0]) + products))
        return term._replace(factor=factor, N_M=N_M)

    def subtract(self, r: NDArray[np.floating], x: NDArray[np.floating], comm: Communicator) -> None:
        """Subtract N^T N x from r in place."""
        r[self.unknowns] -= self.N_T @ comm.total(self.N @ x[self.unknowns])

    def correct(
        self, factor: float, r: NDArray[np.floating], comm: Communicator, *vectors: NDArray[np.floating]
    ) -> None:
        """Add `factor` (M + N^T N)^-1 r - `factor` M^-1 r to each of the `vectors`, in place."""
        if self.factor is None or self.N_M is None:
            return
        p = factor * self.factor.solve(comm.total(self.N_M @ r[self.unknowns]).astype(float))
        change = self.N_M.T @ p.astype(r.dtype)
        for one in vectors:
            one[self.unknowns] -= change


def scaled_rows(N: bsr_array, rows: Ints, factor: Floats) -> bsr_array:
    """Return some `rows` (a,) of blocks (1, b), each times its `factor` (a,)."""
    length = np.diff(N.indptr)[rows]
    ends = np.concatenate([[0], np.cumsum(length)])
    at = np.repeat(N.indptr[rows] - ends[:-1], length) + np.arange(ends[-1])
    data = (N.data[at] * np.repeat(factor, length)[:, None, None]).astype(N.dtype)
    return bsr_array((data, N.indices[at], ends.astype(N.indptr.dtype)), shape=(len(rows), N.shape[1]))


def _rows(blocks: Floats, nodes: Ints, indptr: Ints, n_nodes: int) -> csr_array:
    """Return rows of blocks (k, 1, b) at `nodes` (k,), without their zeros."""
    shape = len(indptr) - 1, n_nodes * blocks.shape[2]
    rows = csr_array(bsr_array((blocks, nodes.astype(indptr.dtype), indptr), shape=shape).tocsr())
    rows.eliminate_zeros()
    return rows


def bounded(inverse: NDArray[np.floating], N: bsr_array, comm: Communicator) -> NDArray[np.floating]:
    """Return the blocks (n / b, b, b) of (M + L)^-1 for those of M^-1, with v N^T N v <= v L v for rows N (a, n).

    Of the entries n_j of a row at the nodes j, n_j n_j^T / t_j is added at each node, with t_j > 0 and sum t_j = 1
    (Cauchy-Schwarz). The part t_j is proportional to the root of n_j M^-1 n_j, so that soft bodies have the larger one.
    """
    n, row = N.data[:, 0].astype(float), np.repeat(np.arange(N.shape[0]), np.diff(N.indptr))
    nodes, at = np.unique(N.indices, return_inverse=True)
    own = inverse[nodes].astype(float)
    part = np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", n, own[at], n), 0.0))
    whole = comm.total(np.bincount(row, part, minlength=N.shape[0]).astype(float))[row]
    weight = np.divide(whole, part, out=np.zeros_like(part), where=part > 0)
    terms = ((weight[:, None] * n)[:, :, None] * n[:, None, :]).reshape(len(n), n.shape[1] ** 2)
    L = csr_array((np.ones(len(at)), (at, np.arange(len(at)))), shape=(len(nodes), len(at))) @ terms
    out = inverse.copy()
    out[nodes] = np.linalg.pinv(np.linalg.pinv(own, hermitian=True) + L.reshape(own.shape), hermitian=True)
    return out
