"""Rigid bodies: nodes that follow a few rigid-body motions, each of them held, prescribed, or loaded and free.

Motions m: displacement of the centre along x, y (and z), then the rotation: a vector in 3D, a number in a plane, none
in axisymmetry, where only y remains. With small kinematics u_i = U + theta x (X_i - c), linear in theta even for a
prescribed rotation; with finite kinematics u_i = U + (R(theta) - 1)(X_i - c), exact for any angle.

A moment on a body under finite kinematics keeps its axes in space and its size, as a force does. The force conjugate to
d theta is H^T m (`rotation`), not m, and it and its derivative depend on theta. A free rotation in space must stay
short of a full turn, where the rotation vector is singular; a prescribed rotation need not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints, concatenated
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.joints import Coupling
from lacsolver.case.records import Gravity, Rigid
from lacsolver.case.value import Value
from lacsolver.case.value_kinds import FREE
from lacsolver.constraints.conditions import Prescribed
from lacsolver.constraints.rotation import conjugate, conjugate_derivative, turn, turn_curvature, turn_derivative
from lacsolver.space.places import name_of, nodes_of, said, wrong
from lacsolver.space.space import Space

_AXES = "xyz"
#: relative singular value of the free motions' displacements below which a motion moves no node
_STILL = 1e-9
#: angle of a free rotation in space beyond which its vector is too close to the singular full turn
_NEARLY_ALL = 1.9 * np.pi


@dataclass(frozen=True, eq=False)
class RigidBody:
    """Nodes that move rigidly. `nodes` (k,), `centre` (3,); `moment_arm` (k dim, m): displacements of unit motions.

    Each of several processes has the body with those of its nodes that it knows. `arm` (k, 3): vectors from the centre
    to the nodes; `finite`: True for finite rotations. `moved`: prescribed value of each of the m motions, None where it
    is held or free; `loads`: force or moment on each free motion, None for others; `free` (m,). `columns` (m,): index
    in q of each free motion, -1 for the others; `unit` (m,): motion per unit of the unknown. Unknowns are lengths: that
    of a rotation is the displacement of the node farthest from the centre.
    `gravity`: that of the case, for the weight of the body's own mass.
    """

    record: Rigid
    nodes: Ints
    centre: Floats
    moment_arm: NDArray[np.floating]
    arm: Floats
    moved: tuple[Value | None, ...]
    loads: tuple[Value | None, ...]
    columns: Ints
    unit: NDArray[np.floating]
    finite: bool = False
    gravity: Gravity | None = None

    @property
    def name(self) -> str:
        """Name of the body in results: that of its group."""
        return name_of(self.record)

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Mask (m,), True for free motions."""
        return np.array([load is not None for load in self.loads])

    def motion(self, q: Floats, t: float) -> NDArray[np.floating]:
        """Return the motions (m,) at time t, with unknowns q (n_q,) of the constraints."""
        m = _values(self.moved, t)
        m[self.free] = q[self.columns[self.free]] * self.unit[self.free]
        return m

    def held(self, t: float) -> NDArray[np.floating]:
        """Return the motions (m,) at time t, with 0 for the free ones."""
        return _values(self.moved, t)

    def rotation(self, t: float) -> NDArray[np.floating] | None:
        """Return the rotation vector (3,) that is prescribed at time t; None for free and for small rotations."""
        if not self.turns or self.free[self._dim :].any():
            return None
        return self._in_space(self.held(t)[self._dim :])

    def force(self, t: float, motion: Floats | None = None) -> NDArray[np.floating]:
        """Return the forces (m,) at time t that are conjugate to changes of the motions, at `motion` (m,)."""
        f = _values(self.loads, t) + self.weight(t)
        if motion is not None and self.turns:
            f[self._dim :] = conjugate(self._theta(motion), self._in_space(f[self._dim :]))[self._axes]
        return f

    def weight(self, t: float) -> NDArray[np.floating]:
        """Return the weight (m,) of the body's own mass at time t, at its centre."""
        out, given = np.zeros(len(self.loads)), self.gravity
        if self.record.mass is not None and given is not None:
            at = self.centre[None, : self._dim]
            values = _components(given, "g", self._dim)
            out[: self._dim] = [0.0 if v is None else self.record.mass * float(v(at, t)[0]) for v in values]
        return out

    def force_derivative(self, t: float, motion: Floats) -> NDArray[np.floating]:
        """Return the derivative (m, m) of `force` by motions (m,)."""
        out = np.zeros((len(self.loads), len(self.loads)))
        if self.turns:
            m = self._in_space(_values(self.loads, t)[self._dim :])
            out[self._dim :, self._dim :] = conjugate_derivative(self._theta(motion), m)[np.ix_(self._axes, self._axes)]
        return out

    @property
    def turns(self) -> bool:
        """True if displacements are not linear in the motions, because rotations are finite."""
        return self.finite and len(self.loads) > self._dim

    def displacement(self, motion: Floats) -> NDArray[np.floating]:
        """Return the displacements (k dim,) of the nodes under motions (m,)."""
        if not self.turns:
            return self.moment_arm @ motion
        turned = self.arm @ turn(self._theta(motion)).T
        return (motion[: self._dim] + turned[:, : self._dim]).ravel()

    def moment_arm_at(self, motion: Floats) -> NDArray[np.floating]:
        """Return the derivative (k dim, m) of `displacement` at motions (m,)."""
        if not self.turns:
            return self.moment_arm
        out = self.moment_arm.reshape(-1, self._dim, len(motion)).copy()
        turned = np.einsum("jsi,ki->ksj", turn_derivative(self._theta(motion)), self.arm)
        out[:, :, self._dim :] = turned[:, : self._dim, self._axes]
        return out.reshape(self.moment_arm.shape)

    def curvature(self, motion: Floats, forces: Floats) -> NDArray[np.floating]:
        """Return the second derivative (m, m), by motions (m,), of the work of forces (k dim,) at the nodes."""
        out = np.zeros((len(motion), len(motion)))
        if self.turns:
            M = np.zeros((3, 3))
            M[: self._dim] = forces.reshape(-1, self._dim).T @ self.arm
            bent = turn_curvature(self._theta(motion), M)
            out[self._dim :, self._dim :] = bent[np.ix_(self._axes, self._axes)]
        return out

    def resultant(self, forces: Floats, motion: Floats | None = None) -> NDArray[np.floating]:
        """Return resultant and moment (m,), about the centre displaced by `motion`, of forces (k dim,) at the nodes."""
        if motion is None or not self.turns:
            return self.moment_arm.T @ forces
        f = np.zeros((len(self.nodes), 3))
        f[:, : self._dim] = forces.reshape(-1, self._dim)
        where = self.arm + self.arm @ turn(self._theta(motion)).T
        return np.concatenate([f.sum(axis=0)[: self._dim], np.cross(where, f).sum(axis=0)[self._axes]])

    @cached_property
    def _dim(self) -> int:
        return 3 if len(self.loads) == 6 else 2

    @cached_property
    def _axes(self) -> list[int]:
        """Indices of the axes of the rotations."""
        return [0, 1, 2] if self._dim == 3 else [2]

    def _in_space(self, turns: Floats) -> NDArray[np.floating]:
        """Return rotations or moments (r,) as a vector (3,) in space."""
        out = np.zeros(3)
        out[self._axes] = turns
        return out

    def _theta(self, motion: Floats) -> NDArray[np.floating]:
        """Return the rotation vector (3,). Raises InadmissibleError for a free one in space near a full turn."""
        theta = self._in_space(motion[self._dim :])
        if self._dim == 3 and self.free[3:].any() and np.linalg.norm(theta) > _NEARLY_ALL:
            message = f"{said(self.record)} turns freely by nearly a full turn, where its rotation vector cannot follow"
            raise InadmissibleError(f"{message}; take smaller steps, prescribe the rotation, or end the case before")
        return theta


def rigid_bodies(
    space: Space, records: Sequence[Rigid], finite: bool = False, gravity: Gravity | None = None
) -> tuple[RigidBody, ...]:
    """Return the rigid bodies of a case, with their free motions numbered from 0; `finite`: finite kinematics.

    Raises CaseError for a group that is missing or empty, a node in two of them, and a loaded motion that moves no node
    (a rotation about the line on which all nodes lie).
    """
    bodies: list[RigidBody] = []
    problems: list[Issue] = []
    for record in records:
        try:
            first = sum(int(body.free.sum()) for body in bodies)
            bodies.append(_rigid_body(space, record, first, finite, gravity))
        except CaseError as error:
            problems += error.problems
    if problems:
        raise CaseError(problems)
    _in_one(space, bodies)
    return tuple(bodies)


def numbered(bodies: Sequence[RigidBody], first: int) -> tuple[RigidBody, ...]:
    """Return the bodies with `first` added to the numbers of their free motions."""
    return tuple(replace(b, columns=np.where(b.free, b.columns + first, -1)) for b in bodies)


def check_apart(space: Space, bodies: Sequence[RigidBody], parts: Sequence[Prescribed]) -> None:
    """Raise CaseError where a node of a rigid body has its displacement prescribed by another record."""
    owner = _owners(space, bodies)
    for part in parts:
        both = part.nodes[owner[part.nodes] >= 0]
        if len(both):
            body = bodies[owner[both[0]]]
            numbers = some(np.unique(space.mesh.node_number[both]))
            message = f"{said(part.record)} prescribes {part.component} of nodes {numbers}, which {said(body.record)}"
            raise CaseError([Issue(f"{message} moves; prescribe the motion of the rigid body instead")])


def moments(dim: int, x: Floats) -> NDArray[np.floating]:
    """Return theta x X (k, dim, r) at places X (k, 3) for unit rotations theta: about x, y, z, or about z in 2D."""
    cross = np.cross(np.eye(3)[None], x[:, None])  # (k, axis, component)
    return np.moveaxis(cross if dim == 3 else cross[:, 2:, :2], 1, 2)


def _rigid_body(space: Space, record: Rigid, first: int, finite: bool, gravity: Gravity | None) -> RigidBody:
    own = nodes_of(space, record)
    nodes, x = space.known(own), space.local.points[own]
    centre = space.share.total(x.sum(axis=0)) / space.share.total(np.array(len(x)))
    if record.centre is not None:
        centre[: space.dim] = np.array(record.centre) - space.origin[: space.dim]
    x = space.local.points[nodes]
    moment_arm = np.tile(np.eye(space.dim), (len(nodes), 1, 1))
    if not space.model.axisymmetric:
        moment_arm = np.concatenate([moment_arm, moments(space.dim, x - centre)], axis=2)
    moment_arm = moment_arm.reshape(-1, moment_arm.shape[-1])
    turns = moment_arm.shape[1] - space.dim
    moved = _components(record, "u", space.dim) + turns_of(record, turns)
    loads = _components(record, "f", space.dim) + _moments(record, turns)
    free = np.array([load is not None for load in loads])
    columns = np.where(free, first + np.cumsum(free) - 1, -1)
    far = space.share.largest(float(np.linalg.norm(x - centre, axis=1).max(initial=0.0)))
    unit = np.repeat([1.0, 1.0 / far if far > 0 else 1.0], [space.dim, turns])
    body = RigidBody(
        record, nodes, centre + space.origin, moment_arm, x - centre, moved, loads, columns, unit, finite, gravity
    )
    _check_moves(space, body)
    return body


def _components(record: Rigid | Gravity, letter: str, dim: int) -> tuple[Value | None, ...]:
    return tuple(getattr(record, letter + axis) for axis in _AXES[:dim])


def turns_of(record: Rigid | Coupling, turns: int) -> tuple[Value | None, ...]:
    """Return the components of a prescribed rotation, each None if it is not prescribed."""
    if record.rotation is None:
        return (None,) * turns
    return tuple(one if isinstance(one, Value) else None for one in record.rotation[:turns])


def _moments(record: Rigid, turns: int) -> tuple[Value | None, ...]:
    """Return the moment about each axis about which a body turns freely, None about the others."""
    moment = record.moment or (Value(0.0),) * turns
    if record.rotation is None:
        return (None,) * turns if record.moment is None else moment[:turns]
    return tuple(m if theta == FREE else None for m, theta in zip(moment, record.rotation[:turns], strict=False))


def _values(values: Sequence[Value | None], t: float) -> NDArray[np.floating]:
    return np.array([0.0 if value is None else value.at(t) for value in values])


def _check_moves(space: Space, body: RigidBody) -> None:
    """Raise CaseError if a free motion, or a combination of free motions, moves no node."""
    own = space.mask_own(body.nodes)
    moment_arm = body.moment_arm[np.repeat(own, space.dim)][:, body.free]
    size = np.sqrt(space.share.total(np.square(moment_arm).sum(axis=0)))
    reach = space.extent * np.sqrt(space.share.total(np.array(float(own.sum()))))
    turning = np.flatnonzero(body.free) >= space.dim
    scaled = space.share.gather(np.asarray(np.linalg.qr(moment_arm / np.where(turning, reach, size), mode="r")))
    rank = int((np.linalg.svd(np.linalg.qr(scaled, mode="r"), compute_uv=False) > _STILL).sum()) if scaled.size else 0
    if rank < moment_arm.shape[1]:
        one = space.dim == 2 or not space.extent_of(body.nodes[own])
        message = f"the nodes of {body.name!r} are {'one point' if one else 'on one line'}"
        raise wrong(
            body.record,
            f"{message}, so that a free rotation moves none of them; remove moment, and the rotation is fixed",
        )


def _owners(space: Space, bodies: Sequence[RigidBody]) -> Ints:
    """Return the rigid body of each node, (n_nodes,), -1 for none."""
    owner = np.full(space.mesh.n_nodes, -1)
    for k, body in enumerate(bodies):
        owner[body.nodes] = k
    return owner


def _in_one(space: Space, bodies: Sequence[RigidBody]) -> None:
    """Raise CaseError if a node is in two rigid bodies."""
    node = concatenated(body.nodes for body in bodies)
    owner = np.repeat(np.arange(len(bodies)), [len(body.nodes) for body in bodies])
    order = np.argsort(node, kind="stable")
    again = np.flatnonzero(node[order[1:]] == node[order[:-1]])
    if len(again):
        a, b = order[again[0]], order[again[0] + 1]
        numbers = some(space.mesh.node_number[np.unique(node[order[again]])])
        message = f"nodes {numbers} are in {said(bodies[owner[a]].record)} and in {said(bodies[owner[b]].record)}"
        raise CaseError([Issue(f"{message}; a node moves with one rigid body, so join the groups or take them apart")])
