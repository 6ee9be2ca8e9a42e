"""Local quadratic fits: at each node the curve of the skin, from the nodes of two rings around it.

In the frame of a node's normal n, a neighbour at d has the height z = d.n and the place |d| (d_t / |d_t|), with d_t its
part in the tangent plane: with the length of the chord for that of its shadow, z = -|d|^2 / 2R holds on a sphere, and
on a circle in the plane, whatever |d| is. z is fitted by a quadratic without a constant, neighbours weighted with
1 / |d|, and the frame is turned to the fitted normal.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints

Bools = NDArray[np.bool_]

#: rounds of turning the frame
_ROUNDS = 3
#: least number of neighbours, in the plane and in space
LEAST = {1: 2, 2: 5}
#: what the second derivatives are held back by, of what the neighbours say: where these cannot tell them from the slope
#: (a strip of one row of faces), the skin is straight
_RIDGE = 1e-10
#: nodes that are fitted at once
_PIECE = 8192


class Rings(NamedTuple):
    """Neighbours of nodes: those of node i are neighbour[start[i]:start[i + 1]]."""

    start: Ints
    neighbour: Ints

    def of(self, i: int) -> Ints:
        """The neighbours of one node."""
        return self.neighbour[self.start[i] : self.start[i + 1]]


class Fits(NamedTuple):
    """Quadratics at nodes: `normal` (n, 3), second derivatives `H` (n, 3, 3) along it, `known` (n,) where it is one."""

    normal: Floats
    H: Floats
    known: Bools


def rings_of(node: Ints, n_nodes: int, asked: Bools, least: int) -> tuple[Rings, Rings]:
    """The nodes of one ring, and those of two, around the nodes that are asked for (n,), on faces with nodes (f, 4).

    Where two rings are fewer than `least`, three.
    """
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
    mine = csr_matrix(one.multiply(asked[:, None]))
    two = _without_self(mine + mine @ one)
    few = (np.diff(two.indptr) < least) & asked
    if few.any():
        two = _without_self(two + csr_matrix(two.multiply(few[:, None])) @ one)
    return Rings(mine.indptr, mine.indices), Rings(two.indptr, two.indices)


def _without_self(graph: Any) -> Any:
    """A graph without the edges from nodes to themselves."""
    graph = graph.tocoo()
    apart = graph.row != graph.col
    from scipy.sparse import csr_matrix

    return csr_matrix((np.ones(int(apart.sum()), np.int32), (graph.row[apart], graph.col[apart])), shape=graph.shape)


def local_fits(x: Floats, normal: Floats, rings: Rings, dim: int) -> Fits:
    """The quadratics at nodes x (n, 3) with normals (n, 3) to begin with."""
    known = np.diff(rings.start) >= LEAST[dim]
    normal, H = normal.copy(), np.zeros((len(x), 3, 3))
    rows = np.flatnonzero(known)
    for first in range(0, len(rows), _PIECE):
        some = rows[first : first + _PIECE]
        count = np.diff(rings.start)[some]
        begin = np.cumsum(count) - count
        pair = np.arange(count.sum()) + np.repeat(rings.start[some] - begin, count)
        d = x[rings.neighbour[pair]] - np.repeat(x[some], count, axis=0)
        for _ in range(_ROUNDS):
            normal[some], H[some] = _fitted(d, normal[some], count, begin, dim)
    return Fits(normal, H, known)


def _fitted(d: Floats, normal: Floats, count: Ints, begin: Ints, dim: int) -> tuple[Floats, Floats]:
    """One round: the fitted normals (n, 3) and the second derivatives (n, 3, 3) of neighbours at d (p, 3)."""
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
    columns = [u[0], u[0] ** 2 / 2] if dim == 1 else [*u, u[0] ** 2 / 2, u[1] ** 2 / 2, u[0] * u[1]]
    m = len(columns)
    A, b = np.empty((len(count), m, m)), np.empty((len(count), m))
    for i in range(m):
        weighted = w * columns[i]
        b[:, i] = np.add.reduceat(weighted * z, begin)
        for j in range(i + 1):
            A[:, i, j] = A[:, j, i] = np.add.reduceat(weighted * columns[j], begin)
    ridge = _RIDGE * np.trace(A, axis1=1, axis2=2)
    for i in range(m):
        A[:, i, i] += ridge * (0 if i < dim else 2 if i == 4 else 1) + 1e-14 * ridge + 1e-300
    c = np.linalg.solve(A, b[:, :, None])[:, :, 0]
    slope = np.einsum("nk,nks->ns", c[:, :dim], frame)
    turned = normal - slope
    second = c[:, dim:] / size[:, None]
    t = frame
    H = np.einsum("n,ni,nj->nij", second[:, 0], t[:, 0], t[:, 0])
    if dim == 2:
        H += np.einsum("n,ni,nj->nij", second[:, 1], t[:, 1], t[:, 1])
        mixed = np.einsum("n,ni,nj->nij", second[:, 2], t[:, 0], t[:, 1])
        H += mixed + np.swapaxes(mixed, 1, 2)
    return turned / np.linalg.norm(turned, axis=1, keepdims=True), H


def _frames(normal: Floats, dim: int) -> Floats:
    """(n, dim, 3): tangents at right angles to normals (n, 3)."""
    if dim == 1:
        return np.stack([-normal[:, 1], normal[:, 0], 0 * normal[:, 0]], axis=1)[:, None]
    least = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, least)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    return np.stack([first, np.cross(normal, first)], axis=1)


def edge_heights(fits: Fits, x: Floats, i: Ints, j: Ints) -> tuple[Floats, Bools]:
    """(e,): heights at the middles of edges from nodes i to j (e,), and whether there is a fit at either end."""
    kappa, known = _curvature(fits, np.stack([i, j], axis=1), x[j] - x[i])
    return _arc(kappa, np.linalg.norm(x[j] - x[i], axis=1)), known


def centre_heights(fits: Fits, x: Floats, node: Ints) -> Floats:
    """(f,): heights at the centres of quadrangles with nodes (f, 4), the means of their corners.

    The mean of the four arcs whose half chords lead from the centre to a corner: exact for a quadratic.
    """
    total = np.zeros(len(node))
    for k in range(4):
        d = 2 * (x[node[:, k]] - x[node].mean(axis=1))
        total += _arc(_curvature(fits, node, d)[0], np.linalg.norm(d, axis=1))
    return total / 4


def _curvature(fits: Fits, node: Ints, e: Floats) -> tuple[Floats, Bools]:
    """(m,): curvatures along directions e (m, 3), means over nodes (m, k); convex > 0. Whether a node has a fit."""
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
    """(m,): how high arcs of curvature kappa (m,) stand over chords (m,): kappa chord^2 / 8 where these are short."""
    c = np.clip(kappa * chord, -2.0, 2.0)
    return chord * (c / 4) / (1 + np.sqrt(1 - c * c / 4))
