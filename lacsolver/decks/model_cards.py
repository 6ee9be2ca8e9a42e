"""Handlers of the cards that describe a model: elements, amplitudes, contact, ties, rigid bodies, springs."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from lacmesh.deck import key_of
from lacmesh.errors import some
from lacmesh.mesh import Ints
from lacsolver.case.value_kinds import PRESSURES
from lacsolver.decks.cards import Card, DeckLine, Refused, check_rows, look_up
from lacsolver.decks.content import (
    Amplitude,
    DeckContent,
    DeckRigid,
    GroundSpring,
    Interaction,
    Pair,
    SpringsBetween,
)
from lacsolver.decks.joint_cards import cyclic_tie

#: elements that lacsolver computes, and letters of their names that change how they are computed
_SOLIDS = re.compile(r"(?:C3D(?:4|6|8|10|15|20|27)|CPS(?:3|4|6|8)|CPE(?:3|4|6|8)|CAX(?:3|4|6|8))([RIHM]*)")
_POINTS = ("SPRING1", "MASS", "ROTARYI", "DCOUP3D")
_PAIRS = ("SPRING2", "SPRINGA")
_VARIANTS = {
    "R": "reduced integration",
    "I": "incompatible modes",
    "H": "a pressure of its own (hybrid)",
    "M": "a modified tetrahedron",
}


def element(deck: DeckContent, card: Card) -> None:
    """Take elements that are solids or springs; others have no place in lacsolver."""
    name = card.word("TYPE")
    solid = _SOLIDS.fullmatch(name)
    if name in _PAIRS:
        deck.spring_types.add(name)
        return
    if solid is None and name not in _POINTS:
        raise Refused(
            "lacsolver computes solid elements (C3D, CPS, CPE, CAX), springs (SPRING1, SPRING2, SPRINGA) and masses of "
            f"rigid bodies (MASS, ROTARYI), and none of type {name or '(none)'}; model this part with solid "
            "elements, or take it out"
        )
    if solid and solid[1] and name not in deck.variants:
        deck.variants.add(name)
        _tell_variant(deck, card, name, solid[1])


def _tell_variant(deck: DeckContent, card: Card, name: str, letters: str) -> None:
    """Tell that elements of a variant are computed otherwise here; linear ones are too stiff in bending."""
    variants = " and ".join(_VARIANTS[letter] for letter in dict.fromkeys(letters))
    message = f"{name} has {variants}; lacsolver computes the same shape with full integration"
    if letters == "H":
        deck.note(card, message)
        return
    linear = re.search(r"[48][A-Z]*$", name) and not name.startswith(("CPS8", "CPE8", "CAX8"))
    advice = ", which is too stiff in bending: elevate its order before (lacmesh convert --order 2)" if linear else ""
    deck.warn(card, message + advice)


def surface(deck: DeckContent, card: Card) -> None:
    """Refuse surfaces without faces and nodes in the mesh, such as analytical ones."""
    del deck
    kind = card.word("TYPE") or "ELEMENT"
    if kind not in ("ELEMENT", "NODE"):
        raise Refused(f"a surface of type {kind} has no faces in the mesh; list element faces (TYPE=ELEMENT)")


def amplitude(deck: DeckContent, card: Card) -> None:
    """Take a table of times and factors."""
    if (card.word("DEFINITION") or "TABULAR") != "TABULAR":
        raise Refused("only tables of times and factors are taken (DEFINITION=TABULAR); write one")
    if (card.word("VALUE") or "RELATIVE") != "RELATIVE":
        raise Refused("only factors are taken (VALUE=RELATIVE); divide the table by the load's size")
    shift = [card.number(name, 0.0) for name in ("SHIFTX", "SHIFTY")]
    rows: list[tuple[float, float]] = []
    for row in card.rows:
        for k in range(0, len(row.fields) - 1, 2):
            t, factor = row.number(k, "a time"), row.number(k + 1, "a factor")
            if rows and t + shift[0] <= rows[-1][0]:
                raise Refused(f"its times should increase, and {t:g} follows {rows[-1][0]:g}", row)
            rows.append((t + shift[0], factor + shift[1]))
    if not rows:
        raise Refused("it should list times and factors")
    total = card.word("TIME") == "TOTALTIME"
    deck.amplitudes[key_of(card.needed("NAME"))] = Amplitude(tuple(rows), total)


def interaction(deck: DeckContent, card: Card) -> None:
    """Begin a surface interaction, hard as long as nothing else is said."""
    deck.interactions[key_of(card.needed("NAME"))] = Interaction(card)


def behavior(deck: DeckContent, card: Card) -> None:
    """Take hard contact, linear pressure over overlap, and contact that is tied."""
    kind = card.word("PRESSURE-OVERCLOSURE") or "HARD"
    if deck.in_step:
        _changed_behavior(deck, card, kind)
        return
    which = deck.interaction
    if kind in ("LINEAR", "TIED"):
        which.stiffness, which.tied = {-1: _pressure_per_overlap(card)}, kind == "TIED"
        if which.tied:
            deck.note(card, "surfaces that are tied become a [[tie]], without its stiffness: they stay together")
    elif kind == "EXPONENTIAL":
        which.curve = _exponential(deck, card)
    elif kind == "TABULAR":
        which.curve = _table(card)
    elif kind != "HARD":
        raise Refused(
            f"lacsolver has HARD, LINEAR, EXPONENTIAL and TABULAR contact, and not {kind}; write one of these"
        )


def _pressure_per_overlap(card: Card) -> float:
    return card.first("the pressure per overlap").positive(0, "the pressure per overlap")


def change(deck: DeckContent, card: Card) -> None:
    """Begin a change of a surface interaction from a step on; *SURFACE BEHAVIOR or *FRICTION follows."""
    look_up(deck.interactions, card.needed("INTERACTION"), "*SURFACE INTERACTION")
    deck.step.changes[card.key] = card


def _changed(deck: DeckContent, name: str) -> Interaction:
    """Return the surface interaction that the last card `name` of a step begins to change. Raises Refused."""
    card = deck.step.changes.get(name.replace(" ", ""))
    if card is None:
        raise Refused(f"in a step it belongs after *{name}, INTERACTION=name; write that")
    return deck.interactions[key_of(card.needed("INTERACTION"))]


def _changed_behavior(deck: DeckContent, card: Card, kind: str) -> None:
    """Take the pressure per overlap from a step on. Raises Refused for another kind than LINEAR, before and now."""
    which = _changed(deck, "CHANGE SURFACE BEHAVIOR")
    if kind != "LINEAR" or not which.stiffness or which.tied:
        raise Refused(
            "a step changes the pressure per overlap of LINEAR contact, and hard, tied and curved contact keep their "
            "law for all steps; say LINEAR in the model and in the step"
        )
    which.stiffness[len(deck.steps) - 1] = _pressure_per_overlap(card)


def _exponential(deck: DeckContent, card: Card) -> dict[str, Any]:
    """Return the keys of an exponential law: its clearance, and its pressure where the surfaces meet."""
    row = card.single("the clearance without pressure and the pressure without clearance")
    clearance, pressure = row.number(0, "the clearance"), row.number(1, "the pressure")
    if not (clearance > 0 and pressure > 0):
        raise Refused("the clearance and the pressure should be positive", row)
    deck.warn(
        card,
        "the exponential is Abaqus's, 0 from this clearance on; that of CalculiX falls to a hundredth there, and grows "
        "faster with the overlap: both have this pressure where the surfaces meet",
    )
    return {"law": "exponential", "pressure_at_contact": pressure, "clearance_at_zero": clearance}


def _table(card: Card) -> dict[str, Any]:
    """Return the keys of a law by a table of pressures and overlaps. Raises Refused."""
    card.first("a pressure and an overlap")
    if len({row.number(2, "the temperature", 0.0) for row in card.rows}) > 1:
        raise Refused("pressures that depend on temperature are not taken; give those of one", card.rows[-1])
    rows = [[row.number(0, "the pressure"), row.number(1, "the overlap")] for row in card.rows]
    check_rows(PRESSURES, rows, card)
    return {"law": "table", "pressures": rows}


def damping(deck: DeckContent, card: Card) -> None:
    """Take the damping of contact, a pressure per approach velocity. Raises Refused."""
    if (kind := card.word("DEFINITION") or "DAMPINGCOEFFICIENT") != "DAMPINGCOEFFICIENT":
        raise Refused(f"damping of contact is a DAMPING COEFFICIENT in lacsolver, and not {kind}; give that")
    if "TANGENTFRACTION" in card.options and card.number("TANGENTFRACTION"):
        raise Refused("damping acts along the normal only; leave TANGENT FRACTION out, or say 0")
    row = card.single("the damping coefficient")
    value = row.number(0, "the damping coefficient")
    if value < 0 or row.number(1, "the clearance without damping", 0.0):
        raise Refused("the coefficient should not be negative, and acts where surfaces overlap: give it alone", row)
    deck.interaction.damping = value, card


def friction(deck: DeckContent, card: Card) -> None:
    """Take Coulomb friction, with a largest stress (TAUMAX), or ROUGH surfaces, which do not slip while they touch."""
    which, now = _with_friction(deck)
    if "ROUGH" in card.options:
        which.friction[now] = math.inf
        return
    row = card.single("the coefficient of friction")
    value = row.number(0, "the coefficient of friction", 0.0)
    if value < 0:
        raise Refused(f"the coefficient of friction should not be negative, and is {value:g}", row)
    if "TAUMAX" in card.options:
        limit = card.number("TAUMAX")
        if not limit > 0:
            raise Refused(f"TAUMAX should be positive, not {limit:g}")
        if now >= 0:
            raise Refused("lacsolver has one TAUMAX for all steps; give it in the model's *FRICTION")
        which.shear_limit = limit
    which.friction[now] = value
    slope = row.number(1, "the stick slope", 0.0)
    if value and slope and not which.tied:
        deck.note(card, f"its stick slope of {slope:g} is not needed: what sticks does not slip at all here", row)


def _with_friction(deck: DeckContent) -> tuple[Interaction, int]:
    """Return the surface interaction that *FRICTION belongs to, and the step, -1 before the first. Raises Refused."""
    if not deck.in_step:
        return deck.interaction, -1
    return _changed(deck, "CHANGE FRICTION"), len(deck.steps) - 1


def contact_pair(deck: DeckContent, card: Card) -> None:
    """Take pairs of a slave and a master; slaves that are surfaces of nodes become the faces on these nodes."""
    keys: dict[str, Any] = {"geometry": "reference"} if "SMALLSLIDING" in card.options else {}
    if "ADJUST" in card.options:
        keys["adjust"] = _adjust(deck, card)
    for row in card.rows:
        slave, master = _skins(deck, card, row)
        deck.pairs.append(Pair(slave, master, card.options.get("INTERACTION", ""), keys, card))


def _adjust(deck: DeckContent, card: Card) -> float:
    """Return the distance within which nodes of the slave are moved onto the master. Raises Refused."""
    text = card.options["ADJUST"]
    if key_of(text) in deck.names.deck.groups_of("NSET"):
        message = f"ADJUST={text} names a set of nodes, and lacsolver moves those within a distance"
        raise Refused(f"{message}; give that, as ADJUST=0.01")
    distance = card.number("ADJUST")
    if distance < 0:
        raise Refused(f"the distance of ADJUST should not be negative, and is {distance:g}")
    return distance


def tie(deck: DeckContent, card: Card) -> None:
    """Take ties; the position tolerance becomes the distance within which the master is searched."""
    if "CYCLICSYMMETRY" in card.options:
        cyclic_tie(deck, card)
        return
    keys = {}
    if card.options.get("POSITIONTOLERANCE", ""):
        keys["search_distance"] = card.number("POSITIONTOLERANCE")
    for row in card.rows:
        slave, master = _skins(deck, card, row)
        deck.pairs.append(Pair(slave, master, "", keys, card, tie=True))


def _skins(deck: DeckContent, card: Card, row: DeckLine) -> tuple[str, ...]:
    """Return the keys of slave and master on a data line. Raises Refused."""
    for text in row.two_skins():
        name, facets = deck.names.skin(text, row)
        if deck.names.of_nodes(text):
            deck.note(card, f"the surface of nodes {name!r} is taken as the {len(facets)} faces on its nodes", row)
    return tuple(key_of(text) for text in row.fields)


def clearance(deck: DeckContent, card: Card) -> None:
    """Take the gap between a slave and a master, which replaces the one in the mesh."""
    pair = tuple(key_of(card.needed(name)) for name in ("SLAVE", "MASTER"))
    deck.clearances[pair[0], pair[1]] = (card.number("VALUE"), card)


def rigid_body(deck: DeckContent, card: Card) -> None:
    """Take a rigid body, with the nodes that hold its place and its rotation."""
    names = deck.names
    if "NSET" in card.options:
        kind, (group, nodes) = "node", names.nodes(card.needed("NSET"), None)
    else:
        kind, (group, cells) = "cell", names.cells(card.needed("ELSET"), None)
        nodes = np.unique(np.concatenate([part.ravel() for _, _, part in names.mesh.select(cells)]))
    if not group:
        raise Refused("a rigid body should be a set of nodes or of elements, not a number")
    reference = names.node(card.needed("REFNODE"))
    turning = names.node(card.needed("ROTNODE")) if "ROTNODE" in card.options else None
    deck.rigid.append(DeckRigid(group, kind, nodes, reference, turning, card))


def spring(deck: DeckContent, card: Card) -> None:
    """Take linear springs: a line with directions, blank for those along a line, and a line with the stiffness."""
    if deck.names.mesh.plane == "CAX":
        raise Refused(
            "a spring of an axisymmetric model is that of a sector of 2 degrees in CalculiX, and of the full circle in "
            "Abaqus and here; write a [[spring]] into the case"
        )
    ends = deck.names.pairs(card.needed("ELSET"))
    if len(ends):
        _between_nodes(deck, card, ends)
        return
    group, nodes = deck.names.points(card.needed("ELSET"))
    if len(card.rows) != 2:
        raise Refused("a spring to the ground is a line with its direction, 1 to 3, and one with its stiffness")
    axis = card.rows[0].whole(0, "the direction")
    stiffness = card.rows[1].number(0, "the stiffness")
    if axis not in (1, 2, 3) or not stiffness > 0:
        raise Refused("the direction should be 1 to 3, and the stiffness positive", card.rows[0])
    deck.springs.append(GroundSpring(group, nodes, axis - 1, stiffness, card))


def _between_nodes(deck: DeckContent, card: Card, ends: Ints) -> None:
    """Take linear springs between the nodes `ends` (m, 2). Raises Refused."""
    rows = [row for row in card.rows if any(row.fields)]
    kind = {1: "SPRINGA", 2: "SPRING2"}.get(len(rows), "")
    if kind not in deck.spring_types:
        raise Refused(
            "a SPRING2 is a line with its two directions and one with its stiffness, a SPRINGA a blank line and one "
            "with its stiffness, at one temperature"
        )
    stiffness = rows[-1].positive(0, "the stiffness")
    numbers = deck.names.mesh.node_number
    loose = np.unique(ends[~deck.names.in_cells[ends]])
    if len(loose):
        message = f"nodes {some(numbers[loose])} belong to no solid element, and carry no spring"
        raise Refused(f"{message}; SPRING1 is a spring to the ground")
    axis = None
    if kind == "SPRING2":
        first, second = (rows[0].whole(k, "the direction") for k in (0, 1))
        if first not in (1, 2, 3) or first != second:
            raise Refused("a SPRING2 has one direction, 1 to 3, at both its nodes in lacsolver", rows[0])
        axis = first - 1
    deck.springs_between.append(SpringsBetween(ends, axis, stiffness, card))
