"""Inertia of a problem: the mass of cells, without that of massless nodes, and of rigid bodies.

A rigid body's own mass is carried by points that move with it, one, two (in a plane) or six (in space), which together
have its mass, centre and moments of inertia. So one rule serves for nodes and points: `w` (n_w,) are the displacements
of all nodes and then of these points, M (n_w, n_w) their mass, and T_w = dw/dq. Of several processes each has the rows
of M at its own nodes, and all have the points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array, diags_array, kron, vstack

from lacmesh.mesh import Floats, Ints, concatenated
from lacsolver.bodies.mass import assemble_mass
from lacsolver.bodies.material import Materials
from lacsolver.case import Dynamics
from lacsolver.constraints import Constraints
from lacsolver.constraints.rigid import RigidBody, moments
from lacsolver.contact import Zone
from lacsolver.problem.massless import Massless, massless_nodes
from lacsolver.problem.rigid_modes import body_names, centres
from lacsolver.space.places import wrong
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse, sparse_blocks

#: change of a body's inertia by its massless nodes above which a warning is due
LARGE = 0.01


@dataclass(frozen=True, eq=False)
class Inertia:
    """Mass M (n_w, n_w) of the nodes and of the `points` of rigid bodies that have a mass of their own.

    `plain` (n_dof, n_dof): mass of the cells before that of `massless` nodes is moved. `finite`: True if positions are
    deformed.
    """

    space: Space
    constraints: Constraints
    M: csr_array
    plain: csr_array
    massless: Massless
    points: tuple[RigidBody, ...]
    finite: bool = False

    @classmethod
    def of(
        cls, space: Space, materials: Materials, constraints: Constraints, zones: Sequence[Zone], how: Dynamics,
        finite: bool,
    ) -> Inertia:  # fmt: skip
        """Build the inertia of a problem. Raises CaseError for a body that moves freely and has no mass."""
        plain = csr_array(assemble_mass(space, materials, how.mass))
        rigid = concatenated(body.nodes for body in constraints.rigid)
        massless = massless_nodes(space, zones, how.massless, rigid)
        points = tuple(_points(space, body) for body in constraints.rigid if body.record.mass)
        own = [_point_mass(body, space.dim) for body in points]
        M = csr_array(block_diag([_redistributed(space, plain, massless), *own], format="csr"))
        inertia = cls(space, constraints, M, plain, massless, points, finite)
        inertia._check_rigid()
        return inertia

    def places(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return w (n_w,), the displacements of nodes and points at unknowns q (n_q,) and time t."""
        return np.concatenate([self.constraints.displacement(q, t), self.of_points(q, t)])

    def of_points(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the displacements of the points alone."""
        x = self.constraints.before_equations(q, t)
        return np.concatenate([np.empty(0), *(body.displacement(body.motion(x, t)) for body in self.points)])

    def tangent(self, q: Floats, t: float) -> csr_array:
        """Return T_w = dw/dq (n_w, n_q)."""
        c = self.constraints
        T, x, n = c.tangent(q, t), c.before_equations(q, t), c.supports.n_x
        parts = [_columns(body, body.moment_arm_at(body.motion(x, t)), n) for body in self.points]
        return T if not parts else csr_array(vstack([T, *map(c.through_equations, parts)]))

    @cached_property
    def turning(self) -> tuple[tuple[RigidBody, Ints], ...]:
        """Bodies, and points of bodies, that turn by finite rotations, with their places in w."""
        first = self.space.n_dof
        turned = [(body, self.space.dofs(body.nodes).ravel()) for body in self.constraints.rigid]
        for body in self.points:
            turned.append((body, first + np.arange(len(body.moment_arm))))
            first += len(body.moment_arm)
        return tuple((body, at) for body, at in turned if body.turns)

    @cached_property
    def massless_dofs(self) -> Ints:
        """Places in w of the nodes without mass."""
        return self.space.dofs(np.flatnonzero(self.massless.nodes)).ravel()

    def reduced(self, S: csr_array, q: Floats, t: float) -> csr_array:
        """Return T_w^T S T_w (n_q, n_q) for S (n_w, n_w); of several processes the part of this one."""
        c, n, T = self.constraints, self.space.n_dof, self.tangent(q, t)
        if not self.points:
            return c.reduced(S, T)
        S_q = c.reduced(csr_array(S[:n, :n]), csr_array(T[:n]))
        return S_q if self.space.share.rank else csr_array(S_q + T[n:].T @ S[n:, n:] @ T[n:])

    def on_unknowns(self, f: Floats, q: Floats, t: float) -> NDArray[np.floating]:
        """Return T_w^T f (n_q,) of forces f (n_w,)."""
        c, n, T = self.constraints, self.space.n_dof, self.tangent(q, t)
        if not self.points:
            return c.on_unknowns(f, T)
        return c.on_unknowns(f[:n], csr_array(T[:n])) + T[n:].T @ f[n:]

    def curvature(self, q: Floats, t: float, f: Floats) -> csr_array | None:
        """Return the derivative (n_q, n_q) of T_w^T f by q for constant forces f (n_w,); None if T_w is constant.

        Of several processes each has its part.
        """
        parts, f, c = [], self.of_own(f), self.constraints
        x = c.before_equations(q, t)
        for body, at in self.turning:
            columns = body.columns[body.free]
            bent = body.curvature(body.motion(x, t), f[at]) * body.unit * body.unit[:, None]
            parts.append((columns, bent[np.ix_(body.free, body.free)]))
        if not parts:
            return None
        bent = sparse_blocks(c.supports.n_x, parts)
        return csr_array(c.through_equations(c.through_equations(bent).T.tocsr()).T)

    def of_own(self, f: Floats) -> NDArray[np.floating]:
        """Return forces f (n_w,) with 0 where another process counts them: its nodes, or the points."""
        n, share = self.space.n_dof, self.space.share
        return np.concatenate([self.space.of_own(f[:n]), f[n:] * (share.rank == 0)])

    def dot(self, x: Floats, y: Floats) -> float:
        """Return the product x . y of vectors (n_w,), over the nodes of all processes and the points."""
        n = self.space.n_dof
        return self.space.dot(x[:n], y[:n]) + float(x[n:] @ y[n:])

    def total(self, values: Floats) -> NDArray[np.floating]:
        """Return the sum (k,) of values (n_w / dim, k) over the nodes of all processes and the points."""
        n = self.space.mesh.n_nodes
        return self.space.share.total(self.space.own(values[:n]).sum(axis=0)) + values[n:].sum(axis=0)

    def padded(self, f: Floats) -> NDArray[np.floating]:
        """Return forces f (n_dof,) at the nodes as (n_w,), with none at the points."""
        return np.concatenate([f, np.zeros(self.M.shape[0] - len(f))])

    def on_nodes(self, f: Floats) -> NDArray[np.floating]:
        """Return the part (n_dof,) of a vector (n_w,) at the nodes."""
        return f[: self.space.n_dof]

    def weight(self, g: Floats) -> NDArray[np.floating]:
        """Return the weight (n_dof,) of the nodes under accelerations g (n_dof,) of gravity, M g."""
        n = self.space.n_dof
        return np.asarray(self.M[:n, :n] @ g)

    @property
    def positions(self) -> NDArray[np.floating]:
        """Undeformed coordinates (n_w,) of nodes and points, relative to the space's origin."""
        dim, centre = self.space.dim, self.space.origin
        of_points = [(body.centre - centre)[:dim] + body.arm[:, :dim] for body in self.points]
        return np.concatenate([self.space.local.points[:, :dim].ravel(), *(x.ravel() for x in of_points)])

    def moved(self) -> dict[int, float]:
        """Return the relative change of each body's moment of inertia by its massless nodes, the trace of its tensor.

        In axisymmetry, that along the axis about the centre.
        """
        space, of_node, n = self.space, self.space.bodies, self.space.n_dof
        if not self.massless.nodes.any():
            return {}
        centre, _ = centres(space, of_node)
        arm = (space.local.points - centre[np.maximum(of_node, 0)])[:, : space.dim]
        arm[of_node < 0] = 0.0
        in_body = space.own_nodes(np.flatnonzero(of_node >= 0))
        masses = (self.plain, self.M[:n, :n])
        parts = ((arm * (M @ arm.ravel()).reshape(arm.shape)).sum(axis=1)[in_body] for M in masses)
        sums = (np.bincount(of_node[in_body], part, len(centre)).astype(float) for part in parts)
        before, after = map(space.share.total, sums)
        there = np.unique(of_node[self.massless.nodes])
        return {int(k): float(after[k] / before[k] - 1) for k in there}

    def told(self) -> list[str]:
        """Return warnings: skins that keep their mass, and a change of inertia above one per cent."""
        moved = self.moved()
        worst = max(moved, key=lambda body: abs(moved[body]), default=-1)
        said = list(self.massless.told)
        if worst >= 0 and abs(moved[worst]) > LARGE:
            name = body_names(self.space, self.space.bodies)[worst]
            advice = 'refine the cells at the contact, or take massless = "internal"'
            said.append(f"massless nodes change the inertia of {name} by {moved[worst]:+.2%}; {advice}")
        return said

    def _check_rigid(self) -> None:
        """Raise CaseError for a rigid body that a load moves freely, and that has no mass, or no moment of inertia."""
        c = self.constraints.plain
        alone = self if c is self.constraints else replace(self, constraints=c)
        diagonal = c.summed(alone.reduced(self.M, np.zeros(c.n_q), 0.0).diagonal())
        for body in self.constraints.rigid:
            free = np.flatnonzero(body.free)
            empty = free[~(diagonal[body.columns[free]] > 0)]
            if len(empty):
                key = "mass" if (empty < self.space.dim).any() else "inertia"
                message = f"{body.name!r} moves freely under its loads and has no {key}"
                raise wrong(body.record, f"{message}; give its {key}, or hold it")


def _redistributed(space: Space, plain: csr_array, massless: Massless) -> csr_array:
    """Return P^T M P (n_dof, n_dof) of a mass M, symmetric to round-off, with its rows at own nodes alone.

    With D the identity at nodes with mass and W = P - D: D M D + (X + X^T), X = W^T M (D + W / 2). W and the rows of M
    that W^T takes are at massless nodes, and the same on all processes.
    """
    P = kron(massless.P, np.eye(space.dim), format="csr")
    given = np.repeat(massless.nodes, space.dim)
    own = np.ones(space.n_dof, bool) if space.share.own is None else np.repeat(space.share.own, space.dim)
    D = csr_array(diags_array((~given).astype(float)))
    W = csr_array(P - D)
    taken = space.share.add_matrices(csr_array(diags_array((given & own).astype(float)) @ plain), (True, True))
    X = W.T @ taken @ (D + W / 2)
    return csr_array(diags_array(own.astype(float)) @ csr_array(D @ plain @ D + (X + X.T)))


def _points(space: Space, body: RigidBody) -> RigidBody:
    """Return the points that carry a body's own mass, as a body of these points."""
    inertia, mass = body.record.inertia, body.record.mass
    arm = np.zeros((1, 3))
    if inertia is not None and space.dim == 2:
        arm = np.sqrt(np.atleast_1d(inertia)[0] / mass) * np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    elif inertia is not None:
        trace = np.sum(inertia)
        size = np.sqrt(np.maximum(1.5 * (trace - 2 * np.array(inertia)) / mass, 0.0))
        arm = np.concatenate([np.diag(size), -np.diag(size)])
    moment_arm = np.tile(np.eye(space.dim), (len(arm), 1, 1))
    if not space.model.axisymmetric:
        moment_arm = np.concatenate([moment_arm, moments(space.dim, arm)], axis=2)
    moment_arm = moment_arm.reshape(-1, moment_arm.shape[-1])
    return replace(body, nodes=np.arange(len(arm)), arm=arm, moment_arm=moment_arm)


def _point_mass(body: RigidBody, dim: int) -> csr_array:
    """Return the mass (k dim, k dim) of a body's points, equal for all of them."""
    count = len(body.arm)
    return csr_array(diags_array(np.full(count * dim, (body.record.mass or 0.0) / count)))


def _columns(body: RigidBody, moment_arm: Floats, n_q: int) -> csr_array:
    """Return the derivative (k dim, n_q) of a body's displacements by the unknowns, from that by its motions."""
    values, rows = (moment_arm * body.unit)[:, body.free], np.arange(len(moment_arm))[:, None]
    return sparse((len(moment_arm), n_q), (rows, body.columns[body.free], values))
