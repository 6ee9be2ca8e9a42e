"""Losses of a deck whose mesh goes to another format: a cell is only a shape, without formulation or plane."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from lacmesh.deck import Deck, DeckCard
from lacmesh.formats.inp.follow import Followed
from lacmesh.formats.inp.scope import ElementCard
from lacmesh.formats.inp.types import PLANE, SHELL, SOLID, DeckElement, element
from lacmesh.formats.inp.writer_types import TARGETS, card

#: Cards whose content is the mesh's, or that only say where a part of the file begins or ends.
OF_MESH = frozenset(
    ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "HEADING", "PART", "ENDPART", "INSTANCE", "ENDINSTANCE")
) | {"ASSEMBLY", "ENDASSEMBLY"}


def plane_of(elements: Iterable[ElementCard]) -> str:
    """Common hypothesis of all plane elements: CPS, CPE or CAX; empty if there are none, or several kinds."""
    kinds = {name_of(e.card.parameters): e.element for e in elements if e.element is not None and len(e.number)}
    planes = {_plane(name) for name, e in kinds.items() if e.kind == PLANE}
    return planes.pop() if len(planes) == 1 else ""


def losses(deck: Deck) -> str:
    """Clause that names what a mesh alone does not keep of its deck; empty if nothing is lost."""
    parts = list(dict.fromkeys("*" + c.name for c in deck.cards if c.key not in OF_MESH))
    kinds = {name_of(c.options): element(name_of(c.options)) for c in deck.cards if _has_cells(c)}
    named = {name: e for name, e in kinds.items() if e is not None}
    solid = any(e.kind == SOLID for e in named.values())
    shapes = [f"{name} (written as {e.type})" for name, e in named.items() if plain(name, e, solid) != name]
    if shapes:
        parts.append(f"the formulation of the elements {', '.join(shapes)}")
    return f"left out of the deck {deck.path}: {', '.join(parts)}" if parts else ""


def below_dimension(followed: Followed) -> str:
    """Reason to write a deck of a mesh alone anew: elements below its dimension become surfaces and sets; or empty.

    gmsh, for one, writes skin as elements, which no material is for.
    """
    deck, mesh = followed.deck, followed.mesh
    lower = followed.home[(followed.home >= 0) & (mesh.cell_dim < mesh.dim)]
    if not len(lower) or any(c.key not in OF_MESH for c in deck.cards):
        return ""
    names = dict.fromkeys(name_of(deck.cards[k].options) for k in np.unique(lower).tolist())
    return (
        f"{len(lower)} elements of lower dimension than the mesh ({', '.join(names)}) become faces of surfaces, or "
        "sets of nodes, unless --all-cells (all_cells=True) keeps them elements"
    )


def _has_cells(c: DeckCard) -> bool:
    return c.key == "ELEMENT" and c.numbers is not None and len(c.numbers) > 0


def name_of(options: Mapping[str, str]) -> str:
    """Type of the elements that an *ELEMENT card with these options makes."""
    return options.get("TYPE", "").strip('"').upper()


def plain(name: str, e: DeckElement, solid: bool) -> str:
    """Element type that a cell of an element is written as without a deck: `name` itself if its shape says it.

    `solid`: there are solid elements, so that membranes and surface elements may be their skin.

    >>> [plain(name, element(name), False) for name in ("C3D8I", "CAX4R", "STRI65", "B31")]
    ['C3D8', 'CAX4', 'STRI65', 'T3D2']
    """
    if e.kind == PLANE:
        plane = _plane(name)
        return (plane and card(e.type, "calculix", plane, False)) or e.type
    skin = solid and e.kind == SHELL and name.startswith(("M3D", "SFM3D"))
    cards = [card(e.type, target, flat, skin) for flat in (None, "CPS") for target in TARGETS]
    if name in cards and name != "S8R":  # the only one of Abaqus; CalculiX has S8 as well
        return name
    return next((known for known in cards if known), e.type)


def _plane(name: str) -> str:
    """CPS, CPE or CAX by an element's name, else empty: a heat element, say, is the same in plane stress and strain."""
    return "CAX" if "AX" in name else name[:3] if name.startswith(("CPS", "CPE")) else ""
