"""Contact and ties: surface interactions, pairs of skins, and the [[contact]] and [[tie]] records."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lacmesh.deck import key_of
from lacmesh.mesh import Ints, Mesh
from lacmesh.surface import Surface, contact_points
from lacmesh.surface.points import face_measure
from lacsolver.case import Case, CaseError, Contact, Issue
from lacsolver.decks.cards import Card, DeckLine, Lacking, Refused, look_up
from lacsolver.decks.histories import from_step_on
from lacsolver.decks.import_ import Import, Interaction, Pair
from lacsolver.decks.joints import cyclic_tie
from lacsolver.decks.materials import check_rows
from lacsolver.decks.names import SIDES, faces_at
from lacsolver.problem.roles import FEW
from lacsolver.validation import validate

#: distance within which CalculiX ties, relative to the size of an element (manual of CalculiX, *TIE)
_TIED = 0.025
#: what the first number of LINEAR contact is
_STIFFNESS = "the pressure per overlap"
#: largest difference of gaps that are taken for one, relative to the extent of the mesh
_EVEN = 1e-6


# ---- surface interactions


def interaction(import_: Import, card: Card) -> None:
    """Begin a surface interaction, hard as long as nothing else is said."""
    import_.interactions[key_of(card.needed("NAME"))] = Interaction(card)


def behavior(import_: Import, card: Card) -> None:
    """Take hard contact, linear pressure over overlap, and contact that is tied."""
    kind = card.word("PRESSURE-OVERCLOSURE", "HARD")
    if import_.in_step:
        _changed_behavior(import_, card, kind)
        return
    which = import_.interaction
    if kind in ("LINEAR", "TIED"):
        which.stiffness, which.tied = {-1: card.first(_STIFFNESS).positive(0, _STIFFNESS)}, kind == "TIED"
        if which.tied:
            import_.note(card, "tied surfaces become a [[tie]], without the stiffness")
    elif kind == "EXPONENTIAL":
        which.curve = _exponential(import_, card)
    elif kind == "TABULAR":
        rows = card.table("the pressure", "the overlap")
        check_rows(card, rows, lambda some: Contact(slave="a", master="b", law="table", pressures=some))
        which.curve = {"law": "table", "pressures": rows}
    elif kind != "HARD":
        raise Refused(
            f"lacsolver has HARD, LINEAR, EXPONENTIAL and TABULAR contact, and not {kind}; write one of these"
        )


def change(import_: Import, card: Card) -> None:
    """Begin a change of a surface interaction from a step on; *SURFACE BEHAVIOR or *FRICTION follows."""
    look_up(import_.interactions, card.needed("INTERACTION"), "*SURFACE INTERACTION")
    import_.step.changes[card.key] = card


def _changed(import_: Import, name: str) -> Interaction:
    """Return the surface interaction that the last card `name` of a step begins to change. Raises Refused."""
    card = import_.step.changes.get(name.replace(" ", ""))
    if card is None:
        raise Refused(f"in a step it belongs after *{name}, INTERACTION=name; write that")
    return import_.interactions[key_of(card.needed("INTERACTION"))]


def _changed_behavior(import_: Import, card: Card, kind: str) -> None:
    """Take the pressure per overlap from a step on. Raises Refused for another kind than LINEAR, before and now."""
    which = _changed(import_, "CHANGE SURFACE BEHAVIOR")
    if kind != "LINEAR" or not which.stiffness or which.tied:
        raise Refused(
            "a step changes the pressure per overlap of LINEAR contact, and hard, tied and curved contact keep their "
            "law for all steps; say LINEAR in the model and in the step"
        )
    which.stiffness[len(import_.steps) - 1] = card.first(_STIFFNESS).positive(0, _STIFFNESS)


def _exponential(import_: Import, card: Card) -> dict[str, Any]:
    """Return the keys of an exponential law: its clearance, and its pressure where the surfaces meet."""
    row = card.single("the clearance without pressure and the pressure without clearance")
    clearance, pressure = row.number(0, "the clearance"), row.number(1, "the pressure")
    if not (clearance > 0 and pressure > 0):
        raise Refused("the clearance and the pressure should be positive", row)
    import_.warn(
        card,
        "the exponential is Abaqus's, 0 from this clearance on; that of CalculiX falls to a hundredth there, and grows "
        "faster with the overlap: both have this pressure where the surfaces meet",
    )
    return {"law": "exponential", "pressure_at_contact": pressure, "clearance_at_zero": clearance}


def damping(import_: Import, card: Card) -> None:
    """Take the damping of contact, a pressure per approach velocity. Raises Refused."""
    if (kind := card.word("DEFINITION", "DAMPINGCOEFFICIENT")) != "DAMPINGCOEFFICIENT":
        raise Refused(f"damping of contact is a DAMPING COEFFICIENT in lacsolver, and not {kind}; give that")
    if "TANGENTFRACTION" in card.options and card.number("TANGENTFRACTION"):
        raise Refused("damping acts along the normal only; leave TANGENT FRACTION out, or say 0")
    row = card.single("the damping coefficient")
    value = row.number(0, "the damping coefficient")
    if value < 0 or row.number(1, "the clearance without damping", 0.0):
        raise Refused("the line should be one coefficient that is not negative", row)
    import_.interaction.damping = value, card


def friction(import_: Import, card: Card) -> None:
    """Take Coulomb friction, with a largest stress (TAUMAX), or ROUGH surfaces, which do not slip while they touch."""
    now = len(import_.steps) - 1 if import_.in_step else -1
    which = _changed(import_, "CHANGE FRICTION") if import_.in_step else import_.interaction
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
        import_.note(card, f"its stick slope of {slope:g} is not needed: sticking points do not slip in lacsolver", row)


# ---- pairs


def contact_pair(import_: Import, card: Card) -> None:
    """Take pairs of a slave and a master; slaves that are surfaces of nodes become the faces on these nodes."""
    for row in card.rows:
        slave, master = _skins(import_, card, row)
        keys: dict[str, Any] = {"geometry": "reference"} if "SMALLSLIDING" in card.options else {}
        if "ADJUST" in card.options:
            keys["adjust"] = _adjust(import_, card, row)
        import_.pairs.append(Pair(slave, master, card.options.get("INTERACTION", ""), keys, card))


def _adjust(import_: Import, card: Card, row: DeckLine) -> float:
    """Return the distance within which nodes of the slave are moved onto the master. Raises Refused.

    It is larger than the model for a set of nodes, which should have all nodes of the slave.
    """
    text = card.options["ADJUST"]
    if key_of(text) in import_.names.deck.groups_of("NSET"):
        chosen = import_.names.nodes(text, row)[1]
        slave = _surface(import_, import_.names.skin(row.fields[0], row)[1]).faces.distinct_nodes
        if np.isin(slave, chosen).all():
            return _far(import_)
        message = f"ADJUST={text} has some slave nodes only, and lacsolver moves all nodes within a distance"
        raise Refused(f"{message}; give that, as ADJUST=0.01")
    distance = card.number("ADJUST")
    if distance < 0:
        raise Refused(f"the distance of ADJUST should not be negative, and is {distance:g}")
    return distance


def tie(import_: Import, card: Card) -> None:
    """Take ties; the position tolerance becomes the distance within which the master is searched."""
    if "CYCLICSYMMETRY" in card.options:
        cyclic_tie(import_, card)
        return
    named = card.options.get("POSITIONTOLERANCE", "")
    keys = {"search_distance": card.number("POSITIONTOLERANCE")} if named else {}
    for row in card.rows:
        import_.pairs.append(Pair(*_skins(import_, card, row), "", keys, card, tie=True))


def _skins(import_: Import, card: Card, row: DeckLine) -> tuple[str, str]:
    """Return the keys of slave and master on a data line. Raises Refused."""
    slave, master = row.two_skins()
    for text in (slave, master):
        name, facets = import_.names.skin(text, row)
        if import_.names.of_nodes(text):
            import_.note(card, f"the surface of nodes {name!r} is taken as the {len(facets)} faces on its nodes", row)
    return key_of(slave), key_of(master)


def clearance(import_: Import, card: Card) -> None:
    """Take the gap between a slave and a master, which replaces the one in the mesh."""
    slave, master = (key_of(card.needed(name)) for name in ("SLAVE", "MASTER"))
    value = (card.number("VALUE"), card)

    def set_later() -> None:
        for pair in _pairs_of(import_, slave, master):
            pair.clearance = value

    import_.later("material", card, set_later)


def model_change(import_: Import, card: Card) -> None:
    """Take contact that is removed for some steps, or added again."""
    now = import_.steps.index(import_.step)
    if card.word("TYPE") != "CONTACTPAIR":
        raise Lacking("elements are there in all steps; leave out the steps without them")
    if ("ADD" in card.options) == ("REMOVE" in card.options):
        raise Refused("the option ADD or REMOVE is missing")
    for row in card.rows:
        slave, master = row.two_skins()
        _pairs_of(import_, slave, master, row)[0].changes.append((now, "ADD" in card.options, card))


def _pairs_of(import_: Import, slave: str, master: str, row: DeckLine | None = None) -> list[Pair]:
    """Return the contact pairs of a slave and a master. Raises Refused if there are none."""
    names = key_of(slave), key_of(master)
    if own := [pair for pair in import_.pairs if (pair.slave, pair.master) == names and not pair.tie]:
        return own
    raise Refused(f"there is no *CONTACT PAIR of {slave} and {master}; name one of them", row)


# ---- records


def contacts(import_: Import) -> None:
    """Add a [[contact]] or a [[tie]] for each slave; several masters of one slave become one group. Raises Refused."""
    by_slave: dict[str, list[Pair]] = {}
    for pair in import_.pairs:
        by_slave.setdefault(pair.slave, []).append(pair)
    for pairs in by_slave.values():
        with import_.taking(pairs[0].card):
            _add_pair(import_, pairs)


def _add_pair(import_: Import, pairs: list[Pair]) -> None:
    """Add the record of the pairs of one slave. Raises Refused."""
    first, names = pairs[0], import_.names
    laws = [_interaction(import_, pair) for pair in pairs]
    if any((one.tie, one.keys) != (first.tie, first.keys) for one in pairs) or len(set(map(id, laws))) > 1:
        raise Refused("this slave has several masters with different contact; give them one", pairs[1].card.rows[0])
    masters = [names.skin(pair.master, None) for pair in pairs]
    slave = names.skin(first.slave, None)
    master = "_".join(dict.fromkeys(name for name, _ in masters)), np.concatenate([f for _, f in masters])
    if _exchanged(import_, pairs, slave, master):
        slave, master = master, slave
    added = import_.groups.add("skins", *master)
    keys: dict[str, Any] = {"slave": import_.groups.add("skins", *slave), "master": added}
    law = laws[0]
    if first.tie or (law and law.tied):
        distance = first.keys.get("search_distance")
        if distance is None and first.tie:
            distance = _tied_within(import_, *slave, master[1], first)
            if distance is None:
                return
        import_.add("tie", keys | ({} if distance is None else {"search_distance": distance}), first.card)
        return
    if removed := [one for pair in pairs for one in pair.changes]:
        keys["clearance"] = _removed(import_, pairs, removed)
    if law:
        keys |= _pressures(import_, law) | _friction(import_, law) | _damping(import_, law)
    normals = {"normals": "smoothed"} if import_.large else {}  # those of CalculiX, averaged at the nodes
    keys |= normals | dict(first.keys)
    for pair in pairs:
        pair.record = keys
    import_.add("contact", keys, first.card)


def _interaction(import_: Import, pair: Pair) -> Interaction | None:
    """Return the surface interaction of a contact pair. Raises Refused if it is not there."""
    if pair.tie or not pair.interaction:
        return None
    return import_.interactions[look_up(import_.interactions, pair.interaction, "*SURFACE INTERACTION")]


def _tied_within(import_: Import, name: str, slave: Ints, master: Ints, pair: Pair) -> float | None:
    """Return the distance within which CalculiX ties two skins, facets (k,); None, with a warning, if they are farther.

    Without POSITION TOLERANCE it is 2.5 % of the size of an element.
    """
    one, other = (_surface(import_, facets) for facets in (slave, master))
    distance = _TIED * float(np.mean(face_measure(one) ** (1 / one.dim)))
    if len(contact_points(one, other, search_distance=distance, max_penetration=distance).macro):
        return distance
    message = f"the slave {name!r} is farther from its master than {distance:.3g}, 2.5 % of its faces, within which "
    import_.warn(pair.card, f"{message}CalculiX ties without POSITION TOLERANCE: it is not tied; give the tolerance")
    return None


def _surface(import_: Import, facets: Ints) -> Surface:
    """Return the surface of facets (k,) of the mesh."""
    mesh = import_.names.mesh
    return Surface(mesh.points, faces_at(mesh, facets), facets // SIDES, mesh.dim - 1, np.full(len(facets), np.nan))


def _exchanged(import_: Import, pairs: list[Pair], slave: tuple[str, Ints], master: tuple[str, Ints]) -> bool:
    """True, with a note, if a slave of few faces should be the master of its own; warn if both have few."""
    (name, facets), (other, opposite), card = slave, master, pairs[0].card
    few, count = FEW[import_.dim], len(np.unique(opposite))
    if len(facets) >= few:
        return False
    start = f"the slave {name!r} has few faces, {len(facets)}, with one pressure each: they may not keep a body from "
    faces = _surface(import_, opposite).faces.nodes
    rigid = any(np.isin(faces, body.nodes).any() for body in import_.bodies)
    masters = {pair.master for pair in pairs}
    taken = any({pair.slave, pair.master} & masters for pair in import_.pairs if pair not in pairs)
    if count >= few and not rigid and not taken:
        import_.note(card, f"{start}turning; {other!r} has {count}, so that it is the slave in the case, and cut")
        return True
    why = "its master is rigid" if rigid else "its master is in another pair" if taken else "its master has few as well"
    advice = "'run' refuses the case if nothing else holds that; refine the mesh of one of them"
    import_.warn(card, f"{start}turning, and {why}, so that results are coarse; {advice}")
    return False


def _removed(import_: Import, pairs: list[Pair], changes: list[tuple[int, bool, Card]]) -> list[list[float]]:
    """Return the clearance of contact that is removed for some steps: larger than the model, else 0. Raises Refused."""
    if len(pairs) > 1:
        message = "this slave has several masters, whose contact is removed together here; give it one"
        raise Refused(message, None, changes[0][2])
    far = _far(import_)
    return from_step_on({-1: 0.0} | {step: far * (not added) for step, added, _ in changes}, import_.steps)


def _far(import_: Import) -> float:
    """Return a length that is larger than the model."""
    return 10 * float(np.linalg.norm(np.ptp(import_.names.mesh.points, axis=0)))


def _from_step_on(import_: Import, values: dict[int, float]) -> Any:
    """Return a value, or a table of times if steps change it."""
    points = from_step_on(values, import_.steps)
    return points if len({value for _, value in points}) > 1 else points[0][1]


def _pressures(import_: Import, law: Interaction) -> dict[str, Any]:
    """Return the keys of linear contact, or of a curve; {} for hard contact."""
    return {"stiffness": _from_step_on(import_, law.stiffness)} if law.stiffness else law.curve


def _friction(import_: Import, law: Interaction) -> dict[str, Any]:
    """Return the keys of friction: a number, or a table of times if steps change it. Raises Refused."""
    if not any(law.friction.values()):
        return {}
    value = _from_step_on(import_, {-1: 0.0} | law.friction)
    if isinstance(value, list) and any(one == math.inf for _, one in value):
        raise Refused(
            "surfaces that are ROUGH in some steps only are not supported; give a coefficient", None, law.card
        )
    return {"friction": value} | ({} if law.shear_limit is None else {"shear_limit": law.shear_limit})


def _damping(import_: Import, law: Interaction) -> dict[str, Any]:
    """Return the key of damping, {} where no step is in motion. Raises Refused for contact without an overlap."""
    if law.damping is None or not law.damping[0]:
        return {}
    value, card = law.damping
    if all(step.alpha is None for step in import_.steps):
        import_.note(card, "damping of contact has no effect without *DYNAMIC, and is left out")
        return {}
    if not (law.stiffness or law.curve):
        message = "hard contact is rigid in lacsolver, so there is no overlap for the damping"
        raise Refused(f"{message}; give *SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", None, card)
    return {"damping": value}


def set_clearances(import_: Import, case: Case, mesh: Mesh) -> bool:
    """Set clearances so that they replace the gap in the mesh, which must be even; True if there are any.

    Raises CaseError for another gap.
    """
    pairs = [pair for pair in import_.pairs if pair.clearance and pair.record]
    wanted = {id(pair.record): (pair.record, *pair.clearance) for pair in pairs if pair.clearance}
    gaps = {zone.slave: zone.gap for zone in validate(case, mesh).zones} if wanted else {}
    mistakes = []
    for record, value, card in wanted.values():
        found = gaps.get(record["slave"], (np.nan, np.nan))
        gap = even_gap(found, mesh)
        if gap is None:
            message = f"the gap in the mesh is from {found[0]:.6g} to {found[1]:.6g}"
            message += ", and a clearance of lacsolver adds to it: it replaces an even gap only"
            message += "; move the nodes in the mesh instead"
            mistakes.append(Issue(f"{card.of.place}: *{card.of.name}: {message}"))
            continue
        of_steps = record.get("clearance", [[0.0, 0.0]])  # of contact that is removed for some of them
        shift = value - (gap - of_steps[0][1])
        shifted = [[t, more + shift] for t, more in of_steps]
        record["clearance"] = shifted if "clearance" in record else shift
    if mistakes:
        raise CaseError(mistakes)
    return bool(wanted)


def even_gap(gap: tuple[float, float], mesh: Mesh) -> float | None:
    """Return the mean of the least and the largest gap of a contact, None if they differ, or there is none (NaN)."""
    extent = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    return (gap[0] + gap[1]) / 2 if gap[1] - gap[0] <= _EVEN * extent else None
