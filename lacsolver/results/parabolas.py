"""Parabolas fitted to the means of macro-elements of a surface, and roots of parabolas, for the recovery of pressures.

Around each macro-element a parabola (in space a quadric) in coordinates s along the surface is fitted to the means p_m,

    p(s) = sum of q_t s^t,   sum over the patch of w_m (mean_m(p) - p_m)^2 least,   t: 1, s, s s

A patch is extended, ring by ring, until it has 6 macro-elements in the plane and 16 in space, whose weights are worth
at least 3 and 12 equal ones. With fewer than 3 and 12, planes are fitted, and paraboloids of revolution for roots.
Terms that the patch does not determine independently of those before them are left out.

The weights w_m are the areas A_m, times a factor for less trust at a boundary. Where means scatter more than p changes
within a macro-element, errors at a boundary do not matter. There a mean on the boundary that is as near to the fit as
the others has its whole area, and the patch is fitted again. Also in space patches are twice as wide there, if means
scatter no more about the wide fit. Slopes and curvatures that explain no more of the means than chance does (Fisher's
F) are left out of that fit.

A root p = sqrt(q) of a parabola q, 0 where q < 0, has the means p_g if

    mean_g(q) = p_g^2 + var_g(sqrt(q)) + mean_g(min(q, 0))

since the mean of a square is the square of the mean plus the variance. The right side is that of the fit before. In
space patches are larger then, 36 macro-elements, and weights are areas.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacsolver.bodies.assembly import scatter
from lacsolver.results.patches import patches_of

Bools = NDArray[np.bool_]

#: by the surface's dimension: number of macro-elements that a patch is extended to, and least number for a parabola
MANY, LEAST = {1: 6, 2: 16}, {1: 3, 2: 12}
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
#: scatter squared, over the square of the change of p within a macro-element: weights on the boundary count below the
#: first value, and not above the second
_SCATTERED = (0.05, 0.5)
#: deviation from the fit squared, over the scatter squared: a mean is like the others below the first, and unlike above
_UNLIKE = (4.0, 16.0)
#: Gauss points along each axis of macro-elements that reach beyond the edge of contact, where the root has its end
_FINE = 8
#: number of patches that are in memory at once
PIECE = 2048
#: number of fits of roots; most of its last step that an iteration goes on by, or back from
_TIMES, _FURTHER = 20, 3.0


class Slave(NamedTuple):
    """A slave surface: its nodes (k,) at x (k, 3), and its n macro-elements, or the sets that they are merged to.

    `area` (n,); `centroid` (n, 3); `moment` (n, 3, 3): mean of d d with d from the centroid; `means` M (n, k): means of
    nodal values; `touch` (k, n): 1 if the node belongs to a face of the macro-element; `trust` (n,): weight in fits
    over the area; `ends` (n,): True if the contact may end within: linear faces, or a set that has an open one;
    `dim` of the surface.
    """

    nodes: Ints
    x: Floats
    area: Floats
    centroid: Floats
    moment: Floats
    means: csr_array
    touch: csr_array
    trust: Floats
    ends: Bools
    dim: int


def fitted(
    slave: Slave, touch: csr_array, means: Floats, *, root: bool = False
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Fit a parabola around each macro-element in `touch` to `means`, by its own means or those of its root.

    Return its values at the nodes of its macro-element, in the order of `touch`, and the scatter of the means about it.
    In space, where means alternate, the fit is on a wide patch, if it is as near to these means.
    """
    every, many = np.ones(touch.shape[1], dtype=bool), (_MANY_ROOTS if root else MANY)[slave.dim]
    values, scatter, alternate = _fits(slave, touch, means, every, many, root=root)
    if slave.dim == 2 and alternate.any():
        some = alternate > 0
        wide, wider, _ = _fits(slave, touch, means, some, _MANY_WIDE, wide=True)
        alternate[some] *= 1 - between(wider**2, scatter[some] ** 2, _ALIKE)
        values = values + alternate[touch.indices] * (wide - values)
    return values, scatter


def _fits(
    slave: Slave, touch: csr_array, means: Floats, some: Bools, many: int, *, root: bool = False, wide: bool = False
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Fit on patches of at least so `many` macro-elements, around `some` (n,).

    Return the values at their nodes, in the order of `touch`, 0 for the others; for each fit the scatter of the means,
    and a factor, 1 where means alternate.
    """
    patches = patches_of(touch, many, LEAST[slave.dim], slave.trust)[np.flatnonzero(some)]
    pieces = [_fit_piece(slave, patches[k : k + PIECE], means, root, wide) for k in range(0, patches.shape[0], PIECE)]
    q, x_bar, axis, scatter, alternate = (np.concatenate(of_pieces) for of_pieces in zip(*pieces, strict=True))
    values, there = np.zeros(touch.nnz), some[touch.indices]
    row = np.repeat(np.arange(len(slave.x)), np.diff(touch.indptr))[there]
    g = (np.cumsum(some) - 1)[touch.indices[there]]
    s = np.einsum("rs,rsn->rn", slave.x[row] - x_bar[g], axis[g])
    values[there] = (_powers(s) * q[g]).sum(axis=1)
    return values, scatter, alternate


def _fit_piece(
    slave: Slave, patches: csr_array, means: Floats, root: bool, wide: bool
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Fit the parabolas of some patches (k, n), in coordinates s = axis . (x - x_bar).

    Return their coefficients (k, terms), x_bar (k, 3), axis (k, 3, dim), the scatter (k,) of the means, and a factor
    (k,), 1 where means alternate; for roots both are 0. Fits on `wide` patches lack terms that are due to scatter.
    """
    k = patches.shape[0]
    row, g = np.repeat(np.arange(k), np.diff(patches.indptr)), patches.indices
    given, trust = means[g], slave.trust[g]
    basis = basis_of(slave, patches, trust, root)
    if root:
        return _root(slave, basis, g, given), basis.x_bar, basis.axis, np.zeros(k), np.zeros(k)
    value = basis.values(basis.fit(given))
    square = (given - value.mean(axis=1)) ** 2
    scatter, change = summed(row, basis.weight * square, k), 12 * value.var(axis=1)  # 12: of a linear p, from variance
    noisy = between(scatter[row], change, _SCATTERED)
    like = 1 - between(square, scatter[row], _UNLIKE)
    alternate = between(scatter, summed(row, basis.weight * change, k), _SCATTERED)
    basis = basis_of(slave, patches, trust + (1 - trust) * noisy * like)
    q = _without_chance(basis, given) if wide else basis.fit(given)
    if wide:
        scatter = summed(row, basis.weight * (given - basis.values(q).mean(axis=1)) ** 2, k)
    return q, basis.x_bar, basis.axis, np.sqrt(scatter), alternate


def _root(slave: Slave, basis: Basis, g: Ints, given: Floats) -> NDArray[np.floating]:
    """Return the coefficients (k, terms) of parabolas whose roots have the means `given` (r,) over macro-elements g."""
    wanted, ends = given**2, slave.ends[g]
    grid, weight = rule(CELLS[{1: "SEG2", 2: "QUAD4"}[slave.dim]].family, 2 * _FINE - 1)
    weight = weight / weight.sum()
    middle, off = basis.middle[ends], basis.off[ends] * np.sqrt(3 / slave.dim)
    points = _powers(middle[:, None] + np.einsum("pm,rmn->rpn", grid, off))
    before = np.stack([wanted, np.zeros(len(given))])
    for _ in range(_TIMES):
        q = basis.fit(wanted)
        new = given**2 + np.sqrt(np.maximum(basis.values(q), 0.0)).var(axis=1)
        value = np.einsum("rpt,rt->rp", points, q[basis.row[ends]])
        root = np.sqrt(np.maximum(value, 0.0))
        mean = root @ weight
        new[ends] = given[ends] ** 2 + (root - mean[:, None]) ** 2 @ weight + np.minimum(value, 0.0) @ weight
        wanted, before = _accelerated(basis, wanted, (new - wanted) / 3, before)
    return basis.fit(wanted)


def _accelerated(basis: Basis, x: Floats, step: Floats, before: Floats) -> tuple[Floats, Floats]:
    """Return x (r,) after a `step` of a fixed-point iteration, and these two.

    `before`: the two of the step before. Anderson's acceleration by one step, for each patch.
    """
    turn = step - before[1]
    size, along = (summed(basis.row, basis.weight * turn * d, len(basis.x_bar)) for d in (turn, step))
    part = np.clip(np.divide(along, size, out=np.zeros_like(size), where=size > 0), -_FURTHER, 0.5)[basis.row]
    return x + step - part * (x - before[0] + turn), np.stack([x, step])


def _without_chance(basis: Basis, given: Floats) -> NDArray[np.floating]:
    """Return the coefficients (k, terms) of fits to `given` (r,), without terms that are due to scatter.

    By Fisher's F: the square that slopes or curvatures explain, over the square that as many explain by chance.
    """
    k, q, square, terms = len(basis.x_bar), [], [], []
    for fit in (basis.at_most(1), basis.at_most(1 + basis.axis.shape[2]), basis):
        q.append(fit.fit(given))
        off = given - fit.values(q[-1]).mean(axis=1)
        square.append(summed(basis.row, basis.weight * off**2, k))
        terms.append(np.count_nonzero(np.einsum("kii->ki", fit.inverse), axis=1))
    by_chance = square[2] / np.maximum(np.bincount(basis.row, minlength=k) - terms[2], 1)
    found = q[0]
    for t in (1, 2):
        sure = between(square[t - 1] - square[t], (terms[t] - terms[t - 1]) * by_chance, _CHANCE)
        found = found + sure[:, None] * (q[t] - q[t - 1])
    return np.asarray(found)


class Basis(NamedTuple):
    """Terms of the parabolas of k patches, with r macro-elements in all, of the patches `row` (r,).

    `x_bar` (k, 3), `axis` (k, 3, dim); `middle` (r, dim) of each macro-element, and half its Gauss points, as seen from
    there, `off` (r, dim, dim); `points` (r, p, terms): terms at all of them, whose mean is that over the macro-element;
    `weight` (r,), with a sum of 1 in each patch; `normal` (k, terms, terms): the matrix of the normal equations; its
    `inverse`, with zeros for terms that are left out.
    """

    row: Ints
    x_bar: Floats
    axis: Floats
    middle: Floats
    off: Floats
    points: Floats
    weight: Floats
    normal: Floats
    inverse: Floats

    def at_most(self, terms: int) -> Basis:
        """Return the basis of the first `terms`."""
        return self._replace(inverse=_inverse_of_independent(self.normal, np.full(len(self.normal), terms)))

    def fit(self, wanted: Floats) -> NDArray[np.floating]:
        """Return the coefficients (k, terms) of the parabolas whose means are nearest to those `wanted` (r,)."""
        right = summed(self.row, (self.weight * wanted)[:, None] * self.points.mean(axis=1), len(self.x_bar))
        return np.asarray(np.einsum("kij,kj->ki", self.inverse, right))

    def values(self, q: Floats) -> NDArray[np.floating]:
        """Return the values (r, p) of parabolas with coefficients q (k, terms) at the points."""
        return np.asarray(np.einsum("rpt,rt->rp", self.points, q[self.row]))

    def gradients(self, q: Floats, x: Floats) -> NDArray[np.floating]:
        """Return the gradients (k, 3) of parabolas with coefficients q (k, terms) at x (k, 3)."""
        dim = self.axis.shape[2]
        s = np.einsum("ks,ksn->kn", x - self.x_bar, self.axis)
        slope = q[:, 1 : 1 + dim] + 2 * q[:, 1 + dim, None] * s
        for t, (a, b) in enumerate(_products(dim), 2 + dim):
            slope[:, a] += q[:, t] * s[:, b]
            slope[:, b] += q[:, t] * s[:, a]
        return np.asarray(np.einsum("ksn,kn->ks", self.axis, slope))


def basis_of(slave: Slave, patches: csr_array, trust: Floats, root: bool = False) -> Basis:
    """Compute the terms of parabolas on some patches (k, n), whose macro-elements weigh `trust` (r,) of their area."""
    k, dim, number = patches.shape[0], slave.dim, np.diff(patches.indptr)
    few = number < LEAST[dim]
    row, g = np.repeat(np.arange(k), number), patches.indices
    weight = slave.area[g] * trust
    weight = weight / summed(row, weight, k)[row]
    x_bar = summed(row, weight[:, None] * slave.centroid[g], k)
    d = slave.centroid[g] - x_bar[row]
    axis = _axes(summed(row, weight[:, None, None] * dyads(d), k), dim, few & root)
    # Gauss points of a macro-element: exact for means of parabolas, and nearly so for those of roots
    size, turn = np.linalg.eigh(np.einsum("rsn,rst,rtm->rnm", axis[row], slave.moment[g], axis[row]))
    off = np.swapaxes(np.sqrt(np.maximum(dim * size, 0.0))[:, None] * turn, 1, 2)
    middle = np.einsum("rs,rsn->rn", d, axis[row])
    points = _powers(np.concatenate([middle[:, None] - off, middle[:, None] + off], axis=1))
    normal = summed(row, weight[:, None, None] * dyads(points.mean(axis=1)), k)
    inverse = _inverse_of_independent(normal, np.where(few, 1 + dim + root, points.shape[2]))
    return Basis(row, x_bar, axis, middle, off, points, weight, normal, inverse)


def between(x: Floats, y: Floats, ends: tuple[float, float]) -> NDArray[np.floating]:
    """Return 0 where x / y >= 0 is at most the first of the `ends`, 1 above the second, linear between; 0 / 0 is 0."""
    low, high = ends
    over = np.divide(x - low * y, (high - low) * y, out=np.where(x > 0, 1.0, 0.0), where=y > 0)
    return np.asarray(np.clip(over, 0.0, 1.0))


def _axes(spread: Floats, dim: int, alike: Bools) -> NDArray[np.floating]:
    """Return principal axes (k, 3, dim) over deviations, all over the largest if `alike` (k,); 0 in thin directions."""
    variance, axes = np.linalg.eigh(spread)
    variance, axes = variance[:, : -1 - dim : -1], axes[:, :, : -1 - dim : -1]
    there = variance > _THIN * variance[:, :1]
    variance = np.where(alike[:, None], variance[:, :1], variance)
    return np.where(there[:, None], axes / np.sqrt(np.where(there, variance, 1.0))[:, None], 0.0)


def _powers(s: Floats) -> NDArray[np.floating]:
    """Return the terms of a parabola (..., terms): 1, the coordinates (..., dim), their square, other products."""
    square, (a, b) = (s**2).sum(axis=-1, keepdims=True), _products(s.shape[-1]).T
    return np.concatenate([np.ones((*s.shape[:-1], 1)), s, square, s[..., a] * s[..., b]], axis=-1)


def _products(dim: int) -> Ints:
    """Return the pairs of coordinates (terms, 2) whose products are terms beside the square."""
    return np.stack(np.triu_indices(dim), axis=1)[1:]


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


def nodal_means(touch: csr_array, values: Floats) -> NDArray[np.floating]:
    """Return the mean (k,) of values of each node's macro-elements, given in the order of `touch`; 0 without any."""
    count = np.diff(touch.indptr)
    total = summed(np.repeat(np.arange(len(count)), count), values, len(count))
    return np.divide(total, count, out=np.zeros(len(count)), where=count > 0)


def summed(row: Ints, values: Floats, k: int) -> NDArray[np.floating]:
    """Return the sums (k, ...) of values (r, ...) with the same row number."""
    out = np.zeros((k, int(np.prod(values.shape[1:]))))
    scatter(out, row[:, None], np.ascontiguousarray(values).reshape(len(row), 1, out.shape[1]))
    return out.reshape(k, *values.shape[1:])


def dyads(d: Floats) -> NDArray[np.floating]:
    """Return the dyadic products d d (..., n, n) of vectors (..., n)."""
    return d[..., :, None] * d[..., None, :]
