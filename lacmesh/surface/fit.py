"""Weights that integrate every shape function of both faces exactly over a piece, on faces of any shape in the plane.

Over a piece the functions of the slave face are polynomials in its reference coordinates, and so are those of the
master face in its own; in the plane neither are. Their integrals follow from the piece's edges alone (`moments`,
`curved`). The weights of a plain rule are then corrected,

    w_q (1 + c_q),  sum_q w_q c_q^2 least,  sum_q w_q (1 + c_q) f(q) = int_P f  for every function f of either face,

by orthogonalising the functions (modified Gram-Schmidt); a function that depends on those before it, as where both
faces are the same, is left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.surface.curved import curved_integrals, vertices_in_faces
from lacmesh.surface.maps import CURVED
from lacmesh.surface.moments import functions, straight_integrals
from lacmesh.surface.polygon import MASTER

#: what is left of a function, against itself, for it to count as one more
_INDEPENDENT = 3e-11
#: what is left of its square where orthogonalising it once is enough
_MUCH = 0.25


@kernel
def fit(
    polygon: Any, edges: Any, slave: Any, master: Any, centre: Any, e: Any, rules: Any, xi_s: Any, xi_m: Any,
    weight: Any, room: Any,
) -> None:  # fmt: skip
    """Correct the weights of the points xi_s, xi_m (q, 2) of a piece, so that the functions of both sides are exact.

    `slave`, `master`: `curved.Side`; `rules`: `moments.Gauss`; `room`: (corner (., 4), target, work, phi (., q)).
    """
    corner, target, work, phi = room
    count = 1 + slave.k + master.k
    vertices_in_faces(polygon, edges, slave, master, centre, e, corner)
    n = len(polygon)
    at_slave, at_master = _local(corner, n, 0), _local(corner, n, 2)
    target[:count] = 0.0
    if slave.kind == CURVED or master.kind == CURVED:
        curved_integrals(corner, edges, n, slave, master, e, at_slave, at_master, rules, target, work)
    else:
        own = corner[:, :2]
        straight_integrals(polygon, own, edges, 0, slave.y, slave.n, at_slave, slave.k, 1, rules, target)
        own = corner[:, 2:]
        straight_integrals(
            polygon, own, edges, MASTER, master.y, master.n, at_master, master.k, 1 + slave.k, rules, target
        )
    _values(xi_s, at_slave, slave.k, phi, 1, work)
    _values(xi_m, at_master, master.k, phi, 1 + slave.k, work)
    phi[0, : len(weight)] = 1.0
    correct(weight, len(weight), phi, count, target)


@kernel
def _values(xi: Any, local: Any, k: int, phi: Any, first: int, work: Any) -> None:
    """The first k functions of a face at points xi (q, 2), into phi[first:]."""
    u, v, h = local
    for q in range(len(xi)):
        functions((xi[q, 0] - u) / h, (xi[q, 1] - v) / h, k, work, 0)
        for i in range(k):
            phi[first + i, q] = work[i]


@kernel
def _local(corner: Any, n: int, first: int) -> Any:
    """Origin and scale of the arguments of the functions of a face on a piece with `n` vertices corner[:, first:]."""
    u, v, size = 0.0, 0.0, 0.0
    for k in range(n):
        u += corner[k, first] / n
        v += corner[k, first + 1] / n
    for k in range(n):
        size = max(size, abs(corner[k, first] - u), abs(corner[k, first + 1] - v))
    return u, v, size


@kernel
def correct(weight: Any, n: int, phi: Any, k: int, target: Any) -> Any:
    """Multiply n weights so that functions phi (k, n) have the integrals `target`; phi is used up.

    Returns the largest relative change.
    """
    kept = 0
    for j in range(k):
        size = 0.0
        for q in range(n):
            size += weight[q] * phi[j, q] * phi[j, q]
        t, before, left = target[j], size, size
        for _ in range(2):
            for i in range(kept):
                c = 0.0
                for q in range(n):
                    c += weight[q] * phi[j, q] * phi[i, q]
                for q in range(n):
                    phi[j, q] -= c * phi[i, q]
                t -= c * target[i]
            left = 0.0
            for q in range(n):
                left += weight[q] * phi[j, q] * phi[j, q]
            if left > _MUCH * before:
                break
            before = left
        if left > _INDEPENDENT * _INDEPENDENT * size and kept < n:
            left = np.sqrt(left)
            for q in range(n):
                phi[kept, q] = phi[j, q] / left
            target[kept] = t / left
            kept += 1
    for i in range(kept):
        c = target[i]
        for q in range(n):
            c -= weight[q] * phi[i, q]
        target[i] = c
    most = 0.0
    for q in range(n):
        c = 0.0
        for i in range(kept):
            c += target[i] * phi[i, q]
        most = max(most, abs(c))
        phi[0, q] = c
    if not most < np.inf:
        return most
    for q in range(n):
        weight[q] *= 1 + phi[0, q]
    return most
