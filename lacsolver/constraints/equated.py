"""Constraints with linear equations: u = T q + u0(t), where the equations have eliminated unknowns of the others.

The constraints of displacements and rigid bodies alone have the unknowns x, less the further unknowns s of equations,
which come after them: x = Z q + Y h(t), see `equations`.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, vstack
from scipy.sparse.linalg import SuperLU

from lacmesh.errors import LacmeshWarning
from lacmesh.mesh import Floats, Ints
from lacsolver.case.errors import CaseError, Issue
from lacsolver.constraints.constraints import Constraints
from lacsolver.constraints.equations import Equations, EquationSystem, contradiction, following, stacked, words_of
from lacsolver.constraints.rigid import RigidBody
from lacsolver.linear.direct.superlu import factor_of
from lacsolver.space.space import Space

#: rotations (radians) by which a row is tried, and a change that is round-off, relative to the extent
_ANGLES, _ALONG = (-0.7, 1.0, 2.0), 1e-12
#: displacement that is round-off, relative to the bodies' extent
_ROUNDING = 1e-6 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class EquatedConstraints(Constraints):
    """Constraints with equations; built by `EquatedConstraints.with_equations`.

    `before`: the constraints without them; `system`: the equations on the unknowns x.
    """

    before: Constraints = field(kw_only=True)
    system: EquationSystem = field(kw_only=True)

    @classmethod
    def with_equations(cls, plain: Constraints, equations: tuple[Equations, ...], times: list[float]) -> Constraints:
        """Return constraints with equations, which are the plain ones if there is none.

        Of several processes all have all nodes of equations, and one process owns those of equations that share
        unknowns (`of_case.node_sets`), so that all choose the same unknowns to eliminate, and rows of own nodes are
        complete. Equations that follow from others are warned of. Raises CaseError for those that contradict one
        another at one of the `times`, hold a rigid body that turns freely by finite rotations, or, in several
        processes, join nodes by the motion of a rigid body.
        """
        if not equations:
            return plain
        _check_turning(plain, equations, times)
        system = EquationSystem.of(stacked(equations, plain.T), plain.n_nodal)
        _check_owners(plain, equations, system)
        T = csr_array(plain.T @ system.Z[: plain.n_q])
        out = cls(plain.space, T, plain.local, plain.rigid, plain.names, equations, before=plain, system=system)
        for t in times:
            out.u0(t)
        if message := following(equations, system):
            warnings.warn(LacmeshWarning(message), stacklevel=5)
        return out

    @property
    def plain(self) -> Constraints:
        """The constraints without equations."""
        return self.before

    @cached_property
    def C(self) -> csr_array:
        """The coefficients (k, n_dof) of all equations."""
        return csr_array(vstack([one.C for one in self.equations]))

    @cached_property
    def n_nodal(self) -> int:
        """Number of the nodes' own unknowns that are kept."""
        return int((self.system.kept < self.plain.n_nodal).sum())

    @cached_property
    def nodal(self) -> Constraints:
        """The constraints on the nodes' own unknowns."""
        return replace(self.plain, T=csr_array(self.T[:, : self.n_nodal]), rigid=())

    @cached_property
    def at_nodes(self) -> Constraints:
        """Constraints whose T takes each of the nodes' own unknowns to its own node, and to no other."""
        return replace(self.plain, T=csr_array(self.plain.T[:, self.system.kept[: self.n_nodal]]), rigid=())

    @cached_property
    def node_of_unknown(self) -> Ints:
        """Node (n_nodal,) of each of the nodes' own unknowns."""
        return self.plain.node_of_unknown[self.system.kept[: self.n_nodal]]

    @property
    def places(self) -> Ints | None:
        """Index (n_q,) of each unknown that is kept, as without equations."""
        own = self.plain.places
        return own[self.system.kept] if own is not None and self.n_nodal == self.n_q else None

    def before_equations(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the unknowns x of the plain constraints, then the further unknowns, for q (n_q,) at time t."""
        return self.system.Z @ q + self._offset(t)

    def through_equations(self, rows: csr_array) -> csr_array:
        """Return rows (k, plain n_q) on the unknowns of the plain constraints as rows (k, n_q) on q."""
        return csr_array(rows @ self.system.Z[: self.plain.n_q])

    def u0(self, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with q = 0. Raises CaseError where conditions contradict."""
        return self.plain.displacement(self._offset(t)[: self.plain.n_q], t)

    def displacement(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at time t with unknowns q (n_q,), exact for finite rotations."""
        return self.plain.displacement(self.before_equations(q, t)[: self.plain.n_q], t)

    def tangent(self, q: Floats, t: float) -> csr_array:
        """Return du/dq (n_dof, n_q) at q (n_q,) and time t."""
        T = self.plain.tangent(self.before_equations(q, t)[: self.plain.n_q], t)
        return self.T if T is self.plain.T else self.through_equations(T)

    def unknowns(self, u: Floats) -> NDArray[np.floating]:
        """Return q (n_q,) with T q = u, for a u (n_dof,) in the range of T; the nearest one for others.

        Of several processes, for others the one with the values of u at the nodes whose unknowns are kept.
        """
        if self.own is not None:
            at_nodes = np.asarray(self.at_nodes.T.T @ u)
            beside = u - self.T[:, : self.n_nodal] @ at_nodes
            return at_nodes if self.n_nodal == self.n_q else np.append(at_nodes, self._motions(beside))
        q = self._normal.solve(self.T.T @ u)
        return q + self._normal.solve(self.T.T @ (u - self.T @ q))

    def force(self, t: float, q: Floats | None = None) -> NDArray[np.floating]:
        """Return the loads (n_q,) on free motions and on further unknowns at time t."""
        return np.asarray(self.system.Z.T @ self._forces(t, q))

    def turning(self, q: Floats, t: float, forces: Floats) -> csr_array | None:
        """Return the geometric stiffness (n_q, n_q) of rigid bodies that turn."""
        bent = self.plain.turning(self.before_equations(q, t)[: self.plain.n_q], t, forces)
        Z = self.system.Z[: self.plain.n_q]
        return None if bent is None else csr_array(Z.T @ bent @ Z)

    def rigid_motion(self, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return each rigid body's displacement of its centre, then its rotation, by group."""
        return self.plain.rigid_motion(self.before_equations(q, t)[: self.plain.n_q], t)

    def further(self, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return the further unknowns (n_s,) of each record that has some, by name."""
        s, out = self.before_equations(q, t)[self.plain.n_q :], {}
        for one in self.equations:
            if one.n_further:
                out[one.name], s = s[: one.n_further], s[one.n_further :]
        return out

    def equation_forces(self, reaction: Floats, q: Floats, t: float) -> dict[str, NDArray[np.floating]]:
        """Return the forces (k,) of each record's equations in the reactions (n_dof,) at the nodes, by name.

        Equations C u = g act on the bodies by C^T times them.
        """
        r = np.zeros(self.system.Z.shape[0])
        r[: self.plain.n_q] = self.plain.on_unknowns(reaction, self.plain.tangent(self._plain(q, t), t))
        forces = self.system.forces(self._from_owners(r - self._forces(t, q)))
        parts = np.split(forces, np.cumsum([one.C.shape[0] for one in self.equations])[:-1])
        return {one.name: part for one, part in zip(self.equations, parts, strict=True)}

    def _from_owners(self, r: Floats) -> NDArray[np.floating]:
        """Return r (n_x,) with the values at eliminated unknowns of nodes that their owners have."""
        if self.plain.own is None:
            return r
        at = self.system.columns[self.system.columns < self.plain.n_nodal]
        out = r.copy()
        out[at] = self.space.share.total(np.where(self.plain.own[at], r[at], 0.0))
        return out

    def of_supports(self, reaction: Floats, forces: Mapping[str, Floats]) -> NDArray[np.floating]:
        """Return reactions (n_dof,) without the `forces` of the equations."""
        own = [forces[one.name] for one in self.equations if one.name in forces]
        return reaction if len(own) < len(self.equations) else reaction - self.C.T @ np.concatenate(own)

    def _plain(self, q: Floats, t: float) -> NDArray[np.floating]:
        return self.before_equations(q, t)[: self.plain.n_q]

    def _forces(self, t: float, q: Floats | None) -> NDArray[np.floating]:
        """Return the loads (n_x,) on the unknowns of the plain constraints and on the further ones."""
        plain = self.plain.force(t, None if q is None else self._plain(q, t))
        return np.concatenate([plain, *(one.load(t) for one in self.equations)])

    def _offset(self, t: float) -> NDArray[np.floating]:
        """Return Y h(t) (n_x,); that of the last time is kept. Raises CaseError where equations contradict."""
        if self._last[0] != t:
            g = np.concatenate([np.asarray(one.values(t), float) for one in self.equations])
            u0 = self.plain.u0(t)
            terms = np.abs(g) + abs(self.C) @ np.abs(u0) + _ROUNDING * self.space.extent
            h = g - self.C @ u0
            error = contradiction(self.equations, self.system, h, t, terms)
            if error is not None:
                raise error
            self._last[:] = [t, self.system.offset(h)]
        return self._last[1]

    @cached_property
    def _last(self) -> list:
        return [None, None]

    @cached_property
    def _normal(self) -> SuperLU:
        return factor_of(csc_array(self.T.T @ self.T))


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
