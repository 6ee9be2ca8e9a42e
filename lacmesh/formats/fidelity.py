"""Features of a mesh that each format keeps: the tables of docs/formats.md.

A feature is kept silently, or lost with a LacmeshWarning that names it, or a mesh that has it is refused with a
WriteError. tests/formats/test_formats_table.py proves every row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lacmesh.cells import CELLS
from lacmesh.formats.table import OF_NAME

#: key -> what a mesh may have
FEATURES: Mapping[str, str] = {
    "group": "groups of cells",
    "overlap": "groups that overlap",
    "lower": "groups of skin",
    "dims": "groups of several dimensions",
    "empty": "empty groups",
    "loose": "cells in no group",
    "loose_skin": "skin in no group",
    "nodes": "groups of nodes",
    "names": "names with blanks and accents",
    "long": "names of 60 characters",
    "orphan": "nodes of no cell",
    "node_number": "numbers of nodes",
    "cell_number": "numbers of cells",
    "order": "order of cells of several types",
    "turn": "how each cell turns",
    "field": "fields",
    "vector": "fields of vectors, tensors",
    "gap": "fields with missing values",
    "integer": "fields of integers",
    "steps": "fields at several times",
    "cut": "the records of a cut",
    "zones": "names of a cut's zones",
    "plane": "two dimensions",
    "flat": "a plane mesh in space",
    "periodic": "periodic links",
    "partition": "partitions",
    "entity": "entities of gmsh",
    "tags": "tags of groups",
    "name": "the mesh's name",
    "digits": "every digit of coordinates",
}

KEPT, LOST, REFUSED = "yes", "lost", "error"
#: Cells stand together by type in the file, without a word, since their numbers tell the order.
BY_TYPE = "by type"
#: Kept where only lacmesh reads it again, which a LacmeshWarning says.
OURS = "for lacmesh"
#: Kept in a file of its own beside the mesh's, `NAME.SUFFIX.lac.json`, without a word.
BESIDE = "beside"


@dataclass(frozen=True)
class Row:
    """A format with its options: the cell types that it `takes`, the features that are `lost` or `refused`.

    `by_type`: the order of cells is kept BY_TYPE. `ours`: features and cell types that are OURS; `beside`: features
    that are BESIDE.
    """

    title: str
    format: str
    takes: frozenset[str]
    lost: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()
    by_type: bool = False
    ours: frozenset[str] = frozenset()
    beside: frozenset[str] = frozenset()
    options: Mapping[str, Any] = field(default_factory=dict)

    def keeps(self, feature: str) -> str:
        """Fate of a feature: KEPT, LOST, REFUSED, BY_TYPE, OURS or BESIDE."""
        if feature == "order" and self.by_type:
            return BY_TYPE
        if feature in self.ours:
            return OURS
        if feature in self.beside:
            return BESIDE
        return LOST if feature in self.lost else REFUSED if feature in self.refused else KEPT

    def keeps_cells(self, cell_type: str) -> str:
        """Fate of a cell type: KEPT, REFUSED or OURS."""
        return OURS if cell_type in self.ours else KEPT if cell_type in self.takes else REFUSED

    @property
    def variants(self) -> list[dict[str, Any]]:
        """Options of `lacmesh.formats.write` for each coding of the file; all codings keep the same features."""
        codings: dict[str, dict[str, Any]] = {"binary": {"binary": False}, "compress": {"compress": True}}
        chosen = [coding for name, coding in codings.items() if name in OF_NAME[self.format].options]
        return [{**self.options, **coding} for coding in ({}, *chosen)]


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


def _but(words: str) -> frozenset[str]:
    return frozenset(CELLS) - _set(words)


_LINEAR = _set("POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5")
#: What a format of cells, nodes and groups alone loses.
_FIELDS = _set("field vector gap integer steps partition entity periodic tags")
#: What such a format has beside it.
_CUT = _set("cut zones")
#: What a format of cells and nodes alone loses.
_CELLS_ONLY = _FIELDS | _set("group overlap empty nodes names long node_number cell_number name")
#: What only meshes of several types of cells have.
_MIXED = _set("lower loose_skin dims order cut zones periodic")


def _by_meshio(
    name: str, takes: str, *, mixed: bool = False, keeps: str = "", loses: str = "flat", refuses: str = ""
) -> Row:
    """Row of a meshio format that keeps cells and the features `keeps`; `mixed`: cells of several types in one mesh."""
    lost = (_CELLS_ONLY | _MIXED - _CUT - {"loose_skin"} if mixed else _CELLS_ONLY - _MIXED) | _set(loses)
    refused = _set(refuses) | (frozenset() if mixed else _MIXED)
    return Row(name, name, _set(takes), lost - _set(keeps), refused, beside=_CUT if mixed else frozenset())


ROWS = (
    Row("msh 4.1", "msh", _but(""), by_type=True, ours=_set("TRIA7 partition")),
    Row("msh 2.2", "msh", _but(""), ours=_set("TRIA7"), options={"msh": "2.2"}),
    Row("MED", "med", _but("PYRAM14"), by_type=True),
    Row(".mail", "mail", _but("PYRAM14"), _FIELDS | _set("names long"), by_type=True, beside=_CUT),
    Row(
        ".inp for CalculiX",
        "inp",
        _but("TRIA7 QUAD9 HEXA27 PENTA18 PYRAM5 PYRAM13 PYRAM14"),
        _FIELDS | _set("loose_skin empty names long"),
        by_type=True,
        beside=_CUT,
    ),
    Row(
        ".inp for Abaqus",
        "inp",
        _but("TRIA7 PYRAM13 PYRAM14"),
        _FIELDS | _set("loose_skin empty names"),
        by_type=True,
        beside=_CUT,
        options={"target": "abaqus"},
    ),
    Row("VTU", "vtu", _but("PYRAM14")),
    Row("XDMF", "xdmf", _but("TRIA7 PYRAM14")),
    Row(
        "vtk",
        "vtk",
        _but("TRIA7 PENTA15 PYRAM13 PYRAM14"),
        _set("order steps flat name periodic tags"),
        beside=_set("zones"),
    ),
    Row("hmf", "hmf", _LINEAR, _set("names long steps flat tags name"), _MIXED),
    _by_meshio("tecplot", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8", keeps="node_number cell_number field gap"),
    _by_meshio(
        "avsucd",
        "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5",
        keeps="node_number cell_number field vector gap entity",
    ),
    _by_meshio("exodus", "POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5", mixed=True),
    _by_meshio("mdpa", "POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6", mixed=True),
    _by_meshio("medit", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5", mixed=True),
    _by_meshio("nastran", "TRIA3 TETRA4 PENTA6", mixed=True, loses="flat digits"),
    _by_meshio("netgen", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5", mixed=True),
    _by_meshio("permas", "POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5", mixed=True),
    _by_meshio("h5m", "SEG2 TRIA3 TETRA4", mixed=True),
    _by_meshio("dolfin-xml", "TRIA3 TETRA4"),
    _by_meshio("flac3d", "TETRA4 HEXA8 PYRAM5", loses="", refuses="plane flat turn"),
    _by_meshio("su2", "TETRA4 HEXA8 PENTA6 PYRAM5", loses="", refuses="plane flat"),
    _by_meshio("ply", "POI1 SEG2 TRIA3 QUAD4"),
    _by_meshio("stl", "TRIA3", loses="flat orphan"),
    _by_meshio("obj", "TRIA3 QUAD4"),
    _by_meshio("off", "TRIA3"),
)
