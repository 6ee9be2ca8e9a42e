"""PETSc's hierarchy of smoothed aggregation (GAMG) under the V-cycle that one process has, too.

PETSc aggregates the nodes, makes the prolongations and the coarser matrices. Their rows are taken over in single
precision, and PETSc's own are freed. PETSc's cycle is not used, for two measured defects: it has no room for the term
of the rows of contact on every level, and takes two to three times the V-cycles without it (docs/scaling.md); its
smoothers by blocks give NaN in PETSc 3.18 where an aggregate is smaller than six rigid-body modes. A user who sets
options of PETSc's cycle (`-lacsolver_mg_...`) gets that one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear.cycle import Cycle, Halo, Level, jacobi
from lacsolver.linear.halo import Everywhere, Processes, Rows, SharedHalo, SharedTeam
from lacsolver.linear.petsc import PREFIX, PetscCycle, petsc_errors, set_up

#: options of PETSc that are about its cycle
_OF_THE_CYCLE = ("mg_", "pc_mg_")


def gamg_cycle(PETSc: Any, A: Any, modes: Floats, processes: Processes) -> Cycle | PetscCycle:
    """Return the V-cycle of a matrix of `petsc_matrix`, which is destroyed; modes (n_own, r): rigid-body modes.

    It is PETSc's own if PETSc makes one level only, or where its options are about its cycle.
    """
    asked = any(name.startswith(_OF_THE_CYCLE) for name in PETSc.Options(PREFIX).getAll())
    with petsc_errors():
        pc = set_up(PETSc, A, modes, "gamg")
        if asked or pc.getMGLevels() < 2:
            return PetscCycle(pc, "gamg")
        matrices, prolongations = _copies(pc)
        pc.destroy()
        A.destroy()
    return _cycle(matrices, prolongations, processes)


class _Copy(NamedTuple):
    """Own rows (indptr, indices, data) of a matrix of PETSc, with columns in the whole matrix.

    `blocks`: unknowns of a node of the rows and of the columns; `starts` (processes + 1,): first node of the columns of
    each process.
    """

    csr: tuple[Ints, Ints, Floats]
    blocks: tuple[int, int]
    starts: Ints

    @staticmethod
    def of(A: Any, columns: Any) -> _Copy:
        """Copy a matrix, whose columns are numbered as those of a square one."""
        b = columns.getBlockSize()
        starts = np.asarray(columns.getOwnershipRanges(), np.int64) // b
        return _Copy(A.getValuesCSR(), (A.getBlockSizes()[0], b), starts)

    @property
    def width(self) -> int:
        """Number of columns of the whole matrix."""
        return int(self.blocks[1] * self.starts[-1])

    def rows(self, processes: Processes) -> tuple[bsr_array, Halo]:
        """Return the rows in blocks, and the halo of their columns."""
        made = Rows.of(self.csr, self.blocks, self.starts, processes.rank)
        return made.A, SharedHalo(processes, self.starts, made.ghosts, self.blocks[1])

    def rows_everywhere(self, processes: Processes) -> tuple[bsr_array, Halo]:
        """Return the rows in blocks, for vectors of all columns on each process."""
        indptr, indices, data = self.csr
        made = csr_array((data, indices, indptr), shape=(len(indptr) - 1, self.width))
        return bsr_array(made.tobsr(self.blocks)), Everywhere(processes, self.blocks[1])

    def diagonal(self, processes: Processes) -> Floats:
        """Return the sum of the diagonal entries of all processes, and their number."""
        indptr, indices, data = self.csr
        first = self.blocks[1] * self.starts[processes.rank]
        row = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr)) + first
        return processes.total(np.array([data[row == indices].sum(), len(indptr) - 1.0]))

    def whole(self, processes: Processes) -> Floats:
        """Return a small square matrix, whole on each process."""
        indptr, indices, data = self.csr
        first = self.blocks[1] * self.starts[processes.rank]
        last = self.width - first - len(indptr) + 1
        ends = np.concatenate([np.zeros(first, np.int64), indptr, np.full(last, indptr[-1])])
        own = csr_array((data, indices, ends), shape=(self.width, self.width))
        return np.asarray(processes.add_matrices(own, (False, False)).toarray())


def _copies(pc: Any) -> tuple[list[_Copy], list[_Copy]]:
    """Return the matrices of PETSc's levels, from the finest to the coarsest, and the prolongations between them."""
    numbers = range(pc.getMGLevels() - 1, -1, -1)
    matrices = [pc.getMGSmoother(k).getOperators()[0] for k in numbers]
    between = [pc.getMGInterpolation(k) for k in numbers[:-1]]
    prolongations = [_Copy.of(P, below) for P, below in zip(between, matrices[1:], strict=True)]
    return [_Copy.of(A, A) for A in matrices], prolongations


def _cycle(matrices: list[_Copy], prolongations: list[_Copy], processes: Processes) -> Cycle:
    """Return the cycle of matrices, which are released one by one, and of the prolongations between them."""
    team, levels = SharedTeam(processes), list[Level]()
    total, count = matrices[0].diagonal(processes)
    unit = float(count / total)
    while len(matrices) > 1:
        K, halo = matrices.pop(0).rows(processes)
        inverse, largest = jacobi(K, team, halo)
        below = prolongations.pop(0)
        P, coarse = below.rows(processes) if prolongations else below.rows_everywhere(processes)
        R = bsr_array(P.T.tobsr(P.blocksize[::-1]))
        levels.append(Level.of(K, R, P, inverse / largest, unit, (halo, coarse)))
    return Cycle(levels, matrices[0].whole(processes) * unit, unit, team)
