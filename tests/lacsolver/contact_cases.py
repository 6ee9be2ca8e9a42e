"""Small contact problems, and what every state of one has to fulfil."""

from __future__ import annotations

import numpy as np

from lacsolver.case import Pressure, Solver
from lacsolver.equilibrium.state import CONTACT, OPEN, UNPAIRED
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.saddle.tolerances import ROUNDING
from tests.problem_meshes import nodes_of as nodes_of_mesh
from tests.problems import ELASTIC, case_of, fix
from verification.measures.balance import unbalanced

YOUNG, POISSON = 1000.0, 0.3


def solve(mesh, *records, model="3d", material=ELASTIC, **keys):
    """Solve a case: (problem, states); every converged state is checked."""
    solver = Solver(threads=1, tolerance=1e-11 if keys.get("kinematics") == "finite" else 1e-10)
    return checked(Problem.of(case_of(mesh, *records, material, solver, model=model, **keys), mesh))


def only(mesh, *records, **options):
    """Solve a case of one step: (problem, its only state)."""
    problem, (state,) = solve(mesh, *records, **options)
    return problem, state


def last(mesh, *records, **options):
    """Solve a case: (problem, its last state)."""
    problem, states = solve(mesh, *records, **options)
    return problem, states[-1]


def checked(problem, states=None, exact=True):
    """(problem, its states), each of which is checked; `exact`: gaps of linear bodies are zero to rounding."""
    states, moved = list(march(problem) if states is None else states), 1e-300
    for state in states:
        moved = max(moved, float(np.abs(state.u).max()))
        check(problem, state, moved, exact)
    return problem, states


def check(problem, state, moved, exact=True):
    """Check equilibrium of the free unknowns, the conditions of every zone, and the balance of contact forces.

    In motion the account of energies closes instead. `moved`: the largest displacement up to now, which round-off goes
    with.
    """
    c, u, q = problem.constraints, state.u, state.step.iterate.q
    K = problem.kinematics.tangent(u, state.time)
    acting = problem.kinematics.internal_force(u, state.time), problem.load(state.time, u), state.reaction
    forces = [np.abs(v).max(initial=0.0) for v in acting]
    forces.append(1e-4 * abs(K).max() * moved)  # what round-off is measured with where nothing acts
    tolerance = max(1e-10, 10 * problem.case.solver.tolerance)
    if not problem.kinematics.linear:  # rounding of coordinates makes forces
        forces.append(10 * ROUNDING / tolerance * abs(K).max() * np.ptp(problem.space.mesh.points, axis=0).max())
    if (motion := state.step.motion) is not None:
        assert abs(motion.account) <= 1e-8 * max(np.abs(motion.energies).max(), 1e-300)
    else:
        left = c.tangent(q, state.time).T @ state.reaction - c.force(state.time, q)
        linear = problem.kinematics.linear and not any(joint.moving for joint in problem.joints)
        limit = (1e-10 if linear else tolerance) * max(forces)
        assert np.abs(left).max(initial=0.0) <= limit, "balance of what is free"
    for joint, zone in zip(problem.joints, state.zones, strict=True):
        linear = problem.kinematics.linear and zone.friction is None and motion is None
        check_conditions(joint, zone, moved, 1e-12 if linear and exact else tolerance)
        if np.abs(zone.force).max() > 1e-12 * max(forces) and not problem.case.cyclic:
            x = joint.places(problem.space, u)
            force, moment = unbalanced(x, zone.force, axisymmetric=problem.space.model.axisymmetric)
            assert max(force, moment) <= 1e-12, (zone.name, force, moment)


def check_conditions(joint, zone, moved, tolerance):
    """Check the conditions of a zone: p >= 0, G >= 0, p G = 0; no gap where it is held; zero where it is not paired.

    Of soft contact p >= 0 alone; friction stays within its bound.
    """
    on = zone.status != UNPAIRED
    assert (zone.pressure[~on] == 0).all() and np.isnan(zone.gap[~on]).all()
    p, g = zone.pressure[on], zone.gap[on]
    strong = max(p.max(initial=0.0), YOUNG * moved)
    nothing = tolerance * moved
    if joint.moving:  # gaps are then differences of places, which have a last bit
        nothing += 4 * np.finfo(float).eps * np.abs(zone.centre).max()
    if zone.friction is not None:
        assert np.nanmax(zone.friction.use, initial=0.0) <= 1 + 1e-8
    if not joint.one_sided:
        assert (zone.status[on] == CONTACT).all()
        assert joint.law.yields or np.abs(g).max(initial=0.0) <= nothing
        return
    assert p.min(initial=0.0) >= -1e-14 * strong
    assert np.abs(p[zone.status[on] == OPEN]).max(initial=0.0) <= 1e-14 * strong
    assert (p[zone.status[on] >= CONTACT] > 0).all()
    if not joint.law.yields:
        assert g.min(initial=0.0) >= -nothing
        assert np.abs(p * g).max(initial=0.0) <= strong * nothing


def stresses(problem, state):
    """(points, components) of the whole body."""
    found = problem.kinematics.stress(state.u, state.time)
    return np.concatenate([s.reshape(-1, s.shape[-1]) for s in found])


def by_node(problem, state):
    """(n_nodes, dim): the displacement."""
    return state.u.reshape(-1, problem.space.dim)


def nodes_of(problem, group):
    """The nodes of a group of cells, in the mesh as it is cut."""
    return nodes_of_mesh(problem.space.mesh, group)


def places(problem, state, group=None):
    """Deformed positions (n, dim) of nodes (of a group)."""
    x = problem.space.mesh.points[:, : problem.space.dim] + by_node(problem, state)
    return x if group is None else x[nodes_of(problem, group)]


def resultant(zone, problem):
    """(d,): the contact force on the slave."""
    (joint,) = [j for j in problem.joints if j.name == zone.name]
    return zone.force[joint.zone.slave.faces.distinct_nodes].sum(axis=0)


def total(zone):
    """The sum of the pressures of a zone."""
    return zone.pressure @ zone.area


def load(group, value):
    """A pressure on a group."""
    return Pressure(group=group, value=value)


#: both blocks slide along their sides x = 0 and y = 0
SIDES = fix("x0", "x"), fix("y0", "y")
