"""A run: solution of a case from its first step to its last, with its output."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lacmesh import __version__
from lacmesh.cli.terminal import peak_memory
from lacmesh.errors import LacmeshWarning, RequestError
from lacmesh.formats.output import signals_wait
from lacmesh.mesh import Floats, MeshLike, as_mesh
from lacsolver.case import Case, as_case, fingerprint
from lacsolver.distributed.share import UNDIVIDED, Distribution
from lacsolver.equilibrium.attempt import Progress
from lacsolver.equilibrium.holding import beyond_a_cell, warnings_of
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import OutputFolder, Writer, check_same, create
from lacsolver.output.states import deal_state
from lacsolver.problem.first_look import doubts
from lacsolver.problem.overlap import Start, scarcely_covered, start_of
from lacsolver.problem.problem import Problem, read_mesh
from lacsolver.problem.resultants import Resultant, resultants
from lacsolver.results.alternation import alternating
from lacsolver.results.answer import Answer
from lacsolver.results.compression import most_compressed, softened, worse
from lacsolver.results.faceted import faceted
from lacsolver.results.motion import ENERGIES, doubtful_energy
from lacsolver.results.results import Fields, Restart, Results, StepFigures
from lacsolver.results.state import CONTACT, State
from lacsolver.results.whole import orders_of


def run(
    case: Case | str | Path,
    folder: OutputFolder | str | Path,
    *,
    mesh: MeshLike | None = None,
    start: Restart | None = None,
    progress: Callable[[Progress], None] | None = None,
    stepped: Callable[[StepFigures], None] | None = None,
    distribution: Distribution = UNDIVIDED,
) -> Results:
    """Solve a case and write its results into a folder; `start`: a state to restart from.

    `case`: a case, or the path of a case file. `folder`: its path, which must not hold results yet, or what
    `lacsolver.output.create` made of it. `mesh`: a mesh or its path; None for that of the case. `progress` is called
    for every iteration, `stepped` for every converged step. `distribution`: the processes that share the model, each of
    which calls this function. Raises NotConvergedError after the last state tried is written, the errors of
    `Problem.of` and `Writer`, and DataError for a state of another case or mesh.
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
        folder = folder if isinstance(folder, OutputFolder) else create(folder, restart=start)
        problem = Problem.of(case, mesh, distribution)
        case = problem.case
        prints = fingerprint(case, *distribution.as_read(mesh))
        points = 0 if problem.inertia is None else problem.inertia.M.shape[0] - problem.space.n_dof
        orders = orders_of(problem.constraints, points)
        if start is not None:
            again, there = start, mesh
            problem.space.share.on_first(lambda: check_same(again, case, there, prints))
            start = deal_state(start, problem.space.share, orders) if orders else start
        starts = _starts(problem)
    roles = {pair.name: (pair.record.slave, pair.record.master, pair.record.why) for pair in problem.joints}
    overlap = {name: one.overlap for name, one in starts.items()}
    first = Results(__version__, sizes=_sizes(problem), roles=roles, overlap=overlap)
    made = _Run(Answer(problem), clock, first, start.number if start else 0, starts=starts)
    writer: Writer | None = None  # made once there is something to write, so that no earlier results are lost before
    try:
        with clock.phase("solve"):
            for state in march(problem, start=start, progress=progress):
                with clock.phase("results"), signals_wait():  # a step is in all files or in none
                    writer = writer or Writer(folder, case, problem.space, prints, orders)
                    made.add(state)
                    writer.step(made.results, made.fields_of(state), made.restart(state))
                    if stepped is not None:
                        stepped(made.results.steps[-1])
    except BaseException as error:
        if writer is None and isinstance(error, NotConvergedError):
            writer = Writer(folder, case, problem.space, prints, orders)
        if writer is not None:
            writer.finish(*made.ended(error))
        if isinstance(error, NotConvergedError):
            for doubt in made.softened():
                warnings.warn(LacmeshWarning(doubt), stacklevel=2)
        raise
    held = tuple(one.words for one in made.last.held if np.isnan(one.part)) if made.last else ()
    doubts = _doubts(problem, made)
    loads = _resultants(problem, made.last)
    made.results = replace(made.told(), status="done", held=held, message="\n".join(doubts), loads=loads)
    for doubt in doubts:
        warnings.warn(LacmeshWarning(doubt), stacklevel=2)
    writer = writer or Writer(folder, case, problem.space, prints, orders)
    writer.finish(made.results)
    return made.results


@dataclass
class Clock:
    """Seconds of each phase; a phase inside another is not counted in the outer one."""

    seconds: dict[str, float] = field(default_factory=dict)
    _open: list[str] = field(default_factory=list)
    _since: float = 0.0

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


@dataclass
class _Run:
    """A run so far: its results, number of steps, last state; its zones at the start.

    `covered`: largest covered fraction of each zone so far, 1 once it has been in contact.
    """

    answer: Answer
    clock: Clock
    results: Results
    number: int
    last: State | None = None
    compressed: Floats | None = None
    starts: Mapping[str, Start] = field(default_factory=dict)
    covered: dict[str, float] = field(default_factory=dict)

    @property
    def problem(self) -> Problem:
        """The problem that is solved."""
        return self.answer.problem

    def add(self, state: State) -> None:
        """Add a converged step to the results."""
        self.number += 1
        self.last = state
        step = self.answer.figures(state)
        for zone in state.zones:  # a ball that touches a plane has most of its skin away from it, as it should
            touches = (zone.status == CONTACT).any()
            covered = 1.0 if touches else float((zone.area * zone.coverage).sum() / zone.area.sum())
            self.covered[zone.name] = max(self.covered.get(zone.name, 0.0), covered)
        ranges = self.answer.stress_ranges(state)
        self.results = replace(self.told(), steps=(*self.results.steps, step), stress=ranges)
        now = most_compressed(self.problem, state)
        self.compressed = now if self.compressed is None else worse(self.compressed, now)

    def softened(self) -> tuple[str, ...]:
        """Return warnings about bodies that a step so far has crushed, of all processes."""
        return () if self.compressed is None else tuple(softened(self.problem, self.compressed))

    def fields_of(self, state: State) -> Callable[[], Fields]:
        """Return a function that computes the fields of a state when it is called."""
        return lambda: self.answer.fields(state)

    def restart(self, state: State) -> Restart:
        """Return a converged state for a restart."""
        size = state.step.step_size if np.isfinite(state.step.step_size) else self.problem.case.steps.last
        return Restart.of(state, size, self.number)

    def told(self) -> Results:
        """Return the results with current timings and peak memory."""
        return replace(self.results, timings=dict(self.clock.seconds), memory=peak_memory())

    def ended(self, error: BaseException) -> tuple[Results, Callable[[], Fields] | None]:
        """Return the results of a run ended by an error or a signal, and a function for the last state's fields.

        The function is None unless the run did not converge.
        """
        failed = isinstance(error, Exception)
        results = replace(self.told(), status="failed" if failed else "interrupted", message=str(error))
        if isinstance(error, NotConvergedError):
            return results, self.fields_of(error.state)
        return results, None


def _doubts(problem: Problem, made: _Run) -> tuple[str, ...]:
    """Return warnings about doubtful results of a finished run, those of all processes."""
    told = list(_strangers(problem, made.results))
    told += [said for start in made.starts.values() for said in start.told]
    for pair in problem.joints:
        told += scarcely_covered(pair, made.covered.get(pair.name, 0.0)) if pair.moving else ()
    told += doubts(problem)
    told += _doubtful_energy(problem.case, made.results)
    told += made.softened()
    if made.last is not None:
        told += warnings_of(made.last.held, made.last.prescribed)
        told += faceted(problem, made.last)
        told += alternating(problem, made.last)
        if not problem.kinematics.finite:
            told += filter(None, [beyond_a_cell(problem.space, made.last.u)])
    return problem.space.share.texts(told)


def _starts(problem: Problem) -> dict[str, Start]:
    """Return the zones of a problem in the undeformed configuration, at the end of the first step."""
    space, t = problem.space, problem.case.steps.planned[0]
    u = np.zeros(space.n_dof)
    return {pair.name: start_of(pair, pair.integrate(space, u, t), space) for pair in problem.joints}


def _resultants(problem: Problem, last: State | None) -> tuple[Resultant, ...]:
    """Return the resultants of all loads in the last state; none without one."""
    if last is None:
        return ()
    weight = None if problem.inertia is None else problem.inertia.weight
    return resultants(problem.space, problem.materials, problem.case, last.time, u=last.u, weight=weight)


def _strangers(problem: Problem, results: Results) -> Iterator[str]:
    """Yield a warning for each zone whose slave had no master in front of it at any step."""
    for joint in problem.joints:
        seen = [step.contact[joint.name] for step in results.steps]
        if seen and not any(zone.active + zone.open for zone in seen):
            message = f"slave {joint.record.slave!r} never had master {joint.record.master!r} in front of it"
            yield f"{message}; check which groups these are and that their faces turn outward, or raise search_distance"


def _doubtful_energy(case: Case, results: Results) -> Iterator[str]:
    """Yield a warning if the steps in motion have made energy, or have lost too much of it in contact."""
    steps = [(step.time, step.motion.energies) for step in results.steps if step.motion is not None]
    table = np.array([[energies[name] for name in ENERGIES] for _, energies in steps]).reshape(-1, len(ENERGIES))
    there = np.isfinite(table).all(axis=1)  # static steps before have none
    rigid = all(pair.type in ("unilateral", "bilateral") and pair.stiffness is None for pair in case.contact)
    said = doubtful_energy([time for (time, _), on in zip(steps, there, strict=True) if on], table[there], rigid)
    if said is not None and case.dynamics is not None:
        skins = case.dynamics.massless == "skins"
        yield f"{said}; " + ("take smaller steps" if skins else 'take massless = "skins", or smaller steps')


def _sizes(problem: Problem) -> dict[str, int]:
    space, own = problem.space, problem.constraints.own

    def total(n: int) -> Floats:
        return space.share.total(np.array(n))

    return {
        "nodes": int(total(len(space.own(np.empty(space.mesh.n_nodes))))),
        "cells": int(total(sum(int(space.own_cells(block).sum()) for block in space.blocks))),
        "unknowns": int(total(problem.constraints.n_q if own is None else int(own.sum()))),
        "macro_elements": sum(joint.zone.n_macros for joint in problem.joints),
    }
