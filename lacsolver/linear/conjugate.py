"""Conjugate gradients with a preconditioner, as a generator of iterates; the caller decides when to stop.

Hestenes, Stiefel (1952), in the usual letters: x, r = b - K x, z = M r, p the direction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.linear.errors import Breakdown

Apply = Callable[[Floats], Floats]


class Operator(Protocol):
    """Interface of a matrix, or of an operator that multiplies like one."""

    def __matmul__(self, x: Floats, /) -> Floats:
        """Return K x."""


def iterates(K: Operator, M: Apply, b: Floats, x: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Yield (x, r) without end, r by recurrence, from the given x; the next step overwrites both arrays.

    Raises Breakdown where the energy p.Kp or r.Mr is not positive: K or M is not positive definite.
    """
    x = x.copy()
    r = b - K @ x
    yield x, r
    z = M(r)
    p = z.copy()
    rz = float(r @ z)
    while True:
        Kp = K @ p
        energy = float(p @ Kp)
        if not (energy > 0 and rz > 0):
            raise Breakdown(int(np.abs(p).argmax()))
        alpha = rz / energy
        x += alpha * p
        r -= alpha * Kp
        yield x, r
        z = M(r)
        rz, before = float(r @ z), rz
        p *= rz / before
        p += z
