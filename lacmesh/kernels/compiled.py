"""The compiled form of kernels, by numba, which is slow to import: `kernels` imports this module only if it pays.

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
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from lacmesh.kernels.kept import folders, read, save

#: numba's types say less than it takes
_NJIT: Any = numba.njit
_UNLITERAL: Any = numba.types.unliteral
_RESULT: Any = CompileResult
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def outer(function: Callable[..., Any], key: str) -> Any:
    """Return the form for calls from Python: compiled for the types of the arguments, or loaded from the disk."""
    made = _NJIT(function, **_OPTIONS)
    made._cache = _Kept(key)
    return made


def inner(function: Callable[..., Any]) -> Any:
    """Return the form for calls from other kernels; no wrapper for Python is made, which takes a third of the time."""
    made = _NJIT(function, no_cpython_wrapper=True, **_OPTIONS)
    template = made.get_call_template
    # one form for all integers, not another for each that a caller writes as a number
    made.get_call_template = lambda types, keywords: template([_UNLITERAL(t) for t in types], keywords)
    return made


class _Kept(_Cache):
    """Cache on the disk of the compiled forms of one kernel, with the interface that numba expects."""

    def __init__(self, key: str) -> None:
        self._key = key

    @property
    def cache_path(self) -> str:
        return str(folders()[0])

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

    def enable(self) -> None: ...

    def disable(self) -> None: ...

    def flush(self) -> None: ...


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
        found = super().find_class(module, name)
        return (lambda _, *rest: found(__name__, *rest)) if name == "_rebuild_env" else found


@functools.cache
def _say_that_it_takes_time() -> None:
    logging.getLogger("lacmesh").info("compiling what this needs: some seconds, the first time")
