"""Local axes of the nodes of a deck (*TRANSFORM), for supports, forces and equations."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from lacmesh.mesh import Floats, Ints
from lacsolver.decks.cards import Refused
from lacsolver.decks.draft import CaseDraft
from lacsolver.space.axes import cartesian, cylindrical


def directions_at(draft: CaseDraft, node: int) -> Floats:
    """Return the directions (3, 3) of the displacements of a node, a row each."""
    axes = axes_of(draft, node)
    if axes is None:
        return np.eye(3)
    if "axis" not in axes:
        return cartesian(axes, 3)
    (directions,), (radius,) = cylindrical(axes, draft.groups.mesh.points[[node]])
    if not radius > 0:
        raise Refused(f"node {draft.groups.mesh.node_number[node]} is on the axis of its *TRANSFORM")
    return directions


def axes_of(draft: CaseDraft, node: int) -> dict[str, list[float]] | None:
    """Return the local axes of a node by the last *TRANSFORM that names it; None for those of the mesh."""
    systems = [one for one in draft.deck.systems if node in one.nodes]
    return systems[-1].axes if systems else None


def by_axes(draft: CaseDraft, nodes: Ints) -> Iterator[tuple[dict[str, Any], Ints]]:
    """Yield keys for the local axes of some nodes, {} for those of the mesh, and the nodes that have them."""
    which = np.full(len(nodes), -1)
    for k, system in enumerate(draft.deck.systems):
        which[np.isin(nodes, system.nodes)] = k
    for k in np.unique(which).tolist():
        axes = {} if k < 0 else {"axes": in_model(draft, draft.deck.systems[k].axes)}
        yield axes, nodes[which == k]


def in_model(draft: CaseDraft, axes: dict[str, list[float]]) -> dict[str, list[float]]:
    """Return axes with as many components as the model has. Raises Refused for axes out of a plane."""
    if draft.dim == 3:
        return axes
    if "axis" in axes:
        if any(axes["axis"][:2]):
            raise Refused("the axis of a *TRANSFORM in a plane should be along z")
        return {"origin": axes["origin"][:2], "axis": axes["axis"]}
    if axes["x"][2] or axes["xy"][2]:
        raise Refused("the points of a *TRANSFORM in a plane should have z = 0")
    return {name: values[:2] for name, values in axes.items()}
