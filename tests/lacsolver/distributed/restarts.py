"""Runs in some processes, from whose states others go on: a program for `mpiexec`, for `test_restarts`.

A motion, and a law with a history, on a mesh that each process has as a whole; and blocks in contact on a mesh of which
processes read slices, or parts of a folder.
"""

from __future__ import annotations

from contextlib import nullcontext, suppress
from pathlib import Path

from lacmesh.errors import DataError
from lacsolver.case import parse_case
from lacsolver.case.added import MATERIAL_LAWS
from lacsolver.distributed import processes
from lacsolver.distributed.launch import import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.distributed.together import on_first
from lacsolver.output import create_output, read_state
from lacsolver.running import run
from tests.lacsolver.distributed.compare import problem_of
from tests.lacsolver.distributed.mpi import ROOT
from tests.lacsolver.invariant_cases import CASES
from tests.lacsolver.test_added import YOUNG, Damaged

#: a case of blocks that are damaged; `scale`: so large that no cell loses all of its stiffness
DAMAGED = f"""
mesh = "none.msh"
model = "3d"
[[material]]
law = "damaged"
constants = {{ young = {YOUNG}, scale = 20.0 }}
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
[solver]
threads = 1
"""
#: cases, and the time of each to go on from: with a preload and damping, with a free rigid body of its own mass, with
#: the energy that a law has had at each point
MIDDLE = {"preloaded, pushed by a foot, damped": 1.0, "a wall of its own mass, finite": 0.2, "damaged": 2.0}


def solved(name, folder, start=None, comm=None):
    """Solve a case into a folder, or go on from the state in another; alone without a communicator."""
    if name == "damaged":  # known where it is solved, not wherever this module is imported
        MATERIAL_LAWS["damaged"] = Damaged
    (text, mesh), when = (DAMAGED, CASES["in space"].mesh()) if name == "damaged" else problem_of(name), MIDDLE[name]
    if comm is None:
        case = parse_case(f"{text}[output]\ntimes = [{when}]\n")
        state = None if start is None else read_state(start, case, when, mesh=mesh)
        return run(case, create_output(folder, restart=state), mesh=mesh, start=state)
    case = parse_case(text + 'backend = "mumps"\n')
    state = (
        None if start is None else on_first(comm, lambda: read_state(start, case, MIDDLE[name], mesh=mesh, large=False))
    )
    place = on_first(comm, lambda: create_output(folder, restart=state))
    return run(case, place, mesh=mesh, start=state, distribution=Processes(comm))


def blocks(mesh):
    """The case `two_blocks` on a mesh, in four steps, each with its state."""
    text = (ROOT / "data" / "two_blocks.toml").read_text().replace("two_blocks.msh", str(mesh))
    return parse_case(text.replace("count = 2", "count = 4") + "[output]\nevery = 1\n[solver]\nthreads = 1\n")


def pressed(mesh, folder, start=None, comm=None, *, when=0.5, stop=False):
    """Press the blocks, or go on from a state in another folder; `stop`: interrupted after two steps."""
    case = blocks(mesh)

    def stepped(step):
        if stop and step.time == 0.5:
            raise KeyboardInterrupt

    if comm is None:
        state = None if start is None else read_state(start, case, when)
        run(case, create_output(folder, restart=state), start=state)
        return
    shared = Processes(comm)
    state = None if start is None else on_first(comm, lambda: read_state(start, case, when, large=False))
    place = on_first(comm, lambda: create_output(folder, restart=state))
    with suppress(KeyboardInterrupt) if stop else nullcontext():
        run(case, place, start=state, stepped=stepped, distribution=shared)


def spread(world, some, alone, place):
    """Press the blocks in two of the processes, and go on in other numbers of them, on slices and on parts."""
    processes.LARGE = 0  # files are read by slices
    mesh = place / "blocks.med"
    if world.rank < some.size:
        pressed(mesh, place / "two", comm=some, stop=True)
    world.Barrier()
    pressed(mesh, place / "three_after_two", place / "two", world)
    try:
        pressed(place / "moved.med", place / "refused", place / "two", world)
    except DataError as error:
        (place / f"refused_{world.rank}.txt").write_text(str(error))
    if world.rank < some.size:
        pressed(mesh, place / "two_after_one", place / "one", some)
        pressed(place / "blocks.parts", place / "parts_after_two", place / "two", some)
    if world.rank == 0:
        pressed(mesh, place / "one_after_two", place / "two", alone)


def main(comm, folder):
    """Solve the cases, and go on, in the processes of `mpiexec`."""
    import_petsc()
    some, alone = comm.Split(int(comm.rank > 1)), comm.Split(comm.rank)
    spread(comm, some, alone, Path(folder) / "blocks")
    for name in MIDDLE:
        place = Path(folder) / name
        solved(name, place / "three", comm=comm)
        if comm.rank <= 1:
            solved(name, place / "two_after_three", place / "three", some)
