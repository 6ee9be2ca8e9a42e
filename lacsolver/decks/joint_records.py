"""Records of joints: [[equation]], [[pretension]], [[coupling]], [[cyclic]]; the local axes of supports and loads."""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.errors import some
from lacsolver.decks.body_records import history_at, turning
from lacsolver.decks.cards import Refused
from lacsolver.decks.content import DeckCoupling, DeckEquation
from lacsolver.decks.draft import AXES, CaseDraft
from lacsolver.decks.histories import written
from lacsolver.decks.load_records import scaled
from lacsolver.decks.local_axes import axes_of, directions_at, in_model

#: direction cosine below which a direction has no part along an axis
_NOTHING = 1e-14


def equations(draft: CaseDraft) -> None:
    """Add an [[equation]] for each equation of the deck. Raises Refused."""
    for one in draft.deck.equations:
        if one.linearised and draft.large:
            raise Refused(f"{one.linearised} is linear here, and NLGEOM is not; take a [[coupling]]", one.row, one.card)
        terms, value = _terms(draft, one)
        if not terms:
            continue
        keys: dict[str, Any] = {"terms": terms} | ({"value": value} if value else {})
        draft.add("equation", keys, one.card)


def _terms(draft: CaseDraft, one: DeckEquation) -> tuple[list[dict[str, Any]], Any]:
    """Return the terms of an equation at nodes of bodies, and its value, what others are prescribed. Raises Refused."""
    deck, number = draft.deck, draft.groups.mesh.node_number
    factors: dict[tuple[int, int], float] = {}
    value: Any = None
    for node, direction, factor in one.terms:
        if node in deck.beside_bodies:
            message = f"node {number[node]} is the reference node of a rigid body, of a coupling or of a bolt"
            raise Refused(f"{message}, of which lacsolver has no equations", one.row, one.card)
        if deck.names.in_cells[node]:
            for axis, part in enumerate(directions_at(draft, node)[direction][: draft.dim].tolist()):
                if abs(part) > _NOTHING:
                    factors[node, axis] = factors.get((node, axis), 0.0) + factor * part
            continue
        prescribed = history_at(draft, "displacement", node, direction)
        if prescribed is None or value is not None:
            what = "is free" if prescribed is None else "is another one that is prescribed"
            message = f"node {number[node]} belongs to no solid element, and {what}"
            raise Refused(f"{message}; one node beside the bodies may move an equation", one.row, one.card)
        value = scaled(written(prescribed, draft.ramped), -factor)
    terms = [
        {"factor": factor, "component": f"u{AXES[axis]}", "node": int(number[node])}
        for (node, axis), factor in factors.items()
        if factor
    ]
    return terms, value


def bolts(draft: CaseDraft) -> None:
    """Add a [[pretension]] for each section of a bolt. Raises Refused for one without force and displacement."""
    deck = draft.deck
    for one in deck.bolts:
        pulled, moved = (history_at(draft, kind, one.reference, 0) for kind in ("force", "displacement"))
        keys: dict[str, Any] = {"group": draft.groups.add_skin(one.group, one.facets)}
        if any(one.normal):
            keys["normal"] = list(one.normal[: draft.dim])
        if pulled and moved:
            message = "its node has a force and then a displacement; lock the bolt by *BOUNDARY, FIXED instead"
            raise Refused(message, None, one.card)
        if pulled:
            keys["force"] = written(pulled, draft.ramped)
        elif moved:
            keys["shortening"] = written(moved, draft.ramped)
        else:
            number = draft.groups.mesh.node_number[one.reference]
            raise Refused(f"node {number} has no *CLOAD and no *BOUNDARY in direction 1", None, one.card)
        if one.lock is not None:
            keys["lock"] = deck.steps[one.lock].begin
        draft.add("pretension", keys, one.card)


def couplings(draft: CaseDraft) -> None:
    """Add a [[coupling]] for each coupling of the deck whose reference node moves or is loaded. Raises Refused."""
    for one in draft.deck.couplings:
        if not one.kind:
            raise Refused("it should be followed by *KINEMATIC or *DISTRIBUTING", None, one.card)
        keys = _point(draft, one)
        if not keys and one.kind == "distributing":
            draft.deck.note(one.card, "its reference node has neither a load nor a motion, so that it has no effect")
            continue
        draft.add("coupling", _group(draft, one) | (keys or {"fy": 0.0}), one.card)


def _group(draft: CaseDraft, one: DeckCoupling) -> dict[str, Any]:
    """Return the keys of a coupling that do not depend on its loads."""
    deck, number = draft.deck, draft.groups.mesh.node_number
    if one.facets is not None:
        group = draft.groups.add_skin(one.group, one.facets)
    else:
        nodes = np.asarray(one.nodes)
        loose = nodes[~deck.names.in_cells[nodes]]
        if len(loose):
            raise Refused(f"nodes {some(number[loose])} belong to no solid element", None, one.card)
        group = draft.groups.add_nodes(one.group, nodes)
    keys: dict[str, Any] = {"name": f"{one.group} {number[one.reference]}", "group": group, "kind": one.kind}
    if draft.top["model"] != "axisymmetric":
        keys["at"] = draft.groups.mesh.points[one.reference][: draft.dim].tolist()
    if one.weights:
        keys["weights"] = [[int(number[node]), weight] for node, weight in one.weights.items()]
    if _follows_partly(draft, one):
        keys["components"] = [f"u{AXES[c]}" for c in one.components]
    if one.axes:
        keys["axes"] = in_model(draft, one.axes)
    return keys


def _point(draft: CaseDraft, one: DeckCoupling) -> dict[str, Any]:
    """Return motions and loads at the reference node of a coupling. Raises Refused for mixed rotations."""
    if axes_of(draft, one.reference) is not None:
        raise Refused(
            "the reference node of a coupling has the axes of the mesh; take its *TRANSFORM out", None, one.card
        )
    if one.axes and any(
        history_at(draft, kind, one.reference, c) for kind in ("displacement", "force") for c in range(3)
    ):
        raise Refused("loads at a reference node are along the axes of the mesh; leave ORIENTATION out", None, one.card)
    keys: dict[str, Any] = {}
    for c in [1] if draft.top["model"] == "axisymmetric" else range(draft.dim):
        prescribed, pushed = (history_at(draft, kind, one.reference, c) for kind in ("displacement", "force"))
        if prescribed:
            keys[f"u{AXES[c]}"] = written(prescribed, draft.ramped)
        elif pushed:
            keys[f"f{AXES[c]}"] = written(pushed, draft.ramped)
    if draft.top["model"] == "axisymmetric":
        return keys
    turns = turning(draft, one.reference, None)
    if draft.large:
        _check_finite(draft, one, turns)
    return keys | turns


def _check_finite(draft: CaseDraft, one: DeckCoupling, turns: dict[str, Any]) -> None:
    """Raise Refused for a coupling whose finite rotations are not available."""
    values = turns.get("rotation", "free")
    free = [value == "free" for value in (values if draft.dim == 3 and "rotation" in turns else [values])]
    if one.kind == "distributing" and any(free) and not all(free):
        message = "with NLGEOM a distributing coupling turns freely about all axes or about none"
        raise Refused(f"{message}; fix all or none, or make it *KINEMATIC", None, one.card)
    if one.kind == "rigid" and (one.axes or _follows_partly(draft, one)) and any(free):
        message = "with NLGEOM a coupling of some directions turns only as its rotations are prescribed"
        raise Refused(f"{message}; fix all of them, or let all directions follow", None, one.card)


def _follows_partly(draft: CaseDraft, one: DeckCoupling) -> bool:
    """True for a kinematic coupling of some directions."""
    return one.kind == "rigid" and one.components != list(range(3)) and len(set(one.components)) < draft.dim


def sectors(draft: CaseDraft) -> None:
    """Add a [[cyclic]] for each sector. Raises Refused."""
    for one in draft.deck.sectors.values():
        if not one.count:
            raise Refused("it should be followed by *CYCLIC SYMMETRY MODEL, N=sectors", None, one.card)
        if one.count < 2:
            raise Refused("the number of sectors N should be 2 at least", None, one.card)
        keys: dict[str, Any] = {
            "slave": draft.groups.add_skin(*one.slave),
            "master": draft.groups.add_skin(*one.master),
        }
        keys |= {"sectors": one.count}
        if draft.dim == 3:
            keys["axis"] = one.axis.tolist()
        elif one.axis[:2].any():
            raise Refused("the axis of a sector in a plane should be along z", None, one.card)
        draft.add("cyclic", keys | {"origin": one.origin[: draft.dim].tolist()}, one.card)
