"""Forces and moments at a point, spread over weighted nodes, and the motion of these nodes as a whole.

With weights w_i that add up to 1, the centre c = sum w_i X_i of the nodes and r_i = X_i - c, positions from the mean
position rho_i = r_i + u_i - sum w_j u_j:

    A = sum w_i rho_i r_i^T = R S          R: the rotation that is nearest to the motion of the nodes (Kabsch 1976)
    K = R (tr(S) 1 - S) R^T                a spin d theta of R is K^-1 sum w_i (R r_i) x du_i
    u_P = sum w_i u_i + (R - 1) d          the point P that moves with them, d = P - c
    f_i = w_i (F + (K^-1 M_c) x R r_i)     forces whose sum is F, and whose moment about P at its place is M

with M_c = M + (R d) x F. The forces are conjugate to u_P and R, so that a potential exists for forces that keep their
direction, and both balances hold at any displacement, whatever the nodes' strain. Nodes that turn rigidly turn R
exactly. Small kinematics are R = 1, K = J = sum w_i (r_i.r_i 1 - r_i r_i^T), and the spin the rotation itself. In a
plane all rotations are about z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints

#: eigenvalue of J, relative to its trace, below which nodes cannot carry a moment
_ON_LINE = 1e-10
#: step of central differences on A, relative to its size
_STEP = 1e-5


@dataclass(frozen=True, eq=False)
class Spread:
    """Weighted nodes: `nodes` (k,), `w` (k,), their sum 1, `r` (k, 3) from the centre, `d` (3,) from it to the point.

    `dim`: of the space; `finite`: True for finite rotations.
    """

    nodes: Ints
    w: NDArray[np.floating]
    r: NDArray[np.floating]
    d: NDArray[np.floating]
    dim: int
    finite: bool

    @classmethod
    def of(cls, nodes: Ints, w: Floats, x: Floats, point: Floats | None, dim: int, finite: bool) -> Spread:
        """Return those of nodes at x (k, 3) with weights (k,) of any sum; `point` (3,), None for their centre."""
        w = w / w.sum()
        centre = w @ x
        r = x - centre
        r -= w @ r  # round-off of the centre
        return cls(nodes, w, r, np.zeros(3) if point is None else point - centre, dim, finite)

    @property
    def axes(self) -> list[int]:
        """Axes of rotations: all three in space, z in a plane."""
        return [0, 1, 2] if self.dim == 3 else [2]

    @cached_property
    def J(self) -> NDArray[np.floating]:
        """Moments of inertia (a, a) of the weights about the axes."""
        return self.inertia(self.r.T @ (self.w[:, None] * self.r))

    @cached_property
    def gyration(self) -> float:
        """Radius of gyration: a rotation of 1 moves the nodes by about this length."""
        return float(np.sqrt(self.w @ np.square(self.r).sum(axis=1)))

    @property
    def turns(self) -> bool:
        """True if the nodes tell of every rotation, False if they are one point or on one line."""
        values = np.linalg.eigvalsh(self.J)
        return bool(values[0] > _ON_LINE * max(float(np.trace(self.J)), 1e-300))

    def moved(self, u: Floats) -> NDArray[np.floating]:
        """Return the displacements (k, 3) of the nodes, of those (n_dof,) of all nodes."""
        out = np.zeros((len(self.nodes), 3))
        out[:, : self.dim] = u.reshape(-1, self.dim)[self.nodes]
        return out

    def shape(self, u: Floats) -> NDArray[np.floating]:
        """Return A (3, 3) at u (n_dof,)."""
        return self._sum(self.r + self.moved(u))

    def polar(self, A: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return R (3, 3) and K (a, a) of A; the identity and J under small kinematics."""
        if not self.finite:
            return np.eye(3), self.J
        if self.dim == 2:
            c, s = A[0, 0] + A[1, 1], A[1, 0] - A[0, 1]
            size = np.hypot(c, s)
            R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, size]]) / size
            return R, np.array([[size]])
        U, size, V = np.linalg.svd(A)
        size[2] *= np.sign(np.linalg.det(U) * np.linalg.det(V)) or 1.0
        sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ V))])
        R = U @ sign @ V
        return R, self.inertia(U @ np.diag(size) @ sign @ U.T)

    def mean(self, u: Floats) -> NDArray[np.floating]:
        """Return the mean displacement (3,)."""
        return self.w @ self.moved(u)

    def rotation(self, u: Floats) -> NDArray[np.floating]:
        """Return the rotation vector (a,) of the nodes at u (n_dof,); 0 where they do not tell of one."""
        if not self.turns:
            return np.zeros(len(self.axes))
        if not self.finite:
            return np.linalg.solve(self.J, self._moment(self.r, self.moved(u)))
        return rotation_vector(self.polar(self.shape(u))[0])[self.axes]

    def point(self, u: Floats) -> NDArray[np.floating]:
        """Return the displacement (dim,) of the point at u (n_dof,)."""
        if not self.d.any():
            return self.mean(u)[: self.dim]
        if self.finite:
            turned = self.polar(self.shape(u))[0] @ self.d - self.d
        else:
            turned = np.cross(self.full(self.rotation(u)), self.d)
        return (self.mean(u) + turned)[: self.dim]

    def forces(self, F: Floats, M: Floats, A: Floats) -> NDArray[np.floating]:
        """Return the nodal forces (k, 3) of a force F (3,) and a moment M (3,) at the point, for the shape A."""
        R, K = self.polar(A)
        moment = (M + np.cross(R @ self.d, F))[self.axes]
        out = self.w[:, None] * F
        if moment.any():
            spin = self.full(np.linalg.solve(K, moment))
            out = out + self.w[:, None] * np.cross(spin, self.r @ R.T)
        return out

    def tangent(self, F: Floats, M: Floats, A: Floats) -> NDArray[np.floating]:
        """Return the derivative (k dim, k dim) of the nodal forces by the nodes' displacements, by differences on A."""
        columns, size = [], _STEP * max(np.abs(A).max(), 1e-300)
        for a in range(3):
            for b in range(3):
                dA = np.zeros((3, 3))
                dA[a, b] = size
                columns.append((self.forces(F, M, A + dA) - self.forces(F, M, A - dA))[:, : self.dim] / (2 * size))
        # dA[a, b] = sum w_i du_ia r_ib
        by_shape = np.stack(columns, axis=-1).reshape(-1, 3, 3)[:, : self.dim, : self.dim]
        out = np.einsum("fab,i,ib->fia", by_shape, self.w, self.r[:, : self.dim])
        return out.reshape(len(by_shape), -1)

    def full(self, turns: Floats) -> NDArray[np.floating]:
        """Return rotations or moments (a,) as a vector (3,)."""
        out = np.zeros(3)
        out[self.axes] = turns
        return out

    def _sum(self, rho: Floats) -> NDArray[np.floating]:
        return np.asarray((self.w[:, None] * rho).T @ self.r)

    def _moment(self, arm: Floats, v: Floats) -> NDArray[np.floating]:
        return (self.w @ np.cross(arm, v))[self.axes]

    def inertia(self, S: Floats) -> NDArray[np.floating]:
        """Return tr(S) 1 - S (a, a) about the axes, of S (3, 3)."""
        return (np.trace(S) * np.eye(3) - S)[np.ix_(self.axes, self.axes)]


def rotation_vector(R: Floats) -> NDArray[np.floating]:
    """Return the rotation vector (3,) of a rotation R (3, 3), of an angle of at most pi."""
    axial = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine, cosine = np.linalg.norm(axial), (np.trace(R) - 1) / 2
    angle = np.arctan2(sine, cosine)
    if sine > 1e-6 or cosine > 0:
        return axial * (angle / sine if sine > 1e-150 else 1.0)
    axis = np.sqrt(np.maximum((np.diag(R) + 1) / 2, 0.0))  # close to half a turn
    k = int(axis.argmax())
    axis = (R[k] + np.eye(3)[k]) / (2 * axis[k])
    axis = axis / np.linalg.norm(axis)
    return axis * angle * (1.0 if axis @ axial >= 0 else -1.0)
