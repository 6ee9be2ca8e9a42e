"""Jacobian determinant of cells at given reference points, for volume elements and for the check of inverted cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints


def determinant(nodes: Ints, x: Floats, dN: Floats) -> NDArray[np.floating]:
    """Return det J (c, p) of cells with nodes (c, n) at x (n_nodes, 3), for dN (p, n, dim), dim 2 (in x, y) or 3."""
    n_points, n, dim = dN.shape
    of_nodes = x[nodes, :dim].transpose(1, 0, 2).reshape(n, -1)
    J = (dN.transpose(2, 0, 1).reshape(-1, n) @ of_nodes).reshape(dim, n_points, len(nodes), dim)
    J = J.transpose(0, 3, 2, 1)
    if dim == 2:
        return J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    return (
        J[0, 0] * (J[1, 1] * J[2, 2] - J[1, 2] * J[2, 1])
        + J[0, 1] * (J[1, 2] * J[2, 0] - J[1, 0] * J[2, 2])
        + J[0, 2] * (J[1, 0] * J[2, 1] - J[1, 1] * J[2, 0])
    )
