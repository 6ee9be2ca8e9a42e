"""One triangle of a symmetric matrix, taken out of its full storage once and again for new values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints


@dataclass(frozen=True, eq=False)
class Triangle:
    """The lower triangle by columns, which is the upper one by rows: column j holds `indices[indptr[j]:indptr[j + 1]]`.

    Ascending, the diagonal first. `taken` (nnz,): which values of the full matrix, by rows, stand in it.
    """

    indptr: Ints
    indices: Ints
    taken: NDArray[np.bool_]

    @classmethod
    def of(cls, K: csr_array) -> Triangle:
        """The triangle of a symmetric matrix stored in full, its indices sorted, its diagonal stored."""
        rows = np.repeat(np.arange(K.shape[0], dtype=K.indices.dtype), np.diff(K.indptr))
        taken = K.indices >= rows
        kept = np.concatenate([[0], np.cumsum(taken, dtype=K.indptr.dtype)])
        return cls(kept[K.indptr].astype(K.indptr.dtype), K.indices[taken], taken)

    @property
    def n(self) -> int:
        """Rows of the matrix."""
        return len(self.indptr) - 1

    @cached_property
    def columns(self) -> Ints:
        """(nnz,): the column of every entry."""
        return np.repeat(np.arange(self.n, dtype=self.indices.dtype), np.diff(self.indptr))

    def values(self, K: csr_array) -> Floats:
        """Values of the triangle of a matrix with the same pattern."""
        return K.data[self.taken]
