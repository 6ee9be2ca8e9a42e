"""Slave skins of plane models as lines: the order of their faces, and values over the length along them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.topology.bodies import label_components


def along(ends: Ints, values: Floats, x: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return (s, values) of faces along a skin, as steps, with NaN between chains that are not joined.

    `ends` (f, 2): end nodes of the faces, at x (n_nodes, 3); `values` (f,). An open chain starts at its end, a closed
    one at its first face; s continues from one chain to the next.
    """
    order, first = chains(ends)
    length = np.linalg.norm(x[ends[order, 1]] - x[ends[order, 0]], axis=1)
    stop = np.cumsum(length)
    s = np.stack([np.append(0.0, stop[:-1]), stop], axis=1)
    p = np.repeat(values[order], 2).reshape(-1, 2)
    gaps = 2 * first[1:]
    return np.insert(s.ravel(), gaps, np.nan), np.insert(p.ravel(), gaps, np.nan)


def chains(ends: Ints) -> tuple[Ints, Ints]:
    """Return the order of segments (f, 2), which all run one way, along chains, and the start of each chain in it.

    >>> order, first = chains(np.array([[2, 3], [7, 8], [1, 2], [3, 4]]))
    >>> order.tolist(), first.tolist()
    ([2, 0, 3, 1], [0, 3])
    """
    n = len(ends)
    by_start = np.argsort(ends[:, 0], kind="stable")
    at = np.minimum(np.searchsorted(ends[by_start, 0], ends[:, 1]), n - 1)
    after = np.where(ends[by_start[at], 0] == ends[:, 1], by_start[at], -1)
    joined = np.flatnonzero(after >= 0)
    chain = label_components(joined, after[joined], n)
    lowest = np.unique(chain, return_index=True)[1]
    begun = np.isin(chain[lowest], chain[np.setdiff1d(np.arange(n), after)])
    after[np.isin(after, lowest[~begun])] = -1  # a closed chain begins at its first face
    left = (after >= 0).astype(np.int64)  # number of segments that follow: up to a jump, which doubles each time
    for _ in range(n.bit_length()):
        on = after >= 0
        left[on] += left[after[on]]
        after[on] = after[after[on]]
    order = np.lexsort((-left, chain))
    return order, np.searchsorted(chain[order], np.arange(len(lowest)))
