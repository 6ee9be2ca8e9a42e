"""Measure runs in several processes against one: V-cycles, processor time, memory, communication, stiffness ratios.

    python benchmarks/distributed.py [--quick] [--sizes 24000 118000] [--ranks 1 2 4 8]
                                     [--backends multigrid gamg hypre] [--weak 25000] [--moving 24000 118000]
                                     [--python .venv-petsc/bin/python] [--repeat 3] [-o TABLE.md]

The model is that of `contact.py`: a block with a clearance of r^2 / 2R over an elastic block whose faces do not match,
HEXA8 cut `pyramid`, one step from no contact at all; of contact that moves, that of `moving.py` on the same mesh. The
mesh is divided once for each number of processes, and each reads its part alone. Every run is one of `mpiexec` with the
Python that `--python` names; the serial solver is the backend `multigrid` on one thread of the Python that runs this
program. More processes than cores share the cores.

Seconds are those of the processor, of the process that has most of them, busy waiting for the others included; so
efficiencies are lower bounds. Of several runs the fastest is told. They run from the matrices to the pressures: all
of the active set, without the assembly and the pairing, which are told beside them. Efficiency is the time of one
process over n times that of n. Memory is the largest resident memory of a process, and what it has grown by since all
modules and kernels were loaded: up to the set-up of the preconditioner, when the mesh, contact and K are there
("model"), and at most ("grown"). Messages and bytes are those that the process with most of them sends for each
V-cycle, with the reductions over all processes; what hypre sends within its own cycles is not counted. Pairing and
derivative of contact that moves are for each iteration, of the process that has most contact points.
"""

from __future__ import annotations

import argparse
import gc
import json
import resource
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from contact import pressed, pressed_case
from large import Clock, side
from meshes import blocks
from moving import DERIVATIVES, case_of

import lacsolver.bodies.small
import lacsolver.contact.tangent
import lacsolver.equilibrium.active_set
import lacsolver.equilibrium.newton
import lacsolver.problem.pair
import lacsolver.saddle.shared_stiffness
import lacsolver.saddle.stiffness
from lacmesh import Mesh
from lacmesh.partition import distribute_nodes, read_part, write_parts
from lacsolver.case import Case
from lacsolver.contact import Interface
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.saddle.saddle import SaddleSolution
from verification.mpiexec import ROOT, environment, words

SIZES, QUICK = (24_000, 118_000), (10_000,)
RANKS, BACKENDS, RATIOS = (1, 2, 4, 8), ("multigrid", "gamg", "hypre"), (0.01, 1.0, 100.0)
#: the backend multigrid on one thread of one process
SERIAL = "serial"
#: contact that moves: kinematics and geometry, and normals
MOVING = ("current facet", "current smoothed", "finite facet")
#: unknowns of a process in the weak scaling
WEAK = 25_000
HEADS = ("unknowns, backend", "n", "V-cycles", "sets", "set-up", "matrices to pressures", "efficiency")
HEADS += ("against serial", "assembly", "pairing", "memory", "model", "grown", "bytes an unknown of the process")
WEAK_HEADS = ("unknowns, backend", "n", "V-cycles", "sets", "matrices to pressures")
WEAK_HEADS += ("messages, bytes, reductions for each V-cycle",)
MOVING_HEADS = ("geometry, normals", "n", "iterations", "V-cycles", "points", "whole solve", "efficiency")
MOVING_HEADS += ("pairing, an iteration", "its efficiency", "derivative, an iteration", "its efficiency")


class Run(NamedTuple):
    """One run: its mesh, or the folder of its parts, the backend, and the stiffness of the master over the slave's.

    `moving`: one of `MOVING`, or empty for contact that is paired once.
    """

    path: str
    backend: str
    ratio: float = 1.0
    moving: str = ""

    def case(self) -> Case:
        """The case that is solved."""
        backend = "multigrid" if self.backend == SERIAL else self.backend
        if self.moving:
            return case_of(*self.moving.split(), backend, Path(self.path))
        return pressed_case(backend, "small", self.ratio, Path(self.path), threads=1)


class Sent:
    """Messages and bytes that this process has sent, and reductions over all processes."""

    def __init__(self) -> None:
        self.counts = np.zeros(3)


def counted(MPI: Any, sent: Sent) -> Any:
    """A communicator of all processes that counts what lacsolver sends through it."""

    class Counted(MPI.Intracomm):
        __module__ = MPI.__name__  # by which PETSc recognises a communicator

        def Isend(self, given: Any, *to: Any) -> Any:
            sent.counts += (1, given[0].nbytes, 0)
            return super().Isend(given, *to)

        def Allreduce(self, *arguments: Any, **options: Any) -> None:
            sent.counts[2] += 1
            super().Allreduce(*arguments, **options)

        def allgather(self, given: Any) -> Any:
            sent.counts[2] += 1
            return super().allgather(given)

    return Counted(MPI.COMM_WORLD)


def watched(clock: Clock, solved: list[SaddleSolution], models: list[int], interfaces: deque[Interface]) -> ExitStack:
    """The phases of a contact solve under the clock; `models` gets the memory in use at the start of each set-up."""

    def set_up(work: Callable[..., Any]) -> Callable[..., Any]:
        timed = clock.around("set-up", work)

        def noted(*arguments: Any, **options: Any) -> Any:
            models.append(resident())
            return timed(*arguments, **options)

        return noted

    places: list[tuple[Any, str, str, Any]] = [
        (lacsolver.bodies.small, "assemble_stiffness", "assembly", None),
        (lacsolver.problem.pair, "integrate", "pairing", interfaces),
        (lacsolver.equilibrium.active_set, "solve_saddle", "loops", solved),
        (lacsolver.equilibrium.newton, "solve_saddle", "loops", solved),
        *((lacsolver.contact.tangent, name, "derivative", None) for name in DERIVATIVES),
    ]
    stack = ExitStack()
    for cache in (lacsolver.saddle.stiffness.FactorCache, lacsolver.saddle.shared_stiffness.SharedFactors):
        stack.enter_context(patch.object(cache, "factorise", set_up(cache.factorise)))
    for module, name, phase, kept in places:
        stack.enter_context(patch.object(module, name, clock.around(phase, getattr(module, name), kept)))
    return stack


def measured(run: Run) -> list[dict[str, Any]]:
    """The figures of one run, of each of its processes; on all but the first an empty list."""
    _ = list(march(pressed(blocks(9, 6, 4), "multigrid")))  # modules and kernels are loaded
    case = run.case()
    if run.moving:
        _ = list(march(Problem.of(case, blocks(9, 6, 4))))
    if run.backend == SERIAL:
        return [figures(lambda: Problem.of(case, read_part(run.path, 0).mesh))]
    from lacsolver.distributed.launch import import_mpi
    from lacsolver.distributed.processes import Processes

    sent = Sent()
    comm = counted(import_mpi(), sent)
    told = figures(lambda: Problem.of(case, distribution=Processes(comm)), sent)
    return list(comm.gather(told) or [])


def figures(problem_of: Callable[[], Problem], sent: Sent | None = None) -> dict[str, Any]:
    """The figures of a contact solve on this process."""
    gc.collect()
    before, clock, solved, models = resident(), Clock(), list[SaddleSolution](), list[int]()
    last = deque[Interface](maxlen=1)
    with clock("problem"):
        problem = problem_of()
    earlier = None if sent is None else sent.counts.copy()
    with watched(clock, solved, models, last), clock("contact"):
        *_, state = march(problem)
    cycles = sum(one.applications for one in solved)
    own = problem.constraints.own
    return {
        "unknowns": problem.constraints.n_q if own is None else int(own.sum()),
        "macros": problem.joints[0].zone.n_macros,
        "closed": int((state.zones[0].status == 1).sum()),
        "cycles": cycles,
        "sets": state.iterations,
        "points": len(last[0].points),
        "cpu": clock.cpu,
        "solve": clock.cpu["contact"] - clock.cpu.get("assembly", 0.0) - clock.cpu["pairing"],
        "memory": peak(),
        "model": models[0] - before,
        "grown": peak() - before,
        "traffic": [0.0] * 3 if sent is None else ((sent.counts - earlier) / cycles).tolist(),
    }


def resident() -> int:
    """Bytes of memory that this process has now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def peak() -> int:
    """Largest resident memory of this process, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


class Launcher:
    """Runs in processes of `mpiexec`, with meshes in a folder of its own; a mesh is divided once."""

    def __init__(self, python: str, folder: Path, repeat: int = 1) -> None:
        self._python, self._folder, self._repeat = python, folder, repeat
        self._meshes: dict[int, Mesh] = {}

    def of(self, unknowns: int, n: int, backend: str, ratio: float = 1.0, moving: str = "") -> list[dict[str, Any]]:
        """The figures of all processes of the fastest of the runs; n is 0 for the serial solver."""
        run = Run(self._divided(unknowns, max(n, 1)), backend, ratio, moving)
        return min((self._run(run, unknowns, n) for _ in range(self._repeat)), key=partial(busiest, phase="solve"))

    def _run(self, run: Run, unknowns: int, n: int) -> list[dict[str, Any]]:
        arguments = [__file__, "--one", *map(str, run)]
        command = words(n, *arguments, python=self._python) if n else [sys.executable, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment())
        if done.returncode:
            raise SystemExit(f"{unknowns} unknowns, {run.backend}, {n} processes: {done.stderr.strip()[-2000:]}")
        return list(json.loads(done.stdout.splitlines()[-1]))

    def _divided(self, unknowns: int, n: int) -> str:
        """The folder with the parts of a mesh; for one process its only part is the whole."""
        folder = self._folder / f"{unknowns}.{n}"
        if not folder.exists():
            if unknowns not in self._meshes:
                cells = side(unknowns)
                self._meshes[unknowns] = blocks(cells, cells - 3, cells // 2)
            mesh = self._meshes[unknowns]
            write_parts(folder, mesh, distribute_nodes(mesh, n))
        return str(folder)


def busiest(found: Sequence[dict[str, Any]], phase: str) -> float:
    """Processor seconds of a phase, or `solve`, of the process that has most."""
    return max(one["solve"] if phase == "solve" else one["cpu"].get(phase, 0.0) for one in found)


def name_of(found: Sequence[dict[str, Any]], backend: str) -> str:
    """The unknowns of a run and its backend."""
    total, one = sum(one["unknowns"] for one in found), found[0]
    return f"{total:,}, {one['macros']:,} macro-elements, {one['closed']} closed, {backend}"


def strong_line(backend: str, n: int, found: Any, single: Any, serial: Any) -> str:
    """A row of the table; n is 0 for the serial solver."""
    spent, first, alone = (busiest(one, "solve") for one in (found, single, serial))
    largest = max(found, key=lambda one: one["memory"])
    grown = max(found, key=lambda one: one["grown"])
    cells = [name_of(found, backend), str(n or "serial"), f"{found[0]['cycles']}", f"{found[0]['sets']}"]
    cells += [f"{busiest(found, 'set-up'):.2f} s", f"{spent:.2f} s", f"{first / n / spent:.2f}" if n else ""]
    cells += [f"{spent / alone:.2f}", f"{busiest(found, 'assembly'):.2f} s", f"{busiest(found, 'pairing'):.2f} s"]
    model = max(one["model"] for one in found)
    cells += [f"{largest['memory'] / 2**20:.0f} MB", f"{model / 2**20:.0f} MB", f"{grown['grown'] / 2**20:.0f} MB"]
    return row([*cells, f"{grown['grown'] / grown['unknowns']:,.0f}"])


def weak_line(backend: str, n: int, found: Any) -> str:
    """A row of the table of weak scaling."""
    cells = [name_of(found, backend), str(n), f"{found[0]['cycles']}", f"{found[0]['sets']}"]
    cells.append(f"{busiest(found, 'solve'):.2f} s")
    messages, size, sums = np.max([one["traffic"] for one in found], axis=0)
    cells.append(f"{messages:.0f}, {size:,.0f}, {sums:.1f}")
    return row(cells)


def moving_line(kind: str, n: int, found: Any, single: Any) -> str:
    """A row of the table of contact that moves; n is 0 for the serial solver, which is not compared."""
    cells = [kind, str(n or "serial"), f"{found[0]['sets']}", f"{found[0]['cycles']}"]
    cells.append(f"{max(one['points'] for one in found):,}")
    for phase in ("contact", "pairing", "derivative"):
        spent, alone = (busiest(one, phase) / (1 if phase == "contact" else one[0]["sets"]) for one in (found, single))
        cells += [f"{spent:.3f} s", f"{alone / n / spent:.2f}" if n else ""]
    return row(cells)


def row(cells: Sequence[str]) -> str:
    """A row of a table."""
    return f"| {' | '.join(cells)} |"


class Told:
    """The lines of the tables, printed as they come."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def __call__(self, *lines: str) -> None:
        self.lines += lines
        print("\n".join(lines), flush=True)

    def table(self, title: str, heads: Sequence[str]) -> None:
        """Begin a table."""
        self("", title, "", row(heads), "|---" * len(heads) + "|")


def strong(launcher: Launcher, sizes: Sequence[int], args: argparse.Namespace, told: Told) -> None:
    """The tables of one model in more and more processes."""
    for size in sizes:
        told.table("### The same model in more processes", HEADS)
        serial = launcher.of(size, 0, SERIAL)
        told(strong_line("multigrid", 0, serial, serial, serial))
        for backend in args.backends:
            single = launcher.of(size, 1, backend) if args.ranks[0] != 1 else None
            for n in args.ranks:
                found = launcher.of(size, n, backend)
                single = single or found
                told(strong_line(backend, n, found, single, serial))


def ratios(launcher: Launcher, size: int, args: argparse.Namespace, told: Told) -> None:
    """The table of V-cycles at several ratios of stiffness."""
    told.table(f"### Stiffness of the master over the slave's, {size:,} unknowns: V-cycles (sets)",
               ("backend", "n", *(f"{ratio:g}" for ratio in RATIOS)))  # fmt: skip
    for backend, n in [(SERIAL, 0), *((backend, n) for backend in args.backends for n in (1, 2))]:
        found = [launcher.of(size, n, backend, ratio)[0] for ratio in RATIOS]
        told(
            row(
                [
                    "multigrid" if n == 0 else backend,
                    str(n or "serial"),
                    *(f"{one['cycles']} ({one['sets']})" for one in found),
                ]
            )
        )


def weak(launcher: Launcher, args: argparse.Namespace, told: Told) -> None:
    """The table of models that grow with the processes."""
    told.table(f"### {args.weak:,} unknowns a process", WEAK_HEADS)
    for backend in args.backends:
        for n in args.ranks:
            told(weak_line(backend, n, launcher.of(n * args.weak, n, backend)))


def moving(launcher: Launcher, args: argparse.Namespace, told: Told) -> None:
    """The tables of contact that is paired again in every iteration, by the backend multigrid."""
    for size in args.moving:
        for kind in MOVING:
            serial = launcher.of(size, 0, SERIAL, moving=kind)
            if kind == MOVING[0]:
                sizes = f"{serial[0]['unknowns']:,} unknowns, {serial[0]['macros']:,} macro-elements"
                told.table(f"### Contact that moves, {sizes}", MOVING_HEADS)
            told(moving_line(kind, 0, serial, serial))
            single = launcher.of(size, 1, "multigrid", moving=kind)
            for n in args.ranks:
                found = single if n == 1 else launcher.of(size, n, "multigrid", moving=kind)
                told(moving_line(kind, n, found, single))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK[0]:,} unknowns, and a tenth of the weak scaling")
    parser.add_argument("--sizes", nargs="*", type=int, help=f"unknowns (default: {' '.join(map(str, SIZES))})")
    parser.add_argument("--ranks", nargs="+", type=int, default=RANKS, help="numbers of processes (default: 1 2 4 8)")
    parser.add_argument(
        "--backends", nargs="+", default=BACKENDS, help="of the engine petsc (default: multigrid gamg hypre)"
    )
    parser.add_argument("--weak", type=int, help=f"unknowns a process; 0 for none (default: {WEAK})")
    parser.add_argument(
        "--moving", nargs="*", type=int, help=f"unknowns with contact that moves (default: {' '.join(map(str, SIZES))})"
    )
    parser.add_argument("--no-ratios", action="store_true", help="without the table of stiffness ratios")
    there = ROOT / ".venv-petsc" / "bin" / "python"
    parser.add_argument("--python", default=str(there) if there.exists() else sys.executable, help="Python with PETSc")
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    parser.add_argument("-o", metavar="TABLE.md", help="write the tables here too")
    parser.add_argument("--repeat", type=int, default=3, help="runs, of which the fastest is told (default: 3)")
    args = parser.parse_args()
    if args.one:
        path, backend, ratio, kind = args.one
        if told := measured(Run(path, backend, float(ratio), kind)):
            print(json.dumps(told))
        return
    sizes = (QUICK if args.quick else SIZES) if args.sizes is None else args.sizes
    args.moving = (QUICK if args.quick else SIZES) if args.moving is None else args.moving
    args.weak = (WEAK // 10 if args.quick else WEAK) if args.weak is None else args.weak
    lines = Told()
    with tempfile.TemporaryDirectory() as folder:
        launcher = Launcher(args.python, Path(folder), args.repeat)
        strong(launcher, sizes, args, lines)
        if sizes and not args.no_ratios:
            ratios(launcher, sizes[0], args, lines)
        if args.weak:
            weak(launcher, args, lines)
        if args.moving:
            moving(launcher, args, lines)
    if args.o:
        Path(args.o).write_text("\n".join(lines.lines[1:]) + "\n")


if __name__ == "__main__":
    main()
