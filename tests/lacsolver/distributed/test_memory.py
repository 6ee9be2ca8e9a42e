"""Memory of a process: no array as long as the whole model, from the parts of the mesh to the files and back.

Each process is watched, where numpy allocates arrays and where messages are pickled. A run is done in a model that is
divided beforehand, and again from its state: a step in static equilibrium, and one in motion. One process has the same
part in two models, the other one has the rest, which is larger in the second model. So whatever the first process
allocates at a place must not grow with the model.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from lacmesh.generate import box, stack
from lacmesh.partition import write_parts
from lacsolver.case import Dynamics, Solver, Steps
from lacsolver.distributed.launch import import_mpi, import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.distributed.together import on_first
from lacsolver.linear.multigrid import aggregation
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import read_mesh
from lacsolver.results import whole
from lacsolver.running import run
from tests.lacsolver.distributed.mpi import printed
from tests.lacsolver.distributed.watch import watched
from tests.problems import Material, case_of, contact, fix, move

#: for `make verify`: what is traced takes a minute
pytestmark = [pytest.mark.petsc, pytest.mark.slow]
RECORDS = (
    Material(young=1000.0, poisson=0.3, density=1.0), contact(name="zone"), fix("bottom", "xyz"),
    move("top", ux=0.0, uy=0.0, uz="-0.02 * t"), Dynamics(start=0.5), Steps(count=2),
    Solver(backend="multigrid", threads=1),
)  # fmt: skip


# ---- memory


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Allocations that each process found to grow, the other one having more and more."""
    return {line["fixed"]: line for line in printed(2, "test_memory", tmp_path_factory.mktemp("models"), timeout=900)}


@pytest.mark.parametrize("fixed", (0, 1))
def test_no_allocation_grows_with_the_part_of_another_process(told, fixed):
    """The first process writes the states, and gathers nothing else either.

    Levels of multigrid that are whole on each process have at most four nodes here, in place of 500.
    """
    (nodes, cells, own), (more, more_cells, same) = told[fixed]["sizes"]
    assert own == same and more > 3 * nodes and more_cells > 3 * cells
    longer = min(more - nodes, more_cells - cells)  # bytes by which an array of one byte a node or cell would grow
    assert {place: size for place, size in told[fixed]["grown"].items() if size >= longer} == {}
    assert told[fixed]["largest"] > 10 * longer  # what is allocated is seen


def main(comm, folder):
    """Print, for each process as the one with the same part, the places that grow, and the sizes of both models."""
    folder = Path(folder)
    whole.PIECE = 256
    aggregation._WHOLE, aggregation._FEW = 0, 2  # the levels that each process has whole: four nodes, not 500
    import_petsc()
    MPI = import_mpi()
    solved(divided(folder / "first", 6, 0, comm), comm)  # modules and kernels are loaded
    for fixed in range(comm.size):
        models = [divided(folder / f"{fixed}.{layers}", layers, fixed, comm) for layers in (6, 160)]
        small, large = (watched(lambda place=place: solved(place, comm), MPI) for place in models)
        grown = {place: size - small.get(place, 0) for place, size in large.items() if size > small.get(place, 0)}
        if comm.rank == fixed:
            sizes = [np.load(place / "figures.npy").tolist() for place in models]
            line = {"fixed": fixed, "grown": grown, "sizes": sizes, "largest": max(small.values())}
            print(json.dumps(line), flush=True)


def divided(folder, layers, fixed, comm):
    """The folder with the parts of two blocks, the lower one of so many layers, of which the process `fixed` has a half
    of the upper block and of the uppermost layers, and the other process the rest.
    """

    def make():
        folder.mkdir()
        tall = layers / 4
        mesh = stack(box((8, 8, layers), (1, 1, tall)), box((7, 7, 3)))
        mesh = mesh.only("bottom", "master", "slave", "top", "lower", "upper")
        mesh = mesh.renamed(lower="", upper="").moved((0, 0, -tall))  # the own part is at one place in both models
        x = mesh.points
        own = (x[:, 2] > -1.0) & (x[:, 0] < 0.45)
        write_parts(folder / "mesh.parts", mesh, np.where(own, fixed, 1 - fixed))
        np.save(folder / "figures.npy", np.array([mesh.n_nodes, mesh.n_cells, int(own.sum())]))

    on_first(comm, make)
    return folder


def solved(folder, comm):
    """Solve the case of a folder on its parts, and go on from its middle."""
    case, shared = case_of(folder / "mesh.parts", *RECORDS, model="3d"), Processes(comm)
    run(case, on_first(comm, lambda: create_output(folder / "out")), distribution=shared)
    mesh = read_mesh(case, shared)
    start = on_first(comm, lambda: read_state(folder / "out", case, 0.5, mesh=mesh, large=False))
    again = on_first(comm, lambda: create_output(folder / "again", restart=start))
    run(case, again, start=start, mesh=mesh, distribution=shared)
