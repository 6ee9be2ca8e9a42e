"""Consistent linearisation of an interface: derivatives of the contact force and of the gaps by the displacement.

With the derivatives at one point (`chain`), w the weight of a point and dw its change in the current measure,

    d(B^T p).v = sum p w [ dn.(v - v_bar) - (n.dv_bar/dxi^b) dxi_bar^b ] + p dw n.(v - v_bar)
    dG = sum w dg + dw g

The edges of mortar segments move too, by V (`edges`), which adds the line integral of the integrand times V:

    d(B^T p).v += sum_edges p w V n.(v - v_bar),     dG += sum_edges w V g

With friction q = p n + t_alpha e_alpha stands in the place of p n, and its arm across the ray is added (`tractions`).

One loop over the points, and over those of the edges, sums these for each run of points with the same two faces, as the
matrix of an element is summed over its quadrature points, and adds the sums to sparse matrices: where forces are asked,
those of the gaps come with them, since the chain of derivatives at a point is the same for both. With other normals
h(u) than those of the slave's faces its columns are those of the nodes, then those of the normals: the latter are
eliminated at the end, once for each normal, by dh/du (`normals`):

    K = A_u + A_h dh/du,      dG = g_u + g_h dh/du
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array, get_index_dtype, vstack

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacmesh.surface.normals import normal_maps
from lacsolver.contact.chain import (
    GAP,
    MOST_UNKNOWNS,
    NORMAL,
    SLIDE,
    STRETCH,
    LoopPoints,
    MovingEdges,
    Skins,
    differentiate,
    n_normals,
    new_room,
)
from lacsolver.contact.edges import edges_of
from lacsolver.contact.faces import tangents
from lacsolver.contact.interface import Interface, Pairing, clearance, stretch
from lacsolver.contact.normals import OtherNormals, other_normals
from lacsolver.contact.rows import Runs, pattern, position, runs_of, skins_of
from lacsolver.contact.shear import Tangents, frames
from lacsolver.contact.tractions import Shear, add_slip, add_traction, asks

#: runs of points that are taken at once where the loop runs as it stands
_AT_ONCE = 64
#: blocks of a matrix that are put on all unknowns at once
_BLOCKS_AT_ONCE = 20_000


class Loop(NamedTuple):
    """Points of a loop (n,), with their `weight` and their `distance`, the gap with the clearance, run by run."""

    points: LoopPoints
    weight: Floats
    distance: Floats
    runs: Runs


class SlidingPoints(NamedTuple):
    """Points of a loop (n,) with friction: their faces `slave` and `master`, and the `tangents` of the slave there."""

    slave: Ints
    master: Ints
    tangents: Tangents


class Sums(NamedTuple):
    """Blocks `value` (entries, k, d) of a sparse matrix with a known pattern; without entries where it is not asked."""

    indptr: Ints
    indices: Ints
    value: NDArray[np.floating]

    @classmethod
    def of(cls, entries: csr_array, k: int, d: int) -> Sums:
        """Return zeros. Indices have 8 bytes, whatever scipy took, so that kernels are compiled once."""
        indptr, indices = (a.astype(np.int64, copy=False) for a in (entries.indptr, entries.indices))
        return cls(indptr, indices, np.zeros((entries.nnz, k, d)))

    @classmethod
    def none(cls) -> Sums:
        """Return those of a matrix that is not asked."""
        return cls(np.zeros(1, np.int64), np.empty(0, np.int64), np.empty((0, 0, 0)))


@dataclass(frozen=True, eq=False)
class Motion:
    """Points that the derivatives of an interface are summed over, those on moving edges included.

    `skins`: the nodes and normals that the points know; `nodes`: numbers of these nodes in the mesh, of `n_nodes`; `d`:
    the dimension. `normals`: None for those of the slave's faces. `along`: the points of each loop as those of
    friction, None without.
    """

    skins: Skins
    nodes: Ints
    n_nodes: int
    d: int
    loops: tuple[Loop, Loop]
    normals: OtherNormals | None
    along: tuple[SlidingPoints, SlidingPoints] | None = None

    def gaps(self, fading: Floats | None = None) -> csr_array:
        """Return the derivative (m, n_dof) of the integrals of the gap.

        `fading` (m,): what is added of the derivative of the covered measure, 0 by default.
        """
        entries, value = self._macro_nodes, self._of_gaps[:, :1]
        if fading is not None and fading.any():
            row = np.repeat(np.arange(len(fading)), np.diff(entries.indptr))
            value = value + fading[row, None, None] * self._of_gaps[:, 1:]
        return self._on_unknowns(entries, value)

    @cached_property
    def _of_gaps(self) -> NDArray[np.floating]:
        """Blocks (entries, 2, d) of the derivatives of the integrals of the gap, and of the covered measure."""
        sums = Sums.of(self._macro_nodes, 2, self.d)
        self._add(np.zeros(len(self.loops[0].runs.start) - 1), ((), ()), sums, Sums.none())
        return sums.value

    def slips(self, which: NDArray[np.bool_], slips: Sequence[tuple[Floats, Floats]]) -> csr_array:
        """Return the derivative (m (d - 1), n_dof) of the integrals of the slip since another state.

        `which` (m,): macro-elements that it is asked for; `slips`: for the points (n,) of each loop the slip (n, d - 1)
        and its derivative (n, d - 1, d - 1) by the point's coordinates in the master's face.
        """
        shear, sums = [Shear.since(which, *slip) for slip in slips], Sums.of(self._macro_nodes, self.d - 1, self.d)
        self._add(np.empty(0), shear, sums, Sums.none())
        return self._on_unknowns(self._macro_nodes, sums.value)

    def forces(self, p: Floats, t: Floats | None = None) -> csr_array:
        """Return the derivative (n_dof, n_dof) of the forces B^T p + B_T^T t.

        `p` (m,): pressures; `t` (m (d - 1),): tractions, None where there are none.
        """
        shear: Sequence[Any] = ((), ())
        if t is not None:
            assert self.along is not None
            shear = [Shear.of(t.reshape(-1, self.d - 1), points.tangents) for points in self.along]
        known = "_of_gaps" in self.__dict__
        of_gaps = Sums.none() if known else Sums.of(self._macro_nodes, 2, self.d)
        sums = Sums.of(self._node_pairs, self.d, self.d)
        self._add(p, shear, of_gaps, sums)
        if not known:
            self.__dict__["_of_gaps"] = of_gaps.value
        return self._on_rows(self._on_unknowns(self._node_pairs, sums.value))

    def _add(self, p: Floats, shear: Sequence[Any], of_macros: Sums, of_nodes: Sums) -> None:
        """Add the derivatives from all points, see the kernel; `shear`: tractions, or slips, of each loop."""
        for loop, own in zip(self.loops, shear, strict=True):
            _add(loop, self.skins, p, own, self.d, of_macros, of_nodes)

    @property
    def _n_columns(self) -> int:
        """Number of nodes and normals."""
        return len(self.nodes) + len(self.skins.normals)

    @cached_property
    def _columns(self) -> NDArray[np.int64]:
        """Nodes and normals that each run knows, normals numbered after the nodes, (runs of both loops, 18 to 27)."""
        skins, parts = self.skins, [loop.runs for loop in self.loops]
        of_s, of_m = (np.concatenate([getattr(runs, side) for runs in parts]) for side in ("slave", "master"))
        known = [skins.nodes_s[of_s], skins.nodes_m[of_m]]
        if len(skins.normals):
            of = of_m if skins.of_master else of_s
            known.append(np.where(skins.normal_of >= 0, skins.normal_of + len(self.nodes), -1)[of])
        return np.concatenate(known, axis=1)

    @cached_property
    def _macro_nodes(self) -> csr_array:
        """Which nodes and normals (columns) the gap and the slip of each macro-element (row) depend on."""
        starts = [loop.runs.start for loop in self.loops]
        macro = np.concatenate([np.repeat(np.arange(len(start) - 1), np.diff(start)) for start in starts])
        order = np.argsort(macro, kind="stable")
        start = np.searchsorted(macro[order], np.arange(len(starts[0])))
        return pattern(self._columns[order], start, self._n_columns)

    @cached_property
    def _node_pairs(self) -> csr_array:
        """Which nodes and normals (columns) the force on each node (row) depends on."""
        columns, every = self._columns, np.arange(len(self._columns) + 1)
        rows = pattern(columns[:, :18], every, len(self.nodes))
        pairs = csr_array(rows.T @ pattern(columns, every, self._n_columns))
        pairs.sort_indices()
        return pairs

    def _on_unknowns(self, entries: csr_array, value: Floats) -> csr_array:
        """Return a matrix on all unknowns (columns), with the normals eliminated; `value` (entries, k, d).

        To eliminate normals some rows are taken at once, as what stands between takes several times the memory of the
        matrix.
        """
        at_once = max(entries.nnz, 1) if self.normals is None else _BLOCKS_AT_ONCE
        starts = np.searchsorted(entries.indptr, np.arange(0, max(entries.nnz, 1), at_once))
        ends = np.unique([*starts, entries.shape[0]])
        parts = [self._some_on_unknowns(entries, value, *pair) for pair in itertools.pairwise(ends)]
        return parts[0] if len(parts) == 1 else csr_array(vstack(parts))

    def _some_on_unknowns(self, entries: csr_array, value: Floats, first: int, last: int) -> csr_array:
        """Return the rows of `_on_unknowns` that belong to the rows `first` to `last` of the entries."""
        n, k, start = self.d * len(self.nodes), value.shape[1], entries.indptr[first : last + 1]
        own, shape = slice(start[0], start[-1]), (k * (last - first), self.d * self._n_columns)
        dtype = get_index_dtype(maxval=max(value[own].size, self.d * self.n_nodes))  # half the memory, if they are few
        blocks = value[own], entries.indices[own].astype(dtype), (start - start[0]).astype(dtype)
        A = bsr_array(blocks, shape=shape, blocksize=(k, self.d)).tocsr()
        if self.normals is not None:
            A = csr_array(A[:, :n] + A[:, n:] @ self.normals.derivative)
        place = (self.d * self.nodes[:, None] + np.arange(self.d)).ravel().astype(A.indices.dtype)
        return csr_array((A.data, place[A.indices], A.indptr), shape=(shape[0], self.d * self.n_nodes))

    def _on_rows(self, A: csr_array) -> csr_array:
        """Return a matrix whose rows are those of the skins' nodes with rows of all nodes."""
        count = np.zeros((self.n_nodes, self.d), np.int64)
        count[self.nodes] = np.diff(A.indptr).reshape(-1, self.d)
        indptr = np.concatenate([[0], np.cumsum(count)]).astype(A.indptr.dtype)
        return csr_array((A.data, A.indices, indptr), shape=(self.d * self.n_nodes, A.shape[1]))


def motion_of(face: Interface, slave: Surface, master: Surface, pairing: Pairing, dim: int) -> Motion:
    """Return what the derivatives of an interface are summed from; `slave`, `master`: its deformed skins."""
    points, m = face.points, len(face.w)
    skins, nodes = skins_of(slave, master)
    normals = other_normals(slave, master, pairing.normals, pairing.crease_angle, dim, nodes)
    if normals is not None:
        skins = skins._replace(normal_of=normals.of_faces, normals=normals.n, of_master=normals.of_master)
    current = int(pairing.measure == "current")
    slope = np.empty((0, 2)) if master.height is None else master.height.slope(points.master, points.xi_master)
    inside = LoopPoints(
        points.xi_slave, points.xi_master, points.normal, points.ray, slope, current, current * pairing.axisymmetric,
        MovingEdges.none(),
    )  # fmt: skip
    runs = runs_of(points.slave, points.master, points.macro, m)
    edges, of_edges = _edges(face, slave, master, pairing, dim)
    loops, along = (Loop(inside, face.weight, face.distance, runs), edges), None
    if face.tangents is not None and of_edges is not None:
        along = SlidingPoints(points.slave, points.master, face.tangents), of_edges
    return Motion(skins, nodes, slave.x.shape[0], dim, loops, normals, along)


def _edges(
    face: Interface, slave: Surface, master: Surface, pairing: Pairing, dim: int
) -> tuple[Loop, SlidingPoints | None]:
    """Return the points on the moving edges of mortar segments, with the clearance there.

    Beside them they are returned as points of friction, None without.
    """
    H = normal_maps(slave, master, pairing.normals, pairing.crease_angle)
    edges = edges_of(face.points.slave, face.points.master, slave, master, dim, H, pairing.axisymmetric)
    macro = face.zone.macro[edges.slave]
    weight = edges.weight * pairing.depth(macro)
    if pairing.measure == "reference":
        weight = weight * stretch(face.zone, slave, edges.slave, edges.points.xi_s, pairing.axisymmetric)
    distance = edges.gap + clearance(face.zone, edges.slave, edges.points.xi_s, pairing, face.t)
    runs = runs_of(edges.slave, edges.master, macro, len(face.w))
    loop = Loop(edges.points, weight, distance, runs)
    if not pairing.friction:
        return loop, None
    J = tangents(slave, edges.slave, edges.points.xi_s)
    directions = frames(face.zone, edges.slave, edges.points.xi_s, edges.points.normal, J)
    return loop, SlidingPoints(edges.slave, edges.master, directions)


def tangent(motion: Motion, p: Floats, t: Floats | None = None) -> csr_array:
    """Return d(B^T p + B_T^T t)/du (n_dof, n_dof), see `Motion.forces`; it is not symmetric."""
    return motion.forces(p, t)


def gap_derivative(motion: Motion, fading: Floats | None = None) -> csr_array:
    """Return -dG/du (m, n_dof), with all terms; `fading` (m,): G has a part that changes by so much with w."""
    out = motion.gaps(fading)
    np.negative(out.data, out=out.data)
    return out


@kernel(borrows=True)
def _local(skins: Any, s: int, m: int, out: Any) -> Any:
    """Write the nodes and normals that points of slave face s and master face m know, and return how many."""
    k_s, k_m = skins.n_nodes[skins.type_s[s]], skins.n_nodes[skins.type_m[m]]
    for a in range(k_s):
        out[a] = skins.nodes_s[s, a]
    for b in range(k_m):
        out[k_s + b] = skins.nodes_m[m, b]
    if len(skins.normals) == 0:
        return k_s, k_m, k_s + k_m
    k_n, face = n_normals(skins, k_s, k_m), m if skins.of_master else s
    for a in range(k_n):
        out[k_s + k_m + a] = len(skins.x) + skins.normal_of[face, a]
    return k_s, k_m, k_s + k_m + k_n


@kernel
def _add(loop: Any, skins: Any, p: Any, shear: Any, d: int, of_macros: Any, of_nodes: Any) -> None:
    """Add the derivatives from all points to two matrices, of which one that is not asked has no entries.

    `of_nodes` (.., d, d): of the forces on nodes, at pressures p (m,). `of_macros`: of the gaps and of the covered
    measure, (.., 2, d); without pressures, p (0,), of slips, (.., d - 1, d). `shear`: the tractions beside the
    pressures, the slips, or (), for which nothing of them is compiled. One loop does all, as what takes long, to
    compile and to compute, is the chain of derivatives in it.
    """
    runs, room, local = loop.runs, new_room(()), np.empty(27, np.int64)
    points, weight, distance = loop.points, loop.weight, loop.distance  # to take them out for each point costs more
    n_own, K = of_macros.value.shape[1], np.empty((MOST_UNKNOWNS, MOST_UNKNOWNS))
    own = np.empty((2, MOST_UNKNOWNS))
    for macro in range(len(runs.start) - 1):
        asked = asks(shear, p, macro, len(of_macros.value) > 0, len(of_nodes.value) > 0)
        if not (asked[0] or asked[1]):
            continue
        for r in range(runs.start[macro], runs.start[macro + 1]):
            s, m = runs.slave[r], runs.master[r]
            types = (skins.type_s[s], skins.type_m[m])
            sizes = _local(skins, s, m, local)
            n_rows = sizes[0] + sizes[1] if asked[1] else 0
            K[: n_rows * d, : d * sizes[2]] = 0.0
            own[:, : d * sizes[2]] = 0.0
            for q in range(runs.first[r], runs.last[r]):
                differentiate(skins, points, q, s, m, types, d, room)
                if asked[0]:
                    _add_to_macro(p, shear, q, weight[q], distance[q], d * sizes[2], d, room.rows, own)
                if asked[1]:
                    _add_to_nodes(points, skins, p, shear, q, macro, s, weight[q], sizes, d, room, K)
            if asked[0]:
                _add_row(own, 0, n_own, local, sizes[2], of_macros, macro)
            for a in range(n_rows):
                _add_row(K, d * a, d, local, sizes[2], of_nodes, local[a])


def _add_arrays(loop: Loop, skins: Skins, p: Floats, shear: Any, d: int, of_macros: Sums, of_nodes: Sums) -> None:
    """Do what `_add` does, for arrays of points whose faces have the same types: what runs if it is not compiled."""
    runs, m = loop.runs, len(loop.runs.start) - 1
    macro = np.repeat(np.arange(m), np.diff(runs.start))
    types = np.stack([skins.type_s[runs.slave], skins.type_m[runs.master]], axis=1)
    wanted = len(of_macros.value) > 0, len(of_nodes.value) > 0
    asked = np.array([asks(shear, p, k, *wanted) for k in range(m)], bool).reshape(m, 2)[macro]
    for pair in np.unique(types[asked.any(axis=1)], axis=0):
        for one in np.unique(asked, axis=0):
            own = np.flatnonzero((asked == one).all(axis=1) & (types == pair).all(axis=1) & one.any())
            for first in range(0, len(own), _AT_ONCE):
                some = own[first : first + _AT_ONCE]
                nodes, *sums = _sums_of_runs(loop, skins, p, shear, d, tuple(pair), some, macro[some], one)
                _add_blocks(macro[some, None], nodes, sums[0], of_macros)
                _add_blocks(nodes[:, : sums[1].shape[1]], nodes, sums[1], of_nodes)


def _add_blocks(rows: Ints, columns: Ints, blocks: NDArray[np.floating], out: Sums) -> None:
    """Add blocks (r, rows, columns, k, d) to `rows` (r, .) and `columns` (r, .) of a matrix, if there are any."""
    if blocks.shape[1]:
        n = int(max(columns.max(), out.indices.max())) + 1
        keys = np.repeat(np.arange(len(out.indptr) - 1), np.diff(out.indptr)) * n + out.indices  # ascending
        np.add.at(out.value, np.searchsorted(keys, rows[:, :, None] * n + columns[:, None, :]), blocks)


def _sums_of_runs(
    loop: Loop, skins: Skins, p: Floats, shear: Any, d: int, types: Any, some: Ints, macro: Ints, asked: Any
) -> tuple[Ints, NDArray[np.floating], NDArray[np.floating]]:
    """Return the nodes and normals (r, columns) that `some` runs (r,) know, and their sums (r, rows, columns, k, d).

    These are those of macro-elements and of nodes, without rows where they are not `asked` (2,). `types`: those of the
    faces of all of them; `macro` (r,): their macro-elements.
    """
    runs, sizes, nodes = loop.runs, *_known(skins, types, loop.runs.slave[some], loop.runs.master[some])
    n_rows, k = (sizes[0] + sizes[1]) * int(asked[1]), 2 if len(p) else d - 1
    count = runs.last[some] - runs.first[some]
    start = np.cumsum(count) - count
    q = np.arange(count.sum()) + np.repeat(runs.first[some] - start, count)
    s, m, of = (np.repeat(values, count) for values in (runs.slave[some], runs.master[some], macro))
    room, K = new_room((len(q),)), np.zeros((d * n_rows, d * sizes[2], len(q)))
    own = np.zeros((k * int(asked[0]), d * sizes[2], len(q)))
    differentiate(skins, loop.points, q, s, m, types, d, room)
    if asked[0]:
        _add_to_macro(p, shear, q, loop.weight[q], loop.distance[q], d * sizes[2], d, room.rows, own)
    if asked[1]:
        _add_to_nodes(loop.points, skins, p, shear, q, of, s, loop.weight[q], sizes, d, room, K)

    def by_run(sums: NDArray[np.floating], k: int) -> NDArray[np.floating]:
        of_runs = np.add.reduceat(sums, start, axis=2).reshape(-1, k, sizes[2], d, len(some))
        return np.asarray(of_runs.transpose(4, 0, 2, 1, 3))

    return nodes, by_run(own, k), by_run(K, d)


def _known(skins: Skins, types: Any, s: Ints, m: Ints) -> tuple[tuple[int, int, int], Ints]:
    """Return the sizes of `_local` and what it writes, for arrays of faces of the same types: (faces, columns)."""
    k_s, k_m = skins.n_nodes[types[0]], skins.n_nodes[types[1]]
    known = [skins.nodes_s[s, :k_s], skins.nodes_m[m, :k_m]]
    if len(skins.normals):
        of = m if skins.of_master else s
        known.append(len(skins.x) + skins.normal_of[of, : n_normals(skins, k_s, k_m)])
    nodes = np.concatenate(known, axis=1)
    return (k_s, k_m, nodes.shape[1]), nodes


_add.plain = _add_arrays


@kernel(borrows=True)
def _add_to_macro(p: Any, shear: Any, q: Any, w: Any, g: Any, n: int, d: int, rows: Any, K: Any) -> None:
    """Add what point q, of weight w and gap g, gives to the sums K (., n) of its macro-element, by its `rows`."""
    if len(p) > 0:
        _add_gap(w, g, n, rows, K)
    elif len(shear) > 0:
        add_slip(shear, q, w, n, d, rows, K)


@kernel(borrows=True)
def _add_to_nodes(
    points: Any, skins: Any, p: Any, shear: Any, q: Any, macro: Any, s: Any, w: Any, sizes: Any, d: int, room: Any,
    K: Any,
) -> None:  # fmt: skip
    """Add what point q of a macro-element, on slave face s with weight w, gives to the sums K of the nodes."""
    if len(shear) > 0:
        load = (w * p[macro], w * shear.t[macro, 0], w * shear.t[macro, 1])
        add_traction(skins, points, shear, q, s, load, sizes, d, room, K)
    else:
        _add_force(points, q, w * p[macro], skins.of_master, sizes, d, room, K)


@kernel(borrows=True)
def _add_gap(w: Any, g: Any, n: int, rows: Any, K: Any) -> None:
    """Add what a point of weight w and gap g gives to the derivatives of the gaps and of the measure, K (2, n)."""
    for j in range(n):
        K[0, j] += w * (rows[GAP, j] + g * rows[STRETCH, j])
        K[1, j] += w * rows[STRETCH, j]


@kernel(borrows=True)
def _add_force(points: Any, q: Any, load: Any, of_master: bool, sizes: Any, d: int, room: Any, K: Any) -> None:
    """Add what a point with p w = `load` gives to the derivative of the forces on its nodes, K."""
    k_s, k_m, k = sizes
    rows, dM = room.rows, room.dN_m
    # dn is of the slave's nodes, of the normals, or, `of_master`, of all; dw of the slave's nodes, V of those of both
    low, high = (0, d * k_s) if k == k_s + k_m else (d * (k_s + k_m), d * k)
    if points.current == 1 or of_master:
        low, high = 0, d * k
    for i in range(d):
        n_i = points.normal[q, i]
        for j in range(low, high):  # dn + n dw/w, in the place of dn, which is not needed again
            rows[NORMAL + i, j] = load * (rows[NORMAL + i, j] + n_i * rows[STRETCH, j])
        for a in range(k_s):
            for j in range(low, high):
                K[d * a + i, j] += room.N_s[a] * rows[NORMAL + i, j]
        for b in range(k_m):
            M, u, v = room.N_m[b], load * n_i * dM[b, 0], load * n_i * dM[b, 1]  # in a plane the second slope is 0
            for j in range(d * k):
                slid = u * rows[SLIDE, j] + v * rows[SLIDE + 1, j]
                K[d * (k_s + b) + i, j] -= M * rows[NORMAL + i, j] + slid


@kernel(borrows=True)
def _add_row(K: Any, first: int, k: int, local: Any, n: int, sums: Any, row: int) -> None:
    """Add k rows of K, from `first` on, in the columns of n nodes and normals, to a row of a matrix."""
    indices, value, d = sums.indices, sums.value, sums.value.shape[2]
    low, high = sums.indptr[row], sums.indptr[row + 1]
    for b in range(n):
        at = position(indices, low, high, local[b])
        for i in range(k):
            for j in range(d):
                value[at, i, j] += K[first + i, d * b + j]
