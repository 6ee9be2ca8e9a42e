"""Constraints of a case as u = T q + u0(t): a chain of two maps, those of supports and of equations.

    u = T_s x + u0(t)         prescribed displacements and rigid bodies (`supports`)
    x = Z q + Y h(t)          linear equations, which have eliminated some of the unknowns x (`equations`)

T = T_s Z is constant. The stiffness on q is T^T K T, the load T^T f + force(t), and the reactions r = f_int - f_ext +
B^T p satisfy T^T r = force(t): they vanish on the nodes' own unknowns, and equal the prescribed load on a free motion.
Further unknowns s of equations come after those of the supports in x.

Under finite kinematics with a freely rotating rigid body, u(q, t) is not linear: `displacement` is exact, T(q, t) its
derivative, and equilibrium is r(q) = T(q)^T (f_int - f_ext + B^T p) - force(q, t) = 0, whose tangent is
T^T K T + turning(q, t, forces), with the geometric stiffness `turning`. Otherwise T(q, t) is T, and turning is None.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, vstack
from scipy.sparse.linalg import SuperLU

from lacmesh.errors import LacmeshWarning, RequestError, did_you_mean
from lacmesh.mesh import Floats, Ints
from lacsolver.case.case import Case
from lacsolver.case.errors import CaseError, Issue
from lacsolver.constraints.equations import Equations, EquationSystem, contradiction, following, stacked, words_of
from lacsolver.constraints.local import LocalBases
from lacsolver.constraints.rigid import RigidBody
from lacsolver.constraints.supports import Supports, at_own, nearest_motions
from lacsolver.linear import Matrix
from lacsolver.linear.direct.superlu import factor_of
from lacsolver.space.space import Space

#: rotations (radians) by which a row is tried, and a change that is round-off, relative to the extent
_ANGLES, _ALONG = (-0.7, 1.0, 2.0), 1e-12
#: displacement that is round-off, relative to the bodies' extent
_ROUNDING = 1e-6 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Constraints:
    """u = T q + u0(t); built by `Constraints.of` and `with_equations`.

    `supports`: prescribed displacements and rigid bodies; `equations`: those that have eliminated some of their
    unknowns, by way of the `system` of all of them, None without any.
    """

    space: Space
    supports: Supports
    equations: tuple[Equations, ...] = ()
    system: EquationSystem | None = None

    @classmethod
    def of(cls, space: Space, case: Case) -> Constraints:
        """Build the constraints of a case's displacements and rigid bodies. Raises CaseError as `Supports.of` does."""
        return cls(space, Supports.of(space, case))

    def with_equations(self, equations: tuple[Equations, ...], times: list[float]) -> Constraints:
        """Return these constraints with equations, the same ones if there are none.

        Of several processes all have all nodes of equations, and one process owns those of equations that share
        unknowns (`of_case.node_sets`), so that all choose the same unknowns to eliminate, and rows of own nodes are
        complete. Equations that follow from others are warned of. Raises CaseError for those that contradict one
        another at one of the `times`, hold a rigid body that turns freely by finite rotations, or, in several
        processes, join nodes by the motion of a rigid body.
        """
        if not equations:
            return self
        _check_turning(self, equations, times)
        system = EquationSystem.of(stacked(equations, self.T), self.n_nodal)
        _check_owners(self, equations, system)
        out = replace(self, equations=equations, system=system)
        for t in times:
            out.u0(t)
        if message := following(equations, system):
            warnings.warn(LacmeshWarning(message), stacklevel=4)
        return out

    @cached_property
    def plain(self) -> Constraints:
        """These constraints without equations."""
        return self if self.system is None else Constraints(self.space, self.supports)

    # ---- unknowns

    @cached_property
    def T(self) -> csr_array:
        """Matrix (n_dof, n_q) of the constraints."""
        return self.through_equations(self.supports.T)

    @property
    def n_q(self) -> int:
        """Number of unknowns q."""
        return self.T.shape[1]

    @property
    def local(self) -> LocalBases:
        """The prescribed displacements."""
        return self.supports.local

    @property
    def rigid(self) -> tuple[RigidBody, ...]:
        """The rigid bodies, in the case's order."""
        return self.supports.rigid

    @property
    def names(self) -> Mapping[str, Ints]:
        """Conditions of each displacement, rows of `local`, by the name of its reaction."""
        return self.supports.names

    @cached_property
    def _kept(self) -> Ints:
        """Index (n_q,) in x of each unknown q."""
        return np.arange(self.supports.n_x) if self.system is None else self.system.kept

    @cached_property
    def n_nodal(self) -> int:
        """Number of the nodes' own unknowns, which come before free motions of rigid bodies and further unknowns."""
        return int(np.searchsorted(self._kept, self.supports.n_nodal))

    @cached_property
    def nodal_T(self) -> csr_array:
        """T at the nodes' own unknowns (n_dof, n_nodal)."""
        return self.T if self.n_nodal == self.n_q else csr_array(self.T[:, : self.n_nodal])

    @cached_property
    def at_nodes(self) -> Constraints:
        """Constraints whose T takes each of the nodes' own unknowns to its own node, and to no other."""
        if self.system is None and self.n_nodal == self.n_q:
            return self
        T = csr_array(self.supports.T[:, self._kept[: self.n_nodal]])
        return Constraints(self.space, replace(self.supports, T=T, rigid=()))

    @cached_property
    def node_of_unknown(self) -> Ints:
        """Node (n_nodal,) of each of the nodes' own unknowns."""
        return self.supports.node_of_unknown[self._kept[: self.n_nodal]]

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
        if self.system is not None:
            without = self.plain.places
            return without[self._kept] if without is not None and self.n_nodal == self.n_q else None
        if self.is_selection:
            return self.free
        if self.n_nodal < self.n_q:
            return None
        node = self.node_of_unknown
        return np.asarray(self.space.dim * node + np.arange(len(node)) - np.searchsorted(node, node))

    def unknowns(self, u: Floats) -> NDArray[np.floating]:
        """Return q (n_q,) with T q = u, for a u (n_dof,) in the range of T; the nearest one for others.

        With equations and several processes, for others the one with the values of u at the nodes whose unknowns are
        kept.
        """
        if self.system is None:
            return np.asarray(self.supports.unknowns(u))
        if self.own is None:
            q = self._normal.solve(self.T.T @ u)
            return q + self._normal.solve(self.T.T @ (u - self.T @ q))
        at_nodes = np.asarray(self.at_nodes.T.T @ u)
        if self.n_nodal == self.n_q:
            return at_nodes
        beside = u - self.nodal_T @ at_nodes
        return np.append(at_nodes, nearest_motions(self.space, csr_array(self.T[:, self.n_nodal :]), beside))

    @cached_property
    def _normal(self) -> SuperLU:
        return factor_of(csc_array(self.T.T @ self.T))

    def updated(self, q: Floats) -> NDArray[np.floating]:
        """Return unknowns q (n_q,) with the values at the nodes of other processes that they have."""
        if self.own is None:
            return q
        n, T = self.n_nodal, self.at_nodes.T
        return np.append(T.T @ self.space.updated(T @ q[:n]), q[n:])

    # ---- displacements

    def before_equations(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the unknowns x of the supports, then the further unknowns, for q (n_q,) at time t."""
        return q if self.system is None else self.system.Z @ q + self._offset(t)

    def through_equations(self, rows: csr_array) -> csr_array:
        """Return rows (k, n_x) on the unknowns of the supports as rows (k, n_q) on q."""
        return rows if self.system is None else csr_array(rows @ self.system.Z[: self.supports.n_x])

    def u0(self, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with q = 0. Raises CaseError where conditions contradict."""
        if self.system is None:
            return self.supports.u0(t)
        return self.supports.displacement(self._offset(t)[: self.supports.n_x], t)

    def displacement(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with unknowns q (n_q,), exact for finite rotations."""
        return self.supports.displacement(self._x(q, t), t)

    def tangent(self, q: Floats, t: float) -> csr_array:
        """Return du/dq (n_dof, n_q) at q (n_q,) and time t; it is T unless a rigid body has free finite rotations.

        Raises InadmissibleError where a free rotation in space comes close to a full turn.
        """
        T = self.supports.tangent(self._x(q, t), t)
        return self.T if T is self.supports.T else self.through_equations(T)

    def rigid_motion(self, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return each rigid body's displacement of its centre, then its rotation (3 in 3D, 1 in a plane), by group."""
        x = self._x(q, t)
        return {body.name: body.motion(x, t) for body in self.rigid}

    def further(self, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return the further unknowns (n_s,) of each record that has some, by name."""
        s, out = self.before_equations(q, t)[self.supports.n_x :], {}
        for one in self.equations:
            if one.n_further:
                out[one.name], s = s[: one.n_further], s[one.n_further :]
        return out

    def _x(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the unknowns (n_x,) of the supports."""
        return self.before_equations(q, t)[: self.supports.n_x]

    def _offset(self, t: float) -> NDArray[np.floating]:
        """Return Y h(t) (n_x,); that of the last time is kept. Raises CaseError where equations contradict."""
        assert self.system is not None
        if self._last[0] != t:
            g = np.concatenate([np.asarray(one.values(t), float) for one in self.equations])
            u0 = self.supports.u0(t)
            terms = np.abs(g) + abs(self._C) @ np.abs(u0) + _ROUNDING * self.space.extent
            h = g - self._C @ u0
            error = contradiction(self.equations, self.system, h, t, terms)
            if error is not None:
                raise error
            self._last[:] = [t, self.system.offset(h)]
        return self._last[1]

    @cached_property
    def _last(self) -> list:
        return [None, None]

    @cached_property
    def _C(self) -> csr_array:
        """The coefficients (k, n_dof) of all equations."""
        return csr_array(vstack([one.C for one in self.equations]))

    # ---- forces

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
        return csr_array((at_own(self.space, T).T @ K @ T).tocsr())

    def force(self, t: float, q: Floats | None = None) -> NDArray[np.floating]:
        """Return the forces and moments (n_q,) on free motions and further unknowns at time t, 0 elsewhere.

        `q` (n_q,): current unknowns; for free finite rotations the force conjugate to a moment depends on them.
        """
        f = self._force_before_equations(t, q)
        return f if self.system is None else np.asarray(self.system.Z.T @ f)

    def _force_before_equations(self, t: float, q: Floats | None) -> NDArray[np.floating]:
        """Return the loads on the unknowns of the supports and on the further ones."""
        of_supports = self.supports.force(t, None if q is None else self._x(q, t))
        return np.concatenate([of_supports, *(one.load(t) for one in self.equations)])

    def turning(self, q: Floats, t: float, forces: Floats) -> csr_array | None:
        """Return the geometric stiffness (n_q, n_q) of rigid bodies that turn: see `Supports.turning`."""
        bent = self.supports.turning(self._x(q, t), t, forces)
        if bent is None or self.system is None:
            return bent
        Z = self.system.Z[: self.supports.n_x]
        return csr_array(Z.T @ bent @ Z)

    def equation_forces(self, reaction: Floats, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return the forces (k,) of each record's equations in the reactions (n_dof,) at the nodes, by name.

        Equations C u = g act on the bodies by C^T times them.
        """
        if self.system is None:
            return {}
        r = -self._force_before_equations(t, q)
        r[: self.supports.n_x] += self.plain.on_unknowns(reaction, self.supports.tangent(self._x(q, t), t))
        forces = self.system.forces(self._from_owners(r))
        parts = np.split(forces, np.cumsum([one.C.shape[0] for one in self.equations])[:-1])
        return {one.name: part for one, part in zip(self.equations, parts, strict=True)}

    def _from_owners(self, r: Floats) -> NDArray[np.floating]:
        """Return r (n_x,) with the values at eliminated unknowns of nodes that their owners have."""
        own = self.plain.own
        if own is None or self.system is None:
            return r
        at = self.system.columns[self.system.columns < self.supports.n_nodal]
        out = r.copy()
        out[at] = self.space.share.total(np.where(own[at], r[at], 0.0))
        return out

    def of_supports(self, reaction: Floats, forces: Mapping[str, Floats]) -> NDArray[np.floating]:
        """Return reactions (n_dof,) without the `forces` of the equations."""
        own = [forces[one.name] for one in self.equations if one.name in forces]
        return reaction - self._C.T @ np.concatenate(own) if own and len(own) == len(self.equations) else reaction

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


def _check_owners(plain: Constraints, equations: tuple[Equations, ...], system: EquationSystem) -> None:
    """Raise CaseError for an equation that makes an unknown of one process that of nodes of another.

    The motion of a rigid body is one of all processes, and so is a further unknown: nodes of several may be joined by
    one that is eliminated.
    """
    if plain.own is None:
        return
    Z = csr_array(system.Z[: plain.n_q])[:, system.kept < plain.n_nodal].tocoo()
    owned = plain.own & (np.arange(plain.n_q) < plain.n_nodal)
    column = system.kept[Z.col]
    wrong = np.unique(Z.row[(owned[Z.row] != owned[column]) | (Z.row >= plain.n_nodal)])
    first = plain.space.share.gather(np.flatnonzero(np.isin(system.columns, wrong))[:1])
    if len(first):
        message = f"{words_of(equations, int(system.rows[first.min()]))} joins nodes by the motion of a whole"
        raise CaseError([Issue(f"{message}, which is solved by one process only; run the case in one")])


def _check_turning(plain: Constraints, equations: tuple[Equations, ...], times: list[float]) -> None:
    """Raise CaseError for an equation of a rigid body that is not linear in the body's free rotation."""
    dim = plain.space.dim
    for body in plain.rigid:
        if not (body.turns and body.free[dim:].any()):
            continue
        moved = np.zeros(plain.space.n_dof)
        moved[plain.space.dofs(body.nodes).ravel()] = 1.0
        for one in equations:
            rows = np.flatnonzero(abs(one.C) @ moved)
            rows = rows[_turned(plain.space, body, csr_array(one.C[rows]), times)]
            if len(rows):
                message = f"{one.said(int(rows[0]))} has a node of rigid {body.name!r}, which turns freely"
                message = (
                    f"{message} by finite rotations; prescribe its rotation about all axes except one, along which "
                )
                raise CaseError([Issue(f"{message}the nodes are constrained, or remove the nodes")])


def _turned(space: Space, body: RigidBody, C: csr_array, times: list[float]) -> NDArray[np.bool_]:
    """Return a mask (k,) of rows C (k, n_dof) that a body's free rotation changes: not those along its only axis."""
    free = space.dim + np.flatnonzero(body.free[space.dim :])
    if len(free) > 1:
        return np.ones(C.shape[0], bool)
    out, rows = np.zeros(C.shape[0], bool), csr_array(C[:, space.dofs(body.nodes).ravel()])
    for t in times:
        still = body.displacement(body.held(t))
        for angle in _ANGLES:
            motion = body.held(t)
            motion[free] = angle
            change = body.displacement(motion) - still
            out |= np.abs(rows @ change) > _ALONG * (abs(rows) @ np.abs(change) + space.extent)
    return out
