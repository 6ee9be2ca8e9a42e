"""A problem linearised about its undeformed bodies or about a state: its stiffness, and the rows that stay closed.

    K dq + C^T dp = forces,    C dq = 0,        dp: change of the pressures of the closed rows

K is the tangent of bodies, springs, followers and rows that yield, with the geometric stiffness of contact and of rigid
bodies. Its antisymmetric part, which followers and contact on deformed skins have, is left out. Without a state
unilateral contacts are open; ties and bilateral contacts are closed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from lacmesh.mesh import Floats
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.state import Histories
from lacsolver.linear.regular import is_free
from lacsolver.problem.problem import Problem
from lacsolver.problem.rigid_modes import FreeMotion, still_free
from lacsolver.results.results import Restart
from lacsolver.saddle.contact_system import ContactSystem, contact_system, row_energies


@dataclass(frozen=True, eq=False)
class LinearisedProblem:
    """Matrices on the unknowns q: `K` (n_q, n_q), and `C` (m, n_q), the rows that stay closed.

    Rows are scaled: C^T C is about as stiff as K. `T` (n_dof, n_q): du/dq. `rigid`: motions that nothing resists, and
    `R` (n_q, r) their unknowns. `held`: number of closed rows of each contact pair, of those that yield too.
    `q` (n_q,) and `t`: unknowns and time of the state. `about_state`: False for the undeformed bodies.
    """

    model: ReducedProblem
    K: csr_array
    C: csr_array
    T: csr_array
    rigid: tuple[FreeMotion, ...]
    R: NDArray[np.floating]
    held: dict[str, int]
    q: Floats
    t: float
    about_state: bool = False

    @classmethod
    def of(cls, model: ReducedProblem, at: Restart | None = None) -> LinearisedProblem:
        """Linearise a problem about a state, or about its undeformed bodies if None."""
        base = _Base.of(model.problem, at)
        T = model.problem.constraints.tangent(base.q, base.t)
        B = csr_array(base.contact.rows.B[base.closed] @ T)
        moved = np.diff(B.indptr) > 0  # rows between prescribed nodes hold nothing
        compliance = base.contact.equations(base.p, base.active)[1][base.closed]
        yields = moved & (compliance > 0)
        K = model.K_q if at is None else base.tangent(T)
        if yields.any():
            K = csr_array(K + B[yields].T @ diags_array(1 / compliance[yields]) @ B[yields])
        rigid, R = base.rigid(model, K, csr_array(base.contact.rows.B[base.closed[moved]]))
        return cls(
            model, K, _scaled(csr_array(B[moved & ~yields]), K), T, rigid, R,
            {g.pair.name: int(moved[_between(base.closed, g.rows)].sum()) for g in base.contact.pairs},
            base.q, base.t, at is not None,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Base:
    """The state that a problem is linearised about: unknowns q, pressures p, and what follows from them.

    `contact`: the rows on the unknowns of all nodes; `active` (m,) a mask, and `closed` the indices of closed rows.
    """

    problem: Problem
    q: Floats
    p: Floats
    t: float
    u: Floats
    histories: Histories
    contact: ContactSystem
    active: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem, at: Restart | None) -> _Base:
        constraints, space = problem.constraints, problem.space
        iterate, histories, t = None, Histories(), 0.0
        q: Floats = np.zeros(constraints.n_q)
        u: Floats = np.zeros(space.n_dof)
        if at is not None and at.step.iterate is not None:
            iterate, histories, t = at.step.iterate, at.step.histories, at.time
            q, u = iterate.q, constraints.displacement(iterate.q, t)
        faces = [pair.integrate(space, u, t) for pair in problem.joints]
        contact = contact_system(problem, faces, u, histories, t, u)
        p = np.zeros(len(contact.G)) if iterate is None else iterate.p
        active = contact.start_active(p > 0) if iterate is None else iterate.active
        return cls(problem, q, p, t, u, histories, contact, active)

    @property
    def closed(self) -> NDArray[np.integer]:
        """Indices of the closed rows."""
        return np.flatnonzero(self.active)

    def tangent(self, T: csr_array) -> csr_array:
        """Return the symmetric part (n_q, n_q) of the tangent stiffness."""
        problem, u, t = self.problem, self.u, self.t
        kinematics, materials = problem.kinematics, self.histories.materials
        K = kinematics.tangent(u, t, materials)
        following = problem.loads.tangent(t, u)
        if following is not None:
            K = csr_array(K - following)
        if self.contact.moving:
            K = csr_array(K + self.contact.geometric_stiffness(self.p))
        forces = kinematics.internal_force(u, t, materials) - problem.load(t, u) + self.contact.rows.B_T @ self.p
        bent = problem.constraints.turning(self.q, t, forces)
        K_q = problem.constraints.reduced(K, T)
        K_q = K_q if bent is None else csr_array(K_q + bent)
        return csr_array((K_q + K_q.T) / 2)

    def rigid(
        self, model: ReducedProblem, K: csr_array, B: csr_array
    ) -> tuple[tuple[FreeMotion, ...], NDArray[np.floating]]:
        """Return the rigid-body motions that neither supports nor the closed rows B (m, n_dof) resist, and unknowns.

        About a state of a problem that is not linear, those that loads or pressures resist are left out.
        """
        x = self.problem.space.places(self.u)
        free = still_free(B, model.motions, x=x)
        R = [self.problem.constraints.unknowns(_field(motion, x)) for motion in free]
        if not model.linear and self.u.any():
            chosen = [is_free(K, q) for q in R]
            free = tuple(motion for motion, kept in zip(free, chosen, strict=True) if kept)
            R = [q for q, kept in zip(R, chosen, strict=True) if kept]
        return free, np.stack(R, axis=1) if R else np.zeros((K.shape[0], 0))


def _field(motion: FreeMotion, x: Floats) -> NDArray[np.floating]:
    """Return the displacement (n_dof,) of all nodes by a motion, with nodes at x (n_nodes, 3)."""
    u = np.zeros((len(x), motion.space.dim))
    u[motion.nodes] = motion.at(x)
    return u.ravel()


def _scaled(B: csr_array, K: csr_array) -> csr_array:
    """Return rows B (m, n), each scaled so that b b^T is what K has along b."""
    energy, size = row_energies(B, K)
    scale = np.sqrt(np.where(energy > 0, energy, 1.0)) / np.where(size > 0, size, 1.0)
    return csr_array(diags_array(scale) @ B)


def _between(numbers: NDArray[np.integer], rows: slice) -> NDArray[np.bool_]:
    """Return a mask of the sorted numbers that a slice has."""
    return np.asarray((numbers >= rows.start) & (numbers < rows.stop))
