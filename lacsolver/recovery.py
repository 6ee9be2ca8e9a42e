"""Continuous fields from what a solution knows at points and in the mean: nodal stress, and pressure on the slave.

    stress at integration points -> at nodes                            (nodal_stress)
    nodal stress -> the pressure that the slave's own stress says       (slave_pressure)
    p_m, and that pressure -> a continuous pressure of higher order     (recover_pressure)

The pressure p_m of a macro-element is a mean, so as a function it is of first order whatever the cells. Away from the
edge of contact the means themselves are better than that, and better than the stress of linear cells, so a plane is
fitted to them around each node:

    p(x_i) = a + b.(x_i - x_bar),  sum over the patch of A_m (a + b.(c_m - x_bar) - p_m)^2 least           F p_m

c_m the centroid of T_m (weighted with 2 pi r in axisymmetry), so that a linear pressure is met exactly on plane faces.
The patch of a node is its own macro-elements in contact, grown by their neighbours where these do not go round the
node. On quadratic faces what the means of the fit, M p, lack is fitted and added once: p + F(p_m - M p).

In the plane, where three macro-elements are left for it, it is a parabola instead, fitted to six of them and more. At
the rim of the slave p_m is off by a part of order h of the slope of p, alternately and less from one macro-element to
the next: the last two are left out.

At the edge of contact the active set lets the last macro-elements share their force wrongly (one too much, the next too
little; measured 10 % of the peak, the sum is right), and the exact pressure has a square-root there.

In the plane, where p >= 0, p is the root of a parabola: the square of Hertz's pressure is one. The last macro-element
in contact is merged with the one beside it, as their sum is right, and around each node a parabola q is fitted so that
the means of its root are those of p_m,

    p(x_i) = sqrt(q(x_i)),   sum over the patch of A_g (mean_g(q) - p_g^2 - var_g(sqrt(q)))^2 least     (sqrt(q < 0): 0)

var_g of the last fit, as the mean of a square is that of the mean and the variance. The slave's stress is no help: it
follows p_m in its wrong shares. In space, where a patch is as wide as the contact, and with fewer than three
merged macro-elements, it is the better witness of the shape, p_m still of the size: p = t + F(p_m - M t), t the slave's
stress, with open neighbours in the patches. Nodes of macro-elements in contact at most some steps from an open one get
these.

Last, where p >= 0, each connected part of the contact gets the force of its p_m. Where roots are taken, the difference
is near the edge: what straight lines between nodes hold less than the root goes to the nodes that open macro-elements
share, what they hold more is taken from the last macro-elements; else all nodes are scaled.

Measured (regular meshes, L2 norm over the slave): smooth pressure, rate 1.5 to 2 on linear cells, 1.9 to 3 on quadratic
ones (p_m: 1), in space 1.5 to 1.7 where the slave has a rim that p has a slope at; in the plane errors are 0.2
(quadratic cells) to 0.7 of what planes through all means make there, with 32 macro-elements from rim to rim.
Hertz, of the error of p_m: in the plane and about an axis 0.1 to 0.5 with 5 to 30 macro-elements to the
half-width, wherever the edge falls in its macro-element (by the stress alone, as in space, 0.3 to 0.65); in space, with
only 2 to 4, 0.36 to 0.46 on linear cells and 0.41 to 0.6 on quadratic ones (0.67 on the `hexa` cut of HEXA20), where
the best that the nodes could hold is near 0.4. Roots, or merging before t + F(p_m - M t), were no better there.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.quadrature import rule
from lacmesh.shapes import shape
from lacmesh.surface import Surface
from lacmesh.surface.normals import weighted
from lacsolver.assemble import weights
from lacsolver.assemble.fields import Field, scatter
from lacsolver.rules import cell_rule
from lacsolver.space import Space
from lacsolver.state import CONTACT, OPEN, UNPAIRED

Bools = NDArray[np.bool_]

#: products of reference coordinates (by their places) that a stress is fitted with, beside 1, in a family of cells
_TERMS: dict[str, tuple[tuple[int, ...], ...]] = {
    "TRIA": ((0,), (1,)),
    "QUAD": ((0,), (1,), (0, 1)),
    "TETRA": ((0,), (1,), (2,)),
    "HEXA": ((0,), (1,), (2,), (0, 1), (1, 2), (0, 2), (0, 1, 2)),
    "PENTA": ((0,), (1,), (2,), (0, 2), (1, 2)),
    "PYRAM": ((0,), (1,), (2,)),
}
#: degree of the rule on faces, by their order: N times the Jacobian, with r
_DEGREE = {1: 5, 2: 8}
#: a patch grows to this many rings of macro-elements, and is large enough, by the surface's dimension, with so many
_RINGS, _ENOUGH = 3, {1: 2, 2: 5}
#: a patch has no slope along a direction in which its variance is less than this part of the largest
_THIN = 1e-2
#: rings of macro-elements along the edge of contact where the slave's stress says the shape; a parabola
_EDGE, _NEAR = 2, 9
#: macro-elements that a patch for a parabola grows to, in at most so many rings, and that it must have
_MANY, _WIDE, _LEAST = 6, 8, 3
#: how often the parabolas are fitted; the most that the last nodes in contact are scaled by
_TIMES, _MOST = 20, 2.0


def nodal_stress(space: Space, field: Field, cells: Ints | None = None) -> NDArray[np.floating]:
    """(n_nodes, 4 or 6): a stress given at the integration points of the stiffness (cells, points, n), at the nodes.

    In each cell a polynomial is fitted to the points, as rich as the shape functions of the linear cell, and taken to
    the cell's nodes; a node has the mean of its cells, weighted with their volumes. A constant is met exactly, and a
    linear stress on affine cells whose points can tell its slope: not where there is one point (TRIA3, TETRA4), nor
    along the axis of PYRAM5, whose points lie in one plane.

    The mean is over all the cells of a node, whatever their material; `cells` (indices in the mesh) names those to
    count, such as one body's, where a stress may jump. Nodes without any have NaN.
    """
    n = space.mesh.n_nodes
    total, volume = np.zeros((n, space.model.n_stress)), np.zeros((n, 1))
    for block, given, W in zip(space.blocks, field, weights(space), strict=True):
        rows = np.arange(len(block.cell)) if cells is None else np.flatnonzero(np.isin(block.cell, cells))
        size = W[rows].sum(axis=1)[:, None, None]
        at = extrapolation(block.type, space.model.axisymmetric) @ given[rows]
        scatter(total, block.nodes[rows], np.ascontiguousarray(at * size))
        scatter(volume, block.nodes[rows], np.repeat(size, block.nodes.shape[1], axis=1))
    return np.divide(total, volume, out=np.full_like(total, np.nan), where=volume > 0)


@cache
def extrapolation(name: str, axisymmetric: bool = False) -> NDArray[np.floating]:
    """(n_nodes, q): takes values at a cell's integration points to its nodes, by weighted least squares."""
    X, w = cell_rule(name, axisymmetric)
    middle, root = w @ X / w.sum(), np.sqrt(w)
    terms = _TERMS[CELLS[name].family]

    def values(at: Floats) -> NDArray[np.floating]:
        # about the middle of the points: where they cannot tell a slope, the shortest solution has none
        return np.stack([np.ones(len(at)), *((at - middle)[:, t].prod(axis=1) for t in map(list, terms))], axis=1)

    fit = np.linalg.pinv(values(X) * root[:, None], rcond=1e-10) * root
    return values(np.array(CELLS[name].reference)) @ fit


def slave_pressure(surface: Surface, stress: Floats) -> NDArray[np.floating]:
    """(n_nodes,): -n.sigma.n at the nodes of a surface, from a nodal stress (n_nodes, 4 or 6); NaN at other nodes.

    A node of several faces has the mean over their normals, weighted with the faces' areas.
    """
    total, weight = np.zeros((len(surface.x), 1)), np.zeros((len(surface.x), 1))
    xx, yy, zz, xy, *shear = (stress[:, k] for k in range(stress.shape[1]))
    for name, _, nodes in surface.by_type():
        n = weighted(name, surface.x[nodes], np.array(CELLS[name].reference))
        size = np.linalg.norm(n, axis=2)
        n = np.divide(n, size[..., None], out=np.zeros_like(n), where=size[..., None] > 0)
        p = -(xx[nodes] * n[..., 0] ** 2 + yy[nodes] * n[..., 1] ** 2 + 2 * xy[nodes] * n[..., 0] * n[..., 1])
        if shear:
            p -= zz[nodes] * n[..., 2] ** 2
            p -= 2 * (shear[0][nodes] * n[..., 1] * n[..., 2] + shear[1][nodes] * n[..., 0] * n[..., 2])
        area = np.repeat(size.mean(axis=1)[:, None, None], nodes.shape[1], axis=1)
        scatter(total, nodes, np.ascontiguousarray(p[..., None] * area))
        scatter(weight, nodes, area)
    return np.divide(total, weight, out=np.full_like(total, np.nan), where=weight > 0)[:, 0]


def recover_pressure(
    surface: Surface,
    macro: Ints,
    pressure: Floats,
    status: Ints,
    *,
    traction: Floats | None = None,
    axisymmetric: bool = False,
    unilateral: bool = True,
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """A continuous pressure of higher order: at nodes (n_nodes,), and its mean over each macro-element (n_macros,).

    `surface`: the slave's faces; `macro` (faces,): the macro-element of each, negative for none; `pressure` p_m and
    `status` (n_macros,). `traction` (n_nodes,): the pressure that the slave's stress says (`slave_pressure`); without
    it the edge of contact in space is less sharp. `unilateral`: no nodal value is below 0, and forces are those of p_m.

    Between nodes the faces' own shape functions hold. Nodes of no macro-element in contact have 0, nodes off the
    slave's surface NaN; beyond the edge of contact the pressure falls to 0 in the next macro-element. The mean is the
    value at the centroid but for terms of second order, and a better one than the value of the shape functions there.
    See the module for the method, and for what it is worth.
    """
    macro, pressure, status = np.asarray(macro), np.asarray(pressure, dtype=float), np.asarray(status)
    if macro.shape != (len(surface),) or macro.max(initial=-1) >= len(pressure):
        raise ValueError(f"macro must be ({len(surface)},), and below {len(pressure)}")
    if pressure.ndim != 1 or status.shape != pressure.shape:
        raise ValueError(f"pressure and status must be (n_macros,), not {pressure.shape} and {status.shape}")
    ours = surface if (macro >= 0).all() else surface.take(np.flatnonzero(macro >= 0))
    slave = _slave(ours, macro[macro >= 0], len(pressure), axisymmetric)
    contact = (status == CONTACT) & (slave.area > 0)
    means = np.where(contact, pressure, 0.0)
    opened = (status == OPEN) & (slave.area > 0)
    p = _fitted(slave, means, contact, opened, traction)
    if unilateral:
        edge = _beside(slave.touch, opened, 1) & contact
        root, taken = _roots(slave, means, contact, edge)
        last = taken & (slave.touch @ edge.astype(float) > 0)
        outer = last & (slave.touch @ opened.astype(float) > 0)
        p = np.where(taken, root, np.maximum(p, 0.0))
        p = _balanced(slave, p, means, contact, status != UNPAIRED, last, outer)
    nodal = np.full(len(surface.x), np.nan)
    nodal[slave.nodes] = p
    return nodal, slave.means @ p


class _Slave(NamedTuple):
    """A slave surface's nodes (k,) at x (k, 3) and macro-elements: area (n,), centroid (n, 3), means M (n, k).

    `touch` (k, n): 1 where a face of the macro-element holds the node. `dim` of the surface, `order` of its faces.
    `spread` (n,): the mean square of the distance from the centroid.
    """

    nodes: Ints
    x: Floats
    area: Floats
    centroid: Floats
    spread: Floats
    means: csr_array
    touch: csr_array
    dim: int
    order: int


def _slave(surface: Surface, macro: Ints, n: int, axisymmetric: bool) -> _Slave:
    """What the fits need of a surface. A macro-element without extent has an area of 0, and says nothing."""
    rows, columns, values = [], [], []
    area, moment, square, order = np.zeros((n, 1)), np.zeros((n, 3)), np.zeros((n, 1)), 1
    for name, faces, nodes in surface.by_type():
        X, w = rule(CELLS[name].family, _DEGREE[CELLS[name].order])
        N = shape(name, X)
        at = np.einsum("qa,fas->fqs", N, surface.x[nodes])
        W = np.linalg.norm(weighted(name, surface.x[nodes], X), axis=2) * w
        W = W * (2 * np.pi * at[..., 0] if axisymmetric else 1.0)
        scatter(area, macro[faces, None], W.sum(axis=1)[:, None, None])
        scatter(moment, macro[faces, None], np.einsum("fq,fqs->fs", W, at)[:, None])
        scatter(square, macro[faces, None], np.einsum("fq,fqs,fqs->f", W, at, at)[:, None, None])
        rows.append(np.repeat(macro[faces], nodes.shape[1]))
        columns.append(nodes.ravel())
        values.append((W @ N).ravel())
        order = max(order, CELLS[name].order)
    m, (nodes, k) = np.concatenate(rows), np.unique(np.concatenate(columns), return_inverse=True)
    size = np.where(area > 0, area, 1.0)
    means = coo_array((np.concatenate(values) / size[m, 0], (m, k)), shape=(n, len(nodes))).tocsr()
    touch = _ones(coo_array((np.ones(len(m)), (k, m)), shape=(len(nodes), n)).tocsr())
    centroid = moment / size
    spread = np.maximum(square[:, 0] / size[:, 0] - (centroid**2).sum(axis=1), 0.0)
    return _Slave(nodes, surface.x[nodes], area[:, 0], centroid, spread, means, touch, surface.dim, order)


def _ones(matrix: csr_array) -> csr_array:
    """A matrix with 1 where the given one is not 0."""
    matrix.eliminate_zeros()
    matrix.data[:] = 1.0
    return matrix


def _only(touch: csr_array, macros: Bools) -> csr_array:
    """The columns of some macro-elements, the others empty."""
    return _ones((touch @ diags_array(macros.astype(float)).tocsr()).tocsr())


def _fitted(
    slave: _Slave, means: Floats, contact: Bools, opened: Bools, traction: Floats | None
) -> NDArray[np.floating]:
    """(k,): the pressure at the slave's nodes: F p_m, and at the edge of contact t + F(p_m - M t)."""
    M, touch = slave.means, slave.touch
    held = touch @ contact.astype(float) > 0
    F = _fit(slave, contact)
    p = F @ means
    for _ in range(slave.order - 1):
        p += F @ np.where(contact, means - M @ p, 0.0)
    smooth, taken = _smooth(slave, means, contact)
    p = np.where(taken, smooth, p)
    edge = _beside(touch, opened, _EDGE) & contact
    if traction is not None and edge.any():
        t = np.where(held, np.nan_to_num(traction[slave.nodes]), 0.0)
        around = contact | (_beside(touch, contact, 1) & opened)
        t += _fit(slave, around) @ np.where(around, means - M @ t, 0.0)
        p = np.where(touch @ edge.astype(float) > 0, t, p)
    return np.where(held, p, 0.0)


def _smooth(slave: _Slave, means: Floats, contact: Bools) -> tuple[NDArray[np.floating], Bools]:
    """(k,): parabolas fitted to the means in contact, but for the last two at a rim; and where they may be taken.

    Only in the plane.
    """
    if slave.dim != 1:
        return np.zeros(len(slave.x)), np.zeros(len(slave.x), dtype=bool)
    rim = np.diff((slave.touch.T @ slave.touch).tocsr().indptr) <= 2
    patch = _wide(_only(slave.touch, contact), contact & ~_beside(slave.touch, rim, 1))
    local = _patches(slave, patch)
    held = slave.touch @ contact.astype(float) > 0
    return local.value(local.fit(means[patch.indices])), held & (np.diff(patch.indptr) >= _LEAST)


def _roots(slave: _Slave, means: Floats, contact: Bools, edge: Bools) -> tuple[NDArray[np.floating], Bools]:
    """(k,): roots of parabolas, 0 where these are below 0, whose means are those of p_m; and where they may be taken:
    near the macro-elements at the `edge` of contact, which are merged with those beside them.

    Only in the plane.
    """
    if slave.dim != 1 or not edge.any():
        return np.zeros(len(slave.x)), np.zeros(len(slave.x), dtype=bool)
    merged, W = _merged(slave, contact, edge)
    patch = _wide(merged.touch, np.ones(len(merged.area), dtype=bool))
    local = _patches(merged, patch)
    q = _squares(local, (W @ means)[patch.indices] ** 2)
    near = slave.touch @ (_beside(slave.touch, edge, _NEAR) & contact).astype(float) > 0
    return np.sqrt(np.maximum(local.value(q), 0.0)), near & (np.diff(patch.indptr) >= _LEAST)


class _Patches(NamedTuple):
    """The patches of nodes (k,), a row for each of their macro-elements (r,); each patch has a coordinate of its own.

    `weight` (r, 1): share of the patch. Powers 2, 1, 0 of the coordinate at Gauss' two points, which say a mean: `low`,
    `high` (r, 3), and at the node (k, 3). `inverse` (k, 3, 3): of the normal equations.
    """

    row: Ints
    weight: Floats
    low: Floats
    high: Floats
    node: Floats
    inverse: Floats

    def fit(self, means: Floats) -> NDArray[np.floating]:
        """(k, 3): the parabolas whose means are nearest to those given (r,)."""
        right = _summed(self.row, self.weight * (self.low + self.high) / 2 * means[:, None], len(self.node))
        return np.asarray(np.einsum("kij,kj->ki", self.inverse, right))

    def value(self, q: Floats) -> NDArray[np.floating]:
        """(k,): of parabolas (k, 3), at the nodes."""
        return np.asarray((self.node * q).sum(axis=1))


def _patches(slave: _Slave, patch: csr_array) -> _Patches:
    """What parabolas along a line are fitted by, around each row of `patch` (k, n)."""
    k = patch.shape[0]
    row, g = np.repeat(np.arange(k), np.diff(patch.indptr)), patch.indices
    weight = (slave.area[g] / _summed(row, slave.area[g], k)[row])[:, None]
    x_bar = _summed(row, weight * slave.centroid[g], k)
    d = slave.centroid[g] - x_bar[row]
    variance, axes = np.linalg.eigh(_summed(row, weight[..., None] * d[:, :, None] * d[:, None, :], k))
    length = np.sqrt(np.where(variance[:, -1] > 0, variance[:, -1], 1.0))
    axis = axes[:, :, -1] / length[:, None]
    middle, off = (d * axis[row]).sum(axis=1), np.sqrt(slave.spread[g]) / length[row]
    low, high = np.vander(middle - off, 3), np.vander(middle + off, 3)
    mean = (low + high) / 2
    normal = _summed(row, weight[..., None] * mean[:, :, None] * mean[:, None, :], k)
    node = np.vander(((slave.x - x_bar) * axis).sum(axis=1), 3)
    return _Patches(row, weight, low, high, node, np.linalg.pinv(normal, rcond=1e-9, hermitian=True))


def _squares(patches: _Patches, squares: Floats) -> NDArray[np.floating]:
    """(k, 3): parabolas whose roots have means with these squares (r,)."""
    wanted = squares
    for _ in range(_TIMES):
        q = patches.fit(wanted)[patches.row]
        low, high = (np.sqrt(np.maximum((end * q).sum(axis=1), 0.0)) for end in (patches.low, patches.high))
        # a third of a step: longer ones may turn about the answer
        wanted = (2 * wanted + squares + (low - high) ** 2 / 4) / 3
    return patches.fit(wanted)


def _summed(row: Ints, values: Floats, k: int) -> NDArray[np.floating]:
    """(k, ...): values (r, ...) summed over their rows."""
    out = np.zeros((k, int(np.prod(values.shape[1:]))))
    scatter(out, row[:, None], np.ascontiguousarray(values).reshape(len(row), 1, out.shape[1]))
    return out.reshape(k, *values.shape[1:])


def _merged(slave: _Slave, contact: Bools, last: Bools) -> tuple[_Slave, csr_array]:
    """The macro-elements in contact, the `last` of them shared by those beside them; and W, which takes means."""
    inner = diags_array((contact & ~last).astype(float)).tocsr()
    shares = (inner @ _ones((slave.touch.T @ slave.touch).tocsr()) @ diags_array(last.astype(float))).tocsr()
    count = shares.sum(axis=0)
    kept = contact & (~last | (count == 0))
    shares = shares @ diags_array(np.divide(1.0, count, out=np.zeros_like(count), where=count > 0))
    shares = (shares + diags_array(kept.astype(float))).tocsr()[np.flatnonzero(kept)]
    area = shares @ slave.area
    W = (diags_array(1 / area) @ shares @ diags_array(slave.area)).tocsr()
    centroid = W @ slave.centroid
    spread = np.maximum(W @ (slave.spread + (slave.centroid**2).sum(axis=1)) - (centroid**2).sum(axis=1), 0.0)
    touch = _ones((slave.touch @ shares.T).tocsr())
    return slave._replace(area=area, centroid=centroid, spread=spread, means=W @ slave.means, touch=touch), W


def _wide(touch: csr_array, used: Bools) -> csr_array:
    """(k, n): the `used` macro-elements around each node, so many rings of all that a parabola has enough of them."""
    beside = _ones((touch.T @ touch).tocsr())
    for _ in range(_WIDE):
        small = np.diff(_only(touch, used).indptr) < _MANY
        grown = diags_array(small.astype(float)) @ touch @ beside
        touch = _ones((grown + diags_array((~small).astype(float)) @ touch).tocsr())
    return _only(touch, used)


def _balanced(
    slave: _Slave, p: Floats, means: Floats, contact: Bools, paired: Bools, last: Bools, outer: Bools
) -> NDArray[np.floating]:
    """(k,): p >= 0, so that in each connected part of the contact its force over what is paired is that of p_m.

    Force that lacks is given to the `outer` nodes (k,), up to the p_m beside them; then the `last` nodes are scaled,
    within bounds; then all.
    """
    touch = _only(slave.touch, contact)
    _, part = connected_components((touch.T @ touch).tocsr(), directed=False)
    held = np.flatnonzero(np.diff(touch.indptr))
    of_node = part[touch.indices[touch.indptr[held]]]
    integral = (slave.means.T @ np.where(paired, slave.area, 0.0))[held]
    wanted, out = np.bincount(part, slave.area * means), p[held]

    def lacking(share: Floats) -> NDArray[np.floating]:
        """(parts,): the force that lacks, over that of a share of the pressures."""
        lack = wanted - np.bincount(of_node, integral * out, minlength=len(wanted))
        theirs = np.bincount(of_node, integral * share, minlength=len(wanted))
        return np.divide(lack, theirs, out=np.zeros_like(wanted), where=theirs > 0)

    more = np.maximum(lacking(outer[held].astype(float)), 0.0)[of_node]
    out = out + np.where(outer[held], np.minimum(more, (touch @ means)[held]), 0.0)
    for some, most in ((last[held], _MOST), (np.ones(len(held), dtype=bool), np.inf)):
        factor = np.clip(1 + lacking(np.where(some, out, 0.0)), 1 / most, most)[of_node]
        out = np.where(some, out * factor, out)
    balanced = p.copy()
    balanced[held] = out
    return balanced


def _beside(touch: csr_array, macros: Bools, rings: int) -> Bools:
    """(n,): macro-elements at most so many steps, from node to node, away from some; these too."""
    for _ in range(rings):
        macros = touch.T @ (touch @ macros.astype(float) > 0).astype(float) > 0
    return macros


def _fit(slave: _Slave, used: Bools) -> csr_array:
    """F (k, n): takes means over macro-elements to the nodes, by a plane fitted to the `used` ones around each."""
    patch = _only(slave.touch, used)
    beside = _ones((patch.T @ patch).tocsr())
    F, wanted = csr_array(patch.shape), np.diff(patch.indptr) > 0
    for ring in range(1, _RINGS + 1):
        made, around = _planes(slave, patch)
        enough = around | ((np.diff(patch.indptr) >= _ENOUGH[slave.dim]) & (ring > 1))
        taken = wanted & (enough | (ring == _RINGS))
        F = F + diags_array(taken.astype(float)).tocsr() @ made
        wanted &= ~taken
        if not wanted.any():
            break
        patch = _ones((diags_array(wanted.astype(float)).tocsr() @ patch @ beside).tocsr())
    return F.tocsr()


def _planes(slave: _Slave, patch: csr_array) -> tuple[csr_array, Bools]:
    """The plane through the means of each patch (a row of k), and whether the patch goes round its node."""
    k = patch.shape[0]
    row, m = np.repeat(np.arange(k), np.diff(patch.indptr)), patch.indices
    size = _summed(row, slave.area[m], k)
    w = slave.area[m] / np.where(size > 0, size, 1.0)[row]
    x_bar = _summed(row, w[:, None] * slave.centroid[m], k)
    d = slave.centroid[m] - x_bar[row]
    spread = _summed(row, w[:, None, None] * d[:, :, None] * d[:, None, :], k)
    variance, axes = np.linalg.eigh(spread)
    there = (variance > _THIN * variance[:, -1:]) & (np.arange(3) >= 3 - slave.dim)
    inverse = np.divide(1.0, variance, out=np.zeros_like(variance), where=there)
    off = np.einsum("kij,ki->kj", axes, slave.x - x_bar)
    slope = np.einsum("kij,kj->ki", axes, off * inverse)
    coefficient = w * (1.0 + np.einsum("ms,ms->m", d, slope[row]))
    # a node farther out than the standard deviation of its patch would be extrapolated to
    around = (there.sum(axis=1) == slave.dim) & ((off**2 * inverse).sum(axis=1) <= 1.0 + 1e-9)
    around &= np.diff(patch.indptr) > slave.dim
    return csr_array((coefficient, m, patch.indptr), shape=patch.shape), around
