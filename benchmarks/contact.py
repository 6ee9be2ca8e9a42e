"""Measure a contact solve against elastic solves of the same mesh with the same backend, in the same run.

    python benchmarks/contact.py [--quick] [-o TABLE.md]

Two blocks, non-matching, pressed together with a clearance of r^2 / 2R, `geometry = "reference"`. An elastic solve is
one analysis, one factorisation and one solution of K; a contact solve is everything from K to the pressures: pairing,
integration, factorisation, and all steps of the active set. Both are timed in turn, medians of three. Then the contact
matrices alone (search, intersection, B) of 1e5 against 1e5 faces, and how they grow.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from statistics import median

import numpy as np
from meshes import blocks

from lacmesh import Surface
from lacsolver.case import Case, Contact, Displacement, Material, Solver
from lacsolver.contact import Zone, integrate
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem

_ROUND = "0.03*((x-0.5)**2+(y-0.5)**2)"


def pressed(mesh, backend: str, kinematics: str = "small", ratio: float = 1.0) -> Problem:
    """The problem of `pressed_case` on a mesh of two blocks."""
    return Problem.of(pressed_case(backend, kinematics, ratio), mesh)


def pressed_case(
    backend: str, kinematics: str = "small", ratio: float = 1.0, path: Path = Path("blocks.msh"), **solver: int
) -> Case:
    """The upper block pushed into the lower one by a hundredth of its height; a finite one's skin is round itself.

    `ratio`: stiffness of the upper block, which has the master, relative to that of the lower one; `path`: the mesh.
    """
    law = "elastic" if kinematics == "small" else "neo_hookean"
    bodies = {"lower": 1000.0, "upper": 1000.0 * ratio}
    return Case(
        mesh=path,
        model="3d",
        kinematics=kinematics,
        material=tuple(Material(groups=(g,), law=law, young=young, poisson=0.3) for g, young in bodies.items()),
        contact=(Contact(slave="slave", master="master", clearance=_ROUND if kinematics == "small" else 0.0),),
        displacement=(
            Displacement(group="bottom", ux=0.0, uy=0.0, uz=0.0),
            Displacement(group="top", ux=0.0, uy=0.0, uz=-0.01),
        ),
        solver=Solver(backend=backend, **solver),
    )


def elastic(problem: Problem) -> tuple[float, float]:
    """Wall and processor seconds of one factorisation and solution of K, with multigrid of the set-up of a hierarchy.

    The backend is that of the contact solve: `auto` takes multigrid for large models.
    """
    model, b = ReducedProblem(problem), np.random.default_rng(0).normal(size=problem.constraints.n_q)
    _ = model.K  # is assembled
    start = time.perf_counter(), time.process_time()
    model.reference().solve(b)
    return time.perf_counter() - start[0], time.process_time() - start[1]


def contact(problem: Problem) -> tuple[float, float, int, int]:
    """Wall and processor seconds of the contact solve, its iterations, the macro-elements in contact."""
    start = time.perf_counter(), time.process_time()
    *_, state = march(problem)
    spent = time.perf_counter() - start[0], time.process_time() - start[1]
    return *spent, state.iterations, int((state.zones[0].status == 1).sum())


def compared(name: str, mesh, backend: str) -> str:
    """A line of the table."""
    problem = pressed(mesh, backend)
    _ = ReducedProblem(problem).K  # kernels are compiled
    runs = [(elastic(problem), contact(problem)) for _ in range(3)]
    e, c = (median(run[k][0] for run in runs) for k in (0, 1))
    own = median(run[1][1] / run[0][1] for run in runs)
    *_, iterations, closed = runs[0][1]
    sizes = f"{problem.constraints.n_q:,} unknowns, {problem.joints[0].zone.n_macros:,} macro-elements, {backend}"
    return (
        f"| {name}, {sizes} "
        f"| {c:.1f} s, {iterations} iterations, {closed} in contact | {c / e:.2f} elastic solves of {e:.1f} s "
        f"({own:.2f} by processor time) |"
    )


def cut(mesh) -> Zone:
    """The zone of a mesh that is cut."""
    return Zone.of(mesh, "slave", "master")


def whole(mesh) -> Zone:
    """The zone of a mesh that is not cut, each slave face a macro-element."""
    slave, master = (Surface.of(mesh, mesh.cell_groups[name]) for name in ("slave", "master"))
    faces = np.arange(len(slave))
    return Zone("slave", slave, master, faces, faces)


def matrices(name: str, zone: Zone) -> tuple[str, int, float]:
    """A line of the table for contact matrices; faces and seconds."""
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        face = integrate(zone, 3)
        seconds.append(time.perf_counter() - start)
    s = median(seconds)
    line = f"| contact matrices, {len(zone.slave):,} against {len(zone.master):,} {name} | {s:.2f} s "
    return f"{line}| {len(face.points):,} points, {face.B.nnz:,} entries |", len(zone.slave), s


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes")
    parser.add_argument("-o", metavar="TABLE.md", help="write the table here too")
    args = parser.parse_args()
    n, n10, faces = (10, 6, 20) if args.quick else (30, 15, 160)
    contact(pressed(blocks(4, 3, 2), "auto"))  # kernels are compiled, or loaded
    lines = ["| what | measured | against |", "|---|---|---|"]
    lines.append(compared("HEXA8", blocks(n, n - 3, n // 2), "auto"))
    lines.append(compared("HEXA8 cut hexa", blocks(n, n - 3, n // 2, hexa="hexa"), "auto"))
    lines.append(compared("TETRA10", blocks(n10, n10 - 3, n10 // 2, "TETRA10"), "auto"))
    print("\n".join(lines), flush=True)
    sides = {
        "triangles (HEXA8 cut pyramid against TETRA4)": lambda k: cut(blocks(k, round(1.4 * k), 1, "HEXA8", "TETRA4")),
        "parallelograms (QUAD4)": lambda k: whole(blocks(2 * k, 2 * k + 3, 1, hexa=None)),
        "biquadratic parallelograms (HEXA27)": lambda k: cut(blocks(2 * k, 2 * k + 3, 1, "HEXA27")),
        "trapezoids (HEXA8 cut hexa against QUAD4)": lambda k: cut(blocks(round(0.9 * k), 2 * k, 1, hexa="hexa")),
    }
    for name, make in sides.items():
        found = [matrices(name, make(k)) for k in (faces // 4, faces // 2, faces)]
        growth = np.polyfit(np.log([f[1] for f in found[1:]]), np.log([f[2] for f in found[1:]]), 1)[0]
        lines.append(found[-1][0].rstrip("| ") + f", exponent {growth:.2f} |")
        print(lines[-1], flush=True)
    if args.o:
        Path(args.o).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
