"""Blocks of LZ4 (lz4_Block_format.md, as VTK's vtkLZ4DataCompressor writes them), expanded by a numba kernel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel

Whole = int | np.integer


@kernel
def _extended(data: NDArray[np.uint8], at: Whole, length: Whole) -> tuple[Whole, Whole]:
    """Extend a length of 15 by bytes up to one that is not 255; return it (-1 past the end) and the next position."""
    if length < 15:
        return length, at
    while at < len(data):
        more = np.int64(data[at])
        length += more
        at += 1
        if more < 255:
            return length, at
    return -1, at


@kernel
def expand(data: NDArray[np.uint8], out: NDArray[np.uint8]) -> Whole:
    """Expand the block `data` into `out`; return the number of bytes written, -1 if the block is damaged.

    A block is a row of sequences: a token (length of literals, length of a match less 4, each in 4 bits), more of the
    first length, the literals, how far back the match starts (2 bytes), more of the second length. The last sequence
    ends with its literals.
    """
    i: Whole = 0
    o: Whole = 0
    while i < len(data):
        token = np.int64(data[i])
        length, i = _extended(data, i + 1, token >> 4)
        if length < 0 or i + length > len(data) or o + length > len(out):
            return -1
        for k in range(length):
            out[o + k] = data[i + k]
        i += length
        o += length
        if i == len(data):
            return o
        if i + 2 > len(data):
            return -1
        back = np.int64(data[i]) + 256 * np.int64(data[i + 1])
        length, i = _extended(data, i + 2, token & 15)
        length += 4
        if length < 4 or back == 0 or back > o or o + length > len(out):
            return -1
        for k in range(length):  # a match may overlap what it makes
            out[o + k] = out[o - back + k]
        o += length
    return o
