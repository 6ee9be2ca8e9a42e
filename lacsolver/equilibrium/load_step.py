"""Load step: a problem on the unknowns q at one time, with its forces, its tangent and its contact at any q.

    r(q) = T^T (f(u, t) - f_int(u)) + forces on rigid bodies - forces of the time scheme,     T = du/dq
    K_q = T^T K T + matrix of the time scheme,   B_q = B T,   D_q = D T

Equilibrium is r = B_q^T p. Under small kinematics with skins that are paired once, everything is linear in q. Residuals
and tangents are evaluated apart: a trial that is given up costs no tangent.

In a step the factor of an earlier tangent K_0 serves as long as the tangent is near it, and K_q - K_0 is taken along in
the loop on the pressures as geometric stiffness is: it costs one product for each application of the factor.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.contact import Interface
from lacsolver.contact.friction import Bounds
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.schemes import StepTerms
from lacsolver.equilibrium.state import Histories, StepState
from lacsolver.linear import Matrix, SingularError
from lacsolver.saddle.contact_system import ContactSystem, contact_system
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.saddle import scaled
from lacsolver.saddle.stiffness import Stiffness
from lacsolver.saddle.tolerances import ForceTerms, sizes

#: largest change of an entry of the tangent for which the factor before serves, relative to both diagonal entries
_NEAR = 0.1


@dataclass(eq=False)
class LoadStep:
    """A problem at time t, in the step from a state: loads, prescribed displacements, and all that depends on q.

    `given`: terms to take in place of those of the model's time scheme. `stuck`: numbers of the pairs whose friction
    has no limit. `factor`: the last tangent of this step that a direct backend has factorised without damping; None
    before.
    """

    model: ReducedProblem
    t: float
    state: StepState = field(default_factory=StepState)
    given: StepTerms | None = None
    stuck: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        self._last: tuple[Floats, tuple[Interface, ...], ContactSystem] | None = None
        self._linear: ContactSystem | None = None
        self._definite = True
        self.factor: Operator | None = None

    @cached_property
    def u0(self) -> NDArray[np.floating]:
        """Displacement (n_dof,) at q = 0, from the prescribed displacements."""
        return self.model.problem.constraints.u0(self.t)

    @cached_property
    def _reference_load(self) -> NDArray[np.floating]:
        """Nodal forces of the loads (n_dof,), with follower loads on the undeformed faces."""
        return self.model.problem.load(self.t)

    @cached_property
    def terms(self) -> StepTerms | None:
        """Terms of the time scheme."""
        return self.given or self.model.scheme.terms(self.model, self.state, self.t)

    @property
    def _matrix(self) -> csr_array | None:
        return None if self.terms is None else self.terms.matrix

    @property
    def reference(self) -> Operator:
        """Stiffness of the undeformed bodies and of the time scheme, factorised."""
        return self.model.reference(self._matrix)

    def load(self, u: Floats) -> NDArray[np.floating]:
        """Return the nodal forces of the loads (n_dof,), with follower loads on the faces at u (n_dof,)."""
        problem = self.model.problem
        return problem.load(self.t, u) if problem.loads.follow else self._reference_load

    @cached_property
    def f(self) -> NDArray[np.floating]:
        """Forces (n_q,) of a linear problem, (K_q + matrix) q = f without contact."""
        c = self.model.problem.constraints
        f = c.on_unknowns(self._reference_load - self.model.K @ self.u0) + c.force(self.t)
        return f if self.terms is None else f - self.terms.force(np.zeros_like(f))

    def u(self, q: Floats) -> NDArray[np.floating]:
        """Return the displacement (n_dof,) at q."""
        return self.model.problem.constraints.displacement(q, self.t)

    def interfaces(self, q: Floats) -> tuple[Interface, ...]:
        """Return the interfaces of all contact pairs at q."""
        return self._nodal_contact(q)[0]

    def contact(self, q: Floats) -> ContactSystem:
        """Return the contact system on the unknowns, with its gaps at q."""
        if self._linear is not None:
            return self._linear.with_gaps(self._linear.G - self._linear.rows.D @ q)
        T = self.model.problem.constraints.tangent(q, self.t)
        contact = self._nodal_contact(q)[1].reduced(T, self.reference)
        if self.model.linear:
            self._linear = contact.with_gaps(contact.G + contact.rows.D @ q)
        return contact

    def closed_rows(self, q: Floats, active: NDArray[np.bool_]) -> csr_array:
        """Return the rows (k, n_dof) of B at q that are closed, as `active` tells."""
        return csr_array(self._nodal_contact(q)[1].rows.B[np.flatnonzero(active)])

    def reaction(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """Return the reactions (n_dof,) of the supports on the bodies: f_int - f + B^T p, and the time scheme's."""
        internal, load, contact = self.forces(q, p)
        out = internal - load + contact
        return out if self.terms is None else self.terms.reaction(q, out)

    def forces(self, q: Floats, p: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
        """Return the internal forces, the loads, and the contact forces B^T p, (n_dof,) each."""
        u = self.u(q)
        return self.internal_force(u), self.load(u), self._nodal_contact(q)[1].rows.B_T @ p

    def pressing(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """Return the contact forces (n_dof,) without those of friction: B^T p along normals, and of ties."""
        system = self._nodal_contact(q)[1]
        return system.rows.B_T @ np.where(system.along_tangents | system.of_equality, 0.0, p)

    def joining(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """Return C^T p (n_dof,) of the rows of equality, which `forces` has among the contact forces."""
        system = self._nodal_contact(q)[1]
        if not system.equalities:
            return np.zeros(self.model.problem.space.n_dof)
        return system.rows.B_T @ np.where(system.of_equality, p, 0.0)

    def dissipated(self, q: Floats, p: Floats) -> float:
        """Return the energy that friction takes in the step: t . S of all macro-elements, with t at its end."""
        u, out = self.u(q), 0.0
        for group in self._nodal_contact(q)[1].pairs:
            if group.shear is not None:
                out -= float(p[group.shear.tangential] @ group.gaps(u)[group.shear.n_rows :])
        return out

    def damped_by_contact(self, q: Floats, p: Floats) -> float:
        """Return the energy that damping of contact takes in the step."""
        return self._nodal_contact(q)[1].damped(self.u(q), p)

    def stored_in_contact(self, q: Floats, p: Floats) -> float:
        """Return the energy that soft contact stores at q."""
        return self._nodal_contact(q)[1].stored(self.u(q), p)

    def zone_forces(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """Return the resultant (n_pairs, dim) of the contact forces on each slave."""
        space, system = self.model.problem.space, self._nodal_contact(q)[1]
        out = np.zeros((len(system.pairs), space.dim))
        for k, group in enumerate(system.pairs):
            force = -(group.face.all_rows.T @ p[group.every]).reshape(-1, space.dim)
            out[k] = force[group.pair.zone.slave.faces.distinct_nodes].sum(axis=0)
        return out

    def commit(self, q: Floats, p: Floats, active: NDArray[np.bool_], contact: ContactSystem) -> Histories:
        """Return what laws and the time scheme keep of this step, which has converged at q."""
        histories, model = self.state.histories, self.model
        materials = model.problem.kinematics.commit(self.u(q), self.t, histories.materials)
        scheme = model.scheme.commit(self, q, p)
        return Histories(materials, contact.commit(p, active), scheme, contact.anchors(active))

    def linearize(self, q: Floats) -> Linearization:
        """Return forces and contact at q, with their derivatives. Raises InadmissibleError."""
        u = self.u(q)
        self.model.check_beside_axis(u)
        return Linearization(self, q, u, self._nodal_contact(q)[1])

    def predictor(self, q: Floats, u: Floats, p: Floats) -> Linearization:
        """Return a first-order prediction of `linearize`, from u (n_dof,) with earlier prescribed values.

        Forces and gaps are those at u, plus their linear change on the way to u(q, t) at pressures p (m,).
        """
        nodal = self._system(self._paired(u), u)
        return Linearization(self, q, u, nodal, (self.u(q) - u, p))

    def internal_force(self, u: Floats) -> NDArray[np.floating]:
        """Return the internal forces (n_dof,). Raises InadmissibleError where u inverts a cell, on all processes."""
        f, failed = np.zeros_like(u), None
        try:
            f = self.model.problem.kinematics.internal_force(u, self.t, self.state.histories.materials)
        except InadmissibleError as error:
            failed = error
        self.model.problem.space.share.agree(failed)
        return f

    def stabilized(self, K_q: csr_array) -> csr_array:
        """Return K_q (n_q, n_q) with the matrix of the time scheme, stabilised."""
        return self.model.stabilized(K_q, self._matrix)

    def factorised(self, K: csr_array, damping: float, definite: bool) -> Operator:
        """Return a tangent K (n_q, n_q) plus `damping` times the undeformed bodies' stiffness, factorised."""
        self.factor = None  # its memory is free before
        made = self._factorised(csr_array(K + damping * self.reference.K) if damping else K, damping, definite)
        self.factor = None if damping or made.iterative else made
        return made

    def _factorised(self, K: csr_array, damping: float, definite: bool) -> Operator:
        if self._definite and definite:
            with suppress(SingularError):
                return self.model.factors.factorise(K)
        self._definite = bool(damping)  # bodies that buckle: a definite factor is not tried again before the next step
        return self.model.factors.factorise(K, definite=False)

    def _nodal_contact(self, q: Floats) -> tuple[tuple[Interface, ...], ContactSystem]:
        """Return interfaces and contact rows on all nodes at q; the last are kept, in a linear problem for every q."""
        if self._last is None or not (self.model.linear or np.array_equal(self._last[0], q)):
            u = self.u(q)
            faces = self._paired(u)
            self._last = q.copy(), faces, self._system(faces, u)
        return self._last[1:]

    def _system(self, faces: tuple[Interface, ...], u: Floats) -> ContactSystem:
        """Return the contact rows of some interfaces at u (n_dof,), on the unknowns of all nodes."""
        problem, histories = self.model.problem, self.state.histories
        dt = 0.0 if self.state.motion is None else self.t - self.state.time
        return contact_system(problem, faces, u, histories, self.t, self.u_before, self._bounds, dt)

    @cached_property
    def _bounds(self) -> tuple[Bounds | None, ...]:
        """Bounds of the friction of all contact pairs at the time of the step, None without friction."""
        problem = self.model.problem
        bounds = [pair.bounds(problem.space, self.t) for pair in problem.joints]
        return tuple(one.unlimited if one and k in self.stuck else one for k, one in enumerate(bounds))

    @cached_property
    def u_before(self) -> NDArray[np.floating]:
        """Displacement (n_dof,) at the start of the step."""
        state = self.state
        if state.iterate is None:
            return np.zeros_like(self.u0)
        return self.model.problem.constraints.displacement(state.iterate.q, state.time)

    def _paired(self, u: Floats) -> tuple[Interface, ...]:
        pairs = zip(self.model.problem.joints, self._closed_before, strict=True)
        return tuple(self.model.interface(pair, u, self.t, closed) for pair, closed in pairs)

    @cached_property
    def _closed_before(self) -> tuple[NDArray[np.bool_] | None, ...]:
        """Macro-elements of each contact pair that were in contact at the start of the step; None of ties."""
        problem, iterate, out, first = self.model.problem, self.state.iterate, list[NDArray[np.bool_] | None](), 0
        for pair in problem.joints:
            known = pair.one_sided and iterate is not None
            out.append(iterate.active[first : first + pair.zone.n_macros] if known and iterate is not None else None)
            first += pair.n_rows(problem.space.dim)
        return tuple(out)


class Linearization:
    """Forces and contact of a load step at q, and their derivatives, which are computed when they are asked for.

    `r` (n_q,): residual of forces without contact; `size`: the largest force on the body of each unknown; `contact`:
    the contact system.
    """

    def __init__(
        self, step: LoadStep, q: Floats, u: Floats, nodal: ContactSystem, change: tuple[Floats, Floats] | None = None
    ) -> None:
        """Evaluate forces and contact at u (n_dof,); `change`: (du (n_dof,), p (m,)) to go on by, to first order.

        `nodal`: the contact at u, on the unknowns of all nodes. Raises InadmissibleError where u inverts a cell.
        """
        model, constraints = step.model, step.model.problem.constraints
        self._step, self._q, self._u, self._nodal = step, q, u, nodal
        self._T = constraints.tangent(q, step.t)
        self._internal, self._load = step.internal_force(u), step.load(u)
        self._unbalanced = self._internal - self._load
        self.contact = nodal.reduced(self._T, step.reference)
        if change is not None:
            self._extrapolate(*change)
        self._rigid = constraints.force(step.t, q)
        self._inertial = np.zeros_like(q) if step.terms is None else step.terms.force(q)
        self.r = self._rigid - constraints.on_unknowns(self._unbalanced, self._T) - self._inertial
        nodal_forces, own_forces = (self._internal, self._load, self._unbalanced), (self._rigid, self._inertial)
        self.size = model.largest_forces(nodal_forces, own_forces)

    @property
    def free(self) -> NDArray[np.floating]:
        """Rigid-body modes (n_q, r) that only contact constrains."""
        return self._step.model.stabilization.free

    def modes(self, K: Operator) -> NDArray[np.floating]:
        """Return these modes (n_q, r) where the bodies are now: those of undeformed bodies strain bodies that turned.

        K: the stiffness. Each is its displacement under the forces by which the springs that stabilise K follow the
        mode of the undeformed bodies. Solves with multigrid would cost too much: then it is that mode.
        """
        free, R, springs = self._step.model.stabilization
        if springs is None or not isinstance(K, Stiffness) or K.iterative or self._step.model.problem.kinematics.linear:
            return free
        turning = [K.solve(springs @ mode) for mode in free.T[R.shape[1] :]]
        return np.concatenate([R, np.stack(turning, axis=1)], axis=1)

    def stiffness(self, damping: float, definite: bool) -> Operator:
        """Return K_q plus `damping` times that of the undeformed bodies, factorised; or a K that is near (`change`).

        Negative energies are accepted unless `definite`. Raises LinearError.
        """
        step = self._step
        if step.model.problem.kinematics.linear:
            return step.reference
        if definite and not damping and self._near is not None:
            return self._near[0]
        return step.factorised(self._K_q, damping, definite)

    def change(self, K: Operator) -> csr_array | None:
        """Return what K_q has beside the K (n_q, n_q) that `stiffness` returned; None if that is K_q itself."""
        return self._near[1] if self._near is not None and self._near[0] is K else None

    @cached_property
    def _K_q(self) -> csr_array:
        """The tangent (n_q, n_q) of the bodies and of the time scheme, stabilised."""
        return self._step.stabilized(self._step.model.problem.constraints.reduced(self._tangent, self._T))

    @cached_property
    def _near(self) -> tuple[Operator, csr_array] | None:
        """A factorised tangent of this step, and the change (n_q, n_q) since then; None if there is none, or far.

        None also where only contact holds bodies, as entries say little about motions of so little energy, and in
        several processes, which would have to agree.
        """
        before, alone = self._step.factor, self._step.model.problem.space.share.own is None
        if before is None or before.K is self._K_q or self.free.shape[1] or not alone:
            return None
        change = csr_array(self._K_q - before.K)
        near = np.abs(scaled(change, 1 / np.sqrt(np.abs(before.scaling))).data).max(initial=0.0) <= _NEAR
        return (before, change) if near else None

    def geometric_stiffness(self, pressure: Floats) -> csr_array | None:
        """Return C (n_q, n_q) at pressures (m,); None if there is none.

        It is the geometric stiffness of contact, of follower loads, of rigid bodies and of inertia, without the springs
        that stabilise K_q.
        """
        model, nodal = self._step.model, self._nodal
        constraints, springs = model.problem.constraints, model.stabilization.springs
        parts = [nodal.geometric_stiffness(pressure)] if nodal.moving else []
        parts += [] if self._load_tangent is None else [-self._load_tangent]
        on_unknowns = [constraints.reduced(csr_array(part), self._T) for part in parts]
        on_unknowns += [
            constraints.turning(self._q, self._step.t, self._unbalanced + nodal.rows.B_T @ pressure),
            None if springs is None else -springs,
            None if self._step.terms is None else self._step.terms.bent(self._q),
        ]
        total = [part for part in on_unknowns if part is not None]
        return csr_array(sum(total[1:], total[0])) if total else None

    def terms(self) -> ForceTerms:
        """Return the terms that the forces are summed from, for their round-off."""
        model, K = self._step.model, self._step.reference.K
        nodal = np.abs(self._internal) + np.abs(self._load)
        beside = np.abs(self._rigid) + np.abs(self._inertial)
        beside = beside + model.problem.constraints.on_unknowns(nodal, abs(self._T))
        stiff = np.abs(model.vectors.summed(K.diagonal()))
        if model.problem.kinematics.linear:
            return ForceTerms(model.vectors.summed(sizes(K, self._q)) + beside, stiff)
        largest = model.vectors.largest_of_body(self._q) + model.longest * model.vectors.size  # strains of about 1
        return ForceTerms(stiff * largest, stiff)

    @cached_property
    def _tangent(self) -> Matrix:
        """Tangent (n_dof, n_dof) of the internal forces at u."""
        model = self._step.model
        if model.problem.kinematics.linear:
            return model.K
        return model.problem.kinematics.tangent(self._u, self._step.t, self._step.state.histories.materials)

    @cached_property
    def _load_tangent(self) -> csr_array | None:
        """Derivative (n_dof, n_dof) of the loads at u; None if no load follows the bodies."""
        return self._step.model.problem.loads.tangent(self._step.t, self._u)

    def _extrapolate(self, du: Floats, p: Floats) -> None:
        """Add the change of forces and gaps along du (n_dof,) at pressures p (m,), to first order."""
        nodal = self._nodal
        self._unbalanced = self._unbalanced + self._tangent @ du
        if nodal.moving:
            self._unbalanced = self._unbalanced + nodal.geometric_stiffness(p) @ du
        if self._load_tangent is not None:
            self._unbalanced = self._unbalanced - self._load_tangent @ du
        self.contact = self.contact.with_gaps(self.contact.G - nodal.rows.D @ du)
