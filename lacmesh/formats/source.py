"""The bytes of a file and the position reached in them, for readers that scan; errors name the line, or the byte."""

from __future__ import annotations

import mmap
from pathlib import Path

from lacmesh.errors import ReadError, reading

#: A file smaller than this is read, a larger one is mapped.
_MAPPED = 1 << 20


class SourceFile:
    """The bytes of a file and the position reached; `binary`: errors name the byte, not the line."""

    def __init__(self, path: Path, head: bytes = b"") -> None:
        """Open a file; `head`: its first bytes, if they are enough."""
        self.path = path
        self.position = 0
        self.section_start = 0
        self.binary = False
        self.data: bytes | mmap.mmap = head
        if not head:
            with reading(path), path.open("rb") as file:
                large = file.seek(0, 2) > _MAPPED
                file.seek(0)
                self.data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if large else file.read()
        self.size = len(self.data)

    def error(self, message: str, at: int | None = None) -> ReadError:
        """Make the error for byte `at` (default: the start of the section)."""
        at = self.section_start if at is None else min(at, self.size)
        if self.binary:
            return ReadError(self.path, message, f"byte {at}")
        line = self.data[:at].count(b"\n") + 1
        return ReadError(self.path, message, f"line {line}")

    def line(self) -> bytes:
        """The next line, without its end. Raises ReadError at the end of the file."""
        if self.position >= self.size:
            raise self.error("the file ends too early", self.size)
        end = self.data.find(b"\n", self.position)
        end = self.size if end < 0 else end
        line = self.data[self.position : end]
        self.position = end + 1
        return line.rstrip(b"\r")
