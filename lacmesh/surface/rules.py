"""Quadrature on mortar segments (pieces): the choice of the rule for a piece, and its points.

A piece is a convex polygon in the slave's mean plane. The integrands are the shape functions of both faces and the gap,
which are polynomials in the plane if both faces are affine: then a rule of their degree is exact. Rules of degree 1 and
2 need no triangles: the centroid, and three points on the ellipse of inertia (every polygon has one that is exact to
degree 2, and inside every convex polygon: Kannan, Lovasz, Simonovits, Discrete Comput. Geom. 13, 1995). Higher rules
are used on a fan of triangles, which has its apex at the centroid where no rule is exact, as along normals that turn.

On general quadrangles the functions are no polynomials in the plane, and a rule that integrates them to 1e-10 needs a
hundred points per triangle. Here a few points are used, with weights corrected (`fit`) such that every function of both
faces, and of the heights over them, has its exact integral over the piece: what a rule left would depend on how the
piece is divided into triangles, and this on the last bits of coordinates.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.surface.maps import AFFINE, CURVED, FLAT, NEARLY_FLAT
from lacmesh.topology.skin import FACE_TYPES

Bools = NDArray[np.bool_]

CENTROID, ELLIPSE, FAN3, FAN6, FAN7, FAN12, FAN16, FAN30 = range(8)
#: added to the code of a rule whose weights are fitted, and of one on the fan around the centroid, which has no first
#: vertex: what it leaves of integrands that are no polynomials does not depend on how corners are numbered
FITTED, AROUND = 8, 16
#: degree that each rule is exact to
DEGREE = (1, 2, 2, 4, 5, 6, 8, 9)
#: degree of the shape functions of each type of face in its reference coordinates
FUNCTION_DEGREE = np.array(
    [{"POI1": 0, "SEG2": 1, "SEG3": 2, "TRIA3": 1, "TRIA6": 2, "TRIA7": 3, "QUAD4": 2, "QUAD8": 3}.get(t, 4)
     for t in FACE_TYPES]
)  # fmt: skip
#: how many functions of a type of face, beside the constant, a fit takes (moments.functions)
N_FUNCTIONS = np.array(
    [{"TRIA3": 2, "QUAD4": 3, "TRIA6": 5, "TRIA7": 7, "QUAD8": 7, "QUAD9": 8}.get(t, 1) for t in FACE_TYPES]
)
#: share of a fan that one triangle has almost alone, and that it may have where all are to count
_ALONE, _AMONG_OTHERS = 0.95, 0.8


class Placed(NamedTuple):
    """Points, one per row: piece, coordinates (n, 2) in both faces, weight, unit normal, gap; `met`: ray hits master.

    `first` (pieces + 1,): the first point of each piece, in the order in which they were placed.
    """

    first: Ints
    piece: Ints
    xi_slave: Floats
    xi_master: Floats
    weight: Floats
    normal: Floats
    gap: Floats
    met: Bools


class Fans(NamedTuple):
    """Rules on the triangles of a fan, one after the other: that of code k is in rows start[k] to start[k + 1].

    `X` (., 2) in the reference triangle; `w` (.,), of sum 1 for each rule.
    """

    X: Floats
    w: Floats
    start: Ints


@cache
def fan_rules() -> Fans:
    """Return all fan rules; those of CENTROID and ELLIPSE, which need no triangles, are empty."""
    table = [rule("TRIA", d) if k >= FAN3 else (np.empty((0, 2)), np.empty(0)) for k, d in enumerate(DEGREE)]
    start = np.cumsum([0, *(len(w) for _, w in table)])
    return Fans(np.concatenate([X for X, _ in table]), 2 * np.concatenate([w for _, w in table]), start)


class Sides(NamedTuple):
    """Properties of one side that determine the rules of pieces: type, and kind and warp of the faces (maps.kinds).

    `whole`: the patch is not half of a quadrangle with a re-entrant corner; `functions`: how many a fit takes.
    """

    type: Ints
    kind: Ints
    warp: Floats
    whole: Bools
    functions: Ints


def pair_rule(slave: Sides, master: Sides, vertices: Ints, share: Floats, turned: Floats, least: int = 0) -> Ints:
    """Choose the rules of pieces with the given numbers of vertices; return their codes.

    `share`: of the largest triangle in each piece's fan (if it is all of it, the points of the others do not count);
    `turned`: deviation of the normals from the slave face's own; `least`: degree that is exact in any case.
    """
    degree = np.maximum(np.maximum(FUNCTION_DEGREE[slave.type], FUNCTION_DEGREE[master.type]), least)
    code = np.where(degree <= 1, CENTROID, np.where(degree <= 2, ELLIPSE, FAN6))
    curved = (slave.kind == CURVED) | (master.kind == CURVED)
    bend = np.maximum(np.maximum(slave.warp, turned), np.where(master.kind == CURVED, master.warp, 0.0))
    bent = bend > np.where(curved, NEARLY_FLAT, FLAT)
    code = np.where(bent, np.where(degree <= 2, FAN6, FAN12), code)
    affine = (slave.kind == AFFINE) & (master.kind == AFFINE)
    fit = slave.whole & master.whole & ~affine
    fitted = _fitted(1 + slave.functions + master.functions, vertices, share)
    around = np.where(fit & ~curved, FITTED + AROUND, np.where(vertices > 3, AROUND, 0))
    return np.where(affine & ~bent, code, np.where(fit & ~bent, fitted, code + around))


def _fitted(functions: Ints, vertices: Ints, share: Floats) -> Ints:
    """Codes of fitted rules with at least as many points as functions, on the triangles that count."""
    single = share > _ALONE
    few = np.where((vertices > 4) & (share < _AMONG_OTHERS), FAN3, np.where(single, FAN7, FAN6))
    some = np.where(single, FAN12, FAN6)
    many = np.where(single, FAN30, FAN16)
    return np.where(functions <= 7, few, np.where(functions <= 11, some, many)) + FITTED


def points_of(code: Ints, vertices: Ints) -> Ints:
    """Number of points of rules, by their codes, on pieces with the given numbers of vertices."""
    each = np.diff(fan_rules().start)
    each[CENTROID], each[ELLIPSE] = 1, 3
    base = code % FITTED
    triangles = np.where(code >= AROUND, vertices, vertices - 2)
    return np.where(base <= ELLIPSE, each[base], each[base] * triangles)
