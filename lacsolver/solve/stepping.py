"""Stepping in time: equilibrium at each step; a step that does not converge is halved, and grows again afterwards."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshError, LacmeshWarning
from lacmesh.mesh import Floats
from lacsolver.bodies.finite import InadmissibleError
from lacsolver.case import Case
from lacsolver.contact import Interface
from lacsolver.problem.overlap import check_overlap
from lacsolver.problem.problem import ContactPair, Problem
from lacsolver.problem.rigid_modes import describe
from lacsolver.results.results import Restart
from lacsolver.results.state import CONTACT, OPEN, UNPAIRED, Held, Iterate, State, ZoneState
from lacsolver.solve.equilibrium import ROUNDING, ContactSystem, Limits, Outcome, find_equilibrium
from lacsolver.solve.holding import holdings
from lacsolver.solve.model import Instant, ReducedProblem
from lacsolver.solve.newton import Place, follow
from lacsolver.space.places import wrong

#: relative difference below which two times are the same
_SAME = 1e-9
#: gap, relative to the macro-element's size, below which a row is closed in the initial status
_TOUCHING = 1e-6
#: damping of the second search for an equilibrium at its start, relative to the undeformed bodies' stiffness
_DRAG = 1.0
#: displacements below this multiple of the round-off of gaps are too small for reliable pressures
_CLEAR = 100
_EPSILON = float(np.finfo(float).eps)
#: load along a rigid-body mode that contact does not balance, relative to all forces along it
_UNCARRIED = 1e-6


class NotConvergedError(LacmeshError):
    """No equilibrium was found at some time. `state`: the last state tried.

    >>> from dataclasses import replace
    >>> from lacsolver import Problem, read_case
    >>> case = read_case("data/two_blocks.toml")
    >>> case = replace(case, solver=replace(case.solver, max_iterations=1))
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


class Told(NamedTuple):
    """An iteration: target time, halvings so far, its number, closed rows, relative residuals of balance and gap."""

    time: float
    halvings: int
    number: int
    closed: int
    balance: float
    gap: float


@dataclass
class _Step:
    """Iterations, halvings and residuals of a step so far."""

    iterations: int = 0
    halvings: int = 0
    residuals: list[float] = field(default_factory=list)

    def add(self, outcome: Outcome) -> None:
        self.iterations += len(outcome.defects)
        self.residuals += [balance for balance, _ in outcome.defects]
        self.halvings += not outcome.converged


def march(
    problem: Problem, *, start: Restart | None = None, told: Callable[[Told], None] | None = None
) -> Iterator[State]:
    """Yield the converged states, step by step, from the undeformed bodies or a restart.

    Raises NotConvergedError if a step was halved too often, DataError if a rigid-body motion is not constrained,
    CaseError if prescribed displacements alone make skins overlap, or hold a tie apart.

    >>> from lacsolver import read_case
    >>> for state in march(Problem.of(read_case("data/two_blocks.toml"))):
    ...     print(state.time, (state.zones[0].pressure > 0).all())
    0.5 True
    1.0 True
    """
    model = ReducedProblem(problem)
    steps = problem.case.steps
    time, size = (start.time, start.step_size) if start else (0.0, np.inf)
    path = _Path(time, start.iterate, start.earlier) if start else _Path()
    spent, warned = _Step(), False
    for target in meeting_times(problem.case):
        while target - time > _SAME * target:
            whole = target - time <= size * (1 + _SAME)
            instant = Instant(model, target if whole else time + size)
            outcome = _search(instant, path, spent, told)
            spent.add(outcome)
            if not outcome.converged:
                size = (instant.t - time) / 2
                if spent.halvings > steps.max_halvings:
                    raise NotConvergedError(_why(instant, outcome), _state(instant, outcome, spent, size))
                continue
            _check_stuck(instant, outcome.iterate.q, outcome.contact)
            warned = warned or _warn_of_rounding(instant, outcome.iterate)
            size *= steps.growth
            path, time = path.then(instant.t, outcome.iterate), instant.t
            last = steps.last - time <= _SAME * steps.last
            yield _state(instant, outcome, spent, size, path.earlier, _held(instant, outcome) if last else ())
            spent = _Step()


@dataclass(frozen=True)
class _Path:
    """The last converged iterate with its time, and the one before in `earlier`; None for the undeformed bodies."""

    time: float = 0.0
    iterate: Iterate | None = None
    earlier: tuple[float, Iterate] | None = None

    def then(self, time: float, iterate: Iterate) -> _Path:
        """Return the path after one more step."""
        return _Path(time, iterate, None if self.iterate is None else (self.time, self.iterate))

    def guess(self, t: float) -> Iterate | None:
        """Return the linear extrapolation of the last two iterates to time t; None if there are fewer."""
        if self.iterate is None or self.earlier is None:
            return None
        now, (then, last) = self.iterate, self.earlier
        part = (t - self.time) / (self.time - then)
        return Iterate(now.q + part * (now.q - last.q), now.p + part * (now.p - last.p), now.active)


def _warn_of_rounding(instant: Instant, now: Iterate) -> bool:
    """Warn if displacements are hardly larger than the round-off of gaps; return True if it warned."""
    model = instant.model
    moved = float(np.abs(instant.u(now.q)).max(initial=0.0))
    if model.linear:
        known = _EPSILON * model.length * any(face.G.any() for face in instant.interfaces(now.q))
    else:
        known = ROUNDING * model.length
    if not now.p.any() or moved > _CLEAR * known:
        return False
    message = f"at time {instant.t:.6g} nothing moves by more than {moved:.1e}, and coordinates of this size give gaps "
    message += f"to {known:.1e} only: pressures may be wrong by {min(known / moved, 1.0):.0%}"
    advice = "load the bodies more" + ("" if model.linear else ', or ask for geometry = "reference"')
    warnings.warn(LacmeshWarning(f"{message}; {advice}"), stacklevel=3)
    return True


def _check_stuck(instant: Instant, q: Floats, contact: ContactSystem) -> None:
    """Raise CaseError if prescribed displacements on both sides fix a gap and violate the contact or tie condition."""
    space, gap, first = instant.model.problem.space, contact.G / contact.rows.w, 0
    wrong_way = np.where(contact.held, np.abs(gap), -gap) * (contact.covered & ~contact.paired)
    for joint, face in zip(instant.model.problem.joints, instant.interfaces(q), strict=True):
        by = wrong_way[first : first + face.B.shape[0]].reshape(len(face.area), -1).max(axis=1)
        first += face.B.shape[0]
        bad = np.flatnonzero(by > _TOUCHING * face.length)
        if len(bad):
            place = ", ".join(space.told(face.centre[by.argmax()] + space.origin[: space.dim]))
            what = "overlap" if joint.one_sided else "are apart"
            message = f"{len(bad)} macro-elements {what} by up to {by.max():.6g} at time {instant.t:.6g}"
            message += f", most near ({place}), and all nodes of both skins are prescribed there"
            raise wrong(joint.record, f"{message}; leave some of them free, or prescribe what fits")


def meeting_times(case: Case) -> list[float]:
    """Return the times at which steps must end: the planned ones, and those of fields in [output]."""
    asked = [t for t in case.output.times or () if 0 < t <= case.steps.last]
    return sorted({*case.steps.planned, *asked})


def _search(instant: Instant, path: _Path, spent: _Step, told: Callable[[Told], None] | None) -> Outcome:
    """Search the equilibrium at one time; under finite kinematics a second, damped search follows a failed first one.

    The iterations of both searches are counted.
    """
    model, solver = instant.model, instant.model.problem.case.solver
    moved = float(np.abs(instant.u0).max(initial=0.0))
    limits = Limits(solver.tolerance, solver.max_iterations, 0.0 if model.linear else model.length, moved)

    def tell(number: int, closed: int, balance: float, gap: float) -> None:
        if told is not None:
            told(Told(instant.t, spent.halvings, number, closed, balance, gap))

    now, guess = path.iterate or _first(instant), path.guess(instant.t)
    if model.linear:
        turning, start = None if model.steady is None else -model.steady, guess or now
        return find_equilibrium(
            model.held, instant.f, instant.contact, start, limits, free=model.free, turning=turning, told=tell
        )
    constant, outcome = model.problem.kinematics.constant, None
    if guess is not None:
        with suppress(InadmissibleError):
            outcome = follow(instant.place, guess, limits, exact=constant, told=tell)
    if outcome is not None and (outcome.converged or constant):
        return outcome
    first = _foreseen(instant, now, path.time)
    if outcome is None:
        outcome = follow(instant.place, now, limits, first=first, exact=constant, told=tell)
    if outcome.converged or constant:
        return outcome
    again = follow(instant.place, now, limits, first=first, drag=_DRAG, told=tell)
    return again._replace(defects=outcome.defects + again.defects, products=outcome.products + again.products)


def _foreseen(instant: Instant, now: Iterate, time: float) -> Place:
    """Return the predictor: the linearisation at the new time, from the last iterate or the undeformed bodies."""
    u = Instant(instant.model, time).u(now.q) if time else np.zeros_like(instant.u0)
    return instant.foreseen(now.q, u, now.p)


def _first(instant: Instant) -> Iterate:
    """Return the initial iterate at q = 0. Raises errors for overlap, zones without a master, unsupported bodies."""
    problem, q = instant.model.problem, np.zeros(instant.model.problem.constraints.n_q)
    contact, interfaces = instant.contact(q), instant.interfaces(q)
    for joint, face in zip(problem.joints, interfaces, strict=True):
        check_overlap(joint, face, problem.space)
        joint.check_facing(face)
    instant.model.check_held(interfaces, contact.paired)
    closed = [np.empty(0, bool), *map(_initial, problem.joints, interfaces)]
    return Iterate(q, np.zeros(len(contact.G)), np.concatenate(closed) & contact.paired)


def _initial(joint: ContactPair, face: Interface) -> NDArray[np.bool_]:
    """Return a mask (rows,), True for rows of a pair that are closed at the start."""
    if joint.initial == "gap":
        return _touching(face)
    return np.full(face.B.shape[0], joint.initial == "all")


def _touching(face: Interface) -> NDArray[np.bool_]:
    """Return a mask (rows,), True for rows of a pair without a gap, up to round-off."""
    return np.asarray(face.gap <= _TOUCHING * face.length)


def _state(
    instant: Instant,
    outcome: Outcome,
    spent: _Step,
    size: float,
    earlier: tuple[float, Iterate] | None = None,
    held: tuple[Held, ...] = (),
) -> State:
    """Return the state of an outcome, with the data of the one before that a restart needs."""
    problem = instant.model.problem
    q, p, contact = outcome.iterate.q, outcome.iterate.p, outcome.contact
    gap = contact.G / contact.rows.w
    zones, first = [], 0
    for joint, face in zip(problem.joints, instant.interfaces(q), strict=True):
        rows = slice(first, first + face.B.shape[0])
        own = -(face.B.T @ p[rows])
        make = _tied if joint.tie else _pressed
        made = make(joint, face, p[rows], gap[rows], contact.covered[rows], own.reshape(-1, problem.space.dim))
        zones.append(replace(made, centre=made.centre + problem.space.origin[: problem.space.dim]))
        first = rows.stop
    return State(
        instant.t, instant.u(q), instant.reaction(q, p), tuple(zones), problem.constraints.rigid_motion(q, instant.t),
        spent.iterations, spent.halvings, tuple(spent.residuals), size, outcome.iterate, earlier, outcome.settled,
        held, float(np.abs(instant.u0).max(initial=0.0)),
    )  # fmt: skip


def _held(instant: Instant, outcome: Outcome) -> tuple[Held, ...]:
    """Evaluate the rigid-body motions that only contact constrains, under finite kinematics on the deformed bodies."""
    model, (q, _, active) = instant.model, outcome.iterate
    if not model.motions:
        return ()
    space, u = model.problem.space, instant.u(q)
    x = None
    if not model.problem.kinematics.constant:
        x = space.local.points.copy()
        x[:, : space.dim] += u.reshape(-1, space.dim)
    touching = [  # without pressure, round-off alone decides which of them are active
        _touching(face) if joint.one_sided else np.zeros(face.B.shape[0], bool)
        for joint, face in zip(model.problem.joints, instant.interfaces(q), strict=True)
    ]
    closed = active | (np.concatenate(touching) & outcome.contact.paired)
    return holdings(model.motions, instant.closed_rows(q, closed), u, x=x)


def _pressed(
    joint: ContactPair, face: Interface, p: NDArray, gap: NDArray, paired: NDArray[np.bool_], force: NDArray
) -> ZoneState:
    p = np.maximum(p, 0.0) if joint.one_sided else p  # round-off makes some slightly negative
    closed = (p > 0) | (not joint.one_sided)
    status = np.where(paired, np.where(closed, CONTACT, OPEN), UNPAIRED).astype(np.int8)
    return ZoneState(
        joint.name, False, p, -p[:, None] * face.normal, np.where(paired, gap, np.nan), status, face.coverage,
        face.area, face.centre, face.normal, force,
    )  # fmt: skip


def _tied(
    joint: ContactPair, face: Interface, p: NDArray, gap: NDArray, paired: NDArray[np.bool_], force: NDArray
) -> ZoneState:
    d = face.normal.shape[1]
    traction, on = -p.reshape(-1, d), paired.reshape(-1, d).all(axis=1)
    status = np.where(on, CONTACT, UNPAIRED).astype(np.int8)
    jump = np.where(on, np.linalg.norm(gap.reshape(-1, d), axis=1), np.nan)
    return ZoneState(
        joint.name, True, -(traction * face.normal).sum(axis=1), traction, jump, status, face.coverage, face.area,
        face.centre, face.normal, force,
    )  # fmt: skip


def _why(instant: Instant, outcome: Outcome) -> str:
    """Return the message for a failed search: a body that moves away, or the largest imbalance, and what to try."""
    model, problem = instant.model, instant.model.problem
    q, p, rows = outcome.iterate.q, outcome.iterate.p, outcome.contact.rows
    contact, closed = rows.B_T @ p, rows.B[np.flatnonzero(outcome.iterate.active)]
    said = f"no equilibrium found at time {instant.t:.6g} after {len(outcome.defects)} iterations"
    off = instant.reaction(q, p)
    pushed = problem.constraints.T.T @ off - problem.constraints.force(instant.t)
    for motion in model.motions:
        along = model.unknowns(motion.field)
        left, whole = along @ pushed, np.abs(along) @ (np.abs(pushed + contact) + np.abs(contact))
        if abs(left) > _UNCARRIED * whole and not np.abs(closed @ along).any():
            return f"{said}: {describe(motion)}, and no contact stops it; hold it, or load it toward its master"
    r = problem.constraints.T @ pushed
    node = int(np.abs(r).argmax()) // problem.space.dim
    place = ", ".join(problem.space.told(problem.space.mesh.points[node]))
    balance, gap = outcome.defects[-1]
    number = problem.space.mesh.node_number[node]
    said += f": forces are off by {balance:.1e} of the largest, most at node {number} ({place}), "
    said += f"gaps by {gap:.1e} of the largest displacement, where {problem.case.solver.tolerance:.1e} is asked"
    return f"{said}; try more steps ([steps] count) or more iterations ([solver] max_iterations)"
