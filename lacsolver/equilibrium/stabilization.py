"""Stabilisation of rigid-body modes that only contact or soft springs resist, which static equilibrium needs.

Modes without energy in any configuration are in the null space of K_q: springs at as many unknowns make its factor
definite, and the contact loop ensures that they carry no force (`stiffness`). Rotations, for which the geometric
stiffness has either sign, and motions on soft springs are stabilised by springs that are added to K and subtracted
again as a part of the geometric stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from lacmesh.mesh import Floats
from lacsolver.constraints import Constraints
from lacsolver.linear import Matrix
from lacsolver.linear.vectors import WHOLE, Vectors, products
from lacsolver.problem.problem import Problem
from lacsolver.problem.rigid_modes import FreeMotion, free_motions
from lacsolver.saddle.stiffness import leading_unknowns
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse

#: springs are soft if they resist a rigid-body motion by less than this fraction of the bodies' own stiffness
_SOFT = 1e-4
#: largest number of rigid-body motions for which those on soft springs are sought: they are stored densely, and the
#: iterations converge without them
_MANY = 300
#: a unit motion is independent of others if its part orthogonal to them is larger than this
_ANOTHER = 1e-6


class Stabilization(NamedTuple):
    """Rigid-body modes of a problem on its unknowns q.

    `free` (n_q, r): orthonormal modes that cost little energy; `R` (n_q, k): the first of them, which never cost any.
    `springs` (n_q, n_q): stiffness that stabilises the others, None if there are none.
    """

    free: NDArray[np.floating]
    R: NDArray[np.floating]
    springs: csr_array | None

    @classmethod
    def none(cls, n_q: int) -> Stabilization:
        """Return the stabilisation of a problem in which nothing needs it."""
        return cls(np.zeros((n_q, 0)), np.zeros((n_q, 0)), None)

    @classmethod
    def of(
        cls, problem: Problem, motions: Sequence[FreeMotion], K: Matrix, linear: bool, vectors: Vectors = WHOLE
    ) -> Stabilization:
        """Return the stabilisation of `motions`, rigid-body modes that only contact constrains, and of soft springs.

        K (n_dof, n_dof): stiffness of the undeformed bodies. In a problem that is not `linear`, only translations are
        without energy in any configuration.
        """
        always = [m for m in motions if linear or not m.twists[:, 3:].any()]
        others = [m for m in motions if not linear and m.twists[:, 3:].any()]
        free = _orthonormal(problem.constraints, [*always, *others], vectors)
        free = np.concatenate([free, _soft(problem, K, free, vectors)], axis=1)
        R = free[:, : len(always)]
        size = problem.space.mean(np.abs(K.diagonal())) or 1.0
        return cls(free, R, _springs(R, free[:, R.shape[1] :], size, problem.constraints))


def _orthonormal(
    constraints: Constraints, motions: Sequence[FreeMotion], vectors: Vectors = WHOLE
) -> NDArray[np.floating]:
    """Return orthonormal columns (n_q, k) with the span of motions, by Cholesky's factor of their products, twice."""
    if not motions:
        return np.zeros((constraints.n_q, 0))
    columns = np.stack([constraints.unknowns(motion.field) for motion in motions], axis=1)
    for _ in range(2):
        upper = np.linalg.cholesky(products(vectors, columns, columns)).T
        columns = np.linalg.solve(upper.T, columns.T).T
    return columns


def _soft(problem: Problem, K: Matrix, free: Floats, vectors: Vectors) -> NDArray[np.floating]:
    """Return orthonormal motions (n_q, k) on soft springs alone, orthogonal to the `free` ones (n_q, r)."""
    motions = () if problem.springs is None else free_motions(problem.space, problem.constraints)
    if not 0 < len(motions) <= _MANY:
        return free[:, :0]
    modes = _orthonormal(problem.constraints, motions, vectors)
    modes = modes - free @ products(vectors, free, modes)
    square, turn = np.linalg.eigh(products(vectors, modes, modes))
    new = square > _ANOTHER**2
    modes = modes @ (turn[:, new] / np.sqrt(square[new]))
    if not modes.shape[1]:
        return modes
    space, moved = problem.space, problem.constraints.T @ modes
    energy, axes = np.linalg.eigh(_products(space, moved, problem.springs @ moved))
    stiff = K.diagonal()
    stiff = np.where(stiff > 0, stiff, space.mean(stiff))  # the mean for rigid bodies without cells
    return (modes @ axes)[:, energy < _SOFT * _products(space, stiff[:, None], np.square(moved @ axes))[0]]


def _products(space: Space, A: Floats, B: Floats) -> NDArray[np.floating]:
    """Return A^T B (k, j) of displacements A (n_dof, k) and B (n_dof, j), over the nodes of all processes."""
    own_A, own_B = (space.own(C).reshape(-1, C.shape[1]) for C in (A, B))
    return space.share.total(own_A.T @ own_B)


def _springs(R: Floats, soft: Floats, size: float, constraints: Constraints) -> csr_array | None:
    """Return springs (n_q, n_q) against modes `soft` (n_q, k), on differences of unknowns that R leaves unchanged.

    `size`: their stiffness. Several processes take unknowns that all have, and each has its own rows.
    """
    if not soft.shape[1]:
        return None
    among, own = constraints.common, constraints.own
    leading = leading_unknowns(R, among)
    if len(leading):
        soft = soft - R @ np.linalg.solve(R[leading], soft[leading])
    other = leading_unknowns(soft, among)
    w = sparse(soft.shape, (other, np.arange(len(other)), 1.0))
    if len(leading):
        part = np.linalg.solve(R[leading].T, R[other].T)
        w = csr_array(w - sparse(soft.shape, (leading[:, None], np.arange(len(other)), part)))
    springs = csr_array(size * (w @ w.T))
    return springs if own is None else csr_array(diags_array(own.astype(float)) @ springs)
