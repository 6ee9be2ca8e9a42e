"""Stiffness K on the constrained unknowns, regularised and factorised.

A body that only contact supports makes K singular: springs at as many unknowns as it has rigid-body modes make K
definite, and the contact loop (`schur`) ensures that they carry no force. Multigrid works on blocks of whole nodes: for
it K is embedded in the unknowns of all nodes, with multiples of identity rows for the constrained ones.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array, diags_array

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints
from lacsolver.linear import Analysis, Backend, Factor, Matrix, analyse, choose
from lacsolver.linear.vectors import Vectors
from lacsolver.saddle.node_blocks import add_to_diagonal, submatrix


class Whole(NamedTuple):
    """Embedding of q in the unknowns of all nodes.

    `free` (n_q,): indices of q among the `n_dof` unknowns; `block`: unknowns per node; `modes` (n_dof, r): rigid-body
    modes.
    """

    free: Ints
    n_dof: int
    block: int
    modes: NDArray[np.floating]


class KeptParts(ABC):
    """Parts of a stiffness, of one or of several processes, that are kept for the next active set."""

    matrix: Matrix
    R: NDArray[np.floating]
    _restricted: tuple[Ints, csr_array] | None = None
    _rows: tuple[csr_array, bsr_array] | None = None

    @cached_property
    def K(self) -> csr_array:
        """Matrix (n, n); where only blocks are kept, it is made of them once it is asked for."""
        return self.matrix if isinstance(self.matrix, csr_array) else self._submatrix(np.arange(len(self.R)))

    def restricted(self, unknowns: Ints) -> csr_array:
        """Return the rows and columns of K at some unknowns, which all processes have; the last are kept."""
        if self._restricted is None or self._restricted[0] is not unknowns:
            self._restricted = unknowns, self._total(self._submatrix(unknowns))
        return self._restricted[1]

    def _kept_blocks_of(self, B: csr_array) -> bsr_array:
        """Return rows B as blocks of the unknowns of nodes; the last are kept."""
        if self._rows is None or self._rows[0] is not B:
            self._rows = B, self._blocks_of(B)
        return self._rows[1]

    @abstractmethod
    def _submatrix(self, unknowns: Ints) -> csr_array:
        """Return the rows and columns of K at some unknowns, without the rows of other processes."""

    @abstractmethod
    def _blocks_of(self, B: csr_array) -> bsr_array:
        """Return rows B as blocks of the unknowns of nodes."""

    def _total(self, A: csr_array) -> csr_array:
        """Return the sum of a matrix over all processes."""
        return A


@dataclass(eq=False)
class Stiffness(KeptParts):
    """K (n, n) on the constrained unknowns, its factor, and the rigid-body modes R (n, r) in its null space.

    `R` has orthonormal columns. `factor`: that of K with the springs `spring` (n,), embedded by `whole` unless that is
    None. `matrix`: K, or the matrix of that factor, as blocks. It is an `Operator`, and solves with K.
    """

    matrix: Matrix
    factor: Factor
    R: NDArray[np.floating]
    whole: Whole | None = None
    spring: NDArray[np.floating] | None = None

    @property
    def definite(self) -> bool:
        """True if negative energies of K are errors, of an iterative solution."""
        return True

    @property
    def iterative(self) -> bool:
        """True with multigrid, where `cycle` is the basic operation and K^-1 takes many cycles."""
        return self.factor.iterative

    @property
    def vectors(self) -> Vectors:
        """Operations on vectors of the unknowns."""
        return self.factor.vectors

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
        """Return K q (n,), computed on all threads with multigrid."""
        if not self.factor.iterative:
            return np.asarray(self.K @ q)
        made = self._on_nodes(self.factor.apply, q)
        return made if self.spring is None else made - self.spring * q

    def _submatrix(self, unknowns: Ints) -> csr_array:
        if isinstance(self.matrix, csr_array) or self.whole is None:
            return csr_array(self.matrix[unknowns][:, unknowns])
        K = submatrix(self.matrix, self.whole.free[unknowns])
        return K if self.spring is None else csr_array(K - diags_array(self.spring[unknowns]))

    def solve(self, f: Floats) -> NDArray[np.floating]:
        """Return K^-1 f (n,); f should be in balance along R, since the springs balance the rest."""
        return self._on_nodes(self.factor.solve, f)

    def cycle(self, f: Floats) -> NDArray[np.floating]:
        """Return an approximation of K^-1 f (n,): by one V-cycle with multigrid, else the solution."""
        return self._on_nodes(self.factor.cycle, f)

    def cycle_with_rows(self, B: csr_array, weights: Floats) -> Callable[[Floats], NDArray[np.floating]]:
        """Return f -> an approximation of (K + B^T W B)^-1 f, one V-cycle: rows B (m, n), W = diag `weights` (m,).

        What was made for the cycles of K, and for the rows of B, serves other weights too.
        """
        cycle = self.factor.cycle_with_rows(self._kept_blocks_of(B), weights)
        return lambda f: self._on_nodes(cycle, f)

    def _blocks_of(self, B: csr_array) -> bsr_array:
        """Return rows B as blocks of the unknowns of nodes."""
        if self.whole is None:
            return bsr_array(B.tobsr((1, 1)))
        columns = self.whole.free.astype(B.indices.dtype)[B.indices]
        made = csr_array((B.data, columns, B.indptr), shape=(B.shape[0], self.whole.n_dof))
        return bsr_array(made.tobsr((1, self.whole.block)))

    def record_convergence(self, use: str, cycles: int, first: float, last: float) -> None:
        """Record that `cycles` V-cycles reduced a residual norm from `first` to `last`."""
        if first > 0:
            self.factor.record_convergence(use, cycles, float(np.log10(first / max(last, 1e-16 * first))))

    def _on_nodes(self, apply: Callable[[Floats], Floats], f: Floats) -> NDArray[np.floating]:
        """Apply an operator to f, embedded in the unknowns of all nodes if the operator works on nodal blocks."""
        if self.whole is None:
            return np.asarray(apply(f))
        all_f = np.zeros(self.whole.n_dof)
        all_f[self.whole.free] = f
        return np.asarray(apply(all_f)[self.whole.free])


class FactorCache:
    """Factorises matrices one after the other by one backend, and reuses what it can of the one before.

    A direct backend keeps the analysis of an unchanged pattern and releases the factor before; multigrid keeps its
    hierarchy until it is stale. R (n, r): rigid-body modes that springs at r unknowns fix. `whole`: embedding in whole
    nodes, for multigrid.
    """

    def __init__(
        self, R: NDArray[np.floating], backend: str = "auto", threads: int = 1, whole: Whole | None = None
    ) -> None:
        self._R, self._backend, self._threads, self._whole = R, backend, threads, whole
        self._analyses: dict[bool, Analysis] = {}
        self._cycles: Factor | None = None

    @property
    def on_nodes(self) -> bool:
        """True if multigrid is taken, which works on blocks of whole nodes: see `factorise_on_nodes`."""
        return self._whole is not None and not self._chosen.direct

    @cached_property
    def _chosen(self) -> Backend:
        return choose(self._backend, len(self._R), 0 if self._whole is None else self._whole.modes.shape[1])

    def forget(self) -> None:
        """Drop the hierarchy of multigrid: the next matrix is not similar to the last one."""
        self._cycles = None

    def factorise(self, K: csr_array, definite: bool = True) -> Stiffness:
        """Factorise a symmetric K, regularised by springs; with `definite` false K may be indefinite, see `analyse`.

        Raises SingularError if K has other motions without energy than R.
        """
        regular, spring, whole = K, self._springs(K.diagonal()), self._whole
        if spring is not None:
            regular = csr_array(K + diags_array(spring))
        if whole is None or self._chosen.direct or not definite:
            return Stiffness(K, self._analysed(regular, self._chosen.name, definite), self._R, None, spring)
        on_nodes = bsr_array(embed(regular, whole.free, whole.n_dof).tobsr((whole.block, whole.block)))
        return Stiffness(K, self._preconditioned(on_nodes, whole), self._R, whole, spring)

    def factorise_on_nodes(self, K: bsr_array) -> Stiffness:
        """Return the factor of K that is embedded in the unknowns of all nodes as blocks, for multigrid.

        K is the only copy that is kept, and regularised in place. Raises SingularError as `factorise` does.
        """
        whole = self._whole
        assert whole is not None
        spring = self._springs(K.diagonal()[whole.free])
        if spring is not None:
            everywhere = np.zeros(whole.n_dof)
            everywhere[whole.free] = spring
            add_to_diagonal(K, everywhere)
        return Stiffness(K, self._preconditioned(K, whole), self._R, whole, spring)

    def _springs(self, diagonal: Floats) -> NDArray[np.floating] | None:
        """Return springs (n,) at as many unknowns as K of that diagonal has rigid-body modes; None if it has none."""
        if not self._R.shape[1]:
            return None
        spring = np.zeros(len(diagonal))
        spring[leading_unknowns(self._R)] = np.abs(diagonal).mean() or 1.0
        return spring

    def _preconditioned(self, K: bsr_array, whole: Whole) -> Factor:
        """Return K with a hierarchy, that of the matrix before until it is stale."""
        name = self._chosen.name
        made = analyse(K, backend=name, threads=self._threads, modes=whole.modes, block=whole.block)
        self._cycles = made.factor(K, self._cycles)
        return self._cycles

    def _analysed(self, K: csr_array, backend: str, definite: bool) -> Factor:
        """Return a factor of K, by the analysis before if the pattern is the same."""
        if definite in self._analyses:
            with suppress(RequestError):  # another pattern
                return self._analyses[definite].factor(K)
        analysis = analyse(K, backend=backend, threads=self._threads, definite=definite)
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
    own = np.zeros(indptr[-1], bool)
    own[indptr[:-1][held]] = True
    indices, data = np.empty(len(own), K.indices.dtype), np.empty(len(own))
    mean = K.diagonal().mean() if K.shape[0] else 1.0
    indices[own], data[own] = np.flatnonzero(held), mean if diagonal is None else diagonal
    np.logical_not(own, out=own)
    indices[own], data[own] = free.astype(K.indices.dtype)[K.indices], K.data
    return csr_array((data, indices, indptr.astype(K.indices.dtype)), shape=(n_dof, n_dof))
