"""Local fits: the curvature of the skin at each node, from the nodes of two rings around it, or three.

In the frame of a node's normal n, a neighbour at d has the height z = d.n and the position |d| (d_t / |d_t|), with d_t
its tangential part: with the length of the chord in place of that of its projection, z = -|d|^2 / 2R holds exactly on a
sphere, and on a circle in the plane, for every |d|. z is fitted by a polynomial without a constant term, neighbours are
weighted with 1 / |d|, and the frame is rotated to the fitted normal. The fit gives the second derivatives at the node:
terms of third and fourth order, where there are enough neighbours, keep these free of the skin's own terms of such
order.
"""

from __future__ import annotations

import itertools
from math import factorial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints

Bools = NDArray[np.bool_]

#: rounds of turning the frame
_ROUNDS = 3
#: least number of neighbours for a polynomial of degree 2, 3 and 4, in the plane and in space
LEAST = {1: (2, 3, 4), 2: (5, 12, 20)}
#: a third ring is taken in where two have fewer neighbours than this, by the degree that is wanted
ENOUGH = {1: {2: 2, 4: 4}, 2: {2: 5, 4: 24}}
#: penalty on the derivatives of order 1 to 4, per neighbour. That on the second makes the skin straight where
#: neighbours cannot tell curvature from slope (a strip of one row of faces); a larger one on the third and fourth makes
#: these give way to the second; the first has as much as keeps the matrix regular
_PENALTY = (1e-24, 1e-10, 1e-5, 1e-5)
#: nodes that are fitted at once
_PIECE = 8192


class Rings(NamedTuple):
    """Neighbours of nodes: those of node i are neighbour[start[i]:start[i + 1]]."""

    start: Ints
    neighbour: Ints

    def of(self, i: int) -> Ints:
        """The neighbours of one node."""
        return self.neighbour[self.start[i] : self.start[i + 1]]


class LocalFits(NamedTuple):
    """Fits at nodes: `normal` (n, 3), second derivatives `H` (n, 3, 3) of the height along it, `known` (n,): fitted."""

    normal: Floats
    H: Floats
    known: Bools


def rings_of(node: Ints, n_nodes: int, wanted: Bools, least: int) -> tuple[Rings, Rings]:
    """Return the nodes of one ring, and those of two, around the nodes `wanted` (n,), on faces with nodes (f, 4).

    Three rings are used where two have fewer nodes than `least`.
    """
    if not wanted.any():  # as of flat skins, which are most
        none = Rings(np.zeros(n_nodes + 1, np.int32), np.zeros(0, np.int32))
        return none, none
    from scipy.sparse import csr_matrix

    rows, columns = [], []
    for a in range(node.shape[1]):
        for b in range(node.shape[1]):
            both = (node[:, a] >= 0) & (node[:, b] >= 0) & (a != b)
            rows.append(node[both, a])
            columns.append(node[both, b])
    i, j = np.concatenate(rows), np.concatenate(columns)
    one = csr_matrix((np.ones(len(i), np.int32), (i, j)), shape=(n_nodes, n_nodes))
    one.data[:] = 1
    mine = csr_matrix(one.multiply(wanted[:, None]))
    two = _without_self(mine + mine @ one)
    few = (np.diff(two.indptr) < least) & wanted
    if few.any():
        two = _without_self(two + csr_matrix(two.multiply(few[:, None])) @ one)
    return Rings(mine.indptr, mine.indices), Rings(two.indptr, two.indices)


def _without_self(graph: Any) -> Any:
    """Remove from a graph the edges from nodes to themselves."""
    graph = graph.tocoo()
    apart = graph.row != graph.col
    from scipy.sparse import csr_matrix

    return csr_matrix((np.ones(int(apart.sum()), np.int32), (graph.row[apart], graph.col[apart])), shape=graph.shape)


def local_fits(x: Floats, normal: Floats, rings: Rings, dim: int, degree: int = 4) -> LocalFits:
    """Fit at nodes x (n, 3), with initial normals (n, 3), by polynomials of this degree at most."""
    count = np.diff(rings.start)
    highest = 1 + np.searchsorted(LEAST[dim], count, side="right")
    normal, H = normal.copy(), np.zeros((len(x), 3, 3))
    for last in range(2, degree + 1):
        rows = np.flatnonzero(np.minimum(highest, degree) == last)
        for first in range(0, len(rows), _PIECE):
            some = rows[first : first + _PIECE]
            begin = np.cumsum(count[some]) - count[some]
            pair = np.arange(count[some].sum()) + np.repeat(rings.start[some] - begin, count[some])
            d = x[rings.neighbour[pair]] - np.repeat(x[some], count[some], axis=0)
            for one in (*[2] * (_ROUNDS - 1), last):
                normal[some], H[some] = _fitted(d, normal[some], count[some], begin, dim, one)
    return LocalFits(normal, H, highest > 1)


def _fitted(d: Floats, normal: Floats, count: Ints, begin: Ints, dim: int, degree: int) -> tuple[Floats, Floats]:
    """Fit once: normals (n, 3) and second derivatives (n, 3, 3) from neighbours at relative positions d (p, 3)."""
    frame = _frames(normal, dim)
    each = np.repeat(frame, count, axis=0)
    z = np.einsum("ps,ps->p", d, np.repeat(normal, count, axis=0))
    length = np.linalg.norm(d, axis=1)
    shadow = np.einsum("ps,pks->kp", d, each)
    across = np.linalg.norm(shadow, axis=0)
    shadow *= np.divide(length, across, out=np.zeros_like(length), where=across > 0)
    size = np.add.reduceat(length, begin) / count
    size = np.where(size > 0, size, 1.0)
    scale = np.repeat(size, count)
    u, z = shadow / scale, z / scale
    w = np.divide(scale, length, out=np.zeros_like(length), where=length > 0) ** 2
    powers = _powers(dim, degree)
    columns = [np.prod([u[k] ** p / factorial(p) for k, p in enumerate(one)], axis=0) for one in powers]
    m = len(powers)
    A, rhs = np.empty((len(count), m, m)), np.empty((len(count), m))
    for i in range(m):
        weighted = w * columns[i]
        rhs[:, i] = np.add.reduceat(weighted * z, begin)
        for j in range(i + 1):
            A[:, i, j] = A[:, j, i] = np.add.reduceat(weighted * columns[j], begin)
    for i, one in enumerate(powers):
        often = factorial(sum(one)) / np.prod([factorial(p) for p in one])  # so that it does not hang on the frame
        A[:, i, i] += count * often * _PENALTY[sum(one) - 1] + 1e-300
    c = np.linalg.solve(A, rhs[:, :, None])[:, :, 0]
    turned = normal - np.einsum("nk,nks->ns", c[:, :dim], frame)
    H = np.zeros((len(count), 3, 3))
    for i, one in enumerate(powers):
        if sum(one) == 2:
            a, b = np.repeat(np.arange(dim), one)
            both = np.einsum("n,ni,nj->nij", c[:, i] / size, frame[:, a], frame[:, b])
            H += both if a == b else both + np.swapaxes(both, 1, 2)
    return turned / np.linalg.norm(turned, axis=1, keepdims=True), H


def _powers(dim: int, degree: int) -> list[tuple[int, ...]]:
    """Powers of u, or of u and v, in the terms of a polynomial without constant term, sorted by degree."""
    every = itertools.product(range(degree, -1, -1), repeat=dim)
    return sorted((one for one in every if 0 < sum(one) <= degree), key=sum)


def _frames(normal: Floats, dim: int) -> Floats:
    """(n, dim, 3): tangents perpendicular to normals (n, 3)."""
    if dim == 1:
        return np.stack([-normal[:, 1], normal[:, 0], 0 * normal[:, 0]], axis=1)[:, None]
    least = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, least)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    return np.stack([first, np.cross(normal, first)], axis=1)


def edge_heights(fits: LocalFits, x: Floats, i: Ints, j: Ints) -> tuple[Floats, Bools]:
    """(e,): heights at the midpoints of edges from nodes i to j (e,); (e,): True if at least one end has a fit."""
    kappa, known = _curvature(fits, np.stack([i, j], axis=1), x[j] - x[i])
    return _arc(kappa, np.linalg.norm(x[j] - x[i], axis=1)), known


def centre_heights(fits: LocalFits, x: Floats, node: Ints) -> Floats:
    """(f,): heights at the centres of quadrangles with nodes (f, 4), at the mean of their corners.

    Each is the mean of four arcs whose half chords lead from the centre to a corner, exact for a quadratic surface.
    """
    total = np.zeros(len(node))
    for k in range(4):
        d = 2 * (x[node[:, k]] - x[node].mean(axis=1))
        total += _arc(_curvature(fits, node, d)[0], np.linalg.norm(d, axis=1))
    return total / 4


def cubic_heights(fits: LocalFits, x: Floats, node: Ints) -> Floats:
    """(f, k): factors of the cubics of heights over segments and triangles with nodes (f, 2 or 3), `surface.maps`.

    They make second derivatives linear over the face: along its edges, and of triangles at its centre too.
    """
    n = node.shape[1]
    edges = [(0, 1)] if n == 2 else [(0, 1), (1, 2), (2, 0)]
    out = np.zeros((len(node), len(edges) + (n == 3)))
    for k, (i, j) in enumerate(edges):
        e = x[node[:, j]] - x[node[:, i]]
        chord = np.linalg.norm(e, axis=1)
        bend = [chord * np.clip(chord * _curvature(fits, node[:, [c]], e)[0], -2.0, 2.0) for c in range(n)]
        out[:, k] = (bend[j] - bend[i]) / 12
        if n == 3:
            out[:, 3] += (2 * bend[3 - i - j] - bend[i] - bend[j]) / 12
    return out


def _curvature(fits: LocalFits, node: Ints, e: Floats) -> tuple[Floats, Bools]:
    """(m,): curvature along directions e (m, 3), mean over nodes (m, k), convex > 0; (m,): True if a node has a fit."""
    total, number = np.zeros(len(e)), np.zeros(len(e))
    for one in node.T:
        normal = fits.normal[one]
        t = e - (e * normal).sum(axis=1)[:, None] * normal
        size = (t * t).sum(axis=1)
        kappa = -np.einsum("es,est,et->e", t, fits.H[one], t)
        total += np.divide(kappa, size, out=np.zeros_like(kappa), where=fits.known[one] & (size > 0))
        number += fits.known[one]
    return total / np.maximum(number, 1), number > 0


def _arc(kappa: Floats, chord: Floats) -> Floats:
    """(m,): heights of arcs of curvature kappa (m,) over their chords (m,): kappa chord^2 / 8 for short chords."""
    c = np.clip(kappa * chord, -2.0, 2.0)
    return chord * (c / 4) / (1 + np.sqrt(1 - c * c / 4))
