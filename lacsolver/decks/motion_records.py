"""Records of motion: [dynamics] for the steps with inertia, [[initial]] for the velocities at their start."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints
from lacmesh.topology.bodies import body_names, label_bodies
from lacsolver.decks.cards import Refused, look_up
from lacsolver.decks.content import Assigned
from lacsolver.decks.draft import AXES, CaseDraft

#: largest difference of the velocities of a body from linear ones, relative to the largest of them
_LINEAR = 1e-6


def dynamics(draft: CaseDraft) -> None:
    """Add [dynamics] and [[initial]] if there is a *DYNAMIC step. Raises Refused."""
    deck = draft.deck
    moving = [step for step in deck.steps if step.alpha is not None]
    given = [line for line in deck.assigned if line.kind == "velocity"]
    if not moving:
        cards = [line.card for line in given[:1]] + [m.card for m in deck.materials.values() if any(m.damping)]
        for card in cards:
            draft.deck.note(card, "without a step of *DYNAMIC velocities and damping have no effect")
        return
    first = deck.steps.index(moving[0])
    if len(moving) < len(deck.steps) - first:
        late = next(step for step in deck.steps[first:] if step.alpha is None)
        draft.deck.error(late.origin, "a static step after a dynamic one is not taken; compute it in a deck of its own")
    if other := next((step for step in moving if step.alpha != moving[0].alpha), None):
        draft.deck.error(other.origin, "lacsolver has one ALPHA for all steps; give the steps of *DYNAMIC the same")
    if first and given:
        message = "CalculiX takes these velocities away in the static step before the motion"
        raise Refused(f"{message}; take them out, or write [[initial]] into the case", given[0].row, given[0].card)
    keys: dict[str, Any] = {"alpha": moving[0].alpha} | ({"start": moving[0].begin} if first else {})
    if any(damping := _damping(draft)):
        keys["rayleigh"] = list(damping)
    draft.add("dynamics", keys, moving[0].origin)
    _add_initial(draft, given)


def _damping(draft: CaseDraft) -> tuple[float, float]:
    """Return the Rayleigh damping of the materials, which all must share, and have a density. Raises Refused."""
    deck = draft.deck
    keys = {look_up(deck.materials, section.material, "*MATERIAL") for section in deck.sections}
    materials = [deck.materials[key] for key in sorted(keys)]
    for material in materials:
        if not material.keys.get("density"):
            message = f"material {material.name} has no *DENSITY, and what moves has a mass; give it one"
            draft.deck.error(material.card, message)
    if len({material.damping for material in materials}) > 1:
        names = ", ".join(material.name for material in materials)
        raise Refused(f"materials {names} have several dampings, and lacsolver has one for all; give them the same")
    return materials[0].damping if materials else (0.0, 0.0)


def _add_initial(draft: CaseDraft, lines: list[Assigned]) -> None:
    """Add an [[initial]] for each body with velocities, which must be linear in its coordinates. Raises Refused."""
    if not lines:
        return
    mesh = draft.groups.mesh
    v = np.zeros((mesh.n_nodes, 3))
    for line in lines:
        v[line.items, line.components[0]] = line.value
    _move_rigid(draft, v, lines)
    _check_velocities(draft, v, lines)
    solid = np.flatnonzero(mesh.cell_dim == mesh.dim)
    body_of = label_bodies((nodes for _, _, nodes in mesh.select(solid)), mesh.n_nodes)
    cell_body = np.full(mesh.n_cells, -1)
    for _, cells, nodes in mesh.select(solid):
        cell_body[cells] = body_of[nodes[:, 0]]
    names = body_names(mesh, body_of, int(body_of.max(initial=-1)) + 1)
    for body in np.unique(body_of[(v != 0).any(axis=1) & (body_of >= 0)]).tolist():
        nodes, cells = np.flatnonzero(body_of == body), np.flatnonzero(cell_body == body)
        line = next((one for one in lines if np.isin(one.items, nodes).any()), lines[0])
        keys = dict(_linear(draft, names[body], nodes, v[nodes], line))
        groups = {} if len(cells) == len(solid) else {"groups": [_group(draft, cells)]}
        draft.add("initial", groups | keys, line.card)


def _move_rigid(draft: CaseDraft, v: Floats, lines: list[Assigned]) -> None:
    """Give the nodes of rigid bodies the velocity (n_nodes, 3) of their reference nodes, in place. Raises Refused."""
    for body in draft.deck.rigid:
        own, reference = v[body.nodes], v[body.reference].copy()
        if own.any() and (own != reference).any():
            number = draft.groups.mesh.node_number[body.reference]
            line = next(one for one in lines if np.isin(one.items, body.nodes).any())
            message = f"a rigid body moves with its reference node, {number}, in CalculiX and Abaqus"
            raise Refused(f"{message}; give the velocity to that node", line.row, line.card)
        v[body.reference] = 0.0
        v[body.nodes] = reference


def _group(draft: CaseDraft, cells: Ints) -> str:
    """Return the name of the deck's set of some cells, or of a new group of them."""
    there = (name for name, own in draft.groups.cells.items() if np.array_equal(np.sort(own), cells))
    return next(there, "") or draft.groups.add_cells("moving", cells)


def _check_velocities(draft: CaseDraft, v: Floats, lines: list[Assigned]) -> None:
    """Raise Refused for velocities of nodes of no solid element, or along directions in which nodes are held."""
    number, in_cells = draft.groups.mesh.node_number, draft.deck.names.in_cells
    loose = np.flatnonzero((v != 0).any(axis=1) & ~in_cells)
    if len(loose):
        message = f"nodes {some(number[loose])} belong to no solid element"
        raise Refused(f"{message}; give the velocity to the nodes of elements", lines[0].row, lines[0].card)
    for line in (one for one in draft.deck.assigned if one.kind == "displacement"):
        for c in line.components:
            if (fixed := line.items[v[line.items, c] != 0]).size:
                message = f"nodes {some(number[fixed])} have a velocity along {AXES[c]}, in which they are held"
                raise Refused(f"{message}; hold the nodes or move them, not both", line.row, line.card)


def _linear(draft: CaseDraft, name: str, nodes: Ints, v: Floats, line: Assigned) -> Iterator[tuple[str, float | str]]:
    """Yield the keys of the velocities (k, 3) of the nodes of a body, its name in a sentence: numbers, or formulas.

    Raises Refused.
    """
    points = draft.groups.mesh.points[nodes]
    centre = points.mean(axis=0)
    basis = np.column_stack([np.ones(len(nodes)), points - centre])[:, : 1 + draft.dim]
    for c in range(draft.dim):
        size = np.abs(v[:, c]).max()
        if not size:
            continue
        if (v[:, c] == v[0, c]).all():
            yield f"v{AXES[c]}", float(v[0, c])
            continue
        parts = np.linalg.lstsq(basis, v[:, c], rcond=None)[0]
        off = np.abs(basis @ parts - v[:, c])
        if off.max() > _LINEAR * size:
            number = draft.groups.mesh.node_number[nodes[off.argmax()]]
            raise Refused(
                f"the velocities along {AXES[c]} of {name} are not linear in its coordinates, most of all at node "
                f"{number}, as those of a translation, a rotation or a stretch are; give all nodes of the body such "
                "velocities",
                line.row,
                line.card,
            )
        terms = [f"{a!r} * ({AXES[k]} - {centre[k].item()!r})" for k, a in enumerate(parts[1:].tolist())]
        yield f"v{AXES[c]}", " + ".join([repr(float(parts[0])), *terms])
