"""The determinant of the map of cells at given reference points: volume elements, and which cells are folded."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints


def determinant(nodes: Ints, x: Floats, dN: Floats) -> NDArray[np.floating]:
    """(c, p): det J of cells with nodes (c, n) at x (n_nodes, 3), for dN (p, n, dim), dim 2 (in x, y) or 3."""
    out = np.empty((len(nodes), len(dN)))
    _fill(nodes, x, np.ascontiguousarray(dN), out)
    return out


@kernel
def _fill(nodes: Any, x: Any, dN: Any, out: Any) -> None:
    n_points, n, dim = dN.shape
    J = np.zeros((3, 3))
    for e in range(len(nodes)):
        for p in range(n_points):
            J[:] = 0.0
            J[2, 2] = 3.0 - dim
            for a in range(n):
                for s in range(dim):
                    for d in range(dim):
                        J[s, d] += x[nodes[e, a], s] * dN[p, a, d]
            out[e, p] = (
                J[0, 0] * (J[1, 1] * J[2, 2] - J[1, 2] * J[2, 1])
                + J[0, 1] * (J[1, 2] * J[2, 0] - J[1, 0] * J[2, 2])
                + J[0, 2] * (J[1, 0] * J[2, 1] - J[1, 1] * J[2, 0])
            )
