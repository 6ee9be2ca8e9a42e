"""Levels of a multigrid hierarchy that several processes share: their vectors, and the sums over processes.

A process has consecutive own nodes of each level, and beside its own entries of a vector those of the neighbouring
nodes that its rows of a matrix touch, the nodes of lower processes first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.communicator import Communicator
from lacmesh.mesh import Floats, Ints
from lacsolver.linear.multigrid.cycle import Halo


class BlockRows(NamedTuple):
    """Rows of blocks (k, b, c), with the number of blocks of each, `length`, and their `columns` (k,).

    Columns are those of the matrix of all processes.
    """

    length: Ints
    columns: Ints
    data: NDArray[np.floating]

    def compressed(self, first: int, last: int) -> tuple[bsr_array, Ints]:
        """Return the rows, with the own columns first to last before others, and the numbers (g,) of these, sorted."""
        mine = (self.columns >= first) & (self.columns < last)
        ghosts, at = np.unique(self.columns[~mine], return_inverse=True)
        local = self.columns - first
        local[~mine] = last - first + at
        indptr = np.concatenate([[0], np.cumsum(self.length)])
        b, c = self.data.shape[1:]
        shape = b * len(self.length), c * (last - first + len(ghosts))
        index = np.int32 if max(indptr[-1], *shape) < np.iinfo(np.int32).max else np.int64
        return bsr_array((self.data, local.astype(index), indptr.astype(index)), shape=shape), ghosts

    def some(self, chosen: Ints) -> BlockRows:
        """Return the `chosen` rows."""
        ends = np.cumsum(self.length)
        length = self.length[chosen]
        first = np.repeat((ends - self.length)[chosen] - (np.cumsum(length) - length), length)
        at = first + np.arange(len(first))
        return BlockRows(length, self.columns[at], self.data[at])

    def followed_by(self, others: BlockRows) -> BlockRows:
        """Return these rows and others after them."""
        return BlockRows(*(np.concatenate(arrays) for arrays in zip(self, others, strict=True)))

    def exchanged(self, comm: Communicator, counts: Ints, expected: Ints) -> BlockRows:
        """Send rows to other processes, and return those that they send; see `Communicator.exchange`."""
        length = comm.exchange(self.length, counts, expected)[0]
        blocks, incoming = _sums(self.length, counts), _sums(length, expected)
        columns, data = (comm.exchange(values, blocks, incoming)[0] for values in (self.columns, self.data))
        return BlockRows(length, columns, data)


def _sums(x: Ints, counts: Ints) -> Ints:
    """Return the sums (n,) of consecutive parts of x, of `counts` (n,) entries each."""
    return np.diff(np.append(0, np.cumsum(x))[np.append(0, np.cumsum(counts))])


class SharedHalo(Halo):
    """The entries at `ghosts` (g,), nodes of other processes, ascending, after the own entries of a vector.

    `starts` (size + 1,): first node of each process; `block`: unknowns of a node.
    """

    def __init__(self, comm: Communicator, starts: Ints, ghosts: Ints, block: int) -> None:
        self._comm, self._starts, self._ghosts, self._block = comm, starts, ghosts, block
        self._first, self._whole = int(starts[comm.rank]), int(starts[-1])
        self._n_own = int(starts[comm.rank + 1]) - self._first
        #: (size,): number of ghosts that each process owns
        self._n_ghosts = np.diff(np.searchsorted(ghosts, starts))
        wanted, self._n_wanted = comm.exchange(ghosts, self._n_ghosts)
        #: own nodes that are ghosts of other processes, process after process, `n_wanted` (size,) of each
        self._wanted = wanted - self._first

    @staticmethod
    def of_rows(rows: BlockRows, comm: Communicator) -> tuple[bsr_array, SharedHalo]:
        """Return the own rows of a square matrix of all processes, and the halo of their columns."""
        starts = np.cumsum(np.append(0, comm.gather(np.array([len(rows.length)]))))
        own, ghosts = rows.compressed(int(starts[comm.rank]), int(starts[comm.rank + 1]))
        return own, SharedHalo(comm, starts, ghosts, own.blocksize[1])

    @property
    def everywhere(self) -> Everywhere:
        """The halo of these vectors where each process has them whole."""
        return Everywhere(self._comm, self._block)

    def fill(self, x: NDArray[np.floating]) -> None:
        """Fill the entries of ghosts with those of their own processes."""
        nodes = x.reshape(-1, self._block)
        nodes[self._n_own :] = self._comm.exchange(nodes[self._wanted], self._n_wanted, self._n_ghosts)[0]

    def add(self, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the own entries with those that other processes have for them added, in the order of processes."""
        nodes = x.reshape(-1, self._block)
        others = self._comm.exchange(nodes[self._n_own :], self._n_ghosts, self._n_wanted)[0]
        out, ends = nodes[: self._n_own].copy(), np.cumsum(self._n_wanted)[:-1]
        for own, part in zip(np.split(self._wanted, ends), np.split(others, ends), strict=True):
            out[own] += part
        return out.ravel()

    def add_columns(self, A: bsr_array) -> bsr_array:
        """Return the own columns of a matrix (a, own and ghosts) with what other processes have for them added."""
        number = np.concatenate([self._first + np.arange(self._n_own), self._ghosts])
        placed = (A.data, number[A.indices], A.indptr)
        whole = bsr_array(placed, shape=(A.shape[0], self._block * self._whole)).tocsr()
        added = self._comm.total_matrix(csr_array(whole)).tocoo()
        row, column = added.coords[0], added.coords[1] - self._block * self._first
        own = (column >= 0) & (column < self._block * self._n_own)
        shape = A.shape[0], self._block * self._n_own
        own_rows = csr_array((added.data[own], (row[own], column[own])), shape=shape)
        return bsr_array(own_rows.tobsr((1, self._block)))

    def of_columns(self, A: bsr_array) -> SharedHalo:
        """Return the halo of vectors of the columns of A, all of which are own entries."""
        block = A.blocksize[1]
        starts = np.cumsum(np.append(0, self._comm.gather(np.array([A.shape[1] // block]))))
        return SharedHalo(self._comm, starts, np.empty(0, np.int64), block)

    def with_ghosts(self, A: bsr_array, columns: SharedHalo) -> tuple[bsr_array, SharedHalo]:
        """Return own rows of A with those of neighbours below them, and the halo of the columns that they have."""
        rows = columns._numbered(A)
        of_ghosts = rows.some(self._wanted).exchanged(self._comm, self._n_wanted, self._n_ghosts)
        return columns._compressed(rows.followed_by(of_ghosts))

    def add_rows(self, A: bsr_array, columns: SharedHalo) -> tuple[bsr_array, SharedHalo]:
        """Return the own rows of A with what all processes have for them added, and the halo of their columns."""
        rows, n = columns._numbered(A), self._n_own
        others = rows.some(np.arange(n, n + len(self._ghosts))).exchanged(self._comm, self._n_ghosts, self._n_wanted)
        sums, halo = columns._compressed(rows.some(np.arange(n)).followed_by(others))
        return _folded(sums, self._wanted), halo

    def whole_columns(self, A: bsr_array) -> bsr_array:
        """Return own rows of A for vectors that each process has whole."""
        rows = self._numbered(A)
        shape = A.shape[0], self._block * self._whole
        return bsr_array((rows.data, rows.columns, A.indptr), shape=shape)

    def whole(self, A: bsr_array, x: Floats) -> tuple[bsr_array, NDArray[np.floating]]:
        """Return the rows of all processes, of a square matrix and of x (own unknowns, r)."""
        rows = self._comm.gather_rows(csr_array(self.whole_columns(A).tocsr()))
        return bsr_array(rows.tobsr(A.blocksize)), self._comm.gather(x)

    def _numbered(self, A: bsr_array) -> BlockRows:
        """Return rows with the columns of this halo."""
        number = np.concatenate([self._first + np.arange(self._n_own), self._ghosts])
        return BlockRows(np.diff(A.indptr), number[A.indices], A.data)

    def _compressed(self, rows: BlockRows) -> tuple[bsr_array, SharedHalo]:
        """Return rows with the own columns before others, and the halo of these."""
        matrix, ghosts = rows.compressed(self._first, self._first + self._n_own)
        return matrix, SharedHalo(self._comm, self._starts, ghosts, self._block)


def _folded(A: bsr_array, place: Ints) -> bsr_array:
    """Return the first rows of A with each of the last ones added to that at its `place` (k,)."""
    length, order = np.diff(A.indptr), np.argsort(place, kind="stable")
    n, end = len(length) - len(place), A.indptr[-1 - len(place)]
    shape = A.blocksize[0] * n, A.shape[1]
    last = BlockRows(length[n:], A.indices[end:], A.data[end:]).some(order)
    counts = np.bincount(place[order], last.length, minlength=n)
    indptr = np.concatenate([[0], np.cumsum(counts)]).astype(A.indptr.dtype)
    first = bsr_array((A.data[:end], A.indices[:end], A.indptr[: n + 1]), shape=shape)
    return bsr_array(first + bsr_array((last.data, last.columns, indptr), shape=shape))


class Everywhere(Halo):
    """A level whose vectors all processes have whole."""

    def __init__(self, comm: Communicator, block: int) -> None:
        self._comm, self._block = comm, block

    def add(self, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the sum over all processes."""
        return self._comm.total(x)

    def add_columns(self, A: bsr_array) -> bsr_array:
        """Return the sum of a matrix over all processes."""
        return bsr_array(self._comm.total_matrix(csr_array(A.tocsr())).tobsr((1, self._block)))
