"""Quadrature weights that integrate every shape function of both faces exactly over a piece, on any plane faces.

Over a piece the functions of the slave face are polynomials in its reference coordinates, and those of the master face
in its own; in the coordinates of the plane neither are. Their integrals are computed from the piece's edges alone
(`moments`). The weights of a plain rule are then corrected,

    w_q (1 + c_q),  sum_q w_q c_q^2 least,  sum_q w_q (1 + c_q) f(q) = int_P f  for every function f of either face,

by orthogonalising the functions (modified Gram-Schmidt, the most independent first); a function that is linearly
dependent on earlier ones, as where both faces are the same, is left out. For a nearly dependent function the integral
is known only up to rounding over its remaining size. On faces in one plane this is harmless: whatever the weights are,
every integral is exact. Where faces are warped, or normals vary, by `bend`, products with the normal are integrated as
well, and weights that depend on rounding would show: there a function counts only as far as its remaining size exceeds
a fraction of the bend. What is left of a function depends on those before it. So those of an affine face come first:
they span the same polynomials whichever corner of the face is its first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.surface.maps import AFFINE, CURVED
from lacmesh.surface.moments import curved_integrals, functions, straight_integrals, vertices_in_faces
from lacmesh.surface.polygon import MASTER

#: what is left of a function, against itself, for it to count as one more
_INDEPENDENT = 3e-11
#: what is left of it where orthogonalising it once is enough, and where subtracting squares says how much that is
_MUCH = 0.1


@kernel
def fit(
    polygon: Any, edges: Any, slave: Any, master: Any, centre: Any, e: Any, rules: Any, xi_s: Any, xi_m: Any,
    weight: Any, least: float, room: Any,
) -> None:  # fmt: skip
    """Correct the weights of a piece's points xi_s, xi_m (q, 2) to integrate the functions of both sides exactly.

    `slave`, `master`: `curved.Side`; `rules`: `moments.Gauss`; `room`: (corner (., 4), target, work, phi (., q)).
    """
    corner, target, work, phi = room
    count = 1 + slave.k + master.k
    swapped = master.kind == AFFINE and slave.kind < CURVED
    first_s, first_m = 1, 1 + slave.k
    if swapped:
        first_s, first_m = 1 + master.k, 1
    vertices_in_faces(polygon, edges, slave, master, centre, e, corner)
    n = len(polygon)
    at_slave, at_master = _local(corner, n, 0), _local(corner, n, 2)
    target[:count] = 0.0
    if slave.kind == CURVED or master.kind == CURVED:
        curved_integrals(corner, edges, n, slave, master, e, at_slave, at_master, rules, target, work)
    else:
        own = corner[:, :2]
        straight_integrals(polygon, own, edges, 0, slave.y, slave.n, at_slave, slave.k, first_s, rules, target)
        own = corner[:, 2:]
        straight_integrals(polygon, own, edges, MASTER, master.y, master.n, at_master, master.k, first_m, rules, target)
    _values(xi_s, at_slave, slave.k, phi, first_s, work)
    _values(xi_m, at_master, master.k, phi, first_m, work)
    phi[0, : len(weight)] = 1.0
    lead = max(first_s, first_m) if swapped or slave.kind == AFFINE else 1
    correct(weight, len(weight), phi, count, target, least, lead)


@kernel
def _values(xi: Any, local: Any, k: int, phi: Any, first: int, work: Any) -> None:
    """Write the values of the first k functions of a face at points xi (q, 2) into phi[first:]."""
    u, v, h = local
    for q in range(len(xi)):
        functions((xi[q, 0] - u) / h, (xi[q, 1] - v) / h, k, work, 0)
        for i in range(k):
            phi[first + i, q] = work[i]


@kernel
def _local(corner: Any, n: int, first: int) -> Any:
    """Origin and scale of the arguments of a face's functions, for a piece with `n` vertices corner[:, first:]."""
    u, v, size = 0.0, 0.0, 0.0
    for k in range(n):
        u += corner[k, first] / n
        v += corner[k, first + 1] / n
    for k in range(n):
        size = max(size, abs(corner[k, first] - u), abs(corner[k, first + 1] - v))
    return u, v, size


@kernel
def correct(weight: Any, n: int, phi: Any, k: int, target: Any, least: float, lead: int) -> Any:
    """Scale n weights so that functions phi (k, n) have the integrals `target`; overwrites phi and `target`.

    The most independent function comes first: of the first `lead` ones while any of these is independent, then of the
    rest. A function of which no more than the fraction `least` is left after orthogonalisation is corrected only in
    part, as far as its integral is more than rounding. Returns the largest relative change.
    """
    left = np.empty(k)
    _scale(weight, n, phi, k, target, left)
    kept = 0
    while kept < min(k, n):
        if kept < lead:
            _bring_forward(phi, target, left, n, kept, lead)
        if kept >= lead or not left[kept] > _INDEPENDENT:
            lead = kept
            _bring_forward(phi, target, left, n, kept, k)
        if left[kept] < _MUCH:
            for i in range(kept):
                _take_off(weight, n, phi, target, i, kept, kept + 1, left)
        if not left[kept] > _INDEPENDENT:
            break
        scale = 1 / left[kept]
        for q in range(n):
            phi[kept, q] *= scale
        target[kept] *= scale
        _take_off(weight, n, phi, target, kept, kept + 1, k, left)
        kept += 1
    for i in range(kept):
        target[i] *= left[i] * left[i] / (left[i] * left[i] + least * least)
    most = 0.0
    for q in range(n):
        c = 0.0
        for i in range(kept):
            c += target[i] * phi[i, q]
        most = max(most, abs(c))
        phi[0, q] = c
    if most < np.inf:
        for q in range(n):
            weight[q] *= 1 + phi[0, q]
    return most


@kernel
def _scale(weight: Any, n: int, phi: Any, k: int, target: Any, left: Any) -> None:
    """Scale k functions to size 1, and subtract from their integrals those that the present weights give.

    `left` (k,) becomes 1, or 0 where the function is 0.
    """
    for j in range(k):
        total, square = 0.0, 0.0
        for q in range(n):
            f = weight[q] * phi[j, q]
            total += f
            square += f * phi[j, q]
        left[j] = 1.0 if square > 0 else 0.0
        scale = 1 / np.sqrt(square) if square > 0 else 1.0
        for q in range(n):
            phi[j, q] *= scale
        target[j] = (target[j] - total) * scale


@kernel
def _bring_forward(phi: Any, target: Any, left: Any, n: int, kept: int, k: int) -> None:
    """Exchange function `kept` with the one among it and those after it, up to k, with the largest remaining size."""
    j = kept
    for i in range(kept + 1, k):
        if left[i] > left[j]:
            j = i
    if j == kept:
        return
    target[kept], target[j] = target[j], target[kept]
    left[kept], left[j] = left[j], left[kept]
    for q in range(n):
        phi[kept, q], phi[j, q] = phi[j, q], phi[kept, q]


@kernel
def _take_off(weight: Any, n: int, phi: Any, target: Any, i: int, first: int, last: int, left: Any) -> None:
    """Make functions first to last - 1 orthogonal to function i, which has size 1; `left`: their remaining sizes.

    Many are done at a time, since a call for each would cost as much as the sums. The sizes follow by Pythagoras where
    rounding permits.
    """
    for j in range(first, last):
        c = 0.0
        for q in range(n):
            c += weight[q] * phi[j, q] * phi[i, q]
        for q in range(n):
            phi[j, q] -= c * phi[i, q]
        target[j] -= c * target[i]
        square = left[j] * left[j] - c * c
        if not square > _MUCH * _MUCH:
            square = 0.0
            for q in range(n):
                square += weight[q] * phi[j, q] * phi[j, q]
        left[j] = np.sqrt(square)
