"""Levels of a multigrid hierarchy that several processes share: their vectors, and the sums over processes.

A process has consecutive own nodes of each level, and beside its own entries of a vector those of the neighbouring
nodes that its rows of a matrix touch, the nodes of lower processes first.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.cycle import Team


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


class OwnRows(NamedTuple):
    """Own rows of a matrix in blocks: `A` (own, own and ghosts), and the `ghosts` (g,), sorted nodes of others."""

    A: bsr_array
    ghosts: Ints

    @staticmethod
    def of(csr: tuple[Ints, Ints, Floats], blocks: tuple[int, int], starts: Ints, rank: int) -> OwnRows:
        """Return rows with columns in the whole matrix, given as (indptr, indices, data).

        `blocks`: the unknowns of a node of the rows and of the columns; `starts` (processes + 1,): the first node of
        the columns of each process.
        """
        indptr, indices, data = csr
        node, b = indices // blocks[1], blocks[1]
        first, last = starts[rank], starts[rank + 1]
        mine = (node >= first) & (node < last)
        ghosts, at = np.unique(node[~mine], return_inverse=True)
        local = node - first
        local[~mine] = last - first + at
        shape = len(indptr) - 1, b * int(last - first + len(ghosts))
        made = csr_array((data, b * local + indices % b, indptr), shape=shape)
        return OwnRows(bsr_array(made.tobsr(blocks)), ghosts)


class SharedHalo:
    """The entries at `ghosts` (g,), nodes of other processes, after the own entries of a vector.

    `starts` (processes + 1,): first node of each process; `block`: unknowns of a node.
    """

    def __init__(self, processes: Communication, starts: Ints, ghosts: Ints, block: int) -> None:
        comm, rank = processes.comm, processes.rank
        self._processes, self._comm, self._block = processes, comm, block
        self._first, self._whole = int(starts[rank]), int(starts[-1])
        self._n_own, self._ghosts = int(starts[rank + 1] - starts[rank]), ghosts
        ends = np.searchsorted(ghosts, starts)
        wanted = comm.alltoall([ghosts[ends[k] : ends[k + 1]] for k in range(len(starts) - 1)])
        #: process, and the places of what comes from it
        self._asked = [
            (k, slice(self._n_own + ends[k], self._n_own + ends[k + 1])) for k in np.flatnonzero(np.diff(ends))
        ]
        #: process, and the own nodes that it asks for
        self._given = [(k, nodes - self._first) for k, nodes in enumerate(wanted) if len(nodes)]

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


class Everywhere:
    """The coarsest level, whose vectors all processes have whole."""

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
