"""What the conditions of a node leave free of its displacement.

At each node with conditions D u = c (D a row a condition, unit vectors) the displacement is u = N^T q + P c: the rows
of N are an orthonormal basis of what is left, P the pseudo-inverse of D, so that P c is the shortest u that meets them.
Conditions are taken in the order of the case; one that follows from earlier ones at its node carries nothing, and its
value must be what they say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.case.errors import CaseError, Problem
from lacsolver.constraints.conditions import Prescribed
from lacsolver.space.places import said
from lacsolver.space.space import Space

#: sine of the angle below which two directions are one
_ONE_DIRECTION = 1e-6
#: values at a node may differ by this much of the largest prescribed one, and of the bodies' extent (round-off)
_SAME_VALUE, _SAME_PLACE = 1e-9, 1e-14


@dataclass(frozen=True, eq=False)
class LocalBases:
    """The conditions of all nodes, combined; built by `combine`.

    `parts`: the conditions; all of them, in this order, are the rows i of what follows. `node` (i,), `direction`
    (i, dim). `nodes` (k,): those with conditions, sorted; `basis` (k, dim, dim): its first `n_free[k]` rows are N.
    `P` (n_dof, i): zero columns for conditions that follow from others.
    """

    space: Space
    parts: tuple[Prescribed, ...]
    node: Ints
    direction: NDArray[np.floating]
    nodes: Ints
    basis: NDArray[np.floating]
    n_free: Ints
    P: csr_array

    @cached_property
    def D(self) -> csr_array:
        """(i, n_dof): D u are the displacements that are prescribed."""
        return _sparse(self.space, self.node, self.direction).T.tocsr()

    def values(self, t: float) -> NDArray[np.floating]:
        """(i,): what D u is at time t. Raises CaseError where two conditions at a node contradict each other."""
        c = np.concatenate([np.empty(0), *(part.at(self.space, t) for part in self.parts)])
        missed = np.abs(self.D @ (self.P @ c) - c)
        if missed.max(initial=0.0) > _SAME_VALUE * np.abs(c).max(initial=0.0) + _SAME_PLACE * self.space.extent:
            self._contradiction(int(missed.argmax()), c, t)
        return c

    def forces(self, reaction: Floats) -> NDArray[np.floating]:
        """(i, dim): the force of each condition on its node, of reactions (n_dof,) at the nodes.

        Conditions that follow from earlier ones carry nothing, so that the forces add up to the reaction.
        """
        return (self.P.T @ reaction)[:, None] * self.direction

    def _contradiction(self, i: int, c: Floats, t: float) -> None:
        """The error for a condition that the others at its node do not allow, and the one that is nearest to it."""
        here = np.flatnonzero((self.node == self.node[i]) & (self._carries | (np.arange(len(c)) == i)))
        others = here[here != i]
        likeness = np.abs(self.direction[others] @ self.direction[i])
        other = int(others[likeness.argmax()])
        first, second = sorted((i, other))
        number = self.space.mesh.node_number[self.node[i]]
        more = " (with what else is prescribed there)" if likeness.max() < 1 - 1e-9 and len(others) > 1 else ""
        told = f"{self._told(first, c)}, and {self._told(second, c)}{more}"
        message = f"node {number} cannot have {told}, at t = {t:g}; leave one out, or make them agree"
        raise CaseError([Problem(message)])

    def _told(self, i: int, c: Floats) -> str:
        ends = np.cumsum([len(part.nodes) for part in self.parts])
        part = self.parts[int(np.searchsorted(ends, i, side="right"))]
        along = f" along ({', '.join(f'{d:.4g}' for d in self.direction[i])})" if part.component == "un" else ""
        return f"{part.component} = {c[i]:.10g}{along} of {said(part.record)}"

    @cached_property
    def _carries(self) -> NDArray[np.bool_]:
        return np.diff(self.P.tocsc().indptr) > 0


def combine(space: Space, parts: Sequence[Prescribed]) -> LocalBases:
    """Combine conditions, node by node."""
    dim = space.dim
    node = np.concatenate([np.empty(0, np.int64), *(part.nodes for part in parts)])
    direction = np.concatenate([np.empty((0, dim)), *(part.directions for part in parts)])
    nodes, place = np.unique(node, return_inverse=True)
    held, inverse, rank, row = _orthonormal(direction, place, len(nodes), dim)
    kept = np.flatnonzero(row >= 0)
    where = place[kept]
    along = np.einsum("ksd,ks->kd", held[where], inverse[where, :, row[kept]])
    P = _sparse(space, node[kept], along, kept, len(node))
    return LocalBases(space, tuple(parts), node, direction, nodes, _completed(held, rank), dim - rank, P)


def _orthonormal(direction: Floats, place: Ints, n: int, dim: int) -> tuple[Floats, Floats, Ints, Ints]:
    """Gram and Schmidt's D = L B at each of n nodes, over its conditions in their order.

    B (n, dim, dim), its first rank rows orthonormal, the others 0; inverse of L (n, dim, dim); rank (n,); and the row
    of D that each condition is (i,), -1 for one that follows from those before it.
    """
    B, L = np.zeros((n, dim, dim)), np.tile(np.eye(dim), (n, 1, 1))
    rank, row = np.zeros(n, np.int64), np.full(len(direction), -1)
    order = np.argsort(place, kind="stable")
    turn = np.arange(len(order)) - np.searchsorted(place[order], place[order])
    for k in range(turn.max(initial=-1) + 1):
        chosen = order[turn == k]
        at, d = place[chosen], direction[chosen]
        along = np.einsum("ksd,kd->ks", B[at], d)
        rest = d - np.einsum("ksd,ks->kd", B[at], along)
        rest -= np.einsum("ksd,ks->kd", B[at], np.einsum("ksd,kd->ks", B[at], rest))  # again: against round-off
        size = np.linalg.norm(rest, axis=1)
        new = np.flatnonzero(size > _ONE_DIRECTION)
        at, chosen = at[new], chosen[new]
        r = rank[at]
        L[at, r] = along[new]
        L[at, r, r] = size[new]
        B[at, r] = rest[new] / size[new, None]
        row[chosen] = r
        rank[at] += 1
    return B, np.linalg.inv(L), rank, row


def _completed(B: Floats, rank: Ints) -> NDArray[np.floating]:
    """(n, dim, dim): a basis N of what the rows of B leave, as near to the axes as may be; rows of zeros fill it up."""
    dim = B.shape[2]
    N = np.zeros_like(B)
    for k in range(dim):
        at = np.flatnonzero(dim - rank > k)
        left = np.eye(dim) - np.einsum("ksd,kse->kde", B[at], B[at]) - np.einsum("ksd,kse->kde", N[at], N[at])
        length = np.diagonal(left, axis1=1, axis2=2)  # squared: of each axis, as far as it lies in what is left
        axis = (length > length.max(axis=1, keepdims=True) - 1e-12).argmax(axis=1)
        v = np.take_along_axis(left, axis[:, None, None], axis=1)[:, 0]
        N[at, k] = v / np.linalg.norm(v, axis=1, keepdims=True)
    return N


def _sparse(space: Space, node: Ints, block: Floats, column: Ints | None = None, n: int | None = None) -> csr_array:
    """(n_dof, n): columns of `block` (k, dim) at the unknowns of nodes; column k is that of row k if None."""
    column = np.arange(len(node)) if column is None else column
    columns = np.repeat(column, space.dim)
    made = coo_array((block.ravel(), (space.dofs(node).ravel(), columns)), shape=(space.n_dof, n or len(node))).tocsr()
    made.eliminate_zeros()
    return made
