"""Recognition of cut edges in plane meshes, by restoring the parent cell behind their segments.

On a line the positions of nodes are no evidence: any even spacing looks like a cut. So the whole pattern must be found
in the cells behind the segments; they are then replaced by the cell that was cut. A cell that was cut for several of
its edges is restored edge by edge, in the opposite order: the rounds are repeated until no pattern is left.

The cone on a triangle, two triangles beside the middle of an edge, is common in uncut meshes too. It counts only if the
middle is numbered after both ends, and if the two triangles are neighbours in the file, as a cut leaves them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting.patterns import CONE, RING
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, mask_of, places_of
from lacmesh.topology.skin import TYPE_CODE, Faces, cells_of_dim

Bools = NDArray[np.bool_]
#: kind, parts (m, k), frame (m, 2 + new nodes), half-width of the ring
Segments = tuple[str, Ints, Ints, float]


class _Chains(NamedTuple):
    """Candidate chains of segments: `parts` (m, k), consecutive rows of faces; `nodes` (m, k + 1), from end to end."""

    parts: Ints
    nodes: Ints

    def take(self, rows: Bools) -> _Chains:
        return _Chains(self.parts[rows], self.nodes[rows])


class _Merge(NamedTuple):
    """Cells to merge: `chain` (k,), the candidate; `gone` (k, r), its cells; `parent` (k, 4), nodes of the parent."""

    chain: Ints
    gone: Ints
    parent: Ints

    def take(self, rows: Bools) -> _Merge:
        return _Merge(self.chain[rows], self.gone[rows], self.parent[rows])


def regroup_segments(mesh: Mesh, faces: Faces, place: Ints, tolerance: float) -> list[Segments]:
    """Recognise the macro-elements among the SEG2 of a skin; `place` (f,): the position of each face in the file."""
    pairs, triples, half = _candidates(mesh, faces, tolerance)
    if not len(pairs.parts) and not len(triples.parts):
        return []
    cells = cells_around(mesh, np.unique(np.concatenate([pairs.nodes.ravel(), triples.nodes.ravel()])))
    sides_of_pair, sides_of_triple = ((cells.behind(c.nodes) >= 0).sum(axis=1) for c in (pairs, triples))
    late = triples.nodes[:, 1:3].min(axis=1) > triples.nodes[:, [0, 3]].max(axis=1)
    together = (np.diff(place[triples.parts], axis=1) == 1).all(axis=1)
    parentless = (sides_of_triple == 0) & late & together
    merged_pairs, merged_triples = np.zeros_like(sides_of_pair), np.zeros_like(sides_of_triple)
    while True:
        merges = [find_rings(cells, triples.nodes), *find_cones(cells, pairs.nodes, sides_of_pair)]
        if not sum(len(merge.chain) for merge in merges):
            break
        merges = _apart(merges, len(cells.nodes))
        cells = merged(cells, merges)
        np.add.at(merged_triples, merges[0].chain, 1)
        np.add.at(merged_pairs, np.concatenate([merge.chain for merge in merges[1:]]), 1)
    in_a_row = (np.diff(place[pairs.parts], axis=1) == 1).all(axis=1)
    is_pair = (merged_pairs == sides_of_pair) & ((sides_of_pair > 0) | in_a_row)
    is_triple = (merged_triples == sides_of_triple) & ((sides_of_triple > 0) | parentless)
    pairs, triples = pairs.take(is_pair), triples.take(is_triple)
    return [
        (CONE, pairs.parts, pairs.nodes[:, [0, 2, 1]], 1 / 3),
        (RING, triples.parts, triples.nodes[:, [0, 3, 1, 2]], half),
    ]


def _candidates(mesh: Mesh, faces: Faces, tolerance: float) -> tuple[_Chains, _Chains, float]:
    """Candidates: pairs of segments halved and numbered as by a cut; symmetric triples; half-width of the ring."""
    rows = np.flatnonzero(faces.type == TYPE_CODE["SEG2"])
    start, stop = faces.nodes[rows, 0], faces.nodes[rows, 1]
    starts, stops = (np.bincount(nodes, minlength=mesh.n_nodes) for nodes in (start, stop))
    after = places_of(start, mesh.n_nodes)
    passed = (starts == 1) & (stops == 1)
    following = np.where(passed[stop], after[stop], -1)
    one = np.flatnonzero(following >= 0)
    two = one[following[following[one]] >= 0]
    pairs = _Chains(
        np.column_stack([one, following[one]]), np.column_stack([start[one], stop[one], stop[following[one]]])
    )
    middle = following[two]
    last = following[middle]
    triples = _Chains(
        np.column_stack([two, middle, last]), np.column_stack([start[two], stop[two], stop[middle], stop[last]])
    )
    a, n, b = np.moveaxis(mesh.points[pairs.nodes], 1, 0)
    late = (pairs.nodes[:, [1]] > pairs.nodes[:, [0, 2]]).all(axis=1)
    pairs = pairs.take(_near(n, (a + b) / 2, b - a, tolerance) & late)
    a, n, m, b = np.moveaxis(mesh.points[triples.nodes], 1, 0)
    size = np.maximum(((b - a) ** 2).sum(axis=1), 1e-300)
    half = ((m - n) * (b - a)).sum(axis=1) / size
    even = (half > 0) & (half < 1)
    for x, sign in ((n, -1), (m, 1)):
        even &= _near(x, (a + b) / 2 + sign * (half / 2)[:, None] * (b - a), b - a, tolerance)
    width = float(np.median(half[even])) if even.any() else 1 / 3
    return (
        _Chains(rows[pairs.parts], pairs.nodes),
        _Chains(rows[triples.parts], triples.nodes).take(even),
        width if abs(width - 1 / 3) > tolerance else 1 / 3,
    )


def _near(x: Floats, expected: Floats, side: Floats, tolerance: float) -> Bools:
    return np.linalg.norm(x - expected, axis=1) <= tolerance * np.linalg.norm(side, axis=1)


@dataclass(frozen=True)
class CellsAround:
    """The TRIA3 and QUAD4 near a skin: `nodes` (k, 4), -1 last in a triangle; `n_nodes` of the mesh.

    `first`, `last` (k,): the range of positions in the file that each occupies; a merged cell takes that of its parts.
    """

    nodes: Ints
    first: Ints
    last: Ints
    n_nodes: int

    @cached_property
    def _edges(self) -> tuple[Ints, Ints]:
        """The edges of all cells, by a number of their nodes, sorted; the cell of each."""
        size = np.where(self.nodes[:, 3] < 0, 3, 4)
        row, k = np.nonzero(np.arange(4) < size[:, None])
        number = self._number(self.nodes[row, k], self.nodes[row, (k + 1) % size[row]])
        order = np.lexsort((row, number))
        return number[order], row[order]

    def _number(self, a: Ints, b: Ints) -> Ints:
        return np.minimum(a, b) * self.n_nodes + np.maximum(a, b)

    def at_edge(self, a: Ints, b: Ints) -> Ints:
        """(k, 2): the cells that have the edges a b, padded with -1; -1 also for edges of more than two cells."""
        numbers, owner = self._edges
        low, high = (np.searchsorted(numbers, self._number(a, b), side=side) for side in ("left", "right"))
        out = np.full((len(low), 2), -1, np.int64)
        for k in range(2):
            there = (high - low > k) & (high - low <= 2)
            out[there, k] = owner[low[there] + k]
        return out

    def behind(self, chains: Ints) -> Ints:
        """(m, 2): the cells behind the first segment of each chain, padded with -1."""
        return self.at_edge(chains[:, 0], chains[:, 1])

    def across(self, cell: Ints, a: Ints, b: Ints) -> Ints:
        """Return the neighbours of the cells across the edges a b, -1 where there is none."""
        one, other = self.at_edge(a, b).T
        return np.where(one == cell, other, np.where(other == cell, one, -1))

    def beside(self, cell: Ints, corner: Ints, other: Ints) -> Ints:
        """Return the neighbour of a corner in each quadrangle that is not `other`; -1 where there is none."""
        nodes = self.nodes[cell]
        k = (nodes == corner[:, None]).argmax(axis=1)
        rows = np.arange(len(cell))
        before, after = nodes[rows, (k - 1) % 4], nodes[rows, (k + 1) % 4]
        good = (cell >= 0) & (nodes[:, 3] >= 0) & (nodes[rows, k] == corner)
        return np.where(good & (before == other), after, np.where(good & (after == other), before, -1))


def cells_around(mesh: Mesh, seeds: Ints) -> CellsAround:
    """Return the cells that touch some nodes, and the cells that share two nodes with them."""
    touched = mask_of(mesh.n_nodes, seeds)
    plane = [(n, ids) for kind, n, ids in cells_of_dim(mesh, 2) if kind in ("TRIA3", "QUAD4")]
    nodes = np.concatenate(
        [np.empty((0, 4), np.int64), *(np.pad(n, ((0, 0), (0, 4 - n.shape[1])), constant_values=-1) for n, _ in plane)]
    )
    ids = concatenated(ids for _, ids in plane)
    for least in (1, 2):
        near = np.count_nonzero(touched[nodes] & (nodes >= 0), axis=1) >= least
        touched[nodes[near][nodes[near] >= 0]] = True
    place = mesh.places_in_file(ids[near])
    return CellsAround(nodes[near].astype(np.int64), place, place, mesh.n_nodes)


def find_cones(cells: CellsAround, chains: Ints, sides: Ints) -> list[_Merge]:
    """Find pairs whose cells on one side are a triangle cut in two, or a quadrangle cut in three triangles.

    The triangles are a fan around the middle n of a chain a n b: it is walked from the segment a n, over spokes from n,
    to b. `sides` (m,): the number of cells behind each chain in the mesh.
    """
    behind = cells.behind(chains)
    chain, side = np.nonzero(behind >= 0)
    cell = behind[chain, side]
    spoke, n, b = (chains[chain, k] for k in range(3))
    fan: list[Ints] = []
    outline: list[Ints] = []  # the ends of the spokes so far
    walking = np.ones(len(chain), bool)
    merges = []
    for size in (1, 2, 3):
        fan = [*fan, cell]
        walking &= (cell >= 0) & (cells.nodes[cell, 3] < 0)
        third = np.where(walking, cells.nodes[cell, :3].sum(axis=1) - n - spoke, -1)
        arrived = walking & (third == b)
        if size > 1:
            rows = np.flatnonzero(arrived & _may_merge(cells, fan, sides[chain] == 2))
            far = [*outline[::-1], *[np.full(len(chain), -1)] * (3 - size)]
            parent = np.column_stack([chains[chain, 0], b, *far])[rows]
            merges.append(_Merge(chain[rows], np.column_stack(fan)[rows], parent))
        walking &= ~arrived
        outline = [*outline, third]
        cell, spoke = np.where(walking, cells.across(cell, n, third), -1), third
    return merges


def _may_merge(cells: CellsAround, fan: list[Ints], interface: Bools) -> Bools:
    """(k,): True for fans of two or three triangles that a cut has made; meshers make such fans too.

    Two must follow each other in the file. A cut makes three only at an `interface`, or in a cell with another slave
    edge at an interface: then one of the three has been merged before.
    """
    if len(fan) == 2:
        a, b = fan
        return (cells.last[a] + 1 == cells.first[b]) | (cells.last[b] + 1 == cells.first[a])
    of_parts: Bools = np.any([cells.first[cell] < cells.last[cell] for cell in fan], axis=0)
    return interface | of_parts


def find_rings(cells: CellsAround, chains: Ints) -> _Merge:
    """Find triples whose cells on one side are a quadrangle cut in four."""
    behind = cells.behind(chains)
    chain, side = np.nonzero(behind >= 0)
    first = behind[chain, side]
    a, n1, n2, b = (chains[chain, k] for k in range(4))
    v4, m1 = cells.beside(first, a, n1), cells.beside(first, n1, a)
    middle = cells.across(first, n1, m1)
    m2 = cells.beside(middle, n2, n1)
    last = cells.across(middle, n2, m2)
    v3 = cells.beside(last, b, n2)
    far = cells.across(middle, m1, m2)
    good = (cells.beside(middle, n1, n2) == m1) & (cells.beside(last, n2, b) == m2) & (v3 >= 0) & (v4 >= 0)
    good &= (cells.beside(far, m1, m2) == v4) & (cells.beside(far, m2, m1) == v3)
    rows = np.flatnonzero(good)
    gone = np.column_stack([first, middle, last, far])[rows]
    return _Merge(chain[rows], gone, np.column_stack([a, b, v3, v4])[rows])


def _apart(merges: list[_Merge], n_cells: int) -> list[_Merge]:
    """Leave a merge that needs a cell of another merge for a later round; if all do, take one, or nothing would end."""
    used = np.zeros(n_cells, np.int64)
    for merge in merges:
        np.add.at(used, merge.gone.ravel(), 1)
    apart = [merge.take((used[merge.gone] == 1).all(axis=1)) for merge in merges]
    if sum(len(merge.chain) for merge in apart):
        return apart
    best = next(k for k, merge in enumerate(merges) if len(merge.chain))
    return [merge.take((np.arange(len(merge.chain)) == 0) & (k == best)) for k, merge in enumerate(merges)]


def merged(cells: CellsAround, merges: list[_Merge]) -> CellsAround:
    """Replace cells by the parents they came from; no two merges have a cell in common."""
    kept = np.ones(len(cells.nodes), bool)
    for merge in merges:
        kept[merge.gone] = False
    nodes = np.concatenate([cells.nodes[kept], *(m.parent for m in merges)])
    first = np.concatenate([cells.first[kept], *(cells.first[m.gone].min(axis=1, initial=2**62) for m in merges)])
    last = np.concatenate([cells.last[kept], *(cells.last[m.gone].max(axis=1, initial=-1) for m in merges)])
    return CellsAround(nodes, first, last, cells.n_nodes)
