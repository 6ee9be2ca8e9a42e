"""Signatures of the kernels, recorded as text, so that all kernels can be compiled before they are called.

`signatures.json` lists, for each kernel that Python calls, the types of its arguments: `int`, `float`, `bool`; arrays
as `float64[2,C]` (dimensions, layout C, F or A, and `fixed` if it is read-only); tuples as lists, named tuples as
{class: fields}. `tools/record_kernels.py` generates it.
"""

from __future__ import annotations

import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

FILE = Path(__file__).with_name("signatures.json")
_ARRAY = re.compile(r"(\w+)\[(\d),([CFA])(,fixed)?\]")


class Signature(NamedTuple):
    """A kernel, given by its module and name, and the types of its arguments."""

    module: str
    name: str
    arguments: list[Any]

    @staticmethod
    def of(key: str, arguments: list[Any]) -> Signature:
        """Make the signature of a kernel whose name includes its module."""
        module, _, name = key.rpartition(".")
        return Signature(module, name, arguments)


def declared() -> list[Signature]:
    """Return all recorded signatures, in the order of the file."""
    listed = json.loads(FILE.read_text())
    return [Signature.of(key, arguments) for key, forms in listed.items() for arguments in forms]


def described(value: Any) -> Any:
    """Describe an argument, or a tuple of them, as text."""
    if isinstance(value, np.ndarray):
        layout = "C" if value.flags.c_contiguous else "F" if value.flags.f_contiguous else "A"
        return f"{value.dtype}[{value.ndim},{layout}{'' if value.flags.writeable else ',fixed'}]"
    if isinstance(value, tuple):
        fields = [described(v) for v in value]
        kind = type(value)
        return fields if kind is tuple else {f"{kind.__module__}.{kind.__qualname__}": fields}
    if isinstance(value, np.generic):
        return str(value.dtype)
    return type(value).__name__


def compile_signature(signature: Signature) -> None:
    """Compile a kernel for its recorded argument types, or load it from the disk."""
    kernel = getattr(import_module(signature.module), signature.name)
    kernel.compile().compile(tuple(_numba_type(a) for a in signature.arguments))


def _numba_type(text: Any) -> Any:
    from numba import from_dtype, types

    tuples: Any = types.BaseTuple
    if isinstance(text, list):
        return tuples.from_types([_numba_type(t) for t in text])
    if isinstance(text, dict):
        ((path, fields),) = text.items()
        module, _, name = path.rpartition(".")
        return tuples.from_types([_numba_type(t) for t in fields], getattr(import_module(module), name))
    array = _ARRAY.fullmatch(text)
    if array:
        dtype, ndim, layout, fixed = array.groups()
        return types.Array(from_dtype(np.dtype(dtype)), int(ndim), layout, readonly=bool(fixed))  # type: ignore[arg-type]
    plain = {"int": types.intp, "float": types.float64, "bool": types.boolean}
    return plain.get(text) or from_dtype(np.dtype(text))
