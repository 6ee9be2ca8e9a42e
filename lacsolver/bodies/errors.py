"""The error for a displacement that inverts cells."""

from __future__ import annotations

from collections.abc import Iterable

from lacmesh.errors import LacmeshError


class InadmissibleError(LacmeshError):
    """A displacement inverts cells, whose numbers in the file are `cells`. A smaller step usually helps."""

    status = 4

    def __init__(self, message: str, cells: Iterable[int] = ()) -> None:
        super().__init__(message)
        self.cells = tuple(int(c) for c in cells)
