"""Processes that compute together, each with a part of the data: sums over all of them, and messages between them.

A function that serves one process and several takes a `Communicator`, by default `SERIAL`, of the one process that has
everything. `lacsolver.distributed.mpi` has that of the processes of MPI.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from lacmesh.mesh import Ints

T = TypeVar("T")


class Communicator:
    """One process alone, of which every sum is its own value. With several, all of them call each method together.

    `rank`: number of this process, from 0; `size`: number of processes; `mpi`: their communicator of MPI, None for one.

    >>> import numpy as np
    >>> SERIAL.total(np.ones(2)), SERIAL.largest(3.0)
    (array([1., 1.]), 3.0)
    """

    rank, size = 0, 1
    mpi: Any = None

    def total(self, x: NDArray) -> NDArray:
        """Return the sum of an array over all processes."""
        return x

    def total_matrix(self, A: csr_array) -> csr_array:
        """Return the sum of a sparse matrix over all processes; rows and columns mean the same on all."""
        return A

    def greatest(self, x: NDArray) -> NDArray:
        """Return the largest value of all processes at each place of an array without NaN."""
        return x

    def largest(self, x: float) -> float:
        """Return the largest value of all processes; NaN if one is."""
        return x

    def before(self, count: int) -> int:
        """Return the sum of a number over the processes before this one."""
        return 0

    def gather(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other."""
        return x

    def gather_rows(self, A: csr_array) -> csr_array:
        """Return the rows of all processes, one process after the other; columns mean the same on all."""
        return A

    def collect(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other, on the first process; on others what is empty."""
        return x

    def deal(self, x: NDArray, counts: Ints) -> NDArray:
        """Return this process's part of an array that the first process has, of which each takes as many rows."""
        return x

    def same(self, x: NDArray) -> NDArray:
        """Return the array that the first process has."""
        return x

    def exchange(self, x: NDArray, counts: Ints, expected: Ints | None = None) -> tuple[NDArray, Ints]:
        """Send rows x (k, ...), `counts` (size,) of them to each process in order; return those that come, and counts.

        `expected` (size,): number of rows that come from each process, asked for if None.
        """
        return x, counts

    def texts(self, own: Sequence[str]) -> tuple[str, ...]:
        """Return the different texts of all processes, those of the first one first."""
        return tuple(dict.fromkeys(own))

    def agree(self, error: Exception | None) -> None:
        """Raise the error of the first process that has one, on all of them."""
        if error is not None:
            raise error

    def on_first(self, work: Callable[[], T]) -> T | None:
        """Do something on the first process alone, and return its result there; raise its error on all of them."""
        return work()

    def on_each(self, work: Callable[[], T]) -> T:
        """Do something on every process by itself; raise the error of the first one that fails on all of them."""
        return work()


#: of one process alone
SERIAL = Communicator()
