"""Skins that lie on a known surface: sheets of faces rolled onto it, blocks bent with it, and the surface itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.reference.shapes import shape
from lacmesh.surface.record import mean_normals
from lacmesh.topology.skin import FACE_TYPES
from tests.surface.surfaces import mapped, sheet, whole

ANGLE = np.arctan2(1.0, 0.4)


def plane(x):
    return x @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]


def cylinder(x):
    return np.stack([np.cos(x[:, 0]), np.sin(x[:, 0]), x[:, 1]], axis=1)


def sphere(x):
    a, b = x[:, 0], x[:, 1]
    return np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)


def cone(x):
    r = 1 + x[:, 1]
    return np.stack([r * np.cos(x[:, 0]), r * np.sin(x[:, 0]), -0.4 * x[:, 1]], axis=1)


def torus(x):
    r = 3 + np.cos(x[:, 1])
    return np.stack([r * np.cos(x[:, 0]), r * np.sin(x[:, 0]), np.sin(x[:, 1])], axis=1)


def ellipsoid(x):
    return sphere(x) * [1, 1.3, 0.8]


def saddle(x):
    u, v = x[:, 0] - 0.5, x[:, 1] - 0.5
    return np.stack([u, v, 0.5 * (u * u - v * v) + 0.2 * u**3], axis=1)


def waves(x):
    return np.stack([x[:, 0], x[:, 1], 0.1 * np.sin(3 * x[:, 0] + 2 * x[:, 1] ** 2)], axis=1)


def _waves(x):
    return x[:, 2] - 0.1 * np.sin(3 * x[:, 0] + 2 * x[:, 1] ** 2)


#: a function that is 0 on each surface, and grows on its outer side
LEVEL = {
    plane: lambda x: 0 * x[:, 0],
    cylinder: lambda x: np.hypot(x[:, 0], x[:, 1]) - 1,
    sphere: lambda x: np.linalg.norm(x, axis=1) - 1,
    cone: lambda x: (np.hypot(x[:, 0], x[:, 1]) - 1) * np.cos(ANGLE) + x[:, 2] * np.sin(ANGLE),
    torus: lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]) - 3, x[:, 2]) - 1,
    ellipsoid: lambda x: np.linalg.norm(x / [1, 1.3, 0.8], axis=1) - 1,
    saddle: lambda x: x[:, 2] - 0.5 * (x[:, 0] ** 2 - x[:, 1] ** 2) - 0.2 * x[:, 0] ** 3,
    waves: _waves,
}


def rolled(surface, n, kind="TRIA3", skew=0.25, seed=0, **options):
    """A sheet of n x n faces, its inner nodes moved, on a surface; all faces are the group `skin`."""
    mesh = mapped(sheet(n, kind=kind, skew=skew, seed=seed, **options), surface)
    return replace(mesh, cell_groups={"skin": np.arange(mesh.n_cells)})


def inner(n, kind="TRIA3", skew=0.25, seed=0, by=1.2):
    """(f,): the faces of `rolled` that are not at its rim."""
    centre = mean_normals(whole(sheet(n, kind=kind, skew=skew, seed=seed)))[1]
    return (np.abs(centre[:, :2] - 0.5) < 0.5 - by / n).all(axis=1)


def points_in(faces, rows, n=3, seed=0):
    """Faces, reference points and places: n anywhere in each of some faces."""
    rng = np.random.default_rng(seed)
    for name, mine, nodes in faces.by_type():
        there = np.isin(mine, rows)
        for _ in range(n):
            k = int(there.sum())
            xi = rng.dirichlet([1, 1, 1], k)[:, :2] if name == "TRIA3" else rng.uniform(-1, 1, (k, 2))
            yield mine[there], xi, np.einsum("pn,pns->ps", shape(name, xi), faces.x[nodes[there]])


def along(level, x, way):
    """Distance to a surface along directions, by Newton's method with differences."""
    t = np.zeros(len(x))
    for _ in range(30):
        at = lambda s: level(x + s[:, None] * way)  # noqa: E731
        t = t - at(t) / ((at(t + 1e-6) - at(t - 1e-6)) / 2e-6)
    return t


def worst(surface, faces, height, rows):
    """The largest error of the heights over some faces, and the largest height."""
    normal = mean_normals(faces)[0]
    error = largest = 0.0
    for face, xi, x in points_in(faces, rows):
        exact = along(LEVEL[surface], x, normal[face])
        error = max(error, float(np.abs(height.at(face, xi) - exact).max(initial=0.0)))
        largest = max(largest, float(np.abs(exact).max(initial=0.0)))
    return error, largest


def block(kind, bend, n=4, layers=(0.0, 0.2, 0.4)):
    """A block of two layers whose top, the group `skin`, is bent: HEXA8, PENTA6, TETRA4, PYRAM5, or mixed."""
    rng = np.random.default_rng(0)
    g = np.linspace(0, 1, n + 1)
    x = np.stack(np.meshgrid(g, g, layers, indexing="ij"), axis=-1).reshape(-1, 3)
    free = ((x[:, :2] > 0) & (x[:, :2] < 1)).all(axis=1)
    x[free, :2] += rng.uniform(-0.2, 0.2, (int(free.sum()), 2)) / n
    i = np.arange(len(x)).reshape(n + 1, n + 1, len(layers))
    low = np.stack([i[:-1, :-1, :-1], i[1:, :-1, :-1], i[1:, 1:, :-1], i[:-1, 1:, :-1]], axis=-1)
    hexa = np.concatenate([low, low + 1], axis=-1).reshape(-1, 8)
    top = np.stack([i[:-1, :-1, -1], i[1:, :-1, -1], i[1:, 1:, -1], i[:-1, 1:, -1]], axis=-1).reshape(-1, 4)
    halves = np.concatenate([top[:, [0, 1, 2]], top[:, [0, 2, 3]]])
    prisms = lambda h: np.concatenate([h[:, [0, 1, 2, 4, 5, 6]], h[:, [0, 2, 3, 4, 6, 7]]])  # noqa: E731
    if kind == "HEXA8":
        cells = [("HEXA8", hexa), ("QUAD4", top)]
    elif kind == "PENTA6":
        cells = [("PENTA6", prisms(hexa)), ("TRIA3", halves)]
    elif kind == "TETRA4":
        kuhn = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
        cells = [("TETRA4", np.concatenate([hexa[:, k] for k in kuhn])), ("TRIA3", halves)]
    elif kind == "PYRAM5":
        centre = len(x) + np.arange(len(hexa))[:, None]
        x = np.concatenate([x, x[hexa].mean(axis=1)])
        sides = [(1, 2, 3, 0), (4, 5, 1, 0), (5, 6, 2, 1), (6, 7, 3, 2), (7, 4, 0, 3), (7, 6, 5, 4)]
        cells = [("PYRAM5", np.concatenate([np.hstack([hexa[:, s], centre]) for s in sides])), ("QUAD4", top)]
    else:
        column = np.arange(len(hexa)) // (len(layers) - 1) % 2 == 0
        even = np.arange(len(top)) % 2 == 0
        some = np.concatenate([top[~even][:, [0, 1, 2]], top[~even][:, [0, 2, 3]]])
        cells = [("HEXA8", hexa[column]), ("PENTA6", prisms(hexa[~column])), ("QUAD4", top[even]), ("TRIA3", some)]
    first = sum(len(nodes) for name, nodes in cells if name not in ("QUAD4", "TRIA3"))
    total = sum(len(nodes) for _, nodes in cells)
    return Mesh.create(bend(x), cells, cell_groups={"skin": np.arange(first, total)})


def shell(x):
    """Places of a block about a sphere of radius 1.4 at its top."""
    r = 1 + x[:, 2]
    a, b = x[:, 0], x[:, 1]
    return r[:, None] * np.stack([np.sin(a), np.cos(a) * np.sin(b), np.cos(a) * np.cos(b)], axis=1)


def over(height):
    """(f, 5): a height at the middles of the edges of each face and, of quadrangles, at the centre."""
    out = np.zeros((len(height.type), 5))
    for code in np.unique(height.type):
        n = CELLS[FACE_TYPES[code]].n_corners
        rows, more = height.type == code, {2: 1, 3: 3, 4: 5}[n]
        out[rows, :more] = height.value[rows, n : n + more]
    return out
