"""A cylinder on a block, the mesh that contact codes are compared on: half of it, x = 0 is a plane of symmetry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from verification.exact.finite_bodies import BLOCK, CYLINDER, FORCE, RADIUS, Hertz
from verification.grids import box, lines, under_circle
from verification.meshes.bodies import at, body, joined

Floats = NDArray[np.floating]

#: cells beyond the contact grow by this; cells of the cylinder are so much larger than the block's
GROWTH, COARSER = 1.25, 1.5


def cylinder_on_block(n: int) -> Mesh:
    """n slave faces to the half-width a, even up to 1.5 a. Groups: upper, lower, slave, master, top, bottom, x0."""
    a = Hertz.plane(FORCE).radius
    h = a / n
    upper = under_circle(lines(CYLINDER[0], h, 1.5 * a, GROWTH), lines(CYLINDER[1], h, a, GROWTH), RADIUS)
    h /= COARSER
    lower = box(lines(BLOCK[0], h, 1.5 * a, GROWTH), -lines(BLOCK[1], h, a, GROWTH)[::-1])
    wide, high = upper[:, 0].T

    def under(x: Floats, y: Floats) -> NDArray[np.bool_]:
        return np.isclose(y, np.interp(x, wide, high)) & (y < CYLINDER[1])

    return joined(
        {
            "upper": body(upper, skins={"slave": under, "top": at(1, CYLINDER[1]), "x0": at(0, 0.0)}),
            "lower": body(lower, skins={"master": at(1, 0.0), "bottom": at(1, -BLOCK[1]), "x0": at(0, 0.0)}),
        }
    )
