"""Local bases of the directions in which nodes with prescribed displacements remain free.

At each node with conditions D u = c (one row of D, a unit vector, per condition) the displacement is u = N^T q + P c:
the rows of N are an orthonormal basis of the null space of D, and P is the pseudo-inverse of D, so that P c is the
shortest u that meets the conditions. Conditions are taken in the order of the case; one that depends on earlier ones at
its node carries no force, and its value must agree with theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints, concatenated
from lacsolver.case.errors import CaseError, Issue
from lacsolver.constraints.conditions import Prescribed, rows_of, values_of
from lacsolver.space.places import said
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse

#: sine of the angle below which two directions count as the same
_ONE_DIRECTION = 1e-6
#: round-off allowed between values at a node, relative to the largest prescribed value, and to the bodies' extent
_SAME_VALUE, _SAME_PLACE = 1e-9, 1e-14


@dataclass(frozen=True, eq=False)
class LocalBases:
    """The conditions of all nodes, combined; built by `combine`.

    `parts`: the conditions, which are the rows i of the following arrays, in this order. `node` (i,), `direction`
    (i, dim). `nodes` (k,): nodes with conditions, sorted; `basis` (k, dim, dim): its first `n_free[k]` rows are N.
    `P` (n_dof, i): zero columns for conditions that depend on others.
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
        """Matrix (i, n_dof) such that D u are the components of displacement that are prescribed."""
        return rows_of(self.space, self.parts)

    def values(self, t: float) -> NDArray[np.floating]:
        """Return the prescribed values (i,) of D u at time t. Raises CaseError where two conditions contradict."""
        c = values_of(self.space, self.parts, t)
        missed = np.abs(self.D @ (self.P @ c) - c)
        if missed.max(initial=0.0) > _SAME_VALUE * np.abs(c).max(initial=0.0) + _SAME_PLACE * self.space.extent:
            self._contradiction(int(missed.argmax()), c, t)
        return c

    def forces(self, reaction: Floats) -> NDArray[np.floating]:
        """Return the force (i, dim) of each condition on its node, from reactions (n_dof,) at the nodes.

        Conditions that depend on earlier ones carry no force, so that the forces add up to the reaction.
        """
        return (self.P.T @ reaction)[:, None] * self.direction

    def _contradiction(self, i: int, c: Floats, t: float) -> None:
        """Raise the error for condition i, which contradicts others at its node; name the nearest in direction."""
        here = np.flatnonzero((self.node == self.node[i]) & (self._carries | (np.arange(len(c)) == i)))
        others = here[here != i]
        likeness = np.abs(self.direction[others] @ self.direction[i])
        other = int(others[likeness.argmax()])
        first, second = sorted((i, other))
        number = self.space.mesh.node_number[self.node[i]]
        more = " (with what else is prescribed there)" if likeness.max() < 1 - 1e-9 and len(others) > 1 else ""
        both = f"{self._told(first, c)}, and {self._told(second, c)}{more}"
        message = f"node {number} cannot have {both}, at t = {t:g}; leave one out, or make them agree"
        raise CaseError([Issue(message)])

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
    node = concatenated(part.nodes for part in parts)
    direction = np.concatenate([np.empty((0, dim)), *(part.directions for part in parts)])
    nodes, place = np.unique(node, return_inverse=True)
    basis, inverse, rank, row = _orthonormal(direction, place, len(nodes), dim)
    kept = np.flatnonzero(row >= 0)
    where = place[kept]
    along = np.einsum("ksd,ks->kd", basis[where], inverse[where, :, row[kept]])
    P = sparse((space.n_dof, len(node)), (space.dofs(node[kept]), kept[:, None], along))
    P.eliminate_zeros()
    return LocalBases(space, tuple(parts), node, direction, nodes, _completed(basis, rank), dim - rank, P)


def _orthonormal(direction: Floats, place: Ints, n: int, dim: int) -> tuple[Floats, Floats, Ints, Ints]:
    """Factorise D = L B by Gram-Schmidt at each of n nodes, over its conditions in their order.

    Returns B (n, dim, dim), its first rank rows orthonormal, the others 0; the inverse of L (n, dim, dim); rank (n,);
    and for each condition its row (i,) in D, -1 for a condition that depends on those before it.
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
    """Return a basis N (n, dim, dim) of the complement of the rows of B, as close to the axes as possible.

    Unused rows are zero.
    """
    dim = B.shape[2]
    N = np.zeros_like(B)
    for k in range(dim):
        at = np.flatnonzero(dim - rank > k)
        left = np.eye(dim) - np.einsum("ksd,kse->kde", B[at], B[at]) - np.einsum("ksd,kse->kde", N[at], N[at])
        length = np.diagonal(left, axis1=1, axis2=2)  # squared length of each axis's projection on the rest
        axis = (length > length.max(axis=1, keepdims=True) - 1e-12).argmax(axis=1)
        v = np.take_along_axis(left, axis[:, None, None], axis=1)[:, 0]
        N[at, k] = v / np.linalg.norm(v, axis=1, keepdims=True)
    return N
