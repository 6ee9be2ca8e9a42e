"""Cases of every kind solved by several processes, compared with one: a program for `mpiexec`.

Its argument is JSON: rows [ranks, backend, names], whose ranks solve the cases of these names with that backend one
after the other, beside the other rows. The names are of tests/lacsolver/invariant_cases.py, `moving_cases`,
`friction_cases`, `plastic_cases`, `soft_cases` and `joined_cases`. The first of the ranks prints a line of JSON each.
"""

from __future__ import annotations

import json
import time
from typing import Any, NamedTuple

import numpy as np

from lacsolver.case import parse_case
from lacsolver.distributed.launch import import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.first_look import doubts
from lacsolver.problem.problem import Problem
from lacsolver.results.figures import step_figures
from tests.lacsolver.distributed import friction_cases, joined_cases, moving_cases, plastic_cases, soft_cases
from tests.lacsolver.invariant_cases import CASES, text_of


class Solved(NamedTuple):
    """The solution of a case by one process: its states, their figures, and the doubts about it."""

    states: list[Any]
    figures: list[Any]
    doubts: Any


def main(world, rows):
    """Solve each case in one process, the cases shared out; then compare what is found by the ranks of each row."""
    import_petsc()
    rows = json.loads(rows)
    every = list(dict.fromkeys(name for _, _, names in rows for name in names))
    own = {name: in_one_process(name) for name in every[world.rank :: world.size]}
    wait(world)
    alone = {name: solved for part in world.allgather(own) for name, solved in part.items()}
    groups = [ranks for ranks in dict.fromkeys(tuple(ranks) for ranks, _, _ in rows) if world.rank in ranks]
    together = {ranks: world.Create_group(world.group.Incl(ranks)) for ranks in groups}
    for ranks, backend, names in rows:
        if world.rank not in ranks:
            continue
        comm = together[tuple(ranks)]
        wait(comm)
        for name in names:
            differences = compared(name, backend, comm, alone[name])
            if comm.rank == 0:
                row = {"n": comm.size, "backend": backend, "name": name, **differences}
                print(json.dumps(row), flush=True)
    wait(world)


def wait(comm):
    """Wait for the other processes, and leave the processor to them."""
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(0.02)


def problem_of(name):
    """The text of a case, with a section [solver], and its mesh."""
    if name in CASES:
        case = CASES[name]
        return text_of(case, case.world), case.mesh()
    others = (moving_cases, friction_cases, plastic_cases, soft_cases, joined_cases)
    text, mesh = {**moving_cases.RIGID, **{k: v for one in others for k, v in one.CASES.items()}}[name]
    return text + "[solver]\nthreads = 1\n" + joined_cases.SOLVER.get(name, ""), mesh()


def in_one_process(name):
    """The solution of a case by this process alone."""
    text, mesh = problem_of(name)
    problem = Problem.of(parse_case(text), mesh)
    states = list(march(problem))
    figures = [step_figures(problem, state) for state in states]
    return Solved(states, figures, None if problem.inertia is None else doubts(problem))


def compared(name, backend, comm, alone):
    """Worst relative differences from one process, over all steps.

    Those of u and p are relative to the largest of their step, those of what may vanish in flight to that of all steps.
    """
    text, mesh = problem_of(name)
    several = parse_case(text.replace("[solver]", f'[solver]\nbackend = "{backend}"', 1))
    problem = Problem.of(several, mesh, Processes(comm))
    worst, sizes = {"u": 0.0, "p": 0.0, "sets": True, "closed": 0, "sliding": 0}, {}

    def add(key, value, expected, least=0.0):
        far, size = np.abs(value - expected).max(initial=0.0), max(np.abs(expected).max(initial=0.0), least)
        if key in worst:
            worst[key] = max(worst[key], float(far / size) if far else 0.0)
        else:
            before = sizes.get(key, (0.0, 0.0))
            sizes[key] = max(before[0], float(far)), max(before[1], float(size))

    for one, other, of_other in zip(march(problem), alone.states, alone.figures, strict=True):
        add("u", whole(problem.space, one.u), other.u)
        pushed = max((np.abs(zone.force).max() for zone in other.zones), default=0.0)
        add("reaction", whole(problem.space, one.reaction), other.reaction, pushed)
        figures = step_figures(problem, one), of_other
        add("energy", *(np.float64(found.energy) for found in figures))
        for zone, expected in zip(one.zones, other.zones, strict=True):
            add("p", zone.pressure, expected.pressure)
            worst["sets"] &= bool((zone.status == expected.status).all())
            worst["closed"] = max(worst["closed"], int((zone.status == 1).sum()))
            worst["sliding"] = max(worst["sliding"], int((zone.status == 2).sum()))
            if expected.friction is not None:
                for key in ("shear", "slip", "path", "dissipation", "resultant"):
                    add(key, getattr(zone.friction, key), getattr(expected.friction, key))
        for key in ("pretension", "couplings", "equations"):
            values = [joint_numbers(getattr(of, key)) for of in figures]
            if len(values[0]):
                add(key, *values)
        if other.step.work is not None:
            add("work", np.array(one.step.work), np.array(other.step.work))
        if figures[1].plastic is not None:
            add("flow", *(np.array([*of.plastic[:2], *of.plastic[2]]) for of in figures))
        if other.step.motion is not None:
            compare_motions(add, problem.space, one.step.motion, other.step.motion)
            probes = [np.concatenate([*found.motion.velocities.values()]) for found in figures]
            add("probes", *probes)
    worst |= {key: far / size if far else 0.0 for key, (far, size) in sizes.items()}
    if problem.inertia is not None:
        worst["told"] = doubts(problem) == alone.doubts
    return worst


def joint_numbers(records):
    """All numbers of the figures of bolts, couplings or equations."""
    parts = [
        np.ravel(part) for record in records.values() for part in (record if isinstance(record, tuple) else [record])
    ]
    return np.concatenate([np.empty(0), *parts])


def compare_motions(add, space, one, other):
    """Add the differences of a motion."""
    n = space.n_dof
    for key in ("velocity", "acceleration"):
        values = getattr(other, key)
        add(key, whole(space, getattr(one, key)[:n]), values[: len(values) - len(getattr(one, key)) + n])
    for key in ("energies", "impulse", "linear", "angular"):
        add(key, getattr(one, key), getattr(other, key))


def whole(space, values):
    """Values (n_dof,) at all nodes of the model, from those that each process owns."""
    order = np.argsort(space.share.gather(space.share.node[space.share.own]))
    return space.share.gather(space.own(values))[order].ravel()


if __name__ == "__main__":
    main()
