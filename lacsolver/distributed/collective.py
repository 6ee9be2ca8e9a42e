"""Operations of the processes of a communicator together: sums, and arrays sent to all, to one, or to each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.errors import LacmeshError
from lacmesh.mesh import Ints

T = TypeVar("T")


class Collective:
    """The processes of an MPI communicator; all of them call each method."""

    def __init__(self, comm: Any) -> None:
        from mpi4py.MPI import MAX

        self.comm, self.rank, self.n = comm, comm.Get_rank(), comm.Get_size()
        self._maximum = MAX

    def total(self, x: NDArray) -> NDArray:
        """Return the sum of an array over all processes."""
        sent = np.ascontiguousarray(x)
        got = np.empty_like(sent)
        self.comm.Allreduce(sent, got)
        return got.reshape(np.shape(x))[()]

    def greatest(self, x: NDArray) -> NDArray:
        """Return the largest value of all processes at each place of an array without NaN."""
        sent = np.ascontiguousarray(x)
        got = np.empty_like(sent)
        self.comm.Allreduce(sent, got, self._maximum)
        return got.reshape(np.shape(x))[()]

    def before(self, count: int) -> int:
        """Return the sum of a number over the processes before this one."""
        return sum(self.comm.allgather(count)[: self.rank])

    def largest(self, x: float) -> float:
        """Return the largest value of all processes; NaN if one is."""
        got = np.empty(2)
        sent = np.array([np.isnan(x), -np.inf if np.isnan(x) else x])  # the maximum of MPI does not keep NaN
        self.comm.Allreduce(sent, got, self._maximum)
        return float("nan") if got[0] else float(got[1])

    def gather(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other."""
        sent, counts = self._rows(x)
        got = np.empty((int(counts.sum()), *sent.shape[1:]), sent.dtype)
        size = _width(sent)
        self.comm.Allgatherv(sent, [got, (size * counts).tolist()])
        return got

    def _rows(self, x: NDArray) -> tuple[NDArray, Ints]:
        """Return an array (k, ...) as it is sent, and the number of rows (n,) of all processes."""
        sent, counts = np.ascontiguousarray(x), np.empty(self.n, np.int64)
        self.comm.Allgather(np.array([len(sent)], np.int64), counts)
        return sent, counts

    def same(self, x: NDArray) -> NDArray:
        """Return the array that the first process has."""
        out = np.ascontiguousarray(x)
        self.comm.Bcast(out)
        return out

    def collect(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other, on the first process; on others what is empty."""
        sent, counts = self._rows(x)
        got = np.empty((int(counts.sum()) if self.rank == 0 else 0, *sent.shape[1:]), sent.dtype)
        size = _width(sent)
        self.comm.Gatherv(sent, [got, (size * counts).tolist()] if self.rank == 0 else None)
        return got

    def deal(self, x: NDArray, counts: Ints) -> NDArray:
        """Return this process's part of an array that the first process has, of which each takes as many rows."""
        kind, shape = self.comm.bcast((x.dtype, x.shape[1:]) if self.rank == 0 else None)
        got = np.empty((int(counts[self.rank]), *shape), kind)
        size = _width(got)
        sent = [np.ascontiguousarray(x), (size * counts).tolist()] if self.rank == 0 else None
        self.comm.Scatterv(sent, got)
        return got

    def gather_rows(self, A: csr_array) -> csr_array:
        """Return the rows of all processes, one process after the other; columns mean the same on all."""
        A = csr_array(A)
        ends = np.concatenate([[0], np.cumsum(self.gather(np.diff(A.indptr).astype(np.int64)))])
        columns = self.gather(A.indices.astype(np.int64))
        return csr_array((self.gather(A.data), columns, ends), shape=(len(ends) - 1, A.shape[1]))

    def texts(self, own: Sequence[str]) -> tuple[str, ...]:
        """Return the different texts of all processes, those of the first one first."""
        return tuple(dict.fromkeys(text for texts in self.comm.allgather(tuple(own)) for text in texts))

    def agree(self, error: Exception | None) -> None:
        """Raise the error of the first process that has one, on all of them."""
        first = int(-self.largest(-float(self.rank if error is not None else self.n)))
        if first == self.n:
            return
        found = self.comm.bcast(None if error is None else (type(error), str(error)), root=first)
        raise error if error is not None else _made(*found)

    def on_first(self, work: Callable[[], T]) -> T | None:
        """Do something on the first process alone, and return its result there; raise its error on all of them."""
        return self.on_each(lambda: work() if self.rank == 0 else None)

    def on_each(self, work: Callable[[], T]) -> T:
        """Do something on every process by itself; raise the error of the first one that fails on all of them."""
        failed: Exception | None = None
        try:
            made = work()
        except Exception as error:
            failed = error
        self.agree(failed)
        return made


def _made(kind: type[Exception], message: str) -> Exception:
    """Return an error with a message; a LacmeshError if errors of this kind are made of more."""
    try:
        return kind(message)
    except (TypeError, AttributeError):
        made = LacmeshError(message)
        made.status = getattr(kind, "status", made.status)
        return made


def _width(x: NDArray) -> int:
    """Return the number of values in a row of an array (k, ...)."""
    return int(np.prod(x.shape[1:], dtype=np.int64))


class Routes:
    """Ways of rows from each process to others: `counts` (n,) rows to each of them, in their order."""

    def __init__(self, together: Collective, counts: Ints) -> None:
        self._comm, self._sent = together.comm, np.ascontiguousarray(counts, np.int64)
        self._got = np.empty_like(self._sent)
        self._comm.Alltoall(self._sent, self._got)

    def there(self, x: NDArray) -> NDArray:
        """Send the rows x (k, ...), and return those that all processes have sent to this one, in their order."""
        return self._moved(x, self._sent, self._got)

    def back(self, x: NDArray) -> NDArray:
        """Send rows x back to where others came from, and return those that come back, in the order of those sent."""
        return self._moved(x, self._got, self._sent)

    def _moved(self, x: NDArray, counts: Ints, others: Ints) -> NDArray:
        from mpi4py.MPI import BYTE

        sent = np.ascontiguousarray(x)
        got = np.empty((int(others.sum()), *sent.shape[1:]), sent.dtype)
        row = BYTE.Create_contiguous(sent.itemsize * _width(sent)).Commit()
        try:
            self._comm.Alltoallv([sent, counts.tolist(), row], [got, others.tolist(), row])
        finally:
            row.Free()
        return got
