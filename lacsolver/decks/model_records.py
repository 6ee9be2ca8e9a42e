"""Records of the model: its dimension, materials, contacts, ties, springs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.surface import Surface, contact_points
from lacmesh.surface.points import face_measure
from lacmesh.topology.skin import FaceIncidence, facets_of
from lacsolver.decks.cards import Card, Refused, look_up
from lacsolver.decks.content import DeckContent, DeckSection, DeckStep, Interaction, Pair
from lacsolver.decks.draft import AXES, MODELS, CaseDraft
from lacsolver.decks.histories import JUMP
from lacsolver.decks.names import SIDES
from lacsolver.problem.roles import FEW

#: distance within which CalculiX ties, relative to the size of an element (manual of CalculiX, *TIE)
_TIED = 0.025
_FINITE = {"elastic": "saint_venant_kirchhoff", "neo_hookean": "neo_hookean", "plastic": "plastic"}


def top(draft: CaseDraft) -> None:
    """Set the model, the thickness and the kinematics. Raises Refused."""
    mesh = draft.groups.mesh
    if draft.dim == 3:
        draft.top["model"] = "3d"
    elif mesh.plane in MODELS:
        draft.top["model"] = MODELS[mesh.plane]
    else:
        raise Refused(
            "its elements are of several plane kinds, or of none: lacsolver has one of CPS, CPE, CAX in a model"
        )
    if draft.top["model"].startswith("plane"):
        draft.top["thickness"] = _thickness(draft)
    if draft.large:
        draft.top["kinematics"] = "finite"


def _thickness(draft: CaseDraft) -> float | dict[str, float]:
    """Return the thickness of the sections, or that of a group of cells for each that they have."""
    sections, thickness = draft.deck.sections, np.zeros(draft.groups.mesh.n_cells)
    for section in sections:
        thickness[section.cells] = section.thickness
    values = np.unique(thickness[thickness > 0]).tolist()
    if len(values) < 2:
        return values[0] if values else 1.0
    names = {value: [one.name for one in sections if one.thickness == value] for value in values}
    return {
        draft.groups.add_cells(names[value][0] if len(names[value]) == 1 else "thick", cells): value
        for value in values
        for cells in [np.flatnonzero(thickness == value)]
    }


def materials(draft: CaseDraft) -> None:
    """Add a [[material]] for each material, orientation and initial temperature. Raises Refused."""
    deck, mesh = draft.deck, draft.groups.mesh
    solid = np.flatnonzero(mesh.cell_dim == mesh.dim)
    section_of = np.full(mesh.n_cells, -1)
    for k, section in enumerate(deck.sections):
        section_of[section.cells] = k
    if (bare := solid[section_of[solid] < 0]).size:
        raise Refused(f"elements {some(mesh.cell_number[bare])} have no *SOLID SECTION; give them one")
    kinds = [_kind(deck, section) for section in deck.sections]
    start = initial_temperatures(draft)
    laws = {kind: k for k, kind in enumerate(dict.fromkeys(kinds))}
    law_of = np.array([laws[kind] for kind in kinds])[section_of[solid]]
    temperature, which = np.unique(start[solid], return_inverse=True)
    both = law_of * len(temperature) + which.ravel()
    for code in np.unique(both).tolist():
        law, T = list(laws)[code // len(temperature)], float(temperature[code % len(temperature)])
        cells = solid[both == code]
        _add_material(draft, law, T, cells, deck.sections[int(section_of[cells[0]])], len(cells) == len(solid))


def _kind(deck: DeckContent, section: DeckSection) -> tuple[str, str]:
    """Return the keys of the material and the orientation of a section. Raises Refused."""
    material = look_up(deck.materials, section.material, "*MATERIAL")
    axes = look_up(deck.orientations, section.axes, "*ORIENTATION") if section.axes else ""
    return material, axes if deck.materials[material].keys.get("law") == "orthotropic" else ""


def _add_material(
    draft: CaseDraft, law: tuple[str, str], T: float, cells: Ints, section: DeckSection, whole: bool
) -> None:
    """Add the record of one law on some cells. Raises Refused for a law that its kinematics do not have."""
    material = draft.deck.materials[law[0]]
    keys = dict(material.keys)
    if "law" not in keys:
        raise Refused(f"material {material.name} has no *ELASTIC and no *HYPERELASTIC; give it one")
    if draft.large and keys["law"] not in _FINITE:
        raise Refused(
            f"material {material.name} is orthotropic, which lacsolver has for small displacements; leave out NLGEOM"
        )
    if not draft.large and keys["law"] == "neo_hookean":
        raise Refused(
            f"material {material.name} is hyperelastic, which lacsolver has for finite displacements; say NLGEOM"
        )
    if draft.large and keys["law"] == "elastic":
        draft.deck.note(
            material.card,
            f"with NLGEOM material {material.name} has the law saint_venant_kirchhoff, as in CalculiX: it is meant for "
            "small strains, and crushed to less than 0.577 of its length its force falls; neo_hookean does not",
        )
    keys["law"] = _FINITE[keys["law"]] if draft.large else keys["law"]
    if keys["law"] == "orthotropic":
        keys["axes"] = draft.deck.orientations.get(law[1], ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    elif isinstance(keys.get("expansion"), list):
        raise Refused(f"material {material.name} is isotropic and has an expansion for each axis; give one")
    if keys.get("expansion") and T:
        keys["reference_temperature"] = T
    name = section.name if np.array_equal(cells, section.cells) else material.name
    groups = {} if whole else {"groups": [draft.groups.add_cells(name, cells)]}
    draft.add("material", groups | keys, material.card)


def initial_temperatures(draft: CaseDraft) -> Floats:
    """Return the initial temperature (n_cells,) of each cell; 0 where no cell expands. Raises Refused."""
    mesh = draft.groups.mesh
    nodal, there = np.zeros(mesh.n_nodes), []
    for line in draft.deck.assigned:
        if line.kind == "temperature" and line.step < 0:
            nodal[line.items] = line.value
            there.append(line)
    out = np.zeros(mesh.n_cells)
    if not there:
        return out
    for _, cells, nodes in mesh.select(expanding(draft)):
        T = nodal[nodes]
        uneven = (T[:, :1] != T).any(axis=1)
        if uneven.any():
            raise Refused(
                f"the nodes of elements {some(mesh.cell_number[cells[uneven]])} have several initial temperatures, and "
                "an element has one in lacsolver",
                there[-1].row,
            )
        out[cells] = T[:, 0]
    return out


def expanding(draft: CaseDraft) -> Ints:
    """Return the cells (k,) whose material expands."""
    deck = draft.deck
    expands = np.zeros(draft.groups.mesh.n_cells, bool)
    for section in deck.sections:
        expands[section.cells] = bool(deck.material_of(section).keys.get("expansion"))
    return np.flatnonzero(expands)


def contacts(draft: CaseDraft) -> None:
    """Add a [[contact]] or a [[tie]] for each slave; several masters of one slave become one group. Raises Refused."""
    paired = {(pair.slave, pair.master) for pair in draft.deck.pairs if not pair.tie}
    for names, (_, card) in draft.deck.clearances.items():
        if names not in paired:
            draft.deck.error(card, f"there is no *CONTACT PAIR of {names[0]} and {names[1]}; name one of them")
    by_slave: dict[str, list[Pair]] = {}
    for pair in draft.deck.pairs:
        by_slave.setdefault(pair.slave, []).append(pair)
    for pairs in by_slave.values():
        _add_pair(draft, pairs)


def _add_pair(draft: CaseDraft, pairs: list[Pair]) -> None:
    first, names = pairs[0], draft.deck.names
    laws = [_interaction(draft.deck, pair) for pair in pairs]
    if any((one.tie, one.keys) != (first.tie, first.keys) for one in pairs) or len(set(map(id, laws))) > 1:
        raise Refused("this slave has several masters with different contact; give them one", pairs[1].card.rows[0])
    skins = [names.skin(pair.master, None) for pair in pairs]
    slave, facets = names.skin(first.slave, None)
    master, opposite = "_".join(dict.fromkeys(name for name, _ in skins)), np.concatenate([f for _, f in skins])
    if _exchanged(draft, pairs, (slave, facets), (master, opposite)):
        (slave, facets), (master, opposite) = (master, opposite), (slave, facets)
    added = draft.groups.add_skin(master, opposite)
    keys: dict[str, Any] = {"slave": draft.groups.add_skin(slave, facets), "master": added}
    law = laws[0]
    if first.tie or (law and law.tied):
        distance = first.keys.get("search_distance")
        if distance is None and first.tie:
            distance = _tied_within(draft, slave, facets, opposite, first)
            if distance is None:
                return
        draft.add("tie", keys | ({} if distance is None else {"search_distance": distance}), first.card)
        return
    for pair in pairs:
        if (pair.slave, pair.master) in draft.deck.clearances:
            draft.clearances[keys["slave"]] = draft.deck.clearances[pair.slave, pair.master]
    if removed := [one for pair in pairs for one in draft.deck.changes.get((pair.slave, pair.master), ())]:
        keys["clearance"] = _removed(draft, pairs, removed)
    soft = (_stiffness(draft, law) or law.curve) if law else {}
    friction = (_friction(draft, law) | _damping(draft, law)) if law else {}
    normals = {"normals": "smoothed"} if draft.large else {}  # those of CalculiX, averaged at the nodes
    draft.add("contact", keys | soft | friction | normals | dict(first.keys), first.card)


def _tied_within(draft: CaseDraft, name: str, slave: Ints, master: Ints, pair: Pair) -> float | None:
    """Return the distance within which CalculiX ties two skins, facets (k,); None, with a warning, if they are farther.

    Without POSITION TOLERANCE it is 2.5 % of the size of an element.
    """
    one, other = (_surface(draft.groups.mesh, facets) for facets in (slave, master))
    distance = _TIED * float(np.mean(face_measure(one) ** (1 / one.dim)))
    if len(contact_points(one, other, search_distance=distance, max_penetration=distance).macro):
        return distance
    message = f"the slave {name!r} is farther from its master than {distance:.3g}, 2.5 % of its faces, within which "
    draft.deck.warn(pair.card, f"{message}CalculiX ties without POSITION TOLERANCE: it is not tied; give the tolerance")
    return None


def _surface(mesh: Mesh, facets: Ints) -> Surface:
    """Return the surface of facets (k,) of a mesh."""
    cells, sides = np.divmod(facets, SIDES)
    faces = facets_of(mesh, FaceIncidence(np.arange(len(cells)), cells, sides, np.ones(len(cells), bool)))
    return Surface(mesh.points, faces, cells, mesh.dim - 1, np.full(len(cells), np.nan))


def _exchanged(draft: CaseDraft, pairs: list[Pair], slave: tuple[str, Ints], master: tuple[str, Ints]) -> bool:
    """True if a slave of few faces should be the master of its own; tell that, or that both have few."""
    (name, facets), (other, opposite), card = slave, master, pairs[0].card
    few = FEW[draft.dim]
    if len(facets) >= few:
        return False
    said = f"the slave {name!r} has few faces, {len(facets)}, with one pressure each: they may not keep a body from "
    mesh, deck = draft.groups.mesh, draft.deck
    faces = _surface(mesh, opposite).faces.nodes
    rigid = any(np.isin(faces, body.nodes).any() for body in deck.rigid)
    others = [pair for pair in deck.pairs if pair not in pairs]
    taken = any({pair.slave, pair.master} & {pair.master for pair in pairs} for pair in others)
    if len(np.unique(opposite)) >= few and not rigid and not taken:
        count = len(np.unique(opposite))
        draft.deck.note(card, f"{said}turning; {other!r} has {count}, so that it is the slave in the case, and cut")
        return True
    why = "its master is rigid" if rigid else "its master is in another pair" if taken else "its master has few as well"
    advice = "'run' refuses the case if nothing else holds that; refine the mesh of one of them"
    draft.deck.warn(card, f"{said}turning, and {why}, so that results are coarse; {advice}")
    return False


def _removed(draft: CaseDraft, pairs: list[Pair], changes: list[tuple[int, bool, Card]]) -> list[list[float]]:
    """Return the clearance of contact that is removed for some steps: larger than the model, else 0. Raises Refused."""
    card = changes[0][2]
    if len(pairs) > 1:
        raise Refused("this slave has several masters, whose contact is removed together here; give it one", None, card)
    far = 10 * float(np.linalg.norm(np.ptp(draft.groups.mesh.points, axis=0)))
    return _from_step_on({-1: 0.0} | {step: far * (not added) for step, added, _ in changes}, draft.deck.steps)


def _damping(draft: CaseDraft, law: Interaction) -> dict[str, Any]:
    """Return the key of damping, {} where no step is in motion. Raises Refused for contact without an overlap."""
    if law.damping is None or not law.damping[0]:
        return {}
    value, card = law.damping
    if all(step.alpha is None for step in draft.deck.steps):
        draft.deck.note(card, "damping of contact has no effect without *DYNAMIC, and is left out")
        return {}
    if not (law.stiffness or law.curve):
        message = "hard contact is rigid in lacsolver, without an overlap that damping could act on"
        raise Refused(f"{message}; give *SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", None, card)
    return {"damping": value}


def _stiffness(draft: CaseDraft, law: Interaction) -> dict[str, Any]:
    """Return the key of linear contact: a number, or a table of times if steps change it; {} for other contact."""
    points = _from_step_on(law.stiffness, draft.deck.steps) if law.stiffness else []
    if len({value for _, value in points}) > 1:
        return {"stiffness": points}
    return {"stiffness": points[0][1]} if points else {}


def _friction(draft: CaseDraft, law: Interaction) -> dict[str, Any]:
    """Return the keys of friction: a number, or a table of times if steps change it. Raises Refused."""
    if not any(law.friction.values()):
        return {}
    values = {-1: 0.0} | law.friction
    points = _from_step_on(values, draft.deck.steps)
    coefficients = {value for _, value in points}
    if len(coefficients) > 1 and math.inf in coefficients:
        raise Refused("surfaces that are ROUGH in some steps alone are not taken; give a coefficient", None, law.card)
    limit = {} if law.shear_limit is None else {"shear_limit": law.shear_limit}
    return {"friction": points if len(coefficients) > 1 else coefficients.pop()} | limit


def _from_step_on(values: dict[int, float], steps: list[DeckStep]) -> list[list[float]]:
    """Return a table of times for values, each from a step on, and -1 for the model's, which jump as a step begins."""
    now = [values[max(k for k in values if k <= number)] for number in range(len(steps))]
    points = [(0.0, now[0] if now else values[-1])]
    for step, value in zip(steps, now, strict=True):
        if value != points[-1][1]:
            points.append((step.begin + JUMP * step.period, value))
        points.append((step.end, value))
    return [list(point) for point in points]


def _interaction(deck: DeckContent, pair: Pair) -> Interaction | None:
    """Return the surface interaction of a contact pair. Raises Refused if it is not there."""
    if pair.tie or not pair.interaction:
        return None
    return deck.interactions[look_up(deck.interactions, pair.interaction, "*SURFACE INTERACTION")]


def springs(draft: CaseDraft) -> None:
    """Add a [[spring]] for each *SPRING, those between nodes for each element; those of one place add."""
    for spring in draft.deck.springs:
        for count, nodes in _repeats(spring.nodes):
            size = count * spring.stiffness
            group = draft.node_group(spring.group, nodes, "sprung")
            draft.add("spring", {"group": group, f"k{AXES[spring.axis]}": size}, spring.card)
    for pair in draft.deck.springs_between:
        name = "k" if pair.axis is None else f"k{AXES[pair.axis]}"
        for one, other in pair.ends:
            groups = {"group": draft.node_group("", one[None]), "to": draft.node_group("", other[None])}
            draft.add("spring", groups | {name: pair.stiffness}, pair.card)


def _repeats(nodes: Ints) -> Iterator[tuple[int, Ints]]:
    """Yield how often nodes are listed, and the nodes that are listed so often."""
    distinct, counts = np.unique(nodes, return_counts=True)
    for count in np.unique(counts).tolist():
        yield count, distinct[counts == count]
