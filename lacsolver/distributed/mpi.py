"""The communicator of several processes, those of MPI."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from lacmesh.communicator import Communicator
from lacmesh.errors import LacmeshError
from lacmesh.mesh import Ints

T = TypeVar("T")


class MpiCommunicator(Communicator):
    """The processes of an MPI communicator `comm`; see `lacmesh.communicator`."""

    def __init__(self, comm: Any) -> None:
        from mpi4py.MPI import MAX

        self.mpi, self.rank, self.size = comm, comm.Get_rank(), comm.Get_size()
        self._maximum = MAX

    def total(self, x: NDArray) -> NDArray:
        """Return the sum of an array over all processes."""
        sent = np.ascontiguousarray(x)
        got = np.empty_like(sent)
        self.mpi.Allreduce(sent, got)
        return got.reshape(np.shape(x))[()]

    def greatest(self, x: NDArray) -> NDArray:
        """Return the largest value of all processes at each place of an array without NaN."""
        sent = np.ascontiguousarray(x)
        got = np.empty_like(sent)
        self.mpi.Allreduce(sent, got, self._maximum)
        return got.reshape(np.shape(x))[()]

    def before(self, count: int) -> int:
        """Return the sum of a number over the processes before this one."""
        return sum(self.mpi.allgather(count)[: self.rank])

    def largest(self, x: float) -> float:
        """Return the largest value of all processes; NaN if one is."""
        got = np.empty(2)
        sent = np.array([np.isnan(x), -np.inf if np.isnan(x) else x])  # the maximum of MPI does not keep NaN
        self.mpi.Allreduce(sent, got, self._maximum)
        return float("nan") if got[0] else float(got[1])

    def gather(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other."""
        sent, counts = self._rows(x)
        got = np.empty((int(counts.sum()), *sent.shape[1:]), sent.dtype)
        size = _width(sent)
        self.mpi.Allgatherv(sent, [got, (size * counts).tolist()])
        return got

    def _rows(self, x: NDArray) -> tuple[NDArray, Ints]:
        """Return an array (k, ...) as it is sent, and the number of rows (n,) of all processes."""
        sent, counts = np.ascontiguousarray(x), np.empty(self.size, np.int64)
        self.mpi.Allgather(np.array([len(sent)], np.int64), counts)
        return sent, counts

    def same(self, x: NDArray) -> NDArray:
        """Return the array that the first process has."""
        out = np.ascontiguousarray(x)
        self.mpi.Bcast(out)
        return out

    def collect(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other, on the first process; on others what is empty."""
        sent, counts = self._rows(x)
        got = np.empty((int(counts.sum()) if self.rank == 0 else 0, *sent.shape[1:]), sent.dtype)
        size = _width(sent)
        self.mpi.Gatherv(sent, [got, (size * counts).tolist()] if self.rank == 0 else None)
        return got

    def deal(self, x: NDArray, counts: Ints) -> NDArray:
        """Return this process's part of an array that the first process has, of which each takes as many rows."""
        kind, shape = self.mpi.bcast((x.dtype, x.shape[1:]) if self.rank == 0 else None)
        got = np.empty((int(counts[self.rank]), *shape), kind)
        size = _width(got)
        sent = [np.ascontiguousarray(x), (size * counts).tolist()] if self.rank == 0 else None
        self.mpi.Scatterv(sent, got)
        return got

    def hand_out(self, make: Callable[[int], T] | None) -> T:
        """Return this process's object `make(rank)`; the first process, which alone has `make`, makes all of them.

        Objects are made and sent one after the other, each without a copy of its arrays, of any size below 2 GiB each.
        """
        from mpi4py.util.pkl5 import Intracomm

        objects = Intracomm(self.mpi)
        if make is None:
            received: T = objects.recv(source=0)
            return received
        for rank in range(1, self.size):
            objects.send(make(rank), dest=rank)
        return make(0)

    def gather_rows(self, A: csr_array) -> csr_array:
        """Return the rows of all processes, one process after the other; columns mean the same on all."""
        A = csr_array(A)
        ends = np.concatenate([[0], np.cumsum(self.gather(np.diff(A.indptr).astype(np.int64)))])
        columns = self.gather(A.indices.astype(np.int64))
        return csr_array((self.gather(A.data), columns, ends), shape=(len(ends) - 1, A.shape[1]))

    def total_matrix(self, A: csr_array) -> csr_array:
        """Return the sum of a sparse matrix over all processes; rows and columns mean the same on all."""
        entries = A.tocoo()
        row, column, value = (
            self.gather(part) for part in (*(i.astype(np.int64) for i in entries.coords), entries.data)
        )
        return csr_array(coo_array((value, (row, column)), shape=A.shape).tocsr())

    def exchange(self, x: NDArray, counts: Ints, expected: Ints | None = None) -> tuple[NDArray, Ints]:
        """Send rows x (k, ...), `counts` (size,) of them to each process in order; return those that come, and counts.

        Only processes with rows for each other send messages.
        """
        from mpi4py.MPI import BYTE

        if expected is None:
            expected = np.empty(self.size, np.int64)
            self.mpi.Alltoall(np.ascontiguousarray(counts, np.int64), expected)
        sent = np.ascontiguousarray(x)
        got = np.empty((int(expected.sum()), *sent.shape[1:]), sent.dtype)
        row = BYTE.Create_contiguous(sent.itemsize * _width(sent)).Commit()
        try:
            waits = [self.mpi.Irecv([part, len(part), row], k) for k, part in _parts(got, expected)]
            waits += [self.mpi.Isend([part, len(part), row], k) for k, part in _parts(sent, counts)]
            for wait in waits:
                wait.Wait()
        finally:
            row.Free()
        return got, expected

    def texts(self, own: Sequence[str]) -> tuple[str, ...]:
        """Return the different texts of all processes, those of the first one first."""
        return tuple(dict.fromkeys(text for texts in self.mpi.allgather(tuple(own)) for text in texts))

    def agree(self, error: Exception | None) -> None:
        """Raise the error of the first process that has one, on all of them."""
        first = int(-self.largest(-float(self.rank if error is not None else self.size)))
        if first == self.size:
            return
        raised = self.mpi.bcast(None if error is None else (type(error), str(error)), root=first)
        raise error if error is not None else _error_of(*raised)

    def on_first(self, work: Callable[[], T]) -> T | None:
        """Do something on the first process alone, and return its result there; raise its error on all of them."""
        return self.on_each(lambda: work() if self.rank == 0 else None)

    def on_each(self, work: Callable[[], T]) -> T:
        """Do something on every process by itself; raise the error of the first one that fails on all of them."""
        failed: Exception | None = None
        try:
            result = work()
        except Exception as error:
            failed = error
        self.agree(failed)
        return result


def _error_of(kind: type[Exception], message: str) -> Exception:
    """Return an error with a message; a LacmeshError if errors of this kind are made of more."""
    try:
        return kind(message)
    except (TypeError, AttributeError):
        error = LacmeshError(message)
        error.status = getattr(kind, "status", error.status)
        return error


def _width(x: NDArray) -> int:
    """Return the number of values in a row of an array (k, ...)."""
    return int(np.prod(x.shape[1:], dtype=np.int64))


def _parts(x: NDArray, counts: Ints) -> list[tuple[int, NDArray]]:
    """Return the rows of x (k, ...) of each process that has some, `counts` (size,) in order, with its number."""
    ends = np.cumsum(counts)
    return [(k, x[ends[k] - counts[k] : ends[k]]) for k in np.flatnonzero(counts).tolist()]
