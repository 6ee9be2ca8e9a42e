"""A motion in three processes, from whose states two of them go on: a program for `mpiexec`, for `test_restarts`."""

from __future__ import annotations

import sys
import traceback
from pathlib import Path

from lacsolver.case import parse_case
from lacsolver.distributed.launch import import_mpi, import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.distributed.together import on_first
from lacsolver.output import create, read_state
from lacsolver.running import run
from tests.lacsolver.distributed.compare import problem_of

#: cases, and the time of each to go on from: with a preload and damping, with a free rigid body of its own mass
MIDDLE = {"preloaded, pushed by a foot, damped": 1.0, "a wall of its own mass, finite": 0.2}


def solved(name, folder, start=None, comm=None):
    """Solve a case into a folder, or go on from the state in another; alone without a communicator."""
    (text, mesh), when = problem_of(name), MIDDLE[name]
    if comm is None:
        case = parse_case(f"{text}[output]\ntimes = [{when}]\n")
        state = None if start is None else read_state(start, case, when, mesh=mesh)
        return run(case, create(folder, restart=state), mesh=mesh, start=state)
    case = parse_case(text + 'backend = "mumps"\n')
    state = (
        None if start is None else on_first(comm, lambda: read_state(start, case, MIDDLE[name], mesh=mesh, large=False))
    )
    place = on_first(comm, lambda: create(folder, restart=state))
    return run(case, place, mesh=mesh, start=state, distribution=Processes(comm))


def main():
    """Solve the cases, and go on, in the processes of `mpiexec`."""
    import_petsc()
    comm = import_mpi().COMM_WORLD
    some = comm.Split(int(comm.rank > 1))
    try:
        for name in MIDDLE:
            place = Path(sys.argv[1]) / name
            solved(name, place / "three", comm=comm)
            if comm.rank <= 1:
                solved(name, place / "two_after_three", place / "three", some)
    except Exception:
        traceback.print_exc()
        comm.Abort(1)
