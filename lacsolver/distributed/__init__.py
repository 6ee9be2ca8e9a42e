"""Distributed solution with PETSc over MPI: a run in several processes (ranks), each with a part of the model.

`run` is imported on first use, so that the start of a command imports nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lacmesh import _named

if TYPE_CHECKING:
    from lacsolver.distributed.running import run as run


def __getattr__(name: str) -> Any:
    return _named("lacsolver.distributed", name, {"run": "lacsolver.distributed.running"}, {})
