"""Handlers of the cards of materials: laws, density, expansion, orientations, sections."""

from __future__ import annotations

from lacmesh.deck import key_of
from lacsolver.decks.cards import Card, Refused
from lacsolver.decks.constants import engineering_constants, rubber
from lacsolver.decks.content import DeckSection, MaterialData
from lacsolver.decks.reading import Reading


def material(reading: Reading, card: Card) -> None:
    """Begin a material."""
    name = card.needed("NAME")
    key = key_of(name)
    if key in reading.content.materials:
        raise Refused(f"there are two materials named {name!r}; rename one")
    reading.content.materials[key] = MaterialData(name, card)


def elastic(reading: Reading, card: Card) -> None:
    """Take Young's modulus and Poisson's ratio, or the constants of three axes of symmetry."""
    keys = reading.content.material.keys
    if "law" in keys:
        raise Refused("this material has an elastic law already; keep one")
    kind = card.word("TYPE") or "ISOTROPIC"
    if kind in ("ISO", "ISOTROPIC"):
        row = card.single("Young's modulus and Poisson's ratio")
        keys |= {"law": "elastic", "young": row.number(0, "Young's modulus"), "poisson": row.number(1, "nu", 0.0)}
        return
    keys |= {"law": "orthotropic", **engineering_constants(card, kind)}


def hyperelastic(reading: Reading, card: Card) -> None:
    """Take a neo-Hookean law; the other forms have no place in lacsolver."""
    if not card.options.keys() & {"NEOHOOKE"}:
        form = next((k for k in card.options if k not in ("N", "MODULI")), "MOONEY-RIVLIN")
        raise Refused(f"lacsolver has NEO HOOKE of the hyperelastic laws, and not {form}; fit that one")
    keys = reading.content.material.keys
    if "law" in keys:
        raise Refused("this material has an elastic law already; keep one")
    keys |= {"law": "neo_hookean", **rubber(card.single("C10 and D1"))}
    reading.warn(
        card,
        "the neo-Hookean law of lacsolver has the same moduli at small strains, and another energy of the change of "
        "volume (docs/theory.md): results differ where the volume changes much",
    )


def density(reading: Reading, card: Card) -> None:
    """Take the density of a material."""
    reading.content.material.keys["density"] = card.single("the density").number(0, "the density")


def expansion(reading: Reading, card: Card) -> None:
    """Take thermal expansion, one number or one for each axis; ZERO has no effect on constant expansion."""
    kind = card.word("TYPE") or "ISO"
    count = {"ISO": 1, "ORTHO": 3}.get(kind, 0)
    if not count:
        raise Refused(f"expansion of type {kind} is not taken; give ISO, or ORTHO with an orthotropic material")
    row = card.single("the expansion")
    values = [row.number(k, "the expansion") for k in range(count)]
    reading.content.material.keys["expansion"] = values[0] if count == 1 else values


def orientation(reading: Reading, card: Card) -> None:
    """Take the axes of an orientation, two points in the plane of axes 1 and 2."""
    if (card.word("SYSTEM") or "RECTANGULAR") not in ("RECTANGULAR", "R"):
        raise Refused("only rectangular orientations are taken; give the axes of each part as SYSTEM=RECTANGULAR")
    if len(card.rows) > 1:
        raise Refused("an orientation that is turned about an axis is not taken; give its axes", card.rows[1])
    row = card.first("two points")
    numbers = [row.number(k, "a coordinate") for k in range(6)]
    key = key_of(card.needed("NAME"))
    reading.content.orientations[key] = (tuple(numbers[:3]), tuple(numbers[3:]))


def section(reading: Reading, card: Card) -> None:
    """Take the material, orientation and thickness of an element set."""
    name, cells = reading.names.cells(card.needed("ELSET"), None)
    thickness = card.rows[0].number(0, "the thickness", 1.0) if card.rows else 1.0
    if not thickness > 0:
        raise Refused(f"the thickness should be positive, not {thickness:g}", card.rows[0])
    made = DeckSection(name, cells, card.needed("MATERIAL"), card.options.get("ORIENTATION", ""), thickness, card)
    reading.content.sections.append(made)
