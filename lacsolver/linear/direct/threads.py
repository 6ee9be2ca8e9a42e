"""Limit of the number of cores that BLAS and OpenMP libraries use while a backend runs."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import Any


@cache
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def limited(threads: int) -> AbstractContextManager[Any]:
    """Return a context in which BLAS and OpenMP libraries loaded before the first call use `threads` cores."""
    return _controller().limit(limits=threads)
