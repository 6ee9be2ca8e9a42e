"""Plain twins of what `lacmesh.topology` does fast: a table of facets, all pairs of boxes, scipy's components."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lacmesh.topology.facets import ABSENT, ALONE, CROWDED, FACET_TABLE, FACETS


def pairs_of_facets(solid):
    """`pair_facets` from a table of facets by their sorted corners; the winding from the cycle of the corners."""
    opposite = np.full(len(solid.cells) * FACETS, ABSENT)
    same = np.zeros(len(opposite), bool)
    table = {}
    for cell, (corners, family) in enumerate(zip(solid.corners, solid.family, strict=True)):
        for j, places in enumerate(FACET_TABLE[family]):
            if places[0] >= 0:
                listed = corners[places[places >= 0]].tolist()
                table.setdefault(tuple(sorted(listed)), []).append((cell * FACETS + j, listed))
    for owners in table.values():
        numbers = [number for number, _ in owners]
        opposite[numbers] = ALONE if len(owners) == 1 else CROWDED
        if len(owners) == 2:
            opposite[numbers] = numbers[::-1]
            same[numbers] = cycle(owners[0][1]) == cycle(owners[1][1])
    return opposite, same


def cycle(listed):
    """Winding of a facet: True if the larger of the two neighbours of the lowest corner follows it."""
    k = listed.index(min(listed))
    if len(listed) == 2:
        return k == 0
    return listed[(k + 1) % len(listed)] > listed[k - 1]


def meeting(low, high, other_low, other_high):
    """(i, j): all pairs of intersecting boxes, by comparing every box with every other."""
    return np.nonzero(((low[:, None] <= other_high) & (high[:, None] >= other_low)).all(axis=2))


def bodies(cells, n_nodes):
    """`label_bodies` by scipy: the graph of cells and nodes."""
    cell, place = np.nonzero(cells >= 0)
    size = n_nodes + len(cells)
    graph = coo_array((np.ones(len(cell), bool), (cells[cell, place], n_nodes + cell)), shape=(size, size))
    label = connected_components(graph, directed=False)[1]
    out, seen = np.full(n_nodes, -1), {}
    for node in np.unique(cells[cells >= 0]).tolist():
        out[node] = seen.setdefault(label[node], len(seen))
    return out
