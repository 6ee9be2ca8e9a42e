"""Handlers of the cards of motion: the dynamic procedure, damping, masses of points, initial velocities."""

from __future__ import annotations

from lacsolver.decks.cards import Card, Refused
from lacsolver.decks.content import Assigned, PointMass
from lacsolver.decks.reading import Reading
from lacsolver.decks.step_cards import take_times

#: largest numerical damping of the method of Hilber, Hughes and Taylor
_MOST_DAMPING = 1 / 3


def dynamic(reading: Reading, card: Card) -> None:
    """Take an implicit step with inertia: its increments, and the numerical damping; loads act in full at once."""
    which = reading.content.begin_procedure(card)
    if "EXPLICIT" in card.options:
        message = (
            "lacsolver's time scheme is implicit, and this step is EXPLICIT; leave the option out, and give increments"
        )
        reading.lack(card, f"{message} in which a wave crosses a half to a whole element", "the step is implicit")
    alpha = -card.number("ALPHA", -0.05)
    if not 0 <= alpha <= _MOST_DAMPING:
        raise Refused(f"ALPHA should be from -1/3 to 0, not {-alpha:g}")
    take_times(which, card)
    which.alpha = alpha
    which.sudden = which.card.word("AMPLITUDE") != "RAMP"


def damping(reading: Reading, card: Card) -> None:
    """Take the Rayleigh damping of a material: ALPHA times its mass, BETA times its stiffness."""
    reading.content.material.damping = (card.number("ALPHA", 0.0), card.number("BETA", 0.0))


def mass(reading: Reading, card: Card) -> None:
    """Take the mass of each element of type MASS in a set."""
    row = card.single("the mass")
    _add(reading, card, row.number(0, "the mass"), None)


def rotary_inertia(reading: Reading, card: Card) -> None:
    """Take the moments of inertia of each element of type ROTARYI in a set, about axes along x, y and z."""
    row = card.single("the moments of inertia")
    if any(row.number(k, "a product of inertia", 0.0) for k in (3, 4, 5)):
        raise Refused("products of inertia are not taken; lacsolver has moments about axes along x, y and z", row)
    _add(reading, card, 0.0, tuple(row.number(k, "a moment of inertia", 0.0) for k in range(3)))


def _add(reading: Reading, card: Card, mass: float, inertia: tuple[float, ...] | None) -> None:
    _, nodes = reading.names.points(card.needed("ELSET"))
    if reading.names.mesh.plane == "CAX":
        raise Refused(
            "a mass of an axisymmetric model is that of a sector of 2 degrees in CalculiX, and of the full circle in "
            "Abaqus and here; write mass into the [[rigid]] of the case"
        )
    reading.content.masses += [PointMass(node, mass, inertia or (0.0, 0.0, 0.0), card) for node in nodes.tolist()]


def velocities(reading: Reading, card: Card) -> None:
    """Take the velocities with which nodes begin to move."""
    for row in card.rows:
        name, nodes = reading.names.nodes(row.text(0), row)
        axis = row.whole(1, "the direction")
        if axis not in (1, 2, 3):
            raise Refused("the direction of an initial velocity should be 1 to 3", row)
        value = row.number(2, "the velocity")
        reading.content.assigned.append(Assigned("velocity", -1, name, nodes, (axis - 1,), value, "", card, row))
