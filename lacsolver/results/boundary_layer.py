"""The layer at the boundary of a slave in space, where p_m differs from the mean of p in proportion to the slope of p.

p_m is constant on a macro-element where p is not (docs/theory.md). In the k-th ring of macro-elements from the boundary

    p_m - mean_m(p) = c_k h_m . grad p,    h_m = sum of A_m n / L

over the edges on the boundary, of outward normal n and length L, with the area A_m of the macro-element; the next rings
have the h_m of the macro-element before them. The numbers c_k depend on the cells and their cut alone: 0.12, -0.03 and
0.00 for QUAD9, 0.11, -0.09 and 0.03 for the cut QUAD8 of HEXA20. Least squares find them together with the parabolas of
all patches. Where c_k is small and explains the differences, as on quadrangles, the means are corrected, and weigh more
in the fits by as much as the squared differences decrease. Nothing is changed on pairs of triangles, whose differences
alternate along the boundary, and at sharp edges, where p has no bound.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacmesh.surface.normals import unit
from lacsolver.results.parabolas import LEAST, MANY, PIECE, Basis, Slave, basis_of, between
from lacsolver.results.patches import ones, patches_of

#: number of rings that have a layer; number of times that slopes and c_k are found from one another
_RINGS, _TIMES = 3, 3
#: least cosine between the way to the next ring and the inward normal
_INWARDS = 0.7
#: difference between cosines of neighbours that lie alike
_ALIKE = 1e-6
#: least eigenvalue of the equations for c_k, scaled, of the parts of the slopes that parabolas do not resemble
_DETERMINED = 1e-3
#: part of the squared differences that c_k leaves: the means are corrected below the first value, not above the second
_LEFT = (0.25, 0.5)
#: largest c_k: no layer is above the second value, but pressures that have no bound at sharp edges and alternate
_LARGE = (0.25, 0.5)


def without_layer(
    slave: Slave, touch: csr_array, means: Floats, surface: Surface, macro: Ints
) -> tuple[Slave, NDArray[np.floating]]:
    """Return the slave with its weights after the correction of its means p_m (n,), and the corrected means (n,).

    `touch` (k, n): macro-elements in contact; `surface`, `macro` (faces,): the slave's faces, their macro-elements.
    A slave in the plane, and one whose boundary is not in contact or whose layer takes up nearly all of it, are
    returned as they are.
    """
    if slave.dim == 1:
        return slave, means
    rings = _rings(slave, touch, surface, macro)
    if not rings.any():
        return slave, means
    patches = patches_of(touch, MANY[slave.dim], LEAST[slave.dim], slave.trust)
    own = np.flatnonzero(patches @ rings.any(axis=(0, 2)).astype(float) > 0)
    patches = patches[own]
    corrected, weighted, one = means, slave, np.array(1.0)
    for _ in range(_TIMES):
        slopes = np.einsum("kns,ns->kn", rings, _gradients(weighted, patches, own, corrected))
        c, left = _fit(weighted, patches, means, slopes)
        sure = (1.0 - between(np.array(left), one, _LEFT)) * (1.0 - between(np.abs(c).max(), one, _LARGE))
        corrected = means - sure * (c @ slopes)
        more = np.minimum(slave.trust / max(left, np.finfo(float).tiny), 1.0) - slave.trust
        weighted = slave._replace(trust=slave.trust + sure * more)
    return weighted, corrected


def _rings(slave: Slave, touch: csr_array, surface: Surface, macro: Ints) -> NDArray[np.floating]:
    """Return h_m (rings, n, 3) of the macro-elements in contact of each ring: the sums over edges on the boundary.

    From the macro-element at an edge, the rings go to the neighbour that lies most nearly inwards.
    """
    own, depth = _boundary(surface, macro, slave.area)
    rings, near = np.zeros((_RINGS, len(slave.area), 3)), ones(touch.T @ touch)
    for ring in rings:
        here = np.diff(near.indptr)[own] > 0
        own, depth = own[here], depth[here]
        np.add.at(ring, own, depth)
        own, depth = _inwards(near, slave.centroid, own, depth)
    return rings


def _boundary(surface: Surface, macro: Ints, area: Floats) -> tuple[Ints, Floats]:
    """Return the macro-element (e,) of each edge on the boundary, and A n / L (e, 3), a length."""
    face, k = np.nonzero(surface.boundary)
    corners, number, edge = surface.faces.corners[face], surface.n_corners[face], np.arange(len(face))
    first, second = (surface.x[corners[edge, at]] for at in (k, (k + 1) % number))
    middle = np.where(corners[..., None] >= 0, surface.x[corners], 0.0).sum(axis=1) / number[:, None]
    along, across = unit(second - first), (first + second) / 2 - middle
    across = unit(across - np.einsum("es,es->e", across, along)[:, None] * along)
    length = np.linalg.norm(second - first, axis=1)
    depth = np.divide(area[macro[face]], length, out=np.zeros_like(length), where=length > 0)
    return macro[face], depth[:, None] * across


def _inwards(near: csr_array, x: Floats, own: Ints, outward: Floats) -> tuple[Ints, Floats]:
    """Return the neighbour of each macro-element `own` (e,) most nearly against its `outward` (e, 3), and that vector.

    Neighbours that lie alike share it, so that their order does not matter. `near` (n, n): neighbours; x (n, 3):
    centroids. Macro-elements without a neighbour within `_INWARDS` are left out.
    """
    rows = near[own]
    row, g = np.repeat(np.arange(len(own)), np.diff(rows.indptr)), rows.indices
    cosine = -np.einsum("rs,rs->r", unit(x[g] - x[own[row]]), unit(outward)[row])
    largest = np.full(len(own), _INWARDS)
    np.maximum.at(largest, row, cosine)
    most = cosine > largest[row] - _ALIKE
    row, g = row[most], g[most]
    return g, outward[row] / np.bincount(row, minlength=len(own))[row][:, None]


def _bases(slave: Slave, patches: csr_array) -> Iterator[tuple[Basis, Ints]]:
    """Yield the terms of the parabolas of some patches (k, n) at a time, and the macro-elements (r,) in them."""
    for first in range(0, patches.shape[0], PIECE):
        piece = patches[first : first + PIECE]
        yield basis_of(slave, piece, slave.trust[piece.indices]), piece.indices


def _fit(slave: Slave, patches: csr_array, means: Floats, slopes: Sequence[Floats]) -> tuple[Floats, float]:
    """Return c (rings,), and the part that it leaves of the squared differences between means and parabolas.

    Least squares of p_m - c_k slopes_k about the parabolas of all patches, with the weights of the fits. If parabolas
    resemble the slopes too much for that, as on few macro-elements, c is 0 and leaves all.
    """
    values, size = np.stack([means, *slopes]), np.zeros(1 + len(slopes))
    normal = np.zeros((len(size), len(size)))
    for basis, g in _bases(slave, patches):
        given = values[:, g]
        off = np.stack([each - basis.values(basis.fit(each)).mean(axis=1) for each in given])
        normal += (basis.weight * off) @ off.T
        size += given**2 @ basis.weight
    scale = np.sqrt(np.divide(1.0, size, out=np.zeros_like(size), where=size > 0))
    normal *= scale[:, None] * scale
    if normal[0, 0] <= 0 or np.linalg.eigvalsh(normal[1:, 1:])[0] < _DETERMINED:
        return np.zeros(len(slopes)), 1.0
    c = np.linalg.solve(normal[1:, 1:], normal[1:, 0])
    return c * scale[1:] / scale[0], 1.0 - float(c @ normal[1:, 0]) / normal[0, 0]


def _gradients(slave: Slave, patches: csr_array, own: Ints, means: Floats) -> NDArray[np.floating]:
    """Return the gradients (n, 3) of parabolas around the macro-elements `own` (k,), at their centroids; others 0."""
    out, first = np.zeros((len(means), 3)), 0
    for basis, g in _bases(slave, patches):
        these = own[first : first + len(basis.x_bar)]
        out[these] = basis.gradients(basis.fit(means[g]), slave.centroid[these])
        first += len(these)
    return out
