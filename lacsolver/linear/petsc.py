"""PETSc as a preconditioner of a matrix that is distributed over processes by whole nodes.

`gamg` (PETSc's smoothed aggregation) and `hypre` (BoomerAMG) apply one V-cycle, `mumps` a factorisation. Options of
PETSc with the prefix `lacsolver_`, from PETSC_OPTIONS, go before those that are set here. GAMG's cycle is smoothed by
Chebyshev's polynomial with the inverse diagonal; its smoothers by blocks give NaN in PETSc 3.18 where an aggregate is
smaller than six rigid-body modes. BoomerAMG truncates its interpolation. It does not coarsen its first level
aggressively, which is faster where it converges, but with 4 processes it did not on three models of warped and
quadratic cells.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.errors import LinearError

#: PETSc's code for a lack of memory (PETSC_ERR_MEM)
_NO_MEMORY = 55
#: prefix of the options of PETSc that apply here
PREFIX = "lacsolver_"
_OPTIONS: dict[str, dict[str, str | float]] = {
    "gamg": {
        "pc_type": "gamg",
        "pc_gamg_type": "agg",
        "pc_gamg_agg_nsmooths": 1,
        "pc_gamg_threshold": 0.01,
        "mg_levels_ksp_type": "chebyshev",
        "mg_levels_pc_type": "jacobi",
        "mg_levels_ksp_max_it": 2,
    },
    "hypre": {
        "pc_type": "hypre",
        "pc_hypre_type": "boomeramg",
        "pc_hypre_boomeramg_strong_threshold": 0.5,
        "pc_hypre_boomeramg_coarsen_type": "HMIS",
        "pc_hypre_boomeramg_interp_type": "ext+i",
        "pc_hypre_boomeramg_P_max": 4,
    },
    "mumps": {"pc_type": "lu", "pc_factor_mat_solver_type": "mumps"},
}


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


def petsc_matrix(PETSc: Any, comm: Any, K: csr_array, number: Ints, block: int) -> Any:
    """Return PETSc's matrix of the rows K (n_own, n) of the own unknowns, in blocks of `block`; PETSc copies them.

    `number` (n,): the index in the whole matrix of each column of K.
    """
    column = number.astype(PETSc.IntType)[K.indices]
    placed = csr_array((K.data, column, K.indptr), shape=(K.shape[0], int(number.max(initial=-1)) + 1))
    placed.sort_indices()
    rows = (placed.indptr.astype(PETSc.IntType), placed.indices.astype(PETSc.IntType), placed.data)
    size = (K.shape[0], PETSc.DETERMINE)
    with petsc_errors():
        return PETSc.Mat().createAIJ((size, size), bsize=block, csr=rows, comm=comm)


def set_up(PETSc: Any, A: Any, modes: Floats, backend: str) -> Any:
    """Return PETSc's preconditioner of a matrix of `petsc_matrix`; modes (n_own, r): rigid-body modes."""
    pc, comm = PETSc.PC().create(A.getComm()), A.getComm()
    A.setNearNullSpace(PETSc.NullSpace().create(vectors=_orthonormal(A.createVecRight(), modes), comm=comm))
    options = PETSc.Options(PREFIX)
    ours = {name: value for name, value in _OPTIONS[backend].items() if not options.hasName(name)}
    for name, value in ours.items():
        options[name] = value
    try:
        pc.setOptionsPrefix(PREFIX)
        pc.setOperators(A)
        pc.setFromOptions()
        pc.setUp()
    finally:  # another backend of the same process has options of its own
        for name in ours:
            options.delValue(name)
    return pc


class PetscCycle:
    """One application of PETSc's preconditioner `pc` to a residual at this process's own nodes."""

    def __init__(self, pc: Any, backend: str) -> None:
        self._pc, self._backend = pc, backend
        self._x, self._b = pc.getOperators()[0].createVecs()

    def __call__(self, r: Floats) -> NDArray[np.floating]:
        """Return an approximation of K^-1 r (n_own,). Raises LinearError on all processes if it is not finite."""
        self._b.array = r
        with petsc_errors():
            self._pc.apply(self._b, self._x)
        if not np.isfinite(self._x.norm()):
            message = f"PETSc's {self._backend} gives numbers that are not finite"
            raise LinearError(f'{message}; take another [solver] backend, "hypre" or "mumps"')
        return self._x.array.copy()


def _orthonormal(like: Any, modes: Floats) -> list[Any]:
    """Return modes as orthonormal vectors of PETSc; those that depend on others are left out."""
    basis: list[Any] = []
    for column in modes.T:
        vector = like.duplicate()
        vector.array = column
        before = vector.norm()
        for _ in range(2):
            for other in basis:
                vector.axpy(-vector.dot(other), other)
        if vector.norm() > 1e-10 * before > 0:
            vector.normalize()
            basis.append(vector)
    return basis
