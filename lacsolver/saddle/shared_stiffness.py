"""Stiffness on the unknowns of several processes, with a V-cycle or a factorisation; the counterpart of `stiffness`.

Each process has the rows of K at its own nodes. Displacements are known at all nodes of its share, forces at its own.
The free motions of rigid bodies are unknowns that all processes have; their rows are sums of those of all processes,
and the cycle on the other unknowns is completed by eliminating them (`bordered`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array, diags_array

from lacmesh.mesh import Floats, Ints
from lacsolver.constraints import Constraints
from lacsolver.constraints.rigid import moments
from lacsolver.linear import MULTIGRID_ABOVE, Matrix, backends, choose
from lacsolver.linear.multigrid.aggregation import aggregated
from lacsolver.linear.multigrid.cycle import Cycle, Team
from lacsolver.linear.multigrid.factor import Hierarchy
from lacsolver.linear.multigrid.halo import BlockRows, SharedHalo
from lacsolver.linear.petsc import PetscCycle, petsc_errors, petsc_matrix, set_up
from lacsolver.linear.vectors import Vectors
from lacsolver.problem.rigid_modes import centres
from lacsolver.saddle.bordered import bordered
from lacsolver.saddle.node_blocks import add_to_diagonal, only_rows, submatrix
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.stiffness import embed, leading_unknowns
from lacsolver.space.space import Space


class SharedStiffness(Operator):
    """Rows of K (n, n) at the own unknowns of this process, and a hierarchy with a cycle."""

    iterative = True

    def __init__(
        self, matrix: Matrix, R: NDArray[np.floating], constraints: Constraints,
        hierarchy: Hierarchy[Cycle | PetscCycle], vectors: Vectors, spring: NDArray[np.floating] | None = None,
        definite: bool = True,
    ) -> None:  # fmt: skip
        super().__init__(matrix, R, spring)
        self.constraints, self.hierarchy, self.vectors, self.definite = constraints, hierarchy, vectors, definite

    @cached_property
    def scaling(self) -> NDArray[np.floating]:
        """Diagonal (n,) of K with its springs, at all unknowns; 1 where it is 0."""
        d = self.matrix.diagonal()
        if isinstance(self.matrix, csr_array):
            d = self.vectors.summed(d + (0.0 if self.spring is None else self.spring))
        else:
            d = d[self.constraints.free]
        d = self.constraints.updated(np.where(d == 0, 1.0, d))
        return np.where(d == 0, 1.0, d)

    def apply(self, q: Floats) -> NDArray[np.floating]:
        """Return K q (n,) at the own unknowns."""
        if isinstance(self.matrix, csr_array):
            return self.vectors.summed(np.asarray(self.matrix @ q))
        Kq = np.asarray(self.matrix @ (self.constraints.T @ q))[self.constraints.free]
        return Kq if self.spring is None else Kq - self.spring * q

    def _total(self, A: csr_array) -> csr_array:
        return self.constraints.space.share.total_matrix(A)

    def _submatrix(self, unknowns: Ints) -> csr_array:
        assert self.constraints.own is not None
        own = (self.constraints.own[unknowns] | (unknowns >= self.constraints.n_nodal)).astype(float)
        if isinstance(self.matrix, csr_array):
            return csr_array(diags_array(own) @ self.matrix[unknowns][:, unknowns])
        K = submatrix(self.matrix, self.constraints.free[unknowns])
        return K if self.spring is None else csr_array(K - diags_array(own * self.spring[unknowns]))

    def cycle(self, f: Floats) -> NDArray[np.floating]:
        """Return an approximation of K^-1 f (n,) at all unknowns."""
        return self._plain(f)

    @cached_property
    def _plain(self) -> Callable[[Floats], NDArray[np.floating]]:
        return self._with_motions(self.hierarchy.cycle)

    def cycle_with_rows(self, B: csr_array, weights: Floats) -> Callable[[Floats], NDArray[np.floating]] | None:
        """Return f -> an approximation of (K + B^T W B)^-1 f, one V-cycle; None if the backend has none."""
        cycle = self.hierarchy.cycle
        if isinstance(cycle, PetscCycle):
            return None
        rows = self._rows_of(B, lambda B: cycle.on_levels(self._blocks_of(B)))
        return self._with_motions(cycle.with_rows(rows, weights), B, weights)

    def _blocks_of(self, B: csr_array) -> bsr_array:
        """Return rows B at the unknowns of own nodes, as blocks."""
        space, nodal = self.constraints.space, self.constraints.at_nodes
        assert space.share.own is not None
        own = space.dofs(np.flatnonzero(space.share.own)).ravel()
        return bsr_array(csr_array((B[:, : nodal.n_q] @ nodal.T.T).tocsc()[:, own]).tobsr((1, space.dim)))

    def _with_motions(
        self, cycle: Callable[[Floats], Floats], B: csr_array | None = None, weights: Floats | None = None
    ) -> Callable[[Floats], NDArray[np.floating]]:
        """Return a cycle on all unknowns, with rows B and their weights, from one on displacements of own nodes."""
        c = self.constraints

        def on_nodal(f: Floats) -> NDArray[np.floating]:
            return self._on_nodes(cycle, f)

        if c.n_nodal == c.n_q:
            return on_nodal
        K = self.K if self.spring is None else csr_array(self.K + diags_array(self.spring))
        return bordered(on_nodal, K, c.n_nodal, self.vectors, B, weights)

    def _on_nodes(self, apply: Callable[[Floats], Floats], f: Floats) -> NDArray[np.floating]:
        """Apply an operator on the unknowns of own nodes to forces f (n_nodal,); return displacements of all nodes."""
        space, nodal = self.constraints.space, self.constraints.at_nodes
        u = np.zeros((space.mesh.n_nodes, space.dim))
        made = apply(space.own(np.asarray(nodal.T @ f)).ravel())
        u[space.share.own] = made.reshape(-1, space.dim)
        return np.asarray(nodal.T.T @ space.updated(u.ravel()))

    def _record(self, use: str, cycles: int, decades: float) -> None:
        self.hierarchy.record_convergence(use, cycles, decades)


class SharedFactors:
    """Preconditions matrices one after the other, see `stiffness.FactorCache`.

    `backend`: multigrid, or gamg, hypre or mumps of PETSc. `note`: "", as none takes the place of another.
    """

    note = ""

    def __init__(self, R: NDArray[np.floating], backend: str, constraints: Constraints, vectors: Vectors) -> None:
        self._R, self._backend, self._constraints, self._vectors = R, backend, constraints, vectors
        self._kept: Hierarchy[Cycle | PetscCycle] | None = None

    @property
    def on_nodes(self) -> bool:
        """True if `factorise` takes K as blocks of whole nodes, too, for multigrid."""
        return self._constraints.is_selection and self._chosen == "multigrid"

    def forget(self) -> None:
        """Drop the cycle: the next matrix is not similar to the last one."""
        self._kept = None

    def factorise(self, K: Matrix, definite: bool = True) -> SharedStiffness:
        """Precondition a symmetric K, regularised by springs; one that may be indefinite by a factorisation.

        K (n, n), or blocks of the unknowns of all nodes of the share, in which it is embedded (`on_nodes`): they are
        regularised in place, and their rows of own nodes are the only copy that is kept.
        """
        constraints, share = self._constraints, self._constraints.space.share
        backend, spring = self._chosen if definite else "mumps", None
        if isinstance(K, bsr_array):
            spring = self._springs(K.diagonal()[constraints.free])
            if spring is not None:
                add_to_diagonal(K, constraints.T @ spring)
            assert share.own is not None
            K = rows = only_rows(K, share.own)
        else:
            spring = self._springs(K.diagonal())
            rows = K if spring is None else csr_array(K + diags_array(spring))
        hierarchy = self._kept
        if hierarchy is None or hierarchy.is_stale or backend == "mumps":
            hierarchy = Hierarchy(_cycle(rows, constraints, backend))
            self._kept = None if backend == "mumps" else hierarchy
        return SharedStiffness(K, self._R, constraints, hierarchy, self._vectors, spring, definite)

    def _springs(self, diagonal: Floats) -> NDArray[np.floating] | None:
        """Return springs (n,) at as many unknowns as there are rigid-body modes, each on one process; None for none."""
        if not self._R.shape[1]:
            return None
        c, spring = self._constraints, np.zeros(len(diagonal))
        assert c.own is not None
        spring[leading_unknowns(self._R, c.common)] = _mean(diagonal[: c.n_nodal], c.at_nodes)
        return np.asarray(spring * c.own)

    @cached_property
    def _chosen(self) -> str:
        """The backend; for `auto` a factorisation of small and of plane models, else multigrid."""
        if self._backend == "multigrid":
            return choose("multigrid", 0).name
        if self._backend != "auto":
            return self._backend
        space, own = self._constraints.space, self._constraints.own
        assert own is not None
        small = space.share.total(np.array(own.sum())) < MULTIGRID_ABOVE
        if space.dim == 2 or small:
            return "mumps"
        return "multigrid" if backends()["multigrid"].installed else "gamg"


def _mean(diagonal: Floats, constraints: Constraints) -> float:
    """Return the mean magnitude of a diagonal over all own unknowns; 1 for 0."""
    assert constraints.own is not None
    own = np.abs(diagonal[constraints.own])
    total, count = constraints.space.share.total(np.array([own.sum(), len(own)]))
    return float(total / max(count, 1.0)) or 1.0


def _cycle(K: Matrix, constraints: Constraints, backend: str) -> Cycle | PetscCycle:
    """Return a cycle of T K T^T on the nodal unknowns, with the mean diagonal of K in what T leaves out.

    K: on the constrained unknowns, or as blocks of all nodes of the share, of which others than own ones are empty.
    """
    if isinstance(K, bsr_array):
        return _aggregated(K, constraints)
    n, nodal, space = constraints.n_nodal, constraints.at_nodes, constraints.space
    assert space.share.own is not None
    own = space.dofs(np.flatnonzero(space.share.own)).ravel()
    rows = _own_rows(K if n == K.shape[0] else csr_array(K[:n, :n]), nodal, own)
    if backend != "multigrid":
        return _petsc_cycle(rows, nodal, backend)
    at = np.flatnonzero(space.share.own)
    near = csr_array(space.neighbours[at][:, at]) if constraints.equations else None
    return _aggregated(bsr_array(rows.tobsr((space.dim, space.dim))), nodal, near)


def _aggregated(rows: bsr_array, constraints: Constraints, near: csr_array | None = None) -> Cycle:
    """Return the V-cycle of multigrid of the rows of own nodes, or of all nodes of the share where others are empty.

    `near` (own nodes, own nodes): nonzero for nodes of one cell, None where all that K couples are.
    """
    share = constraints.space.share
    assert share.own is not None and share.number is not None
    length = np.diff(rows.indptr)
    length = length[share.own] if len(length) == len(share.own) else length
    K, halo = SharedHalo.of_rows(BlockRows(length, share.number[rows.indices], rows.data), share)
    return aggregated(K, _own_modes(constraints), Team(1, share), halo, near)


def _own_modes(constraints: Constraints) -> NDArray[np.floating]:
    """Return the rigid-body modes at the unknowns of own nodes, without what T leaves out."""
    space, T = constraints.space, constraints.T
    assert space.share.own is not None
    modes = T @ (T.T @ rigid_body_modes(space))
    return np.asarray(modes[space.dofs(np.flatnonzero(space.share.own)).ravel()])


def _petsc_cycle(rows: csr_array, constraints: Constraints, backend: str) -> PetscCycle:
    """Return a preconditioner of PETSc for own rows (n_own, n_dof)."""
    from lacsolver.distributed.launch import import_petsc

    petsc, space, share = import_petsc(), constraints.space, constraints.space.share
    assert share.number is not None
    with petsc_errors():
        A = petsc_matrix(petsc, share.mpi, rows, space.dofs(share.number).ravel(), space.dim)
        return PetscCycle(set_up(petsc, A, _own_modes(constraints), backend), backend)


def _own_rows(K: csr_array, constraints: Constraints, own: Ints) -> csr_array:
    """Return the rows of the unknowns `own` (n_own,) of T K T^T, with the mean diagonal of K in what T leaves out."""
    space, T, mean = constraints.space, constraints.T, _mean(K.diagonal(), constraints)
    if constraints.is_selection:
        K = embed(K, constraints.free, space.n_dof, mean)
        return K if len(own) == space.n_dof else csr_array(K[own])
    T_own = csr_array(T[own])
    one = csr_array((np.ones(len(own)), (np.arange(len(own)), own)), shape=(len(own), space.n_dof))
    return csr_array(T_own @ K @ T.T + mean * (one - T_own @ T.T))


def rigid_body_modes(space: Space) -> NDArray[np.floating]:
    """Return the rigid-body modes (n_dof, r) of all bodies in the same columns, about each body's own centre."""
    body = space.bodies
    centre, _ = centres(space, body)
    arm = np.where(body[:, None] >= 0, space.local.points - centre[body], 0.0)
    straight = np.tile(np.eye(space.dim), (len(arm), 1, 1))
    modes = np.concatenate([straight, moments(space.dim, arm) / (space.extent or 1.0)], axis=2)
    return modes.reshape(space.n_dof, -1)
