"""Stepping in time: equilibrium at each step; a step that does not converge is halved, and grows again afterwards."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshError, LacmeshWarning
from lacmesh.mesh import Floats
from lacsolver.bodies.folding import folded
from lacsolver.case import Case
from lacsolver.constraints.coupling import CouplingRows
from lacsolver.constraints.equality_rows import Free
from lacsolver.contact.interface import TOUCHING, dips, mean_planes
from lacsolver.contact.laws import RowState
from lacsolver.equilibrium.attempt import Progress, attempt, convex, nothing_acts, rested, why
from lacsolver.equilibrium.holding import holdings
from lacsolver.equilibrium.ledger import Ledger
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.schemes import QuasiStatic, TimeScheme
from lacsolver.equilibrium.search import Outcome
from lacsolver.equilibrium.state import (
    CONTACT,
    SLIDES,
    UNPAIRED,
    Held,
    Iterate,
    State,
    StepState,
    ZoneFriction,
    ZoneState,
)
from lacsolver.problem.problem import Problem
from lacsolver.problem.rigid_modes import still_free
from lacsolver.problem.turned import turned_too_far
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.row_group import PairGroup
from lacsolver.saddle.tolerances import ROUNDING
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: relative difference below which two times are the same
_SAME = 1e-9
#: displacements below this multiple of the round-off of gaps are too small for reliable pressures
_CLEAR = 100
_EPSILON = float(np.finfo(float).eps)
#: halvings of a step that converged, whose scheme asks for a smaller one, or in which a cell folds
_REFINED = 3


class NotConvergedError(LacmeshError):
    """No equilibrium was found at some time. `state`: the last state tried.

    >>> from dataclasses import replace
    >>> from lacsolver import read_case
    >>> from lacsolver.problem.problem import Problem
    >>> case = read_case("data/two_blocks.toml")
    >>> contact = replace(case.contact[0], geometry="current")
    >>> case = replace(case, contact=contact, solver=replace(case.solver, max_iterations=1))
    >>> try:
    ...     list(march(Problem.of(case)))
    ... except NotConvergedError as error:
    ...     print(error.state.time == 0.5 / 2**6)  # after the last cutback of the first step
    True
    """

    status = 4

    def __init__(self, message: str, state: State) -> None:
        super().__init__(message)
        self.state = state


@dataclass
class _Attempts:
    """Iterations, halvings and residuals of a step so far. `refined`: halvings although it converged."""

    iterations: int = 0
    halvings: int = 0
    refined: int = 0
    residuals: list[float] = field(default_factory=list)

    def add(self, outcome: Outcome, missed: str | None) -> None:
        self.iterations += len(outcome.residuals)
        self.residuals += [balance for balance, _ in outcome.residuals]
        self.halvings += bool(missed) or not outcome.converged


def march(
    problem: Problem,
    *,
    start: StepState | None = None,
    progress: Callable[[Progress], None] | None = None,
    scheme: TimeScheme | None = None,
    kept: list[ReducedProblem] | None = None,
) -> Iterator[State]:
    """Yield the converged states, step by step, from the undeformed bodies or what an earlier step has committed.

    `progress` is called for every iteration. `scheme`: time scheme of the steps, static equilibrium by default. `kept`:
    a list with the problem of an earlier call, or empty; what serves this problem too is taken from there, and the
    list then has this problem.

    Raises NotConvergedError if a step was halved too often, DataError if a rigid-body motion is not constrained,
    and CaseError if prescribed displacements alone make skins overlap, or hold a tie apart. Nothing else is checked:
    `doubts.rules.Doubts` asks what may be wrong before the first step, after each of them, and at the end.

    >>> from lacsolver import read_case
    >>> for state in march(Problem.of(read_case("data/two_blocks.toml"))):
    ...     print(state.time, (state.zones[0].pressure > 0).all())
    0.5 True
    1.0 True
    """
    state, warned = start or StepState(), False
    acted = start is not None
    for one, times in _phases(problem, scheme, state.time):
        model = ReducedProblem(problem, one)
        if kept is not None:
            model.take_from(*kept)
            kept[:] = [model]
        state = one.begin(model, state, times[0])
        for step, outcome, converged in _marched(model, state, times, progress):
            warned, state = warned or _warn_of_rounding(step, outcome), converged.step
            acted = acted or _acts(step, converged.u, outcome.iterate.p)
            yield converged
    if not acted:
        message = "nothing acts on the bodies: the case has no load, prescribed motion or overlap that is not 0"
        warnings.warn(LacmeshWarning(f"{message}, and all displacements are 0; add one"), stacklevel=2)


def _acts(step: LoadStep, u: Floats, p: Floats) -> bool:
    """Return True if displacements u (n_dof,), pressures p (m,), loads or the forces of strains are not 0."""
    largest = step.model.problem.space.largest
    return bool(p.any() or largest(u) or largest(step.load(u)) or largest(step.internal_force(u)))


def _phases(problem: Problem, scheme: TimeScheme | None, now: float) -> Iterator[tuple[TimeScheme, Sequence[float]]]:
    """Yield each time scheme with the times at which its steps end: static ones first, where [dynamics] starts later.

    Times until `now` are left out.
    """
    case = problem.case
    times = [t for t in step_end_times(case) if t - now > _SAME * t]
    start = 0.0 if scheme is not None or case.dynamics is None else case.dynamics.start
    static = [t for t in times if t - start <= _SAME * start]
    if static:
        yield QuasiStatic(), static
    if len(times) > len(static):
        yield scheme or _scheme(problem), times[len(static) :]


def _scheme(problem: Problem) -> TimeScheme:
    """Return the time scheme of the steps that are not static."""
    if problem.case.dynamics is None:
        return QuasiStatic()
    from lacsolver.equilibrium.newmark import Newmark

    return Newmark(problem)


def _marched(
    model: ReducedProblem, state: StepState, times: Sequence[float], progress: Callable[[Progress], None] | None
) -> Iterator[tuple[LoadStep, Outcome, State]]:
    """Yield the converged steps of one time scheme, from a state to the last of some times, and the state of each."""
    steps, attempts, ledger = model.problem.case.steps, _Attempts(), Ledger.of(model, state)
    planned = step_end_times(model.problem.case)
    for target in times:
        began = max((t for t in planned if target - t > _SAME * target), default=0.0)
        least = (target - began) / 4.0**steps.max_halvings
        while target - state.time > _SAME * target:
            whole = target - state.time <= state.step_size * (1 + _SAME)
            step = LoadStep(model, target if whole else state.time + state.step_size, state)
            far = turned_too_far(model.problem, None if state.iterate is None else state.time, step.t)
            if far and attempts.halvings < steps.max_halvings:
                attempts.halvings += 1
                state = state.with_step_size((step.t - state.time) / 2)
                continue
            outcome = attempt(step, attempts.halvings, progress)
            missed = far or (_passed(step, outcome) if outcome.converged else None)
            attempts.add(outcome, missed)
            if missed or not outcome.converged:
                state = state.with_step_size((step.t - state.time) / 2)
                ends = attempts.halvings > steps.max_halvings or state.step_size < least
                if ends or (not missed and convex(step, outcome.iterate)):  # a smaller step is as hard
                    message = missed or why(step, outcome)
                    raise NotConvergedError(message, _state(step, outcome, attempts, state, last=False))
                continue
            q, p, active = outcome.iterate
            _check_prescribed_gaps(step, q, outcome.contact)
            _check_prescribed_slips(step, outcome)
            histories = step.commit(q, p, active, outcome.contact)
            fold = folded(model.problem.kinematics, step.u(q), step.t)
            coarse = bool(fold) and _folds_in(step, target - began)
            if attempts.refined < _REFINED and (coarse or model.scheme.too_coarse(model, state, histories.scheme)):
                attempts.refined += 1
                attempts.halvings += 1
                state = state.with_step_size((step.t - state.time) / 2)
                continue
            work = None if ledger is None else ledger.add(step, q, p)
            iterate, came_to_rest = rested(step, outcome)
            state = state.commit(step.t, iterate, state.step_size * steps.growth, histories, work)
            state = replace(state, earlier=None) if came_to_rest else state  # loads have ended: nothing to extrapolate
            last = steps.last - state.time <= _SAME * steps.last
            yield step, outcome, replace(_state(step, outcome, attempts, state, last), folded=fold)
            attempts = _Attempts()


def _folds_in(step: LoadStep, planned: float) -> bool:
    """Return True if cells that end a step folded were not so at its start, and a smaller step is still worth a try.

    `planned`: size of the step that was asked for. A cell that must fold does so in each of the smaller steps.
    """
    problem, state = step.model.problem, step.state
    least = planned / 2 ** min(_REFINED, problem.case.steps.max_halvings)
    return step.t - state.time > least * (1 + _SAME) and not folded(problem.kinematics, step.u_before, state.time)


def _passed(step: LoadStep, outcome: Outcome) -> str | None:
    """Return a sentence about the first contact that passes through its master in a step; None if none does."""
    problem, state = step.model.problem, step.state
    space, q = problem.space, outcome.iterate.q
    if not any(pair.moving for pair in problem.joints):
        return None
    from lacsolver.problem.passing import passing, words

    before = state.iterate
    x = space.places(
        np.zeros_like(step.u0) if before is None else problem.constraints.displacement(before.q, state.time)
    )
    for pair, face in zip(problem.joints, step.interfaces(q), strict=True):
        passed = passing(pair, face, x, step.t, space)
        if passed is not None:
            return words(pair, passed, step.t, space)
    return None


def _warn_of_rounding(step: LoadStep, outcome: Outcome) -> bool:
    """Warn if displacements are hardly larger than the round-off of gaps; return True if it warned.

    Where nothing acts none are expected.
    """
    now, model = outcome.iterate, step.model
    moved = model.problem.space.largest(step.u(now.q))
    if model.linear:
        known = _EPSILON * model.length * any(face.G.any() for face in step.interfaces(now.q))
    else:
        known = ROUNDING * model.length
    if nothing_acts(step) or not (now.p.any() and 0 < moved <= _CLEAR * known):
        return False
    message = f"at time {step.t:.6g} the largest displacement is {moved:.1e}, and round-off of coordinates limits gaps "
    message += f"to {known:.1e} only: pressures may be wrong by {min(known / moved, 1.0):.0%}"
    advice = "increase the loads" + ("" if model.linear else ', or set geometry = "reference"')
    warnings.warn(LacmeshWarning(f"{message}; {advice}"), stacklevel=3)
    return True


def _check_prescribed_gaps(step: LoadStep, q: Floats, contact: ContactSystem) -> None:
    """Raise CaseError if prescribed displacements on both sides fix a gap and violate the contact law."""
    space, pairs = step.model.problem.space, step.model.problem.joints
    gap = np.where(contact.above_threshold & ~contact.enforceable, contact.G / contact.rows.w, 0.0)
    for pair, group, face in zip(pairs, contact.pairs, step.interfaces(q), strict=True):
        own = gap[group.rows]
        wrong_way = (-own if pair.law.compressive else np.abs(own)).reshape(len(face.area), -1).max(axis=1)
        bad = np.flatnonzero(wrong_way > TOUCHING * face.length)
        if len(bad):
            place = ", ".join(space.told(face.centre[wrong_way.argmax()] + space.origin[: space.dim]))
            what = "overlap" if pair.law.compressive else "are apart"
            message = f"{len(bad)} macro-elements {what} by up to {wrong_way.max():.6g} at time {step.t:.6g}"
            message += f", most near ({place}), and all nodes of both surfaces are prescribed there"
            raise wrong(pair.record, f"{message}; leave some of them free, or prescribe values that fit")
    least = _SAME * space.largest(step.u(q))
    for one in contact.equalities:
        if isinstance(one.law, Free):
            continue
        own = np.abs(gap[one.rows])
        if own.max(initial=0.0) > least:
            message = (
                f"it is violated by {own.max():.6g} at time {step.t:.6g}, and all its displacements are prescribed"
            )
            raise wrong(one.equality.record, f"{message}; leave some of its nodes free, or prescribe values that fit")


def _check_prescribed_slips(step: LoadStep, outcome: Outcome) -> None:
    """Raise CaseError if prescribed displacements on both sides fix the slip of macro-elements with friction."""
    contact, p = outcome.contact, outcome.iterate.p
    slip = np.where(contact.above_threshold & ~contact.enforceable, contact.G / contact.rows.w, 0.0)
    least = TOUCHING * step.model.problem.space.largest(step.u(outcome.iterate.q))
    for group in contact.pairs:
        if group.shear is None:
            continue
        slips = (np.abs(group.shear.vectors(slip)) > least).any(axis=1) & (p[group.rows] > 0)
        if slips.any():
            message = f"{int(slips.sum())} macro-elements slip at time {step.t:.6g}, and all nodes of both surfaces "
            message += "are prescribed along them there"
            raise wrong(
                group.pair.record, f"{message}; prescribed slip with friction is not available: leave some of them free"
            )


def step_end_times(case: Case) -> list[float]:
    """Return the times at which steps end: those planned, of fields, locks, late supports, and the start of motion."""
    asked = [*(case.output.times or ()), *([] if case.dynamics is None else [case.dynamics.start])]
    asked += [record.lock for record in case.pretension if record.lock is not None]
    asked += [record.begin for record in case.displacement if record.begin is not None]
    return sorted({*case.steps.planned, *(t for t in asked if 0 < t <= case.steps.last)})


def _state(step: LoadStep, outcome: Outcome, attempts: _Attempts, committed: StepState, last: bool) -> State:
    """Return the state of an outcome, with what the step has committed; `last`: True for the last step of the case."""
    problem, u, held = step.model.problem, step.u(outcome.iterate.q), _held(step, outcome) if last else ()
    q, p, active = outcome.iterate
    contact, gap = outcome.contact, outcome.contact.G / outcome.contact.rows.w
    zones = [
        _zone(group, rows._replace(gap=gap[group.rows]), contact.above_threshold[group.rows], problem.space, u)
        if group.shear is None
        else _zone_with_friction(group, rows._replace(gap=gap[group.rows]), contact, outcome.iterate, problem.space, u)
        for group, rows in contact.states(p, active)
        if isinstance(group, PairGroup)
    ]
    reaction, constraints = step.reaction(q, p), problem.constraints
    rows = {group.equality.name: -p[group.rows] for group in contact.equalities}
    return State(
        step.t, u, reaction, tuple(zones), problem.constraints.rigid_motion(q, step.t),
        attempts.iterations, attempts.halvings, tuple(attempts.residuals), committed, outcome.n_unchanged_sets,
        step.state.histories.materials, held, _prescribed(step),
        constraints.equation_forces(reaction, q, step.t) | rows, constraints.further(q, step.t),
        step.model.factors.note,
    )  # fmt: skip


def _zone(group: PairGroup, rows: RowState, covered: NDArray[np.bool_], space: Space, u: Floats) -> ZoneState:
    """Return the state of a pair's zone under u (n_dof,), for one row along the normal or for all components."""
    pair, face, (centre, normal) = group.pair, group.face, (group.face.centre, group.face.normal)
    if pair.turns:  # B is of undeformed faces
        centre, normal, _ = mean_planes(pair.zone, pair.zone.slave.at(space.places(u)), space.dim)
    force = -(face.B.T @ rows.pressure).reshape(-1, space.dim)
    status = group.law.status(rows)
    if group.law.all_components:
        traction = -rows.pressure.reshape(-1, space.dim)
        on, status = covered.reshape(-1, space.dim).all(axis=1), status.reshape(-1, space.dim).max(axis=1)
        pressure = -(traction * normal).sum(axis=1)
        gap = np.linalg.norm(rows.gap.reshape(-1, space.dim), axis=1)
    else:
        pressure, on = (np.maximum(rows.pressure, 0.0) if group.law.compressive else rows.pressure), covered
        traction, gap = -pressure[:, None] * normal, rows.gap  # round-off makes some slightly negative
        gap = face.gap if pair.moving else gap  # without what slivers may overlap
    return ZoneState(
        pair.name, pair.tie, pressure, traction, np.where(on, gap, np.nan),
        np.where(on, status, UNPAIRED).astype(np.int8), face.coverage, face.area, centre + space.origin[: space.dim],
        normal, force,
        dip=None if pair.tie else dips(face, space.share),
    )  # fmt: skip


def _zone_with_friction(
    group: PairGroup, rows: RowState, contact: ContactSystem, iterate: Iterate, space: Space, u: Floats
) -> ZoneState:
    """Return the state of a zone with friction."""
    face, slid = group.face, contact.slid(group, iterate.p, iterate.active)
    assert face.B_T is not None and face.frame is not None
    zone, w = _zone(group, rows, contact.above_threshold[group.rows], space, u), contact.rows.w[group.rows]
    force = -(face.B_T.T @ slid.t.ravel()).reshape(-1, space.dim)
    friction = ZoneFriction(
        face.frame, slid.t, slid.slip, slid.kept.path,
        np.divide(np.linalg.norm(slid.t, axis=1), slid.bound, out=np.zeros(len(w)), where=slid.bound > 0),
        slid.kept.dissipation / w, (float(slid.energy.sum()), float(slid.kept.dissipation.sum())),
        force[face.zone.slave.faces.distinct_nodes].sum(axis=0),
    )  # fmt: skip
    status = np.where(slid.slides & (zone.status == CONTACT), SLIDES, zone.status).astype(np.int8)
    traction = zone.traction - friction.in_space(slid.t)
    return replace(zone, status=status, traction=traction, force=zone.force + force, friction=friction)


def _prescribed(step: LoadStep) -> float:
    """Return the largest displacement that is prescribed, also by the motion of a coupling."""
    couplings = [rows for rows in step.model.problem.equalities if isinstance(rows, CouplingRows)]
    return max(step.model.problem.space.largest(step.u0), *(rows.carried(step.t) for rows in couplings), 0.0)


def _held(step: LoadStep, outcome: Outcome) -> tuple[Held, ...]:
    """Evaluate the rigid-body motions that only contact constrains, under finite kinematics on the deformed bodies."""
    model, (q, _, active) = step.model, outcome.iterate
    joined = step.closed_rows(q, outcome.contact.may_carry & outcome.contact.of_equality)
    motions = still_free(joined, model.motions) if joined.shape[0] else model.motions
    if not motions or model.scheme.resists_rigid_motion:
        return ()
    space, u = model.problem.space, step.u(q)
    x = None
    if model.problem.kinematics.finite:
        x = space.local.points.copy()
        x[:, : space.dim] += u.reshape(-1, space.dim)
    reached = np.zeros(len(active), bool)
    for group, face in zip(outcome.contact.pairs, step.interfaces(q), strict=True):
        if group.law.compressive:  # without pressure, round-off alone decides which of them are active
            reached[group.rows] = face.touching
    closed = active | (reached & outcome.contact.enforceable)
    return holdings(motions, step.closed_rows(q, closed), u, x=x)
