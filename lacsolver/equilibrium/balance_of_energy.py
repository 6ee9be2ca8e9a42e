"""Energies of a motion, and its momentum: an account that closes in every step, if the step fulfils its equations.

    kinetic + strain + soft_contact - external + damped + contact + friction + numerical = 0

`strain`, `soft_contact`: what bodies and springs store, and what soft contact does; `external`: the energy at the
start, and the work of loads, supports and heat since then; `damped`, `contact`, `friction`: what damping (also that of
contact), contact and its friction have taken. Work is that of mean forces, dw . (F + F') / 2. Friction takes its
traction at the end of each step times the slip of that step, and the rest of the work of contact forces, but what soft
contact stores of it, is `contact`. `numerical`: what the time scheme has taken, by its own formula, with d for
differences over a step and m for means,

    dT = dv . M v_m = dw . M a_m - N,
    N = dt^2 (beta - gamma/2) (d(a . M a) / 2 + (gamma - 1/2) da . M da) - (gamma - 1/2) da . M dw

and M a = reaction - F_alpha with F_alpha' = (1 - alpha) F' + alpha F. What is left over in finite kinematics, as mean
forces do not integrate energy exactly, is numerical too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.motion import MotionState

if TYPE_CHECKING:
    from lacsolver.equilibrium.newmark import Newmark
    from lacsolver.problem.inertia import Inertia


def kinetic(inertia: Inertia, v: Floats) -> float:
    """Return the kinetic energy of velocities v (n_w,)."""
    return 0.5 * inertia.dot(v, inertia.M @ v)


def strain(step: LoadStep, q: Floats, internal: Floats) -> float:
    """Return the energy stored in bodies and springs at q, with the internal forces (n_dof,) there."""
    problem, u = step.model.problem, step.u(q)
    if problem.kinematics.linear and not problem.case.temperature:
        return 0.5 * problem.space.dot(u, internal)
    own = problem.kinematics.energy(u, step.t, step.state.histories.materials)
    return float(problem.space.share.total(np.array(own)))


def momentum(inertia: Inertia, w: Floats, v: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the linear momentum (dim,), and the angular one (3,), () in a plane, about the origin.

    Displacements w (n_w,) count in finite kinematics. In axisymmetry only the momentum along y is not 0.
    """
    space, dim = inertia.space, inertia.space.dim
    mv = (inertia.M @ v).reshape(-1, dim)
    x = inertia.positions.reshape(-1, dim) + space.origin[:dim]
    x = x + w.reshape(-1, dim) if inertia.finite else x
    linear = inertia.total(mv)
    if space.model.axisymmetric:
        return linear * [0.0, 1.0], np.array(0.0)
    if dim == 2:
        return linear, inertia.total((x[:, 0] * mv[:, 1] - x[:, 1] * mv[:, 0])[:, None])[0]
    return linear, inertia.total(np.cross(x, mv))


def energies(
    scheme: Newmark, step: LoadStep, q: Floats, p: Floats, dt: float, after: MotionState
) -> NDArray[np.floating]:
    """Return the energies (8,) at the end of a step, in the order of `equilibrium.motion.ENERGIES`.

    The step, of size dt, has converged at q (n_q,), p (m,) with the motion `after`.
    """
    inertia, problem, now, before = scheme.inertia, step.model.problem, step.state.iterate, step.state.motion
    assert now is not None and before is not None
    dw = inertia.places(q, step.t) - inertia.places(now.q, step.state.time)
    du = inertia.on_nodes(dw)

    def work(name: str) -> float:
        return 0.5 * problem.space.dot(du, getattr(before, name) + getattr(after, name))

    stored, heat = strain(step, q, after.internal), heat_of(step, q)
    soft = step.stored_in_contact(q, p)
    damped = 0.0 if scheme.C is None else 0.5 * inertia.dot(dw, scheme.C @ (before.velocity + after.velocity))
    supports, turned = _supports(scheme, step, q, after, dw)
    rubbed, in_contact = step.dissipated(q, p), step.damped_by_contact(q, p)
    added = [
        work("load") + supports + heat,
        damped + in_contact,
        work("contact") - rubbed - in_contact - (soft - before.energies[-1]),
        rubbed,
        turned + _dissipated(scheme, before, after, dt, dw),
    ]
    if not problem.kinematics.linear:  # what laws with a history do not give back is damped
        keeps = any(getattr(law, "n_history", 0) for law in problem.materials.laws)
        added[1 if keeps else 4] += work("internal") + heat - (stored - before.energies[1])
    return np.array([kinetic(inertia, after.velocity), stored, *(before.energies[2:-1] + added), soft])


def heat_of(step: LoadStep, q: Floats) -> float:
    """Return the energy that bodies get from a change of temperature in a step, the mean of that at both its ends."""
    problem, state = step.model.problem, step.state
    if not any(record.value.depends_on_time for record in problem.case.temperature):
        return 0.0
    history = state.histories.materials
    ends = [
        problem.kinematics.energy(u, step.t, history) - problem.kinematics.energy(u, state.time, history)
        for u in (step.u_before, step.u(q))
    ]
    return 0.5 * float(problem.space.share.total(np.array(sum(ends))))


def _dissipated(scheme: Newmark, before: MotionState, after: MotionState, dt: float, dw: Floats) -> float:
    """Return the energy that the time scheme takes in a step: N, and the work of F_alpha beyond that of F."""
    M, dot = scheme.inertia.M, scheme.inertia.dot
    da, more = after.acceleration - before.acceleration, scheme.gamma - 0.5
    Mda = M @ da
    square = dot(after.acceleration + before.acceleration, Mda)
    newmark = dt**2 * (scheme.beta - scheme.gamma / 2) * (0.5 * square + more * dot(da, Mda))
    weighted = after.reaction + before.reaction - M @ (after.acceleration + before.acceleration)
    plain = scheme.forces(after) + scheme.forces(before)
    return newmark - more * dot(Mda, dw) + 0.5 * dot(dw, weighted - plain)


def _supports(scheme: Newmark, step: LoadStep, q: Floats, after: MotionState, dw: Floats) -> tuple[float, float]:
    """Return the work of supports and of loads on rigid bodies in a step, and what finite rotations lose of it.

    That of free unknowns is dq times the loads on them, and not times the reactions, which must come to the same.
    """
    inertia, constraints = scheme.inertia, step.model.problem.constraints
    now, then, before = step.state.iterate, step.state.time, step.state.motion
    assert now is not None and before is not None
    mean, turned = 0.5 * (before.reaction + after.reaction), 0.0
    held = inertia.places(np.zeros_like(q), step.t) - inertia.places(np.zeros_like(q), then)
    on_free = inertia.on_unknowns(before.reaction, now.q, then)
    on_free += (1 - scheme.alpha) * constraints.force(step.t, q) + scheme.alpha * constraints.force(then, now.q)
    work = 0.5 * float(step.model.vectors.dots((q - now.q)[None], on_free)[0])
    first, last = inertia.of_own(before.reaction), inertia.of_own(after.reaction)
    for body, at in inertia.turning:
        start, end = (body.motion(constraints.before_equations(*one), one[1]) for one in ((now.q, then), (q, step.t)))
        force = body.moment_arm_at(start).T @ first[at] + body.moment_arm_at(end).T @ last[at]
        sums = inertia.space.share.total(np.append(force, dw[at] @ (first[at] + last[at])))
        turned += 0.5 * float((end - start) @ sums[:-1] - sums[-1])
        work += 0.5 * float((end - start)[~body.free] @ sums[:-1][~body.free])
        held[at] = 0.0
    return work + inertia.dot(held, mean), turned
