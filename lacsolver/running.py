"""A run: solution of a case from its first step to its last, with its output."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from lacmesh import __version__
from lacmesh.errors import LacmeshWarning, RequestError
from lacmesh.formats.output import signals_wait
from lacmesh.mesh import Floats, Mesh, MeshLike, as_mesh
from lacmesh.threads import peak_memory
from lacsolver.case import Case, as_case, fingerprint
from lacsolver.contact import Interface
from lacsolver.distributed.share import UNDIVIDED, Distribution
from lacsolver.equilibrium.attempt import Progress
from lacsolver.equilibrium.holding import beyond_a_cell, warnings_of
from lacsolver.equilibrium.motion import ENERGIES, doubtful_energy
from lacsolver.equilibrium.state import CONTACT, State
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import OutputFolder, Writer, check_same, create_output
from lacsolver.output.ring import described
from lacsolver.output.states import scatter_state
from lacsolver.problem.first_look import doubts
from lacsolver.problem.opening import inexact_friction, opening_angles
from lacsolver.problem.overlap import scarcely_covered, start_of
from lacsolver.problem.problem import Problem, read_mesh
from lacsolver.problem.resultants import Resultant, resultants
from lacsolver.results.alternation import alternating
from lacsolver.results.compression import most_compressed, softened, worse
from lacsolver.results.dipping import dipped
from lacsolver.results.faceted import faceted
from lacsolver.results.fields import point_stress, state_fields
from lacsolver.results.figures import step_figures, stress_ranges
from lacsolver.results.new_contact import closed_at_start, sliding_since_contact, turned_far
from lacsolver.results.results import Restart, Results, StepFigures
from lacsolver.results.whole import orders_of

#: part of the dissipation that the balance of work may leave over; part of the work below which it is not looked at
_LEFT, _FELT = 0.05, 1e-4


def run(
    case: Case | str | Path,
    folder: OutputFolder | str | Path,
    *,
    mesh: MeshLike | None = None,
    start: Restart | None = None,
    force: bool = False,
    progress: Callable[[Progress], None] | None = None,
    stepped: Callable[[StepFigures], None] | None = None,
    distribution: Distribution = UNDIVIDED,
) -> Results:
    """Solve a case and write its results into a folder; `start`: a state to restart from.

    `case`: a case, or the path of a case file. `folder`: its path, which must not hold results yet unless `force`, or
    what `lacsolver.output.create_output` made of it. `mesh`: a mesh or its path; None for that of the case. `progress`
    is called for every iteration, `stepped` for every converged step. `distribution`: the processes that share the
    model, each of which calls this function. Raises NotConvergedError after the last state tried is written, the
    errors of `Problem.of` and `Writer`, and DataError for a state of another case or mesh.
    An interrupted run leaves the steps that have converged. Raises RequestError for a case of the engine petsc
    without a distribution, such as `lacsolver.distributed.processes.Processes` of MPI's communicator.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     results = run("data/two_blocks.toml", f"{folder}/results")
    >>> results.status, [step.time for step in results.steps]
    ('done', [0.5, 1.0])
    """
    case = as_case(case)
    if distribution is UNDIVIDED and case.solver.engine_for(1) != "serial":
        message = "the case names the engine petsc or a backend of it, which needs the processes of MPI"
        raise RequestError(f"{message}; give distribution=Processes(comm), or call the command lacsolver run")
    clock = Clock()
    with clock.phase("mesh"):
        mesh = read_mesh(case, distribution) if mesh is None else as_mesh(mesh)
        folder = folder if isinstance(folder, OutputFolder) else create_output(folder, force=force, restart=start)
        problem = Problem.of(case, mesh, distribution)
        output = RunOutput(problem, folder, fingerprint(problem.case, *distribution.as_read(mesh)), clock)
        start = None if start is None else output.continued(start, mesh)
    with output, clock.phase("solve"):
        for state in march(problem, start=start.step if start else None, progress=progress):
            with clock.phase("results"), signals_wait():  # a step is in all files or in none
                output.add(state)
                if stepped is not None:
                    stepped(output.results.steps[-1])
    return output.results


class Clock:
    """Seconds of each phase; a phase inside another is not counted in the outer one."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._open: list[str] = []
        self._since = 0.0

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the time spent in this context to a phase."""
        self._spend()
        self._open.append(name)
        try:
            yield
        finally:
            self._spend()
            self._open.pop()

    def _spend(self) -> None:
        now = time.perf_counter()
        if self._open:
            self.seconds[self._open[-1]] = self.seconds.get(self._open[-1], 0.0) + now - self._since
        self._since = now


class RunOutput:
    """Output of a run: its `results` so far, which are written into a folder after every step and at the end.

    A context that completes the results: with the warnings about a finished run, or the error that ended it. Nothing is
    written before the first step has converged, or has failed to, so that earlier results are not lost before.
    """

    def __init__(self, problem: Problem, folder: OutputFolder, prints: dict[str, str], clock: Clock) -> None:
        """`prints`: the fingerprint of the case and its mesh."""
        points = 0 if problem.inertia is None else problem.inertia.M.shape[0] - problem.space.n_dof
        self._problem, self._folder, self._prints, self._clock = problem, folder, prints, clock
        self._orders = orders_of(problem.constraints, points)
        faces, self._number = _undeformed(problem), 0
        self._starts = {pair.name: start_of(pair, faces[pair.name], problem.space) for pair in problem.joints}
        self._angles = [opening_angles(pair, faces[pair.name], problem.space.share) for pair in problem.joints]
        self._writer: Writer | None = None
        self._last: State | None = None
        self._compressed: Floats | None = None
        #: the first warning of each kind: `solver` and `folded`, of which `march` has warned, and those of `_look_at`
        self._first: dict[str, str] = {}
        #: largest covered fraction of each zone so far, 1 once it has been in contact
        self._covered: dict[str, float] = {}
        #: macro-elements of each zone in contact, and motions of rigid bodies, at the end of the last step
        self._touched = closed_at_start(problem, faces)
        self._rigid: Mapping[str, Floats] = {}
        self.results = Results(
            __version__,
            sizes=_sizes(problem),
            roles={pair.name: (pair.record.slave, pair.record.master, pair.record.why) for pair in problem.joints},
            overlap={name: one.overlap for name, one in self._starts.items()},
            bridged={name: one.bridged for name, one in self._starts.items() if one.bridged > 0},
            units=problem.case.output.units or "",
            adjusted=problem.adjusted,
            sectors=described(problem.case),
        )

    def continued(self, start: Restart, mesh: Mesh) -> Restart:
        """Return the share of this process in a state to restart from, after whose step the output goes on.

        Raises DataError for a state of another case or mesh.
        """
        problem, self._number = self._problem, start.number
        self._touched = {name: status >= CONTACT for name, status in start.status.items()}
        self._rigid = start.rigid
        problem.space.share.on_first(lambda: check_same(start, problem.case, mesh, self._prints))
        return scatter_state(start, problem.space.share, self._orders) if self._orders else start

    def add(self, state: State) -> None:
        """Add a converged step to the results, and write it."""
        problem = self._problem
        writer = self._writer = self._writer or self._open()
        self._number, self._last = self._number + 1, state
        self._look_at(state)
        stress = point_stress(problem, state)
        steps = (*self.results.steps, step_figures(problem, state, stress))
        self.results = replace(self.results, steps=steps, stress=stress_ranges(problem.space, stress), **self._spent())
        size = state.step.step_size if np.isfinite(state.step.step_size) else problem.case.steps.last
        writer.step(self.results, lambda: state_fields(problem, state, stress), Restart.of(state, size, self._number))

    def _look_at(self, state: State) -> None:
        """Keep what warnings at the end of the run need of a converged step."""
        problem = self._problem
        for zone in state.zones:  # a ball that touches a plane has most of its skin away from it, as it should
            touches = (zone.status >= CONTACT).any()
            covered = 1.0 if touches else float((zone.area * zone.coverage).sum() / zone.area.sum())
            self._covered[zone.name] = max(self._covered.get(zone.name, 0.0), covered)
        looks: dict[str, Callable[[], str]] = {
            "solver": lambda: state.linear_solver,
            "folded": lambda: state.folded,
            "way": lambda: next(sliding_since_contact(state, self._touched), ""),
            "turned": lambda: next(turned_far(problem, state, self._rigid), ""),
            "dipped": lambda: next(dipped(problem, state), ""),
        }
        for kind, look in looks.items():
            self._first[kind] = self._first.get(kind) or look()
        self._touched = {zone.name: zone.status >= CONTACT for zone in state.zones}
        self._rigid = state.rigid
        now = most_compressed(problem, state)
        self._compressed = now if self._compressed is None else worse(self._compressed, now)

    def _warnings(self, *kinds: str) -> list[str]:
        """Return the first warning of each kind, where there is one."""
        return [self._first[kind] for kind in kinds if self._first.get(kind)]

    def __enter__(self) -> RunOutput:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if error is None:
            self._finish()
        else:
            self._end(error)

    def _finish(self) -> None:
        """Complete the results of a finished run, warn of what is doubtful in them, and write them."""
        problem, last = self._problem, self._last
        messages = problem.space.share.texts([*self._doubts()])
        modes: tuple[str, ...] = ()
        loads: tuple[Resultant, ...] = ()
        if last is not None:
            modes = tuple(motion.words for motion in last.held if np.isnan(motion.part))
            loads = resultants(problem.loads, last.time, last.u)
        message = "\n".join([*self._warnings("solver", "folded"), *messages])  # the first are known already
        self.results = replace(self.results, status="done", held=modes, message=message, loads=loads, **self._spent())
        for message in messages:
            warnings.warn(LacmeshWarning(message), stacklevel=4)
        writer = self._writer or self._open()
        writer.finish(self.results)

    def _end(self, error: BaseException) -> None:
        """Write the results of a run ended by an error or a signal, with the last state tried if none converged."""
        status = "failed" if isinstance(error, Exception) else "interrupted"
        self.results = replace(self.results, status=status, message=str(error), **self._spent())
        if isinstance(error, NotConvergedError):
            tried = error.state
            writer = self._writer or self._open()
            writer.finish(self.results, lambda: state_fields(self._problem, tried))
            for message in (*self._softened(), *self._warnings("dipped")):
                warnings.warn(LacmeshWarning(message), stacklevel=4)
        elif self._writer is not None:
            self._writer.finish(self.results)

    def _spent(self) -> dict[str, Any]:
        """Return the timings and the peak memory of now, as keywords of `Results`."""
        return {"timings": dict(self._clock.seconds), "memory": peak_memory()}

    def _open(self) -> Writer:
        problem = self._problem
        return Writer(self._folder, problem.case, problem.space, self._prints, self._orders)

    def _doubts(self) -> Iterator[str]:
        """Yield warnings about doubtful results of a finished run."""
        problem, last = self._problem, self._last
        yield from _never_facing(problem, self.results)
        for start in self._starts.values():
            yield from start.told
        for pair in problem.joints:
            if pair.moving:
                yield from scarcely_covered(pair, self._covered.get(pair.name, 0.0))
        yield from doubts(problem)
        yield from _doubtful_energy(problem.case, self.results)
        yield from _doubtful_dissipation(self.results)
        yield from self._softened()
        yield from self._warnings("way", "turned", "dipped")
        if last is not None:
            yield from warnings_of(last.held, last.prescribed)
            yield from faceted(problem, last)
            yield from alternating(problem, last)
            yield from self._inexact(last)
            if not problem.kinematics.finite:
                yield from filter(None, [beyond_a_cell(problem.space, last.u)])

    def _inexact(self, last: State) -> Iterator[str]:
        """Yield a warning for each zone whose friction is inexact at the end, as its gap closed at an angle."""
        for pair, angles, zone in zip(self._problem.joints, self._angles, last.zones, strict=True):
            bounds = pair.bounds(self._problem.space, last.time)
            if angles is not None and bounds is not None:
                yield from filter(None, [inexact_friction(pair.name, angles, bounds, zone.pressure)])

    def _softened(self) -> tuple[str, ...]:
        """Return warnings about bodies that a step so far has crushed, of all processes."""
        return () if self._compressed is None else tuple(softened(self._problem, self._compressed))


def _undeformed(problem: Problem) -> dict[str, Interface]:
    """Return the interfaces of a problem in the undeformed configuration, at the end of the first step."""
    space, t = problem.space, problem.case.steps.planned[0]
    u = np.zeros(space.n_dof)
    return {pair.name: pair.integrate(space, u, t) for pair in problem.joints}


def _never_facing(problem: Problem, results: Results) -> Iterator[str]:
    """Yield a warning for each zone whose slave had no master in front of it at any step."""
    for pair in problem.joints:
        zones = [step.contact[pair.name] for step in results.steps]
        if zones and not any(zone.active + zone.open for zone in zones):
            message = f"slave {pair.record.slave!r} never had master {pair.record.master!r} in front of it"
            yield f"{message}; check which groups these are and that their faces turn outward, or raise search_distance"


def _doubtful_energy(case: Case, results: Results) -> Iterator[str]:
    """Yield a warning if the steps in motion have made energy, or have lost too much of it in contact."""
    steps = [(step.time, step.motion.energies) for step in results.steps if step.motion is not None]
    table = np.array([[energies[name] for name in ENERGIES] for _, energies in steps]).reshape(-1, len(ENERGIES))
    known = np.isfinite(table).all(axis=1)  # static steps before have none
    conservative = all(pair.type in ("unilateral", "bilateral") for pair in case.contact)
    times = [time for (time, _), on in zip(steps, known, strict=True) if on]
    message = doubtful_energy(times, table[known], conservative)
    if message is not None and case.dynamics is not None:
        skins = case.dynamics.massless == "skins"
        yield f"{message}; " + ("take smaller steps" if skins else 'take massless = "skins", or smaller steps')


def _doubtful_dissipation(results: Results) -> Iterator[str]:
    """Yield a warning if static steps are too long for the energy that friction takes, as the ledger of work shows.

    What the plastic flow has taken is no error. Friction that takes little of the work is not looked at.
    """
    last = results.steps[-1] if results.steps else None
    if last is None or last.work is None:
        return
    flow = 0.0 if last.plastic is None else last.plastic.dissipation[1]
    taken, left = last.work.dissipation + flow, last.work.left - flow
    felt = last.work.dissipation > _FELT * max(abs(last.work.external), last.work.strain)
    if felt and abs(left) > _LEFT * taken:
        by = "friction and plastic flow" if flow else "friction"
        message = f"steps are too long for the energy that {by} takes: it is {taken:.4g} at time {last.time:.6g}, and "
        yield f"{message}the work balance is off by {left:.4g} ({abs(left) / taken:.0%}); use more steps"


def _sizes(problem: Problem) -> dict[str, int]:
    space, own = problem.space, problem.constraints.own

    def total(n: int) -> int:
        return int(space.share.total(np.array(n)))

    return {
        "nodes": total(len(space.own(np.empty(space.mesh.n_nodes)))),
        "cells": total(sum(int(space.own_cells(block).sum()) for block in space.blocks)),
        "unknowns": total(problem.constraints.n_q if own is None else int(own.sum())),
        "macro_elements": sum(pair.zone.n_macros for pair in problem.joints),
    }
