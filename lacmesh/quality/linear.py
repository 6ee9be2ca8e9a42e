"""Base class of Verdict's linear cells: their nodes, and the measures that compare a cell with the mean size."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray


class Linear:
    """Linear cells of one type with nodes x (n, 3, k); measures are methods that return (k,).

    `mean_size`: the mean area or volume of the cells of this type in the mesh, for the measures of relative size.
    """

    def __init__(self, x: NDArray, mean_size: float | None = None) -> None:
        self.x = x
        self._mean = mean_size

    @property
    def size(self) -> NDArray:
        """(k,): area or volume."""
        raise NotImplementedError

    @property
    def sampled_size(self) -> NDArray:
        """(k,): the size of each cell that is compared with the mean size."""
        return self.size

    @cached_property
    def mean_size(self) -> float:
        """Mean size with which cells are compared: the given one, or the mean over these cells."""
        return float(self.size.mean()) if self._mean is None else self._mean

    def relative_size_squared(self) -> NDArray:
        """Size over the mean size of the type, or its inverse where that is less, squared; 0 if inverted.

        NaN in a mesh whose mean size is negative.
        """
        if self.mean_size < 0:
            return np.full(self.x.shape[-1], np.nan)
        relative = self.sampled_size / self.mean_size if self.mean_size else np.zeros(self.x.shape[-1])
        some = relative > 0
        inverse = np.divide(1, relative, out=np.zeros_like(relative), where=some)
        return np.where(some, np.minimum(relative, inverse), 0) ** 2

    def shape(self) -> NDArray:
        """Closeness to the ideal shape, independent of the size."""
        raise NotImplementedError

    def shape_and_size(self) -> NDArray:
        """Shape times relative size squared."""
        return self.shape() * self.relative_size_squared()
