"""Measure the check: seconds and memory on 1e6 cells, growth, and the parts by themselves.

    python benchmarks/check.py [--quick]

A block of 1e6 HEXA8 or TETRA4 cells with about 1e4 slave faces, cut, and a master block of one layer above it.
Every figure is of a second run: the first loads what is compiled (once on a machine, then from numba's cache).
"""

from __future__ import annotations

import argparse
import time
import tracemalloc

import numpy as np
from meshes import box, n_bytes

import lacmesh
from lacmesh.checks import RULES, _arguments, check
from lacmesh.checks.request import Request
from lacmesh.mesh import Mesh
from lacmesh.origin import from_origin, origin_of_mesh


def pair(nx: int, ny: int, nz: int, cell: str) -> Mesh:
    """A block with the group 'slave' on its top, cut, and one layer above it whose bottom is the group 'master'."""
    low = lacmesh.cut_skin(box(nx, ny, nz, cell), "slave").mesh
    high = box(nx, ny, 1, cell)
    points = high.points * [1.001, 1.001, -1.0] + [0, 0, nz + 1.01]  # its top comes to lie over the slave
    blocks, groups = {}, {name: [] for name in ("slave", "master")}
    for part, x, name in ((low, 0, "slave"), (high, low.n_nodes, "master")):
        for k, b in enumerate(part.blocks):
            before = sum(len(n) for n in blocks.get(b.type, []))
            nodes = b.nodes + x
            if part is high:  # mirrored
                nodes = nodes[:, _mirror(b.type)]
            blocks.setdefault(b.type, []).append(nodes)
            mine = part.cell_groups["slave"]
            mine = mine[(mine >= part.offsets[k]) & (mine < part.offsets[k + 1])] - part.offsets[k]
            groups[name].append((b.type, before + mine))
    made = {kind: np.concatenate(rows) for kind, rows in blocks.items()}
    start = dict(zip(made, np.cumsum([0, *(len(n) for n in made.values())]), strict=False))
    named = {name: np.concatenate([start[kind] + rows for kind, rows in of]) for name, of in groups.items()}
    return Mesh.create(np.vstack([low.points, points]), made.items(), cell_groups=named)


def _mirror(kind: str) -> list[int]:
    return {"HEXA8": [4, 5, 6, 7, 0, 1, 2, 3], "TETRA4": [0, 2, 1, 3], "QUAD4": [0, 3, 2, 1], "TRIA3": [0, 2, 1]}[kind]


def measured(mesh: Mesh) -> tuple[float, float, dict[str, float]]:
    """(seconds, peak memory over the mesh's own, seconds of each rule; the first that needs a figure computes it)."""
    options = dict.fromkeys(("search_distance", "max_penetration"))
    options |= {"axisymmetric": False, "surface": "smooth", "crease_angle": 40.0}
    origin = origin_of_mesh(mesh)
    local = from_origin(mesh, origin)
    request = Request.of(local, origin, ("slave",), ("master",), recognise=True, **options)
    parts = {}
    for scope, function in (part for rule in RULES.values() for part in rule.functions):
        start = time.perf_counter()
        for _, *skin in _arguments(scope, request):
            _ = [*function(request, *skin)]
        parts[function.__name__] = time.perf_counter() - start
    start = time.perf_counter()
    found = check(mesh, "slave", "master", recognise=True)
    seconds = time.perf_counter() - start
    assert not found.errors, [f.message for f in found.errors]
    tracemalloc.start()
    check(mesh, "slave", "master", recognise=True)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return seconds, peak / n_bytes(mesh), parts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the size")
    args = parser.parse_args()
    k = 10 if args.quick else 1
    check(pair(3, 3, 3, "HEXA8"), "slave", "master", recognise=True)
    print("| cells | type | seconds | memory over the mesh's | slowest parts |\n|---:|---|---:|---:|---|")
    for cell, shapes in (
        ("HEXA8", [(100, 100, n // k) for n in (20, 50, 100)]),
        ("TETRA4", [(71, 71, n // k) for n in (10, 33)]),
    ):
        for shape in shapes:
            mesh = pair(*shape, cell)
            seconds, memory, parts = measured(mesh)
            slow = sorted(parts, key=parts.get, reverse=True)[:4]
            named = ", ".join(f"{name} {parts[name]:.2f}" for name in slow)
            print(f"| {mesh.n_cells:,} | {cell} | {seconds:.2f} | {memory:.2f} | {named} |")


if __name__ == "__main__":
    main()
