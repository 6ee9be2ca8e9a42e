"""Output of numbers and text to a msh file, ASCII or binary, so that each section's layout is coded once."""

from __future__ import annotations

import struct
from itertools import chain
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lacmesh.formats.ids import CHUNK
from lacmesh.mesh import Floats, Ints


class Output:
    """A msh file that is being written; floats in ASCII are the shortest that read back the same."""

    def __init__(self, file: BinaryIO, binary: bool) -> None:
        self.file = file
        self.binary = binary

    def text(self, text: str) -> None:
        """Write text unchanged, in ASCII and binary files."""
        self.file.write(text.encode())

    def array(self, array: NDArray) -> None:
        """Write the bytes of an array unchanged; for binary files."""
        self.file.write(np.ascontiguousarray(array).data)

    def end(self, name: str) -> None:
        """Write the line that ends a section."""
        self.text(f"\n$End{name}\n" if self.binary else f"$End{name}\n")

    def record(self, layout: str, *values: float) -> None:
        """Write a few numbers: a line, or, in binary, bytes in the `layout` of the module struct."""
        if self.binary:
            self.file.write(struct.pack("<" + layout, *values))
        else:
            self.text(" ".join(map(str, values)) + "\n")

    def int_rows(self, rows: Ints) -> None:
        """Write rows of integers (n, m), of 8 bytes in binary."""
        if self.binary:
            self.array(rows.astype("<i8", copy=False))
        else:
            self._lines("%d", [rows[:, j] for j in range(rows.shape[1])])

    def real_rows(self, rows: Floats) -> None:
        """Write rows of doubles (n, m)."""
        if self.binary:
            self.array(rows.astype("<f8", copy=False))
        else:
            self._lines("%r", [rows[:, j] for j in range(rows.shape[1])])

    def numbered_rows(self, number: Ints, values: Floats) -> None:
        """Write rows of a number, of 4 bytes in binary, and doubles (n, m)."""
        if not self.binary:
            self._lines("%r", [number, *(values[:, j] for j in range(values.shape[1]))])
            return
        record = np.dtype([("number", "<i4"), ("values", "<f8", (values.shape[1],))])
        for a in range(0, len(number), CHUNK):
            rows = np.empty(len(number[a : a + CHUNK]), record)
            rows["number"], rows["values"] = number[a : a + CHUNK], values[a : a + CHUNK]
            self.array(rows)

    def _lines(self, form: str, columns: list[Ints | Floats]) -> None:
        line = " ".join([form] * len(columns)) + "\n"
        for a in range(0, len(columns[0]), CHUNK):
            part = [c[a : a + CHUNK].tolist() for c in columns]
            self.text(line * len(part[0]) % tuple(chain.from_iterable(zip(*part, strict=True))))
