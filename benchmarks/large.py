"""Measure large contact models: time by phase, V-cycles, memory, growth, against multigrid solves of K alone.

    python benchmarks/large.py [--quick] [--finite] [--ratio 1] [--backend multigrid] [--sizes 50000 ...] [-o TABLE.md]

3D Hertz: a block with a clearance of r^2 / 2R over an elastic block whose faces do not match, HEXA8 cut `pyramid`,
small kinematics, `geometry = "reference"`, one step from no contact at all, all steps of the active set included. Each
size runs in a process of its own, whose largest resident memory is told. 'K alone' is a multigrid solve of the elastic
problem without contact, set-up included, to residuals of 1e-12 of the forces, before contact in the same process (that
of contact is told beside it). 'Coarse start' is the first active set, found on the first coarser level; its V-cycles
cost a small part of the others and are not counted. 'Contact' is all from K to the state, its own set-up, search and
integration included. Seconds are of the wall, with those of the processors in brackets. `--finite`: the same under
finite kinematics (neo-Hookean, `geometry = "current"`, the upper skin round without a clearance), whose ratio is that
of a Newton iteration. `--ratio`: stiffness of the upper block, the master, relative to that of the lower one.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np
from contact import cut, pressed
from meshes import blocks

import lacsolver.contact.interface
import lacsolver.equilibrium.active_set
import lacsolver.equilibrium.attempt
import lacsolver.equilibrium.newton
import lacsolver.problem.pair
import lacsolver.saddle.stiffness
from lacmesh import Mesh
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.contact import integrate
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.linear import TOLERANCE
from lacsolver.problem.problem import Problem
from lacsolver.saddle.saddle import SaddleSolution

SIZES = (50_000, 100_000, 370_000, 1_000_000)
QUICK = (10_000, 25_000, 50_000)


class Clock:
    """Wall and processor seconds by phase."""

    def __init__(self) -> None:
        self.wall: dict[str, float] = {}
        self.cpu: dict[str, float] = {}

    @contextmanager
    def __call__(self, phase: str) -> Iterator[None]:
        start = time.perf_counter(), time.process_time()
        yield
        self.wall[phase] = self.wall.get(phase, 0.0) + time.perf_counter() - start[0]
        self.cpu[phase] = self.cpu.get(phase, 0.0) + time.process_time() - start[1]

    def mean(self, phase: str, count: int) -> None:
        """Replace the total time of a phase by its mean over `count` runs."""
        for seconds in (self.wall, self.cpu):
            seconds[phase] /= count

    def around(self, phase: str, work: Callable[..., Any], kept: list[Any] | None = None) -> Callable[..., Any]:
        """Wrap `work` so that its calls are timed as a phase; its results are appended to `kept`."""

        def timed(*arguments: Any, **options: Any) -> Any:
            with self(phase):
                made = work(*arguments, **options)
            if kept is not None:
                kept.append(made)
            return made

        return timed


def watched(clock: Clock, solved: list[SaddleSolution]) -> ExitStack:
    """The phases of a contact solve under the clock."""
    places = [
        (lacsolver.contact.interface, "contact_points", "search", None),
        (lacsolver.problem.pair, "integrate", "search and integration", None),
        (lacsolver.saddle.stiffness.FactorCache, "factorise", "set-up", None),
        (lacsolver.equilibrium.active_set, "solve_saddle", "loops", solved),
        (lacsolver.equilibrium.newton, "solve_saddle", "loops", solved),
        (lacsolver.equilibrium.attempt, "coarse_start", "coarse start", None),
    ]
    stack = ExitStack()
    for module, name, phase, kept in places:
        stack.enter_context(patch.object(module, name, clock.around(phase, getattr(module, name), kept)))
    return stack


def side(unknowns: int) -> int:
    """Cells along the side of the lower block."""
    return next(n for n in range(4, 200) if 3 * (n * n + (n - 3) ** 2) * (n // 2) > 0.98 * unknowns)


def rounded(n: int) -> Mesh:
    """The blocks with the upper one's skin rounded, as the clearance of the others has it."""
    mesh = blocks(n, n - 3, n // 2, hexa=None)
    x, first = mesh.points.copy(), (n + 1) ** 2 * (n // 2 + 1)
    x[first:, 2] += 0.06 * (np.square(x[first:, :2] - 0.5).sum(axis=1)) * (1 - x[first:, 2])
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, node_groups=mesh.node_groups)


def measured(unknowns: int, backend: str, kinematics: str = "small", ratio: float = 1.0) -> dict[str, Any]:
    """The figures of one size."""
    small = kinematics == "small"
    _ = list(march(pressed(blocks(9, 6, 4) if small else rounded(9), backend, kinematics)))  # kernels are compiled
    n, clock, solved = side(unknowns), Clock(), []
    with clock("mesh and cut"):
        mesh = blocks(n, n - 3, n // 2) if small else rounded(n)
    with clock("problem"):
        problem = pressed(mesh, backend, kinematics, ratio)
    _ = assemble_stiffness(problem.space, problem.materials, problem.threads)  # the pattern, and memory's first touch
    for _ in range(3):
        with clock("assembly"):
            assemble_stiffness(problem.space, problem.materials, problem.threads)
    clock.mean("assembly", 3)
    alone = elastic(problem, clock)
    gc.collect()
    with watched(clock, solved), clock("contact"):
        *_, state = march(problem)
    return {
        "unknowns": problem.constraints.n_q,
        "macros": problem.joints[0].zone.n_macros,
        "closed": int((state.zones[0].status == 1).sum()),
        "iterations": state.iterations,
        "finite": kinematics == "finite",
        "cycles": sum(one.applications for one in solved),
        "balance": state.residuals[-1],
        "alone": alone,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "wall": clock.wall,
        "cpu": clock.cpu,
    }


def elastic(problem: Problem, clock: Clock) -> int:
    """One multigrid solve of K alone, under the clock; its iterations."""
    model = ReducedProblem(problem)
    f = LoadStep(model, 1.0).f
    with clock("set-up of K alone"):
        held = model.reference()
    with clock("solution of K alone"):
        q = held.solve(f)
    assert np.linalg.norm(held.apply(q) - f) <= 10 * TOLERANCE * np.linalg.norm(f)
    return int(getattr(held.factor, "n_iterations", 1))


def apart(unknowns: int, backend: str, kinematics: str, ratio: float) -> dict[str, Any]:
    """The figures of one size, from a process of its own."""
    command = [sys.executable, __file__, "--one", str(unknowns), "--backend", backend, "--ratio", str(ratio)]
    command += ["--finite"] if kinematics == "finite" else []
    run = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ)
    if run.returncode:
        raise SystemExit(f"{unknowns} unknowns: {run.stderr.strip().splitlines()[-1]}")
    return dict(json.loads(run.stdout.splitlines()[-1]))


def line(found: dict[str, Any]) -> str:
    """A row of the table."""
    wall, cpu = found["wall"], found["cpu"]

    def spent(*phases: str) -> str:
        return f"{sum(wall.get(p, 0.0) for p in phases):.2f} s ({sum(cpu.get(p, 0.0) for p in phases):.2f})"

    count = found["iterations"] if found["finite"] else 1
    ratio, own = (t["contact"] / count / (t["set-up of K alone"] + t["solution of K alone"]) for t in (wall, cpu))
    return (
        f"| {found['unknowns']:,}, {found['macros']:,} macro-elements, {found['closed']} closed | {spent('assembly')} "
        f"| {spent('search and integration')} | {spent('set-up')} | {spent('coarse start')} "
        f"| {spent('loops')}, {found['cycles']} V-cycles, {found['iterations']} iterations | {spent('contact')} "
        f"| {spent('set-up of K alone', 'solution of K alone')}, {found['alone']} V-cycles | {ratio:.2f} ({own:.2f}) "
        f"| {spent('problem', 'assembly', 'contact')} "
        f"| {found['memory']:.2f} GB, {found['memory'] * 2**20 / found['unknowns']:.1f} kB an unknown |"
    )


def exponent(x: list[float], y: list[float]) -> float:
    """The slope of a line through logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def growth(found: list[dict[str, Any]]) -> str:
    """Exponents with which the processor time of phases grows with the unknowns, and the growth of memory."""
    n = [f["unknowns"] for f in found]
    phases = {"assembly": ["assembly"], "set-up": ["set-up"], "loops": ["loops"], "contact": ["contact"]}
    phases["multigrid solve of K alone"] = ["set-up of K alone", "solution of K alone"]
    said = [
        f"{name} {exponent(n, [sum(f['cpu'][p] for p in parts) for f in found]):.2f}" for name, parts in phases.items()
    ]
    more = (found[-1]["memory"] - found[0]["memory"]) * 2**20 / (n[-1] - n[0])
    return f"Growth with the unknowns: {', '.join(said)}; memory {more:.1f} kB an unknown."


def surfaces(sizes: tuple[int, ...]) -> str:
    """Exponents with which the time of search and integration grows with the faces, on large skins."""
    faces, search, rest = [], [], []
    for k in sizes:
        zone, runs = cut(blocks(k, round(1.4 * k), 1, "HEXA8", "TETRA4")), []
        for _ in range(3):
            clock = Clock()
            with watched(clock, []), clock("all"):
                integrate(zone, 3)
            runs.append((clock.cpu["search"], clock.cpu["all"] - clock.cpu["search"]))
        faces.append(len(zone.slave))
        search.append(median(run[0] for run in runs))
        rest.append(median(run[1] for run in runs))
    said = f"search {exponent(faces, search):.2f}, integration {exponent(faces, rest):.2f}"
    return f"Growth with the faces, {faces[0]:,} to {faces[-1]:,}: {said}."


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes")
    parser.add_argument("--finite", action="store_true", help="finite kinematics: the ratio of a Newton iteration")
    parser.add_argument("--sizes", nargs="+", type=int, help=f"unknowns (default: {' '.join(map(str, SIZES))})")
    parser.add_argument("--backend", default="multigrid", help="linear solver (default: multigrid)")
    parser.add_argument("--ratio", type=float, default=1.0, help="stiffness of the master's body (default: 1)")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    parser.add_argument("-o", metavar="TABLE.md", help="write the table here too")
    args = parser.parse_args()
    kinematics = "finite" if args.finite else "small"
    if args.one:
        print(json.dumps(measured(args.one, args.backend, kinematics, args.ratio)))
        return
    heads = ["unknowns", "assembly", "search and integration", "set-up", "coarse start", "loops", "contact", "K alone"]
    heads += ["ratio", "with problem and assembly", "memory"]
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    print("\n".join(lines), flush=True)
    found = []
    for size in args.sizes or (QUICK if args.quick else SIZES):
        found.append(apart(size, args.backend, kinematics, args.ratio))
        lines.append(line(found[-1]))
        print(lines[-1], flush=True)
    lines += ["", *([growth(found)] if len(found) > 1 else []), surfaces((20, 40) if args.quick else (40, 80, 160))]
    print("\n".join(lines[len(found) + 2 :]))
    if args.o:
        Path(args.o).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
