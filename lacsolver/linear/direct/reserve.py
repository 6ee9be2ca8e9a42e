"""The solver that takes the place of rslab where that cannot be loaded, or fails: SciPy's SuperLU, said once."""

from __future__ import annotations

import warnings
from functools import cache

from lacmesh.errors import LacmeshWarning


def superlu_serves(what: str, why: str, advice: str) -> str:
    """Return the sentence that SuperLU serves, and warn of it the first time.

    `what` happened to rslab, `why`, and what to do about it.
    """
    first = f"rslab, which comes with lacmesh, {what} ({why})"
    message = f"{first}: SciPy's SuperLU serves, which is many times slower for large models; {advice}"
    warn_once(message)
    return message


@cache
def warn_once(message: str) -> None:
    """Warn, but of the same only once in a process."""
    warnings.warn(LacmeshWarning(message), stacklevel=3)
