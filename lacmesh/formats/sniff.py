"""Detection of a file's format by its first bytes, or by its suffix if these do not tell.

The content decides: a .msh file that holds VTU is read as VTU. Plain-text formats that may begin with anything (.mail,
.inp, those of meshio) are recognised by their suffix; for .mail and .inp the content is checked too.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from lacmesh.errors import ReadError
from lacmesh.formats.table import OF_MESHIO, OWN, SUFFIXES, suffix_of

_HDF5 = b"\x89HDF\r\n\x1a\n"
#: how many of a file's bytes are looked at
HEAD = 4096
#: Beginnings of formats that lacmesh does not read by itself: the sentence's end.
_FOREIGN = (
    (b"CDF\x01", "a netCDF file"),
    (b"CDF\x02", "a netCDF file"),
    (b"PK\x03\x04", "a zip archive"),
    (b"\x1f\x8b", "a file packed by gzip"),
    (b"ISO-10303-21", "a STEP file, which is geometry: lacmesh mesh makes a mesh of it"),
    (b"%PDF", "a PDF file"),
)
#: Elements that VTK's XML files hold, and what can be done.
_VTK = {
    "Collection": "is a collection of VTU files (.pvd); read one of them: {files}",
    "PUnstructuredGrid": "is a list of the pieces of a mesh (.pvtu); read one of them: {files}",
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
    suffix = suffix_of(path)
    if head.startswith(_HDF5):
        return DetectedFormat(_in_hdf5(path, suffix))
    if text.startswith(b"$") and (suffix not in OF_MESHIO or b"$MeshFormat" in head):  # $ begins a comment of Nastran
        return DetectedFormat("msh")
    if text.startswith(b"<"):
        detected = _in_xml(path, text, suffix)
        if detected:
            return detected
    if not text.strip():
        raise ReadError(path, "is empty")
    for begin, what in _FOREIGN:
        if head.startswith(begin) and SUFFIXES.get(suffix) not in ("exodus", "netgen"):
            raise ReadError(path, f"is {what}")
    if text.startswith(b"# vtk DataFile"):
        return DetectedFormat("vtk")
    if text.startswith(b"solid ") and suffix not in SUFFIXES:
        return DetectedFormat("stl")
    return _by_suffix(path, text, suffix)


def _by_suffix(path: Path, text: bytes, suffix: str) -> DetectedFormat:
    """Detect a plain-text format: that of the suffix, if the text may be of it, else the one the text looks like."""
    from lacmesh.formats import inp, mail

    begins: dict[str, Callable[[bytes], bool]] = {"mail": mail.begins, "inp": inp.begins}
    name = SUFFIXES.get(suffix)
    if name in begins:
        other = "inp" if name == "mail" else "mail"
        if not begins[name](text) and begins[other](text):
            return DetectedFormat(other)
        return DetectedFormat(name)
    if name is not None and name not in {f.name for f in OWN}:
        return DetectedFormat(name)
    if mail.begins(text):
        return DetectedFormat("mail")
    if text.startswith(b"*") and inp.begins(text):
        return DetectedFormat("inp")
    raise ReadError(
        path,
        "is neither a gmsh msh file ($MeshFormat) nor a MED file (HDF5), nor VTU, XDMF, .mail or .inp; "
        "formats of meshio are known by their suffix",
    )


def _in_xml(path: Path, text: bytes, suffix: str) -> DetectedFormat | None:
    """Detect the format of an XML file; None if the suffix may tell it. Raises ReadError."""
    root = re.search(rb"<VTKFile\b[^>]*?\btype\s*=\s*[\"'](\w+)[\"']", text)
    if root:
        vtk_type = root[1].decode()
        if vtk_type in _VTK:
            raise ReadError(path, _VTK[vtk_type].format(files=_listed(path) or "it names none"))
        return DetectedFormat("vtu", binary=_binary_vtu(path))
    if re.search(rb"<Xdmf\b", text):
        return DetectedFormat("xdmf", binary=b'Format="XML"' not in text)
    if re.search(rb"<dolfin\b", text):
        return DetectedFormat("dolfin-xml")
    if suffix in (".vtu", ".xdmf", ".xmf", ".xml"):
        raise ReadError(path, "is XML, but neither VTU (<VTKFile>) nor XDMF (<Xdmf>)")
    return None


def _binary_vtu(path: Path) -> bool:
    with path.open("rb") as file:
        return b'format="ascii"' not in file.read(1 << 16) or b"<AppendedData" in file.read()


def _listed(path: Path) -> str:
    with path.open("rb") as file:
        names = re.findall(rb"(?:file|Source)\s*=\s*[\"']([^\"']+)[\"']", file.read(1 << 16))
    return ", ".join(n.decode("utf-8", "replace") for n in names[:4]) + (" ..." if len(names) > 4 else "")


def _in_hdf5(path: Path, suffix: str) -> str:
    """Detect the format of an HDF5 file by the names at its root, else by its suffix. Raises ReadError."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            names, marks = set(file), set(file.attrs)
    except (OSError, RuntimeError, ValueError, KeyError):
        return "med"  # its reader says what is wrong
    if "INFOS_GENERALES" in names or "ENS_MAA" in names:
        return "med"
    if "lacmesh_id" in marks:
        raise ReadError(path, "holds the arrays of an XDMF file; read the .xdmf file beside it")
    if "VTKHDF" in names:
        raise ReadError(path, "is a VTKHDF file, which is not read; save it as .vtu")
    if "CGNSLibraryVersion" in names:
        raise ReadError(path, "is a CGNS file, which is not read; gmsh makes a .msh of it")
    if "tstt" in names:
        return "h5m"
    name = SUFFIXES.get(suffix, "med")
    return name if name in ("hmf", "h5m", "exodus") else "med"
