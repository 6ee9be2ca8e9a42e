"""Records of bodies: loads per volume, which are gravity and centrifugal loads, and rigid bodies."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from lacmesh.mesh import Floats, Ints
from lacsolver.decks.cards import Refused
from lacsolver.decks.content import DeckRigid
from lacsolver.decks.draft import AXES, CaseDraft
from lacsolver.decks.histories import Points, history_of, parts_of, written
from lacsolver.decks.load_records import check_begun, orders_by_step, scaled


def gravity(draft: CaseDraft) -> None:
    """Add [gravity] if it acts on all that has a density, else a [[body_force]] for each density. Raises Refused.

    Gravity along another direction is another load, which adds to that of earlier steps, as in CalculiX.
    """
    density, mesh = densities(draft), draft.groups.mesh
    lines = [line for line in draft.deck.assigned if line.kind == "gravity"]
    alike = [[line for line in lines if line.data == way] for way in dict.fromkeys(line.data for line in lines)]
    along = (orders_by_step(draft, "gravity", some) for some in alike)
    parts = [part for one in along for part in parts_of(draft.deck, one, once=True)]
    heavy = np.flatnonzero(density)
    for part, histories in parts:
        keys = {f"{AXES[c]}": written(points, draft.ramped) for c, points in histories.items() if c < draft.dim}
        if not np.isin(part.items, heavy).any():
            raise Refused("gravity acts on elements without a density; give their material a *DENSITY", part.row)
        if len(parts) == 1 and np.isin(heavy, part.items).all():
            if mesh.plane == "CAX" and keys.pop("x", 0.0):
                raise Refused("gravity along the radius has no meaning in a full circle; give it along y", part.row)
            draft.add("gravity", {f"g{axis}": value for axis, value in keys.items()}, part.card)
            continue
        for rho, cells in _by_density(density, part.items):
            group = draft.groups.add_cells(part.name or "heavy", cells)
            loads = {f"f{axis}": scaled(value, rho) for axis, value in keys.items()}
            draft.add("body_force", {"groups": [group]} | loads, part.card)


def _by_density(density: Floats, cells: Ints) -> list[tuple[float, Ints]]:
    """Return the densities of some cells, and the cells of each."""
    parts = [(float(rho), cells[density[cells] == rho]) for rho in np.unique(density[cells])]
    return [(rho, some_cells) for rho, some_cells in parts if rho]


def densities(draft: CaseDraft) -> Floats:
    """Return the density (n_cells,) of each cell, 0 without one."""
    deck = draft.deck
    out = np.zeros(draft.groups.mesh.n_cells)
    for section in deck.sections:
        out[section.cells] = deck.material_of(section).keys.get("density", 0.0)
    return out


def centrifugal(draft: CaseDraft) -> None:
    """Add a [[body_force]] for each centrifugal load. Raises Refused."""
    deck, density = draft.deck, densities(draft)
    for line in (one for one in deck.assigned if one.kind == "centrifugal"):
        if draft.large or line.amplitude or len(deck.steps) > 1:
            message = (
                "a centrifugal load is taken in one step, without NLGEOM and without amplitude; write a [[body_force]]"
            )
            raise Refused(message, line.row)
        for rho, cells in _by_density(density, line.items):
            group = draft.groups.add_cells(line.name or "turning", cells)
            factor = rho * line.value
            time = "" if deck.steps[0].sudden else f" * t / {draft.end!r}"
            outward = _outward(np.array(line.data[:3]), np.array(line.data[3:]))
            loads = {f"f{AXES[c]}": f"{factor!r} * ({outward[c]}){time}" for c in range(draft.dim) if outward[c]}
            draft.add("body_force", {"groups": [group]} | loads, line.card)


def _outward(origin: Floats, way: Floats) -> list[str]:
    """Return the vector from an axis to a place, as formulas of x, y, z; "" for a component that is 0.

    >>> _outward(np.zeros(3), np.array([0.0, 2.0, 0.0]))
    ['1.0 * x', '', '1.0 * z']
    """
    across = np.eye(3) - np.outer(way, way) / (way @ way)
    rows = []
    for row in across:
        terms = [(float(a), AXES[k], float(origin[k])) for k, a in enumerate(row) if abs(a) > 1e-15]
        rows.append(" + ".join(f"{a!r} * ({axis} - {o!r})" if o else f"{a!r} * {axis}" for a, axis, o in terms))
    return rows


def rigid_bodies(draft: CaseDraft) -> None:
    """Add a [[rigid]] for each rigid body. Raises Refused."""
    for body in draft.deck.rigid:
        keys: dict[str, Any] = {"group": body.group, "kind": body.kind}
        if body.kind == "node":
            keys["group"] = draft.groups.add_nodes(body.group, body.nodes)
        centre = draft.groups.mesh.points[body.reference][: draft.dim]
        axisymmetric = draft.top["model"] == "axisymmetric"
        if not axisymmetric:
            keys["centre"] = centre.tolist()
        for c in [1] if axisymmetric else range(draft.dim):
            keys |= _moved(draft, body, c)
        if not axisymmetric:
            turns = turning(draft, body.reference, body.rotation)
            keys |= turns or {"moment": [0.0] * 3 if draft.dim == 3 else 0.0}
        draft.add("rigid", keys | _own_mass(draft, body), body.card)
    references = [body.reference for body in draft.deck.rigid]
    for one in draft.deck.masses:
        if one.node not in references:
            number = draft.groups.mesh.node_number[one.node]
            message = f"node {number} is no reference node of a *RIGID BODY, and others have the mass of their elements"
            draft.deck.error(one.card, f"{message} alone in lacsolver; spread the mass by *DENSITY")


def _own_mass(draft: CaseDraft, body: DeckRigid) -> dict[str, Any]:
    """Return mass and inertia of the elements at the reference node of a body. Raises Refused for a wrong mass."""
    own = [one for one in draft.deck.masses if one.node == body.reference]
    if not own:
        return {}
    mass = sum(one.mass for one in own)
    inertia = np.sum([one.inertia for one in own], axis=0).tolist()
    if not mass > 0:
        raise Refused("the mass at the reference node of a rigid body should be positive", None, own[0].card)
    return {"mass": mass} | ({"inertia": inertia if draft.dim == 3 else inertia[2]} if any(inertia) else {})


def _moved(draft: CaseDraft, body: DeckRigid, c: int) -> dict[str, Any]:
    """Return how a component of the reference node moves: prescribed, or free under a force, which may be 0."""
    prescribed = history_at(draft, "displacement", body.reference, c)
    pushed = history_at(draft, "force", body.reference, c)
    if prescribed:
        return {f"u{AXES[c]}": written(prescribed, draft.ramped)}
    return {f"f{AXES[c]}": written(pushed, draft.ramped) if pushed else 0.0}


def turning(draft: CaseDraft, node: int, rotation: int | None) -> dict[str, Any]:
    """Return how a body or a coupling turns, by its reference node: prescribed, or free under a moment.

    `rotation`: a node whose displacements and forces are rotations and moments, None if there is none. {} where the
    deck says nothing. Raises Refused.
    """

    def histories(kind: str, of_rotation: str) -> list[Points | None]:
        axes = range(3) if draft.dim == 3 else [2]
        other = [None if rotation is None else history_at(draft, of_rotation, rotation, c) for c in axes]
        return [history_at(draft, kind, node, c) or beside for c, beside in zip(axes, other, strict=True)]

    prescribed, loaded = histories("spin", "displacement"), histories("moment", "force")

    def values(own: list[Points | None], else_: float | str) -> Any:
        every = [written(points, draft.ramped) if points else else_ for points in own]
        return every if draft.dim == 3 else every[0]

    keys = {"rotation": values(prescribed, "free")} if any(prescribed) else {}
    loaded = [None if theta else m for theta, m in zip(prescribed, loaded, strict=True)]
    return keys | ({"moment": values(loaded, 0.0)} if any(loaded) else {})


def history_at(draft: CaseDraft, kind: str, node: int, c: int) -> Points | None:
    """Return the history of a component of one node, None if the deck says nothing of it. Raises Refused."""
    lines = [line for line in draft.deck.assigned if line.kind == kind and node in line.items]
    lines = [replace(line, items=np.array([node])) for line in lines]
    if not lines:
        return None
    ordered = orders_by_step(draft, kind, lines)
    if kind in ("displacement", "spin"):
        check_begun(ordered)
    return history_of(draft.deck, ordered, node, c)
