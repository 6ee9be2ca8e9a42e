"""Numba kernel that finds where the cells start in a mixture of XDMF, by a walk from cell to cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel


@kernel
def starts(values: NDArray[np.int64], width: NDArray[np.int64], start: NDArray[np.int64]) -> int:
    """Write the positions in `values` where cells start to `start`; return their number, or -1 - position of an error.

    `width[number]`: values that a cell of that number of XDMF takes with its number, 0 where there is no such cell.
    """
    at, n = 0, 0
    while at < len(values):
        number = values[at]
        if number < 0 or number >= len(width) or width[number] == 0 or n == len(start):
            return -1 - at
        start[n] = at
        n += 1
        at += width[number]
    return n if at == len(values) else -1 - start[n - 1]
