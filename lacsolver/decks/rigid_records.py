"""Records of rigid bodies: how each moves and turns, prescribed or free under loads."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from lacsolver.decks.cards import Refused
from lacsolver.decks.content import DeckRigid
from lacsolver.decks.draft import AXES, CaseDraft
from lacsolver.decks.histories import Points, written
from lacsolver.decks.load_records import orders_by_step, scaled
from lacsolver.decks.parts import history_of


def rigid_bodies(draft: CaseDraft) -> None:
    """Add a [[rigid]] for each rigid body. Raises Refused."""
    for body in draft.reading.content.rigid:
        keys: dict[str, Any] = {"group": body.group, "kind": body.kind}
        if body.kind == "node":
            keys["group"] = draft.groups.add_nodes(body.group, body.nodes)
        centre = draft.groups.mesh.points[body.reference][: draft.dim]
        axisymmetric = draft.top["model"] == "axisymmetric"
        if not axisymmetric:
            keys["centre"] = centre.tolist()
        for c in [1] if axisymmetric else range(draft.dim):
            keys |= _moved(draft, body, c)
        keys |= {} if axisymmetric else _turned(draft, body)
        draft.add("rigid", keys | _own_mass(draft, body), body.card)
    references = [body.reference for body in draft.reading.content.rigid]
    for one in draft.reading.content.masses:
        if one.node not in references:
            number = draft.groups.mesh.node_number[one.node]
            message = f"node {number} is no reference node of a *RIGID BODY, and others have the mass of their elements"
            draft.reading.error(one.card, f"{message} alone in lacsolver; spread the mass by *DENSITY")


def _own_mass(draft: CaseDraft, body: DeckRigid) -> dict[str, Any]:
    """Return mass and inertia of the elements at the reference node of a body. Raises Refused for a wrong mass."""
    own = [one for one in draft.reading.content.masses if one.node == body.reference]
    if not own:
        return {}
    mass = sum(one.mass for one in own) * draft.per_thickness
    inertia = (np.sum([one.inertia for one in own], axis=0) * draft.per_thickness).tolist()
    if not mass > 0:
        raise Refused("the mass at the reference node of a rigid body should be positive", None, own[0].card)
    return {"mass": mass} | ({"inertia": inertia if draft.dim == 3 else inertia[2]} if any(inertia) else {})


def _moved(draft: CaseDraft, body: DeckRigid, c: int) -> dict[str, Any]:
    """Return how a component of the reference node moves: prescribed, or free under a force, which may be 0."""
    prescribed = _at(draft, "displacement", body.reference, c)
    pushed = _at(draft, "force", body.reference, c)
    if prescribed:
        return {f"u{AXES[c]}": written(prescribed, draft.ramped)}
    return {f"f{AXES[c]}": scaled(written(pushed, draft.ramped), draft.per_thickness) if pushed else 0.0}


def _turned(draft: CaseDraft, body: DeckRigid) -> dict[str, Any]:
    """Return how a body turns: all rotations prescribed, or all free under a moment. Raises Refused for a mixture."""
    axes = range(3) if draft.dim == 3 else [2]
    prescribed = [_at(draft, "spin", body.reference, c) or _of_node(draft, "displacement", body, c) for c in axes]
    loaded = [_at(draft, "moment", body.reference, c) or _of_node(draft, "force", body, c) for c in axes]
    if any(prescribed):
        if not all(prescribed):
            raise Refused("a rigid body of lacsolver turns freely about all axes or about none; fix all or none")
        name, values = "rotation", [written(points, draft.ramped) for points in prescribed if points]
    else:
        scale = draft.per_thickness
        values = [scaled(written(points, draft.ramped), scale) if points else 0.0 for points in loaded]
        name = "moment"
    return {name: values if draft.dim == 3 else values[0]}


def _of_node(draft: CaseDraft, kind: str, body: DeckRigid, c: int) -> Points | None:
    return None if body.rotation is None else _at(draft, kind, body.rotation, c)


def _at(draft: CaseDraft, kind: str, node: int, c: int) -> Points | None:
    """Return the history of a component of one node, None if the deck says nothing of it. Raises Refused."""
    lines = [line for line in draft.reading.content.assigned if line.kind == kind and node in line.items]
    lines = [replace(line, items=np.array([node])) for line in lines]
    return history_of(draft.reading.content, orders_by_step(draft, kind, lines), node, c) if lines else None
