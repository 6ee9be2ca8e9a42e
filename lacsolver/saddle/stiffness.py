"""Stiffness K on the constrained unknowns of one process, regularised and factorised.

A body that only contact supports makes K singular: springs at as many unknowns as it has rigid-body modes make K
definite, and the contact loop (`schur`) ensures that they carry no force. Multigrid works on blocks of whole nodes: for
it K is embedded in the unknowns of all nodes, with multiples of identity rows for the constrained ones.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array, diags_array

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints, mask_of
from lacsolver.linear import Analysis, Backend, Factor, Matrix, analyse, choose
from lacsolver.linear.vectors import Vectors
from lacsolver.saddle.node_blocks import add_to_diagonal, submatrix
from lacsolver.saddle.operator import Operator

if TYPE_CHECKING:
    from lacsolver.linear.multigrid.cycle import RowsOnLevels
    from lacsolver.linear.multigrid.factor import MultigridAnalysis, MultigridFactor


class NodalEmbedding(NamedTuple):
    """Embedding of the unknowns q in those of all nodes.

    `free` (n_q,): indices of q among the `n_dof` unknowns; `block`: unknowns per node; `modes` (n_dof, r): rigid-body
    modes; `near` (n_nodes, n_nodes): nonzero for nodes of one cell, None where all that K couples are.
    """

    free: Ints
    n_dof: int
    block: int
    modes: NDArray[np.floating]
    near: csr_array | None = None

    def on_nodes(self, f: Floats) -> NDArray[np.floating]:
        """Return f (n_q,) at the unknowns of all nodes, 0 at others."""
        out = np.zeros(self.n_dof)
        out[self.free] = f
        return out

    def rows(self, B: csr_array) -> bsr_array:
        """Return rows B (m, n_q) as blocks of the unknowns of all nodes."""
        columns = self.free.astype(B.indices.dtype)[B.indices]
        return bsr_array(csr_array((B.data, columns, B.indptr), shape=(B.shape[0], self.n_dof)).tobsr((1, self.block)))


class Stiffness(Operator):
    """K with the factor of K and its springs, embedded by `whole` unless that is None; it solves with K, too."""

    def __init__(
        self, matrix: Matrix, factor: Factor, R: NDArray[np.floating], whole: NodalEmbedding | None = None,
        spring: NDArray[np.floating] | None = None, vectors: Vectors | None = None,
    ) -> None:  # fmt: skip
        super().__init__(matrix, R, spring)
        self.factor, self.whole = factor, whole
        self.iterative, self.vectors = factor.iterative, vectors or factor.vectors

    @cached_property
    def scaling(self) -> NDArray[np.floating]:
        """Diagonal (n,) of K with its springs; 1 where it is 0."""
        d = self.matrix.diagonal()
        if isinstance(self.matrix, csr_array):
            d = d + (0.0 if self.spring is None else self.spring)
        elif self.whole is not None:
            d = d[self.whole.free]
        return np.where(d == 0, 1.0, d)

    def apply(self, q: Floats) -> NDArray[np.floating]:
        """Return K q (n,), computed on all threads with multigrid; its round-off along R is spread over the bodies."""
        if not self.iterative:
            Kq = np.asarray(self.K @ q)
            return Kq - self._spread @ (self.R.T @ Kq)
        Kq = self._on_nodes(self._multigrid.apply, q)
        return Kq if self.spring is None else Kq - self.spring * q

    @cached_property
    def _spread(self) -> NDArray[np.floating]:
        """Forces D R (R^T D R)^-1 (n, r) of unit resultants along R, with the diagonal D of K."""
        R_D = self.R * np.abs(self.scaling)[:, None]
        return np.asarray(np.linalg.solve(self.R.T @ R_D, R_D.T).T)

    def solve(self, f: Floats) -> NDArray[np.floating]:
        """Return K^-1 f (n,); f should be in balance along R, since the springs balance the rest."""
        return self._on_nodes(self.factor.solve, f)

    def cycle(self, f: Floats) -> NDArray[np.floating]:
        """Return an approximation of K^-1 f (n,), by one V-cycle."""
        return self._on_nodes(self._multigrid.cycle, f)

    def cycle_with_rows(self, B: csr_array, weights: Floats) -> Callable[[Floats], NDArray[np.floating]]:
        """Return f -> an approximation of (K + B^T W B)^-1 f, one V-cycle: rows B (m, n), W = diag `weights` (m,)."""
        cycle = self._multigrid.hierarchy.cycle.with_rows(self._rows_of(B, self._on_levels), weights)
        return lambda f: self._on_nodes(cycle, f)

    @property
    def _multigrid(self) -> MultigridFactor:
        return cast("MultigridFactor", self.factor)

    def _on_levels(self, B: csr_array) -> RowsOnLevels:
        blocks = bsr_array(B.tobsr((1, 1))) if self.whole is None else self.whole.rows(B)
        return self._multigrid.hierarchy.cycle.on_levels(blocks)

    def _record(self, use: str, cycles: int, decades: float) -> None:
        self._multigrid.hierarchy.record_convergence(use, cycles, decades)

    def _submatrix(self, unknowns: Ints) -> csr_array:
        if isinstance(self.matrix, csr_array) or self.whole is None:
            return csr_array(self.matrix[unknowns][:, unknowns])
        K = submatrix(self.matrix, self.whole.free[unknowns])
        return K if self.spring is None else csr_array(K - diags_array(self.spring[unknowns]))

    def _on_nodes(self, apply: Callable[[Floats], Floats], f: Floats) -> NDArray[np.floating]:
        """Apply an operator to f, embedded in the unknowns of all nodes if the operator works on nodal blocks."""
        if self.whole is None:
            return np.asarray(apply(f))
        return np.asarray(apply(self.whole.on_nodes(f))[self.whole.free])


class FactorCache:
    """Factorises matrices one after the other by one backend, and reuses what it can of the one before.

    A direct backend keeps the analysis of an unchanged pattern and releases the factor before; multigrid keeps its
    hierarchy until it is stale. R (n, r): rigid-body modes that springs at r unknowns fix. `whole`: embedding in whole
    nodes, for multigrid. `vectors`: operations on the unknowns of a direct backend, None for those of its factor.
    """

    def __init__(
        self, R: NDArray[np.floating], backend: str = "auto", threads: int = 1, whole: NodalEmbedding | None = None,
        vectors: Vectors | None = None,
    ) -> None:  # fmt: skip
        self._R, self._backend, self._threads, self._whole, self._vectors = R, backend, threads, whole, vectors
        self._analyses: dict[bool, Analysis] = {}
        self._last: MultigridFactor | None = None
        self._note = ""

    @property
    def on_nodes(self) -> bool:
        """True if `factorise` takes K as blocks of whole nodes, too, for multigrid."""
        return self._whole is not None and not self._chosen.direct

    @cached_property
    def _chosen(self) -> Backend:
        return choose(self._backend, len(self._R), 0 if self._whole is None else self._whole.modes.shape[1])

    @property
    def note(self) -> str:
        """Sentence about SuperLU, where it had to take the place of rslab; "" where it had not."""
        return self._note or next((analysis.note for analysis in self._analyses.values() if analysis.note), "")

    def forget(self) -> None:
        """Drop the hierarchy of multigrid: the next matrix is not similar to the last one."""
        self._last = None

    def factorise(self, K: Matrix, definite: bool = True) -> Stiffness:
        """Factorise a symmetric K, regularised by springs; with `definite` false K may be indefinite, see `analyse`.

        K (n, n), or blocks of the unknowns of all nodes, in which it is embedded (`on_nodes`): they are regularised in
        place, and the only copy that is kept. Raises SingularError if K has other motions without energy than R.
        """
        whole = self._whole if self.on_nodes and definite else None
        if whole is not None and isinstance(K, bsr_array):
            spring = self._springs(K.diagonal()[whole.free])
            if spring is not None:
                add_to_diagonal(K, whole.on_nodes(spring))
            return Stiffness(K, self._preconditioned(K, whole), self._R, whole, spring)
        K = csr_array(K) if isinstance(K, bsr_array) else K
        spring = self._springs(K.diagonal())
        regular = K if spring is None else csr_array(K + diags_array(spring))
        if whole is None:
            return Stiffness(K, self._analysed(regular, definite), self._R, None, spring, self._vectors)
        on_nodes = bsr_array(embed(regular, whole.free, whole.n_dof).tobsr((whole.block, whole.block)))
        return Stiffness(K, self._preconditioned(on_nodes, whole), self._R, whole, spring)

    def _springs(self, diagonal: Floats) -> NDArray[np.floating] | None:
        """Return springs (n,) at as many unknowns as K of that diagonal has rigid-body modes; None if it has none."""
        if not self._R.shape[1]:
            return None
        spring = np.zeros(len(diagonal))
        spring[leading_unknowns(self._R)] = np.abs(diagonal).mean() or 1.0
        return spring

    def _preconditioned(self, K: bsr_array, whole: NodalEmbedding) -> MultigridFactor:
        """Return K with a hierarchy, that of the matrix before until it is stale."""
        name = self._chosen.name
        analysis = analyse(
            K, backend=name, threads=self._threads, modes=whole.modes, block=whole.block, near=whole.near
        )
        self._last = cast("MultigridAnalysis", analysis).factor(K, self._last)
        return self._last

    def _analysed(self, K: csr_array, definite: bool) -> Factor:
        """Return a factor of K, by the analysis before if the pattern is the same."""
        if definite in self._analyses:
            with suppress(RequestError):  # another pattern
                return self._analyses[definite].factor(K)
        self._note = self.note  # of the analysis that goes
        analysis = analyse(K, backend=self._chosen.name, threads=self._threads, definite=definite)
        self._analyses[definite] = analysis
        return analysis.factor(K)


def leading_unknowns(R: Floats, among: Ints | None = None) -> Ints:
    """Return r unknowns at which the motions R (n, r) are well distinguished, by QR with column pivoting.

    `among`: the unknowns to choose from, all if None.
    """
    if not R.shape[1]:
        return np.empty(0, np.int64)
    among = np.arange(len(R)) if among is None else among
    *_, order = scipy.linalg.qr(R[among].T, mode="r", pivoting=True)
    return np.asarray(among[order[: R.shape[1]]])


def embed(K: csr_array, free: Ints, n_dof: int, diagonal: float | None = None) -> csr_array:
    """Return K (n, n) embedded at the unknowns `free` (n,) among n_dof.

    `diagonal`: that of the others; None for the mean of K's.
    """
    length = np.ones(n_dof, np.int64)
    length[free] = np.diff(K.indptr)
    indptr = np.concatenate([[0], np.cumsum(length)])
    held = np.ones(n_dof, bool)
    held[free] = False
    own = mask_of(indptr[-1], indptr[:-1][held])
    indices, data = np.empty(len(own), K.indices.dtype), np.empty(len(own))
    mean = K.diagonal().mean() if K.shape[0] else 1.0
    indices[own], data[own] = np.flatnonzero(held), mean if diagonal is None else diagonal
    np.logical_not(own, out=own)
    indices[own], data[own] = free.astype(K.indices.dtype)[K.indices], K.data
    return csr_array((data, indices, indptr.astype(K.indices.dtype)), shape=(n_dof, n_dof))
