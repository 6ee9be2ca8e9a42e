"""Measure the linear solvers that are installed, as ratios against rslab in the same run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/linear.py [--quick] [-o TABLE.md]

A cube of HEXA8 and one of TETRA10, 8e4 unknowns, held below, under a load on its top. CPU seconds, one thread: analysis
of the pattern, factor, one right-hand side, eight at once. Then what our own part
of a solve (the residual) costs beside the backend's, and multigrid to 1e-12.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from statistics import median

import numpy as np
from meshes import box
from scipy.sparse import csr_array

from lacmesh import Mesh, raise_order
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.linear import analyse, backends
from lacsolver.space.space import Space

LAW = Elastic(young=200.0, poisson=0.3)
REFERENCE = "rslab"


def problem(cell, n):
    """K of a cube of n^3 hexahedra, or of six times as many tetrahedra; its rigid modes; a load on top."""
    family = "TETRA4" if cell.startswith("TETRA") else "HEXA8"
    mesh = box(n, n, n, family)
    mesh = Mesh.create(mesh.points, [(family, mesh.block(family))])
    mesh = raise_order(mesh, "2") if cell != family else mesh
    space = Space.of(mesh, "3d")
    x = mesh.points - mesh.points.mean(axis=0)
    modes = np.stack([*(np.broadcast_to(e, x.shape).ravel() for e in np.eye(3)),
                      *(np.cross(e, x).ravel() for e in np.eye(3))], axis=1)  # fmt: skip
    kept = np.repeat(x[:, 2] > x[:, 2].min() + 1e-9, 3)
    K = assemble_stiffness(space, Materials.of(space, LAW)).tocsr()
    load = np.zeros(space.n_dof)
    load[3 * np.flatnonzero(x[:, 2] > x[:, 2].max() - 1e-9) + 2] = -1.0
    return csr_array(K[kept][:, kept]), modes[kept], load[kept]


def timed(run, repeats=1):
    """CPU seconds, the median of some runs after a first one where there are several; what the last one returned."""
    if repeats > 1:
        run()
    took = []
    for _ in range(repeats):
        start = time.process_time()
        made = run()
        took.append(time.process_time() - start)
    return median(took), made


def direct(backend, K, load, repeats):
    """Seconds of analysis, factor, solve, eight solves at once, and the backend's own part of a solve."""
    eight = load[:, None] * np.linspace(1, 2, 8)
    analysis_time, analysis = timed(lambda: analyse(K, backend=backend))
    factor_time, factor = timed(lambda: analysis.factor(K))
    one, x = timed(lambda: factor.solve(load), repeats)
    many, _ = timed(lambda: factor.solve(eight), max(2, repeats // 2))
    bare, _ = timed(lambda: factor._solve(load.copy()), repeats)
    return (analysis_time, factor_time, one, many, bare), x


def multigrid(K, modes, load):
    """Seconds of set-up and of a solve, its iterations, the solution."""
    setup, factor = timed(lambda: analyse(K, backend="multigrid", modes=modes, block=3).factor(K))
    solve, x = timed(lambda: factor.solve(load))
    return setup, solve, factor.n_iterations, x


def compared(cell, n, skip, repeats):
    """Rows of one matrix: every backend against the reference."""
    K, modes, load = problem(cell, n)
    names = [b.name for b in backends().values() if b.direct and b.installed and b.name not in skip]
    results = {name: direct(name, K, load, repeats) for name in names}
    reference, exact = results[REFERENCE]
    title = f"{cell} {n}, {K.shape[0]:,} unknowns"
    for name, (took, x) in results.items():
        assert np.abs(x - exact).max() < 1e-9 * np.abs(exact).max()
        seconds = [f"{t:.2f} s ({t / r:.2f})" for t, r in zip(took[:2], reference, strict=False)]
        seconds += [f"{t:.3f} s ({t / r:.2f})" for t, r in zip(took[2:4], reference[2:], strict=False)]
        yield title, name, *seconds, f"{took[2] / took[4]:.2f}"
    if "multigrid" not in skip and backends()["multigrid"].installed:
        setup, solve, iterations, x = multigrid(K, modes, load)
        assert np.abs(x - exact).max() < 1e-9 * np.abs(exact).max()
        yield (title, "multigrid", "", f"{setup:.2f} s ({setup / reference[1]:.2f})",
               f"{solve:.2f} s ({solve / reference[2]:.2f}), {iterations} iterations", "", "")  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="an eighth of the size")
    parser.add_argument("--skip", nargs="*", default=["superlu"], help="backends to leave out (default: superlu)")
    parser.add_argument("-o", "--output", type=Path, help="write the table here as well")
    args = parser.parse_args()
    k, repeats = (2, 5) if args.quick else (1, 9)
    rows = [r for cell, n in (("HEXA8", 29), ("TETRA10", 15)) for r in compared(cell, n // k, args.skip, repeats)]
    heads = ("what", "backend", "analysis", "factor", "one solve", "eight at once", "one solve, of the backend's own")
    lines = [heads, ["---"] * len(heads), *rows]
    text = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    print(text)
    if args.output:
        args.output.write_text(text)


if __name__ == "__main__":
    main()
