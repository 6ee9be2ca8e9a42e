"""Motions of whole bodies, and what they are called.

A twist is the displacement t of a body's centre c and its rotation theta, both as vectors of three: u = t + theta x
(X - c), of which a model has some: in a plane t_x, t_y and theta_z, in axisymmetry t_y. A motion is a twist of each of
some bodies. A space of motions has many bases; `plain_motions` picks one whose members a person can name: one body
alone, body by body, then all as one, then what is left; of each, translations before rotations, along the axes where
these are among them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacsolver.space.space import Space

#: of a unit motion: what is below this is none, and what is within it of an axis is along it
_NONE = 1e-6


@dataclass(frozen=True, eq=False)
class Body:
    """What moves as one: `name` in a sentence, `nodes` that it moves, its `centre` (3,) and `radius`, a length."""

    name: str
    nodes: Ints
    centre: Floats
    radius: float


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A motion of some bodies of a space: `twists` (b, 6) are t and theta of each. The largest t or r theta is 1."""

    space: Space
    bodies: tuple[Body, ...]
    twists: NDArray[np.floating]

    @cached_property
    def nodes(self) -> Ints:
        """(k,): the nodes that move, body by body."""
        return np.concatenate([body.nodes for body in self.bodies])

    @cached_property
    def at_nodes(self) -> NDArray[np.floating]:
        """(k, dim): the displacement of `nodes`."""
        return self.at(self.space.local.points)

    def at(self, x: Floats) -> NDArray[np.floating]:
        """(k, dim): the same where the mesh's nodes are at x (n_nodes, 3)."""
        moved = [
            twist[:3] + np.cross(twist[3:], x[body.nodes] - body.centre)
            for body, twist in zip(self.bodies, self.twists, strict=True)
        ]
        return np.concatenate(moved)[:, : self.space.dim]

    @property
    def field(self) -> NDArray[np.floating]:
        """(n_dof,): the displacement of all nodes."""
        u = np.zeros((self.space.mesh.n_nodes, self.space.dim))
        u[self.nodes] = self.at_nodes
        return u.ravel()


def describe(motion: FreeMotion) -> str:
    """A motion in words, who and how: `'punch' moves along x`; bodies that move alike are named together."""
    alike: dict[tuple[str, str], list[str]] = {}
    for body, twist in zip(motion.bodies, motion.twists, strict=True):
        alike.setdefault(_words(motion, body, twist), []).append(body.name)
    parts = []
    for (verb, how), names in alike.items():
        who = f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]
        parts.append(f"{who} {verb if len(names) == 1 else verb[:-1]} {how}")
    return " while ".join(parts)


def plain_motions(space: Space, bodies: Sequence[Body], twists: Floats) -> Iterator[FreeMotion]:
    """Motions that span those given (k, b, 6), linearly independent, in plain words: see the module."""
    scale = _scale(bodies)
    Z = _orthonormal((twists * scale).reshape(len(twists), -1))
    found = np.empty((0, Z.shape[1]))
    for z in (*_alone(Z), *_as_one(Z, bodies)):
        new = z - (found @ z) @ found
        if np.linalg.norm(new) > _NONE * np.linalg.norm(z):
            found = np.vstack([found, new / np.linalg.norm(new)])
            yield _motion(space, bodies, z.reshape(-1, 6) / scale)
    for z in _others(np.linalg.svd(Z @ found.T)[0][:, len(found) :].T @ Z):
        yield _motion(space, bodies, z.reshape(-1, 6) / scale)


def _alone(Z: Floats) -> Iterator[Floats]:
    """The motions of one body while all others stay, that rows Z (k, 6 b), orthonormal, span; body by body."""
    for first in range(0, Z.shape[1], 6):
        for twist in _plain(_shared(np.eye(6), Z[:, first : first + 6])):
            yield np.pad(twist, (first, Z.shape[1] - first - 6))


def _as_one(Z: Floats, bodies: Sequence[Body]) -> Iterator[Floats]:
    """The motions of all bodies as one that rows Z (k, 6 b), orthonormal, span."""
    unit = np.eye(6) / _scale(bodies[:1]).T
    moved = [unit[:, :3] + np.cross(unit[:, 3:], body.centre - bodies[0].centre) for body in bodies]
    whole = np.hstack([np.hstack([t, unit[:, 3:]]) * scale for t, scale in zip(moved, _scale(bodies), strict=True)])
    basis = _orthonormal(whole)
    inside = _shared(basis, Z @ basis.T)
    if len(inside):
        yield from (twist @ whole for twist in _plain(_orthonormal(inside[:, :6])))


def _shared(basis: Floats, along: Floats) -> NDArray[np.floating]:
    """Vectors of an orthonormal basis (r, n) that another space has too, given its own basis along this one (k, r)."""
    _, s, Vt = np.linalg.svd(along)
    return Vt[: int((s > 1 - _NONE**2 * 100).sum())] @ basis


def _others(rest: Floats) -> Iterator[Floats]:
    """A basis of what orthonormal rows (k, 6 b) span: those that move the first body, then those that do not, ..."""
    for first in range(0, rest.shape[1], 6):
        U, s, Vt = np.linalg.svd(rest[:, first : first + 6])
        rank = int((s > _NONE).sum())
        for twist in _plain(Vt[:rank]):
            yield (U[:, :rank] * (Vt[:rank] @ twist / s[:rank])).sum(axis=1) @ rest
        rest = U[:, rank:].T @ rest


def _scale(bodies: Sequence[Body]) -> Floats:
    """(b, 6): makes displacements of twists."""
    return np.array([[1.0, 1.0, 1.0, *(3 * [body.radius])] for body in bodies])


def _motion(space: Space, bodies: Sequence[Body], twists: Floats) -> FreeMotion:
    """The motion of those bodies that it moves."""
    size = np.abs(twists * _scale(bodies))
    twists = np.where(size > _NONE * 1e-3 * size.max(), twists, 0.0) / size.max()
    moved = [k for k in range(len(bodies)) if size[k].max() > _NONE * size.max()]
    return FreeMotion(space, tuple(bodies[k] for k in moved), twists[moved])


def _orthonormal(rows: Floats) -> NDArray[np.floating]:
    """An orthonormal basis of the space that rows (k, n) span; all of them are independent."""
    return np.linalg.qr(rows.T)[0].T


def _plain(Y: Floats) -> Iterator[Floats]:
    """A basis of the space of twists of one body that orthonormal rows Y (r, 6) span: translations, then rotations."""
    U, s, Vt = np.linalg.svd(Y[:, 3:])
    turns = int((s > _NONE).sum())
    for axis in _axes((U[:, turns:].T @ Y)[:, :3]):
        yield np.concatenate([axis, np.zeros(3)])
    for axis in _axes(Vt[:turns]):
        yield (U[:, :turns] * (Vt[:turns] @ axis / s[:turns])).sum(axis=1) @ Y


def _axes(S: Floats) -> Iterator[Floats]:
    """Orthonormal directions that span orthonormal rows S (p, 3): the axes among them, then those next to axes."""
    left = S.T @ S
    found: list[Floats] = []
    while len(found) < len(S):
        along = np.sqrt(np.maximum(np.diagonal(left), 0.0))
        k = int((along > along.max() - _NONE).argmax())
        v = np.eye(3)[k] if along[k] > 1 - _NONE**2 else left[k] / along[k]
        found.append(v / np.linalg.norm(v))
        left = left - np.outer(left @ v, v)
        left = left - np.outer(v, v @ left)
        yield found[-1]


def _words(motion: FreeMotion, body: Body, twist: Floats) -> tuple[str, str]:
    """A body's part of a motion: the verb, and how. An axis is given by its point next to the first body's centre."""
    dim, t, theta = motion.space.dim, twist[:3], twist[3:]
    angle = float(np.linalg.norm(theta))
    if angle * body.radius <= _NONE * np.abs(t).max():
        return "moves", f"along {_direction(t, dim)}"
    where = body.centre + np.cross(theta, t) / angle**2
    where = where + ((motion.bodies[0].centre - where) @ theta) / angle**2 * theta
    place = f"({', '.join(motion.space.told(where + motion.space.origin, 4))})"
    if dim == 2:
        return "turns", f"about the point {place}"
    axis = f"an axis along {_direction(theta, dim)} through {place}"
    pitch = float(t @ theta) / angle**2
    if abs(pitch) <= _NONE * body.radius:
        return "turns", f"about {axis}"
    return "screws", f"about {axis}, {pitch:.4g} forward a radian"


def _direction(v: Floats, dim: int) -> str:
    """`x`, `-y`, or the unit vector."""
    unit = v / np.linalg.norm(v)
    k = int(np.abs(unit).argmax())
    if abs(unit[k]) > 1 - _NONE**2:
        return ("" if unit[k] > 0 else "-") + "xyz"[k]
    unit = np.where(np.abs(unit) > _NONE, unit, 0.0)
    return f"({', '.join(f'{c:.4g}' for c in unit[:dim])})"
