"""Cases of every kind solved by several processes, compared with one: a program for `mpiexec`.

Arguments: a backend, and names of the cases in tests/lacsolver/invariant_cases.py. Rank 0 prints a line of JSON each.
"""

from __future__ import annotations

import json
import sys

import numpy as np

from lacsolver.case import parse_case
from lacsolver.distributed.launch import import_mpi, import_petsc
from lacsolver.distributed.processes import Processes
from lacsolver.problem.problem import Problem
from lacsolver.results.answer import Answer
from lacsolver.solve.stepping import march
from tests.lacsolver.invariant_cases import CASES, text_of


def main():
    """Compare the cases."""
    backend, *names = sys.argv[1:]
    import_petsc()
    comm = import_mpi().COMM_WORLD
    for name in names:
        told = compared(CASES[name], backend, comm)
        if comm.rank == 0:
            print(json.dumps({"name": name, **told}), flush=True)


def compared(case, backend, comm):
    """Worst relative differences from one process, over all steps."""
    text, mesh = text_of(case, case.world), case.mesh()
    alone = list(march(Problem.of(parse_case(text), mesh)))
    several = parse_case(text.replace("[solver]", f'[solver]\nbackend = "{backend}"', 1))
    problem = Problem.of(several, mesh, Processes(comm))
    answer, whole_answer = Answer(problem), Answer(Problem.of(parse_case(text), mesh))
    worst = {"u": 0.0, "p": 0.0, "reaction": 0.0, "energy": 0.0, "sets": True}
    for one, other in zip(march(problem), alone, strict=True):
        for key, field in (("u", "u"), ("reaction", "reaction")):
            worst[key] = max(worst[key], difference(whole(problem.space, getattr(one, field)), getattr(other, field)))
        energy = (made.figures(state).energy for made, state in ((answer, one), (whole_answer, other)))
        worst["energy"] = max(worst["energy"], difference(*map(np.float64, energy)))
        for zone, expected in zip(one.zones, other.zones, strict=True):
            worst["p"] = max(worst["p"], difference(zone.pressure, expected.pressure))
            worst["sets"] &= bool((zone.status == expected.status).all())
    return worst


def whole(space, values):
    """Values (n_dof,) at all nodes of the model, from those that each process owns."""
    order = np.argsort(space.share.gather(space.share.node[space.share.own]))
    return space.share.gather(space.own(values))[order].ravel()


def difference(values, expected):
    """Largest difference, relative to the largest value."""
    return float(np.abs(values - expected).max() / np.abs(expected).max())


if __name__ == "__main__":
    main()
