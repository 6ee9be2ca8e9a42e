"""States of the whole model, as they are written, from and for the shares of several processes.

Unknowns of the whole are in the order of the model's nodes, as one process alone has them, so that a run may go on with
any number of processes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import RequestError
from lacmesh.mesh import Floats, Ints
from lacsolver.constraints import Constraints
from lacsolver.results.results import Restart
from lacsolver.results.state import Iterate


def whole_restart(constraints: Constraints, state: Restart) -> Restart:
    """Return a state with the displacements and unknowns of the whole model; only the first process has all of them."""
    if constraints.own is None:
        return state
    unknowns = _Order(constraints, constraints.own, constraints.node_of_unknown)
    dofs = _Order(constraints, *_of_dofs(constraints))

    def whole(now: Iterate) -> Iterate:
        return now._replace(q=unknowns.collect(now.q))

    step = state.step
    assert step.iterate is not None
    earlier = None if step.earlier is None else (step.earlier[0], whole(step.earlier[1]))
    return replace(state, u=dofs.collect(state.u), step=replace(step, iterate=whole(step.iterate), earlier=earlier))


def share_of_restart(constraints: Constraints, state: Restart) -> Restart:
    """Return the share of this process in a state of the whole model, which every process has read."""
    if constraints.own is None:
        return state
    if state.step.histories.materials or state.step.histories.scheme:
        raise RequestError("a state with histories of materials goes on in one process only")
    unknowns = _Order(constraints, constraints.own, constraints.node_of_unknown)
    dofs = _Order(constraints, *_of_dofs(constraints))

    def own(now: Iterate) -> Iterate:
        q, T = unknowns.deal(now.q), constraints.T
        return now._replace(q=T.T @ constraints.space.updated(T @ q))

    step = state.step
    assert step.iterate is not None
    earlier = None if step.earlier is None else (step.earlier[0], own(step.earlier[1]))
    u = constraints.space.updated(dofs.deal(state.u))
    return replace(state, u=u, step=replace(step, iterate=own(step.iterate), earlier=earlier))


def _of_dofs(constraints: Constraints) -> tuple[NDArray[np.bool_], Ints]:
    """Return which displacements (n_dof,) are this process's own, and the node of each."""
    space = constraints.space
    assert space.share.own is not None
    return np.repeat(space.share.own, space.dim), np.repeat(np.arange(space.mesh.n_nodes), space.dim)


class _Order:
    """The places in the whole model of values at own nodes: `own` (n,) tells which are, `node` (n,) their nodes."""

    def __init__(self, constraints: Constraints, own: NDArray[np.bool_], node: Ints) -> None:
        self._share, self._own = constraints.space.share, np.flatnonzero(own)
        assert self._share.node is not None
        self._counts = self._share.gather(np.array([len(self._own)]))
        self._order = np.argsort(self._share.collect(self._share.node[node[self._own]]), kind="stable")
        self._n = len(own)

    def collect(self, values: Floats) -> NDArray[np.floating]:
        """Return the values of the whole model from those of each process, on the first process."""
        return self._share.collect(values[self._own])[self._order]

    def deal(self, values: Floats) -> NDArray[np.floating]:
        """Return the values (n,) of this process from those of the whole model, 0 where others own them."""
        mixed = np.empty_like(values)
        if self._share.rank == 0:
            mixed[self._order] = values
        out = np.zeros(self._n)
        out[self._own] = self._share.deal(mixed, self._counts)
        return out
