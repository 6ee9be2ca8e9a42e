"""Kernels: loops over arrays that run compiled if there is enough work, and as plain Python if there is not.

Compiling takes seconds, loading numba and the compiled code tenths of a second. For a few faces plain Python is faster,
with the same results up to rounding. Which form a call takes depends on the entries in its arrays, not on earlier
calls: from CACHED_FROM on it is compiled if the kernel was compiled before this process, else from COMPILED_FROM on.

numba compiles, and caches on the disk. Its cache does not see that a kernel of another file has changed: so each kernel
has a folder of its own, named by a digest of its code and of all that it calls. The folders lie beside the package, in
the user's cache folder where that cannot be written, or where NUMBA_CACHE_DIR says.

A kernel is called with positional arguments, and calls other kernels by their names: they are compiled into it, or run
as plain Python with it. With NUMBA_DISABLE_JIT=1, which is set for debugging, all kernels run as plain Python.
"""

from __future__ import annotations

import functools
import hashlib
import json
import logging
import os
import re
import shutil
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, ClassVar, overload

import numpy as np

#: numbers in the arrays of a call from which it runs compiled, if the kernel is cached, and if it is not. As it stands,
#: a number takes one to ten microseconds; to load a kernel takes 2 to 15 ms, numba 400
CACHED_FROM, COMPILED_FROM = 300, 100_000
#: numbers in all calls of a process from which a kernel that is not cached is compiled by later ones
WORTH_CACHING = 500_000
#: numbers that a kernel whose other form takes arrays at once does as it stands in the time of one in a loop
IN_ARRAYS = 10
#: the kernels that `lacmesh compile` compiles, and the types of their arguments
SIGNATURES = Path(__file__).with_name("kernel_signatures.json")
#: of all that numba compiles
_OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}

_plain = threading.local()  # `running` is True inside a kernel that runs as it stands
_one_at_a_time = threading.RLock()


class Kernel:
    """A function of arrays and numbers, plain and compiled. Division by zero gives inf or NaN in both, as in numpy."""

    #: every kernel of the modules that are imported
    known: ClassVar[list[Kernel]] = []

    def __init__(self, function: Callable[..., Any], least: int = 0, costly: int = 1, borrows: bool = False) -> None:
        functools.update_wrapper(self, function)
        self.function: Any = function
        #: what runs as it stands; another function of arrays that gives the same, and much faster, may take its place
        self.plain: Any = function
        self.compiled: Any = None
        self.least, self.costly, self.borrows = least, costly, borrows
        self._done = 0
        Kernel.known.append(self)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function: as it stands if the calling kernel runs so, else by `dispatch`."""
        return self.plain(*arguments) if getattr(_plain, "running", False) else self.dispatch(*arguments)

    def dispatch(self, *arguments: Any) -> Any:
        """Call the function, compiled or plain, by the size of the arguments."""
        return (self.fast if self._is_worth_compiling(_numbers(arguments)) else self.py_func)(*arguments)

    def py_func(self, *arguments: Any) -> Any:
        """Call the plain function with numpy's numbers, which allow division by zero, and without numpy's warnings."""
        before, _plain.running = getattr(_plain, "running", False), True
        try:
            with np.errstate(all="ignore"):
                return self.plain(*(np.float64(a) if type(a) is float else a for a in arguments))
        finally:
            _plain.running = before

    def fast(self, *arguments: Any) -> Any:
        """Call the compiled function; a cache that is damaged, or on a full disk, is removed, and done without."""
        try:
            return (self.compiled or self.compile())(*arguments)
        except Exception:  # numba reads and writes its files without a guard; kernels raise nothing of their own
            shutil.rmtree(self.folder, ignore_errors=True)
            self.compiled = self._jit()
            return self.compiled(*arguments)

    def compile(self) -> Any:
        """Return the compiled form for calls from Python: a numba dispatcher, which compiles for the argument types."""
        with _one_at_a_time:
            if self.compiled is None:
                if not any(self.folder.rglob("*.nbi")):  # numba's index of what it cached
                    _log_compilation()
                for old in self.folder.parent.glob(f"{self.folder.stem}.*"):
                    if old != self.folder:  # of earlier sources
                        shutil.rmtree(old, ignore_errors=True)
                self.compiled = self._jit(self.folder if writable(self.folder) else None)
        return self.compiled

    def _jit(self, folder: Path | None = None, **options: Any) -> Any:
        """Return numba's form of the function, which calls those of other kernels; `folder`: where it is cached."""
        numba: Any = import_module("numba")  # slow
        names = dict(self.function.__globals__)
        names |= {name: value.inner for name, value in _named(self.function) if isinstance(value, Kernel)}
        function, options = FunctionType(self.function.__code__, names), {**_OPTIONS, **options}
        with _one_at_a_time:
            before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder or "")
            try:
                return numba.njit(cache=folder is not None, **options)(function)
            except RuntimeError:  # numba caches no function that has no file, as in a notebook
                return numba.njit(**options)(function)
            finally:
                numba.config.CACHE_DIR = before

    @functools.cached_property
    def inner(self) -> Any:
        """The compiled form for kernels that call this one, without a wrapper for Python: a third of the time."""
        return self._jit(no_cpython_wrapper=True, _nrt=not self.borrows)

    def check_parts(self) -> None:
        """Check the kernels that are compiled into this one. Raises TypeError for one that borrows and returns arrays.

        numba refuses one that makes arrays.
        """
        for name, part in _named(self.function):
            if isinstance(part, Kernel):
                part.check_parts()
                if part.borrows and any("array" in str(one.return_type) for one in part.inner.nopython_signatures):
                    raise TypeError(f"the kernel {name} borrows arrays, and returns one")

    @functools.cached_property
    def folder(self) -> Path:
        """The folder where what is compiled is cached; there is none yet if nothing is, and none is asked for."""
        digest = hashlib.sha256(b"".join(_content(self))).hexdigest()[:24]
        return cache_folder() / f"{self.__module__}.{self.function.__name__}.{sys.implementation.cache_tag}.{digest}"

    @functools.cached_property
    def _is_cached(self) -> bool:
        """True if the compiled form was on the disk, or was asked for, when this process first needed to know."""
        return self.folder.is_dir()

    def _is_worth_compiling(self, numbers: int) -> bool:
        """True if a call with so many numbers runs compiled; if not, count the work for later processes."""
        if numbers < max(CACHED_FROM, self.least) or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
            return False
        numbers = numbers if self.plain is self.function else numbers // IN_ARRAYS
        if self._is_cached or numbers >= self.costly * COMPILED_FROM:
            return True
        before, self._done = self._done, self._done + numbers
        if before < WORTH_CACHING <= self._done:
            writable(self.folder)
        return False


@overload
def kernel(function: Callable[..., Any]) -> Any: ...
@overload
def kernel(*, least: int = 0, costly: int = 1, borrows: bool = False) -> Callable[[Callable[..., Any]], Any]: ...
def kernel(function: Any = None, *, least: int = 0, costly: int = 1, borrows: bool = False) -> Any:
    """Make a kernel of a function of arrays, numbers, and tuples of them, in the Python that numba compiles.

    `least`: numbers in the arrays of a call below which it runs as it stands in any case; for kernels of commands that
    otherwise do without numba. `costly`: how many times as much work as for most kernels a call must have to be worth
    compiling it, for kernels of many parts, whose compiling takes many seconds. `borrows`: for parts of other kernels
    that make no arrays and return none: the references to arrays that they take, in tuples too, are not counted, which
    takes longer than the work on one point (numba's option `_nrt`, which is not in its manual).
    """
    options: dict[str, Any] = {"least": least, "costly": costly, "borrows": borrows}
    return functools.partial(Kernel, **options) if function is None else Kernel(function)


@functools.cache
def cache_folder() -> Path:
    """Return the folder of all that is cached, which may be missing, or impossible to make."""
    package = Path(__file__).parent
    beside, name = package / "__pycache__" / "kernels", hashlib.sha256(str(package).encode()).hexdigest()[:16]
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen) / f"lacmesh-{name}"
    if os.access(beside.parent if beside.parent.is_dir() else package, os.W_OK):
        return beside
    with suppress(RuntimeError):  # nobody knows where this user is at home
        return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / f"lacmesh-{name}"
    return beside


def writable(folder: Path) -> bool:
    """Make a folder; return True if files can be written there."""
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
        return True
    return False


# ---- kernels that are compiled before they are called


def listed() -> dict[str, list[Any]]:
    """Return the listed kernels by module and name, with the forms of their arguments; what takes longest is first.

    Forms are `int`, `float`, `bool`; arrays as `float64[2,C]` (dimensions, layout C, F or A, and `fixed` if it is
    read-only); tuples as lists, named tuples as {class: fields}. `tools/record_kernels.py` makes the list.
    """
    return json.loads(SIGNATURES.read_text())


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
    if array := re.fullmatch(r"(\w+)\[(\d),([CFA])(,fixed)?\]", text):
        dtype, ndim, layout, fixed = array.groups()
        value = np.zeros((2,) * int(ndim), dtype, order="F" if layout == "F" else "C")
        value = np.repeat(value, 2, axis=-1)[..., ::2] if layout == "A" else value
        value.flags.writeable = not fixed
        return value
    return {"int": 0, "float": 0.0, "bool": False}[text] if text in ("int", "float", "bool") else np.dtype(text).type(0)


# ---- what a kernel is made of


def _codes(function: Any) -> list[CodeType]:
    """The code of a function, and of those that are defined inside it."""
    codes = [function.__code__]
    for code in codes:
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return codes


def _named(function: Any) -> Iterator[tuple[str, Any]]:
    """Yield the names that the code of a function has, and what they are in its module; None for what is not there."""
    for code in _codes(function):
        yield from ((name, function.__globals__.get(name)) for name in code.co_names)


def _content(kernel: Kernel) -> Iterator[bytes]:
    """Yield everything on which the compiled form of a kernel depends."""
    yield repr((kernel.borrows, sys.version_info)).encode()
    words = kernel.function.__doc__  # which changes nothing
    for code in _codes(kernel.function):
        yield code.co_code + repr([c for c in code.co_consts if not isinstance(c, CodeType) and c != words]).encode()
    for name, value in _named(kernel.function):
        if isinstance(value, Kernel):
            yield from _content(value)
        elif isinstance(value, np.ndarray):
            yield f"{name} {value.dtype} {value.shape}".encode() + value.tobytes()
        else:
            yield f"{name} {getattr(value, '__qualname__', None) or getattr(value, '__name__', value)!r}".encode()


def _numbers(arguments: Any) -> int:
    """Total number of entries of the arrays among some arguments."""
    return sum(a.size if isinstance(a, np.ndarray) else _numbers(a) if isinstance(a, tuple) else 0 for a in arguments)


@functools.cache
def _log_compilation() -> None:
    message = "compiling loops that this command is the first to need, 10 to 50 s; lacmesh compile compiles all of them"
    logging.getLogger("lacmesh").info(message)
