"""Rows of K, B, D and G of several processes against those of one: a program for `test_rows`.

It is started once, in as many processes as the largest number; smaller numbers are those first in rank.
"""

from __future__ import annotations

import json
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from lacmesh import kernels
from lacsolver.case import parse_case
from lacsolver.distributed.processes import Processes
from lacsolver.problem.problem import Problem
from lacsolver.saddle.contact_system import contact_system
from tests.lacsolver.invariant_cases import CASES, text_of


def main(world, *arguments):
    """Print a line of JSON for each number of processes and case: how many rows of each matrix differ."""
    kernels.KEPT_FROM = kernels.COMPILED_FROM = 0  # plain ones, of less work, round otherwise
    numbers, names = map(json.loads, arguments)
    for n in numbers:
        comm = world.Split(int(world.rank < n), world.rank)
        for name in names if world.rank < n else []:
            told = differing(name, comm)
            if world.rank == 0:
                print(json.dumps({"n": n, "name": name, **told}), flush=True)
        comm.Free()


def differing(name, comm):
    """Rows of each matrix that are not those of one process, and the rows that were compared, over all processes."""
    case = CASES[name]
    parsed, mesh = parse_case(text_of(case, case.world)), case.mesh()
    whole = comm.bcast(of_one_process(name) if comm.rank == 0 else None)
    own = matrices(Problem.of(parsed, mesh, Processes(comm)))
    told = {}
    for key, rows in own.items():
        wrong = sum(not agree(rows[k], whole[key].get(k)) for k in rows)
        told[key] = [int(comm.allreduce(wrong)), int(comm.allreduce(len(rows)))]
    return told | {"rows": {key: len(rows) for key, rows in whole.items()}}


@cache
def of_one_process(name):
    """The rows of each matrix of a case in one process."""
    case = CASES[name]
    return matrices(Problem.of(parse_case(text_of(case, case.world)), case.mesh()))


def matrices(problem):
    """The rows of each matrix that are complete on this process: index in the whole model -> columns and values."""
    space, case = problem.space, problem.case
    u = deformed(space)
    node = np.arange(space.mesh.n_nodes) if space.share.node is None else space.share.node
    dofs = (space.dim * node[:, None].astype(np.int64) + np.arange(space.dim)).ravel()
    own = np.ones(len(node), bool) if space.share.own is None else space.share.own
    faces = tuple(pair.integrate(space, u, case.steps.last) for pair in problem.joints)
    contact = contact_system(problem, faces, u)
    K = csr_array(problem.kinematics.tangent(u, case.steps.last))
    mine = np.flatnonzero(np.repeat(own, space.dim))
    told = {"K": dict(zip(dofs[mine].tolist(), columns_and_values(K[mine], dofs), strict=True))}
    for key, matrix in (("B", contact.rows.B), ("D", contact.rows.D)):
        told[key] = dict(enumerate(columns_and_values(matrix, dofs)))
    return told | {"G": {k: (np.zeros(1, int), np.array([value])) for k, value in enumerate(contact.G)}}


def deformed(space):
    """Displacements (n_dof,) that are products of coordinates, rounded alike wherever a node stands in an array."""
    x = space.mesh.points
    u = np.zeros((len(x), space.dim))
    for k in range(space.dim):
        u[:, k] = 1e-2 * x[:, k] * x[:, (k + 1) % space.dim]
    u[:, -1] -= 2e-2 * x[:, space.dim - 1]
    return u.ravel()


def agree(one, other):
    """True for the same columns, and values that agree to round-off of a row whose terms are of size 1 or less."""
    if other is None or not np.array_equal(one[0], other[0]):
        return False
    return bool(np.abs(one[1] - other[1]).max(initial=0.0) <= 1e-13 * max(1.0, np.abs(other[1]).max(initial=0.0)))


def columns_and_values(A, dofs):
    """Columns in the whole model and values of each row of a sparse matrix."""
    A = A.tocsr()
    A.sort_indices()
    ends = A.indptr.tolist()
    columns = dofs[A.indices]
    return [(columns[i:j], A.data[i:j]) for i, j in pairwise(ends)]


if __name__ == "__main__":
    main()
