"""Exact shapes: surfaces of revolution, each defined by its curve in the meridian plane.

For a point x, s = (x - c).a is its position along the axis a from the centre c, q = x - c - s a its offset from the
axis and rho = |q|. The signed distance f of a shape is that from its meridian curve, with the derivatives f_rho and
f_s; in terms of these all others are the same for every shape:

    grad f = f_rho q / rho + f_s a,    df/dc = -grad f,    df/da = -f_rho s q / rho + f_s q.

In plane problems, z = 0, lines are treated as planes, and circles as spheres.
"""

from __future__ import annotations

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
