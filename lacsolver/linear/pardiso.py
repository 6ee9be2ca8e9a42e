"""PARDISO of Intel's MKL: L L^T, supernodal, nested dissection, called in its shared library.

Numbers of `iparm` are those of the reference manual, less one.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.linear.errors import Breakdown, LinearError
from lacsolver.linear.mkl import library
from lacsolver.linear.triangle import Triangle

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTOR, _SOLVE, _RELEASE = 11, 22, 33, -1
_NOT_POSITIVE = -4
_REASONS = {-2: "the memory does not suffice", -3: "its ordering failed", -8: "its 32-bit numbers do not suffice"}


class _Pardiso:
    """A handle of the library: analysis and factor live in it, one at a time."""

    def __init__(self, triangle: Triangle, threads: int) -> None:
        self._n, self._threads = triangle.n, threads
        self._ia = (triangle.indptr + 1).astype(np.int32)
        self._ja = (triangle.indices + 1).astype(np.int32)
        self._values: Floats = np.ones(len(triangle.indices))
        self._pt = np.zeros(64, np.int64)
        self._iparm = np.zeros(64, np.int32)
        self._iparm[0] = 1  # not the defaults
        self._iparm[1] = 2  # nested dissection
        self._iparm[23] = 1  # two-level factorisation: a tenth faster, on one core too
        self._run(_ANALYSE)

    def factor(self, values: Floats) -> _Pardiso:
        self._values = values
        self._run(_FACTOR)
        return self

    def solve(self, b: Floats) -> Floats:
        x = np.empty_like(b, order="F")
        self._run(_SOLVE, b, x)
        return x

    def _run(self, phase: int, b: Floats | None = None, x: Floats | None = None) -> None:
        mkl = library()
        assert mkl is not None
        error = ctypes.c_int32(0)
        n_rhs = b.shape[1] if b is not None and b.ndim == 2 else 1
        kept = mkl.MKL_Set_Num_Threads_Local(self._threads)
        one = _number(1)
        mkl.pardiso(
            _array(self._pt), one, one, _number(_POSITIVE_DEFINITE), _number(phase), _number(self._n),
            _array(self._values), _array(self._ia), _array(self._ja), None, _number(n_rhs), _array(self._iparm),
            _number(0), _array(b), _array(x), ctypes.byref(error),
        )  # fmt: skip
        mkl.MKL_Set_Num_Threads_Local(kept)
        if error.value == _NOT_POSITIVE:
            raise Breakdown(int(self._iparm[29]) - 1 if self._iparm[29] > 0 else None)
        if error.value:
            reason = _REASONS.get(error.value, f"error {error.value}")
            raise LinearError(f"the linear solver pardiso gave up: {reason}; try backend = rslab")

    def __del__(self) -> None:
        if getattr(self, "_pt", None) is not None and self._pt.any():
            self._run(_RELEASE)


def _array(a: Any) -> Any:
    return None if a is None else a.ctypes.data_as(ctypes.c_void_p)


def _number(k: int) -> Any:
    return ctypes.byref(ctypes.c_int32(k))


def analyse(triangle: Triangle, threads: int) -> _Pardiso:
    """Order the elimination of a triangle."""
    return _Pardiso(triangle, threads)
