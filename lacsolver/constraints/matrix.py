"""Matrix T = du/dq of the constraints: columns of the nodes' own unknowns, then of the free motions of rigid bodies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.constraints.local import LocalBases
from lacsolver.constraints.rigid import RigidBody
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse


def _own_unknowns(space: Space, local: LocalBases, rigid: tuple[RigidBody, ...]) -> tuple[Ints, int]:
    """Return the first of each node's own unknowns in q, (n_nodes,), -1 for none, and the number of such unknowns."""
    count = np.where(space.attached, space.dim, 0)
    count[local.nodes] = np.where(space.attached[local.nodes], local.n_free, 0)
    for body in rigid:
        count[body.nodes] = 0
    first = np.cumsum(count) - count
    return np.where(count > 0, first, -1), int(count.sum())


def nodal_map(space: Space, local: LocalBases, rigid: tuple[RigidBody, ...]) -> csr_array:
    """Return the columns of T at the nodes' own unknowns."""
    own, n = _own_unknowns(space, local, rigid)
    alone = own >= 0
    alone[local.nodes] = False
    whole = np.flatnonzero(alone)
    k, j = np.nonzero((own[local.nodes, None] >= 0) & (np.arange(space.dim) < local.n_free[:, None]))
    T = sparse(
        (space.n_dof, n),
        (space.dofs(whole), own[whole, None] + np.arange(space.dim), 1.0),
        (space.dofs(local.nodes[k]), (own[local.nodes[k]] + j)[:, None], local.basis[k, j]),
    )
    T.eliminate_zeros()
    return _shared(space, T, own)


def with_motions(
    space: Space, nodal: csr_array, rigid: tuple[RigidBody, ...],
    moment_arms: tuple[NDArray[np.floating], ...] | None = None,
) -> csr_array:  # fmt: skip
    """Return T with columns for the free motions of rigid bodies after the `nodal` ones.

    `moment_arms`: other moment arms than the bodies' own, for finite rotations; zeros are then kept.
    """
    n, given = nodal.shape[1], nodal.tocoo()
    entries: list[tuple[Ints, Ints, Floats]] = [(given.row, given.col, given.data)]
    for body, moment_arm in zip(rigid, moment_arms or [body.moment_arm for body in rigid], strict=True):
        rows = space.dofs(body.nodes).reshape(-1, 1)
        entries.append((rows, body.columns[body.free], (moment_arm * body.unit)[:, body.free]))
        n += int(body.free.sum())
    T = sparse((space.n_dof, n), *entries)
    if moment_arms is None:
        T.eliminate_zeros()
    return T


def _shared(space: Space, T: csr_array, own: Ints) -> csr_array:
    """Return T with the blocks at the nodes of other processes that they have; `own` (n_nodes,): first unknowns."""
    if space.share.own is None:
        return T
    entries, dim = T.tocoo(), space.dim
    node = entries.row // dim
    blocks = np.zeros((space.mesh.n_nodes, dim, dim))
    blocks[node, entries.row % dim, entries.col - own[node]] = entries.data
    shared = space.share.update(blocks.reshape(-1, dim * dim)).reshape(-1, dim, dim)
    used = shared.any(axis=1)  # (n_nodes, columns)
    first = np.cumsum(used.sum(axis=1)) - used.sum(axis=1)
    node, s, j = np.nonzero(shared)
    return sparse((space.n_dof, int(used.sum())), (dim * node + s, first[node] + j, shared[node, s, j]))
