"""Small contact problems under finite kinematics: bodies, cases, and what every state of one has to fulfil."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.state import CONTACT, UNPAIRED
from lacsolver.saddle.tolerances import ROUNDING
from tests.lacsolver.contact_cases import nodes_of
from tests.lacsolver.patch_meshes import stack
from verification.measures.balance import unbalanced

YOUNG = 1000.0
#: of forces out of balance and of gaps, relative, that states are asked for; of contact forces and their moments
TOLERANCE, BALANCED = 1e-11, 1e-12


def text(sections, model="3d", law="neo_hookean", poisson=0.3, solver="", more=""):
    """A case as a file has it."""
    head = f'mesh = "blocks.msh"\nmodel = "{model}"\nkinematics = "finite"\n[solver]\nthreads = 1\n'
    own = "" if "tolerance" in solver else f"tolerance = {TOLERANCE}\n"
    material = f'[[material]]\nlaw = "{law}"\nyoung = {YOUNG}\npoisson = {poisson}\n{more}'
    return head + own + solver + material + sections


def problem_of(mesh, sections, **options):
    """The problem of a case on a mesh."""
    return Problem.of(parse_case(text(sections, **options)), mesh)


def solve(mesh, sections, **options):
    """Solve a case: (problem, states); every converged state is checked."""
    problem = problem_of(mesh, sections, **options)
    states = list(march(problem))
    for state in states:
        check(problem, state)
    return problem, states


def last(mesh, sections, **options):
    """Solve a case: (problem, its last state)."""
    problem, states = solve(mesh, sections, **options)
    return problem, states[-1]


def check(problem, state):
    """Check equilibrium of the free unknowns, the zones' conditions, and the balance of forces where they act."""
    c, u, q = problem.constraints, state.u, state.step.iterate.q
    K = problem.kinematics.tangent(u, state.time)
    moved = max(float(np.abs(u).max()), 1e-3)
    acting = problem.kinematics.internal_force(u, state.time), problem.load(state.time, u), state.reaction
    far = max(moved, float(np.ptp(problem.space.mesh.points, axis=0).max()))  # rounding of coordinates makes forces
    rounding = ROUNDING / TOLERANCE * np.abs(K.data).max(initial=0.0) * far
    size = max(*(np.abs(v).max(initial=0.0) for v in acting), rounding)
    left = c.tangent(q, state.time).T @ state.reaction - c.force(state.time, q)
    assert np.abs(left).max(initial=0.0) <= 10 * TOLERANCE * size, "balance of what is free"
    for joint, zone in zip(problem.joints, state.zones, strict=True):
        check_conditions(joint, zone, moved)
        if np.abs(zone.force).max() > 1e-12 * size:
            x = joint.places(problem.space, u)
            force, moment = unbalanced(x, zone.force, axisymmetric=problem.space.model.axisymmetric)
            assert max(force, moment) <= BALANCED, (zone.name, force, moment)


def check_conditions(joint, zone, moved):
    """Check the conditions of a zone: p >= 0, G >= 0, p G = 0; no gap where it is held; zero where it is not paired."""
    on = zone.status != UNPAIRED
    assert (zone.pressure[~on] == 0).all() and np.isnan(zone.gap[~on]).all()
    p, g = zone.pressure[on], zone.gap[on]
    if not joint.one_sided:
        assert np.abs(g).max(initial=0.0) <= 10 * TOLERANCE * moved and (zone.status[on] == CONTACT).all()
        return
    assert p.min(initial=0.0) >= 0
    assert g.min(initial=0.0) >= -10 * TOLERANCE * moved
    assert np.abs(g[p > 0]).max(initial=0.0) <= 10 * TOLERANCE * moved


def places(problem, state, group=None):
    """Deformed positions (n, dim) of nodes (of a group)."""
    d = problem.space.dim
    x = problem.space.mesh.points[:, :d] + state.u.reshape(-1, d)
    return x if group is None else x[nodes_of(problem, group)]


# ---- bodies


def waves(slave, master, dim, *, gap=0.0, size=0.1, counts=(3, 4), margin=0.15, skew=0.1):
    """Two blocks that wave, from x = 1 on; the slave, below, stops short of its master's rim by `margin`."""
    mesh = stack(slave, master, dim, counts=counts, gap=gap, skew=skew)
    x, up = mesh.points.copy(), dim - 1
    low = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["lower"])]))
    x[low, :up] = 0.5 + (1 - 2 * margin) * (x[low, :up] - 0.5)
    x[:, up] += size * np.sin(2.1 * x[:, :up].sum(axis=1))
    x[:, 0] += 1.0
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=dim)
