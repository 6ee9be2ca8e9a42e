"""The largest allocation of numpy, and of messages, at each place of the code: a program for `test_memory`.

A run is done in a model that is divided beforehand, from the parts of its mesh to its files, and again from its state:
a step in static equilibrium, and one in motion.
One process has the same part in both models, the other one has the rest, which is larger in the second model. So
whatever the first process allocates at a place must not grow with the model.
"""

from __future__ import annotations

import ctypes
import json
import pickle
import sys
import traceback
from pathlib import Path

import numpy as np

from lacmesh.partition import write_parts
from lacsolver.case import parse_case
from lacsolver.distributed.launch import import_mpi, import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.distributed.together import on_first
from lacsolver.linear.multigrid import aggregation
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import read_mesh
from lacsolver.results import whole
from lacsolver.running import run
from verification.meshes.blocks import block, joined
from verification.mpiexec import ROOT

CASE = """
mesh = "none.msh"
model = "3d"
[[material]]
young = 1000.0
poisson = 0.3
density = 1.0
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
uz = "-0.02 * t"
[dynamics]
start = 0.5
[solver]
backend = "multigrid"
threads = 1
[steps]
count = 2
"""


def main(comm, folder, *numbers):
    """Print, for processes as the one with the same part, the places that grow, and the sizes of both models."""
    folder = Path(folder)
    whole.PIECE = 256
    aggregation._WHOLE, aggregation._FEW = 0, 2  # the levels that each process has whole: four nodes, not 500
    import_petsc()
    MPI = import_mpi()
    solved(divided(folder / "first", 6, 0, comm), comm)  # modules and kernels are loaded
    for fixed in map(int, numbers):
        models = [divided(folder / f"{fixed}.{layers}", layers, fixed, comm) for layers in (6, 160)]
        found = [watched(MPI, lambda place=place: solved(place, comm)) for place in models]
        if comm.rank == fixed:
            sizes = [np.load(place / "figures.npy").tolist() for place in models]
            told = {"fixed": fixed, "grown": grown(*found), "sizes": sizes, "largest": max(found[0].values())}
            print(json.dumps(told), flush=True)


def grown(small, large):
    """Bytes by which the largest allocation at each place is larger in the larger model."""
    told = {place: size - small.get(place, 0) for place, size in large.items()}
    return {place: size for place, size in sorted(told.items(), key=lambda one: -one[1]) if size > 0}


# ---- the models


def divided(folder, layers, fixed, comm):
    """The folder with the parts of two blocks, the lower one of so many layers, of which the process `fixed` has a half
    of the upper block and of the uppermost layers, and the other process the rest.
    """

    def make():
        folder.mkdir()
        mesh = blocks(layers)
        x = mesh.points
        own = (x[:, 2] > -1.0) & (x[:, 0] < 0.45)
        write_parts(folder / "mesh.parts", mesh, np.where(own, fixed, 1 - fixed))
        np.save(folder / "figures.npy", np.array([mesh.n_nodes, mesh.n_cells, int(own.sum())]))

    on_first(comm, make)
    return folder


def blocks(layers):
    """A unit block on a column of layers of cells of height 1/4."""
    upper, lower = box((7, 7, 3), 0.0, 1.0), box((8, 8, layers), -0.25 * layers, 0.0)
    return joined([(lower, {"z0": "bottom", "z1": "master"}), (upper, {"z0": "slave", "z1": "top"})])


def box(counts, low, high):
    """A block of HEXA8 between two heights."""
    return block("HEXA8", counts, (0.0, 0.0, low), (1.0, 1.0, high))


def solved(folder, comm):
    """Solve the case of a folder on its parts, and go on from its middle."""
    case = parse_case(CASE.replace("none.msh", str(folder / "mesh.parts")))
    shared = Processes(comm)
    try:
        run(case, on_first(comm, lambda: create_output(folder / "out")), distribution=shared)
        mesh = read_mesh(case, shared)
        start = on_first(comm, lambda: read_state(folder / "out", case, 0.5, mesh=mesh, large=False))
        again = on_first(comm, lambda: create_output(folder / "again", restart=start))
        run(case, again, start=start, mesh=mesh, distribution=shared)
    except Exception:
        traceback.print_exc()
        comm.Abort(1)


# ---- the watch


class Allocator(ctypes.Structure):
    """PyDataMemAllocator of numpy's C interface (NEP 49)."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("ctx", "malloc", "calloc", "realloc", "free")]


class Handler(ctypes.Structure):
    """PyDataMem_Handler of numpy's C interface."""

    _fields_ = [("name", ctypes.c_char * 127), ("version", ctypes.c_uint8), ("allocator", Allocator)]


_ONE = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
_TWO = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
_MORE = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t)
_KEPT = []  # what numpy has pointers to, until the process ends


def watched(MPI, work):
    """Largest allocation of numpy's arrays, and largest message of pickled objects, by place, of some work: bytes."""
    largest = {}

    def seen(size):
        if size > 1024:
            place = place_of(sys._getframe(2))
            largest[place] = max(largest.get(place, 0), size)

    before = set_handler(handler(seen))
    MPI.pickle.__init__(
        lambda *given: noted(pickle.dumps(*given), seen), lambda data, *more: pickle.loads(noted(data, seen), *more)
    )
    try:
        work()
    finally:
        MPI.pickle.__init__()
        set_handler(before)
    return largest


def noted(data, seen):
    """Bytes of a message, after their size was seen."""
    seen(len(data))
    return data


def place_of(frame):
    """File and line of this repository that is nearest in the call."""
    while frame is not None:
        name = frame.f_code.co_filename
        if name.startswith(str(ROOT / "lac")):
            return f"{Path(name).relative_to(ROOT)}:{frame.f_lineno}"
        frame = frame.f_back
    return "elsewhere"


def handler(seen):
    """numpy's own allocator, whose sizes are seen."""
    api = _api()
    default = ctypes.cast(api[306], ctypes.POINTER(ctypes.py_object))[0]
    own = Handler.from_address(_pointer(default, b"mem_handler"))
    plain = own.allocator
    malloc, calloc, realloc = _ONE(plain.malloc), _TWO(plain.calloc), _MORE(plain.realloc)

    def of_malloc(ctx, size):
        seen(size)
        return malloc(ctx, size)

    def of_calloc(ctx, count, size):
        seen(count * size)
        return calloc(ctx, count, size)

    def of_realloc(ctx, there, size):
        seen(size)
        return realloc(ctx, there, size)

    functions = _ONE(of_malloc), _TWO(of_calloc), _MORE(of_realloc)
    pointers = (ctypes.cast(function, ctypes.c_void_p) for function in functions)
    made = Handler(b"watched", own.version, Allocator(plain.ctx, *pointers, plain.free))
    _KEPT.extend((functions, made))
    new = ctypes.pythonapi.PyCapsule_New
    new.restype, new.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    return new(ctypes.addressof(made), b"mem_handler", None)


def set_handler(capsule):
    """Let numpy allocate by a handler; the one before."""
    return ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object)(_api()[304])(capsule)


def _api():
    core = np.core if np.__version__ < "2" else np._core
    return ctypes.cast(_pointer(core._multiarray_umath._ARRAY_API, None), ctypes.POINTER(ctypes.c_void_p))


def _pointer(capsule, name):
    get = ctypes.pythonapi.PyCapsule_GetPointer
    get.restype, get.argtypes = ctypes.c_void_p, [ctypes.py_object, ctypes.c_char_p]
    return get(capsule, name)


if __name__ == "__main__":
    main()
