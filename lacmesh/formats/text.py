"""Text files: text to numbers at once, rows of numbers to text, labels for names, the line of an error."""

from __future__ import annotations

import mmap
import re
import unicodedata
import warnings
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError, reading
from lacmesh.indices import CHUNK
from lacmesh.mesh import Floats, Ints

#: Separators become blanks; in real numbers, Fortran's exponents D become E.
AS_INTEGERS = bytes.maketrans(b",\t", b"  ")
AS_REALS = bytes.maketrans(b"Dd,\t", b"ee  ")
#: a file smaller than this is read, a larger one is mapped
_MAPPED = 1 << 20


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
    begin = 0
    for line in text.splitlines(keepends=True):
        if parsed(line, dtype) is None:
            return begin
        begin += len(line)
    return 0


def integers(text: bytes) -> Ints | None:
    """Integers in a text; None if it holds anything but integers, commas and blanks."""
    return parsed(text.translate(AS_INTEGERS), np.int64)


def decoded(name: bytes) -> str:
    """A name as text: UTF-8, or latin-1 as older programs write it."""
    try:
        return name.decode()
    except UnicodeDecodeError:
        return name.decode("latin-1")


def reals(values: Floats, limit: int = 24) -> list[str]:
    """Each number as the shortest text that reads back the same, with a point, of at most `limit` characters.

    If `limit` (16 at least) allows no exact text, the nearest that it allows: to 1 in 10^12 for 20 characters.

    >>> reals(np.array([1.0, 1e-7, -1.2345678901234567e-8])), reals(np.array([-1.2345678901234567e-8]), 20)
    (['1.0', '1.0e-07', '-1.2345678901234567e-08'], ['-1.2345678901235e-08'])
    """
    texts = list(map(repr, values.tolist()))
    for k, text in enumerate(texts):
        if "e" in text and "." not in text:  # code_aster reads no exponent without a point before it
            texts[k] = text.replace("e", ".0e")
        digits = limit
        while len(texts[k]) > limit:
            digits, texts[k] = digits - 1, f"{values[k]:.{digits}e}"
    return texts


def node_lines(numbers: Ints, points: Floats, limit: int = 24) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield the number and the coordinates of each node, of at most `limit` characters (`reals`)."""
    for a in range(0, len(numbers), CHUNK):
        columns = [reals(column, limit) for column in points[a : a + CHUNK].T]
        yield from zip(numbers[a : a + CHUNK].tolist(), zip(*columns, strict=True), strict=True)


def rows_of_text(form: str, *tables: NDArray) -> Iterator[str]:
    """Yield rows of tables (n,) or (n, m), side by side, as text, in pieces; `form`: of a row, as `%` takes it.

    >>> "".join(rows_of_text("M%d N%d\\n", np.array([1, 2]), np.array([7, 8])))
    'M1 N7\\nM2 N8\\n'
    """
    for a in range(0, len(tables[0]), CHUNK):
        parts = [table[a : a + CHUNK] for table in tables]
        values: Iterable[Any] = parts[0].reshape(-1).tolist()
        if len(parts) > 1:
            columns = [column for part in parts for column in part.reshape(len(part), -1).T.tolist()]
            values = chain.from_iterable(zip(*columns, strict=True))
        yield form * len(parts[0]) % tuple(values)


def in_lines(values: NDArray, form: str, per_line: int, between: str = " ") -> Iterator[str]:
    """Yield values (n,) as text, `per_line` on a line; `form`: of one value, as `%` takes it."""
    whole = len(values) // per_line * per_line
    for rows in (values[:whole].reshape(-1, per_line), values[whole:].reshape(1, -1)):
        if rows.size:
            yield from rows_of_text(between.join([form] * rows.shape[1]) + "\n", rows)


def labels(
    names: Iterable[str], allowed: str, limit: int, reserved: Iterable[str] = (), first: str = "A-Za-z"
) -> dict[str, str]:
    """Label for each name, distinct regardless of case; a name that is allowed is its own label.

    `allowed`: characters allowed after the `first` one, written as in the brackets of a regular expression.

    >>> labels(["rive gauche", "Rive_gauche", "été", "2nd"], "A-Za-z0-9_", 24)
    {'rive gauche': 'rive_gauche_2', 'Rive_gauche': 'Rive_gauche', 'été': 'ete', '2nd': 'G_2nd'}
    """

    def plain(name: str) -> str:
        letters = "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))
        label = re.sub(rf"[^{allowed}]", "_", letters)
        return (label if re.match(rf"[{first}]", label) else f"G_{label}")[:limit]

    return distinct_names(names, plain, limit, reserved, str.upper)


def distinct_names(
    names: Iterable[str],
    plain: Callable[[str], str],
    limit: int,
    reserved: Iterable[str] = (),
    like: Callable[[str], str] = str,
) -> dict[str, str]:
    """Plain name for each name, of at most `limit` letters; `like`: makes names that count as the same alike."""
    of_name = {name: plain(name) for name in names}
    taken, chosen = set(map(like, reserved)), dict[str, str]()
    for name in sorted(of_name, key=lambda name: of_name[name] != name):  # names that fit come first
        label, k = of_name[name], 1
        while like(label) in taken:
            k += 1
            label = of_name[name][: limit - len(f"_{k}")] + f"_{k}"
        taken.add(like(label))
        chosen[name] = label
    return {name: chosen[name] for name in of_name}


def changes(chosen: dict[str, str]) -> str:
    """Text that lists the labels that differ from their names, for a warning; empty if none does.

    >>> changes({"a": "a", "b c": "b_c"})
    "'b c' is b_c"
    """
    return ", ".join(f"{name!r} is {label}" for name, label in chosen.items() if name != label)


class SourceFile:
    """The bytes of a file and the position reached; errors name the line, or, of a `binary` file, the byte."""

    def __init__(self, path: Path, head: bytes = b"") -> None:
        """Open a file; `head`: its first bytes, if they are enough."""
        self.path, self.position, self.section_start, self.binary = path, 0, 0, False
        self.data: bytes | mmap.mmap = head
        if not head:
            with reading(path), path.open("rb") as file:
                large = path.stat().st_size > _MAPPED
                self.data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if large else file.read()
        self.size = len(self.data)

    def error(self, message: str, at: int | None = None) -> ReadError:
        """Make the error for byte `at` (default: the start of the section)."""
        at = self.section_start if at is None else min(at, self.size)
        line = self.data[:at].count(b"\n") + 1
        return ReadError(self.path, message, f"byte {at}" if self.binary else f"line {line}")

    def line(self) -> bytes:
        """The next line, without its end. Raises ReadError at the end of the file."""
        if self.position >= self.size:
            raise self.error("the file ends too early", self.size)
        end = self.data.find(b"\n", self.position)
        end = self.size if end < 0 else end
        line = self.data[self.position : end]
        self.position = end + 1
        return line.rstrip(b"\r")
