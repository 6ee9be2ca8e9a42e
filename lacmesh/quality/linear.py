"""Verdict's measures of linear cells that reports and the check need: each once, for compiled and for plain use.

Stimpson et al., *The Verdict Library Reference Manual*, SAND2007-1751, 2007, and where it is silent the program (the
shapes of prism and pyramid). VTK computes all others (`by_vtk`). A kernel fills out (c, m) for cells with nodes (c, n)
among points (p, 3). As it stands it takes all cells at once, as points (n, 3, c), one
row of nodes and out (1, m, c), since Python is a hundred times slower cell by cell. A million hexahedra take 0.3 s
compiled and 3 s in numpy; a small mesh is measured in numpy before the compiler's code is loaded, which takes 0.2 s.

Notation: a, b, c edges that leave a corner, det their determinant, squares the sum of their squared lengths.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.quality.vectors import (
    LARGEST,
    ROUND_OFF,
    choose,
    corner_angle,
    cross,
    dot,
    edge,
    in_columns,
    minus,
    norm,
    over,
)

_ROOT_2, _ROOT_3, _ROOT_6 = math.sqrt(2), math.sqrt(3), math.sqrt(6)
_TETRA_EDGES = CELLS["TETRA4"].edges
_TETRA_FACES = tuple(facet.nodes for facet in CELLS["TETRA4"].facets)
#: each corner of a hexahedron and its neighbours, counted so that the cube's determinants are positive
HEXA_CORNERS = (
    *((0, 1, 3, 4), (1, 2, 0, 5), (2, 3, 1, 6), (3, 0, 2, 7)),
    *((4, 7, 5, 0), (5, 4, 6, 1), (6, 5, 7, 2), (7, 6, 4, 3)),
)
_HEXA_SIGNS = np.array(CELLS["HEXA8"].reference)
_HEXA_FACES = tuple(facet.nodes for facet in CELLS["HEXA8"].facets)
#: each corner of a prism, its two neighbours in the triangle, and that in the other triangle
_PRISM_CORNERS = ((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2))
_PRISM_SIDES = ((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
#: aspect_frobenius of the tetrahedron at a corner of the ideal prism, rounded as in Verdict
_PRISM_ASPECT = 1.16477
#: the four ways to take three corners of a pyramid's base, and the apex
_PYRAMID_TETRAHEDRA = ((0, 1, 2, 4), (0, 2, 3, 4), (0, 1, 3, 4), (1, 2, 3, 4))


@kernel
def _lengths(a: Any, b: Any, c: Any) -> Any:
    """Product of three lengths."""
    return norm(a) * norm(b) * norm(c)


@kernel
def _squares(a: Any, b: Any, c: Any) -> Any:
    """Sum of three squared lengths."""
    return dot(a, a) + dot(b, b) + dot(c, c)


@kernel
def _minors(a: Any, b: Any, c: Any) -> Any:
    """Sum of the squared minors of the matrix of three vectors."""
    return _squares(cross(b, c), cross(c, a), cross(a, b))


@kernel
def _bounded(value: Any) -> Any:
    """Value clipped to [-LARGEST, LARGEST]; NaN, where the definition is void, becomes LARGEST."""
    return choose(value == value, np.minimum(np.maximum(value, -LARGEST), LARGEST), LARGEST)


@kernel
def _triangle(a: Any, b: Any, c: Any) -> Any:
    """Measures of `triangles`, from the edges: one node to the next."""
    la, lb, lc = norm(a), norm(b), norm(c)
    longest, shortest = np.maximum(np.maximum(la, lb), lc), np.minimum(np.minimum(la, lb), lc)
    exact = norm(cross(a, c))  # twice the area
    twice = choose(exact > ROUND_OFF * longest**2, exact, 0.0)
    scaled = over(2 / _ROOT_3 * twice, np.maximum(np.maximum(la * lb, lb * lc), lc * la))
    aspect = _bounded(longest * (la + lb + lc) / (2 * _ROOT_3 * twice))
    condition = _bounded((la**2 + lb**2 + lc**2) / (2 * _ROOT_3 * twice))
    shape = choose(condition < LARGEST, 1 / condition, 0.0)
    at = corner_angle(c, a), corner_angle(a, b), corner_angle(b, c)
    low = choose(shortest > 0, np.minimum(np.minimum(at[0], at[1]), at[2]), 0.0)
    high = choose(shortest > 0, np.maximum(np.maximum(at[0], at[1]), at[2]), 0.0)
    return scaled, aspect, condition, shape, low, high, exact / 2


@kernel
def triangles(points: Any, nodes: Any, out: Any) -> None:
    """Write the measures of each TRIA3 into a row of `out`, in the order of `LINEAR`."""
    for cell in range(len(nodes)):
        row = nodes[cell]
        values = _triangle(edge(points, row, 0, 1), edge(points, row, 1, 2), edge(points, row, 2, 0))
        for k in range(7):
            out[cell, k] = values[k]


@kernel
def quadrangles(points: Any, nodes: Any, out: Any) -> None:
    """Write the measures of each QUAD4 into a row of `out`, in the order of `LINEAR`.

    Where the last two nodes coincide, some are those of the triangle, as in Verdict.
    """
    for cell in range(len(nodes)):
        row = nodes[cell]
        L = edge(points, row, 0, 1), edge(points, row, 1, 2), edge(points, row, 2, 3), edge(points, row, 3, 0)
        l = norm(L[0]), norm(L[1]), norm(L[2]), norm(L[3])  # noqa: E741
        longest = np.maximum(np.maximum(l[0], l[1]), np.maximum(l[2], l[3]))
        shortest = np.minimum(np.minimum(l[0], l[1]), np.minimum(l[2], l[3]))
        scaled, worst, least, area, low, high = np.inf, 0.0, np.inf, 0.0, np.inf, 0.0
        for c in range(4):
            alpha = _alpha(L, c)
            area = area + alpha / 4
            least = np.minimum(least, alpha)
            scaled = np.minimum(scaled, over(alpha, l[c - 1] * l[c]))
            condition = (l[c - 1] ** 2 + l[c] ** 2) / (2 * alpha)
            worst = np.maximum(worst, choose(alpha > ROUND_OFF * longest**2, condition, np.inf))
            at = corner_angle(L[c - 1], L[c])
            low, high = np.minimum(low, at), np.maximum(high, at)
        some = choose(np.abs(area) > ROUND_OFF * longest**2, area, 0.0)
        aspect = longest * (l[0] + l[1] + l[2] + l[3]) / (4 * some)
        high = choose(least < 0, 360 - high, high)
        triangle, collapsed = _triangle(L[0], L[1], edge(points, row, 2, 0)), l[2] == 0
        X, Y = minus(L[0], L[2]), minus(L[1], L[3])
        out[cell, 0] = choose(collapsed, triangle[0], scaled)
        out[cell, 1] = choose(aspect == aspect, _bounded(aspect), -LARGEST)  # a point: 0 / 0
        out[cell, 2] = choose(collapsed, triangle[2], _bounded(worst))
        out[cell, 3] = over(np.abs(dot(X, Y)), norm(X) * norm(Y))
        out[cell, 4] = _quad_shape(L)
        out[cell, 5] = _warpage(L)
        out[cell, 6] = choose(collapsed, triangle[4], choose(shortest > 0, low, 360.0))
        out[cell, 7] = choose(collapsed, triangle[5], choose(shortest > 0, high, 0.0))
        out[cell, 8] = area


@kernel
def _alpha(L: Any, c: int) -> Any:
    """Component, along the normal at the centre, of the product of the edges at a corner; L: the edges in a circle."""
    centre = cross(minus(L[0], L[2]), minus(L[1], L[3]))
    size = norm(centre)  # divided by before the product, as in Verdict: of an angle of 180 degrees round-off decides
    return dot((over(centre[0], size), over(centre[1], size), over(centre[2], size)), cross(L[c - 1], L[c]))


@kernel
def _quad_shape(L: Any) -> Any:
    """2 alpha over the sum of the squared edges, the least over the corners; 0 where it is negative."""
    least = np.inf
    for c in range(4):
        least = np.minimum(least, over(2 * _alpha(L, c), dot(L[c - 1], L[c - 1]) + dot(L[c], L[c])))
    return choose(least > ROUND_OFF, least, 0.0)


@kernel
def _warpage(L: Any) -> Any:
    """Cubed cosine of the angle between the normals at opposite corners, the lesser of both."""
    p, q, r, s = cross(L[3], L[0]), cross(L[0], L[1]), cross(L[1], L[2]), cross(L[2], L[3])
    one, other = norm(p) * norm(r), norm(q) * norm(s)
    return choose(np.minimum(one, other) > 0, np.minimum(dot(p, r) / one, dot(q, s) / other) ** 3, ROUND_OFF)


@kernel
def tetrahedra(points: Any, nodes: Any, out: Any) -> None:
    """Write the measures of each TETRA4 into a row of `out`, in the order of `LINEAR`."""
    for cell in range(len(nodes)):
        row = nodes[cell]
        longest, area = 0.0, 0.0
        for i, j in _TETRA_EDGES:
            longest = np.maximum(longest, norm(edge(points, row, i, j)))
        for i, j, k in _TETRA_FACES:
            area = area + norm(cross(edge(points, row, i, j), edge(points, row, i, k))) / 2
        a, b, c = edge(points, row, 0, 1), edge(points, row, 0, 2), edge(points, row, 0, 3)
        det = dot(a, cross(b, c))
        some = choose(np.abs(det) > ROUND_OFF * longest**3, det, 0.0)
        out[cell, 0] = _bounded(_tetra_scaled(a, b, c))
        out[cell, 1] = _bounded(longest * area / (_ROOT_6 * np.abs(some)))
        out[cell, 2] = _tetra_condition(a, b, c, some)
        out[cell, 3] = choose(some > 0, 3 * np.cbrt(2 * some * some) / _tetra_norm(a, b, c), 0.0)
        out[cell, 4] = det / 6


@kernel
def _tetra_norm(a: Any, b: Any, c: Any) -> Any:
    """Two thirds of the squared Frobenius norm of the map from the regular tetrahedron."""
    return 1.5 * _squares(a, b, c) - dot(a, b) - dot(b, c) - dot(c, a)


@kernel
def _tetra_scaled(a: Any, b: Any, c: Any) -> Any:
    """Determinant over the largest product of three edges at a corner, times sqrt(2); NaN for a point."""
    u, v, w = minus(b, a), minus(c, b), minus(a, c)
    det = dot(a, cross(b, c))
    most = np.maximum(
        np.maximum(_lengths(a, b, c), _lengths(a, u, w)), np.maximum(_lengths(b, u, v), _lengths(c, v, w))
    )
    return _ROOT_2 * det / np.maximum(most, np.abs(det))


@kernel
def _tetra_condition(a: Any, b: Any, c: Any, det: Any) -> Any:
    """Condition number, in the Frobenius norm, of the map from the regular tetrahedron; negative if inverted."""
    r, q = 1 / _ROOT_3, 1 / _ROOT_6
    v = (2 * b[0] - a[0]) * r, (2 * b[1] - a[1]) * r, (2 * b[2] - a[2]) * r
    w = (3 * c[0] - a[0] - b[0]) * q, (3 * c[1] - a[1] - b[1]) * q, (3 * c[2] - a[2] - b[2]) * q
    return _bounded(np.sqrt(_squares(a, v, w) * _minors(a, v, w)) / (3 * _ROOT_2 * det))


@kernel
def _tetra_aspect(a: Any, b: Any, c: Any, det: Any) -> Any:
    """Frobenius norm of the map from the regular tetrahedron, its determinant brought to 1."""
    u, v, w = minus(b, a), minus(c, b), minus(a, c)
    longest = np.maximum(np.maximum(dot(a, a), dot(b, b)), np.maximum(dot(c, c), dot(u, u)))
    longest = np.sqrt(np.maximum(longest, np.maximum(dot(v, v), dot(w, w))))
    some = choose(np.abs(det) > ROUND_OFF * longest**3, det, 0.0)
    return _bounded(_tetra_norm(a, b, c) / (3 * np.cbrt(_ROOT_2 * some) ** 2))


@kernel
def hexahedra(points: Any, nodes: Any, out: Any) -> None:
    """Write the measures of each HEXA8 into a row of `out`, in the order of `LINEAR`."""
    for cell in range(len(nodes)):
        row = nodes[cell]
        X, Y, Z = _axis(points, row, 0), _axis(points, row, 1), _axis(points, row, 2)
        least = dot(X, cross(Y, Z)) / _lengths(X, Y, Z)
        worst, flattest, longest, six = 0.0, np.inf, 0.0, 0.0
        for i, j, k, m in HEXA_CORNERS:
            a, b, c = edge(points, row, i, j), edge(points, row, i, k), edge(points, row, i, m)
            det, product, squares = dot(a, cross(b, c)), _lengths(a, b, c), _squares(a, b, c)
            least = np.minimum(least, det / product)  # NaN where an edge has no length
            longest = np.maximum(np.maximum(longest, dot(a, a)), np.maximum(dot(b, b), dot(c, c)))
            some = det > ROUND_OFF * product
            worst = np.maximum(worst, choose(some, squares * _minors(a, b, c) / (det * det), np.inf))
            flattest = np.minimum(flattest, choose(some, (det / squares) * (det / squares) / squares, 0.0))
        for face in _HEXA_FACES:
            six = six + _cones(points, row, 0, face)
        out[cell, 0] = _bounded(least)
        out[cell, 1] = _bounded(np.sqrt(worst) / 3)
        out[cell, 2] = _skew(X, Y, Z, np.sqrt(longest))
        out[cell, 3] = 3 * np.cbrt(flattest)
        out[cell, 4] = six / 6


@kernel
def _axis(points: Any, row: Any, d: int) -> Any:
    """Principal axis of a hexahedron: from face to face through the centre, four times as long."""
    x, y, z = 0.0, 0.0, 0.0
    for n in range(8):
        p, sign = row[n], _HEXA_SIGNS[n, d]
        x, y, z = x + sign * points[p, 0], y + sign * points[p, 1], z + sign * points[p, 2]
    return x, y, z


@kernel
def _skew(X: Any, Y: Any, Z: Any, longest: Any) -> Any:
    """Largest cosine between two principal axes, without its sign; LARGEST where one has no length."""
    x, y, z = norm(X), norm(Y), norm(Z)
    most = np.maximum(np.abs(dot(X, Y)) / (x * y), np.abs(dot(Y, Z)) / (y * z))
    most = np.maximum(most, np.abs(dot(Z, X)) / (z * x))
    return choose(np.minimum(np.minimum(x, y), z) > ROUND_OFF * longest, most, LARGEST)


@kernel
def _cones(points: Any, row: Any, apex: int, face: Any) -> Any:
    """Six times the volume of the cones over the triangles around the centre of a face of four nodes."""
    a, b = edge(points, row, apex, face[0]), edge(points, row, apex, face[1])
    c, d = edge(points, row, apex, face[2]), edge(points, row, apex, face[3])
    middle = (a[0] + b[0] + c[0] + d[0]) / 4, (a[1] + b[1] + c[1] + d[1]) / 4, (a[2] + b[2] + c[2] + d[2]) / 4
    return dot(cross(minus(c, a), minus(d, b)), middle)


@kernel
def prisms(points: Any, nodes: Any, out: Any) -> None:
    """Write the measures of each PENTA6 into a row of `out`, in the order of `LINEAR`.

    `shape` is 1 for the right prism on an equilateral triangle, and less for every other, but not always a good
    criterion: it compares the volume with the lengths of the edges, without their directions.
    """
    for cell in range(len(nodes)):
        row = nodes[cell]
        least, flattest, largest = np.inf, np.inf, 0.0
        for i, j, k, m in _PRISM_CORNERS:
            a, b, c = edge(points, row, i, j), edge(points, row, i, k), edge(points, row, i, m)
            det, squares = dot(a, cross(b, c)), _squares(a, b, c)
            least = np.fmin(least, det / _lengths(a, b, c))  # of the corners that have edges
            largest = np.maximum(largest, _tetra_aspect(a, b, c, det))
            some = choose(det > ROUND_OFF * squares**1.5, 2 / _ROOT_3 * det, 0.0)
            flattest = np.minimum(flattest, over(3 * np.cbrt(some) ** 2, squares))
        six = dot(edge(points, row, 0, 3), cross(edge(points, row, 0, 4), edge(points, row, 0, 5)))
        for face in _PRISM_SIDES:
            six = six + _cones(points, row, 0, face)
        out[cell, 0] = choose(least < np.inf, 2 / _ROOT_3 * least, -LARGEST)
        out[cell, 1] = choose(largest < LARGEST, np.maximum(largest / _PRISM_ASPECT, 1.0), LARGEST)
        out[cell, 2] = np.minimum(flattest, 1.0)
        out[cell, 3] = six / 6


@kernel
def pyramids(points: Any, nodes: Any, out: Any) -> None:
    """Write the measures of each PYRAM5 into a row of `out`, in the order of `LINEAR`.

    Verdict takes the direction of the base from the corner of node 0, and limits the length of the edge 0-1 to that of
    the edge 1-2: the shape depends on the order in which the cell lists its nodes.
    """
    for cell in range(len(nodes)):
        row = nodes[cell]
        least = np.inf
        for i, j, k, m in _PYRAMID_TETRAHEDRA:
            a, b, c = edge(points, row, i, j), edge(points, row, i, k), edge(points, row, i, m)
            least = np.fmin(least, _tetra_scaled(a, b, c))
        least = _ROOT_2 * np.maximum(least, 0.0)
        L = edge(points, row, 0, 1), edge(points, row, 1, 2), edge(points, row, 2, 3), edge(points, row, 3, 0)
        longest, axis = np.minimum(norm(L[0]), norm(L[1])), (0.0, 0.0, 0.0)
        longest = np.maximum(longest, np.maximum(norm(L[2]), norm(L[3])))
        for n in range(4):
            side = edge(points, row, n, 4)
            longest = np.maximum(longest, norm(side))
            axis = axis[0] + side[0] / 4, axis[1] + side[1] / 4, axis[2] + side[2] / 4
        normal, base, ideal = cross(L[3], L[0]), _quad_shape(L), longest / _ROOT_2
        height = dot(axis, normal) / norm(normal)
        shape = base * height / norm(axis) * np.minimum(height / ideal, ideal / height)
        out[cell, 0] = _bounded(np.minimum(least, 2 - least))
        out[cell, 1] = choose(height > 0, choose(base > 0, shape, 0.0), 0.0)
        out[cell, 2] = -_cones(points, row, 4, (0, 1, 2, 3)) / 6


#: type -> its kernel, and the measures in the columns that it fills, in the order of a report
LINEAR: Mapping[str, tuple[Any, tuple[str, ...]]] = MappingProxyType(
    {
        "TRIA3": (
            triangles,
            ("scaled_jacobian", "aspect_ratio", "condition", "shape", "min_angle", "max_angle", "area"),
        ),
        "QUAD4": (
            quadrangles,
            (
                *("scaled_jacobian", "aspect_ratio", "condition", "skew", "shape", "warpage"),
                *("min_angle", "max_angle", "area"),
            ),
        ),
        "TETRA4": (tetrahedra, ("scaled_jacobian", "aspect_ratio", "condition", "shape", "volume")),
        "HEXA8": (hexahedra, ("scaled_jacobian", "condition", "skew", "shape", "volume")),
        "PENTA6": (prisms, ("scaled_jacobian", "condition", "shape", "volume")),
        "PYRAM5": (pyramids, ("scaled_jacobian", "shape", "volume")),
    }
)


def linear_measures(name: str, points: Floats, nodes: Ints) -> dict[str, NDArray]:
    """Return the default measures of Verdict, (c,) each, of cells of a linear type."""
    fill, names = LINEAR[name]
    return dict(zip(names, in_columns(fill, points, nodes, len(names)), strict=True))
