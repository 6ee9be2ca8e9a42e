"""Numbers of nodes and cells of a file, found among those of all processes that read it by slices.

A number is sent to one of the processes, which meets all that are the same: the process that a hash of it names.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lacmesh.formats.ids import Index
from lacmesh.mesh import Ints
from lacsolver.distributed.collective import Collective, Routes

#: 2^64 divided by the golden ratio, for Fibonacci hashing: Knuth, The Art of Computer Programming 3, section 6.4
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)


class NumberedReaders(Collective):
    """Processes that read a file together, each a slice of it: see `lacmesh.formats.slices.Readers`."""

    def repeated(self, number: Ints) -> int | None:
        """Return the smallest of the numbers (k,) of all processes that occurs several times, or None."""
        ends = self.gather(number[[0, -1]] if len(number) else number)
        ascending = (np.diff(number) > 0).all() and (ends[1:-1:2] < ends[2::2]).all()
        if self.greatest(np.array(not ascending, np.int64)) == 0:
            return None
        routes, order = self._routes(number)
        ordered = np.sort(routes.there(number[order]))
        again = ordered[1:][ordered[1:] == ordered[:-1]]
        none = np.iinfo(np.int64).max
        least = -int(self.greatest(np.array(-again[0] if len(again) else -none)))
        return None if least == none else least

    def index(self, own: Index, wanted: Iterable[Ints]) -> Index:
        """Return a map from numbers to indices in the whole, for the numbers `wanted`; `own`: that of this slice."""
        first = self.before(own.n)
        place = np.arange(first, first + own.n)
        n = int(self.total(np.array(own.n)))
        if self.greatest(np.array(not np.array_equal(own.numbers, place + 1), np.int64)) == 0:
            return Index.counting(n)
        routes, order = self._routes(own.numbers)
        there = Index(routes.there(own.numbers[order]), table=False)
        place = routes.there(place[order])
        distinct = [np.unique(np.asarray(number, np.int64)) for number in wanted]
        number = np.unique(np.concatenate([np.empty(0, np.int64), *distinct]))
        routes, order = self._routes(number)
        found = there.places(routes.there(number[order]))
        places = np.empty(len(number), np.int64)
        places[order] = routes.back(np.append(place, -1)[found])
        return Index.of_places(number, places, n)

    def _routes(self, number: Ints) -> tuple[Routes, Ints]:
        """Return the ways of some numbers (k,) to the processes that meet them, and the order (k,) in which they go."""
        mixed = number.astype(np.uint64) * _GOLDEN >> np.uint64(32)
        where = (mixed % np.uint64(self.n)).astype(np.int64)
        return Routes(self, np.bincount(where, minlength=self.n)), np.argsort(where, kind="stable")
