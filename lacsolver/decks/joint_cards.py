"""Handlers of the cards that join nodes: equations, local axes, couplings, sides of sectors."""

from __future__ import annotations

import numpy as np

from lacmesh.deck import key_of
from lacmesh.mesh import Ints
from lacsolver.decks.cards import Card, DeckLine, Refused, look_up
from lacsolver.decks.content import DeckBolt, DeckContent, DeckCoupling, DeckEquation, DeckSector, LocalSystem

#: terms on one line of *EQUATION, and nodes on one of *MPC
_TERMS = 4
#: sine of the angle, or relative size, below which three points are on one line
_FLAT = 1e-9


def equation(deck: DeckContent, card: Card) -> None:
    """Take equations: the number of terms, then node, direction and factor of each, four terms on a line."""
    rows = list(card.rows)
    while rows:
        head = rows.pop(0)
        count = head.whole(0, "the number of terms")
        if count < 1:
            raise Refused("the number of terms should be positive", head)
        terms: list[tuple[int, int, float]] = []
        while len(terms) < count:
            if not rows:
                raise Refused(f"it should have {count} terms, and has {len(terms)}", head)
            row = rows.pop(0)
            here = min(_TERMS, count - len(terms), (len(row.fields) + 2) // 3)
            terms += [_term(deck, row, 3 * k) for k in range(here)]
        deck.equations.append(DeckEquation(tuple(terms), card, head))


def _term(deck: DeckContent, row: DeckLine, k: int) -> tuple[int, int, float]:
    """Return node, direction and factor of the term whose fields begin at k. Raises Refused."""
    _, nodes = deck.names.nodes(row.text(k), row)
    if len(nodes) != 1:
        raise Refused(f"a term of an equation should be at one node, and {row.text(k)} has {len(nodes)}", row)
    direction = row.whole(k + 1, "the direction")
    if not 1 <= direction <= 3:
        raise Refused("the directions of an equation should be 1 to 3; rotations are those of rigid bodies", row)
    return int(nodes[0]), direction - 1, row.number(k + 2, "the factor")


def mpc(deck: DeckContent, card: Card) -> None:
    """Take nodes that stay in a plane (PLANE), on a line (STRAIGHT), or have a mean rotation (MEANROT)."""
    lists: list[tuple[str, list[int], DeckLine]] = []
    for row in card.rows:
        fields = [text for text in row.fields if text]
        if fields and not fields[0].isdigit():
            lists.append((fields.pop(0).upper(), [], row))
        if not lists:
            raise Refused("it should begin with PLANE, STRAIGHT or MEANROT", row)
        for text in fields:
            lists[-1][1].extend(deck.names.nodes(text, row)[1].tolist())
    takes = {"PLANE": _plane, "STRAIGHT": _straight, "MEANROT": _mean_rotation}
    for kind, nodes, row in lists:
        if kind not in takes:
            raise Refused(f"lacsolver has the constraints PLANE, STRAIGHT and MEANROT, and not {kind}", row)
        for terms in takes[kind](deck.names.mesh.points, nodes, row):
            kept = tuple((node, axis, factor) for node, axis, factor in terms if factor)
            deck.equations.append(DeckEquation(kept, card, row, linearised=kind))


def _plane(x: np.ndarray, nodes: list[int], row: DeckLine) -> list[list[tuple[int, int, float]]]:
    """Return n . (u_p - sum a_i u_i) = 0 for each node p after the first three, whose plane it is in."""
    if len(nodes) < 4:
        raise Refused("PLANE should list four nodes at least: the first three define the plane", row)
    first = x[nodes[:3]]
    sides = first[1] - first[0], first[2] - first[0]
    normal = np.cross(*sides)
    if not np.linalg.norm(normal) > _FLAT * np.linalg.norm(sides[0]) * np.linalg.norm(sides[1]):
        raise Refused("the first three nodes of PLANE are on one line, and define no plane", row)
    normal /= np.linalg.norm(normal)
    out = []
    for node in nodes[3:]:
        a = np.linalg.lstsq(np.stack(sides, axis=1), x[node] - first[0], rcond=None)[0]
        parts = zip((node, *nodes[:3]), (1.0, a[0] + a[1] - 1.0, -a[0], -a[1]), strict=True)
        out.append([(one, axis, float(part * normal[axis])) for one, part in parts for axis in range(3)])
    return out


def _straight(x: np.ndarray, nodes: list[int], row: DeckLine) -> list[list[tuple[int, int, float]]]:
    """Return e . (u_p - (1 - s) u_1 - s u_2) = 0, for both e across the line, for each node p after the first two."""
    if len(nodes) < 3:
        raise Refused("STRAIGHT should list three nodes at least: the first two define the line", row)
    way = x[nodes[1]] - x[nodes[0]]
    if not way.any():
        raise Refused("the first two nodes of STRAIGHT are at one place, and define no line", row)
    axes = np.linalg.svd(way[None])[2][1:]
    if not np.ptp(x[:, 2]):  # in a plane, across means in the plane
        axes = np.array([[-way[1], way[0], 0.0]]) / np.linalg.norm(way)
    out = []
    for node in nodes[2:]:
        s = float((x[node] - x[nodes[0]]) @ way / (way @ way))
        parts = list(zip((node, *nodes[:2]), (1.0, s - 1.0, -s), strict=True))
        out += [[(one, axis, float(part * e[axis])) for one, part in parts for axis in range(3)] for e in axes]
    return out


def _mean_rotation(x: np.ndarray, nodes: list[int], row: DeckLine) -> list[list[tuple[int, int, float]]]:
    """Return the mean of the rotations of nodes about an axis through their mean, less that of the last node.

    The coordinates of the last node are the direction of the axis, and its first displacement is the rotation.
    """
    *listed, pilot = nodes
    own = list(dict.fromkeys(listed))
    if len(own) < 2 or len(listed) != 3 * len(own):
        raise Refused("MEANROT should list each node three times, and then the node whose first direction turns", row)
    axis = x[pilot]
    if not axis.any():
        raise Refused("the place of the last node of MEANROT should be the direction of the axis, and not 0", row)
    axis = axis / np.linalg.norm(axis)
    arm = x[own] - x[own].mean(axis=0)
    arm -= (arm @ axis)[:, None] * axis
    square = (arm**2).sum(axis=1)
    if not (square > 0).all():
        raise Refused("a node of MEANROT is on the axis through the mean of its nodes, where it has no rotation", row)
    theta = np.cross(axis, arm) / square[:, None] / len(own)
    terms = [(node, k, float(theta[i, k])) for i, node in enumerate(own) for k in range(3)]
    return [[*terms, (pilot, 0, -1.0)]]


def transform(deck: DeckContent, card: Card) -> None:
    """Take local axes of nodes: rectangular (R) or cylindrical (C), from two points."""
    _, nodes = deck.names.nodes(card.needed("NSET"), None)
    kind = card.word("TYPE") or "R"
    row = card.first("six coordinates")
    a, b = _two_points(row)
    if kind == "R":
        if not np.linalg.norm(np.cross(a, b)) > _FLAT * np.linalg.norm(a) * np.linalg.norm(b):
            raise Refused("the two points of *TRANSFORM are on one line with the origin; give two that are not", row)
        axes = {"x": a.tolist(), "xy": b.tolist()}
    elif kind == "C":
        if not (b - a).any():
            raise Refused("the two points of the axis are the same", row)
        axes = {"origin": a.tolist(), "axis": (b - a).tolist()}
    else:
        raise Refused(f"axes are rectangular (TYPE=R) or cylindrical (TYPE=C), and not {kind}")
    deck.systems.append(LocalSystem(np.asarray(nodes), axes, card))


def _two_points(row: DeckLine) -> tuple[np.ndarray, np.ndarray]:
    """Return the two points (3,) of a line of six coordinates, 0 where they are left out."""
    x = np.array([row.number(k, "a coordinate", 0.0) for k in range(6)])
    return x[:3], x[3:]


def coupling(deck: DeckContent, card: Card) -> None:
    """Begin a coupling of a surface with a reference node; *KINEMATIC or *DISTRIBUTING follows."""
    name = card.needed("SURFACE")
    there = deck.names.deck.surface_group(name)
    if there is not None and there[0] == "NODE":
        group, facets, nodes = there[1], None, np.asarray(deck.names.mesh.node_groups[there[1]])
    else:
        group, facets = deck.names.skin(name, None)
        nodes = None
    reference = deck.names.node(card.needed("REFNODE"))
    axes = None
    if "ORIENTATION" in card.options:
        x, y = deck.orientations[look_up(deck.orientations, card.options["ORIENTATION"], "*ORIENTATION above it")]
        axes = {"x": list(x), "xy": list(y)}
    deck.couplings.append(DeckCoupling(group, facets, nodes, reference, card, axes=axes))


def pretension_section(deck: DeckContent, card: Card) -> None:
    """Take a section of a bolt, with the node that has its force or its shortening, and the normal if it is given."""
    if "ELEMENT" in card.options:
        raise Refused("a bolt that is a beam has no section here; mesh it with solid elements, and give a SURFACE")
    group, facets = deck.names.skin(card.needed("SURFACE"), None)
    _, reference = deck.names.nodes(card.needed("NODE"), None)
    if len(reference) != 1:
        raise Refused(f"NODE should be one node, and {card.options['NODE']} has {len(reference)}")
    if deck.names.in_cells[reference[0]]:
        raise Refused("NODE should be a node of its own, beside those of the elements")
    if len(card.rows) > 1:
        raise Refused("the data line should be the normal of the section", card.rows[1])
    normal = tuple(card.rows[0].number(k, "the normal", 0.0) for k in range(3)) if card.rows else ()
    deck.bolts.append(DeckBolt(group, facets, int(reference[0]), normal, card))


def kinematic(deck: DeckContent, card: Card) -> None:
    """Take the directions in which the nodes of a coupling follow its reference node: all, if none are listed."""
    which = _open(deck)
    which.kind = "rigid"
    directions = {
        d
        for row in card.rows
        for d in range(row.whole(0, "a direction"), row.whole(1, "a direction", row.whole(0, "")) + 1)
    }
    if card.rows and not directions & {1, 2, 3}:
        raise Refused("nodes of solid elements have the directions 1 to 3 alone", card.rows[0])
    which.components = sorted(d - 1 for d in directions & {1, 2, 3}) or [0, 1, 2]


def distributing(deck: DeckContent, card: Card) -> None:
    """Take that loads at the reference node of a coupling are spread by area over its surface."""
    which = _open(deck)
    which.kind = "distributing"
    if (card.word("WEIGHTINGMETHOD") or "UNIFORM") != "UNIFORM":
        raise Refused("weights are those of the area (WEIGHTING METHOD=UNIFORM), or of *DISTRIBUTING COUPLING")


def _open(deck: DeckContent) -> DeckCoupling:
    """Return the coupling begun last. Raises Refused if there is none, or it has its kind."""
    if not deck.couplings or deck.couplings[-1].kind:
        raise Refused("it belongs after *COUPLING; move it there")
    return deck.couplings[-1]


def distributing_coupling(deck: DeckContent, card: Card) -> None:
    """Take nodes with weights, over which the loads at the node of an element DCOUP3D are spread."""
    reference = _coupled_node(deck, card)
    weights: dict[int, float] = {}
    for row in card.rows:
        for node in deck.names.nodes(row.text(0), row)[1].tolist():
            weights[node] = row.number(1, "the weight")
    if not weights:
        raise Refused("it should list nodes and their weights")
    nodes: Ints = np.array(sorted(weights))
    deck.couplings.append(DeckCoupling("coupled", None, nodes, reference, card, "distributing", weights=weights))


def _coupled_node(deck: DeckContent, card: Card) -> int:
    """Return the node of the element DCOUP3D in the set of a card, which is no cell of the mesh. Raises Refused."""
    wanted = key_of(card.needed("ELSET"))
    rows = [
        row
        for one in map(Card, deck.names.deck.cards)
        if one.key == "ELEMENT" and one.word("TYPE") == "DCOUP3D" and key_of(one.options.get("ELSET", "")) == wanted
        for row in one.rows
    ]
    if len(rows) != 1:
        raise Refused(f"the set {card.options['ELSET']} should have one element of type DCOUP3D, and has {len(rows)}")
    return int(deck.names.nodes(rows[0].text(1), rows[0])[1][0])


def cyclic_tie(deck: DeckContent, card: Card) -> None:
    """Take the sides of a sector; *CYCLIC SYMMETRY MODEL tells of its angle."""
    row = card.first("the two sides of the sector")
    slave, master = (deck.names.skin(text, row) for text in row.two_skins())
    deck.sectors[key_of(card.needed("NAME"))] = DeckSector(slave, master, card)


def cyclic_model(deck: DeckContent, card: Card) -> None:
    """Take the number of sectors, and two points of the axis."""
    if not deck.sectors:
        raise Refused("it should follow *TIE, CYCLIC SYMMETRY, NAME=name; write that before")
    name = look_up(deck.sectors, card.options.get("TIE", next(reversed(deck.sectors))), "*TIE, CYCLIC SYMMETRY")
    which = deck.sectors[name]
    if card.options.get("ELSET", ""):
        deck.note(card, "the fields of the whole ring are written if the case says ring = true")
    row = card.first("two points of the axis")
    a, b = _two_points(row)
    if not (b - a).any():
        raise Refused("the two points of the axis are the same", row)
    which.count, which.origin, which.axis = int(card.number("N")), a, b - a
