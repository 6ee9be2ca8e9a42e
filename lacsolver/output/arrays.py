"""Arrays in a file as `numpy.savez` writes it, of which no more than some rows are in memory."""

from __future__ import annotations

import zipfile
from collections.abc import Generator, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lacmesh.formats.output import replacing
from lacsolver.results.whole import Order


class StoredRows(NamedTuple):
    """An array to be written: its type, its shape, and its rows piece after piece."""

    dtype: np.dtype
    shape: tuple[int, ...]
    pieces: Iterator[NDArray]

    @classmethod
    def of(cls, values: NDArray, order: Order | None = None) -> StoredRows:
        """Return an array, or with an order that of the whole model, of which the `values` of each process are rows."""
        if order is None:
            return cls(values.dtype, values.shape, iter([values]))
        return cls(values.dtype, (order.n, *values.shape[1:]), order.pieces(values))


def write_arrays(path: Path, small: Mapping[str, NDArray], rows: Mapping[str, StoredRows]) -> None:
    """Write arrays, those in `rows` piece after piece. An existing file is replaced at the end. Raises WriteError.

    The small ones are compressed: of anchors half are numbers of faces, which hardly differ from row to row.
    """
    every = {name: StoredRows.of(values) for name, values in small.items()} | dict(rows)
    with replacing(path) as (beside,), zipfile.ZipFile(beside, "w") as archive:
        for name, array in every.items():
            head = {"descr": npy.dtype_to_descr(array.dtype), "fortran_order": False, "shape": array.shape}
            member = zipfile.ZipInfo(f"{name}.npy")
            member.compress_type = zipfile.ZIP_DEFLATED if name in small else zipfile.ZIP_STORED
            with archive.open(member, "w", force_zip64=True) as file:
                npy.write_array_header_1_0(file, head)
                for piece in array.pieces:
                    file.write(np.ascontiguousarray(piece).tobytes())


def rows_of(values: NDArray) -> Generator[NDArray, int, None]:
    """Yield rows of an array, one after the other: as many as are sent; the first item is empty."""
    n, start = (yield values[:0]), 0
    while True:
        rows, start = values[start : start + n], start + n
        n = yield rows


def rows_in(path: Path, name: str) -> Generator[NDArray, int, None]:
    """Yield rows of an array of a file, as `rows_of`. Raises ValueError where it has fewer, and what zipfile raises."""
    n = yield np.empty(0)
    with zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as file:
        npy.read_magic(file)
        shape, _, dtype = npy.read_array_header_1_0(file)
        width = int(np.prod(shape[1:], dtype=np.int64)) * dtype.itemsize
        while True:
            data = file.read(n * width)
            if len(data) < n * width:
                raise ValueError(f"{name} has {shape[0]} rows, and the model more")
            n = yield np.frombuffer(data, dtype).reshape(n, *shape[1:])
