"""Measure the equations of finite strains against the linear stiffness of the same mesh, timed in the same run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/finite.py [--quick] [-o TABLE.md]

f_int(u) and K(u) in one pass, f_int(u) alone, with mean dilatation and on two threads; the energy, Cauchy stress; the
load stiffness of a follower pressure; growth with the mesh and memory. CPU seconds, for two threads wall.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from pathlib import Path
from statistics import median

import numpy as np
from assembly import body, in_turn, seconds
from meshes import box

from lacmesh import Mesh
from lacsolver.bodies.finite import NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.pointwise import DisplacedBodies
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.problem import loads
from lacsolver.space.space import Space

LINEAR = Elastic(young=200.0, poisson=0.3)
LAWS = {
    "neo-Hookean": NeoHookean(200.0, 0.3),
    "neo-Hookean, mean dilatation": NeoHookean(200.0, 0.3, mean_dilatation=True),
    "Saint Venant-Kirchhoff": SaintVenantKirchhoff(200.0, 0.3),
}


def displaced(cell, n):
    """A body of cells of size 1, its nodes moved by a stretch and at random."""
    space = Space.of(body(cell, n), "3d")
    _ = space.pattern
    x = space.mesh.points
    return space, (0.1 * x + np.random.default_rng(0).uniform(-0.02, 0.02, x.shape)).ravel()


def against_linear(cell, n, repeats):
    space, u = displaced(cell, n)
    linear, n_cells = Materials.of(space, LINEAR), len(space.blocks[0].nodes)
    for name, law in LAWS.items():
        if law == LAWS["neo-Hookean, mean dilatation"] and cell != "HEXA8":
            continue
        laws = Materials.of(space, law)
        runs = {
            "linear": lambda: assemble_stiffness(space, linear),
            "f and K": lambda m=laws: (
                DisplacedBodies(space, m, u).internal_force(),
                DisplacedBodies(space, m, u).tangent(),
            ),
            "f": lambda m=laws: DisplacedBodies(space, m, u).internal_force(),
            "energy": lambda m=laws: DisplacedBodies(space, m, u).energy(),
            "Cauchy stress": lambda m=laws: DisplacedBodies(space, m, u).cauchy_stress(),
        }
        took = in_turn(runs, repeats)
        for what in list(runs)[1:]:
            ratio = median(a / b for a, b in zip(took[what], took["linear"], strict=True))
            yield (
                f"{what}, {n_cells:,} {cell}, {name}",
                f"{median(took[what]):.2f} s",
                f"linear K {median(took['linear']):.2f} s: ratio {ratio:.2f}",
            )


def two_threads(cell, n, repeats):
    space, u = displaced(cell, n)
    laws = Materials.of(space, LAWS["neo-Hookean"])
    runs = {k: (lambda k=k: DisplacedBodies(space, laws, u, threads=k).tangent()) for k in (1, 2)}
    took = in_turn(runs, repeats, time.perf_counter)
    ratio = median(a / b for a, b in zip(took[2], took[1], strict=True))
    return (
        f"K, {len(space.blocks[0].nodes):,} {cell}, two threads",
        f"{median(took[2]):.2f} s wall",
        f"one thread {median(took[1]):.2f} s wall: ratio {ratio:.2f}",
    )


def growth(cell, sizes, repeats):
    cells, took, listed = [], [], []
    for n in sizes:
        space, u = displaced(cell, n)
        laws = Materials.of(space, LAWS["neo-Hookean"])
        DisplacedBodies(space, laws, u).tangent()
        run = [seconds(lambda s=space, m=laws, v=u: DisplacedBodies(s, m, v).tangent()) for _ in range(repeats)]
        took.append(min(run))
        cells.append(len(space.blocks[0].nodes))
        listed.append(f"{cells[-1]:,}: {took[-1]:.2f} s")
    slope = np.polyfit(np.log(cells), np.log(took), 1)[0]
    return f"growth, K, {cell}", ", ".join(listed), f"exponent {slope:.2f}"


def memory(cell, n):
    space, u = displaced(cell, n)
    laws = Materials.of(space, LAWS["neo-Hookean"])
    DisplacedBodies(space, laws, u).tangent()
    tracemalloc.start()
    K = DisplacedBodies(space, laws, u).tangent()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return (
        f"memory, {len(space.blocks[0].nodes):,} {cell}",
        f"{peak / 1e6:.0f} MB",
        f"of the values of K: {peak / K.data.nbytes:.2f}",
    )


def follower(n, repeats):
    mesh = box(n, n, 1)
    space = Space.of(Mesh.create(mesh.points, mesh.blocks, cell_groups=mesh.cell_groups), "3d")
    top, x = space.mesh.cell_groups["slave"], 1.1 * space.mesh.points
    runs = {
        "force": lambda: loads.pressure(space, top, 2.0, x=x),
        "load stiffness": lambda: loads.pressure_tangent(space, top, 2.0, x=x),
    }
    took = in_turn(runs, repeats)
    ratio = median(a / b for a, b in zip(took["load stiffness"], took["force"], strict=True))
    return (
        f"load stiffness of a follower, {len(top):,} QUAD4",
        f"{median(took['load stiffness']):.2f} s",
        f"its force {median(took['force']):.2f} s: ratio {ratio:.1f}",
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="about a tenth of the size")
    parser.add_argument("-o", "--output", type=Path, help="write the table here as well")
    args = parser.parse_args()
    k = 2 if args.quick else 1
    rows = [*against_linear("HEXA8", 40 // k, 5), *against_linear("TETRA10", 20 // k, 5)]
    rows += [two_threads("HEXA8", 40 // k, 5), growth("HEXA8", [m // k for m in (20, 30, 40, 50)], 3)]
    rows += [memory("HEXA8", 40 // k), follower(200 // k, 3)]
    text = "| what | measured | against |\n|---|---|---|\n" + "".join(f"| {' | '.join(row)} |\n" for row in rows)
    print(text)
    if args.output:
        args.output.write_text(text)


if __name__ == "__main__":
    main()
