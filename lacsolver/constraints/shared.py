"""Nodes of rigid bodies whose displacement a [[displacement]] prescribes too: equations between the motions.

Where the body's own motions are prescribed so already, the equation follows, and the body carries the force.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from lacmesh.mesh import concatenated
from lacsolver.case.case import Case
from lacsolver.constraints.conditions import prescribed, rows_of, values_of
from lacsolver.constraints.coupling import rigid_records
from lacsolver.constraints.equations import Equations
from lacsolver.space.places import name_of, nodes_of, said, wrong
from lacsolver.space.space import Space


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
        parts = [part.take(body_of[part.nodes] >= 0) for part in prescribed(space, [record])]
        nodes = concatenated(part.nodes for part in parts)
        if not space.share.total(np.array(len(nodes))):
            continue
        if space.share.own is not None:
            message = "nodes of a rigid body are prescribed by it too, which is solved by one process only"
            raise wrong(record, f"{message}; run the case in one, or take the nodes out")
        words = [f"{said(record)} at node {space.mesh.node_number[n]} of {said(bodies[body_of[n]])}" for n in nodes]
        yield Equations(
            f"displacement {k + 1} on rigid bodies", rows_of(space, parts), partial(values_of, space, parts),
            words.__getitem__, may_follow=True, support=name_of(record),
        )  # fmt: skip
