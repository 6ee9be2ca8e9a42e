"""Newmark's method and that of Hilber, Hughes and Taylor (HHT), with the contact conditions at the end of each step.

    M a' + (1 - alpha) F' + alpha F = reaction',      F = f_int(u) - f + B^T p + C v
    u' = u + dt v + dt^2 ((1/2 - beta) a + beta a'),  v' = v + dt ((1 - gamma) a + gamma a')

A prime marks the end of the step. HHT: alpha in [0, 1/3], beta = (1 + alpha)^2 / 4, gamma = 1/2 + alpha (Hilber, Hughes
and Taylor 1977, whose alpha has the other sign); Newmark: alpha = 0. Divided by 1 - alpha, this is the static equation
with the forces (M a' + alpha F) / (1 - alpha) + C v' and their derivative beside it: a step is a search as in statics.

At nodes without mass the equation is F' = 0: their velocity in results is the difference of displacements over
the step.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array

from lacmesh.mesh import Floats
from lacsolver.equilibrium.balance_of_energy import energies, momentum
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.motion import CONTACT, STORED, MotionState
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.schemes import StepTerms
from lacsolver.equilibrium.starting import motion_forces, start_of_motion
from lacsolver.equilibrium.state import Iterate, StepState
from lacsolver.problem.problem import Problem

#: digits of a step's size: steps that differ by round-off are one, and share a factor
_DIGITS = 10
#: contact work of a step, relative to all energy, above which the step is halved, in finite kinematics
_COARSE = 0.01


class Newmark:
    """The time scheme of a problem with [dynamics]: HHT, or Newmark's method."""

    resists_rigid_motion = True

    def __init__(self, problem: Problem) -> None:
        how, inertia = problem.case.dynamics, problem.inertia
        if how is None or inertia is None:
            raise ValueError("the case has no [dynamics]")
        self.problem, self.inertia, self.rayleigh = problem, inertia, how.rayleigh
        hht = how.scheme == "hht"
        self.alpha = how.alpha if hht else 0.0
        self.beta = (1 + self.alpha) ** 2 / 4 if hht else how.beta
        self.gamma = 0.5 + self.alpha if hht else how.gamma
        self._matrix: tuple[float, csr_array] | None = None

    @cached_property
    def C(self) -> csr_array | None:
        """Damping matrix (n_w, n_w), a M + b K with the undeformed bodies' K; None without damping."""
        a, b = self.rayleigh
        if not (a or b):
            return None
        K = self.problem.kinematics.tangent(np.zeros(self.problem.space.n_dof), 0.0)
        more = self.inertia.M.shape[0] - K.shape[0]
        return csr_array(a * self.inertia.M + b * block_diag([K, csr_array((more, more))], format="csr"))

    def begin(self, model: ReducedProblem, state: StepState, t: float) -> StepState:
        """Return the state of the start: initial velocities, with accelerations and pressures that are consistent."""
        if state.motion is not None:
            return state
        return start_of_motion(model, self.inertia, self.C, state, t - state.time)

    def predict(self, state: StepState, t: float) -> Iterate | None:
        """Return the linear extrapolation of the last two steps."""
        return state.extrapolated(t)

    def terms(self, model: ReducedProblem, state: StepState, t: float) -> StepTerms:
        """Return the forces of inertia and damping in the step to time t, and their derivatives."""
        before, now = state.motion, state.iterate
        assert before is not None and now is not None
        dt, inertia, constraints = time_step(state, t), self.inertia, self.problem.constraints
        last = self.alpha / (1 - self.alpha)
        forces, force = self.forces(before), last * constraints.force(state.time, now.q)
        w, v = self._extrapolated(before, inertia.places(now.q, state.time), dt)
        M = inertia.M / (1 - self.alpha)

        def inner(q: Floats) -> NDArray[np.floating]:
            a = (inertia.places(q, t) - w) / (self.beta * dt**2)
            out = M @ a + last * forces
            return out if self.C is None else out + self.C @ (v + self.gamma * dt * a)

        def bent(q: Floats) -> csr_array | None:
            curved = inertia.curvature(q, t, inner(q))
            return None if curved is None else csr_array(self._reduced(dt, q, t) - matrix + curved)

        def reaction(q: Floats, out: Floats) -> NDArray[np.floating]:
            return inertia.on_nodes((1 - self.alpha) * (inertia.padded(out) + inner(q)))

        matrix = self._constant(dt) if not inertia.turning else self._reduced(dt, now.q, state.time)
        return StepTerms(lambda q: inertia.on_unknowns(inner(q), q, t) - force, matrix, bent, reaction)

    def commit(self, step: LoadStep, q: Floats, p: Floats) -> Mapping[str, NDArray]:
        """Return the motion at the end of a step."""
        before, now = step.state.motion, step.state.iterate
        assert before is not None and now is not None
        dt, inertia = time_step(step.state, step.t), self.inertia
        w_before, w = inertia.places(now.q, step.state.time), inertia.places(q, step.t)
        w_free, v = self._extrapolated(before, w_before, dt)
        a = (w - w_free) / (self.beta * dt**2)
        v = v + self.gamma * dt * a
        if not self.rayleigh[1]:
            massless = inertia.massless_dofs
            v[massless] = (w - w_before)[massless] / dt
            a[massless] = (v - before.velocity)[massless] / dt
        internal, load, contact = motion_forces(step, q, p)
        pushed = step.zone_forces(q, p)
        pushes = np.stack([pushed, (1 - self.alpha) * pushed + self.alpha * before.pushes[:, 0]], axis=1)
        impulse = dt * ((1 - self.gamma) * before.pushes[:, 1] + self.gamma * pushes[:, 1])
        motion = MotionState(
            v, a, np.empty(0), internal, load, contact, before.energies, *momentum(inertia, w, v),
            before.impulse + impulse, pushes,
        )  # fmt: skip
        reaction = inertia.M @ a + (1 - self.alpha) * self.forces(motion) + self.alpha * self.forces(before)
        motion = motion._replace(reaction=reaction)
        return motion._replace(energies=energies(self, step, q, p, dt, motion))._asdict()

    def too_coarse(self, model: ReducedProblem, state: StepState, kept: Mapping[str, NDArray]) -> bool:
        """True in finite kinematics if the contact work of a step is more than one per cent of the energy."""
        before = state.motion
        if model.linear or before is None:
            return False
        then, now = before.energies, kept["energies"]
        return bool(abs(now[CONTACT] - then[CONTACT]) > _COARSE * max(then[STORED].sum(), now[STORED].sum()))

    def forces(self, motion: MotionState) -> NDArray[np.floating]:
        """Return F (n_w,), all forces but those of inertia and of supports."""
        out = self.inertia.padded(motion.internal - motion.load + motion.contact)
        return out if self.C is None else out + self.C @ motion.velocity

    def _extrapolated(
        self, before: MotionState, w: Floats, dt: float
    ) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return displacements and velocities (n_w,) at the end of a step without an acceleration there."""
        v, a = before.velocity, before.acceleration
        return w + dt * v + dt**2 * (0.5 - self.beta) * a, v + dt * (1 - self.gamma) * a

    def _constant(self, dt: float) -> csr_array:
        """Return the matrix for a step of size dt; that of the last size is kept, so that its factor serves again."""
        if self._matrix is None or self._matrix[0] != dt:
            self._matrix = dt, self._reduced(dt, np.zeros(self.problem.constraints.n_q), 0.0)
        return self._matrix[1]

    def _reduced(self, dt: float, q: Floats, t: float) -> csr_array:
        """Return T_w^T (M / ((1 - alpha) beta dt^2) + C gamma / (beta dt)) T_w at q."""
        S = self.inertia.M / ((1 - self.alpha) * self.beta * dt**2)
        S = S if self.C is None else S + self.C * (self.gamma / (self.beta * dt))
        return self.inertia.reduced(csr_array(S), q, t)


def time_step(state: StepState, t: float) -> float:
    """Return the size of the step from a state to time t, rounded so that equal steps are the same to the last bit."""
    return float(f"{t - state.time:.{_DIGITS}g}")
