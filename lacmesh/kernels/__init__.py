"""Kernels: loops over arrays that run compiled if there is enough work, and as plain Python if there is not.

Compiling a kernel takes seconds, loading numba and the compiled code takes tenths of a second. For a few faces plain
Python is faster, with the same results up to rounding. So a kernel starts as plain Python, and is compiled once its
work in this process (the number of entries in its arrays, summed over the calls) passes a limit: a low limit if it was
compiled before and is cached on the disk (`kept`), a lower one if numba is loaded already because another kernel is in
use, and a high one if it must be compiled first.

A kernel is called with positional arguments, and calls other kernels by their names: they are compiled into it, or run
as plain Python with it. With NUMBA_DISABLE_JIT=1, which is set for debugging, all kernels run as plain Python.
"""

from __future__ import annotations

import functools
import hashlib
import math
import os
import re
import sys
from collections.abc import Callable, Iterator
from threading import Lock
from types import CodeType, FunctionType, ModuleType
from typing import Any, ClassVar

import numpy as np

from lacmesh.kernels.kept import has

#: numbers in the arrays of a kernel's calls so far, beyond which it goes on compiled: where it is kept on the disk and
#: others are in use, where it is the first, and where it has to be compiled first. As it stands, a number takes one to
#: ten microseconds; to load a kernel takes 2 to 15 ms, numba 200
ADDED_FROM, LOADED_FROM, COMPILED_FROM = 1_000, 20_000, 500_000


class Kernel:
    """A function of arrays and numbers, plain and compiled. Division by zero gives inf or NaN in both, as in numpy."""

    #: every kernel of the modules that are imported, by the order of their making
    known: ClassVar[list[Kernel]] = []
    _one_at_a_time: ClassVar[Any] = Lock()

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self.__qualname__: str = function.__qualname__
        self._function: Any = function
        self._done = 0
        self.compiled: Any = None
        Kernel.known.append(self)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function, compiled or plain, and return its result."""
        if self.compiled is None:
            self._done += _numbers(arguments)
            if not self._is_worth_compiling():
                return self.py_func(*arguments)
            self.compile()
        return self.compiled(*arguments)

    def py_func(self, *arguments: Any) -> Any:
        """Call the plain function with numpy's numbers, which allow division by zero, and without numpy's warnings."""
        with np.errstate(all="ignore"):
            return self.plain(*(np.float64(a) if type(a) is float else a for a in arguments))

    def compile(self) -> Any:
        """Switch to the compiled form and return it: a numba dispatcher, which compiles for the argument types."""
        from lacmesh.kernels.compiled import outer

        with Kernel._one_at_a_time:
            if self.compiled is None:
                self.compiled = outer(self.linked(lambda other: other.inner), self.key)
        return self.compiled

    @functools.cached_property
    def inner(self) -> Any:
        """The compiled form for kernels that call this one."""
        from lacmesh.kernels.compiled import inner

        return inner(self.linked(lambda other: other.inner))

    @functools.cached_property
    def plain(self) -> Callable[..., Any]:
        """The plain function, which calls the plain form of other kernels. Square roots are numpy's: NaN below zero."""
        return self.linked(lambda other: other.plain, {math: np})

    @functools.cached_property
    def key(self) -> str:
        """Cache key: the name and a hash of the code, the globals it uses, and those of the kernels it calls."""
        stamp = hashlib.sha256(repr(sys.version_info).encode())
        for part in self.parts():
            stamp.update(part)
        name = re.sub(r"[^\w.]", "", f"{self.__module__}.{self.__qualname__}")  # of a file
        return f"{name}.{sys.implementation.cache_tag}.{stamp.hexdigest()[:24]}"

    def linked(self, form: Callable[[Kernel], Any], instead: dict[Any, Any] | None = None) -> Callable[..., Any]:
        """Copy of the function that refers to the given form of each kernel it uses, and to the globals `instead`."""
        named: dict[str, Any] = {"__name__": self.__module__, "__builtins__": __builtins__}
        for name, value in self.named():
            named[name] = form(value) if isinstance(value, Kernel) else value
            if isinstance(value, ModuleType) and instead:
                named[name] = instead.get(value, value)
        old = self._function
        made = FunctionType(old.__code__, named, old.__name__, old.__defaults__, old.__closure__)
        functools.update_wrapper(made, old)
        del made.__wrapped__  # type: ignore[attr-defined]
        return made

    def parts(self) -> Iterator[bytes]:
        """Yield everything on which the compiled form depends, as bytes."""
        words = self._function.__doc__  # which changes nothing
        for code in _codes(self._function.__code__):
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
        every = self._function.__globals__
        for code in _codes(self._function.__code__):
            yield from ((name, every[name]) for name in code.co_names if name in every)

    def _is_worth_compiling(self) -> bool:
        least = ADDED_FROM if any(k.compiled for k in Kernel.known) else LOADED_FROM
        if self._done <= least or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
            return False
        return self._done > COMPILED_FROM or has(self.key)


def kernel(function: Callable[..., Any]) -> Any:
    """Make a kernel of a function of arrays, numbers, and tuples of them, in the Python that numba compiles."""
    return Kernel(function)


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
