"""The middles of edges and faces on the outer skin of a mesh's bodies, moved onto the smooth surface.

An edge lies in two faces of the skin. Where these go over into each other it has one way to the surface, that of the
exact shape or of the fit that it is on. At a crease, or between two exact shapes, it goes onto both surfaces: the end
of a cylinder onto the circle in which it meets the plane of its end.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.smooth.find import numbers_of
from lacmesh.smooth.heights import ROUNDING, Smooth, smooth_of
from lacmesh.smooth.parents import Bools
from lacmesh.surface.normals import CREASE_ANGLE
from lacmesh.surface.record import Surface
from lacmesh.topology.facets import boundary_faces
from lacmesh.topology.skin import MAX_CORNERS, label_rows

#: steps of Newton's method onto two shapes, which converges as it does from the middle of a chord
_STEPS = 8
#: a way over the length of the edge: what is rounding, and what is no arc
_LEAST, _MOST = 1e-12, 0.5
#: square of the sine between two exact shapes that touch
_TOUCHING = 1e-4
#: z of a plane mesh may differ by this much of its extent
_PLANE = 1e-9


class _Middles(NamedTuple):
    """Middles of edges and faces, one for each face they lie in: `corners` (m, 4) sorted and padded with -1.

    `x` (m, 3); the `height` (m,) of the smooth surface along `normal` (m, 3); `shape` (m,): exact shape, -1 for none.
    """

    corners: Ints
    x: Floats
    height: Floats
    normal: Floats
    shape: Ints

    def take(self, rows: Ints) -> _Middles:
        """Return some of them."""
        return _Middles(self.corners[rows], self.x[rows], self.height[rows], self.normal[rows], self.shape[rows])


def ways_to_surface(mesh: Mesh, corners: list[Ints]) -> list[NDArray[np.floating]]:
    """(k, 3) each: the ways from the middles of edges and faces with `corners` (k, c) each to the smooth surface.

    They are 0 inside bodies, on flat skins, and on skins without a body behind them. Edges at which the skin turns by
    more than 40 degrees are edges of the surface as well.
    """
    wanted = [_padded(one) for one in corners]
    out = np.zeros((sum(map(len, wanted)), 3))
    skin = _outer_skin(mesh)
    if skin is not None and len(out):
        smooth = smooth_of(mesh, skin, CREASE_ANGLE + ROUNDING)
        middles = _middles_of(smooth)
        label, count = label_rows(np.concatenate([*wanted, middles.corners]) + 1)
        mine, theirs = np.split(label, [len(out)])
        order = np.argsort(theirs, kind="stable")
        first, last = (np.searchsorted(theirs[order], np.arange(count), side) for side in ("left", "right"))
        rows = np.flatnonzero(last[mine] > first[mine])
        one, two = order[first[mine[rows]]], order[last[mine[rows]] - 1]
        out[rows] = _ways(smooth, middles.take(one), middles.take(two))
    return np.split(out, np.cumsum([len(one) for one in wanted])[:-1])


def _padded(corners: Ints) -> Ints:
    """(k, 4): sorted corners, padded with -1; the centres of cells, which have more corners, have none."""
    out = np.full((len(corners), MAX_CORNERS), -1, np.int64)
    if corners.shape[1] <= MAX_CORNERS:
        out[:, : corners.shape[1]] = np.sort(corners, axis=1)
    return out


def _outer_skin(mesh: Mesh) -> Surface | None:
    """Return the outer faces of solids, or the outer segments of plane bodies; None without such."""
    if mesh.dim < 2 or (mesh.dim == 2 and np.ptp(mesh.points[:, 2]) > _PLANE * np.ptp(mesh.points, axis=0).max()):
        return None
    faces, cell = boundary_faces(mesh)
    return Surface(mesh.points, faces, cell, mesh.dim - 1, np.full(len(cell), np.nan)) if len(cell) else None


def _middles_of(smooth: Smooth) -> _Middles:
    """Return the middles of the edges of the linear faces, and of quadrangles themselves."""
    patches, height = smooth.fit.whole, smooth.heights[0]
    corner = smooth.parents.faces.faces.corners[smooth.rows]
    shape = numbers_of(smooth.fit.shapes, len(corner))
    face, k, i, j = patches.edges()
    quads = np.flatnonzero(corner[:, 3] >= 0)
    after = (k + 1) % np.maximum((corner[face] >= 0).sum(axis=1), 1)
    middle, centre = (patches.x[i] + patches.x[j]) / 2, patches.x[patches.node[quads]].mean(axis=1)
    ends = _padded(np.column_stack([corner[face, k], corner[face, after]]))
    edges = _Middles(ends, middle, height[face, k], patches.edge_normal[face, k], shape[face])
    centres = _Middles(_padded(corner[quads]), centre, height[quads, 4], patches.normal[quads], shape[quads])
    return _Middles(*(np.concatenate(both) for both in zip(edges, centres, strict=True)))


def _ways(smooth: Smooth, one: _Middles, two: _Middles) -> NDArray[np.floating]:
    """(k, 3): the ways from middles, which lie in one face each, or in two."""
    flat = np.array([*(one.shape.kind == "plane" for one in smooth.fit.shapes), True])
    bent = ~flat[one.shape] | ~flat[two.shape] | (one.height != 0) | (two.height != 0)
    way = np.zeros((len(one.x), 3))
    for _ in range(_STEPS):
        (n, h, exact), (m, g, other) = (_left(smooth, side, way) for side in (one, two))
        c = (n * m).sum(axis=1)
        sine = 1 - c * c
        both = np.where(exact & other, sine > _TOUCHING, c < np.cos(np.radians(CREASE_ANGLE)))
        share = np.where(exact == other, 0.5, exact)[:, None]
        mean = share * h[:, None] * n + (1 - share) * g[:, None] * m
        size = np.where(both, sine, 1.0)
        onto = ((h - c * g) / size)[:, None] * n + ((g - c * h) / size)[:, None] * m
        way += np.where(both[:, None], onto, mean)
    length = 2 * np.linalg.norm(smooth.parents.faces.x[one.corners[:, 0]] - one.x - smooth.origin, axis=1)
    size = np.linalg.norm(way, axis=1)
    moved: Bools = bent & (size > _LEAST * length) & (size < _MOST * length)
    return np.where(moved[:, None], way, 0.0)


def _left(smooth: Smooth, side: _Middles, way: Floats) -> tuple[Floats, Floats, Bools]:
    """Return the normals (k, 3) of the surface at the ends of ways, and what is left (k,) to it along them.

    The last (k,): True for exact shapes; a plane between two rows of nodes of curved shapes is none.
    """
    n, left, exact = side.normal.copy(), side.height - (side.normal * way).sum(axis=1), np.zeros(len(way), bool)
    for number, one in enumerate(smooth.fit.shapes):
        rows = np.flatnonzero(side.shape == number)
        if one.shape.kind == "plane":
            rows = rows[side.height[rows] == 0]
        f, normal = one.shape.distance((side.x + way)[rows])
        sign = np.copysign(1.0, (normal * n[rows]).sum(axis=1))
        n[rows], left[rows], exact[rows] = sign[:, None] * normal, -f * sign, True
    return n, left, exact
