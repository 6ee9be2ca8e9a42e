"""Operations on vectors that the iterative loops use: products, norms and sums; the only place that a loop sums in.

`multigrid.cycle.Team` has them on several threads, `SharedVectors` on several processes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lacmesh.communicator import Communicator
from lacmesh.mesh import Floats, Ints


class Vectors:
    """Vectors (n,) that are whole arrays of numpy.

    >>> WHOLE.norm(np.array([3.0, 4.0])), WHOLE.largest(np.array([3.0, -4.0]))
    (5.0, 4.0)
    """

    #: extent of the body of each unknown, (n,), where there are several
    size: Floats | float = 1.0

    def dots(self, A: Floats, x: Floats) -> NDArray[np.floating]:
        """Return the products (k,) of rows A (k, n) with x."""
        return np.asarray(A @ x)

    def norm(self, x: Floats) -> float:
        """Return the Euclidean norm."""
        return float(np.linalg.norm(x))

    def largest(self, x: Floats) -> float:
        """Return the largest magnitude of an entry, 0 for an empty vector."""
        return float(np.abs(x).max(initial=0.0))

    def largest_of_body(self, x: Floats) -> Floats | float:
        """Return for each unknown the largest magnitude of an entry at its body, (n,); a number if all are one body."""
        return self.largest(x)

    def norm_of_body(self, x: Floats) -> Floats | float:
        """Return for each unknown the Euclidean norm of the entries at its body, (n,); a number if all are one body."""
        return self.norm(x)

    def subtract(self, c: Floats, A: Floats, x: Floats) -> None:
        """Subtract c A from x in place, for rows A (k, n)."""
        x -= c @ A

    def summed(self, f: Floats) -> NDArray[np.floating]:
        """Return f (n,) with sums over all processes at unknowns that all have, where each process has a part."""
        return f

    def same(self, x: NDArray) -> NDArray:
        """Return an array that all processes compute, as the first one has it: their processors may round otherwise."""
        return x


class BodyVectors(Vectors):
    """Vectors of unknowns of several bodies: `body` (n,), the number of that of each, and `size` (n,), its extent.

    >>> vectors = BodyVectors(np.array([0, 1, 0]), np.ones(3))
    >>> vectors.largest_of_body(np.array([3.0, -1.0, 4.0])).tolist()
    [4.0, 1.0, 4.0]
    """

    def __init__(self, body: Ints, size: Floats) -> None:
        self.size, self._body, self._n = size, body, int(body.max(initial=-1)) + 1

    def largest_of_body(self, x: Floats) -> Floats | float:
        """Return for each unknown the largest magnitude of an entry at its body, (n,)."""
        out = np.zeros(self._n)
        np.maximum.at(out, self._body, np.abs(x))
        return out[self._body]

    def norm_of_body(self, x: Floats) -> Floats | float:
        """Return for each unknown the Euclidean norm of the entries at its body, (n,)."""
        return np.asarray(np.sqrt(np.bincount(self._body, np.square(x), self._n))[self._body])


class SharedVectors(Vectors):
    """Vectors of unknowns of which each process of `comm` holds some, its `own` (n,), and copies of others.

    Entries beyond the n unknowns, such as pressures, are the same on all processes. `summed`: the method.
    """

    def __init__(self, own: NDArray[np.bool_], summed: Callable[[Floats], Floats], comm: Communicator) -> None:
        self._own, self._weight = np.flatnonzero(own), own.astype(float)
        self._summed, self._comm = summed, comm

    def dots(self, A: Floats, x: Floats) -> NDArray[np.floating]:
        """Return the products (k,) of rows A (k, n) with x."""
        if not len(A):
            return np.zeros(0)
        n = len(self._weight)
        rest = A[:, n:] @ x[n:] if self._comm.rank == 0 and len(x) > n else 0.0
        return np.asarray(self._comm.total(A[:, :n] @ (x[:n] * self._weight) + rest))

    def norm(self, x: Floats) -> float:
        """Return the Euclidean norm."""
        return float(np.sqrt(self.dots(x[None], x)[0]))

    def largest(self, x: Floats) -> float:
        """Return the largest magnitude of an entry, 0 for an empty vector."""
        n = len(self._weight)
        own = float(np.abs(x[self._own]).max(initial=0.0))
        return self._comm.largest(max(own, float(np.abs(x[n:]).max(initial=0.0))))

    def summed(self, f: Floats) -> NDArray[np.floating]:
        """Return f (n,) with sums over all processes at unknowns that all have, where each process has a part."""
        return self._summed(f)

    def same(self, x: NDArray) -> NDArray:
        """Return an array that all processes compute, as the first one has it: their processors may round otherwise."""
        return self._comm.same(x)


def products(vectors: Vectors, A: Floats, B: Floats) -> NDArray[np.floating]:
    """Return A^T B (k, j) of the columns of A (n, k) with the columns of B (n, j)."""
    if not (A.shape[1] and B.shape[1]):
        return np.zeros((A.shape[1], B.shape[1]))
    return np.stack([vectors.dots(A.T, column) for column in B.T], axis=1)


#: whole arrays
WHOLE = Vectors()
