"""PARDISO of Intel's MKL: L L^T, supernodal, nested dissection, called in its shared library.

The library is found where pip or the system has it. Indices of `iparm` are those of the reference manual minus one.
"""

from __future__ import annotations

import ctypes
import re
import sys
import weakref
from contextlib import suppress
from ctypes.util import find_library
from functools import cache, partial
from importlib import metadata
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.direct.triangle import Factorise, Solve, Triangle
from lacsolver.linear.errors import Breakdown, LinearError

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTOR, _SOLVE, _RELEASE = 11, 22, 33, -1
_NOT_POSITIVE = -4
_REASONS = {-2: "the memory does not suffice", -3: "its ordering failed", -8: "its 32-bit numbers do not suffice"}
#: names by which the system's loader may know the library: `find_library` would start a C compiler to look for it
_LOADED_AS = ("libmkl_rt.so", "libmkl_rt.so.3", "libmkl_rt.so.2", "libmkl_rt.so.1", "libmkl_rt.dylib")
_NAME = re.compile(r"libmkl_rt\.so[.\d]*|libmkl_rt[.\d]*\.dylib|mkl_rt[.\d]*\.dll")


@cache
def library() -> ctypes.CDLL | None:
    """Load and return the library mkl_rt; None if it is not installed."""
    for path in _candidates():
        with suppress(OSError):
            return ctypes.CDLL(path)
    return None


def _candidates() -> list[str]:
    paths = []
    with suppress(metadata.PackageNotFoundError):
        paths = [str(f.locate()) for f in metadata.files("mkl") or [] if _NAME.fullmatch(f.name)]
    elsewhere = (find_library("mkl_rt"),) if sys.platform == "win32" else _LOADED_AS
    return [*paths, *filter(None, elsewhere)]


class _Pardiso:
    """Analysis and one factor at a time, which the library keeps behind the handle `pt`."""

    def __init__(self, triangle: Triangle, threads: int) -> None:
        ia, ja = ((a + 1).astype(np.int32) for a in (triangle.indptr, triangle.indices))
        iparm = np.zeros(64, np.int32)
        iparm[[0, 1]] = 1, 2  # not the defaults; nested dissection
        iparm[23] = 1  # two-level factorisation: a tenth faster, on one core too
        self._call = partial(_run, np.zeros(64, np.int64), iparm, ia, ja, threads)
        self._values: Floats = np.ones(len(triangle.indices))
        self._call(_ANALYSE, self._values)
        weakref.finalize(self, self._call, _RELEASE)

    def factor(self, values: Floats) -> Solve:
        self._values = values
        self._call(_FACTOR, values)
        return self._solve

    def _solve(self, b: Floats) -> Floats:
        x = np.empty_like(b, order="F")
        self._call(_SOLVE, self._values, b, x)
        return x


def _run(
    pt: Ints, iparm: Ints, ia: Ints, ja: Ints, threads: int, phase: int, values: Floats | None = None,
    b: Floats | None = None, x: Any = None,
) -> None:  # fmt: skip
    mkl = library()
    assert mkl is not None
    error = ctypes.c_int32(0)
    one, n = _number(1), _number(len(ia) - 1)
    n_rhs = _number(b.shape[1] if b is not None and b.ndim == 2 else 1)
    before = mkl.MKL_Set_Num_Threads_Local(threads)
    mkl.pardiso(
        _array(pt), one, one, _number(_POSITIVE_DEFINITE), _number(phase), n,
        _array(values), _array(ia), _array(ja), None, n_rhs, _array(iparm),
        _number(0), _array(b), _array(x), ctypes.byref(error),
    )  # fmt: skip
    mkl.MKL_Set_Num_Threads_Local(before)
    if error.value == _NOT_POSITIVE:
        raise Breakdown(int(iparm[29]) - 1 if iparm[29] > 0 else None)
    if error.value:
        reason = _REASONS.get(error.value, f"error {error.value}")
        raise LinearError(f"the linear solver pardiso gave up: {reason}; try backend = rslab")


def _array(a: NDArray | None) -> Any:
    return None if a is None else a.ctypes.data_as(ctypes.c_void_p)


def _number(k: int) -> Any:
    return ctypes.byref(ctypes.c_int32(k))


def analyse(triangle: Triangle, threads: int) -> Factorise:
    """Analyse the pattern of a triangle: order its elimination."""
    return _Pardiso(triangle, threads).factor
