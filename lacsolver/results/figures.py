"""Figures of a converged state: of its step, its zones, their balance, stress ranges, probes.

Forces and areas are those of the whole thickness or circle. The moments in a zone's figures are about the origin, those
in its balance about the centre of the contact forces.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacsolver.bodies.points import Field
from lacsolver.case import Coupling
from lacsolver.constraints.coupling import CouplingRows, CouplingState, distributing_state, followed_state, force_name
from lacsolver.constraints.late import support_forces
from lacsolver.constraints.pretension import SectionForces, carried_by
from lacsolver.constraints.terms import carried
from lacsolver.equilibrium.motion import ENERGIES
from lacsolver.equilibrium.state import CONTACT, OPEN, SLIDES, UNPAIRED, State, ZoneFriction, ZoneState
from lacsolver.problem.problem import Problem
from lacsolver.results.nodal import PRINCIPAL, principal, von_mises
from lacsolver.results.results import FrictionFigures, MotionFigures, StepFigures, ZoneFigures
from lacsolver.results.yielding import plastic_figures, yields
from lacsolver.space.space import COMPONENTS, Space


def step_figures(problem: Problem, state: State, stress: Field | None = None) -> StepFigures:
    """Return the figures of the step that led to a state; `stress`: its `point_stress`, where that is known."""
    space = problem.space
    if stress is None and yields(problem):
        stress = problem.kinematics.stress(state.u, state.time, state.history)
    pairs = [
        (zone, pair.zone.slave.faces.distinct_nodes, pair.places(space, state.u)[:, : space.dim])
        for pair, zone in zip(problem.joints, state.zones, strict=True)
    ]
    return StepFigures(
        time=state.time,
        iterations=state.iterations,
        halvings=state.halvings,
        residuals=state.residuals,
        reactions=_reactions(problem, state),
        probes={name: probe(space, state.u, nodes) for name, nodes in problem.probes.items()},
        contact={zone.name: zone_figures(zone, nodes, x + space.origin[: space.dim]) for zone, nodes, x in pairs},
        balance=balance(
            (zone.force, x)
            for (zone, _, x), pair in zip(pairs, problem.joints, strict=True)
            if pair.pairing.turn is None  # forces on the other sector are turned
        ),
        energy=float(space.share.total(np.array(problem.kinematics.energy(state.u, state.time, state.history)))),
        displacement=space.largest(np.linalg.norm(state.u.reshape(-1, space.dim), axis=1)),
        motion=None if problem.case.dynamics is None else _motion(problem, state),
        work=state.step.work,
        plastic=None if stress is None else plastic_figures(problem, state, stress),
        couplings={one.name: _coupling(problem, state, one) for one in problem.case.coupling},
        pretension=bolt_forces(problem, state),
        equations={one.name: carried(one, state.equations[one.name]) for one in problem.case.equation},
    )


def _reactions(problem: Problem, state: State) -> dict[str, NDArray[np.floating]]:
    """Return the reaction (dim,) of each support and rigid body, by name."""
    out = problem.constraints.reactions(state.reaction, state.equations)
    for name, f in support_forces(problem.constraints, problem.equalities, state.equations):
        out[name] = out.get(name, 0.0) + f.reshape(-1, problem.space.dim).sum(axis=0)
    return out


def _coupling(problem: Problem, state: State, record: Coupling) -> CouplingState:
    """Return the motion of a coupling's point, and the force and moment that it exerts on the nodes."""
    space, constraints = problem.space, problem.constraints
    if record.kind == "distributing":
        rows = CouplingRows.of(space, record, problem.case.kinematics == "finite")
        forces = state.equations.get(rows.name, np.empty(0))
        return distributing_state(space, rows, forces, state.time, state.u)
    if record.name in state.rigid:
        motion = state.rigid[record.name]
        reaction = constraints.of_supports(state.reaction, state.equations)
        force = constraints.rigid_reactions(reaction, state.rigid)[record.name]
        return CouplingState(*np.split(motion, [space.dim]), *np.split(force, [space.dim]))
    name = force_name(record)
    further = state.further.get(name, np.empty(0))
    u = state.u if problem.case.kinematics == "finite" else None
    return followed_state(space, record, state.equations[name], further, state.time, u)


def bolt_forces(problem: Problem, state: State) -> dict[str, SectionForces]:
    """Return what each section of a bolt carries in a state, by its name."""
    displaced = problem.case.kinematics == "finite"
    return {
        one.record.name: carried_by(one, problem.space, state.u, state.equations, displaced=displaced)
        for one in problem.sections
    }


def _motion(problem: Problem, state: State) -> MotionFigures:
    """Return the figures of a state in motion; NaN for a static state."""
    space, motion, names = problem.space, state.step.motion, [pair.name for pair in problem.joints]
    if motion is None:
        none = np.full(space.dim, np.nan)
        return MotionFigures(
            dict.fromkeys(ENERGIES, float("nan")),
            {"linear": none, "angular": np.full(3, np.nan) if space.dim == 3 else np.array(np.nan)},
            *(dict.fromkeys(of, none) for of in (names, problem.probes, problem.probes)),
        )
    of_probes = [
        {name: probe(space, values[: space.n_dof], nodes) for name, nodes in problem.probes.items()}
        for values in (motion.velocity, motion.acceleration)
    ]
    return MotionFigures(
        dict(zip(ENERGIES, motion.energies.tolist(), strict=True)),
        {"linear": motion.linear, "angular": motion.angular},
        dict(zip(names, motion.impulse, strict=True)),
        *of_probes,
    )


def zone_figures(zone: ZoneState, slave: Ints, x: Floats) -> ZoneFigures:
    """Return the figures of a zone. `slave`: its slave nodes; `x` (n_nodes, dim): points of action of the forces."""
    paired = zone.status != UNPAIRED
    force = np.zeros_like(zone.force)
    force[slave] = zone.force[slave]
    pressure, gap = zone.pressure[paired], zone.gap[paired]
    covered = (zone.area * zone.coverage)[zone.status >= CONTACT]
    contact_area = float(covered.sum())
    mean = float(covered @ zone.pressure[zone.status >= CONTACT]) / contact_area if contact_area > 0 else np.nan
    return ZoneFigures(
        pressure_min=_least(pressure),
        pressure_max=-_least(-pressure),
        pressure_mean=mean,
        gap_min=_least(gap),
        gap_max=-_least(-gap),
        contact_area=contact_area,
        resultant=force.sum(axis=0),
        moment=moment(force, x),
        coverage_min=_least(zone.coverage),
        coverage_max=-_least(-zone.coverage),
        active=int((zone.status >= CONTACT).sum()),
        open=int((zone.status == OPEN).sum()),
        unpaired=int((~paired).sum()),
        friction=None if zone.friction is None else _friction(zone, zone.friction),
    )


def _friction(zone: ZoneState, friction: ZoneFriction) -> FrictionFigures:
    """Return the figures of the friction of a zone."""
    return FrictionFigures(
        sticking=int((zone.status == CONTACT).sum()),
        sliding=int((zone.status == SLIDES).sum()),
        slip_max=float(np.linalg.norm(friction.slip, axis=1).max(initial=0.0)),
        dissipation=friction.energy,
        friction=friction.resultant,
    )


def moment(force: Floats, x: Floats) -> NDArray[np.floating]:
    """Return the moment of forces (n, dim) at x (n, dim) about the origin, (3,) in space, () in a plane."""
    if x.shape[1] == 2:
        return np.asarray(x[:, 0] @ force[:, 1] - x[:, 1] @ force[:, 0])
    return np.asarray(np.cross(x, force).sum(axis=0))


def balance(zones: Iterable[tuple[Floats, Floats]]) -> tuple[float, float]:
    """Return the relative errors of the balance of forces and of moments, the largest of all zones; 0 without forces.

    `zones`: contact forces on all nodes and their points of action, (n_nodes, dim) each. Forces: their sum over slave
    and master, relative to half the sum of their magnitudes. Moments: about the centre of the forces, relative to half
    the sum of magnitude times distance. In axisymmetry they are taken in the plane too: the forces on both skins are
    those of the slave's circle.
    """
    errors = [_balance(force, x) for force, x in zones]
    return max((f for f, _ in errors), default=0.0), max((m for _, m in errors), default=0.0)


def _balance(force: Floats, x: Floats) -> tuple[float, float]:
    size = np.linalg.norm(force, axis=1)
    total = float(size.sum())
    if not total > 0:
        return 0.0, 0.0
    arm = x - (size @ x) / total
    moment_arm = float(size @ np.linalg.norm(arm, axis=1))
    turned = float(np.linalg.norm(moment(force, arm)))
    return float(np.linalg.norm(force.sum(axis=0))) / (total / 2), turned / (moment_arm / 2) if moment_arm > 0 else 0.0


def stress_ranges(space: Space, stress: Field) -> Mapping[str, Mapping[str, tuple[float, float]]]:
    """Return the ranges of stresses at integration points, for all cells ('') and for cell groups.

    Of each component, of von Mises' stress, and of the principal stresses, of which the first is the largest.
    """
    names = (*COMPONENTS[: space.model.n_stress], "von_mises", *PRINCIPAL)
    n = len(names)
    low = np.full((space.mesh.n_cells, n), np.inf)
    high = np.full((space.mesh.n_cells, n), -np.inf)
    for block, values in zip(space.blocks, stress, strict=True):
        own = with_invariants(values)
        low[block.cell], high[block.cell] = own.min(axis=1), own.max(axis=1)
    ours = space.cells()
    groups = {"": ours} | {name: np.intersect1d(cells, ours) for name, cells in space.mesh.cell_groups.items()}
    ends = [
        np.concatenate([-low[cells].min(axis=0, initial=np.inf), high[cells].max(axis=0, initial=-np.inf)])
        for cells in groups.values()
    ]
    largest = space.share.gather(np.array(ends)[None]).max(axis=0)
    return {
        name: {c: (float(-end[k]), float(end[n + k])) for k, c in enumerate(names)}
        for name, end in zip(groups, largest, strict=True)
        if end[n] > -np.inf
    }


def with_invariants(stress: Floats) -> NDArray[np.floating]:
    """Return stresses (cells, points, n) with von Mises' stress and the principal stresses as further components."""
    flat = stress.reshape(-1, stress.shape[-1])
    wide = np.concatenate([flat, von_mises(flat)[:, None], principal(flat)], axis=1)
    return wide.reshape(*stress.shape[:-1], wide.shape[1])


def probe(space: Space, u: Floats, nodes: Ints) -> NDArray[np.floating]:
    """Return the mean displacement (dim,) of some nodes, those of all processes."""
    total = space.share.total(np.append(u.reshape(-1, space.dim)[nodes].sum(axis=0), len(nodes)))
    return np.asarray(total[:-1] / total[-1])


def _least(values: Floats) -> float:
    return float(values.min()) if len(values) else float("nan")
