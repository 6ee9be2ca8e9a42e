"""The triangle of a symmetric matrix, as the modules of direct backends take it.

Each has a function `analyse(triangle, threads)`, which orders the elimination and returns a function of a triangle's
values, `Factorise`. Its result is a function of right-hand sides, `Solve`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints

#: b -> K^-1 b, for b (n,), or (n, k) stored by columns; b may be overwritten
Solve: TypeAlias = Callable[[Floats], Floats]
#: values of a triangle -> its factor, which may overwrite the previous one; raises Breakdown
Factorise: TypeAlias = Callable[[Floats], Solve]


@dataclass(frozen=True, eq=False)
class Triangle:
    """The lower triangle by columns, which is the upper one by rows: column j holds `indices[indptr[j]:indptr[j + 1]]`.

    Indices are ascending, the diagonal first. `taken` (nnz,): mask of the values of the full matrix, by rows, that
    belong to the triangle.
    """

    indptr: Ints
    indices: Ints
    taken: NDArray[np.bool_]

    @classmethod
    def of(cls, K: csr_array) -> Triangle:
        """Return the triangle of a symmetric matrix that is stored in full, with sorted indices and its diagonal."""
        rows = np.repeat(np.arange(K.shape[0], dtype=K.indices.dtype), np.diff(K.indptr))
        taken = K.indices >= rows
        kept = np.concatenate([[0], np.cumsum(taken, dtype=K.indptr.dtype)])
        return cls(kept[K.indptr].astype(K.indptr.dtype), K.indices[taken], taken)

    @property
    def n(self) -> int:
        """Number of rows of the matrix."""
        return len(self.indptr) - 1

    def values(self, K: csr_array) -> Floats:
        """Return the values of the triangle of a matrix with the same pattern."""
        return K.data[self.taken]
