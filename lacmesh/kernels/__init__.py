"""Kernels: loops over arrays that run compiled if there is enough work, and as plain Python if there is not.

Compiling a kernel takes seconds, loading numba and the compiled code takes tenths of a second. For a few faces plain
Python is faster, with the same results up to rounding. Which form a call takes hangs on its own work, the number of
entries in its arrays, and not on earlier calls: it is compiled from a low limit on if the kernel was compiled before
this process and is cached on the disk (`kept`), from a high one if it must be compiled first. A kernel that did much
work in all, call by call, is compiled from the low limit on in the next process.

A kernel is called with positional arguments, and calls other kernels by their names: they are compiled into it, or run
as plain Python with it. With NUMBA_DISABLE_JIT=1, which is set for debugging, all kernels run as plain Python.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import sys
import threading
from collections.abc import Callable, Iterator
from types import CodeType
from typing import Any, ClassVar, overload

import numpy as np

from lacmesh.kernels.kept import has, save

#: numbers in the arrays of a call from which it runs compiled, if the kernel is kept on the disk, and if it is not. As
#: it stands, a number takes one to ten microseconds; to load a kernel takes 2 to 15 ms, numba 200
KEPT_FROM, COMPILED_FROM = 300, 100_000
#: numbers in all calls of a process from which a kernel that is not kept is compiled by later ones
WORTH_KEEPING = 500_000
#: numbers that a kernel whose other form takes arrays at once does as it stands in the time of one in a loop
IN_ARRAYS = 10


class _Plain(threading.local):
    """State of this thread: `running` is True inside a kernel that runs as it stands."""

    running = False


_plain = _Plain()


class Kernel:
    """A function of arrays and numbers, plain and compiled. Division by zero gives inf or NaN in both, as in numpy.

    `least`: numbers in the arrays of a call below which it runs as it stands in any case. `costly`: how many times as
    much work as for most kernels a call must have to be worth compiling it. `borrows`: as a part of another kernel it
    counts no references to arrays.
    """

    #: every kernel of the modules that are imported, by the order of their making
    known: ClassVar[list[Kernel]] = []
    _one_at_a_time: ClassVar[Any] = threading.Lock()

    def __init__(self, function: Callable[..., Any], least: int = 0, costly: int = 1, borrows: bool = False) -> None:
        functools.update_wrapper(self, function)
        self.__qualname__: str = function.__qualname__
        self.function: Any = function
        #: what runs as it stands; another function of arrays that gives the same, and much faster, may take its place
        self.plain: Any = function
        self.compiled: Any = None
        self.least, self.costly, self.borrows = least, costly, borrows
        self._done = 0
        Kernel.known.append(self)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function and return its result: as it stands if the calling kernel runs so, else by `dispatch`."""
        return self.plain(*arguments) if _plain.running else self.dispatch(*arguments)

    def dispatch(self, *arguments: Any) -> Any:
        """Call the function, compiled or plain, by the size of the arguments."""
        if self._is_worth_compiling(_numbers(arguments)):
            return (self.compiled or self.compile())(*arguments)
        return self.py_func(*arguments)

    def py_func(self, *arguments: Any) -> Any:
        """Call the plain function with numpy's numbers, which allow division by zero, and without numpy's warnings."""
        before, _plain.running = _plain.running, True
        try:
            with np.errstate(all="ignore"):
                return self.plain(*(np.float64(a) if type(a) is float else a for a in arguments))
        finally:
            _plain.running = before

    def compile(self) -> Any:
        """Return the compiled form for calls from Python: a numba dispatcher, which compiles for the argument types."""
        from lacmesh.kernels.compiled import outer

        with Kernel._one_at_a_time:
            if self.compiled is None:
                self.compiled = outer(self.function, self.key)
        return self.compiled

    @functools.cached_property
    def inner(self) -> Any:
        """The compiled form for kernels that call this one."""
        from lacmesh.kernels.compiled import inner

        return inner(self.function, self.borrows)

    @functools.cached_property
    def key(self) -> str:
        """Cache key: the name and a hash of the code, the globals it uses, and those of the kernels it calls."""
        stamp = hashlib.sha256(repr(sys.version_info).encode())
        for part in self.parts():
            stamp.update(part)
        name = re.sub(r"[^\w.]", "", f"{self.__module__}.{self.__qualname__}")  # of a file
        return f"{name}.{sys.implementation.cache_tag}.{stamp.hexdigest()[:24]}"

    def parts(self) -> Iterator[bytes]:
        """Yield everything on which the compiled form depends, as bytes."""
        yield b"borrows" if self.borrows else b""
        words = self.function.__doc__  # which changes nothing
        for code in _codes(self.function.__code__):
            yield code.co_code
            yield repr([c for c in code.co_consts if not isinstance(c, CodeType) and c != words]).encode()
        for name, value in self.named():
            yield name.encode()
            if isinstance(value, Kernel):
                yield from value.parts()
            elif isinstance(value, np.ndarray):
                yield f"{value.dtype} {value.shape}".encode() + value.tobytes()
            else:
                yield repr(getattr(value, "__qualname__", None) or getattr(value, "__name__", value)).encode()

    def named(self) -> Iterator[tuple[str, Any]]:
        """Yield the names and values of the globals that the function uses."""
        every = self.function.__globals__
        for code in _codes(self.function.__code__):
            yield from ((name, every[name]) for name in code.co_names if name in every)

    @functools.cached_property
    def _is_kept(self) -> bool:
        """True if the compiled form was on the disk, or was asked for, when this process began to use kernels."""
        return has(self.key)

    def _is_worth_compiling(self, numbers: int) -> bool:
        """True if a call with so many numbers runs compiled; if not, count the work for later processes."""
        if numbers < max(KEPT_FROM, self.least) or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
            return False
        numbers = numbers if self.plain is self.function else numbers // IN_ARRAYS
        if self._is_kept or numbers >= self.costly * COMPILED_FROM:
            return True
        before, self._done = self._done, self._done + numbers
        if before < WORTH_KEEPING <= self._done:
            save(self.key, f"{self.key}.wanted", b"")
        return False


@overload
def kernel(function: Callable[..., Any]) -> Any: ...


@overload
def kernel(*, least: int = 0, costly: int = 1, borrows: bool = False) -> Callable[[Callable[..., Any]], Any]: ...


def kernel(
    function: Callable[..., Any] | None = None, *, least: int = 0, costly: int = 1, borrows: bool = False
) -> Any:
    """Make a kernel of a function of arrays, numbers, and tuples of them, in the Python that numba compiles.

    `least`: numbers in the arrays of a call below which it runs as it stands in any case; for kernels of commands that
    otherwise do without numba. `costly`: how many times as much work as for most kernels a call must have to be worth
    compiling it, for kernels of many parts, whose compiling takes many seconds. `borrows`: for parts of other kernels
    that make no arrays and return none: the references to arrays that they are given, in tuples too, are not counted,
    which takes longer than the work on one point.
    """
    return (
        functools.partial(Kernel, least=least, costly=costly, borrows=borrows) if function is None else Kernel(function)
    )


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield the code of a function and of the functions inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _numbers(arguments: Any) -> int:
    """Total number of entries of the arrays among some arguments."""
    count = 0
    for argument in arguments:
        if isinstance(argument, np.ndarray):
            count += argument.size
        elif isinstance(argument, tuple):
            count += _numbers(argument)
    return count
