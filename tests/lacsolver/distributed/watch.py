"""The largest allocation of numpy's arrays at each place of the code, by the handler of memory that numpy lets set."""

import ctypes
import pickle
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from tests import REPOSITORY


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


def watched(work, MPI=None):
    """Largest allocation of numpy's arrays, and largest message that MPI pickles, by place, of some work: bytes."""
    largest = {}

    def seen(size):
        if size > 1024:
            place = place_of(sys._getframe(2))
            largest[place] = max(largest.get(place, 0), size)

    def noted(data):
        seen(len(data))
        return data

    before = set_handler(handler(seen))
    messages = SimpleNamespace(__init__=lambda *_: None) if MPI is None else MPI.pickle
    messages.__init__(lambda *x: noted(pickle.dumps(*x)), lambda data, *more: pickle.loads(noted(data), *more))
    try:
        work()
    finally:
        messages.__init__()
        set_handler(before)
    return largest


def place_of(frame):
    """File and line of this repository that is nearest in the call."""
    while frame is not None:
        name = frame.f_code.co_filename
        if name.startswith((str(REPOSITORY / "lac"), str(REPOSITORY / "tests"))):
            return f"{Path(name).relative_to(REPOSITORY)}:{frame.f_lineno}"
        frame = frame.f_back
    return "elsewhere"


def handler(seen):
    """numpy's own allocator, whose sizes are seen."""
    default = ctypes.cast(_api()[306], ctypes.POINTER(ctypes.py_object))[0]
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
