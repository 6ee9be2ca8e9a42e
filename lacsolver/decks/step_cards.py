"""Handlers of the cards of steps: how time runs, supports, loads, temperatures, and what is printed."""

from __future__ import annotations

import numpy as np

from lacmesh.deck import key_of
from lacmesh.mesh import Ints
from lacsolver.decks.cards import Card, DeckLine, Lacking, Refused
from lacsolver.decks.content import Assigned, DeckStep
from lacsolver.decks.reading import Reading

#: supports of Abaqus that have a name, and the displacements that they hold; rotations have no meaning in a solid
_NAMED_SUPPORTS = {"ENCASTRE": (0, 1, 2), "PINNED": (0, 1, 2), "XSYMM": (0,), "YSYMM": (1,), "ZSYMM": (2,)}
#: most nodes of one *NODE PRINT that become probes
MOST_PROBES = 20


def step(reading: Reading, card: Card) -> None:
    """Begin a step."""
    content = reading.content
    begin = content.steps[-1].end if content.steps else 0.0
    before = bool(content.steps) and content.steps[-1].large  # which stays, unless a step says NO
    large = card.word("NLGEOM") != "NO" if "NLGEOM" in card.options else before
    if content.steps and large != content.steps[0].large:
        raise Refused("lacsolver has small or finite displacements for all steps; say NLGEOM in all of them or in none")
    if (card.word("AMPLITUDE") or "RAMP") not in ("RAMP", "STEP"):
        raise Refused(f"the amplitude of a step is RAMP or STEP, and not {card.word('AMPLITUDE')}")
    content.steps.append(DeckStep(card, begin, large=large, sudden=card.word("AMPLITUDE") == "STEP"))
    content.in_step = True


def static(reading: Reading, card: Card) -> None:
    """Take the first increment and the length of a step."""
    take_times(reading.content.begin_procedure(card), card)


def take_times(which: DeckStep, card: Card) -> None:
    """Take the increments and the length of a step from its procedure. Raises Refused."""
    if card.rows:
        row = card.rows[0]
        which.increment, which.period = row.number(0, "the first increment", 1.0), row.number(1, "the period", 1.0)
        which.largest = row.number(3, "the largest increment", 0.0)
        if not (which.period > 0 and which.increment > 0 and which.largest >= 0):
            raise Refused("the increments and the period of a step should be positive", row)
    which.direct = "DIRECT" in card.options


def frequency(reading: Reading, card: Card) -> None:
    """Take how many natural modes are asked for: `lacsolver modes` finds them."""
    which = reading.content.begin_procedure(card)
    which.modes = card.first("the number of modes").whole(0, "the number of modes")
    if which.modes < 1:
        raise Refused("the number of modes should be positive", card.rows[0])
    state = ", with --state DIR for those about the state of a run" if len(reading.content.steps) > 1 else ""
    reading.note(card, f"natural modes are found by lacsolver modes CASE.toml -k {which.modes}{state}")


def end_step(reading: Reading, card: Card) -> None:
    """End a step, if one is open; one that asks for modes takes no time, and may not load anything."""
    del card
    content = reading.content
    if not content.in_step:
        return
    content.in_step = False
    which = content.steps[-1]
    if which.modes:
        now = len(content.steps) - 1
        content.modal = content.steps.pop()
        if any(line.step == now for line in content.assigned):
            raise Refused("supports and loads of a *FREQUENCY step are not taken; give supports in the model")
    elif "PERTURBATION" in which.card.options:
        raise Refused("a step of small PERTURBATION is taken with *FREQUENCY alone; leave the option out")


def _now(reading: Reading) -> int:
    """Return the number of the step that is open, -1 before the first. Raises Refused between steps."""
    content = reading.content
    if content.steps and not content.in_step:
        raise Refused("it stands between two steps; move it into one, between *STEP and *END STEP")
    return len(content.steps) - 1 if content.in_step else -1


def _begin(reading: Reading, card: Card, *kinds: str) -> int:
    """Return the number of the step, and keep that OP=NEW removes what earlier steps have said of some kinds."""
    now = _now(reading)
    if card.word("OP") == "NEW":
        for kind in kinds:
            reading.content.removed[kind][now] = card
    elif card.word("OP") not in ("", "MOD"):
        raise Refused(f"OP is MOD or NEW, and not {card.word('OP')}")
    return now


def boundary(reading: Reading, card: Card) -> None:
    """Take prescribed displacements; those of the model are supports, and 0."""
    now = _begin(reading, card, "displacement")
    for row in card.rows:
        name, nodes = reading.names.nodes(row.text(0), row)
        named = _NAMED_SUPPORTS.get(row.text(1).upper())
        first = 1 if named else row.whole(1, "the first direction")
        last = row.whole(2, "the last direction", first) if not named else first
        if not 1 <= first <= last <= 6:
            raise Refused("the directions should be 1 to 3, or 4 to 6 for rotations of a rigid body", row)
        value = 0.0 if named else row.number(3, "the displacement", 0.0)
        if value and now < 0:
            raise Refused("a displacement other than 0 belongs into a step; move it there", row)
        axes = named or tuple(range(first - 1, last))
        for kind, some in (("displacement", [a for a in axes if a < 3]), ("spin", [a - 3 for a in axes if a >= 3])):
            if some:
                _assign(reading, card, row, kind, now, name, nodes, tuple(some), value)


def cload(reading: Reading, card: Card) -> None:
    """Take forces on nodes, and moments on the node of a rigid body."""
    now = _in_step(reading, card, "force")
    for row in card.rows:
        name, nodes = reading.names.nodes(row.text(0), row)
        axis = row.whole(1, "the direction")
        if not 1 <= axis <= 6:
            raise Refused("the direction of a force should be 1 to 3, or 4 to 6 for a moment on a rigid body", row)
        kind, component = ("force", axis - 1) if axis < 4 else ("moment", axis - 4)
        _assign(reading, card, row, kind, now, name, nodes, (component,), row.number(2, "the force"))


def _in_step(reading: Reading, card: Card, *kinds: str) -> int:
    reading.content.step  # noqa: B018 (raises outside a step)
    return _begin(reading, card, *kinds)


def _assign(
    reading: Reading, card: Card, row: DeckLine, kind: str, now: int, name: str, items: Ints,
    components: tuple[int, ...], value: float, data: tuple[float, ...] = (),
) -> None:  # fmt: skip
    """Add one line to the content. Raises Refused for an amplitude that is not there."""
    amplitude = key_of(card.options["AMPLITUDE"]) if "AMPLITUDE" in card.options else ""
    if amplitude and amplitude not in reading.content.amplitudes:
        raise Refused(f"there is no *AMPLITUDE named {card.options['AMPLITUDE']!r} above this card")
    reading.content.assigned.append(Assigned(kind, now, name, items, components, value, amplitude, card, row, data))


def dload(reading: Reading, card: Card) -> None:
    """Take pressures on faces of elements, gravity, and centrifugal loads."""
    now = _in_step(reading, card, "pressure", "gravity", "centrifugal")
    for row in card.rows:
        name, cells = reading.names.cells(row.text(0), row)
        label = row.text(1).upper()
        if label == "GRAV":
            size = row.number(2, "the acceleration")
            way = np.array([row.number(k, "a direction", 0.0) for k in (3, 4, 5)])
            if not np.linalg.norm(way) > 0:
                raise Refused("the direction of gravity should not be 0", row)
            for axis, part in enumerate(size * way / np.linalg.norm(way)):
                _assign(reading, card, row, "gravity", now, name, cells, (axis,), float(part))
        elif label == "CENTRIF":
            axis_data = tuple(row.number(k, "a point or a direction of the axis", 0.0) for k in range(3, 9))
            if not np.linalg.norm(axis_data[3:]) > 0:
                raise Refused("the direction of the axis should not be 0", row)
            value = row.number(2, "the square of the angular velocity")
            _assign(reading, card, row, "centrifugal", now, name, cells, (0,), value, axis_data)
        elif label[:1] == "P" and label[1:].isdigit():
            facets = reading.names.facets(cells, label[1:], row)
            _assign(reading, card, row, "pressure", now, f"{name}_{label}" if name else "", facets, (0,),
                    row.number(2, "the pressure"))  # fmt: skip
        else:
            raise Refused(f"lacsolver has the loads P1 to P6, GRAV and CENTRIF, and not {label or '(none)'}", row)


def dsload(reading: Reading, card: Card) -> None:
    """Take pressures on surfaces."""
    now = _in_step(reading, card, "pressure")
    for row in card.rows:
        if row.text(1).upper() != "P":
            raise Refused(f"lacsolver has the load P on a surface, and not {row.text(1) or '(none)'}", row)
        name, facets = reading.names.skin(row.text(0), row)
        _assign(reading, card, row, "pressure", now, name, facets, (0,), row.number(2, "the pressure"))


def model_change(reading: Reading, card: Card) -> None:
    """Take contact that is removed for some steps, or added again."""
    now = reading.content.steps.index(reading.content.step)
    if card.word("TYPE") != "CONTACTPAIR":
        raise Lacking("elements are there in all steps; leave out the steps without them")
    if ("ADD" in card.options) == ("REMOVE" in card.options):
        raise Refused("it should say either ADD or REMOVE")
    for row in card.rows:
        if len(row.fields) != 2:
            raise Refused("a line should be a slave surface and a master surface", row)
        pair = key_of(row.text(0)), key_of(row.text(1))
        if pair not in {(one.slave, one.master) for one in reading.content.pairs if not one.tie}:
            raise Refused(f"there is no *CONTACT PAIR of {row.text(0)} and {row.text(1)}; name one of them", row)
        reading.content.changes[pair].append((now, "ADD" in card.options, card))


def temperature(reading: Reading, card: Card) -> None:
    """Take temperatures of nodes."""
    now = _in_step(reading, card, "temperature")
    for row in card.rows:
        name, nodes = reading.names.nodes(row.text(0), row)
        _assign(reading, card, row, "temperature", now, name, nodes, (0,), row.number(1, "the temperature"))


def node_print(reading: Reading, card: Card) -> None:
    """Make probes of the nodes whose displacements are asked for; fields and tables have the rest."""
    wanted = {text.upper() for row in card.rows for text in row.fields if text}
    said = []
    if "U" in wanted:
        name, nodes = reading.names.nodes(card.needed("NSET"), None)
        nodes = nodes[reading.names.in_cells[nodes]]
        if len(nodes) <= MOST_PROBES:
            reading.content.watched |= dict.fromkeys(nodes.tolist())
            said.append(f"U of {name}: {len(nodes)} probes")
        else:
            said.append(f"U of {name}: {len(nodes)} nodes are too many for probes; the fields have them")
    if "RF" in wanted:
        said.append("RF: results.json has the reactions of each support")
    if others := sorted(wanted - {"U", "RF"}):
        said.append(f"{', '.join(others)}: see docs/output.md for what a run writes")
    reading.note(card, "; ".join(said) or "nothing is asked for")
