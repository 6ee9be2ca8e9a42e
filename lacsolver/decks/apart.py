"""Groups of nodes that a cut leaves as they are: loads on each node of a group must not reach the cut's new nodes.

A cut adds a new node to a group that holds all corners of the edge, face or cell on which it lies. So no group of a
force or a spring may hold two nodes of a cell that is cut.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints, Mesh


def apart(mesh: Mesh, cut: Ints, nodes: Ints) -> list[Ints]:
    """Return `nodes` (k,) in groups, each without two nodes of one of the cells `cut`; one group if they allow it."""
    place = np.full(mesh.n_nodes, -1)
    place[nodes] = np.arange(len(nodes))
    pairs = _pairs(place[cell_nodes] for _, _, cell_nodes in mesh.select(np.unique(cut)))
    left = np.ones(len(nodes), bool)
    groups = []
    while left.any():
        chosen = _independent(pairs, left)
        groups.append(nodes[chosen])
        left &= ~chosen
    return groups


def _pairs(cells: Iterable[Ints]) -> Ints:
    """Return the pairs (m, 2), both ways, of members of the same row; -1 stands for no member."""
    found = [np.empty((0, 2), np.int64)]
    for rows in cells:
        a, b = np.nonzero(~np.eye(rows.shape[1], dtype=bool))
        found.append(np.stack([rows[:, a].ravel(), rows[:, b].ravel()], axis=1))
    both = np.concatenate(found)
    return np.unique(both[(both >= 0).all(axis=1)], axis=0)


def _independent(pairs: Ints, left: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return a mask (k,): a largest set of those that are left of which no two are a pair (Luby's method)."""
    rank = np.random.default_rng(0).permutation(len(left))
    chosen, open_ = np.zeros(len(left), bool), left.copy()
    while open_.any():
        i, j = pairs[open_[pairs].all(axis=1)].T
        lowest = np.full(len(left), len(left))
        np.minimum.at(lowest, i, rank[j])
        picked = open_ & (rank < lowest)
        chosen |= picked
        open_ &= ~picked
        open_[j[picked[i]]] = False
    return chosen
