"""First active set of a linear problem, from the same problem on the first coarser level of multigrid.

On that level q = P v, with P the prolongation, and K is P^T K P, which the hierarchy has. Its unknowns are too few for
a pressure on each macro-element: the rows of a pair are joined to groups, those that act most on the same node of the
level, and a group has one pressure. The joined rows are a contact problem as any other. A set of it costs a small part
of one on K, and the last is right but for a strip of the width of a group, so that few sets are left to be tried on K,
and about as many for all sizes of a model (nested iteration).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.linear import LinearError
from lacsolver.saddle.contact_system import ContactSystem, skin_stiffness
from lacsolver.saddle.iterate import Iterate
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.row_group import RowGroup, Rows
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.stiffness import NodalEmbedding, Stiffness
from lacsolver.saddle.tolerances import ConvergenceTolerance

if TYPE_CHECKING:
    from lacsolver.linear.multigrid.cycle import Level
    from lacsolver.linear.multigrid.factor import MultigridFactor

#: reduction of the residual in each solve, and most sets that are tried
_LOOSE, _SETS = 0.2, 6


def coarse_start(
    K: Operator, f: Floats, contact: ContactSystem, start: Iterate, tolerance: ConvergenceTolerance
) -> Iterate:
    """Return an iterate near the solution of K q = f - B^T p with contact, or `start` where there is no coarser level.

    `contact`: the system at `start`. It is `start` too for bodies that only contact supports, with friction, with rows
    of equality, for laws with a history or that ask for exact solves, and where the coarse problem is not solved.
    """
    laws = [group.law for group in contact.groups]
    coarse = None if contact.equalities else _CoarseLevel.of(K)
    if coarse is None or contact.exact or contact.sheared or any(law.n_history for law in laws):
        return start
    with suppress(LinearError):
        return _solved(coarse, coarse.restricted(f - K.apply(start.q)), contact, start, tolerance)
    return start


class _CoarseLevel(NamedTuple):
    """Stiffness on the first coarser level, and the level above it, which has the prolongation."""

    K: Stiffness
    above: Level
    whole: NodalEmbedding

    @staticmethod
    def of(K: Operator) -> _CoarseLevel | None:
        """Return the level below K; None if K has none, or has rigid-body modes."""
        if not isinstance(K, Stiffness) or K.whole is None or K.R.shape[1]:
            return None
        found = cast("MultigridFactor", K.factor).coarse() if K.iterative else None
        if found is None:
            return None
        factor, above = found
        n, none = factor.shape[0], np.zeros((factor.shape[0], 0))
        whole = NodalEmbedding(np.arange(n), n, factor.matrix.blocksize[1], none)
        return _CoarseLevel(Stiffness(factor.matrix, factor, none, whole), above, K.whole)

    def restricted(self, f: Floats) -> NDArray[np.floating]:
        """Return P^T f."""
        return _in_single(self.above.restrict, self.whole.on_nodes(f))

    def prolonged(self, v: Floats) -> NDArray[np.floating]:
        """Return P v."""
        return _in_single(self.above.prolong, v)[self.whole.free]

    def rows(self, B: csr_array) -> bsr_array:
        """Return B P."""
        return self.above.rows_below(self.whole.rows(B))


def _in_single(apply: Callable[[NDArray[np.floating]], NDArray[np.floating]], v: Floats) -> NDArray[np.floating]:
    """Return the product of an operator in single precision with v, which is scaled first."""
    size = float(np.abs(v).max(initial=0.0)) or 1.0
    return apply((v / size).astype(np.float32)).astype(float) * size


def _solved(
    coarse: _CoarseLevel, f: Floats, contact: ContactSystem, start: Iterate, tolerance: ConvergenceTolerance
) -> Iterate:
    """Solve the coarse problem for the correction of `start`, loosely, until its set stays as it is."""
    joined, group = _joined(contact, coarse)
    closed = np.bincount(group, start.active, minlength=len(joined.G)) > 0
    active, now = joined.start_active(closed), joined
    v: Floats = np.zeros(len(f))
    p: Floats = np.zeros(len(joined.G))
    for _ in range(_SETS):
        G, S = now.equations(p, active)
        problem = SaddleProblem(coarse.K, joined.rows, np.flatnonzero(active), f, G + joined.rows.B @ v, S)
        v, p, *_ = solve_saddle(problem, v, p, tolerance.linear(_LOOSE))
        now = joined.with_gaps(joined.G - joined.rows.B @ v)
        before, active = active, now.next_active(active, p)
        if np.array_equal(before, active):
            break
    rows = contact.enforceable & active[group]
    return Iterate(start.q + coarse.prolonged(v), np.where(rows, p[group], 0.0), rows)


def _joined(contact: ContactSystem, coarse: _CoarseLevel) -> tuple[ContactSystem, Ints]:
    """Return the joined rows as a contact system on the coarse unknowns, and the group (m,) of each row."""
    B = coarse.rows(contact.rows.B)
    pair, component = np.zeros((2, len(contact.G)), np.int64)
    for k, own in enumerate(contact.groups):
        pair[own.rows] = k
        if own.law.all_components:
            component[own.rows] = np.arange(own.rows.stop - own.rows.start) % coarse.whole.block
    keys, group = np.unique(np.stack([pair, component, _leading_nodes(B)]), axis=1, return_inverse=True)
    group, m = group.ravel(), keys.shape[1]
    join = csr_array((contact.enforceable.astype(float), (group, np.arange(len(group)))), shape=(m, len(group)))
    w = join @ contact.rows.w
    rows = Rows(csr_array(join @ B), np.where(w > 0, w, 1.0))
    ends = np.searchsorted(keys[0], np.arange(len(contact.groups) + 1))
    pairs = tuple(
        RowGroup(own.law, slice(int(first), int(last)), np.zeros((last - first, 0)))
        for own, first, last in zip(contact.groups, ends[:-1], ends[1:], strict=True)
    )
    skin = skin_stiffness(coarse.K, rows)
    return ContactSystem(rows, join @ contact.G, pairs, w > 0, w > 0, skin), group


def _leading_nodes(B: bsr_array) -> Ints:
    """Return the node (m,) of the largest block of each row of B; -1 for a row without one."""
    out = np.full(B.shape[0], -1, np.int64)
    row, size = np.repeat(np.arange(B.shape[0]), np.diff(B.indptr)), np.abs(B.data).sum(axis=(1, 2))
    order = np.lexsort((size, row))
    out[row[order]] = B.indices[order]  # the largest of a row is written last
    return out
