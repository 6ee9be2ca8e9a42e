"""Scanner of a msh file: its sections and numbers from the current position on, and errors that name the position.

A section is `$Name`, its content, `$EndName`. The content is text, or, in a binary file, numbers of fixed sizes that
only their own counts delimit; section names and lines of text stay text. `BinaryNumbers` and `TextNumbers` have the
same methods, so that each section's layout is coded once.
"""

from __future__ import annotations

import re
from typing import TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

from lacmesh.errors import ReadError
from lacmesh.formats.source import SourceFile
from lacmesh.formats.text import bad_line, parsed
from lacmesh.mesh import Floats, Ints


class MshBytes(SourceFile):
    """The bytes of a msh file and the position reached; `order` is the byte order of its numbers ("<" or ">")."""

    order = "<"
    version = ""

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
        mark = b"$End" + name.encode()
        at = self.position - 1
        while True:
            at = self.data.find(b"\n" + mark, at)
            if at < 0:
                raise self.error(f"the section ${name} has no $End{name}")
            line = self.data[at + 1 : at + 80 + len(mark)].split(b"\n", 1)[0]
            if line.strip() == mark:
                break
            at += 1
        body = self.data[self.position : at + 1]
        self.position = at + 1
        self.line()
        return body

    def take(self, dtype: DTypeLike, n: int) -> NDArray:
        """The next n numbers of a binary file, a view. Raises ReadError where they are not all there."""
        dtype = np.dtype(dtype)
        return self.records(n, dtype.itemsize).reshape(-1).view(dtype)

    def records(self, n: int, size: int) -> NDArray[np.uint8]:
        """The next n records of a binary file, of `size` bytes each, a view (n, size). Raises ReadError as `take`."""
        if n < 0 or n * size > self.size - self.position:
            raise self.error(f"{n} values should stand here, and the file ends too early", self.position)
        taken = np.frombuffer(self.data, np.uint8, n * size, self.position) if n else np.empty(0, np.uint8)
        self.position += n * size
        return taken.reshape(n, size)

    def end(self, name: str) -> None:
        """Skip `$EndName`, which must stand here, after the numbers of a binary section. Raises ReadError."""
        at = self.position
        while self.data[at : at + 1] in (b"\n", b"\r", b" "):
            at += 1
        self.position = at
        if at >= self.size or self.line().rstrip() != f"$End{name}".encode():
            raise self.error(f"the section ${name} should end here", at)

    def count(self, name: str) -> int:
        """The number that stands alone on the next line. Raises ReadError."""
        at = self.position
        line = self.line().strip()
        if not re.fullmatch(rb"\d{1,18}", line):
            raise self.error(f"the section ${name} should say here how much follows", at)
        return int(line)

    def numbers(self, name: str, real: bool) -> Numbers:
        """The numbers of a section, from here to its end; `real`: some of them may be no integers."""
        return BinaryNumbers(self, name) if self.binary else TextNumbers(self, name, real)


class BinaryNumbers:
    """The numbers of a section of a binary file: int (4 bytes), in msh 4.1 also size_t (8), and double."""

    def __init__(self, source: MshBytes, name: str) -> None:
        self.source, self.name = source, name

    def ints(self, n: int) -> Ints:
        """The next n numbers of type int."""
        return self.source.take(self.source.order + "i4", n)

    def sizes(self, n: int) -> Ints:
        """The next n numbers of type size_t; those of 2^63 and more come out negative."""
        return self.source.take(self.source.order + "i8", n)

    def reals(self, n: int) -> Floats:
        """The next n numbers of type double."""
        return self.source.take(self.source.order + "f8", n)

    def numbered(self, n: int, width: int, what: str) -> tuple[Ints, Floats]:
        """The next n rows: the number of a node or cell, int, and `width` doubles; views (n,) and (n, width)."""
        size = 4 + 8 * width  # numpy's types hold no record of very many components
        raw, order = self.source.records(n, size), self.source.order
        number = np.ndarray((n,), order + "i4", raw.data, 0, (size,)) if n else np.empty(0, np.int32)
        values = np.ndarray((n, width), order + "f8", raw.data, 4, (size, 8)) if n else np.empty((0, width))
        return number, values

    def error(self, message: str) -> ReadError:
        """Make the error for the numbers read last."""
        return self.source.error(message, self.source.position)

    def done(self) -> None:
        """Skip the end of the section. Raises ReadError if it does not stand here."""
        self.source.end(self.name)


class TextNumbers:
    """The numbers of a section of an ASCII file, parsed as a whole."""

    def __init__(self, source: MshBytes, name: str, real: bool, signs: tuple[bytes, bytes] | None = None) -> None:
        self.source, self.name = source, name
        self.start = source.position
        body = source.body(name)
        if signs is not None:
            body = body.replace(*signs)
        self.values = _parsed(source, body, self.start, np.float64 if real else np.int64)
        self.place = 0

    def _take(self, n: int) -> NDArray:
        if n < 0 or n > len(self.values) - self.place:
            raise self.error(f"{n} values should follow here, and ${self.name} ends too early")
        self.place += n
        return self.values[self.place - n : self.place]

    def ints(self, n: int) -> Ints:
        """The next n numbers, which must be integers."""
        taken = self._take(n)
        if taken.dtype != np.float64:
            return taken
        with np.errstate(invalid="ignore"):
            whole = taken.astype(np.int64)
        if not (whole == taken).all():
            raise self.error("an integer should stand here")
        return whole

    sizes = ints

    def reals(self, n: int) -> Floats:
        """The next n numbers."""
        return self._take(n)

    def numbered(self, n: int, width: int, what: str) -> tuple[Ints, Floats]:
        """The next n rows: the number of a node or cell, `what`, and `width` values; as arrays (n,) and (n, width)."""
        table = self.reals(n * (width + 1)).reshape(n, width + 1)
        with np.errstate(invalid="ignore"):
            number = table[:, 0].astype(np.int64)
        if not (number == table[:, 0]).all():
            raise self.source.error(f"the number of a {what} should be an integer")
        return number, np.ascontiguousarray(table[:, 1:])

    def error(self, message: str) -> ReadError:
        """Make the error for the numbers read last."""
        at = self.start
        left = self.place
        for line in self.source.data[self.start : self.source.position].splitlines(keepends=True):
            left -= len(line.split())
            if left <= 0:
                break
            at += len(line)
        return self.source.error(message, at)

    def error_at(self, message: str, place: int) -> ReadError:
        """Make the error for a number of the section, counted from 0."""
        self.place = place + 1
        return self.error(message)

    def done(self) -> None:
        """Raise ReadError if numbers are left over."""
        if self.place < len(self.values):
            self.place += 1
            raise self.error(f"the section ${self.name} should end here")


Numbers: TypeAlias = BinaryNumbers | TextNumbers


def _parsed(source: MshBytes, text: bytes, start: int, dtype: type) -> NDArray:
    """Numbers of a text that stands at byte `start`. Raises ReadError with the line of the first that is no number."""
    values = parsed(text, dtype, clip=True)  # readers say which number is none of a node, a cell or a count
    if values is None:
        place = bad_line(text, dtype)
        line = text[place:].split(b"\n", 1)[0].decode("ascii", "replace").strip()[:60]
        raise source.error(f"{line!r} should be numbers", start + place)
    return values
