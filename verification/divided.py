"""Problems solved by several processes: a program for `mpiexec`, what it is given, and what it leaves.

    python -m verification.divided FOLDER

The folder has `jobs.json`, with the names of the problems and the backend; of each problem the case as `NAME.toml`, and
its mesh in as many parts as there are processes, `NAME.N`. The states of the whole model go to `NAME.N.npz`.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.errors import LacmeshError
from lacmesh.partition import distribute_nodes, write_parts
from lacsolver import Case, parse_case
from lacsolver.equilibrium.state import State
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from verification import mpiexec

Floats = NDArray[np.floating]

#: seconds after which processes are given up
_PATIENCE = 1500.0
_JOBS = "jobs.json"
#: fields of a state in a file, beside its time
_FIELDS = ("u", "status", "pressure", "force", "velocity", "energies")


class FailedError(LacmeshError):
    """Processes that were to solve a problem failed."""


@dataclass(frozen=True, eq=False)
class WholeState:
    """A state of the whole model. `u` (n_nodes, dim); of all zones, one after the other: `status` and `pressure`
    (macro-elements,), and `force` (zones, n_nodes, dim). In motion, `velocity` (n_nodes, dim) and `energies` (8,); both
    are empty without.
    """

    time: float
    u: Floats
    status: NDArray[np.integer]
    pressure: Floats
    force: Floats
    velocity: Floats
    energies: Floats


def found(state: State, problem: Problem) -> WholeState:
    """The state of the whole model, on the first of the processes that share it; all of them call this."""
    zones, motion, n = state.zones, state.step.motion, problem.space.n_dof
    return WholeState(
        state.time,
        _whole(problem, state.u),
        np.concatenate([zone.status for zone in zones]),
        np.concatenate([zone.pressure for zone in zones]),
        np.array([_whole(problem, zone.force) for zone in zones]),
        np.empty((0, 0)) if motion is None else _whole(problem, motion.velocity[:n]),
        np.empty(0) if motion is None else motion.energies,
    )


def _whole(problem: Problem, values: Floats) -> Floats:
    """The values (n_nodes, dim) at all nodes of the model, from those at the own nodes of each process."""
    space, share = problem.space, problem.space.share
    if share.node is None:
        return values.reshape(space.mesh.n_nodes, -1)
    order = np.argsort(share.collect(share.node[share.own]))
    return share.collect(space.own(values))[order]


# ---- the side that starts the processes


def solve_divided(
    problems: Mapping[str, tuple[str, Mesh]], n: int, backend: str, folder: Path
) -> dict[str, list[WholeState]]:
    """The states of problems, of each its case and its mesh, solved by n processes with a backend; by name.

    Raises FailedError with the last line of the processes if they fail, subprocess.TimeoutExpired.
    """
    for name, (text, mesh) in problems.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
        write_parts(folder / f"{name}.{n}", mesh, distribute_nodes(mesh, n))
    (folder / _JOBS).write_text(json.dumps({"names": list(problems), "backend": backend}), encoding="utf-8")
    done = mpiexec.run(n, ["-m", "verification.divided", folder], _PATIENCE)
    if done.returncode:
        messages = [line for line in done.stderr.splitlines() if line.startswith("rank ")] or ["no message"]
        raise FailedError(f"{n} processes with {backend}: {messages[0]}")
    return {name: _read(folder / f"{name}.{n}.npz") for name in problems}


def _read(path: Path) -> list[WholeState]:
    with np.load(path) as file:
        times = file["time"]
        fields = {key: file[key] for key in _FIELDS}
    return [WholeState(float(t), **{key: values[k] for key, values in fields.items()}) for k, t in enumerate(times)]


# ---- the program


def main(folder: Path) -> None:
    """Solve the problems of a folder, in all processes."""
    from lacsolver.distributed.launch import import_mpi, import_petsc

    import_petsc()
    comm = import_mpi().COMM_WORLD
    jobs = json.loads((folder / _JOBS).read_text(encoding="utf-8"))
    for name in jobs["names"]:
        case = parse_case((folder / f"{name}.toml").read_text(encoding="utf-8"))
        try:
            _solve(case, folder / f"{name}.{comm.size}", jobs["backend"], comm)
        except Exception as error:
            traceback.print_exc()
            sys.stderr.write(f"rank {comm.rank}: {name}: {type(error).__name__}: {error}\n")
            sys.stderr.flush()
            comm.Abort(1)


def _solve(case: Case, parts: Path, backend: str, comm: Any) -> None:
    """Solve a case on parts of its mesh, and write the states on the first process."""
    from lacsolver.distributed.processes import Processes

    solver = replace(case.solver, backend=backend, threads=1)
    problem = Problem.of(replace(case, mesh=parts, solver=solver), distribution=Processes(comm))
    states = [found(state, problem) for state in march(problem)]
    if comm.rank == 0:
        arrays = {key: np.array([getattr(state, key) for state in states]) for key in ("time", *_FIELDS)}
        np.savez(f"{parts}.npz", **arrays)  # type: ignore[arg-type]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
