"""The kernels that `lacmesh compile` compiles before they are called.

`kernel_signatures.json` lists, for each kernel that Python calls, the types of its arguments: `int`, `float`, `bool`;
arrays as `float64[2,C]` (dimensions, layout C, F or A, and `fixed` if it is read-only); tuples as lists, named tuples
as {class: fields}. `tools/record_kernels.py` makes it.
"""

from __future__ import annotations

import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.kernels import Kernel

FILE = Path(__file__).with_name("kernel_signatures.json")
_ARRAY = re.compile(r"(\w+)\[(\d),([CFA])(,fixed)?\]")


def listed() -> dict[str, list[Any]]:
    """Return the listed kernels by module and name, with the forms of their arguments; what takes longest is first."""
    return json.loads(FILE.read_text())


def compile_listed(name: str) -> None:
    """Compile a listed kernel for all its forms of arguments, or load it from the disk.

    Raises TypeError for a part of it that borrows arrays and returns one.
    """
    numba: Any = import_module("numba")
    module, _, function = name.rpartition(".")
    kernel: Kernel = getattr(import_module(module), function)
    for arguments in listed()[name]:
        kernel.compile().compile(tuple(numba.typeof(_example(text)) for text in arguments))
    kernel.check_parts()


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
