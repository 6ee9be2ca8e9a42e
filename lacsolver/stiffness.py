"""K on the constrained unknowns, made regular and factorised.

A body that only contact holds makes K singular: springs at as many unknowns as it has free motions make it definite,
and the contact loop (`schur`) sees to it that they carry nothing. Multigrid works on the blocks of whole nodes: for it
K is put back among all unknowns, with rows of the identity for those that are held.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array, diags_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear import Factor, analyse, choose


class Whole(NamedTuple):
    """Where q stands among the unknowns of all nodes: `free` (n_q,), of `n_dof`, `block` a node; `modes` (n_dof, r)."""

    free: Ints
    n_dof: int
    block: int
    modes: NDArray[np.floating]


class Stiffness(NamedTuple):
    """K (n, n) of the constrained unknowns, what solves with it, and the motions R (n, r) that it does not resist.

    `R` has orthonormal columns. `whole`: None where `factor` is that of K itself, with springs.
    """

    K: csr_array
    factor: Factor
    R: NDArray[np.floating]
    whole: Whole | None = None

    def solve(self, f: Floats) -> NDArray[np.floating]:
        """(n,): K^-1 f; f in balance along R, or the springs take what is left."""
        if self.whole is None:
            return self.factor.solve(f)
        all_f = np.zeros(self.whole.n_dof)
        all_f[self.whole.free] = f
        return self.factor.solve(all_f)[self.whole.free]


def hold(
    K: csr_array,
    R: NDArray[np.floating],
    *,
    backend: str = "auto",
    threads: int = 1,
    whole: Whole | None = None,
    definite: bool = True,
) -> Stiffness:
    """Factorise K, symmetric, with springs at r unknowns along its free motions R (n, r), so that it is definite.

    `whole` lets multigrid see whole nodes. Where `definite` is false, K may be indefinite, see `analyse`.

    Raises SingularError where K has more free motions than R.
    """
    regular = K
    if R.shape[1]:
        spring = np.zeros(K.shape[0])
        spring[leading_unknowns(R)] = np.abs(K.diagonal()).mean() or 1.0
        regular = csr_array(K + diags_array(spring))
    n_modes = 0 if whole is None else whole.modes.shape[1]
    if not definite:
        return Stiffness(K, analyse(regular, backend=backend, threads=threads, definite=False).factor(regular), R)
    if choose(backend, K.shape[0], n_modes).name == "multigrid" and whole is not None:
        on_nodes = _put_back(regular, whole)
        made = analyse(on_nodes, backend="multigrid", threads=threads, modes=whole.modes, block=whole.block)
        return Stiffness(K, made.factor(on_nodes), R, whole)
    return Stiffness(K, analyse(regular, backend=backend, threads=threads).factor(regular), R)


def leading_unknowns(R: Floats) -> Ints:
    """(r,): unknowns that tell the motions R (n, r) apart best."""
    if not R.shape[1]:
        return np.empty(0, np.int64)
    *_, order = scipy.linalg.qr(R.T, mode="r", pivoting=True)
    return np.asarray(order[: R.shape[1]])


def _put_back(K: csr_array, whole: Whole) -> bsr_array:
    """K (n_dof, n_dof), rows of its mean diagonal for unknowns that are held."""
    place = np.zeros(whole.n_dof + 1, np.int64)
    place[whole.free + 1] = np.diff(K.indptr)
    held = np.setdiff1d(np.arange(whole.n_dof), whole.free)
    big = csr_array((K.data, whole.free[K.indices], np.cumsum(place)), shape=(whole.n_dof, whole.n_dof))
    diagonal = np.zeros(whole.n_dof)
    diagonal[held] = K.diagonal().mean()
    return csr_array(big + diags_array(diagonal)).tobsr((whole.block, whole.block))
