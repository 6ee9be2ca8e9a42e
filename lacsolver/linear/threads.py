"""How many cores the BLAS and OpenMP libraries of a backend use, for as long as it runs."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import Any


@cache
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def limited(threads: int) -> AbstractContextManager[Any]:
    """A block in which the libraries that were loaded at its first use take so many cores."""
    return _controller().limit(limits=threads)
