"""Plain twins of the compiled kernels of contact geometry: slow, short, and written from the definitions."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import fsolve

from lacmesh.cells import CELLS
from lacmesh.reference.shapes import gradient, shape


def all_candidates(slave, master, reach):
    """Twin of search.candidates: every pair, by the definition of the prism."""
    deep = reach.deep.max(initial=0.0)
    out = []
    for s in range(len(slave.n)):
        y = slave.y[s, : slave.n[s]]
        low, high = y.min(axis=0), y.max(axis=0)
        low[2] -= min(reach.behind[s] + deep, reach.limit)
        high[2] += reach.ahead[s]
        row = []
        for m in range(len(master.n)):
            x = master.x[m, : master.n[m]]
            ends = np.array(list(itertools.product(*zip(x.min(axis=0), x.max(axis=0), strict=True))))
            there = (ends - slave.centre[s]) @ slave.e[s].T
            if (there.max(axis=0) >= low - 1e-9).all() and (there.min(axis=0) <= high + 1e-9).all():
                row.append(m)
        out.append(row)
    return out


def area(p):
    """Area of a polygon (n, 2), counter-clockwise."""
    p = np.asarray(p).reshape(-1, 2)
    if len(p) < 3:
        return 0.0
    q = np.roll(p, -1, axis=0)
    return float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2)


def inside(polygon, by):
    """The part of a polygon inside a convex one, side by side, on lists of points."""
    for a, b in zip(by, np.roll(by, -1, axis=0), strict=True):
        side = [(b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) for p in polygon]
        out = []
        for k, p in enumerate(polygon):
            q, f, g = polygon[k - 1], side[k], side[k - 1]
            if f * g < 0:
                out.append(q + (p - q) * g / (g - f))
            if f >= 0:
                out.append(p)
        polygon = out
    return polygon


def triangles(corners):
    """A polygon that may go in at one corner, as triangles."""
    n = len(corners)
    if n == 3:
        return [corners]
    best = max(range(2), key=lambda k: min(area(corners[[k, k + 1, k + 2]]), area(corners[[k, k + 2, (k + 3) % 4]])))
    return [corners[[best, best + 1, best + 2]], corners[[best, best + 2, (best + 3) % 4]]]


def shared_area(slave, s, master, m):
    """Area that two patches share in the slave's plane; both may be any quadrangles that do not cross themselves."""
    p = slave.y[s, : slave.n[s], :2]
    q = (((master.x[m, : master.n[m]] - slave.centre[s]) @ slave.e[s].T)[::-1])[:, :2]
    total = 0.0
    for a in triangles(p):
        for b in triangles(q):
            if area(b) > 0 and area(a) > 0:
                total += area(inside(list(b), a))
    return total


def ray(name, x, start, n):
    """Intersection of a ray with a face of nodes x (n_nodes, 3): reference point and distance, by scipy."""
    dim = CELLS[name].dim

    def miss(z):
        return shape(name, [z[:dim]])[0] @ x - start - z[dim] * n

    def slope(z):
        return np.column_stack([np.einsum("ns,nd->sd", x, gradient(name, [z[:dim]])[0]), -n])

    z = fsolve(miss, np.append(np.full(dim, 0.1), 0.0), fprime=slope, xtol=1e-14)
    return z[:dim], z[dim]
