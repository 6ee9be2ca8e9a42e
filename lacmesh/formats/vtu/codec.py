"""Bytes of arrays in VTK's XML files: headers, base64, and blocks compressed by zlib, lzma or lz4.

An array is a header and its bytes. Not compressed, the header is the number of bytes; compressed, it is the number of
blocks, the size of a block, the size of the last one if it is smaller, and the size of each when compressed. In base64
a header of a compressed array is encoded by itself, any other together with the bytes.
"""

from __future__ import annotations

import base64
import binascii
import lzma
import zlib
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints

Order = Literal["<", ">"]
#: What decoding may raise on damaged bytes.
DAMAGE = (ValueError, IndexError, OverflowError, MemoryError, zlib.error, lzma.LZMAError, binascii.Error, EOFError)


class Coding(NamedTuple):
    """Coding of a file's arrays: byte order ("<", ">"), type of a header's integers, the compressor's name."""

    order: Order
    header: np.dtype
    compressor: str

    def array(self, raw: bytes | memoryview, base64_text: bool, most: int | None = None) -> bytes:
        """Decode the array that starts where `raw` does. Raises ValueError and others of DAMAGE.

        `most`: a compressed array that claims more bytes is not expanded, as each byte may give a thousand.
        """
        return bytes(self._packed(raw, base64_text, most) if self.compressor else self._plain(raw, base64_text))

    def _plain(self, raw: bytes | memoryview, text: bool) -> bytes | memoryview:
        size = self.header.itemsize
        if not text:
            n = self._integers(raw, 1)[0]
            return _exactly(raw[size : size + n], n)
        first = _decoded(bytes(raw[: _chars(size)]), size)
        n = int(np.frombuffer(first[:size], self.header)[0])
        if b"=" in bytes(raw[: _chars(size)]) and n:  # a header that was encoded by itself
            start = _chars(size)
            return _decoded(bytes(raw[start : start + _chars(n)]), n)
        return _decoded(bytes(raw[: _chars(size + n)]), size + n)[size:]

    def _packed(self, raw: bytes | memoryview, text: bool, most: int | None) -> bytes:
        size = self.header.itemsize
        head = bytes(raw[: _chars(3 * size)]) if text else b""
        blocks, block, last = self._integers(_decoded(head, 3 * size) if text else raw, 3)
        if blocks * size > len(raw):
            raise ValueError(f"{blocks} blocks are more than the file holds")
        claimed = (blocks - 1) * block + (last or block) if blocks else 0
        if most is not None and claimed > most:
            raise ValueError(f"its header claims {claimed} bytes, where {most} should be")
        whole = (3 + blocks) * size
        sizes = self._integers(_decoded(bytes(raw[: _chars(whole)]), whole) if text else raw, 3 + blocks)[3:]
        start, total = (_chars(whole), sum(sizes)) if text else (whole, sum(sizes))
        data: bytes | memoryview
        data = _decoded(bytes(raw[start : start + _chars(total)]), total) if text else raw[start : start + total]
        _exactly(data, total)
        expand = _EXPAND.get(self.compressor)
        if expand is None:
            raise ValueError(f"the compressor {self.compressor} is not known")
        result, at = [], 0
        for k, n in enumerate(sizes):
            wanted = last if k == blocks - 1 and last else block
            result.append(_exactly(expand(bytes(data[at : at + n]), wanted), wanted))
            at += n
        return b"".join(result)

    def _integers(self, raw: bytes | memoryview, n: int) -> list[int]:
        return [
            int(i)
            for i in np.frombuffer(_exactly(raw[: n * self.header.itemsize], n * self.header.itemsize), self.header)
        ]


def _chars(n: int) -> int:
    """Characters of base64 for n bytes."""
    return -(-n // 3) * 4


def _decoded(text: bytes, n: int) -> bytes | memoryview:
    return _exactly(base64.b64decode(text, validate=True)[:n], n)


def _exactly(data: bytes | memoryview, n: int) -> bytes | memoryview:
    if len(data) != n:
        raise ValueError(f"{len(data)} bytes where {n} should be")
    return data


def _zlib(data: bytes, n: int) -> bytes:
    return zlib.decompressobj().decompress(data, n + 1)


def _lzma(data: bytes, n: int) -> bytes:
    return lzma.LZMADecompressor(memlimit=2**28).decompress(data, n + 1)


def _lz4(data: bytes, n: int) -> bytes:
    from lacmesh.formats.vtu.lz4 import expand

    if n > 255 * len(data) + 64:
        raise ValueError("a block claims more bytes than lz4 can hold")
    out = np.empty(n, np.uint8)
    if expand(np.frombuffer(data, np.uint8), out) != n:
        raise ValueError("a block of lz4 is damaged")
    return out.tobytes()


_EXPAND: dict[str, Callable[[bytes, int], bytes]] = {
    "vtkZLibDataCompressor": _zlib,
    "vtkLZMADataCompressor": _lzma,
    "vtkLZ4DataCompressor": _lz4,
}


def numbers(data: bytes, dtype: np.dtype, order: Order) -> NDArray:
    """Values in bytes of some order, as native numbers. Raises ValueError."""
    if len(data) % dtype.itemsize:
        raise ValueError(f"{len(data)} bytes are no whole number of {dtype}")
    return np.frombuffer(data, dtype.newbyteorder(order)).astype(dtype)


def from_text(text: str, dtype: np.dtype) -> NDArray:
    """The values in a text. Raises ValueError."""
    words = text.split()
    if dtype.kind == "f":
        return np.array(words, np.float64).astype(dtype)
    values: Ints = np.array(words, np.uint64 if dtype == np.uint64 else np.int64)
    typed = values.astype(dtype)
    if not (typed == values).all():
        raise ValueError(f"a number is too large for {dtype}")
    return typed
