"""The stress at nodes, from the stress at integration points: fitted in each cell, and the mean of a node's cells."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.small import weights
from lacsolver.bodies.small.fields import Field, scatter
from lacsolver.space.rules import cell_rule
from lacsolver.space.space import Space

#: products of reference coordinates (by their places) that a stress is fitted with, beside 1, in a family of cells
_TERMS: dict[str, tuple[tuple[int, ...], ...]] = {
    "TRIA": ((0,), (1,)),
    "QUAD": ((0,), (1,), (0, 1)),
    "TETRA": ((0,), (1,), (2,)),
    "HEXA": ((0,), (1,), (2,), (0, 1), (1, 2), (0, 2), (0, 1, 2)),
    "PENTA": ((0,), (1,), (2,), (0, 2), (1, 2)),
    "PYRAM": ((0,), (1,), (2,)),
}


def nodal_stress(space: Space, field: Field, cells: Ints | None = None) -> NDArray[np.floating]:
    """(n_nodes, 4 or 6): a stress given at the integration points of the stiffness (cells, points, n), at the nodes.

    In each cell a polynomial is fitted to the points, as rich as the shape functions of the linear cell, and taken to
    the cell's nodes; a node has the mean of its cells, weighted with their volumes. A constant is met exactly, and a
    linear stress on affine cells whose points can tell its slope: not where there is one point (TRIA3, TETRA4), nor
    along the axis of PYRAM5, whose points lie in one plane.

    The mean is over all the cells of a node, whatever their material; `cells` (indices in the mesh) names those to
    count, such as one body's, where a stress may jump. Nodes without any have NaN.
    """
    n = space.mesh.n_nodes
    total, volume = np.zeros((n, space.model.n_stress)), np.zeros((n, 1))
    for block, given, W in zip(space.blocks, field, weights(space), strict=True):
        rows = np.arange(len(block.cell)) if cells is None else np.flatnonzero(np.isin(block.cell, cells))
        size = W[rows].sum(axis=1)[:, None, None]
        at = extrapolation(block.type, space.model.axisymmetric) @ given[rows]
        scatter(total, block.nodes[rows], np.ascontiguousarray(at * size))
        scatter(volume, block.nodes[rows], np.repeat(size, block.nodes.shape[1], axis=1))
    return np.divide(total, volume, out=np.full_like(total, np.nan), where=volume > 0)


@cache
def extrapolation(name: str, axisymmetric: bool = False) -> NDArray[np.floating]:
    """(n_nodes, q): takes values at a cell's integration points to its nodes, by weighted least squares."""
    X, w = cell_rule(name, axisymmetric)
    middle, root = w @ X / w.sum(), np.sqrt(w)
    terms = _TERMS[CELLS[name].family]

    def values(at: Floats) -> NDArray[np.floating]:
        # about the middle of the points: where they cannot tell a slope, the shortest solution has none
        return np.stack([np.ones(len(at)), *((at - middle)[:, t].prod(axis=1) for t in map(list, terms))], axis=1)

    fit = np.linalg.pinv(values(X) * root[:, None], rcond=1e-10) * root
    return values(np.array(CELLS[name].reference)) @ fit
