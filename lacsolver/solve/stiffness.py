"""Stiffness K on the constrained unknowns, regularised and factorised.

A body that only contact supports makes K singular: springs at as many unknowns as it has rigid-body modes make K
definite, and the contact loop (`schur`) ensures that they carry no force. Multigrid works on blocks of whole nodes: for
it K is embedded in the unknowns of all nodes, with multiples of identity rows for the constrained ones.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array, diags_array

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints
from lacsolver.linear import Analysis, Factor, analyse, choose
from lacsolver.linear.cycle import Team
from lacsolver.linear.direct import DirectAnalysis
from lacsolver.linear.multigrid import MultigridAnalysis, MultigridFactor


class Whole(NamedTuple):
    """Embedding of q in the unknowns of all nodes.

    `free` (n_q,): indices of q among the `n_dof` unknowns; `block`: unknowns per node; `modes` (n_dof, r): rigid-body
    modes.
    """

    free: Ints
    n_dof: int
    block: int
    modes: NDArray[np.floating]


class Stiffness(NamedTuple):
    """K (n, n) on the constrained unknowns, its factor, and the rigid-body modes R (n, r) in its null space.

    `R` has orthonormal columns. `factor`: that of K with the springs `spring` (n,), embedded by `whole` unless that is
    None. `analysis`: the analysis that the factor was made by.
    """

    K: csr_array
    factor: Factor
    R: NDArray[np.floating]
    whole: Whole | None = None
    spring: NDArray[np.floating] | None = None
    analysis: Analysis | None = None

    def solve(self, f: Floats) -> NDArray[np.floating]:
        """Return K^-1 f (n,); f should be in balance along R, since the springs balance the rest."""
        return self._on_nodes(self.factor.solve, f)

    @property
    def cycles(self) -> bool:
        """True with multigrid, where `cycle` is the basic operation and K^-1 takes many cycles."""
        return isinstance(self.factor, MultigridFactor)

    def cycle(self, f: Floats) -> NDArray[np.floating]:
        """Return an approximation of K^-1 f (n,), by one V-cycle of multigrid."""
        assert isinstance(self.factor, MultigridFactor)
        return self._on_nodes(self.factor.hierarchy.cycle, f)

    def times(self, q: Floats) -> NDArray[np.floating]:
        """Return K q (n,), computed on all threads with multigrid."""
        if not isinstance(self.factor, MultigridFactor):
            return np.asarray(self.K @ q)
        made = self._on_nodes(self.factor.__matmul__, q)
        return made if self.spring is None else made - self.spring * q

    @property
    def diagonal(self) -> NDArray[np.floating]:
        """Diagonal (n,) of K with its springs; 1 where it is 0."""
        d = self.K.diagonal() + (0.0 if self.spring is None else self.spring)
        return np.where(d == 0, 1.0, d)

    @property
    def team(self) -> Team:
        """Threads of multigrid; a single one for direct backends."""
        return self.factor.team if isinstance(self.factor, MultigridFactor) else Team(1)

    def note(self, use: str, cycles: int, first: float, last: float) -> None:
        """Record that `cycles` V-cycles reduced a residual norm from `first` to `last`."""
        if isinstance(self.factor, MultigridFactor) and first > 0:
            self.factor.hierarchy.note(use, cycles, float(np.log10(first / max(last, 1e-16 * first))))

    def _on_nodes(self, apply: Callable[[Floats], Floats], f: Floats) -> NDArray[np.floating]:
        """Apply an operator to f, embedded in the unknowns of all nodes if the operator works on nodal blocks."""
        if self.whole is None:
            return np.asarray(apply(f))
        all_f = np.zeros(self.whole.n_dof)
        all_f[self.whole.free] = f
        return np.asarray(apply(all_f)[self.whole.free])


def hold(
    K: csr_array,
    R: NDArray[np.floating],
    *,
    backend: str = "auto",
    threads: int = 1,
    whole: Whole | None = None,
    definite: bool = True,
    like: Stiffness | None = None,
) -> Stiffness:
    """Factorise a symmetric K, regularised by springs at r unknowns that fix its rigid-body modes R (n, r).

    `whole`: embedding in whole nodes, for multigrid. With `definite` false K may be indefinite, see `analyse`. `like`:
    stiffness of an earlier, similar K by the same backend: its analysis is reused if the pattern is the same (which
    releases its factor), its hierarchy until it is stale.

    Raises SingularError if K has other motions without energy than R.
    """
    regular, spring = K, None
    if R.shape[1]:
        spring = np.zeros(K.shape[0])
        spring[leading_unknowns(R)] = np.abs(K.diagonal()).mean() or 1.0
        regular = csr_array(K + diags_array(spring))
    n_modes = 0 if whole is None else whole.modes.shape[1]
    name = choose(backend, K.shape[0], n_modes).name
    if name != "multigrid" or whole is None or not definite:
        analysis, factor = _factorised(regular, name, threads, like, definite)
        return Stiffness(K, factor, R, None, spring, analysis)
    on_nodes = _put_back(regular, whole)
    made = analyse(on_nodes, backend=name, threads=threads, modes=whole.modes, block=whole.block)
    assert isinstance(made, MultigridAnalysis)
    before = like.factor if like is not None and like.whole is not None else None
    factor = made.factor(on_nodes, before if isinstance(before, MultigridFactor) else None)
    return Stiffness(K, factor, R, whole, spring, made)


def _factorised(
    K: csr_array, backend: str, threads: int, like: Stiffness | None, definite: bool
) -> tuple[Analysis, Factor]:
    """Return an analysis, the previous one if it can be reused, and the factor of K."""
    before = None if like is None else like.analysis
    if isinstance(before, DirectAnalysis) and before.asked == (backend, definite):
        with suppress(RequestError):  # another pattern
            return before, before.factor(K)
    analysis = analyse(K, backend=backend, threads=threads, definite=definite)
    return analysis, analysis.factor(K)


def leading_unknowns(R: Floats) -> Ints:
    """Return r unknowns at which the motions R (n, r) are well distinguished, by QR with column pivoting."""
    if not R.shape[1]:
        return np.empty(0, np.int64)
    *_, order = scipy.linalg.qr(R.T, mode="r", pivoting=True)
    return np.asarray(order[: R.shape[1]])


def _put_back(K: csr_array, whole: Whole) -> bsr_array:
    """Return K embedded in all unknowns, (n_dof, n_dof), with its mean diagonal in the rows of constrained ones."""
    length = np.ones(whole.n_dof, np.int64)
    length[whole.free] = np.diff(K.indptr)
    indptr = np.concatenate([[0], np.cumsum(length)])
    held = np.ones(whole.n_dof, bool)
    held[whole.free] = False
    own = np.zeros(indptr[-1], bool)
    own[indptr[:-1][held]] = True
    indices, data = np.empty(len(own), K.indices.dtype), np.empty(len(own))
    indices[own], data[own] = np.flatnonzero(held), K.diagonal().mean() if K.shape[0] else 1.0
    np.logical_not(own, out=own)
    indices[own], data[own] = whole.free.astype(K.indices.dtype)[K.indices], K.data
    big = csr_array((data, indices, indptr.astype(K.indices.dtype)), shape=(whole.n_dof, whole.n_dof))
    return bsr_array(big.tobsr((whole.block, whole.block)))
