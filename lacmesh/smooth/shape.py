"""Exact shapes: surfaces of revolution, each defined by its curve in the meridian plane, and their fit to nodes.

For a point x, s = (x - c).a is its position along the axis a from the centre c, q = x - c - s a its offset from the
axis and rho = |q|. The signed distance f of a shape is that from its meridian curve, with the derivatives f_rho and
f_s; in terms of these all others are the same for every shape:

    grad f = f_rho q / rho + f_s a,    df/dc = -grad f,    df/da = -f_rho s q / rho + f_s q.

In plane problems, z = 0, lines are treated as planes, and circles as spheres. Of several shapes that contain some nodes
the simplest is chosen: plane, cylinder, sphere, cone, torus.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lacmesh.mesh import Floats

#: shapes from the simplest, and the numbers that tell one from another of its kind: freedoms in space
FREEDOMS = {"plane": 3, "cylinder": 5, "sphere": 4, "cone": 6, "torus": 7}
#: rounds of Gauss and Newton; from where it converges it needs six
_ROUNDS = 25
#: rounds that need not bring it nearer; how far off it is lost, of size 1
_FREE, _LOST = 4, 1e3
#: directions in which the distances do not change, of the largest change there is
_FLAT = 1e-11


class Meridian(NamedTuple):
    """Signed distances f (n,), their derivatives with respect to rho and s (n,), and to the sizes (n, k)."""

    f: Floats
    rho: Floats
    s: Floats
    size: Floats


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape: `kind`, `centre` (3,), `axis` (3,) unit, `size` (k,).

    Sizes: none for a plane, which contains the centre and has the axis as its normal; the radius of a cylinder or a
    sphere; the half angle of a cone, whose centre is its apex and whose axis points into it; the radius of a torus'
    circle and that of its tube.
    """

    kind: str
    centre: Floats
    axis: Floats
    size: Floats

    def meridian(self, rho: Floats, s: Floats) -> Meridian:
        """Compute the signed distances from the curve in the meridian plane, and their derivatives."""
        one, none = np.ones_like(rho), np.zeros_like(rho)
        if self.kind == "plane":
            return Meridian(s, none, one, np.empty((len(s), 0)))
        if self.kind == "cylinder":
            return Meridian(rho - self.size[0], one, none, -one[:, None])
        if self.kind == "cone":
            c, d = np.cos(self.size[0]), np.sin(self.size[0])
            return Meridian(c * rho - d * s, c * one, -d * one, -(d * rho + c * s)[:, None])
        R, r = (0.0, self.size[0]) if self.kind == "sphere" else self.size
        g = np.maximum(np.hypot(rho - R, s), 1e-300)
        u, v = (rho - R) / g, s / g
        return Meridian(g - r, u, v, -one[:, None] if self.kind == "sphere" else np.stack([-u, -one], axis=1))

    def distance(self, x: Floats) -> tuple[Floats, Floats]:
        """(n,) signed distances of points x (n, 3), and (n, 3) their gradients, which are unit normals."""
        f, normal, _ = self._derivatives(x)
        return f, normal

    def meets(self, x: Floats, way: Floats) -> Floats:
        """(n,): distances from points x (n, 3) to the shape along unit directions (n, 3); NaN where they miss it.

        Newton's method starts from the points themselves, so that it finds the nearest side.
        """
        t, reach = np.zeros(len(x)), np.linalg.norm(x - self.centre, axis=1)
        for _ in range(30):
            f, normal = self.distance(x + t[:, None] * way)
            along = (normal * way).sum(axis=1)
            step = np.divide(f, along, out=np.full_like(f, np.nan), where=np.abs(along) > 0.1)
            t = t - step
            if not (np.abs(step) > 1e-15 * reach).any():
                break
        return np.where(np.abs(step) <= 1e-9 * reach, t, np.nan)

    def fitted(self, x: Floats, tolerance: float) -> Shape | None:
        """Fit a shape of this kind to points x (n, 3) by Gauss-Newton; None if a point is farther than `tolerance`."""
        shape, last = self, np.inf
        for turn in range(_ROUNDS):
            f, normal, more = shape._derivatives(x)
            worst = float(np.abs(f).max())
            slow = not worst < 0.5 * last
            if slow and (worst <= tolerance or turn > _FREE or not worst < _LOST):
                break
            last = worst
            shape = shape._moved(np.concatenate([-normal, more], axis=1), f)
        return shape if worst <= tolerance else None

    def _derivatives(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """(n,) distances, (n, 3) gradients, (n, 3 + k) derivatives with respect to the axis and the sizes."""
        d = x - self.centre
        s = d @ self.axis
        q = d - s[:, None] * self.axis
        rho = np.linalg.norm(q, axis=1)
        f, f_rho, f_s, f_size = self.meridian(rho, s)
        out = np.divide(q, rho[:, None], out=np.zeros_like(q), where=rho[:, None] > 0)
        normal = f_rho[:, None] * out + f_s[:, None] * self.axis
        by_axis = -(f_rho * s)[:, None] * out + f_s[:, None] * q
        return f, normal, np.concatenate([by_axis, f_size], axis=1)

    def _moved(self, J: Floats, f: Floats) -> Shape:
        """Return the shape after one Gauss-Newton step, the one of least norm if the distances do not determine it."""
        step = np.linalg.lstsq(J, -f, rcond=_FLAT)[0]
        axis = self.axis + step[3:6]
        return replace(
            self,
            centre=self.centre + step[:3],
            axis=axis / max(float(np.linalg.norm(axis)), 1e-300),
            size=self.size + step[6:],
        )


#: how far a node may be from a shape, of the size of all nodes on it
EXACT = 1e-8
#: what coordinates are rounded to, of their distance from 0
ROUNDED = 1e-15
#: more nodes than freedoms that a shape needs before it is believed, in the plane and in space
_MORE = {1: 2, 2: 3}
#: of the size of the nodes, how far from them the apex is of a cone that might be a sphere
_APEX = 1e-3
#: nodes that a shape is fitted to first; a fit to these must hold for all
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
