"""Quality that one number ranks: the least corner Jacobian, each type scaled to 1 for its ideal cell.

At a corner the tangents of the edges are brought to length 1 and their determinant is taken (Knupp, Int. J. Numer.
Meth. Engng 48, 2000); ideal are the equilateral triangle and tetrahedron, the square and the cube, the prism with an
equilateral base, the pyramid of equilateral sides. A pyramid's apex, where four edges meet, has no such number. The
tangents of a quadratic cell are those of its curved edges.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.shapes import gradient

_IDEAL = {
    "TRIA": np.sqrt(3) / 2,
    "QUAD": 1.0,
    "TETRA": np.sqrt(0.5),
    "HEXA": 1.0,
    "PENTA": np.sqrt(3) / 2,
    "PYRAM": np.sqrt(0.5),
}
_CHUNK = 1 << 15


@cache
def _tangents(name: str) -> NDArray:
    """(corners, dim, n_nodes): weights of the nodes in the tangents of the edges that leave each corner."""
    cell = CELLS[name]
    ref = np.array(cell.reference)
    corners = range(4 if cell.family == "PYRAM" else cell.n_corners)
    rows = []
    for c in corners:
        ends = [b if a == c else a for a, b in cell.edges if c in (a, b)]
        along = np.array([ref[e] - ref[c] for e in ends])
        if np.linalg.det(along) < 0:
            along[[0, 1]] = along[[1, 0]]
        rows.append(along @ gradient(name, ref[c])[0].T)
    return np.array(rows)


def corner_jacobian(name: str, x: Floats, plane: bool = False) -> Floats:
    """(k,): least scaled Jacobian over the corners of cells with nodes at x (k, n_nodes, 3); 1 ideal, <= 0 invalid.

    Surface cells count against their own mean normal, or against +z where `plane`. Points and lines give 1.

    >>> float(corner_jacobian("QUAD4", np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]]))[0])
    1.0
    """
    cell = CELLS.get(name)
    if cell is None or cell.dim < 2:
        return np.ones(len(x))
    out = np.empty(len(x))
    for start in range(0, len(x), _CHUNK):
        t = np.einsum("cdn,kns->kcds", _tangents(name), x[start : start + _CHUNK], optimize=True)
        size = np.linalg.norm(t, axis=-1)
        t = np.divide(t, size[..., None], out=np.zeros_like(t), where=size[..., None] > 0)
        out[start : start + _CHUNK] = _determinant(t, cell.dim, plane).min(axis=1) / _IDEAL[cell.family]
    return out


def _determinant(t: NDArray, dim: int, plane: bool) -> NDArray:
    """(k, corners) from unit tangents (k, corners, dim, 3)."""
    normal = np.cross(t[:, :, 0], t[:, :, 1])
    if dim == 3:
        return np.einsum("kcs,kcs->kc", normal, t[:, :, 2])
    if plane:
        return normal[..., 2]
    mean = normal.sum(axis=1, keepdims=True)
    size = np.linalg.norm(mean, axis=-1, keepdims=True)
    return (normal * np.divide(mean, size, out=np.zeros_like(mean), where=size > 0)).sum(axis=-1)


def worst(mesh: Mesh, cells: Ints) -> float:
    """The least corner Jacobian among some cells of a mesh; NaN where there is none to measure."""
    least = [
        corner_jacobian(kind, mesh.points[nodes], mesh.space_dim == 2).min()
        for kind, _, nodes in mesh.select(cells)
        if kind in CELLS and CELLS[kind].dim > 1
    ]
    return float(min(least)) if least else float("nan")
