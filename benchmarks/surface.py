"""Measure coverage and gap between two skins: seconds, growth, and a reference timed in the same run.

    python benchmarks/surface.py [--quick]

Two flat skins of about 1e5 faces each, non-matching: triangles, quadrangles, and quadrangles whose inner nodes are
moved at random (their weights are fitted). `Surface.of` both, `contact_points` and `coverage` count. The reference is
scipy's cKDTree: the eight nearest master centres of each slave centre, which a search alone would need. The first call
of a fresh process is timed apart, without and with numba's cache.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from lacmesh import Mesh
from lacmesh.surface import Surface, contact_points, coverage

FIRST = (
    "import sys, time; sys.path.insert(0, sys.argv[1]); start = time.perf_counter(); import surface; "
    "surface.measured('QUAD4', 10, 0.2); print(time.perf_counter() - start)"
)


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


def first_calls() -> tuple[float, float]:
    """Seconds of the first small problem in a fresh process: compiling everything, and from the cache."""
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, "NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-c", FIRST, str(Path(__file__).parent)]
        runs = [subprocess.run(command, check=True, capture_output=True, text=True, env=env) for _ in range(2)]
    return float(runs[0].stdout), float(runs[1].stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the size")
    args = parser.parse_args()
    compiled, cached = first_calls()
    print(f"first call in a process: {compiled:.1f} s compiling, {cached:.1f} s from the cache\n")
    for kind, skew in (("TRIA3", 0.2), ("QUAD4", 0.0), ("QUAD4", 0.2)):
        measured(kind, 100, skew)
    print("| faces | type | points | Surface.of | contact_points | coverage | total | against cKDTree's query |")
    print("|---:|---|---:|---:|---:|---:|---:|---:|")
    k = 10 if args.quick else 1
    for kind, skew in (("TRIA3", 0.2), ("QUAD4", 0.0), ("QUAD4", 0.2)):
        sizes, totals = [], []
        for faces in (10_000 // k, 100_000 // k, 400_000 // k):
            rows = [measured(kind, faces, skew) for _ in range(3 if faces <= 100_000 else 1)]
            n, points, seconds, reference = min(rows, key=lambda row: sum(row[2]))
            sizes.append(n)
            totals.append(sum(seconds))
            parts = " | ".join(f"{s:.2f}" for s in seconds)
            print(f"| {n:,} | {kind}, skew {skew} | {points:,} | {parts} | {totals[-1]:.2f} "
                  f"| {totals[-1] / reference:.1f} |", flush=True)  # fmt: skip
        print(f"\ngrowth: exponent {np.polyfit(np.log(sizes), np.log(totals), 1)[0]:.2f}\n")


if __name__ == "__main__":
    main()
