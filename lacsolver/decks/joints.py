"""What joins nodes: equations, local axes, couplings, bolts, sides of sectors; their cards and records."""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.deck import key_of
from lacmesh.errors import some
from lacmesh.mesh import Ints
from lacsolver.decks.bodies import motion, turning
from lacsolver.decks.cards import Card, DeckLine, Refused, look_up
from lacsolver.decks.histories import scaled
from lacsolver.decks.import_ import AXES, Import

#: terms on one line of *EQUATION
_TERMS = 4
#: sine of the angle, or relative size, below which three points are on one line
_FLAT = 1e-9
#: direction cosine below which a direction has no part along an axis
_NOTHING = 1e-14
#: node, direction and factor of each term of an equation
Terms = list[tuple[int, int, float]]


# ---- equations


def equation(import_: Import, card: Card) -> None:
    """Take equations: the number of terms, then node, direction and factor of each, four terms on a line."""
    rows = list(card.rows)
    while rows:
        head = rows.pop(0)
        count = head.whole(0, "the number of terms")
        if count < 1:
            raise Refused("the number of terms should be positive", head)
        terms: Terms = []
        while len(terms) < count:
            if not rows:
                raise Refused(f"it should have {count} terms, and has {len(terms)}", head)
            row = rows.pop(0)
            here = min(_TERMS, count - len(terms), (len(row.fields) + 2) // 3)
            terms += [_term(import_, row, 3 * k) for k in range(here)]
        _equate(import_, card, head, terms)


def _term(import_: Import, row: DeckLine, k: int) -> tuple[int, int, float]:
    """Return node, direction and factor of the term whose fields begin at k. Raises Refused."""
    _, nodes = import_.names.nodes(row.text(k), row)
    if len(nodes) != 1:
        raise Refused(f"a term of an equation should be at one node, and {row.text(k)} has {len(nodes)}", row)
    direction = row.whole(k + 1, "the direction")
    if not 1 <= direction <= 3:
        raise Refused("the directions of an equation should be 1 to 3; rotations are those of rigid bodies", row)
    return int(nodes[0]), direction - 1, row.number(k + 2, "the factor")


def _equate(import_: Import, card: Card, row: DeckLine, terms: Terms, linearised: str = "") -> None:
    """Add an [[equation]] once all cards are read; `linearised`: its kind of *MPC, or ""."""
    import_.equated += [node for node, *_ in terms]

    def add() -> None:
        if linearised and import_.large:
            raise Refused(f"{linearised} is linear here, and NLGEOM is not; take a [[coupling]]", row)
        kept, value = _at_bodies(import_, terms, row)
        if kept:
            import_.add("equation", {"terms": kept} | ({"value": value} if value else {}), card)

    import_.later("equation", card, add)


def _at_bodies(import_: Import, terms: Terms, row: DeckLine) -> tuple[list[dict[str, Any]], Any]:
    """Return the terms of an equation at nodes of bodies, and its value, what others are prescribed. Raises Refused."""
    number = import_.names.mesh.node_number
    factors: dict[tuple[int, int], float] = {}
    value: Any = None
    for node, direction, factor in terms:
        if node in import_.beside_bodies:
            message = f"node {number[node]} is the reference node of a rigid body, of a coupling or of a bolt"
            raise Refused(f"{message}, of which lacsolver has no equations", row)
        if import_.names.in_cells[node]:
            for axis, part in enumerate(import_.directions_at(node)[direction][: import_.dim].tolist()):
                if abs(part) > _NOTHING:
                    factors[node, axis] = factors.get((node, axis), 0.0) + factor * part
            continue
        prescribed = import_.value("displacement", node, direction)
        if prescribed is None or value is not None:
            what = "is free" if prescribed is None else "is another one that is prescribed"
            message = f"node {number[node]} belongs to no solid element, and {what}"
            raise Refused(f"{message}; one node beside the bodies may move an equation", row)
        value = scaled(prescribed, -factor)
    kept = [
        {"factor": factor, "component": f"u{AXES[axis]}", "node": int(number[node])}
        for (node, axis), factor in factors.items()
        if factor
    ]
    return kept, value


def mpc(import_: Import, card: Card) -> None:
    """Take nodes that stay in a plane (PLANE), on a line (STRAIGHT), or have a mean rotation (MEANROT)."""
    lists: list[tuple[str, list[int], DeckLine]] = []
    for row in card.rows:
        fields = [text for text in row.fields if text]
        if fields and not fields[0].isdigit():
            lists.append((fields.pop(0).upper(), [], row))
        if not lists:
            raise Refused("it should begin with PLANE, STRAIGHT or MEANROT", row)
        for text in fields:
            lists[-1][1].extend(import_.names.nodes(text, row)[1].tolist())
    takes = {"PLANE": _plane, "STRAIGHT": _straight, "MEANROT": _mean_rotation}
    for kind, nodes, row in lists:
        if kind not in takes:
            raise Refused(f"lacsolver has the constraints PLANE, STRAIGHT and MEANROT, and not {kind}", row)
        for terms in takes[kind](import_.names.mesh.points, nodes, row):
            _equate(import_, card, row, [term for term in terms if term[2]], kind)


def _plane(x: np.ndarray, nodes: list[int], row: DeckLine) -> list[Terms]:
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


def _straight(x: np.ndarray, nodes: list[int], row: DeckLine) -> list[Terms]:
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


def _mean_rotation(x: np.ndarray, nodes: list[int], row: DeckLine) -> list[Terms]:
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


def transform(import_: Import, card: Card) -> None:
    """Take local axes of nodes: rectangular (R) or cylindrical (C), from two points."""
    _, nodes = import_.names.nodes(card.needed("NSET"), None)
    kind = card.word("TYPE", "R")
    row = card.first("six coordinates")
    a, b = _two_points(row)
    if kind == "R":
        if not np.linalg.norm(np.cross(a, b)) > _FLAT * np.linalg.norm(a) * np.linalg.norm(b):
            raise Refused("the two points of *TRANSFORM are on one line with the origin; give two that are not", row)
        axes = {"x": a.tolist(), "xy": b.tolist()}
    elif kind == "C":
        axes = {"origin": a.tolist(), "axis": _axis(a, b, row)}
    else:
        raise Refused(f"axes are rectangular (TYPE=R) or cylindrical (TYPE=C), and not {kind}")
    import_.systems.append((np.asarray(nodes), axes))


def _two_points(row: DeckLine) -> tuple[np.ndarray, np.ndarray]:
    """Return the two points (3,) of a line of six coordinates, 0 where they are left out."""
    x = np.array(row.numbers(0, 6, "a coordinate", 0.0))
    return x[:3], x[3:]


def _axis(a: np.ndarray, b: np.ndarray, row: DeckLine) -> list[float]:
    """Return the direction from a to b. Raises Refused if they are one point."""
    if not (b - a).any():
        raise Refused("the two points of the axis are the same", row)
    return [float(x) for x in b - a]


# ---- bolts


def pretension_section(import_: Import, card: Card) -> None:
    """Take a section of a bolt, with the node that has its force or its shortening, and the normal if it is given."""
    if "ELEMENT" in card.options:
        raise Refused("a bolt that is a beam has no section here; mesh it with solid elements, and give a SURFACE")
    group, facets = import_.names.skin(card.needed("SURFACE"), None)
    _, nodes = import_.names.nodes(card.needed("NODE"), None)
    if len(nodes) != 1:
        raise Refused(f"NODE should be one node, and {card.options['NODE']} has {len(nodes)}")
    node = int(nodes[0])
    if import_.names.in_cells[node]:
        raise Refused("NODE should be a node of its own, beside those of the elements")
    if len(card.rows) > 1:
        raise Refused("the data line should be the normal of the section", card.rows[1])
    normal = card.rows[0].numbers(0, 3, "the normal", 0.0) if card.rows else []
    import_.references.append(node)
    import_.locks[node] = None

    def add() -> None:
        pulled, moved = (import_.value(kind, node, 0) for kind in ("force", "displacement"))
        keys: dict[str, Any] = {"group": import_.groups.add("skins", group, facets)}
        if any(normal):
            keys["normal"] = normal[: import_.dim]
        if pulled is not None and moved is not None:
            message = "its node has a force and then a displacement; lock the bolt by *BOUNDARY, FIXED instead"
            raise Refused(message)
        if pulled is None and moved is None:
            number = import_.names.mesh.node_number[node]
            raise Refused(f"node {number} has no *CLOAD and no *BOUNDARY in direction 1")
        keys |= {"shortening": moved} if pulled is None else {"force": pulled}
        if (lock := import_.locks[node]) is not None:
            keys["lock"] = import_.steps[lock].begin
        import_.add("pretension", keys, card)

    import_.later("pretension", card, add)


# ---- couplings


def coupling(import_: Import, card: Card) -> None:
    """Begin a coupling of a surface with a reference node; *KINEMATIC or *DISTRIBUTING follows."""
    name, axes = card.needed("SURFACE"), None
    there = import_.names.deck.surface_group(name)
    if there is not None and there[0] == "NODE":
        on, (name, members) = "nodes", (there[1], np.asarray(import_.names.mesh.node_groups[there[1]]))
    else:
        on, (name, members) = "skins", import_.names.skin(name, None)
    reference = import_.names.node(card.needed("REFNODE"))
    if "ORIENTATION" in card.options:
        known = import_.orientations
        x, y = known[look_up(known, card.options["ORIENTATION"], "*ORIENTATION above it")]
        axes = {"x": list(x), "xy": list(y)}
    _couple(import_, card, reference, (on, name, members), {"kind": "", "axes": axes})


def kinematic(import_: Import, card: Card) -> None:
    """Take the directions in which the nodes of a coupling follow its reference node: all, if none are listed."""
    which = _open(import_)
    which["kind"] = "rigid"
    directions: set[int] = set()
    for row in card.rows:
        first = row.whole(0, "a direction")
        directions |= set(range(first, row.whole(1, "a direction", first) + 1))
    followed = sorted(directions & {1, 2, 3})
    if card.rows and not followed:
        raise Refused("nodes of solid elements have the directions 1 to 3 alone", card.rows[0])
    if 0 < len(followed) < import_.dim:
        which["components"] = [f"u{AXES[d - 1]}" for d in followed]


def distributing(import_: Import, card: Card) -> None:
    """Take that loads at the reference node of a coupling are spread by area over its surface."""
    _open(import_)["kind"] = "distributing"
    if card.word("WEIGHTINGMETHOD", "UNIFORM") != "UNIFORM":
        raise Refused("weights are those of the area (WEIGHTING METHOD=UNIFORM), or of *DISTRIBUTING COUPLING")


def _open(import_: Import) -> dict[str, Any]:
    """Return the keys of the coupling begun last. Raises Refused if there is none, or it has its kind."""
    if not import_.couplings or import_.couplings[-1]["kind"]:
        raise Refused("it belongs after *COUPLING; move it there")
    return import_.couplings[-1]


def distributing_coupling(import_: Import, card: Card) -> None:
    """Take nodes with weights, over which the loads at the node of an element DCOUP3D are spread."""
    reference = _coupled_node(import_, card)
    weights: dict[int, float] = {}
    for row in card.rows:
        weights |= dict.fromkeys(import_.names.nodes(row.text(0), row)[1].tolist(), row.number(1, "the weight"))
    if not weights:
        raise Refused("it should list nodes and their weights")
    x, sizes = import_.names.mesh.points, np.array(list(weights.values()))
    away = sizes @ (x[list(weights)] - x[reference])
    if np.linalg.norm(away) > _FLAT * np.abs(sizes).sum() * np.linalg.norm(np.ptp(x, axis=0)):
        message = "its node is not at the centre of the weights, where CalculiX lets the load act"
        import_.warn(card, f"{message}: here and in Abaqus it acts at the node")
    number = import_.names.mesh.node_number
    rows = [[int(number[node]), weight] for node, weight in weights.items()]
    keys = {"kind": "distributing", "weights": rows}
    _couple(import_, card, reference, ("nodes", "coupled", np.array(sorted(weights))), keys)


def _coupled_node(import_: Import, card: Card) -> int:
    """Return the node of the element DCOUP3D in the set of a card, which is no cell of the mesh. Raises Refused."""
    wanted = key_of(card.needed("ELSET"))
    rows = [
        row
        for one in map(Card.from_deck, import_.names.deck.named("ELEMENT"))
        if one.word("TYPE") == "DCOUP3D" and key_of(one.options.get("ELSET", "")) == wanted
        for row in one.rows
    ]
    if len(rows) != 1:
        raise Refused(f"the set {card.options['ELSET']} should have one element of type DCOUP3D, and has {len(rows)}")
    return int(import_.names.nodes(rows[0].text(1), rows[0])[1][0])


def _couple(
    import_: Import, card: Card, reference: int, group: tuple[str, str, Ints], keys: dict[str, Any]
) -> None:  # fmt: skip
    """Add a [[coupling]] once all cards are read, if its reference node moves or is loaded.

    `group`: kind (nodes or skins), name and members; `keys`: its kind, "" as long as it is not known, weights,
    components and axes.
    """
    on, name, members = group
    mesh = import_.names.mesh
    import_.couplings.append(keys)
    import_.references.append(reference)

    def add() -> None:
        if not keys["kind"]:
            raise Refused("it should be followed by *KINEMATIC or *DISTRIBUTING")
        acting = _acting(import_, reference, keys)
        if not acting and keys["kind"] == "distributing":
            import_.note(card, "its reference node has neither a load nor a motion, so that it has no effect")
            return
        if on == "nodes" and len(loose := members[~import_.names.in_cells[members]]):
            raise Refused(f"nodes {some(mesh.node_number[loose])} belong to no solid element")
        number = mesh.node_number[reference]
        head = {"name": f"{name} {number}", "group": import_.groups.add(on, name, members), "kind": keys["kind"]}
        if import_.model != "axisymmetric":
            head["at"] = mesh.points[reference][: import_.dim].tolist()
        if keys.get("axes"):
            keys["axes"] = import_.axes_in_model(keys["axes"])
        rest = {key: keys[key] for key in ("weights", "components", "axes") if keys.get(key)}
        import_.add("coupling", head | rest | (acting or {"fy": 0.0}), card)

    import_.later("coupling", card, add)


def _acting(import_: Import, reference: int, keys: dict[str, Any]) -> dict[str, Any]:
    """Return motions and loads at the reference node of a coupling. Raises Refused for other rotations."""
    if import_.axes_at(reference) is not None:
        raise Refused("the reference node of a coupling has the axes of the mesh; take its *TRANSFORM out")
    if keys.get("axes") and any(motion(import_, reference, c) for c in range(3)):
        raise Refused("loads at a reference node are along the axes of the mesh; leave ORIENTATION out")
    acting: dict[str, Any] = {}
    for c in [1] if import_.model == "axisymmetric" else range(import_.dim):
        acting |= motion(import_, reference, c)
    if import_.model == "axisymmetric":
        return acting
    acting |= turning(import_, reference, None)
    turned = acting.get("rotation", "free")
    free = [one == "free" for one in (turned if import_.dim == 3 and turned != "free" else [turned])]
    if import_.large and keys["kind"] == "distributing" and any(free) and not all(free):
        message = "with NLGEOM a distributing coupling turns freely about all axes or about none"
        raise Refused(f"{message}; fix all or none, or make it *KINEMATIC")
    if import_.large and keys["kind"] == "rigid" and (keys.get("axes") or "components" in keys) and any(free):
        message = "with NLGEOM a coupling of some directions turns only as its rotations are prescribed"
        raise Refused(f"{message}; fix all of them, or let all directions follow")
    return acting


# ---- sectors


def cyclic_tie(import_: Import, card: Card) -> None:
    """Take the sides of a sector; *CYCLIC SYMMETRY MODEL has its angle."""
    row = card.first("the two sides of the sector")
    slave, master = (import_.names.skin(text, row) for text in row.two_skins())
    rest: dict[str, Any] = {}
    import_.sectors[key_of(card.needed("NAME"))] = rest

    def add() -> None:
        if not rest:
            raise Refused("it should be followed by *CYCLIC SYMMETRY MODEL, N=sectors")
        if rest["sectors"] < 2:
            raise Refused("the number of sectors N should be 2 at least")
        if import_.dim == 2 and any(rest.pop("axis")[:2]):
            raise Refused("the axis of a sector in a plane should be along z")
        rest["origin"] = rest["origin"][: import_.dim]
        sides = {"slave": import_.groups.add("skins", *slave), "master": import_.groups.add("skins", *master)}
        import_.add("cyclic", sides | rest, card)

    import_.later("cyclic", card, add)


def cyclic_model(import_: Import, card: Card) -> None:
    """Take the number of sectors, and two points of the axis."""
    if not import_.sectors:
        raise Refused("it should follow *TIE, CYCLIC SYMMETRY, NAME=name; write that before")
    name = card.options.get("TIE", next(reversed(import_.sectors)))
    which = import_.sectors[look_up(import_.sectors, name, "*TIE, CYCLIC SYMMETRY")]
    if card.options.get("ELSET", ""):
        import_.note(card, "the fields of the whole ring are written if the case says ring = true")
    row = card.first("two points of the axis")
    a, b = _two_points(row)
    which |= {"sectors": int(card.number("N")), "axis": _axis(a, b, row), "origin": a.tolist()}
