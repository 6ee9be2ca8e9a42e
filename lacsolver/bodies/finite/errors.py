"""What a displacement can be that no body can follow."""

from __future__ import annotations

from collections.abc import Iterable

from lacmesh.errors import LacmeshError


class InadmissibleError(LacmeshError):
    """A displacement turns cells inside out. `cells`: the file's numbers of them. A smaller step is what helps."""

    status = 4

    def __init__(self, message: str, cells: Iterable[int] = ()) -> None:
        super().__init__(message)
        self.cells = tuple(int(c) for c in cells)
