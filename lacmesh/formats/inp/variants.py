"""Names of elements for other shapes: the children of a C3D20R are C3D20R and C3D15, those of a C3D8I are C3D8I."""

from __future__ import annotations

import re

from lacmesh.formats.inp.types import PLANE, SHELL, element
from lacmesh.formats.inp.writer_types import card

#: Letters of a formulation that only some shapes have; all others (H, T, E ...) are of every shape.
_SHAPES = {
    "R": ("QUAD4", "QUAD8", "HEXA8", "HEXA20"),
    "I": ("QUAD4", "HEXA8"),
    "M": ("TRIA6", "TETRA10"),
    "S": ("HEXA8", "TETRA10"),
}
_NAME = re.compile(r"(.*?3D|.*?2D|[A-Z]+)(\d+)([A-Z]*)")


def variant(name: str, cell_type: str, target: str, plane: str | None = None) -> str | None:
    """Element of a cell that takes the place of an element `name`; None if the target has none.

    `plane`: CPS, CPE or CAX, if plane elements are to be of that kind.

    >>> variant("C3D20R", "HEXA20", "calculix"), variant("C3D20R", "PENTA15", "calculix")
    ('C3D20R', 'C3D15')
    >>> variant("C3D8I", "TETRA4", "calculix"), variant("CPE4R", "TRIA3", "calculix", plane="CAX")
    ('C3D4', 'CAX3')
    """
    old = element(name)
    if old is None:
        return None
    if plane and old.kind == PLANE and name.startswith(("CPS", "CPE", "CAX")):
        name = plane + name[3:]
    if old.type == cell_type:
        return name
    plain = card(cell_type, target, "CPS" if old.kind == PLANE else None, old.kind == SHELL and "M3D" in name)
    parts = _NAME.fullmatch(name)
    if plain is None or parts is None:
        return plain
    number = re.search(r"\d+(?=\D*$)", plain)
    letters = "".join(c for c in parts[3] if cell_type in _SHAPES.get(c, (cell_type,)))
    new = f"{parts[1]}{number[0] if number else ''}{letters}"
    known = element(new)
    return new if known is not None and known.type == cell_type else plain
