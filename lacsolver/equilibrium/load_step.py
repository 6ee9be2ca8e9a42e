"""Load step: a problem on the unknowns q at one time, with its forces, its tangent and its contact at any q.

    r(q) = T^T (f(u, t) - f_int(u)) + forces on rigid bodies - forces of the time scheme,     T = du/dq
    K_q = T^T K T + matrix of the time scheme,   B_q = B T,   D_q = D T

Equilibrium is r = B_q^T p. Under small kinematics with skins that are paired once, everything is linear in q. Residuals
and tangents are evaluated apart: a trial that is given up costs no tangent.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.bodies.finite import InadmissibleError
from lacsolver.contact import Interface
from lacsolver.equilibrium.newton import Linearization
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.schemes import StepTerms
from lacsolver.linear import Matrix, SingularError
from lacsolver.problem import acting
from lacsolver.results.state import Histories, StepState
from lacsolver.saddle.contact_system import ContactSystem, contact_system
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.tolerances import ForceTerms, sizes


@dataclass(eq=False)
class LoadStep:
    """A problem at time t, in the step from a state: loads, prescribed displacements, and all that depends on q.

    `given`: terms to take in place of those of the model's time scheme.
    """

    model: ReducedProblem
    t: float
    state: StepState = field(default_factory=StepState)
    given: StepTerms | None = None

    def __post_init__(self) -> None:
        self._last: tuple[Floats, tuple[Interface, ...], ContactSystem] | None = None
        self._linear: ContactSystem | None = None
        self._definite = True

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
        follows = any(pressure.follower for pressure in self.model.problem.case.pressure)
        return self.model.problem.load(self.t, u) if follows else self._reference_load

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
        made = self._reduced(self._nodal_contact(q)[1], self.model.problem.constraints.tangent(q, self.t))
        if self.model.linear:
            self._linear = made.with_gaps(made.G + made.rows.D @ q)
        return made

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
        return self._internal_force(u), self.load(u), self._nodal_contact(q)[1].rows.B_T @ p

    def zone_forces(self, q: Floats, p: Floats) -> NDArray[np.floating]:
        """Return the resultant (n_pairs, dim) of the contact forces on each slave."""
        space, system = self.model.problem.space, self._nodal_contact(q)[1]
        out = np.zeros((len(system.groups), space.dim))
        for k, group in enumerate(system.groups):
            assert group.pair is not None and group.face is not None
            nodes = group.pair.zone.slave.faces.nodes
            force = -(group.face.B.T @ p[group.rows]).reshape(-1, space.dim)
            out[k] = force[np.unique(nodes[nodes >= 0])].sum(axis=0)
        return out

    def commit(self, q: Floats, p: Floats, active: NDArray[np.bool_], contact: ContactSystem) -> Histories:
        """Return what laws and the time scheme keep of this step, which has converged at q."""
        histories, model = self.state.histories, self.model
        materials = model.problem.kinematics.commit(self.u(q), self.t, histories.materials)
        scheme = model.scheme.commit(self, q, p)
        return Histories(materials, contact.commit(p, active), scheme)

    def linearize(self, q: Floats) -> Linearization:
        """Return forces and contact at q, and functions for the tangent. Raises InadmissibleError."""
        u = self.u(q)
        self.model.check_beside_axis(u)
        return self._linearize(q, u, self._nodal_contact(q)[1])

    def predictor(self, q: Floats, u: Floats, p: Floats) -> Linearization:
        """Return a first-order prediction of `linearize`, from u (n_dof,) with earlier prescribed values.

        Forces and gaps are those at u, plus their linear change on the way to u(q, t) at pressures p (m,).
        """
        nodal = contact_system(self.model.problem, self._paired(u), u, self.state.histories.contact)
        return self._linearize(q, u, nodal, (self.u(q) - u, p))

    def _internal_force(self, u: Floats) -> NDArray[np.floating]:
        """Return the internal forces (n_dof,). Raises InadmissibleError where u inverts a cell, on all processes."""
        f, failed = np.zeros_like(u), None
        try:
            f = self.model.problem.kinematics.internal_force(u, self.t, self.state.histories.materials)
        except InadmissibleError as error:
            failed = error
        self.model.problem.space.share.agree(failed)
        return f

    def _linearize(
        self, q: Floats, u: Floats, nodal: ContactSystem, change: tuple[Floats, Floats] | None = None
    ) -> Linearization:
        """Return the linearisation from the contact at u; `change`: (du (n_dof,), p) to go on by, to first order."""
        model, problem = self.model, self.model.problem
        c, T = problem.constraints, problem.constraints.tangent(q, self.t)
        inner, load = self._internal_force(u), self.load(u)
        tangent, following = self._tangents(u)
        contact, out = self._reduced(nodal, T), inner - load
        if change is not None:
            du, p = change
            out = out + tangent() @ du + (nodal.geometric_stiffness(p) @ du if nodal.moving else 0.0)
            load_tangent = following()
            out = out if load_tangent is None else out - load_tangent @ du
            contact = contact.with_gaps(contact.G - nodal.rows.D @ du)
        rigid = c.force(self.t, q)
        scheme = np.zeros_like(q) if self.terms is None else self.terms.force(q)

        def geometric_stiffness(pressure: Floats) -> csr_array | None:
            load_tangent = following()
            parts = [nodal.geometric_stiffness(pressure)] if nodal.moving else []
            parts += [] if load_tangent is None else [-load_tangent]
            total = [model.reduced(csr_array(part), T) for part in parts]
            bent = c.turning(q, self.t, out + nodal.rows.B_T @ pressure)
            springs = model.stabilization.springs
            total += ([] if bent is None else [bent]) + ([] if springs is None else [-springs])
            inertial = None if self.terms is None else self.terms.bent(q)
            total += [] if inertial is None else [inertial]
            return csr_array(sum(total[1:], total[0])) if total else None

        def stiffness(damping: float, definite: bool) -> Operator:
            if problem.kinematics.linear:
                return self.reference
            return self._factorised(model.stabilized(model.reduced(tangent(), T), self._matrix), damping, definite)

        def terms() -> ForceTerms:
            inside = c.on_unknowns(np.abs(inner) + np.abs(load), abs(T))
            return self._force_terms(q, np.abs(rigid) + np.abs(scheme) + inside)

        largest = max(problem.space.largest(v) for v in (inner, load, out))
        largest = max(largest, *(model.vectors.largest(v) for v in (rigid, scheme)))
        r = rigid - c.on_unknowns(out, T) - scheme
        return Linearization(r, largest, contact, stiffness, geometric_stiffness, model.stabilization.free, terms)

    def _tangents(self, u: Floats) -> tuple[Callable[[], Matrix], Callable[[], csr_array | None]]:
        """Return functions for K and df/du (n_dof, n_dof) at u, each evaluated once, when it is called."""
        problem = self.model.problem

        @cache
        def tangent() -> Matrix:
            if problem.kinematics.linear:
                return self.model.K
            return problem.kinematics.tangent(u, self.t, self.state.histories.materials)

        @cache
        def following() -> csr_array | None:
            return acting.load_tangent(problem.space, problem.case, u, self.t)

        return tangent, following

    def _force_terms(self, q: Floats, terms: Floats) -> ForceTerms:
        """Return the terms that forces at q are summed from; `terms` (n_q,): those beside K q of a linear problem."""
        K, summed = self.reference.K, self.model.vectors.summed
        stiff = np.abs(summed(K.diagonal()))
        if self.model.problem.kinematics.linear:
            return ForceTerms(summed(sizes(K, q)) + terms, stiff)
        largest = self.model.vectors.largest(q) + self.model.longest  # strains of about 1
        return ForceTerms(stiff * largest, stiff)

    def _factorised(self, K: csr_array, damping: float, definite: bool) -> Operator:
        """Return K (n_q, n_q) plus `damping` times that of the undeformed bodies, factorised."""
        K = csr_array(K + damping * self.reference.K) if damping else K
        if self._definite and definite:
            with suppress(SingularError):
                return self.model.factors.factorise(K)
        self._definite = bool(damping)  # bodies that buckle: a definite factor is not tried again before the next step
        return self.model.factors.factorise(K, definite=False)

    def _reduced(self, nodal: ContactSystem, T: csr_array) -> ContactSystem:
        return nodal.reduced(T, self.reference)

    def _nodal_contact(self, q: Floats) -> tuple[tuple[Interface, ...], ContactSystem]:
        """Return interfaces and contact rows on all nodes at q; the last are kept, in a linear problem for every q."""
        if self._last is None or not (self.model.linear or np.array_equal(self._last[0], q)):
            u = self.u(q)
            faces = self._paired(u)
            made = contact_system(self.model.problem, faces, u, self.state.histories.contact)
            self._last = q.copy(), faces, made
        return self._last[1:]

    def _paired(self, u: Floats) -> tuple[Interface, ...]:
        return tuple(self.model.interface(pair, u, self.t) for pair in self.model.problem.joints)
