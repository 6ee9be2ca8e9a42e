"""Options of writers, until these take keywords."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class WriteOptions:
    """Options of `lacmesh.formats.write`."""

    msh: str | None = None
    binary: bool | None = None
    compress: bool = False
    target: str | None = None
    plane: str | None = None
    all_cells: bool = False
    lenient: bool = False
    second: tuple[Path, str] | None = None

    @property
    def in_binary(self) -> bool:
        """True for binary files."""
        return self.binary is None or self.binary


DEFAULT = WriteOptions()
