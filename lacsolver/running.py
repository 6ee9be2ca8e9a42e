"""A run: solution of a case from its first step to its last, with its output."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from lacmesh import __version__
from lacmesh.errors import RequestError
from lacmesh.formats.output import signals_wait
from lacmesh.mesh import Mesh, MeshLike, as_mesh
from lacmesh.threads import peak_memory
from lacsolver.case import Case, as_case, fingerprint
from lacsolver.distributed.share import UNDIVIDED, Distribution
from lacsolver.doubts.overlap import deepest_overlap, widest_gap
from lacsolver.doubts.rules import Doubts
from lacsolver.equilibrium.attempt import Progress
from lacsolver.equilibrium.state import State
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import OutputFolder, Writer, check_same, create_output
from lacsolver.output.ring import described
from lacsolver.output.states import scatter_state
from lacsolver.problem.problem import Problem, read_mesh
from lacsolver.problem.resultants import Resultant, resultants
from lacsolver.results.fields import point_stress, state_fields
from lacsolver.results.figures import step_figures, stress_ranges
from lacsolver.results.results import Restart, Results, StepFigures
from lacsolver.results.whole import orders_of


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
        self._number = 0
        self._doubts = Doubts(problem)
        self._doubts.ask("undeformed")
        gaps = {pair.name: widest_gap(self._doubts.run, pair) for pair in problem.joints if pair.tie}
        self._writer: Writer | None = None
        self._last: State | None = None
        #: a sentence about a solver that took the place of the one that was asked for, of which was warned
        self._solver = ""
        self.results = Results(
            __version__,
            sizes=_sizes(problem),
            roles={pair.name: (pair.record.slave, pair.record.master, pair.record.why) for pair in problem.joints},
            overlap={pair.name: deepest_overlap(self._doubts.run, pair) for pair in problem.joints},
            bridged={name: gap for name, gap in gaps.items() if gap > 0},
            units=problem.case.output.units or "",
            adjusted=problem.adjusted,
            sectors=described(problem.case),
        )

    def continued(self, start: Restart, mesh: Mesh) -> Restart:
        """Return the share of this process in a state to restart from, after whose step the output goes on.

        Raises DataError for a state of another case or mesh.
        """
        problem, self._number = self._problem, start.number
        self._doubts.continued(start)
        problem.space.share.on_first(lambda: check_same(start, problem.case, mesh, self._prints))
        return scatter_state(start, problem.space.share, self._orders) if self._orders else start

    def add(self, state: State) -> None:
        """Add a converged step to the results, and write it. Raises CaseError for a state that is refused."""
        self._doubts.after(state)
        problem = self._problem
        writer = self._writer = self._writer or self._open()
        self._number, self._last, self._solver = self._number + 1, state, self._solver or state.linear_solver
        stress = point_stress(problem, state)
        steps = (*self.results.steps, step_figures(problem, state, stress))
        self.results = replace(self.results, steps=steps, stress=stress_ranges(problem.space, stress), **self._spent())
        size = state.step.step_size if np.isfinite(state.step.step_size) else problem.case.steps.last
        writer.step(self.results, lambda: state_fields(problem, state, stress), Restart.of(state, size, self._number))

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
        self._doubts.ask("end")
        modes: tuple[str, ...] = ()
        loads: tuple[Resultant, ...] = ()
        if last is not None:
            modes = tuple(motion.words for motion in last.held if np.isnan(motion.part))
            loads = resultants(problem.loads, last.time, last.u)
        message = "\n".join(filter(None, [self._solver, *self._doubts.texts]))
        self.results = replace(self.results, status="done", held=modes, message=message, loads=loads, **self._spent())
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
            self._doubts.ask("failed")
        elif self._writer is not None:
            self._writer.finish(self.results)

    def _spent(self) -> dict[str, Any]:
        """Return the timings and the peak memory of now, as keywords of `Results`."""
        return {"timings": dict(self._clock.seconds), "memory": peak_memory()}

    def _open(self) -> Writer:
        problem = self._problem
        return Writer(self._folder, problem.case, problem.space, self._prints, self._orders)


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
