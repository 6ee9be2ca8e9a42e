"""Displacement and velocity that [[initial]] gives to the nodes, and the unknowns that fit them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints, mask_of
from lacsolver.case import Case, CaseError, Initial
from lacsolver.constraints.rigid import moments
from lacsolver.problem.problem import Problem
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: relative error up to which prescribed displacements allow an initial motion
_SAME = 1e-6


class Given(NamedTuple):
    """A field of [[initial]]: `values` (n_nodes, dim), and the components that are `given`, with their `record`.

    `record` (n_nodes, dim): index of the last record that gives each component, -1 for none.
    """

    values: NDArray[np.floating]
    record: Ints


def initial_motion(space: Space, case: Case, t: float) -> tuple[Given, Given]:
    """Return the displacements and the velocities that a case gives at its start. Raises CaseError for empty groups.

    Several processes have them at all their nodes.
    """
    shape = space.mesh.n_nodes, space.dim
    given = Given(np.zeros(shape), np.full(shape, -1)), Given(np.zeros(shape), np.full(shape, -1))
    for number, record in enumerate(case.initial):
        nodes = _nodes(space, record)
        x = space.mesh.points[nodes, : space.dim]
        turned = _turned(space, record, nodes, t)
        for field, letter, more in zip(given, "uv", (None, turned), strict=True):
            for k, axis in enumerate("xyz"[: space.dim]):
                value = getattr(record, letter + axis)
                if value is None and more is None:
                    continue
                field.values[nodes, k] = 0.0 if value is None else value(x, t)
                field.values[nodes, k] += 0.0 if more is None else more[:, k]
                field.record[nodes, k] = number
    displacements, velocities = (
        Given(space.share.update(values), space.share.update(record.astype(float)).astype(np.int64))
        for values, record in given
    )
    return displacements, velocities


def fitted(problem: Problem, given: Given, prescribed: Floats, what: str) -> NDArray[np.floating]:
    """Return unknowns q (n_q,) with T q + prescribed = the given values, where they are given; 0 elsewhere.

    `prescribed` (n_dof,): what prescribed displacements give. Raises CaseError where these contradict.
    """
    space = problem.space
    there = given.record.ravel() >= 0
    wanted = np.where(there, given.values.ravel(), prescribed)
    q = problem.constraints.unknowns(wanted - prescribed)
    off = np.where(there, np.abs(problem.constraints.T @ q + prescribed - wanted), 0.0)
    mine = space.attached | _rigid(problem)
    off[~np.repeat(mine if space.share.own is None else mine & space.share.own, space.dim)] = 0.0
    bad = np.flatnonzero(off > _SAME * space.largest(wanted))
    space.share.agree(_excluded(problem, given, bad, what) if len(bad) else None)
    return q


def _excluded(problem: Problem, given: Given, bad: Ints, what: str) -> CaseError:
    """Return the error for given values that prescribed displacements exclude; `bad` (k,): their places in u."""
    nodes = np.unique(bad // problem.space.dim)
    record = problem.case.initial[given.record.ravel()[bad[0]]]
    message = (
        f"gives nodes {some(problem.space.mesh.node_number[nodes])} a {what} that prescribed displacements exclude"
    )
    return wrong(record, f"{message}; name groups without them, or make both equal")


def jumps(problem: Problem) -> list[str]:
    """Return a warning about prescribed displacements that begin with a jump, where none are given by [[initial]]."""
    space, how = problem.space, problem.case.dynamics
    if how is None or how.start > 0:
        return []
    given, _ = initial_motion(space, problem.case, 0.0)
    moved = np.where(given.record < 0, problem.constraints.u0(0.0).reshape(-1, space.dim), 0.0)
    far = np.linalg.norm(space.own(moved.ravel()), axis=1)
    most, own = space.share.largest(float(far.max(initial=0.0))), space.own_nodes(np.arange(space.mesh.n_nodes))
    if not most:
        return []
    nodes = some(space.share.gather(space.mesh.node_number[own[far > 0]]))
    message = f"prescribed displacements move nodes {nodes} by up to {most:.4g} at once when motion starts"
    return [f"{message}; write formulas of t that begin at 0, or let inertia act from a later [dynamics] start on"]


def _rigid(problem: Problem) -> NDArray[np.bool_]:
    return mask_of(problem.space.mesh.n_nodes, *(body.nodes for body in problem.constraints.rigid))


def _nodes(space: Space, record: Initial) -> Ints:
    if record.groups is None:
        return np.flatnonzero(space.attached)
    nodes = space.mesh.nodes_on(np.unique(np.concatenate([space.mesh.cells_of(name) for name in record.groups])))
    if not space.share.total(np.array(len(nodes))):
        raise wrong(record, f"the groups {', '.join(map(repr, record.groups))} are empty; name some that have cells")
    return nodes


def _turned(space: Space, record: Initial, nodes: Ints, t: float) -> NDArray[np.floating] | None:
    """Return the velocities (k, dim) of a record's rotation; None if it has none."""
    if record.rotation is None:
        return None
    x = space.local.points[nodes]
    own = space.local.points[space.own_nodes(nodes)]
    centre = space.share.total(own.sum(axis=0)) / space.share.total(np.array(len(own)))
    if record.centre is not None:
        centre[: space.dim] = np.array(record.centre) - space.origin[: space.dim]
    return np.asarray(moments(space.dim, x - centre) @ np.array([value.at(t) for value in record.rotation]))
