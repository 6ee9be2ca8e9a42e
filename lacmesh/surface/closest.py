"""The points of a surface that are closest to given points, and the way there.

On a face the foot of a point is found by the method of Gauss and Newton, exact in one step where the face is flat. A
point without a foot inside any face is closest to an edge or to a corner. Where that is on the boundary of the surface,
the way goes to the surface as if it went on beyond its boundary, so that a point that overhangs it is not drawn in.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS, Cell
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.shapes import gradient, shape
from lacmesh.surface.normals import normals_of, unit
from lacmesh.surface.record import Surface
from lacmesh.topology.boxes import meeting
from lacmesh.topology.skin import FACE_TYPES, N_NODES

_STEPS = 100
#: step in reference coordinates below which a foot has been found, and largest step
_FOUND, _LONGEST = 1e-13, 1.0
#: reference coordinates, relative distances: what is round-off
_ROUNDING = 1e-9
#: a quadratic face is nowhere farther from the box of its nodes than this part of its size
_BULGE = 0.25


class Closest(NamedTuple):
    """Points of a surface closest to given points (n,): the `face` of each, -1 where there is none within reach.

    `way` (n, 3): from the point to the surface, less what lies beyond its boundary; `distance` (n,): to the surface,
    inf without a face.
    """

    face: Ints
    way: NDArray[np.floating]
    distance: NDArray[np.floating]


def closest_points(surface: Surface, x: Floats, outward: Floats, reach: float) -> Closest:
    """Return the points of a surface, of those within `reach`, that are closest to points x (n, 3).

    `outward` (n, 3): the direction of the body's skin at each point, which must be against the normal of the surface.
    Heights of a smooth surface over its faces count.
    """
    nearest = Closest(np.full(len(x), -1), np.zeros((len(x), 3)), np.full(len(x), np.inf))
    point, face = meeting(x - reach, x + reach, *_boxes(surface))
    if not len(point):
        return nearest
    way, normal, beyond = _ways(surface, face, x[point])
    distance = np.linalg.norm(way, axis=1)
    facing = np.flatnonzero((distance <= reach) & ((normal * outward[point]).sum(axis=1) < 0))
    order = facing[np.lexsort((face[facing], distance[facing], point[facing]))]
    first = order[np.unique(point[order], return_index=True)[1]]
    least = np.full(len(x), np.inf)
    least[point[first]] = distance[first]
    over = np.linalg.norm(beyond, axis=1)  # of several faces at a corner, the one whose boundary is there
    near = order[distance[order] <= least[point[order]] * (1 + _ROUNDING)]
    near = near[np.lexsort((face[near], -over[near], point[near]))]
    chosen = near[np.unique(point[near], return_index=True)[1]]
    nearest.face[point[chosen]] = face[chosen]
    nearest.way[point[chosen]] = way[chosen] + beyond[chosen]
    nearest.distance[point[chosen]] = distance[chosen]
    return nearest


def _boxes(surface: Surface) -> tuple[Floats, Floats]:
    """Return boxes (f, 3) that contain the faces, with their heights."""
    low, high = np.zeros((2, len(surface), 3))
    for name, rows, nodes in surface.by_type():
        own = surface.x[nodes]
        more = _BULGE * np.linalg.norm(np.ptp(own, axis=1), axis=1)[:, None] * (CELLS[name].order > 1)
        if surface.height is not None:
            more = more + np.abs(surface.height.value[rows]).sum(axis=1)[:, None]
        low[rows], high[rows] = own.min(axis=1) - more, own.max(axis=1) + more
    return low, high


class _Patches(NamedTuple):
    """Faces (p,) of one type of a surface, with their nodes at `own` (p, n, 3)."""

    cell: Cell
    surface: Surface
    face: Ints
    own: Floats

    def take(self, rows: Ints) -> _Patches:
        """Return some of them."""
        return self._replace(face=self.face[rows], own=self.own[rows])

    def at(self, xi: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return the places (p, 3) and tangents (p, 3, dim) at xi (p, dim), with the heights of a smooth surface."""
        x = np.einsum("pn,pns->ps", shape(self.cell.name, xi), self.own)
        J = np.einsum("pns,pnd->psd", self.own, gradient(self.cell.name, xi))
        height = self.surface.height
        if height is not None:
            n, padded = unit(normals_of(J)), np.pad(xi, ((0, 0), (0, 2 - xi.shape[1])))
            x += height.at(self.face, padded)[:, None] * n
            J += n[:, :, None] * height.slope(self.face, padded)[:, None, : self.cell.dim]
        return x, J


def _ways(surface: Surface, face: Ints, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the ways from points x (n, 3) to their faces (n,), the normals there, and the ways back beyond boundaries.

    The last undo the part of the way that leads from beyond the boundary of the surface to it; (n, 3) each.
    """
    way, normal, beyond = np.zeros((3, len(face), 3))
    kind = surface.faces.type[face]
    for code in np.unique(kind):
        rows, cell = np.flatnonzero(kind == code), CELLS[FACE_TYPES[code]]
        own = surface.x[surface.faces.nodes[face[rows], : N_NODES[code]]]
        patches = _Patches(cell, surface, face[rows], own)
        xi = _closest(patches, x[rows])
        at, J = patches.at(xi)
        way[rows], normal[rows] = at - x[rows], unit(normals_of(J))
        sides = _inward(cell, xi) <= _ROUNDING
        sides &= surface.neighbours[face[rows], : sides.shape[1]] < 0
        beyond[rows] = _beyond(cell, J, normal[rows], sides, way[rows])
    return way, normal, beyond


def _beyond(cell: Cell, J: Floats, n: Floats, boundary: NDArray[np.bool_], way: Floats) -> NDArray[np.floating]:
    """Return what a way (p, 3) has across the sides (p, sides) of the boundary on which it ends, with its sign changed.

    `J` (p, 3, dim), `n` (p, 3): tangents and normals at its end.
    """
    out = np.zeros_like(way)
    for k in range(boundary.shape[1]):
        if cell.dim == 1:
            across = J[:, :, 0] * (-1.0, 1.0)[k]
        else:
            ends = np.array(cell.reference)[list(cell.edges[k])]
            across = np.cross(J @ (ends[1] - ends[0]), n)
        across = unit(across)
        inward = np.minimum(((way + out) * across).sum(axis=1), 0.0)
        out -= np.where(boundary[:, k], inward, 0.0)[:, None] * across
    return out


def _closest(patches: _Patches, x: Floats) -> NDArray[np.floating]:
    """Return the reference coordinates (p, dim) in faces that are closest to points x (p, 3)."""
    cell = patches.cell
    corners = np.array(cell.reference[: cell.n_corners])
    middle = np.broadcast_to(corners.mean(axis=0), (len(x), cell.dim))
    xi = _foot(patches, x, middle, np.zeros(cell.dim), np.eye(cell.dim))
    outside = np.flatnonzero(~(_inward(cell, xi).min(axis=1) >= -_ROUNDING))
    best, patches, x = np.full(len(outside), np.inf), patches.take(outside), x[outside]
    for a, b in ((0, 0), (1, 1)) if cell.dim == 1 else cell.edges:
        along = (corners[b] - corners[a])[:, None]
        s = np.full((len(x), 1), 0.5)
        s = _foot(patches, x, s, corners[a], along) if cell.dim == 2 else s
        on = corners[a] + s @ along.T
        distance = np.linalg.norm(patches.at(on)[0] - x, axis=1)
        nearer = distance < best
        xi[outside[nearer]], best[nearer] = on[nearer], distance[nearer]
    return xi


def _foot(patches: _Patches, x: Floats, t: Floats, start: Floats, along: Floats) -> NDArray[np.floating]:
    """Return parameters t (p, k) of the feet of points x (p, 3) on faces, or on a side of them, from a first guess.

    xi = `start` + `along` t, with `start` (dim,), `along` (dim, k). On a side t stays between 0 and 1.
    """
    t = np.array(t, float)
    for _ in range(_STEPS):
        at, J = patches.at(start + t @ along.T)
        J = J @ along
        A = np.einsum("psd,pse->pde", J, J)
        A[np.linalg.det(A) <= 0] = np.eye(A.shape[1])
        step = np.linalg.solve(A, np.einsum("psd,ps->pd", J, x - at)[:, :, None])[:, :, 0]
        size = np.abs(step).max(axis=1, keepdims=True)
        new = t + step * np.minimum(1.0, _LONGEST / np.maximum(size, 1e-300))
        new = np.clip(new, 0.0, 1.0) if len(start) > along.shape[1] else new
        change, t = np.abs(new - t).max(initial=0.0), new
        if change < _FOUND:
            break
    return t


def _inward(cell: Cell, xi: Floats) -> NDArray[np.floating]:
    """Return the distance (p, sides) from each side of a face, an edge or an end, in reference coordinates."""
    if cell.family == "SEG":
        return np.concatenate([1 + xi, 1 - xi], axis=1)
    u, v = xi.T
    if cell.family == "TRIA":
        return np.stack([v, 1 - u - v, u], axis=1)
    return np.stack([1 + v, 1 - u, 1 - v, 1 + u], axis=1)
