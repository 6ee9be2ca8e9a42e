"""Prescribed displacements and rigid bodies of a case, as u = T q + u0(t).

T is constant and built once: it has columns for the nodes' own unknowns, node by node, then for the rigid bodies' free
motions. The stiffness on q is T^T K T, the load T^T f + force(t), and the reactions r = f_int - f_ext + B^T p satisfy
T^T r = force(t): they vanish on the nodes' own unknowns, and equal the prescribed load on a free motion.

Under finite kinematics with a freely rotating rigid body, u(q, t) is not linear: `displacement` is exact, T(q, t) its
derivative, and equilibrium is r(q) = T(q)^T (f_int - f_ext + B^T p) - force(q, t) = 0, whose tangent is
T^T K T + turning(q, t, forces), with the geometric stiffness `turning`. Otherwise T(q, t) is T, and turning is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.linalg import spsolve

from lacmesh.errors import RequestError, did_you_mean
from lacmesh.mesh import Floats, Ints
from lacsolver.case.case import Case
from lacsolver.constraints.conditions import AXIS, on_axis, prescribed
from lacsolver.constraints.local import LocalBases, combine
from lacsolver.constraints.rigid import RigidBody, check_apart, numbered, rigid_bodies
from lacsolver.space.places import name_of
from lacsolver.space.space import Space


@dataclass(frozen=True, eq=False)
class Constraints:
    """u = T q + u0(t); built by `Constraints.of`.

    `T` (n_dof, n_q): its columns at the nodes' own unknowns are orthonormal. `local`: the prescribed displacements;
    `rigid`: the rigid bodies, in the case's order. `names`: each displacement's conditions (rows of `local`), by the
    name of its reaction: its group, or `at [x, y, z]`.
    """

    space: Space
    T: csr_array
    local: LocalBases
    rigid: tuple[RigidBody, ...]
    names: Mapping[str, Ints]

    @classmethod
    def of(cls, space: Space, case: Case) -> Constraints:
        """Build the constraints of a case's displacements and rigid bodies.

        In axisymmetry nodes on the axis have ux = 0, whatever the case prescribes there. Nodes without a cell of the
        space that no rigid body moves have no unknowns: components that are not prescribed there are 0.

        Raises CaseError, with the lines of the records concerned, for groups and places that are missing or empty, `un`
        of a group that is no skin, conditions that contradict each other at a node (checked at some of the case's times
        here, and at every time by `u0`), a node in two rigid bodies, or a node of one that is prescribed too.
        """
        parts = prescribed(space, case.displacement)
        rigid = rigid_bodies(space, case.rigid, case.kinematics == "finite", case.gravity)
        check_apart(space, rigid, parts)
        moved = np.concatenate([np.empty(0, np.int64), *(body.nodes for body in rigid)])
        local = combine(space, (*parts, *on_axis(space, moved)))
        own, n = _own_unknowns(space, local, rigid)
        rigid = numbered(rigid, n)
        made = cls(space, _shared(space, _map(space, local, own, n, rigid), own), local, rigid, _names(local))
        for t in _probed(case):
            made.u0(t)
        return made

    @property
    def n_q(self) -> int:
        """Number of unknowns q."""
        return self.T.shape[1]

    @cached_property
    def own(self) -> NDArray[np.bool_] | None:
        """Mask (n_q,) of the unknowns at this process's own nodes; None if all are."""
        return None if self.space.share.own is None else self.space.share.own[self.node_of_unknown]

    @cached_property
    def common(self) -> Ints | None:
        """Unknowns at nodes of contact skins, which all processes have in this order; None for a process alone."""
        return (
            None if self.space.share.common is None else np.flatnonzero(self.space.share.common[self.node_of_unknown])
        )

    @cached_property
    def node_of_unknown(self) -> Ints:
        """Node (n_q,) of each unknown, the first one for the motion of a rigid body."""
        T = self.T.tocsc()
        return T.indices[T.indptr[:-1]] // self.space.dim

    def u0(self, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with q = 0. Raises CaseError where conditions contradict."""
        u = self.local.P @ self.local.values(t)
        for body in self.rigid:
            u[self.space.dofs(body.nodes).ravel()] = body.displacement(body.held(t))
        return self.space.updated(u)

    def displacement(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with unknowns q (n_q,), exact for finite rotations."""
        u = self.T @ q + self.u0(t)
        for body in self._turning:
            u[self.space.dofs(body.nodes).ravel()] = body.displacement(body.motion(q, t))
        return u

    def tangent(self, q: Floats, t: float) -> csr_array:
        """Return du/dq (n_dof, n_q) at q (n_q,) and time t; it is T unless a rigid body has free finite rotations.

        Raises InadmissibleError where a free rotation in space comes close to a full turn.
        """
        if not self._turning:
            return self.T
        own, n = _own_unknowns(self.space, self.local, self.rigid)
        moment_arms = tuple(body.moment_arm_at(body.motion(q, t)) for body in self.rigid)
        return _map(self.space, self.local, own, n, self.rigid, moment_arms)

    def unknowns(self, u: Floats) -> NDArray[np.floating]:
        """Return q (n_q,) with T q = u, for a u (n_dof,) in the range of T; the nearest one for others."""
        if self.is_selection:
            return u[self.free]
        if not self.rigid:  # orthonormal columns
            return np.asarray(self.T.T @ u)
        return np.asarray(spsolve(csc_array(self.T.T @ self.T), self.T.T @ u))

    def updated(self, q: Floats) -> NDArray[np.floating]:
        """Return unknowns q (n_q,) with the values at the nodes of other processes that they have."""
        return q if self.own is None else np.asarray(self.T.T @ self.space.updated(self.T @ q))

    def force(self, t: float, q: Floats | None = None) -> NDArray[np.floating]:
        """Return the forces and moments on the free motions of rigid bodies at time t, 0 elsewhere, (n_q,).

        `q` (n_q,): current unknowns; for free finite rotations the force conjugate to a moment depends on them.
        """
        f = np.zeros(self.n_q)
        for body in self.rigid:
            f[body.columns[body.free]] = body.force(t, None if q is None else body.motion(q, t))[body.free]
            f[body.columns[body.free]] *= body.unit[body.free]
        return f

    def turning(self, q: Floats, t: float, forces: Floats) -> csr_array | None:
        """Return the geometric stiffness (n_q, n_q): derivative by q of T(q)^T forces - force(t, q), `forces` fixed.

        `forces` (n_dof,) are f_int - f_ext + B^T p. None where T and force do not depend on q; not symmetric where a
        moment rotates a body in space.
        """
        if not self._turning:
            return None
        rows, columns, values = [], [], []
        for body in self._turning:
            motion, at = body.motion(q, t), body.columns[body.free]
            bent = body.curvature(motion, forces[self.space.dofs(body.nodes).ravel()]) - body.force_derivative(
                t, motion
            )
            rows.append(np.repeat(at, len(at)))
            columns.append(np.tile(at, len(at)))
            bent = bent * body.unit * body.unit[:, None]
            values.append(bent[np.ix_(body.free, body.free)].ravel())
        made = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return coo_array(made, shape=(self.n_q, self.n_q)).tocsr()

    @cached_property
    def _turning(self) -> tuple[RigidBody, ...]:
        """Rigid bodies whose displacements are not linear in q."""
        return tuple(body for body in self.rigid if body.turns and body.free[self.space.dim :].any())

    def rigid_motion(self, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return each rigid body's displacement of its centre, then its rotation (3 in 3D, 1 in a plane), by group."""
        return {body.name: body.motion(q, t) for body in self.rigid}

    @cached_property
    def is_selection(self) -> bool:
        """True if T merely selects unknowns of u, so that T^T K T is K[free][:, free]."""
        one_each = np.diff(self.T.tocsc().indptr) == 1
        return bool(one_each.all() and (self.T.data == 1.0).all() and self.T.has_canonical_format)

    @cached_property
    def free(self) -> Ints:
        """Index (n_q,) into u of each unknown q. Raises ValueError unless `is_selection`."""
        if not self.is_selection:
            raise ValueError("q are no unknowns of u: multiply with T")
        return self.T.tocsc().indices

    def reactions(self, reaction: Floats) -> dict[str, NDArray[np.floating]]:
        """Return the share (dim,) of each displacement and rigid body in the reactions (n_dof,) at the nodes.

        If two conditions at a node are dependent, the earlier one carries the force, so that the shares add up to the
        whole. The share of a rigid body is that of all forces on its nodes, including the loads on its free motions.
        """
        own, share = self.local.forces(reaction), self.space.share
        shares = {name: share.total(own[rows].sum(axis=0)) for name, rows in self.names.items()}
        return shares | {name: m[: self.space.dim] for name, m in self.rigid_reactions(reaction).items()}

    def reaction(self, name: str, reaction: Floats) -> NDArray[np.floating]:
        """Return one of the `reactions` (dim,), by name. Raises RequestError for an unknown name."""
        found = self.reactions(reaction)
        if name not in found:
            raise RequestError(f"no displacement or rigid body named {name!r}{did_you_mean(name, found)}")
        return found[name]

    def rigid_reactions(
        self, reaction: Floats, motions: Mapping[str, Floats] | None = None
    ) -> dict[str, NDArray[np.floating]]:
        """Return each rigid body's force, then its moment about the centre (3 in 3D, 1 in a plane), of reactions.

        `reaction` (n_dof,). `motions`: those of `rigid_motion`, for finite rotations: moments are then about the
        displaced centre.
        """
        at, where, total = self.space.dofs, motions or {}, self.space.share.total
        return {
            body.name: total(body.resultant(reaction[at(body.nodes).ravel()], where.get(body.name)))
            for body in self.rigid
        }


def _own_unknowns(space: Space, local: LocalBases, rigid: tuple[RigidBody, ...]) -> tuple[Ints, int]:
    """Return the first of each node's own unknowns in q, (n_nodes,), -1 for none, and the number of such unknowns."""
    count = np.where(space.attached, space.dim, 0)
    count[local.nodes] = np.where(space.attached[local.nodes], local.n_free, 0)
    for body in rigid:
        count[body.nodes] = 0
    first = np.cumsum(count) - count
    return np.where(count > 0, first, -1), int(count.sum())


def _map(
    space: Space,
    local: LocalBases,
    own: Ints,
    n: int,
    rigid: tuple[RigidBody, ...],
    moment_arms: tuple[NDArray[np.floating], ...] | None = None,
) -> csr_array:
    """Return T from the first own unknown of each node, n own unknowns in all, and the moment_arms of the rigid bodies.

    `moment_arms`: other moment arms than the bodies' own, for finite rotations.
    """
    alone = own >= 0
    alone[local.nodes] = False
    whole = np.flatnonzero(alone)
    entries: list[tuple[Ints, Ints, Floats]] = []
    entries.append((space.dofs(whole), own[whole, None] + np.arange(space.dim), np.ones((len(whole), space.dim))))
    k, j = np.nonzero((own[local.nodes, None] >= 0) & (np.arange(space.dim) < local.n_free[:, None]))
    entries.append((space.dofs(local.nodes[k]), (own[local.nodes[k]] + j)[:, None], local.basis[k, j]))
    for body, moment_arm in zip(rigid, moment_arms or [body.moment_arm for body in rigid], strict=True):
        rows = space.dofs(body.nodes).reshape(-1, 1)
        entries.append((rows, body.columns[body.free], (moment_arm * body.unit)[:, body.free]))
        n += int(body.free.sum())
    spread = [np.broadcast_arrays(*entry) for entry in entries]
    row, column, value = (np.concatenate([part[a].ravel() for part in spread]) for a in range(3))
    T = coo_array((value, (row, column)), shape=(space.n_dof, n)).tocsr()
    if moment_arms is None:
        T.eliminate_zeros()
    return T


def _shared(space: Space, T: csr_array, own: Ints) -> csr_array:
    """Return T with the blocks at the nodes of other processes that they have; `own` (n_nodes,) as for `_map`."""
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
    entry = shared[node, s, j], (dim * node + s, first[node] + j)
    return coo_array(entry, shape=(space.n_dof, int(used.sum()))).tocsr()


def _names(local: LocalBases) -> Mapping[str, Ints]:
    rows: dict[str, list[Ints]] = {}
    start = 0
    for part in local.parts:
        if part.record is not AXIS:
            rows.setdefault(name_of(part.record), []).append(np.arange(start, start + len(part.nodes)))
        start += len(part.nodes)
    return MappingProxyType({name: np.concatenate(found) for name, found in rows.items()})


def _probed(case: Case) -> list[float]:
    """Return some times of a case: the first, middle and last of its steps, and one in between."""
    planned = case.steps.planned
    return sorted({planned[0], planned[len(planned) // 2], planned[-1], 0.618 * case.steps.last})
