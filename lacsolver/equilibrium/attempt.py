"""Attempts to find the equilibrium of one step, with their start, and the message of one that failed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.contact import Interface
from lacsolver.equilibrium.active_set import active_set_iterates
from lacsolver.equilibrium.alternating import alternating
from lacsolver.equilibrium.carrying import friction_at, least_friction, may_press_alone
from lacsolver.equilibrium.kept_columns import start_from_columns
from lacsolver.equilibrium.load_step import Linearization, LoadStep
from lacsolver.equilibrium.newton import newton_iterates, residual_of
from lacsolver.equilibrium.search import IterationCallback, Outcome, Trial, search
from lacsolver.equilibrium.state import Iterate, StepState
from lacsolver.linear import LinearError
from lacsolver.problem.motions import FreeMotion, describe
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.rigid_modes import STOPPED_BY_CONTACT, felt
from lacsolver.saddle.coarse_start import coarse_start
from lacsolver.saddle.saddle import RANK_TOLERANCE, SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import ROUNDING, ConvergenceTolerance, sizes
from lacsolver.space.space import Space

#: damping of the second search for an equilibrium at its start, relative to the undeformed bodies' stiffness
_DAMPING = 1.0
#: iterations of the first search, and of both, as fractions of `max_iterations`, and how many each may take in any case
_FIRST, _BOTH = (0.5, 25), (0.78, 39)
#: steps in which bodies settle where they slip least, on skins that move
_SETTLED = 4
#: load along a rigid-body mode that contact does not balance, relative to all forces along it
_UNCARRIED = 1e-6
#: part of the contact stiffness below which a message names the motion that it resists: faces at a slope of 3 %
_SLIGHT = 1e-3


class Progress(NamedTuple):
    """Progress of a search after an iteration: target time, halvings so far, number of iterations, closed rows.

    `balance`, `gap`: relative residuals; `before`: time of the last converged step.
    """

    time: float
    halvings: int
    number: int
    closed: int
    balance: float
    gap: float
    before: float = 0.0


def attempt(step: LoadStep, halvings: int = 0, progress: Callable[[Progress], None] | None = None) -> Outcome:
    """Search the equilibrium at one time, after so many halvings. The iterations of all attempts are counted.

    A body that moves away has none: what is left of its load may be less than the round-off of a body so far away.
    """

    def report(number: int, closed: int, balance: float, gap: float) -> None:
        if progress is not None:
            progress(Progress(step.t, halvings, number, closed, balance, gap, step.state.time))

    outcome = _released(step, None, report) if nothing_acts(step) else None
    if outcome is None:
        outcome = _searched(step, report, _tolerance(step))
        outcome = _released(step, outcome, report) or outcome
    doubted = outcome.converged and step.model.problem.kinematics.linear
    return outcome._replace(converged=False) if doubted and any(_uncarried(step, outcome)) else outcome


def _searched(step: LoadStep, report: IterationCallback, tolerance: ConvergenceTolerance) -> Outcome:
    """Search as `attempt` does, by one method after another."""
    model, solver = step.model, step.model.problem.case.solver

    def newton(start: Iterate, most: int, **how: Any) -> Outcome:
        limits = replace(tolerance, max_iterations=min(most, solver.max_iterations))
        return search(newton_iterates(step.linearize, start, limits, constant=constant, **how), limits, report)

    state, constant, outcome = step.state, model.problem.kinematics.linear, None
    first, both = (max(int(share * solver.max_iterations), least) for share, least in (_FIRST, _BOTH))
    first = solver.max_iterations if constant else first  # there is no second search
    now, extrapolated = state.iterate or first_iterate(step), model.scheme.predict(state, step.t)
    if model.linear:
        start = extrapolated or now
        trials = _linear_iterates(step, start, tolerance)
        ends = convex(step, start)
        return search(trials, replace(tolerance, max_iterations=sys.maxsize) if ends else tolerance, report)
    if extrapolated is not None:
        with suppress(InadmissibleError):
            if not (state.histories.materials and _turns_round(step, extrapolated, now, tolerance)):
                outcome = newton(extrapolated, first)
    if outcome is None:
        outcome = newton(now, first, predictor=_predictor(step, now))
    if outcome.converged or constant:
        return outcome
    left = both - outcome.trials
    again = newton(now, left, predictor=_predictor(step, now), damping=_DAMPING)
    return again._replace(
        residuals=outcome.residuals + again.residuals, applications=outcome.applications + again.applications
    )


def convex(step: LoadStep, at: Iterate) -> bool:
    """True if equilibrium is the least value of a convex energy: the search ends by itself, in steps of any size."""
    return step.model.linear and step.contact(at.q).with_springs(0.0) is not None


def nothing_acts(step: LoadStep) -> bool:
    """Return True if a step has no load and no prescribed displacement."""
    largest, rigid = step.model.problem.space.largest, step.model.problem.constraints.force(step.t)
    return not (rigid.any() or largest(step.u0) or largest(step.load(step.u_before)))


def _released(step: LoadStep, outcome: Outcome | None, report: IterationCallback) -> Outcome | None:
    """Return the equilibrium in which pairs that carry no force lie where they slip least; None where they carry one.

    Friction has no bound without a pressure: round-off chooses what sticks, and with it where bodies go that friction
    alone has held. So bodies first give up their strains, and then no pair slides any more. `outcome`: that of the
    usual search, None before; without one that has converged all pairs must be free of forces, by statics.
    """
    model, now = step.model, step.state.iterate
    if now is None or not model.motions or model.scheme.resists_rigid_motion:
        return None
    contact = step.contact(now.q)
    known = outcome is not None and outcome.converged
    idle = _idle(step, outcome) if outcome is not None and known else frozenset(range(len(contact.pairs)))
    if not any(group.shear is not None for k, group in enumerate(contact.pairs) if k in idle):
        return None
    motions = np.stack([model.problem.constraints.unknowns(motion.field) for motion in model.motions])
    if not known and may_press_alone(contact, motions):
        return None
    tolerance = replace(_tolerance(step), moved=model.problem.space.largest(step.u_before))  # slips are from there
    try:
        lying = replace(step, state=_lying(step, now, idle), stuck=idle)
        then = _searched(lying, report, tolerance)
    except (InadmissibleError, LinearError):
        return None
    doubted = model.problem.kinematics.linear and any(_uncarried(lying, then))  # of finite strains noise is left
    rests = then.converged and idle <= _idle(lying, then, tolerance) and not doubted
    return then if rests else None


def _idle(step: LoadStep, outcome: Outcome, tolerance: ConvergenceTolerance | None = None) -> frozenset[int]:
    """Return the numbers of the pairs without a pressure or traction beyond the tolerance of gaps."""
    (q, p, _), contact = outcome.iterate, outcome.contact
    gaps = (tolerance or _tolerance(step)).gaps(contact.rows.B, q)
    carries = np.abs(p) > contact.skin_stiffness * gaps
    pairs = enumerate(contact.pairs)
    return frozenset(k for k, group in pairs if group.law.compressive and not carries[group.every].any())


def _lying(step: LoadStep, now: Iterate, idle: frozenset[int]) -> StepState:
    """Return the state before a step with bodies as they are without the forces of `idle` pairs, which slip least.

    Slip is counted from there on.
    """
    contact, free, q = step.contact(now.q), step.model.stabilization.free, now.q
    p, active, pressed = now.p.copy(), now.active.copy(), contact.of_macro_elements(now.p > 0)
    for k, group in enumerate(contact.pairs):
        if k in idle:
            p[group.every], active[group.every] = 0.0, False
            active[group.rows] = now.p[group.rows] > 0
    for _ in range(1 if step.model.linear else _SETTLED):
        there = step.linearize(q)
        f = there.r - there.contact.rows.B_T @ p
        alone = SaddleProblem(there.stiffness(0.0, True), contact.rows, np.empty(0, np.int64), f, contact.G)
        q = q + solve_saddle(alone, np.zeros_like(f), np.zeros_like(p), _tolerance(step).linear(0.0)).q
        contact = step.contact(q)
        weight = 1 / np.sqrt(contact.rows.w[pressed])
        moves = weight[:, None] * (contact.rows.D @ free)[pressed]
        q = q + free @ np.linalg.lstsq(moves, weight * contact.G[pressed], rcond=RANK_TOLERANCE)[0]
    histories = step.commit(q, p, active, step.contact(q))._replace(materials=step.state.histories.materials)
    return replace(step.state, iterate=Iterate(q, p, active), earlier=None, histories=histories)


def _tolerance(step: LoadStep) -> ConvergenceTolerance:
    """Return the convergence criteria of a step."""
    model, solver = step.model, step.model.problem.case.solver
    length, moved = 0.0 if model.linear else model.length, model.problem.space.largest(step.u0)
    return ConvergenceTolerance(solver.tolerance, solver.max_iterations, length, moved, model.vectors)


def _linear_iterates(step: LoadStep, start: Iterate, tolerance: ConvergenceTolerance) -> Iterator[Trial]:
    """Return the iteration of a linear problem: active sets on its only linearisation."""
    free, _, springs = step.model.stabilization
    geometric = None if springs is None else -springs
    if geometric is None and step.given is None:
        contact = step.contact(start.q)
        if step.state.iterate is None:
            start = coarse_start(step.reference, step.f, contact, start, tolerance)
        elif (kept := step.model.kept_columns(step.reference, contact.rows)) is not None:
            start = start_from_columns(kept, step.f, contact, start, tolerance)
    return active_set_iterates(step.reference, step.f, step.contact, start, tolerance, free=free, geometric=geometric)


def _turns_round(step: LoadStep, extrapolated: Iterate, now: Iterate, tolerance: ConvergenceTolerance) -> bool:
    """True if the extrapolated state is farther from balance than the last one is at the new time: loads turn round.

    A material with a history is then elastic again, and its tangent at the extrapolated state is of flow that is over.
    Raises InadmissibleError.
    """
    # the extrapolated state last: mostly the search goes on from there, and its skins are paired by then
    before, ahead = (residual_of(step.linearize(one.q), one, tolerance).merit for one in (now, extrapolated))
    return ahead > before


def _predictor(step: LoadStep, now: Iterate) -> Linearization:
    """Return the linearisation at the new time, extrapolated from the last iterate or the undeformed bodies."""
    time = step.state.time
    u = LoadStep(step.model, time, step.state).u(now.q) if time else np.zeros_like(step.u0)
    return step.predictor(now.q, u, now.p)


def first_iterate(step: LoadStep) -> Iterate:
    """Return the initial iterate at q = 0. Raises DataError for unsupported bodies."""
    problem, q = step.model.problem, np.zeros(step.model.problem.constraints.n_q)
    contact, interfaces = step.contact(q), step.interfaces(q)
    step.model.check_held(step.closed_rows(q, contact.may_carry))
    closed = np.zeros(len(contact.G), bool)
    for pair, face, group in zip(problem.joints, interfaces, contact.pairs, strict=True):
        closed[group.rows] = _initial(pair, face)
    return Iterate(q, np.zeros(len(contact.G)), closed & contact.enforceable)


def _initial(pair: ContactPair, face: Interface) -> NDArray[np.bool_]:
    """Return a mask (rows,), True for rows of a pair that are closed at the start."""
    if pair.initial == "gap":
        return face.touching
    return np.full(face.B.shape[0], pair.initial == "all")


def rested(step: LoadStep, outcome: Outcome) -> tuple[Iterate, bool]:
    """Return the iterate of a converged step from which the next one starts, and True if a contact has come to rest.

    A contact rests where its pressures are within the tolerance of gaps: round-off has chosen its rows. Where contact
    alone holds bodies, its rows are then those of the undeformed bodies at the start of a run.
    """
    model, (q, p, active), contact = step.model, outcome.iterate, outcome.contact
    if not model.motions or model.scheme.resists_rigid_motion:
        return outcome.iterate, False
    p, active, before, came, idle = p.copy(), active.copy(), step.state.iterate, False, _idle(step, outcome)
    for k, (group, face) in enumerate(zip(contact.pairs, step.interfaces(q), strict=True)):
        if k in idle:
            p[group.every], active[group.every] = 0.0, False
            active[group.rows] = _initial(group.pair, face) & contact.enforceable[group.rows]
            came = came or (before is not None and bool(before.p[group.rows].any()))
    return Iterate(q, p, active), came


def why(step: LoadStep, outcome: Outcome) -> str:
    """Return the message for a failed search: a body that moves away, or the largest imbalance, and what to try."""
    problem = step.model.problem
    acts = outcome.iterate.active | (outcome.iterate.p != 0)  # rows along tangents that slide are not active
    closed = outcome.contact.rows.B[np.flatnonzero(acts)]
    message = f"no equilibrium found at time {step.t:.6g} after {len(outcome.residuals)} iterations"
    for motion, along, load in _uncarried(step, outcome):
        if slides := _sliding(step, outcome, along, load):
            return f"{message}: {describe(motion).replace(' moves ', ' slides ')}: {slides}"
        if STOPPED_BY_CONTACT**2 < (part := _resistance(step, motion)) < _SLIGHT:
            hardly = f"contact resists that with {part:.1e} of its stiffness only"
            return (
                f"{message}: {describe(motion)} along its load, and {hardly}; support it by a displacement or a spring"
            )
        if not np.abs(closed @ along).any():
            return f"{message}: {describe(motion)}, and no contact stops it; support it, or load it toward its master"
    off = problem.constraints.on_unknowns(step.reaction(*outcome.iterate[:2])) - problem.constraints.force(step.t)
    number, place = _largest_node(problem.space, problem.constraints.T @ off)
    balance, gap = outcome.residuals[-1]
    message += f": forces are off by {balance:.1e} of the largest, most at node {number} ({place}), "
    message += f"gaps by {gap:.1e} of the largest displacement (tolerance {problem.case.solver.tolerance:.1e})"
    what, advice = alternating(outcome, problem.space)
    message += f"; in the last iterations {what}" if what else ""
    if convex(step, outcome.iterate):
        held = "check whether loads tilt a body that only contact supports, or prescribed displacements squeeze one"
        return f"{message}; {advice or held}"
    message += f"; {advice}; or" if advice else ";"
    return f"{message} try more steps ([steps] count) or more iterations ([solver] max_iterations)"


def _resistance(step: LoadStep, motion: FreeMotion) -> float:
    """Return the part of the contact stiffness that resists a motion at the start of a step; inf without contact.

    On skins that are parallel to the motion it is the mean square of their roughness.
    """
    problem, now = step.model.problem, step.state.iterate or first_iterate(step)
    closed, x = step.closed_rows(now.q, now.active), problem.space.local.points.copy()
    x[:, : problem.space.dim] += step.u_before.reshape(-1, problem.space.dim)
    own = x if problem.kinematics.finite else None
    return float(felt(closed, (motion,), own)[0]) ** 2 if closed.shape[0] else np.inf


def _uncarried(step: LoadStep, outcome: Outcome) -> Iterator[tuple[FreeMotion, Floats, Floats]]:
    """Yield the rigid-body motions along which contact, within its laws, does not carry the load.

    Each with its displacement (n_q,), and all with the load (n_q,). Bodies do no work along them; of small strains
    their forces have only round-off, which is large where bodies are far away.
    """
    model, constraints = step.model, step.model.problem.constraints
    if model.scheme.resists_rigid_motion or not model.motions:
        return
    internal, load, _ = step.forces(*outcome.iterate[:2])
    internal = np.zeros_like(load) if model.problem.kinematics.linear else internal
    load = constraints.on_unknowns(load - internal) + constraints.force(step.t)
    carried = outcome.contact.rows.B_T @ outcome.contact.lawful(outcome.iterate.p)
    along = np.stack([constraints.unknowns(motion.field) for motion in model.motions])
    left = np.abs(model.vectors.dots(along, load - carried))
    whole = model.vectors.dots(np.abs(along), np.abs(load) + np.abs(carried))
    # forces that are in balance leave that, in whatever direction they are
    largest = max(map(model.vectors.norm, along)) * model.vectors.norm(np.abs(load) + np.abs(carried))
    within = step.model.problem.case.solver.tolerance * largest
    beyond = left > np.maximum(_UNCARRIED * whole, within)
    if beyond.any() and model.problem.kinematics.linear:
        # round-off of bodies within the model, and of gaps, which is all that is left without a load
        near = np.clip(outcome.iterate.q, -model.length, model.length)
        terms = model.vectors.summed(sizes(step.reference.K, near))
        gaps = np.abs(outcome.contact.rows.B @ along.T).T @ outcome.contact.skin_stiffness * model.length
        beyond &= left > ROUNDING * (model.vectors.dots(np.abs(along), terms) + gaps)
    for k in np.flatnonzero(beyond):
        yield model.motions[k], along[k], load


def _sliding(step: LoadStep, outcome: Outcome, along: Floats, load: Floats) -> str:
    """Return a sentence on the friction that a load (n_q,) asks for, along a motion (n_q,) that contact resists.

    "" where friction is not the reason that no equilibrium was found.
    """
    model = step.model
    if not outcome.contact.sheared:
        return ""
    motions = np.stack([model.problem.constraints.unknowns(motion.field) for motion in model.motions])
    asked = least_friction(outcome.contact, motions, model.vectors.dots(motions, load), along)
    asked = asked or friction_at(outcome.contact, outcome.iterate, float(model.vectors.dots(along, load)), along)
    if asked is None:
        return ""
    return (
        f"friction of {asked.pair!r} carries {asked.carries:.3f} of its pressure, and {asked.asks:.3f} is needed; "
        "support the body, or raise friction"
    )


def _largest_node(space: Space, r: Floats) -> tuple[int, str]:
    """Return the number and the place of the node with the largest entry of r (n_dof,), of those of all processes."""
    size = np.abs(r).reshape(-1, space.dim).max(axis=1)
    if space.share.own is not None:
        size[~space.share.own] = -1.0
    node = int(size.argmax())
    largest = space.share.gather(np.array([[size[node], space.mesh.node_number[node], *space.mesh.points[node]]]))
    _, number, *at = largest[largest[:, 0].argmax()]
    return int(number), ", ".join(space.told(np.array(at)))
