"""Fields of a state on the nodes of its mesh, and its stress at integration points."""

from __future__ import annotations

from dataclasses import replace

from lacsolver.bodies.points import Field
from lacsolver.constraints.late import late_forces
from lacsolver.equilibrium.state import State, ZoneState
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.problem import Problem
from lacsolver.results.nodal import nodal_stress
from lacsolver.results.recovery import recover_pressure
from lacsolver.results.results import Fields, ZoneFields
from lacsolver.results.yielding import nodal_plastic_strain


def point_stress(problem: Problem, state: State) -> Field:
    """Return the stress of a state at integration points, (cells, points, n) for each block."""
    return problem.kinematics.stress(state.u, state.time, state.history)


def state_fields(problem: Problem, state: State, stress: Field | None = None) -> Fields:
    """Return the fields of a state; `stress`: its `point_stress`, where that is known."""
    space, dynamics = problem.space, problem.case.dynamics
    at_nodes = nodal_stress(space, point_stress(problem, state) if stress is None else stress)
    pairs = zip(problem.joints, state.zones, strict=True)
    zones = {zone.name: _zone(problem, pair, zone, state) for pair, zone in pairs}
    at_nodes = space.share.update(at_nodes)
    late = [f for _, f in late_forces(problem.equalities, state.equations)]
    vectors = [state.u, space.updated(sum(late, state.reaction))]
    if dynamics is not None:
        motion, n = state.step.motion, space.n_dof
        moving = (motion.velocity[:n], motion.acceleration[:n]) if motion else (0.0 * state.u, 0.0 * state.u)
        vectors += moving
    u, reaction, *velocities = (values.reshape(-1, space.dim) for values in vectors)
    fields = Fields(state.time, u, at_nodes, reaction, zones, *velocities)
    return replace(fields, plastic_strain=nodal_plastic_strain(problem, state))


def _zone(problem: Problem, pair: ContactPair, zone: ZoneState, state: State) -> ZoneFields:
    """Return the fields of a pair, with pressure and friction recovered on the skin where it is paired."""
    slave, round_ = pair.zone.slave.at(pair.places(problem.space, state.u)), problem.space.model.axisymmetric
    nodal, mean = recover_pressure(
        slave, pair.zone.macro, zone.pressure, zone.status,
        axisymmetric=round_, unilateral=pair.law.compressive, coverage=zone.coverage,
    )  # fmt: skip
    bounds, shear = pair.bounds(problem.space, state.time), None
    if bounds is not None and zone.friction is not None:
        t = zone.friction.in_space(zone.friction.shear)
        pressures = zone.pressure, nodal
        from lacsolver.results.recovered_shear import recover_shear

        shear = recover_shear(
            slave, pair.zone.macro, t, pressures, zone.status, bounds, axisymmetric=round_, coverage=zone.coverage
        )
    undeformed = pair.zone.slave.at(problem.space.mesh.points)
    return ZoneFields(
        **vars(zone), surface=undeformed, macro=pair.zone.macro, number=pair.zone.number, recovered=mean,
        pressure_recovered=nodal, shear_recovered=shear,
    )  # fmt: skip
