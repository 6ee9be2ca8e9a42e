"""Prescribed displacements and rigid bodies of a case, as u = T x + u0(t).

T is constant and built once: it has columns for the nodes' own unknowns, node by node, then for the rigid bodies' free
motions. Under finite kinematics with a freely rotating rigid body, u(x, t) is not linear: `displacement` is exact,
T(x, t) its derivative, and `turning` the geometric stiffness. Otherwise T(x, t) is T, and `turning` is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, issparse, vstack

from lacmesh.mesh import Floats, Ints, concatenated, mask_of
from lacsolver.case.case import Case
from lacsolver.constraints.conditions import AXIS, on_axis, prescribed
from lacsolver.constraints.coupling import rigid_records
from lacsolver.constraints.local import LocalBases, combine
from lacsolver.constraints.rigid import RigidBody, numbered, rigid_bodies
from lacsolver.space.places import name_of
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse, sparse_blocks


@dataclass(frozen=True, eq=False)
class Supports:
    """u = T x + u0(t); built by `Supports.of`.

    `T` (n_dof, n_x): its columns at the nodes' own unknowns are orthonormal. `local`: the prescribed displacements;
    `rigid`: the rigid bodies, in the case's order. `names`: each displacement's conditions (rows of `local`), by the
    name of its reaction: its group, or `at [x, y, z]`.
    """

    space: Space
    T: csr_array
    local: LocalBases
    rigid: tuple[RigidBody, ...]
    names: Mapping[str, Ints]

    @classmethod
    def of(cls, space: Space, case: Case) -> Supports:
        """Build the supports of a case's displacements and rigid bodies.

        In axisymmetry nodes on the axis have ux = 0, whatever the case prescribes there. Nodes without a cell of the
        space that no rigid body moves have no unknowns: components that are not prescribed there are 0.

        Raises CaseError, with the lines of the records concerned, for groups and places that are missing or empty, `un`
        of a group that is no skin, conditions that contradict each other at a node (checked at some of the case's times
        here, and at every time by `u0`), or a node in two rigid bodies. What is prescribed at nodes of these is left to
        equations (`shared`).
        """
        parts = prescribed(space, [record for record in case.displacement if record.begin is None])
        rigid = rigid_bodies(space, rigid_records(case), case.kinematics == "finite", case.gravity)
        moved = concatenated(body.nodes for body in rigid)
        by_rigid = mask_of(space.mesh.n_nodes, moved)
        parts = tuple(part.take(~by_rigid[part.nodes]) for part in parts)
        local = combine(space, (*parts, *on_axis(space, moved)))
        nodal = nodal_map(space, local, rigid)
        rigid = numbered(rigid, nodal.shape[1])
        supports = cls(space, with_motions(space, nodal, rigid), local, rigid, _names(local))
        for t in probed_times(case):
            supports.u0(t)
        return supports

    @property
    def n_x(self) -> int:
        """Number of unknowns x."""
        return self.T.shape[1]

    @cached_property
    def n_nodal(self) -> int:
        """Number of the nodes' own unknowns, which come before the free motions of rigid bodies."""
        return self.n_x - sum(int(body.free.sum()) for body in self.rigid)

    @cached_property
    def nodal_T(self) -> csr_array:
        """T at the nodes' own unknowns (n_dof, n_nodal)."""
        return self.T if self.n_nodal == self.n_x else csr_array(self.T[:, : self.n_nodal])

    @cached_property
    def node_of_unknown(self) -> Ints:
        """Node (n_nodal,) of each of the nodes' own unknowns."""
        T = self.nodal_T.tocsc()
        return T.indices[T.indptr[:-1]] // self.space.dim

    @cached_property
    def constrained(self) -> Ints:
        """Indices of the displacements (k,) that are not unknowns by themselves."""
        T, out = self.nodal_T.tocsc(), np.ones(self.space.n_dof, bool)
        alone = T.indptr[:-1][np.diff(T.indptr) == 1]
        out[T.indices[alone[T.data[alone] == 1.0]]] = False
        return np.flatnonzero(out)

    def u0(self, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with x = 0, not to be written to.

        That of the last two times is kept, as a step asks for it many times, and a motion for that of its start.
        Raises CaseError where conditions contradict.
        """
        kept = self._last_u0
        if t not in kept:
            u = self.local.P @ self.local.values(t)
            for body in self.rigid:
                u[self.space.dofs(body.nodes).ravel()] = body.displacement(body.held(t))
            kept[t] = self.space.updated(u)
            kept[t].flags.writeable = False
            for earlier in list(kept)[:-2]:
                del kept[earlier]
        return kept[t]

    @cached_property
    def _last_u0(self) -> dict[float, NDArray[np.floating]]:
        """The displacements of `u0` at the last times that were asked for, by time."""
        return {}

    def displacement(self, x: Floats, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with unknowns x (n_x,), exact for finite rotations."""
        u = self.T @ x + self.u0(t)
        for body in self._turning:
            u[self.space.dofs(body.nodes).ravel()] = body.displacement(body.motion(x, t))
        return u

    def tangent(self, x: Floats, t: float) -> csr_array:
        """Return du/dx (n_dof, n_x) at x (n_x,) and time t; it is T unless a rigid body has free finite rotations.

        Raises InadmissibleError where a free rotation in space comes close to a full turn.
        """
        if not self._turning:
            return self.T
        moment_arms = tuple(body.moment_arm_at(body.motion(x, t)) for body in self.rigid)
        return with_motions(self.space, self.nodal_T, self.rigid, moment_arms)

    def unknowns(self, u: Any) -> Any:
        """Return x (n_x,) with T x = u, for a u (n_dof,) in the range of T; the nearest one for others.

        Of the columns of a sparse u (n_dof, k) it is a sparse (n_x, k).
        """
        x = self.T.T @ u  # T has orthonormal columns at the nodes' own unknowns
        if self.n_nodal == self.n_x:
            return x
        own, motions = x[: self.n_nodal], nearest_motions(self.space, csr_array(self.T[:, self.n_nodal :]), u)
        return csr_array(vstack([own, csr_array(motions)])) if issparse(u) else np.append(own, motions)

    def force(self, t: float, x: Floats | None = None) -> NDArray[np.floating]:
        """Return the forces and moments on the free motions of rigid bodies at time t, 0 elsewhere, (n_x,).

        `x` (n_x,): current unknowns; for free finite rotations the force conjugate to a moment depends on them.
        """
        f = np.zeros(self.n_x)
        for body in self.rigid:
            f[body.columns[body.free]] = body.force(t, None if x is None else body.motion(x, t))[body.free]
            f[body.columns[body.free]] *= body.unit[body.free]
        return f

    def turning(self, x: Floats, t: float, forces: Floats) -> csr_array | None:
        """Return the geometric stiffness (n_x, n_x): derivative by x of T(x)^T forces - force(t, x), `forces` fixed.

        `forces` (n_dof,) are f_int - f_ext + B^T p; of several processes the part of own nodes. None where T and force
        do not depend on x; not symmetric where a moment rotates a body in space.
        """
        if not self._turning:
            return None
        parts = []
        forces, first = self.space.of_own(forces), self.space.share.rank == 0
        for body in self._turning:
            motion, at = body.motion(x, t), body.columns[body.free]
            bent = body.curvature(motion, forces[self.space.dofs(body.nodes).ravel()])
            bent = bent - body.force_derivative(t, motion) if first else bent
            bent = bent * body.unit * body.unit[:, None]
            parts.append((at, bent[np.ix_(body.free, body.free)]))
        return sparse_blocks(self.n_x, parts)

    @cached_property
    def _turning(self) -> tuple[RigidBody, ...]:
        """Rigid bodies whose displacements are not linear in x."""
        return tuple(body for body in self.rigid if body.turns and body.free[self.space.dim :].any())


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


def nearest_motions(space: Space, T: csr_array, u: Any) -> NDArray[np.floating]:
    """Return the motions of rigid bodies, with columns T (n_dof, k), nearest to u (n_dof,), or to each column of u."""
    own, total = at_own(space, T), space.share.total
    along = own.T @ u
    return np.linalg.solve(total((own.T @ T).toarray()), total(along.toarray() if issparse(u) else along))


def at_own(space: Space, T: csr_array) -> csr_array:
    """Return T (n_dof, k) without its rows at nodes of other processes."""
    own = space.share.own
    return T if own is None else csr_array(diags_array(np.repeat(own, space.dim).astype(float)) @ T)


def _names(local: LocalBases) -> Mapping[str, Ints]:
    rows: dict[str, list[Ints]] = {}
    start = 0
    for part in local.parts:
        if part.record is not AXIS:
            rows.setdefault(name_of(part.record), []).append(np.arange(start, start + len(part.nodes)))
        start += len(part.nodes)
    return MappingProxyType({name: np.concatenate(nodes) for name, nodes in rows.items()})


def probed_times(case: Case) -> list[float]:
    """Return some times of a case: the first, middle and last of its steps, and one in between."""
    planned = case.steps.planned
    return sorted({planned[0], planned[len(planned) // 2], planned[-1], 0.618 * case.steps.last})
