"""Measure quality and validity on 1e6 cells, and what a report of a cut costs.

    python benchmarks/quality.py [--quick] [-o TABLE.md]

Seconds are wall time and this process's own time, of all its threads together: on two free cores the first is down to
half of the second, on a shared machine it is longer. Kernels are compiled, or loaded, by an untimed call before.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from meshes import box

from lacmesh import cut_skin, raise_order
from lacmesh.cells import CELLS
from lacmesh.mesh import Mesh
from lacmesh.quality import measure_quality
from lacmesh.quality.geometry import validity_among
from lacmesh.report import cut_report


def shaken(mesh):
    """A mesh whose nodes are moved a little: no two cells are alike."""
    return replace(mesh, points=mesh.points + 0.1 * np.random.default_rng(0).normal(size=mesh.points.shape))


def prisms(n):
    """n x n x n boxes cut into two prisms each."""
    hexa = box(n, n, n).block("HEXA8")
    nodes = hexa[:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]].reshape(-1, 6)
    return Mesh.create(box(n, n, n).points, [("PENTA6", nodes)], cell_groups={"body": np.arange(len(nodes))})


def pyramids(n):
    """n x n x n boxes cut into six pyramids each, from their centres."""
    mesh = box(n, n, n)
    hexa = mesh.block("HEXA8")
    centres = mesh.points[hexa].mean(axis=1)
    faces = [(0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)]
    apex = len(mesh.points) + np.arange(len(hexa))
    nodes = np.concatenate([np.column_stack([hexa[:, face[::-1]], apex]) for face in faces])
    points = np.vstack([mesh.points, centres])
    return Mesh.create(points, [("PYRAM5", nodes)], cell_groups={"body": np.arange(len(nodes))})


def meshes(quick):
    """(type, mesh) of about 1e6 linear or 1e5 quadratic cells; then a quarter of a million each of four types."""
    n = 20 if quick else 100
    yield "HEXA8", box(n, n, n)
    yield "TETRA4", box(n, n, n // 6 + 1, "TETRA4")
    yield "PENTA6", prisms(int(n / 1.26))
    yield "PYRAM5", pyramids(int(n / 1.82))
    m = 10 if quick else 46
    yield "HEXA20", raise_order(box(m, m, m), "2")
    yield "TETRA10", raise_order(box(m, m, m // 6 + 1, "TETRA4"), "2")
    k = 12 if quick else 63
    hexa, tetra = box(k, k, k), box(k, k, k // 6 + 1, "TETRA4")
    yield "mixture", together(hexa, tetra, raise_order(hexa, "2"), raise_order(tetra, "2"))


def together(*parts):
    """The solids of some meshes in one mesh."""
    points, blocks = [], []
    for part in parts:
        start = sum(map(len, points))
        points.append(part.points)
        blocks += [(b.type, b.nodes + start) for b in part.blocks if CELLS[b.type].dim == 3]
    count = sum(len(nodes) for _, nodes in blocks)
    return Mesh.create(np.vstack(points), blocks, cell_groups={"body": np.arange(count)})


def timed(run, repeats):
    """The least wall time, and the least of the process's own, of several calls after one that is not counted."""
    run()
    wall, own = [], []
    for _ in range(repeats):
        start = time.perf_counter(), time.process_time()
        run()
        wall.append(time.perf_counter() - start[0])
        own.append(time.process_time() - start[1])
    return min(wall), min(own)


def rows(quick, repeats):
    for name, plain in meshes(quick):
        mesh = shaken(plain)
        solids = [b for b in mesh.blocks if CELLS[b.type].dim == 3]
        count = sum(len(b.nodes) for b in solids)
        calls = {"validity": lambda m=mesh, s=solids: [validity_among(b.type, m.points, b.nodes) for b in s]}
        calls["lacmesh quality"] = lambda m=mesh: measure_quality(m, "body")
        for what, call in calls.items():
            wall, own = timed(call, repeats)
            yield f"{what}, {count:,} {name}", wall, own, 1e6 / count
    n = 20 if quick else 100
    mesh = shaken(box(n, n, n))
    cut = cut_skin(mesh, "slave")
    yield f"cut_report, {n * n:,} slave faces", *timed(lambda: cut_report(mesh, cut), repeats), None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small meshes, once")
    parser.add_argument("-o", "--output", type=Path, help="write the table here too")
    args = parser.parse_args()
    lines = ["| what | wall | own | own, 1e6 cells |", "|---|---:|---:|---:|"]
    print("\n".join(lines))
    for what, wall, own, million in rows(args.quick, 1 if args.quick else 3):
        scaled = f"{own * million:.2f} s" if million else ""
        lines.append(f"| {what} | {wall:.2f} s | {own:.2f} s | {scaled} |")
        print(lines[-1], flush=True)
    if args.output:
        args.output.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
