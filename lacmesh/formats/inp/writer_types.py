"""Elements that cells are written as, for CalculiX and for Abaqus, and advice for cells that have none."""

from __future__ import annotations

#: What an .inp file is written for, and how the elements of a plane mesh may be called.
TARGETS = ("calculix", "abaqus")
PLANES = ("CPS", "CPE", "CAX")

_VOLUMES = {
    "TETRA4": "C3D4",
    "TETRA10": "C3D10",
    "PENTA6": "C3D6",
    "PENTA15": "C3D15",
    "HEXA8": "C3D8",
    "HEXA20": "C3D20",
}
_ABAQUS_VOLUMES = {"PYRAM5": "C3D5", "PENTA18": "C3D15V", "HEXA27": "C3D27"}
_FACES = {"TRIA3": "3", "QUAD4": "4", "TRIA6": "6", "QUAD8": "8"}
_SHELLS = {
    "calculix": {"TRIA3": "S3", "QUAD4": "S4", "TRIA6": "S6", "QUAD8": "S8"},
    "abaqus": {"TRIA3": "S3", "QUAD4": "S4", "TRIA6": "STRI65", "QUAD8": "S8R", "QUAD9": "S9R5"},
}
#: Skin as elements: without stiffness in Abaqus; membranes, the least that CalculiX has, in CalculiX.
_SKINS = {
    "calculix": {kind: "M3D" + n for kind, n in _FACES.items()},
    "abaqus": {kind: "SFM3D" + n for kind, n in _FACES.items()} | {"QUAD9": "M3D9"},
}
_LINES = {"SEG2": "T3D2", "SEG3": "T3D3"}
_PLANE_LINES = {"calculix": _LINES, "abaqus": {"SEG2": "T2D2", "SEG3": "T2D3"}}

_PYRAMIDS = "write PYRAM5 for Abaqus, which has C3D5, or cut hexahedra with --hexa hexa, which makes no pyramids"
_HINTS = {
    "PYRAM5": "write for Abaqus, which has C3D5, or cut hexahedra with --hexa hexa, which makes no pyramids",
    "PYRAM13": _PYRAMIDS,
    "PYRAM14": _PYRAMIDS,
    "PENTA18": "write for Abaqus, which has C3D15V, or make the cells PENTA15",
    "HEXA27": "write for Abaqus, which has C3D27, or make the cells HEXA20",
    "TRIA7": "make the cells TRIA6",
    "QUAD9": "make the cells QUAD8",
}


def card(cell_type: str, target: str, plane: str | None, skin: bool) -> str | None:
    """Element for a cell of type `kind`; None if the target has none.

    `plane`: CPS, CPE or CAX for plane meshes, None in 3D; `skin`: the cell lies on a face of another cell.

    >>> card("HEXA8", "calculix", None, False), card("QUAD4", "calculix", "CPE", False)
    ('C3D8', 'CPE4')
    """
    if cell_type in _VOLUMES:
        return _VOLUMES[cell_type]
    if target == "abaqus" and cell_type in _ABAQUS_VOLUMES:
        return _ABAQUS_VOLUMES[cell_type]
    if cell_type == "POI1":
        return "MASS"
    if cell_type in _LINES:
        return (_PLANE_LINES[target] if plane else _LINES)[cell_type]
    if plane:
        return plane + _FACES[cell_type] if cell_type in _FACES else None
    return (_SKINS if skin else _SHELLS)[target].get(cell_type)


def hint(cell_type: str, target: str) -> str:
    """Advice for a cell type that has no element in the target."""
    if target == "abaqus" and cell_type in ("PYRAM13", "PYRAM14"):
        return "cut hexahedra with --hexa hexa, which makes no pyramids"
    return _HINTS.get(cell_type, "lower their order")
