"""K on the constrained unknowns, made regular and factorised.

A body that only contact holds makes K singular: springs at as many unknowns as it has free motions make it definite,
and the contact loop (`schur`) sees to it that they carry nothing. Multigrid works on the blocks of whole nodes: for it
K is put back among all unknowns, with rows of the identity for those that are held.
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
    """Where q stands among the unknowns of all nodes: `free` (n_q,), of `n_dof`, `block` a node; `modes` (n_dof, r)."""

    free: Ints
    n_dof: int
    block: int
    modes: NDArray[np.floating]


class Stiffness(NamedTuple):
    """K (n, n) of the constrained unknowns, what solves with it, and the motions R (n, r) that it does not resist.

    `R` has orthonormal columns. `whole`: None where `factor` is that of K itself, with springs (n,). `analysis`: what
    the factor was made by.
    """

    K: csr_array
    factor: Factor
    R: NDArray[np.floating]
    whole: Whole | None = None
    spring: NDArray[np.floating] | None = None
    analysis: Analysis | None = None

    def solve(self, f: Floats) -> NDArray[np.floating]:
        """(n,): K^-1 f; f in balance along R, or the springs take what is left."""
        return self._on_nodes(self.factor.solve, f)

    @property
    def cycles(self) -> bool:
        """Whether `cycle` is all there is, and K^-1 takes many of them."""
        return isinstance(self.factor, MultigridFactor)

    def cycle(self, f: Floats) -> NDArray[np.floating]:
        """(n,): about K^-1 f, by one V-cycle of multigrid."""
        assert isinstance(self.factor, MultigridFactor)
        return self._on_nodes(self.factor.hierarchy.cycle, f)

    def times(self, q: Floats) -> NDArray[np.floating]:
        """(n,): K q, on all threads with multigrid."""
        if not isinstance(self.factor, MultigridFactor):
            return np.asarray(self.K @ q)
        made = self._on_nodes(self.factor.__matmul__, q)
        return made if self.spring is None else made - self.spring * q

    @property
    def diagonal(self) -> NDArray[np.floating]:
        """(n,): of K with its springs; 1 where that is nothing."""
        d = self.K.diagonal() + (0.0 if self.spring is None else self.spring)
        return np.where(d == 0, 1.0, d)

    @property
    def team(self) -> Team:
        """The threads of multigrid."""
        return self.factor.team if isinstance(self.factor, MultigridFactor) else Team(1)

    def note(self, use: str, cycles: int, first: float, last: float) -> None:
        """That so many V-cycles brought a residual down from the first size to the last."""
        if isinstance(self.factor, MultigridFactor) and first > 0:
            self.factor.hierarchy.note(use, cycles, float(np.log10(first / max(last, 1e-16 * first))))

    def _on_nodes(self, apply: Callable[[Floats], Floats], f: Floats) -> NDArray[np.floating]:
        """What is done on the unknowns of whole nodes, if it is."""
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
    """Factorise K, symmetric, with springs at r unknowns along its free motions R (n, r), so that it is definite.

    `whole` lets multigrid see whole nodes. Where `definite` is false, K may be indefinite, see `analyse`. `like`: what
    was made of an earlier K, much the same, by the same backend: its analysis serves again where the pattern is as it
    was (its factor is given up then), its hierarchy as long as it is not worn.

    Raises SingularError where K has more free motions than R.
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
    """An analysis, the one before if it serves, and the factor of K."""
    before = None if like is None else like.analysis
    if isinstance(before, DirectAnalysis) and before.asked == (backend, definite):
        with suppress(RequestError):  # another pattern
            return before, before.factor(K)
    analysis = analyse(K, backend=backend, threads=threads, definite=definite)
    return analysis, analysis.factor(K)


def leading_unknowns(R: Floats) -> Ints:
    """(r,): unknowns that tell the motions R (n, r) apart best."""
    if not R.shape[1]:
        return np.empty(0, np.int64)
    *_, order = scipy.linalg.qr(R.T, mode="r", pivoting=True)
    return np.asarray(order[: R.shape[1]])


def _put_back(K: csr_array, whole: Whole) -> bsr_array:
    """K (n_dof, n_dof), rows of its mean diagonal for unknowns that are held."""
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
