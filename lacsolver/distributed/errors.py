"""Errors of PETSc as errors of linear systems."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from lacsolver.linear.errors import LinearError

#: PETSc's code for a lack of memory (PETSC_ERR_MEM)
_NO_MEMORY = 55


@contextmanager
def petsc_errors() -> Iterator[None]:
    """Turn an error of PETSc into a LinearError, or into a MemoryError where memory ran out.

    An iteration that does not converge is no error of PETSc: ask `KSP.getConvergedReason`.
    """
    from petsc4py import PETSc

    try:
        yield
    except PETSc.Error as error:
        if error.ierr == _NO_MEMORY:
            raise MemoryError from error
        words = str(error).splitlines()[-1].partition("] ")[2] or "it says no more"
        message = f"PETSc stopped with its error {error.ierr} ({words}); another [solver] backend may do"
        raise LinearError(message) from error
