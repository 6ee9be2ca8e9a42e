"""The compiled form of kernels by numba, which is slow to import: `kernels` imports this module only if it pays.

`kernel_signatures.json` lists, for each kernel that Python calls, the types of its arguments, so that `lacmesh compile`
can compile it before it is called: `int`, `float`, `bool`; arrays as `float64[2,C]` (dimensions, layout C, F or A, and
`fixed` if it is read-only); tuples as lists, named tuples as {class: fields}. `tools/record_kernels.py` makes it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.extending import models, register_model, typeof_impl

from lacmesh.kernels import Kernel, _one_at_a_time

FILE = Path(__file__).with_name("kernel_signatures.json")
_ARRAY = re.compile(r"(\w+)\[(\d),([CFA])(,fixed)?\]")
#: numba, whose annotations say less than it takes
_NUMBA: Any = numba
_TYPES: Any = _NUMBA.types
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def jit(function: Callable[..., Any], folder: Path | None = None, **options: Any) -> Any:
    """Return a numba dispatcher, which caches what it compiles in a folder, if there is one."""
    with _one_at_a_time:
        before, _NUMBA.config.CACHE_DIR = _NUMBA.config.CACHE_DIR, str(folder or "")
        try:
            return _NUMBA.njit(function, cache=folder is not None, **_OPTIONS, **options)
        except RuntimeError:  # numba caches no function that has no file, as in a notebook
            return _NUMBA.njit(function, **_OPTIONS, **options)
        finally:
            _NUMBA.config.CACHE_DIR = before


class _Inner(_TYPES.Dispatcher):  # type: ignore[misc]
    """numba's type of a kernel that another calls: one form for all integers, not another for each that is written."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Return the types of a call. Raises TypeError for a kernel that borrows arrays, and returns one."""
        signature = super().get_call_type(context, [_TYPES.unliteral(a) for a in args], kws)
        if not self.dispatcher.targetoptions["_nrt"] and _has_arrays(signature.return_type):
            raise TypeError(f"{self.dispatcher} borrows arrays, and returns one")
        return signature


def _has_arrays(kind: Any) -> bool:
    """Return True for the type of an array, or of a tuple with one."""
    parts = kind if isinstance(kind, _TYPES.BaseTuple) else ()
    return isinstance(kind, _TYPES.Array) or any(_has_arrays(part) for part in parts)


register_model(_Inner)(models.OpaqueModel)


@typeof_impl.register(Kernel)
def _(kernel: Kernel, _: Any) -> Any:
    return _Inner(kernel.inner)


def listed() -> dict[str, list[Any]]:
    """Return the listed kernels by module and name, with the forms of their arguments; what takes longest is first."""
    return json.loads(FILE.read_text())


def compile_listed(name: str) -> None:
    """Compile a listed kernel for all its forms of arguments, or load it from the disk."""
    module, _, function = name.rpartition(".")
    kernel = getattr(import_module(module), function)
    for arguments in listed()[name]:
        kernel.compile().compile(tuple(_NUMBA.typeof(_example(text)) for text in arguments))


def _example(text: Any) -> Any:
    """Return a value of a type that is written as text."""
    if isinstance(text, list):
        return tuple(map(_example, text))
    if isinstance(text, dict):
        ((path, fields),) = text.items()
        module, _, name = path.rpartition(".")
        return getattr(import_module(module), name)(*map(_example, fields))
    if array := _ARRAY.fullmatch(text):
        dtype, ndim, layout, fixed = array.groups()
        value = np.zeros((2,) * int(ndim), dtype, order="F" if layout == "F" else "C")
        value = np.repeat(value, 2, axis=-1)[..., ::2] if layout == "A" else value
        value.flags.writeable = not fixed
        return value
    return {"int": 0, "float": 0.0, "bool": False}[text] if text in ("int", "float", "bool") else np.dtype(text).type(0)
