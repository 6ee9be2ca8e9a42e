"""Equations of the case: sums of displacements of nodes, and displacements that all nodes of a group share."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints
from lacsolver.case.case import Case
from lacsolver.case.joints import Equation
from lacsolver.case.keys import Section
from lacsolver.case.records import AtNodes
from lacsolver.constraints.coupling import rigid_records
from lacsolver.constraints.equations import Equations
from lacsolver.space.places import in_words, nodes_of, wrong
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse

_COMPONENTS = ("ux", "uy", "uz")


def equations_of(space: Space, case: Case) -> Iterator[Equations]:
    """Yield the equations of the [[equation]] of a case.

    Raises CaseError for nodes that are missing, that neither a body nor a rigid body has, and for groups of several
    nodes where one is meant.
    """
    moved = space.attached.copy()
    for body in rigid_records(case):
        moved[nodes_of(space, body)] = True
    for record in case.equation:
        if record.terms is None:
            nodes = nodes_of(space, record)
            _check_moved(space, record, nodes, moved)
            yield _shared(space, record, nodes)
        else:
            nodes = np.array([_node(space, record, term) for term in record.terms])
            _check_moved(space, record, nodes, moved)
            yield _sum(space, record, nodes)


def carried(record: Equation, forces: Floats) -> float:
    """Return the force of an equation, of the `forces` (k,) of its rows: it acts on each term times its factor.

    For shared displacements, the forces that pass between the nodes: half the sum of their magnitudes.
    """
    if record.terms is not None:
        return float(forces[0])
    by_component = forces.reshape(-1, len(record.same or ()))
    return float((np.abs(by_component).sum() + np.abs(by_component.sum(axis=0)).sum()) / 2)


def _sum(space: Space, record: Equation, nodes: Ints) -> Equations:
    assert record.terms is not None
    along = np.array([_COMPONENTS.index(term["component"]) for term in record.terms])
    factors = np.array([term["factor"] for term in record.terms])
    C = sparse((1, space.n_dof), (0, space.dim * nodes + along, factors))
    return Equations(record.name, C, partial(_value, record), partial(in_words, record))


def _value(record: Equation, t: float) -> NDArray[np.floating]:
    return np.array([0.0 if record.value is None else record.value.at(t)])


def _shared(space: Space, record: Equation, nodes: Ints) -> Equations:
    assert record.same is not None
    along = np.array([_COMPONENTS.index(name) for name in record.same])
    first, others = space.dim * nodes[0] + along, (space.dim * nodes[1:, None] + along).ravel()
    rows = np.arange(len(others))
    firsts = np.tile(first, len(nodes) - 1)
    C = sparse((len(others), space.n_dof), (rows, others, 1.0), (rows, firsts, -1.0))
    return Equations(record.name, C, lambda t: np.zeros(len(others)), partial(in_words, record), may_follow=True)


def _node(space: Space, record: Equation, term: Mapping[str, Any]) -> int:
    """Return the node of a term."""
    if "node" in term:
        (at,) = np.nonzero(space.mesh.node_number == term["node"])
        if not len(at):
            raise wrong(record, f"it has a term at node {term['node']}, which the mesh does not have")
        return int(at[0])
    nodes = nodes_of(
        space, _Place(place=record.place, **{name: term[name] for name in ("group", "kind", "at") if name in term})
    )
    if len(nodes) != 1:
        message = f"it has a term at group {term['group']!r}, which has {len(nodes)} nodes"
        raise wrong(record, f"{message}; name a group of one node, or give the node or its place")
    return int(nodes[0])


class _Place(AtNodes):
    """The place of a term."""

    SECTION = Section("equation", True, "a term of an equation")


def _check_moved(space: Space, record: Equation, nodes: Iterable[int], moved: NDArray[np.bool_]) -> None:
    """Raise CaseError for nodes that nothing moves."""
    still = [node for node in nodes if not moved[node]]
    if still:
        numbers = some(space.mesh.node_number[still])
        raise wrong(record, f"nodes {numbers} belong to no cell of a body and to no rigid body; name nodes of bodies")
