"""Text files to which lines are appended: a line is written completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from lacmesh.errors import WriteError


def append(path: Path, content: bytes) -> None:
    """Append content to a file and flush it to the disk; if that fails, the file keeps its former content.

    Raises WriteError.
    """
    try:
        with path.open("ab", buffering=0) as file:
            size = file.seek(0, os.SEEK_END)
            try:
                rest = memoryview(content)
                while len(rest):
                    rest = rest[file.write(rest) :]
                os.fsync(file.fileno())
            except OSError:
                file.truncate(size)
                raise
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error
