"""Small contact problems from lines of a case file, and what every state of one has to fulfil."""

from __future__ import annotations

import numpy as np

from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.state import CONTACT, OPEN, UNPAIRED
from verification.measures.balance import unbalanced

YOUNG, POISSON = 1000.0, 0.3
HEAD = """mesh = "blocks.msh"
model = "{model}"
[solver]
threads = 1
"""
MATERIAL = f"""[[material]]
young = {YOUNG}
poisson = {POISSON}
"""
JOINT = """[[contact]]
slave = "slave"
master = "master"
"""


def solve(mesh, sections, model="3d", material=MATERIAL):
    """Solve a case: (problem, states); every converged state is checked."""
    problem = Problem.of(parse_case(HEAD.format(model=model) + material + sections), mesh)
    states, moved = list(march(problem)), 0.0
    for state in states:
        moved = max(moved, float(np.abs(state.u).max()))
        check(problem, state, moved)
    return problem, states


def only(mesh, sections, model="3d", material=MATERIAL):
    """Solve a case of one step: (problem, its only state)."""
    problem, (state,) = solve(mesh, sections, model, material)
    return problem, state


def check(problem, state, moved):
    """Check equilibrium of the free unknowns, the conditions of every zone, and the balance of contact forces.

    `moved`: the largest displacement up to now, which round-off goes with.
    """
    c, u = problem.constraints, state.u
    K = problem.kinematics.tangent(u, state.time)
    acting = problem.kinematics.internal_force(u, state.time), problem.load(state.time, u), state.reaction
    forces = [np.abs(v).max(initial=0.0) for v in acting]
    forces.append(1e-4 * abs(K).max() * moved)  # what round-off is measured with where nothing acts
    left = c.T.T @ state.reaction - c.force(state.time)
    assert np.abs(left).max(initial=0.0) <= 1e-10 * max(forces), "balance of what is free"
    x = problem.space.mesh.points.copy()
    if any(joint.moving for joint in problem.joints):
        x[:, : problem.space.dim] += state.u.reshape(-1, problem.space.dim)
    for joint, zone in zip(problem.joints, state.zones, strict=True):
        check_conditions(joint, zone, moved)
        if np.abs(zone.force).max() > 1e-14 * max(forces):
            force, moment = unbalanced(x, zone.force, axisymmetric=problem.space.model.axisymmetric)
            assert max(force, moment) <= 1e-12, (zone.name, force, moment)


def check_conditions(joint, zone, moved):
    """Check the conditions of a zone: p >= 0, G >= 0, p G = 0; no gap where it is held; zero where it is not paired."""
    on = zone.status != UNPAIRED
    assert (zone.pressure[~on] == 0).all() and np.isnan(zone.gap[~on]).all()
    p, g = zone.pressure[on], zone.gap[on]
    if not joint.one_sided:
        assert np.abs(g).max(initial=0.0) <= 1e-12 * moved and (zone.status[on] == CONTACT).all()
        return
    strong = max(p.max(initial=0.0), YOUNG * moved)
    nothing = 1e-12 * moved
    if joint.moving:  # gaps are then differences of places, which have a last bit
        nothing += 4 * np.finfo(float).eps * np.abs(zone.centre).max()
    assert p.min(initial=0.0) >= -1e-14 * strong
    assert g.min(initial=0.0) >= -nothing
    assert np.abs(p * g).max(initial=0.0) <= strong * nothing
    assert np.abs(p[zone.status[on] == OPEN]).max(initial=0.0) <= 1e-14 * strong
    assert (p[zone.status[on] == CONTACT] > 0).all()


def stresses(problem, state):
    """(points, components) of the whole body."""
    found = problem.kinematics.stress(state.u, state.time)
    return np.concatenate([s.reshape(-1, s.shape[-1]) for s in found])


def by_node(problem, state):
    """(n_nodes, dim): the displacement."""
    return state.u.reshape(-1, problem.space.dim)


def nodes_of(problem, group):
    """The nodes of a group of cells, in the mesh as it is cut."""
    mesh = problem.space.mesh
    return np.unique(np.concatenate([nodes.ravel() for _, _, nodes in mesh.select(mesh.cells_of(group))]))


def resultant(zone, problem):
    """(d,): the contact force on the slave."""
    (joint,) = [j for j in problem.joints if j.name == zone.name]
    faces = joint.zone.slave.faces.nodes
    nodes = np.unique(faces[faces >= 0])
    return zone.force[nodes].sum(axis=0)


def held(group, **values):
    """A [[displacement]]: a component by name, 0 unless said."""
    return "".join(["[[displacement]]\n", f'group = "{group}"\n', *(f"{k} = {_said(v)}\n" for k, v in values.items())])


def at(place, **values):
    """A [[displacement]] of the node at a place."""
    return "".join([f"[[displacement]]\nat = {place}\n", *(f"{k} = {v}\n" for k, v in values.items())])


def pressed(group, value):
    """A [[pressure]]."""
    return f'[[pressure]]\ngroup = "{group}"\nvalue = {_said(value)}\n'


def _said(value):
    return f'"{value}"' if isinstance(value, str) else repr(value) if not isinstance(value, list) else str(value)


#: both blocks slide along their sides x = 0 and y = 0
SLIDING = held("x0", ux=0.0) + held("y0", uy=0.0)
