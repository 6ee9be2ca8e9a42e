"""Skins that lie on a known surface: sheets of faces rolled onto it, blocks bent with it, and the surface itself."""

from dataclasses import replace

import numpy as np

from lacmesh import Mesh, generate
from lacmesh.cells import CELLS
from lacmesh.reference.shapes import shape
from lacmesh.smooth import height_of
from lacmesh.surface import Surface
from lacmesh.surface.record import mean_normals
from lacmesh.topology.skin import FACE_TYPES
from tests.surface.surfaces import mapped, sheet, whole

ANGLE = np.arctan2(1.0, 0.4)
KINDS = ["TRIA3", "QUAD4", "mixed"]


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


def slight(x):
    """A cubic, whose second derivatives are linear and whose slopes are small."""
    u, v = x[:, 0] - 0.5, x[:, 1] - 0.5
    return np.stack([u, v, 1e-3 * (u * v + u**3 - 2 * u * u * v + v**3)], axis=1)


def waves(x):
    return np.stack([x[:, 0], x[:, 1], 0.1 * np.sin(3 * x[:, 0] + 2 * x[:, 1] ** 2)], axis=1)


#: a function that is 0 on each surface, and grows on its outer side
LEVEL = {
    cylinder: lambda x: np.hypot(x[:, 0], x[:, 1]) - 1,
    sphere: lambda x: np.linalg.norm(x, axis=1) - 1,
    cone: lambda x: (np.hypot(x[:, 0], x[:, 1]) - 1) * np.cos(ANGLE) + x[:, 2] * np.sin(ANGLE),
    torus: lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]) - 3, x[:, 2]) - 1,
    ellipsoid: lambda x: np.linalg.norm(x / [1, 1.3, 0.8], axis=1) - 1,
    saddle: lambda x: x[:, 2] - 0.5 * (x[:, 0] ** 2 - x[:, 1] ** 2) - 0.2 * x[:, 0] ** 3,
    slight: lambda x: x[:, 2] - slight(x + 0.5)[:, 2],
    waves: lambda x: x[:, 2] - 0.1 * np.sin(3 * x[:, 0] + 2 * x[:, 1] ** 2),
}
ROUND = [cylinder, sphere, cone, torus]


def rolled(surface, n, kind="TRIA3", skew=0.25, **options):
    """A sheet of n x n faces, its inner nodes moved, on a surface; all faces are the group `skin`."""
    mesh = mapped(sheet(n, kind=kind, skew=skew, **options), surface)
    return replace(mesh, cell_groups={"skin": np.arange(mesh.n_cells)})


def chain(points, closed=True):
    """Segments from each point to the next, as the group `skin`; normals are to the right of the way."""
    n = len(points)
    pairs = np.stack([np.arange(n), np.roll(np.arange(n), -1)], axis=1)[: n if closed else n - 1]
    return Mesh.create(points, [("SEG2", pairs)], cell_groups={"skin": np.arange(len(pairs))}, space_dim=2)


def block(kind, n=4):
    """A block of two layers about a sphere of radius 1.4 at its top, the group `skin`."""
    mesh = generate.box((n, n, [0, 0.2, 0.4]), 1.0, kind, distortion=0.1).only("body", "top")
    return mesh.renamed(top="skin").moved(shell)


def shell(x):
    a, b, r = x[0], x[1], 1 + x[2]
    return r * np.stack([np.sin(a), np.cos(a) * np.sin(b), np.cos(a) * np.cos(b)])


def skin_of(mesh, group="skin"):
    return Surface.of(mesh, mesh.cells_of(group))


def along(level, x, way):
    """Distance to a surface along directions, by Newton's method with differences."""
    t = np.zeros(len(x))
    for _ in range(30):
        at = lambda s: level(x + s[:, None] * way)  # noqa: E731
        t = t - at(t) / ((at(t + 1e-6) - at(t - 1e-6)) / 2e-6)
    return t


def worst(surface, faces, height, rows):
    """The largest error of the heights anywhere in some faces, and the largest height."""
    normal, rng = mean_normals(faces)[0], np.random.default_rng(0)
    error = largest = 0.0
    for name, mine, nodes in faces.by_type():
        there = np.isin(mine, rows)
        for _ in range(3):
            k = int(there.sum())
            xi = rng.dirichlet([1, 1, 1], k)[:, :2] if name == "TRIA3" else rng.uniform(-1, 1, (k, 2))
            x = np.einsum("pn,pns->ps", shape(name, xi), faces.x[nodes[there]])
            exact = along(LEVEL[surface], x, normal[mine[there]])
            error = max(error, float(np.abs(height.at(mine[there], xi) - exact).max(initial=0.0)))
            largest = max(largest, float(np.abs(exact).max(initial=0.0)))
    return error, largest


def heights(mesh, surface=None):
    """(f, 5): heights at the middles of the edges of each face and, of quadrangles, at the centre."""
    height = height_of(mesh, whole(mesh) if surface is None else surface)
    out = np.zeros((len(height.type), 5))
    for code in np.unique(height.type):
        n = CELLS[FACE_TYPES[code]].n_corners
        rows, more = height.type == code, {2: 1, 3: 3, 4: 5}[n]
        out[rows, :more] = height.value[rows, n : n + more]
    return out
