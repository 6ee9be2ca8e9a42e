"""Table of formats, one row each, and the detection of a file's format.

The content decides, and the suffix where the content is that of several formats: .mail, .inp and those of meshio may
begin with anything. tests/formats/test_formats_table.py has what each format keeps of a mesh.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from lacmesh.errors import ReadError, RequestError, did_you_mean
from lacmesh.mesh import Mesh

#: how many of a file's bytes are looked at
HEAD = 4096
#: how to read what gmsh reads and lacmesh does not
GMSH_CAN = "gmsh makes a .msh of it: gmsh -0 FILE -o mesh.msh"
_MESHIO = "lacmesh.formats.by_meshio"
_HDF5 = b"\x89HDF\r\n\x1a\n"
#: a comment of Nastran and Permas, which begins as a msh file does
_COMMENT = rb"\$(?!(?:(?s:.*)\$)?MeshFormat)"
_MAIL = rb"(?:%[^\n]*\n\s*)*(?:TITRE|COOR_[123]D|GROUP_(?:NO|MA)|(?:POI|SEG|TRIA|QUAD|TETRA|PYRAM|PENTA|HEXA)\d+)\b"
#: Beginnings of what lacmesh does not read: the sentence's end.
_FOREIGN = (
    (b"CDF\x01", "a netCDF file"),
    (b"CDF\x02", "a netCDF file"),
    (b"PK\x03\x04", "a zip archive"),
    (b"\x1f\x8b", "a file packed by gzip"),
    (b"ISO-10303-21", "a STEP file, which is geometry: lacmesh mesh makes a mesh of it"),
    (b"%PDF", "a PDF file"),
    (b"MFEM ", "a mesh of MFEM, which is not read; Mesh::PrintVTU of MFEM saves it as .vtu"),
    (b"-1\n", f"a universal file (.unv), which is not read; {GMSH_CAN}"),
    (b"-1\r\n", f"a universal file (.unv), which is not read; {GMSH_CAN}"),
)
#: Elements that VTK's XML files hold, and what can be done.
_VTK = {
    b"Collection": "is a collection of VTU files (.pvd); read one of them: {files}",
    b"PUnstructuredGrid": "is a list of the pieces of a mesh (.pvtu); read one of them: {files}",
}
#: Names at the root of an HDF5 file, or of its attributes, that are of no format here.
_FOREIGN_HDF5 = {
    "lacmesh_id": "holds the arrays of an XDMF file; read the .xdmf file beside it",
    "VTKHDF": "is a VTKHDF file, which is not read; save it as .vtu",
    "CGNSLibraryVersion": "is a CGNS file, which is not read; gmsh makes a .msh of it",
}


@dataclass(frozen=True)
class Format:
    """A format: its `name`, its `title` for people, its suffixes (the first is the usual one), its `module`.

    `begins`: regular expression of the bytes that its files begin with, after blanks; `sure`: this tells the format
    whatever the suffix is. `hdf5`: names at the root of its HDF5 files. `options`: keywords that its `write` takes.
    `several`: a file may hold several meshes. `beside`: the suffix of a second file beside the first.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    module: str
    begins: bytes = b""
    sure: bool = True
    hdf5: frozenset[str] | None = None
    options: tuple[str, ...] = ()
    several: bool = False
    beside: str = ""

    @property
    def meshio(self) -> bool:
        """True if meshio reads and writes it."""
        return self.module == _MESHIO

    def read(self, path: Path, mesh: str | None = None) -> Mesh:
        """Read one file; `mesh`: a name, for a format of several meshes."""
        module = import_module(self.module)
        if self.meshio:
            return module.read(path, self.name)
        return module.read(path, mesh) if self.several else module.read(path)

    def write(self, path: Path, mesh: Mesh, **options: Any) -> None:
        """Write a mesh to one file."""
        module = import_module(self.module)
        if self.meshio:
            module.write(path, mesh, name=self.name)
        else:
            module.write(path, mesh, **options)


def _ours(name: str, title: str, suffixes: str, **more: Any) -> Format:
    return Format(name, title, tuple(suffixes.split()), f"lacmesh.formats.{name}", **more)


def _by_meshio(name: str, suffixes: str, **more: Any) -> Format:
    return Format(name, f"{name}, by meshio", tuple(suffixes.split()), _MESHIO, **more)


FORMATS = (
    _ours("msh", "msh", ".msh", begins=rb"\$", options=("msh", "binary")),
    _ours("med", "MED", ".med .rmed .mmed", hdf5=frozenset({"INFOS_GENERALES", "ENS_MAA"}), several=True),
    _ours("mail", "code_aster .mail", ".mail", begins=_MAIL, sure=False),
    _ours(
        "inp",
        ".inp of CalculiX and Abaqus",
        ".inp",
        begins=rb"\*[ \t]*[A-Za-z*]",
        sure=False,
        options=("target", "plane", "all_cells", "lenient"),
    ),
    _ours(
        "vtu",
        "VTU",
        ".vtu",
        begins=rb"(?=<)(?s:.*?)<VTKFile\b[^>]*?\btype\s*=\s*[\"'](?P<type>\w+)[\"']",
        options=("binary", "compress"),
    ),
    _ours(
        "xdmf",
        "XDMF",
        ".xdmf .xmf",
        begins=rb"(?=<)(?s:.*?)<Xdmf\b",
        options=("binary", "compress"),
        several=True,
        beside=".h5",
    ),
    _by_meshio("flac3d", ".f3grid"),
    _by_meshio("mdpa", ".mdpa"),
    _by_meshio("ply", ".ply"),
    _by_meshio("stl", ".stl", begins=b"solid ", sure=False),
    _by_meshio("vtk", ".vtk", begins=b"# vtk DataFile"),
    _by_meshio("h5m", ".h5m", hdf5=frozenset({"tstt"})),
    _by_meshio("avsucd", ".avs"),
    _by_meshio("dolfin-xml", ".xml", begins=rb"(?=<)(?s:.*?)<dolfin\b"),
    _by_meshio("exodus", ".e .exo .ex2", begins=rb"CDF[\x01\x02]", sure=False, hdf5=frozenset()),
    _by_meshio("hmf", ".hmf", hdf5=frozenset()),
    _by_meshio("medit", ".mesh .meshb"),
    _by_meshio("nastran", ".bdf .fem .nas", begins=_COMMENT, sure=False),
    _by_meshio("netgen", ".vol .vol.gz", begins=rb"\x1f\x8b", sure=False),
    _by_meshio("obj", ".obj"),
    _by_meshio("off", ".off"),
    _by_meshio("permas", ".post .dato", begins=_COMMENT, sure=False),
    _by_meshio("su2", ".su2"),
    _by_meshio("tecplot", ".dat .tec"),
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


class DetectedFormat(NamedTuple):
    """Coding of a mesh file: its format, for msh the version (4.1 or 2.2), and whether it is binary.

    `binary` is False only for the text form of a format that has a binary form too: msh, VTU and XDMF.
    """

    format: str
    version: str = ""
    binary: bool = True


def sniff(path: Path, head: bytes) -> DetectedFormat:
    """Detect the format of a file that begins with `head`. Raises ReadError."""
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    named = SUFFIXES.get(suffix_of(path), "")
    if head.startswith(_HDF5):
        return DetectedFormat(_in_hdf5(path, named))
    if not text.strip():
        raise ReadError(path, "is empty")
    begun = [form.name for form in FORMATS if form.begins and re.match(form.begins, text)]
    name = named if named in begun else _by_content(path, text, begun, named)
    if name == "vtu":
        return DetectedFormat(name, binary=_binary_vtu(path, text))
    return DetectedFormat(name, binary=name != "xdmf" or b'Format="XML"' not in text)


def _by_content(path: Path, text: bytes, begun: list[str], named: str) -> str:
    """Choose among the formats that a text begins as, where that of its suffix is none of them."""
    for begin, what in _FOREIGN:
        if text.startswith(begin):
            raise ReadError(path, f"is {what}")
    sure = [name for name in begun if OF_NAME[name].sure]
    if sure:
        return sure[0]
    if text.startswith(b"<") and named in ("vtu", "xdmf", "dolfin-xml"):
        raise ReadError(path, "is XML, but neither VTU (<VTKFile>) nor XDMF (<Xdmf>)")
    if named and OF_NAME[named].meshio:
        return named
    if begun:
        return begun[0]
    if named in ("mail", "inp"):
        return named
    raise ReadError(
        path,
        "is neither a gmsh msh file ($MeshFormat) nor a MED file (HDF5), nor VTU, XDMF, .mail or .inp; "
        "formats of meshio are known by their suffix",
    )


def _binary_vtu(path: Path, text: bytes) -> bool:
    """True if a file of VTK is not ASCII. Raises ReadError where it is a list of files."""
    with path.open("rb") as file:
        begin = file.read(1 << 16)
    root = re.match(OF_NAME["vtu"].begins, text)
    if root and root["type"] in _VTK:
        files = [n.decode("utf-8", "replace") for n in re.findall(rb"(?:file|Source)\s*=\s*[\"']([^\"']+)[\"']", begin)]
        listed = ", ".join(files[:4]) + (" ..." if len(files) > 4 else "")
        raise ReadError(path, _VTK[root["type"]].format(files=listed or "it names none"))
    return b'format="ascii"' not in begin or b"<AppendedData" in begin


def _in_hdf5(path: Path, named: str) -> str:
    """Detect the format of an HDF5 file by the names at its root, else by its suffix. Raises ReadError."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            names = {*file, *file.attrs}
    except (OSError, RuntimeError, ValueError, KeyError):
        return "med"  # its reader says what is wrong
    for form in FORMATS:
        if form.hdf5 and form.hdf5 & names:
            return form.name
    for name, message in _FOREIGN_HDF5.items():
        if name in names:
            raise ReadError(path, message)
    return named if named and OF_NAME[named].hdf5 is not None else "med"
