"""The compiled form of kernels, by numba, which is slow to import: `kernels` imports this module only if it pays.

Kernels are compiled by numba's public interface. What is compiled is stored and loaded here (`_Kept`), which numba
leaves to itself: its own cache does not know when a kernel of another file has changed, reads no folder that it cannot
write to, and loads the compiler, which takes longer than all else that a small command does beyond its imports. This
leans on `Dispatcher._cache`, `CompileResult` and `_nrt_python` of numba, and on its option `_nrt`.

The compiled code of a kernel is cached by `kept`, under a name made of its `key`, the types of its arguments, the
processor, and the version of numba.
"""

from __future__ import annotations

import functools
import hashlib
import io
import logging
import pickle
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numba
from llvmlite.binding import add_symbol, parse_assembly
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.extending import models, register_model, typeof_impl

from lacmesh.kernels import Kernel
from lacmesh.kernels.kept import folders, read, save

#: numba's types say less than it takes
_NJIT: Any = numba.njit
_RESULT: Any = CompileResult
_DISPATCHER: Any = numba.types.Dispatcher
_UNLITERAL: Any = numba.types.unliteral
_TUPLE: Any = numba.types.BaseTuple
_ARRAY: Any = numba.types.Array
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def outer(function: Callable[..., Any], key: str) -> Any:
    """Return the form for calls from Python: compiled for the types of the arguments, or loaded from the disk."""
    dispatcher = _NJIT(function, **_OPTIONS)
    dispatcher._cache = _Kept(key)
    return dispatcher


def inner(function: Callable[..., Any], borrows: bool) -> Any:
    """Return the form for calls from other kernels; no wrapper for Python is made, which takes a third of the time.

    `borrows`: without counted references to arrays; then numba refuses to make one.
    """
    return _NJIT(function, no_cpython_wrapper=True, _nrt=not borrows, **_OPTIONS)


class _Inner(_DISPATCHER):  # type: ignore[misc]
    """numba's type of a kernel that another calls: one form for all integers, not another for each that is written."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        """Return the types of a call. Raises TypeError for a kernel that borrows arrays, and returns one."""
        signature = super().get_call_type(context, [_UNLITERAL(a) for a in args], kws)
        if not self.dispatcher.targetoptions["_nrt"] and _has_arrays(signature.return_type):
            raise TypeError(f"{self.dispatcher} borrows arrays, and returns one")
        return signature


def _has_arrays(kind: Any) -> bool:
    """Return True for the type of an array, or of a tuple with one."""
    parts = kind if isinstance(kind, _TUPLE) else ()
    return isinstance(kind, _ARRAY) or any(_has_arrays(part) for part in parts)


register_model(_Inner)(models.OpaqueModel)


@typeof_impl.register(Kernel)
def _(kernel: Kernel, _: Any) -> Any:
    return _Inner(kernel.inner)


class _Kept:
    """Cache on the disk of the compiled forms of one kernel, with the interface that numba expects."""

    def __init__(self, key: str) -> None:
        self._key = key
        self.cache_path = str(folders()[0])

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled form for a signature; None if there is none that can be read."""
        data = read(self._name(sig, target_context.codegen()))
        if data is not None:
            with suppress(Exception):  # what a broken disk left may be anything: it is compiled again
                _name_allocator()
                return _RESULT._rebuild(target_context, *_Reader(io.BytesIO(data)).load())
        _say_that_it_takes_time()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the compiled form for a signature."""
        if data.library.has_dynamic_globals:
            return
        with suppress(Exception):  # another numba may have other parts: then nothing is kept
            save(self._key, self._name(sig, data.codegen), dumps(_lean(*data._reduce())))  # type: ignore[no-untyped-call]

    def _name(self, sig: Any, codegen: Any) -> str:
        every = repr((sig, codegen.magic_tuple(), numba.__version__))
        return f"{self._key}.{hashlib.sha256(every.encode()).hexdigest()[:16]}"


def _lean(library: Any, described: Any, environment: Any, *rest: Any) -> tuple[Any, ...]:
    """Reduce a compiled form: drop the code for inlining, two thirds of its loading time, and keep only its names."""
    title, kind, (code, _) = library
    names = [described.llvm_cpython_wrapper_name, *sorted({one.env_name for one in (environment, *rest[-1])})]
    table = parse_assembly("\n".join(f'@"{name}" = global i8 0' for name in names))
    return (title, kind, (code, table.as_bitcode())), described, environment, *rest


@functools.cache
def _name_allocator() -> None:
    """Register numba's memory allocator with the linker: of numba's set-up to compile, loading needs only this."""
    from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]

    for name, address in _nrt_python.c_helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


class _Reader(pickle.Unpickler):
    """Unpickler of a compiled form that does not import the numba modules whose functions were compiled into it."""

    def find_class(self, module: str, name: str) -> Any:
        function = super().find_class(module, name)
        return (lambda _, *rest: function(__name__, *rest)) if name == "_rebuild_env" else function


@functools.cache
def _say_that_it_takes_time() -> None:
    logging.getLogger("lacmesh").info("compiling what this needs, 10 to 50 s, once; lacmesh compile does it beforehand")
