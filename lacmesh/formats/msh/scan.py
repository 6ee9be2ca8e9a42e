"""Scanner of a msh file: its sections and numbers from the current position on, and errors that name the position.

A section is `$Name`, its content, `$EndName`. The content is text, or, in a binary file, numbers of fixed sizes that
only their own counts delimit; section names and lines of text stay text. `BinaryNumbers` and `TextNumbers` have the
same methods, so that each section's layout is coded once.
"""

from __future__ import annotations

import mmap
import re
import warnings
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

from lacmesh.errors import ReadError
from lacmesh.mesh import Floats, Ints

#: A file smaller than this is read, a larger one is mapped.
_MAPPED = 1 << 20


class MshBytes:
    """The bytes of a file and the position reached; `order` is the byte order of its numbers ("<" or ">")."""

    def __init__(self, path: Path, head: bytes = b"") -> None:
        """Open a file; `head`: its first bytes, if they are enough."""
        self.path = path
        self.position = 0
        self.section_start = 0
        self.binary = False
        self.order = "<"
        self.version = ""
        self.data: bytes | mmap.mmap = head or _content(path)
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

    def take(self, kind: DTypeLike, n: int) -> NDArray:
        """The next n numbers (or records) of a binary file, a view. Raises ReadError where they are not all there."""
        kind = np.dtype(kind)
        if n < 0 or n * kind.itemsize > self.size - self.position:
            raise self.error(f"{n} values should stand here, and the file ends too early", self.position)
        taken = np.frombuffer(self.data, kind, n, self.position) if n else np.empty(0, kind)
        self.position += n * kind.itemsize
        return taken

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


def _content(path: Path) -> bytes | mmap.mmap:
    try:
        with path.open("rb") as file:
            if file.seek(0, 2) > _MAPPED:
                return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            file.seek(0)
            return file.read()
    except OSError as error:
        raise ReadError(path, f"cannot be read ({error.strerror or error})") from error


class BinaryNumbers:
    """The numbers of a section of a binary msh 4.1 file: int (4 bytes), size_t (8) and double."""

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


def _parsed(source: MshBytes, text: bytes, start: int, kind: type) -> NDArray:
    """Numbers of a text that stands at byte `start`. Raises ReadError with the line of the first that is no number."""
    values = _fromstring(text, kind)
    if values is not None:
        return values
    lines = text.splitlines(keepends=True)
    low, high = 0, len(lines)  # a bad line is among lines[low:high]
    while high - low > 1:
        middle = (low + high) // 2
        bad = _fromstring(b"".join(lines[low:middle]), kind) is None
        low, high = (low, middle) if bad else (middle, high)
    at = start + sum(map(len, lines[:low]))
    raise source.error(f"{lines[low].decode('ascii', 'replace').strip()[:60]!r} should be numbers", at)


def _fromstring(text: bytes, kind: type) -> NDArray | None:
    """Numbers of a text; None if anything else is among them."""
    if not text or text.isspace():
        return np.empty(0, kind)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # numpy < 2.3 warns, and gives what it had read
            return np.fromstring(text, kind, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
