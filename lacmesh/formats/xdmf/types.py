"""XDMF's cells: the table of names and numbers (XdmfTopologyType.cpp). Nodes stand in VTK's order (`vtu/types.py`).

That order was measured with VTK's reader, for cells of one type and mixed; dolfinx's `cells.cpp` says the same.
"""

from __future__ import annotations

from typing import NamedTuple


class XdmfType(NamedTuple):
    """XDMF's `name` and `number` of our `type`; `counted`: in a mixture, the number of nodes follows the number."""

    name: str
    number: int
    type: str
    counted: bool = False


XDMF_TYPES = (
    XdmfType("Polyvertex", 1, "POI1", counted=True),
    XdmfType("Polyline", 2, "SEG2", counted=True),
    XdmfType("Edge_3", 34, "SEG3"),
    XdmfType("Triangle", 4, "TRIA3"),
    XdmfType("Triangle_6", 36, "TRIA6"),
    XdmfType("Quadrilateral", 5, "QUAD4"),
    XdmfType("Quadrilateral_8", 37, "QUAD8"),
    XdmfType("Quadrilateral_9", 35, "QUAD9"),
    XdmfType("Tetrahedron", 6, "TETRA4"),
    XdmfType("Tetrahedron_10", 38, "TETRA10"),
    XdmfType("Pyramid", 7, "PYRAM5"),
    XdmfType("Pyramid_13", 39, "PYRAM13"),
    XdmfType("Wedge", 8, "PENTA6"),
    XdmfType("Wedge_15", 40, "PENTA15"),
    XdmfType("Wedge_18", 41, "PENTA18"),
    XdmfType("Hexahedron", 9, "HEXA8"),
    XdmfType("Hexahedron_20", 48, "HEXA20"),
    XdmfType("Hexahedron_27", 50, "HEXA27"),
)

#: Other names of them, in lower case.
ALIASES = {
    "line": "polyline",
    "tri": "triangle",
    "tri_6": "triangle_6",
    "quad": "quadrilateral",
    "quad_8": "quadrilateral_8",
    "quad_9": "quadrilateral_9",
    "tet": "tetrahedron",
    "tet_10": "tetrahedron_10",
    "pyra": "pyramid",
    "hex": "hexahedron",
    "hex_20": "hexahedron_20",
    "hex_27": "hexahedron_27",
}

OF_TYPE = {kind.type: kind for kind in XDMF_TYPES}
OF_NAME = {kind.name.lower(): kind for kind in XDMF_TYPES}
OF_NUMBER = {kind.number: kind for kind in XDMF_TYPES}
