"""Measure coverage and gap between two skins: seconds, growth, and a reference timed in the same run.

    python -m benchmarks.surface [--quick]

Two flat skins of up to 4e5 faces each, non-matching: triangles, quadrangles, and quadrangles whose inner nodes are
moved at random (their weights are fitted). `Surface.of` both, `contact_points` and `coverage` count. The reference is
scipy's cKDTree: the eight nearest master centres of each slave centre, which a search alone would need.
"""

from __future__ import annotations

import time

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.common import HEADS, growth, main
from lacmesh import Mesh
from lacmesh.surface import Surface, contact_points, coverage


def sheet(n: int, z: float, kind: str, skew: float, down: bool, seed: int) -> Mesh:
    """The unit square in n x n quadrangles or twice as many triangles, its inner nodes moved by up to skew faces."""
    rng = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    points = np.stack([i / n, j / n, np.full(i.shape, z)], axis=-1)
    inner = (i % n != 0) & (j % n != 0)
    points[inner, :2] += skew / n * rng.uniform(-1, 1, (inner.sum(), 2))
    g = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    cells = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=-1).reshape(-1, 4)
    if kind == "TRIA3":
        cells = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    return Mesh.create(points.reshape(-1, 3), [(kind, cells[:, ::-1] if down else cells)], space_dim=3)


def measured(kind: str, faces: int, skew: float) -> tuple[int, int, list[float], float]:
    """(faces of the slave, points, seconds of Surface.of, contact_points and coverage, seconds of the reference)."""
    n = max(2, round((faces / (2 if kind == "TRIA3" else 1)) ** 0.5))
    meshes = sheet(n, 0.0, kind, skew, False, 0), sheet(n + 3, 0.001, kind, skew, True, 1)
    clock = [time.perf_counter()]
    slave, master = (Surface.of(mesh, np.arange(mesh.n_cells)) for mesh in meshes)
    clock.append(time.perf_counter())
    points = contact_points(slave, master)
    clock.append(time.perf_counter())
    found = coverage(points, slave)
    clock.append(time.perf_counter())
    assert np.abs(found.ratio - 1).max() < 1e-10, np.abs(found.ratio - 1).max()
    assert np.abs(found.mean_gap - 0.001).max() < 1e-12
    a, b = (mesh.points[mesh.blocks[0].nodes].mean(axis=1) for mesh in meshes)
    start = time.perf_counter()
    cKDTree(b).query(a, k=min(8, len(b)))
    return len(slave), len(points), list(np.diff(clock)), time.perf_counter() - start


def rows(quick):
    for kind, skew in (("TRIA3", 0.2), ("QUAD4", 0.0), ("QUAD4", 0.2)):
        measured(kind, 100, skew)
        sizes, totals, name = [], [], f"{kind}, skew {skew}"
        for faces in (1_000, 10_000, 40_000) if quick else (10_000, 100_000, 400_000):
            found = [measured(kind, faces, skew) for _ in range(3 if faces <= 100_000 else 1)]
            n, points, taken, reference = min(found, key=lambda row: sum(row[2]))
            sizes.append(n)
            totals.append(sum(taken))
            parts = "Surface.of {:.2f}, contact_points {:.2f}, coverage {:.2f}".format(*taken)
            against = f"{totals[-1] / reference:.1f} of cKDTree's query"
            yield f"{n:,} faces, {name}, {points:,} points", f"{totals[-1]:.2f} s: {parts}", against
        yield growth(name, sizes, totals)


if __name__ == "__main__":
    main(__doc__, lambda asked: [(HEADS, rows(asked.quick))])
