"""Quadrature on the reference elements of `cells.py`: Gauss rules in products, collapsed onto simplices and pyramids.

A collapsed rule integrates polynomials of its degree exactly, and on pyramids the rational functions of `shapes.py`
too: with x = u (1 - z), y = v (1 - z) they are polynomials (Stroud, Approximate Calculation of Multiple
Integrals, 1971).
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.shapes import jacobian

Rule = tuple[NDArray[np.floating], NDArray[np.floating]]


def _gauss(degree: int, power: int = 0) -> Rule:
    """Points on [0, 1] and weights that hold (1 - t)^power, exact to `degree` of what else is integrated."""
    t, w = np.polynomial.legendre.leggauss((degree + power) // 2 + 1)
    t, w = (t + 1) / 2, w / 2
    return t, w * (1 - t) ** power


@cache
def rule(family: str, degree: int) -> Rule:
    """Points (p, dim) and weights (p,) on the reference element of a family, exact to `degree`.

    >>> X, w = rule("TETRA", 2)
    >>> float(round(w.sum(), 15)), float(round((w * X[:, 0] ** 2).sum(), 15))
    (0.166666666666667, 0.016666666666667)
    """
    line, w_line = _gauss(degree)
    if family == "POI":
        return np.zeros((1, 0)), np.ones(1)
    if family in ("SEG", "QUAD", "HEXA"):
        axes = {"SEG": 1, "QUAD": 2, "HEXA": 3}[family]
        return _product([(2 * line - 1, 2 * w_line)] * axes)
    if family == "TRIA":
        (X, w) = _product([_gauss(degree, 1), (line, w_line)])
        return np.column_stack([X[:, 0], X[:, 1] * (1 - X[:, 0])]), w
    if family == "TETRA":
        (X, w) = _product([_gauss(degree, 2), _gauss(degree, 1), (line, w_line)])
        y = X[:, 1] * (1 - X[:, 0])
        return np.column_stack([X[:, 0], y, X[:, 2] * (1 - X[:, 0] - y)]), w
    if family == "PENTA":
        X, w = rule("TRIA", degree)
        z, wz = 2 * line - 1, 2 * w_line
        return np.column_stack([np.repeat(X, len(z), axis=0), np.tile(z, len(X))]), np.outer(w, wz).ravel()
    if family == "PYRAM":
        (X, w) = _product([_gauss(degree, 2), (2 * line - 1, 2 * w_line), (2 * line - 1, 2 * w_line)])
        return np.column_stack([X[:, 1] * (1 - X[:, 0]), X[:, 2] * (1 - X[:, 0]), X[:, 0]]), w
    raise ValueError(f"no rule for {family!r}")


def _product(rules: list[Rule]) -> Rule:
    points = np.meshgrid(*(X for X, _ in rules), indexing="ij")
    weights = np.meshgrid(*(w for _, w in rules), indexing="ij")
    return np.stack([p.ravel() for p in points], axis=1), np.prod([w.ravel() for w in weights], axis=0)


#: degree that integrates the determinant of each cell's map exactly
_VOLUME_DEGREE = {1: 3, 2: 6}


def measure(name: str, x: Any, degree: int | None = None) -> NDArray[np.floating]:
    """(cells,): length, area or signed volume of cells with nodes at x (cells, n_nodes, 3).

    Exact for solid cells and for plane ones; a curved surface or line converges with `degree`. Cells of dimension 2
    count positive whatever their orientation.
    """
    cell = CELLS[name]
    x = np.asarray(x, dtype=float)
    X, w = rule(cell.family, _VOLUME_DEGREE.get(cell.order, 1) if degree is None else degree)
    if cell.dim == 0:
        return np.ones(len(x))
    J = jacobian(name, x, X)
    if cell.dim == 3:
        return np.linalg.det(J) @ w
    if cell.dim == 2:
        return np.linalg.norm(np.cross(J[..., 0], J[..., 1]), axis=-1) @ w
    return np.linalg.norm(J[..., 0], axis=-1) @ w
