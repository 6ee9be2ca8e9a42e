"""Quadrature on pieces: which rule a piece takes, and its points.

A piece is a convex polygon in the slave's mean plane. What is integrated there are the shape functions of either face
and the gap, all polynomials in the plane where both faces are affine: then a rule of their degree is exact. Rules of
degree 1 and 2 need no triangles: the centroid; and three points on the ellipse of inertia (any polygon has one that is
exact to degree 2, and it lies inside every convex one: Kannan, Lovasz, Simonovits, Discrete Comput. Geom. 13, 1995).
Higher ones go on the fan of triangles.

On general quadrangles the functions are no polynomials in the plane, and a rule that integrates them to 1e-10 needs a
hundred points a triangle. Here a few points take weights that are corrected (`fit`) so that every function of both
faces has its exact integral over the piece; how many points on the edges give those integrals is `edge_step`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.quadrature import rule
from lacmesh.skin import FACE_TYPES
from lacmesh.surface.maps import AFFINE, CURVED

CENTROID, ELLIPSE, FAN3, FAN6, FAN12, FAN16, FAN30 = range(7)
#: added to the code of a rule whose weights are fitted
FITTED = 8
#: degree that each rule is exact to
DEGREE = (1, 2, 2, 4, 6, 8, 9)
#: degree of the shape functions of each type of face in its reference coordinates
FUNCTION_DEGREE = np.array(
    [{"POI1": 0, "SEG2": 1, "SEG3": 2, "TRIA3": 1, "TRIA6": 2, "TRIA7": 3, "QUAD4": 2}.get(t, 4) for t in FACE_TYPES]
)
FUNCTION_DEGREE[FACE_TYPES.index("QUAD8")] = 3
#: how many functions of a type of face, beside the constant, a fit takes (fit.functions)
N_FUNCTIONS = np.array(
    [{"TRIA3": 2, "QUAD4": 3, "TRIA6": 5, "TRIA7": 7, "QUAD8": 7, "QUAD9": 8}.get(t, 1) for t in FACE_TYPES]
)
#: share of a fan that one triangle has almost alone
_ALL = 0.95
#: distortion up to which so many Gauss points an edge do (measured: tests/surface/test_rules.py)
_EDGE_STEPS = np.array([0.03, 0.1, 0.25, 0.4, 0.55, 0.7])
EDGE_POINTS = np.array([4, 6, 8, 10, 12, 16, 24])
#: Gauss points from the middle of a piece to its edges: QUAD4 with straight sides; anything
RADIAL_POINTS = (3, 6)


def triangle_rule(code: int) -> tuple[Floats, Floats]:
    """Points (p, 2) and weights (p,), of sum 1, of a fan rule on the reference triangle."""
    X, w = rule("TRIA", DEGREE[code])
    return X, 2 * w


def pair_rule(
    type_s: Ints,
    kind_s: Ints,
    plane_s: NDArray,
    type_m: Ints,
    kind_m: Ints,
    plane_m: NDArray,
    share: Floats,
    smooth: bool,
) -> Ints:
    """Codes of the rules of pieces, from the types, kinds (maps.kinds) and planeness of both faces, a row each piece.

    `share`: of the largest triangle in each piece's fan (where it is all, points of the others count for nothing); `smooth`: whether normals are smoothed, and so vary over plane faces.
    """
    degree = np.maximum(FUNCTION_DEGREE[type_s], FUNCTION_DEGREE[type_m])
    code = np.where(degree <= 1, CENTROID, np.where(degree <= 2, ELLIPSE, FAN6))
    bent = ~plane_s | smooth | ((kind_m == CURVED) & ~plane_m)
    code = np.where(bent, np.where(degree <= 2, FAN6, FAN12), code)
    fit = ~bent & ((kind_s > AFFINE) | (kind_m > AFFINE))
    # as many points as functions, and half as many again
    functions = 1 + N_FUNCTIONS[type_s] + N_FUNCTIONS[type_m]
    single = share > _ALL
    code = np.where(fit & (functions <= 7), np.where(single, FAN6, FAN3), code)
    code = np.where(fit & (functions > 7), np.where(single, FAN16, FAN12), code)
    code = np.where(fit & (functions > 11), np.where(single, FAN30, FAN16), code)
    return code + FITTED * fit


def points_of(code: Ints, vertices: Ints) -> Ints:
    """How many points the rules of pieces with so many vertices have."""
    base = code % FITTED
    each = np.array([1, 3, *(len(triangle_rule(k)[1]) for k in range(FAN3, FAN30 + 1))])[base]
    return np.where(base <= ELLIPSE, each, each * (vertices - 2))


def edge_step(distortion: Floats) -> Ints:
    """Which of EDGE_POINTS give the integrals of faces so distorted over a piece to 1e-12 of the face."""
    return np.searchsorted(_EDGE_STEPS, distortion)
