"""Stiffness matrices of bodies, held and free; systems made at random, small, and their plain solutions."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.sparse import block_diag, csr_array

from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.contact.laws import Bilateral, Unilateral
from lacsolver.equilibrium.active_set import active_set_iterates
from lacsolver.equilibrium.newton import newton_iterates
from lacsolver.equilibrium.search import search
from lacsolver.linear import analyse
from lacsolver.saddle.contact_system import ContactSystem, skin_stiffness
from lacsolver.saddle.row_group import RowGroup, Rows
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.stiffness import FactorCache, Stiffness
from lacsolver.space.space import Space
from tests.lacsolver.bodies import cube, mixture, plane_mixture, square

#: name -> mesh, model: plane and solid, linear and quadratic, mixed, axisymmetric
BODIES = {
    "plane": (lambda: square("QUAD8", 5), "plane_strain"),
    "plane mixture": (lambda: plane_mixture("2"), "plane_stress"),
    "axisymmetric": (lambda: square("TRIA6", 5), "axisymmetric"),
    "hexahedra": (lambda: cube("HEXA8", 5), "3d"),
    "tetrahedra": (lambda: cube("TETRA10", 3), "3d"),
    "mixture": (lambda: mixture("2"), "3d"),
}


def stiffness(mesh, model, young=200.0):
    """The space and K of a mesh that nothing holds."""
    space = Space.of(mesh, model)
    return space, assemble_stiffness(space, Materials.of(space, Elastic(young, 0.3)))


def free(name):
    """The space and K of a body that floats (in axisymmetry: along its axis)."""
    mesh, model = BODIES[name]
    return stiffness(mesh(), model)


def held(name, young=200.0):
    """K of a body whose lowest nodes are held, these rows taken out, and the rigid modes on the others."""
    mesh, model = BODIES[name]
    space, K = stiffness(mesh(), model, young)
    kept = above(space)
    return csr_array(K.tocsr()[kept][:, kept]), rigid_modes(space)[kept]


def above(space):
    """(n_dof,): unknowns of nodes that do not lie lowest."""
    height = space.mesh.points[:, space.dim - 1]
    return np.repeat(height > height.min() + 1e-9, space.dim)


def rigid_modes(space):
    """(n_dof, 6) in 3D, (n_dof, 3) in a plane: translations, and rotations about the centre."""
    x = space.mesh.points - space.mesh.points.mean(axis=0)
    turns = [np.cross(axis, x) for axis in np.eye(3)[2 if space.dim == 2 else 0 :]]
    shifts = [np.broadcast_to(axis, x.shape) for axis in np.eye(3)[: space.dim]]
    return np.stack([m[:, : space.dim].ravel() for m in (*shifts, *turns)], axis=1)


def beside(*matrices):
    """One matrix of several bodies that do not touch."""
    return csr_array(block_diag(matrices, format="csr"))


# ---- at random


def factorised(K, R, backend="auto", definite=True):
    """Return a stiffness that is factorised once."""
    return FactorCache(R, backend).factorise(K, definite)


def factorise(K, **options):
    """Return the factor of a matrix that is factorised only once."""
    return analyse(K, **options).factor(K)


class System(NamedTuple):
    """K q + B^T p + C (q - q0) = f, D q = G; `R` (n, r): motions that K does not resist."""

    K: np.ndarray
    B: np.ndarray
    D: np.ndarray
    C: np.ndarray
    w: np.ndarray
    R: np.ndarray
    f: np.ndarray
    G: np.ndarray

    @property
    def held(self) -> Stiffness:
        """K as the solver has it."""
        return factorised(csr_array(self.K), self.R, backend="superlu")

    @property
    def rows(self) -> Rows:
        """B and D as the solver has them."""
        return rows(self.B, self.D, self.w)


class Linearized(NamedTuple):
    """A linearisation as Newton's method needs it, in place of `load_step.Linearization`."""

    r: np.ndarray
    size: float
    contact: ContactSystem
    stiffness: Callable
    geometric_stiffness: Callable
    free: np.ndarray
    terms: Callable | None = None
    change: Callable = lambda K: None

    def modes(self, K):
        return self.free


def system(seed, n=30, m=12, free=0, turning=0.0, same=True):
    """A random one: K like a chain of springs on a grid of two scales, rows of B on a few unknowns each."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n)) * rng.uniform(0.1, 10, n)
    K = root @ root.T / n + 5 * np.eye(n)
    R = np.linalg.qr(rng.normal(size=(n, free)))[0]
    P = np.eye(n) - R @ R.T
    K = P @ K @ P
    K = (K + K.T) / 2
    B = np.where(rng.uniform(size=(m, n)) < 0.3, rng.normal(size=(m, n)), 0.0)
    B[np.arange(m), rng.permutation(n)[:m]] += 2.0
    D = B if same else B * rng.uniform(0.8, 1.2, B.shape)
    C = np.zeros((n, n))
    some = rng.permutation(n)[: n // 4]
    C[np.ix_(some, some)] = turning * rng.normal(size=(len(some), len(some)))
    return System(K, B, D, C, rng.uniform(0.5, 2, m), R, rng.normal(size=n), 0.1 * rng.normal(size=m))


def saddle(s, active, q0):
    """(q, p (m,)) of the whole system, rows `active` held, by dense elimination."""
    n, a = len(s.K), np.asarray(active)
    big = np.block([[s.K + s.C, s.B[a].T], [s.D[a], np.zeros((len(a), len(a)))]])
    found = np.linalg.solve(big, np.concatenate([s.f + s.C @ q0, s.G[a]]))
    p = np.zeros(len(s.B))
    p[a] = found[n:]
    return found[:n], p


def enumerated(s, enforceable, equality):
    """(q, p) of K q = f - B^T p, 0 <= p, G - B q >= 0, p (G - B q) = 0, looked for among all sets of rows."""
    must, may = np.flatnonzero(enforceable & equality), np.flatnonzero(enforceable & ~equality)
    for k in range(len(may) + 1):
        for chosen in itertools.combinations(may, k):
            active = np.sort(np.concatenate([must, chosen]).astype(int))
            if np.linalg.matrix_rank(s.B[active] @ s.R) < s.R.shape[1]:
                continue  # a body is free to move
            q, p = saddle(s, active, np.zeros(len(s.K)))
            gap = s.G - s.B @ q
            if (p[may] >= -1e-12).all() and (gap[may] >= -1e-12).all():
                return q, p
    return None


def rows(B, D, w):
    """Return contact rows of dense matrices."""
    return Rows(csr_array(B), w, lambda: csr_array(D))


class _PerRow:
    """Rows of which some are equalities and the others unilateral."""

    all_components, compressive, yields, exact, n_history = False, False, False, False, 0

    def __init__(self, equality):
        self.equality = equality

    def next_active(self, rows):
        """Close equalities, and the others as `Unilateral` does."""
        return self.equality | Unilateral().next_active(rows)

    def linearise(self, rows):
        """Return zeros: no offset and no compliance."""
        return Bilateral().linearise(rows)

    def residual(self, rows):
        """Return the residual of each row's own law."""
        return np.where(self.equality, Bilateral().residual(rows), Unilateral().residual(rows))


def contact_system(rows, G, enforceable, equality, skin):
    """Return a contact system whose rows are unilateral, or equalities where `equality` tells."""
    law = Unilateral() if not equality.any() else _PerRow(equality & enforceable)
    return ContactSystem(rows, G, (RowGroup(law, slice(0, len(G))),), enforceable, enforceable, skin)


def contact(s, enforceable=None, equality=None):
    """Contact of a system as a function of q: the rows, and their gaps at q."""
    m = len(s.B)
    enforceable = np.ones(m, bool) if enforceable is None else enforceable
    equality = np.zeros(m, bool) if equality is None else equality
    made, skin = s.rows, skin_stiffness(s.held, s.rows)
    return lambda q: contact_system(made, s.G - s.D @ q, enforceable, equality, skin)


def solve_active_set(K, f, contact_at, start, tolerance, report=None):
    """Search the equilibrium on one linearisation."""
    return search(active_set_iterates(K, f, contact_at, start, tolerance), tolerance, report)


def solve_newton(linearize, start, tolerance, **options):
    """Search the equilibrium by Newton's method."""
    return search(newton_iterates(linearize, start, tolerance, **options), tolerance)


def solve_rows(K, rows, active, f, G, q, p, tolerance, geometric=None):
    """Solve K q + B_A^T p + C (q - q_0) = f, D_A q = G_A from a start q_0, p."""
    f = f if geometric is None else f + geometric @ q
    return solve_saddle(SaddleProblem(K, rows, np.asarray(active), f, G, None, geometric), q, p, tolerance)


def complementarity(M, r):
    """The system whose gaps are M p + r: unit rows on K = M^-1."""
    m = len(M)
    K = np.linalg.inv(M)
    eye = np.eye(m)
    return System((K + K.T) / 2, eye, eye, np.zeros((m, m)), np.ones(m), np.zeros((m, 0)), np.zeros(m), r)
