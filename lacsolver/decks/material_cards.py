"""Handlers of the cards of materials: laws and their constants, density, expansion, orientations, sections."""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.deck import key_of
from lacsolver.case.value_kinds import HARDENING
from lacsolver.decks.cards import Card, DeckLine, Refused, check_rows
from lacsolver.decks.content import DeckContent, DeckSection, MaterialData


def material(deck: DeckContent, card: Card) -> None:
    """Begin a material."""
    name = card.needed("NAME")
    key = key_of(name)
    if key in deck.materials:
        raise Refused(f"there are two materials named {name!r}; rename one")
    deck.materials[key] = MaterialData(name, card)


def _without_law(deck: DeckContent) -> dict[str, Any]:
    """Return the keys of the material begun last. Raises Refused if it has an elastic law."""
    if "law" in deck.material.keys:
        raise Refused("this material has an elastic law already; keep one")
    return deck.material.keys


def elastic(deck: DeckContent, card: Card) -> None:
    """Take Young's modulus and Poisson's ratio, or the constants of three axes of symmetry."""
    keys = _without_law(deck)
    kind = card.word("TYPE") or "ISOTROPIC"
    if kind in ("ISO", "ISOTROPIC"):
        row = card.single("Young's modulus and Poisson's ratio")
        keys |= {"law": "elastic", "young": row.number(0, "Young's modulus"), "poisson": row.number(1, "nu", 0.0)}
        return
    keys |= {"law": "orthotropic", **engineering_constants(card, kind)}


def hyperelastic(deck: DeckContent, card: Card) -> None:
    """Take a neo-Hookean law; the other forms have no place in lacsolver."""
    if not card.options.keys() & {"NEOHOOKE"}:
        form = next((k for k in card.options if k not in ("N", "MODULI")), "MOONEY-RIVLIN")
        raise Refused(f"lacsolver has NEO HOOKE of the hyperelastic laws, and not {form}; fit that one")
    keys = _without_law(deck)
    keys |= {"law": "neo_hookean", **rubber(card.single("C10 and D1"))}
    deck.warn(
        card,
        "the neo-Hookean law of lacsolver has the same moduli at small strains, and another energy of the change of "
        "volume (docs/theory.md): results differ where the volume changes much",
    )


def plastic(deck: DeckContent, card: Card) -> None:
    """Take the hardening of a metal that yields, isotropic by a table or kinematic by two lines."""
    keys = deck.material.keys
    if keys.get("law") != "elastic":
        raise Refused("it should follow an isotropic *ELASTIC of the same material")
    kind = card.word("HARDENING") or "ISOTROPIC"
    if kind not in ("ISOTROPIC", "KINEMATIC"):
        raise Refused(f"hardening is ISOTROPIC or KINEMATIC in lacsolver, and not {kind}; fit one of these")
    card.first("the yield stress and the plastic strain")
    if len({row.number(2, "the temperature", 0.0) for row in card.rows}) > 1:
        raise Refused("yield stresses that depend on temperature are not taken; give those of one", card.rows[-1])
    rows = [(row.number(0, "the yield stress"), row.number(1, "the plastic strain", 0.0)) for row in card.rows]
    check_rows(HARDENING, rows, card)
    keys["law"] = "plastic"
    if kind == "ISOTROPIC" or len(rows) == 1:
        keys["hardening"] = [list(row) for row in rows]
        return
    (first, _), (second, strain), *rest = rows
    slope = (second - first) / strain
    if any(abs(first + slope * p - y) > 1e-6 * y for y, p in rest):
        raise Refused("kinematic hardening is linear in lacsolver; give two lines, with the mean slope", card.rows[2])
    keys |= {"hardening": [[first, 0.0]], "kinematic": slope}
    if slope and not rest:
        deck.note(card, "kinematic hardening goes on beyond its last line with the same slope")


def density(deck: DeckContent, card: Card) -> None:
    """Take the density of a material."""
    deck.material.keys["density"] = card.single("the density").number(0, "the density")


def expansion(deck: DeckContent, card: Card) -> None:
    """Take thermal expansion, one number or one for each axis; ZERO has no effect on constant expansion."""
    kind = card.word("TYPE") or "ISO"
    count = {"ISO": 1, "ORTHO": 3}.get(kind, 0)
    if not count:
        raise Refused(f"expansion of type {kind} is not taken; give ISO, or ORTHO with an orthotropic material")
    row = card.single("the expansion")
    values = [row.number(k, "the expansion") for k in range(count)]
    deck.material.keys["expansion"] = values[0] if count == 1 else values


def orientation(deck: DeckContent, card: Card) -> None:
    """Take the axes of an orientation, two points in the plane of axes 1 and 2."""
    if (card.word("SYSTEM") or "RECTANGULAR") not in ("RECTANGULAR", "R"):
        raise Refused("only rectangular orientations are taken; give the axes of each part as SYSTEM=RECTANGULAR")
    if len(card.rows) > 1:
        raise Refused("an orientation that is turned about an axis is not taken; give its axes", card.rows[1])
    row = card.first("two points")
    numbers = [row.number(k, "a coordinate") for k in range(6)]
    key = key_of(card.needed("NAME"))
    deck.orientations[key] = (tuple(numbers[:3]), tuple(numbers[3:]))


def section(deck: DeckContent, card: Card) -> None:
    """Take the material, orientation and thickness of an element set."""
    name, cells = deck.names.cells(card.needed("ELSET"), None)
    thickness = card.rows[0].number(0, "the thickness", 1.0) if card.rows else 1.0
    if not thickness > 0:
        raise Refused(f"the thickness should be positive, not {thickness:g}", card.rows[0])
    material, orientation = card.needed("MATERIAL"), card.options.get("ORIENTATION", "")
    deck.sections.append(DeckSection(name, cells, material, orientation, thickness, card))


#: places in the 21 constants of anisotropy (upper triangle of the stiffness, column by column) of the 9 of orthotropy
_ORTHOTROPIC = (0, 1, 2, 3, 4, 5, 9, 14, 20)


def engineering_constants(card: Card, kind: str) -> dict[str, Any]:
    """Return young, poisson and shear of an orthotropic *ELASTIC. Raises Refused.

    ENGINEERING CONSTANTS are E1, E2, E3, nu12, nu13, nu23, G12, G13, G23; ORTHO is D1111, D1122, D2222, D1133, D2233,
    D3333, D1212, D1313, D2323; ANISO is the upper triangle of the stiffness, column by column.
    """
    count = {"ENGINEERINGCONSTANTS": 9, "ORTHO": 9, "ORTHOTROPIC": 9, "ANISO": 21, "ANISOTROPIC": 21}.get(kind, 0)
    if not count:
        raise Refused(f"elasticity of type {kind} is not taken; ISO, ORTHO and ENGINEERING CONSTANTS are")
    fields = [(row, k) for row in card.rows for k in range(len(row.fields))]
    if not count <= len(fields) <= count + 1:
        raise Refused(f"it should list {count} constants for one temperature, and lists {len(fields)}")
    values = [row.number(k, "a constant") for row, k in fields[:count]]
    if count == 21:
        others = [value for k, value in enumerate(values) if k not in _ORTHOTROPIC]
        if any(others):
            raise Refused(
                "lacsolver has materials with three axes of symmetry, and this one couples shear and stretch in its "
                "axes; give its axes in *ORIENTATION if it has such, and ENGINEERING CONSTANTS"
            )
        values = [values[k] for k in _ORTHOTROPIC]
    if kind == "ENGINEERINGCONSTANTS":
        return {"young": values[:3], "poisson": values[3:6], "shear": values[6:]}
    return _from_stiffness(values)


def _from_stiffness(values: list[float]) -> dict[str, Any]:
    """Return the engineering constants of the nine of a stiffness. Raises Refused if it is singular."""
    d11, d12, d22, d13, d23, d33 = values[:6]
    D = np.array([[d11, d12, d13], [d12, d22, d23], [d13, d23, d33]])
    if not np.linalg.eigvalsh(D)[0] > 1e-14 * np.abs(D).max():
        raise Refused("its stiffness is not positive definite, so that it gives energy when it is strained")
    S = np.linalg.inv(D)
    young = 1 / np.diag(S)
    poisson = [-S[0, 1] * young[0], -S[0, 2] * young[0], -S[1, 2] * young[1]]
    return {"young": young.tolist(), "poisson": [float(nu) for nu in poisson], "shear": values[6:]}


def rubber(row: DeckLine) -> dict[str, float]:
    """Return young and poisson of C10 and D1, which are half the shear modulus and two over the bulk modulus.

    D1 = 0 means incompressible in Abaqus, and a Poisson's ratio of 0.475 in CalculiX. Raises Refused for it.

    >>> {k: round(v, 12) for k, v in rubber(DeckLine(("0.5", "1.0"), "", 1)).items()}
    {'young': 2.571428571429, 'poisson': 0.285714285714}
    """
    c10, d1 = row.number(0, "C10"), row.number(1, "D1", 0.0)
    if not (c10 > 0 and d1 > 0):
        raise Refused(
            "C10 and D1 should be positive; a D1 of 0 (no compression) is for mixed elements, so give one", row
        )
    shear, bulk = 2 * c10, 2 / d1
    return {
        "young": 9 * bulk * shear / (3 * bulk + shear),
        "poisson": (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear)),
    }
