"""Handlers of the cards of steps: how time runs, supports, loads, temperatures, motion, and what is printed."""

from __future__ import annotations

import numpy as np

from lacmesh.deck import key_of
from lacmesh.mesh import Ints
from lacsolver.decks.cards import Card, DeckLine, Lacking, Refused
from lacsolver.decks.content import Assigned, DeckContent, DeckStep, PointMass

#: supports of Abaqus that have a name, and the displacements that they hold; rotations have no meaning in a solid
_NAMED_SUPPORTS = {"ENCASTRE": (0, 1, 2), "PINNED": (0, 1, 2), "XSYMM": (0,), "YSYMM": (1,), "ZSYMM": (2,)}
#: most nodes of one *NODE PRINT that become probes
MOST_PROBES = 20


def step(deck: DeckContent, card: Card) -> None:
    """Begin a step."""
    begin = deck.steps[-1].end if deck.steps else 0.0
    before = bool(deck.steps) and deck.steps[-1].large  # which stays, unless a step says NO
    large = card.word("NLGEOM") != "NO" if "NLGEOM" in card.options else before
    if deck.steps and large != deck.steps[0].large:
        raise Refused("lacsolver has small or finite displacements for all steps; say NLGEOM in all of them or in none")
    if (card.word("AMPLITUDE") or "RAMP") not in ("RAMP", "STEP"):
        raise Refused(f"the amplitude of a step is RAMP or STEP, and not {card.word('AMPLITUDE')}")
    deck.steps.append(DeckStep(card, begin, large=large, sudden=card.word("AMPLITUDE") == "STEP"))
    deck.in_step = True


def static(deck: DeckContent, card: Card) -> None:
    """Take the first increment and the length of a step."""
    take_times(deck.begin_procedure(card), card)


def take_times(which: DeckStep, card: Card) -> None:
    """Take the increments and the length of a step from its procedure. Raises Refused."""
    if card.rows:
        row = card.rows[0]
        which.increment, which.period = row.number(0, "the first increment", 1.0), row.number(1, "the period", 1.0)
        which.largest = row.number(3, "the largest increment", 0.0)
        if not (which.period > 0 and which.increment > 0 and which.largest >= 0):
            raise Refused("the increments and the period of a step should be positive", row)
    which.direct = "DIRECT" in card.options


def frequency(deck: DeckContent, card: Card) -> None:
    """Take how many natural modes are asked for: `lacsolver modes` finds them."""
    which = deck.begin_procedure(card)
    which.modes = card.first("the number of modes").whole(0, "the number of modes")
    if which.modes < 1:
        raise Refused("the number of modes should be positive", card.rows[0])
    state = ", with --state DIR for those about the state of a run" if len(deck.steps) > 1 else ""
    deck.note(card, f"natural modes are found by lacsolver modes CASE.toml -k {which.modes}{state}")


def end_step(deck: DeckContent, card: Card) -> None:
    """End a step, if one is open; one that asks for modes takes no time, and may not load anything."""
    del card
    if not deck.in_step:
        return
    deck.in_step = False
    which = deck.steps[-1]
    if which.modes:
        now = len(deck.steps) - 1
        deck.modal = deck.steps.pop()
        if any(line.step == now for line in deck.assigned):
            raise Refused("supports and loads of a *FREQUENCY step are not taken; give supports in the model")
    elif "PERTURBATION" in which.card.options:
        raise Refused("a step of small PERTURBATION is taken with *FREQUENCY alone; leave the option out")


def _now(deck: DeckContent) -> int:
    """Return the number of the step that is open, -1 before the first. Raises Refused between steps."""
    if deck.steps and not deck.in_step:
        raise Refused("it stands between two steps; move it into one, between *STEP and *END STEP")
    return len(deck.steps) - 1 if deck.in_step else -1


def _begin(deck: DeckContent, card: Card, *kinds: str) -> int:
    """Return the number of the step, and keep that OP=NEW removes what earlier steps have said of some kinds."""
    now = _now(deck)
    if card.word("OP") == "NEW":
        for kind in kinds:
            deck.removed[kind][now] = card
    elif card.word("OP") not in ("", "MOD"):
        raise Refused(f"OP is MOD or NEW, and not {card.word('OP')}")
    return now


def boundary(deck: DeckContent, card: Card) -> None:
    """Take prescribed displacements; those of the model are supports, and what is not 0 begins in the first step."""
    if (kind := card.word("TYPE") or "DISPLACEMENT") != "DISPLACEMENT":
        raise Refused(f"supports prescribe displacements, and not TYPE={kind}; give the displacement as an *AMPLITUDE")
    now = _begin(deck, card, "displacement")
    if "FIXED" in card.options:
        _lock(deck, card, now)
        return
    for row in card.rows:
        nodes = deck.names.nodes(row.text(0), row)
        named = _NAMED_SUPPORTS.get(row.text(1).upper())
        first = 1 if named else row.whole(1, "the first direction")
        last = row.whole(2, "the last direction", first) if not named else first
        if not 1 <= first <= last <= 6:
            raise Refused("the directions should be 1 to 3, or 4 to 6 for rotations of a rigid body", row)
        value = 0.0 if named else row.number(3, "the displacement", 0.0)
        if value and now < 0:
            deck.note(
                card, "a displacement among the model's data that is not 0 is taken as one of the first step", row
            )
        begin = 0 if value and now < 0 else now
        axes = named or tuple(range(first - 1, last))
        for kind, some in (("displacement", [a for a in axes if a < 3]), ("spin", [a - 3 for a in axes if a >= 3])):
            if some:
                _assign(deck, card, row, kind, begin, nodes, tuple(some), value)


def _lock(deck: DeckContent, card: Card, now: int) -> None:
    """Take that sections of bolts, and nodes of bodies, stay as they are from a step on. Raises Refused for others."""
    for row in card.rows:
        named = deck.names.nodes(row.text(0), row)
        first = row.whole(1, "the first direction")
        last = row.whole(2, "the last direction", first)
        sections = [bolt for bolt in deck.bolts if bolt.reference in named[1]]
        solid = bool(deck.names.in_cells[named[1]].all())
        if now < 1 or not 1 <= first <= last <= (3 if solid else 1) or not (solid or len(sections) == len(named[1])):
            message = (
                "FIXED is taken from the second step on, for nodes of solid elements in directions 1 to 3, and for"
            )
            raise Refused(f"{message} nodes of *PRE-TENSION SECTION in direction 1; write other displacements", row)
        if solid:
            _assign(deck, card, row, "held", now, named, tuple(range(first - 1, last)), 0.0)
        for bolt in sections:
            bolt.lock = now if bolt.lock is None else bolt.lock


def cload(deck: DeckContent, card: Card) -> None:
    """Take forces on nodes, and moments on the node of a rigid body."""
    now = _in_step(deck, card, "force")
    for row in card.rows:
        nodes = deck.names.nodes(row.text(0), row)
        axis = row.whole(1, "the direction")
        if not 1 <= axis <= 6:
            raise Refused("the direction of a force should be 1 to 3, or 4 to 6 for a moment on a rigid body", row)
        kind, component = ("force", axis - 1) if axis < 4 else ("moment", axis - 4)
        _assign(deck, card, row, kind, now, nodes, (component,), row.number(2, "the force"))


def _in_step(deck: DeckContent, card: Card, *kinds: str) -> int:
    deck.step  # noqa: B018 (raises outside a step)
    return _begin(deck, card, *kinds)


def _assign(
    deck: DeckContent, card: Card, row: DeckLine, kind: str, now: int, named: tuple[str, Ints],
    components: tuple[int, ...], value: float, data: tuple[float, ...] = (),
) -> None:  # fmt: skip
    """Add one line to the content; `named`: a set and its items. Raises Refused for an amplitude that is not there."""
    amplitude = key_of(card.options["AMPLITUDE"]) if "AMPLITUDE" in card.options else ""
    if amplitude and amplitude not in deck.amplitudes:
        raise Refused(f"there is no *AMPLITUDE named {card.options['AMPLITUDE']!r} above this card")
    deck.assigned.append(Assigned(kind, now, *named, components, value, amplitude, card, row, data))


def dload(deck: DeckContent, card: Card) -> None:
    """Take pressures on faces of elements, gravity, and centrifugal loads."""
    now = _in_step(deck, card, "pressure", "gravity", "centrifugal")
    for row in card.rows:
        named = name, cells = deck.names.cells(row.text(0), row)
        label = row.text(1).upper()
        if label == "GRAV":
            size = row.number(2, "the acceleration")
            way = np.array([row.number(k, "a direction", 0.0) for k in (3, 4, 5)])
            if not np.linalg.norm(way) > 0:
                raise Refused("the direction of gravity should not be 0", row)
            way = way / np.linalg.norm(way)
            along = tuple((way.round(9) + 0.0).tolist())
            for axis, part in enumerate(size * way):
                _assign(deck, card, row, "gravity", now, named, (axis,), float(part), along)
        elif label == "CENTRIF":
            axis_data = tuple(row.number(k, "a point or a direction of the axis", 0.0) for k in range(3, 9))
            if not np.linalg.norm(axis_data[3:]) > 0:
                raise Refused("the direction of the axis should not be 0", row)
            value = row.number(2, "the square of the angular velocity")
            _assign(deck, card, row, "centrifugal", now, named, (0,), value, axis_data)
        elif label[:1] == "P" and label[1:].isdigit():
            facets = deck.names.facets(cells, label[1:], row)
            _assign(deck, card, row, "pressure", now, (f"{name}_{label}" if name else "", facets), (0,),
                    row.number(2, "the pressure"))  # fmt: skip
        else:
            raise Refused(f"lacsolver has the loads P1 to P6, GRAV and CENTRIF, and not {label or '(none)'}", row)


def dsload(deck: DeckContent, card: Card) -> None:
    """Take pressures on surfaces."""
    now = _in_step(deck, card, "pressure")
    for row in card.rows:
        if row.text(1).upper() != "P":
            raise Refused(f"lacsolver has the load P on a surface, and not {row.text(1) or '(none)'}", row)
        facets = deck.names.skin(row.text(0), row)
        _assign(deck, card, row, "pressure", now, facets, (0,), row.number(2, "the pressure"))


def model_change(deck: DeckContent, card: Card) -> None:
    """Take contact that is removed for some steps, or added again."""
    now = deck.steps.index(deck.step)
    if card.word("TYPE") != "CONTACTPAIR":
        raise Lacking("elements are there in all steps; leave out the steps without them")
    if ("ADD" in card.options) == ("REMOVE" in card.options):
        raise Refused("it should say either ADD or REMOVE")
    for row in card.rows:
        slave, master = row.two_skins()
        pair = key_of(slave), key_of(master)
        if pair not in {(one.slave, one.master) for one in deck.pairs if not one.tie}:
            raise Refused(f"there is no *CONTACT PAIR of {slave} and {master}; name one of them", row)
        deck.changes[pair].append((now, "ADD" in card.options, card))


def temperature(deck: DeckContent, card: Card) -> None:
    """Take temperatures of nodes."""
    now = _in_step(deck, card, "temperature")
    for row in card.rows:
        nodes = deck.names.nodes(row.text(0), row)
        _assign(deck, card, row, "temperature", now, nodes, (0,), row.number(1, "the temperature"))


def node_print(deck: DeckContent, card: Card) -> None:
    """Make probes of the nodes whose displacements are asked for; fields and tables have the rest."""
    wanted = {text.upper() for row in card.rows for text in row.fields if text}
    said = []
    if "U" in wanted:
        name, nodes = deck.names.nodes(card.needed("NSET"), None)
        nodes = nodes[deck.names.in_cells[nodes]]
        if len(nodes) <= MOST_PROBES:
            deck.watched |= dict.fromkeys(nodes.tolist())
            said.append(f"U of {name}: {len(nodes)} probes")
        else:
            said.append(f"U of {name}: {len(nodes)} nodes are too many for probes; the fields have them")
    if "RF" in wanted:
        said.append("RF: results.json has the reactions of each support")
    if others := sorted(wanted - {"U", "RF"}):
        said.append(f"{', '.join(others)}: see docs/output.md for what a run writes")
    deck.note(card, "; ".join(said) or "nothing is asked for")


#: largest numerical damping of the method of Hilber, Hughes and Taylor
_MOST_DAMPING = 1 / 3


def dynamic(deck: DeckContent, card: Card) -> None:
    """Take an implicit step with inertia: its increments, and the numerical damping; loads act in full at once."""
    which = deck.begin_procedure(card)
    if "EXPLICIT" in card.options:
        message = (
            "lacsolver's time scheme is implicit, and this step is EXPLICIT; leave the option out, and give increments"
        )
        deck.lack(card, f"{message} in which a wave crosses a half to a whole element", "the step is implicit")
    alpha = -card.number("ALPHA", -0.05)
    if not 0 <= alpha <= _MOST_DAMPING:
        raise Refused(f"ALPHA should be from -1/3 to 0, not {-alpha:g}")
    take_times(which, card)
    which.alpha = alpha
    which.sudden = which.card.word("AMPLITUDE") != "RAMP"


def damping(deck: DeckContent, card: Card) -> None:
    """Take the Rayleigh damping of a material: ALPHA times its mass, BETA times its stiffness."""
    deck.material.damping = (card.number("ALPHA", 0.0), card.number("BETA", 0.0))


def mass(deck: DeckContent, card: Card) -> None:
    """Take the mass of each element of type MASS in a set."""
    row = card.single("the mass")
    _add(deck, card, row.number(0, "the mass"), None)


def rotary_inertia(deck: DeckContent, card: Card) -> None:
    """Take the moments of inertia of each element of type ROTARYI in a set, about axes along x, y and z."""
    row = card.single("the moments of inertia")
    if any(row.number(k, "a product of inertia", 0.0) for k in (3, 4, 5)):
        raise Refused("products of inertia are not taken; lacsolver has moments about axes along x, y and z", row)
    _add(deck, card, 0.0, tuple(row.number(k, "a moment of inertia", 0.0) for k in range(3)))


def _add(deck: DeckContent, card: Card, mass: float, inertia: tuple[float, ...] | None) -> None:
    _, nodes = deck.names.points(card.needed("ELSET"))
    if deck.names.mesh.plane == "CAX":
        raise Refused(
            "a mass of an axisymmetric model is that of a sector of 2 degrees in CalculiX, and of the full circle in "
            "Abaqus and here; write mass into the [[rigid]] of the case"
        )
    deck.masses += [PointMass(node, mass, inertia or (0.0, 0.0, 0.0), card) for node in nodes.tolist()]


def initial_conditions(deck: DeckContent, card: Card) -> None:
    """Take temperatures without strain, and the velocities with which nodes begin to move."""
    kind = card.word("TYPE")
    if kind not in ("TEMPERATURE", "VELOCITY"):
        raise Refused(f"initial conditions of type {kind or '(none)'} are not taken; TEMPERATURE and VELOCITY are")
    for row in card.rows:
        nodes = deck.names.nodes(row.text(0), row)
        if kind == "TEMPERATURE":
            _assign(deck, card, row, "temperature", -1, nodes, (0,), row.number(1, "the temperature"))
            continue
        axis = row.whole(1, "the direction")
        if axis not in (1, 2, 3):
            raise Refused("the direction of an initial velocity should be 1 to 3", row)
        _assign(deck, card, row, "velocity", -1, nodes, (axis - 1,), row.number(2, "the velocity"))
