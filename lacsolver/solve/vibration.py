"""Natural modes of a problem: free vibration about its undeformed bodies, or about a state.

    K q + C^T p = omega^2 M q,    C q = 0

C has the rows of ties and of contacts that stay closed. The rigid-body modes R are known beforehand: K R = 0, C R = 0.
The others are found by Lanczos' iteration (ARPACK, through `scipy.sparse.linalg.eigsh`) with the inverse of K among
the motions that C and R leave,

    f -> P (x - A^-1 C^T S^-1 C x),    x = A^-1 P^T f,    A = K + C^T C,    S = C A^-1 C^T,    P = 1 - R R^T M

for R^T M R = 1. A is factorised by the case's linear solver; along R it is regularised by springs, which carry no force
(`FactorCache`). Since there is no shift, the lowest frequencies are found to full accuracy. Models of few unknowns are
solved with dense matrices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats
from lacsolver.bodies.mass import assemble_mass
from lacsolver.linear import LinearError, SingularError, choose
from lacsolver.problem.problem import Problem
from lacsolver.problem.rigid_modes import describe
from lacsolver.results.modes import NaturalModes
from lacsolver.results.results import Restart
from lacsolver.solve.linearised import LinearisedProblem
from lacsolver.solve.reduced import ReducedProblem
from lacsolver.solve.stabilization import unknowns
from lacsolver.solve.stiffness import FactorCache, Stiffness
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: up to this number of unknowns matrices are dense
_DENSE = 300
#: columns solved together
_TOGETHER = 64


def natural_modes(
    problem: Problem, count: int = 10, *, at: Restart | None = None, mass: str = "consistent"
) -> NaturalModes:
    """Return the rigid-body modes of a problem, and the `count` lowest others, or all if there are fewer.

    `at`: a state of the same problem, whose closed contact rows stay closed, and whose tangent is taken; else the
    undeformed bodies with open contacts. Prescribed displacements, ties and bilateral contacts are held. `mass`:
    `consistent` or `lumped` mass matrix.

    Raises DataError for cells without density, and if nothing can vibrate; CaseError for a rigid body that moves freely
    and has no mass; SingularError if a part of a body can move without force, or the state is not stable; RequestError
    for several processes and for a solver without a factorisation; LinearError if the iteration does not converge.

    >>> from lacsolver import parse_case
    >>> from lacmesh import Mesh
    >>> text = 'mesh = "bar.msh"\\nmodel = "plane_stress"\\n'
    >>> text += "[[material]]\\nyoung = 4.0\\npoisson = 0.0\\ndensity = 1.0\\n"
    >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> modes = natural_modes(Problem.of(parse_case(text), square))
    >>> modes.rigid[0], len(modes.rigid), len(modes.frequencies), round(modes.mass, 12)
    ('the body of node 1 moves along x', 3, 5, 1.0)
    """
    if count < 1:
        raise RequestError(f"the number of modes is 1 or more, not {count}")
    _check_alone(problem)
    model = ReducedProblem(problem)
    lin = LinearisedProblem.of(model, at)
    M = assemble_mass(problem.space, problem.materials, mass)
    system = _System.of(lin, model.reduced(M, lin.T))
    omega2, Q = system.lowest(count)
    along = _translations(problem.space)
    toward = np.asarray(lin.T.T @ (M @ along))
    whole = np.sum(along * (M @ along), axis=0)
    shapes, modal, effective = _told(lin, system.M, Q, toward)
    rigid_shapes, _, rigid_effective = _told(lin, system.M, system.R, toward)
    return NaturalModes(
        np.sqrt(omega2) / (2 * np.pi), shapes, modal, effective,
        tuple(describe(motion) for motion in lin.rigid), rigid_shapes, rigid_effective.sum(axis=0),
        _axes(problem.space), float(whole[0]), problem.constraints.n_q, lin.held, None if at is None else at.time,
    )  # fmt: skip


def _check_alone(problem: Problem) -> None:
    """Raise RequestError for several processes, and for a linear solver without a factorisation."""
    solver = problem.case.solver
    if problem.space.share.n > 1 or solver.engine_for(1) != "serial":
        raise RequestError('natural modes are found by one process, not with PETSc; take [solver] engine = "serial"')
    if solver.backend == "multigrid":
        raise RequestError('natural modes need a factorisation; take [solver] backend = "auto" in place of "multigrid"')


def _axes(space: Space) -> str:
    """Return the axes along which the whole model can be moved."""
    return "y" if space.model.axisymmetric else "xyz"[: space.dim]


def _translations(space: Space) -> NDArray[np.floating]:
    """Return the unit displacements (n_dof, axes) of the whole model along its axes."""
    chosen = ["xyz".index(axis) for axis in _axes(space)]
    return np.tile(np.eye(space.dim)[:, chosen], (space.mesh.n_nodes, 1))


def _told(
    lin: LinearisedProblem, M: csr_array, Q: Floats, toward: Floats
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]:
    """Return shapes (k, n_nodes, dim) with a largest displacement of 1, modal masses and effective masses (k, axes).

    `Q` (n_q, k): modes; `toward` (n_q, axes): T^T M times unit displacements of the whole model.
    """
    space = lin.model.problem.space
    shapes = np.asarray(lin.T @ Q).T.reshape(Q.shape[1], space.mesh.n_nodes, space.dim)
    scale = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0.0)
    flat = shapes.reshape(len(shapes), space.n_dof)
    scale = scale * np.sign(np.take_along_axis(flat, np.abs(flat).argmax(axis=1)[:, None], axis=1)[:, 0])
    mass = np.sum(Q * (M @ Q), axis=0)
    return shapes / scale[:, None, None], mass / scale**2, np.square(Q.T @ toward) / mass[:, None]


@dataclass(frozen=True, eq=False)
class _System:
    """The eigenvalue problem on the unknowns: K, M (n, n), closed rows C (m, n), and rigid-body modes R."""

    K: csr_array
    M: csr_array
    C: csr_array
    R: NDArray[np.floating]
    lin: LinearisedProblem

    @classmethod
    def of(cls, lin: LinearisedProblem, M: csr_array) -> _System:
        _check_mass(lin, M)
        constraints = lin.model.problem.constraints
        R = np.zeros((M.shape[0], 0))
        if lin.rigid:
            R = np.stack([unknowns(constraints, motion.field) for motion in lin.rigid], axis=1)
        for _ in range(2):  # the second time for round-off
            R = np.linalg.solve(np.linalg.cholesky(R.T @ (M @ R)), R.T).T if R.size else R
        return cls(lin.K, M, lin.C, R, lin)

    def lowest(self, count: int) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return the lowest omega^2 (k,) of modes beside R, and the modes (n, k)."""
        n = self.K.shape[0]
        there = n - self.C.shape[0] - self.R.shape[1]
        if there < 1:
            raise RequestError("nothing can vibrate: all displacements are prescribed, or those of rigid bodies")
        factor = self._factor()
        dense = n <= _DENSE or 2 * count > there
        Q = self._dense(min(count, there)) if dense else self._sparse(count, factor)
        omega2 = np.sum(Q * (self.K @ Q), axis=0) / np.sum(Q * (self.M @ Q), axis=0)
        order = np.argsort(omega2, kind="stable")
        return omega2[order], Q[:, order]

    def _dense(self, count: int) -> NDArray[np.floating]:
        held = np.concatenate([self.C.toarray(), (self.M @ self.R).T])
        size = np.linalg.norm(held, axis=1, keepdims=True)
        Z = scipy.linalg.null_space(held / np.where(size > 0, size, 1.0)) if len(held) else np.eye(self.K.shape[0])
        last = min(count, Z.shape[1]) - 1
        _, Y = scipy.linalg.eigh(Z.T @ (self.K @ Z), Z.T @ (self.M @ Z), subset_by_index=[0, last])
        return np.asarray(Z @ Y)

    def _sparse(self, count: int, factor: Stiffness) -> NDArray[np.floating]:
        n = self.K.shape[0]
        inverse = LinearOperator((n, n), matvec=self._inverse(factor), dtype=float)
        start = inverse @ np.random.default_rng(1).normal(size=n)
        try:
            _, Q = eigsh(self.K, count, M=self.M, sigma=0.0, OPinv=inverse, v0=start)
        except ArpackNoConvergence as error:
            found = len(error.eigenvalues)
            raise LinearError(f"of {count} modes only {found} converged; ask for fewer or more") from None
        return np.asarray(Q)

    def _factor(self) -> Stiffness:
        """Return the factor of A = K + C^T C. Raises SingularError, in terms of the mesh."""
        problem = self.lin.model.problem
        A = csr_array(self.K + self.C.T @ self.C) if self.C.shape[0] else self.K
        backend = choose(problem.case.solver.backend, A.shape[0]).name
        try:
            return FactorCache(np.linalg.qr(self.R)[0], backend, problem.threads).factorise(A)
        except SingularError as error:
            if self.lin.about_state and error.mode is None:
                message = "the tangent stiffness of the state is not positive definite, so that the state is not stable"
                raise SingularError(f"{message}; take another time, by --from", error.dof) from error
            raise self.lin.model.explained(error) from error

    def _inverse(self, A: Stiffness) -> Callable[[Floats], NDArray[np.floating]]:
        """Return the inverse of K among the motions that C and R leave."""
        C, R, MR = self.C, self.R, self.M @ self.R
        C_T = csr_array(C.T)
        parts = [A.solve(C_T[:, k : k + _TOGETHER].toarray()) for k in range(0, C.shape[0], _TOGETHER)]
        relaxed = _solver(np.concatenate([C @ part for part in parts], axis=1)) if parts else None

        def inverse(f: Floats) -> NDArray[np.floating]:
            x = A.solve(f - MR @ (R.T @ f))
            if relaxed is not None:
                x = x - A.solve(C_T @ relaxed(C @ x))
            return x - R @ (MR.T @ x)

        return inverse


def _solver(S: Floats) -> Callable[[Floats], NDArray[np.floating]]:
    """Return g -> S^-1 g for a symmetric S (m, m), by its pseudo-inverse if rows depend on each other."""
    S = (S + S.T) / 2
    try:
        factor = scipy.linalg.cho_factor(S)
    except np.linalg.LinAlgError:
        inverse = scipy.linalg.pinvh(S, rtol=1e-10)
        return lambda g: np.asarray(inverse @ g)
    return lambda g: np.asarray(scipy.linalg.cho_solve(factor, g))


def _check_mass(lin: LinearisedProblem, M: csr_array) -> None:
    """Raise CaseError for a rigid body that moves freely without any mass."""
    light = M.diagonal() <= 0
    for body in lin.model.problem.constraints.rigid:
        if light[body.columns[body.free]].any():
            message = f"{body.name!r} moves freely and has no mass, so that it has no natural modes"
            raise wrong(body.record, f"{message}; hold it, or name nodes of cells with a density")
