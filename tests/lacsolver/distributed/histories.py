"""A case whose law has a history, in any number of processes: a program for `mpiexec`, for `test_histories`."""

from __future__ import annotations

import sys
import traceback
from pathlib import Path

from lacsolver.case import parse_case
from lacsolver.case.added import MATERIAL_LAWS
from lacsolver.distributed.launch import import_mpi, import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.distributed.together import on_first
from lacsolver.output import create_output, read_state
from lacsolver.running import run
from tests.lacsolver.invariant_cases import CASES
from tests.lacsolver.test_added_memory import YOUNG, Damaged

#: energy at which the law has lost a part of its stiffness: large enough that no cell loses all of it
SCALE = 20.0
CASE = f"""
mesh = "none.msh"
model = "3d"
[[material]]
law = "damaged"
constants = {{ young = {YOUNG}, scale = {SCALE} }}
[[contact]]
name = "zone"
slave = "slave"
master = "master"
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0
uz = 0.0
[[displacement]]
group = "top"
ux = 0.0
uy = 0.0
uz = [[0.0, 0.0], [1.0, -0.008], [2.0, -0.006], [3.0, -0.01]]
[steps]
times = [1.0, 2.0, 3.0]
"""


def solved(folder, start=None, comm=None):
    """Solve the case into a folder, or go on from the state at t = 2 in another; alone without a communicator."""
    MATERIAL_LAWS["damaged"] = Damaged
    case, mesh = parse_case(CASE), CASES["in space"].mesh()
    if comm is None:
        state = None if start is None else read_state(start, case, 2.0, mesh=mesh)
        return run(case, create_output(folder, restart=state), mesh=mesh, start=state)
    state = None if start is None else on_first(comm, lambda: read_state(start, case, 2.0, mesh=mesh, large=False))
    place = on_first(comm, lambda: create_output(folder, restart=state))
    return run(
        parse_case(CASE + '[solver]\nbackend = "multigrid"\n'),
        place,
        mesh=mesh,
        start=state,
        distribution=Processes(comm),
    )


def main():
    """Solve the case, or go on, in all processes of `mpiexec`."""
    import_petsc()
    comm = import_mpi().COMM_WORLD
    try:
        solved(*map(Path, sys.argv[1:]), comm=comm)
    except Exception:
        traceback.print_exc()
        comm.Abort(1)
