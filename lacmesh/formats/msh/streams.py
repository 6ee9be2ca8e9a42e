"""Bytes of a msh file, read and written: its sections, and their numbers, alike in text and in binary files.

A section is `$Name`, its content, `$EndName`. The content is text, or, in a binary file, numbers of fixed sizes that
only their own counts delimit; section names and lines of text stay text.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterable, Sequence
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError
from lacmesh.formats.text import SourceFile, bad_line, decoded, distinct_names, parsed, rows_of_text
from lacmesh.indices import CHUNK
from lacmesh.mesh import Floats, Ints, Tag

#: kind of a number -> numpy's type of it in a binary file: int, size_t (2^63 and more come out negative) and double
_BINARY = {"int": "i4", "size": "i8", "real": "f8"}
#: integers from here on are not all kept as the reals that a text is read as
_TOO_LARGE = 2.0**53
#: bytes of a name; gmsh cuts at 128 when it saves
_LONGEST = 120


class MshSource(SourceFile):
    """The bytes of a msh file and the position reached; `order` is the byte order of its numbers ("<" or ">")."""

    order = "<"
    version = ""
    #: of the section whose numbers are taken: its name, where they begin, and, in text, all and how many are taken
    name = ""
    _begin = 0
    _words: NDArray | None = None
    _taken = 0

    def section(self) -> str | None:
        """The name of the section that starts here, blank lines apart; None at the end of the file."""
        while self.position < self.size:
            start = self.position
            line = self.line().strip()
            if not line:
                continue
            self.section_start = start
            if not re.fullmatch(rb"\$[A-Za-z_][\w.-]*", line) or line.startswith(b"$End"):
                raise self.error("a section ($...) should start here")
            return line[1:].decode()
        return None

    def body(self, name: str) -> bytes:
        """Everything before `$EndName`, which is skipped. Raises ReadError if that line is missing."""
        mark = b"\n$End" + name.encode()
        at = self.data.find(mark, self.position - 1)
        while at >= 0 and self.data[at + len(mark) : at + len(mark) + 80].split(b"\n", 1)[0].strip():
            at = self.data.find(mark, at + 1)  # the end of a section with a longer name
        if at < 0:
            raise self.error(f"the section ${name} has no $End{name}")
        body = self.data[self.position : at + 1]
        self.position = at + 1
        self.line()
        return body

    def count(self, name: str) -> int:
        """The number that stands alone on the next line. Raises ReadError."""
        at = self.position
        line = self.line().strip()
        if not re.fullmatch(rb"\d{1,18}", line):
            raise self.error(f"the section ${name} should say here how much follows", at)
        return int(line)

    def begin(
        self, name: str, *, text: bool = False, integers: bool = False, signs: tuple[bytes, bytes] = (b"", b"")
    ) -> None:
        """Begin to take the numbers of a section, from here to its end.

        `text`: they are text in a binary file too; `integers`: no other numbers are there; `signs`: a word of the text
        and what stands for it. Raises ReadError for a text that has anything else than numbers.
        """
        self.name, self._begin, self._taken, self._words = name, self.position, 0, None
        if self.binary and not text:
            return
        body = self.body(name)
        if signs[0]:
            body = body.replace(*signs)
        dtype = np.int64 if integers else np.float64
        self._words = parsed(body, dtype, clip=True)  # readers say which number is none of a node, a cell or a count
        if self._words is None:
            place = bad_line(body, dtype)
            line = body[place:].split(b"\n", 1)[0].decode("ascii", "replace").strip()[:60]
            raise self.error(f"{line!r} should be numbers", self._begin + place)

    def take(self, kind: str, n: int) -> NDArray:
        """The next n numbers of a section, "int", "size" or "real"; a view. Raises ReadError if they are not there."""
        if self._words is None:
            dtype = np.dtype(self.order + _BINARY[kind])
            return self.records(n, dtype.itemsize).reshape(-1).view(dtype)
        if not 0 <= n <= len(self._words) - self._taken:
            raise self.here(f"{n} values should follow here, and ${self.name} ends too early")
        self._taken += n
        numbers = self._words[self._taken - n : self._taken]
        if kind == "real" or numbers.dtype.kind == "i":
            return numbers
        with np.errstate(invalid="ignore"):
            whole = numbers.astype(np.int64)
        if not (whole == numbers).all():
            raise self.here("an integer should stand here")
        if np.abs(numbers).max(initial=0.0) >= _TOO_LARGE:
            raise self.here("integers of 2^53 and more are not read here")
        return whole

    def counts(self, n: int) -> list[int]:
        """The next n sizes, none of them negative. Raises ReadError."""
        counts: list[int] = self.take("size", n).tolist()
        if min(counts) < 0:
            raise self.here("a negative count stands here")
        return counts

    def left(self) -> Ints:
        """All integers of a section that are not yet taken, of 4 bytes in a binary file (with what follows it)."""
        if self._words is not None:
            return self._words[self._taken :]
        return np.frombuffer(self.data, self.order + "i4", (self.size - self.position) // 4, self.position)

    def numbered(self, n: int, width: int, what: str) -> tuple[Ints, Floats]:
        """The next n rows: the number of a node or cell, `what`, and `width` reals; as (n,) and (n, width)."""
        if self._words is not None:
            table = self.take("real", n * (width + 1)).reshape(n, width + 1)
            with np.errstate(invalid="ignore"):
                number = table[:, 0].astype(np.int64)
            if not (number == table[:, 0]).all() or np.abs(table[:, 0]).max(initial=0.0) >= _TOO_LARGE:
                raise self.error(f"the number of a {what} should be an integer")
            return number, table[:, 1:]
        dtype = np.dtype([("number", self.order + "i4"), ("values", self.order + "f8", (width,))])
        rows = self.records(n, dtype.itemsize).reshape(-1).view(dtype)
        return rows["number"], rows["values"]

    def records(self, n: int, size: int) -> NDArray[np.uint8]:
        """The next n records of a binary file, of `size` bytes each, a view (n, size). Raises ReadError as `take`."""
        if n < 0 or n * size > self.size - self.position:
            raise self.error(f"{n} values should stand here, and the file ends too early", self.position)
        records = np.frombuffer(self.data, np.uint8, n * size, self.position) if n else np.empty(0, np.uint8)
        self.position += n * size
        return records.reshape(n, size)

    def here(self, message: str) -> ReadError:
        """Make the error for the number taken last."""
        if self._words is None:
            return self.error(message, self.position)
        at, left = self._begin, self._taken
        for line in self.data[self._begin : self.position].splitlines(keepends=True):
            left -= len(line.split())
            if left <= 0:
                break
            at += len(line)
        return self.error(message, at)

    def end(self, name: str = "") -> None:
        """Skip the end of the section, which must stand here. Raises ReadError."""
        name = name or self.name
        if name == self.name and self._words is not None:
            if self._taken < len(self._words):
                self._taken += 1
                raise self.here(f"the section ${name} should end here")
            return
        at = self.position
        while self.data[at : at + 1] in (b"\n", b"\r", b" "):
            at += 1
        self.position = at
        if at >= self.size or self.line().rstrip() != f"$End{name}".encode():
            raise self.error(f"the section ${name} should end here", at)


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

    def rows(self, types: Sequence[str], *tables: NDArray) -> None:
        """Write rows of tables (n,) or (n, m) side by side; `types`: numpy's type of each in binary."""
        if not self.binary:
            width = sum(math.prod(table.shape[1:]) for table in tables)
            for text in rows_of_text(" ".join(["%r"] * width) + "\n", *tables):
                self.text(text)
            return
        layout = [(str(k), kind, table.shape[1:]) for k, (kind, table) in enumerate(zip(types, tables, strict=True))]
        for a in range(0, len(tables[0]), CHUNK):
            record = np.empty(len(tables[0][a : a + CHUNK]), layout)
            for k, table in enumerate(tables):
                record[str(k)] = table[a : a + CHUNK]
            self.array(record)


# ---- names: between double quotes, on one line; the true ones are kept in our note. gmsh (4.15) reads a line of 255
# bytes, takes the text before the second quote, and rejects the whole file if a line is longer


def quoted(line: bytes) -> str:
    """Text between the first and the last quote of a line; the whole line if there are not two quotes."""
    between = re.search(rb'"(.*)"', line)
    return decoded(between[1] if between else line.strip().strip(b'"'))


def safe_names(names: Iterable[str]) -> dict[str, str]:
    """Name in the file for each name: without quotes and control characters, not too long, distinct and not empty.

    >>> safe_names(["slave", 'a "b"', "a 'b'"])
    {'slave': 'slave', 'a "b"': "a 'b'_2", "a 'b'": "a 'b'"}
    """

    def plain(name: str) -> str:
        short = re.sub(r"[\x00-\x1f\x7f\x85\u2028\u2029\ud800-\udfff]", "_", name).replace('"', "'")
        return short.encode()[:_LONGEST].decode("utf-8", "ignore") or "_"

    return distinct_names(names, plain, _LONGEST)


def physical_names(source: MshSource) -> list[tuple[int | None, int, str]]:
    """Read (dimension, tag, name) of each line of $PhysicalNames; msh 2.0 has no dimension. Raises ReadError."""
    n = source.count("PhysicalNames")
    start = source.position
    lines = [line for line in source.body("PhysicalNames").splitlines() if line.strip()]
    if len(lines) != n:
        raise source.error(f"{n} names should follow here, and there are {len(lines)}", start)
    pattern = re.compile(rb'\s*(\d{1,9})\s+"' if source.version == "2.0" else rb'\s*([0-3])\s+(-?\d{1,9})\s+"')
    names: list[tuple[int | None, int, str]] = []
    for line in lines:
        match = pattern.match(line)
        if match is None:
            raise source.error(f"{decoded(line)[:60]!r} should be a dimension, a tag and a name in quotes", start)
        numbers = [int(g) for g in match.groups()]
        names.append((None if len(numbers) == 1 else numbers[0], abs(numbers[-1]), quoted(line)))
    return names


def unnamed(tag: Tag) -> str:
    """The key of a physical group that has no name.

    >>> unnamed((2, 5))
    '2:5'
    """
    return f"{tag[0]}:{tag[1]}"
