"""Levels of a multigrid hierarchy that several processes share: their vectors, and the sums over processes.

A process has consecutive own nodes of each level, and beside its own entries of a vector those of the neighbouring
nodes that its rows of a matrix touch, the nodes of lower processes first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.multigrid.cycle import Team


class Communication(Protocol):
    """Interface of sums and messages between the processes that share a level: `lacsolver.space.share.Share` has it."""

    @property
    def comm(self) -> Any:
        """The communicator of MPI."""

    @property
    def rank(self) -> int:
        """Number of the process, from 0."""

    def total(self, x: Floats) -> NDArray[np.floating]:
        """Return the sum of an array over all processes."""

    def largest(self, x: float) -> float:
        """Return the largest value of all processes."""

    def gather(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other."""

    def gather_rows(self, A: csr_array) -> csr_array:
        """Return the rows of all processes, one process after the other; columns mean the same on all."""

    def add_matrices(self, A: csr_array, nodal: tuple[bool, bool]) -> csr_array:
        """Return the sum over all processes of matrices of one size, whose rows and columns mean the same on all."""


class SharedTeam(Team):
    """A team of one thread on each of several processes."""

    def __init__(self, processes: Communication) -> None:
        super().__init__(1)
        self._processes = processes

    def dots(self, A: Floats, x: Floats) -> NDArray[np.floating]:
        """Return A x for a few long rows A (k, n) of own entries, summed over all processes."""
        return self.total(super().dots(A, x))

    def largest(self, x: Floats) -> float:
        """Return the largest magnitude of an entry on all processes."""
        return self._processes.largest(super().largest(x))

    def total(self, x: Floats) -> NDArray[np.floating]:
        """Return the sum of an array over all processes."""
        return self._processes.total(x)

    def total_matrix(self, A: csr_array) -> csr_array:
        """Return the sum of a matrix over all processes."""
        return self._processes.add_matrices(A, (False, False))


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

    @staticmethod
    def joined(parts: Sequence[BlockRows]) -> BlockRows:
        """Return the rows of several parts, one after the other."""
        return BlockRows(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


class SharedHalo:
    """The entries at `ghosts` (g,), nodes of other processes, after the own entries of a vector.

    `starts` (processes + 1,): first node of each process; `block`: unknowns of a node.
    """

    def __init__(self, processes: Communication, starts: Ints, ghosts: Ints, block: int) -> None:
        comm, rank = processes.comm, processes.rank
        self._processes, self._comm, self._block, self._starts = processes, comm, block, starts
        self._first, self._whole = int(starts[rank]), int(starts[-1])
        self._n_own, self._ghosts = int(starts[rank + 1] - starts[rank]), ghosts
        ends = np.searchsorted(ghosts, starts)
        wanted = comm.alltoall([ghosts[ends[k] : ends[k + 1]] for k in range(len(starts) - 1)])
        #: process, and the places of what comes from it
        self._asked = [
            (k, slice(self._n_own + ends[k], self._n_own + ends[k + 1])) for k in np.flatnonzero(np.diff(ends)).tolist()
        ]
        #: process, and the own nodes that it asks for
        self._given = [(k, nodes - self._first) for k, nodes in enumerate(wanted) if len(nodes)]

    @staticmethod
    def of_rows(rows: BlockRows, processes: Communication) -> tuple[bsr_array, SharedHalo]:
        """Return the own rows of a square matrix of all processes, and the halo of their columns."""
        counts = processes.gather(np.array([len(rows.length)]))
        starts = np.concatenate([[0], np.cumsum(counts)])
        made, ghosts = rows.compressed(int(starts[processes.rank]), int(starts[processes.rank + 1]))
        return made, SharedHalo(processes, starts, ghosts, made.blocksize[1])

    @property
    def n_processes(self) -> int:
        """Number of processes."""
        return len(self._starts) - 1

    @property
    def everywhere(self) -> Everywhere:
        """The halo of these vectors where each process has them whole."""
        return Everywhere(self._processes, self._block)

    def fill(self, x: NDArray[np.floating]) -> None:
        """Fill the entries of ghosts with those of their own processes."""
        nodes = x.reshape(-1, self._block)
        waits = [self._comm.Irecv(nodes[part], k) for k, part in self._asked]
        sent = [np.ascontiguousarray(nodes[own]) for _, own in self._given]
        waits += [self._comm.Isend(part, k) for part, (k, _) in zip(sent, self._given, strict=True)]
        for wait in waits:
            wait.Wait()

    def add(self, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the own entries with those that other processes have for them added, in the order of processes."""
        nodes = x.reshape(-1, self._block)
        got = [np.empty((len(own), self._block), x.dtype) for _, own in self._given]
        waits = [self._comm.Irecv(part, k) for part, (k, _) in zip(got, self._given, strict=True)]
        waits += [self._comm.Isend(nodes[part], k) for k, part in self._asked]
        for wait in waits:
            wait.Wait()
        out = nodes[: self._n_own].copy()
        for (_, own), part in zip(self._given, got, strict=True):
            out[own] += part
        return out.ravel()

    def add_columns(self, A: bsr_array) -> bsr_array:
        """Return the own columns of a matrix (a, own and ghosts) with what other processes have for them added."""
        number = np.concatenate([self._first + np.arange(self._n_own), self._ghosts])
        placed = (A.data, number[A.indices], A.indptr)
        whole = bsr_array(placed, shape=(A.shape[0], self._block * self._whole)).tocsr()
        added = self._processes.add_matrices(csr_array(whole), (False, False)).tocoo()
        row, column = added.coords[0], added.coords[1] - self._block * self._first
        own = (column >= 0) & (column < self._block * self._n_own)
        shape = A.shape[0], self._block * self._n_own
        made = csr_array((added.data[own], (row[own], column[own])), shape=shape)
        return bsr_array(made.tobsr((1, self._block)))

    def of_columns(self, A: bsr_array) -> SharedHalo:
        """Return the halo of vectors of the columns of A, all of which are own entries."""
        block = A.blocksize[1]
        counts = self._processes.gather(np.array([A.shape[1] // block]))
        return SharedHalo(self._processes, np.concatenate([[0], np.cumsum(counts)]), np.empty(0, np.int64), block)

    def with_ghosts(self, A: bsr_array, columns: SharedHalo) -> tuple[bsr_array, SharedHalo]:
        """Return own rows of A with those of neighbours below them, and the halo of the columns that they have."""
        rows = columns._numbered(A)
        sent = [(k, _some(rows, own)) for k, own in self._given]
        got = self._exchanged(sent, [k for k, _ in self._asked])
        return columns._compressed(BlockRows.joined([rows, *got]))

    def summed(self, A: bsr_array, columns: SharedHalo) -> tuple[bsr_array, SharedHalo]:
        """Return the own rows of A with what all processes have for them added, and the halo of their columns."""
        rows = columns._numbered(A)
        sent = [(k, _some(rows, np.arange(part.start, part.stop))) for k, part in self._asked]
        got = self._exchanged(sent, [k for k, _ in self._given])
        own = _some(rows, np.arange(self._n_own))
        made, halo = columns._compressed(BlockRows.joined([own, *got]))
        return _folded(made, np.concatenate([np.empty(0, np.int64), *(nodes for _, nodes in self._given)])), halo

    def whole_columns(self, A: bsr_array) -> bsr_array:
        """Return own rows of A for vectors that each process has whole."""
        rows = self._numbered(A)
        shape = A.shape[0], self._block * self._whole
        return bsr_array((rows.data, rows.columns, A.indptr), shape=shape)

    def whole(self, A: bsr_array, x: Floats) -> tuple[bsr_array, NDArray[np.floating]]:
        """Return the rows of all processes, of a square matrix and of x (own unknowns, r)."""
        made = self._processes.gather_rows(csr_array(self.whole_columns(A).tocsr()))
        return bsr_array(made.tobsr(A.blocksize)), self._processes.gather(x)

    def _numbered(self, A: bsr_array) -> BlockRows:
        """Return rows with the columns of this halo."""
        number = np.concatenate([self._first + np.arange(self._n_own), self._ghosts])
        return BlockRows(np.diff(A.indptr), number[A.indices], A.data)

    def _compressed(self, rows: BlockRows) -> tuple[bsr_array, SharedHalo]:
        """Return rows with the own columns before others, and the halo of these."""
        made, ghosts = rows.compressed(self._first, self._first + self._n_own)
        return made, SharedHalo(self._processes, self._starts, ghosts, self._block)

    def _exchanged(self, sent: Sequence[tuple[int, BlockRows]], sources: Sequence[int]) -> list[BlockRows]:
        """Send rows to processes, and return those that the `sources` send."""
        waits = [self._comm.isend(tuple(rows), k) for k, rows in sent]
        got = [BlockRows(*self._comm.recv(source=k)) for k in sources]
        for wait in waits:
            wait.Wait()
        return got


def _some(rows: BlockRows, chosen: Ints) -> BlockRows:
    """Return the `chosen` rows."""
    ends = np.cumsum(rows.length)
    length = rows.length[chosen]
    first = np.repeat((ends - rows.length)[chosen] - (np.cumsum(length) - length), length)
    at = first + np.arange(len(first))
    return BlockRows(length, rows.columns[at], rows.data[at])


def _folded(A: bsr_array, place: Ints) -> bsr_array:
    """Return the first rows of A with each of the last ones added to that at its `place` (k,)."""
    length, order = np.diff(A.indptr), np.argsort(place, kind="stable")
    n, end = len(length) - len(place), A.indptr[-1 - len(place)]
    shape = A.blocksize[0] * n, A.shape[1]
    last = _some(BlockRows(length[n:], A.indices[end:], A.data[end:]), order)
    counts = np.bincount(place[order], last.length, minlength=n)
    indptr = np.concatenate([[0], np.cumsum(counts)]).astype(A.indptr.dtype)
    first = bsr_array((A.data[:end], A.indices[:end], A.indptr[: n + 1]), shape=shape)
    return bsr_array(first + bsr_array((last.data, last.columns, indptr), shape=shape))


class Everywhere:
    """A level whose vectors all processes have whole."""

    def __init__(self, processes: Communication, block: int) -> None:
        self._processes, self._block = processes, block

    def fill(self, x: NDArray[np.floating]) -> None:
        """Do nothing: there are no other entries."""

    def add(self, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the sum over all processes."""
        return self._processes.total(x)

    def add_columns(self, A: bsr_array) -> bsr_array:
        """Return the sum of a matrix over all processes."""
        return bsr_array(self._processes.add_matrices(csr_array(A.tocsr()), (False, False)).tobsr((1, self._block)))
