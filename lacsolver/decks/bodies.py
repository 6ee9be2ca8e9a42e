"""Elements, rigid bodies with their masses, and springs: their cards and records."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from lacmesh.deck import key_of
from lacmesh.errors import some
from lacmesh.mesh import Ints
from lacsolver.decks.cards import Card, Refused
from lacsolver.decks.import_ import AXES, DeckRigid, Import

#: elements that lacsolver computes, and letters of their names that change how they are computed
_SOLIDS = re.compile(r"(?:C3D(?:4|6|8|10|15|20|27)|CPS(?:3|4|6|8)|CPE(?:3|4|6|8)|CAX(?:3|4|6|8))([RIHM]*)")
_POINTS = ("SPRING1", "MASS", "ROTARYI")
_PAIRS = ("SPRING2", "SPRINGA")
_VARIANTS = {
    "R": "reduced integration",
    "I": "incompatible modes",
    "H": "a pressure of its own (hybrid)",
    "M": "a modified tetrahedron",
}


def element(import_: Import, card: Card) -> None:
    """Take elements that are solids or springs; others have no place in lacsolver."""
    name = card.word("TYPE")
    solid = _SOLIDS.fullmatch(name)
    if name in _PAIRS:
        import_.spring_types.add(name)
    elif name == "DCOUP3D":
        import_.couplers.add(key_of(card.options.get("ELSET", "")))
    elif solid is None and name not in _POINTS:
        raise Refused(
            "lacsolver computes solid elements (C3D, CPS, CPE, CAX), springs (SPRING1, SPRING2, SPRINGA) and masses of "
            f"rigid bodies (MASS, ROTARYI), and none of type {name or '(none)'}; model this part with solid "
            "elements, or take it out"
        )
    elif solid and solid[1] and name not in import_.variants:
        import_.variants.add(name)
        _warn_of_variant(import_, card, name, solid[1])


def _warn_of_variant(import_: Import, card: Card, name: str, letters: str) -> None:
    """Warn that elements of a variant are computed otherwise here; linear ones are too stiff in bending."""
    variants = " and ".join(_VARIANTS[letter] for letter in dict.fromkeys(letters))
    message = f"{name} has {variants}; lacsolver computes the same shape with full integration"
    if letters == "H":
        import_.note(card, message)
        return
    linear = re.search(r"[48][A-Z]*$", name) and not name.startswith(("CPS8", "CPE8", "CAX8"))
    advice = ", which is too stiff in bending: elevate its order before (lacmesh convert --order 2)" if linear else ""
    import_.warn(card, message + advice)


def surface(import_: Import, card: Card) -> None:
    """Refuse surfaces without faces and nodes in the mesh, such as analytical ones."""
    del import_
    kind = card.word("TYPE", "ELEMENT")
    if kind not in ("ELEMENT", "NODE"):
        raise Refused(f"a surface of type {kind} has no faces in the mesh; list element faces (TYPE=ELEMENT)")


# ---- rigid bodies


def rigid_body(import_: Import, card: Card) -> None:
    """Take a rigid body, with the nodes that hold its place and its rotation."""
    names = import_.names
    if "NSET" in card.options:
        kind, (group, nodes) = "node", names.nodes(card.needed("NSET"), None)
    else:
        kind, (group, cells) = "cell", names.cells(card.needed("ELSET"), None)
        nodes = np.unique(np.concatenate([part.ravel() for _, _, part in names.mesh.select(cells)]))
    if not group:
        raise Refused("a rigid body should be a set of nodes or of elements, not a number")
    reference = names.node(card.needed("REFNODE"))
    body = DeckRigid(nodes, reference, names.node(card.needed("ROTNODE")) if "ROTNODE" in card.options else None)
    import_.bodies.append(body)
    import_.references.append(reference)
    import_.later("rigid", card, lambda: _add_rigid(import_, card, body, kind, group))


def _add_rigid(import_: Import, card: Card, body: DeckRigid, kind: str, group: str) -> None:
    """Add the [[rigid]] of a body. Raises Refused."""
    if kind == "node":
        group = import_.groups.add("nodes", group, body.nodes)
    keys: dict[str, Any] = {"group": group, "kind": kind}
    round_ = import_.model == "axisymmetric"
    if not round_:
        keys["centre"] = import_.names.mesh.points[body.reference][: import_.dim].tolist()
    for c in [1] if round_ else range(import_.dim):
        keys |= motion(import_, body.reference, c) or {f"f{AXES[c]}": 0.0}
    if not round_:
        turns = turning(import_, body.reference, body.rotation)
        keys |= turns or {"moment": [0.0] * 3 if import_.dim == 3 else 0.0}
    import_.add("rigid", keys | _own_mass(import_, body), card)


def motion(import_: Import, node: int, c: int) -> dict[str, Any]:
    """Return how a component of a reference node moves: prescribed, or under a force; {} where the deck has neither."""
    prescribed, pushed = (import_.value(kind, node, c) for kind in ("displacement", "force"))
    if prescribed is not None:
        return {f"u{AXES[c]}": prescribed}
    return {} if pushed is None else {f"f{AXES[c]}": pushed}


def turning(import_: Import, node: int, rotation: int | None) -> dict[str, Any]:
    """Return how a body or a coupling turns, by its reference node: prescribed, or free under a moment.

    `rotation`: a node whose displacements and forces are rotations and moments, None if there is none. {} where the
    deck says nothing. Raises Refused.
    """

    def values(kind: str, of_rotation: str) -> list[Any]:
        axes = range(3) if import_.dim == 3 else [2]
        other = [None if rotation is None else import_.value(of_rotation, rotation, c) for c in axes]
        own = [import_.value(kind, node, c) for c in axes]
        return [beside if one is None else one for one, beside in zip(own, other, strict=True)]

    def key(every: list[Any], default: Any) -> Any:
        shown = [default if one is None else one for one in every]
        return shown if import_.dim == 3 else shown[0]

    prescribed, loaded = values("spin", "displacement"), values("moment", "force")
    loaded = [m if theta is None else None for theta, m in zip(prescribed, loaded, strict=True)]
    keys = {"rotation": key(prescribed, "free")} if any(one is not None for one in prescribed) else {}
    return keys | ({"moment": key(loaded, 0.0)} if any(one is not None for one in loaded) else {})


def _own_mass(import_: Import, body: DeckRigid) -> dict[str, Any]:
    """Return mass and inertia of the elements at the reference node of a body. Raises Refused for a wrong mass."""
    own = [one for one in import_.masses if one[0] == body.reference]
    if not own:
        return {}
    mass = sum(one[1] for one in own)
    inertia = np.sum([one[2] for one in own], axis=0).tolist()
    if not mass > 0:
        raise Refused("the mass at the reference node of a rigid body should be positive", None, own[0][3])
    return {"mass": mass} | ({"inertia": inertia if import_.dim == 3 else inertia[2]} if any(inertia) else {})


def mass(import_: Import, card: Card) -> None:
    """Take the mass of each element of type MASS in a set."""
    _add_mass(import_, card, card.single("the mass").number(0, "the mass"), (0.0, 0.0, 0.0))


def rotary_inertia(import_: Import, card: Card) -> None:
    """Take the moments of inertia of each element of type ROTARYI in a set, about axes along x, y and z."""
    row = card.single("the moments of inertia")
    if any(row.numbers(3, 3, "a product of inertia", 0.0)):
        raise Refused("products of inertia are not supported; lacsolver has moments about axes along x, y and z", row)
    _add_mass(import_, card, 0.0, tuple(row.numbers(0, 3, "a moment of inertia", 0.0)))


def _add_mass(import_: Import, card: Card, mass: float, inertia: tuple[float, ...]) -> None:
    """Take a mass and an inertia at each node of a set; other nodes than reference nodes are an error later."""
    _, nodes = import_.names.points(card.needed("ELSET"))
    if import_.names.mesh.plane == "CAX":
        raise Refused(
            "a mass of an axisymmetric model is that of a sector of 2 degrees in CalculiX, and of the full circle in "
            "Abaqus and here; write mass into the [[rigid]] of the case"
        )
    import_.masses += [(node, mass, inertia, card) for node in nodes.tolist()]

    def check() -> None:
        loose = np.setdiff1d(nodes, [body.reference for body in import_.bodies])
        if len(loose):
            message = f"node {import_.names.mesh.node_number[loose[0]]} is no reference node of a *RIGID BODY"
            message += ", and others have the mass of their elements alone in lacsolver"
            raise Refused(f"{message}; spread the mass by *DENSITY")

    import_.later("rigid", card, check)


# ---- springs


def spring(import_: Import, card: Card) -> None:
    """Add linear springs: a line with directions, blank for those along a line, and a line with the stiffness."""
    if import_.names.mesh.plane == "CAX":
        raise Refused(
            "a spring of an axisymmetric model is that of a sector of 2 degrees in CalculiX, and of the full circle in "
            "Abaqus and here; write a [[spring]] into the case"
        )
    ends = import_.names.pairs(card.needed("ELSET"))
    if len(ends):
        _between_nodes(import_, card, ends)
        return
    group, nodes = import_.names.points(card.needed("ELSET"))
    if len(card.rows) != 2:
        raise Refused("a spring to the ground is a line with its direction, 1 to 3, and one with its stiffness")
    axis = card.rows[0].whole(0, "the direction")
    stiffness = card.rows[1].number(0, "the stiffness")
    if axis not in (1, 2, 3) or not stiffness > 0:
        raise Refused("the direction should be 1 to 3, and the stiffness positive", card.rows[0])
    distinct, counts = np.unique(nodes, return_counts=True)  # springs at one place add
    for count in np.unique(counts).tolist():
        own = import_.node_group(group, distinct[counts == count], "sprung")
        import_.add("spring", {"group": own, f"k{AXES[axis - 1]}": count * stiffness}, card)


def _between_nodes(import_: Import, card: Card, ends: Ints) -> None:
    """Add linear springs between the nodes `ends` (m, 2). Raises Refused."""
    rows = [row for row in card.rows if any(row.fields)]
    kind = {1: "SPRINGA", 2: "SPRING2"}.get(len(rows), "")
    if kind not in import_.spring_types:
        raise Refused(
            "a SPRING2 is a line with its two directions and one with its stiffness, a SPRINGA a blank line and one "
            "with its stiffness, at one temperature"
        )
    stiffness = rows[-1].positive(0, "the stiffness")
    loose = np.unique(ends[~import_.names.in_cells[ends]])
    if len(loose):
        message = f"nodes {some(import_.names.mesh.node_number[loose])} belong to no solid element, and carry no spring"
        raise Refused(f"{message}; SPRING1 is a spring to the ground")
    name = "k"
    if kind == "SPRING2":
        first, second = (rows[0].whole(k, "the direction") for k in (0, 1))
        if first not in (1, 2, 3) or first != second:
            raise Refused("a SPRING2 has one direction, 1 to 3, at both its nodes in lacsolver", rows[0])
        name = f"k{AXES[first - 1]}"
    for one, other in ends:
        groups = {"group": import_.node_group("", one[None]), "to": import_.node_group("", other[None])}
        import_.add("spring", groups | {name: stiffness}, card)
