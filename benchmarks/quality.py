"""Measure quality, validity and the check of meshes of 1e6 cells, and the report of a cut.

    python -m benchmarks.quality [--quick] [-o TABLE.md]

Seconds are wall time and this process's own time, of all its threads together: on two free cores the first is down to
half of the second, on a shared machine it is longer. The check is of a block of up to 1e6 HEXA8 or TETRA4 cells with
about 1e4 slave faces, cut, and a master block of one layer above it. Every figure is of a second run: the first loads
compiled kernels.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.common import blocks, box, main, n_bytes, peak, seconds, solid
from lacmesh import cut_skin
from lacmesh.cells import CELLS
from lacmesh.checks import RULES, _arguments, check
from lacmesh.checks.request import Request
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.quality import measure_quality
from lacmesh.quality.geometry import validity_among
from lacmesh.report import cut_report

HEADS = ("what", "wall", "own", "own, 1e6 cells")
CHECK_HEADS = ("check of cells", "type", "seconds", "memory over the mesh's", "slowest parts")


def shaken(mesh):
    """A mesh whose nodes are moved a little: no two cells are alike."""
    return replace(mesh, points=mesh.points + 0.1 * np.random.default_rng(0).normal(size=mesh.points.shape))


def meshes(quick):
    """(type, mesh) of about 1e6 linear or 1e5 quadratic cells."""
    n, m = (20, 10) if quick else (100, 46)
    yield "HEXA8", solid("HEXA8", n, n, n)
    yield "TETRA4", solid("TETRA4", n, n, n // 6 + 1)
    yield "PENTA6", solid("PENTA6", *[int(n / 1.26)] * 3)
    yield "PYRAM5", solid("PYRAM5", *[int(n / 1.82)] * 3)
    yield "HEXA20", solid("HEXA20", m, m, m)
    yield "TETRA10", solid("TETRA10", m, m, m // 6 + 1)


def timed(run, repeats):
    """The least wall time, and the least of the process's own, of several calls after one that is not counted."""
    run()
    took = []
    for _ in range(repeats):
        start = time.perf_counter(), time.process_time()
        run()
        took.append((time.perf_counter() - start[0], time.process_time() - start[1]))
    return np.min(took, axis=0)


def quality_rows(quick):
    repeats = 1 if quick else 3
    for name, plain in meshes(quick):
        mesh, count = shaken(plain), plain.n_cells
        solids = [b for b in mesh.blocks if CELLS[b.type].dim == 3]
        calls = {"validity": lambda m=mesh, s=solids: [validity_among(b.type, m.points, b.nodes) for b in s]}
        calls["lacmesh quality"] = lambda m=mesh: measure_quality(m, "body")
        for what, call in calls.items():
            wall, own = timed(call, repeats)
            yield f"{what}, {count:,} {name}", f"{wall:.2f} s", f"{own:.2f} s", f"{own * 1e6 / count:.2f} s"
    n = 20 if quick else 100
    mesh = shaken(box(n, n, n))
    cut = cut_skin(mesh, "slave")
    wall, own = timed(lambda: cut_report(mesh, cut), repeats)
    yield f"cut_report, {n * n:,} slave faces", f"{wall:.2f} s", f"{own:.2f} s", ""


def checked(mesh):
    """(seconds, peak memory over the mesh's own, seconds of each rule; the first that needs a figure computes it)."""
    options = {"search_distance": None, "max_penetration": None, "axisymmetric": False}
    options |= {"surface": "smooth", "crease_angle": 40.0, "recognise": True}
    origin = origin_of_mesh(mesh)
    request = Request.of(from_origin(mesh, origin), origin, ("slave",), ("master",), **options)
    parts = {}
    for scope, function in (part for rule in RULES.values() for part in rule.functions):
        work = lambda f=function, s=scope: [[*f(request, *skin)] for _, *skin in _arguments(s, request)]  # noqa: E731
        parts[function.__name__] = seconds(work)
    found = []
    whole = partial(check, mesh, "slave", "master", recognise=True)
    took = seconds(lambda: found.append(whole()))
    assert not found[0].errors, [finding.message for finding in found[0].errors]
    return took, peak(whole)[0] / n_bytes(mesh), parts


def check_rows(quick):
    check(blocks(3, 4, 3, top=1), "slave", "master", recognise=True)
    k = 10 if quick else 1
    for cell, n, layers in (("HEXA8", 100, (20, 50, 100)), ("TETRA4", 71, (10, 33))):
        for high in layers:
            mesh = blocks(n, n + 1, max(high // k, 1), cell, top=1)
            took, memory, parts = checked(mesh)
            slow = ", ".join(f"{name} {parts[name]:.2f}" for name in sorted(parts, key=parts.get, reverse=True)[:4])
            yield f"{mesh.n_cells:,}", cell, f"{took:.2f}", f"{memory:.2f}", slow


if __name__ == "__main__":
    main(__doc__, lambda asked: [(HEADS, quality_rows(asked.quick)), (CHECK_HEADS, check_rows(asked.quick))])
