"""Compiled kernels for the default measures: the results of the plain modules, several times faster on many cells.

Both forms are needed: a million hexahedra take 0.9 s of processor time in these and 3.4 s in numpy, and a small mesh is
measured in numpy before the compiler's code is loaded, which takes 0.2 s.

A kernel reads points (n, 3) and nodes of cells (k, n_nodes), and fills out (k, m). Its docstring names the plain
function it reproduces, and a test compares them. Imported only for enough cells to pay for loading the compiler.

Notation as in the plain modules: a, b, c edges that leave a corner; det their determinant.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.kernels import kernel
from lacmesh.kernels.threads import in_threads
from lacmesh.quality.angles import GAUSS_AT, GAUSS_WEIGHT, corners_of
from lacmesh.quality.corner import IDEAL, frames
from lacmesh.quality.hexahedron import FRAMES, SIGNS
from lacmesh.quality.prism import CORNERS, IDEAL_ASPECT, SIDES
from lacmesh.quality.tetrahedron import AT_CORNER, EDGES, FACES
from lacmesh.quality.vectors import LARGEST, ROUND_OFF

_FRAMES, _SIGNS = np.array(FRAMES), np.array(SIGNS)
_AT_CORNER, _EDGES, _FACES = np.array(AT_CORNER), np.array(EDGES), np.array(FACES)
_CORNERS, _SIDES, _IDEAL_ASPECT = np.array(CORNERS), np.array(SIDES), float(IDEAL_ASPECT)
_HEXA_FACES = np.array([f.nodes for f in CELLS["HEXA8"].facets])
_LARGEST, _ROUND_OFF = float(LARGEST), float(ROUND_OFF)


@kernel
def _minus(p: Any, i: int, j: int) -> Any:
    return p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]


@kernel
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _cross(a: Any, b: Any) -> Any:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def _lengths(a: Any, b: Any, c: Any) -> Any:
    """The product of three lengths."""
    return math.sqrt(_dot(a, a)) * math.sqrt(_dot(b, b)) * math.sqrt(_dot(c, c))


@kernel
def _take(points: Any, nodes: Any, p: Any) -> None:
    """Write the coordinates of a cell's nodes (n,) into p (n, 3)."""
    for n in range(len(nodes)):
        for s in range(3):
            p[n, s] = points[nodes[n], s]


@kernel
def _hexa_volume(p: Any) -> Any:
    """Volume of a hexahedron, from cones with apex node 0 over triangles around the centres of the faces."""
    six = 0.0
    for f in range(6):
        mx = my = mz = 0.0
        for k in range(4):
            i = _HEXA_FACES[f, k]
            mx += (p[i, 0] - p[0, 0]) / 4
            my += (p[i, 1] - p[0, 1]) / 4
            mz += (p[i, 2] - p[0, 2]) / 4
        for k in range(4):
            a, b = _minus(p, _HEXA_FACES[f, k], 0), _minus(p, _HEXA_FACES[f, (k + 1) % 4], 0)
            six += _dot(_cross(a, b), (mx, my, mz))
    return six / 6


@kernel
def hexahedra(points: Any, nodes: Any, out: Any) -> None:
    """Write scaled_jacobian, condition, skew, shape and volume of `Hexahedron` into out (k, 5)."""
    p, X = np.empty((8, 3)), np.empty((3, 3))
    for cell in range(len(nodes)):
        _take(points, nodes[cell], p)
        _axes(p, X)
        a, b, c = (X[0, 0], X[0, 1], X[0, 2]), (X[1, 0], X[1, 1], X[1, 2]), (X[2, 0], X[2, 1], X[2, 2])
        product = _lengths(a, b, c)
        collapsed = not product > 0
        least, flattest, worst, longest = _dot(a, _cross(b, c)) / product, np.inf, 0.0, 0.0
        for f in range(8):
            i = _FRAMES[f, 0]
            a, b, c = _minus(p, _FRAMES[f, 1], i), _minus(p, _FRAMES[f, 2], i), _minus(p, _FRAMES[f, 3], i)
            bc, ca, ab = _cross(b, c), _cross(c, a), _cross(a, b)
            det, product = _dot(a, bc), _lengths(a, b, c)
            collapsed = collapsed or not product > 0
            least = min(least, det / product)
            longest = max(longest, _dot(a, a), _dot(b, b), _dot(c, c))
            if det > _ROUND_OFF * product:
                squares = _dot(a, a) + _dot(b, b) + _dot(c, c)
                minors = _dot(bc, bc) + _dot(ca, ca) + _dot(ab, ab)
                worst = max(worst, squares * minors / (det * det))
                flattest = min(flattest, (det / squares) * (det / squares) / squares)
            else:
                worst, flattest = np.inf, 0.0
        out[cell, 0] = _LARGEST if collapsed else least
        out[cell, 1] = min(math.sqrt(worst) / 3, _LARGEST)
        out[cell, 2] = _skew(X, math.sqrt(longest))
        out[cell, 3] = 3 * flattest ** (1 / 3)
        out[cell, 4] = _hexa_volume(p)


@kernel
def _axes(p: Any, X: Any) -> None:
    """Write the principal axes X (3, 3) of a hexahedron with nodes p (8, 3)."""
    X[:] = 0.0
    for n in range(8):
        for d in range(3):
            for s in range(3):
                X[d, s] += _SIGNS[n, d] * p[n, s]


@kernel
def _skew(X: Any, longest: float) -> Any:
    a, b, c = (X[0, 0], X[0, 1], X[0, 2]), (X[1, 0], X[1, 1], X[1, 2]), (X[2, 0], X[2, 1], X[2, 2])
    la, lb, lc = math.sqrt(_dot(a, a)), math.sqrt(_dot(b, b)), math.sqrt(_dot(c, c))
    if not min(la, lb, lc) > _ROUND_OFF * longest:
        return _LARGEST
    return max(abs(_dot(a, b)) / (la * lb), abs(_dot(b, c)) / (lb * lc), abs(_dot(c, a)) / (lc * la))


@kernel
def tetrahedra(points: Any, nodes: Any, out: Any) -> None:
    """Write scaled_jacobian, aspect_ratio, condition, shape and volume of `Tetrahedron` into out (k, 5)."""
    p = np.empty((4, 3))
    l = np.empty(6)  # noqa: E741
    for cell in range(len(nodes)):
        _take(points, nodes[cell], p)
        longest = 0.0
        for e in range(6):
            edge = _minus(p, _EDGES[e, 1], _EDGES[e, 0])
            l[e] = math.sqrt(_dot(edge, edge))
            longest = max(longest, l[e])
        product = 0.0
        for k in range(4):
            product = max(product, l[_AT_CORNER[k, 0]] * l[_AT_CORNER[k, 1]] * l[_AT_CORNER[k, 2]])
        area = 0.0
        for k in range(4):
            i = _FACES[k, 0]
            normal = _cross(_minus(p, _FACES[k, 1], i), _minus(p, _FACES[k, 2], i))
            area += math.sqrt(_dot(normal, normal)) / 2
        a, b, c = _minus(p, 1, 0), _minus(p, 2, 0), _minus(p, 3, 0)
        det = _dot(a, _cross(b, c))
        frobenius = 1.5 * (_dot(a, a) + _dot(b, b) + _dot(c, c)) - _dot(a, b) - _dot(b, c) - _dot(c, a)
        scale = max(product, abs(det))
        out[cell, 0] = math.sqrt(2) * det / scale if scale > 0 else _LARGEST
        out[cell, 4] = det / 6
        if not abs(det) > _ROUND_OFF * longest**3:
            out[cell, 1], out[cell, 2], out[cell, 3] = _LARGEST, _LARGEST, 0.0
            continue
        out[cell, 1] = min(longest * area / (math.sqrt(6) * abs(det)), _LARGEST)
        out[cell, 2] = _tetra_condition(a, b, c, det)
        out[cell, 3] = 3 * (2 * det * det) ** (1 / 3) / frobenius if det > 0 else 0.0


@kernel
def _tetra_condition(a: Any, b: Any, c: Any, det: float) -> Any:
    r, q = 1 / math.sqrt(3), 1 / math.sqrt(6)
    v = ((2 * b[0] - a[0]) * r, (2 * b[1] - a[1]) * r, (2 * b[2] - a[2]) * r)
    w = ((3 * c[0] - a[0] - b[0]) * q, (3 * c[1] - a[1] - b[1]) * q, (3 * c[2] - a[2] - b[2]) * q)
    squares = _dot(a, a) + _dot(v, v) + _dot(w, w)
    av, vw, wa = _cross(a, v), _cross(v, w), _cross(w, a)
    minors = _dot(av, av) + _dot(vw, vw) + _dot(wa, wa)
    return max(min(math.sqrt(squares * minors) / (3 * math.sqrt(2) * det), _LARGEST), -_LARGEST)


@kernel
def prisms(points: Any, nodes: Any, out: Any) -> None:
    """Write scaled_jacobian, condition, shape and volume of `Prism` into out (k, 4)."""
    p = np.empty((6, 3))
    for cell in range(len(nodes)):
        _take(points, nodes[cell], p)
        least, flattest, largest = np.inf, np.inf, 0.0
        for k in range(6):
            i = _CORNERS[k, 0]
            a, b, c = _minus(p, _CORNERS[k, 1], i), _minus(p, _CORNERS[k, 2], i), _minus(p, _CORNERS[k, 3], i)
            det = _dot(a, _cross(b, c))
            squares = _dot(a, a) + _dot(b, b) + _dot(c, c)
            lengths = _lengths(a, b, c)
            if lengths > 0:
                least = min(least, det / lengths)
            largest = max(largest, _tetra_aspect(a, b, c, det))
            some = 2 / math.sqrt(3) * det if det > _ROUND_OFF * squares**1.5 else 0.0
            flattest = min(flattest, 3 * np.cbrt(some) ** 2 / squares if squares > 0 else 0.0)
        out[cell, 0] = 2 / math.sqrt(3) * least if least < np.inf else -_LARGEST
        out[cell, 1] = max(largest / _IDEAL_ASPECT, 1.0) if largest < _LARGEST else _LARGEST
        out[cell, 2] = min(flattest, 1.0)
        out[cell, 3] = _prism_volume(p)


@kernel
def _tetra_aspect(a: Any, b: Any, c: Any, det: float) -> Any:
    """Compute `Tetrahedron.aspect_frobenius` from three edges and their determinant."""
    ab, bc, ca = _dot(a, b), _dot(b, c), _dot(c, a)
    aa, bb, cc = _dot(a, a), _dot(b, b), _dot(c, c)
    longest = max(max(aa, bb, cc), max(aa + bb - 2 * ab, bb + cc - 2 * bc, cc + aa - 2 * ca))
    if not abs(det) > _ROUND_OFF * longest**1.5:
        return _LARGEST
    return min((1.5 * (aa + bb + cc) - ab - bc - ca) / (3 * np.cbrt(math.sqrt(2) * det) ** 2), _LARGEST)


@kernel
def _prism_volume(p: Any) -> Any:
    """Volume of a prism, from cones with apex node 0 over the far triangle and triangles around the sides' centres."""
    six = _dot(_minus(p, 3, 0), _cross(_minus(p, 4, 0), _minus(p, 5, 0)))
    for f in range(3):
        x = y = z = 0.0
        for k in range(4):
            along = _minus(p, _SIDES[f, k], 0)
            x, y, z = x + along[0] / 4, y + along[1] / 4, z + along[2] / 4
        for k in range(4):
            a, b = _minus(p, _SIDES[f, k], 0), _minus(p, _SIDES[f, (k + 1) % 4], 0)
            six += _dot(_cross(a, b), (x, y, z))
    return six / 6


def corners(name: str, points: NDArray, nodes: NDArray) -> NDArray:
    """(k, 4): `corner_jacobian`, `edge_ratio`, then the least and the largest of `angles`, of cells of any type."""
    table, leaving = corners_of(name), frames(name)
    cell = CELLS[name]
    mid = cell.n_corners if cell.order == 2 else 0
    out = np.empty((len(nodes), 4))
    ways = table.dihedral if cell.dim == 3 else np.insert(table.angles, 0, -1, axis=1)
    in_threads(lambda part: _corners(points, nodes[part], table.edges, mid, leaving, ways, out[part]), len(nodes))
    out[:, 0] /= IDEAL[cell.family]
    out[:, 2:] = np.degrees(np.arccos(np.clip(out[:, 2:], -1, 1)))
    return out


@kernel
def _corners(points: Any, nodes: Any, edges: Any, mid: int, leaving: Any, ways: Any, out: Any) -> None:
    """Write least corner determinant, edge ratio, largest and least cosine of each cell into `out`.

    `mid`: index of the first edge's mid-node, 0 if edges are straight. `leaving`: the `frames` of the type.
    """
    t = np.empty((2 * len(edges), 3))
    for cell in range(len(nodes)):
        shortest, longest = np.inf, 0.0
        for e in range(len(edges)):
            i, j = nodes[cell, edges[e, 0]], nodes[cell, edges[e, 1]]
            for s in range(3):
                if mid:
                    middle = 4 * points[nodes[cell, mid + e], s]
                    t[2 * e, s] = middle - 3 * points[i, s] - points[j, s]
                    t[2 * e + 1, s] = middle - 3 * points[j, s] - points[i, s]
                else:
                    t[2 * e, s] = points[j, s] - points[i, s]
                    t[2 * e + 1, s] = -t[2 * e, s]
            length = _length(t, e, mid > 0)
            shortest, longest = min(shortest, length), max(longest, length)
        out[cell, 1] = longest / shortest if shortest > 0 else np.inf
        out[cell, 3], out[cell, 2] = _cosines(t, ways)
        for k in range(len(t)):
            length = math.sqrt(t[k, 0] ** 2 + t[k, 1] ** 2 + t[k, 2] ** 2)
            if length > 0:
                for s in range(3):
                    t[k, s] /= length
        out[cell, 0] = _least_volume(t, leaving) if leaving.shape[1] == 3 else _least_area(t, leaving)


@kernel
def _least_volume(t: Any, leaving: Any) -> Any:
    """Least determinant of the unit tangents t that leave a corner."""
    least = np.inf
    for k in range(len(leaving)):
        third = leaving[k, 2]
        normal = _normal(t, leaving[k, 0], leaving[k, 1])
        least = min(least, _dot(normal, (t[third, 0], t[third, 1], t[third, 2])))
    return least


@kernel
def _least_area(t: Any, leaving: Any) -> Any:
    """Least component along their mean of the normals at the corners, from unit tangents t."""
    x = y = z = 0.0
    for k in range(len(leaving)):
        normal = _normal(t, leaving[k, 0], leaving[k, 1])
        x, y, z = x + normal[0], y + normal[1], z + normal[2]
    size = math.sqrt(x * x + y * y + z * z)
    least = np.inf
    for k in range(len(leaving)):
        least = min(least, _dot(_normal(t, leaving[k, 0], leaving[k, 1]), (x, y, z)))
    return least / size if size > 0 else 0.0


@kernel
def _normal(t: Any, i: int, j: int) -> Any:
    return _cross((t[i, 0], t[i, 1], t[i, 2]), (t[j, 0], t[j, 1], t[j, 2]))


@kernel
def _length(t: Any, e: int, curved: bool) -> Any:
    if not curved:
        return math.sqrt(t[2 * e, 0] ** 2 + t[2 * e, 1] ** 2 + t[2 * e, 2] ** 2)
    length = 0.0
    for g in range(3):
        square = 0.0
        for s in range(3):
            square += ((1 - GAUSS_AT[g]) * t[2 * e, s] - GAUSS_AT[g] * t[2 * e + 1, s]) ** 2
        length += GAUSS_WEIGHT[g] * math.sqrt(square)
    return length


@kernel
def _cosines(t: Any, ways: Any) -> Any:
    """Least and largest cosine of the angles; NaN if there is none."""
    low, high = np.inf, -np.inf
    for w in range(len(ways)):
        e, i, j = ways[w, 0], ways[w, 1], ways[w, 2]
        a, b = (t[i, 0], t[i, 1], t[i, 2]), (t[j, 0], t[j, 1], t[j, 2])
        if e >= 0:
            along = (t[e, 0], t[e, 1], t[e, 2])
            a, b = _cross(along, a), _cross(along, b)
        square = _dot(a, a) * _dot(b, b)
        if square > 0:
            cosine = _dot(a, b) / math.sqrt(square)
            low, high = min(low, cosine), max(high, cosine)
    if high < low:
        return np.nan, np.nan
    return low, high
