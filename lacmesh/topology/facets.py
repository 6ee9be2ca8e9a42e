"""The facets of all cells, each paired with the facet of the neighbouring cell.

A facet is identified by its corners, in any order. Facet j of cell k has the number `FACETS k + j`; `opposite` gives
the number of the same facet in the neighbouring cell, ALONE if there is none, CROWDED if there are several
(non-manifold), ABSENT for a number that a cell of few facets does not use.

The facets are sorted by a hash of 64 bits that does not depend on the order of their corners; neighbours in that order
are then compared corner by corner, so that the result is exact.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.faces import facets_of
from lacmesh.topology.skin import MAX_CORNERS, FaceIncidence, Faces, first_of_each, label_rows
from lacmesh.topology.winding import is_inverted, turned_over

Bools = NDArray[np.bool_]
#: most facets of a cell
FACETS = 6
CORNERS = 8
ALONE, CROWDED, ABSENT = -1, -2, -3
_FAMILIES = ("TRIA", "QUAD", "TETRA", "HEXA", "PENTA", "PYRAM")
#: facets, or pairs of them, that are treated at once
_PIECE = 1 << 17
#: 2^64 over the golden ratio, odd
_GOLDEN = 0x9E3779B97F4A7C15


@dataclass(frozen=True)
class Solid:
    """The cells of the mesh's dimension: `cells` (k,) indices, `corners` (k, 8) padded with -1, `family` (k,)."""

    cells: Ints
    corners: Ints
    family: Ints

    def take(self, rows: Ints) -> Solid:
        """Some of the cells."""
        return Solid(self.cells[rows], self.corners[rows], self.family[rows])

    def copies(self) -> Ints:
        """Rows of duplicate cells: those with the same corners as an earlier one."""
        first, _ = first_of_each(*label_rows(np.sort(self.corners, axis=1) + 1))
        return np.setdiff1d(np.arange(len(self.corners)), first)

    def facets(self) -> Iterator[tuple[int, Ints, list[Ints]]]:
        """Iterate over the facets, family by family: (number in the cell, rows of cells, a column for each corner)."""
        for family in np.flatnonzero(np.bincount(self.family, minlength=len(_FAMILIES))):
            rows = np.flatnonzero(self.family == family)
            own = self.corners if len(rows) == len(self.corners) else self.corners[rows]
            for j, places in enumerate(FACET_TABLE[family]):
                if places[0] >= 0:
                    yield j, rows, [own[:, p] for p in places if p >= 0]

    def corners_of(self, number: Ints) -> list[Ints]:
        """Four columns (m,): the corners of some facets, by their numbers, as their cells list them; padded with -1."""
        rows, facet = np.divmod(number.astype(np.int64), FACETS)
        corners = self.corners.ravel()
        places = FACET_TABLE[self.family[rows], facet]
        return [np.where(p < 0, -1, corners[rows * self.corners.shape[1] + p]) for p in places.T]

    @classmethod
    def of(cls, mesh: Mesh) -> Solid:
        """Return all cells of the highest dimension, by their corners; those of order 3 and higher are included."""
        wide = mesh.n_nodes > np.iinfo(np.int32).max // 2 or mesh.n_cells * FACETS > np.iinfo(np.int32).max
        dtype = np.int64 if wide else np.int32
        mine = [k for k, b in enumerate(mesh.blocks) if ALL_CELLS[b.type].dim == mesh.dim > 1]
        size = sum(len(mesh.blocks[k].nodes) for k in mine)
        corners = np.full((size, CORNERS), -1, dtype)
        cells: Ints = np.empty(size, dtype)
        family: Ints = np.empty(size, np.int8)
        start = 0
        for k in mine:
            kind, nodes = mesh.blocks[k]
            cell = ALL_CELLS[kind]
            rows = slice(start, start + len(nodes))
            corners[rows, : cell.n_corners] = nodes[:, : cell.n_corners]
            cells[rows] = np.arange(mesh.offsets[k], mesh.offsets[k + 1])
            family[rows] = _FAMILIES.index(cell.family)
            start += len(nodes)
        return cls(cells, corners, family)


@dataclass(frozen=True)
class Facets:
    """The cells of a mesh, each once, and their paired facets (`pair_facets`); `copies`: the duplicate cells."""

    solid: Solid
    opposite: Ints
    same: Bools
    copies: Ints

    @classmethod
    def of(cls, mesh: Mesh) -> Facets:
        """Return all facets of the cells of the highest dimension."""
        solid = Solid.of(mesh)
        opposite, same = pair_facets(solid)
        copies: Ints = np.empty(0, np.int64)
        if same.any() or (opposite == CROWDED).any():  # a copy shares its facets, which shows here
            copies = solid.copies()
        if len(copies):
            cells = solid.cells[copies]
            solid = solid.take(np.setdiff1d(np.arange(len(solid.cells)), copies))
            return cls(solid, *pair_facets(solid), cells)
        return cls(solid, opposite, same, copies)

    @property
    def boundary(self) -> tuple[Ints, Ints]:
        """(rows of `solid`, facet numbers) of the boundary facets, which belong to one cell only."""
        alone = np.flatnonzero(self.opposite == ALONE)
        return alone // FACETS, alone % FACETS

    def corners(self, rows: Ints, facet: Ints) -> Ints:
        """(k, 4): the corners of some facets, in the order of their cells, padded with -1."""
        return np.column_stack(self.solid.corners_of(rows * FACETS + facet)).astype(np.int64)


def boundary_faces(mesh: Mesh) -> tuple[Faces, Ints]:
    """Return the facets that belong to one cell only, outward also if that cell is inverted, and the cells (f,)."""
    facets = Facets.of(mesh)
    rows, facet = facets.boundary
    cell = facets.solid.cells[rows].astype(np.int64)
    faces = facets_of(mesh, FaceIncidence(np.arange(len(cell)), cell, facet, np.ones(len(cell), bool)))
    return turned_over(faces, np.flatnonzero(is_inverted(mesh, cell, plane=True))), cell


def _table() -> NDArray[np.int8]:
    """(families, FACETS, 4): local corners of each facet, padded with -1."""
    table = np.full((len(_FAMILIES), FACETS, MAX_CORNERS), -1, np.int8)
    for row, family in enumerate(_FAMILIES):
        cell = next(c for c in CELLS.values() if c.family == family and c.order == 1)
        for j, facet in enumerate(cell.facets):
            table[row, j, : len(facet.nodes)] = facet.nodes
    return table


FACET_TABLE = _table()


def pair_facets(solid: Solid) -> tuple[Ints, Bools]:
    """(opposite (k FACETS,), same (k FACETS,)): the facet on the other side of each; True if it has the same winding.

    The facets of two cells on opposite sides have opposite windings; `same` is False for facets that are not paired.

    >>> square = Solid(np.arange(2), np.array([[0, 1, 2], [2, 1, 3]]), np.zeros(2, int))
    >>> opposite, same = pair_facets(square)
    >>> opposite.tolist(), bool(same.any())
    ([-1, 6, -1, -3, -3, -3, 1, -1, -1, -3, -3, -3], False)
    """
    opposite = np.full(len(solid.cells) * FACETS, ABSENT, solid.cells.dtype)
    same = np.zeros(len(opposite), bool)
    for j, rows, _ in solid.facets():
        opposite[rows * FACETS + j] = ALONE
    left = np.flatnonzero(opposite == ALONE).astype(opposite.dtype)
    seed = 0
    while len(left):  # once, but for the few different facets of equal keys: these draw again
        seed += 1
        members, run = _runs(left, _keys(solid, left, seed), opposite)
        wrong = [_compare(solid, left, opposite, same), _crowd(solid, members, run, opposite)]
        left = np.sort(np.concatenate(wrong))
    return opposite, same


def _pieces(size: int) -> Iterator[slice]:
    """Iterate over 0..size, _PIECE at a time: whole arrays of what is only passed through would double the memory."""
    for k in range(0, size, _PIECE):
        yield slice(k, min(k + _PIECE, size))


def _keys(solid: Solid, number: Ints, seed: int) -> NDArray[np.uint64]:
    """(m,): a hash of each of some facets, which does not depend on the order of their corners."""
    weight = mixed_bits(np.arange(int(solid.corners.max(initial=0)) + 2), seed)
    weight[-1] = 0  # of the corner -1, which a facet of fewer corners lists
    key = np.empty(len(number), np.uint64)
    for piece in _pieces(len(number)):
        key[piece] = sum(weight[column] for column in solid.corners_of(number[piece]))
    return key


def _runs(number: Ints, key: NDArray[np.uint64], opposite: Ints) -> tuple[Ints, Ints]:
    """Write the facets whose key one other has into `opposite`; return those of longer runs (m,), and their runs (m,).

    A key and a place among the facets share 64 bits: whole numbers are sorted several times faster than places.
    """
    bits = np.uint64(len(number).bit_length())
    place = (np.uint64(1) << bits) - np.uint64(1)
    for piece in _pieces(len(key)):
        key[piece] = key[piece] & ~place | np.arange(piece.start, piece.stop, dtype=np.uint64)
    key.sort()
    alike = np.zeros(len(key) + 2, bool)  # True where the facet before has the same key
    for piece in _pieces(len(key) - 1):
        cut = key[piece.start : piece.stop + 1] >> bits
        alike[piece.start + 1 : piece.stop + 1] = cut[1:] == cut[:-1]
    inner: list[Ints] = [np.empty(0, np.int64)]
    for piece in _pieces(len(key) - 1):
        here, after, last = (alike[piece.start + k : piece.stop + k] for k in range(3))
        first = np.flatnonzero(after & ~here & ~last) + piece.start
        a, b = (number[(key[rows] & place).view(np.int64)] for rows in (first, first + 1))
        opposite[a], opposite[b] = b, a
        inner.append(np.flatnonzero(after & here) + piece.start)
    long = np.unique(np.concatenate(inner) + np.arange(-1, 2)[:, None])
    return number[(key[long] & place).view(np.int64)], np.cumsum(~alike[long])


def _compare(solid: Solid, number: Ints, opposite: Ints, same: Bools) -> Ints:
    """Compare some facets with their `opposite` and write `same`; return those that are two facets, ALONE again."""
    unequal = [number[:0]]
    for piece in _pieces(len(number)):
        one = number[piece][number[piece] < opposite[number[piece]]]
        other = opposite[one]
        mine, theirs = solid.corners_of(one), solid.corners_of(other)
        equal = _are_equal(mine, theirs)
        same[one] = same[other] = (_is_forward(mine) == _is_forward(theirs)) & equal
        unequal += [one[~equal], other[~equal]]
    wrong = np.concatenate(unequal)
    opposite[wrong] = ALONE
    return wrong


def _crowd(solid: Solid, members: Ints, run: Ints, opposite: Ints) -> Ints:
    """Write CROWDED for runs of one facet each into `opposite`; return the facets of the other runs."""
    corners = solid.corners_of(members)
    equal = _are_equal([c[1:] for c in corners], [c[:-1] for c in corners]) | (run[1:] != run[:-1])
    wrong = np.isin(run, run[1:][~equal])
    opposite[members[~wrong]] = CROWDED
    return members[wrong]


def _are_equal(mine: list[Ints], theirs: list[Ints]) -> Bools:
    """(m,): True for facets, by four columns each, that have the same corners in any order."""
    return np.all([np.any([c == other for other in theirs], axis=0) for c in mine], axis=0)


def mixed_bits(numbers: Ints, seed: int = 1) -> NDArray[np.uint64]:
    """Hash numbers from 0 to 64 bits each, so that the sum over a set of numbers identifies the set.

    The finalizer of splitmix64 (Steele, Lea, Flood, OOPSLA 2014).
    """
    x = (numbers.astype(np.uint64) + np.uint64(seed)) * np.uint64(_GOLDEN)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


def _is_forward(corners: list[Ints]) -> Bools:
    """(m,): winding of facets, by four columns: True if it runs from the lowest corner to the larger one beside it."""
    listed = np.stack(corners)
    n = np.count_nonzero(listed >= 0, axis=0)
    lowest = np.where(listed >= 0, listed, np.iinfo(listed.dtype).max).argmin(axis=0)
    m = np.arange(listed.shape[1])
    return np.where(n == 2, lowest == 0, listed[(lowest + 1) % n, m] > listed[(lowest - 1) % n, m])
