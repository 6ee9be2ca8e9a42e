"""Recovery of a continuous contact pressure on the slave from the means p_m of macro-elements, after the solution.

The pressure p_m of a macro-element is a mean, so that as a function it is of first order whatever the cells. Away from
the boundary of the slave and from the edge of contact the means themselves are more accurate. Around each macro-element
a parabola (in space a quadric) in coordinates s along the surface is fitted to the means,

    p(s) = sum of q_t s^t,   sum over the patch of w_m (mean_m(p) - p_m)^2 least,   t: 1, s, s s

and the value at a node is the mean of the fits of its macro-elements. A patch is extended, ring by ring, until it has 6
macro-elements in the plane and 16 in space, whose weights are worth at least 3 and 12 equal ones. With fewer than 3 and
12, planes are fitted. Terms that the patch does not determine independently of those before them are left out. A linear
pressure is reproduced exactly on plane faces.

On the boundary of contact, which is that of the slave and of what the master covers, p_m has errors of order h times
the slope of p, which alternate and decrease to about a third from one macro-element to the next. The weights w_m are
those of least squares for such errors: the area A_m, a ninth of it for the last macro-element but one, and a ninth of
that for the last. Where means scatter more than p changes within a macro-element, such errors do not matter. There a
mean on the boundary that is as near to the fit as the others has its whole area, and the patch is fitted again. Also
in space patches are twice as wide there, if means scatter no more about the wide fit. Slopes and curvatures that
explain no more of the means than chance does (Fisher's F) are left out of that fit.

At the edge of contact p behaves as a square root, and the last macro-element in contact shares its force wrongly with
its neighbours (10 % of the peak; the sum is right). So for p >= 0, near an open macro-element, the last ones in contact
are merged with their neighbours, if at least 3 (12) remain, and p is the root of a parabola q such that the root has
the means p_m. In space patches are larger then, 36 macro-elements, and weights are areas:

    p(s) = sqrt(q(s)),   sum over the patch of A_g (mean_g(q) - p_g^2 - var_g(sqrt(q)))^2 least     (sqrt(q < 0): 0)

with var_g of the previous fit, since the mean of a square is the square of the mean plus the variance. The square of
Hertz's pressure is a parabola. Finally, each connected part of the contact gets the force of its p_m: linear
interpolation between nodes has less or more force than the root; missing force goes to the nodes shared with open
macro-elements, excess force is taken from the last nodes in contact. The rest is added where the fit misses the means
by more than they scatter and than p changes within a macro-element: at sharp edges of a body, where the pressure has no
bound. So it leaves the middle as it is. What no macro-element lacks is scaled onto all.

The accuracy of this recovery, and errors that no recovery can correct, are described in docs/theory.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import shape
from lacmesh.surface import Surface
from lacmesh.surface.normals import weighted
from lacsolver.bodies.small.fields import scatter
from lacsolver.results.patches import beside, nodes_of, ones, only, patches_of, scaled
from lacsolver.results.state import CONTACT, OPEN, UNPAIRED
from lacsolver.space.sparse import joined_columns

Bools = NDArray[np.bool_]

#: degree of the rule on faces, by their order: N times the Jacobian, with r
_DEGREE = {1: 5, 2: 8}
#: by the surface's dimension: number of macro-elements that a patch is extended to, and least number for a parabola
_MANY, _LEAST = {1: 6, 2: 16}, {1: 3, 2: 12}
#: number of macro-elements of a patch for roots
_MANY_ROOTS = {1: 6, 2: 36}
#: in space: number of macro-elements of a patch, twice as wide, where means alternate
_MANY_WIDE = 64
#: square that slopes or curvatures explain, over that by chance (F): they are left out below the first value, and whole
#: above the second
_CHANCE = (0.5, 2.0)
#: scatter squared about a wide fit, over that about the near one: the wide fit is taken below the first value
_ALIKE = (2.0, 4.0)
#: a term is left out if less than this fraction of its square is independent of the terms before it, and a direction if
#: its variance is less than this fraction of the largest
_THIN = 1e-2
#: weight of the macro-elements on the boundary, and of their neighbours, relative to their area
_RIM = (1 / 81, 1 / 9)
#: scatter squared, over the square of the change of p within a macro-element: weights on the boundary count below the
#: first value, and not above the second
_SCATTERED = (0.05, 0.5)
#: deviation from the fit squared, over the scatter squared: a mean is like the others below the first, and unlike above
_UNLIKE = (4.0, 16.0)
#: deviation from the mean, over its usual size: none of it is restored below the first value, all above the second
_POOR = (1.0, 2.0)
#: usual deviations from the mean, in scatters
_USUAL = 1.5
#: number of rings of macro-elements that are near the edge of contact
_NEAR = 9
#: number of fits of roots; largest factor by which the last nodes in contact are scaled
_TIMES, _MOST = 20, 2.0
#: number of patches that are in memory at once
_PIECE = 2048


def recover_pressure(
    surface: Surface,
    macro: Ints,
    pressure: Floats,
    status: Ints,
    *,
    axisymmetric: bool = False,
    unilateral: bool = True,
    coverage: Floats | None = None,
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return a continuous pressure of higher order at nodes (n_nodes,), and its mean over macro-elements (n_macros,).

    `surface`: the slave's faces; `macro` (faces,): macro-element of each face, negative for none; `pressure` p_m and
    `status` (n_macros,). `unilateral`: nodal values are not negative, and forces are those of p_m, on the `coverage`
    (n_macros,) of each macro-element; by default all that are paired are covered. Raises ValueError for shapes that do
    not agree.

    Between nodes the pressure is interpolated by the faces' shape functions. Nodes of no macro-element in contact have
    0, nodes off the slave's surface NaN; beyond the edge of contact the pressure falls to 0 in the next macro-element.
    The mean equals the value at the centroid up to terms of second order, and is more accurate than the value of the
    shape functions there.
    """
    macro, pressure, status = np.asarray(macro), np.asarray(pressure, dtype=float), np.asarray(status)
    if macro.shape != (len(surface),) or macro.max(initial=-1) >= len(pressure):
        raise ValueError(f"macro must be ({len(surface)},), and below {len(pressure)}")
    if pressure.ndim != 1 or status.shape != pressure.shape:
        raise ValueError(f"pressure and status must be (n_macros,), not {pressure.shape} and {status.shape}")
    ours = surface if (macro >= 0).all() else surface.take(np.flatnonzero(macro >= 0))
    slave = _slave(ours, macro[macro >= 0], status == UNPAIRED, axisymmetric)
    contact = (status >= CONTACT) & (slave.area > 0)
    means = np.where(contact, pressure, 0.0)
    p, scatter = _nodal_parabolas(slave, means, contact)
    if unilateral:
        opened = (status == OPEN) & (slave.area > 0)
        edge = beside(slave.touch, opened, 1) & contact
        near, last, outer = (
            nodes_of(slave.touch, m) for m in (beside(slave.touch, edge, _NEAR) & contact, edge, opened)
        )
        p = np.maximum(p, 0.0)
        if edge.any():
            p = np.where(near, _nodal_roots(slave, means, contact, edge), p)
        covered = slave.area * np.where(status == UNPAIRED, 0.0, 1.0 if coverage is None else coverage)
        p = _balanced(slave, p, means, contact, covered, scatter, last, last & outer)
    nodal = np.full(len(surface.x), np.nan)
    nodal[slave.nodes] = p
    return nodal, slave.means @ p


class _Slave(NamedTuple):
    """A slave surface: its nodes (k,) at x (k, 3), and its n macro-elements, or the sets that they are merged to.

    `area` (n,); `centroid` (n, 3); `moment` (n, 3, 3): mean of d d with d from the centroid; `means` M (n, k): means of
    nodal values; `touch` (k, n): 1 if the node belongs to a face of the macro-element; `trust` (n,): weight in fits
    over the area; `dim` of the surface.
    """

    nodes: Ints
    x: Floats
    area: Floats
    centroid: Floats
    moment: Floats
    means: csr_array
    touch: csr_array
    trust: Floats
    dim: int


def _slave(surface: Surface, macro: Ints, unpaired: Bools, axisymmetric: bool) -> _Slave:
    """Compute the data of a surface for the fits. A macro-element without extent has an area of 0."""
    rows, columns, values, n = [], [], [], len(unpaired)
    area, first, second = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3))
    for name, faces, nodes in surface.by_type():
        X, w = rule(CELLS[name].family, _DEGREE[CELLS[name].order])
        N, own = shape(name, X), macro[faces]
        at = np.einsum("qa,fas->fqs", N, surface.x[nodes])
        W = np.linalg.norm(weighted(name, surface.x[nodes], X), axis=2) * w
        W = W * (2 * np.pi * at[..., 0] if axisymmetric else 1.0)
        area += _summed(own, W.sum(axis=1), n)
        first += _summed(own, np.einsum("fq,fqs->fs", W, at), n)
        second += _summed(own, np.einsum("fq,fqs,fqt->fst", W, at, at), n)
        rows.append(np.repeat(own, nodes.shape[1]))
        columns.append(nodes.ravel())
        values.append((W @ N).ravel())
    m, (nodes, k) = np.concatenate(rows), np.unique(np.concatenate(columns), return_inverse=True)
    size = np.where(area > 0, area, 1.0)
    means = coo_array((np.concatenate(values) / size[m], (m, k)), shape=(n, len(nodes))).tocsr()
    touch = ones(coo_array((np.ones(len(m)), (k, m)), shape=(len(nodes), n)))
    centroid = first / size[:, None]
    moment = second / size[:, None, None] - _square(centroid)
    trust = _trust(touch, surface, macro, unpaired)
    return _Slave(nodes, surface.x[nodes], area, centroid, moment, means, touch, trust, surface.dim)


def _trust(touch: csr_array, surface: Surface, macro: Ints, unpaired: Bools) -> NDArray[np.floating]:
    """Return the factors (n,) `_RIM` for macro-elements on the boundary and their neighbours, and 1 for the others.

    Their boundary is that of the slave and that of the `unpaired` macro-elements.
    """
    ends = (surface.neighbours < 0) & (np.arange(surface.neighbours.shape[1]) < surface.n_corners[:, None])
    rim = np.isin(np.arange(touch.shape[1]), macro[ends.any(axis=1)]) | beside(touch, unpaired, 1)
    steps = np.sum([~beside(touch, rim, k) for k in range(len(_RIM))], axis=0)
    return np.array([*_RIM, 1.0])[steps]


def _nodal_parabolas(slave: _Slave, means: Floats, contact: Bools) -> tuple[NDArray[np.floating], Floats]:
    """Return nodal values (k,) of parabolas fitted to the means in contact, and the scatter (n,) of the means.

    Nodes of no such macro-element have 0.
    """
    touch = only(slave.touch, contact)
    values, scatter = _fitted(slave, touch, means)
    return _mean(touch, values), scatter


def _nodal_roots(slave: _Slave, means: Floats, contact: Bools, edge: Bools) -> NDArray[np.floating]:
    """Return nodal values (k,) of roots of parabolas, 0 where these are negative, whose means are fitted to p_m.

    The macro-elements at the `edge` of contact are merged with their neighbours.
    """
    merged, W = _merged(slave, contact, edge)
    if len(merged.area) < _LEAST[slave.dim]:
        merged, W = _merged(slave, contact, np.zeros_like(edge))
    q, _ = _fitted(merged, merged.touch, W @ means, root=True)
    return np.sqrt(np.maximum(_mean(merged.touch, q), 0.0))


def _merged(slave: _Slave, contact: Bools, last: Bools) -> tuple[_Slave, csr_array]:
    """Merge the `last` macro-elements in contact into their neighbours; return the merged slave, and W, the new means.

    W (merged, n) takes means over macro-elements to means over the merged ones.
    """
    shares = scaled(ones(slave.touch.T @ slave.touch), contact & ~last, last)
    count = shares.sum(axis=0)
    kept = contact & (~last | (count == 0))
    shares = scaled(shares, 1.0, np.divide(1.0, count, out=np.zeros_like(count), where=count > 0))
    shares = (shares + diags_array(kept.astype(float))).tocsr()[np.flatnonzero(kept)]
    area = shares @ slave.area
    W = scaled(shares, 1 / area, slave.area)
    centroid = W @ slave.centroid
    second = W @ (slave.moment + _square(slave.centroid)).reshape(-1, 9)
    merged = slave._replace(
        area=area, centroid=centroid, moment=second.reshape(-1, 3, 3) - _square(centroid), means=W @ slave.means,
        touch=ones(slave.touch @ shares.T), trust=np.ones_like(area),
    )  # fmt: skip
    return merged, W


def _balanced(
    slave: _Slave, p: Floats, means: Floats, contact: Bools, covered: Floats, scatter: Floats, last: Bools,
    outer: Bools,
) -> NDArray[np.floating]:  # fmt: skip
    """Correct nodal values p >= 0 (k,) so that each connected part of the contact has the force of its p_m.

    The force is that on the `covered` areas (n,). Missing force is first given to the `outer` nodes (k,), up to the
    p_m next to them; then the `last` nodes are scaled, within bounds; then nodes where the fit misses the means by more
    than their `scatter` (n,) are corrected; then all are scaled.
    """
    touch = only(slave.touch, contact)
    part = joined_columns(touch)
    held = np.flatnonzero(np.diff(touch.indptr))
    of_node = part[touch.indices[touch.indptr[held]]]
    integral = (slave.means.T @ covered)[held]
    wanted, out = np.bincount(part, covered * means), p[held]

    def lacking(share: Floats) -> NDArray[np.floating]:
        """Return the missing force of each part, (parts,), relative to the force of a share of the pressures."""
        lack = wanted - np.bincount(of_node, integral * out, minlength=len(wanted))
        theirs = np.bincount(of_node, integral * share, minlength=len(wanted))
        return np.divide(lack, theirs, out=np.zeros_like(wanted), where=theirs > 0)

    more = np.maximum(lacking(outer[held].astype(float)), 0.0)[of_node]
    out = out + np.where(outer[held], np.minimum(more, (touch @ means)[held]), 0.0)
    factor = np.clip(1 + lacking(np.where(last[held], out, 0.0)), 1 / _MOST, _MOST)[of_node]
    out = np.where(last[held], out * factor, out)
    balanced = p.copy()
    balanced[held] = out
    missed = _missed(slave, balanced, means, scatter)
    missed = np.where(missed * np.sign(lacking(np.ones_like(out)))[part] > 0, missed, 0.0)
    local = (touch @ (covered * missed))[held] / np.maximum((touch @ covered)[held], np.finfo(float).tiny)
    local = np.maximum(local, -out)
    out = out + np.minimum(np.abs(lacking(np.abs(local))), 1.0)[of_node] * local
    balanced[held] = out * (1 + lacking(out))[of_node]
    return balanced


def _missed(slave: _Slave, p: Floats, means: Floats, scatter: Floats) -> NDArray[np.floating]:
    """Return by how much (n,) the means of nodal values p miss `means`, 0 where that is usual.

    Usual are some times the `scatter` (n,), and the standard deviation of p at the nodes of the macro-element.
    """
    mean, count = slave.means @ p, np.maximum(slave.touch.sum(axis=0), 1)
    square = slave.touch.T @ p**2 - 2 * mean * (slave.touch.T @ p)
    usual = np.sqrt(np.maximum(square / count + mean**2, 0.0) + (_USUAL * scatter) ** 2)
    return np.asarray((means - mean) * _between(np.abs(means - mean), usual, _POOR))


# ---- fits


def _fitted(
    slave: _Slave, touch: csr_array, means: Floats, *, root: bool = False
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Fit a parabola around each macro-element in `touch` to `means`, by its own means or those of its root.

    Return its values at the nodes of its macro-element, in the order of `touch`, and the scatter of the means about it.
    In space, where means alternate, the fit is on a wide patch, if it is as near to these means.
    """
    every, many = np.ones(touch.shape[1], dtype=bool), (_MANY_ROOTS if root else _MANY)[slave.dim]
    values, scatter, alternate = _fits(slave, touch, means, every, many, root=root)
    if slave.dim == 2 and alternate.any():
        some = alternate > 0
        wide, wider, _ = _fits(slave, touch, means, some, _MANY_WIDE, wide=True)
        alternate[some] *= 1 - _between(wider**2, scatter[some] ** 2, _ALIKE)
        values = values + alternate[touch.indices] * (wide - values)
    return values, scatter


def _fits(
    slave: _Slave, touch: csr_array, means: Floats, some: Bools, many: int, *, root: bool = False, wide: bool = False
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Fit on patches of at least so `many` macro-elements, around `some` (n,).

    Return the values at their nodes, in the order of `touch`, 0 for the others; for each fit the scatter of the means,
    and a factor, 1 where means alternate.
    """
    patches = patches_of(touch, many, _LEAST[slave.dim], slave.trust)[np.flatnonzero(some)]
    pieces = [_fit_piece(slave, patches[k : k + _PIECE], means, root, wide) for k in range(0, patches.shape[0], _PIECE)]
    q, x_bar, axis, scatter, alternate = (np.concatenate(of_pieces) for of_pieces in zip(*pieces, strict=True))
    values, there = np.zeros(touch.nnz), some[touch.indices]
    row = np.repeat(np.arange(len(slave.x)), np.diff(touch.indptr))[there]
    g = (np.cumsum(some) - 1)[touch.indices[there]]
    s = np.einsum("rs,rsn->rn", slave.x[row] - x_bar[g], axis[g])
    values[there] = (_powers(s) * q[g]).sum(axis=1)
    return values, scatter, alternate


def _fit_piece(
    slave: _Slave, patches: csr_array, means: Floats, root: bool, wide: bool
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Fit the parabolas of some patches (k, n), in coordinates s = axis . (x - x_bar).

    Return their coefficients (k, terms), x_bar (k, 3), axis (k, 3, dim), the scatter (k,) of the means, and a factor
    (k,), 1 where means alternate; for roots both are 0. Fits on `wide` patches lack terms that are due to scatter.
    """
    k = patches.shape[0]
    row, g = np.repeat(np.arange(k), np.diff(patches.indptr)), patches.indices
    given, trust = means[g], slave.trust[g]
    basis = _basis(slave, patches, trust)
    if root:
        wanted = given**2
        for _ in range(_TIMES):
            value = np.sqrt(np.maximum(basis.values(basis.fit(wanted)), 0.0))
            # a third of a step: longer steps may oscillate about the solution
            wanted = (2 * wanted + given**2 + value.var(axis=1)) / 3
        return basis.fit(wanted), basis.x_bar, basis.axis, np.zeros(k), np.zeros(k)
    value = basis.values(basis.fit(given))
    square = (given - value.mean(axis=1)) ** 2
    scatter, change = _summed(row, basis.weight * square, k), 12 * value.var(axis=1)  # 12: of a linear p, from variance
    noisy = _between(scatter[row], change, _SCATTERED)
    like = 1 - _between(square, scatter[row], _UNLIKE)
    alternate = _between(scatter, _summed(row, basis.weight * change, k), _SCATTERED)
    basis = _basis(slave, patches, trust + (1 - trust) * noisy * like)
    q = _without_chance(basis, given) if wide else basis.fit(given)
    if wide:
        scatter = _summed(row, basis.weight * (given - basis.values(q).mean(axis=1)) ** 2, k)
    return q, basis.x_bar, basis.axis, np.sqrt(scatter), alternate


def _without_chance(basis: _Basis, given: Floats) -> NDArray[np.floating]:
    """Return the coefficients (k, terms) of fits to `given` (r,), without terms that are due to scatter.

    By Fisher's F: the square that slopes or curvatures explain, over the square that as many explain by chance.
    """
    k, q, square, terms = len(basis.x_bar), [], [], []
    for fit in (basis.at_most(1), basis.at_most(1 + basis.axis.shape[2]), basis):
        q.append(fit.fit(given))
        off = given - fit.values(q[-1]).mean(axis=1)
        square.append(_summed(basis.row, basis.weight * off**2, k))
        terms.append(np.count_nonzero(np.einsum("kii->ki", fit.inverse), axis=1))
    by_chance = square[2] / np.maximum(np.bincount(basis.row, minlength=k) - terms[2], 1)
    found = q[0]
    for t in (1, 2):
        sure = _between(square[t - 1] - square[t], (terms[t] - terms[t - 1]) * by_chance, _CHANCE)
        found = found + sure[:, None] * (q[t] - q[t - 1])
    return np.asarray(found)


class _Basis(NamedTuple):
    """Terms of the parabolas of k patches, with r macro-elements in all, of the patches `row` (r,).

    `x_bar` (k, 3), `axis` (k, 3, dim); `points` (r, p, terms): at points of each macro-element, the mean of whose
    values is that of the macro-element; `weight` (r,), with a sum of 1 in each patch; `normal` (k, terms, terms):
    the matrix of the normal equations; its `inverse`, with zeros for terms that are left out.
    """

    row: Ints
    x_bar: Floats
    axis: Floats
    points: Floats
    weight: Floats
    normal: Floats
    inverse: Floats

    def at_most(self, terms: int) -> _Basis:
        """Return the basis of the first `terms`."""
        return self._replace(inverse=_inverse_of_independent(self.normal, np.full(len(self.normal), terms)))

    def fit(self, wanted: Floats) -> NDArray[np.floating]:
        """Return the coefficients (k, terms) of the parabolas whose means are nearest to those `wanted` (r,)."""
        right = _summed(self.row, (self.weight * wanted)[:, None] * self.points.mean(axis=1), len(self.x_bar))
        return np.asarray(np.einsum("kij,kj->ki", self.inverse, right))

    def values(self, q: Floats) -> NDArray[np.floating]:
        """Return the values (r, p) of parabolas with coefficients q (k, terms) at the points."""
        return np.asarray(np.einsum("rpt,rt->rp", self.points, q[self.row]))


def _basis(slave: _Slave, patches: csr_array, trust: Floats) -> _Basis:
    """Compute the terms of parabolas on some patches (k, n), whose macro-elements weigh `trust` (r,) of their area."""
    k, dim, number = patches.shape[0], slave.dim, np.diff(patches.indptr)
    row, g = np.repeat(np.arange(k), number), patches.indices
    weight = slave.area[g] * trust
    weight = weight / _summed(row, weight, k)[row]
    x_bar = _summed(row, weight[:, None] * slave.centroid[g], k)
    d = slave.centroid[g] - x_bar[row]
    axis = _axes(_summed(row, weight[:, None, None] * _square(d), k), dim)
    # Gauss points of a macro-element: exact for means of parabolas, and nearly so for those of roots
    size, turn = np.linalg.eigh(np.einsum("rsn,rst,rtm->rnm", axis[row], slave.moment[g], axis[row]))
    off = np.swapaxes(np.sqrt(np.maximum(dim * size, 0.0))[:, None] * turn, 1, 2)
    middle = np.einsum("rs,rsn->rn", d, axis[row])[:, None]
    points = _powers(np.concatenate([middle - off, middle + off], axis=1))
    normal = _summed(row, weight[:, None, None] * _square(points.mean(axis=1)), k)
    inverse = _inverse_of_independent(normal, np.where(number < _LEAST[dim], 1 + dim, points.shape[2]))
    return _Basis(row, x_bar, axis, points, weight, normal, inverse)


def _between(x: Floats, y: Floats, ends: tuple[float, float]) -> NDArray[np.floating]:
    """Return 0 where x / y >= 0 is at most the first of the `ends`, 1 above the second, linear between; 0 / 0 is 0."""
    low, high = ends
    over = np.divide(x - low * y, (high - low) * y, out=np.where(x > 0, 1.0, 0.0), where=y > 0)
    return np.asarray(np.clip(over, 0.0, 1.0))


def _axes(spread: Floats, dim: int) -> NDArray[np.floating]:
    """Return principal axes (k, 3, dim) of patches, from means of d d, over their deviations; 0 for thin directions."""
    variance, axes = np.linalg.eigh(spread)
    variance, axes = variance[:, : -1 - dim : -1], axes[:, :, : -1 - dim : -1]
    there = variance > _THIN * variance[:, :1]
    return np.where(there[:, None], axes / np.sqrt(np.where(there, variance, 1.0))[:, None], 0.0)


def _powers(s: Floats) -> NDArray[np.floating]:
    """Return the terms of a parabola (..., terms): 1, the coordinates (..., dim), their products."""
    a, b = np.triu_indices(s.shape[-1])
    return np.concatenate([np.ones((*s.shape[:-1], 1)), s, s[..., a] * s[..., b]], axis=-1)


def _inverse_of_independent(normal: Floats, most: Ints) -> NDArray[np.floating]:
    """Return the inverse of normal equations (k, t, t), restricted to independent terms, 0 for the others.

    A term is taken if it is among the first `most` (k,), and if enough of it is left after those before it are
    eliminated: its pivot in Gauss's elimination, relative to its diagonal.
    """
    independent, left = np.zeros(normal.shape[:2], dtype=bool), normal.copy()
    for t in range(normal.shape[1]):
        pivot = left[:, t, t]
        independent[:, t] = (pivot > _THIN * normal[:, t, t]) & (t < most)
        inverse = np.divide(1.0, pivot, out=np.zeros(len(left)), where=independent[:, t])
        left -= inverse[:, None, None] * left[:, :, t, None] * left[:, t, None, :]
    both = independent[:, :, None] & independent[:, None, :]
    return np.where(both, np.linalg.inv(np.where(both, normal, np.eye(normal.shape[1]))), 0.0)


def _mean(touch: csr_array, values: Floats) -> NDArray[np.floating]:
    """Return the mean (k,) of values of each node's macro-elements, given in the order of `touch`; 0 without any."""
    count = np.diff(touch.indptr)
    total = _summed(np.repeat(np.arange(len(count)), count), values, len(count))
    return np.divide(total, count, out=np.zeros(len(count)), where=count > 0)


def _summed(row: Ints, values: Floats, k: int) -> NDArray[np.floating]:
    """Return the sums (k, ...) of values (r, ...) with the same row number."""
    out = np.zeros((k, int(np.prod(values.shape[1:]))))
    scatter(out, row[:, None], np.ascontiguousarray(values).reshape(len(row), 1, out.shape[1]))
    return out.reshape(k, *values.shape[1:])


def _square(d: Floats) -> NDArray[np.floating]:
    """Return the dyadic products d d (..., n, n) of vectors (..., n)."""
    return d[..., :, None] * d[..., None, :]
