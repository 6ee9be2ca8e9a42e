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
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, issparse, vstack

from lacmesh.errors import RequestError, did_you_mean
from lacmesh.mesh import Floats, Ints, concatenated, mask_of
from lacsolver.case.case import Case
from lacsolver.constraints.conditions import AXIS, on_axis, prescribed
from lacsolver.constraints.coupling import rigid_records
from lacsolver.constraints.equations import Equations
from lacsolver.constraints.local import LocalBases, combine
from lacsolver.constraints.matrix import nodal_map, with_motions
from lacsolver.constraints.rigid import RigidBody, numbered, rigid_bodies
from lacsolver.constraints.shared import without
from lacsolver.linear import Matrix
from lacsolver.space.places import name_of
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse_blocks


@dataclass(frozen=True, eq=False)
class Constraints:
    """u = T q + u0(t); built by `Constraints.of`.

    `T` (n_dof, n_q): its columns at the nodes' own unknowns are orthonormal. `local`: the prescribed displacements;
    `rigid`: the rigid bodies, in the case's order. `names`: each displacement's conditions (rows of `local`), by the
    name of its reaction: its group, or `at [x, y, z]`. `equations`: those that have eliminated some of the unknowns
    (`equated`), none here.
    """

    space: Space
    T: csr_array
    local: LocalBases
    rigid: tuple[RigidBody, ...]
    names: Mapping[str, Ints]
    equations: tuple[Equations, ...] = ()

    @classmethod
    def of(cls, space: Space, case: Case) -> Constraints:
        """Build the constraints of a case's displacements and rigid bodies.

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
        parts = without(parts, mask_of(space.mesh.n_nodes, moved))
        local = combine(space, (*parts, *on_axis(space, moved)))
        nodal = nodal_map(space, local, rigid)
        rigid = numbered(rigid, nodal.shape[1])
        constraints = cls(space, with_motions(space, nodal, rigid), local, rigid, _names(local))
        for t in probed_times(case):
            constraints.u0(t)
        return constraints

    @property
    def n_q(self) -> int:
        """Number of unknowns q."""
        return self.T.shape[1]

    @cached_property
    def n_nodal(self) -> int:
        """Number of the nodes' own unknowns, which come before the free motions of rigid bodies."""
        return self.n_q - sum(int(body.free.sum()) for body in self.rigid)

    @cached_property
    def nodal(self) -> Constraints:
        """The constraints without free motions of rigid bodies, on the nodes' own unknowns."""
        return self if self.n_nodal == self.n_q else replace(self, T=csr_array(self.T[:, : self.n_nodal]), rigid=())

    @property
    def at_nodes(self) -> Constraints:
        """Constraints whose T takes each of the nodes' own unknowns to its own node, and to no other."""
        return self.nodal

    @cached_property
    def own(self) -> NDArray[np.bool_] | None:
        """Mask (n_q,) of the unknowns that count for this process; None if all do.

        They are those at its own nodes, and on the first process the motions of rigid bodies, which all processes have.
        """
        share = self.space.share
        if share.own is None:
            return None
        return np.append(share.own[self.node_of_unknown], np.full(self.n_q - self.n_nodal, share.rank == 0))

    @cached_property
    def common(self) -> Ints | None:
        """Unknowns at nodes that all processes have, and motions, in an order that all have; None for one process."""
        if self.space.share.common is None:
            return None
        at_nodes = np.flatnonzero(self.space.share.common[self.node_of_unknown])
        return np.append(at_nodes, np.arange(self.n_nodal, self.n_q))

    @cached_property
    def node_of_unknown(self) -> Ints:
        """Node (n_nodal,) of each of the nodes' own unknowns."""
        T = self.T[:, : self.n_nodal].tocsc()
        return T.indices[T.indptr[:-1]] // self.space.dim

    def summed(self, f: Floats) -> NDArray[np.floating]:
        """Return forces f (n_q,) with the sums over all processes on the motions of rigid bodies.

        Forces on them, and their rows of matrices, are sums over nodes, of which each process has its own part.
        """
        if self.own is None or self.n_nodal == self.n_q:
            return f
        return np.append(f[: self.n_nodal], self.space.share.total(f[self.n_nodal :]))

    def on_unknowns(self, f: Floats, T: csr_array | None = None) -> NDArray[np.floating]:
        """Return T^T f (n_q,) of forces f (n_dof,) at own nodes; `T`: that of `tangent`, the constant one if None."""
        T = self.T if T is None else T
        return self.summed(np.asarray(T.T @ self.space.of_own(f)))

    def reduced(self, K: Matrix, T: csr_array) -> csr_array:
        """Return T^T K T (n_q, n_q), of several processes the part of own nodes: see `summed`."""
        if self.is_selection:
            return csr_array(K.tocsr()[self.free][:, self.free])
        return csr_array((self._at_own(T).T @ K @ T).tocsr())

    def _at_own(self, T: csr_array) -> csr_array:
        """Return T (n_dof, k) without its rows at nodes of other processes."""
        own = self.space.share.own
        return T if own is None else csr_array(diags_array(np.repeat(own, self.space.dim).astype(float)) @ T)

    def u0(self, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with q = 0, not to be written to.

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
        moment_arms = tuple(body.moment_arm_at(body.motion(q, t)) for body in self.rigid)
        return with_motions(self.space, self.nodal.T, self.rigid, moment_arms)

    def unknowns(self, u: Any) -> Any:
        """Return q (n_q,) with T q = u, for a u (n_dof,) in the range of T; the nearest one for others.

        Of the columns of a sparse u (n_dof, k) it is a sparse (n_q, k).
        """
        if self.is_selection:
            return u[self.free]
        q = self.T.T @ u  # T has orthonormal columns at the nodes' own unknowns
        if self.n_nodal == self.n_q:
            return q
        own, motions = q[: self.n_nodal], self._motions(u)
        return csr_array(vstack([own, csr_array(motions)])) if issparse(u) else np.append(own, motions)

    def _motions(self, u: Any) -> NDArray[np.floating]:
        """Return the motions of rigid bodies that are nearest to u (n_dof,), or to the columns of a sparse one."""
        T = self._at_own(csr_array(self.T[:, self.n_nodal :]))
        along, total = T.T @ u, self.space.share.total
        return np.linalg.solve(total((T.T @ T).toarray()), total(along.toarray() if issparse(u) else along))

    @cached_property
    def constrained(self) -> Ints:
        """Indices of the displacements (k,) that are not unknowns by themselves."""
        T, out = self.T[:, : self.n_nodal].tocsc(), np.ones(self.space.n_dof, bool)
        alone = T.indptr[:-1][np.diff(T.indptr) == 1]
        out[T.indices[alone[T.data[alone] == 1.0]]] = False
        return np.flatnonzero(out)

    def updated(self, q: Floats) -> NDArray[np.floating]:
        """Return unknowns q (n_q,) with the values at the nodes of other processes that they have."""
        if self.own is None:
            return q
        n, T = self.n_nodal, self.at_nodes.T
        return np.append(T.T @ self.space.updated(T @ q[:n]), q[n:])

    @property
    def plain(self) -> Constraints:
        """These constraints without equations."""
        return self

    def before_equations(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the unknowns of prescribed displacements and rigid bodies alone, which are q without equations."""
        return q

    def through_equations(self, rows: csr_array) -> csr_array:
        """Return rows (k, n) on these unknowns as rows (k, n_q) on q."""
        return rows

    def further(self, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return the further unknowns of equations, by name: none here."""
        return {}

    def equation_forces(self, reaction: Floats, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return the forces of equations in the reactions (n_dof,), by name: none here."""
        return {}

    def of_supports(self, reaction: Floats, forces: Mapping[str, Floats]) -> NDArray[np.floating]:
        """Return reactions (n_dof,) without the `forces` of equations."""
        return reaction

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

        `forces` (n_dof,) are f_int - f_ext + B^T p; of several processes the part of own nodes: see `summed`. None
        where T and force do not depend on q; not symmetric where a moment rotates a body in space.
        """
        if not self._turning:
            return None
        parts = []
        forces, first = self.space.of_own(forces), self.space.share.rank == 0
        for body in self._turning:
            motion, at = body.motion(q, t), body.columns[body.free]
            bent = body.curvature(motion, forces[self.space.dofs(body.nodes).ravel()])
            bent = bent - body.force_derivative(t, motion) if first else bent
            bent = bent * body.unit * body.unit[:, None]
            parts.append((at, bent[np.ix_(body.free, body.free)]))
        return sparse_blocks(self.n_q, parts)

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
        if self.space.share.own is not None and self.n_nodal < self.n_q:
            return False  # on all processes, even if the body has one node
        one_each = np.diff(self.T.tocsc().indptr) == 1
        return bool(one_each.all() and (self.T.data == 1.0).all() and self.T.has_canonical_format)

    @cached_property
    def free(self) -> Ints:
        """Index (n_q,) into u of each unknown q. Raises ValueError unless `is_selection`."""
        if not self.is_selection:
            raise ValueError("q are no unknowns of u: multiply with T")
        return self.T.tocsc().indices

    @cached_property
    def places(self) -> Ints | None:
        """Index (n_q,) of each unknown among as many as there are displacements; None if some belong to no node.

        An unknown along an axis of the mesh has the place of that displacement, one along a local axis any of its node.
        """
        if self.is_selection:
            return self.free
        if self.n_nodal < self.n_q:
            return None
        node = self.node_of_unknown
        return np.asarray(self.space.dim * node + np.arange(len(node)) - np.searchsorted(node, node))

    def reactions(
        self, reaction: Floats, equations: Mapping[str, Floats] = MappingProxyType({})
    ) -> dict[str, NDArray[np.floating]]:
        """Return the share (dim,) of each displacement and rigid body in the reactions (n_dof,) at the nodes.

        `equations`: the forces of equations, by name, of which the reactions are freed before (`equation_forces`).

        If two conditions at a node are dependent, the earlier one carries the force, so that the shares add up to the
        whole. The share of a rigid body is that of all forces on its nodes, including the loads on its free motions.
        """
        reaction = self.of_supports(reaction, equations)
        own, share = self.local.forces(reaction), self.space.share
        shares = {name: share.total(own[rows].sum(axis=0)) for name, rows in self.names.items()}
        return shares | {name: m[: self.space.dim] for name, m in self.rigid_reactions(reaction).items()}

    def reaction(self, name: str, reaction: Floats) -> NDArray[np.floating]:
        """Return one of the `reactions` (dim,), by name. Raises RequestError for an unknown name."""
        reactions = self.reactions(reaction)
        if name not in reactions:
            raise RequestError(f"no displacement or rigid body named {name!r}{did_you_mean(name, reactions)}")
        return reactions[name]

    def rigid_reactions(
        self, reaction: Floats, motions: Mapping[str, Floats] | None = None
    ) -> dict[str, NDArray[np.floating]]:
        """Return each rigid body's force, then its moment about the centre (3 in 3D, 1 in a plane), of reactions.

        `reaction` (n_dof,). `motions`: those of `rigid_motion`, for finite rotations: moments are then about the
        displaced centre.
        """
        at, where, total = self.space.dofs, motions or {}, self.space.share.total
        reaction = self.space.of_own(reaction)
        return {
            body.name: total(body.resultant(reaction[at(body.nodes).ravel()], where.get(body.name)))
            for body in self.rigid
        }


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
