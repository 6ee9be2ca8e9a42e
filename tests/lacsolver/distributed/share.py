"""Figures of the share of one of several processes, for `test_share`."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array

from lacsolver.bodies.mass import assemble_mass
from lacsolver.bodies.material import Materials
from lacsolver.case import read_case
from lacsolver.distributed.processes import Processes
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.problem.problem import Problem
from lacsolver.problem.skin import prepared
from lacsolver.saddle.shared_stiffness import SharedFactors, _own_rows
from tests.lacsolver.distributed.mpi import ROOT


def main(comm):
    """Print the figures of each process."""
    for one in comm.gather(found(comm)) or ():
        print(json.dumps(one))


def found(comm):
    """Largest values of all processes, and the rows of this one made in both ways."""
    case = read_case(ROOT / "data" / "two_blocks.toml")
    problem = Problem.of(case, prepared(case), Processes(comm))
    space, constraints, share = problem.space, problem.constraints, problem.space.share
    own, K = space.dofs(np.flatnonzero(share.own)).ravel(), ReducedProblem(problem).K_q
    assert constraints.is_selection
    placed = _own_rows(K, constraints, own)
    vars(constraints)["is_selection"] = False
    product = _own_rows(K, constraints, own)
    laws = tuple(replace(law, density=2.0) for law in problem.materials.laws)
    M = assemble_mass(space, Materials(space.model, laws, problem.materials.law))
    return {
        "mass": float(share.total(np.array(M[own].sum()))),
        "largest": share.largest(float(share.rank)),
        "least": share.largest(-1.0 - share.rank),
        "nan": math.isnan(share.largest(math.nan if share.rank else 1.0)),
        "infinite": share.largest(math.inf if share.rank else 1.0) == math.inf,
        "own": len(own),
        "n_dof": space.dim * share.part.n_nodes,
        "difference": float(abs(placed - product).max()),
        "cycles": cycles(problem),
        "kinds": kinds(problem),
    }


def cycles(problem):
    """Energy of an error after a V-cycle, without and with rows of contact, and the symmetry."""
    model, constraints = ReducedProblem(problem), problem.constraints
    K = SharedFactors(np.zeros((constraints.n_q, 0)), "multigrid", constraints, model.vectors).factorise(model.K_q)
    B = LoadStep(model, 1.0).contact(np.zeros(constraints.n_q)).rows.B
    weights = np.full(B.shape[0], float(K.scaling.max()) / float(abs(B).max()) ** 2)
    rows = K.cycle_with_rows(B, weights)
    unknown = problem.space.dofs(problem.space.share.node).ravel()  # of the whole model
    x, y = (constraints.T.T @ np.sin(rate * unknown) for rate in (1.0, 2.0))
    alone = quality(K, lambda q: K.apply(q), K.cycle, x, y)
    return {"alone": alone, "with rows": quality(K, lambda q: K.apply(q) + B.T @ (weights * (B @ q)), rows, x, y)}


def quality(K, A, cycle, x, y):
    """The energy of x - cycle(A x) over that of x, and the difference of y cycle(x) and x cycle(y)."""

    def dot(a, b):
        return K.vectors.dots(a[None], b)[0]

    left = x - cycle(A(x))
    one, other = dot(y, cycle(x)), dot(x, cycle(y))
    return float(dot(left, A(left)) / dot(x, A(x))), float(abs(one - other) / abs(one))


def kinds(problem):
    """PETSc's name of each preconditioner, one set up after the other in the same process."""
    from lacsolver.distributed.launch import import_petsc
    from lacsolver.linear.petsc import petsc_matrix, set_up

    petsc, share = import_petsc(), problem.space.share
    own = problem.space.dofs(np.flatnonzero(share.own)).ravel()
    one = csr_array((np.ones(len(own)), (np.arange(len(own)), own)), shape=(len(own), problem.space.n_dof))
    number = problem.space.dofs(share.number).ravel()
    modes = np.tile(np.eye(problem.space.dim), (len(own) // problem.space.dim, 1))
    return [
        set_up(petsc, petsc_matrix(petsc, share.mpi, one, number, problem.space.dim), modes, backend).getType()
        for backend in ("gamg", "hypre", "mumps", "gamg")
    ]
