"""Losses of elements that are read as cells: a cell is only a shape, without formulation or plane hypothesis."""

from __future__ import annotations

from collections.abc import Iterable

from lacmesh.cells import CELLS
from lacmesh.formats.inp.scope import ElementCard
from lacmesh.formats.inp.types import PLANE, SHELL, SOLID, DeckElement
from lacmesh.formats.inp.writer_types import TARGETS, card


def plane_of(elements: Iterable[ElementCard]) -> str:
    """Common hypothesis of all plane elements: CPS, CPE or CAX; empty if there are none, or several kinds."""
    planes = _planes(_named(elements))
    return planes[0] if len(planes) == 1 else ""


def losses(elements: Iterable[ElementCard]) -> list[str]:
    """Clauses that name what an .inp output will lose of this file; an empty list if nothing is lost."""
    elements = list(elements)
    named = _named(elements)
    solid = any(e.kind == SOLID for e in named.values())
    new_names = {name: plain(name, e, solid) for name, e in named.items()}
    said = []
    if changed := [f"{name} read as {new}" for name, new in new_names.items() if new != name]:
        said.append(f"{', '.join(changed)}: what else they are is lost, and an .inp output has the plain elements")
    if len(planes := _planes(named)) > 1:
        listed_planes = " and ".join(plane or "others" for plane in planes)
        said.append(f"elements of the plane are {listed_planes}: an .inp output has one kind, that of --plane")
    dim = {name: CELLS[e.type].dim for name, e in named.items()}
    if lower := [name for name in dim if dim[name] < max(dim.values())]:
        n = sum(len(e.number) for e in elements if _name(e) in lower)
        said.append(
            f"{n} elements of lower dimension than the mesh ({', '.join(lower)}): an .inp output has them as faces of "
            "surfaces, or as sets of nodes, unless --all-cells (all_cells=True) keeps them elements"
        )
    return said


def plain(name: str, e: DeckElement, solid: bool) -> str:
    """Element type that an element is written as: `name` itself if it is kept, else CalculiX's if it has one.

    `solid`: there are solid elements, so that membranes and surface elements may be their skin.

    >>> from lacmesh.formats.inp.types import element
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


def _named(elements: Iterable[ElementCard]) -> dict[str, DeckElement]:
    """The elements that are cells, by the name of their type, in order of first appearance."""
    return {_name(e): e.element for e in elements if e.element is not None and len(e.number)}


def _name(e: ElementCard) -> str:
    return e.card.parameters.get("TYPE", "").strip('"').upper()


def _planes(named: dict[str, DeckElement]) -> list[str]:
    return sorted({_plane(name) for name, e in named.items() if e.kind == PLANE})


def _plane(name: str) -> str:
    """CPS, CPE or CAX by an element's name, else empty: a heat element, say, is the same in plane stress and strain."""
    return "CAX" if "AX" in name else name[:3] if name.startswith(("CPS", "CPE")) else ""
