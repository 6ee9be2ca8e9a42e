"""PARDISO of Intel's MKL: L L^T, supernodal, nested dissection, called in its shared library.

Indices of `iparm` are those of the reference manual minus one.
"""

from __future__ import annotations

import ctypes
import weakref
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.linear.direct.mkl import library
from lacsolver.linear.direct.triangle import Triangle
from lacsolver.linear.errors import Breakdown, LinearError

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTOR, _SOLVE, _RELEASE = 11, 22, 33, -1
_NOT_POSITIVE = -4
_REASONS = {-2: "the memory does not suffice", -3: "its ordering failed", -8: "its 32-bit numbers do not suffice"}


class _Handle(NamedTuple):
    """Arguments of every call of the library, which keeps analysis and factor behind `pt`."""

    pt: NDArray[np.int64]
    iparm: NDArray[np.int32]
    ia: NDArray[np.int32]
    ja: NDArray[np.int32]
    threads: int


class _Pardiso:
    """Analysis and one factor at a time, held by one handle."""

    def __init__(self, triangle: Triangle, threads: int) -> None:
        ia, ja = ((a + 1).astype(np.int32) for a in (triangle.indptr, triangle.indices))
        self._handle = _Handle(np.zeros(64, np.int64), np.zeros(64, np.int32), ia, ja, threads)
        self._handle.iparm[[0, 1]] = 1, 2  # not the defaults; nested dissection
        self._handle.iparm[23] = 1  # two-level factorisation: a tenth faster, on one core too
        self._values: Floats = np.ones(len(triangle.indices))
        _run(self._handle, _ANALYSE, self._values)
        weakref.finalize(self, _run, self._handle, _RELEASE)

    def factor(self, values: Floats) -> _Pardiso:
        self._values = values
        _run(self._handle, _FACTOR, values)
        return self

    def solve(self, b: Floats) -> Floats:
        x = np.empty_like(b, order="F")
        _run(self._handle, _SOLVE, self._values, b, x)
        return x


def _run(handle: _Handle, phase: int, values: Floats | None = None, b: Floats | None = None, x: Any = None) -> None:
    mkl = library()
    assert mkl is not None
    error = ctypes.c_int32(0)
    one, n = _number(1), _number(len(handle.ia) - 1)
    n_rhs = _number(b.shape[1] if b is not None and b.ndim == 2 else 1)
    before = mkl.MKL_Set_Num_Threads_Local(handle.threads)
    mkl.pardiso(
        _array(handle.pt), one, one, _number(_POSITIVE_DEFINITE), _number(phase), n,
        _array(values), _array(handle.ia), _array(handle.ja), None, n_rhs, _array(handle.iparm),
        _number(0), _array(b), _array(x), ctypes.byref(error),
    )  # fmt: skip
    mkl.MKL_Set_Num_Threads_Local(before)
    if error.value == _NOT_POSITIVE:
        raise Breakdown(int(handle.iparm[29]) - 1 if handle.iparm[29] > 0 else None)
    if error.value:
        reason = _REASONS.get(error.value, f"error {error.value}")
        raise LinearError(f"the linear solver pardiso gave up: {reason}; try backend = rslab")


def _array(a: NDArray | None) -> Any:
    return None if a is None else a.ctypes.data_as(ctypes.c_void_p)


def _number(k: int) -> Any:
    return ctypes.byref(ctypes.c_int32(k))


def analyse(triangle: Triangle, threads: int) -> _Pardiso:
    """Analyse the pattern of a triangle: order its elimination."""
    return _Pardiso(triangle, threads)
