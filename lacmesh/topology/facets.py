"""The facets of all cells, each paired with the facet of the neighbouring cell.

A facet is identified by its corners, in any order. Facet j of cell k has the number `FACETS k + j`; `opposite` gives
the number of the same facet in the neighbouring cell, ALONE if there is none, CROWDED if there are several
(non-manifold), ABSENT for a number that a cell of few facets does not use.

The facets are sorted by a hash that does not depend on the order of their corners (`skin.sort_hashes`); neighbours in
that order are then compared corner by corner, so that the result is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.orientation import is_inverted, turned_over
from lacmesh.topology.skin import (
    MAX_CORNERS,
    PIECE,
    Bools,
    FaceIncidence,
    Faces,
    facets_of,
    first_of_each,
    label_rows,
    mixed_bits,
    sort_hashes,
)

#: most facets and corners of a cell
FACETS, CORNERS = 6, 8
ALONE, CROWDED, ABSENT = -1, -2, -3
_FAMILIES = ("TRIA", "QUAD", "TETRA", "HEXA", "PENTA", "PYRAM")


def _facet_table() -> NDArray[np.int8]:
    table = np.full((len(_FAMILIES), FACETS, MAX_CORNERS), -1, np.int8)
    for row, family in enumerate(_FAMILIES):
        cell = next(c for c in CELLS.values() if c.family == family and c.order == 1)
        for j, facet in enumerate(cell.facets):
            table[row, j, : len(facet.nodes)] = facet.nodes
    return table


#: (families, FACETS, 4): local corners of each facet, padded with -1
FACET_TABLE = _facet_table()


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

    def corners_of(self, number: Ints) -> list[Ints]:
        """Four columns (m,): the corners of some facets, by their numbers, as their cells list them; padded with -1."""
        rows, facet = np.divmod(number, FACETS)
        corners, start = self.corners.ravel(), rows.astype(np.int64) * self.corners.shape[1]
        columns = [start + places for places in FACET_TABLE[self.family[rows], facet].T]
        return [np.where(at < start, -1, corners[at]) for at in columns]

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
        rows, facet = np.divmod(np.flatnonzero(self.opposite == ALONE), FACETS)
        return rows, facet

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


def pair_facets(solid: Solid) -> tuple[Ints, Bools]:
    """(opposite (k FACETS,), same (k FACETS,)): the facet on the other side of each; True if it has the same winding.

    The facets of two cells on opposite sides have opposite windings; `same` is False for facets that are not paired.

    >>> square = Solid(np.arange(2), np.array([[0, 1, 2], [2, 1, 3]]), np.zeros(2, int))
    >>> opposite, same = pair_facets(square)
    >>> opposite.tolist(), bool(same.any())
    ([-1, 6, -1, -3, -3, -3, 1, -1, -1, -3, -3, -3], False)
    """
    opposite = np.full(len(solid.cells) * FACETS, ABSENT, solid.cells.dtype)
    opposite[(FACET_TABLE[:, :, 0] >= 0)[solid.family].ravel()] = ALONE
    same = np.zeros(len(opposite), bool)
    number = np.flatnonzero(opposite == ALONE).astype(opposite.dtype)
    weight = mixed_bits(np.arange(int(solid.corners.max(initial=0)) + 2))
    weight[-1] = 0  # of the corner -1, which a facet of fewer corners lists
    key = np.empty(len(number), np.uint64)
    for start in range(0, len(number), PIECE):  # whole arrays of what is only passed through would double the memory
        key[start : start + PIECE] = sum(weight[column] for column in solid.corners_of(number[start : start + PIECE]))
    place, new = sort_hashes(key)
    number = number[place]
    del key, place
    alike = _compare(solid, number, new)
    first = np.flatnonzero(new)
    length = np.diff(first, append=len(number))
    opposite[number[np.repeat(length > 2, length)]] = CROWDED
    two = first[length == 2]
    a, b = number[two], number[two + 1]
    opposite[a], opposite[b] = b, a
    same[a] = same[b] = alike[two + 1]
    return opposite, same


def _compare(solid: Solid, number: Ints, new: Bools) -> Bools:
    """(m,): True for facets with the winding of the one before, of the same corners; False where they are `new`.

    The few runs of alike hashes that hold different facets are sorted, and divided, in place.
    """
    alike = np.zeros(len(number), bool)
    clash = _compare_with_last(solid, number, np.flatnonzero(~new), alike)
    if len(clash):
        run = np.cumsum(new)
        at = np.flatnonzero(np.isin(run, run[clash]))
        label, _ = label_rows(np.sort(np.column_stack(solid.corners_of(number[at])), axis=1) + 1)
        order = np.lexsort((label, run[at]))
        number[at], new[at] = number[at[order]], np.diff(label[order], prepend=-1) != 0
        alike[at] = False
        _compare_with_last(solid, number, at[~new[at]], alike)
    return alike


def _compare_with_last(solid: Solid, number: Ints, rows: Ints, alike: Bools) -> Ints:
    """Compare some facets with the ones before; write `alike` for those of one winding, return those that differ."""
    different = [rows[:0]]
    for start in range(0, len(rows), PIECE):
        at = rows[start : start + PIECE]
        mine, last = solid.corners_of(number[at]), solid.corners_of(number[at - 1])
        equal = np.all([np.any([c == other for other in last], axis=0) for c in mine], axis=0)
        alike[at] = equal & (_is_forward(*mine) == _is_forward(*last))
        different.append(at[~equal])
    return np.concatenate(different)


def _is_forward(a: Ints, b: Ints, c: Ints, d: Ints) -> Bools:
    """(m,): winding of facets: True if it runs from the lowest corner to the larger one beside it."""
    up, across = a < c, b < d
    forward = (up == across) ^ (np.minimum(a, c) < np.minimum(b, d))
    if (fewer := d < 0).any():
        forward[fewer] = np.where(c < 0, a < b, (a < b) ^ (b < c) ^ (c < a))[fewer]
    return forward
