"""Files and folders of a run: errors of writing, folders made, lines appended, JSON read."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lacmesh.errors import ReadError, writing


def make_folder(folder: Path) -> None:
    """Make a folder and those around it, unless it is there. Raises WriteError."""
    with writing(folder, "cannot be made"):
        folder.mkdir(exist_ok=True, parents=True)


def read_json(path: Path, is_ours: Callable[[Any], bool], failed: str = "cannot be read", advice: str = "") -> Any:
    """Return the content of a JSON file. Raises ReadError, in the words `failed` and with `advice`, for another one.

    `is_ours` may raise KeyError and TypeError for other content.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if is_ours(content):
            return content
        reason = "it holds something else"
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    raise ReadError(path, f"{failed} ({reason}){advice}")


def append(path: Path, content: bytes) -> None:
    """Append content to a file and flush it to the disk; if that fails, the file keeps its former content.

    Raises WriteError.
    """
    with writing(path), path.open("ab", buffering=0) as file:
        size = file.seek(0, os.SEEK_END)
        try:
            rest = memoryview(content)
            while len(rest):
                rest = rest[file.write(rest) :]
            os.fsync(file.fileno())
        except OSError:
            file.truncate(size)
            raise
