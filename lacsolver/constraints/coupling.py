"""Couplings of the case: a point with a force, a moment or a motion, which the nodes of a group take.

A distributing coupling spreads loads at its point (`spread`), and holds prescribed motions of the point by rows of
equality: each is a combination of all of its nodes, and eliminated it would fill the stiffness. With rotations theta
prescribed,

    sum w_i u_i + (R(theta) - 1) d = u_P(t),    rho K^-1 sum w_i (R(theta) r_i) x (r_i + u_i) = 0

which is linear in u at any angle; rho, the radius of gyration, makes them lengths. The nodes turned by half a turn
against R(theta) fulfil that too: where their own rotation is farther from R(theta) than a radian, a rotation on the way
there, a radian farther than their own, takes its place. Where the point is moved and its rotation is free, R is that of
the nodes.

A rigid coupling of all components is a rigid body (`rigid`). One of some components is an equation for each of them at
each node, a . u_i = a . (u_P + theta x (X_i - P)), which is eliminated (`equations`), with the point's free motions as
further unknowns. Under finite kinematics rotations are prescribed, and theta x is R(theta) - 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacsolver.case.case import Case
from lacsolver.case.joints import Coupling
from lacsolver.case.records import Rigid
from lacsolver.case.value import Value
from lacsolver.constraints.equality_rows import EqualityAt
from lacsolver.constraints.equations import Equations
from lacsolver.constraints.rigid import turns_of
from lacsolver.constraints.rotation import turn
from lacsolver.constraints.spread import Spread, rotation_vector
from lacsolver.contact.laws import Bilateral, ContactLaw
from lacsolver.space.axes import cartesian
from lacsolver.space.places import cells_of, in_words, nodes_of, wrong
from lacsolver.space.quadrature import nodal_measures
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse, sparse_blocks

_AXES = "xyz"
#: nodes up to which the derivative of spread moments and of R is a part of the tangent: it is dense
MOST_NODES = 500
#: largest angle (radians) between the rotation of the nodes and the one that their rows ask for
_ON_THE_WAY = 1.0
#: singular value of a rigid coupling's motions, relative to the largest, below which nodes do not follow one
_STILL = 1e-9


@dataclass(frozen=True, eq=False)
class PointMotion:
    """Loads and motions at the point of a coupling, along its axes: `moved` and `loads` (m,), each None if not given.

    `axes` (dim, dim): directions, a row each. m: displacements, then rotations.
    """

    moved: tuple[Value | None, ...]
    loads: tuple[Value | None, ...]
    axes: NDArray[np.floating]

    @classmethod
    def of(cls, space: Space, record: Coupling) -> PointMotion:
        """Return those of a record."""
        dim, turns = space.dim, 0 if space.model.axisymmetric else 2 * space.dim - 3

        def components(letter: str) -> tuple[Value | None, ...]:
            return tuple(getattr(record, letter + axis) for axis in _AXES[:dim])

        moment = (None,) * turns if record.moment is None else record.moment[:turns]
        moved, loads = components("u") + turns_of(record, turns), components("f") + moment
        return cls(moved, loads, cartesian(record.axes, dim))

    @property
    def dim(self) -> int:
        """Number of displacements."""
        return len(self.axes)

    def load(self, t: float) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return force and moment (3,) at time t, along the axes of the mesh."""
        return self._vectors(_at(self.loads, t))

    def rotation(self, t: float) -> NDArray[np.floating] | None:
        """Return the prescribed rotation vector (3,) at time t; None if some of it is free."""
        if self.turns_freely:
            return None
        return self._vectors(_at(self.moved, t))[1]

    @property
    def turns_freely(self) -> bool:
        """True if the rotation about some axis is not prescribed, or if there is none."""
        turns = self.moved[self.dim :]
        return not turns or any(value is None for value in turns)

    def directions(self) -> NDArray[np.floating]:
        """Return the directions (m, 3) of the motions, in space."""
        out = np.zeros((len(self.moved), 3))
        out[: self.dim, : self.dim] = self.axes
        turns = out[self.dim :]
        turns[:] = self.axes if self.dim == 3 else np.eye(3)[2] * np.linalg.det(self.axes)
        return out

    def _vectors(self, values: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        along = values[:, None] * self.directions()
        return along[: self.dim].sum(axis=0), along[self.dim :].sum(axis=0)


def spread_of(space: Space, record: Coupling, finite: bool) -> Spread:
    """Return the weighted nodes of a distributing coupling.

    Raises CaseError for nodes without a body, weights that are wrong, and a moment or rotation that they cannot take.
    """
    nodes = space.known(nodes_of(space, record))
    loose = nodes[~space.attached[nodes] & space.mask_own(nodes)]
    if len(loose):
        raise wrong(
            record, f"node {space.mesh.node_number[loose[0]]} belongs to no cell of a body; name nodes of bodies"
        )
    w = _weights(space, record, nodes)
    point = None
    if record.at is not None:
        point = np.zeros(3)
        point[: space.dim] = np.array(record.at) - space.origin[: space.dim]
    there = np.flatnonzero(w)
    if not w.sum() > 0:
        raise wrong(record, f"the weights of its nodes add up to {w.sum():g}; their sum must be > 0")
    spread = Spread.of(nodes[there], w[there], space.local.points[nodes[there]], point, space.dim, finite)
    turned = record.rotation is not None or record.moment is not None or spread.d.any()
    if turned and not spread.turns and not space.model.axisymmetric:
        what = "one point" if spread.gyration <= 1e-12 * space.extent else "on one line, or their weights are too odd"
        raise wrong(record, f"its nodes are {what}, so that they take no moment; name more, or leave at and moment out")
    return spread


def distributing(case: Case) -> Iterator[Coupling]:
    """Yield the distributing couplings of a case."""
    return (record for record in case.coupling if record.kind == "distributing")


def rigid_records(case: Case) -> tuple[Rigid, ...]:
    """Return the rigid bodies of a case, and its rigid couplings of all components as such bodies."""
    return (*case.rigid, *(_as_rigid(one, case.model) for one in case.coupling if is_body(one)))


def rows_of(space: Space, case: Case) -> Iterator[CouplingRows]:
    """Yield the rows of equality of the distributing couplings whose point has a prescribed motion."""
    for record in distributing(case):
        rows = CouplingRows.of(space, record, case.kinematics == "finite")
        if any(value is not None for value in rows.motion.moved):
            yield rows


@dataclass(frozen=True, eq=False)
class CouplingRows:
    """Rows of equality of one distributing coupling: the prescribed displacements of its point, then its rotations."""

    record: Coupling
    spread: Spread
    motion: PointMotion
    n_dof: int

    @classmethod
    def of(cls, space: Space, record: Coupling, finite: bool) -> CouplingRows:
        """Return those of a record, none without prescribed motions. Raises CaseError as `spread_of` does.

        Also for a rotation that is prescribed about some axes only, under finite kinematics.
        """
        turns = turns_of(record, 3)
        if finite and any(turns) and not all(turns):
            message = "a distributing coupling with large rotations turns freely about all axes or about none"
            raise wrong(record, f'{message}; prescribe all of rotation, or take kind = "rigid"')
        return cls(record, spread_of(space, record, finite), PointMotion.of(space, record), space.n_dof)

    @property
    def name(self) -> str:
        """Name of the rows' forces in a state."""
        return force_name(self.record)

    @property
    def linear(self) -> bool:
        """True under small kinematics, where rotations are prescribed, and at the centre of the nodes."""
        return not (self.spread.finite and self._turns_freely)

    @property
    def along(self) -> Ints:
        """Indices of the displacements that are prescribed."""
        return np.array([k for k in range(self.motion.dim) if self.motion.moved[k] is not None], np.int64)

    def carried(self, t: float) -> float:
        """Return the largest displacement that the prescribed motions alone give a node at time t."""
        s, theta = self.spread, self.motion.rotation(t)
        straight = np.array([value.at(t) for value in self.motion.moved[: s.dim] if value is not None])
        turned: Floats = np.zeros(1) if theta is None else np.linalg.norm((s.r - s.d) @ turn(theta).T, axis=1)
        return float(np.linalg.norm(straight) + turned.max())

    @property
    def _turns_freely(self) -> bool:
        return bool(self.motion.turns_freely and self.spread.d.any() and len(self.along))

    def law(self, t: float) -> ContactLaw:
        """Return the law that holds the rows."""
        return Bilateral()

    def at(self, u: Floats, t: float) -> EqualityAt:
        """Return the rows at u (n_dof,) and time t."""
        s, theta = self.spread, self.motion.rotation(t)
        R, K = s.polar(s.shape(u)) if theta is None else self._prescribed(theta, u)
        gaps, rows = self._displacements(u, t, theta, R, K)
        about = [k for k, value in enumerate(self.motion.moved[s.dim :]) if value is not None]
        if about:
            turned = s.r @ R.T
            own = s.r + s.moved(u) if s.finite else s.moved(u)
            E = self.motion.directions()[s.dim :][about][:, s.axes]
            wanted = np.zeros(len(about)) if s.finite else _at(self.motion.moved, t)[s.dim :][about]
            spin = E @ np.linalg.solve(K, (s.w @ np.cross(turned, own))[s.axes])
            gaps = np.append(gaps, s.gyration * (wanted - spin))
            rows = np.concatenate([rows, s.gyration * self._spins(E @ np.linalg.inv(K), turned)])
        return EqualityAt(gaps, self._matrix(rows))

    def curvature(self, u: Floats, t: float, p: Floats) -> csr_array | None:
        """Return the derivative (n_dof, n_dof) of C^T p by u; None where C is constant, or for too many nodes."""
        s = self.spread
        if self.linear or len(s.nodes) > MOST_NODES:
            return None
        F = p[: len(self.along)] @ self.motion.directions()[self.along]
        return on_nodes(s, s.tangent(F, np.zeros(3), s.shape(u)), self.n_dof)

    def _prescribed(self, theta: Floats, u: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return R and K of the prescribed rotation, or of one that is on the way to it from that of the nodes."""
        s = self.spread
        R: Floats = np.eye(3)
        if s.finite:
            R, own = R + turn(theta), s.polar(s.shape(u))[0]
            way = rotation_vector(R @ own.T)
            angle = float(np.linalg.norm(way))
            if angle > _ON_THE_WAY:
                R = own + turn(way * (_ON_THE_WAY / angle)) @ own
        turned = s.r @ R.T
        return R, s.inertia(turned.T @ (s.w[:, None] * turned))

    def _displacements(
        self, u: Floats, t: float, theta: Floats | None, R: Floats, K: Floats
    ) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Return gaps (k,) and coefficients (k, nodes, 3) of the prescribed displacements."""
        s, along = self.spread, self.along
        directions = self.motion.directions()[along]
        wanted = np.array([value.at(t) for value in self.motion.moved[: self.motion.dim] if value is not None])
        rows = np.einsum("i,ks->kis", s.w, directions)
        if theta is None:
            moved: Floats = np.zeros(3)
            moved[: s.dim] = s.point(u)
            if self._turns_freely:
                arms = np.cross(R @ s.d, directions)[:, s.axes]
                rows = rows + self._spins(np.linalg.solve(K, arms.T).T, s.r @ R.T)
        else:
            moved = s.mean(u) + (R @ s.d - s.d if s.finite else np.cross(theta, s.d))
        return wanted - directions @ moved, rows

    def _spins(self, turns: Floats, turned: Floats) -> NDArray[np.floating]:
        """Return coefficients (k, nodes, 3) of turns (k, a) . sum w_i r_i x du_i, with r_i `turned` (nodes, 3)."""
        s = self.spread
        full = np.zeros((len(turns), 3))
        full[:, s.axes] = turns
        return s.w[:, None] * np.cross(full[:, None], turned[None])

    def _matrix(self, rows: Floats) -> csr_array:
        s, row = self.spread, np.arange(len(rows))[:, None, None]
        place = s.dim * s.nodes[:, None] + np.arange(s.dim)
        return sparse((len(rows), self.n_dof), (row, place, rows[:, :, : s.dim]))


@dataclass(frozen=True, eq=False)
class PointLoad:
    """Force and moment at the point of a distributing coupling, as forces of its nodes."""

    record: Coupling
    spread: Spread
    motion: PointMotion
    n_dof: int

    @classmethod
    def of(cls, space: Space, record: Coupling, finite: bool) -> PointLoad:
        """Return that of a record. Raises CaseError as `spread_of` does."""
        return cls(record, spread_of(space, record, finite), PointMotion.of(space, record), space.n_dof)

    @property
    def follows(self) -> bool:
        """True if the forces depend on displacements."""
        return self.spread.finite and (self.record.moment is not None or self.record.at is not None)

    def force(self, t: float, u: Floats | None = None) -> NDArray[np.floating]:
        """Return the nodal forces (n_dof,) at time t and the displacement u (n_dof,), 0 if None."""
        s, out = self.spread, np.zeros(self.n_dof)
        A = s.shape(out if u is None else u)
        out.reshape(-1, s.dim)[s.nodes] = s.forces(*self.motion.load(t), A)[:, : s.dim]
        return out

    def tangent(self, t: float, u: Floats) -> csr_array | None:
        """Return the derivative (n_dof, n_dof) of the forces by u (n_dof,); None without one, and for many nodes."""
        s, (F, M) = self.spread, self.motion.load(t)
        if not self.follows or len(s.nodes) > MOST_NODES or not (M.any() or s.d.any()):
            return None
        return on_nodes(s, s.tangent(F, M, s.shape(u)), self.n_dof)


def is_loaded(record: Coupling) -> bool:
    """True for a distributing coupling with a force or a moment at its point."""
    loads = (record.fx, record.fy, record.fz, record.moment)
    return record.kind == "distributing" and any(value is not None for value in loads)


class CouplingState(NamedTuple):
    """Motion of the point of a coupling, and the force and moment that it exerts on the nodes, about its place.

    `displacement`, `force` (dim,); `rotation`, `moment`: 3 in space, 1 in a plane, none in axisymmetry. Along the axes
    of the mesh.
    """

    displacement: NDArray[np.floating]
    rotation: NDArray[np.floating]
    force: NDArray[np.floating]
    moment: NDArray[np.floating]


def distributing_state(space: Space, rows: CouplingRows, forces: Floats, t: float, u: Floats) -> CouplingState:
    """Return the state of a distributing coupling at u (n_dof,); `forces` (k,): those of its rows, C^T times them."""
    s, turns = rows.spread, not space.model.axisymmetric
    load = PointLoad(rows.record, s, rows.motion, rows.n_dof)
    f = load.force(t, u) + rows.at(u, t).C.T @ forces
    on, moved = np.zeros((len(s.nodes), 3)), s.moved(u) if s.finite else 0.0
    on[:, : s.dim] = f.reshape(-1, s.dim)[s.nodes]
    place = np.zeros(3)
    if s.finite:
        place[: s.dim] = s.point(u)
    moment = np.cross(s.r + moved - s.d - place, on).sum(axis=0)[s.axes]
    rotation = s.rotation(u)
    return CouplingState(
        s.point(u), rotation[: turns * len(rotation)], on.sum(axis=0)[: s.dim], moment[: turns * len(moment)]
    )


def on_nodes(s: Spread, block: Floats, n_dof: int) -> csr_array:
    """Return a block (k dim, k dim) of the nodes as a matrix (n_dof, n_dof)."""
    return sparse_blocks(n_dof, [((s.dim * s.nodes[:, None] + np.arange(s.dim)).ravel(), block)])


def equations_of(space: Space, case: Case) -> Iterator[Equations]:
    """Yield the equations of rigid couplings of some components.

    Raises CaseError for free finite rotations, and for motions that no node follows.
    """
    for record in case.coupling:
        if record.kind == "rigid" and not is_body(record):
            one = _Followed.of(space, record, case.kinematics == "finite")
            if one.finite and one.motion.turns_freely:
                message = "a rigid coupling with components or axes needs prescribed finite rotations"
                raise wrong(record, f"{message}; give its rotation about all axes, or remove components and axes")
            yield one.equations(space)


@dataclass(frozen=True, eq=False)
class _Followed:
    """Equations of a rigid coupling of some components: rows a . u_i = sum_k m_k b_ik, node by node.

    `nodes` (k,), `arm` (k, 3) from the point; `along` (c, 3): the components a; `by_motion` (k c, m): b, lengths per
    unit of each motion, whose units are `unit` (m,).
    """

    record: Coupling
    motion: PointMotion
    nodes: Ints
    arm: NDArray[np.floating]
    along: NDArray[np.floating]
    by_motion: NDArray[np.floating]
    unit: NDArray[np.floating]
    finite: bool = False

    @classmethod
    def of(cls, space: Space, record: Coupling, finite: bool = False) -> _Followed:
        """Return those of a record."""
        nodes, motion, dim = space.known(nodes_of(space, record)), PointMotion.of(space, record), space.dim
        x = space.local.points[nodes]
        point = x.mean(axis=0)
        if record.at is not None:
            point[:dim] = np.array(record.at) - space.origin[:dim]
        kept = [k for k in range(dim) if record.components is None or f"u{_AXES[k]}" in record.components]
        directions, arm = motion.directions(), x - point
        far = float(np.linalg.norm(arm, axis=1).max()) or 1.0
        unit = np.repeat([1.0, 1 / far], [dim, len(directions) - dim])
        straight = np.tile(directions[:dim], (len(nodes), 1, 1))
        turned = np.cross(directions[dim:], arm[:, None]).reshape(len(nodes), -1, 3)
        moved = np.concatenate([straight, turned], axis=1)
        by_motion = np.einsum("ks,ims->ikm", directions[kept], moved).reshape(-1, len(directions)) * unit
        turns = finite and not space.model.axisymmetric
        return cls(record, motion, nodes, arm, directions[kept], by_motion, unit, turns)

    def equations(self, space: Space) -> Equations:
        """Return the equations, with the free motions as further unknowns. Raises CaseError."""
        free, motion = self.free, self.motion
        row = np.arange(len(self.by_motion)).reshape(len(self.nodes), -1, 1)
        column = space.dofs(self.nodes)[:, None]
        C = sparse((len(self.by_motion), space.n_dof), (row, column, self.along[:, : space.dim]))

        def held(t: float) -> NDArray[np.floating]:
            m = _at(motion.moved, t)
            theta = motion.rotation(t) if self.finite else None
            if theta is None:
                return self.by_motion @ (m / self.unit)
            m[motion.dim :] = 0.0
            turned = self.arm @ turn(theta).T
            return self.by_motion @ (m / self.unit) + np.einsum("is,ks->ik", turned, self.along).ravel()

        def forces(t: float) -> NDArray[np.floating]:
            return (_at(motion.loads, t) * self.unit)[free]

        said, E = partial(in_words, self.record), csr_array(-self.by_motion[:, free])
        return Equations(
            force_name(self.record), C, held, said, E if len(free) else None, forces if len(free) else None
        )

    @cached_property
    def free(self) -> Ints:
        """Indices of the motions that are further unknowns. Raises CaseError."""
        return _free_motions(self.record, self.motion, self.by_motion)


def followed_state(
    space: Space, record: Coupling, forces: Floats, further: Floats, t: float, u: Floats | None = None
) -> CouplingState:
    """Return the state of a rigid coupling of some components; `forces`: of its equations, `further`: unknowns.

    `u` (n_dof,): displacement under finite kinematics.
    """
    one = _Followed.of(space, record)
    motion, dim, turns = _at(one.motion.moved, t), space.dim, len(one.unit) - space.dim
    motion[one.free] = further * one.unit[one.free]
    directions = one.motion.directions()
    f = np.einsum("ik,ks->is", forces.reshape(len(one.nodes), -1), one.along)
    axes = [0, 1, 2] if dim == 3 else [2]
    arm = one.arm.copy()
    if u is not None:
        arm[:, :dim] += u[space.dofs(one.nodes)] - (motion[:dim] @ directions[:dim])[:dim]
    moment = np.cross(arm, f).sum(axis=0)[axes][:turns]
    rotation = (motion[dim:] @ directions[dim:])[axes][:turns]
    return CouplingState((motion[:dim] @ directions[:dim])[:dim], rotation, f.sum(axis=0)[:dim], moment)


def _at(values: Sequence[Value | None], t: float) -> NDArray[np.floating]:
    return np.array([0.0 if value is None else value.at(t) for value in values])


def _free_motions(record: Coupling, motion: PointMotion, by_motion: Floats) -> Ints:
    """Return the indices of the motions that are further unknowns: those that nodes follow, and that are not given.

    `by_motion` (rows, m). Raises CaseError for a load or a displacement on a motion that no node follows.
    """
    size = np.linalg.norm(by_motion, axis=0)
    names = [*(f"{{}}{axis}" for axis in _AXES[: motion.dim]), *(["{}"] * (len(size) - motion.dim))]
    for k in np.flatnonzero(size <= _STILL * size.max()):
        for values, letter, about in ((motion.moved, "u", "rotation"), (motion.loads, "f", "moment")):
            if values[k] is not None and values[k].source != 0:  # type: ignore[union-attr]
                name = names[k].format(letter if k < motion.dim else about)
                raise wrong(
                    record, f"no node follows its {name}, with these components; leave it out, or add components"
                )
    free = np.array(
        [k for k in range(len(size)) if motion.moved[k] is None and size[k] > _STILL * size.max()], np.int64
    )
    if len(free) and np.linalg.matrix_rank(by_motion[:, free], tol=_STILL * size.max()) < len(free):
        message = "its nodes are on one line, or have too few components, so that some motion of the point moves none"
        raise wrong(record, f"{message}; prescribe its rotation, or name more nodes")
    return free


def force_name(record: Coupling) -> str:
    """Return the name of a coupling's forces in a state; equations may have the same group."""
    return f"coupling {record.name}"


def is_body(record: Coupling) -> bool:
    """True for a rigid coupling that is a rigid body."""
    return record.kind == "rigid" and record.axes is None and record.components is None


def _as_rigid(record: Coupling, model: str) -> Rigid:
    """Return a rigid coupling as the record of a rigid body, whose motions are free unless they are given."""
    axes = {"3d": "xyz", "axisymmetric": "y"}.get(model, "xy")
    given = {name: getattr(record, name) for a in axes for name in ("u" + a, "f" + a)}
    loads = {"f" + a: Value(0.0) for a in axes if given["u" + a] is None and given["f" + a] is None}
    turns = {} if model == "axisymmetric" else {"rotation": record.rotation, "moment": record.moment}
    if turns and record.rotation is None and record.moment is None:
        turns["moment"] = (Value(0.0),) * (3 if model == "3d" else 1)
    at = {} if model == "axisymmetric" else {"centre": record.at}
    keys = {name: value for name, value in {**given, **loads, **turns, **at}.items() if value is not None}
    return Rigid(group=record.group, **keys).altered(name=record.name, place=record.place)


def _weights(space: Space, record: Coupling, nodes: Ints) -> NDArray[np.floating]:
    """Return the weights (k,) of the nodes of a distributing coupling. Raises CaseError."""
    if isinstance(record.weights, Value):
        return record.weights(space.mesh.points[nodes][:, : space.dim], 0.0)
    if record.weights is None:
        cells = cells_of(space, record)
        if cells is None:
            return np.where(space.made_by_cut[nodes], 0.0, 1.0)
        return nodal_measures(space, cells)[nodes]
    given = {int(number): weight for number, weight in record.weights}
    numbers = space.mesh.node_number[nodes].tolist()
    odd = [number for number in given if number not in numbers]
    if odd:
        raise wrong(record, f"its weights name node {odd[0]}, which is not in the group {record.group!r}")
    return np.array([given.get(number, 0.0) for number in numbers])
