"""Quadrature for elasticity: the rule of every type of cell, chosen so that three conditions hold.

1. The patch test is passed on any cell, distorted or curved: int dN_a/dx dV is exact. With x = sum N_a x_a and J the
   derivative of that map, it is int cof(J) dN_a dX, a polynomial even where dN_a/dx is not.
2. The stiffness of an affine cell is exact.
3. A single cell has no modes without energy except its rigid-body modes.

Degrees of cof(J) dN (1.) and dN dN (2.) in each reference coordinate; on TRIA and TETRA in all of them together, on
PENTA in the triangle and along the axis. In axisymmetry r multiplies both, and N det(J) (the hoop strain) comes in.

| cells | 1. | 2. | rule: points |
|---|---|---|---|
| TRIA3, TETRA4 | 0 | 0 | degree 1: 1; TRIA3 in axisymmetry degree 2: 3, for point 3. |
| TRIA6 | 2 | 2 | degree 2: 3; in axisymmetry 4: 6 |
| TRIA7 | 4 | 4 | degree 4: 6; in axisymmetry 7: 16 |
| TETRA10 | 3 | 2 | degree 3: 8 |
| QUAD4, HEXA8 | 2 | 2 | Gauss 2 each way |
| QUAD8, QUAD9, HEXA20, HEXA27 | 3, 5 | 4 | Gauss 3 each way |
| PENTA6 | 1, 2 | 2, 2 | degree 2 x Gauss 2: 6 |
| PENTA15, PENTA18 | 4, 5 | 4, 4 | degree 4 x Gauss 3: 18 |
| PYRAM5 | 2, 2, 0 | 2, 2, 0 | Gauss 2, 2, Gauss-Jacobi 1: 4 |
| PYRAM13, PYRAM14 | 5, 5, 3 | 4, 4, 2 | Gauss 3, 3, Gauss-Jacobi 2: 18 |

Pyramids: in u = x / (1 - z), v = y / (1 - z), z the gradients of the rational functions of `lacmesh.reference.shapes`
are polynomials (of xy / (1 - z): v, u, uv; of x^2 y^2 / (1 - z)^2: 2 u v^2 (1 - z), 2 u^2 v (1 - z),
2 u^2 v^2 (1 - z)), and the volume element is (1 - z)^2, which Gauss-Jacobi takes as its weight. So the integrals are
exact where the rules of polynomials on x, y, z are not at any order.
"""

from __future__ import annotations

from functools import cache
from itertools import permutations

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import QuadratureRule, rule

#: degree asked of `lacmesh.reference.quadrature.rule`: (plane or solid, axisymmetric)
_DEGREE = {
    "TRIA3": (1, 2),
    "TRIA6": (2, 4),
    "TRIA7": (4, 7),
    "QUAD4": (2, 2),
    "QUAD8": (4, 4),
    "QUAD9": (4, 4),
    "TETRA4": (1, 1),
    "HEXA8": (2, 2),
    "HEXA20": (4, 4),
    "HEXA27": (4, 4),
    "PENTA6": (2, 2),
    "PENTA15": (4, 4),
    "PENTA18": (4, 4),
}
#: Gauss points along u and v, Gauss-Jacobi points along z
_PYRAMID = {"PYRAM5": (2, 1), "PYRAM13": (3, 2), "PYRAM14": (3, 2)}
#: points z on [0, 1] and weights of the Gauss-Jacobi rule with weight (1 - z)^2: roots of z - 1/4, z^2 - 2/3 z + 1/15
_ROOT = 2 / 45
_JACOBI = {
    1: ((1 / 4,), (1 / 3,)),
    2: ((1 / 3 - _ROOT**0.5, 1 / 3 + _ROOT**0.5), (1 / 6 + 1 / (72 * _ROOT**0.5), 1 / 6 - 1 / (72 * _ROOT**0.5))),
}
#: degree 3: orbits (coordinate, weight of a point). Walkington, Quadrature on simplices of arbitrary dimension, 2000
_TETRA10 = ((0.328163302516381705, 0.136217842537087417), (0.108047249898428621, 0.113782157462912583))

#: cells that can carry displacements, in the order of the table
SOLID_CELLS = (*_DEGREE, "TETRA10", *_PYRAMID)


@cache
def cell_rule(name: str, axisymmetric: bool = False) -> QuadratureRule:
    """Points (q, dim) and weights (q,) that integrate the stiffness of cell type `name`; see the module's table.

    >>> len(cell_rule("HEXA8")[1]), len(cell_rule("TRIA3")[1]), len(cell_rule("TRIA3", axisymmetric=True)[1])
    (8, 1, 3)
    """
    if name in _PYRAMID:
        return _pyramid(*_PYRAMID[name])
    if name == "TETRA10":
        return _eight_points()
    return rule(CELLS[name].family, _DEGREE[name][axisymmetric])


def _pyramid(across: int, up: int) -> QuadratureRule:
    """Return a product rule in (u, v, z), whose weight along z is (1 - z)^2."""
    u, wu = np.polynomial.legendre.leggauss(across)
    z, wz = (np.array(values) for values in _JACOBI[up])
    Z, U, V = (axis.ravel() for axis in np.meshgrid(z, u, u, indexing="ij"))
    w = (wz[:, None, None] * wu[:, None] * wu).ravel()
    return np.stack([U * (1 - Z), V * (1 - Z), Z], axis=1), w


def _eight_points() -> QuadratureRule:
    points, weights = [], []
    for a, weight in _TETRA10:
        places = sorted(set(permutations((a, a, a, 1 - 3 * a))))
        points += [place[:3] for place in places]
        weights += [weight / 6] * len(places)
    return np.array(points), np.array(weights)
