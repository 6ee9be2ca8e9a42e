"""Kernels: loops over arrays that run compiled where there is enough to do, and as they stand where there is not.

Compiling a kernel takes seconds, loading numba and what is compiled takes tenths of a second. A few faces take less
as plain Python, with the same results to rounding. So a kernel starts as it stands, and goes on compiled once the work
it was given in this process (the numbers in its arrays, call by call) passes a limit: a low one where it was compiled
before and is kept on the disk (`kept`), lower still once another is in use, which loaded numba, and a high one where it
has to be compiled first.

A kernel is called by position, and calls others by their names: they are compiled into it, or run as they stand with
it. With NUMBA_DISABLE_JIT=1, which people set to debug, all run as they stand, whatever there is to do.
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
ADDED_FROM, LOADED_FROM, COMPILED_FROM = 1_000, 5_000, 500_000


class Kernel:
    """A function of arrays and numbers, in its two forms. A division by zero is inf or NaN in either, as in numpy."""

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
        """What the function returns."""
        if self.compiled is None:
            self._done += _numbers(arguments)
            if not self._is_worth_compiling():
                return self.py_func(*arguments)
            self.compile()
        return self.compiled(*arguments)

    def py_func(self, *arguments: Any) -> Any:
        """The function as it stands, with numpy's numbers, which divide by zero, and without numpy's warnings."""
        with np.errstate(all="ignore"):
            return self.plain(*(np.float64(a) if type(a) is float else a for a in arguments))

    def compile(self) -> Any:
        """Use its compiled form from now on, and return it: numba's, which compiles for what it is given."""
        from lacmesh.kernels.compiled import outer

        with Kernel._one_at_a_time:
            if self.compiled is None:
                self.compiled = outer(self.linked(lambda other: other.inner), self.key)
        return self.compiled

    @functools.cached_property
    def inner(self) -> Any:
        """Its compiled form for kernels that call it."""
        from lacmesh.kernels.compiled import inner

        return inner(self.linked(lambda other: other.inner))

    @functools.cached_property
    def plain(self) -> Callable[..., Any]:
        """The function as it stands, which calls others as they stand. Roots are numpy's: NaN below zero."""
        return self.linked(lambda other: other.plain, {math: np})

    @functools.cached_property
    def key(self) -> str:
        """Its name and all that its compiled form hangs on: its code, what it names, and those of kernels it calls."""
        stamp = hashlib.sha256(repr(sys.version_info).encode())
        for part in self.parts():
            stamp.update(part)
        name = re.sub(r"[^\w.]", "", f"{self.__module__}.{self.__qualname__}")  # of a file
        return f"{name}.{sys.implementation.cache_tag}.{stamp.hexdigest()[:24]}"

    def linked(self, form: Callable[[Kernel], Any], instead: dict[Any, Any] | None = None) -> Callable[..., Any]:
        """The function with a form of each kernel that it names, and other things `instead` of some."""
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
        """What its compiled form hangs on, as bytes."""
        for code in _codes(self._function.__code__):
            yield code.co_code
            yield repr([c for c in code.co_consts if not isinstance(c, CodeType)]).encode()
        for name, value in self.named():
            yield name.encode()
            if isinstance(value, Kernel):
                yield from value.parts()
            elif isinstance(value, np.ndarray):
                yield f"{value.dtype} {value.shape}".encode() + value.tobytes()
            else:
                yield repr(getattr(value, "__qualname__", None) or getattr(value, "__name__", value)).encode()

    def named(self) -> Iterator[tuple[str, Any]]:
        """The globals that it names."""
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
    """A function's code and those of the functions inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _numbers(arguments: Any) -> int:
    """How many numbers there are in the arrays among some arguments."""
    count = 0
    for argument in arguments:
        if isinstance(argument, np.ndarray):
            count += argument.size
        elif isinstance(argument, tuple):
            count += _numbers(argument)
    return count
