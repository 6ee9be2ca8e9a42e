"""Natural modes of a problem: free vibration about its undeformed bodies, or about a state.

    K q + C^T p = omega^2 M q,    C q = 0

C has the rows of ties and of contacts that stay closed. Rigid-body modes are not sought: they are the motions that
supports, springs and these rows leave free.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError, LacmeshWarning, RequestError
from lacmesh.mesh import Floats, MeshLike
from lacsolver.case import Case, Dynamics, as_case
from lacsolver.doubts.rules import Doubts
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.linear import SingularError, choose
from lacsolver.problem.inertia import Inertia
from lacsolver.problem.problem import Problem
from lacsolver.problem.rigid_modes import describe
from lacsolver.problem.skin import mesh_of
from lacsolver.results.modes import NaturalModes
from lacsolver.results.results import Restart
from lacsolver.saddle.stiffness import FactorCache, Stiffness
from lacsolver.space.space import Space
from lacsolver.vibration.eigenmodes import EigenProblem, orthonormal
from lacsolver.vibration.linearised import LinearisedProblem


def natural_modes(
    case: Case | str | Path | Problem,
    mesh: MeshLike | None = None,
    *,
    count: int = 10,
    at: Restart | None = None,
    mass: str = "consistent",
) -> NaturalModes:
    """Return the rigid-body modes of a case, and the `count` lowest others, or all if there are fewer.

    `case`, `mesh`: as for `lacsolver.solve`; a problem takes the place of both. `at`: a state of the same problem,
    whose closed contact rows stay closed, and whose tangent is taken; else the undeformed bodies with open contacts.
    Prescribed displacements, ties and bilateral contacts are held. `mass`: `consistent` or `lumped` mass matrix.

    Raises the errors of `lacsolver.assemble`; DataError for cells without density, and if nothing can vibrate;
    CaseError for a rigid body that moves freely and has no mass; SingularError if a part of a body can move without
    force, or the state is not stable; RequestError for several processes and for a solver without a factorisation;
    LinearError if the iteration does not converge.

    >>> from lacsolver import parse_case
    >>> from lacmesh import Mesh
    >>> text = 'mesh = "bar.msh"\\nmodel = "plane_stress"\\n'
    >>> text += "[[material]]\\nyoung = 4.0\\npoisson = 0.0\\ndensity = 1.0\\n"
    >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> modes = natural_modes(parse_case(text), square)
    >>> modes.rigid[0], len(modes.rigid), len(modes.frequencies), round(modes.mass, 12)
    ('the body moves along x', 3, 5, 1.0)
    """
    if count < 1:
        raise RequestError(f"the number of modes is 1 or more, not {count}")
    if isinstance(case, Problem) and mesh is not None:
        raise RequestError("a problem has its mesh; give the number of modes by its name, count=")
    problem = case if isinstance(case, Problem) else _problem(as_case(case), mesh)
    _check_alone(problem)
    Doubts(problem).ask("matrices")
    model = ReducedProblem(problem)
    lin = LinearisedProblem.of(model, at)
    inertia = _inertia(problem, mass)
    M_q = inertia.reduced(inertia.M, lin.q, lin.t)
    system = EigenProblem(lin.K, M_q, lin.C, orthonormal(lin.R, M_q))
    if system.count < 1:
        raise DataError("nothing can vibrate: all displacements are prescribed, or those of rigid bodies")
    omega2, Q = system.lowest(count, _factor(lin, system))
    along, alike = _translations(inertia, np.eye(problem.space.dim)), _alike(problem.case)
    toward = np.asarray(inertia.tangent(lin.q, lin.t).T @ (inertia.M @ _translations(inertia, alike)))
    whole = np.sum(along * (inertia.M @ along), axis=0)
    shapes, modal, effective = _told(lin, Q, toward)
    rigid_shapes, _, rigid_effective = _told(lin, system.R, toward)
    return NaturalModes(
        np.sqrt(omega2) / (2 * np.pi), shapes, modal, effective,
        tuple(describe(motion) for motion in lin.rigid), rigid_shapes, rigid_effective.sum(axis=0),
        _axes(problem.space), float(whole[0]), problem.constraints.n_q, lin.held, None if at is None else at.time,
        _sectors(problem.case),
    )  # fmt: skip


def _problem(case: Case, mesh: MeshLike | None) -> Problem:
    return Problem.of(case, mesh_of(case, mesh))


def _check_alone(problem: Problem) -> None:
    """Raise RequestError for several processes, and for a linear solver without a factorisation."""
    solver = problem.case.solver
    if problem.space.share.size > 1 or solver.engine_for(1) != "serial":
        raise RequestError('natural modes are found by one process, not with PETSc; take [solver] engine = "serial"')
    if solver.backend == "multigrid":
        raise RequestError('natural modes need a factorisation; take [solver] backend = "auto" in place of "multigrid"')


def _axes(space: Space) -> str:
    """Return the axes along which the whole model can be moved."""
    return "y" if space.model.axisymmetric else "xyz"[: space.dim]


def _inertia(problem: Problem, mass: str) -> Inertia:
    """Return the inertia of a problem, with the mass of all nodes in its place. Raises DataError, CaseError."""
    how, finite = Dynamics(massless="none", mass=mass), problem.case.kinematics == "finite"
    return Inertia.of(problem.space, problem.materials, problem.constraints, (), how, finite)


def _translations(inertia: Inertia, along: Floats) -> NDArray[np.floating]:
    """Return the displacements (n_w, axes) of nodes and points if all move by `along` (dim, dim) for each axis."""
    space = inertia.space
    chosen = ["xyz".index(axis) for axis in _axes(space)]
    return np.tile(along[:, chosen], (inertia.M.shape[0] // space.dim, 1))


def _alike(case: Case) -> NDArray[np.floating]:
    """Return the mean motion (dim, dim) of all sectors of a case if one moves by 1 along each axis: that along theirs.

    Sectors that move alike move in directions that turn with them, and their motions across the axis add up to zero.
    """
    dim, out = 3 if case.model == "3d" else 2, np.eye(3)
    for record in case.cyclic:
        axis = np.array(record.axis) / np.linalg.norm(record.axis)
        out = np.outer(axis, axis @ out)
    return out[:dim, :dim]


def _sectors(case: Case) -> int:
    """Return the number of sectors of a case, 0 without; warn that modes with nodal diameters are left out."""
    number = max((record.sectors for record in case.cyclic), default=0)
    if number:
        message = f"modes of a sector are those in which all {number} sectors move alike, without nodal diameters; the"
        message += f" modes with 1 to {number // 2} of them, often the lowest of a ring, are left out: model the whole"
        warnings.warn(LacmeshWarning(f"{message} ring for these"), stacklevel=3)
    return number


def _told(
    lin: LinearisedProblem, Q: Floats, toward: Floats
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Return shapes (k, n_nodes, dim) with a largest displacement of 1, modal masses and effective masses (k, axes).

    `Q` (n_q, k): modes with Q^T M Q = 1; `toward` (n_q, axes): T^T M times unit displacements of the whole model.
    """
    space = lin.model.problem.space
    shapes = np.asarray(lin.T @ Q).T.reshape(Q.shape[1], space.mesh.n_nodes, space.dim)
    scale = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0.0)
    flat = shapes.reshape(len(shapes), space.n_dof)
    scale = scale * np.sign(np.take_along_axis(flat, np.abs(flat).argmax(axis=1)[:, None], axis=1)[:, 0])
    return shapes / scale[:, None, None], 1 / scale**2, np.square(Q.T @ toward)


def _factor(lin: LinearisedProblem, system: EigenProblem) -> Stiffness:
    """Return the factor of the regularised stiffness. Raises SingularError, in terms of the mesh."""
    problem = lin.model.problem
    backend = choose(problem.case.solver.backend, system.K.shape[0]).name
    try:
        return FactorCache(np.linalg.qr(system.R)[0], backend, problem.threads).factorise(system.regular)
    except SingularError as error:
        if lin.about_state and error.mode is None:
            message = "the tangent stiffness of the state is not positive definite, so that the state is not stable"
            raise SingularError(f"{message}; take another time, by --from", error.dof) from error
        raise lin.model.explained(error) from error
