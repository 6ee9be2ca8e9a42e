"""Measure steps of an impact by multigrid: V-cycles of a step in contact against an elastic solve of K + c M.

    python benchmarks/impact.py [--sizes 100000 ...] [--steps 100] [--cfl 1.0] [-o TABLE.md]

A block with a clearance of r^2 / 2R is thrown at an elastic block whose faces do not match, HEXA8 cut `pyramid`, small
kinematics, HHT with alpha = 0.05, backend `multigrid`. In a step a wave crosses `cfl` cells. An elastic solve is one of
the same matrix and the forces of a step without contact, from zero to the same tolerance, in the same run; its V-cycles
are the mean over three steps. A step in contact is one at whose end rows are closed; its V-cycles are those of all its
active sets. Counts depend neither on the machine nor on what else it does.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from large import side
from meshes import blocks

import lacsolver.equilibrium.active_set
import lacsolver.equilibrium.newton
import lacsolver.equilibrium.stepping
from lacsolver.case import Case, Contact, Displacement, Dynamics, Initial, Material, Solver, Steps
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.motion import ENERGIES
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import LinearTolerance

YOUNG, POISSON, SPEED = 1000.0, 0.3, 1.0
#: steps in free flight before the impact
WAIT = 2.5


def thrown(n: int, steps: int, cfl: float = 1.0, backend: str = "multigrid") -> Problem:
    """The upper one of two blocks thrown at the lower one, with n cells along the side of the lower one."""
    wave = float(np.sqrt(YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))))
    dt = cfl / n / wave
    round_skin = f"0.03*((x-0.5)**2+(y-0.5)**2)+{WAIT * dt * SPEED!r}"
    case = Case(
        mesh=Path("blocks.msh"),
        model="3d",
        material=(Material(young=YOUNG, poisson=POISSON, density=1.0),),
        contact=(Contact(slave="slave", master="master", clearance=round_skin),),
        displacement=(Displacement(group="bottom", ux=0.0, uy=0.0, uz=0.0),),
        initial=(Initial(groups=("upper",), vz=-SPEED),),
        dynamics=Dynamics(),
        solver=Solver(backend=backend),
        steps=Steps(end=steps * dt, count=steps),
    )
    return Problem.of(case, blocks(n, n - 3, n // 2))


def elastic(step: LoadStep, tolerance: float) -> int:
    """V-cycles of (K + c M) q = f from zero, to the tolerance of a solve with contact."""
    contact = step.contact(np.zeros(len(step.f)))
    problem = SaddleProblem(step.reference, contact.rows, np.empty(0, np.int64), step.f, contact.G)
    to = LinearTolerance(0.0, 1e-3 * tolerance, 0.0, 0.0)
    return solve_saddle(problem, np.zeros(len(step.f)), np.zeros(len(contact.G)), to).applications


@contextmanager
def counted(cycles: list[int], steps: list[LoadStep]) -> Iterator[None]:
    """Append the V-cycles of each linear solve with contact, and each step that is attempted."""

    def solve(*arguments: Any) -> Any:
        made = solve_saddle(*arguments)
        cycles.append(made.applications)
        return made

    attempt = lacsolver.equilibrium.stepping.attempt

    def attempted(step: LoadStep, *arguments: Any) -> Any:
        steps.append(step)
        return attempt(step, *arguments)

    with (
        patch.object(lacsolver.equilibrium.active_set, "solve_saddle", solve),
        patch.object(lacsolver.equilibrium.newton, "solve_saddle", solve),
        patch.object(lacsolver.equilibrium.stepping, "attempt", attempted),
    ):
        yield


def measured(n: int, count: int, cfl: float = 1.0) -> dict[str, Any]:
    """The figures of one size."""
    problem, cycles, steps = thrown(n, count, cfl), [], []
    spent, alone, energies, closed, start = [], [], [], [], time.perf_counter()
    asked = {count // 4, count // 2, 3 * count // 4}
    with counted(cycles, steps):
        for k, state in enumerate(march(problem)):
            closed.append(int((state.zones[0].status == 1).sum()))
            spent.append(sum(cycles))
            cycles.clear()
            energies.append(state.step.motion.energies)
            if k in asked:
                alone.append(elastic(steps[-1], problem.case.solver.tolerance))
            steps.clear()
    signs = np.array([-1.0 if name == "external" else 1.0 for name in ENERGIES])
    table, on = np.array(energies), np.array(closed) > 0
    return {
        "unknowns": problem.constraints.n_q,
        "macros": problem.joints[0].zone.n_macros,
        "closed": max(closed),
        "steps": len(spent),
        "in contact": int(on.sum()),
        "cycles": float(np.array(spent)[on].mean()),
        "alone": float(np.mean(alone)),
        "energy": float(table[-1, :2].sum() / table[0, 2]),
        "account": float(np.abs(table @ signs).max() / np.abs(table).max()),
        "seconds": time.perf_counter() - start,
    }


def line(found: dict[str, Any]) -> str:
    """A row of the table."""
    return (
        f"| {found['unknowns']:,}, {found['macros']:,} macro-elements, {found['closed']} closed "
        f"| {found['steps']}, {found['in contact']} | {found['cycles']:.1f} | {found['alone']:.1f} "
        f"| {found['cycles'] / found['alone']:.2f} | {found['energy']:.4f} | {found['account']:.0e} "
        f"| {found['seconds']:.0f} s |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", type=int, default=[100_000], help="unknowns (default: 100000)")
    parser.add_argument("--steps", type=int, default=100, help="steps (default: 100)")
    parser.add_argument("--cfl", type=float, default=1.0, help="cells that a wave crosses in a step (default: 1)")
    parser.add_argument("-o", metavar="TABLE.md", help="write the table here too")
    args = parser.parse_args()
    heads = ["unknowns", "steps, in contact", "V-cycles of a step in contact", "of an elastic solve", "ratio"]
    heads += ["energy at the end", "account of energy", "run"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    print("\n".join(lines), flush=True)
    for size in args.sizes:
        lines.append(line(measured(side(size), args.steps, args.cfl)))
        print(lines[-1], flush=True)
    if args.o:
        Path(args.o).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
