"""From step to step: equilibrium at each time; a step that finds none is halved, and grows again once it does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshError
from lacsolver.case import Case
from lacsolver.equilibrium import ROUNDING, Iterate, Limits, Outcome, find_equilibrium
from lacsolver.interface import Interface
from lacsolver.model import Model, Moment
from lacsolver.problem import Joint, Problem
from lacsolver.state import CONTACT, OPEN, UNPAIRED, State, ZoneState

#: times that differ by this much of themselves are one
_SAME = 1e-9
#: a gap that is no more than this much of the macro-element's size is none, when the initial status is asked for
_TOUCHING = 1e-6


class NotConverged(LacmeshError):
    """No equilibrium was found at some time. `state`: the last one tried."""

    def __init__(self, message: str, state: State) -> None:
        super().__init__(message)
        self.state = state


class Told(NamedTuple):
    """An iteration: time sought, halvings so far, its number, closed rows, relative defects of balance and gap."""

    time: float
    halvings: int
    number: int
    closed: int
    balance: float
    gap: float


def march(
    problem: Problem, *, start: State | None = None, step: float | None = None, told: Callable[[Told], None] | None = None
) -> Iterator[State]:
    """States that converged, step after step, from the undeformed body or from `start`.

    `step`: the first step's size, if it is not to be the planned one. Raises NotConverged.
    """
    model = Model(problem)
    steps = problem.case.steps
    time = 0.0 if start is None else start.time
    step = np.inf if step is None else step
    now = None if start is None else _iterate_of(model, start)
    before: tuple[float, Iterate] | None = None
    spent, residuals, halvings = 0, (), 0
    for target in meeting_times(problem.case):
        while target - time > _SAME * target:
            size = target - time if target - time < step * (1 + _SAME) else step
            moment = Moment(model, time + size if size < target - time else target)
            guess = _guess(model, moment, now, before, time)
            outcome = _search(moment, guess, halvings, told)
            spent += len(outcome.defects)
            residuals += tuple(balance for balance, _ in outcome.defects)
            if not outcome.converged:
                halvings, step = halvings + 1, size / 2
                if halvings > steps.max_halvings:
                    raise NotConverged(_why(moment, outcome), _state(moment, outcome, spent, halvings, residuals))
                continue
            yield _state(moment, outcome, spent, halvings, residuals)
            step = step * steps.growth
            before = None if now is None else (time, now)
            now, time = outcome.iterate, moment.t
            spent, residuals, halvings = 0, (), 0


def meeting_times(case: Case) -> list[float]:
    """Times that steps end at: those planned, and those at which fields are asked for."""
    asked = [t for t in case.output.times or () if 0 < t <= case.steps.last]
    return sorted({*case.steps.planned, *asked})


def _search(moment: Moment, guess: Iterate, halvings: int, told: Callable[[Told], None] | None) -> Outcome:
    model, solver = moment.model, moment.model.problem.case.solver
    moved = float(np.abs(moment.u0).max(initial=0.0))
    limits = Limits(solver.tolerance, solver.max_iterations, model.length, moved)

    def tell(*iteration: float) -> None:
        if told is not None:
            told(Told(moment.t, halvings, *iteration))  # type: ignore[arg-type]

    return find_equilibrium(model.held, moment.f, moment.contact, guess, limits, moving=model.moving, told=tell)


def _guess(
    model: Model, moment: Moment, now: Iterate | None, before: tuple[float, Iterate] | None, time: float
) -> Iterate:
    """What a step begins with: as things went on so far; at first the undeformed body and the initial status."""
    n = model.held.K.shape[0]
    if now is None:
        contact = moment.contact(np.zeros(n))
        closed = np.concatenate([np.empty(0, bool), *map(_initial, model.problem.joints, moment.interfaces)])
        if len(closed) < len(contact.held):
            raise AssertionError("a status for every row")
        return Iterate(np.zeros(n), np.zeros(len(closed)), closed & contact.paired)
    if before is None:
        return now
    then, last = before
    part = (moment.t - time) / (time - then)
    return Iterate(now.q + part * (now.q - last.q), now.p + part * (now.p - last.p), now.active)


def _initial(joint: Joint, face: Interface) -> NDArray[np.bool_]:
    """(rows,): which rows of a joint are closed at the start."""
    if not joint.one_sided:
        return np.full(face.B.shape[0], True)
    size = face.area ** (1 / face.zone.slave.dim)
    return {"all": np.isfinite(face.gap), "none": np.zeros(len(face.gap), bool), "gap": face.gap <= _TOUCHING * size}[
        joint.record.initial
    ]


def _iterate_of(model: Model, state: State) -> Iterate:
    """The iterate that a state was."""
    from lacsolver.model import _least_squares

    u0 = model.problem.constraints.u0(state.time)
    q = _least_squares(model.problem.constraints.T, (state.u - u0)[:, None])[:, 0]
    p = [np.empty(0), *(_multipliers(zone) for zone in state.zones)]
    closed = [np.empty(0, bool), *((np.repeat(z.status == CONTACT, z.traction.shape[1] if z.tie else 1)) for z in state.zones)]
    return Iterate(q, np.concatenate(p), np.concatenate(closed))


def _multipliers(zone: ZoneState) -> NDArray[np.floating]:
    return -zone.traction.ravel() if zone.tie else zone.pressure


def _state(moment: Moment, outcome: Outcome, spent: int, halvings: int, residuals: tuple[float, ...]) -> State:
    """The state of an outcome."""
    model, problem = moment.model, moment.model.problem
    q, p = outcome.iterate.q, outcome.iterate.p
    u = moment.u(q)
    zones, first, force = [], 0, np.zeros(problem.space.n_dof)
    gap = outcome.contact.G / outcome.contact.rows.w
    for joint, face in zip(problem.joints, moment.interfaces, strict=True):
        rows = slice(first, first + face.B.shape[0])
        own = -(face.B.T @ p[rows])
        force += own
        zones.append(_zone(joint, face, p[rows], gap[rows], outcome.contact.paired[rows], own.reshape(-1, problem.space.dim)))
        first = rows.stop
    reaction = model.K @ u - moment.load - force
    rigid = problem.constraints.rigid_motion(q, moment.t)
    return State(moment.t, u, reaction, tuple(zones), rigid, spent, halvings, residuals)


def _zone(joint: Joint, face: Interface, p: NDArray, gap: NDArray, paired: NDArray, force: NDArray) -> ZoneState:
    d = face.normal.shape[1]
    if joint.tie:
        traction = -p.reshape(-1, d)
        pressure = -(traction * face.normal).sum(axis=1)
        on = paired.reshape(-1, d).all(axis=1)
        distance = np.linalg.norm(gap.reshape(-1, d), axis=1)
        status = np.where(on, CONTACT, UNPAIRED)
    else:
        traction, pressure, on, distance = -p[:, None] * face.normal, p, paired, gap
        closed = (p > 0) if joint.one_sided else on
        status = np.where(on, np.where(closed, CONTACT, OPEN), UNPAIRED)
    return ZoneState(
        joint.name, joint.tie, pressure, traction, np.where(on, distance, np.nan), status.astype(np.int8), face.coverage,
        face.area, face.centre, face.normal, force,
    )  # fmt: skip


def _why(moment: Moment, outcome: Outcome) -> str:
    """What a user is told of a search that failed: where the largest residual is, and what to try."""
    problem = moment.model.problem
    balance, gap = outcome.defects[-1]
    q, p = outcome.iterate.q, outcome.iterate.p
    r = problem.constraints.T @ (moment.f - moment.model.held.K @ q - outcome.contact.rows.B_T @ p)
    node = int(np.abs(r).argmax()) // problem.space.dim
    place = ", ".join(f"{c:.6g}" for c in problem.space.mesh.points[node])
    said = f"no equilibrium found at time {moment.t:.6g} after {len(outcome.defects)} iterations: "
    said += f"the balance of forces is off by {balance:.1e}, most at node {problem.space.mesh.node_number[node]} ({place}), "
    return said + f"gaps by {gap:.1e}; try more steps ([steps] count), or more iterations ([solver] max_iterations)"
