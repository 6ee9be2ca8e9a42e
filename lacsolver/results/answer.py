"""Evaluation of the states of a problem: figures of a step, fields on the mesh.

for state in march(problem):
    answer.figures(state)        # forces, contact, balance, energy                 (results.StepFigures)
    answer.fields(state)         # displacement, nodal stress, pressures            (results.Fields)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.small.fields import Field
from lacsolver.problem.problem import ContactPair, Problem
from lacsolver.results.figures import balance, probe, stress_ranges, zone_figures
from lacsolver.results.motion import ENERGIES
from lacsolver.results.nodal import nodal_stress
from lacsolver.results.recovery import recover_pressure
from lacsolver.results.results import Fields, MotionFigures, StepFigures, ZoneFields
from lacsolver.results.state import State, ZoneState
from lacsolver.space.places import nodes_of


@dataclass
class Answer:
    """Computes the figures and fields of states of a problem.

    >>> from lacsolver import read_case
    >>> from lacsolver.problem.problem import Problem
    >>> from lacsolver.equilibrium.stepping import march
    >>> problem = Problem.of(read_case("data/two_blocks.toml"))
    >>> *_, state = march(problem)
    >>> answer = Answer(problem)
    >>> answer.figures(state).contact["joint"].active, answer.fields(state).stress.shape
    (36, (512, 6))
    """

    problem: Problem
    _probes: dict[str, Ints] = field(init=False)
    _stress: tuple[State, Field] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self._probes = {p.name: nodes_of(self.problem.space, p) for p in self.problem.case.probe}

    def stress(self, state: State) -> Field:
        """Return the stress at integration points, (cells, points, n) for each block; the last result is cached."""
        if self._stress is None or self._stress[0] is not state:
            self._stress = state, self.problem.kinematics.stress(state.u, state.time, state.history)
        return self._stress[1]

    def figures(self, state: State) -> StepFigures:
        """Return the figures of the step that led to a state."""
        problem, space = self.problem, self.problem.space
        pairs = [
            (zone, joint, self._places(joint, state)) for joint, zone in zip(problem.joints, state.zones, strict=True)
        ]
        return StepFigures(
            time=state.time,
            iterations=state.iterations,
            halvings=state.halvings,
            residuals=state.residuals,
            reactions=problem.constraints.reactions(state.reaction),
            probes={name: probe(space, state.u, nodes) for name, nodes in self._probes.items()},
            contact={
                zone.name: zone_figures(zone, _nodes(joint), x + space.origin[: space.dim]) for zone, joint, x in pairs
            },
            balance=balance((zone.force, x) for zone, _, x in pairs),
            energy=float(space.share.total(np.array(problem.kinematics.energy(state.u, state.time, state.history)))),
            displacement=space.largest(np.linalg.norm(state.u.reshape(-1, space.dim), axis=1)),
            motion=None if problem.case.dynamics is None else self._motion(state),
        )

    def stress_ranges(self, state: State) -> Mapping[str, Mapping[str, tuple[float, float]]]:
        """Return the range of each stress component at integration points, by group of cells, "" for all."""
        return stress_ranges(self.problem.space, self.stress(state))

    def fields(self, state: State) -> Fields:
        """Return the fields of a state."""
        space, joints = self.problem.space, self.problem.joints
        at_nodes = nodal_stress(space, self.stress(state))
        pairs = zip(joints, state.zones, strict=True)
        zones = {zone.name: self._zone(joint, zone, state.u) for joint, zone in pairs}
        at_nodes = space.share.update(at_nodes)
        u, reaction = (v.reshape(-1, space.dim) for v in (state.u, space.updated(state.reaction)))
        if self.problem.case.dynamics is None:
            return Fields(state.time, u, at_nodes, reaction, zones)
        motion, n = state.step.motion, space.n_dof
        both = (0.0 * u, 0.0 * u) if motion is None else (motion.velocity[:n], motion.acceleration[:n])
        return Fields(state.time, u, at_nodes, reaction, zones, *(v.reshape(-1, space.dim) for v in both))

    def _motion(self, state: State) -> MotionFigures:
        """Return the figures of a state in motion; NaN for a static state."""
        space, motion = self.problem.space, state.step.motion
        none = np.full(space.dim, np.nan)
        names = [joint.name for joint in self.problem.joints]
        if motion is None:
            return MotionFigures(
                dict.fromkeys(ENERGIES, float("nan")),
                {"linear": none, "angular": np.full(3, np.nan) if space.dim == 3 else np.array(np.nan)},
                *(dict.fromkeys(told, none) for told in (names, self._probes, self._probes)),
            )
        v, a = motion.velocity[: space.n_dof], motion.acceleration[: space.n_dof]
        return MotionFigures(
            dict(zip(ENERGIES, motion.energies.tolist(), strict=True)),
            {"linear": motion.linear, "angular": motion.angular},
            dict(zip(names, motion.impulse, strict=True)),
            {name: probe(space, v, nodes) for name, nodes in self._probes.items()},
            {name: probe(space, a, nodes) for name, nodes in self._probes.items()},
        )

    def _places(self, joint: ContactPair, state: State) -> Floats:
        """Return the coordinates (n_nodes, dim) at which a pair's forces act, relative to the space's origin."""
        space = self.problem.space
        return joint.places(space, state.u)[:, : space.dim]

    def _zone(self, joint: ContactPair, zone: ZoneState, u: Floats) -> ZoneFields:
        slave = joint.zone.slave.at(joint.places(self.problem.space, u))
        nodal, mean = recover_pressure(
            slave, joint.zone.macro, zone.pressure, zone.status,
            axisymmetric=self.problem.space.model.axisymmetric, unilateral=joint.law.compressive,
        )  # fmt: skip
        told = joint.zone.slave.at(self.problem.space.mesh.points)
        return ZoneFields.of(zone, told, joint.zone.macro, joint.zone.number, mean, nodal)


def _nodes(joint: ContactPair) -> np.ndarray:
    nodes = joint.zone.slave.faces.nodes
    return np.unique(nodes[nodes >= 0])
