"""Fit of one shape to some nodes: the simplest of plane, cylinder, sphere, cone and torus that contains all of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lacmesh.mesh import Floats
from lacmesh.smooth.shape import FREEDOMS, Shape

#: how far a node may be from a shape, of the size of all nodes on it
EXACT = 1e-8
#: what coordinates are rounded to, of their distance from 0
ROUNDED = 1e-15
#: more nodes than freedoms that a shape needs before it is believed, in the plane and in space
_MORE = {1: 2, 2: 3}
#: of the size of the nodes, how far from them the apex is of a cone that might be a sphere
_APEX = 1e-3
#: nodes that a shape is sought on; what is found is asked for all
_SAMPLE = 300


def simplest(x: Floats, normal: Floats, dim: int, slack: float = 1.0) -> Shape | None:
    """Return the simplest shape on which points x (n, 3) with normals (n, 3) lie; None if there is none.

    `dim`: 2 for surfaces, 1 for lines in the plane. `slack`: factor on the tolerance. Two circles about one axis (a
    strip with one row of faces) fit both a cone and a sphere: then the cone is chosen, which is straight between them,
    unless its apex is one of the points.
    """
    frame = _Frame.of(x)
    own, tolerance = frame.local(x), slack * frame.tolerance
    for kind in FREEDOMS if dim == 2 else ("plane", "sphere"):
        shape = _of_kind(kind, own, normal, tolerance, dim)
        if shape is not None and kind == "sphere" and dim == 2:
            cone = _of_kind("cone", own, normal, tolerance, dim)
            if cone is not None and ((own - cone.centre) @ cone.axis).min() > _APEX:
                shape = cone
        if shape is not None:
            return frame.back(shape)
    return None


def nearest(shape: Shape, x: Floats) -> Shape | None:
    """Return the shape of the same kind nearest to points x (n, 3), at any distance; None if the fit fails."""
    frame = _Frame.of(x)
    fitted = frame.inside(shape).fitted(frame.local(x), np.inf)
    return None if fitted is None else frame.back(fitted)


def tolerance_of(x: Floats) -> float:
    """Tolerance, a length, on the distance of points x (n, 3) from a shape on which they lie."""
    frame = _Frame.of(x)
    return frame.tolerance * frame.size


def least_nodes(kind: str, dim: int) -> int:
    """Least number of nodes for which a shape is accepted; 1 for a plane."""
    return 1 if kind == "plane" else FREEDOMS[kind] - (dim == 1) + _MORE[dim]


@dataclass(frozen=True, eq=False)
class _Frame:
    """Scaled coordinates in which a shape is fitted: relative to `origin`, in units of `size`, as is `tolerance`."""

    origin: Floats
    size: float
    tolerance: float

    @classmethod
    def of(cls, x: Floats) -> _Frame:
        origin = x.mean(axis=0)
        size = max(2 * float(np.linalg.norm(x - origin, axis=1).max()), 1e-300)
        return cls(origin, size, EXACT + ROUNDED * float(np.abs(x).max()) / size)

    def local(self, x: Floats) -> Floats:
        return (x - self.origin) / self.size

    def back(self, shape: Shape) -> Shape:
        lengths = shape.size if shape.kind == "cone" else shape.size * self.size
        return replace(shape, centre=self.origin + shape.centre * self.size, size=lengths)

    def inside(self, shape: Shape) -> Shape:
        lengths = shape.size if shape.kind == "cone" else shape.size / self.size
        return replace(shape, centre=self.local(shape.centre), size=lengths)


def _of_kind(kind: str, x: Floats, normal: Floats, tolerance: float, dim: int) -> Shape | None:
    """Return the shape of one kind on which all points lie, if they are enough for it; else None."""
    if len(x) < least_nodes(kind, dim):
        return None
    some = np.linspace(0, len(x) - 1, min(len(x), _SAMPLE)).astype(int)
    for start in _starts(kind, x[some], normal[some], dim):
        shape = start.fitted(x[some], tolerance)
        if shape is not None and len(some) < len(x):
            shape = shape.fitted(x, tolerance)
        if shape is not None and _sound(shape):
            return shape
    return None


def _sound(shape: Shape) -> bool:
    """True for shapes that occur in parts: a torus must have a hole, a cone be neither a plane nor a cylinder."""
    if shape.kind == "torus":
        return bool(shape.size[0] > shape.size[1] > 0)
    return shape.kind != "cone" or bool(0 < shape.size[0] < np.pi / 2)


# ---- where to start from


def _starts(kind: str, x: Floats, normal: Floats, dim: int) -> Iterator[Shape]:
    """Yield initial guesses of a shape of one kind for points x (n, 3) with normals (n, 3), the most likely first."""
    none = np.zeros(0)
    if kind == "plane":
        centre = x.mean(axis=0)
        plane = np.linalg.svd((x - centre)[:, : dim + 1], full_matrices=len(x) <= dim)[2]
        yield Shape(kind, centre, np.append(plane[-1], [0.0] * (2 - dim)), none)
    elif kind == "sphere":
        c, r = _circle(x)
        yield Shape(kind, c, np.array([0.0, 0.0, 1.0]), np.array([r]))
    elif kind == "cylinder":
        axis = np.linalg.eigh(normal.T @ normal)[1][:, 0]
        basis = _across(axis)
        c, r = _circle(x @ basis.T)
        yield Shape(kind, c @ basis, axis, np.array([r]))
    else:
        for axis in _axes(x, normal):
            yield from _about(kind, axis, x, normal)


def _circle(x: Floats) -> tuple[Floats, float]:
    """Centre and radius of the least-squares circle or sphere of points (n, k), by |x|^2 = 2 c.x + r^2 - c^2."""
    A = np.concatenate([2 * x, np.ones((len(x), 1))], axis=1)
    c = np.linalg.lstsq(A, (x * x).sum(axis=1), rcond=1e-13)[0]
    return c[:-1], float(np.sqrt(max(c[-1] + c[:-1] @ c[:-1], 0.0)))


def _across(axis: Floats) -> Floats:
    """(2, 3): two orthogonal directions perpendicular to an axis."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])


def _axes(x: Floats, normal: Floats) -> list[Floats]:
    """Directions of possible axes of revolution, which the normals at the points intersect, the most likely first.

    The line (x, n) intersects the axis of direction a and moment m if a.(x x n) + m.n = 0; the normals of a cone all
    make the same angle with its axis.
    """
    moment = np.cross(x, normal)
    A, B, D = moment.T @ moment, moment.T @ normal, normal.T @ normal
    S = A - B @ np.linalg.pinv(D, rcond=1e-10, hermitian=True) @ B.T
    spread = normal - normal.mean(axis=0)
    meeting, turning = np.linalg.eigh(S)[1].T, np.linalg.eigh(spread.T @ spread)[1].T
    return [meeting[0], turning[0], meeting[1], turning[1], meeting[2], turning[2]]


def _about(kind: str, axis: Floats, x: Floats, normal: Floats) -> Iterator[Shape]:
    """Yield cones or tori with an axis of this direction, placed where the normals meet and fitted in the meridian."""
    basis = _across(axis)
    p, n = x @ basis.T, normal @ basis.T
    rows = np.stack([n[:, 1], -n[:, 0]], axis=1)
    centre = np.linalg.lstsq(rows, (rows * p).sum(axis=1), rcond=1e-10)[0]
    rho, s = np.linalg.norm(p - centre, axis=1), x @ axis
    if kind == "cone":
        slope, at = np.linalg.lstsq(np.stack([s, np.ones_like(s)], axis=1), rho, rcond=None)[0]
        if abs(slope) > 1e-6:
            way = np.sign(slope)
            yield Shape(kind, centre @ basis - at / slope * axis, way * axis, np.array([np.arctan(abs(slope))]))
    else:
        (R, s0), r = _circle(np.stack([rho, s], axis=1))
        if R > 0:
            yield Shape(kind, centre @ basis + s0 * axis, axis, np.array([R, r]))
