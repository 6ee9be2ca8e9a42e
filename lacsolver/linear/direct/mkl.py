"""Intel's MKL as a shared library, found where pip or the system installed it."""

from __future__ import annotations

import ctypes
import re
from contextlib import suppress
from ctypes.util import find_library
from functools import cache
from importlib import metadata

_NAME = re.compile(r"libmkl_rt\.so[.\d]*|libmkl_rt[.\d]*\.dylib|mkl_rt[.\d]*\.dll")


@cache
def library() -> ctypes.CDLL | None:
    """Load and return the library mkl_rt; None if it is not installed."""
    for path in _candidates():
        with suppress(OSError):
            return ctypes.CDLL(path)
    return None


def _candidates() -> list[str]:
    found = []
    with suppress(metadata.PackageNotFoundError):
        files = metadata.files("mkl") or []
        found = [str(f.locate()) for f in files if _NAME.fullmatch(f.name)]
    elsewhere = find_library("mkl_rt")
    return [*found, elsewhere] if elsewhere else found
