"""Table of formats, one row each: its name and suffixes, what a file of it begins with, its module, what it keeps.

A module of a format has `read(path)` and `write(path, mesh, options)` and is imported when it is used; formats that
meshio reads and writes share one. tests/formats/test_formats_table.py proves every row: files are recognised by their
content, and a feature of a mesh is kept silently, or lost with a LacmeshWarning that names it, or a mesh that has it is
refused with a WriteError. The tables of docs/formats.md are made from this one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from lacmesh.cells import CELLS
from lacmesh.errors import RequestError, did_you_mean
from lacmesh.mesh import Mesh

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
class WriteOptions:
    """Options of `lacmesh.formats.write`, as given there; each is for some formats only (`Format.options`).

    `second`: a new file for the arrays of a format of two files, and the name that it will have.
    """

    msh: str | None = None
    binary: bool | None = None
    compress: bool = False
    target: str | None = None
    plane: str | None = None
    all_cells: bool = False
    lenient: bool = False
    second: tuple[Path, str] | None = None

    @property
    def in_binary(self) -> bool:
        """True if a format that has both forms is written as binary, which is the default."""
        return self.binary is None or self.binary


DEFAULT = WriteOptions()


class Fidelity(NamedTuple):
    """Fidelity of a format with some `options`: the cell types that it `takes`, the features `lost` or `refused`.

    `by_type`: the order of cells is kept BY_TYPE. `ours`: features and cell types that are OURS; `beside`: features
    that are BESIDE. Nothing else changes what is kept: neither binary files nor compressed ones.
    """

    title: str
    takes: frozenset[str]
    lost: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()
    by_type: bool = False
    ours: frozenset[str] = frozenset()
    beside: frozenset[str] = frozenset()
    options: Mapping[str, Any] = {}

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


@dataclass(frozen=True)
class Format:
    """A format: its `name`, its `title` for people, its suffixes (the first is the usual one), its `module`.

    `fidelity`: what it keeps, for each of its kinds. `begins`: regular expression of the bytes that its files begin
    with, after blanks; `sure`: this tells the format whatever the suffix is. `hdf5`: names at the root of its HDF5
    files. `options`: those of the WriteOptions that it takes. `several`: a file may hold several meshes. `beside`: the
    suffix of a second file beside the first. `sidecar`: the records of a cut go to a file beside it (`sidecar.py`)
    where it does not keep them itself.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    module: str
    fidelity: tuple[Fidelity, ...]
    begins: bytes = b""
    sure: bool = True
    hdf5: frozenset[str] | None = None
    options: tuple[str, ...] = ()
    several: bool = False
    beside: str = ""
    sidecar: bool = False

    @property
    def meshio(self) -> bool:
        """True if meshio reads and writes it."""
        return self.module == _MESHIO

    def read(self, path: Path, mesh: str | None = None) -> Mesh:
        """Read one file, without its sidecar; `mesh`: a name, for a format of several meshes."""
        module = import_module(self.module)
        if self.meshio:
            return module.read(path, self.name)
        return module.read(path, mesh) if self.several else module.read(path)

    def write(self, path: Path, mesh: Mesh, options: WriteOptions) -> None:
        """Write a mesh to one file, without its sidecar."""
        import_module(self.module).write(path, mesh, options)


_MESHIO = "lacmesh.formats.by_meshio"
#: A comment of Nastran and Permas, which begins as a msh file does.
_COMMENT = rb"\$(?!(?:(?s:.*)\$)?MeshFormat)"


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


def _own(name: str, title: str, suffixes: str, *fidelity: Fidelity, **more: Any) -> Format:
    return Format(name, title, tuple(suffixes.split()), f"lacmesh.formats.{name}", fidelity, **more)


def _by_meshio(name: str, suffixes: str, fidelity: Fidelity, **more: Any) -> Format:
    title = f"{name}, by meshio"
    return Format(name, title, tuple(suffixes.split()), _MESHIO, (fidelity,), sidecar=True, **more)


def _cells(
    name: str, suffixes: str, takes: str, *, keeps: str = "", loses: str = "flat", refuses: str = "", **more: Any
) -> Format:
    """Row of a meshio format of cells of one type, which keeps these and the features `keeps`."""
    lost = _CELLS_ONLY - _MIXED | _set(loses)
    kept = Fidelity(name, _set(takes), lost - _set(keeps), _set(refuses) | _MIXED)
    return _by_meshio(name, suffixes, kept, **more)


def _mixed_cells(name: str, suffixes: str, takes: str, loses: str = "flat", **more: Any) -> Format:
    """Row of a meshio format that keeps cells of several types in one mesh, and nothing else."""
    lost = _CELLS_ONLY | _MIXED - _CUT - {"loose_skin"} | _set(loses)
    return _by_meshio(name, suffixes, Fidelity(name, _set(takes), lost, beside=_CUT), **more)


FORMATS = (
    _own(
        "msh",
        "msh",
        ".msh",
        Fidelity("msh 4.1", _but(""), by_type=True, ours=_set("TRIA7 partition")),
        Fidelity("msh 2.2", _but(""), ours=_set("TRIA7"), options={"msh": "2.2"}),
        begins=rb"\$",
        options=("msh", "binary"),
    ),
    _own(
        "med",
        "MED",
        ".med .rmed .mmed",
        Fidelity("MED", _but("PYRAM14"), by_type=True),
        hdf5=_set("INFOS_GENERALES ENS_MAA"),
        several=True,
    ),
    _own(
        "mail",
        "code_aster .mail",
        ".mail",
        Fidelity(".mail", _but("PYRAM14"), _FIELDS | _set("names long"), by_type=True, beside=_CUT),
        begins=rb"(?:%[^\n]*\n\s*)*(?:TITRE|COOR_[123]D|GROUP_(?:NO|MA)|(?:POI|SEG|TRIA|QUAD|TETRA|PYRAM|PENTA|HEXA)\d+)\b",
        sure=False,
        sidecar=True,
    ),
    _own(
        "inp",
        ".inp of CalculiX and Abaqus",
        ".inp",
        Fidelity(
            ".inp for CalculiX",
            _but("TRIA7 QUAD9 HEXA27 PENTA18 PYRAM5 PYRAM13 PYRAM14"),
            _FIELDS | _set("loose_skin empty names long"),
            by_type=True,
            beside=_CUT,
        ),
        Fidelity(
            ".inp for Abaqus",
            _but("TRIA7 PYRAM13 PYRAM14"),
            _FIELDS | _set("loose_skin empty names"),
            by_type=True,
            beside=_CUT,
            options={"target": "abaqus"},
        ),
        begins=rb"\*[ \t]*[A-Za-z*]",
        sure=False,
        options=("target", "plane", "all_cells", "lenient"),
        sidecar=True,
    ),
    _own(
        "vtu",
        "VTU",
        ".vtu",
        Fidelity("VTU", _but("PYRAM14")),
        begins=rb"(?=<)(?s:.*?)<VTKFile\b[^>]*?\btype\s*=\s*[\"'](?P<type>\w+)[\"']",
        options=("binary", "compress"),
    ),
    _own(
        "xdmf",
        "XDMF",
        ".xdmf .xmf",
        Fidelity("XDMF", _but("TRIA7 PYRAM14")),
        begins=rb"(?=<)(?s:.*?)<Xdmf\b",
        options=("binary", "compress"),
        several=True,
        beside=".h5",
    ),
    _cells("flac3d", ".f3grid", "TETRA4 HEXA8 PYRAM5", loses="", refuses="plane flat turn"),
    _mixed_cells("mdpa", ".mdpa", "POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6"),
    _cells("ply", ".ply", "POI1 SEG2 TRIA3 QUAD4"),
    _cells("stl", ".stl", "TRIA3", loses="flat orphan", begins=b"solid ", sure=False),
    _by_meshio(
        "vtk",
        ".vtk",
        Fidelity(
            "vtk",
            _but("TRIA7 PENTA15 PYRAM13 PYRAM14"),
            _set("order steps flat name periodic tags"),
            beside=_set("zones"),
        ),
        begins=b"# vtk DataFile",
    ),
    _mixed_cells("h5m", ".h5m", "SEG2 TRIA3 TETRA4", hdf5=_set("tstt")),
    _cells(
        "avsucd",
        ".avs",
        "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5",
        keeps="node_number cell_number field vector gap entity",
    ),
    _cells("dolfin-xml", ".xml", "TRIA3 TETRA4", begins=rb"(?=<)(?s:.*?)<dolfin\b"),
    _mixed_cells(
        "exodus",
        ".e .exo .ex2",
        "POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5",
        begins=rb"CDF[\x01\x02]",
        sure=False,
        hdf5=_set(""),
    ),
    _by_meshio("hmf", ".hmf", Fidelity("hmf", _LINEAR, _set("names long steps flat tags name"), _MIXED), hdf5=_set("")),
    _mixed_cells("medit", ".mesh .meshb", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5"),
    _mixed_cells("nastran", ".bdf .fem .nas", "TRIA3 TETRA4 PENTA6", loses="flat digits", begins=_COMMENT, sure=False),
    _mixed_cells(
        "netgen", ".vol .vol.gz", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5", begins=rb"\x1f\x8b", sure=False
    ),
    _cells("obj", ".obj", "TRIA3 QUAD4"),
    _cells("off", ".off", "TRIA3"),
    _mixed_cells(
        "permas", ".post .dato", "POI1 SEG2 TRIA3 QUAD4 TETRA4 HEXA8 PENTA6 PYRAM5", begins=_COMMENT, sure=False
    ),
    _cells("su2", ".su2", "TETRA4 HEXA8 PENTA6 PYRAM5", loses="", refuses="plane flat"),
    _cells("tecplot", ".dat .tec", "SEG2 TRIA3 QUAD4 TETRA4 HEXA8", keeps="node_number cell_number field gap"),
)
OF_NAME = {form.name: form for form in FORMATS}
#: suffix -> name of the format
SUFFIXES = {suffix: form.name for form in FORMATS for suffix in form.suffixes}


def takers(option: str) -> list[Format]:
    """The formats that take an option.

    >>> [form.title for form in takers("compress")]
    ['VTU', 'XDMF']
    """
    return [form for form in FORMATS if option in form.options]


def suffix_of(path: Path) -> str:
    """Suffix of a path that selects a format, double ones such as `.vol.gz` included; else its last."""
    double = "".join(path.suffixes[-2:]).lower()
    return double if double in SUFFIXES else path.suffix.lower()


def format_of(path: Path) -> Format:
    """Format that the suffix of `path` selects. Raises RequestError."""
    suffix = suffix_of(path)
    if suffix not in SUFFIXES:
        raise RequestError(f"{path}: no format has the suffix {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    return OF_NAME[SUFFIXES[suffix]]
