"""The problem at one time on the constrained unknowns q: forces, tangent and contact at any q.

u = u(q, t) is T q + u0(t), except for finite rotations of rigid bodies; T = du/dq:

    r(q) = T^T (f(u, t) - f_int(u)) + forces on rigid bodies,   K_q = T^T K T,   B_q = B T,   D_q = D T

Equilibrium is r = B_q^T p. Under small kinematics with skins that are paired once, everything is linear in q.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array, vstack
from scipy.sparse.linalg import spsolve

from lacmesh.errors import DataError, some
from lacmesh.mesh import Floats
from lacsolver.bodies.finite import InadmissibleError
from lacsolver.contact import Interface, integrate
from lacsolver.linear import SingularError
from lacsolver.problem import acting
from lacsolver.problem.problem import ContactPair, Problem
from lacsolver.problem.rigid_modes import FreeMotion, bodies, describe, free_motions, rigid_modes, still_free
from lacsolver.solve.equilibrium import ContactSystem, ForceTerms, stiffness_of_rows
from lacsolver.solve.meeting import Meeting, meeting
from lacsolver.solve.newton import Place
from lacsolver.solve.schur import Rows
from lacsolver.solve.stiffness import Stiffness, Whole, hold, leading_unknowns

#: how far a node may be across the axis of symmetry, relative to the bodies' extent
_AXIS = 1e-9
#: springs are soft if they resist a rigid-body motion by less than this fraction of the bodies' own stiffness
_SOFT = 1e-4
#: largest number of rigid-body motions for which those on soft springs are sought: they are stored densely, and the
#: iterations converge without them
_MANY = 300
#: a unit motion is independent of others if its part orthogonal to them is larger than this
_ANOTHER = 1e-8


@dataclass(eq=False)
class ReducedProblem:
    """A problem on its constrained unknowns.

    `held`: K_q of the undeformed bodies, factorised; `motions`: rigid-body motions that only contact constrains;
    `length`: size of the coordinates, whose round-off limits the accuracy of gaps.
    """

    problem: Problem

    def __post_init__(self) -> None:
        self._kept: dict[str, Interface] = {}
        self.last: Stiffness | None = None

    @cached_property
    def K(self) -> csr_array:
        """Stiffness (n_dof, n_dof) of the undeformed bodies."""
        return self.problem.kinematics.tangent(np.zeros(self.problem.space.n_dof), 0.0)

    @cached_property
    def motions(self) -> tuple[FreeMotion, ...]:
        """Rigid-body motions that prescribed displacements and springs leave free."""
        return free_motions(self.problem.space, self.problem.constraints, self.problem.springs)

    @cached_property
    def held(self) -> Stiffness:
        """K_q (n_q, n_q) of the undeformed bodies with the stabilisation `steady`, factorised."""
        try:
            return self.hold(self.steadied(self.reduced(self.K, self.problem.constraints.T)))
        except SingularError as error:
            raise self._singular(error) from error

    @cached_property
    def free(self) -> NDArray[np.floating]:
        """Orthonormal rigid-body motions (n_q, r) that cost little energy, those that never cost any first.

        These are `motions`, and motions that only springs constrain which are soft compared with the bodies.
        """
        always = [m for m in self.motions if self._always_free(m)]
        found = self._orthonormal([*always, *(m for m in self.motions if not self._always_free(m))])
        return np.concatenate([found, self._soft(found)], axis=1)

    def _soft(self, free: Floats) -> NDArray[np.floating]:
        """Return orthonormal motions (n_q, k) on soft springs alone, orthogonal to the `free` ones (n_q, r)."""
        problem = self.problem
        motions = () if problem.springs is None else free_motions(problem.space, problem.constraints)
        if not 0 < len(motions) <= _MANY:
            return free[:, :0]
        held = self._orthonormal(motions)
        held = held - free @ (free.T @ held)
        sides, size, _ = np.linalg.svd(held, full_matrices=False)
        held = sides[:, size > _ANOTHER]
        moved = problem.constraints.T @ held
        energy, axes = np.linalg.eigh(moved.T @ (problem.springs @ moved))
        stiff = self.K.diagonal()
        stiff = np.where(stiff > 0, stiff, stiff.mean())  # the mean for rigid bodies without cells
        return (held @ axes)[:, energy < _SOFT * (stiff @ np.square(moved @ axes))]

    @cached_property
    def R(self) -> NDArray[np.floating]:
        """The columns (n_q, k) of `free` that are in the null space of K_q in any configuration."""
        return self.free[:, : sum(map(self._always_free, self.motions))]

    @cached_property
    def steady(self) -> csr_array | None:
        """Stabilisation (n_q, n_q): springs against rigid-body motions whose energy is small or may become negative.

        These are rotations, for which the geometric stiffness has either sign, and motions on soft springs. The springs
        act on differences of unknowns, so that motions without energy are not affected, and they are subtracted again
        as a part of the geometric stiffness. None if there are no such motions.
        """
        soft = self.free[:, self.R.shape[1] :]
        if not soft.shape[1]:
            return None
        leading = leading_unknowns(self.R)
        if len(leading):
            soft = soft - self.R @ np.linalg.solve(self.R[leading], soft[leading])
        other = leading_unknowns(soft)
        w = coo_array((np.ones(len(other)), (other, np.arange(len(other)))), shape=soft.shape).tocsr()
        if len(leading):
            part = np.linalg.solve(self.R[leading].T, self.R[other].T)
            rows, columns = np.meshgrid(leading, np.arange(len(other)), indexing="ij")
            w = csr_array(w - coo_array((part.ravel(), (rows.ravel(), columns.ravel())), shape=soft.shape))
        size = float(np.abs(self.K.diagonal()).mean()) or 1.0
        return csr_array(size * (w @ w.T))

    def steadied(self, K_q: csr_array) -> csr_array:
        """Return K_q plus the stabilisation `steady`."""
        return K_q if self.steady is None else csr_array(K_q + self.steady)

    def _always_free(self, motion: FreeMotion) -> bool:
        """True for a motion without energy in any configuration: all motions of a linear problem, else translations."""
        return self.linear or not motion.twists[:, 3:].any()

    def _orthonormal(self, motions: Sequence[FreeMotion]) -> NDArray[np.floating]:
        if not motions:
            return np.zeros((self.problem.constraints.n_q, 0))
        return np.linalg.qr(np.stack([self.unknowns(motion.field) for motion in motions], axis=1))[0]

    def hold(self, K: csr_array, definite: bool = True, like: Stiffness | None = None) -> Stiffness:
        """Factorise K (n_q, n_q) by the case's backend; `like`: an earlier stiffness whose analysis is reused."""
        backend, threads = self.problem.case.solver.backend, self.problem.threads
        return hold(K, self.R, backend=backend, threads=threads, whole=self._whole, definite=definite, like=like)

    def _singular(self, error: SingularError) -> SingularError:
        """Return the error of a singular stiffness in terms of the mesh: the node that moves most, and its axis."""
        space = self.problem.space
        if error.dof is None:
            return error
        q = np.eye(1, self.problem.constraints.n_q, error.dof)[0] if error.mode is None else error.mode
        u = self.problem.constraints.T @ q
        node, axis = divmod(int(np.abs(u).argmax()), space.dim)
        place = ", ".join(space.told(space.mesh.points[node]))
        who = f"node {space.mesh.node_number[node]} ({place}) along {'xyz'[axis]}"
        message = f"the stiffness is singular: a part of a body can move without any force, most of all {who}"
        advice = "look how it hangs on the rest there, or hold it by a displacement or a spring"
        return SingularError(f"{message}; {advice}", error.dof, error.mode)

    @cached_property
    def _whole(self) -> Whole | None:
        """Embedding of q in the unknowns of all nodes, with the rigid-body modes, for multigrid.

        None if T does not merely select unknowns.
        """
        space, c = self.problem.space, self.problem.constraints
        if not c.is_selection:
            return None
        modes = rigid_modes(space, bodies(space))
        modes[np.setdiff1d(np.arange(space.n_dof), c.free, assume_unique=True)] = 0.0
        return Whole(c.free, space.n_dof, space.dim, modes)

    @cached_property
    def length(self) -> float:
        """Extent of the bodies, in axisymmetry at least the largest radius, since radii are measured from the axis."""
        space = self.problem.space
        radius = space.mesh.points[space.attached, 0].max() if space.model.axisymmetric else 0.0
        return max(space.extent, float(radius))

    @cached_property
    def longest(self) -> float:
        """Extent of the largest cell."""
        space = self.problem.space
        return max(float(np.ptp(space.local.points[b.nodes], axis=1).max(initial=0.0)) for b in space.blocks)

    @cached_property
    def linear(self) -> bool:
        """True if forces and gaps are linear in q: small kinematics, and skins that are paired once."""
        return self.problem.kinematics.constant and not any(joint.moving for joint in self.problem.joints)

    def check_beside_axis(self, u: Floats) -> None:
        """Raise InadmissibleError if u (n_dof,) moves nodes of an axisymmetric model across the axis.

        Nodes within round-off of the axis are accepted.
        """
        space = self.problem.space
        if space.model.axisymmetric:
            x = space.mesh.points[:, 0] + u[:: space.dim]
            beyond = np.flatnonzero((x < -_AXIS * space.extent) & (space.mesh.points[:, 0] >= 0))
            if len(beyond):
                numbers = some(space.mesh.node_number[beyond])
                raise InadmissibleError(f"nodes {numbers} are taken across the axis; take smaller steps")

    def unknowns(self, u: Floats) -> NDArray[np.floating]:
        """Return q (n_q,) with T q = u, for a u (n_dof,) in the range of T."""
        c, T = self.problem.constraints, self.problem.constraints.T
        if c.is_selection:
            return u[c.free]
        return np.asarray(spsolve(csc_array(T.T @ T), T.T @ u))

    def check_held(self, interfaces: Sequence[Interface], paired: NDArray[np.bool_]) -> None:
        """Raise DataError, with a description, if a rigid-body motion is constrained by nothing, contact included."""
        if not self.motions:
            return
        n = self.K.shape[0]
        B = csr_array(vstack([csr_array((0, n)), *(face.B for face in interfaces)]))
        free = still_free(csr_array(B[np.flatnonzero(paired)]), self.motions)
        if free:
            said = "; ".join(describe(motion) for motion in free)
            raise DataError(f"nothing holds a part of the model: {said}; add a displacement, a spring or a contact")

    def reduced(self, K: csr_array, T: csr_array) -> csr_array:
        """Return T^T K T."""
        c = self.problem.constraints
        if c.is_selection:
            return csr_array(K[c.free][:, c.free])
        return csr_array((T.T @ K @ T).tocsr())

    def interface(self, joint: ContactPair, u: Floats, t: float) -> Interface:
        """Return a pair's interface, on the skins displaced by u (n_dof,) if it is paired again, else undeformed."""
        space = self.problem.space
        if joint.moving:
            return integrate(joint.zone, space.dim, joint.pairing, x=joint.places(space, u), t=t)
        if joint.name not in self._kept or joint.timed:
            self._kept[joint.name] = integrate(joint.zone, space.dim, joint.pairing, t=t, tie=joint.tie)
        return self._kept[joint.name]


@dataclass(eq=False)
class Instant:
    """A problem at one time: loads, prescribed displacements, and forces, tangent and contact at any q."""

    model: ReducedProblem
    t: float

    def __post_init__(self) -> None:
        self._last: tuple[Floats, Meeting] | None = None
        self._fixed: ContactSystem | None = None
        self._definite = True

    @cached_property
    def u0(self) -> NDArray[np.floating]:
        """Displacement (n_dof,) at q = 0, from the prescribed displacements."""
        return self.model.problem.constraints.u0(self.t)

    @cached_property
    def dead(self) -> NDArray[np.floating]:
        """Nodal forces of the loads (n_dof,), with follower loads on the undeformed faces."""
        return self.model.problem.load(self.t)

    def load(self, u: Floats) -> NDArray[np.floating]:
        """Return the nodal forces of the loads (n_dof,), with follower loads on the faces at u (n_dof,)."""
        follows = any(pressure.follower for pressure in self.model.problem.case.pressure)
        return self.model.problem.load(self.t, u) if follows else self.dead

    @cached_property
    def f(self) -> NDArray[np.floating]:
        """Forces (n_q,) of a linear problem, K_q q = f without contact."""
        c = self.model.problem.constraints
        return np.asarray(c.T.T @ (self.dead - self.model.K @ self.u0) + c.force(self.t))

    def u(self, q: Floats) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at q."""
        return self.model.problem.constraints.displacement(q, self.t)

    def interfaces(self, q: Floats) -> tuple[Interface, ...]:
        """Return the interfaces of all contact pairs at q."""
        return self._meeting(q).interfaces

    def contact(self, q: Floats) -> ContactSystem:
        """Return the rows of all contact pairs, and their gaps at q."""
        if self._fixed is not None:
            return self._fixed.at(self._fixed.G - self._fixed.rows.D @ q)
        made = self._contact(self._meeting(q), self.model.problem.constraints.tangent(q, self.t))
        if self.model.linear:
            self._fixed = made.at(made.G + made.rows.D @ q)
        return made

    def closed_rows(self, q: Floats, active: NDArray[np.bool_]) -> csr_array:
        """Return the rows (k, n_dof) of B at q that are closed, as `active` tells."""
        return csr_array(self._meeting(q).B[np.flatnonzero(active)])

    def reaction(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """Return the reactions (n_dof,) of the supports on the bodies, f_int - f + B^T p."""
        u, problem = self.u(q), self.model.problem
        return problem.kinematics.internal_force(u, self.t) - self.load(u) + self._meeting(q).B.T @ p

    def place(self, q: Floats) -> Place:
        """Return forces, tangent and contact at q. Raises InadmissibleError where cells are inverted."""
        u = self.u(q)
        self.model.check_beside_axis(u)
        return self._place(q, u)

    def foreseen(self, q: Floats, u: Floats, p: Floats) -> Place:
        """Return a first-order prediction of `place`, from a displacement u (n_dof,) with earlier prescribed values.

        Forces and gaps are those at u, plus their linear change on the way to u(q, t) at pressures p (m,).
        """
        return self._place(q, u, self.u(q) - u, p)

    def _place(self, q: Floats, u: Floats, rest: Floats | None = None, p: Floats | None = None) -> Place:
        problem, c = self.model.problem, self.model.problem.constraints
        T, load = c.tangent(q, self.t), self.load(u)
        if problem.kinematics.constant:
            inner, K, following = problem.kinematics.internal_force(u, self.t), self.model.K, None
        else:
            inner, K = problem.kinematics.force_and_tangent(u, self.t)
            following = acting.load_tangent(problem.space, problem.case, u, self.t)
        met = self._meeting(q) if rest is None else meeting(problem, self._paired(u), u)
        contact, out = self._contact(met, T), inner - load
        if rest is not None and p is not None:
            out = out + K @ rest + (met.turning(p) @ rest if met.turns else 0.0)
            out = out if following is None else out - following @ rest
            contact = contact.at(contact.G - met.D @ rest)
        K_q = self.model.held.K if problem.kinematics.constant else self.model.steadied(self.model.reduced(K, T))
        motion = c.force(self.t, q)

        def turning(pressure: Floats) -> csr_array | None:
            bent = c.turning(q, self.t, out + met.B.T @ pressure)
            parts = [met.turning(pressure)] if met.turns else []
            parts += [] if following is None else [-following]
            total = [self.model.reduced(csr_array(part), T) for part in parts] + ([] if bent is None else [bent])
            total += [] if self.model.steady is None else [-self.model.steady]
            return csr_array(sum(total[1:], total[0])) if total else None

        def terms() -> ForceTerms:
            stiff = np.abs(K_q.diagonal())
            if problem.kinematics.constant:
                return ForceTerms(
                    abs(K_q) @ np.abs(q) + np.abs(motion) + abs(T).T @ (np.abs(inner) + np.abs(load)), stiff
                )
            return ForceTerms(
                stiff * (float(np.abs(q).max(initial=0.0)) + self.model.longest), stiff
            )  # strains of about 1

        size = max(float(np.abs(v).max(initial=0.0)) for v in (inner, load, motion, out))
        return Place(
            motion - T.T @ out,
            size,
            contact,
            lambda drag, definite: self._held(K_q, drag, definite),
            turning,
            self.model.free,
            terms,
        )

    def _held(self, K_q: csr_array, drag: float, definite: bool) -> Stiffness:
        """Return K_q plus `drag` times that of the undeformed bodies, factorised; a constant K is the latter alone."""
        model = self.model
        if model.problem.kinematics.constant:
            return model.held
        K = csr_array(K_q + drag * model.held.K) if drag else K_q
        if self._definite and definite:
            with suppress(SingularError):
                model.last = model.hold(K, like=model.last or model.held)
                return model.last
        self._definite = bool(drag)  # bodies that buckle: a definite factor is not tried again before the next step
        model.last = model.hold(K, definite=False, like=model.last)
        return model.last

    def _contact(self, met: Meeting, T: csr_array) -> ContactSystem:
        """Return the contact rows on the unknowns q."""
        left = csr_array(met.B @ T)
        rows = Rows(left, left if met.D is met.B else csr_array(met.D @ T), met.w)
        moved = np.diff(left.indptr) > 0
        c = stiffness_of_rows(self.model.held, rows)
        return ContactSystem(rows, met.G, met.covered & moved, met.held, c, met.covered & ~moved)

    def _meeting(self, q: Floats) -> Meeting:
        """Return all contact pairs at q; the last result is cached, and in a linear problem it is valid for every q."""
        if self._last is None or not (self.model.linear or np.array_equal(self._last[0], q)):
            u = self.u(q)
            self._last = q.copy(), meeting(self.model.problem, self._paired(u), u)
        return self._last[1]

    def _paired(self, u: Floats) -> tuple[Interface, ...]:
        return tuple(self.model.interface(joint, u, self.t) for joint in self.model.problem.joints)
