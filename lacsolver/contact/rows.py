"""Rows of contact matrices: sums over the contact points of each macro-element, as entries of the nodes they know.

    int q . (v(x) - v(x_bar))

Both sides use the same points, the same vector q and the same weights, so that action equals reaction: forces balance
because shape functions add up to 1, and moments because x_bar - x is parallel to the q of `B`, the normal. Of other
vectors q the moments balance with what is added for the slave's derivatives, int arm_a . dv/dxi^a (`shear`).

Points with the same slave face and the same master face follow one another: a run. Sums of a run are small and dense,
and are added to a matrix whose entries are known before (`pattern`).
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints, places_of
from lacmesh.surface import ContactPoints, Surface
from lacmesh.surface.maps import N_MONOMIALS, basis
from lacmesh.threads import in_threads
from lacmesh.topology.skin import FACE_TYPES, N_NODES
from lacsolver.contact.chain import Skins
from lacsolver.contact.normals import OtherNormals

if TYPE_CHECKING:
    from lacsolver.contact.anchors import Anchors


class Runs(NamedTuple):
    """Runs of points (r,) with one slave and one master face, by macro-element: `first` point, point after the `last`.

    `start` (macro-elements + 1,): first run of each macro-element.
    """

    first: Ints
    last: Ints
    slave: Ints
    master: Ints
    start: Ints


def runs_of(slave: Ints, master: Ints, macro: Ints, n_macros: int) -> Runs:
    """Return the runs of points with the faces `slave` and `master` and the macro-element `macro`, (n,) each."""
    n = len(slave)
    change = (np.diff(slave) != 0) | (np.diff(master) != 0)
    ends = np.concatenate([np.zeros(min(n, 1), np.int64), np.flatnonzero(change) + 1, [n]])
    first, last = ends[:-1], ends[1:]
    order = np.argsort(macro[first], kind="stable")
    first, last = first[order], last[order]
    start = np.searchsorted(macro[first], np.arange(n_macros + 1))
    return Runs(first, last, slave[first], master[first], start)


def skins_of(slave: Surface, master: Surface) -> tuple[Skins, Ints]:
    """Return both skins with their nodes numbered from 0, and the nodes' numbers in the mesh."""
    of_s, of_m = slave.faces.nodes, master.faces.nodes
    nodes = np.unique(np.concatenate([of_s[of_s >= 0], of_m[of_m >= 0]]))
    place = places_of(nodes, int(nodes[-1]) + 2)
    none = np.empty((0, 9), np.int64), np.empty((0, 3)), False
    skins = Skins(
        slave.x[nodes], slave.faces.type, master.faces.type, place[of_s], place[of_m], *none, _bases(), N_NODES
    )
    return skins, nodes


@cache
def _bases() -> NDArray[np.floating]:
    """Return the shape functions of every type of face, (types, 9 nodes, 9 monomials)."""
    out = np.zeros((len(FACE_TYPES), max(N_NODES), N_MONOMIALS))
    for code in range(1, len(FACE_TYPES)):
        out[code, : N_NODES[code]] = basis(code).T
    return out


def pattern(nodes: Ints, start: Ints, n: int) -> csr_array:
    """Return the incidence of rows and nodes: row m has the `nodes` (r, k) from start[m] to start[m + 1], of n.

    Columns ascend, and negative nodes are left out.
    """
    there = nodes >= 0
    count = np.concatenate([[0], np.cumsum(there.sum(axis=1))])
    incidence = csr_array((np.ones(count[-1], np.int32), nodes[there], count[start]), shape=(len(start) - 1, n))
    incidence.sum_duplicates()
    return incidence


def macro_rows(
    points: ContactPoints | Anchors,
    slave: Surface,
    master: Surface,
    q: Floats,
    n_macros: int,
    arms: Floats | None = None,
) -> csr_array:
    """Return a matrix (n_macros, d n_nodes): row m sums q_p . (v(x_p) - v(x_bar_p)) over macro-element m's points p.

    `q` (points, d): a vector at each point, with its weight; or (points, k, d), for k rows a macro-element. `arms`
    (points, dim of the skins, k, d): vectors whose products with dv/dxi of the slave are added, None for none. Columns
    are those of the unknowns d i + k of node i.
    """
    skins, nodes = skins_of(slave, master)
    runs = runs_of(points.slave, points.master, points.macro, n_macros)
    known = np.concatenate([skins.nodes_s[runs.slave], skins.nodes_m[runs.master]], axis=1)
    entries, value = _summed(points, runs, skins, pattern(known, runs.start, len(nodes)), q, arms)
    return on_unknowns(entries, value, nodes, slave.x.shape[0])


def normal_rows(
    points: ContactPoints | Anchors, slave: Surface, master: Surface, normals: OtherNormals, q: Floats, n_macros: int
) -> csr_array:
    """Return a matrix (k n_macros, d n_nodes): rows sum q_p . dh(v) at points p of macro-elements, q (points, k, d).

    dh = N_a dh_a is the change of the interpolation of the normals at the nodes of the slave's or the master's face.
    """
    skins, nodes = skins_of(slave, master)
    d = q.shape[2]
    runs = runs_of(points.slave, points.master, points.macro, n_macros)
    # normals in the place of the nodes of one side, and no nodes of the other
    skins = skins._replace(n_nodes=np.where(np.arange(len(N_NODES)) > 0, N_NODES, 0))
    if normals.of_master:
        skins = skins._replace(nodes_m=normals.of_faces, type_s=np.zeros_like(skins.type_s))
        entries, q = pattern(normals.of_faces[runs.master], runs.start, len(normals.n)), -q
    else:
        skins = skins._replace(nodes_s=normals.of_faces, type_m=np.zeros_like(skins.type_m))
        entries = pattern(normals.of_faces[runs.slave], runs.start, len(normals.n))
    entries, value = _summed(points, runs, skins, entries, q, None)
    A = on_unknowns(entries, value, np.arange(len(normals.n)), len(normals.n)) @ normals.derivative
    place = (d * nodes[:, None] + np.arange(d)).ravel()
    return csr_array((A.data, place[A.indices], A.indptr), shape=(A.shape[0], d * slave.x.shape[0]))


def _summed(
    points: ContactPoints | Anchors, runs: Runs, skins: Skins, entries: csr_array, q: Floats, arms: Floats | None
) -> tuple[csr_array, NDArray[np.floating]]:
    """Return the `entries` of rows, and their blocks (entries, k, d); see `macro_rows`."""
    k, d = q.shape[1:] if q.ndim == 3 else (1, q.shape[1])
    flat = np.ascontiguousarray(q.reshape(len(q), k * d))
    slopes = None if arms is None else np.ascontiguousarray(arms.reshape(len(q), arms.shape[1], k * d))
    value = np.zeros((entries.nnz, k * d))
    xi_s, xi_m, at = points.xi_slave, points.xi_master, (entries.indptr, entries.indices)

    def run(rows: slice) -> None:
        _sum_rows(rows.start, rows.stop, runs, skins, xi_s, xi_m, flat, *at, value)
        if slopes is not None:
            _sum_slopes(rows.start, rows.stop, runs, skins, xi_s, slopes, *at, value)

    in_threads(run, entries.shape[0])
    return entries, value.reshape(entries.nnz, k, d)


def on_unknowns(entries: csr_array, value: Floats, nodes: Ints, n_nodes: int) -> csr_array:
    """Return a matrix with blocks `value` (entries, k, d), on the unknowns d i + k of all `n_nodes` nodes i.

    `nodes`: numbers of the columns' nodes, ascending.
    """
    shape = (value.shape[1] * entries.shape[0], value.shape[2] * n_nodes)
    return bsr_array((value, nodes[entries.indices], entries.indptr), shape=shape, blocksize=value.shape[1:]).tocsr()


@kernel(borrows=True)
def position(indices: Any, low: int, high: int, node: int) -> int:
    """Return the place of a node among ascending indices[low:high], of which it is one."""
    while high - low > 1:
        middle = (low + high) // 2
        if indices[middle] > node:
            high = middle
        else:
            low = middle
    return low


@kernel
def _sum_rows(
    begin: int, end: int, runs: Any, skins: Any, xi_s: Any, xi_m: Any, q: Any, indptr: Any, indices: Any, value: Any
) -> None:
    """Add the sums of the runs of macro-elements `begin` to `end` to their rows."""
    sums_s, sums_m = np.empty((9, q.shape[1])), np.empty((9, q.shape[1]))
    for m in range(begin, end):
        for r in range(runs.start[m], runs.start[m + 1]):
            s, t = runs.slave[r], runs.master[r]
            sums_s[:], sums_m[:] = 0.0, 0.0
            for p in range(runs.first[r], runs.last[r]):
                _add_moments(xi_s[p, 0], xi_s[p, 1], q, p, sums_s)
                _add_moments(xi_m[p, 0], xi_m[p, 1], q, p, sums_m)
            row = (indptr[m], indptr[m + 1])
            _add_shapes(skins, skins.type_s[s], skins.nodes_s[s], sums_s, 1.0, row, indices, value)
            _add_shapes(skins, skins.type_m[t], skins.nodes_m[t], sums_m, -1.0, row, indices, value)


@kernel
def _sum_slopes(
    begin: int, end: int, runs: Any, skins: Any, xi_s: Any, arms: Any, indptr: Any, indices: Any, value: Any
) -> None:
    """Add the sums of arms_a . dv/dxi^a on the slave, of macro-elements `begin` to `end`, to their rows."""
    sums = np.empty((9, arms.shape[2]))
    for m in range(begin, end):
        for r in range(runs.start[m], runs.start[m + 1]):
            s = runs.slave[r]
            sums[:] = 0.0
            for p in range(runs.first[r], runs.last[r]):
                _add_slopes(xi_s[p, 0], xi_s[p, 1], arms, p, sums)
            row = (indptr[m], indptr[m + 1])
            _add_shapes(skins, skins.type_s[s], skins.nodes_s[s], sums, 1.0, row, indices, value)


@kernel(borrows=True)
def _add_slopes(u: float, v: float, arms: Any, p: int, sums: Any) -> None:
    """Add the derivatives of the nine monomials at (u, v), times the arms of point p, to `sums`."""
    for s in range(arms.shape[2]):
        f = arms[p, 0, s]
        sums[1, s] += f
        sums[3, s] += 2 * u * f
        if arms.shape[1] == 2:
            g = arms[p, 1, s]
            sums[2, s] += g
            sums[4, s] += v * f + u * g
            sums[5, s] += 2 * v * g
            sums[6, s] += 2 * u * v * f + u * u * g
            sums[7, s] += v * v * f + 2 * u * v * g
            sums[8, s] += 2 * u * v * v * f + 2 * u * u * v * g


@kernel(borrows=True)
def _add_moments(u: float, v: float, q: Any, p: int, sums: Any) -> None:
    """Add q times the nine monomials at (u, v) to `sums`."""
    for s in range(q.shape[1]):
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


@kernel(borrows=True)
def _add_shapes(skins: Any, code: int, nodes: Any, sums: Any, sign: float, row: Any, indices: Any, value: Any) -> None:
    """Add `sign` times the integrals of a face's shape functions, from those of the monomials, to a row."""
    for a in range(skins.n_nodes[code]):
        at = position(indices, row[0], row[1], nodes[a])
        for s in range(value.shape[1]):
            v = 0.0
            for k in range(9):
                v += skins.bases[code, a, k] * sums[k, s]
            value[at, s] += sign * v
