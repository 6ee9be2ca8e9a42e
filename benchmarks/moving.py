"""Measure contact that is paired again in every iteration beside contact that is paired once, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/moving.py [--quick] [-o TABLE.md]

Two blocks of HEXA8, cut, with a clearance of 0.1 r^2, the upper one lowered by a twentieth: `geometry = "reference"`
and `"current"` with small strains, and finite strains (neo-Hookean), with facet and with smoothed normals. One thread;
seconds of the processor. The derivative of contact is measured against pairing and integration of the same points.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
from meshes import blocks

import lacsolver.contact.tangent as contact_tangent
from lacmesh import Mesh
from lacsolver.case import Case, Contact, Displacement, Material, Solver
from lacsolver.contact.tangent import gap_derivative, motion_of, tangent
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.problem import Problem
from lacsolver.saddle.stiffness import Stiffness

_ROUND = "0.1*((x-0.5)**2+(y-0.5)**2)"
KINDS = {"reference": ("small", "reference"), "current": ("small", "current"), "finite": ("finite", "current")}
#: functions of `contact_tangent` that compute the derivative of contact
DERIVATIVES = ("motion_of", "tangent", "gap_derivative")


class Spent:
    """Seconds of the processor and calls of functions, by name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}

    def around(self, name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function with its time and calls counted under `name`."""

        def timed(*arguments: Any, **options: Any) -> Any:
            start = time.process_time()
            made = work(*arguments, **options)
            self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - start
            self.calls[name] = self.calls.get(name, 0) + 1
            return made

        return timed


def case_of(kind: str, normals: str = "facet", backend: str = "auto", path: Path = Path("blocks.msh")) -> Case:
    """Return the case of the blocks, on one thread; `path`: the mesh."""
    kinematics, geometry = KINDS[kind]
    law = "elastic" if kinematics == "small" else "neo_hookean"
    contact = {"slave": "slave", "master": "master", "clearance": _ROUND, "normals": normals}
    if kinematics == "small":
        contact["geometry"] = geometry
    return Case(
        mesh=path,
        model="3d",
        kinematics=kinematics,
        material=(Material(law=law, young=1000.0, poisson=0.3),),
        contact=(Contact(**contact),),
        displacement=(
            Displacement(group="bottom", ux=0.0, uy=0.0, uz=0.0),
            Displacement(group="top", ux=0.0, uy=0.0, uz=-0.05),
        ),
        solver=Solver(backend=backend, threads=1),
    )


def problem_of(mesh: Mesh, kind: str, normals: str = "facet") -> Problem:
    """Return the problem of the blocks."""
    return Problem.of(case_of(kind, normals), mesh)


def solved(problem: Problem) -> tuple[float, int, Spent]:
    """Return the seconds of a solve, its iterations, and its stages."""
    spent = Spent()
    with ExitStack() as stack:
        for name in DERIVATIVES:
            around = spent.around("derivative", getattr(contact_tangent, name))
            stack.enter_context(patch.object(contact_tangent, name, around))
        stack.enter_context(patch.object(ContactPair, "integrate", spent.around("pairing", ContactPair.integrate)))
        stack.enter_context(patch.object(Stiffness, "solve", spent.around("solutions", Stiffness.solve)))
        start = time.process_time()
        *_, state = march(problem)
        return time.process_time() - start, state.iterations, spent


def stages(problem: Problem, repeats: int) -> tuple[float, float, int]:
    """Return the seconds of pairing and integration, of their derivative, and the number of points."""
    pair, dim = problem.joints[0], problem.space.dim
    u = 1e-3 * np.random.default_rng(0).normal(size=problem.space.n_dof)
    taken = []
    for _ in range(repeats + 1):
        start = time.process_time()
        face = pair.integrate(problem.space, u, 1.0)
        paired = time.process_time()
        motion = motion_of(face, face.slave, face.master, pair.pairing, dim)
        tangent(motion, np.ones(len(face.w)))  # as in an iteration: the forces first
        gap_derivative(motion)
        taken.append((paired - start, time.process_time() - paired))
    first, second = (median(row[k] for row in taken[1:]) for k in (0, 1))
    return first, second, len(face.points)


def growth(sizes: list[int], normals: str) -> list[str]:
    """Return a row: seconds of the derivative, and its memory over that of the points, as they grow in number."""
    counts, seconds, ratios = [], [], []
    for n in sizes:
        problem = problem_of(blocks(n, n + 1, 1), "current", normals)
        pair = problem.joints[0]
        face = pair.integrate(problem.space, np.zeros(problem.space.n_dof), 1.0)
        held = sum(a.nbytes for a in vars(face.points).values() if isinstance(a, np.ndarray))
        _, took, count = stages(problem, 1)
        tracemalloc.start()
        motion = motion_of(face, face.slave, face.master, pair.pairing, 3)
        made = tangent(motion, np.ones(len(face.w))), gap_derivative(motion)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        values = sum(A.data.nbytes + A.indices.nbytes for A in made)
        counts.append(count)
        seconds.append(took)
        ratios.append((peak / held, values / held))
    slope = np.polyfit(np.log(counts), np.log(seconds), 1)[0]
    listed = ", ".join(f"{c:,}: {s:.3f} s" for c, s in zip(counts, seconds, strict=True))
    return [
        f"growth of the derivative with the points, {normals}",
        listed,
        f"exponent {slope:.2f}; peak memory {ratios[-1][0]:.1f} of the points', the result {ratios[-1][1]:.1f}",
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes")
    parser.add_argument("-o", "--output", type=Path, help="write the table here as well")
    args = parser.parse_args()
    small, large = ((6, 5, 4), (10, 9, 8)) if args.quick else ((12, 11, 12), (25, 24, 16))
    rows, whole, mesh = [], {}, blocks(*small)
    for normals in ("facet", "smoothed"):
        pairing, derivative, count = stages(problem_of(mesh, "current", normals), 5)
        what = f"derivative of contact, {normals}, {count:,} points"
        rows.append(
            [what, f"{derivative:.3f} s", f"pairing and integration {pairing:.3f} s: ratio {derivative / pairing:.2f}"]
        )
    for kind in ("current", "finite"):
        for normals in ("facet", "smoothed"):
            problem = problem_of(mesh, kind, normals)
            solved(problem)  # kernels are loaded
            seconds, iterations, spent = solved(problem)
            whole[kind, normals] = seconds
            share = spent.seconds["derivative"] / seconds
            solutions = spent.calls["solutions"] / iterations
            what = f"{kind}, {normals}, {problem.constraints.n_q:,} unknowns"
            rows.append(
                [
                    what,
                    f"{seconds:.2f} s, {iterations} iterations",
                    f"derivative {100 * share:.0f} %; {solutions:.1f} solutions with K an iteration",
                ]
            )
        ratio = whole[kind, "smoothed"] / whole[kind, "facet"]
        rows.append([f"{kind}, smoothed over facet, whole solve", f"{ratio:.2f}", ""])
    mesh, each = blocks(*large), {}
    for kind in KINDS:
        problem = problem_of(mesh, kind)
        seconds, iterations, spent = solved(problem)
        each[kind] = seconds / iterations
        n = f"{problem.constraints.n_q:,} unknowns, {problem.joints[0].zone.n_macros} macro-elements"
        against = f"{each[kind] / each['reference']:.2f} of reference for each iteration"
        rows.append([f"{kind}, facet, {n}", f"{seconds:.1f} s, {iterations} iterations", against])
    sizes = {
        "facet": [4, 12, 38] if args.quick else [4, 12, 38, 98],
        "smoothed": [4, 12, 20] if args.quick else [4, 12, 45],
    }
    rows += [growth(counts, normals) for normals, counts in sizes.items()]
    text = "| what | measured | against |\n|---|---|---|\n" + "".join(f"| {' | '.join(row)} |\n" for row in rows)
    print(text)
    if args.output:
        args.output.write_text(text)


if __name__ == "__main__":
    main()
