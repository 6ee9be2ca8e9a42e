"""What each format keeps of a mesh: the table of docs/formats.md, which tests/formats/test_formats_table.py proves.

A feature is kept, or lost and named in a LacmeshWarning, or the mesh that has it is refused with a WriteError.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from lacmesh.cells import CELLS

#: key -> what a mesh may have
FEATURES: Mapping[str, str] = {
    "group": "groups of cells",
    "overlap": "groups that overlap",
    "lower": "groups of skin",
    "dims": "groups of several dimensions",
    "empty": "empty groups",
    "loose": "cells in no group",
    "nodes": "groups of nodes",
    "names": "names with blanks and accents",
    "long": "names of 60 characters",
    "orphan": "nodes of no cell",
    "node_number": "numbers of nodes",
    "cell_number": "numbers of cells",
    "order": "order of cells of several types",
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
    "tags": "tags of groups",
    "name": "the mesh's name",
    "digits": "every digit of coordinates",
}

KEPT, LOST, REFUSED, BY_TYPE = "kept", "lost", "refused", "by type"


@dataclass(frozen=True)
class Row:
    """A format and its options: features that are `lost`, those that are `refused`, the types of cells it `takes`.

    `by_type`: cells stand together by type in the file, without a word, since their numbers tell the order.
    """

    title: str
    format: str
    lost: frozenset[str]
    refused: frozenset[str]
    takes: frozenset[str]
    by_type: bool = False
    options: Mapping[str, str] = field(default_factory=dict)

    def keeps(self, feature: str) -> str:
        """KEPT, LOST, REFUSED, or BY_TYPE."""
        if feature == "order" and self.by_type:
            return BY_TYPE
        return LOST if feature in self.lost else REFUSED if feature in self.refused else KEPT


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


def _but(words: str) -> frozenset[str]:
    return frozenset(CELLS) - _set(words)


_ALL = _but("")
_LINEAR = _set("POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5")
_FIELDS = _set("field vector gap integer steps cut zones partition")
_MSH_ONLY = _set("periodic tags")
#: What is lost where nothing but the cells of a mesh is kept.
_CELLS_ONLY = _FIELDS | _MSH_ONLY | _set("group overlap empty nodes names long node_number cell_number name")
_MIXED = _set("lower dims order cut zones periodic")

ROWS = (
    Row("msh 4.1", "msh", _set(""), _set(""), _ALL, by_type=True),
    Row("msh 2.2", "msh", _set(""), _set(""), _ALL, options={"msh": "2.2"}),
    Row("MED", "med", _set(""), _set(""), _but("PYRAM14"), by_type=True),
    Row(".mail", "mail", _FIELDS | _MSH_ONLY | _set("names long"), _set(""), _but("PYRAM14"), by_type=True),
    Row(
        ".inp for CalculiX",
        "inp",
        _FIELDS | _MSH_ONLY | _set("empty names long"),
        _set(""),
        _but("TRIA7 QUAD9 HEXA27 PENTA18 PYRAM5 PYRAM13 PYRAM14"),
        by_type=True,
    ),
    Row(
        ".inp for Abaqus",
        "inp",
        _FIELDS | _MSH_ONLY | _set("empty names"),
        _set(""),
        _but("TRIA7 PYRAM13 PYRAM14"),
        by_type=True,
        options={"target": "abaqus"},
    ),
    Row("VTU", "vtu", _set(""), _set(""), _but("PYRAM14")),
    Row("XDMF", "xdmf", _set(""), _set(""), _but("TRIA7 PYRAM14")),
    Row(
        "vtk",
        "vtk",
        _MSH_ONLY | _set("names long order steps zones flat name"),
        _set(""),
        _but("TRIA7 PENTA15 PYRAM13 PYRAM14"),
    ),
    Row("hmf", "hmf", _set("names long steps flat tags name"), _MIXED, _LINEAR),
    Row(
        "tecplot",
        "tecplot",
        _CELLS_ONLY - _MIXED - _set("node_number cell_number field gap") | _set("flat"),
        _MIXED,
        _LINEAR - _set("POI1 PENTA6 PYRAM5"),
    ),
    Row(
        "avsucd",
        "avsucd",
        _CELLS_ONLY - _MIXED - _set("node_number cell_number field vector gap") | _set("flat"),
        _MIXED,
        _LINEAR - _set("POI1"),
    ),
    Row("exodus", "exodus", _CELLS_ONLY | _MIXED | _set("flat"), _set(""), _LINEAR),
    Row("mdpa", "mdpa", _CELLS_ONLY | _MIXED | _set("flat"), _set(""), _LINEAR - _set("PYRAM5")),
    Row("medit", "medit", _CELLS_ONLY | _MIXED | _set("flat"), _set(""), _LINEAR - _set("POI1")),
    Row("nastran", "nastran", _CELLS_ONLY | _MIXED | _set("flat digits"), _set(""), _set("TRIA3 TETRA4 PENTA6")),
    Row("netgen", "netgen", _CELLS_ONLY | _MIXED | _set("flat"), _set(""), _LINEAR - _set("POI1")),
    Row("permas", "permas", _CELLS_ONLY | _MIXED | _set("flat"), _set(""), _LINEAR),
    Row("h5m", "h5m", _CELLS_ONLY | _MIXED | _set("flat"), _set(""), _set("SEG2 TRIA3 TETRA4")),
    Row("cgns", "cgns", _CELLS_ONLY - _MIXED, _MIXED | _set("plane flat"), _set("TETRA4")),
    Row("dolfin-xml", "dolfin-xml", _CELLS_ONLY - _MIXED | _set("flat"), _MIXED, _set("TRIA3 TETRA4")),
    Row("flac3d", "flac3d", _CELLS_ONLY - _MIXED, _MIXED | _set("plane flat"), _set("TETRA4 HEXA8 PYRAM5")),
    Row("su2", "su2", _CELLS_ONLY - _MIXED, _MIXED | _set("plane flat"), _set("TETRA4 HEXA8 PENTA6 PYRAM5")),
    Row("ply", "ply", _CELLS_ONLY - _MIXED | _set("flat"), _MIXED, _set("POI1 SEG2 TRIA3 QUAD4")),
    Row("stl", "stl", _CELLS_ONLY - _MIXED | _set("flat orphan"), _MIXED, _set("TRIA3")),
    Row("obj", "obj", _CELLS_ONLY - _MIXED | _set("flat"), _MIXED, _set("TRIA3 QUAD4")),
    Row("off", "off", _CELLS_ONLY - _MIXED | _set("flat"), _MIXED, _set("TRIA3")),
)
