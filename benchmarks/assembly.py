"""Measure the assembly of the stiffness, as ratios against references timed in the same run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/assembly.py [--quick] [-o TABLE.md]

The references: a numba kernel that goes point by point and pair by pair straight into CSR, for one isotropic law; and
numpy's einsum with COO. All take the mesh in memory and end with the values of K; ours ends with the matrix. CPU
seconds for one thread, wall for two. Then: the symbolic phase, memory beside K, growth with the mesh, the other stages,
and the first call of all, which compiles. (Without the variable, einsum's BLAS takes every core, and its CPU seconds
say little.)
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from pathlib import Path
from statistics import median

import numpy as np
import scipy.sparse as sp
from meshes import box

from lacmesh import Mesh, raise_order
from lacmesh.kernels import kernel
from lacmesh.reference.shapes import gradient
from lacsolver.bodies.material import Elastic, Materials, Orthotropic
from lacsolver.bodies.small import assemble_stiffness, internal_force, stress
from lacsolver.space.pattern import node_pattern
from lacsolver.space.rules import cell_rule
from lacsolver.space.space import Space

LAW = Elastic(young=200.0, poisson=0.3)
WOOD = Orthotropic((11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06), axes=((2.0, 1.0, 0.5), (0.0, 1.0, 1.0)))
FIRST = """
import time; import numpy as np
from lacmesh import Mesh; from lacsolver.space.space import Space
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness, internal_force
x = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
start = time.perf_counter()
space = Space.of(Mesh.create(x, [("TETRA4", [[0, 1, 2, 3]])]), "3d")
materials = Materials.of(space, Elastic(1.0, 0.3))
assemble_stiffness(space, materials); internal_force(space, materials, np.zeros(12))
print(time.perf_counter() - start)
"""


@kernel
def point_by_point(nodes, x, dN, w, lam, mu, indptr, indices, out):
    """Blocks of an isotropic K, added at each point for each pair of nodes."""
    n = nodes.shape[1]
    G, K = np.empty((n, 3)), np.empty((n, n, 3, 3))
    J = np.empty((3, 3))
    for e in range(len(nodes)):
        K[:] = 0.0
        for q in range(len(w)):
            J[:] = 0.0
            for a in range(n):
                for s in range(3):
                    for d in range(3):
                        J[s, d] += x[nodes[e, a], s] * dN[q, a, d]
            c0 = J[1, 1] * J[2, 2] - J[1, 2] * J[2, 1]
            c1 = J[1, 2] * J[2, 0] - J[1, 0] * J[2, 2]
            c2 = J[1, 0] * J[2, 1] - J[1, 1] * J[2, 0]
            det = J[0, 0] * c0 + J[0, 1] * c1 + J[0, 2] * c2
            r = 1.0 / det
            b01, b02 = (J[0, 2] * J[2, 1] - J[0, 1] * J[2, 2]) * r, (J[0, 1] * J[1, 2] - J[0, 2] * J[1, 1]) * r
            b11, b12 = (J[0, 0] * J[2, 2] - J[0, 2] * J[2, 0]) * r, (J[0, 2] * J[1, 0] - J[0, 0] * J[1, 2]) * r
            b21, b22 = (J[0, 1] * J[2, 0] - J[0, 0] * J[2, 1]) * r, (J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]) * r
            for a in range(n):
                d0, d1, d2 = dN[q, a, 0], dN[q, a, 1], dN[q, a, 2]
                G[a, 0] = d0 * c0 * r + d1 * c1 * r + d2 * c2 * r
                G[a, 1] = d0 * b01 + d1 * b11 + d2 * b21
                G[a, 2] = d0 * b02 + d1 * b12 + d2 * b22
            L, M = lam * w[q] * det, mu * w[q] * det
            for a in range(n):
                g0, g1, g2 = G[a, 0], G[a, 1], G[a, 2]
                for b in range(a, n):
                    h0, h1, h2 = G[b, 0], G[b, 1], G[b, 2]
                    dot = M * (g0 * h0 + g1 * h1 + g2 * h2)
                    K[a, b, 0, 0] += (L + M) * g0 * h0 + dot
                    K[a, b, 0, 1] += L * g0 * h1 + M * g1 * h0
                    K[a, b, 0, 2] += L * g0 * h2 + M * g2 * h0
                    K[a, b, 1, 0] += L * g1 * h0 + M * g0 * h1
                    K[a, b, 1, 1] += (L + M) * g1 * h1 + dot
                    K[a, b, 1, 2] += L * g1 * h2 + M * g2 * h1
                    K[a, b, 2, 0] += L * g2 * h0 + M * g0 * h2
                    K[a, b, 2, 1] += L * g2 * h1 + M * g1 * h2
                    K[a, b, 2, 2] += (L + M) * g2 * h2 + dot
        for a in range(n):
            low, high = indptr[nodes[e, a]], indptr[nodes[e, a] + 1]
            for b in range(n):
                at = low + np.searchsorted(indices[low:high], nodes[e, b])
                for s in range(3):
                    for t in range(3):
                        out[at, s, t] += K[a, b, s, t] if b >= a else K[b, a, t, s]


def einsum_and_coo(space):
    """K by B^T C B of all cells at once, and COO."""
    C = LAW.elasticity()
    rows, columns, values = [], [], []
    for name, nodes, _ in space.blocks:
        X, w = cell_rule(name)
        dN = gradient(name, X)
        J = np.einsum("cns,qnd->cqsd", space.mesh.points[nodes], dN, optimize=True)
        G = np.einsum("qnd,cqds->cqns", dN, np.linalg.inv(J), optimize=True)
        B = np.zeros((*G.shape[:2], 6, G.shape[2], 3))
        for k, s, i in (
            (0, 0, 0),
            (1, 1, 1),
            (2, 2, 2),
            (3, 0, 1),
            (3, 1, 0),
            (4, 1, 2),
            (4, 2, 1),
            (5, 0, 2),
            (5, 2, 0),
        ):
            B[:, :, k, :, s] = G[..., i]
        B = B.reshape(*G.shape[:2], 6, -1)
        CB = np.einsum("km,cqmj,cq->cqkj", C, B, np.linalg.det(J) * w, optimize=True)
        K = np.einsum("cqki,cqkj->cij", B, CB, optimize=True)
        dofs = space.dofs(nodes.ravel()).reshape(len(nodes), -1).astype(np.int32)
        rows.append(np.broadcast_to(dofs[:, :, None], K.shape).ravel())
        columns.append(np.broadcast_to(dofs[:, None], K.shape).ravel())
        values.append(K.ravel())
    made = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.coo_array(made, shape=(space.n_dof, space.n_dof)).tocsr()


def numba_reference(space):
    """Values of K by `point_by_point`."""
    out = np.zeros((len(space.pattern.indices), 3, 3))
    for name, nodes, _ in space.blocks:
        X, w = cell_rule(name)
        point_by_point(nodes, space.mesh.points, gradient(name, X), w, *LAW.lame, *space.pattern, out)
    return out


def body(cell, n):
    """A cube of n^3 hexahedra, or of six times as many tetrahedra, without skin."""
    family = "TETRA4" if cell.startswith("TETRA") else "HEXA8"
    mesh = box(n, n, n, family)
    mesh = Mesh.create(mesh.points, [(family, mesh.block(family))])
    return raise_order(mesh, "2-full" if cell == "HEXA27" else "2") if cell != family else mesh


def spaces(cell, n, law=LAW):
    space = Space.of(body(cell, n), "3d")
    _ = space.pattern
    return space, Materials.of(space, law)


def seconds(run, clock=time.process_time):
    start = clock()
    run()
    return clock() - start


def in_turn(runs, repeats, clock=time.process_time):
    """Seconds of each run, several times, one after the other, so that a slow moment falls on all."""
    for run in runs.values():
        run()
    out = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            out[name].append(seconds(run, clock))
    return out


def against(cell, n, repeats, reference, name):
    space, materials = spaces(cell, n)
    ours, theirs = assemble_stiffness(space, materials), reference(space)
    difference = abs(ours.data - theirs).max() if isinstance(theirs, np.ndarray) else abs(ours - theirs).max()
    assert difference < 1e-12 * abs(ours.data).max()
    del theirs
    took = in_turn({"ours": lambda: assemble_stiffness(space, materials), name: lambda: reference(space)}, repeats)
    ratio = median(a / b for a, b in zip(took["ours"], took[name], strict=True))
    what = f"K, {space.blocks[0].nodes.shape[0]:,} {cell}"
    return what, f"{median(took['ours']):.2f} s", f"{name} {median(took[name]):.2f} s: ratio {ratio:.2f}"


def two_threads(cell, n, repeats):
    space, materials = spaces(cell, n)
    runs = {k: (lambda k=k: assemble_stiffness(space, materials, threads=k)) for k in (1, 2)}
    took = in_turn(runs, repeats, time.perf_counter)
    ratio = median(a / b for a, b in zip(took[2], took[1], strict=True))
    return (f"K, {len(space.blocks[0].nodes):,} {cell}, two threads", f"{median(took[2]):.2f} s wall",
            f"one thread {median(took[1]):.2f} s wall: ratio {ratio:.2f}")  # fmt: skip


def stages(cell, n, repeats):
    space, materials = spaces(cell, n)
    wood = Materials.of(space, WOOD)
    u = np.random.default_rng(0).normal(size=space.n_dof)
    runs = {
        "K": lambda: assemble_stiffness(space, materials),
        "K, orthotropic, turned": lambda: assemble_stiffness(space, wood),
        "checks of the mesh": lambda: Space.of(space.mesh, "3d"),
        "symbolic phase": lambda: node_pattern((b.nodes for b in space.blocks), space.mesh.n_nodes),
        "stress": lambda: stress(space, materials, u),
        "internal force": lambda: internal_force(space, materials, u),
    }
    took = in_turn(runs, repeats)
    for name in list(runs)[1:]:
        ratio = median(a / b for a, b in zip(took[name], took["K"], strict=True))
        yield f"{name}, {len(space.blocks[0].nodes):,} {cell}", f"{median(took[name]):.2f} s", f"of K: {ratio:.2f}"


def memory(cell, n):
    space, materials = spaces(cell, n)
    assemble_stiffness(space, materials)
    tracemalloc.start()
    K = assemble_stiffness(space, materials)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return (f"memory, {len(space.blocks[0].nodes):,} {cell}", f"{peak / 1e6:.0f} MB",
            f"of the values of K: {peak / K.data.nbytes:.2f}")  # fmt: skip


def growth(cell, sizes, repeats):
    listed, cells, took = [], [], []
    for n in sizes:
        space, materials = spaces(cell, n)
        assemble_stiffness(space, materials)
        took.append(min(seconds(lambda s=space, m=materials: assemble_stiffness(s, m)) for _ in range(repeats)))
        cells.append(len(space.blocks[0].nodes))
        listed.append(f"{cells[-1]:,}: {took[-1]:.2f} s")
    slope = np.polyfit(np.log(cells), np.log(took), 1)[0]
    return f"growth, {cell}", ", ".join(listed), f"exponent {slope:.2f}"


def first_call():
    with tempfile.TemporaryDirectory() as folder:
        env = os.environ | {"NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-c", FIRST]
        cold, warm = (float(subprocess.run(command, env=env, capture_output=True, check=True).stdout) for _ in range(2))
    return "first call, compiling included", f"{cold:.1f} s", f"of a second process: {warm:.2f} s"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="about a tenth of the size")
    parser.add_argument("-o", "--output", type=Path, help="write the table here as well")
    args = parser.parse_args()
    k = 2 if args.quick else 1
    sizes = {"HEXA8": 50, "TETRA4": 54, "TETRA10": 26, "HEXA20": 20, "HEXA27": 20}
    rows = [against(cell, n // k, 7, numba_reference, "numba, point by point") for cell, n in sizes.items()]
    sizes = {"HEXA8": 30, "TETRA4": 30, "TETRA10": 14}
    rows += [against(cell, n // k, 3, einsum_and_coo, "numpy einsum and COO") for cell, n in sizes.items()]
    rows += [two_threads("HEXA8", 50 // k, 7), *stages("HEXA8", 50 // k, 3), memory("HEXA8", 50 // k)]
    rows += [growth("HEXA8", [m // k for m in (20, 30, 40, 60)], 3), first_call()]
    text = "| what | measured | against |\n|---|---|---|\n" + "".join(f"| {' | '.join(row)} |\n" for row in rows)
    print(text)
    if args.output:
        args.output.write_text(text)


if __name__ == "__main__":
    main()
