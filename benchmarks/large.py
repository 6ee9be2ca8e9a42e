"""Measure large models: parts of a mesh, a contact solve by phase against K alone, and runs in several processes.

    python -m benchmarks.large [--quick] [--parts partition model processes] [--sizes 100000 1000000] [--ratio 1]
                               [--ranks 1 2] [--backends multigrid gamg hypre] [--weak] [--kinds ...] [-o TABLE.md]

`partition`: blocks of 1e6 and 1e7 HEXA8 with the group 'slave' on top, in 64 parts: to read, distribute, write, read a
part back.

`model`: the blocks of `contact.py`, `geometry = "reference"`, multigrid, one step from no contact at all, each size in
a process of its own. "K alone" is a solve of the elastic problem without contact, set-up included, before contact in
the same process. "Coarse start" is the first active set, found on the first coarser level; its V-cycles are not
counted. "Contact" is all from K to the state. Memory is the largest resident memory of the process.

`processes`: the same model, or that of `moving.py` (`--kinds`), in processes of `mpiexec` with the Python that
`--python` names, against the serial solver on one thread; the mesh is divided once for each number of processes.
`--weak`: the sizes are unknowns of a process. More processes than cores share the cores. From the matrices to the
pressures: all of the active set, without assembly and pairing. Efficiency is the time of one process over n times that
of n. "Grown": growth of the memory since all modules and kernels were loaded.

Seconds are those of the processor, of the process that has most of them, busy waiting for others included, and in
brackets of the clock. Of `--repeat` runs the fastest counts. `--ratio`: stiffness of the upper block, the master,
relative to that of the lower one.
"""

from __future__ import annotations

import gc
import json
import resource
import subprocess
import sys
import tempfile
from collections import deque
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import lacmesh
import lacsolver.bodies.small
import lacsolver.contact.interface
import lacsolver.contact.tangent
import lacsolver.equilibrium.active_set
import lacsolver.equilibrium.attempt
import lacsolver.equilibrium.newton
import lacsolver.problem.pair
import lacsolver.saddle.shared_stiffness
import lacsolver.saddle.stiffness
from benchmarks.common import Clock, blocks, box, exponent, main, side
from benchmarks.contact import pressed, pressed_case
from benchmarks.moving import DERIVATIVES, case_of
from lacmesh.partition import describe_parts, distribute_nodes, read_part, write_parts
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.linear import TOLERANCE
from lacsolver.problem.problem import Problem
from verification.mpiexec import ROOT, environment, missing, python_with_petsc, words

PARTS = ("partition", "model", "processes")
RANKS = 64
KINDS = ("reference", "current facet", "current smoothed", "finite facet")
#: the backend multigrid on one thread of one process, without MPI
SERIAL = "serial"
PARTITION_HEADS = ("cells", "read", "distribute", f"write {RANKS} parts", "read one", "copies of a node")
PHASES = ("assembly", "pairing", "set-up", "coarse start", "loops", "contact", "K alone")
MODEL_HEADS = ("unknowns", *PHASES, "ratio", "memory")
PROCESS_HEADS = ("unknowns, model, backend", "n", "V-cycles", "sets", "set-up", "matrices to pressures", "efficiency")
PROCESS_HEADS += ("against serial", "assembly", "pairing", "derivative", "memory", "grown, an unknown of the process")


# ---- parts of a mesh


def divided(n: int, folder: Path):
    """A row: a block of n^3 cells and its parts, written into a folder."""
    clock = Clock()
    lacmesh.write(folder / "block.msh", box(n, n, n))
    with clock("read"):
        mesh = lacmesh.read(folder / "block.msh")
    with clock("distribute"):
        owner = distribute_nodes(mesh, RANKS)
    with clock("write"):
        write_parts(folder / "parts", mesh, owner)
    with clock("one"):
        read_part(folder / "parts", RANKS // 2, everywhere=["slave"])
    seconds = [f"{clock.cpu[phase]:.2f} ({clock.wall[phase]:.2f})" for phase in clock.cpu]
    return (f"{mesh.n_cells:,}", *seconds, f"{describe_parts(folder / 'parts')['copies']:.2f}")


def partition(quick: bool):
    for n in (46, 100) if quick else (100, 216):
        with tempfile.TemporaryDirectory() as name:
            yield divided(n, Path(name))


# ---- a contact solve on this process


def watched(clock: Clock, solved: list, interfaces: deque) -> ExitStack:
    """The phases of a contact solve under the clock."""
    places: list[tuple[Any, str, str, Any]] = [
        (lacsolver.bodies.small, "assemble_stiffness", "assembly", None),
        (lacsolver.problem.pair, "integrate", "pairing", interfaces),
        (lacsolver.saddle.stiffness.FactorCache, "factorise", "set-up", None),
        (lacsolver.saddle.shared_stiffness.SharedFactors, "factorise", "set-up", None),
        (lacsolver.equilibrium.active_set, "solve_saddle", "loops", solved),
        (lacsolver.equilibrium.newton, "solve_saddle", "loops", solved),
        (lacsolver.equilibrium.attempt, "coarse_start", "coarse start", None),
        *((lacsolver.contact.tangent, name, "derivative", None) for name in DERIVATIVES),
    ]
    stack = ExitStack()
    for module, name, phase, kept in places:
        stack.enter_context(patch.object(module, name, clock.around(phase, getattr(module, name), kept)))
    return stack


def measured(parts: str, unknowns: int, backend: str, ratio: float, kind: str, alone: bool) -> list[dict[str, Any]]:
    """The figures of one run, of each of its processes; an empty list on all but the first.

    `parts`: the folder with the parts of the mesh, or empty for a mesh that is made here; `alone`: solve K first.
    """
    name = "multigrid" if backend == SERIAL else backend
    moves = kind != "reference"
    case = (
        case_of(*kind.split(), name, Path(parts))
        if moves
        else pressed_case(name, ratio, Path(parts), threads=int(not alone))
    )
    for made in (pressed(blocks(9, 6, 4), "multigrid"), *([Problem.of(case, blocks(9, 6, 4))] if moves else [])):
        _ = list(march(made))  # modules and kernels are loaded
    gc.collect()
    before, n = peak(), side(unknowns)
    if backend != SERIAL:
        from lacsolver.distributed.launch import import_mpi
        from lacsolver.distributed.processes import Processes

        comm = import_mpi().COMM_WORLD
        return list(comm.gather(figures(Problem.of(case, distribution=Processes(comm)), before)) or [])
    mesh = read_part(parts, 0).mesh if parts else blocks(n, n - 3, n // 2)
    return [figures(Problem.of(case, mesh), before, alone)]


def figures(problem: Problem, before: int, alone: bool = False) -> dict[str, Any]:
    """The figures of a contact solve on this process, whose memory was `before`."""
    clock, solved, last, found = Clock(), [], deque(maxlen=1), {}
    if alone:
        again = lacsolver.bodies.small.assemble_stiffness
        again(problem.space, problem.materials, problem.threads)  # the pattern, and memory's first touch
        with clock("assembly"):
            again(problem.space, problem.materials, problem.threads)
        found["alone"] = elastic(problem, clock)
        gc.collect()
    with watched(clock, solved, last), clock("contact"):
        *_, state = march(problem)
    own = problem.constraints.own
    apart = ("assembly", "pairing") if not alone else ()
    for seconds in (clock.cpu, clock.wall):
        seconds["solve"] = seconds["contact"] - sum(seconds.get(phase, 0.0) for phase in apart)
    return found | {
        "unknowns": problem.constraints.n_q if own is None else int(own.sum()),
        "macros": problem.joints[0].zone.n_macros,
        "closed": int((state.zones[0].status == 1).sum()),
        "cycles": sum(one.applications for one in solved),
        "sets": state.iterations,
        "balance": state.residuals[-1],
        "cpu": clock.cpu,
        "wall": clock.wall,
        "memory": peak(),
        "grown": peak() - before,
    }


def elastic(problem: Problem, clock: Clock) -> int:
    """One solve of K alone, under the clock; its iterations."""
    model = ReducedProblem(problem)
    f = LoadStep(model, 1.0).f
    with clock("K alone"):
        solver = model.reference()
        q = solver.solve(f)
    assert np.linalg.norm(solver.apply(q) - f) <= 10 * TOLERANCE * np.linalg.norm(f)
    return int(getattr(solver.factor, "n_iterations", 1))


def peak() -> int:
    """Largest resident memory of this process, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


# ---- runs, each in processes of its own


def launched(n: int, python: str, *run: Any) -> list[dict[str, Any]]:
    """The figures of all processes of a run; n is 0 for one process without MPI."""
    arguments = ["-m", "benchmarks.large", "--one", json.dumps(run)]
    command = words(n, *arguments, python=python) if n else [sys.executable, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment(), cwd=ROOT)
    if done.returncode:
        raise SystemExit(f"{run}, {n} processes: {done.stderr.strip()[-2000:]}")
    return list(json.loads(done.stdout.splitlines()[-1]))


def spent(found: list[dict[str, Any]], phase: str, clock: str = "cpu") -> float:
    """Seconds of a phase, of the process that has most."""
    return max(one[clock].get(phase, 0.0) for one in found)


def size(found: list[dict[str, Any]]) -> str:
    total, one = sum(one["unknowns"] for one in found), found[0]
    return f"{total:,}, {one['macros']:,} macro-elements, {one['closed']} closed"


def model_row(one: dict[str, Any]) -> list[str]:
    """The row of a model in one process."""
    took = {phase: f"{one['cpu'].get(phase, 0.0):.2f} s ({one['wall'].get(phase, 0.0):.2f})" for phase in PHASES}
    took["loops"] += f", {one['cycles']} V-cycles, {one['sets']} iterations"
    took["K alone"] += f", {one['alone']} V-cycles"
    ratios = [one[clock]["contact"] / one[clock]["K alone"] for clock in ("cpu", "wall")]
    memory = f"{one['memory'] / 2**30:.2f} GB, {one['memory'] / 1024 / one['unknowns']:.1f} kB an unknown"
    return [size([one]), *took.values(), "{:.2f} ({:.2f})".format(*ratios), memory]


def model(sizes: list[int], ratio: float):
    """The rows of a model in one process, and how its phases grow."""
    rows = []
    for unknowns in sizes:
        rows += launched(0, "", "", unknowns, SERIAL, ratio, "reference", True)
        yield model_row(rows[-1])
    if len(rows) > 1:
        n = [one["unknowns"] for one in rows]
        grown = [
            f"{exponent(n, [one['cpu'][phase] for one in rows]):.2f}"
            for phase in ("set-up", "loops", "contact", "K alone")
        ]
        setup, loops, contact, alone = grown
        more = (rows[-1]["memory"] - rows[0]["memory"]) / 1024 / (n[-1] - n[0])
        yield "exponent of growth", "", "", setup, "", loops, contact, alone, "", f"{more:.1f} kB an unknown"


def processes(sizes: list[int], asked: Any):
    """The rows of a model in one and more processes, by backends."""
    if not asked.python:
        yield f"absent: {missing()}", *[""] * (len(PROCESS_HEADS) - 1)
        return
    for unknowns in sizes:
        for kind in asked.kinds:
            serial = single = []
            for backend, n in [(SERIAL, 0), *((backend, n) for backend in asked.backends for n in asked.ranks)]:
                count = unknowns * max(n, 1) if asked.weak else unknowns
                with tempfile.TemporaryDirectory() as folder:
                    cells = side(count)
                    mesh = blocks(cells, cells - 3, cells // 2)
                    write_parts(Path(folder) / "parts", mesh, distribute_nodes(mesh, max(n, 1)))
                    run = (f"{folder}/parts", count, backend, asked.ratio, kind, False)
                    found = min(
                        (launched(n, asked.python, *run) for _ in range(asked.repeat)), key=lambda f: spent(f, "solve")
                    )
                serial = serial or found
                single = found if n <= min(asked.ranks) else single
                yield process_row(f"{size(found)}, {kind}, {backend}", n, found, single, serial)


def process_row(name: str, n: int, found: list, single: list, serial: list) -> list[str]:
    """A row; n is 0 for the serial solver."""
    took, first = spent(found, "solve"), len(single) * spent(single, "solve")
    row = [name, str(n or SERIAL), f"{found[0]['cycles']}", f"{found[0]['sets']}", f"{spent(found, 'set-up'):.2f} s"]
    row += [f"{took:.2f} s ({spent(found, 'solve', 'wall'):.2f})", f"{first / n / took:.2f}" if n else ""]
    row += [f"{took / spent(serial, 'solve'):.2f}"]
    row += [f"{spent(found, phase):.2f} s" for phase in ("assembly", "pairing", "derivative")]
    grown = max(found, key=lambda one: one["grown"])
    row += [f"{max(one['memory'] for one in found) / 2**20:.0f} MB", f"{grown['grown'] / grown['unknowns']:,.0f} B"]
    return row


def tables(asked: Any):
    if "partition" in asked.parts:
        yield PARTITION_HEADS, partition(asked.quick)
    if "model" in asked.parts:
        yield (
            MODEL_HEADS,
            model(asked.sizes or ([10_000, 25_000] if asked.quick else [100_000, 1_000_000]), asked.ratio),
        )
    if "processes" in asked.parts:
        yield PROCESS_HEADS, processes(asked.sizes or [10_000 if asked.quick else 118_000], asked)


if __name__ == "__main__" and sys.argv[1:2] == ["--one"]:
    if found := measured(*json.loads(sys.argv[2])):
        print(json.dumps(found))
elif __name__ == "__main__":
    main(
        __doc__,
        tables,
        parts={"nargs": "+", "choices": PARTS, "default": PARTS},
        sizes={"nargs": "+", "type": int, "help": "unknowns"},
        ratio={"type": float, "default": 1.0},
        ranks={"nargs": "+", "type": int, "default": [1, 2]},
        backends={"nargs": "+", "default": ["multigrid"]},
        kinds={"nargs": "+", "default": ["reference"], "choices": KINDS},
        weak={"action": "store_true"},
        repeat={"type": int, "default": 1},
        python={"default": python_with_petsc(), "help": "Python with PETSc"},
    )
