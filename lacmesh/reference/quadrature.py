"""Quadrature on the reference elements of `cells.py`: products of Gauss rules, symmetric rules on simplices.

A symmetric rule consists of a few orbits: all permutations of a point's barycentric coordinates share one weight.
Beyond the table, and on pyramids, collapsed product rules are used: they are exact for polynomials of their degree, and
on pyramids also for the rational functions of `shapes.py`, which are polynomials in u, v and z for x = u (1 - z),
y = v (1 - z) (Stroud, Approximate Calculation of Multiple Integrals, 1971).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.reference.shapes import jacobian

QuadratureRule = tuple[NDArray[np.floating], NDArray[np.floating]]
Orbits = tuple[tuple[float, tuple[float, ...]], ...]

_R15 = np.sqrt(15.0)
_R10, _SUB = np.sqrt(10.0), np.sqrt(38 - 44 * np.sqrt(0.4))
_TERM = np.sqrt(213125 - 53320 * _R10)
#: degree -> orbits (weight of one point, the whole being 1; barycentric coordinates, the last one left out).
#: 2, 4: Strang and Fix, 1973. 5: Radon, 1948. 6, 8: Dunavant, Int. J. Numer. Meth. Engng 21, 1985.
_TRIANGLES: dict[int, Orbits] = {
    1: ((1.0, (1 / 3, 1 / 3)),),
    2: ((1 / 3, (1 / 6, 1 / 6)),),
    4: (
        ((620 + _TERM) / 3720, ((8 - _R10 + _SUB) / 18,) * 2),
        ((620 - _TERM) / 3720, ((8 - _R10 - _SUB) / 18,) * 2),
    ),
    5: (
        (9 / 40, (1 / 3, 1 / 3)),
        ((155 - _R15) / 1200, ((6 - _R15) / 21,) * 2),
        ((155 + _R15) / 1200, ((6 + _R15) / 21,) * 2),
    ),
    6: (
        (0.11678627572637936603, (0.24928674517091042129,) * 2),
        (0.050844906370206816921, (0.063089014491502227, 0.063089014491502227)),
        (0.082851075618373575194, (0.053145049844816947, 0.31035245103378440542)),
    ),
    8: (
        (0.14431560767778716825, (1 / 3, 1 / 3)),
        (0.095091634267284624793, (0.45929258829272315603, 0.45929258829272315603)),
        (0.10321737053471825028, (0.17056930775176020663, 0.17056930775176020663)),
        (0.032458497623198080310, (0.050547228317030975458, 0.050547228317030975458)),
        (0.027230314174434994264, (0.0083947774099576053372, 0.26311282963463811342)),
    ),
}
#: 2: Hammer, Marlowe and Stroud, 1956. 5: Walkington, 2000. 6: Keast, Comput. Methods Appl. Mech. Engrg. 55, 1986.
_TETRAHEDRA: dict[int, Orbits] = {
    1: ((1.0, (0.25, 0.25, 0.25)),),
    2: ((0.25, ((5 - np.sqrt(5.0)) / 20,) * 3),),
    5: (
        (0.11268792571801585080, (0.31088591926330060980,) * 3),
        (0.073493043116361949544, (0.092735250310891226402,) * 3),
        (0.042546020777081466438, (0.045503704125649649492, 0.045503704125649649492, 0.45449629587435035051)),
    ),
    6: (
        (0.039922750258167492, (0.21460287125915202, 0.21460287125915202, 0.21460287125915202)),
        (0.010077211055320643, (0.040673958534611353, 0.040673958534611353, 0.040673958534611353)),
        (0.055357181543654717, (0.32233789014227551, 0.32233789014227551, 0.32233789014227551)),
        (0.048214285714285714, (0.063661001875017525, 0.063661001875017525, 0.26967233145831581)),
    ),
}


def _gauss(degree: int, power: int = 0) -> QuadratureRule:
    """Points on [0, 1] and weights that include (1 - t)^power, exact to `degree` for the rest of the integrand."""
    t, w = np.polynomial.legendre.leggauss((degree + power) // 2 + 1)
    t, w = (t + 1) / 2, w / 2
    return t, w * (1 - t) ** power


#: by family, the degrees going up
_SYMMETRIC: dict[str, Mapping[int, Orbits]] = {"TRIA": _TRIANGLES, "TETRA": _TETRAHEDRA}


@cache
def rule(family: str, degree: int) -> QuadratureRule:
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
    for tabled, orbits in _SYMMETRIC.get(family, {}).items():
        if tabled >= degree:
            return _orbits(orbits)
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


def _orbits(orbits: Orbits) -> QuadratureRule:
    """Points and weights of a symmetric rule, from one point of each orbit."""
    points, weights = [], []
    for weight, first in orbits:
        places = sorted(set(permutations((*first, 1 - sum(first)))))
        places = [p for k, p in enumerate(places) if not k or not np.allclose(p, places[k - 1], rtol=0, atol=1e-12)]
        points += [p[:-1] for p in places]
        weights += [weight] * len(places)
    X = np.array(points)
    return X, np.array(weights) / (2 if X.shape[1] == 2 else 6)


def _product(rules: list[QuadratureRule]) -> QuadratureRule:
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


def signed_area(name: str, x: Any) -> NDArray[np.floating]:
    """(cells,): area of plane cells with nodes at x (cells, n_nodes, 3), positive if they are counter-clockwise.

    It is integrated along the cells' boundaries, exactly for concave cells and for the parabolas of quadratic cells.

    >>> dart = [[0, 0, 0], [4, 0, 0], [1, 1, 0], [0, 4, 0]]
    >>> signed_area("QUAD4", [dart, dart[::-1]]).tolist()
    [4.0, -4.0]
    """
    cell = CELLS[name]
    x = np.asarray(x, dtype=float)
    x = x[..., :2] - x[:, :1, :2]  # wherever they lie
    area = np.zeros(len(x))
    for k, (a, b) in enumerate(cell.edges):
        area += _turn(x[:, a], x[:, b]) / 2
        if cell.order == 2:
            area += 2 / 3 * _turn(x[:, cell.n_corners + k] - (x[:, a] + x[:, b]) / 2, x[:, b] - x[:, a])
    return area


def _turn(a: NDArray, b: NDArray) -> NDArray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
