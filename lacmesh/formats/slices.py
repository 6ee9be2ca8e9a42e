"""Slices of a mesh file: consecutive nodes, and consecutive cells of each type, so that nobody holds the whole mesh.

Slice k of n has as many nodes, and cells of each type, as any other. It is read by one of n `Readers`, which ask one
another where a number of the file must be found among all; a whole file is the only slice of `ALONE`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.formats import ids
from lacmesh.formats.ids import Index
from lacmesh.mesh import Floats, Ints, Mesh

T = TypeVar("T")


class RowRange(NamedTuple):
    """Rows `start` to `stop` of the `size` rows that a file has."""

    start: int
    stop: int
    size: int

    @property
    def n(self) -> int:
        """Number of the rows."""
        return self.stop - self.start


class Slice(NamedTuple):
    """Slice `k` of `n` of a file."""

    k: int = 0
    n: int = 1

    def rows(self, size: int) -> RowRange:
        """The rows of this slice, of as many as there are."""
        return RowRange(size * self.k // self.n, size * (self.k + 1) // self.n, size)


class CellRows(NamedTuple):
    """Cells of one type, those in `rows` of all in the file: nodes (k, n), indices in the whole mesh."""

    type: str
    rows: RowRange
    nodes: Ints


@dataclass(frozen=True)
class MeshSlice:
    """A slice of a file's mesh: the nodes in `rows`, with points (k, 3), and cells of each type.

    Numbers, groups and data are those of these nodes (k,) and cells (m,), the members of groups by their indices in the
    slice. `cell_place` (m,): positions of the cells in the file, None where they stand in order. `noted`: the mesh's
    other fields. `said`: warnings. All slices have the same types, names of groups and data, `noted` and `said`; in
    `noted` nodes are indices in the whole.
    """

    rows: RowRange
    points: Floats
    space_dim: int
    node_number: Ints
    cells: tuple[CellRows, ...]
    cell_number: Ints
    cell_place: Ints | None
    cell_groups: Mapping[str, Ints]
    node_groups: Mapping[str, Ints]
    cell_data: Mapping[str, NDArray]
    node_data: Mapping[str, NDArray]
    noted: dict[str, Any]
    said: tuple[str, ...]

    @property
    def dim(self) -> int:
        """The highest dimension of a cell of the whole mesh."""
        return max((ALL_CELLS[c.type].dim for c in self.cells), default=0)

    def mesh(self) -> Mesh:
        """Return the mesh of a file whose only slice this is."""
        return Mesh.create(
            self.points,
            [(c.type, c.nodes) for c in self.cells],
            space_dim=self.space_dim,
            node_number=self.node_number,
            cell_number=self.cell_number,
            file_order=None if self.cell_place is None else _inverse(self.cell_place),
            cell_groups=self.cell_groups,
            node_groups=self.node_groups,
            cell_data=self.cell_data,
            node_data=self.node_data,
            **self.noted,
        )


def _inverse(place: Ints) -> Ints:
    """Return the indices (n,) of what stands at each place, from the place (n,) of each."""
    order = np.empty(len(place), np.int64)
    order[place] = np.arange(len(place))
    return order


class Readers(Protocol):
    """Interface of n processes that read a file together, each a slice of it; all call each method.

    All of them raise an error that is raised by the `work` of one.
    """

    rank: int
    n: int

    def on_each(self, work: Callable[[], T]) -> T:
        """Do something on every process by itself, and return its result."""

    def total(self, x: NDArray) -> NDArray:
        """Return the sum of an array over all processes."""

    def greatest(self, x: NDArray) -> NDArray:
        """Return the largest value of all processes at each place of an array."""

    def gather(self, x: NDArray) -> NDArray:
        """Return the arrays of all processes, one after the other."""

    def repeated(self, number: Ints) -> int | None:
        """Return the smallest of the numbers (k,) of all processes that occurs several times, or None."""

    def index(self, own: Index, wanted: Iterable[Ints]) -> Index:
        """Return a map from numbers to indices in the whole, for the numbers `wanted`; `own`: that of this slice."""


class _Alone:
    """The reader of a whole file."""

    rank, n = 0, 1

    def on_each(self, work: Callable[[], T]) -> T:
        return work()

    def total(self, x: NDArray) -> NDArray:
        return x

    def greatest(self, x: NDArray) -> NDArray:
        return x

    def gather(self, x: NDArray) -> NDArray:
        return x

    def repeated(self, number: Ints) -> int | None:
        return ids.repeated(number)

    def index(self, own: Index, wanted: Iterable[Ints]) -> Index:
        return own


#: the reader of a whole file
ALONE: Readers = _Alone()
