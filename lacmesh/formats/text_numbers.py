"""Numbers and names in text files: columns of integers to text at once, text to numbers at once, bytes to words."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints


def parsed(text: bytes, kind: type) -> NDArray | None:
    """All numbers of a text that holds nothing else, separated by white space; None where something else is there.

    >>> parsed(b" 1 2\\n3", int), parsed(b"1 two", int)
    (array([1, 2, 3]), None)
    """
    if not text or text.isspace():
        return np.empty(0, kind)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # numpy < 2.3 warns, and gives what it had read
            values: NDArray = np.fromstring(text, kind, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    if values.dtype.kind == "i" and len(values) and values.max() == np.iinfo(values.dtype).max:
        return None  # more digits than an integer holds
    return values


def bad_line(text: bytes, kind: type) -> int:
    """Byte offset of the first bad line in a text that `parsed` refuses."""
    lines = text.splitlines(keepends=True)
    low, high = 0, len(lines)
    while high - low > 1:
        middle = (low + high) // 2
        bad = parsed(b"".join(lines[low:middle]), kind) is None
        low, high = (low, middle) if bad else (middle, high)
    return sum(map(len, lines[:low]))


def decoded(name: bytes) -> str:
    """A name as text: UTF-8, or latin-1 as older programs write it."""
    try:
        return name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1")


def int_rows(values: Ints, leads: Sequence[bytes]) -> bytes:
    """Rows (n, m) of integers >= 0 as text, each number preceded by its column's lead.

    >>> int_rows(np.array([[7, 10], [8, 9]]), [b"\\n", b", "])
    b'\\n7, 10\\n8, 9'
    """
    if not values.size:
        return b""
    largest = int(values.max())
    rest: NDArray[np.unsignedinteger] = values.astype(np.uint32 if largest < 2**32 else np.uint64)
    width, before = len(str(largest)), max(map(len, leads))
    text = np.empty((*values.shape, before + width), np.uint8)
    text[..., :before] = np.array([list(lead.rjust(before, b"\0")) for lead in leads], np.uint8).reshape(-1, before)
    for place in range(before + width - 1, before - 1, -1):
        higher = rest // 10
        digit = (rest - 10 * higher).astype(np.uint8) + 48
        text[..., place] = digit if place == before + width - 1 else np.where(rest > 0, digit, 0)
        rest = higher
    flat = text.reshape(-1)
    return flat[flat != 0].tobytes()


def reals(values: Floats, limit: int = 24) -> list[str]:
    """Each number as the shortest text that reads back the same, with a point, of at most `limit` characters.

    If `limit` (16 at least) allows no exact text, the nearest that it allows: to 1 in 10^12 for 20 characters.

    >>> reals(np.array([1.0, 1e-7, -1.2345678901234567e-8])), reals(np.array([-1.2345678901234567e-8]), 20)
    (['1.0', '1.0e-07', '-1.2345678901234567e-08'], ['-1.2345678901235e-08'])
    """
    texts = list(map(repr, values.tolist()))
    size = np.abs(values)
    plain = ((size >= 0.1) & (size < 1e15)) | (size == 0)  # 17 digits, a point and a sign: 20 characters at most
    for k in np.flatnonzero(~plain).tolist():
        text = texts[k]
        if "e" in text and "." not in text:  # code_aster reads no exponent without a point before it
            text = text.replace("e", ".0e")
        texts[k] = text if len(text) <= limit else _short(float(values[k]), limit)
    return texts


def _short(value: float, limit: int) -> str:
    digits = limit
    while len(text := f"{value:.{digits}e}") > limit:
        digits -= 1
    return text


def joined(columns: Iterable[Sequence[str]], separator: str) -> str:
    """Lines of text from columns, each terminated by a line end.

    >>> joined([["1", "2"], ["a", "b"]], ", ")
    '1, a\\n2, b\\n'
    """
    return "".join([separator.join(row) + "\n" for row in zip(*columns, strict=True)])
