"""Rigid-body motions of several bodies, and their description in words.

A twist is the displacement t of a body's centre c and its rotation theta, both with three components: u = t + theta x
(X - c). A model has some of these components: in a plane t_x, t_y and theta_z, in axisymmetry t_y. A motion consists of
a twist of each of some bodies. A space of motions has many bases; `plain_motions` chooses one that can be described
simply: motions of one body alone, body by body, then of all bodies together, then the others; in each group
translations before rotations, along the coordinate axes if possible.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacsolver.space.space import Space

#: tolerance relative to a unit motion: smaller components are 0, and directions closer to an axis are along it
_NONE = 1e-6


@dataclass(frozen=True, eq=False)
class Body:
    """A body that can move rigidly: `name` in a sentence, its `nodes`, `centre` (3,) and `radius`, a length."""

    name: str
    nodes: Ints
    centre: Floats
    radius: float


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A motion of some bodies of a space. `twists` (b, 6): t and theta of each; the largest t or r theta is 1."""

    space: Space
    bodies: tuple[Body, ...]
    twists: NDArray[np.floating]

    @cached_property
    def nodes(self) -> Ints:
        """The nodes that move, body by body, (k,)."""
        return np.concatenate([body.nodes for body in self.bodies])

    @cached_property
    def at_nodes(self) -> NDArray[np.floating]:
        """The displacement of `nodes` in the undeformed configuration, (k, dim)."""
        return self.at(self.space.local.points)

    def at(self, x: Floats) -> NDArray[np.floating]:
        """Return the displacement (k, dim) of `nodes` if the mesh's nodes are at x (n_nodes, 3)."""
        moved = [
            twist[:3] + np.cross(twist[3:], x[body.nodes] - body.centre)
            for body, twist in zip(self.bodies, self.twists, strict=True)
        ]
        return np.concatenate(moved)[:, : self.space.dim]

    @property
    def field(self) -> NDArray[np.floating]:
        """The displacement of all nodes, (n_dof,)."""
        u = np.zeros((self.space.mesh.n_nodes, self.space.dim))
        u[self.nodes] = self.at_nodes
        return u.ravel()


def describe(motion: FreeMotion) -> str:
    """Describe a motion in words: `'punch' moves along x`; bodies with the same motion are named together."""
    return " while ".join(f"{who} {what} {how}" for who, what, how in _parts(motion))


def _parts(motion: FreeMotion) -> list[tuple[str, str, str]]:
    """Return the names of bodies that move alike, their verb, and their direction or axis, of each part of a motion."""
    alike: dict[tuple[str, str], list[str]] = {}
    for body, twist in zip(motion.bodies, motion.twists, strict=True):
        alike.setdefault(_words(motion, body, twist), []).append(body.name)
    return [
        (f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0],
         verb if len(names) == 1 else verb[:-1], how)
        for (verb, how), names in alike.items()
    ]  # fmt: skip


def unheld(motions: Sequence[FreeMotion]) -> str:
    """Return the sentence on motions that nothing holds; those of the same bodies stand together, without places."""
    ways: dict[str, list[str]] = {}
    for motion in motions:
        (who, verb, how), *others = _parts(motion)
        if others:
            who, verb, how = describe(motion), "", ""
        ways.setdefault(who, []).append(
            f" {verb} {how}" if len(motions) == 1 else f" {verb} {how.split(' through ')[0]}"
        )
    every = 6 if motions[0].space.dim == 3 else 3
    clauses = [f"{who}{': every motion' if len(how) == every else ','.join(how)}".rstrip() for who, how in ways.items()]
    return f"nothing supports a part of the model: {'; '.join(clauses)}; add a displacement, a spring or a contact"


def plain_motions(space: Space, bodies: Sequence[Body], twists: Floats) -> Iterator[FreeMotion]:
    """Yield a basis of the space of motions that the given ones (k, b, 6) span, easy to describe: see the module."""
    scale = _scale(bodies)
    Z = _orthonormal((twists * scale).reshape(len(twists), -1))
    basis = np.empty((0, Z.shape[1]))
    for z in (*_alone(Z), *_as_one(Z, bodies)):
        new = z - (basis @ z) @ basis
        if np.linalg.norm(new) > _NONE * np.linalg.norm(z):
            basis = np.vstack([basis, new / np.linalg.norm(new)])
            yield _motion(space, bodies, z.reshape(-1, 6) / scale)
    for z in _others(np.linalg.svd(Z @ basis.T)[0][:, len(basis) :].T @ Z):
        yield _motion(space, bodies, z.reshape(-1, 6) / scale)


def _alone(Z: Floats) -> Iterator[Floats]:
    """Yield the motions of one body alone in the span of the orthonormal rows Z (k, 6 b), body by body."""
    for first in range(0, Z.shape[1], 6):
        for twist in _plain(_shared(np.eye(6), Z[:, first : first + 6])):
            yield np.pad(twist, (first, Z.shape[1] - first - 6))


def _as_one(Z: Floats, bodies: Sequence[Body]) -> Iterator[Floats]:
    """Yield the rigid motions of all bodies together in the span of the orthonormal rows Z (k, 6 b)."""
    unit = np.eye(6) / _scale(bodies[:1]).T
    moved = [unit[:, :3] + np.cross(unit[:, 3:], body.centre - bodies[0].centre) for body in bodies]
    whole = np.hstack([np.hstack([t, unit[:, 3:]]) * scale for t, scale in zip(moved, _scale(bodies), strict=True)])
    basis = _orthonormal(whole)
    inside = _shared(basis, Z @ basis.T)
    if len(inside):
        yield from (twist @ whole for twist in _plain(_orthonormal(inside[:, :6])))


def _shared(basis: Floats, along: Floats) -> NDArray[np.floating]:
    """Return the intersection of the span of an orthonormal basis (r, n) with another space.

    `along` (k, r): products of the other space's orthonormal basis with this one.
    """
    _, s, Vt = np.linalg.svd(along)
    return Vt[: int((s > 1 - _NONE**2 * 100).sum())] @ basis


def _others(rest: Floats) -> Iterator[Floats]:
    """Yield a basis of the span of orthonormal rows (k, 6 b): motions of the first body, then those without it, ..."""
    for first in range(0, rest.shape[1], 6):
        U, s, Vt = np.linalg.svd(rest[:, first : first + 6])
        rank = int((s > _NONE).sum())
        for twist in _plain(Vt[:rank]):
            yield (U[:, :rank] * (Vt[:rank] @ twist / s[:rank])).sum(axis=1) @ rest
        rest = U[:, rank:].T @ rest


def _scale(bodies: Sequence[Body]) -> Floats:
    """Return the factors (b, 6) that turn twists into displacements."""
    return np.array([[1.0, 1.0, 1.0, *(3 * [body.radius])] for body in bodies])


def _motion(space: Space, bodies: Sequence[Body], twists: Floats) -> FreeMotion:
    """Return the motion, without the bodies that it does not move."""
    size = np.abs(twists * _scale(bodies))
    twists = np.where(size > _NONE * 1e-3 * size.max(), twists, 0.0) / size.max()
    moved = [k for k in range(len(bodies)) if size[k].max() > _NONE * size.max()]
    return FreeMotion(space, tuple(bodies[k] for k in moved), twists[moved])


def _orthonormal(rows: Floats) -> NDArray[np.floating]:
    """Return an orthonormal basis of the span of linearly independent rows (k, n)."""
    return np.linalg.qr(rows.T)[0].T


def _plain(Y: Floats) -> Iterator[Floats]:
    """Yield a basis of the span of orthonormal twists Y (r, 6) of one body: translations, then rotations."""
    U, s, Vt = np.linalg.svd(Y[:, 3:])
    turns = int((s > _NONE).sum())
    for axis in _axes((U[:, turns:].T @ Y)[:, :3]):
        yield np.concatenate([axis, np.zeros(3)])
    for axis in _axes(Vt[:turns]):
        yield (U[:, :turns] * (Vt[:turns] @ axis / s[:turns])).sum(axis=1) @ Y


def _axes(S: Floats) -> Iterator[Floats]:
    """Yield an orthonormal basis of the span of orthonormal rows S (p, 3): axes in it, then directions near axes."""
    left = S.T @ S
    axes: list[Floats] = []
    while len(axes) < len(S):
        along = np.sqrt(np.maximum(np.diagonal(left), 0.0))
        k = int((along > along.max() - _NONE).argmax())
        v = np.eye(3)[k] if along[k] > 1 - _NONE**2 else left[k] / along[k]
        axes.append(v / np.linalg.norm(v))
        left = left - np.outer(left @ v, v)
        left = left - np.outer(v, v @ left)
        yield axes[-1]


def _words(motion: FreeMotion, body: Body, twist: Floats) -> tuple[str, str]:
    """Return the verb for a body's part of a motion, and its direction or axis in words.

    An axis is given by its point nearest to the first body's centre.
    """
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
    """Return a direction as `x`, `-y`, or the unit vector."""
    unit = v / np.linalg.norm(v)
    k = int(np.abs(unit).argmax())
    if abs(unit[k]) > 1 - _NONE**2:
        return ("" if unit[k] > 0 else "-") + "xyz"[k]
    unit = np.where(np.abs(unit) > _NONE, unit, 0.0)
    return f"({', '.join(f'{c:.4g}' for c in unit[:dim])})"
