"""Compiled kernels: numba, with the settings that all of them share.

A kernel is compiled when it is first called, for some seconds, and kept on the disk beside its module (or in the folder
that `NUMBA_CACHE_DIR` names). The first one that has to be says so to the logger `lacmesh`, which the command prints.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from numba import njit
from numba.core import event


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function of arrays and numbers. A division by zero is inf or NaN in it, as in numpy."""
    try:
        made = njit(function, cache=True, nogil=True, error_model="numpy")
    except RuntimeError:  # no folder to keep it in can be written: it is compiled each time
        return njit(function, nogil=True, error_model="numpy")
    keep = made._cache.save_overload

    def keep_if_it_can(*arguments: Any) -> None:
        with suppress(OSError):  # a full disk: it is compiled again the next time
            keep(*arguments)

    made._cache.save_overload = keep_if_it_can
    return made


class _Compiling(event.Listener):
    """Hears of what is compiled, not of what is found on the disk."""

    def __init__(self) -> None:
        self.said = False

    def on_start(self, event: Any) -> None:
        if not self.said:
            self.said = True
            logging.getLogger("lacmesh").info("compiling what this needs: some seconds, the first time")

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Compiling())  # type: ignore[no-untyped-call]
