"""Text files that grow: what is added is written completely or not at all."""

from __future__ import annotations

import os
from io import FileIO
from pathlib import Path

from lacmesh.errors import WriteError


def append(path: Path, content: bytes, start: int | None = None) -> None:
    """Append content to a file, or put it in place of what follows byte `start`, and flush it to the disk.

    If that fails, as on a full disk, the file keeps its former content: what makes it longer is written first. Raises
    WriteError.
    """
    try:
        with path.open("r+b", buffering=0) as file:
            size = file.seek(0, os.SEEK_END)
            start = size if start is None else start
            file.seek(start)
            former = file.read(size - start)
            try:
                _write(file, size, content[size - start :])
                _write(file, start, content[: size - start])
                file.truncate(start + len(content))
                os.fsync(file.fileno())
            except OSError:
                file.truncate(size)
                _write(file, start, former)
                raise
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error


def _write(file: FileIO, start: int, content: bytes) -> None:
    """Write all of the content at a place of a file."""
    file.seek(start)
    rest = memoryview(content)
    while len(rest):
        rest = rest[file.write(rest) :]
