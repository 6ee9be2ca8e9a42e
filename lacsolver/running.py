"""A run: a case solved from its first step to its last, everything written on the way."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from lacmesh.cli.terminal import peak_memory
from lacmesh.errors import LacmeshWarning
from lacmesh.formats.output import signals_wait
from lacmesh.mesh import Floats, Mesh
from lacsolver.assemble.fields import Field
from lacsolver.case import Case
from lacsolver.figures import balance, probe, stress_ranges, zone_figures
from lacsolver.output import OutputFolder, Writer
from lacsolver.places import nodes_of
from lacsolver.problem import Joint, Problem
from lacsolver.recovery import nodal_stress, recover_pressure, slave_pressure
from lacsolver.results import Fields, Restart, Results, StepFigures, ZoneFields
from lacsolver.state import State, ZoneState
from lacsolver.stepping import NotConvergedError, Told, march


def run(
    case: Case,
    folder: OutputFolder,
    *,
    mesh: Mesh | None = None,
    start: Restart | None = None,
    told: Callable[[Told], None] | None = None,
    stepped: Callable[[StepFigures], None] | None = None,
) -> Results:
    """Solve a case and write it into a folder; `start`: a state to go on from.

    `told` hears of every iteration, `stepped` of every converged step. Raises NotConvergedError after the last state
    tried is written, and what `Problem.of` and `Writer` raise; an interrupted run leaves what had converged.
    """
    clock = Clock()
    with clock.phase("mesh"):
        problem = Problem.of(case, mesh)
    made = _Run(problem, clock, Results(_version(), sizes=_sizes(problem)), start.number if start else 0)
    writer: Writer | None = None  # the folder is taken over once there is something to write: nothing is lost before
    try:
        with clock.phase("solve"):
            for state in march(problem, start=start, told=told):
                with clock.phase("results"), signals_wait():  # a step is told in all places or in none
                    writer = writer or Writer(folder, case, problem.space)
                    made.add(state)
                    writer.step(made.results, made.fields_of(state), made.restart(state))
                    if stepped is not None:
                        stepped(made.results.steps[-1])
    except BaseException as error:
        if writer is None and isinstance(error, NotConvergedError):
            writer = Writer(folder, case, problem.space)
        if writer is not None:
            writer.finish(*made.ended(error))
        raise
    made.results = replace(made.told(), status="done")
    _warn_of_strangers(problem, made.results)
    writer = writer or Writer(folder, case, problem.space)
    writer.finish(made.results)
    return made.results


@dataclass
class Clock:
    """Seconds of each phase; one inside another counts for itself alone."""

    seconds: dict[str, float] = field(default_factory=dict)
    _open: list[str] = field(default_factory=list)
    _since: float = 0.0

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time what is done inside."""
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
    """What is known of a run so far."""

    problem: Problem
    clock: Clock
    results: Results
    number: int

    def __post_init__(self) -> None:
        space = self.problem.space
        self.probes = {p.name: nodes_of(space, p) for p in self.problem.case.probe}
        self._stress: tuple[float, Field] | None = None

    def stress(self, state: State) -> Field:
        """Stress at integration points; that of the last state asked about is kept."""
        if self._stress is None or self._stress[0] != state.time:
            self._stress = state.time, self.problem.kinematics.stress(state.u, state.time)
        return self._stress[1]

    def places(self, joint: Joint, state: State) -> Floats:
        """(n_nodes, dim): where a joint's forces act."""
        space = self.problem.space
        return joint.places(space, state.u)[:, : space.dim]

    def add(self, state: State) -> None:
        """Take a converged step."""
        self.number += 1
        step = self.step(state)
        ranges = stress_ranges(self.problem.space, self.stress(state))
        self.results = replace(self.told(), steps=(*self.results.steps, step), stress=ranges)

    def step(self, state: State) -> StepFigures:
        """The figures of a state."""
        problem, space = self.problem, self.problem.space
        pairs = [
            (zone, joint, self.places(joint, state)) for joint, zone in zip(problem.joints, state.zones, strict=True)
        ]
        zones = {zone.name: zone_figures(zone, _nodes(joint), x) for zone, joint, x in pairs}
        return StepFigures(
            time=state.time,
            iterations=state.iterations,
            halvings=state.halvings,
            residuals=state.residuals,
            reactions=problem.constraints.reactions(state.reaction),
            probes={name: probe(space, state.u, nodes) for name, nodes in self.probes.items()},
            contact=zones,
            balance=balance((zone.force, x) for zone, _, x in pairs),
            energy=problem.kinematics.energy(state.u, state.time),
        )

    def fields_of(self, state: State) -> Callable[[], Fields]:
        """What makes the fields of a state, when they are asked for."""
        return lambda: self.fields(state)

    def fields(self, state: State) -> Fields:
        """The fields of a state."""
        space, joints = self.problem.space, self.problem.joints
        at_nodes = nodal_stress(space, self.stress(state))
        pairs = zip(joints, state.zones, strict=True)
        zones = {zone.name: self._zone(joint, zone, at_nodes, state.u) for joint, zone in pairs}
        u, reaction = (v.reshape(-1, space.dim) for v in (state.u, state.reaction))
        return Fields(state.time, u, at_nodes, reaction, zones)

    def _zone(self, joint: Joint, zone: ZoneState, stress: Floats, u: Floats) -> ZoneFields:
        slave = joint.zone.slave.at(joint.places(self.problem.space, u))
        nodal, mean = recover_pressure(
            slave, joint.zone.macro, zone.pressure, zone.status, traction=slave_pressure(slave, stress),
            axisymmetric=self.problem.space.model.axisymmetric, unilateral=joint.one_sided,
        )  # fmt: skip
        return ZoneFields.of(zone, joint.zone.slave, joint.zone.macro, joint.zone.number, mean, nodal)

    def restart(self, state: State) -> Restart:
        """What to go on from."""
        size = state.next_step if np.isfinite(state.next_step) else self.problem.case.steps.last
        return Restart.of(state, size, self.number)

    def told(self) -> Results:
        """The results with what time and memory came to."""
        return replace(self.results, timings=dict(self.clock.seconds), memory=peak_memory())

    def ended(self, error: BaseException) -> tuple[Results, Callable[[], Fields] | None]:
        """The results of a run that an error or a signal ended, and the fields of the state that it was at."""
        failed = isinstance(error, Exception)
        results = replace(self.told(), status="failed" if failed else "interrupted", message=str(error))
        if isinstance(error, NotConvergedError):
            return results, self.fields_of(error.state)
        return results, None


def _warn_of_strangers(problem: Problem, results: Results) -> None:
    """Warn of zones that moved and at no time had a face of the master in front of one of the slave."""
    for joint in problem.joints:
        seen = [step.contact[joint.name] for step in results.steps]
        if seen and not any(zone.active + zone.open for zone in seen):
            message = f"slave {joint.record.slave!r} never had master {joint.record.master!r} in front of it"
            advice = "check which groups these are and that their faces turn outward, or raise search_distance"
            warnings.warn(LacmeshWarning(f"{message}; {advice}"), stacklevel=3)


def _nodes(joint: Joint) -> np.ndarray:
    nodes = joint.zone.slave.faces.nodes
    return np.unique(nodes[nodes >= 0])


def _sizes(problem: Problem) -> dict[str, int]:
    space = problem.space
    return {
        "nodes": space.mesh.n_nodes,
        "cells": int(sum(len(block.cell) for block in space.blocks)),
        "unknowns": problem.constraints.n_q,
        "macro_elements": sum(joint.zone.n_macros for joint in problem.joints),
    }


def _version() -> str:
    from lacmesh import __version__

    return __version__
