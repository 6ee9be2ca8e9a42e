"""Rows of contact matrices: for each macro-element, int q . (v(x) - v(x_bar)) over its contact points.

Both sides use the same points, the same vector q and the same weights, so that action equals reaction: forces balance
because shape functions add up to 1, and moments because x_bar - x is parallel to the q of `B`, the normal.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import ContactPoints, Surface
from lacmesh.surface.maps import N_MONOMIALS, basis
from lacmesh.surface.search import in_parts
from lacmesh.topology.skin import FACE_TYPES, N_NODES


def macro_rows(points: ContactPoints, slave: Surface, master: Surface, q: Floats, n_macros: int) -> csr_array:
    """Return a matrix (n_macros, d n_nodes): row m sums q_p . (v(x_p) - v(x_bar_p)) over macro-element m's points p.

    `q` (points, d): a vector at each point, with its weight. Columns are those of the unknowns d i + k of node i.
    """
    q, d = np.ascontiguousarray(q), q.shape[1]
    start, order, macro_start = _runs(points, n_macros)
    face_s, face_m = slave.faces, master.faces
    nodes, local_s, local_m = _numbered(face_s.nodes, face_m.nodes)
    run_s, run_m = points.slave[start[:-1]][order], points.master[start[:-1]][order]
    room = N_NODES[face_s.type[run_s]] + N_NODES[face_m.type[run_m]]
    first = np.concatenate([[0], np.cumsum(room)])[macro_start]
    count = np.zeros(n_macros, np.int64)
    column = np.empty(first[-1], np.int32)
    value = np.empty((first[-1], d))

    def run(rows: slice) -> None:
        _sum_rows(
            rows.start, rows.stop, macro_start, start, order, points.xi_slave, points.xi_master, q,
            run_s, run_m, face_s.type, face_m.type, local_s, local_m, _bases(), N_NODES,
            len(nodes), first, count, column, value,
        )  # fmt: skip

    in_parts(run, n_macros)
    return _matrix(nodes, first, count, column, value, d, slave.x.shape[0])


def _runs(points: ContactPoints, n_macros: int) -> tuple[Ints, Ints, Ints]:
    """Return runs of points with one slave and one master face: starts (r + 1,), order by macro-element, its starts."""
    n = len(points)
    change = (np.diff(points.slave) != 0) | (np.diff(points.master) != 0)
    start = np.concatenate([np.zeros(min(n, 1), np.int64), np.flatnonzero(change) + 1, [n]])
    macro = points.macro[start[:-1]]
    order = np.argsort(macro, kind="stable")
    return start, order, np.searchsorted(macro[order], np.arange(n_macros + 1))


def _numbered(slave: Ints, master: Ints) -> tuple[Ints, Ints, Ints]:
    """Return the nodes of both surfaces, each once, and the nodes of the faces as indices into them (-1 stays)."""
    nodes = np.unique(np.concatenate([slave[slave >= 0], master[master >= 0]]))
    place = np.full(int(nodes[-1]) + 2, -1, np.int32)
    place[nodes] = np.arange(len(nodes))
    return nodes, place[slave], place[master]


@cache
def _bases() -> NDArray[np.floating]:
    """Return the shape functions of every type of face, (types, 9 nodes, 9 monomials)."""
    out = np.zeros((len(FACE_TYPES), max(N_NODES), N_MONOMIALS))
    for code in range(1, len(FACE_TYPES)):
        out[code, : N_NODES[code]] = basis(code).T
    return out


def _matrix(nodes: Ints, first: Ints, count: Ints, column: Ints, value: Floats, d: int, n_nodes: int) -> csr_array:
    """Return the summed rows as a matrix: gaps of unused entries removed, columns ascending."""
    at = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first[:-1], count)
    node = nodes[column[at]]
    indptr = np.concatenate([[0], np.cumsum(count)]) * d
    indices = (d * node[:, None] + np.arange(d)).ravel()
    made = csr_array((value[at].ravel(), indices, indptr), shape=(len(count), d * n_nodes))
    made.sort_indices()
    return made


@kernel
def _sum_rows(
    begin: int, end: int, macro_start: Any, start: Any, order: Any, xi_s: Any, xi_m: Any, q: Any,
    run_s: Any, run_m: Any, type_s: Any, type_m: Any, local_s: Any, local_m: Any, bases: Any, n_nodes: Any,
    n_local: int, first: Any, count: Any, column: Any, value: Any,
) -> None:  # fmt: skip
    """Fill the rows of macro-elements `begin` to `end`: nodes in order of first appearance, and their sums."""
    d = q.shape[1]
    at = np.full(n_local, -1, np.int64)
    sums_s, sums_m = np.empty((9, 3)), np.empty((9, 3))
    for m in range(begin, end):
        n = 0
        for r in range(macro_start[m], macro_start[m + 1]):
            s, t = run_s[r], run_m[r]
            sums_s[:], sums_m[:] = 0.0, 0.0
            for p in range(start[order[r]], start[order[r] + 1]):
                _add_moments(xi_s[p, 0], xi_s[p, 1], q, p, d, sums_s)
                _add_moments(xi_m[p, 0], xi_m[p, 1], q, p, d, sums_m)
            n = _scatter(
                bases, type_s[s], n_nodes[type_s[s]], local_s, s, sums_s, 1.0, d, at, first[m], n, column, value
            )
            n = _scatter(
                bases, type_m[t], n_nodes[type_m[t]], local_m, t, sums_m, -1.0, d, at, first[m], n, column, value
            )
        for k in range(n):
            at[column[first[m] + k]] = -1
        count[m] = n


@kernel
def _add_moments(u: float, v: float, q: Any, p: int, d: int, sums: Any) -> None:
    """Add q times the nine monomials at (u, v) to `sums`."""
    for s in range(d):
        f = q[p, s]
        g, h = u * f, u * u * f
        sums[0, s] += f
        sums[1, s] += g
        sums[2, s] += v * f
        sums[3, s] += h
        sums[4, s] += v * g
        sums[5, s] += v * v * f
        sums[6, s] += v * h
        sums[7, s] += v * v * g
        sums[8, s] += v * v * h


@kernel
def _scatter(
    bases: Any, code: int, n_nodes: int, local: Any, face: int, sums: Any, sign: float, d: int, at: Any,
    first: int, n: int, column: Any, value: Any,
) -> int:  # fmt: skip
    """Add a face's share to the row, new nodes at its end, and return the number of nodes in the row."""
    for a in range(n_nodes):
        node = local[face, a]
        if at[node] < 0:
            at[node] = first + n
            column[first + n] = node
            for s in range(d):
                value[first + n, s] = 0.0
            n += 1
        for s in range(d):
            v = 0.0
            for k in range(9):
                v += bases[code, a, k] * sums[k, s]
            value[at[node], s] += sign * v
    return n
