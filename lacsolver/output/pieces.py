"""A VTU file of each process, and a PVTU file that names them all, for ParaView."""

from __future__ import annotations

import re
from pathlib import Path
from xml.sax.saxutils import quoteattr

from lacmesh.formats import write
from lacmesh.formats.output import replace_file
from lacmesh.mesh import Mesh
from lacsolver.distributed.share import Share
from lacsolver.output.names import vtu_file

_SECTION = re.compile(r"<(PointData|CellData|Points)>(.*?)</\1>", re.DOTALL)
_ARRAY = re.compile(r"<DataArray (.*?) format=")
#: bytes in which the names of all arrays stand, before their values
_HEAD = 1 << 20


def write_pieces(folder: Path, stem: str, number: int, mesh: Mesh, share: Share) -> str:
    """Write the piece of each process and, once all are there, the PVTU file; return its name, as a PVD has it.

    The pieces have the same arrays. Raises WriteError.
    """
    own = folder / vtu_file(stem, number, share.rank)
    failed: Exception | None = None
    try:
        write(own, mesh, compress=True)
    except Exception as error:
        failed = error
    share.agree(failed)
    file = str(Path(vtu_file(stem, number)).with_suffix(".pvtu"))
    names = [Path(vtu_file(stem, number, rank)).name for rank in range(share.size)]
    share.on_first(lambda: replace_file(folder / file, _collection(own, names).encode()))
    return file


def _collection(piece: Path, names: list[str]) -> str:
    """Return the text of a PVTU file for pieces with the arrays of one of them."""
    with piece.open("rb") as file:
        head = file.read(_HEAD).split(b"<AppendedData")[0].decode()
    version = re.search(r'version="([0-9.]+)"', head)
    lines = ['<?xml version="1.0" encoding="utf-8"?>']
    lines.append(f'<VTKFile type="PUnstructuredGrid" version="{version[1] if version else "1.0"}">')
    lines.append('<PUnstructuredGrid GhostLevel="0">')
    for section, arrays in _SECTION.findall(head):
        lines += [f"<P{section}>", *(f"<PDataArray {array}/>" for array in _ARRAY.findall(arrays)), f"</P{section}>"]
    lines += [f"<Piece Source={quoteattr(name)}/>" for name in names]
    return "\n".join([*lines, "</PUnstructuredGrid>", "</VTKFile>", ""])
