"""Sectors of thick rings, whose sides match or not, and whole rings of the same cells.

Groups: `body`, `in`, `out`, the sides `a` and `b` of a sector, `bottom` and `top` in space.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh, generate, join

Floats = NDArray[np.floating]


def sector(kind: str, counts: Sequence[int], radii: tuple[float, float], sectors: int, *, skew: float = 0.0) -> Mesh:
    """One of `sectors` of a ring of cells of a type, `counts` of quadrangles along radius, angle (and height 1).

    `skew`: how far radii shift from side `a` to side `b`, relative to the thickness: sides that do not match.
    """
    mesh = generate.ring(counts, radii, kind, angle=360 / sectors)
    mesh = mesh.renamed(**{"inner": "in", "outer": "out", "start": "a", "end": "b"})

    def shifted(x: Floats) -> Floats:
        r, part = np.hypot(x[0], x[1]), np.arctan2(x[1], x[0]) * sectors / (2 * np.pi)
        grown = 1 + skew * (r - radii[0]) * (radii[1] - r) / (radii[1] - radii[0]) * part / r
        return np.stack([x[0] * grown, x[1] * grown, x[2]])

    return mesh.moved(shifted) if skew else mesh


def whole(kind: str, counts: Sequence[int], radii: tuple[float, float], sectors: int) -> Mesh:
    """The whole ring of the cells of a sector."""
    mesh = generate.ring((counts[0], counts[1] * sectors, *counts[2:]), radii, kind)
    return mesh.renamed(**{"inner": "in", "outer": "out"})


def fitted(kind: str, n: int, radii: tuple[float, float, float], sectors: int, *, skew: float = 0.0) -> Mesh:
    """Sectors of two rings, one in the other, n and n + 1 cells around: `slave` is the outer side of the inner one."""
    inner = sector(kind, (n, n), radii[:2], sectors, skew=skew)
    outer = sector(kind, (n, n + 1), radii[1:], sectors, skew=skew)
    return join(
        inner.renamed(**{"body": "within", "in": "inner", "out": "slave"}),
        outer.renamed(**{"body": "around", "in": "master", "out": "outer"}),
    )
