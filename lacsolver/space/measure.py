"""Parts that nodes have in the measure of cells: in the area of faces, the length of edges, the volume of a body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacsolver.space.space import Space

#: degree of the shape functions times the measure, by the order of the cell; with r in axisymmetry
_DEGREE = {0: 1, 1: 5, 2: 10}


def nodal_measures(space: Space, cells: Ints) -> NDArray[np.floating]:
    """Return int N_a (n_nodes,) over cells (indices), those of the highest dimension among them, each cell once.

    With thickness or 2 pi r. Points count 1 each. A uniform load has these parts at the nodes.
    """
    mesh, dims = space.mesh, space.mesh.cell_dim[cells]
    out = np.zeros(mesh.n_nodes)
    for name, chosen, nodes in mesh.select(cells[dims == dims.max(initial=0)]):
        cell = CELLS[name]
        once = np.unique(np.sort(nodes, axis=1), axis=0, return_index=True)[1]
        chosen, nodes = chosen[once], nodes[once]
        if not cell.dim:
            out[nodes.ravel()] = 1.0
            continue
        X, w = rule(cell.family, _DEGREE[cell.order])
        N, x = shape(name, X), space.local.points[nodes]
        J = jacobian(name, x, X[:, : cell.dim])
        size = np.sqrt(np.abs(np.linalg.det(J.swapaxes(2, 3) @ J)))
        parts = np.einsum("qn,cq->cn", N, size * w * space.depth(np.einsum("qn,cns->cqs", N, x), chosen))
        np.add.at(out, nodes, parts)
    return out
