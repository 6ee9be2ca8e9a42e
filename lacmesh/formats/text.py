"""Numbers and names in text files: text to numbers at once, columns of numbers to text at once, bytes to words."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints

#: Separators become blanks; in real numbers, Fortran's exponents D become E.
AS_INTEGERS = bytes.maketrans(b",\t", b"  ")
AS_REALS = bytes.maketrans(b"Dd,\t", b"ee  ")
#: Bytes of data looked at in one go.
_CHUNK = 1 << 22
#: Rows written in one go.
_ROWS = 1 << 14


def parsed(text: bytes, dtype: type, *, clip: bool = False) -> NDArray | None:
    """All numbers of a text that holds nothing else, separated by white space; None where something else is there.

    Integers beyond the range of `kind` are something else, or become its ends with `clip`.

    >>> parsed(b" 1 2\\n3", int), parsed(b"1 two", int)
    (array([1, 2, 3]), None)
    """
    if not text or text.isspace():
        return np.empty(0, dtype)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # numpy < 2.3 warns, and gives what it had read
            values: NDArray = np.fromstring(text, dtype, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    if not clip and values.dtype.kind == "i" and len(values) and values.max() == np.iinfo(values.dtype).max:
        return None  # more digits than an integer holds
    return values


def bad_line(text: bytes, dtype: type) -> int:
    """Byte offset of the first bad line in a text that `parsed` refuses."""
    lines = text.splitlines(keepends=True)
    low, high = 0, len(lines)
    while high - low > 1:
        middle = (low + high) // 2
        bad = parsed(b"".join(lines[low:middle]), dtype) is None
        low, high = (low, middle) if bad else (middle, high)
    return sum(map(len, lines[:low]))


def chunks(text: bytes) -> Iterator[tuple[int, bytes]]:
    """Split a text of whole lines into pieces of whole lines, each with its byte offset."""
    begin = 0
    while begin < len(text):
        end = len(text) if len(text) - begin <= _CHUNK else text.rfind(b"\n", begin, begin + _CHUNK) + 1
        if end <= begin:  # a line longer than a piece
            end = text.find(b"\n", begin) + 1 or len(text)
        yield begin, text[begin:end]
        begin = end


def integers(text: bytes) -> Ints | None:
    """Integers in a text; None if it holds anything but integers, commas and blanks."""
    return parsed(text.translate(AS_INTEGERS), np.int64)


def values_in_lines(text: bytes) -> Ints:
    """Number of comma-separated fields in each line of a text; a comma at its end adds none, a blank line has 0."""
    return np.concatenate([np.empty(0, np.int64), *(_fields_in_lines(piece) for _, piece in chunks(text))])


def _fields_in_lines(text: bytes) -> Ints:
    letters = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(letters == 10)
    commas = np.flatnonzero(letters == 44)
    solid = np.flatnonzero(letters > 32)  # no blank, tab or end of line
    last = np.searchsorted(solid, ends) - 1  # the last solid byte of each line, if it is one of this line
    begins = np.append(0, ends[:-1] + 1)[: len(ends)]
    filled = (last >= 0) & (solid[last] >= begins) if len(solid) else np.zeros(len(ends), bool)
    count = np.diff(np.searchsorted(commas, ends), prepend=0)
    trailing = np.zeros(len(ends), bool)
    trailing[filled] = letters[solid[last[filled]]] == 44
    return np.where(filled, count + 1 - trailing, 0)


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
        digits = limit
        while len(text) > limit:
            digits, text = digits - 1, f"{values[k]:.{digits}e}"
        texts[k] = text
    return texts


def joined(columns: Iterable[Sequence[str]], separator: str) -> str:
    """Lines of text from columns, each terminated by a line end.

    >>> joined([["1", "2"], ["a", "b"]], ", ")
    '1, a\\n2, b\\n'
    """
    return "".join([separator.join(row) + "\n" for row in zip(*columns, strict=True)])


def rows_of_cells(numbers: Ints, nodes: Ints, leads: Sequence[bytes]) -> Iterator[bytes]:
    """Yield the number (k,) and the nodes (k, n) of each cell, each number preceded by its column's lead."""
    for a in range(0, len(numbers), _ROWS):
        part = slice(a, a + _ROWS)
        yield int_rows(np.hstack([numbers[part, None], nodes[part]]), leads)


def numbers_in_lines(numbers: Ints, per_line: int, lead: bytes, between: bytes) -> Iterator[bytes]:
    """Yield numbers in lines; `lead`: what stands before the first of a line, `between`: before the others."""
    whole = len(numbers) // per_line * per_line
    for rows in (numbers[:whole].reshape(-1, per_line), numbers[whole:].reshape(1, -1)):
        if rows.size:
            yield int_rows(rows, [b"\n" + lead, *[between] * (rows.shape[1] - 1)])
