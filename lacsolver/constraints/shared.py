"""Nodes of rigid bodies whose displacement a [[displacement]] prescribes too: equations between the motions.

Where the body's own motions are prescribed so already, the equation follows, and the body carries the force.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints, concatenated
from lacsolver.case.case import Case
from lacsolver.constraints.conditions import Prescribed, prescribed
from lacsolver.constraints.coupling import rigid_records
from lacsolver.constraints.equations import Equations
from lacsolver.space.places import name_of, nodes_of, said, wrong
from lacsolver.space.space import Space
from lacsolver.space.sparse import sparse


def without(parts: Sequence[Prescribed], moved: NDArray[np.bool_]) -> tuple[Prescribed, ...]:
    """Return conditions without those at the nodes `moved` (n_nodes,) by rigid bodies."""
    return tuple(_at(part, ~moved[part.nodes]) for part in parts)


def equations_of(space: Space, case: Case) -> Iterator[Equations]:
    """Yield the equations of each [[displacement]] that holds from the start, at nodes of rigid bodies.

    Raises CaseError in several processes, whose motions of rigid bodies are no unknowns to eliminate.
    """
    bodies = rigid_records(case)
    body_of = np.full(space.mesh.n_nodes, -1)
    for k, body in enumerate(bodies):
        body_of[nodes_of(space, body)] = k
    records = [record for record in case.displacement if bodies and record.begin is None]
    for k, record in enumerate(records):
        parts = [_at(part, body_of[part.nodes] >= 0) for part in prescribed(space, [record])]
        nodes = concatenated(part.nodes for part in parts)
        if not space.share.total(np.array(len(nodes))):
            continue
        if space.share.own is not None:
            message = "nodes of a rigid body are prescribed by it too, which is solved by one process only"
            raise wrong(record, f"{message}; run the case in one, or take the nodes out")
        words = [f"{said(record)} at node {space.mesh.node_number[n]} of {said(bodies[body_of[n]])}" for n in nodes]
        yield _equations(space, f"displacement {k + 1} on rigid bodies", name_of(record), parts, nodes, words)


def _equations(
    space: Space, name: str, support: str, parts: Sequence[Prescribed], nodes: Ints, words: Sequence[str]
) -> Equations:
    d = np.concatenate([part.directions for part in parts])
    C = sparse((len(nodes), space.n_dof), (np.arange(len(nodes))[:, None], space.dofs(nodes), d))

    def values(t: float) -> NDArray[np.floating]:
        return np.concatenate([part.at(space, t) for part in parts])

    return Equations(name, C, values, words.__getitem__, may_follow=True, support=support)


def _at(part: Prescribed, chosen: NDArray[np.bool_]) -> Prescribed:
    return part._replace(nodes=part.nodes[chosen], directions=part.directions[chosen])
