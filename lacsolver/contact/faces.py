"""Positions and tangents at reference points of the faces of a surface."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacmesh.surface.maps import coefficients, slopes, values
from lacmesh.topology.skin import FACE_TYPES, N_NODES


def by_type(surface: Surface, face: Ints) -> Iterator[tuple[Any, str, Ints]]:
    """Yield the points on faces by the type of their face: (rows, type, nodes (k, n))."""
    kind = surface.faces.type[face]
    codes = np.unique(kind)
    for code in codes:
        rows = np.flatnonzero(kind == code) if len(codes) > 1 else slice(None)
        yield rows, FACE_TYPES[code], surface.faces.nodes[face[rows], : N_NODES[code]]


def places(surface: Surface, face: Ints, xi: Floats) -> NDArray[np.floating]:
    """Return the coordinates (points, 3) of reference points xi (points, 2) of faces."""
    return values(coefficients(surface), face, xi)


def tangents(surface: Surface, face: Ints, xi: Floats) -> NDArray[np.floating]:
    """Return the tangents (points, 3, dim of the surface) of faces at reference points xi (points, 2)."""
    return slopes(coefficients(surface), face, xi, surface.dim)
