"""Slices of a mesh file: consecutive nodes, and consecutive cells of each type, so that nobody holds the whole mesh.

Slice k of n has as many nodes, and cells of each type, as any other. It is read by process k of n. Where a number must
be found among all of the file, a hash of it names the process that meets all that are the same. A whole file is the
only slice of one process.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.communicator import SERIAL, Communicator
from lacmesh.formats import ids
from lacmesh.formats.ids import Index
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, places_of

#: 2^64 divided by the golden ratio, for Fibonacci hashing: Knuth, The Art of Computer Programming 3, section 6.4
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)


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
            file_order=None if self.cell_place is None else places_of(self.cell_place, len(self.cell_place)),
            cell_groups=self.cell_groups,
            node_groups=self.node_groups,
            cell_data=self.cell_data,
            node_data=self.node_data,
            **self.noted,
        )


def repeated(number: Ints, comm: Communicator = SERIAL) -> int | None:
    """Return the smallest of the numbers (k,) of all processes that occurs several times, or None."""
    if comm.size == 1:
        return ids.repeated(number)
    ends = comm.gather(number[[0, -1]] if len(number) else number)
    ascending = (np.diff(number) > 0).all() and (ends[1:-1:2] < ends[2::2]).all()
    if comm.greatest(np.array(not ascending, np.int64)) == 0:
        return None
    order, counts = _meetings(number, comm)
    ordered = np.sort(comm.exchange(number[order], counts)[0])
    again = ordered[1:][ordered[1:] == ordered[:-1]]
    none = np.iinfo(np.int64).max
    least = -int(comm.greatest(np.array(-again[0] if len(again) else -none)))
    return None if least == none else least


def whole_index(own: Index, wanted: Iterable[Ints], comm: Communicator = SERIAL) -> Index:
    """Return a map from numbers to indices in the whole, for the numbers `wanted`; `own`: that of this slice."""
    if comm.size == 1:
        return own
    first = comm.before(own.n)
    place = np.arange(first, first + own.n)
    n = int(comm.total(np.array(own.n)))
    if comm.greatest(np.array(not np.array_equal(own.numbers, place + 1), np.int64)) == 0:
        return Index.counting(n)
    order, counts = _meetings(own.numbers, comm)
    numbers, received = comm.exchange(own.numbers[order], counts)
    met = Index(numbers, table=False)
    place = comm.exchange(place[order], counts, received)[0]
    distinct = [np.unique(np.asarray(number, np.int64)) for number in wanted]
    number = np.unique(concatenated(distinct))
    order, counts = _meetings(number, comm)
    asked, received = comm.exchange(number[order], counts)
    places = np.empty(len(number), np.int64)
    places[order] = comm.exchange(np.append(place, -1)[met.places(asked)], received, counts)[0]
    return Index.of_places(number, places, n)


def _meetings(number: Ints, comm: Communicator) -> tuple[Ints, Ints]:
    """Return an order (k,) of some numbers (k,) by the process that meets all that are the same, and counts (size,)."""
    mixed = number.astype(np.uint64) * _GOLDEN >> np.uint64(32)
    where = (mixed % np.uint64(comm.size)).astype(np.int64)
    return np.argsort(where, kind="stable"), np.bincount(where, minlength=comm.size)
