"""PETSc's hierarchy of smoothed aggregation (GAMG) under the V-cycle that one process has, too.

PETSc aggregates the nodes, makes the prolongations and the coarser matrices. Their rows are taken over in single
precision, and PETSc's own are freed. PETSc's cycle is not used, for two measured defects: it has no room for the term
of the rows of contact on every level, and takes two to three times the V-cycles without it (docs/scaling.md); its
smoothers by blocks give NaN in PETSc 3.18 where an aggregate is smaller than six rigid-body modes. A user who sets
options of PETSc's cycle (`-lacsolver_mg_...`) gets that one.
"""

from __future__ import annotations

from typing import Any

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
        made = _taken_over(pc, SharedTeam(processes), processes)
        pc.destroy()
        A.destroy()
    return made


def _taken_over(pc: Any, team: SharedTeam, processes: Processes) -> Cycle:
    """Return the cycle of PETSc's matrices and prolongations, from the finest level to the coarsest."""
    matrices = [pc.getMGSmoother(k).getOperators()[0] for k in reversed(range(pc.getMGLevels()))]
    K, halo = _rows(matrices[0], processes)
    diagonal, size = matrices[0].getDiagonal().sum(), matrices[0].getSize()[0]
    levels, unit = [], size / diagonal
    for k in range(1, len(matrices)):
        inverse, largest = jacobi(K, team, halo)
        last = k + 1 == len(matrices)
        P, coarse = _prolongation(pc.getMGInterpolation(len(matrices) - k), matrices[k], processes, last)
        R = bsr_array(P.T.tobsr(P.blocksize[::-1]))
        levels.append(Level.of(K, R, P, inverse / largest, unit, (halo, coarse)))
        if not last:
            K, halo = _rows(matrices[k], processes)
    return Cycle(levels, _whole(matrices[-1], team) * unit, unit, team)


def _starts(A: Any) -> Ints:
    """Return the first node of each process, and the number of nodes (processes + 1,), of a square matrix."""
    return np.asarray(A.getOwnershipRanges(), np.int64) // A.getBlockSize()


def _rows(A: Any, processes: Processes) -> tuple[bsr_array, Halo]:
    """Return the own rows of a square matrix, and the halo of its columns."""
    starts, b = _starts(A), A.getBlockSize()
    rows = Rows.of(A.getValuesCSR(), (b, b), starts, processes.rank)
    return rows.A, SharedHalo(processes, starts, rows.ghosts, b)


def _prolongation(P: Any, below: Any, processes: Processes, last: bool) -> tuple[bsr_array, Halo]:
    """Return the own rows of a prolongation from the level `below`, whose vectors are whole if it is the `last`."""
    indptr, indices, data = P.getValuesCSR()
    blocks = P.getBlockSizes()[0], below.getBlockSize()
    if last:
        whole = csr_array((data, indices, indptr), shape=(len(indptr) - 1, below.getSize()[0]))
        return bsr_array(whole.tobsr(blocks)), Everywhere(processes, blocks[1])
    starts = _starts(below)
    rows = Rows.of((indptr, indices, data), blocks, starts, processes.rank)
    return rows.A, SharedHalo(processes, starts, rows.ghosts, blocks[1])


def _whole(A: Any, team: SharedTeam) -> Floats:
    """Return a small square matrix, whole on each process."""
    indptr, indices, data = A.getValuesCSR()
    first, last = A.getOwnershipRange()
    n = A.getSize()[0]
    ends = np.concatenate([np.zeros(first, np.int64), indptr, np.full(n - last, indptr[-1])])
    return np.asarray(team.total_matrix(csr_array((data, indices, ends), shape=(n, n))).toarray())
