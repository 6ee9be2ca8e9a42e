"""Text files that grow: a line is there as a whole, or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from lacmesh.errors import WriteError


def append(path: Path, content: bytes) -> None:
    """Put content at the end of a file and on the disk; where it does not fit, the file stays as it was.

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
