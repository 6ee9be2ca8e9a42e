"""The problem at one time, on the unknowns that are left: forces, tangent and contact wherever the bodies are.

u = u(q, t), which is T q + u0(t) but for finite rotations of rigid bodies; T = du/dq:

    r(q) = T^T (f(u, t) - f_int(u)) + forces on rigid bodies,   K_q = T^T K T,   B_q = B T,   D_q = D T

Equilibrium is r = B_q^T p. Where the kinematics are small and the skins stay where they were, all of it is linear in q.
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
from lacsolver.problem.problem import Joint, Problem
from lacsolver.problem.rigid_modes import FreeMotion, bodies, describe, free_motions, rigid_modes, still_free
from lacsolver.solve.equilibrium import Contact, Terms, stiffness_of_rows
from lacsolver.solve.meeting import Meeting, meeting
from lacsolver.solve.newton import Place
from lacsolver.solve.schur import Rows
from lacsolver.solve.stiffness import Stiffness, Whole, hold, leading_unknowns

#: of the bodies' extent: how far a node may be across the axis
_AXIS = 1e-9
#: springs are soft that resist a rigid motion by less than this of the bodies' own stiffness
_SOFT = 1e-4
#: more motions than these are not looked at for what soft springs hold: they are dense, and iterations do without
_MANY = 300
#: a unit motion with more than this beside some others is another one
_ANOTHER = 1e-8


@dataclass(eq=False)
class Model:
    """A problem on its constrained unknowns.

    `held`: K_q of the undeformed bodies and what solves with it; `motions`: those of whole bodies that nothing but
    contact stops; `length`: the size of coordinates, whose rounding limits what gaps are known to.
    """

    problem: Problem

    def __post_init__(self) -> None:
        self._kept: dict[str, Interface] = {}
        self.last: Stiffness | None = None

    @cached_property
    def K(self) -> csr_array:
        """(n_dof, n_dof): of the undeformed bodies."""
        return self.problem.kinematics.tangent(np.zeros(self.problem.space.n_dof), 0.0)

    @cached_property
    def motions(self) -> tuple[FreeMotion, ...]:
        """Motions of whole bodies that displacements and springs leave free."""
        return free_motions(self.problem.space, self.problem.constraints, self.problem.springs)

    @cached_property
    def held(self) -> Stiffness:
        """K_q (n_q, n_q), with what makes it `steady`, factorised."""
        try:
            return self.hold(self.steadied(self.reduced(self.K, self.problem.constraints.T)))
        except SingularError as error:
            raise self._singular(error) from error

    @cached_property
    def free(self) -> NDArray[np.floating]:
        """(n_q, r): motions of bodies that hardly cost energy, orthonormal; first those that never cost any.

        Those are `motions`, and what only springs hold that are soft beside the bodies.
        """
        always = [m for m in self.motions if self._always_free(m)]
        found = self._orthonormal([*always, *(m for m in self.motions if not self._always_free(m))])
        return np.concatenate([found, self._soft(found)], axis=1)

    def _soft(self, free: Floats) -> NDArray[np.floating]:
        """(n_q, k): orthonormal motions of bodies beside the `free` ones (n_q, r) that soft springs alone hold."""
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
        stiff = np.where(stiff > 0, stiff, stiff.mean())  # of a rigid body that no cell holds, as of the others
        return (held @ axes)[:, energy < _SOFT * (stiff @ np.square(moved @ axes))]

    @cached_property
    def R(self) -> NDArray[np.floating]:
        """(n_q, k): the columns of `free` that K_q takes to 0 wherever the bodies are."""
        return self.free[:, : sum(map(self._always_free, self.motions))]

    @cached_property
    def steady(self) -> csr_array | None:
        """(n_q, n_q): springs against motions of whole bodies that cost a little energy, or may gain some.

        Those are rotations, where forces turn with the bodies, and what soft springs hold. They act on differences of
        unknowns, so that motions which cost none do not feel them; they are taken off again as a part of the turning
        forces. None where there are none.
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
        """K_q with `steady`."""
        return K_q if self.steady is None else csr_array(K_q + self.steady)

    def _always_free(self, motion: FreeMotion) -> bool:
        """Whether a motion costs no energy wherever the bodies are: any where all is linear, else a translation."""
        return self.linear or not motion.twists[:, 3:].any()

    def _orthonormal(self, motions: Sequence[FreeMotion]) -> NDArray[np.floating]:
        if not motions:
            return np.zeros((self.problem.constraints.n_q, 0))
        return np.linalg.qr(np.stack([self.unknowns(motion.field) for motion in motions], axis=1))[0]

    def hold(self, K: csr_array, definite: bool = True, like: Stiffness | None = None) -> Stiffness:
        """K (n_q, n_q), factorised by the case's backend, with what serves again of an earlier one."""
        backend, threads = self.problem.case.solver.backend, self.problem.threads
        return hold(K, self.R, backend=backend, threads=threads, whole=self._whole, definite=definite, like=like)

    def _singular(self, error: SingularError) -> SingularError:
        """The error of a singular stiffness, in words of the mesh: the node that moves most, and along which axis."""
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
        """Where q stands among the unknowns of all nodes, and every body's rigid motions; None if q are others."""
        space, c = self.problem.space, self.problem.constraints
        if not c.is_selection:
            return None
        modes = rigid_modes(space, bodies(space))
        modes[np.setdiff1d(np.arange(space.n_dof), c.free, assume_unique=True)] = 0.0
        return Whole(c.free, space.n_dof, space.dim, modes)

    @cached_property
    def length(self) -> float:
        """The bodies' extent; about an axis the largest radius, if it is more: radii are counted from the axis."""
        space = self.problem.space
        radius = space.mesh.points[space.attached, 0].max() if space.model.axisymmetric else 0.0
        return max(space.extent, float(radius))

    @cached_property
    def longest(self) -> float:
        """The longest cell's extent."""
        space = self.problem.space
        return max(float(np.ptp(space.local.points[b.nodes], axis=1).max(initial=0.0)) for b in space.blocks)

    @cached_property
    def linear(self) -> bool:
        """Whether forces and gaps are linear in q: small kinematics, and skins that are paired once."""
        return self.problem.kinematics.constant and not any(joint.moving for joint in self.problem.joints)

    def check_beside_axis(self, u: Floats) -> None:
        """Raises InadmissibleError where u (n_dof,) takes nodes of an axisymmetric model to the other side of the axis.

        Those that are within rounding of it stay there.
        """
        space = self.problem.space
        if space.model.axisymmetric:
            x = space.mesh.points[:, 0] + u[:: space.dim]
            beyond = np.flatnonzero((x < -_AXIS * space.extent) & (space.mesh.points[:, 0] >= 0))
            if len(beyond):
                numbers = some(space.mesh.node_number[beyond])
                raise InadmissibleError(f"nodes {numbers} are taken across the axis; take smaller steps")

    def unknowns(self, u: Floats) -> NDArray[np.floating]:
        """(n_q,): q with T q = u, (n_dof,), which has one."""
        c, T = self.problem.constraints, self.problem.constraints.T
        if c.is_selection:
            return u[c.free]
        return np.asarray(spsolve(csc_array(T.T @ T), T.T @ u))

    def check_held(self, interfaces: Sequence[Interface], paired: NDArray[np.bool_]) -> None:
        """Raises DataError where a body may move and no contact or tie would stop it: who, and how."""
        if not self.motions:
            return
        n = self.K.shape[0]
        B = csr_array(vstack([csr_array((0, n)), *(face.B for face in interfaces)]))
        free = still_free(csr_array(B[np.flatnonzero(paired)]), self.motions)
        if free:
            said = "; ".join(describe(motion) for motion in free)
            raise DataError(f"nothing holds a part of the model: {said}; add a displacement, a spring or a contact")

    def reduced(self, K: csr_array, T: csr_array) -> csr_array:
        """T^T K T."""
        c = self.problem.constraints
        if c.is_selection:
            return csr_array(K[c.free][:, c.free])
        return csr_array((T.T @ K @ T).tocsr())

    def interface(self, joint: Joint, u: Floats, t: float) -> Interface:
        """A joint's interface: a moving one's where u (n_dof,) takes the skins, a still one's where they were."""
        space = self.problem.space
        if joint.moving:
            return integrate(joint.zone, space.dim, joint.pairing, x=joint.places(space, u), t=t)
        if joint.name not in self._kept or joint.timed:
            self._kept[joint.name] = integrate(joint.zone, space.dim, joint.pairing, t=t, tie=joint.tie)
        return self._kept[joint.name]


@dataclass(eq=False)
class Instant:
    """A time: what acts, what is prescribed, and the bodies and their contact at any q."""

    model: Model
    t: float

    def __post_init__(self) -> None:
        self._last: tuple[Floats, Meeting] | None = None
        self._fixed: Contact | None = None
        self._definite = True

    @cached_property
    def u0(self) -> NDArray[np.floating]:
        """(n_dof,): what is prescribed."""
        return self.model.problem.constraints.u0(self.t)

    @cached_property
    def dead(self) -> NDArray[np.floating]:
        """(n_dof,): nodal forces of what acts, followers where the mesh has their faces."""
        return self.model.problem.load(self.t)

    def load(self, u: Floats) -> NDArray[np.floating]:
        """(n_dof,): the same with followers at u (n_dof,)."""
        follows = any(pressure.follower for pressure in self.model.problem.case.pressure)
        return self.model.problem.load(self.t, u) if follows else self.dead

    @cached_property
    def f(self) -> NDArray[np.floating]:
        """(n_q,): forces of a linear problem, K_q q = f without contact."""
        c = self.model.problem.constraints
        return np.asarray(c.T.T @ (self.dead - self.model.K @ self.u0) + c.force(self.t))

    def u(self, q: Floats) -> NDArray[np.floating]:
        """(n_dof,)."""
        return self.model.problem.constraints.displacement(q, self.t)

    def interfaces(self, q: Floats) -> tuple[Interface, ...]:
        """Those of all joints at q."""
        return self._meeting(q).interfaces

    def contact(self, q: Floats) -> Contact:
        """The rows of all joints, and their gaps at q."""
        if self._fixed is not None:
            return self._fixed.at(self._fixed.G - self._fixed.rows.D @ q)
        made = self._contact(self._meeting(q), self.model.problem.constraints.tangent(q, self.t))
        if self.model.linear:
            self._fixed = made.at(made.G + made.rows.D @ q)
        return made

    def closed_rows(self, q: Floats, active: NDArray[np.bool_]) -> csr_array:
        """(k, n_dof): B of the rows that are closed at q."""
        return csr_array(self._meeting(q).B[np.flatnonzero(active)])

    def reaction(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """(n_dof,): forces that what holds the bodies gives them: f_int - f + B^T p."""
        u, problem = self.u(q), self.model.problem
        return problem.kinematics.internal_force(u, self.t) - self.load(u) + self._meeting(q).B.T @ p

    def place(self, q: Floats) -> Place:
        """Forces, tangent and contact at q. Raises InadmissibleError where cells are turned inside out."""
        u = self.u(q)
        self.model.check_beside_axis(u)
        return self._place(q, u)

    def foreseen(self, q: Floats, u: Floats, p: Floats) -> Place:
        """What `place` comes to, linearised about u (n_dof,) where what is prescribed was as it is no more.

        Forces and gaps are those at u, and what the rest of the way to u(q, t) adds to them at pressures p (m,).
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

        def terms() -> Terms:
            stiff = np.abs(K_q.diagonal())
            if problem.kinematics.constant:
                return Terms(abs(K_q) @ np.abs(q) + np.abs(motion) + abs(T).T @ (np.abs(inner) + np.abs(load)), stiff)
            return Terms(stiff * (float(np.abs(q).max(initial=0.0)) + self.model.longest), stiff)  # strains are of 1

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
        """K_q with a part of that of the undeformed bodies, factorised: theirs where it is constant."""
        model = self.model
        if model.problem.kinematics.constant:
            return model.held
        K = csr_array(K_q + drag * model.held.K) if drag else K_q
        if self._definite and definite:
            with suppress(SingularError):
                model.last = model.hold(K, like=model.last or model.held)
                return model.last
        self._definite = bool(drag)  # bodies that buckle: it is not worth trying again before the next step
        model.last = model.hold(K, definite=False, like=model.last)
        return model.last

    def _contact(self, met: Meeting, T: csr_array) -> Contact:
        """Rows on q."""
        left = csr_array(met.B @ T)
        rows = Rows(left, left if met.D is met.B else csr_array(met.D @ T), met.w)
        moved = np.diff(left.indptr) > 0
        c = stiffness_of_rows(self.model.held, rows)
        return Contact(rows, met.G, met.covered & moved, met.held, c, met.covered & ~moved)

    def _meeting(self, q: Floats) -> Meeting:
        """The joints at q; that of the last q that was asked about is kept, and any will do where they stay."""
        if self._last is None or not (self.model.linear or np.array_equal(self._last[0], q)):
            u = self.u(q)
            self._last = q.copy(), meeting(self.model.problem, self._paired(u), u)
        return self._last[1]

    def _paired(self, u: Floats) -> tuple[Interface, ...]:
        return tuple(self.model.interface(joint, u, self.t) for joint in self.model.problem.joints)
