"""Detection of a file's format by its first bytes, or by its suffix if these do not tell.

The content decides: a .msh file that holds VTU is read as VTU. Plain-text formats that may begin with anything (.mail,
.inp, those of meshio) are recognised by their suffix; for .mail and .inp the content is checked too. What the files of
a format begin with is in the table (`Format.begins`, `Format.hdf5`).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from lacmesh.errors import ReadError
from lacmesh.formats.table import FORMATS, OF_NAME, SUFFIXES, suffix_of

_HDF5 = b"\x89HDF\r\n\x1a\n"
#: how to read what gmsh reads and lacmesh does not
GMSH_CAN = "gmsh makes a .msh of it: gmsh -0 FILE -o mesh.msh"
#: how many of a file's bytes are looked at
HEAD = 4096
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
    root = re.match(OF_NAME["vtu"].begins, text)
    if root and root["type"] in _VTK:
        raise ReadError(path, _VTK[root["type"]].format(files=_listed(path) or "it names none"))
    with path.open("rb") as file:
        return b'format="ascii"' not in file.read(1 << 16) or b"<AppendedData" in file.read()


def _listed(path: Path) -> str:
    with path.open("rb") as file:
        names = re.findall(rb"(?:file|Source)\s*=\s*[\"']([^\"']+)[\"']", file.read(1 << 16))
    return ", ".join(n.decode("utf-8", "replace") for n in names[:4]) + (" ..." if len(names) > 4 else "")


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
