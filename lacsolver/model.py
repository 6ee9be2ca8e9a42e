"""The problem at one time, on the unknowns that are left: forces, and contact wherever the skins are.

u = T q + u0(t);   K_q = T^T K T,  f_q = T^T (f(t) - K u0(t)) + forces on rigid bodies,  B_q = B T
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, vstack
from scipy.sparse.linalg import spsolve

from lacmesh.errors import DataError
from lacmesh.mesh import Floats
from lacsolver.bodies import FreeMotion, bodies, describe, free_motions, rigid_modes, still_free
from lacsolver.equilibrium import Contact, shifted, stiffness_of_rows
from lacsolver.interface import Interface, integrate
from lacsolver.interface.tangent import Motion, gap_derivative, motion_of, tangent
from lacsolver.linear import SingularError
from lacsolver.problem import Joint, Problem
from lacsolver.schur import Rows
from lacsolver.stiffness import Stiffness, Whole, hold


@dataclass(eq=False)
class Model:
    """A problem on its constrained unknowns, K factorised once.

    `held`: K_q and what solves with it; `motions`: those of whole bodies that nothing but contact stops; `length`: the
    extent of the bodies.
    """

    problem: Problem

    def __post_init__(self) -> None:
        self._kept: dict[str, Interface] = {}

    @cached_property
    def K(self) -> csr_array:
        """(n_dof, n_dof)."""
        return self.problem.K

    @cached_property
    def motions(self) -> tuple[FreeMotion, ...]:
        """Motions of whole bodies that displacements and springs leave free."""
        return free_motions(self.problem.space, self.problem.constraints, self.problem.springs)

    @cached_property
    def held(self) -> Stiffness:
        """K_q (n_q, n_q), factorised."""
        problem = self.problem
        T, solver = problem.constraints.T, problem.case.solver
        R = np.zeros((T.shape[1], 0))
        if self.motions:
            R = np.linalg.qr(np.stack([self.unknowns(motion.field) for motion in self.motions], axis=1))[0]
        try:
            return hold(self.reduced(self.K), R, backend=solver.backend, threads=problem.threads, whole=self._whole())
        except SingularError as error:
            raise self._singular(error) from error

    def _singular(self, error: SingularError) -> SingularError:
        """The error of a singular stiffness, in words of the mesh: the node that moves most, and along which axis."""
        space = self.problem.space
        if error.dof is None:
            return error
        q = np.eye(1, self.problem.constraints.n_q, error.dof)[0] if error.mode is None else error.mode
        u = self.problem.constraints.T @ q
        node, axis = divmod(int(np.abs(u).argmax()), space.dim)
        place = ", ".join(f"{c:.6g}" for c in space.mesh.points[node, : space.dim])
        who = f"node {space.mesh.node_number[node]} ({place}) along {'xyz'[axis]}"
        message = f"the stiffness is singular: a part of a body can move without any force, most of all {who}"
        advice = "look how it hangs on the rest there, or hold it by a displacement or a spring"
        return SingularError(f"{message}; {advice}", error.dof, error.mode)

    def _whole(self) -> Whole | None:
        """Where q stands among the unknowns of all nodes, and every body's rigid motions; None if q are others."""
        space, c = self.problem.space, self.problem.constraints
        if not c.is_selection:
            return None
        of_node = bodies(space)
        own = [rigid_modes(space, np.flatnonzero(of_node == k)) for k in range(of_node.max() + 1)]
        modes = np.sum([m for m in own if m.shape[1] == own[0].shape[1]], axis=0)
        free = np.zeros(space.n_dof, bool)
        free[c.free] = True
        return Whole(c.free, space.n_dof, space.dim, modes * free[:, None])

    @cached_property
    def length(self) -> float:
        """The bodies' extent."""
        space = self.problem.space
        return float(np.ptp(space.mesh.points[space.attached], axis=0).max())

    @cached_property
    def moving(self) -> bool:
        """Whether some joint is paired again on the deformed skins."""
        return any(joint.moving for joint in self.problem.joints)

    def unknowns(self, u: Floats) -> NDArray[np.floating]:
        """(n_q,): q with T q = u, (n_dof,), which has one."""
        T = self.problem.constraints.T
        return np.asarray(spsolve(csc_array(T.T @ T), T.T @ u))

    def check_held(self, interfaces: list[Interface], paired: NDArray[np.bool_]) -> None:
        """Raises DataError where a body may move and no contact or tie would stop it: who, and how."""
        if not self.motions:
            return
        n = self.K.shape[0]
        B = csr_array(vstack([csr_array((0, n)), *(face.B for face in interfaces)]))
        free = still_free(csr_array(B[np.flatnonzero(paired)]), self.motions)
        if free:
            said = "; ".join(describe(motion) for motion in free)
            raise DataError(f"nothing holds a part of the model: {said}; add a displacement, a spring or a contact")

    def reduced(self, K: csr_array) -> csr_array:
        """T^T K T."""
        c = self.problem.constraints
        if c.is_selection:
            return csr_array(K[c.free][:, c.free])
        return csr_array((c.T.T @ K @ c.T).tocsr())

    def interface(self, joint: Joint, u: Floats, t: float) -> Interface:
        """A joint's interface: a moving one's where u (n_dof,) takes the skins, a still one's where they were."""
        space = self.problem.space
        if joint.moving:
            return integrate(joint.zone, space.dim, joint.pairing, x=joint.places(space, u), t=t)
        if joint.name not in self._kept or joint.timed:
            self._kept[joint.name] = integrate(joint.zone, space.dim, joint.pairing, t=t, tie=joint.tie)
        return self._kept[joint.name]


@dataclass(eq=False)
class Instant:
    """A time: what acts, what is prescribed, and contact at any q. `f` (n_q,), `load` and `u0` (n_dof,).

    `interfaces`: those of the last q that was asked about.
    """

    model: Model
    t: float

    def __post_init__(self) -> None:
        c = self.model.problem.constraints
        self.load, self.u0 = self.model.problem.load(self.t), c.u0(self.t)
        self.f = c.T.T @ (self.load - self.model.K @ self.u0) + c.force(self.t)
        self.interfaces: list[Interface] = []
        self._fixed: Contact | None = None
        self._last: tuple[Floats, Contact] | None = None

    def u(self, q: Floats) -> NDArray[np.floating]:
        """(n_dof,)."""
        return np.asarray(self.model.problem.constraints.T @ q + self.u0)

    def contact(self, q: Floats) -> Contact:
        """The rows of all joints, and their gaps at q."""
        if self._fixed is not None:
            return shifted(self._fixed, self._fixed.G - self._fixed.rows.D @ q)
        if self._last is not None and np.array_equal(self._last[0], q):
            return self._last[1]
        u = self.u(q)
        self.interfaces = [self.model.interface(joint, u, self.t) for joint in self.model.problem.joints]
        made = _rows(self.model, self.interfaces, u)
        if not self.model.moving:
            self._fixed = replace(made, G=made.G + made.rows.D @ q)
        self._last = q.copy(), made
        return made


def _rows(model: Model, interfaces: list[Interface], u: Floats) -> Contact:
    """The rows of all joints on q, and their gaps at u, in which those of still joints are linear."""
    problem = model.problem
    T, d, n = problem.constraints.T, problem.space.dim, problem.constraints.T.shape[1]
    B: list[csr_array] = []
    D: list[csr_array] = []
    G: list[Floats] = [np.empty(0)]
    w: list[Floats] = [np.empty(0)]
    paired, held = [np.empty(0, bool)], [np.empty(0, bool)]
    motions = [_motion(model, joint, face) for joint, face in zip(problem.joints, interfaces, strict=True)]
    for joint, face, motion in zip(problem.joints, interfaces, motions, strict=True):
        repeat = d if joint.tie else 1
        B.append(csr_array(face.B @ T))
        D.append(B[-1] if motion is None else csr_array(gap_derivative(face, motion) @ T))
        G.append(face.G if joint.moving else face.G - face.B @ u)
        w.append(np.repeat(face.w, repeat))
        paired.append(np.repeat(joint.paired(face), repeat))
        held.append(np.full(len(w[-1]), not joint.one_sided))
    left = csr_array(vstack([csr_array((0, n)), *B]))
    right = left if all(a is b for a, b in zip(B, D, strict=True)) else csr_array(vstack(D))
    covered, moved = np.concatenate(paired), np.diff(left.indptr) > 0
    rows = Rows(left, right, np.where(covered, np.concatenate(w), 1.0))

    def turning(p: Floats) -> csr_array:
        total, first = csr_array(model.K.shape), 0
        for face, motion in zip(interfaces, motions, strict=True):
            last = first + face.B.shape[0]
            if motion is not None:
                total = csr_array(total + tangent(face, motion, p[first:last]))
            first = last
        return model.reduced(total)

    turns = turning if any(motion is not None for motion in motions) else None
    c = stiffness_of_rows(model.held, rows)
    return Contact(rows, np.concatenate(G), covered & moved, np.concatenate(held), c, turns, covered & ~moved)


def _motion(model: Model, joint: Joint, face: Interface) -> Motion | None:
    """How a joint's interface moves; None where it does not, or where the tangent asked for leaves that out."""
    if not joint.moving or model.problem.case.solver.tangent == "symmetric":
        return None
    return motion_of(face, face.slave, face.master, joint.pairing, model.problem.space.dim)
