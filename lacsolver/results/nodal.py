"""Stress at nodes: extrapolated from the integration points by a fit in each cell, and averaged over a node's cells."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.assembly import scatter
from lacsolver.bodies.points import Field, weights
from lacsolver.space.rules import cell_rule
from lacsolver.space.space import Space

#: terms of the fit in a family of cells, in addition to 1: products of reference coordinates, by their indices
_TERMS: dict[str, tuple[tuple[int, ...], ...]] = {
    "TRIA": ((0,), (1,)),
    "QUAD": ((0,), (1,), (0, 1)),
    "TETRA": ((0,), (1,), (2,)),
    "HEXA": ((0,), (1,), (2,), (0, 1), (1, 2), (0, 2), (0, 1, 2)),
    "PENTA": ((0,), (1,), (2,), (0, 2), (1, 2)),
    "PYRAM": ((0,), (1,), (2,)),
}

#: names of the principal stresses, the largest first
PRINCIPAL = ("principal_1", "principal_2", "principal_3")


def von_mises(stress: Floats) -> NDArray[np.floating]:
    """Return the equivalent stress (n,) of von Mises of stresses (n, 4 or 6), xx yy zz xy (yz xz).

    >>> von_mises(np.array([[100.0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 10.0, 0]])).round(6).tolist()
    [100.0, 17.320508]
    """
    xx, yy, zz = stress[:, 0], stress[:, 1], stress[:, 2]
    shear = np.square(stress[:, 3:]).sum(axis=1)
    return np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * shear)


def principal(stress: Floats) -> NDArray[np.floating]:
    """Return the principal stresses (n, 3), the largest first, of stresses (n, 4 or 6), xx yy zz xy (yz xz).

    NaN where a component is not finite.

    >>> principal(np.array([[3.0, 3.0, 9.0, 2.0], [1.0, 2.0, 3.0, np.nan]])).tolist()
    [[9.0, 5.0, 1.0], [nan, nan, nan]]
    >>> principal(np.array([[2.0, 2.0, 7.0, 0.0, 0.0, 1.0]])).round(6).tolist()
    [[7.192582, 2.0, 1.807418]]
    """
    out = np.full((len(stress), 3), np.nan)
    known = np.isfinite(stress).all(axis=1)
    xx, yy, zz, xy, *more = stress[known].T
    if not more:
        middle, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
        values = np.sort(np.stack([middle - radius, middle + radius, zz], axis=1), axis=1)
    else:
        yz, xz = more
        tensor = np.stack([np.stack(row, axis=1) for row in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))], axis=1)
        values = np.linalg.eigvalsh(tensor)
    out[known] = values[:, ::-1]
    return out


def nodal_stress(space: Space, field: Field, cells: Ints | None = None) -> NDArray[np.floating]:
    """Return at the nodes (n_nodes, 4 or 6) a stress given at the integration points of the stiffness.

    `field`: (cells, points, 4 or 6) for each block; `cells` as in `nodal_values`.
    """
    return nodal_values(space, field, space.model.n_stress, cells)


def nodal_values(space: Space, field: Sequence[Floats], n: int, cells: Ints | None = None) -> NDArray[np.floating]:
    """Return at the nodes (n_nodes, n) values given at the integration points of the stiffness.

    `field`: (cells, points, n) for each block. In each cell a polynomial with the terms of the linear cell's shape
    functions is fitted to the points and evaluated at the cell's nodes; the value at a node is the mean over its cells,
    weighted with their volumes. A constant is reproduced exactly, and so is a linear stress on affine cells whose
    points determine its slope: not with a single point (TRIA3, TETRA4), nor along the axis of PYRAM5, whose points lie
    in one plane.

    The mean is over all the cells of a node, whatever their material; `cells` (indices in the mesh) restricts it, for
    instance to one body where the stress jumps. Nodes without any of these cells have NaN.
    """
    total, volume = np.zeros((space.mesh.n_nodes, n)), np.zeros((space.mesh.n_nodes, 1))
    for block, given, W in zip(space.blocks, field, weights(space), strict=True):
        rows = np.arange(len(block.cell)) if cells is None else np.flatnonzero(np.isin(block.cell, cells))
        size = W[rows].sum(axis=1)[:, None, None]
        at = extrapolation(block.type, space.model.axisymmetric) @ given[rows]
        scatter(total, block.nodes[rows], np.ascontiguousarray(at * size))
        scatter(volume, block.nodes[rows], np.repeat(size, block.nodes.shape[1], axis=1))
    return np.divide(total, volume, out=np.full_like(total, np.nan), where=volume > 0)


@cache
def extrapolation(name: str, axisymmetric: bool = False) -> NDArray[np.floating]:
    """Return the matrix (n_nodes, q) from a cell's integration points to its nodes, by weighted least squares."""
    X, w = cell_rule(name, axisymmetric)
    middle, root = w @ X / w.sum(), np.sqrt(w)
    terms = _TERMS[CELLS[name].family]

    def values(at: Floats) -> NDArray[np.floating]:
        # about the centre of the points: where they do not determine a slope, the minimum-norm solution has none
        return np.stack([np.ones(len(at)), *((at - middle)[:, t].prod(axis=1) for t in map(list, terms))], axis=1)

    fit = np.linalg.pinv(values(X) * root[:, None], rcond=1e-10) * root
    return values(np.array(CELLS[name].reference)) @ fit
